"""The difference of flow models: its tables, its noise term, and what it does to an estimate."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import N_D, NOISE_STD, exact_response, flight_map, whole_map, with_considered_error
from scaled_maps import scaled_map

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.ensemble import ensemble_of
from builder.inverse.noise.flow_models import FLOW_MODELS, LEVEL, newtonian_snapshots
from builder.inverse.problem import inverse_problem
from builder.inverse.solution import with_flow_models
from builder.manifold.nonlinear_build import with_manifold
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from builder.vehicle.model_form import model_form
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import evaluate

STATE = (6.0, 0.07, 0.03, 5e3)
"""M [1], u, w [rad], p_inf [Pa]."""


def air_data(mach: float, pressure: float) -> dict[str, float]:
    return {"mach_number": mach, "static_pressure": pressure, "dynamic_pressure": 0.7 * mach**2 * pressure}


def read(amplitude: float, considered: np.ndarray) -> np.ndarray:
    """Exact strain of the flow and ``amplitude`` times the considered error."""
    return exact_response(*STATE)[:N_D] + amplitude * considered[:N_D]


@pytest.fixture(scope="module")
def both() -> tuple[Estimator, Estimator, np.ndarray]:
    """Estimators without and with a considered error, and its response (n_d + 5,) at the state."""
    plain = replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=1e-2))
    wide = with_considered_error(plain)
    assert wide.manifold is not None
    assert wide.manifold.considered_tables is not None
    state = np.array([[*STATE[:3], np.log(STATE[3])]])
    return Estimator(plain), Estimator(wide), evaluate(wide.manifold.considered_tables, state).value[0]


def test_a_considered_error_widens_and_corrects_nothing(both: tuple[Estimator, Estimator, np.ndarray]) -> None:
    plain, wide, considered = both
    for amplitude in (0.0, 1.0, -2.0):
        strain = read(amplitude, considered)
        one, other = (it.estimate(strain, **air_data(STATE[0], STATE[3])) for it in (plain, wide))
        np.testing.assert_array_equal(one.loads, other.loads)
        assert other.chi_square <= one.chi_square
        assert np.all(other.loads_std > one.loads_std)
        assert np.all(other.coefficients_std > one.coefficients_std)


def test_its_size_follows_the_residual(both: tuple[Estimator, Estimator, np.ndarray]) -> None:
    """Little where strain fits the tables, more with the square of what it does not."""
    _, wide, considered = both

    def variance(amplitude: float) -> np.ndarray:
        found = wide.estimate(read(amplitude, considered), **air_data(STATE[0], STATE[3]))
        return np.asarray(found.loads_std**2)

    fits, once, twice = variance(0.0), variance(1.0), variance(2.0)
    assert np.any(once > 1.5 * fits)
    np.testing.assert_allclose(twice - fits, 4.0 * (once - fits), atol=0.1 * np.max(once - fits))


def test_errors_of_flows_with_a_drawn_difference_are_inside(both: tuple[Estimator, Estimator, np.ndarray]) -> None:
    _, wide, considered = both
    random = np.random.default_rng(3)
    amplitude = random.standard_normal(400)
    strain = np.array([read(one, considered) for one in amplitude])
    strain += NOISE_STD * random.standard_normal(strain.shape)
    found = wide.estimate(strain, **{k: np.full(400, v) for k, v in air_data(STATE[0], STATE[3]).items()})
    truth = exact_response(*STATE)[N_D:] + amplitude[:, None] * considered[N_D:]
    z = (found.loads - truth) / found.loads_std
    fits = ~found.is_linear
    assert fits.sum() > 50
    assert np.all(np.abs(z[fits]) < 4.0)
    assert np.all(np.sqrt(np.mean(z[fits] ** 2, axis=0)) < 1.1)


def test_fewer_gauges_leave_more_of_it() -> None:
    wide = with_considered_error(whole_map())
    estimator, strain = Estimator(wide), exact_response(*STATE)[:N_D]
    valid = np.arange(N_D) % 3 > 0
    some = estimator.estimate(strain, valid=valid, **air_data(STATE[0], STATE[3]))
    whole = estimator.estimate(strain, **air_data(STATE[0], STATE[3]))
    assert np.all(some.loads_std > whole.loads_std)


def with_entry(vehicle: Vehicle, **entry: object) -> Vehicle:
    return vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"estimator": "nonlinear", **entry})})


def test_tables_of_the_difference_are_those_of_newtonian_flow_less_the_maps(
    vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots
) -> None:
    """At one standard deviation, here half of the difference."""
    half, alone = with_entry(vehicle, discrepancy_of_newtonian_percent=50.0), with_entry(vehicle)
    newtonian = newtonian_snapshots(model_form(half.map, half.noise), snapshots)
    assert newtonian is not None
    made, other = (
        with_manifold(build_inverse_map(one, flows, structure), one, flows, structure).manifold
        for one, flows in ((half, snapshots), (alone, replace(newtonian, engine="newtonian")))
    )
    assert made is not None
    assert made.considered_response is not None
    assert other is not None
    difference = 0.5 * (other.response - made.response)
    np.testing.assert_allclose(made.considered_response, difference, atol=1e-12 * np.abs(difference).max())
    assert other.considered_response is None  # newtonian flow has no difference of its own


def ambient_excess(snapshots: Snapshots) -> np.ndarray:
    """(n_p,) p / p_inf - 1 of the flows without incidence, their mean."""
    flows = [
        pressure / condition.ambient_pressure - 1.0
        for pressure, condition in zip(snapshots.pressure, snapshots.conditions(), strict=True)
        if condition.total_incidence == 0.0
    ]
    return np.asarray(np.mean(flows, axis=0))


def test_the_linear_map_of_a_file_with_tables_expects_the_difference(
    vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots
) -> None:
    """Its term has the mean square of the members' strains and loads; a linear map alone has none."""
    entry = with_entry(vehicle)
    problem = inverse_problem(entry, snapshots, structure)
    newtonian = newtonian_snapshots(problem.model_form, snapshots)
    assert newtonian is not None
    off = 0.1 * (ensemble_of(entry, newtonian).pressure - problem.ensemble.pressure)
    difference = replace(problem.ensemble, pressure=off, fixed_pressure=0.0)
    assert FLOW_MODELS not in [term.name for term in problem.noise]
    level, term = with_flow_models(problem).noise[-2:]
    assert (level.name, term.name) == (LEVEL, FLOW_MODELS)
    assert term.load is not None
    operator = np.vstack([problem.strain_operator, problem.load_operator])
    members = difference.responses(operator)
    expected = np.einsum("k,ki,kj->ij", difference.member_weight, members, members)
    columns = np.vstack([term.strain, term.load])
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(columns @ columns.T, expected, atol=1e-9 * np.outer(size, size).max())
    linear = build_inverse_map(entry, snapshots, structure, problem=problem)
    beside = with_manifold(linear, entry, snapshots, structure, problem=problem)
    narrow, wide = (np.trace(one.noise_covariance) for one in (linear, beside))
    assert wide == pytest.approx(narrow + np.sum(term.strain**2) + np.sum(level.strain**2), rel=0.02)
    assert wide > narrow
    assert level.load is not None
    # A tenth of the axial force without incidence, which the pressure inside, p_inf, has no part in.
    axial = problem.load_operator[0] @ ambient_excess(snapshots)
    assert level.load[0, 0] == pytest.approx(0.1 * axial * difference.mean_ambient_pressure, rel=1e-9)


@pytest.mark.parametrize(
    ("update", "settings"),
    [
        ({"discrepancy_of_newtonian_percent": 0.0}, {}),
        ({"model_form_percent": 0.0}, {}),
        ({}, {"engine": "newtonian"}),
    ],
    ids=["not stated", "no model-form error", "newtonian flow"],
)
def test_nothing_is_expected_where_nothing_is_stated_or_known(
    update: dict[str, float], settings: dict[str, str], vehicle: Vehicle, snapshots: Snapshots
) -> None:
    sizes = model_form(with_entry(vehicle, **update).map, vehicle.noise)
    assert newtonian_snapshots(sizes, replace(snapshots, **settings)) is None
