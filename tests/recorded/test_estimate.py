"""``strainfmu estimate``: every format gives the numbers of the estimator itself; wrong data get one line."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from recorded_case import NAMES, read_csv, samples, write_csv
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_inverse_map

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.samples import open_recording
from strainfmu.recorded.table import BLOCK_ROWS

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]
Truth = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

N = 2 * BLOCK_ROWS + 17


@pytest.fixture(scope="module")
def truth() -> Truth:
    """Return time (n,) [s], strains (n, n_d) [m/m], q_inf (n,) [Pa], and coefficients (n, 5) by the estimator."""
    time, strain, pressure = samples(N)
    estimator = Estimator(synthetic_inverse_map(1))
    expected = np.array([estimator.estimate(d, q).coefficients for d, q in zip(strain, pressure, strict=True)])
    return time, strain, pressure, expected


def coefficients(path: Path) -> np.ndarray:
    with h5py.File(path) as file:
        return np.column_stack([file[name][()] for name in COEFFICIENT_NAMES])


def test_csv_and_hdf5_give_the_estimators_numbers(truth: Truth, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    time, strain, pressure, expected = truth
    data = write_csv(tmp_path / "d.csv", ["time", *NAMES, "dynamic_pressure"], time, strain, pressure)
    seen: list[tuple[int, int]] = []
    summary = estimate_file(
        synthetic.map_1,
        data,
        output=tmp_path / "o.h5",
        dynamic_pressure=None,
        progress=lambda *at: seen.append(at),
    )
    # The same code, but the samples of a block are multiplied together.
    np.testing.assert_allclose(coefficients(tmp_path / "o.h5"), expected, rtol=1e-11, atol=1e-13)
    assert (summary.samples, summary.duration) == (N, pytest.approx(time[-1]))
    assert len(seen) == 3
    assert seen[-1][0] == seen[-1][1]
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["time"], file["strain"], file["dynamic_pressure"] = 1e3 * time, 1e6 * strain, 1e-3 * pressure
        for name, unit in (("time", "ms"), ("strain", "um/m"), ("dynamic_pressure", "kPa")):
            file[name].attrs["unit"] = unit
    estimate_file(synthetic.map_1, tmp_path / "d.h5", tmp_path / "o.csv")
    found = read_csv(tmp_path / "o.csv")
    # A factor of 1e6 and back costs a bit or two of each strain.
    np.testing.assert_allclose(found["C_N [1]"], expected[:, 1], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found["time [s]"], time, rtol=1e-12, atol=1e-15)


def test_fmu_and_map_agree(truth: Truth, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    time, strain, pressure, expected = (part[:200] for part in truth)
    headings = ["Time", *(f"plant.strain[{i}] [um/m]" for i in range(1, N_GAUGES + 1)), "q.dynamic_pressure [hPa]"]
    data = write_csv(tmp_path / "d.csv", headings, time, 1e6 * strain, 1e-2 * pressure)
    estimate_file(synthetic.estimator_1, data, tmp_path / "o.h5")
    np.testing.assert_allclose(coefficients(tmp_path / "o.h5"), expected, rtol=1e-9, atol=1e-12)


def test_missing_strains_are_left_out_and_counted(
    truth: Truth, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    time, strain, pressure, _ = (part[:20].copy() for part in truth)
    strain[3, 2] = np.nan
    pressure[5] = np.nan
    data = write_csv(tmp_path / "d.csv", ["time", *NAMES, "dynamic_pressure"], time, strain, pressure)
    code, out, errors = run("estimate", synthetic.map_1, data, "-o", tmp_path / "o.csv", "--columns", "all")
    assert (code, errors) == (0, "")
    assert "1 strains without a value in 1 gauges, the largest number in 'G2' (1)" in out
    assert "1 samples without a dynamic pressure" in out
    found = read_csv(tmp_path / "o.csv")
    expected = Estimator(synthetic_inverse_map(1)).estimate(strain[3], pressure[3])
    assert found["C_N [1]"][3] == pytest.approx(expected.coefficients[1], rel=1e-11)
    assert found["sigma.C_N [1]"][3] == pytest.approx(expected.coefficients_std[1], rel=1e-11)
    assert found["gauges_used [1]"][3] == N_GAUGES - 1
    assert np.isnan(found["C_N [1]"][5])


THREE = Wanted(gauge_names=("G0", "G1", "G2"))
HEADINGS = "time,G0,G1,G2,dynamic_pressure\n"
WRONG = {
    "time,G0,G1\n0,1e-6,2e-6\n": "no column 'G2' or 'strain[3]' found",
    "G0,G1,G2,dynamic_pressure\n1,1,1,1\n": "times: expected one, got none, it holds G0, G1, G2, dynamic_p",
    "time,G0,G1,G2\n0,1e-6,1e-6,1e-6\n": "no column 'dynamic_pressure' found",
    "time,G0 [mV],G1,G2,dynamic_pressure\n0,1,1,1,1\n": "column 'G0 [mV]': unit: expected one of um/m, ",
    "time,G0,G0,G1,G2,dynamic_pressure\n0,1,1,1,1,1\n": "expected one column for G0, got 2: 'G0'",
    HEADINGS + "0,1e-6,x,1e-6,9e4\n": "line 2, column 'G1': expected a number, got 'x'",
    HEADINGS + "0,100,200,300,9e4\n": "expected at most 0.1 m/m, got 100;",
    HEADINGS + "1,0,0,0,9e4\n1,0,0,0,9e4\n": "line 3: expected increasing times, got 1 s after 1 s",
    HEADINGS + "45992.5,0,0,0,9e4\n45992.5000001,0,0,0,9e4\n": "line 2: expected seconds, got 45992.5 and steps",
    HEADINGS + "nan,0,0,0,9e4\n": "column 'time', line 2: no number found",
    HEADINGS + "0,0,0\n": "line 2: expected 5 cells, got 3",
    # Decimal commas between commas, which would shift all that is behind them.
    HEADINGS + "0,1,5e-6,2,5e-6,9,0e4\n": "line 2: expected 5 cells, got 7",
    HEADINGS.replace("G1", "strain[1],G1") + "0,0,0,0,0,9e4\n": "column for G0, got 2: 'G0' and 'strain[1]'",
    HEADINGS + "0,1_0e-5,0,0,9e4\n": "line 2, column 'G0': expected a number, got '1_0e-5'",
    HEADINGS + "0,0,\u0661\u0662,0,9e4\n": "expected a number, got '\u0661\u0662'",
    HEADINGS + "0,0,0,0,infin\n": "column 'dynamic_pressure': expected a number, got 'infin'",
    HEADINGS + "0,0,1e400,0,9e4\n": "column 'G1', line 2: expected a finite number or NaN, got inf",
    HEADINGS: "no samples found",
    HEADINGS + "0" * 200_000 + "\n": "line 2: field larger than field limit",
    "": "no headings found",
}


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_wrong_tables_get_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "d.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error, open_recording(path, THREE) as opened:
        list(opened.blocks)
    assert WRONG[text] in str(error.value)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_wrong_hdf5_gets_one_line(tmp_path: Path) -> None:
    path = tmp_path / "d.h5"
    good = {"time": np.arange(4.0), "strain": np.zeros((4, 3)), "dynamic_pressure": np.float64(9e4)}
    for name, value, line in (
        ("strain", np.zeros((4, 2)), r"no column 'G2' or 'strain\[3\]' found"),
        ("time", np.arange(5.0), "expected .* values, as many as times"),
        ("dynamic_pressure", np.zeros(7), "expected .* values, as many as times"),
        ("strain", None, r"no column 'G0' or 'strain\[1\]' found"),
        ("strain", np.full((4, 3), b"x"), "values that are no numbers"),
        ("gauge_names", b"G0", "expected a name of each of"),
        (
            "dynamic_pressure",
            np.float64(np.inf),
            "column 'dynamic_pressure', row 1: expected a finite number or NaN, got inf",
        ),
    ):
        with h5py.File(path, "w") as file:
            for key, held in {**good, name: value}.items():
                if held is not None:
                    file[key] = held
        with pytest.raises(InputError, match=line), open_recording(path, THREE) as opened:
            list(opened.blocks)


def test_hdf5_without_samples_or_with_a_unit_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "d.h5"
    for n, unit, line in (
        (0, "um/m", "no samples found"),
        (4, 5, "'strain': attribute unit: expected a text, got 5"),
    ):
        with h5py.File(path, "w") as file:
            file["time"], file["strain"], file["dynamic_pressure"] = np.arange(float(n)), np.zeros((n, 3)), 9e4
            file["strain"].attrs["unit"] = unit
        with pytest.raises(InputError, match=line), open_recording(path, THREE) as opened:
            list(opened.blocks)


def test_what_spreadsheets_leave_in_cells_is_taken(tmp_path: Path) -> None:
    """Empty cells behind the last column, blanks, signs, NaN and nothing: numbers, or no value, as documented."""
    path = tmp_path / "d.csv"
    path.write_text("time,G0,G1,G2,dynamic_pressure\n 0 ,+1.e-6,.5E-6,NaN,9e4,, \n1,-1e-6,,0,90000\n")
    with open_recording(path, THREE) as opened:
        (block,) = opened.blocks
    np.testing.assert_array_equal(block.strain, [[1e-6, 0.5e-6, np.nan], [-1e-6, np.nan, 0.0]])
    np.testing.assert_array_equal(block.dynamic_pressure, [9e4, 9e4])


def test_units_behind_an_index(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    path.write_text("t [ms],strain[1],x.strain[2] [ue],dynamic_pressure [psi]\n0,1e-6,2,10\n5,3e-6,4,11\n")
    with open_recording(path, Wanted(gauge_names=("a", "b"))) as opened:
        (block,) = opened.blocks
    np.testing.assert_allclose(block.time, [0.0, 5e-3])
    np.testing.assert_allclose(block.strain, [[1e-6, 2e-6], [3e-6, 4e-6]])
    np.testing.assert_allclose(block.dynamic_pressure, [68947.57, 75842.33], rtol=1e-6)  # 1 psi = 6894.757 Pa


def test_a_failure_leaves_the_old_output(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    out = tmp_path / "o.csv"
    out.write_text("old")
    rows = "".join(
        f"{k},{',0' * N_GAUGES}"[: -1 if k < 0 else None].replace(",,", ",") + "\n" for k in range(3000)
    )
    bad = "time," + ",".join(NAMES) + "\n" + rows + "x" + ",0" * N_GAUGES + "\n3001" + ",0" * N_GAUGES + "\n"
    (tmp_path / "d.csv").write_text(bad)
    code, _, errors = run("estimate", synthetic.map_1, tmp_path / "d.csv", "-o", out, "--dynamic-pressure", "9e4")
    assert code == 2
    assert "line 3002, column 'time': expected a number, got 'x'" in errors
    assert out.read_text() == "old"
    assert sorted(item.name for item in tmp_path.iterdir()) == ["d.csv", "o.csv"]
    code, _, errors = run("estimate", synthetic.map_1, tmp_path / "d.csv", "-o", tmp_path / "o.xls")
    assert code == 2
    assert "expected one of .csv, .h5, .hdf5, .parquet, .mf4, got '.xls'" in errors


def test_nothing_is_written_of_a_file_without_samples(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    data = tmp_path / "d.csv"
    data.write_text(",".join(["time", *NAMES, "dynamic_pressure"]) + "\n")
    code, _, errors = run("estimate", synthetic.map_1, data, "-o", tmp_path / "o.h5")
    assert (code, errors) == (2, f"strainfmu: {data}: no samples found\n")
    assert [item.name for item in tmp_path.iterdir()] == ["d.csv"]
