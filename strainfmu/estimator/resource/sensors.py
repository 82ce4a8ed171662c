"""Further sensors of a map as the native FMU reads them: a section of ``resources/map.bin``.

Its content is eight 32-bit sizes, the first of which is the number of strain gauges, and float64 values of the
rows behind them in the order of :func:`sensor_section`. ``fmus/native/estimator/map/sensor_rows.h`` describes them
to the C code.
"""

from __future__ import annotations

from strainfmu.estimator.map.sensors import SensorRows
from strainfmu.estimator.resource.sections import section, sized_numbers

SECTION = b"SENSORS\0"


def sensor_section(rows: SensorRows) -> bytes:
    """Return the section of the further sensors among ``rows``."""
    n = rows.n_strain_gauges
    return section(SECTION, sized_numbers((n,), (rows.scale[n:], rows.largest[n:], rows.thrust_response[n:])))
