"""Smoothing of recorded samples: the filter from both ends.

The filter averages each sample with the samples before it, and, over the samples in reverse, with those behind it.
Both averages hold the sample itself. With the parts f and g of the variance of its noise that they leave, the one
with each sample once is

    h (forward / f + backward / g - alone),    1 / h = 1 / f + 1 / g - 1,

and leaves the part h. What lasts is not averaged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY

_ROLL_ANGLE = AIR_DATA_NAMES.index("wind_roll_angle")


@dataclass(frozen=True, kw_only=True, eq=False)
class Smoothed:
    """Smoothed estimates of k samples: fields of :class:`~strainfmu.estimator.estimate.Estimate` that change."""

    loads: FloatArray
    loads_std: FloatArray
    coefficients: FloatArray
    coefficients_std: FloatArray
    other_loads: FloatArray
    other_loads_std: FloatArray
    other_coefficients: FloatArray
    other_coefficients_std: FloatArray
    air: FloatArray
    air_std: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Samples that the filter has estimated: ``time`` (k,) [s], ``filtered`` estimates, and each ``alone``."""

    time: FloatArray
    filtered: Estimate
    alone: Estimate


class Smoother:
    """What smooths the samples of an estimator that filters over time."""

    def __init__(self, estimator: Estimator) -> None:
        """Smooth as ``estimator`` filters."""
        self._alone, self._backward = estimator.filter(0.0), estimator.filter(estimator.filter_time_constant)

    def samples(self, filtered: Estimate, time: FloatArray) -> Samples:
        """Return the next samples, at ``time`` (k,) [s], and what each says alone."""
        return Samples(
            time=time,
            filtered=filtered,
            alone=self._alone.track_again(filtered.sample, filtered.mask, time),
        )

    def smoothed(self, samples: Samples, later: Samples | None) -> Smoothed:
        """Return the estimates of ``samples``; those ``later`` follow, None for none."""
        both = [samples] if later is None else [samples, later]
        inputs, time = (
            np.concatenate([block.filtered.sample for block in both]),
            np.concatenate([block.time for block in both]),
        )
        masks = [_mask_of(block.filtered) for block in both]
        self._backward.restart()
        estimates = self._backward.track_again(inputs[::-1], np.concatenate(masks)[::-1], -time[::-1])
        backward = estimates[np.arange(len(time))[::-1][: len(samples.time)]]
        ends = (samples.filtered, backward, samples.alone)
        forward_left, backward_left = (estimates.noise_left[:, None] for estimates in ends[:2])
        of_fields = {
            name: _joined(forward_left, backward_left, [_values(estimates, name) for estimates in ends])
            for name in ("loads", COEFFICIENT_ARRAY, "other_loads", "other_coefficients", "air")
        }
        return Smoothed(
            **{name: value for name, (value, _) in of_fields.items()},
            **{f"{name}_std": std for name, (_, std) in of_fields.items()},
        )


def _mask_of(estimates: Estimate) -> BoolArray:
    """Return (k, n_d) the gauges that the caller trusts."""
    shape = (len(estimates), estimates.valid.shape[-1])
    return np.ones(shape, dtype=bool) if estimates.mask is None else np.broadcast_to(estimates.mask, shape)


def _values(estimates: Estimate, name: str) -> tuple[FloatArray, FloatArray]:
    """Return the values (k, n) of a field and their standard deviations."""
    if name == "air":
        return estimates.air_data.value, estimates.air_data.std
    return getattr(estimates, name), getattr(estimates, f"{name}_std")


def _joined(
    forward_left: FloatArray, backward_left: FloatArray, ends: list[tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """Return values (k, n) and standard deviations from both ends; ``*_left`` (k, 1) parts of the noise.

    ``ends`` are those forward, backward and of the samples alone. Where a sample alone gives none, the end that is
    more certain does.
    """
    (forward, forward_std), (backward, backward_std), (alone, alone_std) = ends
    if forward.shape[1] == len(AIR_DATA_NAMES):
        forward, backward = (_near(values, alone) for values in (forward, backward))
    remaining = 1.0 / (1.0 / forward_left + 1.0 / backward_left - 1.0)
    value = remaining * (forward / forward_left + backward / backward_left - alone)
    nearer = forward_left <= backward_left
    least = np.where(nearer, forward_left, backward_left)
    averaged = alone_std**2 - np.where(nearer, forward_std, backward_std) ** 2
    noise = np.maximum(averaged, 0.0) / np.where(least < 1.0, 1.0 - least, 1.0)
    std = np.sqrt(np.maximum(alone_std**2 - noise * (1.0 - remaining), 0.0))
    coasts = np.isnan(alone)
    takes_backward = coasts & ~(forward_std <= backward_std)
    value = np.where(coasts, np.where(takes_backward, backward, forward), value)
    return value, np.where(coasts, np.where(takes_backward, backward_std, forward_std), std)


def _near(air: FloatArray, alone: FloatArray) -> FloatArray:
    """Return air data (k, 7) whose roll angle is on the turn of ``alone``; it may leave -pi to pi by less than
    noise."""
    near = air.copy()
    apart = near[:, _ROLL_ANGLE] - alone[:, _ROLL_ANGLE]
    near[:, _ROLL_ANGLE] -= 2.0 * np.pi * np.round(np.where(np.isnan(apart), 0.0, apart) / (2.0 * np.pi))
    return near
