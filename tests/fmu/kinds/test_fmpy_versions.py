"""FMUs of both FMI versions in FMPy 0.3.20, which other programs pin, and in the newest: equal results."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from slender_vehicle import make_slender_files

from strainfmu.cosim.scenario import load_scenario
from strainfmu.fmu.flight_export import export_flight

PROGRAM = """
import json, sys
import fmpy
results = {}
for path in sys.argv[1:]:
    description = fmpy.read_model_description(path)
    real = [v for v in description.modelVariables if v.type in ("Real", "Float64")]
    outputs = [v.name for v in real if v.causality == "output"]
    run = fmpy.simulate_fmu(path, stop_time=0.5, output_interval=0.125, output=outputs, fmi_type="CoSimulation")
    results[path] = [[repr(float(value)) for value in run[-1]], len(run)]
print("RESULTS", json.dumps([fmpy.__version__, results]))
"""


def results_of(python: str, fmus: list[Path]) -> tuple[str, dict[str, list[object]]]:
    command = [python, "-c", PROGRAM, *map(str, fmus)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    version, results = json.loads(done.stdout.split("RESULTS", 1)[1])
    return version, results


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("flight")
    scenario = load_scenario(make_slender_files(folder).scenario)
    return [one for fmi in ("2", "3") for one in export_flight(scenario, folder / fmi, fmi_version=fmi).values()]


def test_fmpy_0_3_20_gives_what_the_newest_does(fmus: list[Path]) -> None:
    older = os.environ.get("STRAINFMU_FMPY_0_3_20")
    if older is None:
        pytest.skip("needs the Python of an environment with FMPy 0.3.20 in STRAINFMU_FMPY_0_3_20")
    version, results = results_of(older, fmus)
    assert version == "0.3.20"
    newest, expected = results_of(sys.executable, fmus)
    assert newest != version
    assert results == expected
