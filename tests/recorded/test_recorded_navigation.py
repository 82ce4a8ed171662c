"""Navigation of recorded data with the nonlinear estimator: Mach number and p_inf with deviations, no q_inf."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from flight_fmu import whole_map
from flight_maps import exact_response

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.summary import EstimationSummary

pytestmark = pytest.mark.fast
MACH, STATIC, STATE = 6.0, 5500.0, (6.0, 0.03, 0.01)
N_D = whole_map().n_gauges
STRAIN = exact_response(*STATE, STATIC)[:N_D]
Writer = Callable[[Path, dict[str, float]], Path]


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fmu")
    save_inverse_map(whole_map(), folder / "map.h5")
    export_estimator(folder / "map.h5", folder / "estimator.fmu", ExportOptions(inputs="full"))
    return folder / "estimator.fmu"


def written(folder: Path, columns: dict[str, float]) -> Path:
    """Write three samples of one flight with ``columns`` of the flow."""
    names = ["time [s]", *(f"strain[{i + 1}] [m/m]" for i in range(N_D)), *columns]
    rows = [[0.01 * i, *STRAIN, *columns.values()] for i in range(3)]
    lines = [",".join(names), *(",".join(f"{one:.15g}" for one in row) for row in rows)]
    (folder / "flight.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "flight.csv"


def written_arrays(folder: Path, columns: dict[str, float]) -> Path:
    """Write the same as arrays of HDF5; a flow is one number or three."""
    with h5py.File(folder / "flight.h5", "w") as file:
        file["time"] = 0.01 * np.arange(3)
        file["strain"] = np.tile(STRAIN, (3, 1))
        for number, (heading, value) in enumerate(columns.items()):
            name, _, unit = heading.removesuffix("]").partition(" [")
            file[name] = np.full(3, value) if number % 2 else value
            if unit:
                file[name].attrs["unit"] = unit
    return folder / "flight.h5"


def estimated(
    folder: Path, columns: dict[str, float], source: Path | None = None, write: Writer = written, **options: float
) -> tuple[np.ndarray, EstimationSummary]:
    """Return the table of estimates, and what is said of it."""
    if source is None:
        source = folder / "map.h5"
        save_inverse_map(whole_map(), source)
    found = estimate_file(source, write(folder, columns), folder / "loads.csv", **options)
    table = np.genfromtxt(folder / "loads.csv", delimiter=",", names=True, deletechars="", replace_space=" ")
    return table, found


def expected(**flow: float) -> np.ndarray:
    """Return coefficients and deviations (10,) of the estimator itself."""
    one = Estimator(whole_map()).step(STRAIN, **flow)
    return np.concatenate([one.coefficients, one.coefficients_std])


def numbers(table: np.ndarray) -> np.ndarray:
    names = ("C_A", "C_N", "C_Y", "M_P", "M_Y")
    return np.array([table[f"{name} [1]"][0] for name in (*names, *(f"sigma.{name}" for name in names))])


@pytest.mark.parametrize("write", [written, written_arrays])
def test_mach_number_and_static_pressure_are_navigation_without_dynamic_pressure(
    tmp_path: Path, write: Writer
) -> None:
    """q_inf computed of both would count their errors twice, and as smaller ones than they are."""
    table, found = estimated(tmp_path, {"mach_number": MACH, "static_pressure [Pa]": STATIC}, write=write)
    np.testing.assert_allclose(
        numbers(table), expected(mach_number=MACH, static_pressure=STATIC), rtol=1e-4, atol=1e-9
    )
    assert np.isnan(table["dynamic_pressure [Pa]"]).all()
    assert found.missing_pressure == 0
    assert "estimated with mach_number and static_pressure as navigation" in found.notes[0]
    q = 0.7 * STATIC * MACH**2
    computed = expected(mach_number=MACH, static_pressure=STATIC, dynamic_pressure=q, q_source=1.0)
    assert np.all(numbers(table)[5:] >= computed[5:])
    assert np.any(numbers(table)[5:] > 1.1 * computed[5:])


@pytest.mark.parametrize("write", [written, written_arrays])
def test_deviations_of_navigation_are_read_in_their_units(tmp_path: Path, write: Writer) -> None:
    stated = {"mach_number": MACH, "mach_number_std": 0.2, "static_pressure [kPa]": STATIC / 1e3}
    table, _ = estimated(tmp_path, stated | {"static_pressure_std [kPa]": 0.4}, write=write)
    wide = expected(mach_number=MACH, mach_number_std=0.2, static_pressure=STATIC, static_pressure_std=400.0)
    np.testing.assert_allclose(numbers(table), wide, rtol=1e-4, atol=1e-9)
    assert np.all(table["static_pressure_std [Pa]"] == 400.0)
    given = expected(mach_number=MACH, static_pressure=STATIC)
    assert np.any(wide[5:] > 1.05 * given[5:])


@pytest.mark.parametrize("write", [written, written_arrays])
@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({}, "estimated from strain alone"),
        ({"mach_number": MACH}, "estimated with mach_number as navigation"),
        ({"mach_number": MACH, "dynamic_pressure [Pa]": 1.0}, "estimated with mach_number as navigation"),
    ],
)
def test_a_recording_without_a_pressure_is_estimated_where_that_is_stated(
    tmp_path: Path, columns: dict[str, float], said: str, write: Writer
) -> None:
    """A column that is misspelt is not taken for a flight without navigation."""
    if "dynamic_pressure [Pa]" not in columns:
        with pytest.raises(
            InputError, match=r"'dynamic_pressure' found, .*--dynamic-pressure, nan where it is not"
        ):
            estimated(tmp_path, columns, write=write)
    table, found = estimated(tmp_path, columns, write=write, dynamic_pressure=float("nan"))
    flow = {"mach_number": MACH} if columns else {}
    np.testing.assert_allclose(numbers(table), expected(**flow), rtol=1e-4, atol=1e-9)
    assert said in found.notes[0]
    assert found.missing_pressure == 0


def test_an_fmu_estimates_without_a_pressure(tmp_path: Path, fmu: Path) -> None:
    table, _ = estimated(tmp_path, {}, fmu, dynamic_pressure=float("nan"))
    np.testing.assert_allclose(numbers(table), expected(), rtol=1e-4, atol=1e-9)


def test_all_three_at_once_and_a_filter(tmp_path: Path) -> None:
    flow = {"dynamic_pressure": 0.7 * STATIC * MACH**2, "mach_number": MACH, "static_pressure": STATIC}
    table, _ = estimated(tmp_path, flow)
    np.testing.assert_allclose(numbers(table), expected(**flow), rtol=1e-4, atol=1e-9)
    filtered, _ = estimated(tmp_path, flow, filter_seconds=1e-6)
    np.testing.assert_allclose(numbers(filtered), expected(**flow), rtol=1e-3, atol=1e-6)


def test_a_negative_deviation_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'static_pressure_std', line 2: expected at least 0, got -1"):
        estimated(tmp_path, {"mach_number": MACH, "static_pressure": STATIC, "static_pressure_std": -1.0})


@pytest.mark.parametrize("filtered", [False, True])
def test_navigation_that_is_left_out_is_said_at_the_end(tmp_path: Path, filtered: bool) -> None:
    q = 0.7 * STATIC * MACH**2
    columns = {"mach_number": 1.25 * MACH, "static_pressure [Pa]": STATIC, "dynamic_pressure [Pa]": q}
    columns["q_source"] = 1.0
    table, found = estimated(tmp_path, columns, **({"filter_seconds": 1.0} if filtered else {}))
    assert not table["navigation_used.mach_number [1]"].any()
    said = "\n".join(found.health_lines())
    assert "DEGRADED: 3 of 3 samples (100 %): " in said
    assert "most often to blame: 'mach_number' (in 3)" in said


@pytest.mark.parametrize("kind", ["map", "fmu"])
@pytest.mark.parametrize(
    ("column", "value"),
    [("mach_number", 4.0), ("static_pressure [Pa]", 9900.0)],
)
def test_navigation_that_cannot_be_used_is_named(
    tmp_path: Path, fmu: Path, kind: str, column: str, value: float
) -> None:
    """All gauges are there: they are not what is missing."""
    q = 0.7 * STATIC * MACH**2
    columns = {"mach_number": MACH, "static_pressure [Pa]": STATIC, "dynamic_pressure [Pa]": q} | {column: value}
    columns["q_source"] = 1.0
    table, found = estimated(tmp_path, columns, fmu if kind == "fmu" else None)
    assert not table[f"navigation_used.{column.partition(' ')[0]} [1]"].any()
    (said,) = found.health_lines()
    assert said.startswith("DEGRADED: 3 of 3 samples (100 %): gauges are missing or navigation is left out, ")
    assert said.endswith(f"most often to blame: '{column.partition(' ')[0]}' (in 3)")


def test_a_computed_pressure_is_not_to_blame(tmp_path: Path) -> None:
    """It is left out in every sample; a gauge that is missing makes the state DEGRADED."""
    q = 0.7 * STATIC * MACH**2
    columns = {"mach_number": MACH, "static_pressure [Pa]": STATIC, "dynamic_pressure [Pa]": q}
    head, *rows = written(tmp_path, columns).read_text(encoding="utf-8").splitlines()
    rows = [",".join([*row.split(",")[:1], "", *row.split(",")[2:]]) for row in rows]  # the first gauge is missing
    path = tmp_path / "lost.csv"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    save_inverse_map(whole_map(), tmp_path / "map.h5")
    found = estimate_file(tmp_path / "map.h5", path, tmp_path / "loads.csv")
    (line,) = found.health_lines()
    assert line.startswith("DEGRADED: 3 of 3")
    assert "dynamic_pressure" not in line
