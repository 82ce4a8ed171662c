"""The native library through ctypes: one class per FMI version, thin enough that every call is the C call."""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Sequence
from ctypes import POINTER, byref, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from strainfmu.estimator.map.inverse_map import InverseMap, has_filter
from strainfmu.estimator.resource.map_file import native_resource
from strainfmu.fmu.native.build import library_file

GUID = "{8c4e810f-3df3-4a00-8276-176fa3c9f000}"
OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3
N_OUTPUTS = 27
REAL_OUTPUTS = [*range(20), 21, 22, 26]
VALUES = [*range(5), *range(10, 15)]
"""Coefficients, then loads: what has derivatives."""

WHOLE_OUTPUTS = [20, 23, 24, 25]
N_SCALARS, SETTINGS = 9, 4
"""Flow and navigation, then the settings, of which the first has that number."""


def first_zero(n_gauges: int) -> int:
    """Value reference of the first zero of a map without tables; deviations and that in common follow."""
    return N_OUTPUTS + 2 * n_gauges + N_SCALARS


def of_filter(inverse_map: InverseMap) -> int:
    """How many variables of the filter stand behind zeros and temperatures: 0 or 1."""
    return int(has_filter(inverse_map))


def this_platform() -> str:
    """The library that this machine runs."""
    if platform.system() == "Windows":
        return "win64"
    if platform.system() == "Darwin":
        return "darwin64"
    return "aarch64-linux" if platform.machine() == "aarch64" else "linux64"


@cache
def shipped_library() -> ctypes.CDLL:
    """The library under ``fmus/native/binaries`` for this machine."""
    return ctypes.CDLL(str(library_file(this_platform())))


def write_resource(inverse_map: InverseMap, folder: Path, guid: str = GUID) -> Path:
    """Write ``resources/map.bin`` under ``folder`` and return the folder of resources."""
    resources = folder / "resources"
    resources.mkdir(parents=True, exist_ok=True)
    (resources / "map.bin").write_bytes(native_resource(inverse_map, guid))
    return resources


_LOGGER_2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)
_LOGGER_3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER_2),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    )


def _doubles(values: Any) -> Any:
    return np.ascontiguousarray(values, dtype=float).ctypes.data_as(POINTER(c_double))


class Fmu2:
    """One instance of FMI 2.0; ``messages`` gathers (status, category, text) of the logger."""

    def __init__(
        self,
        location: str,
        n_gauges: int,
        guid: str = GUID,
        library: ctypes.CDLL | None = None,
        co_simulation: bool = True,
        logging: bool = False,
    ) -> None:
        self.n, self.messages = n_gauges, list[tuple[int, str, str]]()
        self._library = library or shipped_library()
        # The format is always "%s", and the text its one argument.
        self._logger = _LOGGER_2(
            lambda _e, _n, s, c, f, text: self.messages.append((s, c.decode(), text.decode()))
        )
        self._callbacks = _Callbacks(self._logger, None, None, None, None)
        self._library.fmi2Instantiate.restype = c_void_p
        self.instance = c_void_p(
            self._library.fmi2Instantiate(
                b"estimator",
                c_int(co_simulation),
                guid.encode(),
                location.encode(),
                byref(self._callbacks),
                c_int(0),
                c_int(logging),
            )
        )

    def call(self, name: str, *arguments: Any) -> int:
        """Status of the function ``fmi2<name>``."""
        return int(getattr(self._library, f"fmi2{name}")(self.instance, *arguments))

    def start(self) -> Fmu2:
        """Through initialization, with start time 0."""
        assert self.call("SetupExperiment", c_int(0), c_double(0.0), c_double(0.0), c_int(0), c_double(0.0)) == OK
        assert self.call("EnterInitializationMode") == OK
        assert self.call("ExitInitializationMode") == OK
        return self

    def free(self) -> None:
        """Free the instance."""
        self._library.fmi2FreeInstance.restype = None
        self._library.fmi2FreeInstance(self.instance)

    def step(self, time: float = 0.0, size: float = 0.01) -> int:
        """Status of one step."""
        return self.call("DoStep", c_double(time), c_double(size), c_int(1))

    def references(self, values: Sequence[int]) -> Any:
        """Value references as C wants them."""
        return (c_uint * len(values))(*values)

    def get_reals(self, references: Sequence[int]) -> np.ndarray:
        """Values of Real variables."""
        values = np.full(len(references), -1.0)
        arguments = (self.references(references), c_size_t(len(references)), _doubles(values))
        assert self.call("GetReal", *arguments) == OK, self.messages
        return values

    def get_integers(self, references: Sequence[int]) -> np.ndarray:
        """Values of Integer and Enumeration variables."""
        values = (c_int * len(references))()
        arguments = (self.references(references), c_size_t(len(references)), values)
        assert self.call("GetInteger", *arguments) == OK, self.messages
        return np.array(values[:])

    def set_reals(self, references: Sequence[int], values: Any) -> int:
        """Status of setting Real variables."""
        return self.call("SetReal", self.references(references), c_size_t(len(references)), _doubles(values))

    def set_integers(self, references: Sequence[int], values: Sequence[int]) -> int:
        """Status of setting Integer or Enumeration variables."""
        numbers = (c_int * len(values))(*values)
        return self.call("SetInteger", self.references(references), c_size_t(len(references)), numbers)

    def set_valid(self, valid: np.ndarray) -> None:
        """Set the validity of all gauges."""
        references = range(N_OUTPUTS + self.n, N_OUTPUTS + 2 * self.n)
        values = (c_int * self.n)(*valid.astype(int).tolist())
        assert self.call("SetBoolean", self.references(references), c_size_t(self.n), values) == OK

    def set_strain(self, strain: np.ndarray) -> None:
        """Set the strain of all gauges."""
        assert self.set_reals(range(N_OUTPUTS, N_OUTPUTS + self.n), strain) == OK

    def set_scalars(self, first: int, *values: float) -> int:
        """Status of setting scalar inputs and settings from number ``first`` on."""
        start = N_OUTPUTS + 2 * self.n + first
        return self.set_reals(range(start, start + len(values)), values)

    def outputs(self) -> np.ndarray:
        """(27,) all outputs by value reference."""
        values = np.empty(N_OUTPUTS)
        values[REAL_OUTPUTS] = self.get_reals(REAL_OUTPUTS)
        values[WHOLE_OUTPUTS] = self.get_integers(WHOLE_OUTPUTS)
        return values

    def derivative(self, unknowns: Sequence[int], knowns: Sequence[int], direction: Any) -> np.ndarray:
        """Directional derivative of ``unknowns`` along ``direction`` of ``knowns``."""
        values = np.empty(len(unknowns))
        status = self.call(
            "GetDirectionalDerivative",
            self.references(unknowns),
            c_size_t(len(unknowns)),
            self.references(knowns),
            c_size_t(len(knowns)),
            _doubles(direction),
            _doubles(values),
        )
        assert status == OK, self.messages
        return values

    def get_state(self) -> c_void_p:
        """A new FMU state."""
        state = c_void_p(None)
        assert self.call("GetFMUstate", byref(state)) == OK, self.messages
        return state

    def serialise(self, state: c_void_p) -> bytes:
        """The bytes of ``state``."""
        size = c_size_t(0)
        assert self.call("SerializedFMUstateSize", state, byref(size)) == OK
        content = (c_char * size.value)()
        assert self.call("SerializeFMUstate", state, content, size) == OK
        return content.raw

    def deserialise(self, content: bytes) -> tuple[int, c_void_p]:
        """Status, and the state made of ``content``."""
        state = c_void_p(None)
        return self.call("DeSerializeFMUstate", content, c_size_t(len(content)), byref(state)), state


class Fmu3:
    """One instance of FMI 3.0, with arrays; value references 0 .. 32 in the order of its variables.

    ``TARE`` and what follows it are those of a map without a filter.
    """

    FLOATS: ClassVar = {0: 5, 1: 5, 2: 3, 3: 2, 4: 3, 5: 2, 7: 1, 8: 1, 12: 1}
    STRAIN, VALID, FIRST_SCALAR, ZERO, TARE, TIME = 13, 14, 15, 24, 27, 38
    SCALARS: ClassVar = range(15, 24)

    def __init__(
        self,
        location: str,
        n_gauges: int,
        guid: str = GUID,
        library: ctypes.CDLL | None = None,
        co_simulation: bool = True,
    ) -> None:
        self.n, self.messages = n_gauges, list[tuple[int, str, str]]()
        self._library = library or shipped_library()
        self._logger = _LOGGER_3(lambda _e, s, c, text: self.messages.append((s, c.decode(), text.decode())))
        start = (b"estimator", guid.encode(), location.encode(), ctypes.c_bool(False), ctypes.c_bool(False))
        if co_simulation:
            instantiate = self._library.fmi3InstantiateCoSimulation
            middle: tuple[Any, ...] = (ctypes.c_bool(False), ctypes.c_bool(False), None, c_size_t(0))
            end: tuple[Any, ...] = (None, self._logger, None)
        else:
            instantiate, middle, end = self._library.fmi3InstantiateModelExchange, (), (None, self._logger)
        instantiate.restype = c_void_p
        self.instance = c_void_p(instantiate(*start, *middle, *end))

    def call(self, name: str, *arguments: Any) -> int:
        """Status of the function ``fmi3<name>``."""
        return int(getattr(self._library, f"fmi3{name}")(self.instance, *arguments))

    def start(self) -> Fmu3:
        """Through initialization, with start time 0."""
        no = ctypes.c_bool(False)
        assert self.call("EnterInitializationMode", no, c_double(0.0), c_double(0.0), no, c_double(0.0)) == OK
        assert self.call("ExitInitializationMode") == OK
        return self

    def free(self) -> None:
        """Free the instance."""
        self._library.fmi3FreeInstance.restype = None
        self._library.fmi3FreeInstance(self.instance)

    def get(self, kind: str, c_type: Any, references: Sequence[int], size: int) -> tuple[int, np.ndarray]:
        """Status and ``size`` values of the variables of type ``kind``."""
        values = (c_type * size)()
        listed = (c_uint * len(references))(*references)
        status = self.call(f"Get{kind}", listed, c_size_t(len(references)), values, c_size_t(size))
        return status, np.array(values[:])

    def set(self, kind: str, c_type: Any, references: Sequence[int], values: Any) -> int:
        """Status of setting variables of type ``kind``."""
        content = (c_type * len(values))(*values)
        listed = (c_uint * len(references))(*references)
        return self.call(f"Set{kind}", listed, c_size_t(len(references)), content, c_size_t(len(values)))

    def outputs(self) -> np.ndarray:
        """(27,) all outputs in the order of FMI 2.0's value references."""
        values = np.empty(N_OUTPUTS)
        statuses = []
        status, values[REAL_OUTPUTS] = self.get("Float64", c_double, list(self.FLOATS), 23)
        statuses.append(status)
        status, values[20:21] = self.get("Int64", ctypes.c_int64, [6], 1)
        statuses.append(status)
        status, values[23:26] = self.get("Int32", ctypes.c_int32, [9, 10, 11], 3)
        assert [*statuses, status] == [OK] * 3, self.messages
        return values

    def differentiate(self, kind: str, unknowns: Sequence[int], knowns: Sequence[int], seed: Any, n: int) -> Any:
        """Status and (n,) sensitivity of the directional or adjoint derivative."""
        values = np.empty(n)
        status = self.call(
            f"Get{kind}Derivative",
            (c_uint * len(unknowns))(*unknowns),
            c_size_t(len(unknowns)),
            (c_uint * len(knowns))(*knowns),
            c_size_t(len(knowns)),
            _doubles(seed),
            c_size_t(len(seed)),
            _doubles(values),
            c_size_t(n),
        )
        return status, values
