"""The authenticator: CMAC against the vectors of its standard, the bytes it covers, keys from files."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from altered_frames import crc_in
from can_case import CYCLE, KEY, layout_of

from strainfmu.can.authentic import (
    AuthenticationKey,
    Secured,
    authenticated,
    authenticator_of,
    freshness_of,
    is_authentic,
    load_key,
    sent_freshness,
)
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import crc_of
from strainfmu.can.frame_layout import InputFrame
from strainfmu.can.profiles import profile_layout
from strainfmu.can.signals import SignalPlan
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically

pytestmark = pytest.mark.fast

STANDARD_KEY = AuthenticationKey(bytes.fromhex("2b7e151628aed2a6abf7158809cf4f3c"))
STANDARD_MESSAGE = bytes.fromhex(
    "6bc1bee22e409f96e93d7e117393172aae2d8a571e03ac9c9eb76fac45af8e51"
    "30c81c46a35ce411e5fbc1191a0a52eff69f2445df4f9b17ad2b417be66c3710"
)


@pytest.mark.parametrize(
    ("length", "expected"),
    [
        (0, "bb1d6929e95937287fa37d129b756746"),
        (16, "070a16b46b4d4144f79bdd9dd04a287c"),
        (40, "dfa66747de9ae63030ca32611497c827"),
        (64, "51f0bebf7e3b9d92fc49741779363cfe"),
    ],
)
def test_cmac_is_that_of_rfc_4493_and_nist_sp_800_38b(length: int, expected: str) -> None:
    assert STANDARD_KEY.mac(STANDARD_MESSAGE[:length]).hex() == expected


def test_nist_example_of_twenty_bytes() -> None:
    """Only NIST's collection of examples has this length; RFC 4493 has 40 bytes in its place."""
    assert STANDARD_KEY.mac(STANDARD_MESSAGE[:20]).hex() == "7d85449ea6ea19c823a7bf78837dfade"


def test_the_authenticator_covers_data_id_authentic_bytes_and_complete_freshness_value() -> None:
    """The order and byte order of AUTOSAR SecOC; of the CMAC the first bytes are sent."""
    secured, head = Secured(0x5301, 4), b"\x11\x22\x33\x44"
    whole = b"\x53\x01" + head + bytes.fromhex("0000000700000102")
    found = authenticator_of(head, secured, STANDARD_KEY, freshness=freshness_of(7, 0x102))
    assert found == STANDARD_KEY.mac(whole)[:8]


def test_a_frame_ends_with_truncated_freshness_value_and_authenticator() -> None:
    secured = Secured(0x5301, 50)
    freshness = freshness_of(0xABCD_0005, 0x01020304)
    data = authenticated(bytes(64), secured, STANDARD_KEY, freshness=freshness)
    assert len(data) == 64
    assert data[50:56] == bytes.fromhex("040302010500")
    assert data[56:] == authenticator_of(bytes(50), secured, STANDARD_KEY, freshness)
    assert is_authentic(data, secured, STANDARD_KEY, freshness)
    assert not is_authentic(data, secured, STANDARD_KEY, freshness_of(0xABCD_0006, 0x01020304))
    assert not is_authentic(data, Secured(0x5302, 50), STANDARD_KEY, freshness)
    assert not is_authentic(data, secured, KEY, freshness)


@pytest.mark.parametrize(
    ("newest", "value"),
    [
        (freshness_of(1, 5), freshness_of(1, 6)),
        (freshness_of(1, 5), freshness_of(2, 0)),
        (freshness_of(0xFFFF, 9), freshness_of(0x1_0000, 0)),
        (freshness_of(0x1_0000, 9), freshness_of(0xFFFF, 3)),
        (freshness_of(0xFFFF_FFFF, 9), freshness_of(0xFFFF_FFFF, 10)),
        (0, freshness_of(3, 70_000)),
    ],
)
def test_the_complete_freshness_value_is_the_nearest_that_fits(newest: int, value: int) -> None:
    secured = Secured(1, 0)
    assert sent_freshness(authenticated(b"", secured, KEY, value), secured, newest) == value


def frames_of(trip: int, cycle: int) -> list[tuple[InputFrame, bytes]]:
    layout = layout_of("fd64-sec")
    encoder = StrainEncoder(layout, trip)
    strain = 1e-6 * np.arange(30.0)
    frames = encoder.encode(strain, 9e4, cycle=cycle, sample_time=CYCLE * cycle, mach_number=5.0, altitude=2e4)
    by_key = {item.layout.key: item for item in layout.frames}
    return [(by_key[frame.key], frame.data) for frame in frames]


def test_all_frames_of_a_cycle_are_protected_and_authenticated() -> None:
    frames = frames_of(trip=3, cycle=70_000)
    assert [item.layout.name for item, _ in frames] == [
        "SenderState",
        "DynamicPressure",
        "Navigation",
        "Strain1",
        "Strain2",
    ]
    for item, data in frames:
        protection, secured = item.layout.protection, item.layout.secured
        assert protection is not None
        assert secured is not None
        assert len(data) == item.layout.length
        assert crc_in(data, protection) == crc_of(data[: secured.length], protection)
        assert is_authentic(data, secured, KEY, freshness_of(3, 70_000))
        plan = SignalPlan(item.layout)
        values = dict(zip((s.name for s in item.layout.signals), plan.raw(data).tolist(), strict=True))
        assert (values["TripCounter"], values["MessageCounter"]) == (3, 70_000)


def test_no_flipped_bit_is_authentic() -> None:
    for item, data in frames_of(trip=3, cycle=5):
        secured = item.layout.secured
        assert secured is not None
        number = int.from_bytes(data, "little")
        for bit in range(8 * len(data)):
            altered = (number ^ 1 << bit).to_bytes(len(data), "little")
            freshness = sent_freshness(altered, secured, freshness_of(3, 4))
            assert not is_authentic(altered, secured, KEY, freshness)


@pytest.mark.parametrize("text", ["000102030405060708090a0b0c0d0e0f", "00010203 04050607\n08090A0B 0C0D0E0F\n"])
def test_a_key_is_read_from_a_file(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bus.key"
    write_bytes_atomically(path, text.encode(), is_private=True)
    assert load_key(path).mac(b"x") == KEY.mac(b"x")
    assert "0102" not in repr(load_key(path))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"0011", "bus.key: expected a key of AES-128, 32 hexadecimal digits, got 4 of them"),
        (b"", "got 0 of them"),
        (b"00" * 32, "got 64 of them"),
        (b"secret" * 6, "got 36 characters, not all of them such digits"),
        (bytes(range(128, 144)), "got 16 characters, not all of them such digits"),
        (None, "bus.key: the key could not be read: No such file or directory"),
    ],
)
def test_a_file_without_a_key_is_refused_in_one_line(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "bus.key"
    if content is not None:
        write_bytes_atomically(path, content, is_private=True)
    with pytest.raises(InputError, match=message) as caught:
        load_key(path)
    assert "\n" not in str(caught.value)
    assert "secret" not in str(caught.value)


def test_without_the_package_a_line_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("cryptography.hazmat.primitives")]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(StrainfmuError, match=r"cryptography is not installed: pip install 'strainfmu\[auth\]'"):
        AuthenticationKey(bytes(16))


def test_keys_belong_to_authenticated_frames_alone() -> None:
    with pytest.raises(InputError, match="key: expected profile fd64-sec, got 'fd64'"):
        profile_layout("fd64", ["a"], CYCLE, key=KEY)
    with pytest.raises(InputError, match="fd64-sec: frames are authenticated, and no key is given"):
        StrainEncoder(profile_layout("fd64-sec", ["a"], CYCLE))
    with pytest.raises(InputError, match="expected 16 bytes, got 15"):
        AuthenticationKey(bytes(15))
    with pytest.raises(InputError, match="64 bits allowed: "):
        freshness_of(1 << 32, 0)


@pytest.mark.skipif(os.name != "posix", reason="other systems have no POSIX modes")
def test_a_key_that_others_may_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bus.key"
    path.write_text(bytes(range(16)).hex())
    path.chmod(0o644)
    with pytest.raises(InputError, match=r"expected a file of its owner alone, mode 600, got 644: chmod"):
        load_key(path)
