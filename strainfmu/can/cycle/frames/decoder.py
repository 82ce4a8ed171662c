"""The decoder of closed cycles: strains of all gauges, which gauges are present, the sender's status."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.can.cycle.frames.assembler import Arrival
from strainfmu.can.wire.cycle_plan import CyclePlan, InnerRange, raw_ends
from strainfmu.can.wire.frame_layout import InputLayout

STATUS_DEGRADED = 1
"""Sender's status 1; 0 is good, above 1 is not to be used."""


@dataclass(eq=False, slots=True, kw_only=True)  # not frozen: one is made for every cycle
class DecodedCycle:
    """Strains of one cycle.

    Attributes
    ----------
    strain : (n_d,) [m/m]; NaN where the frame is missing.
    raw : (n_d,) raw numbers.
    present : (n_d,) gauges whose frame has arrived.
    refused : (n_d,) gauges without a value, or outside their signal's limits.
    status : worst status of the sender.
    is_clean : all gauges are present and none is refused; may be False where that is so.
    """

    strain: FloatArray
    raw: IntArray
    present: BoolArray
    refused: BoolArray
    status: int = 0
    is_clean: bool = False


_without_fields = object.__new__
"""Makes a cycle whose fields are all still to be set, in half the time of making one by them."""


class StrainDecoder:
    """Decodes the strain frames of a layout, all gauges at once. Its arrays are not to be written to."""

    def __init__(self, layout: InputLayout) -> None:
        frames = layout.strain_frames
        self._n_gauges, self._n_frames = layout.n_gauges, len(frames)
        self._nothing = [bytes(frame.layout.length) for frame in frames]
        owners = {
            gauge: (slot, index, factor)
            for slot, frame in enumerate(frames)
            for index, gauge, factor in zip(frame.indices, frame.gauges, frame.to_strain, strict=True)
        }
        by_gauge = [owners[gauge] for gauge in range(layout.n_gauges)]
        self._plan = CyclePlan([f.layout for f in frames], [(slot, index) for slot, index, _ in by_gauge])
        signals = self._plan.signals
        self._inner = InnerRange(signals)
        self._slot = np.array([slot for slot, _, _ in by_gauge], dtype=np.intp)
        self._to_strain = np.array([factor for _, _, factor in by_gauge])
        # Where the scale is exact, one multiplication gives what two do, to the last bit.
        scale = self._plan.exact_scale()
        self._raw_to_strain = None if scale is None else scale * self._to_strain
        self._low = np.array([-np.inf if s.minimum is None else s.minimum for s in signals])
        self._high = np.array([np.inf if s.maximum is None else s.maximum for s in signals])
        ends = [raw_ends(signal) for signal in signals]
        self._has_ends = np.array([end is not None for end in ends])
        self._first, self._last = np.array([end or (0, 0) for end in ends], dtype=np.int64).T
        # (m, n_d) codes for "no value"; a gauge with fewer than m of them repeats its last one.
        codes = [signal.no_value_codes for signal in signals]
        self._none = np.array([bool(own) for own in codes])
        rows = [[(own or (0,))[min(row, len(own) - 1)] for own in codes] for row in range(max(map(len, codes)))]
        self._no_value = np.array(rows, dtype=np.int64).reshape(-1, len(signals))
        self._everywhere, self._nowhere = (
            np.ones(layout.n_gauges, dtype=bool),
            np.zeros(layout.n_gauges, dtype=bool),
        )
        for shared in (self._everywhere, self._nowhere):
            shared.setflags(write=False)

    def empty(self) -> DecodedCycle:
        """Return a cycle without frames."""
        n = self._n_gauges
        absent = self._nowhere
        return DecodedCycle(
            strain=np.full(n, np.nan), raw=np.zeros(n, dtype=np.int64), present=absent, refused=absent
        )

    def decode(self, arrivals: Sequence[Arrival], trailer_status: int) -> DecodedCycle:
        """Return the decoded ``arrivals`` of a cycle; ``trailer_status`` is the status in the trailer, or 0."""
        data, status = self._nothing.copy(), self._worst_status(arrivals, trailer_status)
        for arrival in arrivals:
            data[arrival.slot] = arrival.frame.data
        raw = self._plan.raw(data)
        is_whole = len(arrivals) == self._n_frames
        if is_whole and status <= STATUS_DEGRADED and self._inner.holds(raw):
            at_once = self._raw_to_strain
            clean = _without_fields(DecodedCycle)
            clean.strain = self._plan.physical(raw) * self._to_strain if at_once is None else raw * at_once
            clean.raw, clean.present, clean.refused = raw, self._everywhere, self._nowhere
            clean.status, clean.is_clean = status, True
            return clean
        value = self._plan.physical(raw)
        strain = value * self._to_strain
        refused = self._without_value(raw) | self._out_of_range(raw, value)
        present = self._everywhere
        if not is_whole:
            here = np.zeros(self._n_frames, dtype=bool)
            here[[arrival.slot for arrival in arrivals]] = True
            present = here[self._slot]
            strain[~present] = np.nan
            refused &= present
        if status > STATUS_DEGRADED:
            refused |= present
        is_clean = is_whole and not refused.any()
        return DecodedCycle(
            strain=strain, raw=raw, present=present, refused=refused, status=status, is_clean=is_clean
        )

    def _worst_status(self, arrivals: Sequence[Arrival], trailer_status: int) -> int:
        """Return the worst status of the sender in a cycle."""
        status = trailer_status
        for arrival in arrivals:
            if arrival.status > status:
                status = arrival.status
        return status

    def _without_value(self, raw: IntArray) -> BoolArray:
        """Return (n_d,) gauges whose raw number stands for "no value"."""
        return self._none & (raw == self._no_value).any(axis=0)

    def _out_of_range(self, raw: IntArray, value: FloatArray) -> BoolArray:
        """Return (n_d,) gauges outside their signal's limits, or at either end of their converter's range."""
        outside = ~((value >= self._low) & (value <= self._high))
        # A converter at either end is overdriven, or its wire is broken.
        return outside | self._has_ends & ((raw == self._first) | (raw == self._last))
