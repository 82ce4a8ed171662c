"""Temperature modes as the native FMU reads them: a section of ``resources/map.bin``.

Its content is eight 32-bit sizes, numbers of modes, of sensors and of coefficients of the data sheet, then float64
values in the order of :func:`thermal_section`. ``fmus/native/estimator/map/thermal.h`` describes them to the C
code.
"""

from __future__ import annotations

import numpy as np

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.temperature import LARGEST_RISE, ThermalMap
from strainfmu.estimator.numerics.fixed_order import product
from strainfmu.estimator.resource.sections import section, sized_numbers

SECTION = b"THERMAL\0"


def thermal_section(inverse_map: InverseMap, thermal: ThermalMap) -> bytes:
    """Return the section of the modes ``thermal`` of ``inverse_map``."""
    error = inverse_map.error_strain
    scalars = np.array(
        [thermal.reference_temperature, LARGEST_RISE, thermal.gauge_factor_slope, thermal.modulus_slope]
    )
    numbers = (
        scalars,
        thermal.prior_std,
        thermal.sensor_std,
        thermal.sensor_operator,
        thermal.apparent_strain,
        thermal.mode_strain,
        thermal.gauge_operator,
        thermal.isothermal_covariance,
        product(error, error.T),
    )
    sizes = (len(thermal.prior_std), thermal.n_sensors, len(thermal.apparent_strain))
    return section(SECTION, sized_numbers(sizes, numbers))
