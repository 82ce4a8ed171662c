"""``resources/model.bin`` of the native FMUs round the estimator; fmus/native/system/system_model.c reads it.

Little endian: a header of 128 bytes, then float64: type, causality, start, minimum and maximum of all variables,
then the data of the model.
"""

import struct
from collections.abc import Sequence
from enum import IntEnum
from math import cos, inf, sin

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import layer_table
from strainfmu.cosim.models.flight_model import FlightModel
from strainfmu.cosim.models.gauge_noise import quantile_table
from strainfmu.cosim.models.trajectory import Trajectory
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.plant_variables import Motion
from strainfmu.resource_file import with_header

FORMAT_VERSION = 2
_CHECKED_HEADER = struct.Struct("<III84s")
_LARGEST_INTEGER = 2**31 - 1


class ModelKind(IntEnum):
    """Which model an FMU is; the order is as in system_model.c."""

    PLANT = 0
    AUTOPILOT = 1
    SCHEDULE = 2


def model_resource(kind: ModelKind, interface: Sequence[Variable], data: FloatArray, guid: str) -> bytes:
    """Return the file for a model with ``data``, whose variables are ``interface``."""
    tables = np.array([_row(variable) for variable in interface]).T
    body = np.concatenate((tables.ravel(), data)).astype("<f8").tobytes()
    checked = _CHECKED_HEADER.pack(int(kind), len(interface), len(data), guid.encode()) + body
    return with_header(b"SFMUSYS", FORMAT_VERSION, checked)


def _row(variable: Variable) -> tuple[float, float, float, float, float]:
    """Return type, causality, start, minimum and maximum of a variable as numbers."""
    kind = ("Real", "Integer", "Boolean").index(variable.fmi_type)
    causality = ("output", "input", "fixed", "tunable").index(
        variable.variability if variable.causality == "parameter" else variable.causality
    )
    lowest, highest = ((-inf, inf), (-_LARGEST_INTEGER, _LARGEST_INTEGER), (0, 1))[kind]
    start = 0.0 if variable.start is None or isinstance(variable.start, tuple) else float(variable.start)
    low = lowest if variable.minimum is None else variable.minimum
    high = highest if variable.maximum is None else variable.maximum
    return kind, causality, start, float(low), float(high)


def plant_data(model: FlightModel, motion: Motion, trajectory: Trajectory | None) -> FloatArray:
    """Return what plant.c reads: motion, noise table, flight model, trajectory."""
    rows = np.empty((0, 9))
    if trajectory is not None:
        rows = np.column_stack((trajectory.time, trajectory.conditions, trajectory.slopes))
    head = [float(motion), float(len(rows))]
    return np.concatenate((head, quantile_table().ravel(), _flight_model_data(model), rows.ravel()))


def _flight_model_data(model: FlightModel) -> FloatArray:
    """Return the flight model as plant.c reads it."""
    n_mach, n_incidence = len(model.mach_knots), len(model.incidence_knots)
    n_channel, n_harmonic = model.strain_table.shape[4:6]
    layers = layer_table()
    vented = model.internal_pressure is None
    sizes = [
        model.n_gauges,
        n_mach,
        n_incidence,
        n_channel,
        n_harmonic,
        len(layers),
        float(vented),
        model.internal_pressure or 0.0,
        model.base_area,
        model.reference_area,
        model.reference_length,
    ]
    angles = model.gauge_roll_angle.tolist()
    arrays = (
        model.mach_knots,
        model.incidence_knots,
        [cos(angle) for angle in angles],
        [sin(angle) for angle in angles],
        model.gauge_channel,
        model.strain_of_internal_pressure,
        np.zeros(model.n_gauges) if model.apparent_strain is None else model.apparent_strain,
        model.noise_scale,
        model.coefficient_table.reshape(n_mach - 1, n_incidence - 1, 16, 3),
        model.strain_table.reshape(n_mach - 1, n_incidence - 1, 16, -1),
        layers,
    )
    return np.concatenate([np.asarray(values, dtype=float).ravel() for values in (sizes, *arrays)])
