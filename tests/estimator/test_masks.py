"""Maps without some of their gauges against maps that never had them."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from random_map import GaussianModel, map_of, missing, random_model
from scipy.linalg import eigh
from scipy.stats import chi2

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.settings import default_settings

Q = 1.2e5
N_GAUGES = 27
VARIANTS = {
    "least squares, diagonal": {"gamma": 0.0, "full": False},
    "least squares, full": {"gamma": 0.0, "full": True},
    "prior, diagonal": {"gamma": 1.0, "full": False, "n_states": 40},
    "prior, full": {"gamma": 1.0, "full": True, "n_states": 40},
    "prior, over-regularised": {"gamma": 10.0**0.5, "full": True, "n_states": 4},
}


@pytest.fixture(scope="module", params=VARIANTS.values(), ids=VARIANTS.keys())
def model(request: pytest.FixtureRequest) -> GaussianModel:
    return random_model(n_gauges=N_GAUGES, **request.param)


def some_masks() -> list[np.ndarray]:
    """Every gauge alone, and 60 random pairs and triples."""
    random = np.random.default_rng(5)
    sets = [(i,) for i in range(N_GAUGES)]
    sets += [tuple(random.choice(N_GAUGES, 2 + k % 2, replace=False)) for k in range(60)]
    return [missing(N_GAUGES, *gauges) for gauges in sets]


def assert_equal_to(expected: np.ndarray, found: np.ndarray, tolerance: float = 1e-9) -> None:
    """Equal to ``tolerance`` of the largest."""
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * np.abs(expected).max())


def test_masked_map_is_the_map_built_without_the_gauges(model: GaussianModel) -> None:
    """Loads, covariance, chi-square and P by the book from the rows that are left, to 1e-9."""
    strain, masks = model.draw(1, 3)[0][0], some_masks()
    of_all = Estimator(map_of(model)).estimate(np.tile(strain, (len(masks), 1)), Q, valid=~np.array(masks))
    for found, mask in zip(of_all, masks, strict=True):
        rest = model.without(mask)
        residual = (strain - model.m)[~mask]
        loads = rest.load_gain() @ residual + rest.load_of_mean
        assert_equal_to(loads, found.loads)
        assert_equal_to(rest.load_covariance(), found.load_covariance)
        np.testing.assert_allclose(found.loads_std**2, np.diag(rest.load_covariance()), rtol=1e-8)
        precision = rest.precision()
        assert found.chi_square == pytest.approx(residual @ precision @ residual, rel=1e-8)
        z = precision @ residual / np.sqrt(np.diag(precision))
        assert_equal_to(z, found.standardised_residual[~mask], 1e-8)
        assert not found.standardised_residual[mask].any()
        np.testing.assert_array_equal(found.valid, ~mask)
        assert found.degrees_of_freedom == len(residual) - (model.a.shape[1] if model.gamma == 0.0 else 0)


@pytest.mark.fast
def test_masked_estimator_is_the_estimator_of_a_rebuilt_map(model: GaussianModel) -> None:
    """With half of the gauges gone too: every output, health and alarm levels included, to 1e-9."""
    estimator = Estimator(map_of(model))
    strain = model.draw(1, 4)[0][0]
    strain[20] += 1e-3
    for gauges in [(0,), (3, 7), (1, 2, 26), tuple(range(13))]:
        mask = missing(N_GAUGES, *gauges)
        found = estimator.estimate(strain, Q, valid=~mask)
        wanted = Estimator(map_of(model.without(mask))).estimate(strain[~mask], Q)
        assert_equal_to(wanted.coefficients, found.coefficients)
        assert_equal_to(wanted.coefficients_std, found.coefficients_std)
        assert found.chi_square == pytest.approx(wanted.chi_square, rel=1e-8)
        assert found.chi_square_limit == wanted.chi_square_limit
        assert found.health is wanted.health is HealthState.INCONSISTENT
        kept = np.flatnonzero(~mask)
        assert found.suspects == tuple(kept[list(wanted.suspects)])


@pytest.mark.fast
def test_nothing_is_left_of_the_gauges_of_before() -> None:
    """The core keeps four sets of gauges: a set in the place of another one, none estimated between them."""
    inverse_map = map_of(random_model(n_gauges=9, n_states=3, seed=6))
    estimator, used = Estimator(inverse_map), np.eye(9, dtype=bool)
    expected = Estimator(inverse_map).estimate(inverse_map.mean_strain, Q, valid=~used[5])
    estimator.estimate(inverse_map.mean_strain, Q, valid=~used[0])
    for k in range(3):
        assert estimator.estimate(inverse_map.mean_strain, Q, valid=used[k]).health == HealthState.UNIDENTIFIED
    found = estimator.estimate(inverse_map.mean_strain, Q, valid=~used[5])
    np.testing.assert_array_equal(found.loads, expected.loads)
    np.testing.assert_array_equal(found.loads_std, expected.loads_std)


def test_without_any_gauge_there_is_no_estimate() -> None:
    """In Case 2 either, whose prior is left."""
    estimator = Estimator(map_of(random_model(gamma=1.0, n_states=40)))
    everything = np.ones(N_GAUGES, dtype=bool)
    assert estimator.estimate(np.zeros(N_GAUGES), Q, valid=~everything).health is HealthState.INVALID


def information_left(model: GaussianModel, mask: np.ndarray) -> float:
    """Smallest eigenvalue e of H_K x = e H x: the smallest fraction of the information on a state that is left."""
    size = np.linalg.norm(model.a, axis=0)

    def hessian(part: GaussianModel) -> np.ndarray:
        return (part.a / size).T @ np.linalg.solve(part.noise_covariance, part.a / size)

    return float(eigh(hessian(model.without(mask)), hessian(model), eigvals_only=True)[0])


@pytest.mark.fast
@pytest.mark.parametrize("has_units", [False, True])
def test_too_little_information_on_a_state_identifies_nothing(has_units: bool) -> None:
    """At 0.8 of the stated fraction and at 1.25 of it, in whatever units gauges and states are."""
    random = np.random.default_rng(2)
    gauges, states = random.uniform(1e-3, 1e3, N_GAUGES), random.uniform(1e-6, 1e6, 5)
    if not has_units:
        gauges[:] = states[:] = 1.0
    mask = missing(N_GAUGES, 3)
    for factor, health in ((0.8, HealthState.UNIDENTIFIED), (1.25, HealthState.DEGRADED)):
        model = one_gauge_for_a_state()
        a = model.a.copy()
        a[8, -1] = 1e-4 * a[3, -1]
        part = information_left(replace(model, a=a), mask)  # in proportion to the square of the entry
        a[8, -1] *= np.sqrt(factor * POLICIES.min_information / part)
        model = replace(
            model,
            a=gauges[:, None] * a * states,
            m=gauges * model.m,
            noise_covariance=np.outer(gauges, gauges) * model.noise_covariance,
            strain_load_covariance=gauges[:, None] * model.strain_load_covariance,
        )
        assert information_left(model, mask) == pytest.approx(factor * POLICIES.min_information, rel=0.05)
        scaled = replace(map_of(model), load_per_state=model.load_per_state * states)
        settings = replace(default_settings(scaled), sensor_range=1e3)
        assert Estimator(scaled, settings).estimate(model.m, Q, valid=~mask).health is health


def one_gauge_for_a_state() -> GaussianModel:
    """The last state is seen by gauges 3 and 8 only."""
    model = random_model()
    a = model.a.copy()
    a[[i for i in range(N_GAUGES) if i not in (3, 8)], -1] = 0.0
    return replace(model, a=a)


@pytest.mark.parametrize("gauges", [(3, 8), (8, 1, 3), tuple(range(23))])
def test_gauges_that_do_not_identify_the_state_give_no_numbers(gauges: tuple[int, ...]) -> None:
    """A state without a gauge, and four gauges for five states."""
    model = one_gauge_for_a_state()
    estimator = Estimator(map_of(model))
    found = estimator.estimate(model.m, Q, valid=~missing(N_GAUGES, *gauges))
    assert found.health is HealthState.UNIDENTIFIED
    for values in (found.loads, found.loads_std, found.load_covariance, found.coefficients):
        assert np.all(np.isnan(values))
    assert found.chi_square == 0.0  # a sum without terms
    assert found.suspects == ()
    assert estimator.estimate(model.m, Q).health is HealthState.OK


def test_a_gauge_that_alone_sees_a_state_is_checked_by_nothing() -> None:
    """Without gauge 8, gauge 3 has z = 0 whatever it reads, and the estimate follows it."""
    model = one_gauge_for_a_state()
    estimator = Estimator(map_of(model))
    strain = model.m.copy()
    strain[3] += 1e-3
    found = estimator.estimate(strain, Q, valid=~missing(N_GAUGES, 8))
    assert found.standardised_residual[3] == 0.0
    assert np.abs(found.standardised_residual).max() < 1e-3
    assert found.health is HealthState.DEGRADED


def test_as_many_gauges_as_states_leave_nothing_to_check() -> None:
    model = random_model()
    mask = missing(N_GAUGES, *range(22))
    found = Estimator(map_of(model)).estimate(model.draw(1, 6)[0][0], Q, valid=~mask)
    assert found.health is HealthState.DEGRADED
    assert found.degrees_of_freedom == 0
    assert found.chi_square_limit == np.inf
    assert found.chi_square < 1e-9
    assert found.suspects == ()
    assert_equal_to(model.without(mask).load_covariance(), found.load_covariance, 1e-7)


def test_nearly_unidentified_is_told_by_sigma() -> None:
    """The last gauge that sees a state, at 1e-4 of the others: information 1e-8 is enough, sigma 1e4 times."""
    model = one_gauge_for_a_state()
    a = model.a.copy()
    a[8, -1] = 1e-4 * a[3, -1]
    model = replace(model, a=a, noise_covariance=np.eye(N_GAUGES) * 4e-14)
    mask = missing(N_GAUGES, 3)
    assert POLICIES.min_information < information_left(model, mask) < 2e-8
    complete, found = (
        Estimator(map_of(replace(model, strain_load_covariance=0.0 * model.strain_load_covariance))).estimate(
            model.m, Q, valid=valid
        )
        for valid in (None, ~mask)
    )
    assert found.health is HealthState.DEGRADED
    assert np.all(found.loads_std > 100.0 * complete.loads_std)


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_fewer_gauges_never_tell_more(gamma: float) -> None:
    """Each loss adds to the covariance where the gain is optimal: gamma 0 or 1, and no load outside the states."""
    model = random_model(gamma=gamma)
    model = replace(model, strain_load_covariance=0.0 * model.strain_load_covariance)
    estimator = Estimator(map_of(model))
    before = estimator.estimate(model.m, Q)
    for count in range(1, 15):
        after = estimator.estimate(model.m, Q, valid=~missing(N_GAUGES, *range(count)))
        size = np.sqrt(np.diag(after.load_covariance))
        growth = (after.load_covariance - before.load_covariance) / np.outer(size, size)
        assert np.linalg.eigvalsh(growth)[0] > -1e-9
        before = after


@pytest.mark.fast
@pytest.mark.parametrize("gauges", [(), (4,), (0, 11, 19), tuple(range(9))])
def test_sigma_covers(model: GaussianModel, gauges: tuple[int, ...]) -> None:
    """4,000 draws, five loads: 1 sigma 68.3 +- 1.5 %, 3 sigma 99.73 +0.2 -0.4 %; mean of e' C^-1 e to 3 errors."""
    strain, loads = model.draw(4000, 7 + len(gauges))
    found = Estimator(map_of(model)).estimate(strain, Q, valid=~missing(N_GAUGES, *gauges))
    errors = found.loads - loads
    within = np.abs(errors) / found.loads_std
    assert (within < 1.0).mean() == pytest.approx(0.683, abs=0.015)
    assert 0.9933 < (within < 3.0).mean() < 0.9993
    distance = np.sum(errors * np.linalg.solve(found.load_covariance[0], errors.T).T, axis=1)
    assert distance.mean() == pytest.approx(5.0, abs=3.0 * np.sqrt(2.0 * 5.0 / 4000))


@pytest.mark.fast
@pytest.mark.parametrize("gauges", [(), (4,), (0, 11, 19), tuple(range(9))])
def test_chi_square_is_one_under_masks(model: GaussianModel, gauges: tuple[int, ...]) -> None:
    """4,000 draws: mean to 3 errors; alarms at scipy's 5 % and 1 % levels inside the binomial 99.9 % interval."""
    n = 4000
    strain, _ = model.draw(n, 17 + len(gauges))
    found = Estimator(map_of(model)).estimate(strain, Q, valid=~missing(N_GAUGES, *gauges))
    chi_square, freedom = found.chi_square, found.degrees_of_freedom[0]
    assert chi_square.mean() == pytest.approx(freedom, abs=3.0 * np.sqrt(2.0 * freedom / n))
    for probability in (0.05, 0.01):
        alarms = np.mean(chi_square > chi2.isf(probability, freedom))
        assert alarms == pytest.approx(probability, abs=3.3 * np.sqrt(probability * (1.0 - probability) / n))


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_writing_strain_otherwise_changes_nothing(gamma: float) -> None:
    """d -> R d with R a rotation, a scaling, both: loads, covariance and chi-square to 1e-9."""
    model = random_model(gamma=gamma)
    random = np.random.default_rng(3)
    rotation = np.linalg.qr(random.normal(size=(N_GAUGES, N_GAUGES)))[0]
    scaling = np.diag(random.uniform(0.1, 10.0, N_GAUGES))
    strain = model.draw(1, 8)[0][0]
    wanted = Estimator(map_of(model)).estimate(strain, Q)
    for r in (rotation, scaling, rotation @ scaling):
        covariance = r @ model.noise_covariance @ r.T
        changed = replace(
            model,
            a=r @ model.a,
            m=r @ model.m,
            noise_covariance=0.5 * (covariance + covariance.T),
            strain_load_covariance=r @ model.strain_load_covariance,
        )
        found = Estimator(map_of(changed)).estimate(r @ strain, Q)
        assert_equal_to(wanted.loads, found.loads)
        assert_equal_to(wanted.load_covariance, found.load_covariance)
        assert found.chi_square == pytest.approx(wanted.chi_square, rel=1e-9)


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_units_of_gauges_change_nothing_under_masks(gamma: float) -> None:
    """Each gauge in a unit of its own, two of them lost: loads, z and suspects stay, to 1e-9."""
    model = random_model(gamma=gamma)
    scale = np.random.default_rng(4).uniform(0.1, 10.0, N_GAUGES)
    changed = replace(
        model,
        a=scale[:, None] * model.a,
        m=scale * model.m,
        noise_covariance=model.noise_covariance * np.outer(scale, scale),
        strain_load_covariance=scale[:, None] * model.strain_load_covariance,
    )
    strain = model.draw(1, 9)[0][0]
    strain[5] += 2e-5
    valid = ~missing(N_GAUGES, 2, 13)
    wanted = Estimator(map_of(model)).estimate(strain, Q, valid=valid)
    found = Estimator(map_of(changed)).estimate(scale * strain, Q, valid=valid)
    assert_equal_to(wanted.loads, found.loads)
    assert_equal_to(wanted.standardised_residual, found.standardised_residual)
    assert found.suspects == wanted.suspects == (5,)


def test_all_pairs_of_a_small_map_keep_their_rank() -> None:
    """8 gauges, 3 states: every pair can be lost, and what is left has 3 degrees of freedom."""
    model = random_model(n_gauges=8, n_states=3)
    masks = [~missing(8, *pair) for pair in combinations(range(8), 2)]
    found = Estimator(map_of(model)).estimate(np.tile(model.m, (len(masks), 1)), Q, valid=masks)
    assert np.all(found.degrees_of_freedom == 3)
    assert np.all(np.isfinite(found.loads_std))
