"""The compiled core agrees with the reference on random samples of every kind of linear map."""

import numpy as np
import pytest
from linear_kinds import KINDS, by_core, by_reference, drawn

from strainfmu.estimator.health import chi_square_limit

TOLERANCE = 1e-9
"""Largest difference [standard deviations], of standard deviations relative."""

UNIDENTIFIED = 0.3
"""Largest fraction of samples whose sensors in use do not identify the states of Case 1."""


def agreement(name: str, n: int, seed: int) -> dict[str, float]:
    """Return the largest difference of each quantity over ``n`` samples of the kind ``name``."""
    inverse_map = KINDS[name].make()
    samples = drawn(inverse_map, KINDS[name], n, seed)
    core, apart, compared = by_core(inverse_map, samples), {}, 0

    def note(quantity: str, difference: np.ndarray) -> None:
        apart[quantity] = max(apart.get(quantity, 0.0), float(np.abs(difference).max(initial=0.0)))

    for places, found in by_reference(inverse_map, samples):
        known = np.isfinite(core.loads[places]).all(axis=1)
        at = places[known]
        compared += len(at)
        loads, coefficients = core.loads[at], core.coefficients[at]
        std, coefficients_std = core.loads_std[at], core.coefficients_std[at]
        if found.loads.shape[1] > 5:
            loads, std = np.hstack([loads, core.other_loads[at]]), np.hstack([std, core.other_loads_std[at]])
            coefficients = np.hstack([coefficients, core.other_coefficients[at]])
            coefficients_std = np.hstack([coefficients_std, core.other_coefficients_std[at]])
        expected = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))[known]
        note("loads", (loads - found.loads[known]) / expected)
        of_coefficients = np.sqrt(np.diagonal(found.coefficient_covariance, axis1=1, axis2=2))[known]
        note("coefficients", (coefficients - found.coefficients[known]) / of_coefficients)
        note("std", std / expected - 1.0)
        note("coefficients_std", coefficients_std / of_coefficients - 1.0)
        size = expected[:, :5]
        whole = core.load_covariance[at] - found.covariance[known][:, :5, :5]
        note("covariance", whole / (size[:, :, None] * size[:, None, :]))
        freedom = found.degrees_of_freedom[known]
        assert np.array_equal(core.degrees_of_freedom[at], freedom)
        if freedom.size and freedom[0] > 0:
            limit = inverse_map.chi_square_scale * chi_square_limit(int(freedom[0]))
            note("expected chi-square", core.chi_square_limit[at] / (limit * found.expected_ratio[known]) - 1.0)
        chi_square = found.chi_square[known]
        note("chi-square", (core.chi_square[at] - chi_square) / np.maximum(chi_square, 1.0))
        z = found.standardised[known]
        note("z", (core.standardised_residual[at] - z) / np.maximum(np.abs(z), 1.0))
    assert compared > (1.0 - UNIDENTIFIED) * n
    return apart


def check(apart: dict[str, float]) -> None:
    """Assert that every difference is within its tolerance."""
    assert {"loads", "std", "z", "chi-square", "expected chi-square"} <= apart.keys()
    assert not {quantity: difference for quantity, difference in apart.items() if difference > TOLERANCE}


@pytest.mark.fast
@pytest.mark.parametrize("name", KINDS)
def test_core_agrees_on_random_samples(name: str) -> None:
    check(agreement(name, n=200, seed=1))


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_core_agrees_on_many_random_samples(name: str) -> None:
    check(agreement(name, n=2000, seed=2))


def main() -> None:
    """Print the largest differences of 2,000 samples of each kind."""
    for name in KINDS:
        print(name, {quantity: f"{one:.1e}" for quantity, one in agreement(name, 2000, 2).items()})


if __name__ == "__main__":
    main()
