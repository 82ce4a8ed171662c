"""The trajectory's interpolation against SciPy, and every wrong row."""

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from synthetic_vehicle import TRAJECTORY, write_trajectory

from strainfmu.cosim.models.trajectory import HEADER, load_trajectory
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

HEAD = ",".join(HEADER)


@pytest.mark.parametrize("n_rows", [2, 3, 4, 20])
def test_between_the_rows_it_is_scipys_pchip(tmp_path: Path, n_rows: int) -> None:
    random = np.random.default_rng(n_rows)
    time = np.append(0.0, np.cumsum(random.uniform(0.1, 2.0, n_rows - 1)))
    # Rounded, so that equal neighbours and turning points occur.
    columns = np.round(random.normal(size=(n_rows, 4)), 1)
    rows = "\n".join(",".join(map(repr, row)) for row in np.column_stack((time, columns)).tolist())
    trajectory = load_trajectory(write_trajectory(tmp_path / "t.csv", f"{HEAD}\n{rows}\n"))
    scale = np.array([1.0, np.pi / 180.0, np.pi / 180.0, 1e3])
    expected = PchipInterpolator(time, columns * scale)
    for t in np.linspace(0.0, time[-1], 101):
        np.testing.assert_allclose(trajectory.condition_at(t).as_tuple(), expected(t), rtol=1e-12, atol=1e-9)


def test_outside_the_rows_it_stays(tmp_path: Path) -> None:
    trajectory = load_trajectory(write_trajectory(tmp_path / "t.csv"))
    assert trajectory.stop_time == 0.4
    assert trajectory.condition_at(9.0) == trajectory.condition_at(0.4)
    assert trajectory.condition_at(-1.0) == trajectory.condition_at(0.0)
    assert trajectory.condition_at(0.4).altitude == pytest.approx(22e3)


def test_a_constant_column_stays_exactly_constant(tmp_path: Path) -> None:
    rows = f"{HEAD}\n0,5.1,0.1,0,20\n1,5.1,0.1,0,21\n3,5.1,0.1,0,25\n"
    trajectory = load_trajectory(write_trajectory(tmp_path / "t.csv", rows))
    assert {trajectory.condition_at(t).mach_number for t in np.linspace(0.0, 3.0, 99)} == {5.1}


def test_a_byte_order_mark_and_blank_lines_do_no_harm(tmp_path: Path) -> None:
    path = write_trajectory(tmp_path / "t.csv")
    path.write_text("\ufeff" + TRAJECTORY.replace("\n0.1", "\n\n0.1") + "\n", encoding="utf-8")
    assert len(load_trajectory(path).time) == 4


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "row 1: expected the header 'time_s,mach_number"),
        ("time,mach\n0,5\n", "altitude_km', got none of them"),
        (f"{HEAD}\n0,5,0,0,20\n", "expected at least 2 rows of values, got 1"),
        (f"{HEAD}\n0,5,0,0\n1,5,0,0,20\n", "row 2: expected 5 values, got 4"),
        (
            f"{HEAD}\n0,5,0,0,20\n1,fast,0,0,20\n",
            "row 3, column mach_number: expected a finite number, got 'fast'",
        ),
        (f"{HEAD}\n0,5,0,0,20\n1,5,0,0,inf\n", "row 3, column altitude_km: expected a finite number, got 'inf'"),
        (f"{HEAD}\n0,1e300,0,0,20\n2,5,0,0,20\n", "row 2, column mach_number: expected -100 .. 100, got '1e300'"),
        (f"{HEAD}\n1,5,0,0,20\n2,5,0,0,20\n", "row 2, column time_s: 1 found, must start at 0"),
        (f"{HEAD}\n0,5,0,0,20\n\n0,5,0,0,20\n", "row 4, column time_s: 0 found after 0, time must increase"),
    ],
)
def test_wrong_rows_are_named(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError) as error:
        load_trajectory(write_trajectory(tmp_path / "t.csv", text))
    assert words in str(error.value)
    assert "t.csv" in str(error.value)
    assert "\n" not in str(error.value)


def test_missing_and_binary_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_trajectory(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match="not a CSV file: expected text"):
        load_trajectory(tmp_path / "b.csv")
