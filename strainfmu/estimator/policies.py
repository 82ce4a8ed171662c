"""Policies of the estimator: constants of iterations, alarms and filter that ``map.bin`` hands to the core."""

import sys
from dataclasses import dataclass
from math import log

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.air_inputs import NAVIGATION
from strainfmu.estimator.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.health import AMBIGUOUS_CORRELATION, FALSE_ALARM_PROBABILITY, outlier_threshold
from strainfmu.estimator.map.flight_tables import MIN_INCIDENCE
from strainfmu.estimator.map.schema import POSITIVE, MapRecord, entry
from strainfmu.estimator.map.validity import PARAMETER_TOLERANCE
from strainfmu.estimator.settings import LARGEST_SETTING, SMALLEST_SETTING
from strainfmu.estimator.signal_names import NOT_KNOWN, TARE

FALSE_ALARMS = (1e-2, 1e-2, 1e-6)
"""Rates at which correct values of :data:`~strainfmu.estimator.air_inputs.NAVIGATION` are left out. M and p_inf:
at a lower rate 5 sigma would pass. q_inf: without it coefficients follow the estimated flight state."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Policies(MapRecord, where="policies"):
    """Constants of the estimator."""

    # fmt: off
    # Gauges that are lost. At the least information standard deviations have grown by 1e5; round-off, squared, is
    # near 1e-24.
    min_information: float = entry(
        meaning="fraction of the information on some state below which the rest of the gauges does not identify "
        "it", default=1e-10, place="linear.min_information")
    min_expected_ratio: float = entry(
        meaning="smallest expected chi-square over its degrees of freedom: the linear model of the errors could "
        "give less", default=0.1, place="scaled.min_expected_ratio")

    ambiguous_correlation: float = entry(meaning="above which gauges cannot be distinguished",
        default=AMBIGUOUS_CORRELATION, place="linear.ambiguous_correlation")

    # Settings, and values that mean nothing.
    smallest_setting: float = entry(meaning="bounds of settings", default=SMALLEST_SETTING,
        place="settings.smallest", low=sys.float_info.min, high=1.0, member="smallest_setting")
    largest_setting: float = entry(meaning="the same", default=LARGEST_SETTING, place="settings.largest", low=1.0,
        member="largest_setting")
    largest_zero: float = entry(meaning="of zero offsets and their standard deviations", default=LARGEST_ZERO,
        place="settings.largest_zero", low=0.0)
    not_known: float = entry(
        meaning="start value of flow parameters, and a value of thrust, that means what NaN does",
        default=NOT_KNOWN, place="settings.not_known")

    # The flow: q = half_gamma M^2 p.
    half_gamma: float = entry(meaning="q = half_gamma M^2 p(h)", default=0.5 * HEAT_CAPACITY_RATIO,
        place="envelope.half_gamma")
    flight_half_gamma: float = entry(meaning="q = half_gamma M^2 p", default=0.5 * HEAT_CAPACITY_RATIO,
        place="flight.half_gamma")
    log_half_gamma: float = entry(meaning="its logarithm", default=log(0.5 * HEAT_CAPACITY_RATIO),
        place="flight.log_half_gamma")
    min_incidence: float = entry(unit="rad",
        meaning="rounds the cone of total angle of attack off at its tip", default=MIN_INCIDENCE,
        place="flight.min_incidence", rule=POSITIVE)

    # Iterations of the flight state.
    largest_step: FloatArray = entry("4", "", "largest change of M [1], u, w [rad] and ln p_inf in one iteration",
        default=np.array([0.5, 0.05, 0.05, 1.0]), place="flight.largest_step", rule=POSITIVE, kind="values")
    start_iterations: int = entry(meaning="iterations of every state of the search, an even number", default=4,
        place="flight.start_iterations", kind="whole", low=2, high=1000)
    cold_iterations: int = entry(meaning="iterations of the best of them from there", default=8,
        place="flight.cold_iterations", kind="whole", low=0, high=1000)
    warm_iterations: int = entry(meaning="iterations of a step that goes on, from the state of the last one",
        default=2, place="flight.warm_iterations", kind="whole", low=0, high=1000)

    # Steps along time.
    search_every: int = entry(meaning="steps from one search of the tables, for what else fits, to the next",
        default=10, place="flight.search_every", kind="whole", low=0, high=1000000)
    return_after: int = entry(
        meaning="steps in a row that must fit the tables before their loads follow the linear map's again",
        default=5, place="flight.return_after", kind="whole", low=0, high=1000000)

    # Air data that do not fit: at the rates of FALSE_ALARMS, and at the rate of health's other tests.
    navigation_limit: FloatArray = entry("3", "", "standardised residuals above which navigation is dropped",
        default=np.array([outlier_threshold(1, rate) for rate in FALSE_ALARMS]), place="flight.navigation_limit",
        kind="values")
    navigation_alarm: float = entry(
        meaning="standardised residual from which navigation that is dropped is an alarm",
        default=outlier_threshold(len(NAVIGATION), FALSE_ALARM_PROBABILITY), place="flight.navigation_alarm")

    # Air data of any flight. No vehicle flies above the largest q_inf (M 10 at sea level: 7.1e6). A flight at the
    # end of the range of Mach numbers is inside it: at a tolerance of 0.01 one in twelve was outside by its
    # measured M, 0.025 are three standard deviations of 0.05 at M 6.
    min_dynamic_pressure: float = entry(unit="Pa", meaning="below which there is no flow, and are no coefficients",
        default=1e-6, place="linear.min_dynamic_pressure", rule=POSITIVE)
    max_dynamic_pressure: float = entry(unit="Pa", meaning="above which there are none", default=1e7,
        place="linear.max_dynamic_pressure")
    mach_tolerance: float = entry(meaning="relative error of a measured Mach number that the range allows",
        default=0.025)
    pressure_tolerance: float = entry(
        meaning="relative difference of q_inf and 0.7 M^2 p(h) that is no contradiction, but errors of navigation "
        "and weather", default=0.05, place="envelope.pressure_tolerance")
    largest_rise: float = entry(unit="K",
        meaning="|rise| above the reference beyond which a sensor of temperature is taken to be broken",
        default=2000.0, place="thermal.largest_rise", rule=POSITIVE)
    largest_channel: float = entry(unit="m/s2, rad/s2, rad2/s2",
        meaning="|channel| beyond which an inertial unit is taken to be broken", default=1e6)

    # Ranges of the map, and what counts as identified. A parameter is OUTSIDE much earlier than it is not used;
    # cubes of what is far off are no numbers.
    range_tolerance: float = entry(meaning="relative excess of a range that does not count", default=0.01,
        place="flight.range_tolerance")
    min_gain: float = entry(
        meaning="part of the prior's standard deviation above which strain and navigation have not identified a "
        "quantity", default=0.5, place="flight.min_gain")
    min_incidence_score: float = entry(
        meaning="from which the wind has a roll angle; standard deviations of the total incidence above zero",
        default=3.0, place="flight.min_incidence_score")
    parameter_tolerance: float = entry(meaning="score up to which a parameter is inside",
        default=PARAMETER_TOLERANCE, place="parameters.tolerance")
    largest_parameter_score: float = entry(meaning="of a value that is no finite number, infinity", default=1e9,
        place="parameters.largest_score")
    largest_used_score: float = entry(
        meaning="part of its range by which a flow parameter may leave it and still be used", default=1.0,
        place="parameter_tables.largest_score", low=0.0)

    # Tares: a window holds four readings of each of 16 stretches.
    least_samples: int = entry(meaning="readings that a window of a tare must hold", default=64,
        place=f"{TARE}.least_samples", low=64.0)
    least_part: float = entry(meaning="part of a window in which a gauge must read", default=0.9,
        place=f"{TARE}.least_part", low=0.0)
    least_gauges: float = entry(meaning="part of the gauges that must have a zero", default=0.5,
        place=f"{TARE}.least_gauges", low=0.0)
    own_factor: float = entry(
        meaning="of the scatter of a gauge by its own noise; times the scatter of the stretches of all gauges",
        default=3.0, place=f"{TARE}.own_factor", low=0.0)
    moved: float = entry(
        meaning="factor on the scatter from which gauges move; standard deviations of a line's rise over the "
        "window", default=6.0, place=f"{TARE}.moved", low=0.0)
    loud: float = entry(meaning="factor on the map's noise from which the scatter of a gauge is loud",
        default=10.0, place=f"{TARE}.loud", low=0.0)

    # The filter. The part of the variance of air data that is not white lasts, and is not averaged.
    white_navigation: float = entry(
        meaning="part of the variance of air data that is independent from sample to sample", default=0.2,
        place="filter.white_navigation", low=0.0, high=1.0)
    smallest_time: float = entry(unit="s", meaning="of the time constant", default=1e-9,
        place="filter.smallest_time", rule=POSITIVE)
    largest_time: float = entry(unit="s", meaning="of the time constant, and of a step", default=1e6,
        place="filter.largest_time", rule=POSITIVE)
    rate: FloatArray = entry("4", "1/s",
        "standard deviations of the rates of (M, u, w, ln p_inf) while no strain comes; 60 m/s^2 at 20 km, "
        "6 deg/s, a climb of 640 m/s", default=np.array([0.2, 0.1, 0.1, 0.1]), place="filter.rate", rule=POSITIVE,
        kind="values")
    # fmt: on


POLICIES = Policies()
