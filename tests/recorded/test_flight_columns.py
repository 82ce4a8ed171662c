"""Recorded strains with the nonlinear estimator: air data, navigation and the kind of loads as columns."""

import threading
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from flight_maps import ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map
from synthetic_vehicle import SyntheticFiles

from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.flight_condition import FlightCondition
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.fast
N_D, K = STATIONS * ROWS, 12


def flights() -> list[FlightCondition]:
    return [FlightCondition(6.0, np.radians(0.6 * i), np.radians(2.0), 20e3) for i in range(K)]


def strains() -> np.ndarray:
    rows = []
    for one in flights():
        u, w = (one.total_incidence * f(one.leeward_roll_angle) for f in (np.cos, np.sin))
        rows.append(exact_response(one.mach_number, u, w, one.ambient_pressure)[:N_D])
    return np.array(rows) + 2e-7 * np.random.default_rng(1).standard_normal((K, N_D))


@pytest.fixture
def map_path(tmp_path: Path) -> Path:
    whole = replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=1e-3))
    save_inverse_map(whole, tmp_path / "map.h5")
    return tmp_path / "map.h5"


def write_table(path: Path) -> Path:
    strain = 1e6 * strains()
    header = ["time [s]", "dynamic_pressure [Pa]", "mach_number [1]", "altitude [m]"]
    header += [f"g{i} [um/m]" for i in range(N_D)]
    lines = [",".join(header)]
    for i, one in enumerate(flights()):
        row = [0.01 * i, one.dynamic_pressure, one.mach_number, one.altitude, *strain[i]]
        lines.append(",".join(f"{value:.9g}" for value in row))
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_air_data_are_columns(map_path: Path, tmp_path: Path) -> None:
    data = write_table(tmp_path / "flight.csv")
    summary = estimate_file(map_path, data, tmp_path / "out.h5", accept_strain_level=True)
    assert summary.samples == K
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["air_data.angle_of_attack"].attrs["unit"] == "rad"
        angle, std = file["air_data.angle_of_attack"][()], file["sigma.air_data.angle_of_attack"][()]
        assert np.all(file["navigation_used.mach_number"][()] == 1.0)
        assert np.all(file["linear_loads"][()] == 0.0)
        assert np.all(file["identified.air_data.total_incidence"][()] == 1.0)
    true = np.array([one.angle_of_attack for one in flights()])
    assert np.all(np.abs(angle - true) < 4.0 * std)


def write_flights(path: Path, strain: np.ndarray, condition: FlightCondition) -> Path:
    with h5py.File(path, "w") as file:
        file["strain"], file["time"] = strain, 0.01 * np.arange(len(strain))
        file["dynamic_pressure"] = np.full(len(strain), condition.dynamic_pressure)
        file["mach_number"] = np.full(len(strain), condition.mach_number)
        file["altitude"] = np.full(len(strain), condition.altitude)
    return path


def test_filtered_and_smoothed_estimates_say_so(
    map_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("strainfmu.recorded.samples.BLOCK_ROWS", 30)
    one, rng = flights()[5], np.random.default_rng(0)
    u, w = (one.total_incidence * f(one.leeward_roll_angle) for f in (np.cos, np.sin))
    exact = exact_response(one.mach_number, u, w, one.ambient_pressure)[:N_D]
    strain = exact + 2e-7 * rng.standard_normal((80, N_D))
    data, found = write_flights(tmp_path / "flight.h5", strain, one), {}
    for name, options in {
        "static": {},
        "filtered": {"filter_seconds": 1.0},
        "smoothed": {"filter_seconds": 1.0, "smooth": True},
    }.items():
        seen: list[int] = []
        summary = estimate_file(
            map_path,
            data,
            tmp_path / f"{name}.h5",
            progress=lambda at, _, s=seen: s.append(at),
            accept_strain_level=True,
            **options,
        )
        assert summary.samples == 80
        assert len(seen) == 3
        with h5py.File(tmp_path / f"{name}.h5") as file:
            found[name] = file["sigma.C_N"][()], dict(file.attrs), file["time"][()], file["C_N"][()]
    assert "filter_time_constant" not in found["static"][1]
    assert (found["filtered"][1]["filter_time_constant"], found["filtered"][1]["smoothed"]) == (1.0, False)
    assert found["smoothed"][1]["smoothed"]
    assert np.all(np.diff(found["smoothed"][2]) > 0.0)
    assert np.mean(found["smoothed"][0]) < np.mean(found["filtered"][0]) < np.mean(found["static"][0])
    assert np.var(found["smoothed"][3]) < np.var(found["filtered"][3]) < np.var(found["static"][3])


def test_a_caller_that_holds_the_lock_of_h5py_waits_for_nothing(map_path: Path, tmp_path: Path) -> None:
    """h5py holds its lock while a loop over the items of a file is under way; another thread would wait for it."""
    one = flights()[5]
    data = write_flights(tmp_path / "flight.h5", np.full((80, N_D), 1e-5), one)

    def estimate_in_a_loop() -> None:
        with h5py.File(data) as file:
            for name, _ in file.items():
                estimate_file(map_path, data, tmp_path / f"{name}.h5", accept_strain_level=True)

    caller = threading.Thread(target=estimate_in_a_loop, daemon=True)
    caller.start()
    caller.join(timeout=60.0)
    assert not caller.is_alive()
    assert (tmp_path / "time.h5").is_file()


def test_smoothing_needs_a_filter_and_a_filter_a_map(map_path: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--smooth: expected with --filter, got it alone"):
        estimate_file(map_path, tmp_path / "flight.h5", tmp_path / "out.h5", smooth=True)


def test_an_fmu_is_not_filtered(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--filter: expected an inverse map, got an FMU"):
        estimate_file(synthetic.estimator_1, tmp_path / "flight.h5", tmp_path / "out.h5", filter_seconds=1.0)
