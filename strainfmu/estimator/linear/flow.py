"""What is known of the flow in k samples: dynamic pressure and navigation, and whether a map holds for it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.arguments import given, per_sample
from strainfmu.estimator.linear.envelope import outside_by_navigation
from strainfmu.estimator.map.envelope import MAX_DYNAMIC_PRESSURE, MIN_DYNAMIC_PRESSURE, FlightRanges
from strainfmu.estimator.map.flow_parameters import PARAMETER_TOLERANCE, FlowParameters

_NAMES = ("dynamic_pressure", "dynamic_pressure_std", "mach_number", "altitude")


class Flow(NamedTuple):
    """Dynamic pressure and its deviation [Pa], Mach number [1] and altitude [m] of k samples, (k,) each; and the
    part of its range by which each further parameter leaves it (k, n_p) [1]."""

    dynamic_pressure: FloatArray
    dynamic_pressure_std: FloatArray
    mach_number: FloatArray
    altitude: FloatArray
    parameter_score: FloatArray

    def rows(self, rows: slice | IntArray) -> Flow:
        """Return the samples ``rows``."""
        return Flow(*[values[rows] for values in self])


def flow_of(
    values: tuple[ArrayLike, ...], known: FlowParameters, parameters: Mapping[str, ArrayLike] | None, samples: int
) -> Flow:
    """Return the flow of k samples: four ``values``, and ``parameters`` of those ``known`` to the map, by name.

    q_inf, Mach number and altitude are NaN where they are not given: 0, below, or NaN.

    Raises
    ------
    InputError
        One is no number or not one of each sample, or a parameter is unknown.
    """
    score = np.zeros((samples, len(known.names)))
    if parameters is not None:
        score = known.score(known.values(parameters, samples))
    pressure, std, mach, altitude = (per_sample(*one, samples) for one in zip(_NAMES, values, strict=True))
    pressure, mach, altitude = given(np.array([pressure, mach, altitude]))
    return Flow(pressure, std, mach, altitude, score)


def known_pressure(flow: Flow, relative_error: float) -> tuple[BoolArray, FloatArray]:
    """Return (k,) whether q_inf gives coefficients, and the standard deviation of its error [Pa], 0 where not.

    ``relative_error`` is that of a q_inf without a deviation.
    """
    q, std = flow.dynamic_pressure, flow.dynamic_pressure_std
    usable = (q >= MIN_DYNAMIC_PRESSURE) & (q <= MAX_DYNAMIC_PRESSURE)
    std = np.where(np.isnan(std), relative_error * np.where(usable, q, 0.0), std)
    known = usable & (std >= 0.0) & (std < np.inf)
    return known, np.where(known, std, 0.0)


def outside(ranges: FlightRanges, flow: Flow, pressure_std: FloatArray) -> BoolArray:
    """Return (k,) whether navigation or a further parameter says that the map does not hold."""
    by_navigation = outside_by_navigation(
        ranges,
        dynamic_pressure=flow.dynamic_pressure,
        dynamic_pressure_std=pressure_std,
        mach_number=flow.mach_number,
        altitude=flow.altitude,
    )
    return by_navigation | parameters_outside(flow) if flow.parameter_score.size else by_navigation


def parameters_outside(flow: Flow) -> BoolArray:
    """Return (k,) whether a further parameter leaves its range."""
    return np.any(flow.parameter_score > PARAMETER_TOLERANCE, axis=1)
