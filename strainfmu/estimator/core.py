"""The compiled estimator: its library, and a handle on one map.

The library is the one that native FMUs carry, ``fmus/native/binaries``; ``strainload.h`` documents its functions.
Where a platform has none, or one of other sources, :mod:`strainfmu.estimator.library_sources` makes one.
"""

from __future__ import annotations

import ctypes
import platform
import sys
from collections.abc import Mapping
from enum import IntEnum
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.library_sources import (
    BINARIES,
    SUFFIX,
    development_library,
    is_of_sources,
    library_digest,
)
from strainfmu.estimator.library_sources import NoCoreError as NoCoreError

VERSION = 5
"""``SL_VERSION`` of the library that this file calls."""

LIBRARIES_OF_FMU = "native"
"""Folder in ``resources/`` of an FMU of the Python kind, which carries libraries and a copy of this package."""

_TEXT_SIZE = 256


class Record(IntEnum):
    """Records of a handle: ``strainload.h``."""

    INPUTS = 0
    SETTINGS = 1
    OUTPUTS = 2
    FIT = 3
    TARE_LIMITS = 4
    TARE = 5
    ROWS = 6
    STATE = 7
    TARE_STATE = 8
    ITERATIONS = 9
    STACK = 10
    MEMORY = 11


class Series(IntEnum):
    """How the samples of a series follow one another."""

    EACH = 0
    """Each by itself, without memory."""
    TRACK = 1
    """Each from what the one before it left."""


class _Field(ctypes.Structure):
    _fields_ = (("name", ctypes.c_char * 64), ("first", ctypes.c_size_t), ("count", ctypes.c_size_t))


Layout = Mapping[str, slice]
"""Place of each field of a record, by name."""

Outcome = Mapping[str, FloatArray]
"""What a tare found, by the names of ``SL_TARE``."""


class Core:
    """The compiled estimator of one map; it serves one thread at a time.

    Attributes
    ----------
    resource : bytes of ``map.bin`` that it was opened with.
    n_rows : number of sensors of the map.
    inputs, settings, outputs, fit : layouts of its records; the fields of ``fit`` begin behind the outputs.
    tare_outcome : layout of what a tare finds.
    most_iterations : Gauss-Newton iterations that no sample exceeds; 0 of a map without tables.
    stack_size, memory_size : bytes of stack that no function exceeds; bytes of a handle, without the map.
    """

    def __init__(self, resource: bytes) -> None:
        """Open the map in ``resource``.

        Raises
        ------
        NoCoreError
            There is no library for this machine, and no compiler to make one.
        InputError
            ``resource`` is damaged, or of another version.
        """
        self._library = library()
        self.resource = resource
        text = ctypes.create_string_buffer(_TEXT_SIZE)
        self._handle = self._library.sl_open(resource, len(resource), text)
        if not self._handle:
            raise InputError(f"map.bin: {text.value.decode()}")
        self._text = text
        size = [self._library.sl_size(self._handle, record) for record in Record]
        self.n_rows, self._state_size = size[Record.ROWS], size[Record.STATE]
        self.n_inputs, self.n_outputs, self.n_fit = size[Record.INPUTS], size[Record.OUTPUTS], size[Record.FIT]
        self.inputs, self.settings = self._layout(Record.INPUTS), self._layout(Record.SETTINGS)
        self.outputs, self.fit = self._layout(Record.OUTPUTS), self._layout(Record.FIT, self.n_outputs)
        self.tare_outcome = self._layout(Record.TARE)
        self._n_outcome, self._tare_state_size = size[Record.TARE], size[Record.TARE_STATE]
        self.most_iterations = size[Record.ITERATIONS]
        self.stack_size, self.memory_size = size[Record.STACK], size[Record.MEMORY]
        # One sample: the addresses of these arrays are taken once.
        self.sample = np.full(self.n_inputs, np.nan)
        self._result = np.empty(self.n_outputs + self.n_fit)
        self._short_result = self._result[: self.n_outputs]
        self._time = ctypes.c_double(0.0)
        self._mask = np.ones(self.n_rows, dtype=np.uint8)
        self._start = np.zeros(4)
        self._series = self._library.sl_series
        # Without declared types of arguments, which cost half a microsecond; they are converted here once.
        self._one_sample = self._library["sl_series"]
        self._one_sample.restype = None
        pointer = ctypes.c_void_p.from_param
        handle, at_time = pointer(self._handle), pointer(ctypes.addressof(self._time))
        arrays = (self.sample, self._mask, self._start, self._result)
        at_sample, at_mask, at_start, at_result = (pointer(array.ctypes.data) for array in arrays)
        count, none = ctypes.c_size_t.from_param(1), ctypes.c_void_p(None)
        # By start or none, mask or none, fit or none, and how the sample follows the one before.
        self._arguments = tuple(
            (handle, int(how), with_fit, count, at_time, at_sample, mask, start, at_result)
            for start in (none, at_start)
            for mask in (none, at_mask)
            for with_fit in (0, 1)
            for how in Series
        )

    def __del__(self) -> None:
        handle = getattr(self, "_handle", None)
        if handle:
            self._library.sl_close(handle)
            self._handle = None

    def _layout(self, record: Record, begin: int = 0) -> Layout:
        places, field = dict[str, slice](), _Field()
        while self._library.sl_field(self._handle, record, len(places), ctypes.byref(field)):
            first = begin + int(field.first)
            places[field.name.decode()] = slice(first, first + int(field.count))
        return MappingProxyType(places)

    def copy(self) -> Core:
        """Return another handle on the same map with the same settings, for another thread."""
        duplicate = Core(self.resource)
        duplicate.set(0, self.get(0, sum(part.stop - part.start for part in self.settings.values())))
        return duplicate

    def set(self, first: int, values: FloatArray) -> None:
        """Set the settings from place ``first`` on to ``values``."""
        settings = np.ascontiguousarray(values, dtype=float)
        if not self._library.sl_set(self._handle, first, settings.size, settings.ctypes.data, self._text):
            raise InputError(self._text.value.decode())

    def renew(self) -> None:
        """Follow changed standard deviations of zero offsets at once, not over the next samples of a track."""
        self._library.sl_renew(self._handle)

    def get(self, first: int, count: int) -> FloatArray:
        """Return ``count`` settings from place ``first`` on."""
        settings = np.empty(count)
        self._library.sl_get(self._handle, first, count, settings.ctypes.data)
        return settings

    def step(
        self,
        time: float,
        how: Series,
        with_fit: bool,
        mask: BoolArray | None = None,
        start: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the record of the one sample in :attr:`sample` at ``time`` [s], and a copy of the sample.

        ``mask`` is (n_d,) of bool, ``start`` (4,) as :meth:`series` takes it.
        """
        self._time.value = time
        if mask is not None:
            self._mask[:] = mask
        if start is not None:
            self._start[:] = start
        which = 4 * (start is not None) + 2 * (mask is not None) + with_fit
        self._one_sample(*self._arguments[len(Series) * which + how])
        return (self._result if with_fit else self._short_result).copy(), self.sample.copy()

    def series(
        self,
        how: Series,
        inputs: FloatArray,
        *,
        with_fit: bool = False,
        time: FloatArray | None = None,
        mask: BoolArray | None = None,
        start: FloatArray | None = None,
        out: FloatArray | None = None,
    ) -> FloatArray:
        """Return the records (k, n) of k samples.

        ``inputs`` is (k, n_inputs), ``time`` (k,) [s], ``mask`` (k, n_d) of bool, ``start`` (k, 4) the flight
        state from which each sample of :attr:`Series.EACH` starts; ``out`` is written if given.
        """
        k = len(inputs)
        samples = np.ascontiguousarray(inputs)
        result = np.empty((k, self.n_outputs + (self.n_fit if with_fit else 0))) if out is None else out
        times = None if time is None else np.ascontiguousarray(time, dtype=float)
        used = None if mask is None else np.ascontiguousarray(mask, dtype=np.uint8)
        state = None if start is None else np.ascontiguousarray(start, dtype=float)
        assert samples.shape == (k, self.n_inputs)
        assert samples.dtype == float
        assert result.flags.c_contiguous
        self._series(
            self._handle,
            how,
            with_fit,
            k,
            None if times is None else times.ctypes.data,
            samples.ctypes.data,
            None if used is None else used.ctypes.data,
            None if state is None else state.ctypes.data,
            result.ctypes.data,
        )
        return result

    def restart(self) -> None:
        """Forget the samples so far."""
        self._library.sl_restart(self._handle)

    @property
    def state(self) -> bytes:
        """What the last sample left."""
        state = ctypes.create_string_buffer(self._state_size)
        self._library.sl_state(self._handle, state)
        return state.raw

    @state.setter
    def state(self, state: bytes) -> None:
        if len(state) != self._state_size:
            raise InputError(f"state: {len(state)} bytes found, must be {self._state_size}: it is of another map")
        if not self._library.sl_restore(self._handle, state, self._text):
            raise InputError(f"state: {self._text.value.decode()}")

    def tare(self, limits: FloatArray, strain: FloatArray, dynamic_pressure: FloatArray) -> Outcome:
        """Return the outcome of a window: ``strain`` (n, n_d) [m/m] and ``dynamic_pressure`` (n,) [Pa].

        ``limits`` are (3 + 2 n_d,): largest dynamic pressure, zero and drift, then known strain and its standard
        deviation.
        """
        outcome, bounds = self._new_outcome(), np.ascontiguousarray(limits)
        readings, pressures = np.ascontiguousarray(strain), np.ascontiguousarray(dynamic_pressure)
        self._library.sl_tare(
            self._handle,
            bounds.ctypes.data,
            len(readings),
            readings.ctypes.data,
            pressures.ctypes.data,
            outcome.ctypes.data,
        )
        return self._named(outcome)

    def tare_step(
        self, limits: FloatArray, is_up: bool, strain: FloatArray, dynamic_pressure: float
    ) -> tuple[bool, Outcome]:
        """Take a step of a tare by steps in; return whether there are other zeros, and the outcome.

        Arguments are of one time, as of :meth:`tare`.
        """
        outcome, bounds, readings = self._new_outcome(), np.ascontiguousarray(limits), np.ascontiguousarray(strain)
        arguments = (bounds.ctypes.data, int(is_up), readings.ctypes.data, dynamic_pressure, outcome.ctypes.data)
        changed = self._library.sl_tare_step(self._handle, *arguments)
        return bool(changed), self._named(outcome)

    def tare_drop(self) -> Outcome:
        """Forget the zeros of tares by steps."""
        outcome = self._new_outcome()
        self._library.sl_tare_drop(self._handle, outcome.ctypes.data)
        return self._named(outcome)

    @property
    def tare_state(self) -> bytes:
        """A tare by steps, for :meth:`restore_tare`."""
        state = ctypes.create_string_buffer(self._tare_state_size)
        self._library.sl_tare_state(self._handle, state)
        return state.raw

    def restore_tare(self, state: bytes) -> Outcome:
        """Go on from what :attr:`tare_state` gave."""
        size, outcome = self._tare_state_size, self._new_outcome()
        if len(state) != size:
            raise InputError(f"tare: {len(state)} bytes found, must be {size}: it is of another map")
        if not self._library.sl_tare_restore(self._handle, state, outcome.ctypes.data, self._text):
            raise InputError(f"tare: {self._text.value.decode()}")
        return self._named(outcome)

    def _new_outcome(self) -> FloatArray:
        return np.empty(self._n_outcome)

    def _named(self, outcome: FloatArray) -> Outcome:
        return {name: outcome[place] for name, place in self.tare_outcome.items()}


@cache
def library() -> ctypes.CDLL:
    """Return the library of the compiled estimator for this machine.

    It is the shipped one if that was built from the installed C sources, else one that is made of them.

    Raises
    ------
    NoCoreError
        No library serves this machine, and there is no compiler to make one.
    """
    path, reason = library_file(), f"no library for {sys.platform} {platform.machine()}"
    if path.exists():
        native = path.parents[2]
        is_fmu = path.parents[1].name != BINARIES  # which has the library alone
        digest = "" if is_fmu else library_digest("estimator", native)
        if not is_of_sources(path.read_bytes(), digest):
            reason = f"{native.name}/{BINARIES}/{path.parent.name} has a library of other C sources"
            return _declared(ctypes.CDLL(str(development_library(native, reason))))
        try:
            return _declared(ctypes.CDLL(str(path)))
        except OSError as error:  # of another C library, musl
            reason += f" ({error})"
    return _declared(ctypes.CDLL(str(development_library(_native_folder(), reason))))


def library_file() -> Path:
    """Return the path of the shipped library for this machine, whether it is there or not."""
    machine = platform.machine().lower()
    folder = {
        ("linux", "x86_64"): "linux64",
        ("linux", "aarch64"): "aarch64-linux",
        ("win32", "amd64"): "win64",
        ("darwin", "x86_64"): "darwin64",
        ("darwin", "arm64"): "darwin64",
    }.get((sys.platform, machine), f"{sys.platform}-{machine}")
    name = Path(folder) / f"estimator{SUFFIX}"
    of_fmu = Path(__file__).parents[2] / LIBRARIES_OF_FMU
    return (of_fmu if of_fmu.is_dir() else _native_folder() / BINARIES) / name


def _declared(loaded: ctypes.CDLL) -> ctypes.CDLL:
    """Return ``loaded`` with the types of its functions."""
    pointer, size, text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
    number = ctypes.c_int
    for name, result, arguments in (
        ("sl_version", number, ()),
        ("sl_open", pointer, (text, size, text)),
        ("sl_close", None, (pointer,)),
        ("sl_size", size, (pointer, number)),
        ("sl_field", number, (pointer, number, size, pointer)),
        ("sl_set", number, (pointer, size, size, pointer, text)),
        ("sl_get", None, (pointer, size, size, pointer)),
        ("sl_renew", None, (pointer,)),
        ("sl_restart", None, (pointer,)),
        ("sl_series", None, (pointer, number, number, size, pointer, pointer, pointer, pointer, pointer)),
        ("sl_state", None, (pointer, text)),
        ("sl_restore", number, (pointer, text, text)),
        ("sl_tare", None, (pointer, pointer, size, pointer, pointer, pointer)),
        ("sl_tare_step", number, (pointer, pointer, number, pointer, ctypes.c_double, pointer)),
        ("sl_tare_drop", None, (pointer, pointer)),
        ("sl_tare_state", None, (pointer, text)),
        ("sl_tare_restore", number, (pointer, text, pointer, text)),
    ):
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    if loaded.sl_version() != VERSION:
        raise NoCoreError(f"the estimator's library has version {loaded.sl_version()}, must be {VERSION}")
    return loaded


def _native_folder() -> Path:
    """Return the folder of the C sources and of the libraries."""
    try:
        return Path(str(resources.files("fmus"))) / "native"
    except ModuleNotFoundError:
        raise NoCoreError(f"the compiled estimator: no library for {sys.platform} {platform.machine()}") from None
