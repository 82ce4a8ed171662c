"""Loads, covariance and residual of strains, by the form of the map: the step without coefficients and health."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.linear.decomposition import decompose
from strainfmu.estimator.linear.map_parts import MapParts
from strainfmu.estimator.linear.masked_map import MaskedMap
from strainfmu.estimator.linear.masks import MIN_INFORMATION
from strainfmu.estimator.linear.pressure_weights import (
    gain_and_precision,
    pressure_weights,
    product_with,
    scaled_estimate,
)
from strainfmu.estimator.map.inverse_map import InverseMap, map_references
from strainfmu.estimator.map.proportional_errors import (
    N_VALUES,
    enclosing_levels,
    error_model,
    excess_products,
    further_level_products,
    level_products,
    symmetric,
)
from strainfmu.estimator.policies import MIN_EXPECTED_RATIO as MIN_EXPECTED_RATIO

CACHED_LEVELS = 512
"""Levels of the errors in proportion to strain that are kept, over all sets of gauges."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadsFromStrain:
    """What the strains of k samples with the same gauges in use say of the loads, about the map's moment point.

    Attributes
    ----------
    loads : (k, 5) [N, N m].
    load_covariance : (k, 5, 5) of their errors, but for that of q_inf [(N, N m)^2].
    chi_square : (k,) [1].
    standardised_residual : (k, n_d) z [1].
    load_per_pressure : (k, 5) derivative of the loads by q_inf [N/Pa, N m/Pa].
    expected_ratio : (k,) expected chi-square over its degrees of freedom [1].
    further, further_variance, further_per_pressure : (k, m) further loads of the map, their variance, and their
        derivative by q_inf.
    """

    loads: FloatArray
    load_covariance: FloatArray
    chi_square: FloatArray
    standardised_residual: FloatArray
    load_per_pressure: FloatArray
    expected_ratio: FloatArray
    further: FloatArray
    further_variance: FloatArray
    further_per_pressure: FloatArray


def absolute_loads(parts: MapParts, masked: MaskedMap, strain: FloatArray) -> LoadsFromStrain:
    """Return the loads of ``strain`` (k, n_d) [m/m] by a map in form "absolute": the gain is fixed."""
    k, inverse_map = len(strain), parts.inverse_map
    residual = np.where(masked.valid, strain - inverse_map.mean_strain, 0.0)
    whitened = product_with(masked.whitening, residual)
    of_mean = np.zeros(0) if inverse_map.further is None else inverse_map.further.load_of_mean
    return LoadsFromStrain(
        loads=product_with(masked.load_gain, residual) + inverse_map.load_of_mean,
        load_covariance=np.broadcast_to(masked.load_covariance, (k, 5, 5)),
        chi_square=np.vecdot(whitened, whitened),
        standardised_residual=product_with(masked.z_whitening, whitened),
        load_per_pressure=np.zeros((k, 5)),
        expected_ratio=np.ones(k),
        further=product_with(masked.further_gain, residual) + of_mean,
        further_variance=np.broadcast_to(masked.further_variance, (k, len(of_mean))),
        further_per_pressure=np.zeros((k, len(of_mean))),
    )


class ScaledLoads:
    """The loads by a map in form "dynamic_pressure": weights follow q_inf, errors follow the current strain."""

    def __init__(self, inverse_map: InverseMap) -> None:
        self._map = inverse_map
        self._parts = decompose(inverse_map)
        n = inverse_map.n_gauges
        zero, none = np.zeros(n), np.zeros(5)
        self._fixed_strain = zero if inverse_map.fixed_strain is None else inverse_map.fixed_strain
        self._fixed_load = none if inverse_map.fixed_load is None else inverse_map.fixed_load
        self._mean_strain = inverse_map.mean_strain - self._fixed_strain
        self._load_of_mean = inverse_map.load_of_mean - self._fixed_load
        fixed, mean = _further_of_mean(inverse_map)
        self._fixed_further, self._further_of_mean = fixed, mean - fixed
        self._min_precision = MIN_INFORMATION / np.diag(inverse_map.gauge_covariance)
        self._errors = error_model(inverse_map)
        self._levels: OrderedDict[tuple[bytes, float], FloatArray] = OrderedDict()

    def loads(self, masked: MaskedMap, strain: FloatArray, dynamic_pressure: FloatArray) -> LoadsFromStrain:
        """Return the loads of ``strain`` (k, n_d) [m/m] at ``dynamic_pressure`` (k,) [Pa]."""
        lost = ~masked.valid
        nominal = self._map.nominal_dynamic_pressure
        ratio = dynamic_pressure / nominal
        weights = pressure_weights(self._parts, ratio, lost)
        residual = strain - (self._fixed_strain + ratio[:, None] * self._mean_strain)
        found = scaled_estimate(
            self._parts,
            weights,
            residual=residual,
            mean_strain=self._mean_strain,
            lost=lost,
            min_precision=self._min_precision,
        )
        loads = self._fixed_load + ratio[:, None] * self._load_of_mean + found.loads
        excess = self._excess(masked.valid, ratio, loads / (dynamic_pressure[:, None] * map_references(self._map)))
        ratio_squared, slope = ratio * ratio, self._further_of_mean
        return LoadsFromStrain(
            loads=loads,
            load_covariance=found.load_covariance + ratio_squared[:, None, None] * symmetric(excess[:, :15]),
            chi_square=found.chi_square,
            standardised_residual=found.standardised_residual,
            load_per_pressure=(self._load_of_mean + found.load_per_pressure) / nominal,
            expected_ratio=np.maximum(
                1.0 + ratio_squared * excess[:, 15] / masked.degrees_of_freedom, MIN_EXPECTED_RATIO
            )
            if masked.degrees_of_freedom > 0
            else np.ones(len(ratio)),
            further=self._fixed_further + ratio[:, None] * slope + found.further,
            # A variance at strains smaller than those of the snapshots may fall below the linear model of errors.
            further_variance=np.maximum(found.further_variance + ratio_squared[:, None] * excess[:, 16:], 0.0),
            further_per_pressure=(slope + found.further_per_pressure) / nominal,
        )

    def _excess(self, valid: BoolArray, ratio: FloatArray, coefficients: FloatArray) -> FloatArray:
        """Return (k, 16 + m) what errors in proportion to strain add at the current strain, per squared ratio."""
        n_values = N_VALUES + len(self._fixed_further)
        if self._errors is None:
            return np.zeros((len(ratio), n_values))
        products = excess_products(self._errors, coefficients)
        below, above = enclosing_levels(ratio)
        out = np.empty((len(ratio), n_values))
        for level in sorted(set(below.tolist())):
            rows = below == level
            low, high = self._level(valid, level), self._level(valid, float(above[rows][0]))
            at = ((ratio[rows] - level) / (above[rows][0] - level))[:, None]
            out[rows] = (1.0 - at) * (products[rows] @ low) + at * (products[rows] @ high)
        return out

    def _level(self, valid: BoolArray, level: float) -> FloatArray:
        """Return (21, 16 + m) the products of a level for the gauges in use, from the cache if they are there."""
        key = (valid.tobytes(), level)
        if key not in self._levels:
            assert self._errors is not None
            gain, precision, _ = gain_and_precision(self._parts, level, ~valid)
            further = further_level_products(self._errors, gain[5:])
            self._levels[key] = np.hstack([level_products(self._errors, gain[:5], precision), further])
            if len(self._levels) > CACHED_LEVELS:
                self._levels.popitem(last=False)
        self._levels.move_to_end(key)
        return self._levels[key]


def _further_of_mean(inverse_map: InverseMap) -> tuple[FloatArray, FloatArray]:
    """Return (m,) fixed further loads, and those of the mean pressure, the fixed ones in them [N, N m]."""
    further = inverse_map.further
    if further is None:
        return np.zeros(0), np.zeros(0)
    fixed = np.zeros(len(further.load_of_mean)) if further.fixed_load is None else further.fixed_load
    return fixed, further.load_of_mean
