"""The machine by itself, frame by frame: cycles, gauges, acceptance; bus state and back-off."""

from dataclasses import replace

import numpy as np
import pytest
from can_case import CYCLE, Ears, Projection, layout_of

from strainfmu.can.bridge import BackOff
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import LISTED_IDENTIFIERS, BusState, Cause, FrameClass, Quality, state_after
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


class Bench:
    """A machine of two frames of strains, whose frames are given one by one; the sender may have a state."""

    def __init__(
        self, profile: str = "fd64", n_gauges: int = 54, has_state: bool = False, deadline: float = 0.5
    ) -> None:
        layout = layout_of(profile, n_gauges)
        self.layout: InputLayout = layout if has_state else replace(layout, state=None)
        self.machine: Machine = Machine(
            self.layout, Projection(n_gauges), BridgeSettings(deadline=deadline), start=0.0
        )
        self._encoder, self._random = StrainEncoder(self.layout), np.random.default_rng(1)
        self.n = n_gauges
        for cycle in range(6):
            self.give(*self.frames(cycle))

    def frames(self, cycle: int, at: float | None = None, counter: int | None = None) -> list[Frame]:
        """Return the frames of a cycle that come at ``at`` [s]: q_inf, then strains."""
        strain = 3e-4 + 2e-6 * self._random.normal(size=self.n)
        frames = self._encoder.encode(
            strain, 9e4, cycle=cycle if counter is None else counter, sample_time=cycle * CYCLE
        )
        begin = cycle * CYCLE if at is None else at
        return [replace(frame, time=begin + 1e-5 * k) for k, frame in enumerate(frames)]

    def give(self, *frames: Frame) -> list[Result]:
        results = []
        for frame in frames:
            results += self.machine.receive(frame)
        return results

    def kind(self, frame: Frame) -> FrameClass | None:
        """Return the class to which a frame comes at once, None if it is pending."""
        before = self.machine.account
        self.give(frame)
        after = self.machine.account
        kinds = [kind for kind in FrameClass if after.classes[kind] > before.classes[kind]]
        return None if after.pending > before.pending else kinds[0]


def test_a_complete_cycle_is_closed_at_once() -> None:
    bench = Bench()
    pressure, first, second = bench.frames(6)
    assert bench.give(pressure, second) == []
    assert [result.valid.all() for result in bench.give(first)] == [True]


def test_a_frame_of_the_next_cycle_closes_a_partial_one_and_late_ones_are_refused() -> None:
    bench = Bench()
    _, first, second = bench.frames(6)
    _, first_next, second_next = bench.frames(7, at=0.062)
    bench.give(first)
    (partial,) = bench.give(first_next)
    assert int(partial.valid.sum()) == 27
    assert partial.causes & Cause.PARTIAL_CYCLE
    assert bench.kind(replace(second, time=0.063)) is FrameClass.LATE
    assert bench.kind(replace(first_next, time=0.063)) is FrameClass.REPEATED
    assert bench.give(replace(second_next, time=0.064))[0].valid.all()


@pytest.mark.parametrize("deadline", [0.5, 0.9])
def test_the_deadline_closes_a_partial_cycle(deadline: float) -> None:
    bench = Bench(deadline=deadline)
    bench.give(bench.frames(6)[1])
    assert bench.machine.next_event == pytest.approx(0.06001 + deadline * CYCLE)
    assert bench.machine.advance(0.06 + deadline * CYCLE) == []
    assert [int(result.valid.sum()) for result in bench.machine.advance(0.06002 + deadline * CYCLE)] == [27]


def test_strains_that_come_behind_the_deadline_of_the_senders_state_are_refused() -> None:
    """The cycle is answered by a result without a sample time: its strains are late."""
    bench = Bench(has_state=True)
    state, _, *strains = bench.frames(6)
    bench.give(state)
    (alone,) = bench.machine.advance(0.0651)
    assert alone.sample_time is None
    assert not alone.valid.any()
    assert [bench.kind(replace(frame, time=0.066)) for frame in strains] == [FrameClass.LATE] * 2
    assert bench.give(*bench.frames(7))[0].valid.all()


def test_the_same_time_with_another_counter_is_no_part_of_the_cycle() -> None:
    bench = Bench()
    bench.give(bench.frames(6)[1])
    assert bench.kind(bench.frames(6, counter=7)[2]) is FrameClass.LATE


def test_without_times_a_repeated_frame_or_the_trailer_ends_a_cycle() -> None:
    plain = Bench("classic-le", 10)
    pressure, *strains, trailer = plain.frames(6)
    assert plain.give(pressure, strains[0], strains[1]) == []
    (result,) = plain.give(trailer)
    assert Cause.PARTIAL_CYCLE in result.causes
    assert Cause.CYCLE_CRC in result.causes
    pressure, *strains, _ = plain.frames(7)
    plain.give(pressure, strains[0])
    assert len(plain.give(replace(strains[0], time=0.0705))) == 1


# --- gauges


def verdicts(strains: list[float], settings: BridgeSettings | None = None) -> list[bool]:
    """Return the verdict on one gauge over cycles, beside others that are well; its frame is trusted before."""
    layout = layout_of("fd64", 4)
    machine = Machine(layout, Projection(4), settings or BridgeSettings(stuck_cycles=25), start=0.0)
    encoder, found = StrainEncoder(layout), []
    ears, random = Ears(encoder), np.random.default_rng(2)
    for k, value in enumerate([*moving(40, strains[0] if strains[0] == strains[0] else 2e-4), *strains]):
        strain = np.array([value, *(1e-4 + 2e-6 * random.normal(size=3))])
        for frame in encoder.encode(strain, 9e4, cycle=k, sample_time=k * CYCLE):
            for result in ears.hear(machine.receive(replace(frame, time=k * CYCLE))):
                if k >= 40:
                    assert result.valid[1:].all()
                    found.append(bool(result.valid[0]))
    return found


def moving(n: int, start: float = 200e-6) -> list[float]:
    return [start + 1e-6 * (k % 3) for k in range(n)]


@pytest.mark.parametrize(
    ("strains", "bad"),
    [
        (moving(10), []),
        ([*moving(3), np.nan, *moving(5)], [3, 4, 5]),
        ([*moving(3), 0.003, *moving(5)], [3, 4, 5, 6]),  # a jump up and down
        ([*moving(3), 0.0, *moving(5)], [3, 4, 5]),
        ([*moving(3), *[0.0] * 9], list(range(3, 12))),
        ([6e-6, 3e-6, 0.0, -3e-6, -6e-6], []),  # moving through zero at its own pace
        ([*moving(1), *[200.25e-6] * 30], list(range(26, 31))),
    ],
)
def test_gauges_are_left_out_and_used_again(strains: list[float], bad: list[int]) -> None:
    assert [k for k, valid in enumerate(verdicts(strains)) if not valid] == bad


def test_constant_signals_can_be_allowed_but_zeros_are_always_found() -> None:
    constant = BridgeSettings(stuck_cycles=0)
    assert all(verdicts([200e-6] * 60, constant))
    assert not any(verdicts([*moving(3), *[0.0] * 50], constant)[3:])


# --- acceptance, account, bus


def test_more_frames_than_a_sender_can_mean_are_shed_and_the_next_cycles_are_not() -> None:
    bench = Bench()
    frame = bench.frames(6)[1]
    kinds = [bench.kind(replace(frame, time=1.0, data=bytes(64))) for _ in range(1000)]
    assert kinds.count(FrameClass.SHED) == 1000 - 64
    later = [bench.kind(replace(frame, time=1.0 + k * CYCLE, data=bytes(64))) for k in range(1, 50)]
    assert later == [FrameClass.CORRUPT] * 49


def test_the_account_of_unknown_identifiers_is_bounded() -> None:
    machine = Bench().machine
    before = machine.account.received
    for key in range(1, 1001):
        machine.receive(Frame(identifier=0x10000 + key, data=b"", time=1.0, is_extended=True))
    account = machine.account
    assert len(account.unknown) == LISTED_IDENTIFIERS
    assert account.classes[FrameClass.UNKNOWN_IDENTIFIER] == account.received - before == 1000
    assert account.unaccounted == 0
    assert account.first_time[FrameClass.UNKNOWN_IDENTIFIER] == 1.0


def test_a_copy_of_the_state_goes_on_as_the_machine_does() -> None:
    """The state holds no pointer: a run of 10^9 cycles may be restored, and restarts as a fresh one does."""
    bench = Bench()
    kept = bench.machine._state.copy()
    frames = bench.frames(6)
    first = [repr(result.strain) for result in bench.give(*frames)]
    bench.machine._state[:] = kept
    assert [repr(result.strain) for result in bench.give(*frames)] == first


def test_a_machine_of_a_billion_cycles_restarts_as_a_fresh_one_does() -> None:
    """Counts and times of 116 days at 100 Hz in its state; then a pause of an hour and a new run of the sender."""
    found = []
    for age in (0, 10**9):
        layout = layout_of("fd64", 4)
        machine = Machine(layout, Projection(4), BridgeSettings(), start=age * CYCLE)
        encoder = StrainEncoder(layout, session=7)
        shift = [0.0]
        ears = Ears(encoder, lambda time, shift=shift: time - shift[0])
        random, qualities = np.random.default_rng(1), []
        for k in range(260):
            if k == 130:
                encoder.begin()
                shift[0] = 130 * CYCLE + 3600.0
            number, at = k - 130 * (k >= 130), age * CYCLE + k * CYCLE + 3600.0 * (k >= 130)
            strain = 3e-4 + 2e-6 * random.normal(size=4)
            for frame in encoder.encode(strain, 9e4, cycle=number + age, sample_time=number * CYCLE + age * CYCLE):
                new = [
                    one for one in ears.hear(machine.receive(replace(frame, time=at))) if one.counter is not None
                ]
                qualities += [(one.quality, one.causes, not one.age_uncertainty > 2e-3) for one in new]
        found.append(qualities)
    assert found[0] == found[1]
    assert [quality for quality, *_ in found[0]][-120:] == [Quality.VALID] * 120


@pytest.mark.parametrize(
    ("identifier", "data", "state"),
    [
        (0x40, bytes(8), BusState.BUS_OFF),
        (0x100, bytes(8), BusState.ERROR_ACTIVE),
        (0x04, bytes([0, 0x04]) + bytes(6), BusState.ERROR_WARNING),
        (0x04, bytes([0, 0x20]) + bytes(6), BusState.ERROR_PASSIVE),
        (0x04, bytes([0, 0x40]) + bytes(6), BusState.ERROR_ACTIVE),
        (0x08, bytes(8), BusState.ERROR_WARNING),  # a bit error changes no state
        (0x04, b"", BusState.ERROR_WARNING),
    ],
)
def test_bus_state_after_error_frames(identifier: int, data: bytes, state: BusState) -> None:
    """Bits of linux/can/error.h: CAN_ERR_CRTL 4, CAN_ERR_BUSOFF 0x40, CAN_ERR_RESTARTED 0x100."""
    assert state_after(BusState.ERROR_WARNING, Frame(identifier=identifier, data=data, is_error=True)) is state


def test_back_off_doubles_to_a_bound_and_gives_up() -> None:
    back_off = BackOff(first=0.1, longest=0.5, attempts=4, settle=2.0)
    waits = []
    for _ in range(5):
        assert not back_off.exhausted
        back_off.failed(10.0)
        assert back_off.due is not None
        waits.append(round(back_off.due - 10.0, 6))
    assert waits == [0.1, 0.2, 0.4, 0.5, 0.5]
    assert back_off.exhausted


def test_back_off_starts_again_only_after_the_bus_has_worked_for_a_while() -> None:
    back_off = BackOff(first=0.1, settle=2.0)
    back_off.failed(0.0)
    back_off.opened(1.0)
    back_off.failed(2.0)
    assert back_off.due == pytest.approx(2.2)
    back_off.opened(3.0)
    back_off.failed(6.0)
    assert back_off.due == pytest.approx(6.1)


@pytest.mark.parametrize("wrong", [{"deadline": 1.0}, {"max_age": 0.0}, {"timeout": float("nan")}])
def test_settings_that_cannot_work_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        BridgeSettings(**wrong)
