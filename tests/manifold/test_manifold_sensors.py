"""Flush ports, inertial unit, load cells, displacement and fibres with the nonlinear estimator, errors drawn."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from fmu_host import loaded

from builder.aero.load_operator import load_operator
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.noise.model import NoiseTerm
from builder.inverse.problem import inverse_problem
from builder.inverse.sensor_set import base_area
from builder.inverse.solution import Problem
from builder.manifold.nonlinear_build import manifold_map, with_manifold
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.sensor_entries import Sensors
from strainfmu.arrays import FloatArray
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.sensor_variables import reading_names
from tests.inverse.test_sensors import CELLS, FIBRE, IMU, POINTS, PORTS

EVERY_KIND = Sensors(
    ports=PORTS,
    imu=IMU,
    load_cells=CELLS,
    displacement=POINTS,
    fibre=FIBRE,
    base_pressure_ratio=0.4,
    base_pressure_percent=20.0,
    friction_C_A=0.01,
    friction_C_A_std=0.005,
)
DRAWS = 250


def with_sensors(vehicle: Vehicle, sensors: Sensors | None) -> Vehicle:
    changed = vehicle.map.model_copy(update={"estimator": "nonlinear"})
    return vehicle.model_copy(update={"map": changed, "sensors": sensors})


def built(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> tuple[InverseMap, Problem]:
    problem = inverse_problem(vehicle, snapshots, structure)
    linear = build_inverse_map(vehicle, snapshots, structure, problem=problem)
    return with_manifold(linear, vehicle, snapshots, structure, problem=problem), problem


class Flights(NamedTuple):
    """Readings in units, q_inf, M, p_inf and coefficients of n flights, and pressure on the surface (n, n_p)."""

    readings: FloatArray
    dynamic_pressure: FloatArray
    mach_number: FloatArray
    static_pressure: FloatArray
    coefficients: FloatArray
    pressure: FloatArray


def as_flown(held_out: Snapshots, chosen: np.ndarray, net: FloatArray) -> dict[str, np.ndarray]:
    """Return the fields of snapshots of the flights: flows of the rows ``chosen`` with the pressure ``net``."""
    names = ("condition", "internal_pressure", "solved", "flow", "momentum_error", "repairs")
    fields = {name: getattr(held_out, name)[chosen] for name in names}
    return fields | {"pressure": net + fields["internal_pressure"][:, None], "mass_error": np.zeros(len(chosen))}


def errors_of(vehicle: Vehicle, flown: Snapshots, structure: StructuralModel) -> Iterator[tuple[FloatArray, bool]]:
    """Yield the strain per dynamic pressure (n, n_d) of each error at the flows as listed, and whether all rows
    have it in common."""
    listed = vehicle.map.model_copy(update={"symmetry": "listed", "estimator": "linear"})
    problem = inverse_problem(vehicle.model_copy(update={"map": listed}), flown, structure)
    for error in problem.errors:
        yield error.strain / problem.ensemble.nominal_dynamic_pressure, error.common


def flights(
    vehicle: Vehicle,
    inverse_map: InverseMap,
    problem: Problem,
    held_out: Snapshots,
    structure: StructuralModel,
    n: int,
) -> Flights:
    """Return held-out flows at any roll angle with every error drawn, those of M and p_inf too; q_inf is exact.

    Base pressure and friction follow their definitions.
    """
    random, conditions = np.random.default_rng(4), held_out.conditions()
    chosen = random.integers(len(conditions), size=n)
    p = np.array([conditions[i].ambient_pressure for i in chosen])
    q = np.array([conditions[i].dynamic_pressure for i in chosen])
    mach = np.array([conditions[i].mach_number for i in chosen])
    net, grid = held_out.pressure[chosen] - held_out.internal_pressure[chosen, None], held_out.grid
    assert grid is not None
    rings, turns = net.reshape(n, -1, grid.n_roll), random.integers(grid.n_roll, size=n)
    net = np.array([np.roll(one, turn, axis=1).ravel() for one, turn in zip(rings, turns, strict=True)])
    rows, reference = net @ problem.strain_operator.T, vehicle.reference_quantities()
    for strain, common in errors_of(vehicle, replace(held_out, **as_flown(held_out, chosen, net)), structure):
        rows += q[:, None] * strain * random.standard_normal((n, 1 if common else strain.shape[1]))
    following = {one.name for one in problem.errors} | {"base pressure", "friction", "internal pressure"}
    for term in problem.noise:
        if term.name not in following:
            assert not term.scales, term.name
            rows += term.draw(random, n)
    inside, sensors, entry = 0.01 * vehicle.noise.internal_pressure_percent, problem.sensors, vehicle.sensors
    uniform = problem.strain_operator.sum(axis=1)
    if sensors is not None and entry is not None:
        n_g = len(uniform) - len(sensors.rows)
        uniform[n_g:] *= [one.follows_inside for one in sensors.rows]
        base = 1.0 - entry.base_pressure_ratio + 0.01 * entry.base_pressure_percent * random.standard_normal(n)
        friction = entry.friction_C_A + entry.friction_C_A_std * random.standard_normal(n)
        force = base * p * base_area(entry, reference) + friction * q * reference.area
        rows[:, n_g:] += np.outer(force, sensors.per_axial_force)
    rows += np.outer(inside * p * random.standard_normal(n), uniform)
    scale = inverse_map.sensors.scale
    loads = net @ load_operator(grid, reference.moment_station).T
    size = reference.area * np.array([1.0, 1.0, 1.0, reference.length, reference.length])
    pressure = net + p[:, None]
    mach = mach + vehicle.noise.navigation_mach_number * random.standard_normal(n)
    p = p * (1.0 + 0.01 * vehicle.noise.navigation_static_pressure_percent * random.standard_normal(n))
    return Flights(rows * scale, q, mach, p, loads / (q[:, None] * size), pressure)


def estimated(inverse_map: InverseMap, flown: Flights, *without: str, start: FloatArray | None = None) -> Estimate:
    """Return the estimates, sensors whose name begins with one of ``without`` left out."""
    found = Estimator(inverse_map).estimate(
        flown.readings,
        flown.dynamic_pressure,
        valid=np.array([not name.startswith(without) for name in inverse_map.gauge_names]),
        dynamic_pressure_std=0.0,
        mach_number=flown.mach_number,
        static_pressure=flown.static_pressure,
        q_source="independent",
        start=start,
    )
    return found


@pytest.fixture(scope="module")
def equipped(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> tuple[InverseMap, Problem]:
    return built(with_sensors(vehicle, EVERY_KIND), snapshots, structure)


def test_sensors_sharpen_what_strain_says(
    vehicle: Vehicle, held_out: Snapshots, structure: StructuralModel, equipped: tuple[InverseMap, Problem]
) -> None:
    """Ports and unit: C_A by a quarter, C_N to a third, M_P to an eighth. Coverage of strain, these, and all."""
    inverse_map, problem = equipped
    flown = flights(with_sensors(vehicle, EVERY_KIND), inverse_map, problem, held_out, structure, DRAWS)
    others = ("cell", "tip", "displacement", "fibre")
    sigma = []
    for without in (("port", "imu", *others), others, ("none",)):
        found = estimated(inverse_map, flown, *without)
        inside = np.abs(found.coefficients - flown.coefficients) <= 3.0 * found.coefficients_std
        sigma.append(np.sqrt(np.mean(found.coefficients_std**2, axis=0)))
        assert np.all(inside.mean(axis=0) >= 0.99)
        assert np.mean(found.fits & np.array([one == () for one in found.suspects])) >= 0.99
    alone, both, every = sigma
    axial, normal, side, pitch, yaw = both / alone
    assert axial <= 0.75
    assert max(normal, side) <= 0.37
    assert max(pitch, yaw) <= 0.125
    assert np.all(every <= both * 1.02)


def test_lost_sensors_leave_the_tables_built_without_them(
    vehicle: Vehicle,
    snapshots: Snapshots,
    held_out: Snapshots,
    structure: StructuralModel,
    equipped: tuple[InverseMap, Problem],
) -> None:
    """One or more of each kind, a whole fibre among them."""
    lost = ["port_180deg", "imu_pitch", "imu_yaw", "cell_normal", "tip_up"]
    lost += [f"fibre_90deg_{k + 1}" for k in range(FIBRE.count)]
    rest = {
        "ports": PORTS.model_copy(update={"roll_deg": [0.0, 90.0, 270.0]}),
        "imu": IMU.model_copy(update={"angular": False}),
        "load_cells": CELLS.model_copy(update={"components": ["axial", "yaw"]}),
        "displacement": POINTS.model_copy(update={"point": POINTS.point[1:]}),
        "fibre": FIBRE.model_copy(update={"roll_deg": [0.0]}),
    }
    whole, problem = equipped
    fewer = with_sensors(vehicle, EVERY_KIND.model_copy(update=rest))
    rebuilt, _ = built(fewer, snapshots, structure)
    flown = flights(with_sensors(vehicle, EVERY_KIND), whole, problem, held_out, structure, 20)
    valid = np.array([name not in lost for name in whole.gauge_names])
    assert rebuilt.gauge_names == tuple(np.array(whole.gauge_names)[valid])
    assert not np.isnan(flown.readings).any()
    flown.readings[:, ~valid] = np.nan
    flown_rebuilt = flown._replace(readings=flown.readings[:, valid])
    found = estimated(whole, flown, "none")
    # Searches end after a fixed number of iterations: 2.1e-9 sigma apart, 1.9e-7 from the minimum.
    expected = estimated(rebuilt, flown_rebuilt, "none")
    np.testing.assert_allclose((found.loads - expected.loads) / expected.loads_std, 0.0, atol=1e-8)
    np.testing.assert_allclose(found.state, expected.state, atol=1e-9)
    # From one state both agree to rounding.
    found = estimated(whole, flown, "none", start=expected.state)
    expected = estimated(rebuilt, flown_rebuilt, "none", start=expected.state)
    np.testing.assert_allclose((found.loads - expected.loads) / expected.loads_std, 0.0, atol=1e-11)
    np.testing.assert_allclose(found.loads_std, expected.loads_std, rtol=1e-10)
    np.testing.assert_allclose(found.chi_square, expected.chi_square, rtol=1e-11)
    np.testing.assert_allclose(found.state, expected.state, atol=1e-12)
    assert HealthState.OK not in found.health


def test_readings_of_the_tables_hold_base_pressure_and_friction(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel, equipped: tuple[InverseMap, Problem]
) -> None:
    """At a snapshot the tables give its readings; the axial ones with 0.6 p_inf S and 0.01 q_inf S on top."""
    inverse_map, problem = equipped
    assert inverse_map.manifold is not None
    condition = snapshots.conditions()[40]
    u, w = (condition.total_incidence * f(condition.leeward_roll_angle) for f in (np.cos, np.sin))
    state = np.array([[condition.mach_number, u, w, np.log(condition.ambient_pressure)]])
    n_g = inverse_map.n_strain_gauges
    rows = evaluate(inverse_map.manifold.tables, state).value[0, n_g : inverse_map.n_gauges]
    reading = dict(zip(inverse_map.gauge_names[n_g:], rows * inverse_map.sensors.scale[n_g:], strict=True))
    net = snapshots.pressure[40] - condition.ambient_pressure
    direct = problem.strain_operator[n_g:] @ net * inverse_map.sensors.scale[n_g:]
    expected = dict(zip(reading, direct, strict=True))
    area = vehicle.reference_quantities().area
    extra = 0.6 * condition.ambient_pressure * area + 0.01 * condition.dynamic_pressure * area
    expected["imu_axial"] += extra / IMU.mass_kg
    expected["cell_axial"] += extra
    for name, value in expected.items():
        kind = inverse_map.sensors.kind[inverse_map.gauge_names.index(name)]
        like = [abs(expected[one]) for one in expected if one.split("_")[0] == name.split("_")[0]]
        assert reading[name] == pytest.approx(value, abs=2e-3 * max(like)), kind
    assert reading["imu_axial"] == pytest.approx(expected["imu_axial"], rel=1e-3)


def test_errors_of_gains_are_those_of_each_row(vehicle: Vehicle, equipped: tuple[InverseMap, Problem]) -> None:
    """Displacement and fibres share Young's modulus with the gauges; ports, unit and cells have gains alone."""
    inverse_map, _ = equipped
    held, noise = inverse_map.manifold, vehicle.noise
    assert held is not None
    own = dict(zip(inverse_map.gauge_names, 100.0 * held.gain_std, strict=True))
    common = dict(zip(inverse_map.gauge_names, 100.0 * held.common_gain, strict=True))
    assert (own["port_0deg"], own["cell_yaw"], own["tip_up"]) == pytest.approx((0.25, CELLS.gain_percent, 0.5))
    assert (common["port_0deg"], common["imu_normal"], common["cell_yaw"]) == (0.0, 0.0, 0.0)
    assert common["tip_up"] == common["fibre_0deg_1"] == pytest.approx(noise.common_gain_percent)
    first = inverse_map.gauge_names[0]
    assert (own[first], common[first]) == pytest.approx((noise.gauge_gain_percent, noise.common_gain_percent))


def test_broken_sensors_are_named_and_ranges_are_their_own(
    vehicle: Vehicle, held_out: Snapshots, structure: StructuralModel, equipped: tuple[InverseMap, Problem]
) -> None:
    inverse_map, problem = equipped
    flown = flights(with_sensors(vehicle, EVERY_KIND), inverse_map, problem, held_out, structure, 1)
    exact = Estimator(inverse_map)
    at = {
        "dynamic_pressure": flown.dynamic_pressure,
        "mach_number": flown.mach_number,
        "static_pressure": flown.static_pressure,
    }
    names = inverse_map.gauge_names
    port, cell = names.index("port_90deg"), names.index("cell_normal")
    broken = flown.readings.copy()
    broken[:, cell] += 500.0
    one = exact.step(broken[0], **{name: float(value[0]) for name, value in at.items()})
    assert one.suspects == (cell,)
    broken = flown.readings.copy()
    broken[:, port] = 3e5  # beyond the range of 2e5 Pa
    one = exact.step(broken[0], **{name: float(value[0]) for name, value in at.items()})
    assert one.health == HealthState.DEGRADED
    assert np.flatnonzero(~one.valid).tolist() == [port]
    zeros = exact.zeros
    assert len(zeros.value) == inverse_map.n_strain_gauges


def test_filter_takes_sensors(
    vehicle: Vehicle, held_out: Snapshots, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """One flight ten times, noise new each time: forces get sharper; moments, which noise hardly moves, stay.

    Without the error of the coarse grid, of whose many directions the filter retains a part: with it the sigma of
    M_Y is 4 % larger than in one sample.
    """
    grid_unknown = replace(snapshots, settings={})
    inverse_map, problem = built(with_sensors(vehicle, EVERY_KIND), grid_unknown, structure)
    flown = flights(with_sensors(vehicle, EVERY_KIND), inverse_map, problem, held_out, structure, 1)
    random, static = np.random.default_rng(8), Estimator(inverse_map)
    noise = inverse_map.noise_std * inverse_map.sensors.scale
    readings = flown.readings[0] + noise * random.standard_normal((10, inverse_map.n_gauges))
    q, mach, p = (float(one[0]) for one in flown[1:4])
    flow = {"mach_number": mach, "static_pressure": p}
    found = static.filter(0.5).track(readings, q, time=0.01 * np.arange(10), **flow)[-1]
    last = static.step(readings[-1], q, **flow)
    ratio = found.coefficients_std / last.coefficients_std
    assert np.all(ratio[:3] < 0.97)
    assert np.all(ratio < 1.02)
    apart = (found.coefficients - flown.coefficients[0]) / last.coefficients_std
    assert np.all(np.abs(apart) < 4.0)


def test_map_is_kept_in_a_file_and_its_fmu_gives_the_same(
    tmp_path: Path,
    vehicle: Vehicle,
    held_out: Snapshots,
    structure: StructuralModel,
    equipped: tuple[InverseMap, Problem],
) -> None:
    """Flights of the vehicle, one sensor of each kind lost in turn, with thrust."""
    inverse_map, problem = equipped
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    loaded_map = load_inverse_map(tmp_path / "map.h5")
    assert inverse_map.manifold is not None
    assert loaded_map.manifold is not None
    np.testing.assert_array_equal(loaded_map.manifold.gain_std, inverse_map.manifold.gain_std)
    options = ExportOptions(platforms=["linux64"])
    assert export_estimator(tmp_path / "map.h5", tmp_path / "e.fmu", options) == "nonlinear"
    lost = ["none", "port_90deg", "imu_axial", "imu_pitch", "cell_axial", "tip_up", "fibre_90deg_1"]
    flown = flights(with_sensors(vehicle, EVERY_KIND), inverse_map, problem, held_out, structure, len(lost))
    sensors, thrust, tracker = inverse_map.sensors, 250.0, Estimator(inverse_map)
    names = ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
    with loaded(tmp_path / "e.fmu", tmp_path / "x") as host:
        host.initialize()
        for k, name in enumerate(lost):
            readings = flown.readings[k] + thrust * sensors.thrust_response
            readings[[one == name for one in inverse_map.gauge_names]] = np.nan
            flow = {
                "dynamic_pressure": float(flown.dynamic_pressure[k]),
                "mach_number": float(flown.mach_number[k]),
                "static_pressure": float(flown.static_pressure[k]),
            }
            one = tracker.track(sensors.without_thrust(readings, thrust), **flow)
            assert one.valid.sum() == inverse_map.n_gauges - (k > 0)
            host.set([*reading_names(inverse_map), *flow, "thrust"], [*readings, *flow.values(), thrust])
            host.fmu.doStep(0.01 * k, 0.01)
            apart = (host.get(names) - one.coefficients) / one.coefficients_std
            np.testing.assert_allclose(apart, 0.0, atol=1e-7)
            sigma = host.get([f"sigma.{one}" for one in names])
            np.testing.assert_allclose(sigma, one.coefficients_std, rtol=1e-7)


def test_ports_sharpen_the_pressure_about_them(
    vehicle: Vehicle, snapshots: Snapshots, held_out: Snapshots, structure: StructuralModel
) -> None:
    """By a quarter at the node next to a port, with the true pressure within 3 standard deviations everywhere."""
    holding = with_sensors(vehicle, Sensors(ports=PORTS))
    holding = holding.model_copy(update={"map": holding.map.model_copy(update={"keep_field": True})})
    inverse_map, problem = built(holding, snapshots, structure)
    flown, grid = flights(holding, inverse_map, problem, held_out, structure, 12), structure.surface
    node = int(np.argmin(np.abs(grid.x - PORTS.x_m))) * grid.n_roll
    with_ports, alone = estimated(inverse_map, flown, "none"), estimated(inverse_map, flown, "port")
    inside, ratio = [], []
    for k, true in enumerate(flown.pressure):
        one, other = with_ports[k].pressure(), alone[k].pressure()
        inside.append(np.abs(one.pressure - true) <= 3.0 * one.std)
        ratio.append(one.std[node] / other.std[node])
    assert np.mean(ratio) < 0.77
    assert np.mean(inside) >= 0.99
    assert np.mean(np.array(inside)[:, node : node + grid.n_roll]) >= 0.99


def test_further_terms_are_those_of_the_gauges(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel, equipped: tuple[InverseMap, Problem]
) -> None:
    """A nuisance that scales widens the gauges' covariance and leaves the sensors' alone."""
    inverse_map, problem = equipped
    n_g = inverse_map.n_strain_gauges
    term = NoiseTerm("warmth", 1e-6 * np.ones((n_g, 1)), scales=True)
    wide, _ = manifold_map(problem, structure.surface, [term])
    assert inverse_map.manifold is not None
    held = inverse_map.manifold.scaled_covariance
    added = (wide.scaled_covariance - held) / np.sqrt(np.outer(np.diagonal(held), np.diagonal(held)))
    assert np.all(np.diagonal(added)[:n_g] > 1e-3)
    np.testing.assert_allclose(added[n_g:, n_g:], 0.0, atol=1e-9)
