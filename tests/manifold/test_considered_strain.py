"""Considered errors of strain alone, as by the inertia of a manoeuvre: they widen and correct nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import N_D, NOISE_STD, exact_response, flight_map, with_considered_error, with_considered_strain
from scaled_maps import scaled_map

from strainfmu.estimator.estimator import Estimator

STATE = (6.0, 0.07, 0.03, 5e3)
"""M [1], u, w [rad], p_inf [Pa]."""
AIR_DATA = {
    "mach_number": STATE[0],
    "static_pressure": STATE[3],
    "dynamic_pressure": 0.7 * STATE[0] ** 2 * STATE[3],
}


@pytest.fixture(scope="module")
def both() -> tuple[Estimator, Estimator]:
    """Estimators without and with considered errors of strain."""
    plain = replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=1e-2))
    return Estimator(plain), Estimator(with_considered_strain(plain))


def strain_of(estimator: Estimator) -> np.ndarray:
    manifold = estimator.inverse_map.manifold
    assert manifold is not None
    assert manifold.considered_strain is not None
    return manifold.considered_strain


def test_it_widens_and_corrects_nothing(both: tuple[Estimator, Estimator]) -> None:
    plain, wide = both
    for amplitude in ([0.0, 0.0], [1.0, -0.5]):
        strain = exact_response(*STATE)[:N_D] + strain_of(wide) @ amplitude
        one, other = (it.estimate(strain, **AIR_DATA) for it in both)
        np.testing.assert_array_equal(one.loads, other.loads)
        assert one.chi_square == other.chi_square
        assert np.all(other.loads_std > one.loads_std)
    assert plain.inverse_map.manifold is not None
    assert plain.inverse_map.manifold.considered_strain is None


def test_loads_under_drawn_amplitudes_are_inside(both: tuple[Estimator, Estimator]) -> None:
    plain, wide = both
    random = np.random.default_rng(4)
    strain = exact_response(*STATE)[:N_D] + random.standard_normal((400, 2)) @ strain_of(wide).T
    strain += NOISE_STD * random.standard_normal(strain.shape)
    air = {name: np.full(400, value) for name, value in AIR_DATA.items()}
    truth = exact_response(*STATE)[N_D:]

    def outside(estimator: Estimator) -> float:
        found = estimator.estimate(strain, **air)
        return float(np.mean(np.abs(found.loads - truth) > 3.0 * found.loads_std))

    assert outside(wide) < 0.01 < 0.05 < outside(plain)


def test_an_error_of_no_size_changes_nothing() -> None:
    """Errors of the flow and of strain are joint: one that is zero leaves the other as it is alone."""
    alone = with_considered_error(replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=1e-2)))
    manifold = alone.manifold
    assert manifold is not None
    joint = replace(alone, manifold=replace(manifold, considered_strain=np.zeros((N_D, 2))))
    strain = exact_response(*STATE)[:N_D] * 1.01
    one, other = (Estimator(it).estimate(strain, **AIR_DATA) for it in (alone, joint))
    np.testing.assert_allclose(other.loads_std, one.loads_std, rtol=1e-12)
