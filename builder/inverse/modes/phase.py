"""The phase of modes that come in pairs: turned to what the gauges observe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.pressure_modes import PressureModes

_SAME = 1e-9
"""Relative difference of standard deviations up to which modes count as a pair."""


def turned_to_gauges(modes: PressureModes, strain_operator: FloatArray, gauge_noise: FloatArray) -> PressureModes:
    """Return the modes of a rolled ensemble, each pair turned so that the gauges observe its first mode best.

    The two phases of a harmonic have the same variance, so the POD leaves their common roll angle open. Gauges
    often observe one phase alone, such as cos(2 phi) with four rows. At any other roll angle both modes would have
    its strain, and the one that becomes a state would stand for pressure that it does not hold.

    Parameters
    ----------
    strain_operator : (n_d, n_p) Z_p [1/Pa].
    gauge_noise : (n_d, n_d) factor N of the gauges' noise N N' [m/m].
    """
    std, turned, first = modes.coefficient_std, modes.modes.copy(), 0
    while first < len(std):
        last = first + int(np.sum(std[first:] >= (1.0 - _SAME) * std[first]))
        if last - first > 1:
            pair = turned[:, first:last]
            whitened = np.linalg.solve(gauge_noise, strain_operator @ pair)
            turned[:, first:last] = pair @ np.linalg.svd(whitened, full_matrices=False)[2].T
        first = last
    largest = np.abs(turned).argmax(axis=0)
    return replace(modes, modes=turned * np.sign(turned[largest, np.arange(len(std))]))
