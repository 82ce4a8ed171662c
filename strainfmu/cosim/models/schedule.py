"""Signals over time that jump at given times: commands and gauge faults, as an FMU that any engine can run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.interface.fmi_variables import Variable


@dataclass(frozen=True)
class ScheduledSignal:
    """One signal: ``values[k]`` from ``times[k]`` [s] on, the first from the start.

    Attributes
    ----------
    variable : the output that carries it; values are in its unit.
    """

    variable: Variable
    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.times) != len(self.values) or not self.times or not np.all(np.diff(self.times) > 0.0):
            raise InputError(f"schedule: the times of {self.variable.name} must increase, one value each")
        if not np.all(np.isfinite([*self.times, *self.values])):
            raise InputError(f"schedule: {self.variable.name} holds a value that is not finite")


def schedule_interface(signals: Sequence[ScheduledSignal]) -> tuple[Variable, ...]:
    """Return the variables of the schedule FMU in the order of their value references."""
    return tuple(signal.variable for signal in signals)


def schedule_data(signals: Sequence[ScheduledSignal]) -> FloatArray:
    """Return rows of time [s] and a value per signal, as schedule.c reads them."""
    times = sorted({0.0, *(time for signal in signals for time in signal.times)})
    columns = [[value_at(signal, time) for time in times] for signal in signals]
    return np.column_stack((times, *columns)).ravel()


def value_at(signal: ScheduledSignal, time: float) -> float:
    """Return the value of a signal at ``time`` [s], in its unit."""
    index = int(np.searchsorted(signal.times, time, side="right")) - 1
    return signal.values[max(index, 0)]
