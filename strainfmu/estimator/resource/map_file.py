"""The inverse map as the compiled estimator reads it: ``map.bin``, arrays by name (:mod:`.container`).

A name is PART.VALUE. Every map has the parts "linear", "scaled", "settings", "envelope" and "tare". A map that
has them adds "scaled_errors", "other_loads" (the loads behind the five; both of form DYNAMIC_PRESSURE),
"filter", "thermal", "inertia", "parameters" and "sensors". :mod:`.nonlinear_arrays` has the parts of
a nonlinear map. A module of ``fmus/native/estimator`` reads each part by its names. A bound that the map does not
state is the largest finite number.

Every value has the same bits on every machine (:mod:`strainfmu.estimator.numerics.fixed_order`). Gains, whitening
and directions of the linear estimator follow from them: the compiled estimator computes these as it opens a map.
"""

from __future__ import annotations

import sys

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
    flight_ranges,
    half_spaces,
)
from strainfmu.estimator.map.flow_parameters import (
    LARGEST_SCORE,
    PARAMETER_TOLERANCE,
    FlowParameters,
    flow_parameters,
)
from strainfmu.estimator.map.inertia import CHANNELS
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.lateral_slope import incidence_per_force
from strainfmu.estimator.map.offers import has_filter, has_other_outputs
from strainfmu.estimator.map.proportional_errors import error_model
from strainfmu.estimator.map.sensors import SensorRows
from strainfmu.estimator.map.temperature import LARGEST_RISE, ThermalMap
from strainfmu.estimator.numerics.fixed_order import householder, product
from strainfmu.estimator.other_loads import FIVE_LOADS, OTHER_LOADS, LoadGroup, load_arrays
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
from strainfmu.estimator.resource.container import Values, pack, texts
from strainfmu.estimator.resource.nonlinear_arrays import nonlinear_parts
from strainfmu.estimator.setting_inputs import OF_AREA, OF_LENGTH, OF_READINGS
from strainfmu.estimator.settings import LARGEST_SETTING, SMALLEST_SETTING, default_settings
from strainfmu.estimator.signal_names import TARE
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
    parts: dict[str, Values] = {
        "linear": _linear(inverse_map),
        **_scaled_parts(inverse_map),
        "settings": _settings(inverse_map),
        "envelope": _envelope(inverse_map),
        TARE: _tare(inverse_map, known or KnownStrain(value=np.zeros(inverse_map.n_strain_gauges))),
        **nonlinear_parts(inverse_map),
    }
    if has_filter(inverse_map):
        parts["filter"] = _filter(inverse_map)
    if inverse_map.modes.n_modes:
        parts["thermal"] = _thermal(inverse_map, inverse_map.modes)
    if inverse_map.inertia is not None:
        vibrations = inverse_map.inertia.vibration_strain.shape[1]
        parts["inertia"] = {"channels": len(CHANNELS), "vibrations": vibrations}
        if inverse_map.inertia.vehicle_mass is not None:
            parts["vehicle"] = {"mass": inverse_map.inertia.vehicle_mass}
    parameters = flow_parameters(inverse_map)
    if parameters.names:
        parts["parameters"] = _parameters(parameters)
    if slope := incidence_per_force(inverse_map):
        parts["angles"] = {"incidence_per_force": slope}
    if inverse_map.has_auxiliary_sensors:
        parts["sensors"] = _sensors(inverse_map.sensors)
    return {
        f"{part}.{name}": np.asarray(value) for part, values in parts.items() for name, value in values.items()
    }


def _linear(inverse_map: InverseMap) -> Values:
    """Return what every map has."""
    counts = range(1, inverse_map.n_gauges + 1)
    return {
        "degrees_of_freedom": inverse_map.residual_degrees_of_freedom,
        "known_prior": inverse_map.case == 2,
        "mean_strain": inverse_map.mean_strain,
        "load_of_mean": inverse_map.load_of_mean[FIVE_LOADS],
        "state_operator": inverse_map.state_operator.T,
        "load_per_state": inverse_map.load_per_state[FIVE_LOADS].T,
        "gauge_covariance": inverse_map.gauge_covariance,
        "error_strain": inverse_map.error_strain.T,
        "error_load": inverse_map.error_load[FIVE_LOADS].T,
        "chi_square_limit": [chi_square_limit(freedom) for freedom in counts],
        "outlier_threshold": [outlier_threshold(n, FALSE_ALARM_PROBABILITY) for n in counts],
        "regularisation": inverse_map.regularisation,
        "min_information": MIN_INFORMATION,
        "ambiguous_correlation": AMBIGUOUS_CORRELATION,
        "min_dynamic_pressure": MIN_DYNAMIC_PRESSURE,
        "max_dynamic_pressure": MAX_DYNAMIC_PRESSURE,
        "dynamic_pressure_error": inverse_map.dynamic_pressure_error,
        "chi_square_scale": inverse_map.chi_square_scale,
        "outlier_scale": inverse_map.outlier_scale,
        "level_slope": inverse_map.level_slope,
    }


def _settings(inverse_map: InverseMap) -> Values:
    """Return start values, and the bounds of settings."""
    settings = default_settings(inverse_map)
    return {
        OF_AREA: settings.reference_area,
        OF_LENGTH: settings.reference_length,
        "moment_station": settings.moment_station,
        OF_READINGS: settings.sensor_range,
        DYNAMIC_PRESSURE: inverse_map.nominal_dynamic_pressure,
        "smallest": SMALLEST_SETTING,
        "largest": LARGEST_SETTING,
        "largest_zero": LARGEST_ZERO,
        "zero_offset": inverse_map.zero_offset[: inverse_map.n_strain_gauges],
        "not_known": NOT_KNOWN,
    }


def _envelope(inverse_map: InverseMap) -> Values:
    """Return ranges of the flight, layers of the atmosphere, limits and directions of the half-spaces."""
    ranges, envelope, largest = flight_ranges(inverse_map), half_spaces(inverse_map), sys.float_info.max
    mach_number = ranges.mach_number * np.array([1.0 - MACH_TOLERANCE, 1.0 + MACH_TOLERANCE])
    return {
        "score_limit": inverse_map.envelope_score_limit,
        DYNAMIC_PRESSURE: np.clip(ranges.dynamic_pressure, -largest, largest),
        MACH_NUMBER: np.clip(mach_number, -largest, largest),
        ALTITUDE: np.clip(ranges.altitude, -largest, largest),
        "half_gamma": 0.5 * HEAT_CAPACITY_RATIO,
        "pressure_tolerance": PRESSURE_TOLERANCE,
        "layers": layer_table(),
        "limit": envelope.limit,
        "direction": envelope.direction.T,
    }


def _tare(inverse_map: InverseMap, known: KnownStrain) -> Values:
    """Return limits, noise of each strain gauge, strain of the loads that act meanwhile, and of flights."""
    return {
        **vars(TareLimits()),
        "least_samples": float(LEAST_SAMPLES),
        "least_part": LEAST_PART,
        "least_gauges": LEAST_GAUGES,
        "own_factor": OWN_FACTOR,
        "moved": MOVED,
        "loud": LOUD,
        "noise_std": inverse_map.noise_std[: inverse_map.n_strain_gauges],
        "known_strain": known.value,
        "known_std": known.std,
        "pattern": load_patterns(inverse_map),
        "load_odds": load_odds(inverse_map),
    }


def _scaled_parts(inverse_map: InverseMap) -> dict[str, Values]:
    """Return what does and what does not scale with the pressure ratio, which is 1 in form "absolute"."""
    follows = inverse_map.follows_pressure
    fixed_strain, fixed_load = inverse_map.fixed_strain * follows, inverse_map.fixed_load * follows
    mean_load = inverse_map.load_of_mean - fixed_load
    spread, spread_load, spread_unseen = _spread(inverse_map)
    found: dict[str, Values] = {
        "scaled": {
            "follows_pressure": follows,
            "fixed_strain": fixed_strain,
            "mean_strain": inverse_map.mean_strain - fixed_strain,
            "fixed_load": fixed_load[FIVE_LOADS],
            "load_of_mean": mean_load[FIVE_LOADS],
            "min_expected_ratio": MIN_EXPECTED_RATIO,
            "spread": spread,
            "spread_load": spread_load[:, FIVE_LOADS],
            "spread_unseen": spread_unseen[FIVE_LOADS, FIVE_LOADS],
        }
    }
    if follows and inverse_map.errors_follow_strain:
        found["scaled_errors"] = vars(error_model(inverse_map))
    if follows and has_other_outputs(inverse_map):
        found["other_loads"] = {
            **_groups(inverse_map.load_groups),
            "is_moment": inverse_map.is_moment[OTHER_LOADS].astype(float),
            "fixed_load": fixed_load[OTHER_LOADS],
            "load_of_mean": mean_load[OTHER_LOADS],
            "load_per_state": inverse_map.load_per_state[OTHER_LOADS].T,
            "spread_load": spread_load[:, OTHER_LOADS],
            "spread_unseen": np.diag(spread_unseen)[OTHER_LOADS],
        }
    return found


def _groups(groups: tuple[LoadGroup, ...]) -> Values:
    """Return the arrays of outputs of the loads behind the five, and by which of the five each load's sigma grows.

    Of each array: its name, what it holds (:attr:`LoadArray.value`), its first row and its length.
    """
    arrays = load_arrays(groups)
    return {
        "array_name": texts([one.name for one in arrays], OUTPUT_NAME_SIZE),
        "array_value": np.array([one.value for one in arrays], dtype=float),
        "array_first": np.array([one.group.first for one in arrays], dtype=float),
        "array_size": np.array([one.group.size for one in arrays], dtype=float),
        "like": np.repeat([float(group.load.like) for group in groups], [group.size for group in groups]),
    }


def _spread(inverse_map: InverseMap) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (n_d, n_d) strain and (n_d, n_f) loads, column by column, of what has a prior; (n_f, n_f) of others.

    They stand for errors that scale, and in Case 2 for the states: covariances of strain and loads are the same.
    In form "absolute" nothing scales: errors are noise, and states alone are columns.
    """
    follows = inverse_map.follows_pressure
    strain, load = inverse_map.error_strain[:, : None if follows else 0], inverse_map.error_load
    load = load[:, : strain.shape[1]]
    if inverse_map.case == 2:
        strain = np.hstack([inverse_map.state_operator, strain])
        load = np.hstack([inverse_map.load_per_state, load])
    n = len(strain)
    whole = np.zeros((max(strain.shape[1], n), n + len(load)))
    whole[: strain.shape[1]] = np.hstack([strain.T, load.T])
    triangle, _ = householder(whole, n)
    rest = triangle[n:, n:]
    return triangle[:n, :n].T, triangle[:n, n:], product(rest.T.copy(), rest)


def _filter(inverse_map: InverseMap) -> Values:
    """Return the filter over time, and what of the errors of gauges and air data it averages."""
    return {
        "smallest_time": SMALLEST_TIME,
        "largest_time": LARGEST_TIME,
        "white_navigation": WHITE_NAVIGATION,
        "rate": [MACH_NUMBER_RATE, ANGLE_RATE, ANGLE_RATE, LOG_PRESSURE_RATE],
        "noise": white_noise(inverse_map),
    }


def white_noise(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d,) variances of what is independent from sample to sample in the readings.

    A covariance of the gauges below the one of their noise has less noise than stated.
    """
    covariance, manifold = inverse_map.gauge_covariance, inverse_map.manifold
    if inverse_map.modes.n_modes:
        covariance = inverse_map.modes.isothermal_covariance
    elif manifold is not None:
        covariance = manifold.gauge_covariance
    std = inverse_map.noise_std
    smallest = float(np.linalg.eigvalsh(covariance / (std[:, None] * std))[0])
    return np.asarray(min(1.0, smallest) * std**2)


def _thermal(inverse_map: InverseMap, thermal: ThermalMap) -> Values:
    """Return modes of temperature and inertia, and the covariance of the errors that scale."""
    error = inverse_map.error_strain
    names = (
        *("reference_temperature", "gauge_factor_slope", "modulus_slope", "prior_std", "sensor_std"),
        *("sensor_operator", "apparent_strain", "mode_strain", "gauge_operator", "isothermal_covariance"),
    )
    own = {name: getattr(thermal, name) for name in names}
    return {**own, "largest_rise": LARGEST_RISE, "scaled_covariance": product(error, error.T)}


def _parameters(known: FlowParameters) -> Values:
    """Return ranges and names of the parameters of the flow that are known to a map."""
    try:
        names = texts(list(known.names), PARAMETER_NAME_SIZE)
    except ValueError as error:
        raise InputError(f"parameters: {error}") from error
    return {
        "tolerance": PARAMETER_TOLERANCE,
        "largest_score": LARGEST_SCORE,
        "minimum": known.minimum,
        "maximum": known.maximum,
        "span": known.span,
        "names": names,
    }


def _sensors(rows: SensorRows) -> Values:
    """Return the rows behind the strain gauges."""
    return {name: getattr(rows, name)[rows.n_strain_gauges :] for name in ("scale", "largest", "thrust_response")}
