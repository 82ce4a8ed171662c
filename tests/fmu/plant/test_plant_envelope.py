"""The native plant outside its envelope: a step is discarded, the plant wants to end, an importer ends with it.

FMI 2.0.5, 4.2.2: after fmi2Discard, fmi2GetBooleanStatus reports by fmi2Terminated that the slave wants to end,
and fmi2GetRealStatus by fmi2LastSuccessfulTime until when it came.
"""

from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2Discard, fmi2LastSuccessfulTime, fmi2OK, fmi2Terminated
from fmu_host import COEFFICIENTS, STRAINS, Host, loaded
from synthetic_vehicle import SyntheticFiles

from strainfmu.cosim.systems.master import simulate
from strainfmu.cosim.systems.system import System
from strainfmu.errors import StrainfmuError
from strainfmu.fmu.plant_export import export_native_plant
from strainfmu.interface.plant_variables import FlightStart, Motion

pytestmark = pytest.mark.fast

START = FlightStart(mach_number=6.0, altitude=20e3, angle_of_attack=0.08, mass=2e4, pitch_inertia=3e5)
STEP = 0.01
MOMENT = 1e7
"""[N m]: turns the vehicle out of its envelope within a second."""


@pytest.fixture(scope="module")
def fmus(synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory) -> dict[Motion, Path]:
    """The plants that can leave their envelope."""
    folder = tmp_path_factory.mktemp("plants")
    made = {motion: folder / f"{motion.name}.fmu" for motion in (Motion.INPUTS, Motion.SHORT_PERIOD)}
    for motion, path in made.items():
        export_native_plant(flight_model_path=synthetic.flight_model, fmu_path=path, motion=motion, start=START)
    return made


def status_of_step(host: Host, time: float) -> int:
    try:
        host.fmu.doStep(time, STEP)
    except FMICallException as error:
        return int(error.status)
    return int(fmi2OK)


def wants_to_end(host: Host) -> bool:
    return bool(host.fmu.getBooleanStatus(fmi2Terminated))


def last_time(host: Host) -> float:
    return float(host.fmu.getRealStatus(fmi2LastSuccessfulTime))


def test_status_after_a_discarded_step(
    fmus: dict[Motion, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with loaded(fmus[Motion.INPUTS], tmp_path / "x") as plant:
        plant.initialize()
        assert status_of_step(plant, 0.0) == fmi2OK
        assert (wants_to_end(plant), last_time(plant)) == (False, STEP)
        state = plant.fmu.getFMUState()
        plant.set(["mach_number"], [9.0])
        for time in (STEP, STEP, 2 * STEP):  # the same step again, or on all the same
            assert status_of_step(plant, time) == fmi2Discard
            assert (wants_to_end(plant), last_time(plant)) == (True, STEP)
        assert capsys.readouterr().out.count("outside the envelope") == 1
        plant.set(["mach_number"], [6.0])
        assert status_of_step(plant, 3 * STEP) == fmi2OK
        assert (wants_to_end(plant), last_time(plant)) == (False, 4 * STEP)
        plant.set(["mach_number"], [9.0])
        assert status_of_step(plant, 4 * STEP) == fmi2Discard
        assert capsys.readouterr().out.count("outside the envelope") == 1
        plant.fmu.setFMUState(state)
        assert (wants_to_end(plant), last_time(plant)) == (False, STEP)
        plant.set(["mach_number"], [9.0])
        assert status_of_step(plant, STEP) == fmi2Discard
        plant.fmu.reset()
        assert (wants_to_end(plant), last_time(plant)) == (False, 0.0)
        plant.fmu.freeFMUState(state)
        plant.initialize()


def test_motion_out_of_the_envelope(fmus: dict[Motion, Path], tmp_path: Path) -> None:
    with loaded(fmus[Motion.SHORT_PERIOD], tmp_path / "x") as plant:
        plant.set(["control_moment"], [MOMENT])
        plant.initialize()
        step = 0
        while status_of_step(plant, step * STEP) == fmi2OK:
            assert np.all(np.isfinite(plant.get([*COEFFICIENTS, *STRAINS])))
            step += 1
        assert 0 < step < 100
        assert (wants_to_end(plant), last_time(plant)) == (True, step * STEP)
        assert np.all(np.isnan(plant.get([*COEFFICIENTS, *STRAINS, "dynamic_pressure"])))


@pytest.mark.parametrize("motion", [Motion.INPUTS, Motion.SHORT_PERIOD])
def test_fmpy_ends_by_itself(fmus: dict[Motion, Path], motion: Motion, capsys: pytest.CaptureFixture[str]) -> None:
    start, ramp = {"control_moment": MOMENT}, None
    if motion is Motion.INPUTS:
        start = {}
        ramp = np.array([(0.0, 6.0), (1.0, 9.0)], dtype=[("time", float), ("mach_number", float)])
    result = fmpy.simulate_fmu(
        str(fmus[motion]),
        stop_time=10.0,
        step_size=STEP,
        output_interval=STEP,
        start_values=start,
        input=ramp,
        output=["C_N", "mach_number"],
        timeout=300.0,
    )
    assert 2 < len(result) < 200
    assert result["time"][-1] < 1.0
    # FMPy records once more at the last successful time, from outputs that are those outside.
    assert result["time"][-1] == result["time"][-2]
    assert np.all(np.isfinite(result["C_N"][:-1]))
    assert np.isnan(result["C_N"][-1])
    assert capsys.readouterr().out.count("outside the envelope") == 1


def test_the_own_master_reports_it(fmus: dict[Motion, Path]) -> None:
    system = System({"plant": fmus[Motion.SHORT_PERIOD]}, (), {"plant.control_moment": MOMENT})
    with pytest.raises(StrainfmuError, match=r"fmi2DoStep returned fmi2Discard at time .* outside the envelope"):
        simulate(system, 10.0, STEP)
