"""The decoder of closed cycles: strains of all gauges, which gauges are present, the sender's status."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from strainfmu.can.cycle.frames.assembler import Arrival
from strainfmu.can.wire.compiled import function, pointer
from strainfmu.can.wire.cycle_plan import CyclePlan, DecodedCycle
from strainfmu.can.wire.frame_layout import FrameLayout, InputLayout

STATUS_DEGRADED = 1
"""Sender's status 1; 0 is good, above 1 is not to be used."""


class StrainDecoder:
    """Decodes the strain frames of a layout, all gauges at once."""

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
        self._plan = self.new_plan(
            [frame.layout for frame in frames],
            [(slot, index) for slot, index, _ in by_gauge],
            [factor for _, _, factor in by_gauge],
        )
        self._at = pointer(self._plan.record)
        self._decode = function("sb_decode", type(self._plan.record))
        self._all_here = b"\x01" * self._n_frames

    def new_plan(
        self, frames: Sequence[FrameLayout], chosen: Sequence[tuple[int, int]], to_strain: Sequence[float]
    ) -> CyclePlan:
        """Return the plan of the gauges' signals."""
        return CyclePlan(frames, chosen, to_strain)

    def new_cycle(self) -> DecodedCycle:
        """Return a cycle without frames, for :meth:`decode` to write into."""
        return DecodedCycle(self._n_gauges)

    def decode(self, arrivals: Sequence[Arrival], trailer_status: int, cycle: DecodedCycle) -> DecodedCycle:
        """Decode the ``arrivals`` of a cycle into ``cycle``; ``trailer_status`` is that in the trailer, or 0."""
        self._decode(*self.arguments(arrivals, trailer_status, cycle))
        return cycle

    def arguments(self, arrivals: Sequence[Arrival], trailer_status: int, cycle: DecodedCycle) -> tuple[Any, ...]:
        """Return what compiled code decodes the ``arrivals`` by; set the worst status of ``cycle``."""
        data, here = self._nothing.copy(), self._all_here
        for arrival in arrivals:
            data[arrival.slot] = arrival.frame.data
        if len(arrivals) != self._n_frames:
            slots = [arrival.slot for arrival in arrivals]
            here = bytes([slot in slots for slot in range(self._n_frames)])
        cycle.status = status = self._worst_status(arrivals, trailer_status)
        joined = b"".join(data)
        if len(joined) != self._plan.size:
            raise ValueError(f"expected {self._plan.size} bytes, got {len(joined)}")
        return self._at, joined, here, status > STATUS_DEGRADED, cycle.address

    def _worst_status(self, arrivals: Sequence[Arrival], trailer_status: int) -> int:
        """Return the worst status of the sender in a cycle."""
        status = trailer_status
        for arrival in arrivals:
            if arrival.status > status:
                status = arrival.status
        return status
