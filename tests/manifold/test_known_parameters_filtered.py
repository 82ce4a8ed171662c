"""Further parameters of the flow that are known with a deviation, in the filter of the nonlinear estimator."""

from functools import cache

import numpy as np
import pytest
from deflected_shape import NAME, deflected, known_map
from shape_case import ALTITUDE, flown, shape_structure, shape_vehicle
from thermal_maps import REFERENCE, with_temperature

from builder.aero.loads.sections import six_loads
from builder.vehicle.conditions.flight_conditions import condition_grid
from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.flight_model import DISCREPANCY, FlightModel, transition, with_tables
from strainfmu.estimator.filter.flight_track import FilteredStep
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.filter.switched import TimedTrack, as_numbers, from_numbers
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.tables.parameter_tables import with_known

DT, STEPS, MACH = 0.025, 48, 6.5
TIME = DT * np.arange(STEPS)
DEFLECTION = 3.0 * np.sin(2.0 * np.pi * TIME / 0.9 + 0.4)
STD = 0.2


@cache
def flight() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return strains, dynamic pressures and coefficients, the last one that of roll, of a manoeuvre."""
    alpha, beta = 1.0 + 2.0 * np.sin(2.0 * np.pi * TIME / 1.5), 1.2 * np.sin(2.0 * np.pi * TIME / 1.1 + 1.0)
    pairs = zip(alpha.tolist(), beta.tolist(), strict=True)
    conditions = [condition_grid((MACH,), (a,), (b,), ALTITUDE)[0] for a, b in pairs]
    snapshots = deflected(flown(conditions), DEFLECTION)
    net = snapshots.pressure - snapshots.internal_pressure[:, None]
    reference = shape_vehicle().reference_quantities()
    pressure = np.array([one.dynamic_pressure for one in conditions])
    length = reference.length
    scale = pressure[:, None] * reference.area * np.array([1.0, 1.0, 1.0, length, length, length])
    true = net @ six_loads(snapshots.surface, reference.moment_station).T / scale
    strain = net @ shape_structure(snapshots.surface).strain_operator("four_rows").T
    noise = np.random.default_rng(5).standard_normal(strain.shape)
    return strain + known_map().noise_std * noise, pressure, true


def filtered(
    value: np.ndarray | None, std: np.ndarray | float = STD, time_constant: float = 0.5
) -> tuple[FlightFilter, list[FilteredStep]]:
    """Return the filter and its steps where the deflection has ``value``, None for not known."""
    strain, pressure, _ = flight()
    found, stds = FlightFilter(ManifoldEstimator(known_map()), FilterSettings(time_constant=time_constant)), []
    for row, one in enumerate(np.broadcast_to(std, STEPS).tolist()):
        known = {} if value is None else {"parameters": {NAME: value[row]}, "parameters_std": {NAME: one}}
        flow = {"dynamic_pressure": pressure[row], "mach_number": MACH}
        stds.append(found.recorded(DT, strain[row], flow, **known))
    return found, stds


@cache
def blind_estimates() -> list[FlightEstimate]:
    """Return the estimates of the filter where the deflection is not known."""
    return estimates(filtered(None)[1])


def errors(found: list[FlightEstimate]) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and deviations (STEPS, 6) of the coefficients and that of roll."""
    value = np.array([[*one.coefficients, one.M_R] for one in found])
    std = np.array([[*one.coefficients_std, one.further_coefficients_std[0]] for one in found])
    return value - flight()[2], std


def estimates(steps: list[FilteredStep]) -> list[FlightEstimate]:
    return [one.estimate[0] for one in steps]


@pytest.mark.parametrize("temperature", [None, np.array([REFERENCE + 4.0, np.nan])], ids=["cold", "warm"])
def test_without_memory_it_is_the_static_estimator_of_the_known_value(temperature: np.ndarray | None) -> None:
    strain, pressure, _ = flight()
    warm = with_temperature(known_map(), k=3, n_t=2, mode_strain=1e-9 * np.ones((known_map().n_gauges, 3)))
    estimator = ManifoldEstimator(known_map() if temperature is None else warm)
    static, found = FlightTracker(estimator), FlightFilter(estimator, FilterSettings(time_constant=1e-9))
    for row in (0, 20):
        flow = {
            "dynamic_pressure": pressure[row],
            "mach_number": MACH,
            "parameters": {NAME: DEFLECTION[row]},
            "parameters_std": {NAME: STD},
            "temperature": temperature,
        }
        for _ in range(6):  # both settle on the covariance at their own state
            one, other = found.step(DT, strain[row], **flow), static.step(strain[row], **flow)
        for name in ("loads", "coefficients", "state", "further_loads"):
            mine, theirs = getattr(one, name), getattr(other, name)
            assert np.max(np.abs(mine - theirs)) < 1e-8 * np.max(np.abs(theirs)), name
        for name in ("coefficients_std", "further_coefficients_std", "chi_square"):
            assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-7), name
        assert one.health == other.health == HealthState.OK


@pytest.mark.parametrize("offset", [-1.0, 1.0])
def test_a_known_deflection_sharpens_the_filter(offset: float) -> None:
    """Its error lasts for the whole flight."""
    _, steps = filtered(DEFLECTION + offset * STD)
    known, blind = estimates(steps), blind_estimates()
    rms = []
    for one in (known, blind):
        error, std = errors(one)
        assert np.mean(np.abs(error) <= 3.0 * std) >= 0.99
        assert all(sample.health is HealthState.OK for sample in one)
        rms.append(np.sqrt(np.mean(error**2, axis=0)))
    assert rms[0][5] < 0.8 * rms[1][5]
    assert np.all(rms[0] < 1.05 * rms[1])
    deviations = [np.median(errors(one)[1][:, 5]) for one in (known, blind)]
    assert deviations[0] < 0.8 * deviations[1]


def test_a_value_that_is_lost_leaves_what_was_learned_and_no_more() -> None:
    std = np.full(STEPS, STD)
    std[16:32] = np.nan
    found, known = (estimates(filtered(DEFLECTION, one)[1]) for one in (std, STD))
    error, deviation = errors(found)
    assert np.all(np.abs(error) <= 3.0 * deviation)
    of_blind, of_known = (errors(one)[1] for one in (blind_estimates(), known))
    assert np.all(deviation[16:32, 5] < 1.01 * of_blind[16:32, 5])
    assert np.all(deviation[20:32, 5] > 1.2 * of_known[20:32, 5])
    np.testing.assert_allclose(deviation[36:, 5], of_known[36:, 5], rtol=0.1)


def at_value(model: FlightModel, value: float) -> FlightModel:
    return with_tables(model, with_known(model.manifold, np.array([value]), np.array([2.0])))


def test_errors_stay_what_they_are_where_their_directions_turn() -> None:
    model = FlightFilter(ManifoldEstimator(known_map()), FilterSettings(time_constant=0.5)).model
    one, near = at_value(model, 1.0), at_value(model, 1.01)
    for last, now in ((one, near), (model, one), (one, model), (one, at_value(model, -3.0))):
        step = transition(now, 1e-6, 1.0, last=last.seen.direction)
        left = step.covariance - step.matrix @ step.covariance @ step.matrix.T
        assert np.linalg.eigvalsh(left).min() > -1e-9 * np.linalg.eigvalsh(step.covariance).max()
    c = slice(DISCREPANCY, model.hardware)
    turn = transition(near, 1e-6, 1.0, last=one.seen.direction).matrix[c, c]
    of_strain = near.seen.strain @ turn - one.seen.strain
    assert np.abs(of_strain).max() < 0.02 * np.abs(one.seen.strain).max()
    plain = transition(one, 1e-6, 1.0).matrix
    np.testing.assert_allclose(transition(one, 1e-6, 1.0, last=one.seen.direction).matrix, plain, atol=1e-12)


def test_a_track_in_numbers_goes_on_as_the_filter_does() -> None:
    flight_filter, _ = filtered(DEFLECTION)
    kept = from_numbers(as_numbers(TimedTrack(track=flight_filter.track)))
    other = FlightFilter(flight_filter.estimator, flight_filter.settings, kept.track)
    strain, pressure, _ = flight()
    known = {"parameters": {NAME: 2.0}, "parameters_std": {NAME: STD}}
    found = [
        one.step(DT, strain[0], pressure[0], mach_number=MACH, **known)  # type: ignore[arg-type]  # kinds by name
        for one in (flight_filter, other)
    ]
    np.testing.assert_array_equal(found[0].coefficients, found[1].coefficients)


def test_values_that_cannot_be_spoil_no_other_sample() -> None:
    """Of a wire that breaks, in a filter of a whole number of seconds."""
    value, std = DEFLECTION.copy(), np.full(STEPS, STD)
    value[4:8], std[8:10] = [1e6, -1e308, np.inf, np.nan], [1e200, np.inf]
    found = estimates(filtered(value, std, time_constant=10)[1])
    assert all(one.health is HealthState.OUTSIDE for one in found[4:7])
    assert all(one.health is HealthState.OK for one in (*found[:4], *found[7:]))
    error, deviation = errors(found)
    assert np.all(np.abs(error) <= 3.0 * deviation)
