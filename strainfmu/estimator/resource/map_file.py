"""The inverse map as the compiled estimator reads it: ``map.bin``, a container of named arrays.

:mod:`strainfmu.resource_file` writes the container, ``fmus/native/estimator/map/map.h`` reads the arrays.

A name is PART.VALUE. Values that are fields of a map have their place in its schema; :data:`DERIVED` lists what
follows from them, :data:`PARTS` the parts that not every map has. A bound that a map does not state is the largest
finite number.

Every value has the same bits on every machine (:mod:`strainfmu.estimator.numerics`). Gains, whitening
and directions of the linear estimator follow from them: the compiled estimator computes these as it opens a map.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import log
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import layer_table
from strainfmu.estimator import health, settings, tare
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, NAVIGATION
from strainfmu.estimator.map import validity
from strainfmu.estimator.map.inverse_map import InverseMap, groups_of_outputs, has_filter
from strainfmu.estimator.map.nonlinear_map import ManifoldMap, Powers
from strainfmu.estimator.map.schema import (
    BOUNDS,
    FROM_0,
    INCREASING,
    POSITIVE,
    Entry,
    MapRecord,
    entries,
    entry,
    stored_value,
)
from strainfmu.estimator.map.sensors import CHANNELS, InertiaMap, SensorRows, ThermalMap
from strainfmu.estimator.numerics import arrow_triangle, householder, product
from strainfmu.estimator.other_loads import FIVE_LOADS, OTHER_LOADS, load_arrays
from strainfmu.estimator.policies import POLICIES, Policies
from strainfmu.estimator.resource.compact_tables import ChannelTables, channel_tables, error_products, factors
from strainfmu.estimator.signal_names import STRAIN, TARE
from strainfmu.resource_file import container, texts, with_header

MAGIC = b"SFMUMAP\0"
FORMAT_VERSION = 8

GUID_SIZE = 80
PARAMETER_NAME_SIZE = OUTPUT_NAME_SIZE = 48
"""Bytes of the guid, of the name of a parameter, of an array of outputs; with a final zero."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Spread(MapRecord, where="spread"):
    """What has a prior, as columns."""

    # fmt: off
    strain: FloatArray = entry("n_d n_d", "m/m", "N of what has a prior, N N' the sum over its columns",
        place="scaled.spread")
    load: FloatArray = entry("n_d n_f", "N, N.m", "loads of its columns", place="scaled.spread_load",
        stored="n_d 5")
    unseen: FloatArray = entry("n_f n_f", "", "what those columns do not hold", place="scaled.spread_unseen",
        stored="5 5")
    # fmt: on


class Source:
    """What values of ``map.bin`` follow from: a map, the strain of loads during a tare, and what several need."""

    def __init__(self, inverse_map: InverseMap, known: tare.KnownStrain) -> None:
        self.map, self.known = inverse_map, known
        self.tables: Any = inverse_map.manifold
        self.settings = settings.default_settings(inverse_map)
        self.parameters = validity.flow_parameters(inverse_map)
        self.load_arrays = load_arrays(inverse_map.load_groups)
        # In form "absolute" nothing follows q_inf.
        self.fixed_strain = inverse_map.fixed_strain * inverse_map.follows_pressure
        self.fixed_load = inverse_map.fixed_load * inverse_map.follows_pressure

    @cached_property
    def error_triangle(self) -> tuple[FloatArray, FloatArray]:
        """Strain and loads of the errors that scale, the gauges' own among them: R, and what it leaves."""
        columns = np.vstack([self.map.error_strain, self.map.error_load]).T
        return arrow_triangle(self.map.own_error_strain, columns)

    @cached_property
    def stored(self) -> InverseMap:
        """The map with all errors that scale as columns, but of many gauges."""
        n, of_file = self.map.n_gauges, self.map
        if of_file.is_low_rank or not of_file.own_error_strain.any():
            return of_file
        triangle, rest = self.error_triangle
        hidden = householder(rest[:, n:])[0][: of_file.n_loads]
        strain = np.vstack([triangle[:, :n], np.zeros((len(hidden), n))]).T
        load = np.vstack([triangle[:, n:], hidden]).T
        return replace(of_file, own_error_strain=np.zeros(0), error_strain=strain, error_load=load)

    @cached_property
    def spread(self) -> Spread:
        """Errors that scale, and in Case 2 the states: covariances of strain and loads are the same.

        In form "absolute" nothing scales: errors are noise, and states alone are columns.
        """
        n, follows = self.map.n_gauges, self.map.follows_pressure
        if self.map.case == 1 and follows:
            triangle, rest = self.error_triangle
        else:
            of_states, of_errors = slice(None if self.map.case == 2 else 0), slice(None if follows else 0)
            strain = [self.map.state_operator[:, of_states], self.map.error_strain[:, of_errors]]
            load = [self.map.load_per_state[:, of_states], self.map.error_load[:, of_errors]]
            columns = np.vstack([np.hstack(strain), np.hstack(load)]).T
            triangle, rest = arrow_triangle(self.map.own_error_strain * follows, columns)
        rest = rest[:, n:]
        return Spread(strain=triangle[:, :n].T, load=triangle[:, n:], unseen=product(rest.T.copy(), rest))

    @cached_property
    def channels(self) -> dict[str, ChannelTables]:
        """Tables without repetition by part."""
        roll_angle = np.arctan2(*self.map.gauge_position[:, 1:].T)
        response, fixed = self.tables.response, self.tables.fixed_response
        n, considered = self.tables.n_gauges + FIVE_LOADS.stop, self.tables.considered_tables
        tables = {"flight": channel_tables(response[:, :, :n], fixed[:n], roll_angle)}
        if considered is not None:
            tables["considered"] = channel_tables(considered.response, considered.fixed_response, roll_angle)
        if self.map.has_other_loads:
            tables["flight_loads"] = channel_tables(response[:, :, n:], fixed[n:], np.zeros(0))
        return tables

    @cached_property
    def factors(self) -> tuple[FloatArray, FloatArray]:
        """Tables of flow parameters as sums of few."""
        return factors(self.tables.parameters.slope)


def white_noise(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d,) variances of what is independent from sample to sample in the readings.

    A covariance of the gauges below the one of their noise has less noise than stated.
    """
    if inverse_map.is_low_rank:
        return np.minimum(inverse_map.gauge_variance, inverse_map.noise_std**2)
    covariance = inverse_map.gauge_covariance
    if inverse_map.thermal_and_inertia.n_modes:
        covariance = inverse_map.thermal_and_inertia.isothermal_covariance
    elif inverse_map.manifold is not None:
        covariance = inverse_map.manifold.gauge_covariance
    std = inverse_map.noise_std
    smallest = float(np.linalg.eigvalsh(covariance / (std[:, None] * std))[0])
    return np.asarray(min(1.0, smallest) * std**2)


def _outlier_threshold(n_gauges: int) -> float:
    return health.outlier_threshold(n_gauges, health.FALSE_ALARM_PROBABILITY)


def _bounds(value: FloatArray) -> FloatArray:
    return np.clip(value, -sys.float_info.max, sys.float_info.max)


def _tables(part: str) -> tuple[Entry, ...]:
    """Return the arrays of tables without repetition."""

    def array(name: str, stated: Entry) -> Entry:
        return replace(stated, place=f"{part}.{name}", value=lambda s: getattr(s.channels[part], name))

    return tuple(array(name, stated) for name, stated in entries(ChannelTables).items())


def _covariances(place: str, before: str, columns: str, errors: str) -> tuple[Entry, ...]:
    """Return the covariances of ``errors``, whose fields begin with ``columns``.

    They are of strain, at ``place``, of the five loads and of the others, under names that begin with ``before``.
    """

    def parts(source: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
        strain, load = (getattr(source.tables, f"{columns}_{rows}") for rows in (STRAIN, "load"))
        return strain, load[FIVE_LOADS], load[OTHER_LOADS]

    def covariance(first: int, second: int) -> Callable[[Any], FloatArray]:
        return lambda source: product(parts(source)[first], parts(source)[second].T)

    strain, five, others = range(3)
    # fmt: off
    return (
        Entry(place, f"of {errors}", covariance(strain, strain), "n_gauges n_gauges", unit="1/Pa^2"),
        Entry(f"flight.{before}load_strain_covariance", "the same of loads with strain", covariance(five, strain),
            "5 n_gauges", unit=""),
        Entry(f"flight.{before}load_covariance", "the same of loads", covariance(five, five), "5 5", unit=""),
        Entry(f"flight_loads.{before}strain_covariance", f"with strain, of {errors}", covariance(others, strain),
            "n_loads n_gauges", unit=""),
        Entry(f"flight_loads.{before}variance", "the same of each load",
            lambda s: np.sum(parts(s)[others] ** 2, axis=1), "n_loads", unit=""),
    )
    # fmt: on


# fmt: off
DERIVED: tuple[Entry, ...] = (
    Entry("linear.degrees_of_freedom", "of the residual with all gauges",
        lambda s: s.map.residual_degrees_of_freedom, kind="whole", low=1, high="n_gauges"),
    Entry("linear.known_prior", "1 in Case 2: any gauge identifies the state", lambda s: s.map.case == 2,
        kind="whole", low=0, high=1),
    Entry("linear.chi_square_limit", "by degrees of freedom from 1 on",
        lambda s: [health.chi_square_limit(freedom) for freedom in range(1, s.map.n_gauges + 1)], "n_gauges",
        rule=POSITIVE),
    Entry("linear.outlier_threshold", "by the number of gauges from 1 on",
        lambda s: [_outlier_threshold(n) for n in range(1, s.map.n_gauges + 1)], "n_gauges", rule=POSITIVE),
    Entry("settings.reference_area", "what the map was built with", lambda s: s.settings.reference_area,
        unit="m2"),
    Entry("settings.reference_length", "the same", lambda s: s.settings.reference_length, unit="m"),
    Entry("settings.moment_station", "the same", lambda s: s.settings.moment_station, unit="m"),
    Entry("settings.sensor_range", "start value", lambda s: s.settings.sensor_range),
    Entry(f"envelope.{DYNAMIC_PRESSURE}", "smallest and largest, may be infinite",
        lambda s: _bounds(s.map.dynamic_pressure_range), "2", unit="Pa", rule=BOUNDS, kind="values"),
    Entry(f"envelope.{MACH_NUMBER}", "the same",
        lambda s: _bounds(s.map.mach_number_range * (1.0 + POLICIES.mach_tolerance * np.array([-1.0, 1.0]))), "2",
        rule=BOUNDS, kind="values"),
    Entry(f"envelope.{ALTITUDE}", "the same", lambda s: _bounds(s.map.altitude_range), "2", unit="m", rule=BOUNDS,
        kind="values"),
    Entry("envelope.layers", "of the atmosphere", layer_table(), "n_layers LAYER_SIZE", unit=""),
    Entry("scaled.follows_pressure", "whether the form is dynamic_pressure", lambda s: s.map.follows_pressure,
        kind="whole", low=0, high=1),
    Entry("scaled.fixed_strain", "d_0", lambda s: s.fixed_strain, "n_gauges", unit="m/m"),
    Entry("scaled.mean_strain", "m - d_0, at the nominal dynamic pressure",
        lambda s: s.map.mean_strain - s.fixed_strain, "n_gauges", unit="m/m"),
    Entry("scaled.fixed_load", "f_0", lambda s: s.fixed_load[FIVE_LOADS], "5", unit="N, N.m"),
    Entry("scaled.load_of_mean", "f_mean - f_0", lambda s: (s.map.load_of_mean - s.fixed_load)[FIVE_LOADS], "5",
        unit="N, N.m"),
    Entry("low_rank.noise_variance", "variances of errors of each gauge alone that do not scale",
        lambda s: s.map.gauge_variance, "n_gauges", unit="(m/m)^2", rule=POSITIVE),
    Entry("low_rank.own_variance", "of those that scale", lambda s: s.map.own_error_strain**2, "n_gauges",
        unit="(m/m)^2", rule=FROM_0),
    Entry("low_rank.common_variance", "of an error that does not scale and is the same of all gauges",
        lambda s: s.map.common_variance, unit="(m/m)^2", low=0.0),
    Entry("other_loads.array_name", "names of the arrays of outputs",
        lambda s: texts("other loads", [array.name for array in s.load_arrays], OUTPUT_NAME_SIZE),
        "n_arrays OUTPUT_NAME_SIZE", kind="text"),
    Entry("other_loads.array_value", "what each holds: loads, their standard deviations, the same of coefficients",
        lambda s: np.array([array.value for array in s.load_arrays], dtype=float), "n_arrays"),
    Entry("other_loads.array_first", "the first of its loads",
        lambda s: np.array([array.group.first for array in s.load_arrays], dtype=float), "n_arrays"),
    Entry("other_loads.array_size", "and how many they are",
        lambda s: np.array([array.group.size for array in s.load_arrays], dtype=float), "n_arrays"),
    Entry("other_loads.like", "which of the five loads its standard deviation grows as; 5: the widest",
        lambda s: np.array([float(group.load.like) for group in s.map.load_groups for _ in range(group.size)]),
        "n_loads"),
    Entry("other_loads.is_moment", "0 or 1", lambda s: s.map.is_moment[OTHER_LOADS].astype(float), "n_loads"),
    Entry("other_loads.fixed_load", "f_0", lambda s: s.fixed_load[OTHER_LOADS], "n_loads", unit="N, N.m"),
    Entry("other_loads.load_of_mean", "f_mean - f_0", lambda s: (s.map.load_of_mean - s.fixed_load)[OTHER_LOADS],
        "n_loads", unit="N, N.m"),
    Entry("other_loads.load_per_state", "M", lambda s: s.map.load_per_state[OTHER_LOADS].T, "n_states n_loads",
        unit="N/state, N.m/state"),
    Entry("other_loads.spread_load", "loads of the columns of spread", lambda s: s.spread.load[:, OTHER_LOADS],
        "n_gauges n_loads", unit="N, N.m"),
    Entry("other_loads.spread_unseen", "variances of what those do not hold",
        lambda s: np.diag(s.spread.unseen)[OTHER_LOADS], "n_loads", unit=""),
    Entry("filter.noise", "variances of what is independent from sample to sample", lambda s: white_noise(s.map),
        "n_gauges", unit="(m/m)^2", rule=POSITIVE),
    Entry("thermal.scaled_covariance", "of the errors that scale",
        lambda s: s.map.scaled_covariance, "n_gauges n_gauges", unit="(m/m)^2"),
    Entry("inertia.channels", "of the sensors, the last: of an inertial unit", len(CHANNELS),
        kind="count", low=1, high=4096, member="n_channels"),
    Entry("inertia.vibrations", "of the modes, the last: of vibration, whose size is an input",
        lambda s: s.map.inertia.vibration_strain.shape[1], kind="count", low=0, high=4096, member="n_vibrations"),
    Entry("parameters.span", "width of the range, at least the size of a value that is fixed",
        lambda s: s.parameters.span, "n_parameters", unit="", rule=POSITIVE),
    Entry("parameters.names", "as in the vehicle file",
        lambda s: texts("parameters", s.parameters.names, PARAMETER_NAME_SIZE),
        "n_parameters PARAMETER_NAME_SIZE", kind="text"),
    Entry("angles.incidence_per_force", "largest total angle of attack over the largest lateral coefficient",
        lambda s: validity.incidence_per_force(s.map), unit="rad", rule=POSITIVE),
    Entry(f"{TARE}.known_strain", "of the loads that act meanwhile", lambda s: s.known.value, "n_strains",
        unit="m/m"),
    Entry(f"{TARE}.known_std", "its standard deviation", lambda s: s.known.std, "n_strains", unit="m/m",
        rule=FROM_0),
    Entry(f"{TARE}.pattern", "orthonormal strains of flights", lambda s: tare.load_patterns(s.map),
        "n_patterns n_strains"),
    Entry(f"{TARE}.load_odds", "threshold of the part along them by the number of gauges",
        lambda s: tare.load_odds(s.map), "n_strains+1"),
    *_tables("flight"),
    Entry("flight.log_pressure_range", "ln(p_inf / Pa)",
        lambda s: [log(p) for p in s.tables.pressure_range.tolist()], "2", rule=INCREASING, kind="values"),
    Entry("flight.middle_log_pressure", "the same", lambda s: np.log(s.tables.pressure_range).mean()),
    Entry("flight.has_crossflow_range", "1, or 0: incidence_limit at every aerodynamic roll angle",
        lambda s: s.tables.crossflow_range is not None, kind="whole", low=0, high=1),
    Entry("flight.crossflow_middle", "of the ranges of u and w", lambda s: s.tables.crossflow[0], "2",
        unit="rad", kind="values"),
    Entry("flight.crossflow_half", "half widths of these", lambda s: s.tables.crossflow[1], "2", unit="rad",
        rule=POSITIVE, kind="values"),
    Entry("flight.outside_score", "of the flight state from which it is outside",
        lambda s: s.tables.outside_score),
    Entry("flight.navigation_error",
        "of navigation without a standard deviation: of M, relative of p_inf and q_inf",
        lambda s: [getattr(s.tables, f"{name}_error") for name in NAVIGATION], "3", kind="values"),
    Entry("flight.prior_mean", "of the flight state where nothing is known",
        lambda s: s.tables.state_prior[0], "4", unit="", kind="values"),
    Entry("flight.prior_precision", "its inverse variance", lambda s: 1.0 / s.tables.state_prior[1]**2, "4",
        unit="", rule=POSITIVE, kind="values"),
    Entry("flight.shape_limit", "sum of squares of discrepancy modes from which strain does not fit",
        lambda s: s.tables.shape_limit),
    Entry("flight.outlier_threshold", "of the largest leave-one-out residual",
        lambda s: _outlier_threshold(s.tables.n_gauges)),
    Entry("flight.chi_square_limit", "by degrees of freedom from 0 on",
        lambda s: [health.chi_square_limit(max(k, 1)) for k in range(s.tables.n_gauges + len(NAVIGATION) + 1)],
        "n_gauges+4"),
    Entry("flight.gain_std", "error of each gain, relative", lambda s: s.tables.gain_std, "n_gauges"),
    Entry("flight.common_gain", "error that gains have in common, in each of them",
        lambda s: s.tables.common_gain, "n_gauges"),
    *_covariances("flight.scaled_covariance", "", "error", "errors that the gain may correct, per p_inf^2"),
    *_covariances("flight.considered_covariance", "considered_", "considered", "considered errors"),
    Entry("flight.considered_common", "considered ones of common_error", lambda s: s.tables.considered_common,
        "n_considered_common 6 n_gauges", unit="1/Pa"),
    Entry("flight.shapes", "discrepancy modes", lambda s: s.tables.discrepancy_shapes.T, "n_shapes n_gauges"),
    *_tables("considered"),
    *_tables("flight_loads"),
    Entry("parameter_tables.basis", "tables, orthonormal, whose sums by", lambda s: s.factors[0],
        "n_basis n_incidence+2 n_harmonics 2"),
    Entry("parameter_tables.row_weight", "are of a unit of a power, per p_inf", lambda s: s.factors[1],
        "n_mach+2 n_powers n_rows n_basis", unit="1/Pa, m2, m3"),
    Entry("parameter_tables.product",
        "of errors, per p_inf^2: of those that no parameter makes; of pairs of powers; of each spread",
        lambda s: error_products(s.tables.parameters, s.tables.n_gauges, s.tables.n_loads),
        "n_products product_size", unit=""),
)
# fmt: on
"""Values that follow from a map, from bounds of settings and from policies."""

RECORDS: tuple[tuple[type[Any], Callable[[Source], Any], dict[str, str]], ...] = (
    (
        InverseMap,
        lambda s: s.stored,
        {"n_d": "n_gauges", "n_q": "n_states", "k": "n_errors", "n_e": "n_terms", "m": "n_half_spaces"},
    ),
    (
        ThermalMap,
        lambda s: s.map.thermal_and_inertia,
        {"n_d": "n_gauges", "k": "n_modes", "n_t": "n_sensors", "j": "n_powers"},
    ),
    (InertiaMap, lambda s: s.map.inertia, {}),
    (SensorRows, lambda s: s.map.sensors, {}),
    (
        ManifoldMap,
        lambda s: s.tables,
        {"n_d": "n_gauges", "n_M": "n_mach", "n_a": "n_incidence", "n_e": "n_common"},
    ),
    (Powers, lambda s: s.tables.parameters.powers, {"n_p": "n_parameters", "J": "n_powers"}),
    (Spread, lambda s: s.spread, {"n_d": "n_gauges"}),
    (validity.FlowParameters, lambda s: s.parameters, {"n_p": "n_parameters"}),
    (Policies, lambda s: POLICIES, {}),
    (tare.TareLimits, lambda s: tare.TareLimits(), {}),
)
"""Records of a map whose fields have places in ``map.bin``, where they come from, and their symbols there."""

PARTS: dict[str, Callable[[InverseMap], bool]] = {
    "low_rank": lambda m: m.is_low_rank,
    "scaled_errors": lambda m: m.follows_pressure and m.errors_follow_strain,
    "other_loads": lambda m: m.follows_pressure and bool(groups_of_outputs(m)),
    "filter": has_filter,
    "thermal": lambda m: m.thermal_and_inertia.n_modes > 0,
    "inertia": lambda m: m.has_masses,
    "vehicle": lambda m: m.inertia is not None and m.inertia.vehicle_mass is not None,
    "parameters": lambda m: bool(validity.flow_parameters(m).names),
    "angles": lambda m: validity.incidence_per_force(m) > 0.0,
    "sensors": lambda m: m.has_auxiliary_sensors,
    "flight": lambda m: m.manifold is not None,
    "considered": lambda m: m.manifold is not None and m.manifold.considered_tables is not None,
    "flight_loads": lambda m: m.manifold is not None and m.has_other_loads,
    "parameter_tables": lambda m: m.manifold is not None and m.manifold.parameters is not None,
}
"""Whether a map has a part; it has those that are not here."""

OF_FEW_GAUGES = {
    "linear.gauge_covariance",
    *(f"scaled.{name}" for name in ("spread", "spread_load", "spread_unseen")),
}
"""Arrays that a map with the part "low_rank" does not have."""


def _field_arrays() -> tuple[Entry, ...]:
    """Return the arrays of ``map.bin`` that are fields of a map, with symbols as there."""

    def array(name: str, stated: Entry, record: Callable[[Source], Any], symbols: Mapping[str, str]) -> Entry:
        def value(source: Source) -> FloatArray:
            return stored_value(getattr(record(source), name), stated, source.map.n_strain_gauges)

        axes = (stated.stored or stated.shape).split()
        return replace(stated, shape=" ".join(symbols.get(axis, axis) for axis in axes), value=value)

    return tuple(
        array(name, stated, record, symbols)
        for kind, record, symbols in RECORDS
        for name, stated in entries(kind).items()
        if stated.place
    )


LAYOUT = (*_field_arrays(), *DERIVED)
"""All arrays of ``map.bin`` but the guid."""


def native_resource(inverse_map: InverseMap, guid: str, known: tare.KnownStrain | None = None) -> bytes:
    """Return the content of ``map.bin`` for ``inverse_map``, which instances with another ``guid`` refuse.

    ``known`` is the strain of the loads that act while a tare is taken; None for none.
    """
    arrays = {"guid": texts("guid", [guid], GUID_SIZE), **map_arrays(inverse_map, known)}
    return with_header(MAGIC, FORMAT_VERSION, container(arrays))


def map_arrays(inverse_map: InverseMap, known: tare.KnownStrain | None = None) -> dict[str, np.ndarray]:
    """Return the arrays of ``map.bin`` by name, but for the guid."""
    source = Source(inverse_map, known or tare.KnownStrain(value=np.zeros(inverse_map.n_strain_gauges)))
    absent = {part for part, is_in in PARTS.items() if not is_in(inverse_map)}
    absent |= OF_FEW_GAUGES if inverse_map.is_low_rank else set()
    present = [array for array in LAYOUT if not {array.part, array.place} & absent]
    return {
        array.place: np.asarray(array.value(source) if callable(array.value) else array.value) for array in present
    }
