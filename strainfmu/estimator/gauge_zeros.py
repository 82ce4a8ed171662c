"""Zeros of the strain gauges: what each reads without strain, and how well that is known.

Auxiliary sensors of a map have none: what they read without load is taken off before.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.signal_names import ZERO, ZERO_COMMON_STD, ZERO_STD

LARGEST_ZERO = 0.05
"""Largest zero and largest standard deviation of one [m/m]: the strain that foil gauges stand."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GaugeZeros:
    """Zero offsets of n_d strain gauges, subtracted from the readings.

    Attributes
    ----------
    value : (n_d,) reading without strain [m/m].
    std : (n_d,) standard deviation of the error of each, independent of the others [m/m].
    common_std : standard deviation of an error common to all [m/m].
    """

    value: FloatArray
    std: FloatArray
    common_std: float = 0.0

    def __post_init__(self) -> None:
        if self.value.ndim != 1 or self.std.shape != self.value.shape:
            raise InputError(
                f"zeros: expected value and std of shape (n_d,), got {self.value.shape} and {self.std.shape}"
            )
        for name, values in ((ZERO, self.value), (ZERO_STD, self.std), (ZERO_COMMON_STD, self.common_std)):
            for value in np.ravel(values).tolist():
                fault = zero_fault(name, value)
                if fault:
                    raise InputError(fault)

    @cached_property
    def covariance(self) -> FloatArray:
        """(n_d, n_d) of their errors [(m/m)^2]."""
        return np.asarray(np.diag(self.std * self.std) + self.common_std * self.common_std)


def zero_fault(name: str, value: float) -> str:
    """Return what is wrong with ``value`` for a zero, or for a standard deviation where ``name`` says ``std``; ""
    if nothing is."""
    smallest = 0.0 if name.partition("[")[0].endswith("std") else -LARGEST_ZERO
    if smallest <= value <= LARGEST_ZERO:
        return ""
    return f"{name}: expected {smallest:g} to {LARGEST_ZERO:g} m/m, got {value:g}"


def no_zeros(n_gauges: int) -> GaugeZeros:
    """Return zeros of 0, exactly known: they replace the zeros of a calibrated map."""
    return GaugeZeros(value=np.zeros(n_gauges), std=np.zeros(n_gauges))


def zeros_of_map(inverse_map: InverseMap) -> GaugeZeros:
    """Return the zeros that a map holds, whose errors are part of its noise; 0 without a calibration."""
    value = inverse_map.zero_offset[: inverse_map.n_strain_gauges]
    return replace(no_zeros(len(value)), value=value)
