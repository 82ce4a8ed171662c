"""The freshness value across runs: reserved ahead, written at the end, refused where it cannot be trusted."""

import json
import os
from pathlib import Path
from time import monotonic, sleep

import pytest
from can_case import KEY

from strainfmu.can.authentic import (
    Authentication,
    AuthenticationKey,
    Authenticity,
    FreshnessKeeper,
    Secured,
    authenticated,
    freshness_file,
    freshness_of,
    load_freshness,
    next_trip,
    save_freshness,
)
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically

pytestmark = pytest.mark.fast

CYCLE = 0.01
RESERVED = 200
SECURED = Secured(1, 2)


def receive(authentication: Authentication, trip: int, message: int) -> Authenticity:
    return authentication.check(0, authenticated(b"ab", SECURED, KEY, freshness_of(trip, message)))


def keeper_of(path: Path) -> tuple[FreshnessKeeper, Authentication]:
    authentication = Authentication([SECURED], KEY)
    return FreshnessKeeper(path, KEY, authentication=authentication, cycle_time=CYCLE), authentication


def test_a_good_end_writes_the_value_reached_and_the_next_run_starts_above(tmp_path: Path) -> None:
    path = tmp_path / "bus.key.bridge.json"
    keeper, authentication = keeper_of(path)
    assert keeper.first_run_text.startswith(f"{path}: no earlier run: recordings made with this key")
    with keeper:
        for message in range(5):
            assert receive(authentication, 2, message) is Authenticity.AUTHENTIC
    assert load_freshness(path, KEY) == freshness_of(2, 4)
    keeper, authentication = keeper_of(path)
    assert keeper.first_run_text == ""
    with keeper:
        assert receive(authentication, 2, 4) is Authenticity.NOT_FRESH
        assert receive(authentication, 2, 5) is Authenticity.AUTHENTIC


def test_after_a_kill_nothing_that_was_used_is_fresh(tmp_path: Path) -> None:
    """Whatever is on disk while the bridge runs lies ahead of all that it has used."""
    path = tmp_path / "f.json"
    keeper, authentication = keeper_of(path)
    with keeper:
        receive(authentication, 2, 7)
        assert load_freshness(path, KEY) == freshness_of(2, 7 + RESERVED)
        receive(authentication, 3, 0)
        assert load_freshness(path, KEY) == freshness_of(3, RESERVED)
        for message in range(1, 150):
            receive(authentication, 3, message)
        end = monotonic() + 60.0
        while load_freshness(path, KEY) == freshness_of(3, RESERVED) and monotonic() < end:
            sleep(0.02)
        assert load_freshness(path, KEY) == freshness_of(3, 149 + RESERVED)
        killed = path.read_bytes()
    path.write_bytes(killed)
    _, authentication = keeper_of(path)
    assert receive(authentication, 3, 149) is Authenticity.NOT_FRESH
    assert receive(authentication, 3, 149 + RESERVED) is Authenticity.NOT_FRESH
    assert receive(authentication, 3, 150 + RESERVED) is Authenticity.AUTHENTIC


def test_a_reservation_is_never_taken_back(tmp_path: Path) -> None:
    """The thread may have read an older value than that of a new trip, which was written meanwhile."""
    path = tmp_path / "f.json"
    keeper, authentication = keeper_of(path)
    with keeper:
        receive(authentication, 3, 0)
        keeper._reserve(freshness_of(2, 900))
        assert load_freshness(path, KEY) == freshness_of(3, RESERVED)


def test_a_run_without_frames_leaves_the_value(tmp_path: Path) -> None:
    path = tmp_path / "f.json"
    save_freshness(path, KEY, freshness_of(4, 9))
    with keeper_of(path)[0]:
        pass
    assert load_freshness(path, KEY) == freshness_of(4, 9)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "damaged: no JSON"),
        ("[" * 100_000, "damaged: no JSON"),
        ("[]", "expected the format 'strainfmu freshness value', version 1"),
        (
            '{"format": "strainfmu freshness value", "version": 1, "trip": true, "message": 0}',
            "expected the format",
        ),
        ('{"format": "strainfmu freshness value", "version": 1, "trip": -1, "message": 0}', "expected the format"),
        ('{"format": "strainfmu freshness value", "version": 2}', "expected the format"),
        ("\udcff", "damaged"),
    ],
)
def test_a_damaged_file_is_one_line_and_never_a_fresh_start(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "f.json"
    write_bytes_atomically(path, content.encode("utf-8", "surrogateescape"), is_private=True)
    with pytest.raises(InputError, match=message) as caught:
        keeper_of(path)
    assert "\n" not in str(caught.value)


def test_a_file_of_another_key_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "f.json"
    save_freshness(path, AuthenticationKey(bytes(16)), 5)
    with pytest.raises(InputError, match=r"is of another key, check value '[0-9a-f]{6}', not '[0-9a-f]{6}'"):
        load_freshness(path, KEY)
    assert bytes(range(16)).hex() not in path.read_text()


@pytest.mark.skipif(
    os.geteuid() == 0 and not Path("/proc").exists(), reason="needs a folder that nobody can write"
)
def test_a_bridge_that_cannot_remember_does_not_start() -> None:
    keeper, _ = keeper_of(Path("/proc/freshness.json"))
    with pytest.raises(StrainfmuError, match=r"/proc/freshness\.json: could not be written"):
        keeper.__enter__()


def test_a_file_that_fails_later_is_said_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "f.json"
    keeper, authentication = keeper_of(path)
    with keeper:
        path.unlink()
        path.parent.rmdir()
        path.parent.write_text("a file where the folder was")
        assert receive(authentication, 2, 1) is Authenticity.AUTHENTIC
    assert "could not be written" in keeper.failure_text
    assert keeper.failure_text.endswith("the next bridge may take a recording of this run for the sender")


def test_a_sender_takes_the_next_trip_at_every_start(tmp_path: Path) -> None:
    path = freshness_file(tmp_path / "bus.key", "sender")
    assert path.name == "bus.key.sender.json"
    assert [next_trip(path, KEY) for _ in range(3)] == [2, 3, 4]
    assert json.loads(path.read_text())["trip"] == 4


@pytest.mark.skipif(os.name != "posix", reason="other systems have no POSIX modes")
@pytest.mark.parametrize("mode", [0o640, 0o602, 0o644])
def test_a_file_that_others_may_read_or_write_is_refused(tmp_path: Path, mode: int) -> None:
    """Whoever writes it turns the freshness value back; whoever reads the key forges frames."""
    path = tmp_path / "f.json"
    save_freshness(path, KEY, freshness_of(4, 9))
    assert path.stat().st_mode & 0o777 == 0o600
    path.chmod(mode)
    with pytest.raises(InputError, match=f"expected a file of its owner alone, mode 600, got {mode:o}: chmod 600"):
        load_freshness(path, KEY)
