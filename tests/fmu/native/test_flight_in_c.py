"""The nonlinear estimator of the native library: its inputs and settings, its state, what it refuses."""

import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from agreement import tracked
from flight_fmu import (
    N_D,
    FlightFmu,
    random_flight,
)
from raw_fmu import ERROR, OK

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.resource.compact_tables import channel_tables
from strainfmu.interface.estimator_variables import output_values

pytestmark = pytest.mark.fast

N_WIDENING = 14
"""Factors behind the flight state in a state, one of each load and air-data output."""


def test_navigation_that_counts_for_nothing_leaves_the_search_as_it_is(
    fmu: FlightFmu, inverse_map: InverseMap
) -> None:
    """A Mach number so large that its square is no number, in the first step."""
    sample = replace(random_flight(inverse_map, 1, 5)[0], flow={})
    expected = fmu.advance(sample)
    assert fmu.call("Reset") == OK
    fmu.start()
    found = fmu.advance(replace(sample, flow={"mach_number": 1e300}))
    assert found[:20].tobytes() == expected[:20].tobytes()


def refused_state(fmu: FlightFmu, content: bytearray) -> str:
    """The message about a serialised state whose checksum is right."""
    content[12:16] = zlib.crc32(content[16:]).to_bytes(4, "little")
    assert fmu.deserialise(bytes(content))[0] == ERROR
    return fmu.messages[-1][2]


def test_the_state_keeps_what_else_fits(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Serialised between two searches; factors that cannot be are refused."""
    samples = [replace(one, flow={}) for one in random_flight(inverse_map, 16, 77)]
    for sample in samples[:5]:
        fmu.advance(sample)
    kept = fmu.serialise(fmu.get_state())
    first = [fmu.advance(sample) for sample in samples[5:]]
    status, state = fmu.deserialise(kept)
    assert status == OK
    assert fmu.call("SetFMUstate", state) == OK
    assert np.array_equal([fmu.advance(sample) for sample in samples[5:]], first)
    for at, factor in ((3, 0.9), (0, 0.0), (13, np.inf), (5, np.nan)):
        changed = bytearray(kept)
        factors = np.frombuffer(changed, dtype=np.uint8)[-8 * (N_WIDENING + 1) : -8].view(np.float64)
        assert factors.min() >= 1.0
        factors[at] = factor
        assert "flight state that cannot be" in refused_state(fmu, changed)


@pytest.mark.parametrize("value", [np.finfo(float).max, np.finfo(float).smallest_subnormal])
@pytest.mark.parametrize("name", ["mach_number", "static_pressure", "dynamic_pressure"])
def test_navigation_at_the_ends_of_numbers(
    fmu: FlightFmu, inverse_map: InverseMap, name: str, value: float
) -> None:
    """One such reading leaves nothing behind: soon after it the steps are those of a flight without it."""
    samples, estimator = random_flight(inverse_map, 8, seed=12), Estimator(inverse_map)
    for k, sample in enumerate(samples):
        changed = {**sample.flow, name: value} if k == 2 else sample.flow
        found, expected = fmu.advance(replace(sample, flow=changed)), tracked(estimator, sample)
    assert found[20] == HealthState.OK
    np.testing.assert_allclose(found[:20], output_values(expected)[:20], rtol=1e-6)


def test_refuses_model_exchange(resources: Path) -> None:
    other = FlightFmu(resources.as_uri(), N_D, co_simulation=False)
    assert other.instance.value is None
    assert other.messages[-1][2] == "this FMU is for co-simulation"


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_channels_are_the_tables(inverse_map: InverseMap, turn: float) -> None:
    """Whatever the stated roll angles are; gauges that are rotations of each other have one channel."""
    manifold = inverse_map.manifold
    assert manifold is not None
    found = channel_tables(manifold.response, manifold.fixed_response, turn + np.arange(N_D))
    again = np.zeros_like(manifold.response)
    for row, channel, *factors in zip(found.row, found.channel, found.cosine, found.sine, strict=True):
        again[:, :, int(row)] += found.table[:, :, int(channel), :, None] * np.stack(factors, axis=-1)
    assert np.max(np.abs(again - manifold.response)) < 1e-13 * np.max(np.abs(manifold.response))
    assert found.table.shape[2] < N_D / 2
