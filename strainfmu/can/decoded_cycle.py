"""A closed cycle decoded: strains of all gauges, which of them are there, and what the sender says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from strainfmu.can.cycle_assembler import Arrival
from strainfmu.can.frame_layout import FLOAT, SIGNED, UNSIGNED, InputFrame, InputLayout
from strainfmu.can.guards import Guards
from strainfmu.can.plausibility import BoolArray
from strainfmu.can.signal_plan import FloatArray, IntArray, SignalPlan

STATUS_DEGRADED = 1
"""The sender's status: 0 good, 1 degraded, above: do not use."""


@dataclass
class DecodedCycle:
    """Strains of one cycle.

    Attributes
    ----------
    strain : (n_d,) [m/m]; NaN where no frame says anything.
    raw : (n_d,) raw numbers.
    present : (n_d,) gauges whose frame is there.
    refused : (n_d,) gauges without a value, or outside their signal's limits.
    status : worst status that the sender gives.
    """

    strain: FloatArray
    raw: IntArray
    present: BoolArray
    refused: BoolArray
    status: int = 0


class StrainDecoder:
    """Decodes the strain frames of a layout."""

    def __init__(self, layout: InputLayout, guards: Guards) -> None:
        self._guards = guards
        self._n_gauges = layout.n_gauges
        self._frames = [_StrainFrame(frame) for frame in layout.strain_frames]

    def empty(self) -> DecodedCycle:
        """Return a cycle without frames."""
        n = self._n_gauges
        absent = np.zeros(n, dtype=bool)
        return DecodedCycle(np.full(n, np.nan), np.zeros(n, dtype=np.int64), absent, absent.copy())

    def decode(self, arrivals: Sequence[Arrival], trailer_status: int) -> DecodedCycle:
        """Return what ``arrivals`` say; ``trailer_status`` is the status that the trailer gives, or 0."""
        cycle = self.empty()
        cycle.status = trailer_status
        for arrival in arrivals:
            frame = self._frames[arrival.slot]
            frame.fill(cycle, arrival.raw, self._guards)
        if cycle.status > STATUS_DEGRADED and self._guards.sender_status:
            cycle.refused |= cycle.present
        return cycle


class _StrainFrame:
    """One strain frame: arrays made once."""

    def __init__(self, frame: InputFrame) -> None:
        signals = [frame.layout.signals[place] for place in frame.places]
        self._status = frame.status
        self._plan = SignalPlan(frame.layout)
        self._places = np.array(frame.places, dtype=np.intp)
        self._gauges = np.array(frame.gauges, dtype=np.intp)
        self._to_strain = np.array(frame.to_strain)
        self._low = np.array([-np.inf if s.minimum is None else s.minimum for s in signals])
        self._high = np.array([np.inf if s.maximum is None else s.maximum for s in signals])
        ends = [_ends(s.kind, s.length) for s in signals]
        self._first = np.array([first for first, _ in ends])
        self._last = np.array([last for _, last in ends])
        self._has_ends = np.array([s.kind != FLOAT and s.length < 64 for s in signals])
        self._none = np.array([s.not_available is not None for s in signals])
        self._not_available = np.array([s.not_available or 0 for s in signals], dtype=np.int64)

    def fill(self, cycle: DecodedCycle, raw: IntArray, guards: Guards) -> None:
        """Put the strains of this frame into ``cycle``."""
        own, gauges = raw[self._places], self._gauges
        value = self._plan.physical(raw)[self._places]
        refused = np.zeros(len(gauges), dtype=bool)
        if guards.not_available:
            refused |= self._none & (own == self._not_available)
        if guards.range:
            refused |= ~((value >= self._low) & (value <= self._high))
            # Both ends of a converter's range mean that it is overdriven, or its wire is broken.
            refused |= self._has_ends & ((own == self._first) | (own == self._last))
        cycle.strain[gauges] = value * self._to_strain
        cycle.raw[gauges] = own
        cycle.present[gauges] = True
        cycle.refused[gauges] = refused
        if self._status is not None:
            cycle.status = max(cycle.status, int(raw[self._status]))


def _ends(kind: str, length: int) -> tuple[int, int]:
    """Return the first and the last raw number of a signal."""
    if kind == SIGNED:
        return -(1 << (length - 1)), (1 << (length - 1)) - 1
    return (0, (1 << length) - 1) if kind == UNSIGNED and length < 64 else (0, 0)
