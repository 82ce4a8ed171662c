"""CRC and counter against the package autosar-e2e; the machine's checks against AUTOSAR PRS_E2EProtocol."""

from collections.abc import Iterable

import numpy as np
import pytest
from altered_frames import counter_in, crc_in
from can_case import CYCLE, Projection, layout_of
from e2e import p01, p05

from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame, Protection, crc_of, protect
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause, FrameClass

pytestmark = pytest.mark.fast

MODULUS = {"fd64": 256, "classic-le": 15}
USED, NOT_TRUSTED, REPEATED = FrameClass.USED, FrameClass.NOT_TRUSTED, FrameClass.REPEATED
WRONG, CORRUPT = FrameClass.WRONG_SEQUENCE, FrameClass.CORRUPT


class Bench:
    """The frame of q_inf of a profile, sent alone: each comes to its class at once."""

    def __init__(self, profile: str) -> None:
        self.layout = layout_of(profile, 4)
        self.item = self.layout.flow_frames[0].layout
        self.machine: Machine = Machine(self.layout, Projection(4), BridgeSettings(), start=0.0)
        self._encoder, self.time = StrainEncoder(self.layout), 0.0
        self.causes = Cause.NONE

    def frame(self, counter: int, pressure: float = 9e4) -> bytes:
        frames = self._encoder.encode(np.zeros(4), pressure, cycle=counter, sample_time=CYCLE * counter)
        return next(frame.data for frame in frames if frame.key == self.item.key)

    def give(self, data: bytes, periods: float = 1.0) -> FrameClass:
        """Return the class of the frame with ``data``, which comes so many periods behind the one before."""
        before, self.time = self.machine.account.classes, self.time + periods * CYCLE
        frame = Frame(identifier=self.item.identifier, data=data, time=self.time, is_fd=self.item.is_fd)
        for result in self.machine.receive(frame):
            self.causes |= result.causes
        after = self.machine.account.classes
        return next(kind for kind in FrameClass if after[kind] > before[kind])

    def all(self, counters: Iterable[int]) -> list[FrameClass]:
        return [self.give(self.frame(counter)) for counter in counters]


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


@pytest.mark.parametrize("profile", MODULUS)
def test_every_single_flipped_bit_and_every_other_data_id_bit_is_found(profile: str) -> None:
    bench = Bench(profile)
    data, protection = bench.frame(7), bench.item.protection
    assert protection is not None
    for bit in range(8 * len(data)):
        wrong = bytearray(data)
        wrong[bit // 8] ^= 1 << bit % 8
        assert crc_in(wrong, protection) != crc_of(wrong, protection)
        assert bench.give(bytes(wrong)) is CORRUPT
    assert bench.give(data) is NOT_TRUSTED, "the first whole one"
    for bit in range(16):
        other = Protection(protection.profile, protection.data_id ^ 1 << bit)
        assert crc_in(data, other) != crc_of(data, other)
        assert bench.give(protect(data, other, 8 + bit % 4)) is CORRUPT


def test_bytes_behind_the_end_are_under_no_crc_and_those_of_other_frames_are() -> None:
    for profile in (1, 5):
        protection = Protection(profile, 0x1234, end=6)
        data = bytearray(protect(bytes(range(8)), protection, 1))
        for place, is_whole in ((6, True), (5, False)):
            data[place] ^= 1
            assert (crc_in(data, protection) == crc_of(data, protection)) is is_whole
    protection = Protection(5, 9)
    whole = protect(bytes(8), protection, 1, covered=b"strains")
    assert crc_in(whole, protection) == crc_of(whole, protection, b"strains")
    assert crc_in(whole, protection) != crc_of(whole, protection, b"strainz")
    # Equal to one frame of all these bytes: data behind the CRC, then the covered ones.
    assert p05.e2e_p05_check(bytes(whole + b"strains"), 9)


@pytest.mark.parametrize("profile", MODULUS)
def test_counter_statuses(profile: str) -> None:
    """E2E_P05Check with MaxDeltaCounter 3: what is received next to a counter of 10, and what follows it."""
    for counter, kind in ((11, USED), (12, USED), (13, USED), (14, WRONG), (10, REPEATED), (9, WRONG)):
        bench = Bench(profile)
        assert bench.all([6, 7, 8, 9, 10])[3:] == [USED] * 2
        assert bench.all([counter]) == [kind]
        assert bench.all([counter + 1]) == [USED], "the counter is taken over whatever its class"
    bench = Bench(profile)
    assert bench.all(range(MODULUS[profile] - 6, MODULUS[profile] + 2))[3:] == [USED] * 5, "wraps"
    broken = bytearray(bench.frame(2))
    broken[-1] ^= 1
    assert bench.give(bytes(broken)) is CORRUPT
    assert bench.all([2]) == [USED], "an error leaves the counter alone"


def test_profile_1_never_uses_counter_15() -> None:
    bench = Bench("classic-le")
    data, protection = bytearray(bench.frame(3)), bench.item.protection
    assert protection is not None
    data[1] |= 15
    data[0] = crc_of(data, protection)
    assert bench.give(bytes(data)) is CORRUPT


def test_trust_against_counting_the_window_again() -> None:
    """E2E_SMCheck: WindowSize 10, MinOkState 3/1/3 and MaxErrorState 1/2/1 of Init, Valid, Invalid."""
    bench, random, counter, state = Bench("fd64"), np.random.default_rng(4), 0, "no data"
    window: list[str] = []
    seen: set[tuple[str, FrameClass]] = set()
    for _ in range(4000):
        kind = str(random.choice(["ok", "error", "again"], p=[0.6, 0.3, 0.1]))
        kind = "ok" if random.random() < 0.6 else kind
        counter += kind == "ok"
        data = bytearray(bench.frame(counter))
        data[-1] ^= kind == "error"
        if state == "no data":
            kind = "ok" if counter == 0 and kind == "again" else kind
            state = state if kind == "error" else "init"
        else:
            window = [*window, kind][-10:]
            ok, errors = window.count("ok"), window.count("error")
            few_ok, many_errors = {"init": (3, 1), "valid": (1, 2), "invalid": (3, 1)}[state]
            if ok >= few_ok and errors <= many_errors:
                state = "valid"
            elif state == "valid" or errors > many_errors:
                state = "invalid"
        expected = {"error": CORRUPT, "again": REPEATED}.get(kind, USED if state == "valid" else NOT_TRUSTED)
        assert bench.give(bytes(data)) is expected
        seen.add((state, expected))
    assert len(seen) >= 7


def alarms(profile: str, sent: list[tuple[float, int, int]]) -> bool:
    """Return whether a second sender is found: periods of arrival, counter and sender of each frame, in order."""
    bench, before = Bench(profile), 0.0
    for period, counter, sender in sent:
        bench.give(bench.frame(counter, pressure=9e4 + sender), period - before)
        before = period
    for result in bench.machine.advance(bench.time + 5 * CYCLE):
        bench.causes |= result.causes
    return bool(bench.causes & Cause.SECOND_SENDER)


@pytest.mark.parametrize("profile", MODULUS)
def test_other_data_with_the_counter_of_either_of_the_last_two_frames_is_another_senders(profile: str) -> None:
    """A gateway that holds frames back puts those of a second sender behind both true ones."""
    assert alarms(profile, [(1.0, 5, 1), (2.0, 6, 1), (2.1, 5, 2), (2.2, 6, 2)])
    assert not alarms(profile, [(1.0, 5, 1), (2.0, 6, 1), (2.1, 5, 1)]), "the same frame once more"


@pytest.mark.parametrize("profile", MODULUS)
def test_a_counter_that_comes_round_again_behind_a_silence_is_of_the_same_sender(profile: str) -> None:
    sent = [(1.0 + k, k, 1) for k in range(3)]
    behind = MODULUS[profile] + 2
    assert not alarms(profile, [*sent, (1.0 + behind, behind, 1)])
    assert alarms(profile, [*sent, (4.0, 2, 2)])


@pytest.mark.parametrize("profile", MODULUS)
def test_a_frame_that_was_missing_and_comes_late_is_of_the_same_sender(profile: str) -> None:
    order = [0, 1, 3, 2, 4, 5, 7, 6, 9, 10, 12, 11]
    assert not alarms(profile, [(1.0 + k, counter, 1) for k, counter in enumerate(order)])


@pytest.mark.parametrize(
    ("profile", "ahead"), [("classic-le", k) for k in range(15)] + [("fd64", k) for k in (1, 2, 3, 4, 90)]
)
def test_two_senders_in_turns_are_found_whatever_their_counters(profile: str, ahead: int) -> None:
    sent = [
        (1.0 + k + shift, k + more, sender)
        for k in range(20)
        for more, sender, shift in ((0, 1, 0.0), (ahead, 2, 0.3))
    ]
    assert alarms(profile, sent)
