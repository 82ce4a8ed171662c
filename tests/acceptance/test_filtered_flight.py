"""The demonstration's manoeuvre with gauge noise alone, each sample by itself and filtered, as recorded data."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from builder.campaign.snapshots import Snapshots, load_snapshots, snapshots_on
from builder.inverse.build import build_inverse_map
from builder.manifold.nonlinear_build import with_manifold
from builder.structure.fourier.fourier_model import structural_model, with_mesh_error
from builder.trial.compared import knowing
from builder.vehicle.file import IC3X, load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.cosim.systems.recording import Recording, load_recording
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, save_inverse_map
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.slow
SETTLED = 100
"""Samples of the first second, in which a filter begins."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory, ic3x_demo: Path) -> Path:
    """Return the folder of the demonstration without errors of hardware, with a map that expects none."""
    folder = tmp_path_factory.mktemp("perfect") / "demo"
    main = "from strainfmu.cli.main import main; main()"
    command = [sys.executable, "-c", main, "demo", "--perfect", "-o", folder]
    subprocess.run([*command, "--snapshots", ic3x_demo / "snapshots.h5"], check=True, capture_output=True)
    save_inverse_map(map_of_gauge_noise(load_snapshots(ic3x_demo / "snapshots.h5")), folder / "noise.h5")
    return folder


def map_of_gauge_noise(snapshots: Snapshots) -> InverseMap:
    """Return the shipped vehicle's map for readings that err by the gauges' noise alone, as `compare` has it."""
    vehicle = knowing(load_vehicle(IC3X), is_exact=True, case=2)
    resolution = vehicle.resolution.map
    structure = structural_model(vehicle, resolution, [vehicle.gauges.layout])
    structure = with_mesh_error(structure, vehicle, resolution)
    on = snapshots_on(snapshots, structure.surface)
    return with_manifold(build_inverse_map(vehicle, on, structure), vehicle, on, structure)


def write_readings(flight: Recording, path: Path, seed: int) -> None:
    """Write strains, and a navigation with one constant error of M +-0.05 and p_inf +-2 %."""
    strains = [name for name in flight.names if name.startswith("plant.strain[")]
    static = np.array([pressure_and_temperature(h)[0] for h in flight["plant.altitude"]])
    random = np.random.default_rng(seed)
    mach = flight["plant.mach_number"] + 0.05 * random.standard_normal()
    pressure = static * (1.0 + 0.02 * random.standard_normal())
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["time [s]", *strains, "mach_number", "static_pressure [Pa]"])
        writer.writerows(np.column_stack([flight.time, *(flight[name] for name in strains), mach, pressure]))


def errors_of(flown: Path, time_constant: float | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return errors and their deviations (n, 5), and chi-square with its degrees of freedom (n, 2)."""
    estimate_file(flown / "noise.h5", flown / "readings.csv", flown / "loads.csv", filter_seconds=time_constant)
    table = np.genfromtxt(flown / "loads.csv", delimiter=",", names=True, deletechars="", replace_space=" ")
    flight = load_recording(flown / "flight.h5")
    truth = np.column_stack([flight[f"plant.{name}"] for name in COEFFICIENT_NAMES])
    found, std = (
        np.column_stack([table[f"{prefix}{name} [1]"] for name in COEFFICIENT_NAMES]) for prefix in ("", "sigma.")
    )
    health = np.column_stack([table[f"health.{name} [1]"] for name in ("chi_square", "degrees_of_freedom")])
    return (found - truth)[SETTLED:], std[SETTLED:], health[SETTLED:]


def test_a_filter_reduces_the_errors_of_a_manoeuvre(flown: Path) -> None:
    """Of air data drawn six times: rms errors, coverage, chi-square. Errors of air data and of the map's tables,
    which no average reduces, are most of an error; what differs from sample to sample is the gauges' noise."""
    squares, changes, flight = [], [], load_recording(flown / "flight.h5")
    for seed in range(6):
        write_readings(flight, flown / "readings.csv", seed)
        alone, alone_std, _ = errors_of(flown, None)
        filtered, filtered_std, innovation = errors_of(flown, 10.0)
        squares.append([np.mean(error**2, axis=0) for error in (alone, filtered)])
        changes.append([np.mean(np.diff(error, axis=0) ** 2, axis=0) for error in (alone, filtered)])
        print("rms errors, alone and filtered, in 1e-4:", *np.round(1e4 * np.sqrt(squares[-1]), 2))
        for error, std in ((alone, alone_std), (filtered, filtered_std)):
            held = 100.0 * np.mean(np.abs(error) <= 3.0 * std, axis=0)
            print("within 3 sigma, %:", np.round(held, 2))
            assert np.all(held >= 99.0)
        above = np.mean(innovation[:, 0] > chi2.ppf(0.995, innovation[:, 1]))
        below = np.mean(innovation[:, 0] < chi2.ppf(0.005, innovation[:, 1]))
        print(f"chi-square above, below their 99 % band: {100.0 * above:.2f}, {100.0 * below:.2f} %")
        assert above <= 0.005
    for what, of, most in (("errors", squares, 0.95), ("errors from sample to sample", changes, 0.5)):
        alone_rms, filtered_rms = np.sqrt(np.mean(of, axis=0))
        print(f"{what}, filtered over alone, all draws:", np.round(filtered_rms / alone_rms, 3))
        assert np.all(filtered_rms <= most * alone_rms)
