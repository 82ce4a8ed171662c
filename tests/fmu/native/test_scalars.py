"""The scalars of the FMI 3.0 front: the variables of FMI 2.0 one by one, of the same model as the arrays."""

from collections.abc import Iterator
from ctypes import c_bool, c_double, c_int32, c_int64
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import N_D, random_flight, whole_map
from native_case import NativeCase
from raw_fmu import (
    ERROR,
    N_OUTPUTS,
    OK,
    REAL_OUTPUTS,
    VALUES,
    WHOLE_OUTPUTS,
    Fmu2,
    Fmu3,
    first_zero,
    of_filter,
    write_resource,
)

from strainfmu.estimator.air_inputs import LAST_INPUTS
from strainfmu.fmu.description.model_description import FIRST_SCALAR
from strainfmu.interface.estimator_variables import estimator_arrays, estimator_interface
from strainfmu.interface.fmi_variables import value_references

pytestmark = pytest.mark.fast


def scalars(numbers: range | list[int]) -> list[int]:
    return [FIRST_SCALAR + number for number in numbers]


@pytest.fixture
def pair(small: NativeCase) -> Iterator[tuple[Fmu2, Fmu3]]:
    """The smallest map behind both fronts."""
    second, third = Fmu2(small.uri, small.n).start(), Fmu3(str(small.resources), small.n).start()
    yield second, third
    second.free()
    third.free()


def read_scalars(fmu: Fmu3) -> np.ndarray:
    """(27,) outputs, one value reference each, by the type of each."""
    values = np.empty(N_OUTPUTS)
    counts = [number for number in WHOLE_OUTPUTS if number != 20]
    for kind, c_type, numbers in (
        ("Float64", c_double, REAL_OUTPUTS),
        ("Int64", c_int64, [20]),
        ("Int32", c_int32, counts),
    ):
        status, values[numbers] = fmu.get(kind, c_type, scalars(numbers), len(numbers))
        assert status == OK, fmu.messages
    return values


def test_scalars_equal_arrays_and_fmi_2(pair: tuple[Fmu2, Fmu3], small: NativeCase) -> None:
    second, third = pair
    random, n = np.random.default_rng(4), small.n
    for lost in (None, 1):
        strain, valid = 1e-5 * random.normal(size=n), np.arange(n) != lost
        second.set_strain(strain)
        second.set_valid(valid)
        second.set_scalars(0, 9e4, 1e3, 6.0, 2e4)
        # In any order, and the flags apart.
        order = random.permutation(n)
        assert third.set("Float64", c_double, scalars((N_OUTPUTS + order).tolist()), strain[order]) == OK
        assert third.set("Boolean", c_bool, scalars(range(N_OUTPUTS + n, N_OUTPUTS + 2 * n)), valid) == OK
        flow = scalars(range(N_OUTPUTS + 2 * n, N_OUTPUTS + 2 * n + 4))
        assert third.set("Float64", c_double, flow, [9e4, 1e3, 6.0, 2e4]) == OK
        expected = second.outputs()
        assert read_scalars(third).tobytes() == third.outputs().tobytes() == expected.tobytes()
        assert third.get("Float64", c_double, [Fmu3.STRAIN], n)[1].tobytes() == strain.tobytes()
        assert third.get("Boolean", c_bool, [Fmu3.VALID], n)[1].tolist() == valid.tolist()


def test_derivatives_by_scalars_are_those_by_arrays(pair: tuple[Fmu2, Fmu3], small: NativeCase) -> None:
    _, third = pair
    seed, n = np.random.default_rng(5).normal(size=small.n), small.n
    assert third.set("Float64", c_double, [Fmu3.STRAIN], 1e-6 * seed) == OK
    inputs = scalars(range(N_OUTPUTS, N_OUTPUTS + n))
    for kind, unknowns, knowns, values, size in (
        ("Directional", scalars(VALUES), inputs, seed, 10),
        ("Adjoint", scalars(VALUES), inputs, seed[:1].repeat(10), n),
    ):
        status, found = third.differentiate(kind, unknowns, knowns, values, size)
        expected = third.differentiate(kind, [0, 2, 3], [Fmu3.STRAIN], values, size)
        assert status == expected[0] == OK, third.messages
        np.testing.assert_array_equal(found, expected[1])


def test_what_is_no_scalar_of_a_type_is_refused(pair: tuple[Fmu2, Fmu3], small: NativeCase) -> None:
    _, third = pair
    tare = first_zero(small.n) + 2 * small.n + 1 + of_filter(small.inverse_map)
    end = tare + 2 + 2 * small.n + 1 + len(LAST_INPUTS) + 1
    largest = 2**32 - 1 - FIRST_SCALAR
    for name, c_type, wrong in (
        ("Float64", c_double, [20, 23, N_OUTPUTS + small.n, tare, tare + 1, end, largest]),
        ("Int32", c_int32, [0, 20, N_OUTPUTS, end, largest]),
        ("Int64", c_int64, [0, 23, end, largest]),
        ("Boolean", c_bool, [0, N_OUTPUTS, tare + 1, end, largest]),
    ):
        for number in wrong:
            third.messages.clear()
            assert third.get(name, c_type, scalars([number]), 1)[0] == ERROR, (name, number)
            assert len(third.messages) == 1
            assert f"fmi3Get{name}" in third.messages[0][2]
    source = end - 1 - len(LAST_INPUTS)
    for name, c_type, wrong in (
        ("Float64", c_double, [0, 20, N_OUTPUTS + small.n, source, end, largest]),
        ("Int32", c_int32, [0, 20, source, end, largest]),
        ("Int64", c_int64, [0, 20, N_OUTPUTS, end, largest]),
        ("Boolean", c_bool, [0, N_OUTPUTS, end, largest]),
    ):
        for number in wrong:
            assert third.set(name, c_type, scalars([number]), [0]) == ERROR, (name, number)
    for value in (3, 4, -1, 2**32, -(2**32)):
        assert third.set("Int64", c_int64, scalars([source]), [value]) == (OK if value == 3 else ERROR)
        assert third.get("Int64", c_int64, scalars([source]), 1)[1].tolist() == [3]
    # A value that is not one per scalar.
    assert third.get("Float64", c_double, scalars([0, 1]), 3)[0] == ERROR
    assert third.get("Float64", c_double, scalars([0, 1]), 1)[0] == ERROR


def test_every_variable_of_a_map_with_tables_has_the_type_that_is_described(tmp_path: Path) -> None:
    """Arrays and scalars of every variable give the same values; time has the reference behind all arrays."""
    inverse_map = whole_map()
    interface = estimator_interface(inverse_map)
    arrays = estimator_arrays(interface)
    fmu = Fmu3(str(write_resource(inverse_map, tmp_path)), N_D).start()
    sample = random_flight(inverse_map, 1, seed=7)[0]
    names = value_references(interface)
    strain = scalars([names[f"strain[{i + 1}]"] for i in range(N_D)])
    assert fmu.set("Float64", c_double, strain, sample.strain) == OK
    flow = scalars([names[name] for name in sample.flow])
    assert fmu.set("Float64", c_double, flow, list(sample.flow.values())) == OK
    types = {
        "Real": ("Float64", c_double),
        "Integer": ("Int32", c_int32),
        "Boolean": ("Boolean", c_bool),
        "Enumeration": ("Int64", c_int64),
    }
    number = 0
    for reference, array in enumerate(arrays):
        kind, c_type = types[array.fmi_type]
        size = array.dimension or 1
        status, expected = fmu.get(kind, c_type, [reference], size)
        found = [fmu.get(kind, c_type, scalars([number + k]), 1) for k in range(size)]
        assert [status, *(one for one, _ in found)] == [OK] * (size + 1), array.name
        np.testing.assert_array_equal(np.concatenate([value for _, value in found]), expected, err_msg=array.name)
        number += size
    assert number == len(interface)
    assert fmu.get("Float64", c_double, [len(arrays)], 1)[0] == OK
    assert fmu.get("Float64", c_double, scalars([number]), 1)[0] == ERROR
    fmu.free()
