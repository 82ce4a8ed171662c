"""FMU states: get, set, serialise and de-serialise in the middle of a run, and bytes that are no state."""

import ctypes
from ctypes import byref, c_size_t, c_void_p

import numpy as np
import pytest
from agreement import random_samples
from native_case import NativeCase
from raw_fmu import ERROR, OK, SETTINGS, Fmu2, Fmu3

pytestmark = pytest.mark.fast


def run(fmu: Fmu2, case: NativeCase, seed: int) -> list[bytes]:
    """Outputs of 20 steps, in bytes."""
    seen = []
    for k, sample in enumerate(random_samples(case.inverse_map, 20, seed)):
        fmu.set_strain(sample.strain)
        fmu.set_valid(sample.valid)
        fmu.set_scalars(0, *sample.flow)
        fmu.step(0.1 * k, 0.1)
        seen.append(fmu.outputs().tobytes())
    return seen


def test_return_to_a_state(case: NativeCase) -> None:
    fmu = Fmu2(case.uri, case.n).start()
    run(fmu, case, seed=1)
    fmu.set_scalars(SETTINGS, 1e-4, 2.0, 0.3, 0.7, 1.0)
    state, outputs = fmu.get_state(), fmu.outputs()
    after = run(fmu, case, seed=2)
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.outputs().tobytes() == outputs.tobytes()
    assert run(fmu, case, seed=2) == after
    # Into a state that is there, and freed twice.
    assert fmu.call("GetFMUstate", byref(state)) == OK
    assert fmu.call("FreeFMUstate", byref(state)) == OK
    assert state.value is None
    assert fmu.call("FreeFMUstate", byref(state)) == OK
    fmu.free()


def test_serialised_state_moves_to_another_instance(case: NativeCase) -> None:
    first, second = Fmu2(case.uri, case.n).start(), Fmu2(case.uri, case.n)
    run(first, case, seed=3)
    content = first.serialise(first.get_state())
    status, state = second.deserialise(content)
    assert status == OK
    assert second.serialise(state) == content
    assert second.call("SetFMUstate", state) == OK  # its mode too: it was never initialised
    assert second.outputs().tobytes() == first.outputs().tobytes()
    assert run(second, case, seed=4) == run(first, case, seed=4)
    for fmu in (first, second):
        fmu.free()


@pytest.mark.parametrize("position", [0, 7, 8, 12, 16, 20, 24, 28, 32, 39, 40, 100, -1])
def test_altered_state(small: NativeCase, position: int) -> None:
    fmu = Fmu2(small.uri, small.n).start()
    fmu.set_strain(small.inverse_map.mean_strain)
    content = bytearray(fmu.serialise(fmu.get_state()))
    content[position] ^= 0x40
    status, state = fmu.deserialise(bytes(content))
    assert status == ERROR
    assert state.value is None
    assert fmu.messages[-1][2].startswith("the serialised state ")
    assert np.isfinite(fmu.outputs()[:5]).all()
    fmu.free()


def test_state_of_the_wrong_length(small: NativeCase) -> None:
    fmu = Fmu2(small.uri, small.n).start()
    content = fmu.serialise(fmu.get_state())
    for wrong in (b"", content[:20], content[:-1], content + b"\0"):
        assert fmu.deserialise(wrong)[0] == ERROR
    short = (ctypes.c_char * 10)()
    assert fmu.call("SerializeFMUstate", fmu.get_state(), short, c_size_t(10)) == ERROR
    assert "takes" in fmu.messages[-1][2]
    fmu.free()


def test_state_of_another_fmu(cases: dict[str, NativeCase]) -> None:
    one, other = cases["case 1"], cases["case 2"]
    first, second = Fmu2(one.uri, one.n).start(), Fmu2(other.uri, other.n).start()
    state = first.get_state()
    assert second.deserialise(first.serialise(state))[0] == ERROR
    assert second.messages[-1][2] == "the serialised state is that of an FMU with another map"
    assert second.call("SetFMUstate", state) == ERROR
    exchange = Fmu2(one.uri, one.n, co_simulation=False).start()
    assert exchange.call("SetFMUstate", state) == ERROR
    assert exchange.messages[-1][2] == "the FMU state is that of another kind of instance"
    for fmu in (first, second, exchange):
        fmu.free()


NAMES = {
    Fmu2: ("GetFMUstate", "SetFMUstate", "SerializedFMUstateSize", "SerializeFMUstate", "DeSerializeFMUstate"),
    Fmu3: ("GetFMUState", "SetFMUState", "SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState"),
}


@pytest.mark.parametrize("version", NAMES, ids=["FMI 2", "FMI 3"])
@pytest.mark.parametrize("names", [("few gauges", "case 1"), ("case 1", "few gauges"), ("case 1", "case 2")])
def test_every_call_refuses_a_state_of_another_map(
    cases: dict[str, NativeCase], names: tuple[str, str], version: type[Fmu2] | type[Fmu3]
) -> None:
    # A state of few gauges is shorter: what is written for many leaves its block. Case 1 and 2 have equal lengths.
    get, put, size_of, serialise, deserialise = NAMES[version]
    own, foreign = (version(cases[name].uri, cases[name].n).start() for name in names)
    here, there, size = c_void_p(None), c_void_p(None), c_size_t(0)
    assert own.call(get, byref(here)) == foreign.call(get, byref(there)) == OK
    assert foreign.call(size_of, there, byref(size)) == OK
    foreign_bytes = ctypes.create_string_buffer(size.value)
    assert foreign.call(serialise, there, foreign_bytes, size) == OK
    assert own.call(size_of, here, byref(size)) == OK
    room, own_bytes = ctypes.create_string_buffer(1 << 16), ctypes.create_string_buffer(size.value)
    assert own.call(serialise, here, own_bytes, size) == OK
    outputs, address = own.outputs().tobytes(), there.value
    refused = {
        "into a foreign state": (get, byref(there)),
        "to a foreign state": (put, there),
        "size of a foreign state": (size_of, there, byref(c_size_t(0))),
        "bytes of a foreign state": (serialise, there, room, c_size_t(len(room))),
        "own bytes into a foreign state": (deserialise, own_bytes, c_size_t(len(own_bytes)), byref(there)),
        "foreign bytes into an own state": (deserialise, foreign_bytes, c_size_t(len(foreign_bytes)), byref(here)),
    }
    for name, call in refused.items():
        assert own.call(*call) == ERROR, name
        assert own.messages[-1][2].endswith("state is that of an FMU with another map"), name
    assert len(own.messages) == len(refused)
    assert not any(room.raw)
    assert own.outputs().tobytes() == outputs
    # The foreign state is what it was.
    again = ctypes.create_string_buffer(len(foreign_bytes))
    assert there.value == address
    assert foreign.call(serialise, there, again, c_size_t(len(again))) == OK
    assert again.raw == foreign_bytes.raw
    for fmu in (own, foreign):
        fmu.free()


def test_state_handed_over_instead_of_its_address(small: NativeCase) -> None:
    # fmusim does so; its first word must read as a state that is already free.
    fmu = Fmu2(small.uri, small.n).start()
    state = fmu.get_state()
    assert fmu.call("FreeFMUstate", c_void_p(state.value)) == OK
    assert fmu.call("SetFMUstate", state) == OK
    fmu.free()
