"""Flow parameters in the native library: inputs, health, scores, the cause in the log."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import byref, c_double

import numpy as np
import pytest
from agreement import assert_same, estimated, random_samples
from native_case import NativeCase
from other_load_maps import STATIONS, with_own_further
from parameter_maps import PARAMETERS, with_parameters
from raw_fmu import ERROR, OK, Fmu2, Fmu3, first_zero, of_filter, write_resource
from scaled_maps import NOMINAL, whole_scaled_map
from thermal_maps import with_temperature

from strainfmu.estimator.air_inputs import LAST_INPUTS
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.input_names import NOT_KNOWN

pytestmark = pytest.mark.fast

N_P, N_T = len(PARAMETERS), 3

N_LAST = len(LAST_INPUTS) + 1
"""Inputs behind those of flow parameters, and whether loads are usable."""


def whole(kind: str) -> InverseMap:
    """A map with parameters alone, or with temperatures and other loads ahead of them."""
    plain = whole_scaled_map(1, 4, 30, 5)
    if kind == "whole":
        plain = with_temperature(with_own_further(plain), k=5, n_t=N_T)
    return with_parameters(plain)


@pytest.fixture(scope="module", params=["alone", "whole"])
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> NativeCase:
    held = whole(request.param)
    return NativeCase(held, write_resource(held, tmp_path_factory.mktemp("parameters")))


def first(case: NativeCase) -> int:
    """Value reference of the first parameter."""
    more = 0 if not case.inverse_map.has_other_loads else N_T + 4 + 12 * len(STATIONS)
    tare = 2 + 2 * case.n + 1
    return first_zero(case.n) + 2 * case.n + 1 + of_filter(case.inverse_map) + more + tare


def give(fmu: Fmu2, case: NativeCase, values: Sequence[float]) -> int:
    return fmu.set_reals(range(first(case), first(case) + N_P), values)


def scores(fmu: Fmu2, case: NativeCase) -> np.ndarray:
    return fmu.get_reals(range(first(case) + N_P, first(case) + 2 * N_P))


def test_as_in_python(case: NativeCase) -> None:
    random, estimator, fmu = np.random.default_rng(3), Estimator(case.inverse_map), Fmu2(case.uri, case.n).start()
    seen = set()
    for k, sample in enumerate(random_samples(case.inverse_map, 40, seed=6)):
        values = random.normal(size=N_P) * [3.0, 0.3, 0.02] + [0.0, 0.25, 2.0]
        if k % 6 == 0:
            values[random.integers(N_P)] = random.choice([np.nan, NOT_KNOWN, np.inf, -np.inf, 1e300])
        fmu.set_strain(sample.strain)
        fmu.set_valid(sample.valid)
        assert fmu.set_scalars(0, *sample.flow) == OK
        assert give(fmu, case, values) == OK
        known = np.where(values == NOT_KNOWN, np.nan, values)
        expected = estimated(estimator, sample, parameters=dict(zip(PARAMETERS, known.tolist(), strict=True)))
        np.testing.assert_array_equal(scores(fmu, case), expected.parameter_score)
        found = fmu.outputs()
        assert_same(found, expected)
        seen.add((HealthState(int(found[20])), bool(expected.outside_parameters)))
    assert {(HealthState.OUTSIDE, True), (HealthState.OK, False)} <= seen


def test_the_log_names_the_cause(case: NativeCase) -> None:
    fmu = Fmu2(case.uri, case.n, logging=True).start()
    fmu.set_strain(case.inverse_map.mean_strain)
    assert fmu.set_scalars(0, NOMINAL) == OK
    assert fmu.step() == OK
    before = len(fmu.messages)
    assert give(fmu, case, [1.0, 0.75, NOT_KNOWN]) == OK
    assert fmu.step(0.01) == OK
    texts = [text for _, _, text in fmu.messages[before:]]
    assert len(texts) == 1
    assert texts[0].startswith("health OUTSIDE at ")
    assert texts[0].endswith("; power = 0.75 is outside 0 to 0.5")


def test_start_state_and_reset(case: NativeCase) -> None:
    fmu = Fmu2(case.uri, case.n).start()
    references = range(first(case), first(case) + N_P)
    assert fmu.get_reals(references).tolist() == [NOT_KNOWN] * N_P
    assert scores(fmu, case).tolist() == [0.0] * N_P
    assert give(fmu, case, [8.0, 0.1, 2.0]) == OK
    state, held = fmu.get_state(), scores(fmu, case)
    content = fmu.serialise(state)
    assert fmu.call("Reset") == OK
    fmu.start()
    assert fmu.get_reals(references).tolist() == [NOT_KNOWN] * N_P
    status, moved = fmu.deserialise(content)
    assert status == OK
    assert fmu.call("SetFMUstate", moved) == OK
    assert scores(fmu, case).tolist() == held.tolist() == [0.5, 0.0, 0.0]
    assert fmu.call("FreeFMUstate", byref(state)) == OK
    assert fmu.set_reals([first(case) + N_P], [0.0]) == ERROR


def test_outputs_do_not_depend_on_it_but_health(case: NativeCase) -> None:
    fmu = Fmu2(case.uri, case.n).start()
    fmu.set_strain(case.inverse_map.mean_strain)
    before = fmu.outputs()
    assert give(fmu, case, [9.0, 9.0, 9.0]) == OK
    after = fmu.outputs()
    assert after[20] == HealthState.OUTSIDE
    assert np.delete(after, 20).tobytes() == np.delete(before, 20).tobytes()
    assert fmu.derivative(range(5), [first(case)], [1.0]).tolist() == [0.0] * 5


def test_scalars_of_fmi_3(case: NativeCase) -> None:
    fmu = Fmu3(str(case.resources), case.n).start()
    reference = (
        Fmu3.TIME
        - N_LAST
        + of_filter(case.inverse_map)
        + (0 if not case.inverse_map.has_other_loads else 1 + 4 + 12)
    )
    assert fmu.set("Float64", c_double, [reference + i for i in range(N_P)], [5.0, 0.2, 1.5]) == OK
    status, found = fmu.get("Float64", c_double, [reference + N_P + i for i in range(N_P)], N_P)
    assert status == OK
    assert found.tolist() == [0.125, 0.0, 0.25]
    assert fmu.get("Float64", c_double, [reference + 2 * N_P + N_LAST], 1)[0] == OK  # the time
