"""Maps some of whose rows are no strain gauges: ports, an inertial unit, load cells, displacement and a fibre."""

from dataclasses import replace

import numpy as np

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import STRAIN, SensorRows

ROWS = {
    "port_0deg": ("pressure", "Pa", 5e8, 0.0),
    "port_180deg": ("pressure", "Pa", 4e8, 0.0),
    "imu_axial": ("acceleration", "m/s2", 3e4, -1.0 / 150.0),
    "imu_pitch": ("angular acceleration", "rad/s2", 2e5, 0.0),
    "cell_axial": ("force", "N", 2e6, 1.0),
    "cell_yaw": ("moment", "N m", 1e6, 0.0),
    "displacement_0.2m_45deg": ("displacement", "m", 12.0, 0.0),
    "fibre_90deg_1": ("fibre strain", "m/m", 1.5, 0.0),
}
"""Kind, unit, scale [unit/(m/m)] and response to thrust [unit/N] by name of the sensor."""

_COMMON_GAIN = np.array([0.01 if kind in ("displacement", "fibre strain") else 0.0 for kind, *_ in ROWS.values()])

LARGEST = 0.01
"""Largest |reading| of a sensor over its scale [m/m]."""


def sensor_rows(n_strains: int) -> SensorRows:
    """Return what the rows of ``n_strains`` gauges and :data:`ROWS` measure."""
    kinds, units, scale, thrust = zip(*ROWS.values(), strict=True)
    unit = np.ones(n_strains)
    return SensorRows(
        kind=(*(STRAIN,) * n_strains, *kinds),
        unit=(*("m/m",) * n_strains, *units),
        scale=np.concatenate([unit, scale]),
        largest=np.concatenate([unit, LARGEST * np.array(scale)]),
        thrust_response=np.concatenate([0.0 * unit, thrust]),
    )


def with_sensors(inverse_map: InverseMap) -> InverseMap:
    """Return ``inverse_map`` whose last rows are :data:`ROWS`."""
    n = inverse_map.n_gauges - len(ROWS)
    manifold = inverse_map.manifold
    if manifold is not None:
        gains = {"sensor_gain_std": 1e-3 * np.arange(len(ROWS)), "sensor_common_gain_std": _COMMON_GAIN}
        manifold = replace(manifold, **gains)
    names = (*inverse_map.gauge_names[:n], *ROWS)
    return replace(inverse_map, gauge_names=names, sensors=sensor_rows(n), manifold=manifold)
