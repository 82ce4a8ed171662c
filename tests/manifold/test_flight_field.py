"""The pressure field of the nonlinear estimator: snapshots, loads, derivative, coverage."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from coarse_vehicle import true_flights
from flight_maps import flight_map

from builder.aero.load_operator import load_operator
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.problem import inverse_problem
from builder.manifold.nonlinear_build import with_manifold
from builder.structure.as_built.as_built_vehicle import exactly_built
from builder.structure.fourier.fourier_model import StructuralModel
from builder.trial.conditions import held_out_conditions
from builder.truth.flow_table import FlowTable, harmonics_at
from builder.truth.true_structure import TrueStructure
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.map.nonlinear_map import FlightField
from strainfmu.estimator.off_deadline import table_pressure


def exact_vehicle(vehicle: Vehicle, **entry: object) -> Vehicle:
    """``vehicle`` without hardware errors, with a map that holds the field."""
    held = {"estimator": "nonlinear", "keep_field": True, "discrepancy_percent": 0.8, **entry}
    return vehicle.model_copy(
        update={
            "map": vehicle.map.model_copy(
                update={"discrepancy_of_prior_percent": 1.0, "discrepancy_of_overpressure_percent": 1.0, **held}
            ),
            "noise": vehicle.noise.without_hardware_errors(),
        }
    )


@pytest.fixture(scope="module")
def inverse_map(vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots) -> InverseMap:
    entry = exact_vehicle(vehicle)
    problem = inverse_problem(entry, snapshots, structure)
    linear = build_inverse_map(entry, snapshots, structure, problem=problem)
    return with_manifold(linear, entry, snapshots, structure, problem=problem)


@pytest.fixture(scope="module")
def field(inverse_map: InverseMap) -> FlightField:
    assert inverse_map.manifold is not None
    assert inverse_map.manifold.pressure_field is not None
    return inverse_map.manifold.pressure_field


def test_snapshots_come_back_at_their_own_state(
    inverse_map: InverseMap, field: FlightField, snapshots: Snapshots
) -> None:
    manifold = inverse_map.manifold
    assert manifold is not None
    errors = []
    for row in range(0, len(snapshots.pressure), 13):
        condition = snapshots.conditions()[row]
        a, phi, ambient = condition.total_incidence, condition.leeward_roll_angle, condition.ambient_pressure
        state = np.array([condition.mach_number, a * np.cos(phi), a * np.sin(phi), np.log(ambient)])
        errors.append((table_pressure(manifold, field, state).value - snapshots.pressure[row]) / ambient)
    assert np.sqrt(np.mean(np.square(errors))) < np.sqrt(np.mean(field.table_error_std**2))
    assert np.max(np.abs(errors)) < 0.02 * np.max(snapshots.pressure) / ambient


def test_derivative_by_the_state(inverse_map: InverseMap, field: FlightField) -> None:
    manifold = inverse_map.manifold
    assert manifold is not None
    state = np.array([5.8, 0.05, -0.07, np.log(5000.0)])
    at = table_pressure(manifold, field, state)
    for place, step in enumerate((1e-4, 1e-5, 1e-5, 1e-4)):
        moved = step * np.eye(4)[place]
        ahead, behind = (table_pressure(manifold, field, state + sign * moved).value for sign in (1.0, -1.0))
        slope = (ahead - behind) / (2.0 * step)
        assert np.max(np.abs(slope - at.jacobian[:, place])) < 1e-5 * np.max(np.abs(slope))


def test_loads_of_the_field_are_those_of_the_estimate(
    vehicle: Vehicle, structure: StructuralModel, inverse_map: InverseMap, field: FlightField
) -> None:
    manifold = inverse_map.manifold
    assert manifold is not None
    loads = load_operator(structure.surface, vehicle.reference_quantities().moment_station)
    n_h = field.strain_covariance.shape[1]
    angle = np.outer(field.roll_angle, np.arange(n_h))
    nodes = np.einsum("rm,xmn->xrn", np.cos(angle), field.strain_covariance[:, :, 0]) + np.einsum(
        "rm,xmn->xrn", np.sin(angle), field.strain_covariance[:, :, 1]
    )
    covariance = loads @ nodes.reshape(field.n_nodes, -1)
    wanted = manifold.error_load @ manifold.error_strain.T
    assert np.all(np.abs(covariance - wanted) < 0.02 * np.abs(wanted).max(axis=1, keepdims=True))
    strain = 1.1 * inverse_map.mean_strain + 5.0 * inverse_map.noise_std * np.cos(np.arange(54.0))
    found = Estimator(inverse_map).estimate(strain, mach_number=6.0, altitude=20e3)
    net = found.pressure().pressure - found.air_data.value[5]
    assert not found.is_linear
    assert np.all(np.abs(loads @ net - found.loads) < 0.2 * found.loads_std + 1e-3 * np.abs(found.loads))


def test_sigma_covers_the_independent_model(
    vehicle: Vehicle, inverse_map: InverseMap, field: FlightField, table: FlowTable, true_model: TrueStructure
) -> None:
    random, n = np.random.default_rng(4), inverse_map.n_gauges
    conditions = held_out_conditions(vehicle, table, 12, random)
    flights = true_flights(vehicle, true_model, table, conditions)
    strain = flights.read(exactly_built(n))
    strain = strain + inverse_map.noise_std * random.standard_normal(strain.shape)
    mach = np.array([condition.mach_number for condition in conditions])
    found = Estimator(inverse_map).estimate(
        strain,
        flights.dynamic_pressure,
        mach_number=mach + 0.05 * random.standard_normal(12),
        static_pressure=flights.ambient_pressure * (1.0 + 0.02 * random.standard_normal(12)),
    )
    harmonic = harmonics_at(table, mach, np.array([one.total_incidence for one in conditions]))
    order = np.arange(harmonic.shape[2])
    inside, errors, of_linear = [], [], []
    linear = Estimator(inverse_map).linear.estimate(strain, flights.dynamic_pressure)
    for row, condition in enumerate(conditions):
        waves = np.cos(np.outer(order, field.roll_angle - condition.leeward_roll_angle))
        ambient = flights.ambient_pressure[row]
        truth = ambient * (harmonic[row] @ waves).ravel()
        one, other = found[row].pressure(), linear[row].pressure()
        assert other.is_net
        assert not one.is_net
        inside.append(np.abs(one.pressure - truth) <= 3.0 * one.std)
        errors.append(np.linalg.norm(one.pressure - truth) / np.linalg.norm(truth))
        of_linear.append(np.linalg.norm(other.pressure + ambient - truth) / np.linalg.norm(truth))
        assert np.mean(np.abs(other.pressure + ambient - truth) <= 3.0 * other.std) > 0.99
        assert np.median(one.std) < 0.06 * ambient
    assert np.mean(inside) > 0.99
    assert np.median(errors) < 0.02
    assert np.median(errors) < 0.3 * np.median(of_linear)


def test_strain_off_the_tables_gets_the_linear_field(inverse_map: InverseMap) -> None:
    q, n = inverse_map.nominal_dynamic_pressure, inverse_map.n_gauges
    strain = inverse_map.mean_strain + 2e-4 * np.random.default_rng(0).standard_normal(n)
    estimator = Estimator(inverse_map)
    found = estimator.track(strain, q, static_pressure=5474.9, mach_number=6.0)
    assert found.is_linear
    assert inverse_map.manifold is not None
    linear = estimator.linear.step(strain, q, dynamic_pressure_std=inverse_map.manifold.dynamic_pressure_error * q)
    ambient = 5474.9 if found.air_data_used[1] else np.exp(found.state[3])
    np.testing.assert_allclose(found.pressure().pressure, linear.pressure().pressure + ambient)
    assert np.all(found.pressure().std > linear.pressure().std)


def test_the_file_holds_the_field(inverse_map: InverseMap, tmp_path: Path) -> None:
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    loaded = load_inverse_map(tmp_path / "map.h5")
    strain = inverse_map.mean_strain
    one, other = (Estimator(held).estimate(strain).pressure() for held in (inverse_map, loaded))
    np.testing.assert_array_equal(one.pressure, other.pressure)
    np.testing.assert_array_equal(one.std, other.std)


def test_a_sample_without_gauges_has_no_pressure(inverse_map: InverseMap) -> None:
    found = Estimator(inverse_map).estimate(np.full((2, inverse_map.n_gauges), np.nan), 1e5)
    assert np.all(np.isnan(found[0].pressure().pressure))
    assert np.all(np.isnan(found[1].pressure().std))


def test_a_map_without_the_field_refuses(inverse_map: InverseMap) -> None:
    assert inverse_map.manifold is not None
    bare = replace(inverse_map, manifold=replace(inverse_map.manifold, pressure_field=None))
    with pytest.raises(InputError, match="holds no pressure field, expected one built with keep_field = true"):
        Estimator(bare).estimate(bare.mean_strain).pressure()


@pytest.mark.fast
def test_tables_of_other_gauges_are_refused() -> None:
    manifold = flight_map()
    held = FlightField(
        station=np.zeros(2),
        radius=np.ones(2),
        roll_angle=np.zeros(3),
        amplitude=np.zeros((*manifold.response.shape[:2], 2, 4), dtype=np.float32),
        strain_covariance=np.zeros((2, 2, 2, 7), dtype=np.float32),
        error_std=np.ones(2),
        table_error_std=np.ones((2, 3), dtype=np.float32),
    )
    with pytest.raises(InputError, match=r"pressure_field: strain_covariance has shape .*, must be .* 48"):
        replace(manifold, pressure_field=held)
