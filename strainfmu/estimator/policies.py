"""Policies of the estimator: constants of iterations, alarms and filter that ``map.bin`` hands to the core."""

from __future__ import annotations

import numpy as np

from strainfmu.estimator.air_inputs import NAVIGATION
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, outlier_threshold

# Gauges that are lost.

MIN_INFORMATION = 1e-10
"""Fraction of the information on some state below which the rest of the gauges does not identify it: its standard
deviation has grown by 1e5, and round-off, squared, is near 1e-24."""

MIN_EXPECTED_RATIO = 0.1
"""Smallest expected chi-square over its degrees of freedom: the linear model of the errors could give less."""

# Iterations of the flight state.

LARGEST_STEP = np.array([0.5, 0.05, 0.05, 1.0])
"""Largest change of M [1], u, w [rad] and ln p_inf in one iteration."""

START_ITERATIONS, COLD_ITERATIONS, WARM_ITERATIONS = 4, 8, 2
"""Iterations of every state of the search, of the best of them from there, and from the last step's state."""

# Steps along time.

SEARCH_EVERY = 10
"""Steps from one search of the tables, for what else fits, to the next."""

RETURN_AFTER = 5
"""Steps in a row that must fit the tables before their loads follow the linear map's again."""

# Air data that do not fit.

FALSE_ALARMS = (1e-2, 1e-2, 1e-6)
"""Rates at which correct values of :data:`~strainfmu.estimator.air_inputs.NAVIGATION` are left out. M and p_inf:
at a lower rate 5 sigma would pass. q_inf: without it coefficients follow the estimated flight state."""

NAVIGATION_ALARM = outlier_threshold(len(NAVIGATION), FALSE_ALARM_PROBABILITY)
"""Standardised residual from which navigation that is dropped is an alarm, at the rate of health's other tests."""

# Ranges of the map, and what counts as identified.

RANGE_TOLERANCE = 0.01
"""Relative excess of a range that does not count."""

MIN_GAIN = 0.5
"""Part of the prior's standard deviation above which strain and navigation have not identified a quantity."""

LARGEST_USED_SCORE = 1.0
"""Part of its range by which a flow parameter may leave it and still be used.

It is ``OUTSIDE`` much earlier; cubes of what is far off are no numbers.
"""

# The filter.

WHITE_NAVIGATION = 0.2
"""Fraction of the variance of air data that is independent from sample to sample, and is averaged. The rest
lasts."""

SMALLEST_TIME, LARGEST_TIME = 1e-9, 1e6
"""Range of the time constant; the latter also the longest time step [s]."""
