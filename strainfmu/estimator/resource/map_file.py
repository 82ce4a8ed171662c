"""The inverse map as the native FMU reads it: ``resources/map.bin``.

Little endian. A header of 128 bytes: magic, format version, byte order mark, length of the file, CRC-32 of all
that follows the first 32 bytes, a zero; numbers of gauges n and of states, degrees of freedom, whether the prior
is known; the guid, ended by a zero. Then eight 32-bit integers: the form, and sizes of what not every map has.
Then float64 values: the scalars, and the arrays in the order of :func:`_arrays`, :func:`_envelope` and
:func:`_scaled`.

Sections follow (:mod:`~strainfmu.estimator.resource.sections`), each written by the file of its name in this
folder: the tables of the nonlinear estimator (``flight``) and its filter (``filter``), the filter of a linear map
(``linear_filter``), temperature modes (``temperature``), loads beside the five (``further_loads``), limits of a
tare (``tare``), further parameters of the flow (``parameters``) and the tables over them (``parameter_tables``),
further sensors (``sensors``). A bound that the map does not state is the largest finite number.
``fmus/native/estimator/map/map_resource.h`` describes the same file to the C code.

Every value is that of :class:`~strainfmu.estimator.linear.estimator.Estimator`, in the same bits on every machine
(:mod:`strainfmu.estimator.numerics.fixed_order`). Of the whitening matrices the
file holds the triangle R of a QR decomposition: all that is computed from W is the same for W and Q' W, and a
triangle takes half the time and half the room.
"""

from __future__ import annotations

import struct
import sys
import zlib
from dataclasses import replace

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, layer_table
from strainfmu.errors import InputError
from strainfmu.estimator.arguments import NOT_KNOWN
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, chi_square_limit
from strainfmu.estimator.linear.decomposition import Decomposition, decompose
from strainfmu.estimator.linear.envelope import (
    MACH_TOLERANCE,
    PRESSURE_TOLERANCE,
    flight_ranges,
    half_spaces,
)
from strainfmu.estimator.linear.flow import MAX_DYNAMIC_PRESSURE, MIN_DYNAMIC_PRESSURE
from strainfmu.estimator.linear.flow_parameters import flow_parameters
from strainfmu.estimator.linear.isolation import AMBIGUOUS_CORRELATION, outlier_threshold
from strainfmu.estimator.linear.loads_from_strain import MIN_EXPECTED_RATIO
from strainfmu.estimator.linear.map_parts import MapParts, map_parts
from strainfmu.estimator.linear.masks import MIN_INFORMATION
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.offers import has_filter, has_further_outputs
from strainfmu.estimator.map.proportional_errors import error_model
from strainfmu.estimator.numerics.fixed_order import householder, product
from strainfmu.estimator.resource.filter import filter_section
from strainfmu.estimator.resource.flight import flight_loads_section, flight_section
from strainfmu.estimator.resource.further_loads import further_section
from strainfmu.estimator.resource.linear_filter import linear_filter_section
from strainfmu.estimator.resource.parameter_tables import parameter_tables_section
from strainfmu.estimator.resource.parameters import parameter_section
from strainfmu.estimator.resource.sensors import sensor_section
from strainfmu.estimator.resource.tare import tare_section
from strainfmu.estimator.resource.temperature import thermal_section
from strainfmu.estimator.settings import LARGEST_SETTING, SMALLEST_SETTING, default_settings
from strainfmu.estimator.zeros.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.zeros.tare import KnownStrain

MAGIC = b"SFMUMAP\0"
FORMAT_VERSION = 4
CHECKED_FROM = 32
"""Position of the first byte that the checksum covers."""

_BYTE_ORDER_MARK = 0x01020304
_GUID_SIZE = 80
_FORM, _N_FREE, _N_HALF_SPACES, _N_LAYERS, _HAS_ERRORS, _N_TERMS, _N_SECTIONS = range(7)
"""Places of the form, 0 or 1, and of the sizes; the last is zero."""


def native_resource(inverse_map: InverseMap, guid: str, known: KnownStrain | None = None) -> bytes:
    """Return the content of ``map.bin`` for ``inverse_map``, which instances with another ``guid`` refuse.

    ``known`` is the strain of the loads that act while a tare is taken; None for none.

    Raises
    ------
    InputError
        ``guid`` is longer than 79 bytes.
    """
    text = guid.encode()
    if len(text) >= _GUID_SIZE or b"\0" in text:
        raise InputError(f"guid: '{guid}' found, must be shorter than {_GUID_SIZE} bytes")
    checked = struct.pack(
        f"<4I{_GUID_SIZE}s",
        inverse_map.n_gauges,
        inverse_map.n_states,
        inverse_map.residual_degrees_of_freedom,
        inverse_map.case == 2,
        text,
    )
    numbers = (*_arrays(inverse_map), *_envelope(inverse_map))
    sizes = [0] * 8
    sizes[_N_HALF_SPACES] = _rows(inverse_map.envelope_limit)
    sizes[_N_LAYERS] = len(layer_table())
    if inverse_map.form == "dynamic_pressure":
        parts = decompose(inverse_map)
        numbers += _scaled(inverse_map, parts)
        sizes[_FORM], sizes[_N_FREE] = 1, parts.n_free
        sizes[_HAS_ERRORS] = inverse_map.common_error is not None
        sizes[_N_TERMS] = _rows(inverse_map.common_error)
    sections = [tare_section(inverse_map, known), *_sections(inverse_map)]
    sizes[_N_SECTIONS] = len(sections)
    checked += struct.pack("<8I", *sizes)
    checked += b"".join(array.astype("<f8").tobytes() for array in (_scalars(inverse_map), *numbers))
    checked += b"".join(sections)
    header = MAGIC + struct.pack(
        "<2IQ2I", FORMAT_VERSION, _BYTE_ORDER_MARK, CHECKED_FROM + len(checked), zlib.crc32(checked), 0
    )
    return header + checked


def _sections(inverse_map: InverseMap) -> list[bytes]:
    """Return what not every map has."""
    sections = list[bytes]()
    if inverse_map.manifold is not None:
        sections.append(flight_section(inverse_map, inverse_map.manifold))
        if has_filter(inverse_map):
            stated = has_further_outputs(inverse_map)
            tables = inverse_map.manifold if stated else replace(inverse_map.manifold, further=None)
            sections.append(filter_section(inverse_map, tables))
    elif has_filter(inverse_map):
        sections.append(linear_filter_section(inverse_map))
    if inverse_map.thermal is not None:
        sections.append(thermal_section(inverse_map, inverse_map.thermal))
    if has_further_outputs(inverse_map) and inverse_map.further is not None:
        if inverse_map.manifold is not None and inverse_map.manifold.further is not None:
            sections.append(flight_loads_section(inverse_map.manifold.further))
        _, load, unseen = _spread(inverse_map)
        parts = decompose(inverse_map)
        sections.append(further_section(inverse_map.further, parts, load[:, 5:], np.diag(unseen)[5:]))
    known = flow_parameters(inverse_map)
    if known.names:
        sections.append(parameter_section(known))
    manifold = inverse_map.manifold
    if manifold is not None and manifold.parameters is not None:
        further = manifold.further if has_further_outputs(inverse_map) else None
        n_further = 0 if further is None else len(further.variance)
        sections.append(parameter_tables_section(manifold, manifold.parameters, n_further))
    if inverse_map.sensors is not None:
        sections.append(sensor_section(inverse_map.sensors))
    return sections


def _scalars(inverse_map: InverseMap) -> FloatArray:
    """Return start values, and the constants that Python alone states."""
    settings, ranges = default_settings(inverse_map), flight_ranges(inverse_map)
    mach_number = ranges.mach_number * np.array([1.0 - MACH_TOLERANCE, 1.0 + MACH_TOLERANCE])
    bounds = np.concatenate([ranges.dynamic_pressure, mach_number, ranges.altitude])
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
            SMALLEST_SETTING,
            LARGEST_SETTING,
            MAX_DYNAMIC_PRESSURE,
            inverse_map.dynamic_pressure_error,
            inverse_map.chi_square_scale,
            inverse_map.outlier_scale,
            inverse_map.envelope_score_limit,
            *np.clip(bounds, -sys.float_info.max, sys.float_info.max),
            0.5 * HEAT_CAPACITY_RATIO,
            PRESSURE_TOLERANCE,
            MIN_EXPECTED_RATIO,
            NOT_KNOWN,
            inverse_map.regularisation,
            LARGEST_ZERO,
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
        parts.load_covariance,
        _packed_columns(parts.residual_whitening),
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
        inverse_map.noise_covariance,
    )


def _envelope(inverse_map: InverseMap) -> tuple[FloatArray, ...]:
    """Return the layers of the atmosphere, and limits and directions of the half-spaces."""
    envelope, air = half_spaces(inverse_map), layer_table()
    return (air,) if envelope is None else (air, envelope.limit, envelope.direction.T)


def _scaled(inverse_map: InverseMap, parts: Decomposition) -> tuple[FloatArray, ...]:
    """Return what form "dynamic_pressure" needs besides, whose weights follow q_inf."""
    fixed_strain = np.zeros(inverse_map.n_gauges) if inverse_map.fixed_strain is None else inverse_map.fixed_strain
    fixed_load = np.zeros(5) if inverse_map.fixed_load is None else inverse_map.fixed_load
    errors = error_model(inverse_map)
    return (
        parts.whitening.T,
        parts.singular_values,
        parts.load_per_direction[:5].T,
        parts.unseen[:5, :5],
        fixed_strain,
        inverse_map.mean_strain - fixed_strain,
        fixed_load,
        inverse_map.load_of_mean - fixed_load,
        MIN_INFORMATION / np.diag(inverse_map.gauge_covariance),
        inverse_map.gauge_covariance,
        *_of_five(*_spread(inverse_map)),
        *(() if errors is None else (errors.of_gauge, errors.mean_product, errors.common)),
    )


def _spread(inverse_map: InverseMap) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (n_d, n_d) strain and (n_d, n_l) loads, column by column, of what has a prior; (n_l, n_l) of others.

    They stand for errors that scale, and in Case 2 for the states: covariances of strain and loads are the same.
    Loads are the five, then the further ones.
    """
    strain, load = inverse_map.error_strain, inverse_map.error_load
    of_states, further = inverse_map.load_per_state, inverse_map.further
    if further is not None:
        load, of_states = np.vstack([load, further.error_load]), np.vstack([of_states, further.load_per_state])
    if inverse_map.case == 2:
        strain, load = np.hstack([inverse_map.state_operator, strain]), np.hstack([of_states, load])
    n = len(strain)
    whole = np.zeros((max(strain.shape[1], n), n + len(load)))
    whole[: strain.shape[1]] = np.hstack([strain.T, load.T])
    triangle, _ = householder(whole, n)
    rest = triangle[n:, n:]
    return triangle[:n, :n].T, triangle[:n, n:], product(rest.T.copy(), rest)


def _of_five(strain: FloatArray, load: FloatArray, unseen: FloatArray) -> tuple[FloatArray, ...]:
    """Return what :func:`_spread` does, of the five loads alone."""
    return strain, load[:, :5], unseen[:5, :5]


def _rows(array: FloatArray | None) -> int:
    return 0 if array is None else len(array)


def _min_precision(parts: MapParts) -> FloatArray:
    """Return (n_d,) the precision of a gauge [1/(m/m)^2] below which it is round-off: no other gauge checks it."""
    return np.asarray(MIN_INFORMATION * np.sum(parts.noise_whitening**2, axis=0))


def _packed_columns(upper: FloatArray) -> FloatArray:
    """Return the columns of an upper triangle (n, n), one after another without the zeros."""
    return np.concatenate([upper[: j + 1, j] for j in range(len(upper))])
