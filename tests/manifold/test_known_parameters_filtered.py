"""Flow parameters that are known with a deviation, in the filter of the nonlinear estimator."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from deflected_shape import NAME, deflected, known_map
from shape_case import ALTITUDE, flown, shape_structure, shape_vehicle
from thermal_maps import REFERENCE, with_temperature

from builder.aero.load_groups import six_loads
from builder.vehicle.flight_conditions import condition_grid
from strainfmu.estimator.air_inputs import QSource
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState

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


def given(value: np.ndarray | float | None, std: np.ndarray | float = STD) -> dict[str, Any]:
    """Return the arguments of a deflection of ``value``, None for not known."""
    return {} if value is None else {"parameters": {NAME: value}, "parameters_std": {NAME: std}}


def filtered(
    value: np.ndarray | None, std: np.ndarray | float = STD, time_constant: float = 0.5
) -> tuple[Estimator, Estimate]:
    """Return the filter and its estimates where the deflection has ``value``, None for not known."""
    strain, pressure, _ = flight()
    estimator = Estimator(known_map()).filter(time_constant)
    flow = {"mach_number": MACH, "q_source": QSource.INDEPENDENT}
    return estimator, estimator.track(strain, pressure, **flow, time=TIME, **given(value, std))


@cache
def blind_estimates() -> Estimate:
    """Return the estimates of the filter where the deflection is not known."""
    return filtered(None)[1]


def errors(found: Estimate) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and deviations (STEPS, 6) of the coefficients and of the rolling moment's."""
    value = np.column_stack([found.coefficients, found.M_R])
    return value - flight()[2], np.column_stack([found.coefficients_std, found.other_coefficients_std[:, 0]])


@pytest.mark.parametrize("temperature", [None, np.array([REFERENCE + 4.0, np.nan])], ids=["cold", "warm"])
def test_without_memory_it_is_the_static_estimator_of_the_known_value(temperature: np.ndarray | None) -> None:
    strain, pressure, _ = flight()
    warm = with_temperature(known_map(), k=3, n_t=2, mode_strain=1e-9 * np.ones((known_map().n_gauges, 3)))
    estimator = Estimator(known_map() if temperature is None else warm)
    flight_filter, begin = estimator.filter(1e-9), 0
    for row in (0, 20):
        rows = np.tile(strain[row], (6, 1))  # both settle on the covariance at their own state
        flow = {"mach_number": MACH, "temperature": temperature, **given(DEFLECTION[row])}
        one = flight_filter.track(rows, pressure[row], time=DT * np.arange(begin, begin + 6), **flow)[-1]
        other, begin = estimator.track(rows, pressure[row], **flow)[-1], begin + 6
        for name in ("loads", "coefficients", "state", "other_loads"):
            mine, theirs = getattr(one, name), getattr(other, name)
            assert np.max(np.abs(mine - theirs)) < 1e-8 * np.max(np.abs(theirs)), name
        for name in ("coefficients_std", "other_coefficients_std", "chi_square"):
            assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-7), name
        assert one.health == other.health == HealthState.OK


@pytest.mark.parametrize("offset", [-1.0, 1.0])
def test_a_known_deflection_sharpens_the_filter(offset: float) -> None:
    """Deviations are below those of the filter that does not know it, include its error, and hold the truth."""
    known, blind = filtered(DEFLECTION + offset * STD)[1], blind_estimates()
    for one in (known, blind):
        error, std = errors(one)
        assert np.mean(np.abs(error) <= 3.0 * std) >= 0.99
        assert np.all(one.health == HealthState.OK)
    deviations = [np.median(errors(one)[1][:, 5]) for one in (known, blind)]
    assert deviations[0] < 0.98 * deviations[1]


def test_a_value_that_is_lost_leaves_no_more_than_the_filter_knows() -> None:
    """The filter begins again where the value is lost: deviations are those of one sample, then below."""
    std = np.full(STEPS, STD)
    std[16:32] = np.nan
    found, known = (filtered(DEFLECTION, one)[1] for one in (std, STD))
    error, deviation = errors(found)
    assert np.all(np.abs(error) <= 3.0 * deviation)
    of_known = errors(known)[1]
    assert np.all(deviation[16:32, 5] > 1.02 * of_known[16:32, 5])
    assert np.mean(deviation[20:32, 5]) < deviation[16, 5]
    np.testing.assert_allclose(deviation[:16, 5], of_known[:16, 5], rtol=1e-12)


def test_memory_of_a_filter_includes_the_known_value() -> None:
    first, _ = filtered(DEFLECTION)
    other = Estimator(known_map()).filter(0.5)
    other.memory = first.memory
    strain, pressure, _ = flight()
    found = [
        one.track(strain[0], pressure[0], mach_number=MACH, time=TIME[-1] + DT, **given(2.0))
        for one in (first, other)
    ]
    np.testing.assert_array_equal(found[0].coefficients, found[1].coefficients)


def test_values_that_cannot_be_spoil_no_other_sample() -> None:
    """Of a wire that breaks, in a filter of a whole number of seconds."""
    value, std = DEFLECTION.copy(), np.full(STEPS, STD)
    value[4:8], std[8:10] = [1e6, -1e308, np.inf, np.nan], [1e200, np.inf]
    found = filtered(value, std, time_constant=10)[1]
    assert np.all(found.health[4:7] == HealthState.OUTSIDE)
    assert np.all(np.delete(found.health, [4, 5, 6]) == HealthState.OK)
    error, deviation = errors(found)
    assert np.all(np.abs(error) <= 3.0 * deviation)
