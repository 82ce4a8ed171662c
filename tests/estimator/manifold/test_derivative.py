"""Derivatives of the nonlinear estimator against differences of estimates whose iterations have ended."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flight_fmu import N_D, random_flight, whole_map

from strainfmu.errors import InputError
from strainfmu.estimator.manifold.air_data import air_data_of_state
from strainfmu.estimator.manifold.derivative import EstimateDerivative, estimate_derivative
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.gauss_newton import Samples, linearise_anew
from strainfmu.estimator.manifold.inputs import EstimatorInputs
from strainfmu.estimator.manifold.navigation import state_measurement
from strainfmu.estimator.manifold.solve import solution, solve_from

pytestmark = pytest.mark.fast

GROUPS = (
    *(slice(*ends) for ends in ((0, 1), (1, 3), (3, 4), (4, 7), (7, 9), (9, 12), (12, 14), (14, 17), (17, 19))),
    *(slice(*ends) for ends in ((19, 22), (22, 24), (24, 25), (25, 29), (29, 30), (30, 31), (31, 32))),
)
"""Estimates of one unit."""


@pytest.fixture(scope="module")
def estimator() -> ManifoldEstimator:
    return ManifoldEstimator(whole_map())


def inputs_of(estimator: ManifoldEstimator, seed: int, known: tuple[bool, bool, bool]) -> EstimatorInputs:
    """A sample with noise, a lost gauge, and navigation where it is ``known``."""
    sample = random_flight(estimator.inverse_map, 1, seed)[0]
    names = ("mach_number", "static_pressure", "dynamic_pressure")
    flow = {name: sample.flow[name] if k else np.nan for name, k in zip(names, known, strict=True)}
    flow |= {f"{name}_std": np.nan for name in names} | {"altitude": np.nan}
    return estimator.checked_inputs(sample.strain, np.arange(N_D) != seed, flow)


def ended(estimator: ManifoldEstimator, inputs: EstimatorInputs, start: np.ndarray | None) -> np.ndarray:
    """(32,) estimates in the order of :func:`stacked`, from ``start`` (1, 4) or a search."""
    manifold = estimator.manifold
    samples = Samples(
        strain=np.where(inputs.used, inputs.strain, 0.0),
        used=inputs.used,
        measured=state_measurement(manifold, inputs.navigation),
    )
    at = solve_from(manifold, estimator.search(samples).state if start is None else start, samples)
    for _ in range(6):
        at = solve_from(manifold, at.state, samples)
    found = solution(manifold, at, inputs.used)
    stds = (np.sqrt(np.diagonal(one[0])) for one in (found.load_covariance, found.coefficient_covariance))
    air, _ = air_data_of_state(at.state)
    parts = [found.state[0], found.loads[0], found.coefficients[0], *stds, found.chi_square, air[0]]
    return np.concatenate(parts)


def stacked(found: EstimateDerivative) -> np.ndarray:
    return np.concatenate(
        [
            *(found.state, found.loads, found.coefficients, found.loads_std, found.coefficients_std),
            found.chi_square[None],
            found.air_data,
        ]
    )


def moved(inputs: EstimatorInputs, change: np.ndarray) -> EstimatorInputs:
    value, std = inputs.navigation.value, inputs.navigation.std
    navigation = replace(inputs.navigation, value=value + change[N_D : N_D + 3], std=std + change[N_D + 3 :])
    return replace(inputs, strain=inputs.strain + change[:N_D], navigation=navigation)


@pytest.mark.parametrize("known", [(True, True, True), (True, False, True), (False, False, False)])
@pytest.mark.parametrize("seed", [1, 3])
def test_against_differences(estimator: ManifoldEstimator, seed: int, known: tuple[bool, bool, bool]) -> None:
    """To 1e-6; differences are not nearer than the rounding of the values, over twice the step."""
    inputs, random = inputs_of(estimator, seed, known), np.random.default_rng(seed)
    exact, start = stacked(estimate_derivative(estimator, inputs)), ended(estimator, inputs, None)[None, :4]
    std = np.where(known, inputs.navigation.std[0], 0.0)
    sizes = np.concatenate([np.full(N_D, 2e-7), std, 0.3 * std])
    directions = [
        sizes * random.normal(size=len(sizes)),
        *(sizes[k] * np.eye(len(sizes))[k] for k in range(N_D, N_D + 6)),
    ]
    for direction in directions:
        if not direction.any():
            continue
        sides = [ended(estimator, moved(inputs, h * direction), start) for h in (0.01, -0.01, 0.02, -0.02)]
        near, far = (sides[0] - sides[1]) / 0.02, (sides[2] - sides[3]) / 0.04
        difference, found = (4.0 * near - far) / 3.0, exact @ direction
        for group in GROUPS:
            error = np.abs(found - difference)[group].max()
            rounding = 1e-11 * np.linalg.norm(sides[0][group])
            assert error <= 1e-6 * np.linalg.norm(difference[group]) + rounding, (group, error)


def test_gauss_newton_alone_is_not_the_derivative(estimator: ManifoldEstimator) -> None:
    """What the second derivatives of the tables and the change of S add is seen."""
    inputs = inputs_of(estimator, 1, (True, False, True))
    exact = estimate_derivative(estimator, inputs).state[:, :N_D]
    samples = Samples(
        strain=np.where(inputs.used, inputs.strain, 0.0),
        used=inputs.used,
        measured=state_measurement(estimator.manifold, inputs.navigation),
    )
    state = ended(estimator, inputs, None)[None, :4]
    at = linearise_anew(estimator.manifold, state, samples)
    gain = np.linalg.solve(at.hessian[0], np.linalg.solve(at.factor[0].T, at.whitened_jacobian[0]).T)
    off = np.linalg.norm(gain - exact, axis=1) / np.linalg.norm(exact, axis=1)
    assert np.all(off > 1e-4)
    assert np.all(off < 0.3)


def test_lost_gauges_and_unknown_navigation_have_none(estimator: ManifoldEstimator) -> None:
    found = stacked(estimate_derivative(estimator, inputs_of(estimator, 3, (True, False, True))))
    none = [3, N_D + 1, N_D + 4]
    assert np.all(found[:, none] == 0.0)
    assert np.all(np.abs(np.delete(found, none, axis=1)).max(axis=0) > 0.0)


def test_no_minimum_no_derivative(estimator: ManifoldEstimator) -> None:
    inputs = inputs_of(estimator, 1, (False, False, False))
    with pytest.raises(InputError, match="no gauge"):
        estimate_derivative(estimator, replace(inputs, used=np.zeros_like(inputs.used)))
    with pytest.raises(InputError, match="beyond the tables"):
        estimate_derivative(estimator, replace(inputs, strain=100.0 * inputs.strain))
