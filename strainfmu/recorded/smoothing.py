"""Smoothing of recorded samples: the filter from both ends.

The filter averages each sample with the samples before it, and, over the samples in reverse, with those behind it.
Both averages hold the sample itself. With the parts f and g of the variance of its noise that they leave, the one
with each sample once is

    h (forward / f + backward / g - alone),    1 / h = 1 / f + 1 / g - 1,

and leaves the part h. What lasts is not averaged.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY

_ROLL_ANGLE = AIR_DATA_NAMES.index("wind_roll_angle")

Filtered = tuple[FloatArray, Estimate, Estimate]
"""Successive samples: times (k,) [s], estimates with a filter, and of each alone."""


def smoothed(backward: Estimator, samples: Filtered, later: Filtered | None) -> SimpleNamespace:
    """Return loads, coefficients and air data of ``samples``, which a filter as ``backward`` has estimated.

    Their names are the fields of :class:`~strainfmu.estimator.estimate.Estimate`. ``later`` are the samples that
    follow, None at the end.
    """
    both = [samples] if later is None else [samples, later]
    time = np.concatenate([at for at, *_ in both])
    inputs = np.concatenate([filtered.sample for _, filtered, _ in both])
    masks = np.concatenate([_mask_of(filtered) for _, filtered, _ in both])
    backward.restart()
    reverse = backward.track_again(inputs[::-1], masks[::-1], -time[::-1])
    at, filtered, alone = samples
    ends = filtered, reverse[np.arange(len(time))[::-1][: len(at)]], alone
    parts = [estimates.noise_left[:, None] for estimates in ends[:2]]
    fields = SimpleNamespace()
    for name in ("loads", COEFFICIENT_ARRAY, "other_loads", "other_coefficients"):
        of_ends = [(getattr(estimates, name), getattr(estimates, f"{name}_std")) for estimates in ends]
        value, std = _joined(*parts, of_ends)
        setattr(fields, name, value)
        setattr(fields, f"{name}_std", std)
    air = [(estimates.air_data.value, estimates.air_data.std) for estimates in ends]
    near = [(_near(value, air[2][0]), std) for value, std in air]
    value, std = _joined(*parts, near)
    fields.air_data = SimpleNamespace(value=value, std=std)
    return fields


def _mask_of(estimates: Estimate) -> BoolArray:
    """Return (k, n_d) the gauges that the caller trusts."""
    shape = (len(estimates), estimates.valid.shape[-1])
    return np.ones(shape, dtype=bool) if estimates.mask is None else np.broadcast_to(estimates.mask, shape)


def _joined(
    forward_left: FloatArray, backward_left: FloatArray, ends: list[tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """Return values (k, n) and standard deviations from both ends; ``*_left`` (k, 1) parts of the noise.

    ``ends`` are those forward, backward and of the samples alone. Where a sample alone gives none, the end that is
    more certain does.
    """
    (forward, forward_std), (backward, backward_std), (alone, alone_std) = ends
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
