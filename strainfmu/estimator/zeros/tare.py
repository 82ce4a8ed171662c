"""Zeros of the gauges from a window of readings while the loads on the vehicle are known.

Zero: mean over the window, less what the known loads strain. Its standard deviation is that of a mean of n
readings, s / sqrt(n) for independent ones. Readings of filtered or slow channels are not independent: the means of
B stretches (:mod:`strainfmu.estimator.zeros.reading_window`) scatter by more than s / sqrt(n / B). The factor on
the variance is averaged over all gauges, as the channels have their filters in common; a gauge with far more has
its own. It falls short by a term in proportion to B, which two numbers of stretches tell (batch means: Alexopoulos
and Seila, Handbook of Simulation, 1998, ch. 7). What the means of all gauges have in common is their common error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.zeros.gauge_zeros import LARGEST_ZERO, GaugeZeros
from strainfmu.estimator.zeros.reading_window import (
    LEAST_PART,
    LEAST_STRETCHES,
    WindowStatistics,
    window_statistics,
)

LEAST_SAMPLES = 4 * LEAST_STRETCHES
"""Readings that a window must hold: four of each stretch."""

OWN_FACTOR = 3.0
"""Times the scatter of the stretches of all gauges from which on a gauge has its own."""

MOVED = 6.0
"""Standard deviations of a straight line's rise over the window that count as a drift."""

LOUD = 10.0
"""Times the map's noise that readings may scatter by."""

LIKE_LOAD = 5.0
"""Deviations of random zeros by which readings may lie along the strain of the mean flight."""


@dataclass(frozen=True, kw_only=True)
class TareLimits:
    """What a tare accepts.

    Attributes
    ----------
    dynamic_pressure : largest |q_inf| [Pa] at which air does not load the vehicle.
    zero : largest plausible |zero| [m/m].
    drift : largest rise of a gauge over the window [m/m] that is taken into its deviation.
    """

    dynamic_pressure: float = 100.0
    zero: float = 2e-3
    drift: float = 2e-6

    def __post_init__(self) -> None:
        for name in ("dynamic_pressure", "zero", "drift"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise InputError(f"{name}: expected at least 0, got {getattr(self, name):g}")


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownStrain:
    """Strain of the loads that act while tare is taken, as own weight.

    Attributes
    ----------
    value : (n_d,) [m/m].
    relative_std : standard deviation of its error, relative [1].
    own_std : (n_d,) that of each gauge [m/m]; None for the relative one.
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
    """Zeros, and what speaks against them.

    Attributes
    ----------
    zeros : of gauges that do not read: 0 with the largest deviation there is.
    samples : number of readings.
    memory : factor on the deviations by which readings depend on each other [1].
    faults : reasons not to use them, one line each; none where loads are known.
    notes : what else is to be known.
    """

    zeros: GaugeZeros
    samples: int
    memory: float
    faults: tuple[str, ...]
    notes: tuple[str, ...]


def tare(
    inverse_map: InverseMap,
    strain: FloatArray,
    dynamic_pressure: FloatArray,
    limits: TareLimits | None = None,
    known: KnownStrain | None = None,
) -> Tare:
    """Return the zeros of ``inverse_map``'s strain gauges from the readings of a window.

    Parameters
    ----------
    strain : (n, n_d) readings [m/m], NaN where there is none.
    dynamic_pressure : (n,) q_inf [Pa], NaN where it is not known.
    known : strain of the loads that act; None for none.

    Raises
    ------
    InputError
        The window holds too few readings.
    """
    if len(strain) < LEAST_SAMPLES:
        raise InputError(f"window: expected at least {LEAST_SAMPLES} samples, got {len(strain)}")
    return judged_tare(inverse_map, window_statistics(strain), dynamic_pressure, limits, known)


def judged_tare(
    inverse_map: InverseMap,
    window: WindowStatistics,
    dynamic_pressure: FloatArray,
    limits: TareLimits | None = None,
    known: KnownStrain | None = None,
) -> Tare:
    """Return the zeros that the statistics of a window give; arguments as :func:`tare`."""
    limits = limits or TareLimits()
    n, n_d, reads = window.samples, inverse_map.n_strain_gauges, window.reads
    of_loads = known or KnownStrain(value=np.zeros(n_d))
    memory, own = _memory(window)
    rise, rise_std = _rise(window)
    drift = np.where(_is_rise(rise, rise_std), rise, 0.0)
    of_drift, of_known = drift**2 / 12.0, of_loads.std**2
    std = np.sqrt((own * window.scatter) ** 2 / n + of_drift + of_known)
    value = window.mean - of_loads.value
    zeros = GaugeZeros(
        value=np.where(reads & (np.abs(value) <= LARGEST_ZERO), value, 0.0),
        std=np.where(reads, np.minimum(std, LARGEST_ZERO), LARGEST_ZERO),
        common_std=_common_std(window.stretch[:, reads]),
    )
    faults = (
        *_pressure_faults(dynamic_pressure, limits),
        *_drift_faults(inverse_map, drift, limits),
        *_scatter_faults(inverse_map, window.scatter),
        *_size_faults(inverse_map, value * reads, limits),
        *_load_faults(inverse_map, value, reads),
    )
    notes = _notes(inverse_map, reads, window.scatter, dynamic_pressure)
    return Tare(zeros=zeros, samples=n, memory=memory, faults=faults, notes=notes)


def _detrended(means: FloatArray) -> FloatArray:
    place = np.arange(len(means)) - 0.5 * (len(means) - 1)
    slope = place @ means / (place @ place)
    return np.asarray(means - means.mean(axis=0) - place[:, None] * slope)


def _excess(means: FloatArray, length: int, scatter: FloatArray) -> FloatArray:
    """Return (n_d,) the variance of means (b, n_d) of ``length`` readings over that of independent readings."""
    square = np.sum(_detrended(means) ** 2, axis=0) / (len(means) - 2)
    return np.asarray(square * length / scatter**2)


def _memory(window: WindowStatistics) -> tuple[float, FloatArray]:
    """Return the factor of all gauges and that of each (n_d,) by which deviations are larger than s / sqrt(n)."""
    moves = window.scatter > 0.0
    own = np.ones(len(moves))
    if not moves.any():
        return 1.0, own
    means, scatter = window.stretch[:, moves], window.scatter[moves]
    fine = _excess(means, window.length, scatter)
    coarse = _excess(0.5 * (means[0::2] + means[1::2]), 2 * window.length, scatter)
    alike = fine <= OWN_FACTOR**2 * np.median(fine)
    of_all = max(float(np.mean(2.0 * coarse[alike] - fine[alike])), float(np.mean(fine[alike])), 1.0)
    own[moves] = np.where(alike, of_all, np.maximum(fine, of_all))
    return float(np.sqrt(of_all)), np.sqrt(own)


def _rise(window: WindowStatistics) -> tuple[FloatArray, FloatArray]:
    """Return the rise of a straight line over the window (n_d,), and its standard deviation."""
    means = window.stretch
    b = len(means)
    place = (np.arange(b) - 0.5 * (b - 1)) * window.length / window.samples
    rise = place @ means / (place @ place)
    residual = np.sum(_detrended(means) ** 2, axis=0) / (b - 2)
    return np.asarray(rise), np.asarray(np.sqrt(residual / (place @ place)))


def _is_rise(rise: FloatArray, rise_std: FloatArray) -> BoolArray:
    return np.asarray(np.abs(rise) > MOVED * rise_std)


def _common_std(means: FloatArray) -> float:
    """Return the standard deviation of the mean over the window of what all gauges have in common."""
    n_d = means.shape[1]
    if n_d < 2:
        return 0.0
    rest = _detrended(means)
    freedom = len(means) - 2
    # The covariance of two different gauges, averaged over all pairs.
    shared = (np.sum(rest.sum(axis=1) ** 2) - np.sum(rest**2)) / (freedom * n_d * (n_d - 1))
    # Below what means of independent gauges give by chance it is none.
    chance = np.sum(rest**2) / (freedom * n_d) * np.sqrt(2.0 / freedom) / n_d * 3.0
    return float(np.sqrt(shared / len(means))) if shared > chance else 0.0


def _pressure_faults(dynamic_pressure: FloatArray, limits: TareLimits) -> list[str]:
    known = dynamic_pressure[np.isfinite(dynamic_pressure)]
    largest = float(np.max(np.abs(known), initial=0.0))
    if largest <= limits.dynamic_pressure:
        return []
    return [
        f"loads are not known: dynamic pressure reaches {largest:.4g} Pa, expected at most "
        f"{limits.dynamic_pressure:g} Pa"
    ]


def _worst(held: InverseMap, values: FloatArray) -> tuple[str, float]:
    worst = int(np.argmax(np.abs(values)))
    return held.gauge_names[worst], float(1e6 * values[worst])


def _drift_faults(held: InverseMap, rise: FloatArray, limits: TareLimits) -> list[str]:
    if np.max(np.abs(rise)) <= limits.drift:
        return []
    name, size = _worst(held, rise)
    return [
        f"readings drift: gauge '{name}' by {size:.3g} um/m over the window, expected at most "
        f"{1e6 * limits.drift:g} um/m"
    ]


def _scatter_faults(held: InverseMap, scatter: FloatArray) -> list[str]:
    noise_std = held.noise_std[: len(scatter)]
    if np.all(scatter <= LOUD * noise_std):
        return []
    worst = int(np.argmax(scatter / noise_std))
    size, noise = 1e6 * scatter[worst], 1e6 * noise_std[worst]
    return [
        f"readings move: gauge '{held.gauge_names[worst]}' by {size:.3g} um/m rms, expected at most {LOUD:g} "
        f"times its noise of {noise:.3g} um/m"
    ]


def _size_faults(held: InverseMap, value: FloatArray, limits: TareLimits) -> list[str]:
    if np.max(np.abs(value)) <= limits.zero:
        return []
    name, size = _worst(held, value)
    largest = 1e6 * limits.zero
    return [f"no plausible zero: gauge '{name}' reads {size:.4g} um/m, expected at most {largest:g} um/m"]


def _load_faults(held: InverseMap, value: FloatArray, reads: BoolArray) -> list[str]:
    """Zeros are random from gauge to gauge; the strain of a flight has a pattern."""
    along = held.mean_strain[: len(reads)][reads]
    n, size = len(along), float(np.linalg.norm(along))
    if n < 8 or not size > 0.0:
        return []
    part = float(value[reads] @ along) / size
    rest = np.sqrt(max(float(value[reads] @ value[reads]) - part**2, 0.0) / (n - 1))
    limit = max(LIKE_LOAD * rest, LIKE_LOAD * float(np.median(held.noise_std[: len(reads)])))
    if abs(part) <= limit:
        return []
    return [
        f"readings look like load: {1e6 * abs(part):.3g} um/m of them lie along the strain of the mean flight, "
        f"expected at most {1e6 * limit:.3g} um/m of random zeros"
    ]


def _notes(
    held: InverseMap, reads: BoolArray, scatter: FloatArray, dynamic_pressure: FloatArray
) -> tuple[str, ...]:
    notes = [
        f"gauge '{name}': reads in less than {100 * LEAST_PART:g} % of the window: no zero, not to be used"
        for name, one in zip(held.gauge_names[: len(reads)], reads, strict=True)
        if not one
    ]
    still = [held.gauge_names[i] for i in np.flatnonzero(reads & (scatter == 0.0))]
    notes += [f"gauge '{name}': every reading is the same: is it alive?" for name in still]
    lost = int(np.count_nonzero(~np.isfinite(dynamic_pressure)))
    if lost == len(dynamic_pressure):
        notes.append("dynamic pressure is not recorded: that air does not load the vehicle is taken on trust")
    elif lost:
        notes.append(
            f"dynamic pressure has no value in {lost} of {len(dynamic_pressure)} samples: that air does not load "
            "the vehicle then is taken on trust"
        )
    return tuple(notes)
