"""The gauges of an input as their values are judged: quantisation, noise, and the frame that holds each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.can.wire.frame_layout import FLOAT, InputLayout
from strainfmu.errors import InputError

UNKNOWN_NOISE = 0.5
"""Noise in quantisation steps where neither the map nor an option states it."""

_USUAL_STRAIN = 1e-3
"""Strain [m/m] at which the resolution of a float is taken."""

_MANTISSA_BITS = {16: 10, 32: 23, 64: 52}


@dataclass(frozen=True, eq=False, kw_only=True)
class GaugeNoise:
    """Noise of n_d gauges against their quantisation.

    Attributes
    ----------
    step : (n_d,) quantisation step [m/m].
    std : (n_d,) standard deviation of the noise [m/m].
    is_known : ``std`` is stated, not assumed.
    frame : (n_d,) number of the frame that holds each gauge, 0, 1 ...
    """

    step: FloatArray
    std: FloatArray
    is_known: bool
    frame: IntArray

    @property
    def ratio(self) -> FloatArray:
        """(n_d,) noise in quantisation steps."""
        return self.std / self.step


def gauge_noise(layout: InputLayout, noise_std: ArrayLike | None) -> GaugeNoise:
    """Return the noise of the gauges of ``layout``.

    Parameters
    ----------
    noise_std : (n_d,) or one standard deviation for all [m/m]; None where it is not known.

    Raises
    ------
    InputError
        A standard deviation is not positive, or there are too few or too many.
    """
    n = layout.n_gauges
    step, frame = np.empty(n), np.empty(n, dtype=np.int64)
    for number, item in enumerate(layout.strain_frames):
        for index, gauge, factor in zip(item.indices, item.gauges, item.to_strain, strict=True):
            signal = item.layout.signals[index]
            resolution = abs(signal.scale) * factor
            if signal.kind == FLOAT:
                resolution = _USUAL_STRAIN * 2.0 ** -_MANTISSA_BITS[signal.length]
            step[gauge], frame[gauge] = resolution, number
    if noise_std is None:
        return GaugeNoise(step=step, std=UNKNOWN_NOISE * step, is_known=False, frame=frame)
    std = np.asarray(noise_std, dtype=float)
    if std.shape not in ((), (n,)) or not (np.isfinite(std) & (std > 0.0)).all():
        raise InputError(f"gauge noise: expected one or {n} positive numbers, got {str(noise_std)[:60]}")
    return GaugeNoise(step=step, std=np.full(n, std), is_known=True, frame=frame)


def like_gauges(n_gauges: int, step: float = 0.25e-6, std: float | None = None) -> GaugeNoise:
    """Return ``n_gauges`` equal gauges of one frame: quantisation step and noise [m/m], None where not known."""
    return GaugeNoise(
        step=np.full(n_gauges, step),
        std=np.full(n_gauges, UNKNOWN_NOISE * step if std is None else std),
        is_known=std is not None,
        frame=np.zeros(n_gauges, dtype=np.int64),
    )
