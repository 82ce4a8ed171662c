"""What a tare at run time is refused for, and what is said of it: on the bus and in an FMU alike."""

from __future__ import annotations

from math import isnan

import numpy as np

from strainfmu.estimator.zeros.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.zeros.tare import Tare, TareLimits

LEAST_GAUGES = 0.5
"""Part of the gauges that must read."""


def loads_fault(dynamic_pressure: float, limits: TareLimits, where: str = "") -> str:
    """Return why loads are not known at ``dynamic_pressure`` [Pa], NaN where it is not stated; "" if they are.

    ``where`` says where it should be, as " on the bus".
    """
    if isnan(dynamic_pressure):
        return f"loads are not known: no dynamic pressure{where}"
    if abs(dynamic_pressure) > limits.dynamic_pressure:
        return (
            f"loads are not known: dynamic pressure is {dynamic_pressure:.4g} Pa, expected at most "
            f"{limits.dynamic_pressure:g} Pa"
        )
    return ""


def refusal(found: Tare) -> str:
    """Return why the zeros of a window are not to be used; "" if they are."""
    reading = found.zeros.std < LARGEST_ZERO
    if found.faults:
        return "; ".join(found.faults)
    if np.count_nonzero(reading) < LEAST_GAUGES * len(reading):
        return f"{np.count_nonzero(reading)} of {len(reading)} gauges read"
    return ""


def refused_text(why: str) -> str:
    """Return the line of a tare that is refused."""
    return f"tare refused: {why}; zeros as before"


def taken_text(found: Tare, unit: str) -> str:
    """Return the line of zeros that are taken; ``unit`` says what their window counts, as "cycles"."""
    used = found.zeros.std < LARGEST_ZERO
    rms = 1e6 * float(np.sqrt(np.mean(found.zeros.value[used] ** 2)))
    largest = 1e6 * float(found.zeros.std[used].max())
    return (
        f"tare taken: {np.count_nonzero(used)} zeros from {found.samples} {unit}, rms {rms:.4g} um/m, standard "
        f"deviations up to {largest:.2g} um/m each and {1e6 * found.zeros.common_std:.2g} um/m in common"
    )
