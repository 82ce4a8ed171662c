"""The inverse map as the compiled estimator reads it: ``map.bin``, arrays by name (:mod:`.container`).

A name is PART.VALUE. Values that are fields of a map have their place in its schema; :data:`DERIVED` and the table
of :mod:`~strainfmu.estimator.resource.nonlinear_arrays` list what follows from them, :data:`PARTS` the parts that
not every map has. A bound that a map does not state is the largest finite number.

Every value has the same bits on every machine (:mod:`strainfmu.estimator.numerics.fixed_order`). Gains, whitening
and directions of the linear estimator follow from them: the compiled estimator computes these as it opens a map.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, layer_table
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER
from strainfmu.estimator.alarm_limits import AMBIGUOUS_CORRELATION, outlier_threshold
from strainfmu.estimator.arguments import NOT_KNOWN
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, chi_square_limit
from strainfmu.estimator.map.envelope import (
    MACH_TOLERANCE,
    MAX_DYNAMIC_PRESSURE,
    MIN_DYNAMIC_PRESSURE,
    PRESSURE_TOLERANCE,
)
from strainfmu.estimator.map.flow_parameters import LARGEST_SCORE, PARAMETER_TOLERANCE, flow_parameters
from strainfmu.estimator.map.inertia import CHANNELS, InertiaMap
from strainfmu.estimator.map.inverse_map import InverseMap, has_filter, has_other_outputs
from strainfmu.estimator.map.sensors import SensorRows
from strainfmu.estimator.map.temperature import LARGEST_RISE, ThermalMap
from strainfmu.estimator.map.validity import incidence_per_force
from strainfmu.estimator.numerics.fixed_order import product
from strainfmu.estimator.other_loads import FIVE_LOADS, OTHER_LOADS
from strainfmu.estimator.policies import (
    ANGLE_RATE,
    LARGEST_TIME,
    LOG_PRESSURE_RATE,
    MACH_NUMBER_RATE,
    MIN_EXPECTED_RATIO,
    MIN_INFORMATION,
    SMALLEST_TIME,
    WHITE_NAVIGATION,
)
from strainfmu.estimator.resource import nonlinear_arrays
from strainfmu.estimator.resource.container import pack, texts
from strainfmu.estimator.resource.source import Source, white_noise
from strainfmu.estimator.setting_inputs import OF_AREA, OF_LENGTH, OF_READINGS
from strainfmu.estimator.settings import LARGEST_SETTING, SMALLEST_SETTING
from strainfmu.estimator.signal_names import TARE
from strainfmu.estimator.tables.manifold_map import ManifoldMap
from strainfmu.estimator.tables.parameter_tables import Powers
from strainfmu.estimator.tables.schema import FROM_0, POSITIVE, Stored, derived, stored_arrays, stored_value
from strainfmu.estimator.zeros.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.zeros.load_patterns import load_odds, load_patterns
from strainfmu.estimator.zeros.tare import (
    LEAST_GAUGES,
    LEAST_PART,
    LEAST_SAMPLES,
    LOUD,
    MOVED,
    OWN_FACTOR,
    KnownStrain,
    TareLimits,
)

GUID_SIZE = 80
PARAMETER_NAME_SIZE = OUTPUT_NAME_SIZE = 48
"""Bytes of the guid, of the name of a parameter, of an array of outputs; with a final zero."""

_LARGEST = sys.float_info.max
_LIMITS = TareLimits()


def _bounds(value: FloatArray) -> FloatArray:
    return np.clip(value, -_LARGEST, _LARGEST)


# fmt: off
DERIVED: tuple[Stored, ...] = (
    derived("linear.degrees_of_freedom", "of the residual with all gauges",
        lambda s: s.map.residual_degrees_of_freedom, whole=(1, "n_gauges")),
    derived("linear.known_prior", "1 in Case 2: any gauge identifies the state", lambda s: s.map.case == 2,
        whole=(0, 1)),
    derived("linear.chi_square_limit", "by degrees of freedom from 1 on",
        lambda s: [chi_square_limit(freedom) for freedom in range(1, s.map.n_gauges + 1)], "n_gauges",
        rule=POSITIVE),
    derived("linear.outlier_threshold", "by the number of gauges from 1 on",
        lambda s: [outlier_threshold(n, FALSE_ALARM_PROBABILITY) for n in range(1, s.map.n_gauges + 1)],
        "n_gauges", rule=POSITIVE),
    derived("linear.min_information", "below which gauges do not identify the state", lambda s: MIN_INFORMATION),
    derived("linear.ambiguous_correlation", "above which gauges cannot be distinguished",
        lambda s: AMBIGUOUS_CORRELATION),
    derived("linear.min_dynamic_pressure", "below which there are no coefficients", lambda s: MIN_DYNAMIC_PRESSURE,
        unit="Pa", rule=POSITIVE),
    derived("linear.max_dynamic_pressure", "above which there are none", lambda s: MAX_DYNAMIC_PRESSURE,
        unit="Pa"),
    derived("settings.smallest", "bounds of settings", lambda s: SMALLEST_SETTING,
        bounds=(sys.float_info.min, 1.0), member="smallest_setting"),
    derived("settings.largest", "the same", lambda s: LARGEST_SETTING, bounds=(1.0, _LARGEST),
        member="largest_setting"),
    derived(f"settings.{OF_AREA}", "what the map was built with", lambda s: s.settings.reference_area, unit="m2"),
    derived(f"settings.{OF_LENGTH}", "the same", lambda s: s.settings.reference_length, unit="m"),
    derived("settings.moment_station", "the same", lambda s: s.settings.moment_station, unit="m"),
    derived(f"settings.{OF_READINGS}", "start value", lambda s: s.settings.sensor_range),
    derived("settings.largest_zero", "of zero offsets and their standard deviations", lambda s: LARGEST_ZERO,
        bounds=(0.0, _LARGEST)),
    derived("settings.not_known",
        "start value of flow parameters, and a value of thrust, that means what NaN does", lambda s: NOT_KNOWN),
    derived(f"envelope.{DYNAMIC_PRESSURE}", "smallest and largest, may be infinite",
        lambda s: _bounds(s.ranges.dynamic_pressure), "2", unit="Pa", rule="BOUNDS", kind="values"),
    derived(f"envelope.{MACH_NUMBER}", "the same",
        lambda s: _bounds(s.ranges.mach_number * np.array([1.0 - MACH_TOLERANCE, 1.0 + MACH_TOLERANCE])), "2",
        rule="BOUNDS", kind="values"),
    derived(f"envelope.{ALTITUDE}", "the same", lambda s: _bounds(s.ranges.altitude), "2", unit="m", rule="BOUNDS",
        kind="values"),
    derived("envelope.half_gamma", "q = half_gamma M^2 p(h)", lambda s: 0.5 * HEAT_CAPACITY_RATIO),
    derived("envelope.pressure_tolerance", "relative difference of the two that is no contradiction",
        lambda s: PRESSURE_TOLERANCE),
    derived("envelope.layers", "of the atmosphere", lambda s: layer_table(), "n_layers LAYER_SIZE", unit=""),
    derived("scaled.follows_pressure", "whether the form is dynamic_pressure", lambda s: s.map.follows_pressure,
        whole=(0, 1)),
    derived("scaled.fixed_strain", "d_0", lambda s: s.fixed_strain, "n_gauges", unit="m/m"),
    derived("scaled.mean_strain", "m - d_0, at the nominal dynamic pressure",
        lambda s: s.map.mean_strain - s.fixed_strain, "n_gauges", unit="m/m"),
    derived("scaled.fixed_load", "f_0", lambda s: s.fixed_load[FIVE_LOADS], "5", unit="N, N.m"),
    derived("scaled.load_of_mean", "f_mean - f_0", lambda s: (s.map.load_of_mean - s.fixed_load)[FIVE_LOADS], "5",
        unit="N, N.m"),
    derived("scaled.min_expected_ratio", "smallest expected chi-square over its degrees of freedom",
        lambda s: MIN_EXPECTED_RATIO),
    derived("scaled.spread", "N of what has a prior, N N' the sum over its columns", lambda s: s.spread.strain,
        "n_gauges n_gauges", unit="m/m"),
    derived("scaled.spread_load", "loads of its columns", lambda s: s.spread.load[:, FIVE_LOADS], "n_gauges 5",
        unit="N, N.m"),
    derived("scaled.spread_unseen", "what those columns do not hold",
        lambda s: s.spread.unseen[FIVE_LOADS, FIVE_LOADS], "5 5", unit=""),
    derived("other_loads.array_name", "names of the arrays of outputs",
        lambda s: texts([one.name for one in s.load_arrays], OUTPUT_NAME_SIZE), "n_arrays OUTPUT_NAME_SIZE",
        kind="text"),
    derived("other_loads.array_value",
        "what each holds: loads, their standard deviations, the same of coefficients",
        lambda s: np.array([one.value for one in s.load_arrays], dtype=float), "n_arrays"),
    derived("other_loads.array_first", "the first of its loads",
        lambda s: np.array([one.group.first for one in s.load_arrays], dtype=float), "n_arrays"),
    derived("other_loads.array_size", "and how many they are",
        lambda s: np.array([one.group.size for one in s.load_arrays], dtype=float), "n_arrays"),
    derived("other_loads.like", "which of the five loads its standard deviation grows as; 5: the widest",
        lambda s: np.array([float(one.load.like) for one in s.map.load_groups for _ in range(one.size)]),
        "n_loads"),
    derived("other_loads.is_moment", "0 or 1", lambda s: s.map.is_moment[OTHER_LOADS].astype(float), "n_loads"),
    derived("other_loads.fixed_load", "f_0", lambda s: s.fixed_load[OTHER_LOADS], "n_loads", unit="N, N.m"),
    derived("other_loads.load_of_mean", "f_mean - f_0", lambda s: (s.map.load_of_mean - s.fixed_load)[OTHER_LOADS],
        "n_loads", unit="N, N.m"),
    derived("other_loads.load_per_state", "M", lambda s: s.map.load_per_state[OTHER_LOADS].T, "n_states n_loads",
        unit="N/state, N.m/state"),
    derived("other_loads.spread_load", "loads of the columns of spread", lambda s: s.spread.load[:, OTHER_LOADS],
        "n_gauges n_loads", unit="N, N.m"),
    derived("other_loads.spread_unseen", "variances of what those do not hold",
        lambda s: np.diag(s.spread.unseen)[OTHER_LOADS], "n_loads", unit=""),
    derived("filter.smallest_time", "of the time constant", lambda s: SMALLEST_TIME, unit="s", rule=POSITIVE),
    derived("filter.largest_time", "of the time constant, and of a step", lambda s: LARGEST_TIME, unit="s",
        rule=POSITIVE),
    derived("filter.white_navigation",
        "part of the variance of air data that is independent from sample to sample", lambda s: WHITE_NAVIGATION,
        bounds=(0.0, 1.0)),
    derived("filter.rate", "standard deviations of the rates of (M, u, w, ln p_inf) while no strain comes",
        lambda s: [MACH_NUMBER_RATE, ANGLE_RATE, ANGLE_RATE, LOG_PRESSURE_RATE], "4", unit="1/s", rule=POSITIVE,
        kind="values"),
    derived("filter.noise", "variances of what is independent from sample to sample", lambda s: white_noise(s.map),
        "n_gauges", unit="(m/m)^2", rule=POSITIVE),
    derived("thermal.largest_rise", "beyond which a sensor is taken to be broken", lambda s: LARGEST_RISE,
        unit="K", rule=POSITIVE),
    derived("thermal.scaled_covariance", "of the errors that scale",
        lambda s: product(s.map.error_strain, s.map.error_strain.T), "n_gauges n_gauges", unit="(m/m)^2"),
    derived("inertia.channels", "of the sensors, the last: of an inertial unit", lambda s: len(CHANNELS),
        whole=(1, 4096), kind="count", member="n_channels"),
    derived("inertia.vibrations", "of the modes, the last: of vibration, whose size is an input",
        lambda s: s.map.inertia.vibration_strain.shape[1], whole=(0, 4096), kind="count", member="n_vibrations"),
    derived("parameters.tolerance", "score up to which a parameter is inside", lambda s: PARAMETER_TOLERANCE),
    derived("parameters.largest_score", "of a value that is no finite number, infinity", lambda s: LARGEST_SCORE),
    derived("parameters.minimum", "over the snapshots", lambda s: s.parameters.minimum, "n_parameters", unit=""),
    derived("parameters.maximum", "the same", lambda s: s.parameters.maximum, "n_parameters", unit=""),
    derived("parameters.span", "width of the range, at least the size of a value that is fixed",
        lambda s: s.parameters.span, "n_parameters", unit="", rule=POSITIVE),
    derived("parameters.names", "as in the vehicle file", lambda s: _parameter_names(s.parameters.names),
        "n_parameters PARAMETER_NAME_SIZE", kind="text"),
    derived("angles.incidence_per_force", "largest total angle of attack over the largest lateral coefficient",
        lambda s: incidence_per_force(s.map), unit="rad", rule=POSITIVE),
    derived(f"{TARE}.dynamic_pressure", "largest at rest", lambda s: _LIMITS.dynamic_pressure, unit="Pa",
        bounds=(0.0, _LARGEST)),
    derived(f"{TARE}.zero", "largest zero offset", lambda s: _LIMITS.zero, unit="m/m", bounds=(0.0, _LARGEST)),
    derived(f"{TARE}.drift", "largest over the window", lambda s: _LIMITS.drift, unit="m/m",
        bounds=(0.0, _LARGEST)),
    derived(f"{TARE}.least_samples", "of a window", lambda s: float(LEAST_SAMPLES),
        bounds=(float(LEAST_SAMPLES), _LARGEST)),
    derived(f"{TARE}.least_part", "of the samples that a gauge must read", lambda s: LEAST_PART,
        bounds=(0.0, _LARGEST)),
    derived(f"{TARE}.least_gauges", "part of the gauges that must have a zero", lambda s: LEAST_GAUGES,
        bounds=(0.0, _LARGEST)),
    derived(f"{TARE}.own_factor", "of the scatter of a gauge by its own noise", lambda s: OWN_FACTOR,
        bounds=(0.0, _LARGEST)),
    derived(f"{TARE}.moved", "factor on the scatter from which gauges move", lambda s: MOVED,
        bounds=(0.0, _LARGEST)),
    derived(f"{TARE}.loud", "factor on the scatter from which a gauge is loud", lambda s: LOUD,
        bounds=(0.0, _LARGEST)),
    derived(f"{TARE}.known_strain", "of the loads that act meanwhile", lambda s: s.known.value, "n_strains",
        unit="m/m"),
    derived(f"{TARE}.known_std", "its standard deviation", lambda s: s.known.std, "n_strains", unit="m/m",
        rule=FROM_0),
    derived(f"{TARE}.pattern", "orthonormal strains of flights", lambda s: load_patterns(s.map),
        "n_patterns n_strains"),
    derived(f"{TARE}.load_odds", "threshold of the part along them by the number of gauges",
        lambda s: load_odds(s.map), "n_strains+1"),
)
# fmt: on
"""Values that follow from a map, from bounds of settings and from policies."""

RECORDS: tuple[tuple[type[Any], Callable[[Source], Any], dict[str, str]], ...] = (
    (
        InverseMap,
        lambda s: s.map,
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
        lambda s: s.nonlinear,
        {"n_d": "n_gauges", "n_M": "n_mach", "n_a": "n_incidence", "n_e": "n_common"},
    ),
    (Powers, lambda s: s.parameter_tables.powers, {"n_p": "n_parameters", "J": "n_powers"}),
)
"""Records of a map whose fields have places in ``map.bin``, where they come from, and their symbols there."""

PARTS: dict[str, Callable[[InverseMap], bool]] = {
    "scaled_errors": lambda one: one.follows_pressure and one.errors_follow_strain,
    "other_loads": lambda one: one.follows_pressure and has_other_outputs(one),
    "filter": has_filter,
    "thermal": lambda one: one.thermal_and_inertia.n_modes > 0,
    "inertia": lambda one: one.has_masses,
    "vehicle": lambda one: one.inertia is not None and one.inertia.vehicle_mass is not None,
    "parameters": lambda one: bool(flow_parameters(one).names),
    "angles": lambda one: incidence_per_force(one) > 0.0,
    "sensors": lambda one: one.has_auxiliary_sensors,
    **nonlinear_arrays.PARTS,
}
"""Whether a map has a part; it has those that are not here."""


def _field_arrays() -> tuple[Stored, ...]:
    """Return the arrays of ``map.bin`` that are fields of a map, with symbols as there."""
    arrays = list[Stored]()
    for record, source, symbols in RECORDS:
        for name, one, array in stored_arrays(record):
            shape = " ".join(symbols.get(axis, axis) for axis in array.shape.split())

            def value(
                s: Source,
                name: str = name,
                shape: str = one.shape,
                stored: str = array.shape,
                source: Any = source,
            ) -> Any:
                whole = np.asarray(getattr(source(s), name), dtype=float)
                return stored_value(whole, shape, stored, s.map.n_strain_gauges)

            arrays.append(replace(array, shape=shape, value=value))
    return tuple(arrays)


LAYOUT = (*_field_arrays(), *DERIVED, *nonlinear_arrays.DERIVED)
"""All arrays of ``map.bin`` but the guid."""


def native_resource(inverse_map: InverseMap, guid: str, known: KnownStrain | None = None) -> bytes:
    """Return the content of ``map.bin`` for ``inverse_map``, which instances with another ``guid`` refuse.

    ``known`` is the strain of the loads that act while a tare is taken; None for none.

    Raises
    ------
    InputError
        ``guid`` is longer than 79 bytes, or the name of a parameter longer than 47.
    """
    try:
        text = texts([guid], GUID_SIZE)
    except ValueError as error:
        raise InputError(f"guid: {error}") from error
    return pack({"guid": text, **map_arrays(inverse_map, known)})


def map_arrays(inverse_map: InverseMap, known: KnownStrain | None = None) -> dict[str, np.ndarray]:
    """Return the arrays of ``map.bin`` by name, but for the guid."""
    source = Source(inverse_map, known or KnownStrain(value=np.zeros(inverse_map.n_strain_gauges)))
    absent = {part for part, is_in in PARTS.items() if not is_in(inverse_map)}
    return {one.place: np.asarray(one.value(source)) for one in LAYOUT if one.part not in absent}


def _parameter_names(names: tuple[str, ...]) -> np.ndarray:
    try:
        return texts(list(names), PARAMETER_NAME_SIZE)
    except ValueError as error:
        raise InputError(f"parameters: {error}") from error
