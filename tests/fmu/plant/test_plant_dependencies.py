"""What the plant's first outputs depend on, as its InitialUnknowns state it: all of that, and nothing else."""

from pathlib import Path

import pytest
from slender_vehicle import make_slender_files
from starting_fmu import Starting

from strainfmu.fmu.plant_export import export_native_plant
from strainfmu.interface.plant_variables import FlightStart, GaugeFault, Motion

pytestmark = pytest.mark.fast

START = FlightStart(mach_number=6.0, altitude=20e3, angle_of_attack=0.05, sideslip_angle=0.02)
TRIED = {
    "mach_number": (6.5, 60.0),
    "altitude": (2.1e4, 1e9),
    "sideslip_angle": (0.03, 1.5),
    "angle_of_attack": (0.06, 1.5),
    "initial_angle_of_attack": (0.06, 1.5),
    "noise_std": (0.0,),
    "seed": (5.0,),
}
"""Within the envelope and outside; other variables take what differs from their start values."""


@pytest.mark.parametrize("motion", [Motion.INPUTS, Motion.SHORT_PERIOD])
def test_the_plant_states_its_true_dependencies(tmp_path: Path, motion: Motion) -> None:
    make_slender_files(tmp_path)
    fmu = tmp_path / "plant.fmu"
    export_native_plant(tmp_path / "flight_model.h5", fmu, motion, START)
    plant = Starting(fmu, tmp_path / "unzipped")
    known = {n: float(v.start) for n, v in plant.variables.items() if v.causality in ("input", "parameter")}
    changed: dict[str, set[str]] = {name: set() for name in plant.stated}
    for kind in (GaugeFault.NONE, GaugeFault.BIAS):  # the value of a fault counts where there is one
        for name in known:
            if name.startswith("fault_kind"):
                plant.set(name, kind)
                known[name] = float(kind)
        for name, start in known.items():
            other = (0.0, 4.0) if name.startswith("fault_kind") else (1.5 * start + 1e-4,)
            for output in plant.changed_by(name, TRIED.get(name, other), start):
                changed[output].add(name)
    # Only at the edge of the envelope C_A and C_Y depend on the angle of attack of this plant: it is tried.
    assert changed == plant.stated
    plant.fmu.freeInstance()
