"""A placed layout from the vehicle file to results on the bus: the same way for every shipped vehicle."""

import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import fmpy
import numpy as np
import pytest
from bus_run import CYCLE, paced_bridge

from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.pipeline.place_and_review import structure_of
from builder.reporting import Silent
from builder.structure.solid import case
from builder.structure.solid.swept_mesh import RESOLUTIONS, SweptResolution
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.can.machine import Result
from strainfmu.can.options import BridgeOptions
from strainfmu.can.quality import Quality
from strainfmu.can.sender import send_flight
from strainfmu.can.setup import map_input_layout
from strainfmu.can.strain_sources import FlownSample
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, load_inverse_map

pytestmark = pytest.mark.slow

Run = Callable[..., tuple[int, str, str]]

GAUGES = 24
SAMPLES = 60
"""Samples of one flight condition, each with gauge noise of its own."""

SETTLED = 40
"""The first sample that is judged: filters and the bridge's trust have settled by then."""

SIGMA = [f"sigma.{name}" for name in COEFFICIENT_NAMES]
NAMES = sorted(path.stem for path in VEHICLES.glob("*.toml") if "[conditions]" in path.read_text(encoding="utf-8"))


@dataclass(frozen=True, eq=False)
class Flown:
    """A snapshot as the gauges read it: strain (n, n_d) [m/m], coefficients (5,), q_inf [Pa], Mach number,
    altitude [m]."""

    strain: np.ndarray
    truth: np.ndarray
    dynamic_pressure: float
    mach_number: float
    altitude: float


@pytest.fixture(autouse=True)
def coarse() -> Iterator[None]:
    """Meshes of tests for the solid walls that are meshed here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(RESOLUTIONS, "coarse", SweptResolution(0.12, 1, 24))
        patch.setattr(case, "CHECK_SIZE", 1.0)
        yield


def test_every_shipped_vehicle_is_taken() -> None:
    assert set(NAMES) == {"blunt_cone", "elliptic_cone", "finned_body", "ic3x", "launcher"}


@pytest.mark.parametrize("name", NAMES)
def test_a_placed_layout_goes_through_to_the_bus(name: str, tmp_path: Path, run: Run) -> None:
    shutil.copytree(VEHICLES, tmp_path / "vehicles")
    file, built = tmp_path / "vehicles" / f"{name}.toml", tmp_path / "built"
    text = file.read_text(encoding="utf-8").replace('engine = "euler"', 'engine = "newtonian"')
    text = text.replace("[map]\n", '[map]\nalarm_levels = "nominal"\n')
    file.write_text(text, encoding="utf-8")
    done(run("place", file, "--gauges", GAUGES, "--starts", 2, "-o", file.with_name("placed.csv")))
    text = re.sub(r'(?m)^layout = "\w+"', 'layout = "placed"', text)
    file.write_text(text + '\n[gauges.layouts.placed]\nfile = "placed.csv"\n', encoding="utf-8")
    done(run("build", file, "-o", built))
    page = (built / "report.html").read_text(encoding="utf-8")
    inverse_map = load_inverse_map(built / "map.h5")
    assert inverse_map.n_gauges == GAUGES
    for gauge in inverse_map.gauge_names:
        assert gauge in page
    done(run("export", built / "map.h5", "-o", built / "estimator.fmu"))
    flown = snapshots_in_flight(file, load_snapshots(built / "snapshots.h5"), inverse_map.noise_std)
    for one in flown:
        check_fmu(built / "estimator.fmu", one)
    check_bus(built / "estimator.fmu", flown[0], name)


def done(finished: tuple[int, str, str]) -> None:
    code, _, err = finished
    assert (code, err) == (0, "")


def snapshots_in_flight(file: Path, snapshots: Snapshots, noise_std: np.ndarray) -> list[Flown]:
    """Return three snapshots of the envelope as the gauges of the layout in use read them."""
    vehicle, random = load_vehicle(file), np.random.default_rng(4)
    structure = structure_of(vehicle, snapshots, Silent())
    operator = structure.strain_operator(vehicle.gauges.layout)
    coefficients, found = snapshots.coefficients(), []
    for k in np.linspace(0, len(snapshots.condition) - 1, 5).astype(int)[1:4]:
        condition = snapshots.conditions()[k]
        strain = operator @ (snapshots.pressure[k] - snapshots.internal_pressure[k])
        noise = random.standard_normal((SAMPLES, len(strain))) * noise_std
        pressure = condition.dynamic_pressure
        found.append(Flown(strain + noise, coefficients[k], pressure, condition.mach_number, condition.altitude))
    return found


def check_fmu(fmu: Path, flown: Flown) -> None:
    """Step the FMU by fmpy on the strains: loads within three sigma of the snapshot's loads."""
    known = {variable.name for variable in fmpy.read_model_description(str(fmu)).modelVariables}
    given = {f"strain[{i + 1}]": column for i, column in enumerate(flown.strain.T)}
    for name in ("dynamic_pressure", "mach_number", "altitude"):
        if name in known:
            given[name] = np.full(SAMPLES, getattr(flown, name))
    inputs = np.empty(SAMPLES, dtype=[(name, float) for name in ("time", *given)])
    inputs["time"] = CYCLE * np.arange(SAMPLES)
    for name, column in given.items():
        inputs[name] = column
    outputs = fmpy.simulate_fmu(
        str(fmu),
        input=inputs,
        stop_time=CYCLE * (SAMPLES - 1),
        step_size=CYCLE,
        output_interval=CYCLE,
        output=[*COEFFICIENT_NAMES, *SIGMA, "health.state"],
        fmi_type="CoSimulation",
    )[SETTLED:]
    assert set(outputs["health.state"]) == {HealthState.OK}
    for coefficient, sigma, truth in zip(COEFFICIENT_NAMES, SIGMA, flown.truth, strict=True):
        assert np.all(np.abs(outputs[coefficient] - truth) <= 3.0 * outputs[sigma]), coefficient


def check_bus(fmu: Path, flown: Flown, channel: str) -> None:
    """Send the strains to the bridge: VALID results, loads within three sigma of the snapshot's loads."""
    options = BridgeOptions(
        interface="virtual",
        channel=f"placed {channel}",
        cycle_time=CYCLE,
        restart="accept",  # this sender hears no result
    )
    sample = partial(FlownSample, mach_number=flown.mach_number, altitude=flown.altitude)
    samples = [sample(strain, flown.dynamic_pressure, flown.truth) for strain in flown.strain]
    results: list[Result] = []
    layout = map_input_layout(options, fmu)[0]
    with paced_bridge(fmu, options, record=None, publish=None, publish_rate=1.0, also=results.append) as paced:
        send_flight(paced, layout, samples=samples, clock=paced.clock, sleep=paced.sleep)
    judged = [one for one in results if one.counter is not None][SETTLED:]
    assert len(judged) > 0.5 * (SAMPLES - SETTLED)
    for one in judged:
        assert one.quality is Quality.VALID, one.causes
        assert np.all(np.abs(one.coefficients - flown.truth) <= 3.0 * one.coefficients_std)
