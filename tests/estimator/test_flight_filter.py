"""The nonlinear estimator over time: static limit, averaging, lost cycles and gauges, navigation, manoeuvres."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import NOISE_STD, ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.policies import POLICIES

pytestmark = pytest.mark.fast
N_D = STATIONS * ROWS
STATE = np.array([6.2, 0.09, -0.05, 8.6])
DT = 0.01


def whole_map(discrepancy: float = 1e-3, hardware: bool = False) -> InverseMap:
    return replace(
        scaled_map(2, 1, N_D),
        noise_std=np.full(N_D, NOISE_STD),
        manifold=flight_map(discrepancy=discrepancy, hardware=hardware),
    )


def exact(state: np.ndarray) -> np.ndarray:
    mach, u, w, log_pressure = state
    return exact_response(mach, u, w, np.exp(log_pressure))


def noise(rng: np.random.Generator) -> np.ndarray:
    return NOISE_STD * rng.standard_normal(N_D)


def strains(states: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return strains (k, n_d) with noise at ``states`` (k, 4)."""
    return np.array([exact(one)[:N_D] + noise(rng) for one in states])


def times(k: int, step: float = DT) -> np.ndarray:
    return step * np.arange(k)


def flow_of(states: np.ndarray) -> dict[str, np.ndarray]:
    """Return navigation (k,) at ``states`` (k, 4) of which both quantities are a little off."""
    return {"mach_number": states[:, 0] + 0.02, "static_pressure": 1.01 * np.exp(states[:, 3])}


@pytest.fixture(name="estimator", scope="module")
def _estimator() -> Estimator:
    return Estimator(whole_map())


@pytest.mark.parametrize("known", [False, True], ids=["blind", "navigation"])
@pytest.mark.parametrize("lost", [0, 3])
@pytest.mark.parametrize("hardware", [False, True])
def test_without_memory_it_is_the_static_estimator(known: bool, lost: int, hardware: bool) -> None:
    """But for states that fit as well, by which deviations of the static one are wider without a pressure."""
    static = Estimator(whole_map(hardware=hardware))
    flight = static.filter(1e-9)
    rng = np.random.default_rng(4)
    strain = np.repeat(strains(np.array([STATE, STATE]), rng), 6, axis=0)
    strain[:, :lost] = np.nan
    flow = flow_of(np.tile(STATE, (12, 1))) if known else {}
    one, other = flight.track(strain, time=times(12), **flow)[-1], static.track(strain, **flow)[-1]
    for name in ("loads", "coefficients", "state"):
        mine, theirs = getattr(one, name), getattr(other, name)
        assert np.max(np.abs(mine - theirs)) < 1e-9 * np.max(np.abs(theirs)), name
    for name in ("loads_std", "coefficients_std"):
        mine, theirs = getattr(one, name), getattr(other, name)
        assert np.all(mine < theirs * (1.0 + 1e-8)), name
        assert not known or mine == pytest.approx(theirs, rel=1e-8), name
    assert one.chi_square == pytest.approx(other.chi_square, rel=1e-8)
    assert one.health == other.health
    np.testing.assert_allclose(one.air_data_residual, other.air_data_residual, rtol=1e-6, atol=1e-7)


def test_a_constant_flight_is_averaged() -> None:
    """In so short a time that rates have moved nothing."""
    static = Estimator(whole_map(discrepancy=0.0))
    strain = strains(np.tile(STATE, (60, 1)), np.random.default_rng(0))
    found, alone = static.filter(10.0).track(strain, time=times(60, 5e-5)), static.track(strain)
    apart = [(one.loads - exact(STATE)[N_D:]) / alone.loads_std for one in (found, alone)]
    filtered, single = (np.sqrt(np.mean(np.square(one[20:]))) for one in apart)
    assert filtered < 0.4 * single
    # What it states is what it has.
    ratio = float((found.loads_std[-1] / alone.loads_std[-1]).max())
    assert 1.0 / np.sqrt(60.0) < ratio < 0.3
    assert filtered < 2.0 * ratio


def test_a_lost_second_is_predicted_with_growing_deviation(estimator: Estimator) -> None:
    flight = estimator.filter(1.0)
    rng = np.random.default_rng(0)
    strain = np.vstack(
        [strains(np.tile(STATE, (20, 1)), rng), np.full((21, N_D), np.nan), strains(STATE[None], rng)]
    )
    time = np.append(times(40), [10.4, 10.41])
    found = flight.track(strain, time=time)
    assert found.health[19] == HealthState.OK
    assert np.all(found.health[20:40] == HealthState.INVALID)
    assert np.all(np.diff(found.loads_std[20:40], axis=0) > 0.0)
    error = np.abs(found.loads - exact(STATE)[N_D:])
    assert np.all(error[39] < 3.0 * found.loads_std[39])
    assert found.health[40] == HealthState.INVALID
    assert np.all(np.isnan(found.loads[40]))
    assert found.health[41] == HealthState.OK
    assert np.all(error[41] < 3.5 * found.loads_std[41])


def test_a_gap_in_time_is_worth_as_much_as_the_cycles_in_it(estimator: Estimator) -> None:
    rng = np.random.default_rng(1)
    first, strain = strains(np.array([STATE, STATE]), rng)
    found = []
    for steps in (1, 4):
        rows = np.vstack([first, np.full((steps - 1, N_D), np.nan), strain])
        found.append(estimator.filter(1.0).track(rows, time=times(steps + 1, 0.2 / steps))[-1])
    assert found[0].loads == pytest.approx(found[1].loads, rel=1e-5)
    assert found[0].loads_std == pytest.approx(found[1].loads_std, rel=1e-3)


def test_gauges_come_and_go(estimator: Estimator) -> None:
    flight, strain = estimator.filter(1.0), strains(np.tile(STATE, (40, 1)), np.random.default_rng(0))
    for i in range(40):
        strain[i, i % N_D : i % N_D + 6] = np.nan
    found = flight.track(strain, time=times(40))
    assert np.all(found.health == HealthState.DEGRADED)
    assert np.all(np.abs(found.loads - exact(STATE)[N_D:]) < 4.0 * found.loads_std)
    valid = np.arange(N_D) % 2 == 0
    assert np.array_equal(flight.track(strain[-1], valid=valid, time=0.41).valid, valid & np.isfinite(strain[-1]))


def test_deviation_includes_navigation_that_is_off_for_the_whole_flight(estimator: Estimator) -> None:
    low = np.array([6.2, 0.01, 0.0, 8.6])
    strain = strains(np.tile(low, (80, 1)), np.random.default_rng(0))
    off = {"mach_number": low[0] + 0.1, "static_pressure": 0.97 * np.exp(low[3])}
    found = estimator.filter(1.0).track(strain, time=times(80), **off)
    assert np.all(np.abs(found.state[-1] - low) < 3.0 * np.sqrt(np.diagonal(found.state_covariance[-1])))


@pytest.mark.parametrize("seed", [0, 1])
def test_deviations_include_gains_of_gauges_through_a_manoeuvre(seed: int) -> None:
    flight, rng = Estimator(whole_map(hardware=True)).filter(1.0), np.random.default_rng(seed)
    gain, i = 1.0 + 0.01 * rng.standard_normal(N_D), np.arange(100)
    turn = 0.02 * np.pi * i
    away = [-0.003 * i, 0.06 * np.cos(turn) - 0.09, 0.06 * np.sin(turn) + 0.05, 0.0 * i]
    states = STATE + np.array(away).T
    both = np.array([exact(one) for one in states])
    strain = gain * both[:, :N_D] + np.array([noise(rng) for _ in i])
    found = flight.track(strain, time=times(100, 0.06), **flow_of(states))
    score = (found.loads - both[:, N_D:]) / found.loads_std
    assert np.mean(np.abs(score) < 3.0) > 0.98


def test_a_jump_of_the_flight_state_is_followed_at_once(estimator: Estimator) -> None:
    jumped = STATE + np.array([0.0, 0.04, 0.02, 0.0])
    states = np.vstack([np.tile(STATE, (50, 1)), np.tile(jumped, (3, 1))])
    found = estimator.filter(1.0).track(strains(states, np.random.default_rng(0)), time=times(53))[50:]
    assert np.all(found.health == HealthState.OK)
    assert np.all(np.abs(found.loads - exact(jumped)[N_D:]) < 3.5 * found.loads_std)


def test_a_turn_that_begins_is_followed_within_a_tenth_of_a_second(estimator: Estimator) -> None:
    rate, states = np.radians(10.0), np.tile(STATE, (100, 1))
    states[:, 1] -= rate * DT * np.maximum(np.arange(100) - 49, 0)
    found = estimator.filter(1.0).track(strains(states, np.random.default_rng(0)), time=times(100))
    assert np.max(np.abs(found.state[60:, 1] - states[60:, 1]) / rate) < 0.1


def test_strain_off_the_tables_gets_the_linear_map_and_returns_later(estimator: Estimator) -> None:
    rng, k = np.random.default_rng(0), 6 + POLICIES.return_after
    strain = strains(np.tile(STATE, (k, 1)), rng)
    strain[5] = exact(STATE)[:N_D] + 1e-4 * rng.standard_normal(N_D)
    found = estimator.filter(1.0).track(strain, 130e3, time=times(k))
    assert found.health[5] != HealthState.OK
    assert found.is_linear.tolist() == [False] * 5 + [True] * POLICIES.return_after + [False]
    assert np.all(np.abs(found.loads[-1] - exact(STATE)[N_D:]) < 4.0 * found.loads_std[-1])
