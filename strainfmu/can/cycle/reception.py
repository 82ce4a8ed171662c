"""The reception of frames: decoding, and whether each can be trusted by its CRC, counter and E2E state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import BoolArray, IntArray
from strainfmu.can.cycle.assembler import Arrival
from strainfmu.can.cycle.frame_account import FrameClass
from strainfmu.can.cycle.quality import Cause
from strainfmu.can.e2e.check import USABLE, E2EStatus, ReceptionCheck
from strainfmu.can.e2e.state_machine import E2EState, E2EStateMachine
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.crc import Protection, counter_in
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import InputFrame, InputLayout
from strainfmu.can.wire.signal_plan import SignalPlan, unsigned

_CLASS_OF_STATUS = {
    E2EStatus.ERROR: FrameClass.CORRUPT,
    E2EStatus.REPEATED: FrameClass.REPEATED,
    E2EStatus.WRONG_SEQUENCE: FrameClass.WRONG_SEQUENCE,
}


@dataclass(frozen=True)
class TrailerVerdict:
    """Verdict of the trailer on its cycle.

    Attributes
    ----------
    refused : class of all frames of the cycle if it cannot be trusted, else None.
    cause : of the refusal.
    status : the sender's own status.
    """

    refused: FrameClass | None = None
    cause: Cause = Cause.NONE
    status: int = 0


class Reception:
    """The frames of a layout by slot: strain frames first, then the trailer, then flow, as ``layout.frames``."""

    def __init__(self, layout: InputLayout, settings: BridgeSettings) -> None:
        self._layout = layout
        self.n_strain = len(layout.strain_frames)
        self.trailer = self.n_strain if layout.trailer is not None else None
        self._slots: dict[int, list[int]] = {}
        for slot, frame in enumerate(layout.frames):
            self._slots.setdefault(frame.layout.key, []).append(slot)
        self._gauges = [np.array(frame.gauges, dtype=np.intp) for frame in layout.strain_frames]
        self._plans = [SignalPlan(frame.layout) for frame in layout.frames]
        self._selectors = [_selector(frame) for frame in layout.frames]
        protections = [frame.layout.protection for frame in layout.frames]
        self._checks = [None if p is None else self.new_check(p, settings.max_delta) for p in protections]
        self._machines = [E2EStateMachine(settings.state_machine) for _ in layout.frames]

    def new_check(self, protection: Protection, max_delta: int) -> ReceptionCheck:
        """Return the check of one frame's CRC and counter."""
        return ReceptionCheck(protection, max_delta)

    def slot_of(self, frame: Frame) -> int | None:
        """Return the slot of a frame, None if its multiplexer's value belongs to no frame of the layout."""
        for slot in self._slots[frame.key]:
            selector = self._selectors[slot]
            if selector is None or int(selector[0].raw(frame.data)[0]) == selector[1]:
                return slot
        return None

    def arrival(self, slot: int, frame: Frame) -> Arrival:
        """Return a frame decoded."""
        item = self._layout.frames[slot]
        raw = self._plans[slot].raw(frame.data)
        sample_time = None if item.sample_time is None else int(raw[item.sample_time])
        protection = item.layout.protection
        counter = None if protection is None else counter_in(frame.data, protection)
        return Arrival(slot=slot, frame=frame, raw=raw, sample_time=sample_time, counter=counter)

    def check(self, arrival: Arrival) -> FrameClass | None:
        """Check a frame by itself; return its class if it is refused."""
        slot = arrival.slot
        if slot == self.trailer:
            return None  # its CRC covers frames that may not have come yet
        check = self._checks[slot]
        status = E2EStatus.OK if check is None else check.check(arrival.frame.data)
        wrong = status is not E2EStatus.ERROR and self._is_of_other_configuration(slot, arrival.raw)
        self._machines[slot].add(E2EStatus.ERROR if wrong else status)
        return FrameClass.WRONG_CONFIGURATION if wrong else _CLASS_OF_STATUS.get(status)

    def check_trailer(self, arrivals: Mapping[int, Arrival]) -> TrailerVerdict:
        """Check CRC and counter over a closed cycle; without a trailer in the layout there is nothing to check."""
        slot, trailer = self.trailer, self._layout.trailer
        if slot is None or trailer is None:
            return TrailerVerdict()
        arrival, check = arrivals.get(slot), self._checks[slot]
        complete = all(index in arrivals for index in range(self.n_strain))
        if arrival is None or check is None or not complete:
            self._machines[slot].add(E2EStatus.NO_NEW_DATA)
            return TrailerVerdict(FrameClass.UNVERIFIED, Cause.CYCLE_CRC | Cause.PARTIAL_CYCLE)
        covered = b"".join(arrivals[index].frame.data for index in range(self.n_strain))
        status = check.check(arrival.frame.data, covered)
        self._machines[slot].add(status)
        status_of_sender = 0 if trailer.status is None else unsigned(arrival.raw, trailer.status)
        if status not in USABLE:
            kind = FrameClass.UNVERIFIED if status is E2EStatus.ERROR else _CLASS_OF_STATUS[status]
            return TrailerVerdict(kind, Cause.CYCLE_CRC, status_of_sender)
        if not self.is_trusted(slot):
            return TrailerVerdict(FrameClass.NOT_TRUSTED, Cause.NOT_TRUSTED, status_of_sender)
        return TrailerVerdict(status=status_of_sender)

    def is_trusted(self, slot: int) -> bool:
        """Return whether the E2E state of a frame is VALID; a strain frame has that of its trailer, if any."""
        if self.trailer is not None and slot < self.n_strain:
            slot = self.trailer
        return self._machines[slot].state is E2EState.VALID

    def trusted_gauges(self, arrivals: Mapping[int, Arrival]) -> BoolArray:
        """Return (n_d,) gauges whose frame has arrived and is trusted."""
        trusted = np.zeros(self._layout.n_gauges, dtype=bool)
        for slot in arrivals:
            if slot < self.n_strain and self.is_trusted(slot):
                trusted[self._gauges[slot]] = True
        return trusted

    def miss(self, arrivals: Mapping[int, Arrival]) -> bool:
        """Note which strain frames a closed cycle lacks; return whether it lacks any."""
        missing = [slot for slot in range(self.n_strain) if slot not in arrivals]
        for slot in missing:
            self._machines[slot].add(E2EStatus.NO_NEW_DATA)
        return bool(missing)

    def miss_cycle(self) -> None:
        """Note that a whole cycle did not come."""
        for machine in self._of_strains():
            machine.add(E2EStatus.NO_NEW_DATA)

    def forget(self) -> None:
        """Start again with the sender of the strains."""
        for machine in self._of_strains():
            machine.reset()

    def _of_strains(self) -> list[E2EStateMachine]:
        return self._machines[: self.n_strain + (self.trailer is not None)]

    def _is_of_other_configuration(self, slot: int, raw: IntArray) -> bool:
        item = self._layout.frames[slot]
        if item.configuration is None:
            return False
        return unsigned(raw, item.configuration) != item.layout.signals[item.configuration].initial


def _selector(frame: InputFrame) -> tuple[SignalPlan, int] | None:
    """Return the multiplexer's signal and value of a multiplexed frame, None of others."""
    if frame.layout.multiplexer is None:
        return None
    signal, number = frame.layout.multiplexer
    return SignalPlan(replace(frame.layout, signals=(signal,))), number
