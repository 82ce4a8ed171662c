"""Tables that checkers read: the inputs of every reference run, without inputs too; FMU Compliance Checker."""

import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import pytest
from slender_vehicle import make_slender_files

from strainfmu.cosim.flight import INSTANCES
from strainfmu.cosim.scenario import load_scenario
from strainfmu.fmu.checks.crosscheck import crosscheck
from strainfmu.fmu.checks.importers import read_table
from strainfmu.fmu.flight_export import export_flight

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("flight")
    return export_flight(load_scenario(make_slender_files(folder).scenario), folder / "fmus")


def input_table(fmu: Path, folder: Path) -> Path:
    path = folder / "in.csv"
    with zipfile.ZipFile(fmu) as archive:
        path.write_bytes(archive.read("extra/org.fmi-standard.fmi-ls-ref/reference_in.csv"))
    return path


@pytest.mark.parametrize("name", INSTANCES)
def test_the_input_table_can_be_read(fmus: dict[str, Path], tmp_path: Path, name: str) -> None:
    """By FMPy, by the importers here, and by a checker whose separator is what follows the first name."""
    path = input_table(fmus[name], tmp_path)
    signals = fmpy.read_csv(str(path))
    assert len(signals) > 2
    assert set(signals.dtype.names) == set(read_table(path))
    separator = re.match(r'"time"(.)', path.read_text(), re.DOTALL)
    assert separator is not None
    assert separator[1] == (" " if name == "schedule" else ",")
    fields = [line.rstrip("\n").split(separator[1]) for line in path.read_text().splitlines()]
    assert {len(row) for row in fields} == {max(2, len(signals.dtype.names))}


def test_an_fmu_without_inputs_is_crosschecked(fmus: dict[str, Path], tmp_path: Path) -> None:
    results = crosscheck(fmus["schedule"], tmp_path)
    assert next(result for result in results if result.importer.startswith("FMPy")).outcome == "passed"
    assert fmpy.read_csv(str(tmp_path / "FlightSchedule_in.csv")).dtype.names == ("time",)


@pytest.mark.parametrize("name", INSTANCES)
def test_fmu_compliance_checker_is_content(fmus: dict[str, Path], tmp_path: Path, name: str) -> None:
    program = os.environ.get("STRAINFMU_FMUCHECK") or shutil.which("fmuCheck")
    if program is None:
        pytest.skip("needs FMU Compliance Checker: its path in STRAINFMU_FMUCHECK, or fmuCheck on PATH")
    command = [program, "-l", "4", "-k", "cs", "-s", "0.1", "-h", "0.01", "-o", "out.csv"]
    command += ["-i", str(input_table(fmus[name], tmp_path)), str(fmus[name])]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said[-2000:]
    assert "0 warning(s) and error(s)" in said
    assert "0 Warning(s)" in said
    assert "0 Error(s)" in said
