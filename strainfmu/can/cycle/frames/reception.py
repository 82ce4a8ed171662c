"""The reception of frames: decoding, and whether each can be trusted by its CRC, counter and E2E state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.assembler import Arrival, arrival_without_fields
from strainfmu.can.cycle.frames.second_sender import SecondSender
from strainfmu.can.e2e.authentication import Authentication, Authenticity
from strainfmu.can.e2e.check import STATUSES, E2EStatus, ReceptionCheck
from strainfmu.can.e2e.state_machine import VALID, E2EStateMachine
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.compiled import ARRAY, INTEGER, Record, address, function, pointer
from strainfmu.can.wire.crc import crc_in, crc_of
from strainfmu.can.wire.cycle_plan import CyclePlan
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import InputFrame, InputLayout
from strainfmu.can.wire.signal_plan import SignalPlan
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


class SlotRecord(Record):
    """What reads and checks one frame for compiled code."""

    position = 9
    _fields_ = (
        ("signals", ARRAY),
        ("length", INTEGER),
        ("place", INTEGER * 3),
        ("expected", INTEGER),
        *((name, ARRAY) for name in ("check", "machine", "trusted_by", "number")),
    )


class _Slot:
    """What reads and checks one frame of the layout, all in one place as it is used for every frame.

    Attributes
    ----------
    index : of the slot.
    plan : its signals.
    selector : multiplexer's signal and value, None of a frame without.
    check : of CRC and counter, None without protection.
    machine : E2E state.
    trusted_by : the same, or the trailer's, which covers frames of strains.
    record : all of it for compiled code.
    numbers : status, sample time, configuration and counter of the last frame; 0 of what it does not hold.
    is_timed, is_counted : the frame holds a sample time, and a counter.
    address : of the record.
    """

    __slots__ = (
        *("address", "check", "index", "is_counted", "is_timed", "machine", "numbers", "plan", "record"),
        *("selector", "trusted_by"),
    )

    def __init__(
        self, index: int, frame: InputFrame, n_covered: int, settings: BridgeSettings, period: float
    ) -> None:
        layout, protection = frame.layout, frame.layout.protection
        self.index, self.plan, self.selector = index, SignalPlan(layout), _selector(frame)
        self.check = (
            None
            if protection is None
            else ReceptionCheck(protection, settings.max_delta, n_covered, period=layout.cycle_time or period)
        )
        self.machine = E2EStateMachine(settings.state_machine)
        self.is_timed, self.is_counted = frame.sample_time is not None, protection is not None
        places = [-1 if at is None else at for at in (frame.status, frame.sample_time, frame.configuration)]
        at, number = frame.configuration, np.zeros(len(places) + 1, dtype=np.int64)
        expected = None if at is None else layout.signals[at].initial
        self.record = SlotRecord(
            signals=CyclePlan([layout], [(0, k) for k in range(len(layout.signals))]).record,
            length=layout.length,
            place=(INTEGER * len(places))(*places),
            expected=expected or 0,
            check=None if self.check is None else self.check.record,
            machine=self.machine.record,
            trusted_by=self.machine.record,
            number=number,
        )
        self.numbers: memoryview = number.data
        self.address = pointer(self.record)
        self.trusted_by = self.machine

    def trust(self, machine: E2EStateMachine) -> None:
        """Have the state of ``machine`` decide whether the frame is trusted."""
        self.trusted_by, self.record.trusted_by = machine, address(machine.record)


_OTHER_CONFIGURATION = 8
"""Flag of strainbus.h."""

_ALL_BITS = (1 << 64) - 1
"""Of a number that compiled code returns as int64."""


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
        n_covered = sum(frame.layout.length for frame in layout.strain_frames)
        self._slots = slots = [
            _Slot(index, frame, n_covered if frame.is_trailer else 0, settings, layout.cycle_time)
            for index, frame in enumerate(layout.frames)
        ]
        self._checks, self._machines = [slot.check for slot in slots], [slot.machine for slot in slots]
        if self.trailer is not None:  # whose state strain frames have
            for slot in slots[: self.n_strain]:
                slot.trust(self._machines[self.trailer])
        self._receive, self._read, self._check = (
            function(name, SlotRecord) for name in ("sb_slot_receive", "sb_slot_read", "sb_slot_check")
        )
        self._time = np.zeros(1)
        self._at_time = pointer(self._time)
        self._by_key: dict[int, list[_Slot]] = {}
        for slot in slots:
            self._by_key.setdefault(layout.frames[slot.index].layout.key, []).append(slot)
        # Of frames that their identifier alone tells.
        self._single = {key: own[0] for key, own in self._by_key.items() if own[0].selector is None}
        self.protected_strains = {
            key: slot.index
            for key, slot in self._single.items()
            if slot.index < self.n_strain and slot.check is not None and slot.index not in self._held
        }
        """Slots of strain frames with a CRC of their own, by key."""
        self.slots = [slot.record for slot in slots]
        """Of every frame for compiled code."""
        self.authentication = _authentication(layout)
        self._second = SecondSender(settings.second_sender_cycles * layout.cycle_time)

    def take(self, frame: Frame) -> Arrival | FrameClass:
        """Return a frame with the numbers about it, or its class if it is refused by itself."""
        data, slot = frame.data, self._single.get(frame.key)
        if slot is None:
            slot = self._selected(self._by_key[frame.key], data)
            if slot is None:
                return FrameClass.NOT_USABLE  # its multiplexer's value belongs to no frame of the layout
        if self.authentication is None and slot.index != self.trailer:
            self._time[0] = frame.time
            found = self._receive(slot.address, self._at_time, data, len(data))
            if found < 0:
                raise ValueError(f"expected {slot.record.length} bytes, got {len(data)}")
        else:
            verdict = self._read_first(slot, frame)
            if isinstance(verdict, FrameClass):
                return verdict
            found = verdict
        status, sample_time, _, counter = slot.numbers.tolist()
        arrival = arrival_without_fields(Arrival)
        arrival.slot, arrival.frame, arrival.plan = slot.index, frame, slot.plan
        arrival.sample_time = sample_time if slot.is_timed else None
        arrival.counter = counter if slot.is_counted else None
        arrival.status = status & _ALL_BITS if status else 0
        return arrival if not found else self._refused(slot, frame, found) or arrival

    def _read_first(self, slot: _Slot, frame: Frame) -> int | FrameClass:
        """Read the numbers about a frame; return what its check finds, or the class if it is forged."""
        data = frame.data
        if not self._read(slot.address, data, len(data)):
            raise ValueError(f"expected {slot.record.length} bytes, got {len(data)}")
        if slot.index == self.trailer:
            return 0  # its CRC covers frames that may not have come yet
        forged = self._not_authentic(slot.index, data)
        if forged is not None:
            return forged
        self._time[0] = frame.time
        return self._check(slot.address, self._at_time, data, len(data))

    def _selected(self, slots: Sequence[_Slot], data: bytes) -> _Slot | None:
        """Return the slot of a frame by its multiplexer's value."""
        for slot in slots:
            if slot.selector is None or int(slot.selector[0].raw(data)[0]) == slot.selector[1]:
                return slot
        return None

    def _refused(self, slot: _Slot, frame: Frame, found: int) -> FrameClass | None:
        """Return the class of a frame by what its check has found, None if it is not refused."""
        self.hear(slot.index, frame.time)
        is_other = found >= _OTHER_CONFIGURATION
        return FrameClass.WRONG_CONFIGURATION if is_other else _CLASS_OF_STATUS.get(STATUSES[found])

    def refused(self, frame: Frame, found: int) -> FrameClass:
        """Return the class of a frame that compiled code has received, and whose check has ``found`` a fault."""
        kind = self._refused(self._single[frame.key], frame, found)
        assert kind is not None
        return kind

    def hear(self, slot: int, time: float) -> None:
        """Look for a second sender in the last check of the frame ``slot``, received at ``time`` [s]."""
        check = self._checks[slot]
        if check is not None:
            self._second.take(check, slot, time)

    def direct_slots(self) -> dict[int, int]:
        """Return the slots of frames that compiled code receives at once, by key.

        Others have a multiplexer or an authenticator, are held, or are a trailer, whose CRC covers the others.
        """
        if self.authentication is not None:
            return {}
        later = {self.trailer, *self._held}
        return {key: slot.index for key, slot in self._single.items() if slot.index not in later}

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

    def has_second_sender(self, now: float) -> bool:
        """Return whether frames that cannot be of one sender have come lately."""
        return self._second.was_heard(now)

    def is_trusted(self, slot: int) -> bool:
        """Return whether the E2E state of a frame is VALID; a strain frame has its trailer's state, if any."""
        return self._slots[slot].trusted_by.record.state == VALID

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
        raise InputError(f"{layout.name}: frames are authenticated, and no key is given: state it as input.key")
    return Authentication([frame.layout.secured for frame in layout.frames], layout.key)


def _selector(frame: InputFrame) -> tuple[SignalPlan, int] | None:
    """Return the multiplexer's signal and value of a multiplexed frame, None of others."""
    if frame.layout.multiplexer is None:
        return None
    signal, number = frame.layout.multiplexer
    return SignalPlan(replace(frame.layout, signals=(signal,))), number
