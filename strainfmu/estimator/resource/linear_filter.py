"""The filter of a linear map as the native FMU reads it: a section of ``resources/map.bin``.

Its content is eight 32-bit sizes, of which the last three are zero, and float64 values: the scalars, then the
arrays in the order of :func:`linear_filter_section`. ``fmus/native/estimator/filter/linear_filter_map.h``
describes them to the C code.
"""

from __future__ import annotations

import numpy as np

from strainfmu.estimator.filter.linear_model import linear_model
from strainfmu.estimator.filter.settings import LARGEST, SLOW, SMALLEST, FilterSettings
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.resource.sections import section, sized_numbers

LINEAR_SECTION = b"LFILTER\0"


def linear_filter_section(inverse_map: InverseMap) -> bytes:
    """Return the section of the filter of ``inverse_map``, which is in form "dynamic_pressure"."""
    model = linear_model(inverse_map, FilterSettings(time_constant=1.0))
    n_d, n = model.n_gauges, len(model.std)
    common = model.slow | (np.arange(n) >= n - model.n_modes)
    numbers = (
        np.array([SLOW, SMALLEST, LARGEST]),
        model.std,
        model.scaled[:n_d, ~common].T,
        model.scaled[n_d:, ~common].T,
        model.common[:, common].T,
        model.own.T,
        model.rest.T,
        model.noise,
        model.seen.rest_cross,
    )
    of_errors = (model.own.shape[1], model.rest.shape[1])
    sizes = (int(np.sum(~common)), int(np.sum(common)), *of_errors, model.n_modes)
    return section(LINEAR_SECTION, sized_numbers(sizes, numbers))
