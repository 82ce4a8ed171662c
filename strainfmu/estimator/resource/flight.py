"""The tables over the flight state as the native FMU reads them: a section of ``resources/map.bin``.

The content of the section is eight 32-bit sizes, of which the last is zero, and float64 values: the scalars, and
the arrays in the order of :func:`_arrays`. ``fmus/native/estimator/tables/flight_map.h`` describes them to the C
code.

Gauges that are rotations of each other have one table. A gauge at roll angle phi reads

    y = p_inf sum_m (E_m cos m(phi - phi_T) + O_m sin m(phi - phi_T)),

E and O the parts of its table that are even and odd about its own meridian. O is zero of every gauge along or
across its meridian, and E is the same all around a station.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, log, sin

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, chi_square_limit
from strainfmu.estimator.linear.isolation import outlier_threshold
from strainfmu.estimator.manifold.air_data import MIN_GAIN, MIN_INCIDENCE_SCORE
from strainfmu.estimator.manifold.flight_health import RANGE_TOLERANCE, outside_score, shape_limit
from strainfmu.estimator.manifold.gauss_newton import LARGEST_STEP
from strainfmu.estimator.manifold.navigation import FALSE_ALARMS, NAVIGATION, NAVIGATION_ALARM, prior
from strainfmu.estimator.manifold.solve import COLD_ITERATIONS, START_ITERATIONS, WARM_ITERATIONS
from strainfmu.estimator.manifold.tracker import RETURN_AFTER, SEARCH_EVERY
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.numerics.fixed_order import product
from strainfmu.estimator.resource.sections import section, sized_numbers
from strainfmu.estimator.tables.flight_tables import MIN_INCIDENCE
from strainfmu.estimator.tables.further_tables import FurtherTables
from strainfmu.estimator.tables.manifold_map import ManifoldMap

SECTION = b"FLIGHT\0\0"
LOADS_SECTION = b"FLOADS\0\0"

ROUND_OFF = 1e-13
"""Difference of two tables, in parts of their largest value, that counts as none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelTables:
    """Tables of strain and loads without repetition.

    Attributes
    ----------
    table : (n_M + 2, n_a + 2, n_c, n_m) spline coefficients of each channel per p_inf.
    row, channel : (n_t,) row of the response that a term adds to, ascending, and its channel.
    cosine, sine : (n_t, n_m) factors of cos m phi_T and sin m phi_T in a term.
    """

    table: FloatArray
    row: FloatArray
    channel: FloatArray
    cosine: FloatArray
    sine: FloatArray

    @property
    def arrays(self) -> tuple[FloatArray, ...]:
        """In the order of the C structure ``TableMap``, behind the knots."""
        return self.table, self.row, self.channel, self.cosine, self.sine


def flight_section(inverse_map: InverseMap, manifold: ManifoldMap) -> bytes:
    """Return the section of the tables of ``inverse_map``."""
    channels = channel_tables(manifold.response, np.arctan2(*inverse_map.gauge_position[:, 1:].T))
    n_channels, n_m = channels.table.shape[2:]
    sizes = (len(manifold.mach_knots), len(manifold.incidence_knots), n_m, n_channels)
    errors = (len(manifold.common_error), manifold.shapes.shape[1])
    numbers = (_scalars(manifold), *_arrays(manifold, channels))
    return section(SECTION, sized_numbers((*sizes, len(channels.row), *errors), numbers))


def flight_loads_section(further: FurtherTables) -> bytes:
    """Return the section of the m ``further`` loads over the flight state: sizes, tables, errors per p_inf^2.

    ``fmus/native/estimator/manifold/flight_further.h`` describes it to the C code.
    """
    channels = channel_tables(further.response, np.zeros(0))
    numbers = (*channels.arrays, further.fixed_response, further.strain_covariance, further.variance)
    sizes = (len(further.variance), channels.table.shape[2], len(channels.row))
    return section(LOADS_SECTION, sized_numbers(sizes, numbers))


def _scalars(manifold: ManifoldMap) -> FloatArray:
    """Return the scalars of the map, and the constants that Python alone states."""
    mean, precision = prior(manifold)
    low, high = manifold.pressure_range.tolist()
    n = manifold.tables.n_gauges
    return np.array(
        [
            manifold.reference_area,
            manifold.reference_length,
            *manifold.mach_range,
            low,
            high,
            log(low),
            log(high),
            float(np.log(manifold.pressure_range).mean()),
            manifold.incidence_limit,
            float(manifold.crossflow_range is not None),
            *manifold.crossflow.middle,
            *manifold.crossflow.half,
            manifold.mach_number_error,
            manifold.static_pressure_error,
            manifold.dynamic_pressure_error,
            manifold.altitude_error,
            manifold.chi_square_scale,
            manifold.outlier_scale,
            *mean,
            *precision,
            *LARGEST_STEP,
            *(outlier_threshold(1, rate) for rate in FALSE_ALARMS),
            NAVIGATION_ALARM,
            shape_limit(manifold, 1.0),
            outlier_threshold(n, FALSE_ALARM_PROBABILITY),
            MIN_INCIDENCE,
            outside_score(manifold),
            RANGE_TOLERANCE,
            MIN_GAIN,
            MIN_INCIDENCE_SCORE,
            0.5 * HEAT_CAPACITY_RATIO,
            log(0.5 * HEAT_CAPACITY_RATIO),
            SEARCH_EVERY,
            RETURN_AFTER,
            START_ITERATIONS,
            COLD_ITERATIONS,
            WARM_ITERATIONS,
        ]
    )


def _arrays(manifold: ManifoldMap, channels: ChannelTables) -> tuple[FloatArray, ...]:
    """Return the arrays of the C structure ``FlightMap``, in its order."""
    strain, load = manifold.error_strain, manifold.error_load
    n = manifold.tables.n_gauges
    return (
        manifold.mach_knots,
        manifold.incidence_knots,
        *channels.arrays,
        manifold.fixed_response,
        manifold.gain_std,
        manifold.common_gain,
        manifold.gauge_covariance,
        product(strain, strain.T),
        product(load, strain.T),
        product(load, load.T),
        manifold.gauge_error_product,
        manifold.common_error,
        manifold.shapes.T,
        np.array([chi_square_limit(max(freedom, 1)) for freedom in range(n + len(NAVIGATION) + 1)]),
    )


def channel_tables(response: FloatArray, roll_angle: FloatArray) -> ChannelTables:
    """Return the tables ``response`` (n_M + 2, n_a + 2, n_r, n_m, 2) without repetition.

    ``roll_angle`` (n_d,) is that of the gauges [rad], the first n_d of the n_r rows.
    """
    found: list[FloatArray] = []
    terms: list[tuple[int, int, FloatArray, FloatArray]] = []
    for row in range(response.shape[2]):
        of_cosine, of_sine = response[:, :, row, :, 0], response[:, :, row, :, 1]
        largest = float(np.max(np.abs(response[:, :, row])))
        phase = _own_angle(of_cosine, of_sine, float(roll_angle[row]) if row < len(roll_angle) else 0.0)
        for first, second, value in _parts(of_cosine, of_sine, phase):
            if np.max(np.abs(value)) > ROUND_OFF * largest or (first is phase[0] and largest == 0.0):
                terms.append((row, _channel_of(found, value), first, second))
    return ChannelTables(
        table=np.stack(found, axis=2),
        row=np.array([term[0] for term in terms], dtype=float),
        channel=np.array([term[1] for term in terms], dtype=float),
        cosine=np.stack([term[2] for term in terms]),
        sine=np.stack([term[3] for term in terms]),
    )


_Phase = tuple[FloatArray, FloatArray]


def _parts(of_cosine: FloatArray, of_sine: FloatArray, phase: _Phase) -> list[tuple[FloatArray, ...]]:
    """Return factors of cos m phi_T and of sin m phi_T, and table, of the even part and of the odd part."""
    c, s = phase
    return [(c, s, of_cosine * c + of_sine * s), (s, -c, of_cosine * s - of_sine * c)]


def _own_angle(of_cosine: FloatArray, of_sine: FloatArray, position: float) -> _Phase:
    """Return cos m phi and sin m phi (n_m,) of the angle about which the table is even, if there is one.

    The angle is ``position``, that of the first harmonic, or 0, whichever leaves the smallest odd part.
    """
    a, b = of_cosine[:, :, 1:2], of_sine[:, :, 1:2]
    of_first = 0.5 * atan2(2.0 * float(np.sum(a * b)), float(np.sum(a * a - b * b)))
    harmonics = range(of_cosine.shape[2])
    phases = [
        (np.array([cos(m * phi) for m in harmonics]), np.array([sin(m * phi) for m in harmonics]))
        for phi in (position, of_first, 0.0)
    ]
    odd = [float(np.max(np.abs(of_cosine * s - of_sine * c))) for c, s in phases]
    smallest = min(odd)
    largest = float(max(np.max(np.abs(of_cosine)), np.max(np.abs(of_sine))))
    return next(one for one, size in zip(phases, odd, strict=True) if size <= smallest + ROUND_OFF * largest)


def _channel_of(found: list[FloatArray], value: FloatArray) -> int:
    """Return the number of the channel of ``found`` that is ``value``, which joins them if none is."""
    limit = ROUND_OFF * float(np.max(np.abs(value)))
    for number, one in enumerate(found):
        if np.max(np.abs(one - value)) <= limit:
            return number
    found.append(value)
    return len(found) - 1
