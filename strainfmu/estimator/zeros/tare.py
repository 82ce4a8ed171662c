"""Inputs, limits and results of a tare, which the compiled core computes (``fmus/native/estimator/zeros``)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.gauge_zeros import GaugeZeros

LEAST_SAMPLES = 64
"""Readings that a window must hold: four of each of 16 stretches."""

LEAST_PART = 0.9
"""Part of a window in which a gauge must read."""

LEAST_GAUGES = 0.5
"""Part of the gauges that must read."""

OWN_FACTOR = 3.0
"""Times the scatter of the stretches of all gauges from which on a gauge has its own."""

MOVED = 6.0
"""Standard deviations of a straight line's rise over the window that count as a drift."""

LOUD = 10.0
"""Times the map's noise that readings may scatter by."""


class TareFault(IntFlag):
    """Why zeros are not to be used: bits of ``strainload.h``, and the last one where there is no core."""

    NONE = 0
    NO_PRESSURE = 1
    PRESSURE = 2
    SHORT = 4
    DRIFTS = 8
    MOVES = 16
    TOO_LARGE = 32
    LIKE_LOAD = 64
    FEW_GAUGES = 128
    NO_CORE = 256


@dataclass(frozen=True, kw_only=True)
class TareLimits:
    """What a tare accepts.

    Attributes
    ----------
    dynamic_pressure : largest |q_inf| [Pa] at which air does not load the vehicle.
    zero : largest plausible |zero| [m/m].
    drift : largest rise of a gauge over the window [m/m]; it joins the standard deviation.
    """

    dynamic_pressure: float = 100.0
    zero: float = 2e-3
    drift: float = 2e-6

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < np.inf:
                raise InputError(f"{name}: expected at least 0, got {value:g}")


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownStrain:
    """Strain of known loads during a tare, such as own weight.

    Attributes
    ----------
    value : (n_d,) [m/m].
    relative_std : standard deviation of its error, relative [1].
    own_std : (n_d,) standard deviation of each gauge [m/m]; None for the relative one.
    """

    value: FloatArray
    relative_std: float = 0.02
    own_std: FloatArray | None = None

    @property
    def std(self) -> FloatArray:
        """(n_d,) standard deviation of its error [m/m]."""
        return self.relative_std * np.abs(self.value) if self.own_std is None else self.own_std


@dataclass(frozen=True, kw_only=True, eq=False)
class Tare:
    """Zero offsets of a tare, and its checks.

    Attributes
    ----------
    zeros : of gauges that do not read: 0 with the largest standard deviation there is.
    samples : number of readings.
    memory : factor on the standard deviations for correlated readings [1].
    gauges : number of gauges that have a zero offset.
    rms, largest_std : of their zero offsets, and the largest of their standard deviations [m/m].
    reasons : all checks that failed.
    faults : the failed checks in words, but for too few gauges; none of a good tare.
    notes : remarks for the user.
    """

    zeros: GaugeZeros
    samples: int
    memory: float
    gauges: int
    rms: float
    largest_std: float
    reasons: TareFault
    faults: tuple[str, ...]
    notes: tuple[str, ...]


def limits_record(limits: TareLimits, known: KnownStrain | None, n_gauges: int) -> FloatArray:
    """Return (3 + 2 n_d,) the record of limits and known strain that the core takes.

    Raises
    ------
    InputError
        The known strain is of another number of gauges.
    """
    loads = known or KnownStrain(value=np.zeros(n_gauges))
    for values in (loads.value, loads.std):
        if values.shape != (n_gauges,):
            raise InputError(f"known strain: expected ({n_gauges},) values, got {values.shape}")
    return np.concatenate([[limits.dynamic_pressure, limits.zero, limits.drift], loads.value, loads.std])
