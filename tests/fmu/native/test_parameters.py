"""Flow parameters in the native library: inputs, health, scores, the cause in the log."""

from collections.abc import Sequence

import numpy as np
import pytest
from native_case import NativeCase
from other_load_maps import STATIONS, with_own_further
from parameter_maps import PARAMETERS, with_parameters
from raw_fmu import OK, Fmu2, first_zero, of_filter, write_resource
from scaled_maps import NOMINAL, whole_scaled_map
from thermal_maps import with_temperature

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.input_names import NOT_KNOWN

pytestmark = pytest.mark.fast

N_P, N_T = len(PARAMETERS), 3


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


def test_outputs_do_not_depend_on_it_but_health(case: NativeCase) -> None:
    fmu = Fmu2(case.uri, case.n).start()
    fmu.set_strain(case.inverse_map.mean_strain)
    before = fmu.outputs()
    assert give(fmu, case, [9.0, 9.0, 9.0]) == OK
    after = fmu.outputs()
    assert after[20] == HealthState.OUTSIDE
    assert np.delete(after, 20).tobytes() == np.delete(before, 20).tobytes()
    assert fmu.derivative(range(5), [first(case)], [1.0]).tolist() == [0.0] * 5
