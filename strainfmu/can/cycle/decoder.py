"""The decoder of closed cycles: strains of all gauges, which gauges are present, the sender's status."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.can.cycle.assembler import Arrival
from strainfmu.can.wire.frame_layout import FLOAT, SIGNED, UNSIGNED, InputFrame, InputLayout, SignalLayout
from strainfmu.can.wire.signal_plan import SignalPlan, unsigned

STATUS_DEGRADED = 1
"""Sender's status 1; 0 is good, above 1 is not to be used."""


@dataclass(eq=False, kw_only=True)
class DecodedCycle:
    """Strains of one cycle.

    Attributes
    ----------
    strain : (n_d,) [m/m]; NaN where the frame is missing.
    raw : (n_d,) raw numbers.
    present : (n_d,) gauges whose frame has arrived.
    refused : (n_d,) gauges without a value, or outside their signal's limits.
    status : worst status of the sender.
    """

    strain: FloatArray
    raw: IntArray
    present: BoolArray
    refused: BoolArray
    status: int = 0


class StrainDecoder:
    """Decodes the strain frames of a layout: raw numbers frame by frame, then all gauges at once."""

    def __init__(self, layout: InputLayout) -> None:
        frames = layout.strain_frames
        self._n_gauges = layout.n_gauges
        self._nothing = [np.zeros(len(frame.layout.signals), dtype=np.int64) for frame in frames]
        self._status = [frame.status for frame in frames]
        self._plans = [SignalPlan(frame.layout) for frame in frames]
        self._is_linear = [_is_linear(frame) for frame in frames]
        # Position of each gauge in the raw numbers of all frames.
        columns = np.cumsum([0, *(len(raw) for raw in self._nothing)])[:-1].tolist()
        owners = {
            gauge: (slot, index, factor)
            for slot, frame in enumerate(frames)
            for index, gauge, factor in zip(frame.indices, frame.gauges, frame.to_strain, strict=True)
        }
        by_gauge = [owners[gauge] for gauge in range(layout.n_gauges)]
        signals = [frames[slot].layout.signals[index] for slot, index, _ in by_gauge]
        self._slot = np.array([slot for slot, _, _ in by_gauge], dtype=np.intp)
        self._column = np.array([columns[slot] + index for slot, index, _ in by_gauge], dtype=np.intp)
        self._scale = np.array([signal.scale for signal in signals])
        self._offset = np.array([signal.offset for signal in signals])
        self._to_strain = np.array([factor for _, _, factor in by_gauge])
        self._low = np.array([-np.inf if s.minimum is None else s.minimum for s in signals])
        self._high = np.array([np.inf if s.maximum is None else s.maximum for s in signals])
        ends = [converter_ends(signal) for signal in signals]
        self._has_ends = np.array([end is not None for end in ends])
        self._first, self._last = np.array([end or (0, 0) for end in ends], dtype=np.int64).T
        # (m, n_d) codes for "no value"; a gauge with fewer than m of them repeats its last one.
        codes = [signal.no_value_codes for signal in signals]
        self._none = np.array([bool(own) for own in codes])
        rows = [[(own or (0,))[min(row, len(own) - 1)] for own in codes] for row in range(max(map(len, codes)))]
        self._no_value = np.array(rows, dtype=np.int64).reshape(-1, len(signals))

    def empty(self) -> DecodedCycle:
        """Return a cycle without frames."""
        n = self._n_gauges
        absent = np.zeros(n, dtype=bool)
        return DecodedCycle(
            strain=np.full(n, np.nan), raw=np.zeros(n, dtype=np.int64), present=absent, refused=absent.copy()
        )

    def decode(self, arrivals: Sequence[Arrival], trailer_status: int) -> DecodedCycle:
        """Return the decoded ``arrivals`` of a cycle; ``trailer_status`` is the status in the trailer, or 0."""
        raws, status = list(self._nothing), self._worst_status(arrivals, trailer_status)
        for arrival in arrivals:
            raws[arrival.slot] = arrival.raw
        raw = np.concatenate(raws)[self._column]
        value = self._values(raws, raw)
        refused = self._without_value(raw) | self._out_of_range(raw, value)
        strain = value * self._to_strain
        present = np.ones(self._n_gauges, dtype=bool)
        if len(arrivals) < len(raws):
            here = np.zeros(len(raws), dtype=bool)
            here[[arrival.slot for arrival in arrivals]] = True
            present = here[self._slot]
            strain[~present] = np.nan
            refused &= present
        if status > STATUS_DEGRADED:
            refused |= present
        return DecodedCycle(strain=strain, raw=raw, present=present, refused=refused, status=status)

    def _values(self, raws: Sequence[IntArray], raw: IntArray) -> FloatArray:
        """Return (n_d,) the gauges' values in their signals' units."""
        if all(self._is_linear):
            return raw * self._scale + self._offset
        plans = zip(self._plans, raws, strict=True)
        return np.concatenate([plan.physical(own) for plan, own in plans])[self._column]

    def _worst_status(self, arrivals: Sequence[Arrival], trailer_status: int) -> int:
        """Return the worst status of the sender in a cycle."""
        status = trailer_status
        for arrival in arrivals:
            index = self._status[arrival.slot]
            if index is not None:
                status = max(status, unsigned(arrival.raw, index))
        return status

    def _without_value(self, raw: IntArray) -> BoolArray:
        """Return (n_d,) gauges whose raw number stands for "no value"."""
        return self._none & (raw == self._no_value).any(axis=0)

    def _out_of_range(self, raw: IntArray, value: FloatArray) -> BoolArray:
        """Return (n_d,) gauges outside their signal's limits, or at either end of their converter's range."""
        outside = ~((value >= self._low) & (value <= self._high))
        # A converter at either end is overdriven, or its wire is broken.
        return outside | self._has_ends & ((raw == self._first) | (raw == self._last))


def _is_linear(frame: InputFrame) -> bool:
    """Return whether the values of all strains are int64 times a scale plus an offset, and none overflows."""
    signals = [frame.layout.signals[index] for index in frame.indices]
    whole = all(s.kind == SIGNED or (s.kind == UNSIGNED and s.length < 64) for s in signals)
    return whole and all(isfinite(abs(s.scale) * 2.0**s.length + abs(s.offset)) for s in signals)


def converter_ends(signal: SignalLayout) -> tuple[int, int] | None:
    """Return the first and the last raw number of an integer; None of a float, or of 64 bits, which none fills."""
    if signal.kind == FLOAT or signal.length >= 64:
        return None
    if signal.kind == SIGNED:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1
