"""What a dynamic pressure is computed from, and measured angles: rules in numpy that the compiled core has too."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.atmosphere import DEVIATION_OF_AIR
from strainfmu.estimator.air_inputs import (
    AIR_INPUTS,
    ANGLE_ERROR,
    DYNAMIC_PRESSURE,
    LARGEST_ANGLE,
    MACH_NUMBER,
    MEASURED_ANGLES,
    Q_SOURCE,
    STATIC_PRESSURE,
    STD,
    QSource,
)
from strainfmu.estimator.arguments import given as positive
from strainfmu.estimator.signal_names import NOT_KNOWN

DAY_OF_MACH = 0.025
"""Relative standard deviation of a Mach number that no other measurement confirms.

The Mach number of a velocity is wrong by half of the day's 0.03 of temperature, and by winds of 0.02 of the
velocity.
"""

DAY_OF_PRESSURE = 0.03
"""Relative standard deviation of a static pressure that no other measurement confirms."""

LEAST_ANGLE_STD = 1e-4
"""Smallest standard deviation of a measured angle [rad]."""


def air_of(inputs: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return (k,) the air data of records (k, 1) by name, NaN where not given.

    Values are not given where they are 0 or below, angles where they are NOT_KNOWN.
    """
    return {
        item.name: np.where(np.equal(values, NOT_KNOWN), np.nan, values) if item.is_signed else positive(values)
        for item in AIR_INPUTS
        for values in (inputs[item.name][:, 0],)
    }


def pressure_source(air: Mapping[str, FloatArray]) -> IntArray:
    """Return (k,) the sources of the dynamic pressures, :class:`QSource` but for AUTO.

    What nothing states counts as computed from the Mach number, where that is ``given``, and from the static
    pressure, or else from an atmosphere. Inputs are (k,) by name, NaN where not given.
    """
    stated = np.nan_to_num(air[Q_SOURCE])
    computed = np.where(np.isnan(air[STATIC_PRESSURE]), QSource.MACH_AND_ALTITUDE, QSource.MACH_AND_PRESSURE)
    default = np.where(np.isnan(air[MACH_NUMBER]), QSource.INDEPENDENT, computed)
    return np.where(stated > 0.5, np.round(stated), default).astype(np.int64)


def computed_pressure_error(
    mach: FloatArray, mach_std: FloatArray, pressure_std: FloatArray | float
) -> FloatArray:
    """Return the relative standard deviation of a dynamic pressure from its sources' own."""
    return np.hypot(2.0 * mach_std / mach, pressure_std)


def computed_pressure_std(air: Mapping[str, FloatArray], own: FloatArray) -> FloatArray:
    """Return (k,) the sigma [Pa] of computed dynamic pressures, ``own`` from the sigma of their sources.

    A stated one counts where the source is stated, too; otherwise the larger.
    """
    stated, is_decided = air[f"{DYNAMIC_PRESSURE}{STD}"], np.nan_to_num(air[Q_SOURCE]) > 0.5
    return np.where(np.isnan(stated) | (~is_decided & (stated < own)), own, stated)


def linear_pressure_std(air: Mapping[str, FloatArray], dynamic_pressure_error: float) -> FloatArray:
    """Return (k,) the standard deviations [Pa] of the dynamic pressures that a linear map works with."""
    q, stated = air[DYNAMIC_PRESSURE], air[f"{DYNAMIC_PRESSURE}{STD}"]
    std = np.where(np.isnan(stated), dynamic_pressure_error * q, stated)
    mach = np.where(np.isnan(air[MACH_NUMBER]), 1.0, air[MACH_NUMBER])
    stated_mach = air[f"{MACH_NUMBER}{STD}"]
    no_mach = np.isnan(stated_mach) | np.isnan(air[MACH_NUMBER])
    mach_std = np.where(no_mach, DAY_OF_MACH * mach, stated_mach)
    relative = air[f"{STATIC_PRESSURE}{STD}"] / air[STATIC_PRESSURE]
    pressure_std = np.where(np.isnan(relative), DAY_OF_PRESSURE, relative)
    with np.errstate(invalid="ignore"):  # q and M may be infinite
        source = pressure_source(air)
        of_pressure = np.where(source == QSource.MACH_AND_ALTITUDE, DEVIATION_OF_AIR, pressure_std)
        own = q * computed_pressure_error(mach, mach_std, of_pressure)
    return np.where(source == QSource.INDEPENDENT, std, computed_pressure_std(air, own))


def measured_directions(air: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return (k, 2) components u and w of the flow direction [rad] by the measured angles, and their sigma.

    The standard deviation of a component that is not measured is infinite; it counts as 0 for the other one.
    """
    angles = np.column_stack([air[name] for name in MEASURED_ANGLES])
    stated = np.column_stack([air[f"{name}{STD}"] for name in MEASURED_ANGLES])
    known = np.abs(angles) < LARGEST_ANGLE
    alpha, beta = np.where(known, angles, 0.0).T
    along, up, starboard = np.cos(beta) * np.cos(alpha), np.cos(beta) * np.sin(alpha), -np.sin(beta)
    across = np.hypot(up, starboard)
    ratio = np.where(across > 0.0, np.arctan2(across, along) / np.where(across > 0.0, across, 1.0), 1.0)
    std = np.where(np.isnan(stated), ANGLE_ERROR, np.maximum(stated, LEAST_ANGLE_STD))
    return np.column_stack([ratio * up, ratio * starboard]), np.where(known, std, np.inf)


def angles_contradict(
    air: Mapping[str, FloatArray],
    *,
    slope: float,
    force: FloatArray,
    force_std: FloatArray,
    limit: float,
) -> BoolArray:
    """Return (k,) whether the flow comes from another side by the measured angles than by the lateral forces.

    Parameters
    ----------
    slope : minimum incidence per lateral coefficient [rad]; 0 for no test.
    force, force_std : (k, 2) C_N and C_Y, and their standard deviations.
    limit : largest square of the standardised difference.
    """
    value, std = measured_directions(air)
    known = np.isfinite(std)
    need = np.where(known, slope * force, 0.0)
    size = np.linalg.norm(need, axis=1)
    part = np.divide(need, size[:, None], out=np.zeros_like(need), where=size[:, None] > 0.0)
    apart = size - (part * value).sum(axis=1)
    own = np.where(known, std, 0.0) ** 2 + (slope * np.nan_to_num(force_std)) ** 2
    variance = (part**2 * np.where(known, own, 0.0)).sum(axis=1)
    return (size > 0.0) & (apart > 0.0) & (apart**2 > limit * variance)
