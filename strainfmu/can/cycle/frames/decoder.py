"""The decoder of closed cycles: strains of all gauges, which gauges are present, the sender's status."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from strainfmu.can.wire.compiled import function, pointer
from strainfmu.can.wire.cycle_plan import CyclePlan, DecodedCycle
from strainfmu.can.wire.frame_layout import FrameLayout, InputLayout

STATUS_DEGRADED = 1
"""Sender's status 1; 0 is good, above 1 is not to be used."""


class StrainDecoder:
    """Decodes the strain frames of a layout, all gauges at once.

    Attributes
    ----------
    plan : signals of the gauges, for compiled code.
    """

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
        self.plan = self.new_plan(
            [frame.layout for frame in frames],
            [(slot, index) for slot, index, _ in by_gauge],
            [factor for _, _, factor in by_gauge],
        )
        self._at = pointer(self.plan.record)
        self._decode = function("sb_decode", type(self.plan.record))

    def new_plan(
        self, frames: Sequence[FrameLayout], chosen: Sequence[tuple[int, int]], to_strain: Sequence[float]
    ) -> CyclePlan:
        """Return the plan of the gauges' signals."""
        return CyclePlan(frames, chosen, to_strain)

    def new_cycle(self) -> DecodedCycle:
        """Return a cycle without frames, for :meth:`decode` to write into."""
        return DecodedCycle(self._n_gauges)

    def decode(self, frames: Mapping[int, bytes], status: int, cycle: DecodedCycle) -> DecodedCycle:
        """Decode the ``frames`` of some slots into ``cycle``; ``status`` is the worst one of the sender."""
        data = [frames.get(slot, nothing) for slot, nothing in enumerate(self._nothing)]
        joined, here = b"".join(data), bytes([slot in frames for slot in range(self._n_frames)])
        if len(joined) != self.plan.size:
            raise ValueError(f"expected {self.plan.size} bytes, got {len(joined)}")
        self._decode(self._at, joined, here, status > STATUS_DEGRADED, cycle.address)
        return cycle
