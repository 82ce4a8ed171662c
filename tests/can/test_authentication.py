"""Freshness: no value is used twice, whatever was recorded and whoever was restarted."""

import numpy as np
import pytest
from can_case import CYCLE, KEY, OWN, Projection, Truth, layout_of, run_campaign
from can_faults import NEED_A_KEY, Fault, FaultKind
from fault_injection import FaultySender

from strainfmu.can.authentic import (
    Authentication,
    AuthenticationKey,
    Authenticity,
    Secured,
    authenticated,
    freshness_of,
)
from strainfmu.can.frame import Frame
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause, FrameClass, Quality
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

SECURED = (Secured(1, 2), Secured(2, 2))


def checked(authentication: Authentication, trip: int, message: int, slot: int = 0) -> Authenticity:
    data = authenticated(b"ab", SECURED[slot], KEY, freshness_of(trip, message))
    return authentication.check(slot, data)


def test_messages_and_trips_only_go_up() -> None:
    check = Authentication(SECURED, KEY)
    assert checked(check, 2, 10) is Authenticity.AUTHENTIC
    assert checked(check, 2, 10) is Authenticity.NOT_FRESH  # a value is used once
    assert checked(check, 2, 9) is Authenticity.NOT_FRESH
    assert checked(check, 2, 10_000_000) is Authenticity.AUTHENTIC
    assert checked(check, 3, 0) is Authenticity.AUTHENTIC
    assert checked(check, 2, 10_000_001) is Authenticity.NOT_FRESH
    assert checked(check, 2, 10_000_001, slot=1) is Authenticity.NOT_FRESH  # nor of another frame of that trip
    assert checked(check, 3, 0, slot=1) is Authenticity.AUTHENTIC


def test_nothing_that_an_earlier_run_reached_is_fresh() -> None:
    check = Authentication(SECURED, KEY)
    check.begin(freshness_of(5, 100))
    for trip, message in ((4, 999), (5, 99), (5, 100)):
        assert checked(check, trip, message) is Authenticity.NOT_FRESH
    assert checked(check, 5, 101) is Authenticity.AUTHENTIC


def test_frames_of_another_key_or_of_another_frame_are_forged() -> None:
    check = Authentication(SECURED, AuthenticationKey(bytes(16)))
    assert checked(check, 2, 10) is Authenticity.FORGED
    check = Authentication(SECURED, KEY)
    data = authenticated(b"ab", SECURED[0], KEY, freshness_of(2, 1))
    assert check.check(1, data) is Authenticity.FORGED


def test_the_first_frame_of_a_run_and_of_a_trip_is_announced() -> None:
    check, announced = Authentication(SECURED, KEY), list[int]()
    check.begin(freshness_of(5, 100))
    check.on_first = announced.append
    for trip, message in ((5, 100), (5, 105), (5, 106), (7, 3), (7, 4)):
        checked(check, trip, message)
    assert announced == [freshness_of(5, 105), freshness_of(7, 3)]


# --- through a whole core -------------------------------------------------------------------------------------


def recorded_run(n_cycles: int, trip: int) -> list[Frame]:
    layout = layout_of("fd64-sec")
    sender, truth = FaultySender(layout, [], trip=trip), Truth(layout.n_gauges, 3)
    return [f for n in range(n_cycles) for f in sender.cycle(n, CYCLE * n, *truth.cycle(n))]


def core_above(reached: int | None) -> Machine:
    layout = layout_of("fd64-sec")
    settings = BridgeSettings(restart="accept")  # this sender hears no results
    core = Machine(layout, Projection(layout.n_gauges), settings, start=0.0, own=[OWN.key])
    assert core.authentication is not None
    core.authentication.begin(reached)
    return core


def results_of(core: Machine, frames: list[Frame]) -> list[Result]:
    results = [result for frame in frames for result in core.receive(frame)]
    core.finish(frames[-1].time)
    assert core.account.unaccounted == core.account.pending == 0
    return results


def test_a_recording_of_an_earlier_run_is_refused_frame_by_frame() -> None:
    frames = recorded_run(60, trip=4)
    first = core_above(None)
    assert [r.quality for r in results_of(first, frames)][-1] is Quality.VALID
    assert first.authentication is not None
    again = core_above(first.authentication.newest)
    assert not any(result.quality.has_coefficients for result in results_of(again, frames))
    assert again.account.classes[FrameClass.NOT_FRESH] == len(frames)
    # The sender goes on with a new trip: all is well.
    following = [r.quality for r in results_of(core_above(first.authentication.newest), recorded_run(60, trip=5))]
    assert following[3:] == [Quality.VALID] * 57


def test_a_run_that_was_not_heard_passes_until_a_newer_one_is() -> None:
    """The limit of a counter, which the documentation states."""
    unheard, heard = recorded_run(30, trip=5), recorded_run(30, trip=6)
    assert results_of(core_above(freshness_of(4, 99)), unheard)[-1].quality is Quality.VALID
    core = core_above(freshness_of(4, 99))
    results_of(core, heard)
    assert core.authentication is not None
    again = core_above(core.authentication.newest)
    assert not any(result.quality.has_coefficients for result in results_of(again, unheard))


def test_a_recording_cannot_take_the_place_of_a_silent_sender() -> None:
    """The true sender stops; its frames of a second ago come again, with live times."""
    frames = recorded_run(200, trip=4)
    per_cycle = len(frames) // 200
    core = core_above(None)
    assert results_of(core, frames)[-1].quality is Quality.VALID
    replayed = [
        Frame(identifier=f.identifier, data=f.data, time=f.time + 1.0, is_fd=True)
        for f in frames[100 * per_cycle :]
    ]
    after = results_of(core, replayed)
    assert after
    assert not any(result.quality.has_coefficients for result in after)


OF_FRAMES = (
    *sorted(NEED_A_KEY, key=lambda kind: kind.value),
    *(FaultKind.CORRUPTION, FaultKind.REPETITION, FaultKind.SEQUENCE, FaultKind.RECORDING, FaultKind.LOSS),
    *(FaultKind.RESTART, FaultKind.CLOCK_JUMP, FaultKind.CONFLICT),
)
"""Faults that act on what is authenticated; test_campaign.py has all without a key, and at random with one."""


@pytest.mark.parametrize("kind", OF_FRAMES)
def test_faults_by_themselves_with_authenticated_frames(kind: FaultKind) -> None:
    gap = BridgeSettings().recovery_cycles + 3
    faults = [Fault(kind=kind, start=20, cycles=1, seed=3), Fault(kind=kind, start=22 + gap, cycles=30, seed=8)]
    run = run_campaign(layout_of("fd64-sec"), faults, 52 + 2 * gap)
    assert run.false_valid == []
    assert run.late_recovery == []


@pytest.mark.parametrize(
    ("kind", "found"),
    [(FaultKind.FORGERY, FrameClass.NOT_AUTHENTIC), (FaultKind.EARLIER_RUN, FrameClass.NOT_FRESH)],
)
def test_what_the_crc_does_not_find_the_authenticator_does(kind: FaultKind, found: FrameClass) -> None:
    faults = [Fault(kind=kind, start=40, cycles=10, seed=1)]
    run = run_campaign(layout_of("fd64-sec"), faults, 80)
    assert run.core.account.classes[found] == 10 * run.core.layout.cycle_length
    assert run.core.account.classes[FrameClass.CORRUPT] == 0


def test_forged_frames_beside_the_true_ones_change_nothing() -> None:
    """A node without the key sends its own frames, CRC and all, ahead of the true ones."""
    strange = AuthenticationKey(bytes(16))

    def intruder(number: int, frames: list[Frame]) -> list[Frame]:
        items = {item.layout.key: item.layout for item in layout_of("fd64-sec").frames}
        forged = []
        for frame in frames:
            secured = items[frame.key].secured
            assert secured is not None
            data = authenticated(frame.data, secured, strange, freshness=freshness_of(2, number))
            forged.append(Frame(identifier=frame.identifier, data=data, time=frame.time, is_fd=True))
        return sorted([*forged, *frames], key=lambda frame: frame.time)

    run = run_campaign(layout_of("fd64-sec"), [], 60, change=intruder)
    assert [result.quality for result in run.results[3:]] == [Quality.VALID] * 57
    assert all(Cause.NOT_AUTHENTIC in result.causes for result in run.results)
    assert run.core.account.classes[FrameClass.NOT_AUTHENTIC] == 60 * run.core.layout.cycle_length


def test_random_bytes_behind_a_right_crc_are_never_used() -> None:
    layout = layout_of("fd64-sec")
    core, random = core_above(None), np.random.default_rng(1)
    items = [item.layout for item in layout.frames]
    for number in range(600):
        item = items[number % len(items)]
        frame = Frame(identifier=item.identifier, data=random.bytes(item.length), time=CYCLE * number, is_fd=True)
        core.receive(frame)
    assert core.account.classes[FrameClass.USED] == 0


def test_a_core_needs_the_key() -> None:
    from strainfmu.can.profiles import profile_layout

    layout = profile_layout("fd64-sec", ["a", "b"], CYCLE)
    with pytest.raises(InputError, match="fd64-sec: frames are authenticated, and no key is given"):
        Machine(layout, Projection(2), BridgeSettings(), start=0.0)


def test_after_clock_jumps_back_and_forth_the_age_is_that_of_the_newest_clock() -> None:
    """The time of a sender that was restarted is over; a later jump ahead must not be taken for its return."""
    kinds = (FaultKind.CLOCK_JUMP, FaultKind.RESTART, FaultKind.CLOCK_JUMP)
    for seed in (1, 23):  # with 23 the last jump ends behind the first clock
        faults = [Fault(kind=kind, start=30 + 40 * i, cycles=1, seed=seed + i) for i, kind in enumerate(kinds)]
        run = run_campaign(layout_of("fd64-sec"), faults, 150)
        assert run.false_valid == []
        assert run.late_recovery == []
