"""Sets of flight conditions: the published ones, and CSV files."""

from collections.abc import Callable
from math import radians
from pathlib import Path

import pytest
from ogive import OGIVE

from builder.vehicle.file import load_vehicle
from builder.vehicle.flight_conditions import condition_set, count_repeated, flow_key, read_conditions
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]

HEADER = "mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km"


def test_published_sets() -> None:
    """90 and 243 conditions; a_T is symmetric in alpha, beta and their signs, so P2 has 3 x 15 flows."""
    first, second = condition_set("P1").conditions, condition_set("P2").conditions
    assert (len(first), len(second)) == (90, 243)
    assert len(set(map(flow_key, first))) == 85
    assert len(set(map(flow_key, second))) == 45
    assert {condition.altitude for condition in first + second} == {20e3}
    # M 5, 6, 7 at alpha 0 .. 8, beta 0 stand in both.
    assert count_repeated(first + second) == 15
    assert first[0] == FlightCondition(5.0, 0.0, 0.0, 20e3)
    assert second[1] == FlightCondition(5.0, radians(-8.0), radians(-6.0), 20e3)


def test_csv_file(tmp_path: Path) -> None:
    path = tmp_path / "set.csv"
    path.write_text(f"\ufeff{HEADER}\r\n5, 2.5,-1,20\r\n\r\n7,0,0,0\r\n", encoding="utf-8")
    assert read_conditions(path) == [
        FlightCondition(5.0, radians(2.5), radians(-1.0), 20e3),
        FlightCondition(7.0, 0.0, 0.0, 0.0),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", f"line 1: expected header '{HEADER}', got nothing"),
        ("5,0,0,20\n", f"line 1: expected header '{HEADER}', got none of them"),
        (
            HEADER.replace("deg", "rad") + "\n",
            f"line 1: expected header '{HEADER}', got mach_number, angle_of_attack_rad",
        ),
        (HEADER + "\n", "expected at least 1 condition, got none"),
        (HEADER + "\n5,0,0,20\n5,0,0\n", "line 3: expected 4 values, got 3"),
        (
            HEADER + "\n\n5,0,zero,20\n",
            "line 3, column sideslip_angle_deg: expected -60 .. 60, got 'zero'",
        ),
        (
            HEADER + "\n5,nan,0,20\n",
            "line 2, column angle_of_attack_deg: expected -60 .. 60, got 'nan'",
        ),
        (
            HEADER + "\n5,61,0,20\n",
            "line 2, column angle_of_attack_deg: expected -60 .. 60, got '61'",
        ),
        (HEADER + "\n0.8,0,0,20\n", "line 2, column mach_number: expected 1.01 .. 30, got '0.8'"),
        (HEADER + "\ninf,0,0,20\n", "line 2, column mach_number: expected 1.01 .. 30, got 'inf'"),
        (HEADER + "\n5,0,0,20000\n", "line 2, column altitude_km: expected 0 .. 71, got '20000'"),
        (
            HEADER + "\n5,0,0,20\n6,0,0,20\n5.0,-0,0,20\n",
            "line 4: expected each condition once, got it in line 2 too",
        ),
        (HEADER + "\n5,0,0,\n", "line 2, column altitude_km: expected 0 .. 71, got ''"),
    ],
)
def test_wrong_csv_file_is_one_line(text: str, message: str, tmp_path: Path, run: Run) -> None:
    path = tmp_path / "set.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_conditions(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    code, _, printed = run("snapshots", OGIVE, "--set", path, "-o", tmp_path / "snapshots.h5")
    assert code == 2
    assert printed.count("\n") == 1
    assert not (tmp_path / "snapshots.h5").exists()


def test_too_many_conditions_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "set.csv"
    path.write_text(HEADER + "".join(f"\n5,0,0,{i / 1000}" for i in range(20_001)), encoding="utf-8")
    with pytest.raises(InputError, match="expected at most 20000 conditions, got more"):
        read_conditions(path)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", None])
def test_unreadable_csv_file(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "set.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match="not a CSV file: expected text" if content else "P1, P2 or a CSV file"):
        condition_set(str(path))


def test_altitudes_of_a_vehicle_file(tmp_path: Path) -> None:
    """A list of altitudes gives all combinations, altitude running slowest, and no flow beyond those of one."""
    text = OGIVE.read_text(encoding="utf-8").replace("altitude_km = 22.0", "altitude_km = [15, 22.0, 30.0]")
    path = tmp_path / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    one, three = load_vehicle(OGIVE).flight_conditions(), load_vehicle(path).flight_conditions()
    assert [c.altitude for c in three] == [15e3] * len(one) + [22e3] * len(one) + [30e3] * len(one)
    assert three[len(one) : 2 * len(one)] == one
    assert {flow_key(c) for c in three} == {flow_key(c) for c in one}
