"""One FMI 2.0 co-simulation instance behind preallocated arrays, driven through fmpy."""

import ctypes
import os
import platform
import re
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strainfmu.archive import check_unpacked_size
from strainfmu.errors import InputError, StrainfmuError, library

# PythonFMU ends the process where the path of the unzipped FMU holds anything else.
_SAFE_PATH = re.compile(r"[A-Za-z0-9 ._~:/\\-]*")

# FMI's logger is variadic. ctypes has no such callbacks, but where variadic arguments lie as fixed ones do, on all
# but Apple's ARM processors, a sixth argument is the first of them.
_LOGGER = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_void_p
)
_VARIADIC_AS_FIXED = not (platform.system() == "Darwin" and platform.machine() == "arm64")

_FMI2_WARNING, _FMI2_ERROR, _FMI2_FATAL = 1, 3, 4
_STATUS_NAMES = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")


def import_fmpy() -> Any:
    """Return the package fmpy.

    Raises
    ------
    StrainfmuError
        It is not installed.
    """
    *_, fmpy = (library(name, "FMPy", "fmu") for name in ("fmpy.fmi2", "fmpy.model_description", "fmpy"))
    return fmpy


def safe_temporary_parent(candidates: Sequence[Path] | None = None) -> Path:
    """Return a folder for temporary files whose path every FMU can bear.

    Raises
    ------
    StrainfmuError
        There is none.
    """
    default = (Path(tempfile.gettempdir()), Path("/tmp"), Path("/var/tmp"), Path("C:/Users/Public"))
    candidates = default if candidates is None else candidates
    for folder in candidates:
        if folder.is_dir() and _SAFE_PATH.fullmatch(str(folder.resolve())):
            return folder.resolve()
    raise StrainfmuError(
        f"{candidates[0]}: FMUs cannot be unzipped where the path holds more than letters from A to Z, "
        "digits, blanks and . _ - ~; set TMPDIR to another folder"
    )


def described(path: Path) -> Any:
    """Return fmpy's ModelDescription of any FMU at ``path``.

    Raises
    ------
    InputError
        The FMU is missing, damaged or larger than FMUs are.
    """
    fmpy = import_fmpy()
    if not path.is_file():
        raise InputError(f"{path}: no such FMU")
    check_unpacked_size(path)
    try:
        return fmpy.read_model_description(str(path), validate=False)
    except Exception as error:  # fmpy raises whatever its zip and XML readers do
        raise InputError(f"{path}: damaged, or not an FMU") from error


def read_description(path: str | PathLike[str]) -> Any:
    """Return fmpy's ModelDescription of the FMU at ``path``.

    Raises
    ------
    InputError
        The FMU is missing, damaged, larger than FMUs are, or not of FMI 2.0 co-simulation.
    """
    description = described(Path(path))
    if description.fmiVersion != "2.0" or description.coSimulation is None:
        raise InputError(
            f"{path}: expected an FMU for FMI 2.0 co-simulation, got FMI {description.fmiVersion}; an estimator's "
            "is written by 'strainfmu export' without --fmi 3"
        )
    return description


def unzip(path: Path, folder: Path) -> None:
    """Unzip the FMU at ``path`` into ``folder``.

    Raises
    ------
    InputError
        The FMU is damaged, or larger than FMUs are.
    StrainfmuError
        The operating system refused (disk full, ...).
    """
    check_unpacked_size(path)
    try:
        import_fmpy().extract(str(path), unzipdir=str(folder))
    except OSError as error:
        raise StrainfmuError(f"{path}: could not be unzipped: {error.strerror or error}") from error
    except (zipfile.BadZipFile, ValueError, RuntimeError, EOFError) as error:
        raise InputError(f"{path}: damaged, cannot be unzipped") from error
    except Exception as error:  # zlib.error, and fmpy's plain Exception for forbidden paths
        raise InputError(f"{path}: damaged, cannot be unzipped: {error}") from error


@dataclass(frozen=True, eq=False)
class SignalBlock:
    """Variables of one FMI type, exchanged by one call.

    Attributes
    ----------
    call : the FMI function, checked, with component, value references and buffer bound.
    function, address, references : name and address of that function, and the value references in C.
    buffer : (k,) values, exchanged in place.
    columns : (k,) where they lie in the master's vector of all signals.
    """

    call: Callable[[], None]
    buffer: NDArray[Any]
    columns: NDArray[np.intp]
    function: str
    address: int
    references: Any


class Instance:
    """A loaded FMU instance; every FMI status above fmi2Warning becomes a one-line StrainfmuError.

    Raises
    ------
    StrainfmuError
        The FMU has no binary for this machine, or cannot be instantiated; the message holds its own words.
    """

    def __init__(self, name: str, path: Path, description: Any, folder: Path) -> None:
        self.name, self.path, self.description = name, path, description
        self._folder = f"{folder}{os.sep}"
        self._messages: list[str] = []
        self._dead = self._initialized = False
        self._fmi2 = import_fmpy().fmi2
        working_directory = os.getcwd()
        try:
            self._fmu = self._fmi2.FMU2Slave(
                guid=description.guid,
                modelIdentifier=description.coSimulation.modelIdentifier,
                unzipDirectory=str(folder),
                instanceName=name,
            )
        except Exception as error:  # fmpy raises plain Exceptions, and stays in the FMU's folder
            os.chdir(working_directory)
            raise StrainfmuError(f"{path}: cannot be loaded on this machine: {self._said(error)}") from error
        try:
            self._fmu.instantiate(callbacks=self._callbacks(), loggingOn=True)
        except Exception as error:
            self._fmu.freeLibrary()
            reason = self._messages[-1] if self._messages else self._said(error)
            raise StrainfmuError(f"{path}: instance '{name}' cannot be instantiated: {reason}") from error

    def _callbacks(self) -> Any:
        """Return FMI's callbacks with a logger that keeps the last messages."""
        fmi2 = self._fmi2

        def log(_: Any, __: Any, status: int, ___: Any, message: bytes | None, first: int | None) -> None:
            if status >= _FMI2_WARNING and message:
                # What a careful FMU passes, so that no % in its text is taken for a format.
                if message == b"%s" and first and _VARIADIC_AS_FIXED:
                    message = ctypes.string_at(first)
                self._messages.append(self._said(message.decode("utf-8", "replace")))
                del self._messages[:-5]

        self._log = _LOGGER(log)  # kept alive, as the struct holds its address alone
        # The struct keeps the other ctypes closures alive, and fmpy the struct.
        return fmi2.fmi2CallbackFunctions(
            ctypes.cast(self._log, fmi2.fmi2CallbackLoggerTYPE),
            fmi2.fmi2CallbackAllocateMemoryTYPE(import_fmpy().calloc),
            fmi2.fmi2CallbackFreeMemoryTYPE(import_fmpy().free),
            fmi2.fmi2StepFinishedTYPE(0),
            None,
        )

    def _said(self, text: object) -> str:
        """Return text in one line, files of the FMU by their names in it, not in the folder that goes again."""
        return _one_line(text).replace(self._folder, "")

    def check(self, function: str, status: int, when: str = "") -> None:
        """Turn a bad status into an error that holds the FMU's own words."""
        if status <= _FMI2_WARNING:
            return
        self._dead = self._dead or status == _FMI2_FATAL
        self._initialized = self._initialized and status < _FMI2_ERROR
        reason = f": {self._messages[-1]}" if self._messages else ", without a message"
        raise StrainfmuError(
            f"{self.path}: instance '{self.name}': {function} returned {_STATUS_NAMES[status]}{when}{reason}"
        )

    def _function(self, name: str) -> Any:
        """Return the bare C function, without fmpy's work per call."""
        return getattr(self._fmu.dll, name)

    def _unconverted(self, name: str) -> Any:
        """Return the bare C function for arguments that are ctypes' own and of its types: it converts none."""
        return self._fmu.dll[name]

    def address_of(self, name: str) -> int:
        """Return the address of a C function."""
        return ctypes.cast(self._unconverted(name), ctypes.c_void_p).value or 0

    @property
    def component(self) -> int:
        """The instance's address."""
        address: int = self._fmu.component
        return address

    def _component(self) -> Any:
        """Return the instance's address as such an argument."""
        return ctypes.byref(ctypes.c_char.from_address(self._fmu.component))

    def block(
        self,
        direction: str,
        variables: Sequence[Any],
        columns: Sequence[int],
        vector: NDArray[np.float64] | None = None,
    ) -> list[SignalBlock]:
        """Return the blocks that get ("Get") or set ("Set") ``variables``, one per FMI type.

        Parameters
        ----------
        columns : index of each variable in the master's vector of all signals.
        vector : that vector, contiguous; Reals that lie side by side in it are exchanged in place, so that the
            buffer is a part of it. None for buffers of their own.
        """
        blocks = []
        for kind, fmi_types in (
            ("Real", {"Real"}),
            ("Integer", {"Integer", "Enumeration"}),
            ("Boolean", {"Boolean"}),
        ):
            chosen = [
                (v.valueReference, c) for v, c in zip(variables, columns, strict=True) if v.type in fmi_types
            ]
            if chosen:
                references, columns_of = zip(*chosen, strict=True)
                function, places = f"fmi2{direction}{kind}", np.array(columns_of)
                is_run = vector is not None and kind == "Real" and bool((np.diff(places) == 1).all())
                shared = vector[places[0] : places[0] + len(places)] if vector is not None and is_run else None
                blocks.append(self._one_block(function, references, places, shared))
        return blocks

    def _one_block(
        self,
        function: str,
        references: Sequence[int],
        columns: NDArray[np.intp],
        buffer: NDArray[Any] | None = None,
    ) -> SignalBlock:
        """Return a block whose call does nothing but the FMI call and its status check."""
        real = function.endswith("Real")
        n = len(references)
        value_references = (ctypes.c_uint * n)(*references)
        if buffer is None:
            buffer = np.zeros(n, dtype=np.float64 if real else np.int32)
        values = (ctypes.c_double * n if real else ctypes.c_int * n).from_buffer(buffer.data)
        # Made ready once, as all that is converted in every call takes longer than the call.
        component, count = self._component(), ctypes.c_size_t.from_param(n)
        first_reference, first_value = ctypes.byref(value_references), ctypes.byref(values)
        c_function = self._unconverted(function)

        def call() -> None:
            status = c_function(component, first_reference, count, first_value)
            if status:
                self.check(function, status)

        return SignalBlock(call, buffer, columns, function, self.address_of(function), value_references)

    def begin(self, stop_time: float) -> None:
        """Enter initialization mode of an experiment from 0 to ``stop_time`` [s]."""
        component = self._fmu.component
        self.check(
            "fmi2SetupExperiment", self._function("fmi2SetupExperiment")(component, 0, 0.0, 0.0, 1, stop_time)
        )
        self.check("fmi2EnterInitializationMode", self._function("fmi2EnterInitializationMode")(component))

    def end_initialization(self) -> None:
        """Leave initialization mode."""
        self.check("fmi2ExitInitializationMode", self._function("fmi2ExitInitializationMode")(self._fmu.component))
        self._initialized = True

    def stepper(self) -> Callable[[float, float], None]:
        """Return the step: a function of current communication point and step size [s]."""
        do_step, component = self._unconverted("fmi2DoStep"), self._component()
        start, size, no_going_back = ctypes.c_double(), ctypes.c_double(), ctypes.c_int.from_param(1)

        def step(time: float, step_size: float) -> None:
            start.value, size.value = time, step_size
            status = do_step(component, start, size, no_going_back)
            if status:
                self.check("fmi2DoStep", status, f" at time {time:.6g} s")

        return step

    def close(self) -> None:
        """Terminate and free the instance as far as its state allows (FMI 2.0, 4.2.4); never raises."""
        # After fmi2Fatal no call is allowed, not even to free: the library stays loaded.
        if self._dead:
            return
        component = self._fmu.component
        if self._initialized and self._function("fmi2Terminate")(component) >= _FMI2_FATAL:
            self._dead = True
            return
        self._function("fmi2FreeInstance")(component)
        self._fmu.freeLibrary()
        self._dead = True


def _one_line(text: object) -> str:
    """Return ``text`` on one line."""
    return " ".join(str(text).split())
