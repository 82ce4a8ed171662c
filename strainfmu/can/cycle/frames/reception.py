"""The reception of frames: decoding, and whether each can be trusted by its CRC, counter and E2E state."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import BoolArray
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.assembler import Arrival, arrival_without_fields
from strainfmu.can.cycle.frames.second_sender import SecondSender
from strainfmu.can.cycle.states.quality import Cause
from strainfmu.can.e2e.authentication import Authentication, Authenticity
from strainfmu.can.e2e.check import USABLE, E2EStatus, ReceptionCheck
from strainfmu.can.e2e.state_machine import E2EState, E2EStateMachine
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.crc import Protection, crc_in, crc_of
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import InputFrame, InputLayout
from strainfmu.can.wire.signal_plan import SignalPlan, number_reader
from strainfmu.errors import InputError

_CLASS_OF_STATUS = {
    E2EStatus.ERROR: FrameClass.CORRUPT,
    E2EStatus.REPEATED: FrameClass.REPEATED,
    E2EStatus.WRONG_SEQUENCE: FrameClass.WRONG_SEQUENCE,
}
_CLASS_OF_VERDICT = {
    Authenticity.FORGED: FrameClass.NOT_AUTHENTIC,
    Authenticity.NOT_FRESH: FrameClass.NOT_FRESH,
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


@dataclass(eq=False, slots=True, kw_only=True)
class _Slot:
    """What reads and checks one frame of the layout, all in one place as it is used for every frame.

    Attributes
    ----------
    index : of the slot.
    plan : its signals.
    numbers : reads status, sample time and configuration, all that is needed before the cycle is closed.
    selector : multiplexer's signal and value, None of a frame without.
    configuration : number of the gauge assignment that is expected, None for any.
    counter_place : byte and bits of the counter, None without protection.
    check : of CRC and counter, None without protection.
    machine : E2E state.
    """

    index: int
    plan: SignalPlan
    numbers: Callable[[bytes], tuple[int | None, ...]]
    selector: tuple[SignalPlan, int] | None
    configuration: int | None
    counter_place: tuple[int, int] | None
    check: ReceptionCheck | None
    machine: E2EStateMachine


_NOTHING_TO_CHECK = TrailerVerdict()
# Members of an Enum by name: through its class each use takes as long as a call.
_OK, _VALID = E2EStatus.OK, E2EState.VALID
_ALL_BITS = (1 << 64) - 1
"""Of a number that a plan returns as int64."""


class Reception:
    """The frames of a layout by slot: strain frames first, then the trailer, then flow, as ``layout.frames``.

    Raises
    ------
    InputError
        Frames are authenticated, and the layout has no key.
    """

    def __init__(self, layout: InputLayout, settings: BridgeSettings) -> None:
        self._layout = layout
        self.n_strain = len(layout.strain_frames)
        self.trailer = self.n_strain if layout.trailer is not None else None
        self._held = frozenset(layout.held_slots)
        self._gauges = [np.array(frame.gauges, dtype=np.intp) for frame in layout.strain_frames]
        self._n_slots = self.n_strain + (layout.trailer is not None)
        self.every_gauge = np.ones(layout.n_gauges, dtype=bool)
        """(n_d,) True."""
        self.every_gauge.setflags(write=False)
        slots = [self._slot(index, frame, settings) for index, frame in enumerate(layout.frames)]
        self._checks, self._machines = [slot.check for slot in slots], [slot.machine for slot in slots]
        self._by_key: dict[int, list[_Slot]] = {}
        for slot in slots:
            self._by_key.setdefault(layout.frames[slot.index].layout.key, []).append(slot)
        # Of frames that their identifier alone tells.
        self._single = {key: own[0] for key, own in self._by_key.items() if own[0].selector is None}
        self.authentication = _authentication(layout)
        self._second = SecondSender(settings.alarm_cycles * layout.cycle_time)

    def new_check(self, protection: Protection, max_delta: int) -> ReceptionCheck:
        """Return the check of one frame's CRC and counter."""
        return ReceptionCheck(protection, max_delta)

    def _slot(self, index: int, frame: InputFrame, settings: BridgeSettings) -> _Slot:
        layout, protection, at = frame.layout, frame.layout.protection, frame.configuration
        return _Slot(
            index=index,
            plan=SignalPlan(layout),
            numbers=number_reader(layout, (frame.status, frame.sample_time, at)),
            selector=_selector(frame),
            configuration=None if at is None else layout.signals[at].initial,
            counter_place=None if protection is None else protection.counter_place,
            check=None if protection is None else self.new_check(protection, settings.max_delta),
            machine=E2EStateMachine(settings.state_machine),
        )

    def take(self, frame: Frame) -> Arrival | FrameClass:
        """Return a frame with the numbers about it, or its class if it is refused by itself."""
        data, slot = frame.data, self._single.get(frame.key)
        if slot is None:
            slot = self._selected(self._by_key[frame.key], data)
            if slot is None:
                return FrameClass.NOT_USABLE  # its multiplexer's value belongs to no frame of the layout
        place, check, numbers = slot.counter_place, slot.check, slot.numbers
        status, sample_time, configuration = numbers(data)
        arrival = arrival_without_fields(Arrival)
        arrival.slot = index = slot.index
        arrival.frame, arrival.plan, arrival.sample_time = frame, slot.plan, sample_time
        arrival.counter = None if place is None else data[place[0]] & place[1]
        arrival.status = status & _ALL_BITS if status else 0
        if index == self.trailer:
            return arrival  # its CRC covers frames that may not have come yet
        if self.authentication is not None:
            forged = self._not_authentic(index, data)
            if forged is not None:
                return forged
        found = _OK if check is None else check.check(data)
        if found is _OK and (configuration is None or configuration & _ALL_BITS == slot.configuration):
            if not slot.machine.is_steady:
                slot.machine.add(_OK)
            return arrival
        return self._refused(slot, frame, configuration, found) or arrival

    def _selected(self, slots: Sequence[_Slot], data: bytes) -> _Slot | None:
        """Return the slot of a frame by its multiplexer's value."""
        for slot in slots:
            if slot.selector is None or int(slot.selector[0].raw(data)[0]) == slot.selector[1]:
                return slot
        return None

    def _refused(
        self, slot: _Slot, frame: Frame, configuration: int | None, status: E2EStatus
    ) -> FrameClass | None:
        """Take in the ``status`` of a frame by itself; return its class if it is refused."""
        check = slot.check
        wrong = (
            configuration is not None
            and status is not E2EStatus.ERROR
            and configuration & _ALL_BITS != slot.configuration
            and self._is_of_other_configuration()
        )
        slot.machine.add(E2EStatus.ERROR if wrong else status)
        if status is E2EStatus.OK and not wrong:
            return None
        if check is not None:
            self._second.take(check, slot.index, frame.time)
        return FrameClass.WRONG_CONFIGURATION if wrong else _CLASS_OF_STATUS.get(status)

    def _is_of_other_configuration(self) -> bool:
        """Return whether another number is that of a sender with another assignment of gauges."""
        return True

    def _not_authentic(self, slot: int, data: bytes) -> FrameClass | None:
        """Return the class of a frame that is not of the sender, or not new; None if its CRC does not fit either.

        A forged frame does not touch the state of the sender's counter. One whose CRC does not fit was altered on
        the bus, which the E2E state machine is to know.
        """
        if self.authentication is None:
            return None
        found = _CLASS_OF_VERDICT.get(self.authentication.check(slot, data))
        if found is None:
            return None
        protection = self._layout.frames[slot].layout.protection
        is_altered = protection is not None and crc_in(data, protection) != crc_of(data, protection)
        return None if is_altered else found

    def check_trailer(self, arrivals: Mapping[int, Arrival]) -> TrailerVerdict:
        """Check CRC and counter over a closed cycle; without a trailer in the layout there is nothing to check."""
        slot = self.trailer
        if slot is None:
            return _NOTHING_TO_CHECK
        arrival, check = arrivals.get(slot), self._checks[slot]
        complete = all(index in arrivals for index in range(self.n_strain))
        if arrival is None or check is None or not complete:
            self._machines[slot].add(E2EStatus.NO_NEW_DATA)
            return TrailerVerdict(FrameClass.UNVERIFIED, Cause.CYCLE_CRC | Cause.PARTIAL_CYCLE)
        covered = b"".join(arrivals[index].frame.data for index in range(self.n_strain))
        status = check.check(arrival.frame.data, covered)
        self._machines[slot].add(status)
        status_of_sender = arrival.status
        self._second.take(check, slot, arrival.frame.time)
        if status not in USABLE:
            kind = FrameClass.UNVERIFIED if status is E2EStatus.ERROR else _CLASS_OF_STATUS[status]
            return TrailerVerdict(kind, Cause.CYCLE_CRC, status_of_sender)
        if not self.is_trusted(slot):
            return TrailerVerdict(FrameClass.NOT_TRUSTED, Cause.NOT_TRUSTED, status_of_sender)
        return TrailerVerdict(status=status_of_sender) if status_of_sender else _NOTHING_TO_CHECK

    def has_second_sender(self, now: float) -> bool:
        """Return whether frames that cannot be of one sender have come lately."""
        return self._second.was_heard(now)

    def is_trusted(self, slot: int) -> bool:
        """Return whether the E2E state of a frame is VALID; a strain frame has that of its trailer, if any."""
        if self.trailer is not None and slot < self.n_strain:
            slot = self.trailer
        return self._machines[slot].state is _VALID

    def trusted_gauges(self, arrivals: Mapping[int, Arrival]) -> BoolArray:
        """Return (n_d,) gauges whose frame has arrived and is trusted; the array is not to be written to."""
        if len(arrivals) == self._n_slots:
            for slot in arrivals:
                if not self.is_trusted(slot):
                    break
            else:
                return self.every_gauge
        trusted = np.zeros(self._layout.n_gauges, dtype=bool)
        for slot in arrivals:
            if slot < self.n_strain and self.is_trusted(slot):
                trusted[self._gauges[slot]] = True
        return trusted

    def miss(self, arrivals: Mapping[int, Arrival]) -> bool:
        """Note which strain frames a closed cycle lacks; return whether it lacks any.

        The E2E state of those that need not come in every cycle is left as it is.
        """
        if len(arrivals) == self._n_slots:
            return False
        missing = [slot for slot in range(self.n_strain) if slot not in arrivals]
        for slot in missing:
            if slot not in self._held:
                self._machines[slot].add(E2EStatus.NO_NEW_DATA)
        return bool(missing)

    def miss_cycle(self) -> None:
        """Note that a whole cycle did not come."""
        for slot, machine in enumerate(self._of_strains()):
            if slot not in self._held:
                machine.add(E2EStatus.NO_NEW_DATA)

    def forget(self) -> None:
        """Start again with the sender of the strains."""
        for machine in self._of_strains():
            machine.reset()

    def _of_strains(self) -> list[E2EStateMachine]:
        return self._machines[: self.n_strain + (self.trailer is not None)]


def _authentication(layout: InputLayout) -> Authentication | None:
    """Return the check of the authenticators of a layout, None if its frames have none."""
    if not layout.is_authenticated:
        return None
    if layout.key is None:
        raise InputError(f"{layout.name}: frames are authenticated, and no key is given: state it by --key")
    return Authentication([frame.layout.secured for frame in layout.frames], layout.key)


def _selector(frame: InputFrame) -> tuple[SignalPlan, int] | None:
    """Return the multiplexer's signal and value of a multiplexed frame, None of others."""
    if frame.layout.multiplexer is None:
        return None
    signal, number = frame.layout.multiplexer
    return SignalPlan(replace(frame.layout, signals=(signal,))), number
