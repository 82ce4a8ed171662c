"""Load equations without a model: coefficients of least squares, and a map that estimates the same loads."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy.simulation import simulate_fmu

from builder.calibration.after_test.equations_map import FittedEquations, equations_map, fit_equations
from builder.calibration.estimate.regression import load_equation
from builder.calibration.ground_test.equations_file import applied_test, equations_file
from builder.pipeline.equations import equations
from builder.reports.calibration_page.equations_page import redundancy_line, verdict_lines
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator

LOADS = ("axial_force", "normal_force", "side_force", "rolling_moment", "pitching_moment", "yawing_moment")
NOISE = 0.3


def written(folder: Path, gauges: int, *, method: str = "all", zeros: bool = True, curve: float = 0.0) -> Path:
    """Write a test of six loads, their combinations and three check rows; ``curve`` bends the gauges."""
    random = np.random.default_rng(gauges)
    sensitivity = random.normal(size=(gauges, 6)) * np.array([0.4, 1.0, 1.0, 2.0, 3.0, 3.0])
    levels = np.array(
        [0.0, 50.0, 100.0, 50.0, -50.0, -100.0] if zeros else [25.0, 50.0, 100.0, 50.0, -50.0, -100.0]
    )
    load = np.vstack([*(level * np.eye(6)[k] for k in range(6) for level in levels)])
    load = np.vstack([load.reshape(-1, 6), random.uniform(-60.0, 60.0, (12, 6))])
    reading = load @ sensitivity.T
    reading += curve * reading**2 / 100.0 + random.uniform(-50.0, 50.0, gauges)
    reading += NOISE * random.standard_normal(reading.shape)
    heading = ["name", *(f"g{k}" for k in range(gauges)), *(f"known_{name}" for name in LOADS), "check"]
    rows = [
        [f"row {n}", *(f"{value:.9f}" for value in (*r, *f)), "x" if n >= len(load) - 3 else ""]
        for n, (r, f) in enumerate(zip(reading, load, strict=True))
    ]
    (folder / "test.csv").write_text("\n".join(",".join(row) for row in [heading, *rows]) + "\n")
    names = ", ".join(f'"g{k}"' for k in range(gauges))
    text = [
        f'name = "cell"\nmethod = "{method}"\n[readings]\ntable = "test.csv"\ngauges = [{names}]\ncheck = "check"'
    ]
    for name in LOADS:
        unit = "N m" if "moment" in name else "N"
        text.append(f'[[load]]\nname = "{name}"\ncolumn = "known_{name}"\nunit = "{unit}"')
    (folder / "test.toml").write_text("\n".join(text) + "\n")
    return folder / "test.toml"


def fitted(path: Path) -> FittedEquations:
    return fit_equations(applied_test(equations_file(path)))


@pytest.mark.parametrize("zeros", [True, False])
def test_coefficients_and_standard_errors_are_those_of_least_squares(tmp_path: Path, zeros: bool) -> None:
    """Against the normal equations in extended precision; without rows at zero a constant is fitted as well."""
    found = fitted(written(tmp_path, 9, zeros=zeros))
    at = ~found.test.is_check
    strain, load = found.test.strain[at], found.test.load[at]
    none = ~load.any(axis=1)
    assert none.any() == zeros
    a = (
        1e6 * (strain - strain[none].mean(axis=0))
        if zeros
        else np.column_stack([1e6 * strain, np.ones(len(strain))])
    )
    q, r = np.linalg.qr(a)
    for k, one in enumerate(found.equations):
        coefficient = np.linalg.solve(r, q.T @ load[:, k])
        rest = load[:, k] - a @ coefficient
        variance = rest @ rest / (len(load) - a.shape[1])
        error = np.sqrt(variance * np.sum(np.linalg.inv(r) ** 2, axis=1))
        np.testing.assert_allclose(1e-6 * one.coefficient, coefficient[:9], rtol=1e-10)
        np.testing.assert_allclose(1e-6 * one.standard_error, error[:9], rtol=1e-10)


@pytest.mark.parametrize(("gauges", "zeros"), [(9, True), (9, False), (6, True)])
def test_the_map_estimates_what_the_equations_say(tmp_path: Path, gauges: int, zeros: bool) -> None:
    found = fitted(written(tmp_path, gauges, zeros=zeros))
    made = equations_map(found)
    estimator = Estimator(made)
    names = list(estimator.load_names)
    result = estimator.estimate(found.test.strain, made.nominal_dynamic_pressure)
    scale = np.abs(found.test.load).max(axis=0)
    for k, name in enumerate(LOADS):
        loads = np.column_stack([result.loads, result.other_loads])[:, names.index(name)]
        np.testing.assert_allclose(loads / scale[k], found.predicted[:, k] / scale[k], atol=1e-6)
    off = (found.predicted - found.test.load)[found.test.is_check]
    assert np.all(np.abs(off) < 4.5 * np.sqrt(np.diag(found.load_covariance)))


def test_the_fmu_of_the_equations_flies_in_fmpy(tmp_path: Path) -> None:
    """Six loads of every row of the test, one step each, with rolling moment, and health by redundant gauges."""
    found = fitted(written(tmp_path, 9))
    save_inverse_map(equations_map(found), tmp_path / "cell.h5")
    export_estimator(tmp_path / "cell.h5", tmp_path / "cell.fmu", ExportOptions())
    strain, step = found.test.strain, 0.01
    time = step * np.arange(len(strain))
    names = ["time", *(f"strain[{k + 1}]" for k in range(9)), "dynamic_pressure"]
    rows = [tuple(row) for row in np.column_stack([time, strain, np.ones(len(strain))])]
    outputs = ["force.axial", "force.normal", "force.side", "moment.roll", "moment.pitch", "moment.yaw"]
    flown = simulate_fmu(
        str(tmp_path / "cell.fmu"),
        input=np.array(rows, dtype=[(name, float) for name in names]),
        stop_time=float(time[-1]),
        step_size=step,
        output_interval=step,
        output=[*outputs, "health.state"],
    )
    loads, scale = np.column_stack([flown[name] for name in outputs]), np.abs(found.test.load).max(axis=0)
    # fmpy holds the inputs of the start of a step and writes its end.
    np.testing.assert_allclose(loads[1:] / scale, found.predicted[:-1] / scale, atol=1e-6)
    assert np.mean(flown["health.state"][1:] == 0) > 0.9


def test_redundant_gauges_detect_a_fault_and_as_many_as_loads_do_not(tmp_path: Path) -> None:
    nine, six = (fitted(written(tmp_path, gauges)) for gauges in (9, 6))
    spoiled = nine.test.strain.copy()
    spoiled[:, 2] += 30e-6
    estimator = Estimator(equations_map(nine))
    sound, faulty = (
        np.median(np.asarray(estimator.estimate(one, 1.0).chi_square)) for one in (nine.test.strain, spoiled)
    )
    assert sound < 3.0 * nine.redundancy < faulty
    assert redundancy_line(six) == "as many gauges as loads: faults of gauges cannot be detected"
    assert equations_map(six).provenance["load_equations"]["faults_of_gauges"] == "cannot be detected"


def test_a_ridge_and_a_selection(tmp_path: Path) -> None:
    """A ridge of exact readings is least squares; of a gauge that reads twice what another does, both are used."""
    random = np.random.default_rng(4)
    strain = random.normal(size=(40, 3))
    strain = np.column_stack([strain, 2.0 * strain[:, 0]])
    load = strain @ np.array([1.0, -2.0, 0.0, 0.5]) + 1e-3 * random.standard_normal(40)
    ridge = load_equation("normal_force", strain, load, range(4), "ridge")
    assert np.abs(load - ridge.value(strain)).max() < 5e-3
    assert ridge.coefficient[0] + 2.0 * ridge.coefficient[3] == pytest.approx(2.0, abs=1e-3)
    chosen = load_equation("normal_force", strain[:, :3], load, range(3), "selected")
    assert sorted(chosen.gauges) == [0, 1]
    assert np.abs(chosen.coefficient / chosen.standard_error).min() >= 4.0


def test_report_map_and_table_are_written_and_bent_gauges_refused(tmp_path: Path) -> None:
    result = equations(written(tmp_path, 9), tmp_path / "cell.h5")
    assert {path.name for path in result.files} >= {"cell.h5", "cell.html", "cell_load_equations.csv"}
    assert load_inverse_map(tmp_path / "cell.h5").n_gauges == 9
    assert verdict_lines(result.found)[0]
    bent = written(tmp_path, 9, curve=0.5)
    with pytest.raises(StrainfmuError, match=r"predicted within .* --accept writes it"):
        equations(bent, tmp_path / "bent.h5")
    assert not (tmp_path / "bent.h5").exists()
    assert (tmp_path / "bent.html").exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('unit = "N m"', 'unit = "N"', "unit: expected one of N m"),
        ('"axial_force"', '"thrust"', "name: expected one of axial_force"),
        ('column = "known_axial_force"', 'column = "x"', "expected a column 'x'"),
        ('name = "axial_force"', 'name = "section_axial"', "x_m: expected a station"),
        ('column = "known_axial_force"', 'column = "known_side_force"', "got 'known_side_force' again"),
        ('"g7", "g8"', '"g8", "g8"', "got 'g8' again"),
        ('unit = "N"', 'unit = "N"\ngauges = ["g1", "g2", "g1"]', "each once, got 'g1'"),
        ("[readings]", '[readings]\nunit = "m/m"', "readings.unit: expected changes of at most 0.1 m/m or V/V"),
        ('unit = "N"', 'unit = "N"\ngauges = ["g1"]', "read the 6 loads differently"),
    ],
)
def test_wrong_entries_are_refused_in_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = written(tmp_path, 9)
    path.write_text(path.read_text().replace(old, new, 6 if "differently" in said else 1))
    with pytest.raises(InputError, match=said):
        fitted(path)


def changed_column(path: Path, name: str, change: Callable[[int, str], str]) -> None:
    """Change the cells of a column, given each row and cell."""
    heading, *rows = [line.split(",") for line in path.read_text().splitlines()]
    for number, row in enumerate(rows):
        row[heading.index(name)] = change(number, row[heading.index(name)])
    path.write_text("\n".join(map(",".join, [heading, *rows])) + "\n")


@pytest.mark.parametrize(
    ("column", "change", "said"),
    [
        ("g3", lambda *_: "7.5", "g3: expected readings that change with the loads, got one in all rows"),
        ("known_axial_force", lambda *_: "0", "known_axial_force: expected loads, got none"),
        (
            "check",
            lambda row, _: "" if row % 5 == 0 else "x",
            "more rows than the 9 gauges of an equation and one",
        ),
    ],
)
def test_tables_that_cannot_be_fitted_are_refused(
    tmp_path: Path, column: str, change: Callable[[int, str], str], said: str
) -> None:
    path = written(tmp_path, 9)
    changed_column(tmp_path / "test.csv", column, change)
    with pytest.raises(InputError, match=said):
        fitted(path)


@pytest.mark.parametrize(
    ("column", "row", "cell", "gauges"),
    [("g3", 7, "9e4", ["g3"]), ("known_axial_force", 2, "1000", [f"g{k}" for k in range(9)])],
)
def test_a_reading_or_a_load_unlike_the_others_is_named(
    tmp_path: Path, column: str, row: int, cell: str, gauges: list[str]
) -> None:
    """Also where the loads are predicted without that gauge."""
    path = written(tmp_path, 9)
    assert verdict_lines(fitted(path))[0]
    changed_column(tmp_path / "test.csv", column, lambda number, was: cell if number == row else was)
    fit = fitted(path)
    assert list(fit.unlike) == [row + 2]
    assert set(fit.unlike[row + 2]) <= set(gauges)
    good, lines = verdict_lines(fit)
    assert not good
    assert f"line {row + 2} of the table: readings of {gauges[0]}" in lines[-1]


def test_a_check_mark_is_any_but_a_no(tmp_path: Path) -> None:
    path = written(tmp_path, 9)
    expected = applied_test(equations_file(path)).is_check
    changed_column(tmp_path / "test.csv", "check", lambda row, cell: cell or ["", "0", "No", "FALSE"][row % 4])
    np.testing.assert_array_equal(applied_test(equations_file(path)).is_check, expected)


@pytest.mark.parametrize(("separator", "mark"), [(";", ","), (";", "."), ("\t", ","), ("\t", ".")])
def test_separators_and_decimal_commas_change_no_number(tmp_path: Path, separator: str, mark: str) -> None:
    path = written(tmp_path, 9)
    table, expected = tmp_path / "test.csv", applied_test(equations_file(path))
    table.write_text(table.read_text().replace(",", separator).replace(".", mark), encoding="utf-8-sig")
    read = applied_test(equations_file(path))
    np.testing.assert_array_equal(read.strain, expected.strain)
    np.testing.assert_array_equal(read.load, expected.load)
    np.testing.assert_array_equal(read.is_check, expected.is_check)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda row: ",".join(row.split(",")[:3]), "line 3: g2: expected a number, got ''"),
        (lambda row: row.replace(row.split(",")[2], "nan"), "line 3: g1: expected a number, got 'nan'"),
        (lambda row: row.replace(row.split(",")[2], "OVLD"), "line 3: g1: expected a number, got 'OVLD'"),
        (lambda row: row.replace(row.split(",")[2], "1e999"), "line 3: g1: expected a number, got '1e999'"),
    ],
)
def test_rows_that_are_short_or_hold_no_number_are_refused(
    tmp_path: Path, wrong: Callable[[str], str], said: str
) -> None:
    path, table = written(tmp_path, 9), tmp_path / "test.csv"
    rows = table.read_text().splitlines()
    table.write_text("\n".join([*rows[:2], wrong(rows[2]), *rows[3:]]))
    with pytest.raises(InputError, match=said):
        applied_test(equations_file(path))


def test_columns_of_one_name_are_refused(tmp_path: Path) -> None:
    path, table = written(tmp_path, 9), tmp_path / "test.csv"
    table.write_text(table.read_text().replace("g8", "g7", 1))
    path.write_text(path.read_text().replace(', "g8"', ""))
    with pytest.raises(InputError, match="expected one column 'g7'"):
        applied_test(equations_file(path))
