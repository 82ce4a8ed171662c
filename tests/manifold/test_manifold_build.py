"""Tables of the nonlinear estimator from real flows: accuracy between the snapshots, discrepancy, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from builder.aero.euler.planes import MarchingGrid
from builder.aero.load_operator import load_operator
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map, snapshot_coefficients
from builder.inverse.noise.error_list import GRID_REFINEMENT
from builder.inverse.noise.flow_models import FLOW_MODELS
from builder.inverse.noise.flows_between import SolvedFlows
from builder.inverse.problem import inverse_problem
from builder.inverse.solution import Problem
from builder.manifold.discrepancy import gaussian_process_shapes
from builder.manifold.flow_amplitudes import flow_amplitudes
from builder.manifold.nonlinear_build import tables_and_errors, with_manifold
from builder.manifold.state_tables import grid_errors
from builder.manifold.tables import (
    interpolation_errors,
    left_out_errors,
    ring_response,
    spline_coefficients,
    spline_rows,
)
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import HARDWARE_ERRORS, MapEntry, Noise
from builder.vehicle.model_form import model_form
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.numerics import basis

SIZES = (
    "model_form_percent",
    "discrepancy_percent",
    "discrepancy_of_prior_percent",
    "discrepancy_of_overpressure_percent",
    "discrepancy_of_leeward_percent",
    "discrepancy_of_newtonian_percent",
)
"""Entries of [map] that state a size of the model-form error."""


def with_entry(vehicle: Vehicle, **entry: object) -> Vehicle:
    return vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"estimator": "nonlinear", **entry})})


@pytest.fixture(scope="module")
def problem(vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots) -> Problem:
    """With all errors of the hardware."""
    return inverse_problem(with_entry(vehicle), snapshots, structure)


@pytest.fixture(scope="module")
def inverse_map(vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots) -> InverseMap:
    exact = vehicle.model_copy(update={"noise": vehicle.noise.without_hardware_errors()})
    small = dict.fromkeys(("discrepancy_of_prior_percent", "discrepancy_of_overpressure_percent"), 1.0)
    small["discrepancy_of_newtonian_percent"] = 0.0
    entry = with_entry(exact, discrepancy_percent=0.5, **small)
    exactly = inverse_problem(entry, snapshots, structure)
    linear = build_inverse_map(entry, snapshots, structure, problem=exactly)
    return with_manifold(linear, entry, snapshots, structure, problem=exactly)


def test_the_flows_own_grid_and_interpolation_are_the_numerical_error(
    vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots, problem: Problem, inverse_map: InverseMap
) -> None:
    """Without a model-form error these are all that is left of the pressure off the tables."""
    alone = vehicle.model_copy(update={"map": with_entry(vehicle, **dict.fromkeys(SIZES, 0.0)).map})
    found = with_manifold(inverse_map, alone, snapshots, structure, problem=replace(problem, entry=alone.map))
    names = [one["name"] for one in found.provenance["table_error_terms"]]
    assert [name for name in names if name != FLOW_MODELS] == [
        "interpolation",
        GRID_REFINEMENT,
        "internal pressure",
    ]
    whole = with_manifold(inverse_map, with_entry(vehicle), snapshots, structure, problem=problem)
    rms = {one["name"]: one["rms_strain"] for one in whole.provenance["table_error_terms"]}
    assert set(rms) > set(names)
    assert rms["interpolation"] < rms[GRID_REFINEMENT] < rms["fraction of the snapshots"]


def test_errors_of_interpolation_are_each_gauges_own(
    vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots, problem: Problem
) -> None:
    """Of the root mean square over the flows left out in turn; loads have none of them."""
    errors = tables_and_errors(problem, structure.surface)[1]["interpolation"]
    n_d, flows = len(problem.strain_operator), flow_amplitudes(snapshots).less_ambient()
    response = ring_response(
        np.vstack([problem.strain_operator, problem.load_operator]), snapshots.grid, flows.amplitude.shape[-1]
    )
    left_out = interpolation_errors(flows, response)[:, :n_d]
    np.testing.assert_allclose(errors[:n_d, :n_d], np.diag(np.sqrt(np.sum(left_out**2, axis=0))), rtol=1e-9)
    assert not np.any(errors[:n_d, n_d:])
    assert not np.any(errors[n_d:, :n_d])


def test_the_error_of_the_grid_is_the_difference_of_two(vehicle: Vehicle, snapshots: Snapshots) -> None:
    """At the ends of Mach number and incidence, and at the middle incidence; p / p_inf itself is about 1."""

    def errors_of(flows: Snapshots) -> np.ndarray | None:
        return grid_errors(SolvedFlows(snapshots=flows, entries=vehicle.flow_entries()))

    found = errors_of(snapshots)
    assert found is not None
    assert found.shape[:2] == (6, 40)
    size = np.sqrt(np.sum(found**2, axis=2).mean(axis=1))
    assert np.all((size > 1e-4) & (size < 0.1))
    straight = np.abs(found[[0, 3], :, 1:])  # without incidence the pressure is the same all round
    assert straight.max() < 0.01 * MarchingGrid().conical_tolerance
    assert errors_of(replace(snapshots, engine="newtonian")) is None
    assert errors_of(replace(snapshots, settings={})) is None


def test_a_middle_mach_number_left_out_of_three_follows_the_dynamic_pressure() -> None:
    """Tables have no error of pressure in proportion to M^2 about the ambient one, so none is expected."""
    mach, incidence = np.array([5.0, 6.5, 10.0]), np.radians([0.0, 2.0, 4.0, 6.0, 8.0, 10.0])
    values = np.broadcast_to((1.0 + 0.02 * mach**2)[:, None], (3, 6)).reshape(3, 6, 1, 1, 1)
    errors = left_out_errors(mach, incidence, np.array(values))
    assert len(errors) > 12
    assert np.abs(errors).max() < 1e-12
    bent = left_out_errors(mach, incidence, values + np.array([0.0, 0.1, 0.0]).reshape(3, 1, 1, 1, 1))
    assert np.abs(bent).max() == pytest.approx(0.05)


def test_sizes_of_the_model_form_error() -> None:
    """What is stated stays; the rest follows one entry, and is 0 in the source's mode."""
    default, paper = (
        Noise(std_um_per_m=1.0),
        Noise(std_um_per_m=1.0, model="paper", **dict.fromkeys(HARDWARE_ERRORS, 0.0)),
    )
    found = model_form(MapEntry(), default)
    assert (found.of_prior, found.of_overpressure, found.of_leeward) == pytest.approx((0.03, 0.1, 0.25))
    assert (found.process_at(10.0), found.process_at(100.0)) == pytest.approx((0.008, 0.02))
    half = model_form(MapEntry(model_form_percent=5.0, discrepancy_of_prior_percent=4.0), default)
    assert (half.of_prior, half.of_overpressure, half.process_at(100.0)) == pytest.approx((0.04, 0.05, 0.01))
    none = model_form(MapEntry(discrepancy_percent=0.5), paper)
    assert (none.of_prior, none.of_overpressure, none.of_leeward, none.process_at(9.0)) == (0.0, 0.0, 0.0, 0.005)
    nothing = model_form(MapEntry(**dict.fromkeys(SIZES, 0.0)), default)
    assert (nothing.of_prior, nothing.of_overpressure, nothing.process_at(9.0)) == (0.0, 0.0, 0.0)


def test_flights_between_the_snapshots_are_found(
    vehicle: Vehicle, structure: StructuralModel, held_out: Snapshots, inverse_map: InverseMap
) -> None:
    conditions = held_out.conditions()
    net = held_out.pressure - held_out.internal_pressure[:, None]
    strain = net @ structure.strain_operator(vehicle.gauges.layout).T
    random = np.random.default_rng(1)
    strain = strain + inverse_map.noise_std * random.standard_normal(strain.shape)
    q = np.array([condition.dynamic_pressure for condition in conditions])
    mach = np.array([condition.mach_number for condition in conditions])
    estimator = Estimator(inverse_map)
    found = estimator.estimate(
        strain,
        q,
        dynamic_pressure_std=0.0,
        mach_number=mach + 0.05 * random.standard_normal(len(q)),
        altitude=20e3,
        q_source="independent",
    )
    loads = load_operator(structure.surface, vehicle.reference_quantities().moment_station)
    true = snapshot_coefficients(vehicle, held_out, loads)
    error = found.coefficients - true
    linear = estimator.linear.estimate(strain, q, dynamic_pressure_std=0.0)
    rms, of_linear = (np.sqrt(np.mean(one**2, axis=0)) for one in (error, linear.coefficients - true))
    assert np.all(rms < 0.5 * of_linear)
    assert np.mean(np.abs(error) <= 3.0 * found.coefficients_std) > 0.98
    angle = np.array([condition.angle_of_attack for condition in conditions])
    assert np.quantile(np.abs(found.air_data.value[:, 0] - angle), 0.95) < np.radians(0.2)
    assert 0.7 < np.mean(found.chi_square / found.degrees_of_freedom) < 1.2


def test_hardware_errors_and_discrepancy_widen_sigma(
    vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots, inverse_map: InverseMap, problem: Problem
) -> None:
    wide = with_manifold(inverse_map, with_entry(vehicle), snapshots, structure, problem=problem)
    strain = inverse_map.mean_strain
    q = inverse_map.nominal_dynamic_pressure
    narrow, other = (Estimator(one).estimate(strain, q, mach_number=6.0) for one in (inverse_map, wide))
    # At zero incidence the discrepancy is small: the difference of flow models has no lateral part there.
    assert np.all(other.coefficients_std > 1.7 * narrow.coefficients_std)


def test_shapes_have_the_correlation_of_the_process(structure: StructuralModel) -> None:
    grid = structure.surface
    along, around = gaussian_process_shapes(grid, MapEntry(discrepancy_length=0.2, discrepancy_roll_deg=40.0))
    exact = np.exp(-0.5 * ((grid.x[:, None] - grid.x) / (0.2 * grid.x[-1])) ** 2)
    assert np.max(np.abs(along @ along.T - exact)) < 0.02
    assert np.max(np.abs(np.diag(around @ around.T) - 1.0)) < 0.02


@pytest.mark.fast
def test_knots_of_the_incidence_keep_their_distance() -> None:
    incidence = np.radians([2.0, 4.0, 5.0, 5.38, 6.0, 8.0, 8.1])
    assert np.degrees(incidence[spline_rows(incidence, np.radians(0.9))]).round(2).tolist() == [
        2.0,
        4.0,
        5.0,
        6.0,
        8.1,
    ]


@pytest.mark.fast
@pytest.mark.parametrize("degrees", [[1.0, 2.0, 4.0, 6.0], [3.0], [4.0, 4.4, 8.0, 12.0]])
def test_without_a_flow_along_the_axis_the_mean_goes_on_to_there(degrees: list[float]) -> None:
    """1 + 2 a^2 in harmonic 0, 3 a in harmonic 1: at zero incidence 1 and 0, and in between nearly as exact."""
    mach, incidence = np.array([5.0, 7.0]), np.radians(degrees)
    values = np.zeros((2, len(incidence), 1, 2, 2))
    values[..., 0, 0], values[..., 1, 0] = (1.0 + 2.0 * incidence**2)[:, None], (3.0 * incidence)[:, None]
    knots, table = spline_coefficients(mach, incidence, values, spline_rows(incidence), None)
    at = np.linspace(0.0, incidence[-1], 30)
    of_mach, of_incidence = basis(mach, np.array([6.0])).value, basis(knots, at).value
    found = np.einsum("ia,jb,abnms->ijnms", of_mach, of_incidence, table)[0, :, 0, :, 0]
    assert np.allclose(found[:, 0], 1.0 + 2.0 * at**2, atol=3.0 * incidence[0] ** 2)
    assert np.allclose(found[:, 1], 3.0 * at, atol=1e-9)


def test_flows_that_do_not_suffice_are_named(
    vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots, inverse_map: InverseMap, problem: Problem
) -> None:
    mach = np.array([condition.mach_number for condition in snapshots.conditions()])
    one = mach == 5.0
    few = rows_of(snapshots, one)
    with pytest.raises(InputError, match="needs 2 Mach numbers and 4 total incidences above 0 at least, got 1"):
        with_manifold(inverse_map, with_entry(vehicle), few, structure)
    torn = rows_of(snapshots, np.arange(len(mach)) != int(np.flatnonzero(one)[-1]))
    with pytest.raises(InputError, match="no flow at Mach number 5 and total incidence"):
        with_manifold(inverse_map, with_entry(vehicle), torn, structure)


def test_between_two_mach_numbers_pressure_is_linear_per_dynamic_pressure(
    vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots, inverse_map: InverseMap
) -> None:
    """Up to 6 deg that errs by less than linear in M does; half of what the two differ by counts as an error."""
    mach = np.array([condition.mach_number for condition in snapshots.conditions()])
    two = rows_of(snapshots, (mach == 5.0) | (mach == 7.0))
    flows, whole = flow_amplitudes(two), flow_amplitudes(snapshots)
    assert flows.mach.tolist() == [5.0, 6.0, 7.0]
    true, found = whole.less_ambient().amplitude[2], flows.less_ambient().amplitude
    linear = 0.5 * (found[0] + found[2])
    low = flows.incidence < np.radians(6.0)
    off, of_linear = (np.linalg.norm((one - true)[low]) for one in (found[1], linear))
    assert off < 0.7 * of_linear
    values = flows.amplitude[:, 1:, :, :1, None]
    left_out = left_out_errors(flows.mach, flows.incidence[1:], values, flows.of_two)
    expected = 0.5 * (found[1] - linear)[1:, :, :1, None]
    assert np.max(np.abs(left_out[-len(expected) :] - expected)) < 0.05 * np.max(np.abs(expected))
    made = with_manifold(inverse_map, with_entry(vehicle, keep_field=True), two, structure).manifold
    assert made is not None
    assert made.mach_knots.tolist() == [5.0, 6.0, 7.0]
    assert made.pressure_field is not None
    assert len(made.pressure_field.amplitude) == 5


def rows_of(snapshots: Snapshots, chosen: np.ndarray) -> Snapshots:
    names = ("condition", "pressure", "internal_pressure", "solved", "flow", "momentum_error", "repairs")
    changed = {name: getattr(snapshots, name)[chosen] for name in names}
    if snapshots.mass_error is not None:
        changed["mass_error"] = snapshots.mass_error[chosen]
    changed["solved"] = np.ones_like(changed["solved"])
    changed["flow"] = np.arange(len(changed["flow"]))
    return replace(snapshots, **changed)


def test_amplitudes_give_the_snapshots_back(snapshots: Snapshots) -> None:
    flows = flow_amplitudes(snapshots)
    condition = snapshots.conditions()[37]
    i = int(np.argmin(np.abs(flows.mach - condition.mach_number)))
    j = int(np.argmin(np.abs(flows.incidence - condition.total_incidence)))
    grid = snapshots.grid
    assert grid is not None
    m = np.arange(flows.amplitude.shape[-1])
    wave = np.cos(np.outer(m, grid.roll_angle - condition.leeward_roll_angle))
    found = condition.ambient_pressure * (flows.amplitude[i, j] @ wave).ravel()
    assert np.max(np.abs(found - snapshots.pressure[37])) < 0.02 * np.max(snapshots.pressure[37])
