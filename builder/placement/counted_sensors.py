"""Auxiliary sensors that are there whatever gauges are placed: flush ports, inertial unit, load cells.

They read the pressure on the surface alone, so that their rows follow from the fields without any structure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.inverse.sensors.sensor_set import Surface, surface_rows
from builder.placement.pressure_basis import PressureBasis
from builder.vehicle.gauges.sensor_entries import Sensors
from strainfmu.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class CountedSensors:
    """n sensors, their readings over the noise of each.

    Attributes
    ----------
    reading : (n, K) per field of the basis [1/Pa].
    gain : (n,) errors of each in proportion to its reading [1].
    against_inside : (n,) whether it reads against the pressure inside the body.
    common : (n_e, n, K) errors that sensors have in common, per field, one standard deviation [1/Pa].
    drift : (n, n_d) offsets that sensors have in common, one standard deviation [1].
    """

    reading: FloatArray
    gain: FloatArray
    against_inside: BoolArray
    common: FloatArray
    drift: FloatArray


def counted_sensors(entry: Sensors | None, surface: Surface, basis: PressureBasis) -> CountedSensors | None:
    """Return the sensors of ``entry`` that read the surface pressure alone; None where there is none.

    Raises
    ------
    InputError
        A port lies off the body, or the surface is none that it can be placed on.
    """
    rows = [] if entry is None else surface_rows(entry, surface)
    if not rows:
        return None
    std = np.array([row.std for row in rows])
    errors = list(dict.fromkeys(name for row in rows for name in row.errors))
    drifts = list(dict.fromkeys(name for row in rows for name in row.drift))
    nothing = np.zeros(len(basis.fields))
    common = np.zeros((len(errors), len(rows), basis.fields.shape[1]))
    for number, name in enumerate(errors):
        common[number] = np.array([row.errors.get(name, nothing) for row in rows]) @ basis.fields / std[:, None]
    return CountedSensors(
        reading=np.array([row.operator for row in rows]) @ basis.fields / std[:, None],
        gain=np.array([row.gain for row in rows]),
        against_inside=np.array([row.follows_inside for row in rows]),
        common=common,
        drift=np.array([[row.drift.get(name, 0.0) for name in drifts] for row in rows]) / std[:, None],
    )
