"""The filter of the nonlinear estimator as the native FMU reads it: a section of ``resources/map.bin``.

Its content is eight 32-bit sizes, of which the last two are zero, and float64 values: the scalars, then the
arrays in the order of :func:`filter_section`. ``fmus/native/estimator/filter/filter_map.h`` describes them to
the C code.
"""

from __future__ import annotations

import numpy as np

from strainfmu.estimator.filter.consistency import BAND, LARGEST, NARROW, WIDEN, WINDOW
from strainfmu.estimator.filter.flight_model import flight_model
from strainfmu.estimator.filter.flight_track import LONGEST_STEP, OF_AGE
from strainfmu.estimator.filter.named_navigation import FITS, NAMED_AFTER
from strainfmu.estimator.filter.settings import LARGEST as LARGEST_TIME
from strainfmu.estimator.filter.settings import RATE_TIME, SLOPE_TIME, SLOW, FilterSettings
from strainfmu.estimator.filter.settings import SMALLEST as SMALLEST_TIME
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.resource.sections import section, sized_numbers
from strainfmu.estimator.tables.manifold_map import ManifoldMap

SECTION = b"FILTER\0\0"


def filter_section(inverse_map: InverseMap, manifold: ManifoldMap) -> bytes:
    """Return the section of the filter of ``inverse_map``, whose tables are ``manifold``."""
    settings = FilterSettings(time_constant=1.0)
    model = flight_model(inverse_map, manifold, settings)
    seen, own = model.seen, model.own[None] if model.own.any() else np.zeros((0, len(model.own)))
    rates = (
        settings.mach_number_rate,
        settings.angle_rate,
        settings.angle_rate,
        settings.log_pressure_rate,
    )
    scalars = (
        *rates,
        RATE_TIME,
        SLOW,
        settings.white_navigation,
        WINDOW,
        BAND,
        WIDEN,
        NARROW,
        LARGEST,
        SMALLEST_TIME,
        LARGEST_TIME,
        NAMED_AFTER,
        FITS,
        SLOPE_TIME,
        OF_AGE,
        LONGEST_STEP,
    )
    errors = model.further
    further = () if errors is None else (errors.load, errors.rest_cross, errors.rest_variance)
    numbers = (
        np.array(scalars),
        seen.strain.T,
        seen.load.T,
        seen.rest_strain,
        seen.rest_load,
        seen.rest_cross,
        model.noise,
        model.common.T,
        np.moveaxis(model.of_gauge, 0, 2),
        own,
        *further,
    )
    n_further = 0 if model.further is None else len(model.further.load)
    of_gauge, n_modes = model.of_gauge.shape[1], len(model.modes.amplitude)
    sizes = (seen.strain.shape[1], model.common.shape[1], of_gauge, len(own), n_further, n_modes)
    return section(SECTION, sized_numbers(sizes, numbers))
