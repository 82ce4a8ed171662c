"""The clock of a sender that is synchronised with ours, as by PTP or AUTOSAR's time synchronisation (StbM).

Its sample times are absolute, so the whole delay is age, a delay that is always there too, and a recording is as
old as it is.
"""

from __future__ import annotations

from strainfmu.can.e2e.sample_clock import ClockReader, clock_record


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
        self.record = clock_record(tick, bits, is_synchronised=1, shift=shift, accuracy=accuracy)
        self.range = self.record.range
        self.read = ClockReader(self.record)

    def seconds(self, ticks: int) -> float:
        """Return a sample time [s]."""
        return ticks * self.record.tick

    def reset(self) -> None:
        """Do nothing: there is nothing to forget."""

    accept = anchor = reset
