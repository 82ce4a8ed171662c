"""Matrices for other standard deviations of zero offsets: made over several steps, the old ones in use."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import random_flight, whole_map
from random_map import map_of, random_model
from scaled_maps import NOMINAL, whole_scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.errors import InputError
from strainfmu.estimator.core import Core, Series
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

STEPS, CHANGED = 40, 6
"""Steps of a run, and the one before which deviations change."""

MOST = 24
"""Steps that a renewal takes at most, of 54 gauges."""

SCALED = 54


@dataclass(frozen=True, eq=False)
class Run:
    """A map, samples of it (k, n_inputs), and the time constant of the filter [s], 0 for none."""

    inverse_map: InverseMap
    resource: bytes
    inputs: np.ndarray
    time_constant: float

    def core(self) -> Core:
        core = Core(self.resource)
        constant = core.settings["filter_time_constant"]
        if self.time_constant > 0.0:
            core.set(constant.start, np.array([self.time_constant]))
        return core

    def step(self, core: Core, k: int) -> np.ndarray:
        """The record of sample ``k``, the next one of ``core``."""
        return core.series(Series.TRACK, self.inputs[k : k + 1], time=np.array([0.01 * k]))[0]


def inputs_of(core: Core, strain: np.ndarray, **given: np.ndarray | float) -> np.ndarray:
    inputs = np.full((len(strain), core.n_inputs), np.nan)
    inputs[:, core.inputs["strain"]] = strain
    for name, value in given.items():
        inputs[:, core.inputs[name]] = np.asarray(value).reshape(-1, 1)
    return inputs


def run_of(held: InverseMap, *, time_constant: float = 0.0) -> Run:
    resource, random = Estimator(held).core.resource, np.random.default_rng(7)
    core = Core(resource)
    if held.manifold is None:
        noise = 0.2 * held.noise_std * random.normal(size=(STEPS, held.n_gauges))
        inputs = inputs_of(core, held.mean_strain + noise, dynamic_pressure=held.nominal_dynamic_pressure)
        inputs[:, core.inputs["temperature"]] = REFERENCE
    else:
        flight = random_flight(held, STEPS, seed=3)
        known = {name: np.array([one.flow[name] for one in flight]) for name in flight[0].flow}
        inputs = inputs_of(core, np.array([one.strain for one in flight]), **known)
    return Run(held, resource, inputs, time_constant)


RUNS: dict[str, Callable[[], Run]] = {
    "absolute": lambda: run_of(map_of(random_model(0.0, n_gauges=21, n_states=5))),
    "absolute, few states": lambda: run_of(map_of(random_model(1e-2, n_gauges=SCALED, n_states=30))),
    "scaled": lambda: run_of(whole_scaled_map(1, seed=4, n=SCALED, n_states=5)),
    "warm": lambda: run_of(with_temperature(whole_scaled_map(2, seed=4, n=12, n_states=9), k=3, n_t=2)),
    "nonlinear": lambda: run_of(whole_map()),
    "filter": lambda: run_of(whole_map(), time_constant=5.0),
}


@pytest.fixture(scope="module", params=list(RUNS))
def run(request: pytest.FixtureRequest) -> Run:
    return RUNS[request.param]()


def deviations(core: Core, seed: int, size: float = 2e-7) -> tuple[int, np.ndarray]:
    """Place of the zero offsets among the settings, and drawn ones with their deviations."""
    places, random = core.settings, np.random.default_rng(seed)
    n = places["zero"].stop - places["zero"].start
    zeros = [1e-8 * random.normal(size=n), size * random.uniform(0.5, 2.0, n), [0.5 * size]]
    return places["zero"].start, np.concatenate(zeros)


def same(one: np.ndarray, other: np.ndarray) -> bool:
    return one.tobytes() == other.tobytes()


def health_of(core: Core, record: np.ndarray) -> HealthState:
    return HealthState(int(record[core.outputs["health"]][0]))


def without_health(core: Core, record: np.ndarray) -> np.ndarray:
    return np.delete(record, core.outputs["health"])


def test_old_matrices_hold_until_the_new_ones_are_made(run: Run) -> None:
    """Then the estimate is that of an instance with the new ones alone, of a filter that begins again."""
    changed, plain, settled = run.core(), run.core(), run.core()
    place, zeros = deviations(changed, seed=1)
    ready, fine = None, 0
    for k in range(STEPS):
        if k == CHANGED:
            changed.set(place, zeros)
        ours, old = run.step(changed, k), run.step(plain, k)
        if k < CHANGED:
            assert same(ours, old)
            continue
        if ready is None and not same(without_health(changed, ours), without_health(changed, old)):
            ready = k
            settled.state = changed.state  # what this step left
        elif ready is None:
            expected = health_of(changed, old)
            fine += expected == HealthState.OK
            assert health_of(changed, ours) == (HealthState.DEGRADED if expected == HealthState.OK else expected)
        if ready is not None and run.inverse_map.manifold is None:
            settled.restart()
            settled.set(place, zeros)
            alone = settled.series(Series.EACH, run.inputs[k : k + 1])[0]
            assert same(ours, alone)
    assert ready is not None
    assert fine > 0
    assert 2 <= ready - CHANGED < MOST


def test_a_renewed_track_goes_on_as_one_with_these_deviations_from_the_start(run: Run) -> None:
    one, other = run.core(), run.core()
    place, zeros = deviations(one, seed=1)
    run.step(one, 0)
    one.set(place, zeros)
    for k in range(1, MOST):
        run.step(one, k)
    other.set(place, zeros)
    one.restart()
    for k in range(MOST, STEPS):
        assert same(run.step(one, k), run.step(other, k))


def test_at_once_where_nothing_has_a_deadline(run: Run) -> None:
    one, other, third = (run.core() for _ in range(3))
    place, zeros = deviations(one, seed=2)
    one.set(place, zeros)  # before the first step
    for k in range(3):
        run.step(other, k)
        run.step(third, k)
    other.set(place, zeros)
    other.restart()
    third.set(place, zeros)
    third.renew()
    first = run.step(one, 3)
    assert same(first, run.step(other, 3))
    assert health_of(one, first) == health_of(third, run.step(third, 3))
    each = [core.series(Series.EACH, run.inputs[4:5])[0] for core in (one, other, third)]
    assert same(each[0], each[1])
    assert same(each[0], each[2])


def test_a_state_holds_how_far_matrices_are_made(run: Run) -> None:
    core, other = run.core(), run.core()
    place, zeros = deviations(core, seed=1)
    states, records = [], []
    for k in range(STEPS):
        if k == CHANGED:
            core.set(place, zeros)
        states.append(core.state)
        records.append(run.step(core, k))
    fresh = run.core()
    for k in (0, CHANGED, CHANGED + 1, CHANGED + 3, CHANGED + 4, STEPS - 2):
        for one in (core, other, fresh):
            one.state = states[k]
            assert one.state == states[k]
            for at in range(k, min(k + 3, STEPS)):
                assert same(run.step(one, at), records[at])
        fresh = run.core()
        fresh.set(*deviations(core, seed=9))


def test_deviations_that_change_all_the_time_are_followed(run: Run) -> None:
    core, plain = run.core(), run.core()
    place, zeros = deviations(core, seed=1)
    others = 0
    for k in range(STEPS):
        zeros[-1] *= 1.0 + 1e-3
        core.set(place, zeros)
        ours, old = run.step(core, k), run.step(plain, k)
        others += k > 0 and not same(without_health(core, ours), without_health(core, old))
    assert others > 0


def test_long_steps_make_every_fifth_part() -> None:
    """Strain that fits no flight is searched for in every step; the matrices come all the same, later."""
    calm = RUNS["nonlinear"]()
    same_sample = calm.inputs[CHANGED : CHANGED + 1].repeat(5 * MOST, axis=0)
    calm = replace(calm, inputs=np.concatenate([calm.inputs[:CHANGED], same_sample]))
    fits_not = calm.inputs.copy()
    alternating = np.where(np.arange(calm.inverse_map.n_gauges) % 2, 1e-4, -1e-4)
    fits_not[CHANGED:, calm.core().inputs["strain"]] += alternating
    ready = []
    for run in (calm, replace(calm, inputs=fits_not)):
        core, plain = run.core(), run.core()
        place, zeros = deviations(core, seed=1)
        for k in range(len(run.inputs)):
            if k == CHANGED:
                core.set(place, zeros)
            ours, old = run.step(core, k), run.step(plain, k)
            if not same(without_health(core, ours), without_health(core, old)):
                ready.append(k - CHANGED)
                break
    quick, late = ready
    assert late == 5 * quick


def test_deviations_that_are_taken_back_leave_the_old_ones(run: Run) -> None:
    core, plain = run.core(), run.core()
    place, zeros = deviations(core, seed=1)
    for k in range(10):
        if k == 4:
            core.set(place, zeros)
        if k == 6:
            core.set(place, np.zeros_like(zeros))
        ours, old = run.step(core, k), run.step(plain, k)
        assert same(without_health(core, ours), without_health(core, old))
        fine = health_of(core, old) == HealthState.OK
        assert same(ours, old) == (not 4 <= k < 6 or not fine)


def test_other_zero_offsets_alone_count_at_once(run: Run) -> None:
    core, other = run.core(), run.core()
    place, zeros = deviations(core, seed=1)
    n = (len(zeros) - 1) // 2
    run.step(core, 0)
    core.set(place, zeros[:n])
    other.set(place, zeros[:n])
    run.step(other, 0)
    ours, theirs = run.step(core, 1), run.step(other, 1)
    if run.inverse_map.manifold is None:
        assert same(ours, theirs)
    assert health_of(core, ours) == health_of(other, theirs) == HealthState.OK


def test_an_estimator_with_other_zeros_has_them_at_once() -> None:
    held = whole_scaled_map(1, seed=4)
    estimator, strain = Estimator(held), held.mean_strain
    estimator.track(strain, NOMINAL)
    n = held.n_strain_gauges
    zeros = GaugeZeros(value=np.zeros(n), std=np.full(n, 1e-7), common_std=0.0)
    found = estimator.with_zeros(zeros)
    assert same(found.track(strain, NOMINAL).loads, found.estimate(strain, NOMINAL).loads)
    assert found.track(strain, NOMINAL).health == HealthState.OK


@pytest.mark.parametrize(("place", "value"), [(0, 0.5), (1, -1.0), (1, 1e9), (2, 5.0), (3, 1.0), (-1, 2.0)])
def test_a_state_that_cannot_be_is_refused(place: int, value: float) -> None:
    run = RUNS["warm"]()
    core = run.core()
    place_of_zeros, zeros = deviations(core, seed=1)
    run.step(core, 0)
    core.set(place_of_zeros, zeros)
    run.step(core, 1)
    run.step(core, 2)
    state, n = bytearray(core.state), 2 * run.inverse_map.n_strain_gauges + 1
    target = state.rindex(zeros.tobytes())  # under way, parts, waited, those in use, then these, then two sensors
    first = target - 8 * (n + 3)
    at = target + 8 * (n + 2 + place) if place < 0 else first + 8 * place
    assert np.frombuffer(state[first : first + 24]).tolist() == [1.0, 2.0, 0.0]
    state[at : at + 8] = np.float64(value).tobytes()
    with pytest.raises(InputError, match="zero offsets that are not allowed"):
        core.state = bytes(state)


def test_the_number_of_steps_is_that_of_the_documentation() -> None:
    """Of as many gauges as the shipped vehicle has."""
    run = RUNS["scaled"]()
    core = run.core()
    place, zeros = deviations(core, seed=1)
    run.step(core, 0)
    core.set(place, zeros)
    health = [health_of(core, run.step(core, k)) for k in range(1, STEPS)]
    page = Path(__file__).parents[2] / "docs" / "reference" / "step_time.md"
    stated = re.search(r"in (\d+) to (\d+) steps", page.read_text(encoding="utf-8"))
    assert stated is not None
    assert int(stated[1]) <= health.count(HealthState.DEGRADED) <= int(stated[2])
