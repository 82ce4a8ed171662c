"""What a tare needs of a map, as the native FMU reads it: a section of ``resources/map.bin``.

Its content is float64 values in the order of :func:`tare_section`; ``fmus/native/estimator/zeros/tare.h``
describes them to the C code.
"""

from __future__ import annotations

import numpy as np

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.resource.sections import section
from strainfmu.estimator.zeros.reading_window import LEAST_PART
from strainfmu.estimator.zeros.tare import (
    LEAST_SAMPLES,
    LIKE_LOAD,
    LOUD,
    MOVED,
    OWN_FACTOR,
    KnownStrain,
    TareLimits,
)
from strainfmu.estimator.zeros.tare_verdict import LEAST_GAUGES

SECTION = b"TARE\0\0\0\0"


def tare_section(inverse_map: InverseMap, known: KnownStrain | None = None) -> bytes:
    """Return the section: limits, the noise of each strain gauge (n_s,) [m/m], then what is known.

    That is the strain (n_s,) [m/m] of the loads that act meanwhile and its standard deviation (n_s,).
    """
    known = known or KnownStrain(value=np.zeros(inverse_map.n_strain_gauges))
    limits = TareLimits()
    numbers = [
        limits.dynamic_pressure,
        limits.zero,
        limits.drift,
        LEAST_SAMPLES,
        LEAST_PART,
        LEAST_GAUGES,
        OWN_FACTOR,
        MOVED,
        LOUD,
        LIKE_LOAD,
    ]
    noise = inverse_map.noise_std[: inverse_map.n_strain_gauges]
    values = np.concatenate([numbers, noise, known.value, known.std])
    return section(SECTION, values.astype("<f8").tobytes())
