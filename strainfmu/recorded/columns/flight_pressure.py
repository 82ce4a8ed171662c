"""Dynamic pressure from the Mach number, where a recording does not hold it: q = gamma/2 p M^2.

p is the static pressure that was measured, or the pressure of the US Standard Atmosphere 1976 at the altitude.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, static_pressure_at
from strainfmu.estimator.air_inputs import ALTITUDE, MACH_NUMBER, STATIC_PRESSURE
from strainfmu.estimator.arguments import given


def pressure_sources(held: Collection[str]) -> tuple[str, ...]:
    """Return which of the quantities ``held`` q_inf is computed from; nothing if they do not suffice."""
    if MACH_NUMBER not in held:
        return ()
    return next(((MACH_NUMBER, one) for one in (STATIC_PRESSURE, ALTITUDE) if one in held), ())


def computed_pressure(flow: Mapping[str, FloatArray]) -> FloatArray:
    """Return (n,) q_inf [Pa] by the sources of ``flow`` [1, Pa, m]; NaN where one is not given, 0 at rest."""
    _, other = pressure_sources(flow)
    mach, stated = flow[MACH_NUMBER], given(flow[other])
    static = stated if other == STATIC_PRESSURE else static_pressure_at(stated)
    return np.asarray(np.where(mach == 0.0, 0.0, 0.5 * HEAT_CAPACITY_RATIO * static * given(mach) ** 2))


def flown_pressure(dynamic_pressure: FloatArray, flow: Mapping[str, FloatArray]) -> FloatArray:
    """Return (n,) ``dynamic_pressure`` [Pa], where it is not known by the Mach number; NaN where neither is."""
    unknown = np.isnan(dynamic_pressure)
    if not pressure_sources(flow) or not unknown.any():
        return dynamic_pressure
    return np.where(unknown, computed_pressure(flow), dynamic_pressure)


def pressure_note(sources: tuple[str, ...]) -> str:
    """Return how q_inf was computed from its ``sources``, and what that costs."""
    if STATIC_PRESSURE in sources:
        return "no dynamic_pressure found: computed from mach_number and static_pressure, gamma/2 p M^2"
    return (
        "no dynamic_pressure found: computed from mach_number and altitude, gamma/2 p M^2 with p of the US "
        "Standard Atmosphere 1976; a day's air differs from it by several percent: state dynamic_pressure_std"
    )


def navigation_note(held: Collection[str]) -> str:
    """Return what the nonlinear estimator knows of the flow without q_inf, of the quantities ``held``."""
    pressure = next((one for one in (STATIC_PRESSURE, ALTITUDE) if one in held), None)
    known = [one for one in (MACH_NUMBER, pressure) if one in held]
    if not known:
        return "no dynamic_pressure found: estimated from strain alone"
    return f"no dynamic_pressure found: estimated with {' and '.join(map(str, known))} as navigation"
