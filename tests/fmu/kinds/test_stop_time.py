"""Steps past the stop time of an experiment: FMI 2.0.4, section 2.1.6, and FMI 3.0 ask for an error."""

from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi2 import fmi2Discard, fmi2Error
from fmu_experiment import Experiment
from slender_vehicle import make_slender_files

from strainfmu.cosim.models.schedule import ScheduledSignal
from strainfmu.fmu.plant_export import export_autopilot, export_native_plant, export_schedule
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.plant_variables import FlightStart, Motion

START = FlightStart(mach_number=6.0, altitude=20e3)
STOP_TIME = 0.3
"""[s]: three steps of 0.1 s end at 0.30000000000000004 s."""


@pytest.fixture(scope="module")
def models(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """FMUs of all models and kinds."""
    folder = tmp_path_factory.mktemp("models")
    make_slender_files(folder)
    vehicle = folder / "flight_model.h5"
    signal = Variable(name="angle", description="one", causality="output", unit="rad")
    export_native_plant(vehicle, folder / "native_plant.fmu", Motion.SHORT_PERIOD, START)
    export_autopilot(vehicle, folder / "autopilot.fmu", START)
    export_schedule([ScheduledSignal(signal, (0.0, 1.0), (0.1, 0.2))], folder / "schedule.fmu")
    made = {name: folder / f"{name}.fmu" for name in ("native_plant", "autopilot", "schedule")}
    return {name: fmus[name] for name in ("native", "native_3", "python", "plant")} | made


NAMES = ("native", "native_3", "python", "plant", "native_plant", "autopilot", "schedule")


@pytest.mark.parametrize("name", NAMES)
def test_a_step_past_the_stop_time_is_an_error(models: dict[str, Path], name: str, tmp_path: Path) -> None:
    run = Experiment(models[name], tmp_path, STOP_TIME)
    refused = fmi2Discard if name in ("python", "plant") else fmi2Error  # PythonFMU has no other status
    assert run.step(0.0, 1.0) == refused
    assert "the step ends at 1 s, behind the stop time of the experiment, 0.3 s" in run.messages[-1]
    time, size = 0.0, 0.1
    for _ in range(3):  # nothing has changed
        assert run.step(time, size) == 0
        time += size
    assert time > STOP_TIME
    assert run.step(time, 1e-3) == refused
    run.end()


@pytest.mark.parametrize("name", NAMES)
def test_without_a_stop_time_any_step_is_taken(models: dict[str, Path], name: str, tmp_path: Path) -> None:
    run = Experiment(models[name], tmp_path, None)
    assert run.step(0.0, 1.0) == 0
    run.end()


def test_a_reset_forgets_the_stop_time(models: dict[str, Path], tmp_path: Path) -> None:
    run = Experiment(models["native"], tmp_path, STOP_TIME)
    run.fmu.reset()
    run.fmu.setupExperiment(startTime=0.0)
    run.fmu.enterInitializationMode()
    run.fmu.exitInitializationMode()
    assert run.step(0.0, 1.0) == 0
    run.end()


def test_a_million_steps_that_are_added_up_reach_the_stop_time(models: dict[str, Path], tmp_path: Path) -> None:
    size, n = 3e-3, 1_000_000
    time = np.add.accumulate(np.full(n - 1, size))[-1]
    assert time + size > n * size
    run = Experiment(models["schedule"], tmp_path, n * size)
    assert run.step(time, size) == 0
    run.end()
