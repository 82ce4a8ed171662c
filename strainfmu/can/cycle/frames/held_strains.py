"""Strains that come more slowly than cycles: each frame is held until the next one or the end of its time-out.

Where frames have a sample time, it is the time of the cycle's frames: the age of held strains follows from both,
and a repeated old frame is old. Elsewhere it counts from the reception.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray
from strainfmu.can.cycle.frames.assembler import Arrival, Cycle
from strainfmu.can.wire.frame_layout import InputFrame, InputLayout

_ROUND_OFF = 1e-6
"""By how much ages may be above a time-out [s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class WholeCycle:
    """What is held for a cycle.

    Attributes
    ----------
    fresh : (n_d,) gauges that are not in a held frame, or in one that came since the last cycle.
    held : by how much the oldest held strains are older than the cycle's own [s], 0 if none is.
    """

    fresh: BoolArray
    held: float


class HeldStrains:
    """Holds the strain frames of a layout that come more slowly than cycles."""

    def __init__(self, layout: InputLayout) -> None:
        self._n_gauges, self._cycle_time = layout.n_gauges, layout.cycle_time
        self._all = layout.frames
        self._frames: dict[int, InputFrame] = {slot: layout.strain_frames[slot] for slot in layout.held_slots}
        self._gauges = {slot: np.array(frame.gauges) for slot, frame in self._frames.items()}
        self._last: dict[int, Arrival] = {}
        self._new: set[int] = set()
        self._verdict = np.zeros(layout.n_gauges, dtype=bool)

    def take(self, arrival: Arrival) -> None:
        """Hold a frame instead of the last one of its slot."""
        self._last[arrival.slot] = arrival
        self._new.add(arrival.slot)

    def forget(self) -> None:
        """Forget all frames: the sender may have been restarted."""
        self._last.clear()
        self._new.clear()

    def complete(self, cycle: Cycle) -> WholeCycle:
        """Complete ``cycle`` by the frames that are held for it; return what they are."""
        oldest = 0.0
        fresh = np.ones(self._n_gauges, dtype=bool)
        for slot, frame in self._frames.items():
            if slot not in self._new:
                fresh[self._gauges[slot]] = False
            last = self._last.get(slot)
            age = None if last is None else self._age(last, cycle, frame)
            if last is not None and age is not None and age <= (frame.hold or 0.0) + _ROUND_OFF:
                cycle.hold(last)
                oldest = max(oldest, age)
        self._new.clear()
        return WholeCycle(fresh=fresh, held=oldest)

    def verdicts(self, checked: BoolArray, fresh: BoolArray) -> BoolArray:
        """Return (n_d,) which gauges are plausible: ``checked`` where ``fresh``, elsewhere as when they were."""
        self._verdict = np.where(fresh, checked, self._verdict)
        return self._verdict

    def _age(self, held: Arrival, cycle: Cycle, frame: InputFrame) -> float | None:
        """Return by how much a held frame is older than ``cycle`` [s]; None if it is of another time."""
        received = max(cycle.first_time - held.frame.time, 0.0)
        newest = cycle.sample_time if self._all[cycle.slots[0]].sample_time is not None else None
        if frame.sample_time is None or held.sample_time is None or newest is None:
            return received
        half = 1 << (frame.layout.signals[frame.sample_time].length - 1)
        sampled = frame.tick * ((newest - held.sample_time + half) % (2 * half) - half)
        # It may come ahead of the cycle of its own time, whose frames are still on their way.
        return None if sampled < -1.5 * self._cycle_time else max(sampled, received, 0.0)


def held_strains(layout: InputLayout) -> HeldStrains | None:
    """Return what holds the slow strain frames of ``layout``, None if it has none."""
    return HeldStrains(layout) if layout.held_slots else None


def gauge_periods(layout: InputLayout) -> np.ndarray:
    """Return (n_d,) the period of the frame that holds each gauge [s]; the period of cycles but for held ones."""
    periods = np.full(layout.n_gauges, layout.cycle_time)
    for slot in layout.held_slots:
        frame = layout.strain_frames[slot]
        periods[list(frame.gauges)] = frame.layout.cycle_time or layout.cycle_time
    return periods
