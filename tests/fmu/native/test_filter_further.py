"""Section loads in the filter of the native library: their references and their state."""

from __future__ import annotations

import numpy as np
import pytest
from flight_fmu import FILTER, N_D, FlightFmu, random_flight, whole_map
from other_load_maps import STATIONS, with_further_tables
from raw_fmu import OK

from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

OUTPUTS = range(FILTER + 1, FILTER + 1 + 4 + 12 * len(STATIONS))
"""Value references of the other loads, behind the time constant."""

STEP = 0.01


@pytest.fixture(scope="module")
def inverse_map() -> InverseMap:
    return with_further_tables(whole_map())


def test_settings_and_state(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Other references; a state brings the samples back, with which the next step gives the same loads."""
    samples = random_flight(inverse_map, 6, seed=3)
    assert fmu.filter(1.0) == OK
    for k, one in enumerate(samples[:4]):
        fmu.advance_over(one, STEP * k, STEP)
    state = fmu.get_state()
    first = fmu.advance_over(samples[4], 4 * STEP, STEP)
    loads = fmu.get_reals(OUTPUTS)
    fmu.advance_over(samples[5], 5 * STEP, STEP)
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.advance_over(samples[4], 4 * STEP, STEP).tobytes() == first.tobytes()
    assert fmu.get_reals(OUTPUTS).tobytes() == loads.tobytes()
    assert fmu.call("SetFMUstate", state) == OK
    area, length = (float(value) for value in fmu.get_reals(range(33 + 2 * N_D, 35 + 2 * N_D)))
    assert fmu.set_scalars(6, 2.0 * area, 3.0 * length) == OK
    fmu.advance_over(samples[4], 4 * STEP, STEP)
    np.testing.assert_allclose(fmu.get_reals(OUTPUTS[:2]), loads[:2] / 6.0, rtol=1e-12)
    np.testing.assert_allclose(fmu.get_reals(OUTPUTS[2:]), loads[2:], rtol=1e-12)
