"""Section loads by the nonlinear estimator: flights between the snapshots, lost gauges, the fall back, turns."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from fmu_host import loaded

from builder.aero.load_groups import section_operator
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.problem import inverse_problem
from builder.manifold.nonlinear_build import with_manifold
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.other_loads import names_of
from strainfmu.estimator.reference.air import air_data_at
from strainfmu.estimator.settings import default_settings
from strainfmu.fmu.export import export_estimator

STATIONS = (0.6, 1.2, 1.75, 2.5, 3.6)


class Flights(NamedTuple):
    """Strain of flights between the snapshots, their q_inf and Mach number, and section loads (k, n_s, 6)."""

    strain: FloatArray
    dynamic_pressure: FloatArray
    mach_number: FloatArray
    truth: FloatArray


@pytest.fixture(scope="module")
def inverse_map(vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots) -> InverseMap:
    entry = {"estimator": "nonlinear", "section_stations_m": STATIONS}
    changed = vehicle.model_copy(update={"map": vehicle.map.model_copy(update=entry)})
    problem = inverse_problem(changed, snapshots, structure)
    linear = build_inverse_map(changed, snapshots, structure, problem=problem)
    return with_manifold(linear, changed, snapshots, structure, problem=problem)


@pytest.fixture(scope="module")
def flights(vehicle: Vehicle, structure: StructuralModel, held_out: Snapshots, inverse_map: InverseMap) -> Flights:
    operator = section_operator(structure.surface, STATIONS)
    net = held_out.pressure - held_out.internal_pressure[:, None]
    strain = net @ structure.strain_operator(vehicle.gauges.layout).T
    strain = strain + inverse_map.noise_std * np.random.default_rng(2).standard_normal(strain.shape)
    conditions = held_out.conditions()
    return Flights(
        strain=strain,
        dynamic_pressure=np.array([one.dynamic_pressure for one in conditions]),
        mach_number=np.array([one.mach_number for one in conditions]),
        truth=np.swapaxes((net @ operator.T).reshape(-1, 6, 5), 1, 2),
    )


def estimate(estimator: Estimator, flights: Flights, valid: np.ndarray | None = None) -> Estimate:
    return estimator.estimate(
        flights.strain,
        flights.dynamic_pressure,
        valid=valid,
        mach_number=flights.mach_number,
        altitude=20e3,
        q_source="independent",
    )


def test_section_loads_between_the_snapshots(inverse_map: InverseMap, flights: Flights) -> None:
    """Within 3 sigma but for 1 %, nearer than the linear map's; at the base the whole loads with their sigmas."""
    estimator = Estimator(inverse_map)
    found = estimate(estimator, flights)
    assert found.fits.all()
    error = found.section_loads.loads - flights.truth
    assert np.mean(np.abs(error) <= 3.0 * found.section_loads.std) >= 0.99
    linear = estimator.linear.estimate(flights.strain, flights.dynamic_pressure)
    rms, of_linear = (
        np.sqrt(np.mean((one - flights.truth)[:, :, 1:5] ** 2))
        for one in (found.section_loads.loads, linear.section_loads.loads)
    )
    print(f"rms of shear and bending {rms:.3g}, of the linear map {of_linear:.3g} [N, N m]")
    assert rms < of_linear
    base, of_base = found.section_loads.loads[:, -1], found.section_loads.std[:, -1]
    np.testing.assert_allclose(base[:, :3], found.loads[:, :3], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(of_base[:, :3], found.loads_std[:, :3], rtol=1e-6)
    np.testing.assert_array_equal(found.section_loads.torsion, 0.0)
    np.testing.assert_array_equal(found.M_R, 0.0)


def test_sigmas_are_wider_with_fewer_gauges_and_still_hold(inverse_map: InverseMap, flights: Flights) -> None:
    valid = np.ones(flights.strain.shape, dtype=bool)
    valid[:, ::3] = False
    estimator = Estimator(inverse_map)
    all_of_them, fewer = estimate(estimator, flights), estimate(estimator, flights, valid)
    wide, narrow = (np.sqrt(np.mean(one.section_loads.std**2, axis=0)) for one in (fewer, all_of_them))
    assert np.all(wide[:, :5] >= narrow[:, :5])
    error = np.abs(fewer.section_loads.loads - flights.truth)
    assert np.mean(error <= 3.0 * fewer.section_loads.std) >= 0.99


def test_coefficients_follow_the_references(inverse_map: InverseMap, flights: Flights) -> None:
    first = default_settings(inverse_map)
    other = replace(
        first, reference_area=2.0 * first.reference_area, reference_length=3.0 * first.reference_length
    )
    one, two = (estimate(Estimator(inverse_map, each), flights) for each in (first, other))
    np.testing.assert_array_equal(two.other_loads, one.other_loads)
    ratio = np.array([1.0, *np.repeat([1.0, 1.0, 1.0, 3.0, 3.0, 1.0], 5)]) * 2.0
    np.testing.assert_allclose(two.other_coefficients * ratio, one.other_coefficients, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(two.other_coefficients_std * ratio, one.other_coefficients_std, rtol=1e-12)


def test_strain_off_the_tables_gets_the_section_loads_of_the_linear_map(
    inverse_map: InverseMap, flights: Flights
) -> None:
    estimator = Estimator(inverse_map)
    spoiled = flights.strain[:4] * np.where(np.arange(flights.strain.shape[1]) % 2, 1.6, 0.5)
    q = flights.dynamic_pressure[:4]
    found = estimator.estimate(spoiled, q, mach_number=flights.mach_number[:4])
    linear = estimator.linear.estimate(spoiled, q, dynamic_pressure_std=0.03 * q)
    assert found.is_linear.all()
    np.testing.assert_allclose(found.section_loads.loads, linear.section_loads.loads, rtol=1e-9)


def test_filtered(inverse_map: InverseMap, flights: Flights) -> None:
    """A filter gives at the base the whole loads with their sigmas, in a flight that stays."""
    strain, q = np.tile(flights.strain[0], (10, 1)), flights.dynamic_pressure[0]
    found = Estimator(inverse_map).filter(1.0).track(strain, q, altitude=20e3, time=0.01 * np.arange(10))[-1]
    assert not found.is_linear
    np.testing.assert_allclose(found.section_loads.loads[-1, :3], found.loads[:3], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(found.section_loads.std[-1, :3], found.loads_std[:3], rtol=1e-6)
    error = np.abs(found.section_loads.loads - flights.truth[0])
    assert np.mean(error <= 3.0 * found.section_loads.std) >= 0.9


@pytest.mark.parametrize("time_constant", [1.0, 10.0])
def test_a_turn_does_not_pass_for_errors_that_last(inverse_map: InverseMap, time_constant: float) -> None:
    """Angles of up to 8 deg that change by 10 deg/s, navigation exact: slopes that lag behind the turn put it into
    errors that last, and angles err by degrees."""
    assert inverse_map.manifold is not None
    random, time = np.random.default_rng(3), 0.02 * np.arange(200)
    angle, state = 2.0 * np.pi * 0.2 * time, np.tile([6.0, 0.0, 0.0, 8.6], (200, 1))
    state[:, 1] = np.radians(3.0) + np.radians(5.0) * np.sin(angle)
    state[:, 2] = np.radians(8.0) * np.cos(angle)
    pressure = float(np.exp(8.6))
    strain = evaluate(inverse_map.manifold.tables, state).value[:, : inverse_map.n_gauges]
    strain = strain + inverse_map.noise_std * random.standard_normal(strain.shape)
    flow = {"mach_number": 6.0, "static_pressure": pressure}
    flight = Estimator(inverse_map).filter(time_constant)
    found = flight.track(strain, 0.7 * 36.0 * pressure, time=time, **flow)
    true = air_data_at(state)
    scores = ((found.air_data.value - true) / found.air_data.std)[:, :3]
    assert np.max(np.abs(scores)) < 3.0


def test_files_and_fmus(inverse_map: InverseMap, flights: Flights, tmp_path: Path) -> None:
    """A file gives the same loads; an FMU gives the loads of the file."""
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    read = load_inverse_map(tmp_path / "map.h5")
    one, two = (estimate(Estimator(each), flights) for each in (inverse_map, read))
    np.testing.assert_array_equal(two.other_loads, one.other_loads)
    export_estimator(tmp_path / "map.h5", tmp_path / "map.fmu")
    one = Estimator(read).estimate(flights.strain[0], flights.dynamic_pressure[0])
    with loaded(tmp_path / "map.fmu", tmp_path / "fmu") as host:
        host.initialize()
        host.set([f"strain[{i + 1}]" for i in range(read.n_gauges)], flights.strain[0])
        host.set(["dynamic_pressure"], [flights.dynamic_pressure[0]])
        for prefix, expected in (("", one.other_loads), ("sigma.", one.other_loads_std)):
            found = host.get([f"{prefix}{name}" for name in names_of(inverse_map.load_groups)[1:]])
            scale = np.repeat(np.abs(expected[1:]).reshape(2, -1).max(axis=1), len(found) // 2)
            assert np.max(np.abs(found - expected[1:]) / scale) < 1e-11
