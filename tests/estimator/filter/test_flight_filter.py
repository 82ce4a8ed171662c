"""The nonlinear estimator over time: static limit, averaging, lost cycles and gauges, navigation, manoeuvres."""

from dataclasses import replace

import numpy as np
import pytest
from flight_maps import NOISE_STD, ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

from strainfmu.errors import InputError
from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold import solve
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.tracker import RETURN_AFTER, FlightTracker
from strainfmu.estimator.map.inverse_map import InverseMap

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


def navigation(state: np.ndarray) -> dict[str, float]:
    return {"mach_number": state[0] + 0.02, "static_pressure": 1.01 * np.exp(state[3])}


@pytest.fixture(name="estimator")
def _estimator() -> ManifoldEstimator:
    return ManifoldEstimator(whole_map())


@pytest.mark.parametrize("known", [False, True], ids=["blind", "navigation"])
@pytest.mark.parametrize("lost", [0, 3])
@pytest.mark.parametrize("hardware", [False, True])
def test_without_memory_it_is_the_static_estimator(
    monkeypatch: pytest.MonkeyPatch, known: bool, lost: int, hardware: bool
) -> None:
    """But for other states that fit as well, which the filter does not know of."""
    monkeypatch.setattr(solve, "widening", lambda *_: None)
    estimator = ManifoldEstimator(whole_map(hardware=hardware))
    flow = navigation(STATE) if known else {}
    flight = FlightFilter(estimator, FilterSettings(time_constant=1e-9))
    static = FlightTracker(estimator)
    rng = np.random.default_rng(4)
    for _ in range(2):
        strain = exact(STATE)[:N_D] + noise(rng)
        strain[:lost] = np.nan
        for _ in range(6):  # both settle on the covariance at their own state
            one, other = flight.step(DT, strain, **flow), static.step(strain, **flow)
    for name in ("loads", "coefficients", "state"):
        mine, theirs = getattr(one, name), getattr(other, name)
        assert np.max(np.abs(mine - theirs)) < 1e-9 * np.max(np.abs(theirs)), name
    for name in ("loads_std", "coefficients_std"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-8), name
    assert one.chi_square == pytest.approx(other.chi_square, rel=1e-8)
    assert one.health == other.health
    assert one.navigation_residual == pytest.approx(other.navigation_residual, rel=1e-6, abs=1e-7)


def test_a_constant_flight_is_averaged() -> None:
    estimator = ManifoldEstimator(whole_map(discrepancy=0.0))
    slow = FilterSettings(time_constant=10.0, mach_number_rate=1e-3, angle_rate=1e-3, log_pressure_rate=1e-3)
    flight, static = FlightFilter(estimator, slow), FlightTracker(estimator)
    rng = np.random.default_rng(0)
    loads, first, last = exact(STATE)[N_D:], [], []
    for _ in range(60):
        strain = exact(STATE)[:N_D] + noise(rng)
        found, alone = flight.step(DT, strain), static.step(strain)
        last.append((found.loads - loads) / alone.loads_std)
        first.append((alone.loads - loads) / alone.loads_std)
    filtered, single = (np.sqrt(np.mean(np.square(one[20:]))) for one in (last, first))
    assert filtered < 0.4 * single
    # What it states is what it has.
    ratio = float((found.loads_std / alone.loads_std).max())
    assert 1.0 / np.sqrt(60.0) < ratio < 0.3
    assert filtered < 2.0 * ratio


def test_a_lost_second_is_predicted_with_growing_deviation(estimator: ManifoldEstimator) -> None:
    flight = FlightFilter(estimator, FilterSettings(time_constant=1.0))
    rng = np.random.default_rng(0)
    for _ in range(20):
        before = flight.step(DT, exact(STATE)[:N_D] + noise(rng))
    assert before.health is HealthState.OK
    lost = [flight.step(DT, np.full(N_D, np.nan)) for _ in range(20)]
    assert all(one.health is HealthState.DEGRADED for one in lost)
    std = np.array([one.loads_std for one in lost])
    assert np.all(np.diff(std, axis=0) > 0.0)
    assert np.all(np.abs(lost[-1].loads - exact(STATE)[N_D:]) < 3.0 * lost[-1].loads_std)
    later = flight.step(10.0, np.full(N_D, np.nan))
    assert later.health is HealthState.INVALID
    assert np.all(np.isnan(later.loads))
    back = flight.step(DT, exact(STATE)[:N_D] + noise(rng))
    assert back.health is HealthState.OK
    assert np.all(np.abs(back.loads - exact(STATE)[N_D:]) < 3.5 * back.loads_std)


def test_a_gap_in_time_is_worth_as_much_as_the_cycles_in_it(estimator: ManifoldEstimator) -> None:
    settings = FilterSettings(time_constant=1.0)
    rng = np.random.default_rng(1)
    first, strain = exact(STATE)[:N_D] + noise(rng), exact(STATE)[:N_D] + noise(rng)
    found = []
    for steps in (1, 4):
        flight = FlightFilter(estimator, settings)
        flight.step(DT, first)
        for _ in range(steps - 1):
            flight.step(0.2 / steps, np.full(N_D, np.nan))
        found.append(flight.step(0.2 / steps, strain))
    assert found[0].loads == pytest.approx(found[1].loads, rel=1e-5)
    assert found[0].loads_std == pytest.approx(found[1].loads_std, rel=1e-3)


def test_gauges_come_and_go(estimator: ManifoldEstimator) -> None:
    flight = FlightFilter(estimator, FilterSettings(time_constant=1.0))
    rng = np.random.default_rng(0)
    for i in range(40):
        strain = exact(STATE)[:N_D] + noise(rng)
        strain[i % N_D : i % N_D + 6] = np.nan
        found = flight.step(DT, strain)
        assert found.health is HealthState.DEGRADED
        assert np.all(np.abs(found.loads - exact(STATE)[N_D:]) < 4.0 * found.loads_std)
    valid = np.arange(N_D) % 2 == 0
    assert np.array_equal(flight.step(DT, strain, valid=valid).valid, valid & np.isfinite(strain))


def test_deviation_holds_navigation_that_is_off_for_the_whole_flight(estimator: ManifoldEstimator) -> None:
    rng = np.random.default_rng(0)
    flight = FlightFilter(estimator, FilterSettings(time_constant=1.0))
    low = np.array([6.2, 0.01, 0.0, 8.6])
    for _ in range(80):
        found = flight.step(
            DT, exact(low)[:N_D] + noise(rng), mach_number=low[0] + 0.1, static_pressure=0.97 * np.exp(low[3])
        )
    error = found.state - low
    assert np.all(np.abs(error) < 3.0 * np.sqrt(np.diagonal(found.state_covariance)))


@pytest.mark.parametrize("seed", [0, 1])
def test_deviations_hold_gains_of_gauges_through_a_manoeuvre(seed: int) -> None:
    estimator = ManifoldEstimator(whole_map(hardware=True))
    rng = np.random.default_rng(seed)
    flight, gain = (
        FlightFilter(estimator, FilterSettings(time_constant=1.0)),
        1.0 + 0.01 * rng.standard_normal(N_D),
    )
    score = []
    for i in range(100):
        turn = 0.02 * np.pi * i
        state = STATE + np.array([-0.003 * i, 0.06 * np.cos(turn) - 0.09, 0.06 * np.sin(turn) + 0.05, 0.0])
        found = flight.step(0.06, gain * exact(state)[:N_D] + noise(rng), **navigation(state))
        score.append((found.loads - exact(state)[N_D:]) / found.loads_std)
    assert np.mean(np.abs(score) < 3.0) > 0.98


def test_a_jump_of_the_flight_state_is_followed_at_once(estimator: ManifoldEstimator) -> None:
    flight = FlightFilter(estimator, FilterSettings(time_constant=1.0))
    rng = np.random.default_rng(0)
    for _ in range(50):
        flight.step(DT, exact(STATE)[:N_D] + noise(rng))
    jumped = STATE + np.array([0.0, 0.04, 0.02, 0.0])
    for _ in range(3):
        found = flight.step(DT, exact(jumped)[:N_D] + noise(rng))
        assert found.health is HealthState.OK
        assert np.all(np.abs(found.loads - exact(jumped)[N_D:]) < 3.5 * found.loads_std)


def test_a_turn_that_begins_is_followed_within_a_tenth_of_a_second(estimator: ManifoldEstimator) -> None:
    flight = FlightFilter(estimator, FilterSettings(time_constant=1.0))
    rng = np.random.default_rng(0)
    rate, late = np.radians(10.0), []
    for i in range(100):
        state = STATE - np.array([0.0, rate * max(i - 49, 0) * DT, 0.0, 0.0])
        found = flight.step(DT, exact(state)[:N_D] + noise(rng))
        late.append((found.state[1] - state[1]) / rate)
    assert np.max(np.abs(late[60:])) < 0.1


def test_strain_off_the_tables_gets_the_linear_map_and_returns_later(estimator: ManifoldEstimator) -> None:
    flight = FlightFilter(estimator, FilterSettings(time_constant=1.0))
    rng = np.random.default_rng(0)
    for _ in range(5):
        flight.step(DT, exact(STATE)[:N_D] + noise(rng), dynamic_pressure=130e3)
    off = 1e-4 * rng.standard_normal(N_D)
    found = flight.step(DT, exact(STATE)[:N_D] + off, dynamic_pressure=130e3)
    assert found.is_linear
    assert found.health is not HealthState.OK
    seen = [flight.step(DT, exact(STATE)[:N_D] + noise(rng), dynamic_pressure=130e3) for _ in range(RETURN_AFTER)]
    assert [one.is_linear for one in seen] == [True] * (RETURN_AFTER - 1) + [False]
    assert np.all(np.abs(seen[-1].loads - exact(STATE)[N_D:]) < 4.0 * seen[-1].loads_std)


@pytest.mark.parametrize("value", [0.0, -0.01, np.nan])
def test_wrong_time_steps_and_strains_are_refused(estimator: ManifoldEstimator, value: float) -> None:
    flight = FlightFilter(estimator, FilterSettings(time_constant=1.0))
    with pytest.raises(InputError, match=r"time_step: .* found, must be positive"):
        flight.step(value, np.zeros(N_D))
    with pytest.raises(InputError, match=r"strain: expected one sample, got 2"):
        flight.step(DT, np.zeros((2, N_D)))
    assert flight.track.law is None
