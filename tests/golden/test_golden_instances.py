"""The native library with maps of every kind: states, resets, start values, equal bits by both versions of FMI."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from fmu_carriers import Fmi2Host, Fmi3Host, values_of_inputs, values_of_parameters
from inputs import recorded
from kinds import KINDS, map_of_kind
from raw_fmu import OK, write_resource

from strainfmu.estimator.health import USABLE_STATES as USED
from strainfmu.estimator.other_loads import LoadArray
from strainfmu.interface.estimator_variables import LOADS, estimator_interface
from strainfmu.interface.fmi_variables import COEFFICIENTS, value_references
from strainfmu.interface.input_names import NOT_KNOWN
from strainfmu.interface.sensor_variables import reading_names
from strainfmu.interface.zero_variables import zero_names

pytestmark = pytest.mark.fast

KEPT, STEPS = 12, 20
"""Samples before a state is kept, and all of them."""


class Flown:
    """An instance that is given the flight of a kind, with the time constant of a filter where it has one [s]."""

    def __init__(self, kind: str, host: type[Fmi2Host] | type[Fmi3Host], resources: Path, seconds: float) -> None:
        held, inputs = map_of_kind(kind), recorded(kind)["flight"].inputs.rows(slice(STEPS))
        self.host = host(held, resources)
        self._parameters = values_of_parameters(self.host.places, held, inputs, seconds)
        self.given = [*zip(values_of_inputs(self.host.places, held, inputs), inputs.valid, strict=True)]
        self.time = inputs.time.tolist()

    def begin(self) -> Flown:
        """Begin, or begin again after a reset."""
        self.host.restart(self._parameters)
        return self

    def step(self, k: int) -> bytes:
        """Return the outputs after a step with the inputs of a sample."""
        self.host.give(*self.given[k])
        return self.host.step(self.time[k], 0.01).tobytes()

    def rest(self) -> list[bytes]:
        """Return the outputs after each step behind the state that is kept."""
        return [self.step(k) for k in range(KEPT, STEPS)]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Flown]:
    """Return a function that begins a flight of a kind."""
    resources = cache(lambda kind: write_resource(map_of_kind(kind), tmp_path_factory.mktemp("golden"), guid=""))
    return lambda kind, host=Fmi2Host, seconds=1.0: Flown(kind, host, resources(kind), seconds).begin()


@pytest.mark.parametrize("kind", KINDS)
def test_fmi_3_gives_the_bits_of_fmi_2_and_both_begin_anew(kind: str, flown: Callable[..., Flown]) -> None:
    two, three = flown(kind), flown(kind, Fmi3Host)
    found = [two.step(k) for k in range(STEPS)]
    assert [three.step(k) for k in range(STEPS)] == found
    for one in (two, three):
        assert [one.begin().step(0), *map(one.step, range(1, STEPS))] == found


@pytest.mark.parametrize("kind", KINDS)
def test_a_state_goes_on_in_its_instance_and_in_another(kind: str, flown: Callable[..., Flown]) -> None:
    one = flown(kind)
    for k in range(KEPT):
        one.step(k)
    at, state = one.host.outputs().tobytes(), one.host.fmu.get_state()
    content, after = one.host.fmu.serialise(state), one.rest()
    assert one.host.fmu.call("SetFMUstate", state) == OK
    assert one.host.outputs().tobytes() == at
    assert one.rest() == after
    other = flown(kind)
    status, moved = other.host.fmu.deserialise(content)
    assert status == OK
    assert other.host.fmu.call("SetFMUstate", moved) == OK
    assert other.rest() == after


@pytest.mark.parametrize("kind", KINDS)
def test_start_values_are_those_of_the_description_also_after_a_reset(
    kind: str, flown: Callable[..., Flown]
) -> None:
    fmu, variables = flown(kind).host.fmu, estimator_interface(map_of_kind(kind))
    assert fmu.call("Reset") == OK
    reals = {k: one.start for k, one in enumerate(variables) if one.fmi_type == "Real" and one.start is not None}
    assert NOT_KNOWN in reals.values() or not map_of_kind(kind).provenance.get("parameters")
    np.testing.assert_array_equal(fmu.get_reals([*reals]), [*reals.values()])


LINEAR = [kind for kind, one in KINDS.items() if not one.is_nonlinear]
MOVED = ("dynamic_pressure", "thrust", "reference_area", "reference_length", "moment_station")


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize("kind", LINEAR)
def test_derivatives_of_linear_maps_are_those_of_differences(
    kind: str, lost: bool, flown: Callable[..., Flown]
) -> None:
    """Along readings, temperatures, zero offsets, dynamic pressure, thrust and settings at once."""
    one, held, random = flown(kind, seconds=0.0), map_of_kind(kind), np.random.default_rng(1)
    states = recorded(kind)["flight"].results["each"]["health"]
    numbers, valid = next(given for given, state in zip(one.given, states, strict=False) if state in USED)
    if lost:
        valid = valid & (np.arange(len(valid)) != 1)
        numbers = np.where(np.arange(len(numbers)) == 3, np.nan, numbers)  # a reading
    one.host.give(numbers, valid)
    fmu, reference = one.host.fmu, value_references(estimator_interface(held))
    noise = dict(zip(reading_names(held), held.noise_std * held.sensors.scale, strict=True))
    noise |= dict(zip(zero_names(held.n_strain_gauges), held.noise_std[: held.n_strain_gauges], strict=False))
    names = [name for name in reference if name in noise or name in MOVED or name.startswith("temperature[")]
    known = [reference[name] for name in names]
    at = fmu.get_reals(known)
    size = np.array([noise.get(name, 1e-3 * abs(value) + 1e-3) for name, value in zip(names, at, strict=True)])
    direction = np.where(np.isfinite(at), size * random.normal(size=len(at)), 0.0)
    loads = [name for group in held.load_groups for name in LoadArray(group, False, False).outputs]
    for group in (COEFFICIENTS, LOADS, loads):
        unknown, ends = [reference[name] for name in group if name in reference], []
        found = fmu.derivative(unknown, known, direction)
        for sign in (1.0, -1.0):
            assert fmu.set_reals(known, at + 1e-2 * sign * direction) == OK
            ends.append(fmu.get_reals(unknown))
        assert fmu.set_reals(known, at) == OK
        expected = (ends[0] - ends[1]) / 2e-2
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max(initial=0.0))
