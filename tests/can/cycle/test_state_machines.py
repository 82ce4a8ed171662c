"""The pure state machines by themselves: cycles, clock, gauges, acceptance, bus state, back-off."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest
from can_case import CYCLE, layout_of

from strainfmu.can.bridge.bus.reconnect import BackOff, BackOffSettings
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.account import LISTED_IDENTIFIERS, FrameAccount, FrameClass
from strainfmu.can.cycle.frames.assembler import Arrival, CycleAssembler, Limits, Verdict
from strainfmu.can.cycle.gauges.plausibility import GaugeChecks
from strainfmu.can.cycle.states.bus_state import BusState, state_after
from strainfmu.can.e2e.sample_clock import ClockLimits, ClockReading, SampleClock
from strainfmu.can.e2e.synchronised_clock import SynchronisedClock
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import FrameLayout
from strainfmu.can.wire.signal_plan import SignalPlan
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

NO_SIGNALS = SignalPlan(FrameLayout(name="empty", identifier=0x300, length=0, signals=()))


def arrival(slot: int, sample_time: int | None, time: float = 0.0, counter: int = 0) -> Arrival:
    return Arrival(
        slot=slot,
        frame=Frame(identifier=0x300, data=b"", time=time),
        plan=NO_SIGNALS,
        sample_time=sample_time,
        counter=counter,
    )


def timed(n_slots: int = 2) -> CycleAssembler:
    return CycleAssembler(
        Limits(n_slots=n_slots, trailer=None, deadline=5e-3, clock_bits=32, late_limit=3 * n_slots), [0] * n_slots
    )


def slots(cycles: list) -> list[list[int]]:
    return [sorted(cycle.slots) for cycle in cycles]


def test_a_complete_cycle_is_closed_at_once() -> None:
    assembler = timed()
    assert assembler.offer(arrival(1, 100)) == (Verdict.ACCEPTED, [])
    verdict, closed = assembler.offer(arrival(0, 100))
    assert (verdict, slots(closed)) == (Verdict.ACCEPTED, [[0, 1]])
    assert assembler.deadline == inf


def test_a_frame_of_the_next_cycle_closes_a_partial_one_and_late_ones_are_refused() -> None:
    assembler = timed()
    assembler.offer(arrival(0, 100))
    verdict, closed = assembler.offer(arrival(0, 200))
    assert (verdict, slots(closed)) == (Verdict.ACCEPTED, [[0]])
    assert assembler.offer(arrival(1, 100))[0] is Verdict.LATE
    assert assembler.offer(arrival(0, 200))[0] is Verdict.REPEATED
    assert slots(assembler.offer(arrival(1, 200))[1]) == [[0, 1]]
    assert assembler.offer(arrival(1, 200))[0] is Verdict.LATE, "its cycle is closed"


def test_the_deadline_closes_a_partial_cycle() -> None:
    assembler = timed()
    assembler.offer(arrival(0, 100, time=1.0))
    assert assembler.deadline == 1.005
    assert assembler.due(1.0049) == []
    assert slots(assembler.due(1.005)) == [[0]]


def test_the_same_time_with_another_counter_is_no_part_of_the_cycle() -> None:
    assembler = timed()
    assembler.offer(arrival(0, 100, counter=4))
    assert assembler.offer(arrival(1, 100, counter=5))[0] is Verdict.LATE


def test_sample_times_wrap() -> None:
    assembler = timed(1)
    for ticks in (2**32 - 10, 5, 2**31):
        assert assembler.offer(arrival(0, ticks))[0] is Verdict.ACCEPTED
    assert assembler.offer(arrival(0, 5))[0] is Verdict.LATE


def test_nothing_but_late_frames_is_a_restart() -> None:
    assembler = timed()
    assembler.offer(arrival(0, 1_000_000))
    verdicts = [assembler.offer(arrival(k % 2, 10 * (k // 2)))[0] for k in range(8)]
    assert verdicts == [Verdict.LATE] * 6 + [Verdict.RESTARTED, Verdict.ACCEPTED]


def test_without_times_a_repeated_frame_or_the_trailer_ends_a_cycle() -> None:
    plain = CycleAssembler(
        Limits(n_slots=3, trailer=None, deadline=5e-3, clock_bits=None, late_limit=9), [0, 0, 0]
    )
    plain.offer(arrival(0, None))
    plain.offer(arrival(1, None))
    assert slots(plain.offer(arrival(0, None))[1]) == [[0, 1]]
    closing = CycleAssembler(Limits(n_slots=3, trailer=2, deadline=5e-3, clock_bits=None, late_limit=9), [0, 0, 0])
    closing.offer(arrival(0, None))
    assert slots(closing.offer(arrival(2, None))[1]) == [[0, 2]]


# --- the sender's clock

LIMITS = ClockLimits(jump_tolerance=CYCLE)


def test_age_is_the_delay_beyond_the_least_and_drift_is_none() -> None:
    """A clock 50 ppm slow, delays of 1 ms and now and then 8 ms: age 0 and 7 ms, drift to 1 ppm."""
    clock = SampleClock(1e-6, 32, LIMITS)
    ages = []
    for k in range(4000):
        source = k * CYCLE
        delay = 8e-3 if k % 7 == 3 else 1e-3
        ages.append(clock.read(source * (1.0 + 50e-6) + delay, round(source * 1e6) % 2**32).age)
    late = np.arange(4000) % 7 == 3
    # The smallest delay is raised at 100 ppm, of which 50 are drift: 0.5e-6 s a cycle.
    assert np.abs(np.array(ages)[~late]).max() < 2e-5
    assert np.array(ages)[late] == pytest.approx(7e-3, abs=2e-5)
    assert clock.drift_ppm == pytest.approx(50.0, abs=1.0)


def test_a_growing_delay_is_age() -> None:
    clock = SampleClock(1e-6, 32, LIMITS)
    ages = [clock.read(k * CYCLE * 1.1, round(k * CYCLE * 1e6)).age for k in range(101)]
    # Each cycle comes 1 ms later than the one before; 1 us of that may be drift.
    assert ages[-1] == pytest.approx(0.1, abs=0.001)


def test_one_odd_time_changes_nothing_and_three_consistent_ones_are_a_restart() -> None:
    clock = SampleClock(1e-6, 32, LIMITS)
    for k in range(10):
        assert not clock.read(k * CYCLE, round(k * CYCLE * 1e6)).jumped
    assert clock.read(10 * CYCLE, 0).jumped, "an old frame again"
    assert not clock.read(11 * CYCLE, round(11 * CYCLE * 1e6)).jumped
    assert clock.read(12 * CYCLE, 50_000_000).jumped, "far ahead"
    readings = [clock.read((13 + k) * CYCLE, round(k * CYCLE * 1e6)) for k in range(4)]
    assert [(r.jumped, r.restarted) for r in readings] == [(True, False)] * 2 + [(True, True), (False, False)]


def test_the_clock_wraps() -> None:
    clock = SampleClock(1e-4, 16, LIMITS)
    for k in range(2000):  # 20 s; 16 bits of 0.1 ms are 6.6 s
        reading = clock.read(k * CYCLE, round(k * CYCLE * 1e4) % 2**16)
        assert not reading.jumped
        assert reading.age < 1e-4 + 1e-5


def read_all(clock: SampleClock, growth: float, duration: float, rate: float = 0.0) -> list[ClockReading]:
    """Return readings of a delay that grows by ``growth`` and a clock that is slow by ``rate`` [s/s]."""
    times = np.arange(0.0, duration, 0.1)
    return [clock.read(t * (1.0 + growth), round(t * (1.0 - rate) * 1e6) % 2**32) for t in times.tolist()]


def test_drift_is_raised_to_a_bound_and_what_grows_beyond_is_age() -> None:
    for growth in (60e-6, 100e-6, 190e-6, 1e-3):
        readings = read_all(SampleClock(1e-6, 32, LIMITS), growth, 600.0)
        hidden = [growth * 0.1 * k - reading.age for k, reading in enumerate(readings)]
        assert max(hidden) <= 10.0e-3 + 2e-6
        first = next(k for k, reading in enumerate(readings) if reading.hides_delay)
        assert first * 0.1 == pytest.approx(10e-3 / min(growth, 100e-6), rel=0.01)
        assert all(reading.hides_delay for reading in readings[first:])


@pytest.mark.parametrize("growth", [0.0, 60e-6, 190e-6, 1e-3])
@pytest.mark.parametrize("rate", [-99e-6, 0.0, 99e-6])
def test_the_true_age_is_never_beyond_the_stated_uncertainty(growth: float, rate: float) -> None:
    """Even where the drift of the sender's clock hides the growth of the delay."""
    readings = read_all(SampleClock(1e-6, 32, LIMITS), growth, 600.0, rate)
    beyond = [growth * 0.1 * k - r.age - r.uncertainty for k, r in enumerate(readings)]
    assert max(beyond) < 2e-6


def test_a_clock_of_known_rate_hides_nothing() -> None:
    limits = ClockLimits(jump_tolerance=CYCLE, rate=80e-6, tolerance=2e-6)
    clock = SampleClock(1e-6, 32, limits)
    readings = read_all(clock, 0.0, 1200.0, rate=80e-6)
    assert not any(reading.hides_delay for reading in readings)
    assert readings[-1].uncertainty < 2.5e-3
    assert readings[-1].age < 1e-4
    assert clock.drift_ppm == pytest.approx(80.0, abs=0.5)


LEARNING = ClockLimits(jump_tolerance=CYCLE, learn=600.0)


@pytest.mark.parametrize("rate", [-90e-6, -50e-6, 0.0, 50e-6, 90e-6])
def test_the_rate_of_a_clock_is_measured_and_its_age_stays_bounded(rate: float) -> None:
    """Slow or fast: from ``learn`` on nothing is hidden, and the uncertainty is small."""
    clock = SampleClock(1e-6, 32, LEARNING)
    readings = read_all(clock, 0.0, 3000.0, rate)
    assert not any(reading.hides_delay for reading in readings[6_200:])
    assert max(reading.age for reading in readings[6_200:]) < 1e-4
    assert max(reading.uncertainty for reading in readings[6_200:]) < 1e-4
    assert clock.drift_ppm == pytest.approx(1e6 * rate, abs=0.5)


@pytest.mark.parametrize("rate", [-100e-6, -50e-6, 50e-6, 95e-6])
@pytest.mark.parametrize("seconds_per_cycle", [0.01, 0.1])
def test_a_slow_clock_is_followed_before_its_rate_is_measured(rate: float, seconds_per_cycle: float) -> None:
    """Within the tolerance of 100 ppm no result waits for the measurement; the true age, 0, is within bounds."""
    clock = SampleClock(1e-6, 32, LEARNING)
    for k in range(int(900 / seconds_per_cycle)):
        t = k * seconds_per_cycle
        reading = clock.read(t, round(t * (1.0 - rate) * 1e6) % 2**32)
        assert not reading.hides_delay, t
        assert reading.age - reading.uncertainty < 1e-5
        assert reading.age < 6.5e-3
    assert reading.uncertainty < 1e-3


@pytest.mark.parametrize("growth", [-30e-6, 60e-6, 95e-6])
@pytest.mark.parametrize("rate", [-60e-6, 0.0])
def test_a_queue_that_grows_like_a_slow_clock_is_in_the_uncertainty_until_then(growth: float, rate: float) -> None:
    clock, true = SampleClock(1e-6, 32, LEARNING), 0.0
    for k in range(5990):
        t = 0.1 * k
        true = growth * t if growth > 0.0 else max(-growth * (300.0 - t), 0.0)
        reading = clock.read(t + true, round(t * (1.0 - rate) * 1e6) % 2**32)
        assert true - reading.age - reading.uncertainty < 1e-5 + (9e-3 if growth < 0.0 else 0.0)


def test_a_delay_that_begins_to_grow_behind_the_measurement_is_age() -> None:
    """A queue that grows by 60 ppm looks like a slow clock at the start, and does not where the rate is known."""
    clock = SampleClock(1e-6, 32, LEARNING)
    for k in range(25_900):
        t = 0.1 * k
        true = 60e-6 * max(t - 2000.0, 0.0)
        reading = clock.read(t + true, round(t * (1.0 + 30e-6) * 1e6) % 2**32)
        assert true - reading.age - reading.uncertainty < 1e-4
        if t > 2300.0:
            assert reading.age > 0.5 * true


def test_a_rate_beyond_the_tolerance_is_not_learned() -> None:
    readings = read_all(SampleClock(1e-6, 32, LEARNING), 190e-6, 2000.0)
    assert all(reading.hides_delay for reading in readings[1100:])
    assert readings[-1].age > 0.3


def test_a_restart_begins_the_measurement_again() -> None:
    clock = SampleClock(1e-6, 32, LEARNING)
    read_all(clock, 0.0, 1000.0, 50e-6)
    for k in range(10):
        reading = clock.read(1000.1 + 0.1 * k, round(1e5 * k))
    assert clock.record.is_learned == 0
    assert reading.uncertainty >= 1e-4 * 0.7, "that of the stated tolerance"


def test_a_fast_clock_hides_nothing_and_a_drained_queue_gives_back_what_was_hidden() -> None:
    assert not any(r.hides_delay for r in read_all(SampleClock(1e-6, 32, LIMITS), 0.0, 600.0, rate=-90e-6))
    clock = SampleClock(1e-6, 32, LIMITS)
    assert read_all(clock, 190e-6, 300.0)[-1].hides_delay
    assert not clock.read(300.0, 300_000_000).hides_delay


def test_a_restart_of_the_sender_keeps_what_a_queue_may_hide() -> None:
    clock = SampleClock(1e-6, 32, LIMITS)
    before = read_all(clock, 190e-6, 300.0)[-1]
    after = [clock.read(300.1 + 0.1 * k, 100_000 * k) for k in range(5)][-1]
    assert after.hides_delay
    assert after.uncertainty >= before.uncertainty
    clock.anchor()
    assert not clock.read(300.6, 500_000).hides_delay, "somebody has checked the delay"


def test_a_clock_of_before_comes_back_unless_the_new_one_was_accepted() -> None:
    for accepted in (False, True):
        clock = SampleClock(1e-6, 32, LIMITS)
        for k in range(50):
            clock.read(k * CYCLE, 10_000 * k)
        readings = [clock.read((50 + k) * CYCLE, 10_000 * k) for k in range(6)]
        assert [r.jumped for r in readings] == [True] * 3 + [False] * 3
        if accepted:
            clock.accept()
        back = clock.read(56 * CYCLE, 560_000)
        assert (back.resumed, back.jumped) == (not accepted, accepted)


def test_after_a_long_silence_our_clock_tells_how_often_the_other_wrapped() -> None:
    clock = SampleClock(1e-4, 16, LIMITS)
    clock.read(0.0, 0)
    reading = clock.read(100.0, round(100.0 * 1e4) % 2**16)
    assert (reading.jumped, reading.age) == (False, pytest.approx(0.0, abs=1e-4))


def test_synchronised_times_are_absolute() -> None:
    clock = SynchronisedClock(1e-6, 32, shift=1.7e9, accuracy=1e-3)

    def ticks(time: float) -> int:
        return round((1.7e9 + time) * 1e6) % 2**32

    late = clock.read(5.0, ticks(4.98))
    assert (late.age, late.uncertainty) == (pytest.approx(20e-3, abs=1e-6), 1e-3)
    assert clock.read(6.0, ticks(6.0005)).age == 0.0
    assert clock.read(6.0, ticks(6.002)).jumped, "from the future"
    assert clock.read(7.0, ticks(6.0)).age == pytest.approx(1.0, abs=1e-5), "a recording is as old as it is"


# --- gauges


def verdicts(strains: list[float], settings: BridgeSettings | None = None) -> list[bool]:
    """Return the verdict on one gauge over cycles, beside another that is well."""
    checks = GaugeChecks(2, CYCLE, settings or BridgeSettings(stuck_cycles=25, zero_cycles=5))
    found = []
    present = np.ones(2, dtype=bool)
    for k, value in enumerate(strains):
        strain = np.array([value, 100e-6 + 1e-6 * (k % 2)])
        raw = np.rint(np.nan_to_num(strain) / 0.25e-6).astype(np.int64)
        valid = checks.update(strain, raw, present=present, refused=np.zeros(2, dtype=bool), now=k * CYCLE)
        assert valid[1]
        found.append(bool(valid[0]))
    return found


def moving(n: int, start: float = 200e-6) -> list[float]:
    return [start + 1e-6 * (k % 3) for k in range(n)]


@pytest.mark.parametrize(
    ("strains", "bad"),
    [
        (moving(10), []),
        ([*moving(3), np.nan, *moving(5)], [3, 4, 5]),
        ([*moving(3), 0.06, *moving(5)], [3, 4, 5, 6]),  # out of range, then a jump back, then good again
        ([*moving(3), 0.003, *moving(5)], [3, 4, 5, 6]),  # a jump up and down
        ([*moving(3), 0.0, *moving(5)], [3, 4, 5]),
        ([*moving(3), *[0.0] * 9], list(range(3, 12))),
        ([0.0] * 9, list(range(4, 9))),  # zero from the start: five in a row
        ([6e-6, 3e-6, 0.0, -3e-6, -6e-6], []),  # moving through zero at its own pace
        ([200e-6] * 30, list(range(25, 30))),
    ],
)
def test_gauges_are_left_out_and_used_again(strains: list[float], bad: list[int]) -> None:
    assert [k for k, valid in enumerate(verdicts(strains)) if not valid] == bad


def test_constant_signals_can_be_allowed_but_zeros_are_always_found() -> None:
    constant = BridgeSettings(stuck_cycles=0, zero_cycles=5)
    assert all(verdicts([200e-6] * 60, constant))
    assert not any(verdicts([*moving(3), *[0.0] * 50], constant)[3:])
    with pytest.raises(InputError, match="zero_cycles: expected a positive number, got 0"):
        BridgeSettings(zero_cycles=0)


# --- acceptance, account, bus


def test_more_frames_than_a_sender_can_mean_are_shed_and_the_next_cycles_are_not() -> None:
    layout = layout_of("fd64")
    acceptance = Acceptance(layout, [], BridgeSettings())
    frame = layout.strain_frames[0].layout
    burst = [
        acceptance.refused(Frame(identifier=frame.identifier, data=bytes(64), time=1.0, is_fd=True))
        for _ in range(1000)
    ]
    assert burst.count(FrameClass.SHED) == 1000 - 64
    later = [
        acceptance.refused(Frame(identifier=frame.identifier, data=bytes(64), time=1.0 + k * CYCLE, is_fd=True))
        for k in range(1, 50)
    ]
    assert later == [None] * 49


def test_the_account_of_unknown_identifiers_is_bounded() -> None:
    account = FrameAccount()
    for key in range(10_000):
        account.received += 1
        account.refuse(FrameClass.UNKNOWN_IDENTIFIER, key, 1.0 * key)
    assert len(account.unknown) == LISTED_IDENTIFIERS
    assert account.classes[FrameClass.UNKNOWN_IDENTIFIER] == 10_000
    assert account.unaccounted == 0
    assert account.first_time[FrameClass.UNKNOWN_IDENTIFIER] == 0.0
    assert account.plus(account).received == 20_000


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
    back_off = BackOff(BackOffSettings(first=0.1, longest=0.5, attempts=4, settle=2.0))
    waits = []
    for _ in range(5):
        assert not back_off.exhausted
        back_off.failed(10.0)
        assert back_off.due is not None
        waits.append(round(back_off.due - 10.0, 6))
    assert waits == [0.1, 0.2, 0.4, 0.5, 0.5]
    assert back_off.exhausted


def test_back_off_starts_again_only_after_the_bus_has_worked_for_a_while() -> None:
    back_off = BackOff(BackOffSettings(first=0.1, settle=2.0))
    back_off.failed(0.0)
    back_off.opened(1.0)
    back_off.failed(2.0)
    assert back_off.due == pytest.approx(2.2)
    back_off.opened(3.0)
    back_off.failed(6.0)
    assert back_off.due == pytest.approx(6.1)
    assert back_off.reconnects == 2


@pytest.mark.parametrize("wrong", [{"deadline": 1.0}, {"max_age": 0.0}, {"timeout": float("nan")}])
def test_settings_that_cannot_work_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        BridgeSettings(**wrong)
