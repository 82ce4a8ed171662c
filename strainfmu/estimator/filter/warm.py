"""Temperature modes in a filter: errors of their amplitudes are states, which last.

A sample's sensors give amplitudes a^ with the covariance P of their errors
(:mod:`strainfmu.estimator.map.temperature`). Strain is corrected by a^, and reads Phi da of what is left, da = a -
a^. Errors of sensors last as the modes do, so that da is a process whose stationary covariance is P. Where a
sensor comes or goes, a stays, and da changes by the difference of both a^; its covariance goes to the new P with
time. What is not linear in a, the data sheet, gauge factor and modulus, is that at a^ and the mean of da.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.filter.kalman import Law
from strainfmu.estimator.map.at_temperature import SensorSets
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.temperature import SensorSet, ThermalMap, strain_at_amplitude


@dataclass(frozen=True, kw_only=True, eq=False)
class WarmSample:
    """What is known of the k temperature modes of a map in one sample; k = 0 of a map without modes.

    Attributes
    ----------
    known : (n_t,) sensors that read.
    amplitude : (k,) a^ [K].
    covariance : (k, k) P [K^2].
    """

    known: BoolArray
    amplitude: FloatArray
    covariance: FloatArray


def not_warm(thermal: ThermalMap | None) -> WarmSample:
    """Return what is known of the modes without any sensor."""
    prior = np.zeros(0) if thermal is None else thermal.prior_std
    n_t = 0 if thermal is None else thermal.n_sensors
    return WarmSample(
        known=np.zeros(n_t, dtype=bool), amplitude=np.zeros_like(prior), covariance=np.diag(prior**2)
    )


def warm_sample(sets: SensorSets[Any], temperature: ArrayLike) -> tuple[WarmSample, SensorSet]:
    """Return what readings ``temperature`` (n_t,) [K] tell, and the set of those that are known.

    Raises
    ------
    InputError
        They have another shape, or the map has no modes.
    """
    readings = sets.readings(temperature, 1)
    ((_, key),) = sets.groups(readings)
    sensors, _ = sets.held(key)
    rise = np.where(sensors.known, readings[0] - sets.thermal.reference_temperature, 0.0)
    found = WarmSample(
        known=sensors.known,
        amplitude=sensors.amplitude_gain @ rise,
        covariance=sensors.amplitude_covariance,
    )
    return found, sensors


def isothermal_covariance(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d, n_d) what gauges err that does not scale, without the modes [(m/m)^2]."""
    thermal = inverse_map.thermal
    return inverse_map.gauge_covariance if thermal is None else thermal.isothermal_covariance


def mode_columns(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d, k) what gauges read of each mode [(m/m)/K]."""
    thermal = inverse_map.thermal
    return np.zeros((inverse_map.n_gauges, 0)) if thermal is None else thermal.linear_strain


def carried(law: Law, last: WarmSample, now: WarmSample) -> Law:
    """Return ``law`` of the last sample, whose last states are da, for the sensors that read ``now``."""
    if np.array_equal(last.known, now.known):
        return law
    mean = law.mean.copy()
    mean[len(mean) - len(now.amplitude) :] += last.amplitude - now.amplitude
    return replace(law, mean=mean)


def warm_strain(thermal: ThermalMap, warm: WarmSample, law: Law, strain: FloatArray) -> FloatArray:
    """Return ``strain`` (1, n_d) less zeros as at the reference temperature [m/m], with what gauges read of da.

    ``law`` is the predicted one, whose last states are da. About its mean the strain is linear in da: a wall that
    stays warm while its sensors are lost stays as soft as it was.
    """
    errors = law.mean[len(law.mean) - len(warm.amplitude) :]
    left = strain_at_amplitude(thermal, warm.amplitude + errors, strain)
    return np.asarray(left + thermal.linear_strain @ errors)
