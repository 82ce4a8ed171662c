"""An estimator under comparison: readings in; coefficients, air data and pressure field out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol

import numpy as np

from builder.compare.field import estimated_fields
from builder.compare.flights import Readings, one_condition
from builder.trial.bound import KNOWN
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_data import AIR_DATA_NAMES
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE, QSource
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

GIVEN, PRESSURE_ALONE, NO_DYNAMIC_PRESSURE = "given", "q_inf only", "M and p_inf only"
NAVIGATION = (GIVEN, PRESSURE_ALONE)
"""What an estimator is given in addition to strain: q_inf, M and p_inf; or q_inf alone. Without q_inf only the
nonlinear estimator has coefficients: what it says of q_inf is scored there."""

STATED = {
    GIVEN: KNOWN,
    PRESSURE_ALONE: (DYNAMIC_PRESSURE,),
    NO_DYNAMIC_PRESSURE: (MACH_NUMBER, STATIC_PRESSURE),
}
"""What is stated with each, by the names of the estimator's arguments."""

AIR_DATA = ("angle_of_attack", "sideslip_angle", MACH_NUMBER, STATIC_PRESSURE, DYNAMIC_PRESSURE)
"""Air data that are compared, in this order."""

STEPS = 31
"""Steps that the cost of one is the median of."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Answer:
    """Estimates of k readings.

    Attributes
    ----------
    coefficients, std : (k, 5) with one standard deviation, or a third of a band for 3 sigma.
    rolling : (k, 2) M_R and its standard deviation [1]; None where it is not estimated.
    air_data : (k, 5) of :data:`AIR_DATA` [rad, rad, 1, Pa, Pa], NaN for what is not estimated; None for none.
    field : (k, n_p) pressure at the nodes of the map [Pa]; None for none.
    """

    coefficients: FloatArray
    std: FloatArray
    rolling: FloatArray | None = None
    air_data: FloatArray | None = None
    field: FloatArray | None = None


class Candidate(Protocol):
    """An estimator under comparison.

    Attributes
    ----------
    has_field : whether it gives the pressure field.
    takes_one_reading : whether its answer is of the last reading alone.
    """

    name: str
    has_field: bool
    takes_one_reading: bool

    def answer(self, read: Readings, navigation: str) -> Answer:
        """Return the estimates of ``read`` with ``navigation``, as in :data:`NAVIGATION`."""
        ...

    def step_microseconds(self, read: Readings, navigation: str) -> float:
        """Return the time of one step [us] in this process, from the readings of one condition."""
        ...


class LinearCandidate:
    """A linear map. Navigation decides on its health alone, but a field of p - p_inf needs p_inf."""

    has_field, takes_one_reading = True, True

    def __init__(self, name: str, inverse_map: InverseMap) -> None:
        self.name, self.inverse_map = name, inverse_map
        self.estimator = Estimator(inverse_map.without_tables())

    def answer(self, read: Readings, navigation: str) -> Answer:
        """Return the estimates; without navigation there is no field where the map's is p - p_inf."""
        found = self.estimator.estimate(
            read.last, read.dynamic_pressure, dynamic_pressure_std=read.dynamic_pressure_std
        )
        is_known = navigation == GIVEN or not self.inverse_map.field_is_net
        field = estimated_fields(found, read.static_pressure) if is_known else None
        return Answer(
            coefficients=found.coefficients, std=found.coefficients_std, rolling=_rolling(found), field=field
        )

    def step_microseconds(self, read: Readings, navigation: str) -> float:
        """Return the median time of a step."""
        one = one_condition(read)
        strain, q = one.last[0], float(one.dynamic_pressure[0])
        return median_microseconds(
            lambda: self.estimator.step(strain, q, dynamic_pressure_std=read.dynamic_pressure_std)
        )


class NonlinearCandidate:
    """The nonlinear estimator, each reading on its own."""

    name = "nonlinear"
    has_field, takes_one_reading = True, True

    def __init__(self, inverse_map: InverseMap) -> None:
        self.estimator = Estimator(inverse_map)

    def answer(self, read: Readings, navigation: str) -> Answer:
        """Return the estimates of a search of the tables; air data have errors of their own."""
        known = navigation != PRESSURE_ALONE
        found = self.estimator.estimate(
            read.last,
            np.nan if navigation == NO_DYNAMIC_PRESSURE else read.dynamic_pressure,
            dynamic_pressure_std=read.dynamic_pressure_std,
            mach_number=read.mach_number if known else np.nan,
            static_pressure=read.static_pressure if known else np.nan,
            q_source=float(QSource.INDEPENDENT),
        )
        columns = [AIR_DATA_NAMES.index(name) for name in AIR_DATA]
        return Answer(
            coefficients=found.coefficients,
            std=found.coefficients_std,
            rolling=_rolling(found),
            air_data=found.air_data.value[:, columns],
            field=estimated_fields(found, read.static_pressure),
        )

    def step_microseconds(self, read: Readings, navigation: str) -> float:
        """Return the median time of a step from the last one's state."""
        one, known = one_condition(read), navigation != PRESSURE_ALONE
        q = np.nan if navigation == NO_DYNAMIC_PRESSURE else float(one.dynamic_pressure[0])

        def step() -> object:
            return self.estimator.track(
                one.last[0],
                q,
                dynamic_pressure_std=read.dynamic_pressure_std,
                mach_number=float(one.mach_number[0]) if known else np.nan,
                static_pressure=float(one.static_pressure[0]) if known else np.nan,
                q_source=float(QSource.INDEPENDENT),
            )

        return median_microseconds(step)


def _rolling(found: Estimate) -> FloatArray | None:
    if not found.other_coefficients.shape[-1]:
        return None
    return np.column_stack([found.M_R, found.sigma.M_R])


def median_microseconds(step: Callable[[], object]) -> float:
    """Return the median time of ``step()`` over :data:`STEPS` calls [us], after one that does not count."""
    step()
    times = []
    for _ in range(STEPS):
        start = perf_counter()
        step()
        times.append(perf_counter() - start)
    return 1e6 * float(np.median(times))
