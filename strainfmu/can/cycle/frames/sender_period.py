"""The period of the sender, measured: limits counted in cycles are wrong where it is not the stated one.

Sample times give it from the median of their differences per step of the counter. Without them it is the mean time
between receptions but for the longest one, since gateways hand cycles over in bunches.
"""

from __future__ import annotations

from math import nan

_INTERVALS = 16
"""Intervals of one measurement; two measurements in a row must be off before the period counts as wrong."""


class SenderPeriod:
    """Measures the period from one judged cycle to the next.

    Parameters
    ----------
    expected : stated period [s].
    tolerance : largest difference from it that counts as none, as a fraction of it.
    tick, bits : unit [s] and length of the sample time; 0 without.
    modulus : number of counter values; 0 without a counter.
    """

    def __init__(self, expected: float, tolerance: float, tick: float, bits: int, modulus: int) -> None:
        self._expected, self._tolerance, self._modulus = expected, tolerance, modulus
        self._tick, self._range = tick, 1 << bits if tick > 0.0 else 0
        self._last: tuple[float, int, int] | None = None
        self._intervals: list[tuple[float, int]] = []
        self._n_wrong = self._n_measured = 0
        self._announced = nan
        self.measured = nan
        """Period of the latest measurement [s], NaN before the second one."""
        self.is_wrong = False
        """It differs from the stated one by more than the tolerance."""
        self.text = ""
        """Both periods in words; it changes only where the measured one does, "" before the second measurement."""

    def forget(self) -> None:
        """Begin a measurement again, after cycles that are not measured."""
        self._last = None
        self._intervals.clear()

    def take(self, time: float, ticks: int, counter: int) -> bool:
        """Take in a cycle received at ``time`` [s]; return whether the period is wrong.

        ``ticks`` is its sample time; ``counter`` is -1 where there is none.
        """
        last, self._last = self._last, (time, ticks, counter)
        if last is None:
            return self.is_wrong
        has_counter = self._modulus > 0 and counter >= 0 and last[2] >= 0
        steps = (counter - last[2]) % self._modulus if has_counter else 1
        passed = time - last[0]
        if self._range:
            forward = (ticks - last[1]) % self._range
            if 2 * forward >= self._range:  # the sender has begun again
                self._intervals.clear()
                return self.is_wrong
            passed = forward * self._tick
        if steps > 0:
            self._intervals.append((passed, steps))
            if len(self._intervals) >= _INTERVALS:
                self._measure()
        return self.is_wrong

    def _measure(self) -> None:
        """Measure the period, compare it with the stated one, and begin again."""
        period = self._median() if self._range else self._mean()
        self._intervals.clear()
        self._n_wrong = self._n_wrong + 1 if self._differs(period, self._expected) else 0
        self._n_measured += 1
        if self._n_measured < 2:
            return
        self.measured = period
        was_wrong, self.is_wrong = self.is_wrong, self._n_wrong >= 2
        has_changed = self.is_wrong and self._differs(period, self._announced)
        if not self.text or was_wrong != self.is_wrong or has_changed:
            self._announced = period
            expected = "" if self.is_wrong else ", as expected"
            stated = f"expected {1e3 * self._expected:.4g} ms, " if self.is_wrong else ""
            self.text = f"period: {stated}measured {1e3 * period:.3g} ms{expected}"

    def _median(self) -> float:
        """Return the median time per step [s]."""
        ranked = sorted(passed / steps for passed, steps in self._intervals)
        return 0.5 * (ranked[_INTERVALS // 2 - 1] + ranked[_INTERVALS // 2])

    def _mean(self) -> float:
        """Return the mean time per step without the longest interval, which may be a pause [s]."""
        kept = sorted(self._intervals)[:-1]
        return sum(passed for passed, _ in kept) / sum(steps for _, steps in kept)

    def _differs(self, period: float, other: float) -> bool:
        return abs(period - other) > self._tolerance * self._expected
