"""The clock of a sender that is synchronised with ours, as by PTP or AUTOSAR's time synchronisation (StbM).

Its sample times are absolute, so the whole delay is age, a delay that is always there too, and a recording is as
old as it is.
"""

from __future__ import annotations

from strainfmu.can.e2e.sample_clock import ClockReading


class SynchronisedClock:
    """Dates samples by the difference of two synchronised clocks.

    Parameters
    ----------
    tick : unit of the sample time [s].
    bits : length of the sample time, which wraps: older than half its range is not distinguished from ahead.
    shift : synchronised time less our monotonic clock [s].
    accuracy : largest difference of the two clocks [s].
    """

    drift_ppm = float("nan")

    def __init__(self, tick: float, bits: int, shift: float, accuracy: float) -> None:
        self._tick, self.range = tick, tick * (1 << bits)
        self._shift, self._accuracy = shift, accuracy

    def read(self, local: float, ticks: int) -> ClockReading:
        """Take in a sample time that arrived at ``local`` on our clock [s]."""
        age = -self.seconds_ahead(local, ticks)
        if age < -self._accuracy:
            return ClockReading(0.0, jumped=True)
        return ClockReading(max(age, 0.0), uncertainty=self._accuracy)

    def seconds_ahead(self, local: float, ticks: int) -> float:
        """Return by how much a sample time is ahead of ours at ``local`` [s]."""
        half = 0.5 * self.range
        return (self.seconds(ticks) - (local + self._shift) + half) % self.range - half

    def seconds(self, ticks: int) -> float:
        """Return a sample time [s]."""
        return ticks * self._tick

    def reset(self) -> None:
        """Do nothing: there is nothing to forget."""

    accept = anchor = reset
