"""The run that every kind of estimator FMU publishes: what it shows, and that the FMU gives it."""

import csv
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmu_host import OPTIONS
from published_run import FOLDER, check_published_run, published_run
from whole_maps import MAPS

from strainfmu.fmu.checks.importers import read_table, run_fmpy
from strainfmu.interface.fmi_variables import COEFFICIENTS

KINDS = (*OPTIONS, "scalars")

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def flights(whole_fmus: Callable[[str], dict[str, Path]]) -> dict[str, Path]:
    """FMUs of a map that has all that a map can have."""
    return whole_fmus("flight")


@pytest.mark.parametrize("kind", KINDS)
def test_the_run_of_a_linear_map(fmus: dict[str, Path], kind: str) -> None:
    """In form "absolute", without ranges of Mach number and altitude."""
    run = check_published_run(fmus[kind], has_air_data=False)
    assert set(run.truth) == {"time", *COEFFICIENTS}


@pytest.mark.parametrize("kind", KINDS)
def test_the_run_of_a_map_with_tables_and_everything_else(flights: dict[str, Path], kind: str) -> None:
    run = check_published_run(flights[kind], has_air_data=True)
    assert {"temperature[1]", "parameter.fin_deg", "parameter_std.fin_deg", "sensor.port_0deg"} <= set(run.inputs)
    ok = run.outputs["health.state"] == 0.0
    for name in ("angle_of_attack", "mach_number", "static_pressure"):
        error = np.abs(run.outputs[f"air_data.{name}"] - run.truth[f"air_data.{name}"])
        assert np.all(error[ok] < 4.0 * run.outputs[f"sigma.air_data.{name}"][ok]), name
    assert "angle of attack [deg]" in run.page


def test_all_kinds_publish_one_run(fmus: dict[str, Path], flights: dict[str, Path]) -> None:
    for paths in (fmus, flights):
        first, *others = (published_run(paths[kind]) for kind in KINDS)
        for other in others:
            for mine, its in (
                (first.inputs, other.inputs),
                (first.outputs, other.outputs),
                (first.truth, other.truth),
            ):
                assert {name: values.tolist() for name, values in mine.items()} == {
                    name: values.tolist() for name, values in its.items()
                }


@pytest.mark.parametrize(
    ("kind", "map_name"),
    [("native", "of form absolute"), ("native_3", "linear"), ("python", "flight"), ("scalars", "flight")],
)
def test_the_fmu_gives_its_run(
    fmus: dict[str, Path],
    whole_fmus: Callable[[str], dict[str, Path]],
    tmp_path: Path,
    kind: str,
    map_name: str,
) -> None:
    """Through FMPy, to the 6 digits of the file."""
    import fmpy

    path = (whole_fmus(map_name) if map_name in MAPS else fmus)[kind]
    folder = Path(fmpy.extract(str(path), str(tmp_path))) / FOLDER
    found, expected = (
        run_fmpy(path, read_table(folder / "reference_in.csv")),
        read_table(folder / "reference_out.csv"),
    )
    assert {*found} == {*expected}
    for name, rows in expected.items():
        size = np.abs(rows).max() or 1.0
        np.testing.assert_allclose(found[name], rows, rtol=0.0, atol=1e-5 * size, err_msg=name)


@pytest.mark.parametrize("kind", ["native", "native_3", "scalars"])  # kind python publishes the native run
def test_the_command_of_fmpy_reads_the_example(fmus: dict[str, Path], tmp_path: Path, kind: str) -> None:
    """All but an array next to scalars, which FMPy's ``read_csv`` reads and its simulation refuses."""
    import fmpy
    from fmpy.util import read_csv

    folder = Path(fmpy.extract(str(fmus[kind]), str(tmp_path / "fmu"))) / FOLDER
    table = read_csv(str(folder / "reference_in.csv"))
    step, end = table["time"][1] - table["time"][0], table["time"][-1]
    files = {"--input-file": str(folder / "reference_in.csv"), "--output-file": str(tmp_path / "out.csv")}
    sizes = {"--output-interval": f"{step:g}", "--stop-time": f"{end:g}", "--interface-type": "CoSimulation"}
    options = [word for pair in (files | sizes).items() for word in pair]
    command = [sys.executable, "-m", "fmpy", "simulate", *options, str(fmus[kind])]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if kind == "native_3":
        assert table["strain"].ndim == 2
        assert finished.stderr.rstrip().endswith("ValueError: all input arrays must have the same shape")
        return
    assert finished.returncode == 0, finished.stderr
    expected = np.ravel(read_table(folder / "reference_out.csv")["C_N"])
    with (tmp_path / "out.csv").open() as file:
        found = np.array([float(row["C_N"]) for row in csv.DictReader(file)])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())
