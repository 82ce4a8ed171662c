"""The shipped examples beside the first vehicle, from file to flown FMU, scored on independent discretisations."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from finned_body import DEFLECTIONS_DEG, OTHER_SURFACE, write_surface
from fmpy.validation import validate_fmu
from published_run import check_published_run

from builder.pipeline.demonstration.demo import demo, vehicle_as_built
from builder.reporting import Silent
from builder.structure.structure_file import load_structure
from builder.truth.shape import flights_along, flows_along, flying_structure
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import load_inverse_map

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def finned_demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finned")
    demo(folder, VEHICLES / "finned_body.toml")
    return folder


def coverage(folder: Path) -> dict[str, float]:
    found: dict[str, float] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["coverage"]
    return found


@pytest.mark.parametrize("name", ["elliptic_cone", "blunt_cone", "launcher"])
def test_loads_lie_within_three_sigma(name: str, tmp_path: Path) -> None:
    demo(tmp_path, VEHICLES / f"{name}.toml")
    assert min(coverage(tmp_path).values()) >= 0.99
    assert load_inverse_map(tmp_path / "map.h5").provenance["mesh_error"]["rms_sigma"] <= 1.0
    assert validate_fmu(str(tmp_path / "estimator.fmu")) == []
    check_published_run(tmp_path / "estimator.fmu", has_air_data=True)


@pytest.mark.parametrize("name", ["elliptic_cone", "finned_body", "blunt_cone"])
def test_loads_of_the_nonlinear_estimator_lie_within_three_sigma(name: str, tmp_path: Path) -> None:
    demo(tmp_path, VEHICLES / f"{name}.toml", estimator="nonlinear")
    assert min(coverage(tmp_path).values()) >= 0.99
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["healthy"] >= 0.99
    assert validate_fmu(str(tmp_path / "estimator.fmu")) == []
    check_published_run(tmp_path / "estimator.fmu", has_air_data=True)


def test_loads_of_the_finned_body_lie_within_three_sigma(finned_demo: Path) -> None:
    found = coverage(finned_demo)
    assert min(found.values()) >= 0.98
    assert found["M_R"] >= 0.99
    mesh = load_inverse_map(finned_demo / "map.h5").provenance["mesh_error"]
    assert mesh["sigmas_trusted"]
    assert validate_fmu(str(finned_demo / "estimator.fmu")) == []
    check_published_run(finned_demo / "estimator.fmu", has_air_data=True)


def test_rolling_moment_of_turned_fins_on_another_surface(finned_demo: Path, tmp_path: Path) -> None:
    """Flow, its surface and its rolling moment from triangles of another size; the structure of another mesh."""
    for path in VEHICLES.glob("finned_body*"):
        shutil.copy(path, tmp_path)
    write_surface(tmp_path / "finned_body.stl", *OTHER_SURFACE)
    for value in DEFLECTIONS_DEG:
        path = tmp_path / f"finned_body_roll_{value:+g}deg.stl"
        write_surface(path, *OTHER_SURFACE, deflection=np.deg2rad(value))
    vehicle = load_vehicle(tmp_path / "finned_body.toml")
    structure = flying_structure(vehicle, load_structure(finned_demo / "structure.h5"), Silent())
    path = load_trajectory(tmp_path / "finned_body_manoeuvre.csv", ("fin_roll_deg",))
    flows = flows_along(vehicle, path, Silent())
    parts = list(flights_along(vehicle, structure, flows, np.linspace(0.0, path.stop_time, 200), path))
    true = np.concatenate([part.coefficients[:, 5] for part in parts])
    pressure = np.concatenate([part.dynamic_pressure for part in parts])
    inverse_map = load_inverse_map(finned_demo / "map.h5")
    random, inside, error = np.random.default_rng(5), [], []
    for seed in range(10):
        built = vehicle_as_built(vehicle, seed)
        strain = np.concatenate([part.read(built) for part in parts])
        noise = random.standard_normal(strain.shape) * inverse_map.noise_std
        stated = pressure * (1.0 + built.dynamic_pressure.item())
        found = Estimator(inverse_map).estimate(strain + noise, stated)
        error.append(found.M_R - true)
        inside.append(np.abs(error[-1]) <= 3.0 * found.sigma.M_R)
    share, rms = np.mean(inside), np.sqrt(np.mean(np.square(error))) / np.ptp(true)
    print(f"rolling moment: within 3 sigma {100 * share:.2f} %, rms error {100 * rms:.2f} % of the range")
    assert share >= 0.99
    assert rms <= 0.1  # what the sigmas say, 0.086
