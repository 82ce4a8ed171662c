"""Air data: what is known of the flight state in addition to strain, what q_inf is computed from, and how an
estimate judges them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import log

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.atmosphere import (
    DEVIATION_OF_AIR,
    HEAT_CAPACITY_RATIO,
    LAYERS,
    pressure_and_temperature,
    static_pressure_at,
)
from strainfmu.estimator.air_inputs import (
    AIR_INPUTS,
    ALTITUDE,
    ANGLE_ERROR,
    DYNAMIC_PRESSURE,
    LARGEST_ANGLE,
    MACH_NUMBER,
    MEASURED_ANGLES,
    NAVIGATION,
    Q_SOURCE,
    STATIC_PRESSURE,
    STATIC_TEMPERATURE_ERROR,
    STD,
    TOTAL_TEMPERATURE,
    TOTAL_TEMPERATURE_ERROR,
    QSource,
)
from strainfmu.estimator.arguments import positive
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, MIN_INCIDENCE, N_STATES, U, W
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.signal_names import NOT_KNOWN

N_AIR, LEAST_RELATIVE_STD = 3, 1e-3
"""Number of air data, and their smallest standard deviation over the value."""

UNLIKELY_PRESSURE = 1.5
"""|z| from which a static pressure that no other measurement confirms is doubted."""

DISCERNED = 16.0
"""Difference of z squared up to which another one is doubted; any is where the dropped one is no alarm."""


DAY_OF_MACH = 0.025
"""Relative standard deviation of a Mach number that no other measurement confirms.

The Mach number of a velocity is wrong by half of the day's 0.03 of temperature, and by winds of 0.02 of the
velocity.
"""

DAY_OF_PRESSURE = 0.03
"""Relative standard deviation of a static pressure that no other measurement confirms."""

LEAST_ANGLE_STD = 1e-4
"""Smallest standard deviation of a measured angle [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AirInputs:
    """M [1], p_inf [Pa] and q_inf [Pa] as far as they are known, ``value`` and ``std`` (3,), NaN for unknown.

    ``is_computed`` states whether q_inf was computed from the others, so that it is none; ``of_loads`` are that
    q_inf and its standard deviation [Pa], for loads of the linear map; ``direction`` and
    ``direction_std`` (2,) are u and w [rad] by measured angles, of infinite standard deviation where not known.
    """

    value: FloatArray
    std: FloatArray
    is_computed: bool = False
    of_loads: tuple[float, float] = (np.nan, np.nan)
    direction: FloatArray = field(default_factory=lambda: np.zeros(2))
    direction_std: FloatArray = field(default_factory=lambda: np.full(2, np.inf))

    @property
    def log_std(self) -> FloatArray:
        """(3,) standard deviations of M, ln p_inf and ln q_inf."""
        return self.std / np.append(1.0, self.value[1:])

    @property
    def log_value(self) -> FloatArray:
        """(3,) M, ln p_inf and ln q_inf."""
        return np.append(self.value[0], np.log(self.value[1:]))


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


def computed_pressure_std(air: Mapping[str, FloatArray], by_sources: FloatArray) -> FloatArray:
    """Return (k,) the sigma [Pa] of computed dynamic pressures, ``by_sources`` from the sigma of their sources.

    A stated one counts where the source is stated, too; otherwise the larger.
    """
    stated, is_decided = air[f"{DYNAMIC_PRESSURE}{STD}"], np.nan_to_num(air[Q_SOURCE]) > 0.5
    return np.where(np.isnan(stated) | (~is_decided & (stated < by_sources)), by_sources, stated)


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
        by_sources = q * computed_pressure_error(mach, mach_std, of_pressure)
    return np.where(source == QSource.INDEPENDENT, std, computed_pressure_std(air, by_sources))


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


def air_inputs(inverse_map: InverseMap, value: FloatArray, std: FloatArray, altitude: float = np.nan) -> AirInputs:
    """Return M, p_inf and q_inf with the standard deviations of the map where ``std`` (3,) is NaN.

    A p_inf that is not known is taken from the standard atmosphere at ``altitude`` [m], with its own standard
    deviation.
    """
    manifold = inverse_map.manifold
    assert manifold is not None
    value, by_altitude = np.array(value), bool(np.isnan(value[1]))
    if by_altitude:
        value[1] = static_pressure_at(np.array([altitude]))[0]
    relative = manifold.altitude_error if by_altitude else manifold.static_pressure_error
    of_map = [manifold.mach_number_error, relative * value[1], manifold.dynamic_pressure_error * value[2]]
    used_std = np.maximum(np.where(np.isnan(std), of_map, std), LEAST_RELATIVE_STD * np.abs(value))
    known = np.isfinite(value) & (value > 0.0) & np.isfinite(used_std) & (used_std > 0.0)
    return AirInputs(value=np.where(known, value, np.nan), std=np.where(known, used_std, np.nan))


def air_inputs_of(inverse_map: InverseMap, sample: Mapping[str, float]) -> AirInputs:
    """Return what is known of a sample of inputs by name, NaN where not given: see :func:`air_inputs`."""
    value, std = (np.array([sample[name + end] for name in NAVIGATION]) for end in ("", STD))
    inputs = air_inputs(inverse_map, value, std, sample[ALTITUDE])
    inputs = _without_computed(inverse_map, inputs, sample)
    as_records = {name: np.array([value]) for name, value in sample.items()}
    direction, direction_std = measured_directions(as_records)
    inputs = replace(inputs, direction=direction[0], direction_std=direction_std[0])
    total, total_std = (sample[TOTAL_TEMPERATURE + end] for end in ("", STD))
    by_temperature, other_std = mach_by_temperature(total, total_std, sample[ALTITUDE])
    mach, mach_std = inputs.value[0], inputs.std[0]
    if np.isnan(by_temperature):
        return inputs
    if np.isnan(mach):
        joined = by_temperature, other_std
    else:
        weight = np.array([mach_std**-2, other_std**-2])
        apart = abs(by_temperature - mach) / np.hypot(mach_std, other_std)
        joined = weight @ [mach, by_temperature] / weight.sum(), max(1.0, apart) / np.sqrt(weight.sum())
    return replace(inputs, value=np.append(joined[0], inputs.value[1:]), std=np.append(joined[1], inputs.std[1:]))


def _without_computed(inverse_map: InverseMap, air: AirInputs, sample: Mapping[str, float]) -> AirInputs:
    """Return ``air`` without a q_inf that is computed from M and a pressure: no measurement of its own.

    It stands for the one of both that is not given. What it is computed from has the standard deviations of the
    day, which no measurement confirms.
    """
    manifold = inverse_map.manifold
    assert manifold is not None
    records = {name: np.array([value]) for name, value in sample.items()}
    source = pressure_source(records)[0]
    if source == QSource.INDEPENDENT or not np.isfinite(air.value[2]):
        return air
    value, std = air.value.copy(), air.std.copy()
    half, by_altitude = 0.5 * HEAT_CAPACITY_RATIO, not sample[STATIC_PRESSURE] > 0.0
    stated = sample[f"{STATIC_PRESSURE}{STD}"]
    of_port = max(manifold.static_pressure_error, DAY_OF_PRESSURE)
    of_day = max(manifold.altitude_error, DEVIATION_OF_AIR)
    error = of_day if source == QSource.MACH_AND_ALTITUDE else of_port
    if stated > 0.0 and not by_altitude and source == QSource.MACH_AND_PRESSURE:
        error = stated / value[1]
    of_mach = sample[f"{MACH_NUMBER}{STD}"]
    mach_std = of_mach if of_mach > 0.0 else manifold.mach_number_error
    if np.isfinite(value[0]) and not of_mach > 0.0:
        mach_std = std[0] = np.hypot(std[0], DAY_OF_MACH * value[0])
    if np.isfinite(value[1]) and not stated > 0.0:
        std[1] = value[1] * max(std[1] / value[1], of_day if by_altitude else of_port)
    mach = value[0] if np.isfinite(value[0]) else manifold.mach_range.mean()
    by_sources = value[2] * computed_pressure_error(np.array(mach), np.array(mach_std), error)
    of_loads = float(value[2]), float(computed_pressure_std(records, by_sources)[0])
    if np.isnan(value[:2]).all():
        return replace(air, std=np.append(std[:2], of_loads[1]), is_computed=True, of_loads=of_loads)
    if np.isnan(value[1]):
        value[1] = value[2] / (half * value[0] ** 2)
        std[1] = value[1] * error
    elif np.isnan(value[0]):
        value[0], std[0] = np.sqrt(value[2] / (half * value[1])), mach_std
    value[2] = std[2] = np.nan
    return AirInputs(value=value, std=std, is_computed=True, of_loads=of_loads)


def mach_by_temperature(total: float, std: float, altitude: float) -> tuple[float, float]:
    """Return M by a total temperature [K] of a perfect gas and the standard atmosphere at ``altitude`` [m].

    T0 = T (1 + (gamma - 1)/2 M^2); the standard deviation follows from T0 and T to first order. NaN where it gives
    none.
    """
    if not (np.isfinite(total) and total > 0.0 and 0.0 <= altitude <= LAYERS[-1][0]):
        return np.nan, np.nan
    ratio, half = total / pressure_and_temperature(altitude)[1], 0.5 * (HEAT_CAPACITY_RATIO - 1.0)
    if ratio <= 1.0:
        return np.nan, np.nan
    mach = np.sqrt((ratio - 1.0) / half)
    relative = np.hypot(std / total if std > 0.0 else TOTAL_TEMPERATURE_ERROR, STATIC_TEMPERATURE_ERROR)
    return float(mach), float(0.5 * ratio * relative / (half * mach))


def without(air: AirInputs, z: FloatArray, dropped: int) -> AirInputs:
    """Return ``air`` without the one ``dropped``, of residuals ``z`` (3,); others that may be wrong are doubted.

    These count with standard deviations larger by |z| of the dropped one, and one more for the noise in it.
    """
    size, gone = abs(z[dropped]), np.arange(N_AIR) == dropped
    doubted = (size <= POLICIES.navigation_alarm) | (size**2 - z**2 < DISCERNED)
    std = air.std * np.where(doubted, size + 1.0, 1.0)
    return replace(air, value=np.where(gone, np.nan, air.value), std=np.where(gone, np.nan, std))


def doubted(air: AirInputs, z: FloatArray) -> AirInputs | None:
    """Return ``air`` with a doubted static pressure, which nothing confirms and strain makes unlikely, or None."""
    size = abs(z[1])
    if not air.is_computed or not size > UNLIKELY_PRESSURE:
        return None
    return replace(air, std=air.std * np.array([1.0, size + 1.0, 1.0]))


def air_rows(state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (3,) M, ln p_inf and ln q_inf at ``state``, and their derivatives (3, 4)."""
    mach, log_pressure = state[MACH], state[LOG_PRESSURE]
    value = [mach, log_pressure, log(0.5 * HEAT_CAPACITY_RATIO) + 2.0 * log(mach) + log_pressure]
    return np.array(value), np.array([[1.0, 0, 0, 0], [0, 0, 0, 1.0], [2.0 / mach, 0, 0, 1.0]])


def air_data(state: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (7,) air data at ``state`` and their standard deviations, see :class:`NonlinearEstimate`."""
    step = 1e-30  # of a complex argument: derivatives to the last digit
    jacobian = np.stack([_air_data(state + 1j * step * axis).imag / step for axis in np.eye(N_STATES)], axis=1)
    value = air_data_at(state[None])[0]
    variance = np.einsum("ix,xy,iy->i", jacobian, covariance, jacobian)
    # Without incidence the wind has no direction: its error is all of the incidence.
    any_direction = (MIN_INCIDENCE / value[2]) ** 2 * (covariance[U, U] + covariance[W, W])
    variance[2:4] += any_direction * np.array([1.0, value[2] ** -2])
    std = np.sqrt(variance)
    std[5:] = value[5:] * lognormal_std(std[5:] / value[5:])
    std[3] = min(std[3], np.pi / np.sqrt(3.0))  # of a roll angle that may be any
    return value, std


def air_data_at(state: FloatArray) -> FloatArray:
    """Return (k, 7) air data at ``state`` (k, 4)."""
    return _air_data(state.T.astype(complex)).real.T


def _air_data(state: FloatArray) -> FloatArray:
    mach, u, w, log_pressure = state
    a, pressure = np.sqrt(u * u + w * w + MIN_INCIDENCE**2), np.exp(log_pressure)
    across = np.sin(a) / a  # the wind blows along (cos a, across w, across u): aft, to starboard, up
    roll = np.arctan2(w.real, u.real) + 1j * (u.real * w.imag - w.real * u.imag) / (a.real * a.real)
    angles = [np.arctan(across * u / np.cos(a)), -np.arcsin(across * w), a, roll]
    return np.array([*angles, mach, pressure, 0.5 * HEAT_CAPACITY_RATIO * mach**2 * pressure])


def lognormal_std(of_log: FloatArray | float) -> FloatArray:
    """Return the relative sigma of a lognormal value: three of them reach as far as three ``of_log``."""
    return np.asarray(np.expm1(3.0 * of_log) / 3.0)
