"""CRC and counter against the package autosar-e2e; the state machine against AUTOSAR PRS_E2EProtocol."""

from __future__ import annotations

import numpy as np
import pytest
from e2e import p01, p05

from strainfmu.can.e2e.check import E2EStatus, ReceptionCheck
from strainfmu.can.e2e.state_machine import E2EState, E2EStateMachine, StateMachineSettings
from strainfmu.can.wire.crc import Protection, counter_in, crc_in, crc_of, protect

pytestmark = pytest.mark.fast

OK, LOST, REPEATED = E2EStatus.OK, E2EStatus.OK_SOME_LOST, E2EStatus.REPEATED
WRONG, ERROR, NOTHING = E2EStatus.WRONG_SEQUENCE, E2EStatus.ERROR, E2EStatus.NO_NEW_DATA


@pytest.mark.parametrize("seed", range(10))
def test_profile_5_is_that_of_autosar_e2e(seed: int) -> None:
    random = np.random.default_rng(seed)
    for _ in range(50):
        one_frame_of_profile_5(random)


def one_frame_of_profile_5(random: np.random.Generator) -> None:
    data_id, counter = int(random.integers(1 << 16)), int(random.integers(256))
    data = random.bytes(int(random.integers(3, 65)))
    ours = protect(data, Protection(5, data_id), counter)
    theirs = bytearray(ours)
    theirs[:2] = b"\0\0"
    p05.e2e_p05_protect(theirs, data_id, increment_counter=False)
    assert ours == bytes(theirs)
    assert p05.e2e_p05_check(ours, data_id)
    assert counter_in(ours, Protection(5, data_id)) == counter


@pytest.mark.parametrize("seed", range(10))
def test_profile_1_is_that_of_autosar_e2e(seed: int) -> None:
    random = np.random.default_rng(seed)
    for _ in range(50):
        one_frame_of_profile_1(random)


def one_frame_of_profile_1(random: np.random.Generator) -> None:
    data_id, counter = int(random.integers(1 << 16)), int(random.integers(15))
    data = random.bytes(int(random.integers(2, 9)))
    ours = protect(data, Protection(1, data_id), counter)
    theirs = bytearray(ours)
    theirs[0] = 0
    p01.e2e_p01_protect(theirs, data_id, increment_counter=False)
    assert ours == bytes(theirs)
    assert p01.e2e_p01_check(bytearray(ours), data_id)
    assert ours[1] >> 4 == data[1] >> 4, "the upper nibble is the user's"


@pytest.mark.parametrize(("profile", "length"), [(5, 64), (1, 8)])
def test_every_single_flipped_bit_and_every_other_data_id_bit_is_found(profile: int, length: int) -> None:
    protection = Protection(profile, 0x1234)
    data = protect(bytes(range(length)), protection, 7)
    for bit in range(8 * length):
        wrong = bytearray(data)
        wrong[bit // 8] ^= 1 << bit % 8
        assert crc_in(wrong, protection) != crc_of(wrong, protection)
        assert ReceptionCheck(protection, 3, period=0.01).check(bytes(wrong)) is ERROR
    assert ReceptionCheck(protection, 3, period=0.01).check(data) is WRONG, "the first reception"
    for bit in range(16):
        other = Protection(profile, 0x1234 ^ 1 << bit)
        assert crc_in(data, other) != crc_of(data, other)
        assert ReceptionCheck(other, 3, period=0.01).check(data) is ERROR


@pytest.mark.parametrize("profile", [1, 5])
def test_bytes_behind_the_end_are_under_no_crc_and_short_frames_have_none(profile: int) -> None:
    protection = Protection(profile, 0x1234, end=6)
    data = bytearray(protect(bytes(range(8)), protection, 1))
    data[6] ^= 1
    assert ReceptionCheck(protection, 3, period=0.01).check(bytes(data)) is not ERROR
    data[5] ^= 1
    assert ReceptionCheck(protection, 3, period=0.01).check(bytes(data)) is ERROR
    for length in range(2 if profile == 1 else 3):
        assert ReceptionCheck(Protection(profile, 0), 3, period=0.01).check(bytes(length)) is ERROR
    with pytest.raises(ValueError, match="expected up to 64 bytes, got 65"):
        ReceptionCheck(protection, 3, period=0.01).check(bytes(65))


def test_bytes_of_other_frames_are_under_the_crc() -> None:
    protection = Protection(5, 9)
    data = protect(bytes(8), protection, 1, covered=b"strains")
    assert crc_in(data, protection) == crc_of(data, protection, b"strains")
    assert crc_in(data, protection) != crc_of(data, protection, b"strainz")
    for covered, status in ((b"strains", LOST), (b"strainz", ERROR)):
        assert ReceptionCheck(protection, 3, n_covered=7, period=0.01).check(data, covered) is status
    # Equal to one frame of all these bytes: data behind the CRC, then the covered ones.
    joined = bytearray(data + b"strains")
    assert p05.e2e_p05_check(bytes(joined), 9)


@pytest.mark.parametrize(("profile", "length", "modulus"), [(5, 16, 256), (1, 8, 15)])
def test_counter_statuses(profile: int, length: int, modulus: int) -> None:
    """E2E_P05Check with MaxDeltaCounter 3: what is received next to a counter of 10, and what follows it."""
    protection = Protection(profile, 77)

    def frame(counter: int) -> bytes:
        return protect(bytes(length), protection, counter)

    for counter, status in ((11, OK), (12, LOST), (13, LOST), (14, WRONG), (10, REPEATED), (9, WRONG)):
        check = ReceptionCheck(protection, 3, period=0.01)
        assert check.check(frame(10)) is WRONG, "the first reception is in no sequence"
        assert check.check(frame(counter)) is status
        assert check.check(frame(counter + 1)) is OK, "the counter is taken over whatever the status"
    check = ReceptionCheck(protection, 3, period=0.01)
    assert check.check(frame(0)) is OK, "a sender's first frame"
    check.check(frame(modulus - 1))
    assert check.check(frame(modulus)) is OK, "wraps"
    broken = bytearray(frame(1))
    broken[-1] ^= 1
    assert check.check(bytes(broken)) is ERROR
    assert check.check(frame(1)) is OK, "an error leaves the counter alone"


def test_profile_1_never_uses_counter_15() -> None:
    protection = Protection(1, 77)
    data = bytearray(8)
    data[1] = 15
    data[0] = crc_of(data, protection)
    assert ReceptionCheck(protection, 14, period=0.01).check(bytes(data)) is ERROR


SETTINGS = StateMachineSettings(
    window_size=5,
    min_ok_init=2,
    max_error_init=1,
    min_ok_valid=1,
    max_error_valid=1,
    min_ok_invalid=3,
    max_error_invalid=0,
)


@pytest.mark.parametrize(
    ("statuses", "state"),
    [
        ([], E2EState.NO_DATA),
        ([ERROR, NOTHING, ERROR], E2EState.NO_DATA),
        ([WRONG], E2EState.INIT),
        ([OK, OK], E2EState.INIT),  # the check that leaves NODATA is not in the window
        ([OK, OK, OK], E2EState.VALID),
        ([OK, OK, LOST], E2EState.VALID),
        ([OK, ERROR, ERROR], E2EState.INVALID),
        ([OK, ERROR, OK, OK], E2EState.VALID),
        ([OK, OK, OK, ERROR], E2EState.VALID),
        ([OK, OK, OK, ERROR, ERROR], E2EState.INVALID),
        ([OK, OK, OK, REPEATED, REPEATED, REPEATED, REPEATED], E2EState.VALID),
        ([OK, OK, OK, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING], E2EState.INVALID),
        ([OK, ERROR, ERROR, OK, OK, OK], E2EState.INVALID),  # an error is still in the window
        ([OK, ERROR, ERROR, OK, OK, OK, OK], E2EState.INVALID),
        ([OK, ERROR, ERROR, OK, OK, OK, OK, OK], E2EState.VALID),
    ],
)
def test_state_machine(statuses: list[E2EStatus], state: E2EState) -> None:
    """By hand from E2E_SMCheck: WindowSize 5, MinOkState 2/1/3 and MaxErrorState 1/1/0 of Init, Valid, Invalid."""
    machine = E2EStateMachine(SETTINGS)
    for status in statuses:
        machine.add(status)
    assert machine.state is state


def test_state_machine_against_counting_the_window_again() -> None:
    random = np.random.default_rng(4)
    machine, history, state = E2EStateMachine(SETTINGS), [], E2EState.NO_DATA
    for _ in range(5000):
        status = list(E2EStatus)[int(random.integers(6))] if random.random() < 0.5 else OK
        if state is E2EState.NO_DATA:
            state = state if status in (ERROR, NOTHING) else E2EState.INIT
        else:
            history.append(status)
            window = history[-5:]
            ok, bad = sum(s in (OK, LOST) for s in window), window.count(ERROR)
            limits = {E2EState.INIT: (2, 1), E2EState.VALID: (1, 1), E2EState.INVALID: (3, 0)}[state]
            if ok >= limits[0] and bad <= limits[1]:
                state = E2EState.VALID
            elif state is E2EState.VALID or bad > limits[1]:
                state = E2EState.INVALID
        assert machine.add(status) is state


@pytest.mark.parametrize("profile", [1, 5])
def test_other_data_with_the_counter_of_either_of_the_last_two_frames_conflict(profile: int) -> None:
    """A gateway that holds frames back puts those of a second sender behind both true ones."""
    protection = Protection(profile, 0x123)
    check = ReceptionCheck(protection, max_delta=3, period=0.01)
    true, other = (
        [protect(bytes(4) + bytes([10 * sender + k] * 4), protection, 5 + k) for k in range(2)]
        for sender in (1, 2)
    )
    found = []
    for data in (*true, *other):
        check.check(data)
        found.append(check.conflicts)
    assert found == [False, False, True, False]
    again = ReceptionCheck(protection, max_delta=3, period=0.01)
    for data in (*true, true[0]):
        again.check(data)
    assert not again.conflicts, "the same frame once more is no other sender"


def arrivals(modulus: int, sent: list[tuple[float, int, int]]) -> list[tuple[bool, bool]]:
    """Return what the check finds of frames: period of arrival, counter and sender of each."""
    protection = Protection(1 if modulus == 15 else 5, 0x123)
    check, found = ReceptionCheck(protection, max_delta=3, period=0.01), []
    for period, counter, sender in sent:
        data = bytes(4) + bytes([sender, counter % 200, 0, 0])
        check.check(protect(data, protection, counter), time=0.01 * period)
        found.append((check.conflicts, check.alternates))
    return found


@pytest.mark.parametrize("modulus", [15, 256])
def test_a_counter_that_comes_round_again_behind_a_silence_is_of_the_same_sender(modulus: int) -> None:
    sent = [(k, k, 1) for k in range(3)]
    assert not any(map(any, arrivals(modulus, [*sent, (modulus + 2, modulus + 2, 1)])))
    assert arrivals(modulus, [*sent, (3, 2, 2)])[-1] == (True, False)


@pytest.mark.parametrize("modulus", [15, 256])
def test_a_frame_that_was_missing_and_comes_late_is_of_the_same_sender(modulus: int) -> None:
    order = [0, 1, 3, 2, 4, 5, 7, 6, 9, 10, 12, 11]
    assert not any(map(any, arrivals(modulus, [(k, counter, 1) for k, counter in enumerate(order)])))


@pytest.mark.parametrize(("modulus", "ahead"), [(15, k) for k in range(15)] + [(256, k) for k in (1, 2, 3, 4, 90)])
def test_two_senders_in_turns_are_found_whatever_their_counters(modulus: int, ahead: int) -> None:
    sent = [
        (k + shift, k + more, sender) for k in range(20) for more, sender, shift in ((0, 1, 0.0), (ahead, 2, 0.3))
    ]
    found = arrivals(modulus, sent)
    assert sum(conflicts or alternates for conflicts, alternates in found[:20]) >= 3
