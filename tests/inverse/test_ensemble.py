"""Ensembles at one pressure level and at every roll angle, against flows rolled one by one."""

from dataclasses import replace
from math import asin, atan2, cos, radians, sin
from typing import Any

import numpy as np
import pytest
from inverse_case import snapshots_at
from sweeps import sweep

from builder.aero.engine import Engine
from builder.aero.engines.euler import EulerEngine
from builder.aero.euler.planes import marching_grid_of
from builder.aero.load_operator import load_operator
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map, snapshot_coefficients
from builder.inverse.ensemble import ROLLS, Ensemble, ensemble_of, rolled_modes
from builder.structure.fourier.fourier_model import StructuralModel, structural_model
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import MapEntry, Noise
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.reference.gain import load_covariance
from strainfmu.flight_condition import FlightCondition

N_X, N_FLOWS = 4, 5


def random_ensemble(fixed_pressure: float = 0.0) -> Ensemble:
    """Return 5 flows of random pressure on 4 x 24 nodes, rolled: the first has its wind along the axis and is
    axisymmetric, the others have no plane of symmetry.
    """
    random = np.random.default_rng(1)
    x = np.linspace(0.0, 1.0, N_X)
    grid = SurfaceGrid(x=x, radius=0.1 * x, angle=np.full(N_X, 0.1), n_roll=ROLLS)
    pressure = 1e4 * random.standard_normal((N_FLOWS, N_X, ROLLS))
    pressure[0] = pressure[0].mean(axis=1, keepdims=True)
    angles = (0.0, 2.0, 4.0, 6.0, 8.0)
    return Ensemble(
        pressure=pressure.reshape(N_FLOWS, -1),
        fixed_pressure=fixed_pressure,
        conditions=tuple(FlightCondition(6.0, radians(angle), 0.0, 20e3) for angle in angles),
        scale=random.uniform(0.5, 2.0, (N_FLOWS, 5)),
        fixed_scale=random.uniform(0.5, 2.0, (N_FLOWS, 5)),
        ambient_pressure=np.full(N_FLOWS, 5475.0),
        nominal_dynamic_pressure=138e3,
        grid=grid,
    )


def rolled(ensemble: Ensemble) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (120, n_p) pressure of every flow at 24 roll angles, the row's flow (120,), and its weight (120,).

    A flow along the axis counts once, any other once per roll angle.
    """
    fields, flows, weights = [], [], []
    for roll in range(ROLLS):
        for number, field in enumerate(ensemble.pressure.reshape(N_FLOWS, N_X, ROLLS)):
            fields.append(np.roll(field, roll, axis=1).ravel())
            flows.append(number)
            weights.append(1.0 / ROLLS if number == 0 else 1.0)
    return np.array(fields), np.array(flows), np.array(weights) / np.sum(weights)


@pytest.mark.fast
@pytest.mark.parametrize("weighted", [False, True])
def test_modes_are_those_of_all_rolled_flows(weighted: bool) -> None:
    """V' W V = I, C W V = V diag(variance), all of the trace, C by the book from 120 rolled fields: 1e-10."""
    ensemble = random_ensemble()
    fields, _, share = rolled(ensemble)
    of_ring = np.repeat([0.3, 0.7, 1.1, 1.9], ROLLS)
    w = of_ring if weighted else np.ones(N_X * ROLLS)
    mean = share @ fields
    covariance = (fields - mean).T @ (share[:, None] * (fields - mean))
    found = rolled_modes(ensemble, of_ring if weighted else None)
    np.testing.assert_allclose(found.mean, mean, rtol=0.0, atol=1e-10 * np.abs(mean).max())
    # The same at all nodes of a ring: all of them together are at every roll angle.
    assert np.ptp(found.mean.reshape(N_X, ROLLS), axis=1).max() == 0.0
    variance = found.coefficient_std**2
    assert np.all(np.diff(variance) <= 1e-12 * variance[0])
    v = found.modes
    np.testing.assert_allclose(v.T @ (w[:, None] * v), np.eye(v.shape[1]), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(covariance @ (w[:, None] * v), v * variance, rtol=0.0, atol=1e-10 * variance[0])
    root = np.sqrt(w)
    brute = np.linalg.eigvalsh(root[:, None] * covariance * root)[::-1][: len(variance)]
    np.testing.assert_allclose(variance, brute, rtol=0.0, atol=1e-10 * brute[0])
    assert variance.sum() == pytest.approx(np.sum(w * np.diag(covariance)), rel=1e-10)


@pytest.mark.fast
def test_members_means_and_responses_are_those_of_rolled_flows() -> None:
    ensemble = random_ensemble(fixed_pressure=2e4)
    fields, flows, share = rolled(ensemble)
    np.testing.assert_array_equal(np.concatenate(list(ensemble.members())), fields)
    np.testing.assert_allclose(ensemble.member_weight, share, rtol=1e-12)
    assert ensemble.member_weight.sum() == pytest.approx(1.0, rel=1e-12)
    operator = np.random.default_rng(2).standard_normal((5, N_X * ROLLS))
    np.testing.assert_allclose(ensemble.responses(operator), (fields - 2e4) @ operator.T, rtol=1e-9)
    expected = (
        fields @ operator.T * ensemble.scale[flows] - 2e4 * operator.sum(axis=1) * ensemble.fixed_scale[flows]
    )
    np.testing.assert_allclose(ensemble.coefficients(operator), expected, rtol=1e-9)
    np.testing.assert_allclose(ensemble.mean(), share @ fields, rtol=1e-9)


def condition_at(incidence_deg: float, roll_deg: float, altitude: float = 20e3) -> FlightCondition:
    """Return M 6 at a total incidence [deg] with the leeward meridian at ``roll_deg``."""
    total, roll = radians(incidence_deg), radians(roll_deg)
    return FlightCondition(6.0, atan2(sin(total) * cos(roll), cos(total)), -asin(sin(total) * sin(roll)), altitude)


@pytest.fixture(scope="module")
def engine(vehicle: Vehicle, structure: StructuralModel, compiled_solver: None) -> EulerEngine:
    return EulerEngine(vehicle.body(), marching_grid_of(vehicle.resolution.map), structure.surface)


def with_map(vehicle: Vehicle, internal_pressure: float | str = "ambient", **entry: Any) -> Vehicle:
    structure = vehicle.structure.model_copy(update={"internal_pressure_Pa": internal_pressure})
    return vehicle.model_copy(update={"map": MapEntry(**entry), "structure": structure})


def test_members_are_the_flows_at_other_roll_angles(
    vehicle: Vehicle, structure: StructuralModel, engine: Engine
) -> None:
    """Pressure and coefficients of the solver's own flows at 24 roll angles, in the order of the members: 1e-9."""
    one = snapshots_at(engine, vehicle, [condition_at(7.0, 0.0)])
    ensemble = ensemble_of(vehicle, one)
    every = snapshots_at(engine, vehicle, [condition_at(7.0, 15.0 * roll) for roll in range(ROLLS)])
    members = np.concatenate(list(ensemble.members()))
    ambient = condition_at(7.0, 0.0).ambient_pressure
    np.testing.assert_allclose(members, every.pressure - ambient, rtol=0.0, atol=1e-9 * np.abs(members).max())
    loads = load_operator(structure.surface, vehicle.reference.moment_station_m)
    expected = snapshot_coefficients(vehicle, every, loads)
    np.testing.assert_allclose(ensemble.coefficients(loads), expected, rtol=0.0, atol=1e-9)


CONDITIONS = [condition_at(0.0, 0.0), condition_at(4.0, 10.0), condition_at(9.0, -100.0)]


def at_altitude(condition: FlightCondition, altitude: float) -> FlightCondition:
    return replace(condition, altitude=altitude)


@pytest.fixture(scope="module")
def of_altitudes(vehicle: Vehicle, engine: EulerEngine) -> Snapshots:
    """The three conditions at 12, 20 and 28 km."""
    conditions = [at_altitude(one, altitude) for altitude in (20e3, 12e3, 28e3) for one in CONDITIONS]
    return snapshots_at(engine, vehicle, conditions)


@pytest.fixture(scope="module")
def of_one(vehicle: Vehicle, engine: EulerEngine) -> Snapshots:
    return snapshots_at(engine, vehicle, CONDITIONS)


@pytest.mark.parametrize("symmetry", ["full", "listed"])
def test_flows_of_several_altitudes_are_those_of_one(
    symmetry: str, vehicle: Vehicle, structure: StructuralModel, of_altitudes: Snapshots, of_one: Snapshots
) -> None:
    """Pressure over q_inf, and what that of a member at the nominal q_inf gives in coefficients: 1e-12."""
    entry = with_map(vehicle, symmetry=symmetry)
    several, single = ensemble_of(entry, of_altitudes), ensemble_of(entry, of_one)
    assert len(several.pressure) == (9 if symmetry == "listed" else 3)
    ratio = several.nominal_dynamic_pressure / single.nominal_dynamic_pressure
    expected = ratio * np.tile(single.pressure, (len(several.pressure) // 3, 1))
    np.testing.assert_allclose(several.pressure, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(several.mean(), ratio * single.mean(), rtol=1e-9)
    loads = load_operator(structure.surface, vehicle.reference.moment_station_m)
    found, coefficients = several.coefficients(loads), single.coefficients(loads)
    if symmetry == "listed":
        coefficients = np.tile(coefficients, (3, 1))
        np.testing.assert_allclose(found, snapshot_coefficients(entry, of_altitudes, loads), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found, coefficients, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("form", ["absolute", "dynamic_pressure"])
def test_a_fixed_internal_pressure_does_not_scale(
    form: str, vehicle: Vehicle, structure: StructuralModel, of_altitudes: Snapshots
) -> None:
    """Pressure of the flow alone follows q_inf; coefficients are those of the flights: 1e-12."""
    entry = with_map(vehicle, internal_pressure=30e3, form=form, symmetry="listed")
    ensemble = ensemble_of(entry, of_altitudes)
    assert ensemble.fixed_pressure == 30e3
    dynamic = np.array([[one.dynamic_pressure] for one in of_altitudes.conditions()])
    ratio = 1.0 if form == "absolute" else ensemble.nominal_dynamic_pressure / dynamic
    np.testing.assert_allclose(ensemble.pressure, ratio * of_altitudes.pressure, rtol=1e-12)
    loads = load_operator(structure.surface, vehicle.reference.moment_station_m)
    expected = snapshot_coefficients(entry, of_altitudes, loads)
    np.testing.assert_allclose(ensemble.coefficients(loads), expected, rtol=0.0, atol=1e-12)
    z_p = structure.strain_operator(vehicle.gauges.layout)
    np.testing.assert_allclose(ensemble.responses(z_p), (ratio * of_altitudes.pressure - 30e3) @ z_p.T, rtol=1e-9)


def test_an_operator_that_reads_nothing_has_responses_of_zero(vehicle: Vehicle, of_altitudes: Snapshots) -> None:
    """Such as the turn of a row of gauges that none of some gauges is in."""
    ensemble = ensemble_of(vehicle, of_altitudes)
    nothing = np.zeros((2, of_altitudes.pressure.shape[1]))
    assert ensemble.grid is not None
    np.testing.assert_array_equal(ensemble.responses(nothing), np.zeros((len(ensemble.member_weight), 2)))


def test_the_absolute_form_takes_one_internal_pressure(vehicle: Vehicle, of_altitudes: Snapshots) -> None:
    entry = with_map(vehicle, form="absolute", symmetry="listed")
    message = r"^map.form 'absolute': expected one internal pressure, got 1\d+.* to \d+.* Pa; give one altitude, "
    with pytest.raises(InputError, match=message) as refused:
        ensemble_of(entry, of_altitudes)
    assert "\n" not in str(refused.value)
    assert ensemble_of(with_map(vehicle, 30e3, form="absolute"), of_altitudes).fixed_pressure == 30e3


def sideslip_snapshots(vehicle: Vehicle, engine: Engine, sideslip: list[float]) -> Snapshots:
    conditions = [
        FlightCondition(mach, radians(alpha), radians(beta), 20e3)
        for mach in (5.0, 7.0)
        for alpha in (0.0, 3.0, 8.0)
        for beta in sideslip
    ]
    return snapshots_at(engine, vehicle, conditions)


@pytest.mark.parametrize("case", sweep([1, 2], [2]))
def test_the_sign_of_a_listed_angle_does_not_limit_a_map(
    case: int, vehicle: Vehicle, compiled_solver: None
) -> None:
    """Sideslip 0..4 deg and -4..4 deg: the same covariances, means and envelope; OK at negative sideslip.

    To 1e-3 of a standard deviation, on 48 roll angles: what the flow solver's cells give at a node depends on its
    roll angle by that much. A map of the listed signs alone is OK at none of them.
    """
    resolution = vehicle.resolution.map.model_copy(update={"surface_roll_angles": 48})
    structure = structural_model(vehicle, resolution, [vehicle.gauges.layout])
    engine = EulerEngine(vehicle.body(), marching_grid_of(resolution), structure.surface)
    half = sideslip_snapshots(vehicle, engine, [0.0, 2.0, 4.0])
    whole = sideslip_snapshots(vehicle, engine, [-4.0, -2.0, 0.0, 2.0, 4.0])
    # Gains alone: the other errors cost time and do not depend on the snapshots.
    noise = Noise(
        std_um_per_m=0.3,
        gauge_position_mm=0.0,
        gauge_orientation_deg=0.0,
        layout_roll_deg=0.0,
        wall_thickness_percent=0.0,
    )
    plain = vehicle.model_copy(update={"noise": noise})
    maps = [build_inverse_map(with_map(plain, case=case), one, structure) for one in (half, whole)]
    one, other = maps
    for covariance in (lambda held: held.noise_covariance, load_covariance):
        found, expected = covariance(one), covariance(other)
        std = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(found / np.outer(std, std), expected / np.outer(std, std), rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(one.mean_strain, other.mean_strain, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(one.envelope_limit, other.envelope_limit, rtol=0.0, atol=1e-6)
    negative = np.array([condition.sideslip_angle < 0.0 for condition in whole.conditions()])
    inside = np.array([[condition.ambient_pressure] for condition in whole.conditions()])
    strain = (whole.pressure - inside) @ structure.strain_operator(vehicle.gauges.layout).T
    q = np.array([condition.dynamic_pressure for condition in whole.conditions()])
    first, second = (Estimator(found).estimate(strain[negative], q[negative]) for found in maps)
    assert np.all(first.health == HealthState.OK)
    np.testing.assert_allclose(
        first.coefficients / first.coefficients_std, second.coefficients / first.coefficients_std, atol=1e-3
    )
    listed = build_inverse_map(with_map(plain, case=case, symmetry="listed"), half, structure)
    signed = Estimator(listed).estimate(strain[negative], q[negative])
    assert np.all(signed.health != HealthState.OK)
