"""Gauss-Newton iterations of a step: counted, and never more than the core and the documentation state."""

import re
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import random_flight, whole_map
from flight_maps import MACH, N_D
from scaled_maps import NOMINAL, whole_scaled_map

from strainfmu.estimator.air_inputs import QSource
from strainfmu.estimator.core import Core, Series
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.policies import POLICIES

pytestmark = pytest.mark.fast

STEPS, PLAIN = 6_000, 4_200

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "step_time.md"

SEARCH = 6 * POLICIES.start_iterations + POLICIES.cold_iterations
"""Of six starts, and of the best of them."""


@pytest.fixture(scope="module")
def core() -> Core:
    return Core(Estimator(whole_map()).core.resource)


def hostile(core: Core, seed: int) -> np.ndarray:
    """(STEPS, n_inputs) flights with jumps, gauges off or lost for a while, air data wrong or missing."""
    random, manifold = np.random.default_rng(seed), whole_map().manifold
    assert manifold is not None
    pieces = STEPS // 8
    jumps = random.uniform([MACH[0], -1.0, -1.0, 7.6], [MACH[-1], 1.0, 1.0, 9.9], (STEPS // 200, 4))
    jumps[:, 1:3] *= 0.6 * manifold.incidence_limit
    state = np.repeat(jumps, 200, axis=0) + 1e-3 * np.sin(0.05 * np.arange(STEPS))[:, None]
    strain = evaluate(manifold.tables, state).value[:, :N_D]
    strain += random.standard_normal((STEPS, N_D)) @ np.linalg.cholesky(manifold.gauge_covariance).T
    off = random.choice([0.0, 0.0, 2e-6, 1e-5, 1e-3], (pieces, 1)) * random.standard_normal((pieces, N_D))
    off[random.random((pieces, N_D)) < random.choice([0.0, 0.1, 0.5], (pieces, 1))] = np.nan
    factor = random.choice([1.0, 1.0, 1.0, 1.3, 0.6, np.nan], (pieces, 3))
    factor[::12] = np.nan
    known = np.stack([state[:, 0], np.exp(state[:, 3]), 0.7 * state[:, 0] ** 2 * np.exp(state[:, 3])], axis=1)
    known *= np.repeat(factor, 8, axis=0) * (1.0 + 0.01 * random.standard_normal((STEPS, 3)))
    inputs = np.full((STEPS, core.n_inputs), np.nan)
    inputs[:, core.inputs["strain"]] = strain + np.repeat(off, 8, axis=0)
    for k, name in enumerate(("mach_number", "static_pressure", "dynamic_pressure")):
        inputs[:, core.inputs[name]] = known[:, k : k + 1]
    inputs[:, core.inputs["q_source"]] = QSource.INDEPENDENT
    inputs[random.random(STEPS) < 0.01] = np.nan
    inputs[random.random(STEPS) < 0.01] *= 1e3
    return inputs


def test_no_step_takes_more_than_the_most(core: Core) -> None:
    """Of most of them without the filter, which searches more often; then the bound is near what steps do take."""
    inputs, largest = hostile(core, seed=3), []
    for time_constant, part in ((0.0, inputs[:PLAIN]), (5.0, inputs[PLAIN:])):
        core.restart()
        core.set(core.settings["filter_time_constant"].start, np.array([time_constant]))
        record = core.series(Series.TRACK, part, time=0.01 * np.arange(len(part)))
        taken = record[:, core.outputs["iterations"]]
        assert {POLICIES.warm_iterations, 2 * POLICIES.warm_iterations, POLICIES.warm_iterations + SEARCH} <= set(
            taken.ravel().astype(int)
        )
        largest.append(int(taken.max()))
    assert max(largest) <= core.most_iterations
    assert largest[0] >= 0.7 * core.most_iterations


def test_of_known_events() -> None:
    held = whole_map()
    estimator, flight = Estimator(held), random_flight(held, 2 * int(POLICIES.search_every), seed=5)
    found = [estimator.track(one.strain, q_source="independent", **one.flow).iterations for one in flight]
    assert found[0] in (SEARCH, 2 * SEARCH)
    assert set(found[1:]) <= {POLICIES.warm_iterations, 2 * POLICIES.warm_iterations}
    assert POLICIES.warm_iterations in found


def test_strain_that_fits_nowhere_takes_two_searches() -> None:
    """With all air data, then without the wrong Mach number; the last state's solution is not solved twice."""
    held = whole_map()
    estimator, flight = Estimator(held), random_flight(held, 6, seed=5)
    for one in flight:
        estimator.track(one.strain, **one.flow)
    wrong = flight[-1].flow | {"q_source": 1.0, "mach_number": 1.3 * flight[-1].flow["mach_number"]}
    found = estimator.track(flight[-1].strain + 1e-4 * (-1.0) ** np.arange(N_D), **wrong)
    assert found.health == HealthState.INCONSISTENT
    assert found.iterations == 2 * (POLICIES.warm_iterations + SEARCH)


def test_the_linear_estimator_takes_none() -> None:
    held = whole_scaled_map(1, seed=4)
    estimator = Estimator(held)
    assert estimator.core.most_iterations == 0
    assert estimator.track(held.mean_strain, NOMINAL).iterations == 0
    assert estimator.estimate(held.mean_strain[None], NOMINAL).iterations.tolist() == [0]


def test_the_documentation_states_what_the_core_states(core: Core) -> None:
    stated = re.search(r"\| maximum[^|]*\| (\d+) and (\d+) \|", PAGE.read_text(encoding="utf-8"))
    assert stated is not None
    assert int(stated[1]) + int(stated[2]) == core.most_iterations
