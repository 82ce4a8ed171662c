"""Stationary processes: flight state with rates, and errors that decay."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray


def with_rates(std: FloatArray, rate_std: FloatArray, time_step: float) -> FloatArray:
    """Return (2 n, 2 n) the step of n quantities, then their rates, over ``time_step`` [s].

    Each follows x'' + 2 lambda x' + lambda^2 (x - mean) = white noise: standard deviation ``std`` (n,), that of
    the rate ``rate_std`` (n,) = lambda std. The rate is continuous and decays with the time constant 1 / lambda
    (Matern 3/2; Rasmussen & Williams, section 4.2.1; Hartikainen & Sarkka 2010).
    """
    n, rate = len(std), rate_std / std
    decay, turn = np.exp(-rate * time_step), rate * time_step
    out = np.zeros((2 * n, 2 * n))
    i = np.arange(n)
    out[i, i], out[i, n + i] = decay * (1.0 + turn), decay * time_step
    out[n + i, i], out[n + i, n + i] = -decay * rate * turn, decay * (1.0 - turn)
    return out


def decaying(time_constant: FloatArray, time_step: float) -> FloatArray:
    """Return (n,) the correlations of Ornstein-Uhlenbeck processes of ``time_constant`` (n,) [s] over a step."""
    return np.asarray(np.exp(-time_step / time_constant))
