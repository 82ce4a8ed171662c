"""The inverse map as the native FMU reads it: ``resources/map.bin``.

Little endian. A header of 128 bytes: magic, format version, byte order mark, length of the file, CRC-32 of all
that follows the first 32 bytes, a zero; numbers of gauges n and of states, degrees of freedom, whether the prior
is known; the guid, ended by a zero. Then float64 values: ten scalars, and the arrays in the order of
:func:`_arrays`.
``fmus/native/estimator/map_resource.h`` describes the same file to the C code.

Every value is that of :class:`~strainfmu.estimator.step.Estimator`, in the same bits on every machine
(:mod:`strainfmu.estimator.fixed_order`). Of the whitening matrices the
file holds the triangle R of a QR decomposition: all that is computed from W is the same for W and Q' W, and a
triangle takes half the time and half the room.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.fixed_order import householder
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, chi_square_limit
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.isolation import AMBIGUOUS_CORRELATION, outlier_threshold
from strainfmu.estimator.map_parts import MapParts, map_parts
from strainfmu.estimator.masks import MIN_INFORMATION
from strainfmu.estimator.settings import LARGEST_SENSOR_RANGE, LARGEST_SETTING, default_settings
from strainfmu.estimator.step import MIN_DYNAMIC_PRESSURE

MAGIC = b"SFMUMAP\0"
FORMAT_VERSION = 1
CHECKED_FROM = 32
"""Position of the first byte that the checksum covers."""

_BYTE_ORDER_MARK = 0x01020304
_GUID_SIZE = 80


def native_resource(inverse_map: InverseMap, guid: str) -> bytes:
    """Return the content of ``map.bin`` for ``inverse_map``, which instances with another ``guid`` refuse.

    Raises
    ------
    InputError
        ``guid`` is longer than 79 bytes.
    """
    if inverse_map.form != "absolute":
        raise InputError(f"inverse map: form '{inverse_map.form}' found, the native FMU runs 'absolute' alone")
    text = guid.encode()
    if len(text) >= _GUID_SIZE or b"\0" in text:
        raise InputError(f"guid: '{guid}' found, must be shorter than {_GUID_SIZE} bytes")
    checked = struct.pack(
        f"<4I{_GUID_SIZE}s",
        inverse_map.n_gauges,
        len(inverse_map.state_offset),
        inverse_map.residual_degrees_of_freedom,
        inverse_map.case == 2,
        text,
    )
    checked += b"".join(array.astype("<f8").tobytes() for array in (_scalars(inverse_map), *_arrays(inverse_map)))
    header = MAGIC + struct.pack(
        "<2IQ2I", FORMAT_VERSION, _BYTE_ORDER_MARK, CHECKED_FROM + len(checked), zlib.crc32(checked), 0
    )
    return header + checked


def _scalars(inverse_map: InverseMap) -> FloatArray:
    """Return start values, and the constants that Python alone states."""
    settings = default_settings(inverse_map)
    return np.array(
        [
            settings.reference_area,
            settings.reference_length,
            settings.moment_station,
            settings.sensor_range,
            inverse_map.nominal_dynamic_pressure,
            MIN_INFORMATION,
            AMBIGUOUS_CORRELATION,
            MIN_DYNAMIC_PRESSURE,
            LARGEST_SENSOR_RANGE,
            LARGEST_SETTING,
        ]
    )


def _arrays(inverse_map: InverseMap) -> tuple[FloatArray, ...]:
    """Return the arrays of the C structure ``Map``, in its order."""
    parts, counts = map_parts(inverse_map), range(1, inverse_map.n_gauges + 1)
    model = parts.error_model
    return (
        inverse_map.mean_strain,
        inverse_map.load_of_mean,
        parts.load_gain.T,
        inverse_map.load_covariance,
        _packed_columns(householder(inverse_map.residual_whitening)[0]),
        _packed_columns(parts.gain_whitening),
        _packed_columns(parts.noise_whitening.T),
        _packed_columns(model.noise_root.T),
        model.regression,
        model.remainder,
        model.state_operator.T,
        model.load_per_state.T,
        _min_precision(parts),
        np.array([chi_square_limit(freedom) for freedom in counts]),
        np.array([outlier_threshold(n, FALSE_ALARM_PROBABILITY) for n in counts]),
    )


def _min_precision(parts: MapParts) -> FloatArray:
    """Return (n_d,) the precision of a gauge [1/(m/m)^2] below which it is round-off: no other gauge checks it."""
    return np.asarray(MIN_INFORMATION * np.sum(parts.noise_whitening**2, axis=0))


def _packed_columns(upper: FloatArray) -> FloatArray:
    """Return the columns of an upper triangle (n, n), one after another without the zeros."""
    return np.concatenate([upper[: j + 1, j] for j in range(len(upper))])
