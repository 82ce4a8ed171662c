"""Columns of a flow parameter and of its standard deviation."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from deflected_shape import NAME, known_map
from shape_case import N_D

from strainfmu.errors import InputError
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.estimator.map.nonlinear_map import with_known
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.recorded.run import estimate_file

STATE = np.array([6.5, 0.03, 0.01, np.log(4000.0)])
Q = 0.7 * 6.5**2 * 4000.0


def readings() -> np.ndarray:
    """Return what the gauges read at a deflection of 1 degree."""
    manifold = known_map().manifold
    assert manifold is not None
    at = with_known(manifold, np.ones(1), np.zeros(1))
    return np.asarray(evaluate(at.tables, STATE[None]).value[0, :N_D])


def estimated(folder: Path, columns: dict[str, float], source: str = "map.h5", **options: object) -> np.ndarray:
    """Return C_l and its deviation (2, 3) of three samples with further ``columns``."""
    strain = readings()
    names = [
        "time [s]",
        *(f"strain[{i + 1}] [m/m]" for i in range(N_D)),
        "dynamic_pressure [Pa]",
        "mach_number",
        "q_source",
        *columns,
    ]
    rows = [[0.01 * i, *strain, Q, 6.5, 1.0, *columns.values()] for i in range(3)]
    text = [",".join(names), *(",".join(f"{one:.12g}" for one in row) for row in rows)]
    (folder / "flight.csv").write_text("\n".join(text) + "\n", encoding="utf-8")
    save_inverse_map(known_map(keep_field="field" in options), folder / "map.h5")
    if source != "map.h5" and not (folder / source).exists():
        export_estimator(folder / "map.h5", folder / source, ExportOptions())
    estimate_file(folder / source, folder / "flight.csv", folder / "loads.csv", **options)
    table = np.genfromtxt(folder / "loads.csv", delimiter=",", names=True, deletechars="", replace_space=" ")
    return np.array([table["M_R [1]"], table["sigma.M_R [1]"]])


@pytest.mark.parametrize("smooth", [False, True])
def test_a_column_of_deviations_sharpens_the_filter(tmp_path: Path, smooth: bool) -> None:
    alone = estimated(tmp_path, {NAME: 1.0}, filter_seconds=1.0, smooth=smooth)
    found = estimated(tmp_path, {NAME: 1.0, f"{NAME}_std": 0.05}, filter_seconds=1.0, smooth=smooth)
    assert np.all(found[1] < 0.7 * alone[1])


def test_a_column_of_deviations_sharpens_the_pressure_field(tmp_path: Path) -> None:
    std = []
    for columns in ({NAME: 1.0}, {NAME: 1.0, f"{NAME}_std": 0.05}):
        estimated(tmp_path, columns, field=tmp_path / "field.vtkhdf")
        with h5py.File(tmp_path / "field.vtkhdf") as file:
            std.append(np.mean(file["VTKHDF/PointData/sigma_pressure"][:]))
    assert std[1] < 0.4 * std[0]


@pytest.mark.parametrize(
    ("columns", "line", "source"),
    [
        (
            {f"{NAME}_std": 0.05},
            rf"flight\.csv: {NAME}_std: expected {NAME} with its standard deviation, got none",
            "map.h5",
        ),
        *(
            (
                {NAME: 1.0, f"{NAME}_std": -0.05},
                rf"column '{NAME}_std', line 2: expected at least 0, got -0\.05",
                of,
            )
            for of in ("map.h5", "e.fmu")
        ),
    ],
)
def test_a_deviation_that_cannot_be_is_refused(
    columns: dict[str, float], line: str, source: str, tmp_path: Path
) -> None:
    """By map and FMU alike; of the bus and of an FMU's input it is one that is not stated."""
    with pytest.raises(InputError, match=line):
        estimated(tmp_path, columns, source)
    assert not (tmp_path / "loads.csv").exists()
