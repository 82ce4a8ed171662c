"""Considered errors: the gain does not know them, sigma and alarms do. Roles of the errors of a build."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import N_D, NOISE_STD, exact_response, flight_map, with_considered_columns
from scaled_maps import scaled_map

from builder.inverse.noise.error_list import ERRORS, ESTIMATED_PART, by_role, parts_of
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState

STATE = (6.0, 0.07, 0.03, 5e3)
"""M [1], u, w [rad], p_inf [Pa]."""
AIR_DATA = {
    "mach_number": STATE[0],
    "static_pressure": STATE[3],
    "dynamic_pressure": 0.7 * STATE[0] ** 2 * STATE[3],
    "q_source": 1.0,
}


@pytest.fixture(scope="module")
def both() -> tuple[Estimator, Estimator]:
    """Estimators without and with considered errors."""
    plain = replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=1e-2))
    wide = with_considered_columns(plain)
    assert wide.manifold is not None
    return Estimator(plain), Estimator(replace(wide, manifold=replace(wide.manifold, considered_common=None)))


def columns_of(estimator: Estimator) -> np.ndarray:
    """Strain and loads (n_d + 5, k) of the considered errors at the state."""
    manifold = estimator.inverse_map.manifold
    assert manifold is not None
    return STATE[3] * manifold.considered_columns


def test_the_gain_does_not_know_them(both: tuple[Estimator, Estimator]) -> None:
    wide = both[1]
    for amplitude in ([0.0, 0.0], [1.0, -0.5]):
        strain = exact_response(*STATE)[:N_D] + columns_of(wide)[:N_D] @ amplitude
        one, other = (it.estimate(strain, **AIR_DATA) for it in both)
        np.testing.assert_array_equal(one.loads, other.loads)
        assert other.chi_square <= one.chi_square
        assert np.all(other.loads_std > one.loads_std)


def test_drawn_at_their_size_they_are_in_sigma_and_no_alarm(both: tuple[Estimator, Estimator]) -> None:
    """Sigma is neither narrow nor wide, and chi-square has the mean of its degrees of freedom."""
    random, n = np.random.default_rng(4), 2000
    manifold = both[1].inverse_map.manifold
    assert manifold is not None
    estimated = STATE[3] * np.vstack([manifold.error_strain, manifold.error_load])
    columns = np.hstack([columns_of(both[1]), estimated])
    own = exact_response(*STATE) + random.standard_normal((n, columns.shape[1])) @ columns.T
    strain = own[:, :N_D] + NOISE_STD * random.standard_normal((n, N_D))
    air = {name: value * np.ones(n) for name, value in AIR_DATA.items()}
    air["mach_number"] = air["mach_number"] + 0.05 * random.standard_normal(n)
    air["static_pressure"] = air["static_pressure"] * (1.0 + 0.02 * random.standard_normal(n))
    air["dynamic_pressure"] = air["dynamic_pressure"] * (1.0 + 0.01 * random.standard_normal(n))
    found = {it: it.estimate(strain, **air) for it in both}
    wide = found[both[1]]
    rms_z = np.sqrt(np.mean(((wide.loads - own[:, N_D:]) / wide.loads_std) ** 2, axis=0))
    assert np.all((rms_z > 0.85) & (rms_z < 1.1))
    assert np.mean(np.asarray(wide.health) != HealthState.OK) < 5e-3
    of_states = len(manifold.state_prior[0])
    assert np.mean(wide.chi_square) == pytest.approx(np.mean(wide.degrees_of_freedom) - of_states, rel=0.02)
    narrow = found[both[0]]
    assert np.mean(np.abs(narrow.loads - own[:, N_D:]) > 3.0 * narrow.loads_std) > 0.02


def test_an_error_of_no_size_changes_nothing(both: tuple[Estimator, Estimator]) -> None:
    manifold = both[1].inverse_map.manifold
    assert manifold is not None
    none = {name: np.zeros_like(getattr(manifold, name)) for name in ("considered_strain", "considered_load")}
    without = replace(both[1].inverse_map, manifold=replace(manifold, **none))
    strain = 1.01 * exact_response(*STATE)[:N_D]
    one, other = (it.estimate(strain, **AIR_DATA) for it in (both[0], Estimator(without)))
    np.testing.assert_allclose(other.loads_std, one.loads_std, rtol=1e-12)
    assert other.chi_square == pytest.approx(one.chi_square, rel=1e-12)


@pytest.mark.parametrize("name", [*ERRORS, "an error of a user's own"])
def test_parts_of_a_role_have_the_whole_variance(name: str) -> None:
    column = np.arange(1.0, 4.0)[:, None]
    estimated, considered = by_role({name: column})
    np.testing.assert_allclose(estimated @ estimated.T + considered @ considered.T, column @ column.T)
    role = ERRORS[name].role if name in ERRORS else "estimated"
    assert parts_of(name)[0] == {"estimated": 1.0, "considered": 0.0, "split": ESTIMATED_PART}[role]
