"""A co-simulation in fmpy with a stop time, of FMI 2.0 or 3.0, that keeps what the FMU logs."""

from collections.abc import Mapping, Sequence
from ctypes import CFUNCTYPE, c_char_p, c_int, c_void_p, cast, string_at
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave

LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_void_p)
"""Logger of FMI 2.0 with its first variadic argument, which lies where a fixed argument does on Linux."""


class Experiment:
    """A co-simulation from 0 s to ``stop_time``.

    Attributes
    ----------
    messages : that the FMU has logged.
    descriptions : of its variables by name.
    """

    def __init__(self, path: Path, folder: Path, stop_time: float | None = None) -> None:
        description = fmpy.read_model_description(str(path))
        fmpy.extract(str(path), str(folder))
        self.messages: list[str] = []
        self.descriptions = {v.name: v.description for v in description.modelVariables}
        self._references = {v.name: v.valueReference for v in description.modelVariables}
        self.is_second = description.fmiVersion == "2.0"
        arguments = {
            "guid": description.guid,
            "modelIdentifier": description.coSimulation.modelIdentifier,
            "unzipDirectory": str(folder),
            "instanceName": "x",
        }
        self.fmu: Any = (FMU2Slave if self.is_second else FMU3Slave)(**arguments)
        if self.is_second:
            callbacks = fmi2CallbackFunctions()
            # Not fmpy's proxy: it calls the last callback that it was given for all FMUs of the process.
            self._logger = LOGGER(self._log_variadic)
            callbacks.logger = cast(self._logger, fmi2CallbackLoggerTYPE)
            self.fmu.instantiate(callbacks=callbacks, loggingOn=True)
            self.fmu.setupExperiment(startTime=0.0, stopTime=stop_time)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.instantiate(
                loggingOn=True, logMessage=lambda *message: self.messages.append(message[3].decode())
            )
            self.fmu.enterInitializationMode(startTime=0.0, stopTime=stop_time)
        self.fmu.exitInitializationMode()

    def _log_variadic(self, *message: Any) -> None:
        text = message[4]
        self.messages.append((string_at(message[5]) if text == b"%s" else text).decode())

    def _log(self, _: object, status: int, category: bytes, text: bytes) -> None:
        self.messages.append(text.decode())

    def step(self, time: float, size: float) -> int:
        """Status of a step."""
        try:
            self.fmu.doStep(time, size)
        except FMICallException as error:
            return int(error.status)
        return 0

    def set(self, values: Mapping[str, float]) -> None:
        """Set real inputs by name."""
        setter = self.fmu.setReal if self.is_second else self.fmu.setFloat64
        setter([self._references[name] for name in values], list(values.values()))

    def get(self, names: Sequence[str]) -> list[float]:
        """Real outputs by name."""
        getter = self.fmu.getReal if self.is_second else self.fmu.getFloat64
        return list(getter([self._references[name] for name in names]))

    def end(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
