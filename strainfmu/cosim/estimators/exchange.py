"""The inputs and outputs of an estimator's FMU, which one call of compiled code moves in a step."""

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.systems.instance import Instance, SignalBlock
from strainfmu.estimator.air_inputs import ANGLE_ERROR
from strainfmu.estimator.core import library

EXCHANGE = np.dtype(
    [
        *((name, "u8") for name in ("move", "reference", "value", "place")),
        *((name, "i4") for name in ("n", "is_whole", "is_output", "is_given")),
    ]
)
"""``SbExchange``."""

ESTIMATOR = np.dtype(
    [
        *((name, "u8") for name in ("component", "step", "exchange", "input", "output", "angle")),
        *((name, "f8") for name in ("angle_error", "time")),
        *((name, "i4") for name in ("n_exchanges", "n_angles")),
    ]
)
"""``SbEstimator``."""

_STATUSES = 8
"""What compiled code multiplies the number of a call by, to put the status of FMI behind it."""


class Record:
    """A record of compiled code, and the arrays whose addresses it holds, by the name of the field."""

    def __init__(self, kind: np.dtype[Any]) -> None:
        self.record = np.zeros(1, dtype=kind)
        self.arrays: dict[str, np.ndarray] = {}

    def set(self, **arrays: np.ndarray) -> None:
        """Let fields be the addresses of ``arrays``."""
        self.arrays |= arrays
        for name, array in arrays.items():
            self.record[name] = array.ctypes.data

    def numbers(self, name: str, kind: str) -> memoryview:
        """Return a field, in which a number is read and written at once."""
        return self.record[name].view(kind).data


class FmuExchange:
    """One step of an FMU with all its inputs and outputs.

    Parameters
    ----------
    inputs, outputs : the blocks of variables.
    given, taken : vectors of all values in and out, in which the blocks have their columns.
    angle_stds : places of the standard deviations of angles, which are ANGLE_ERROR where they are not above 0.

    Attributes
    ----------
    record : ``SbEstimator``.
    """

    def __init__(
        self,
        instance: Instance,
        inputs: Sequence[SignalBlock],
        outputs: Sequence[SignalBlock],
        given: FloatArray,
        taken: FloatArray,
        angle_stds: Sequence[int],
    ) -> None:
        blocks = [*inputs, *outputs]
        self._instance, self._blocks, self._vectors = instance, blocks, (given, taken)
        table = np.zeros(len(blocks), dtype=EXCHANGE)
        self._places = [block.columns.astype(np.int32) for block in blocks]
        for number, (row, block, places) in enumerate(zip(table, blocks, self._places, strict=True)):
            is_output = number >= len(inputs)
            is_in_place = block.buffer.base is (taken if is_output else given)
            row["move"], row["reference"] = block.address, ctypes.addressof(block.references)
            row["value"], row["place"] = block.buffer.ctypes.data, 0 if is_in_place else places.ctypes.data
            row["n"], row["is_output"] = len(block.buffer), is_output
            row["is_whole"] = block.buffer.dtype != np.float64
        self._table, self._angles = table, np.array([*angle_stds, 0], dtype=np.int32)
        self.record = np.zeros(1, dtype=ESTIMATOR)
        step = self.record[0]
        step["component"], step["step"] = instance.component, instance.address_of("fmi2DoStep")
        step["exchange"], step["angle"] = table.ctypes.data, self._angles.ctypes.data
        step["input"], step["output"] = given.ctypes.data, taken.ctypes.data
        step["angle_error"], step["n_exchanges"], step["n_angles"] = ANGLE_ERROR, len(blocks), len(angle_stds)
        self._size = ctypes.c_double()
        self._call: Any = library().sb_step
        self._arguments = ctypes.c_void_p(self.record.ctypes.data), ctypes.byref(self._size)

    def step(self, step_size: float) -> None:
        """Do a step of ``step_size`` [s]; raise what a bad status of FMI means."""
        self._size.value = step_size
        if failed := self._call(*self._arguments):
            self.check(failed)

    def check(self, failed: int) -> None:
        """Raise what the number means that compiled code returned for a step."""
        number, status = divmod(failed, _STATUSES)
        names = [*(block.function for block in self._blocks), "fmi2DoStep"]
        self._instance.check(names[number], status)
