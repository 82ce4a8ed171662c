"""Maps whose arrays cannot be: one line that names the array, what is expected there, and what was found."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_resource import put, refusal, with_arrays
from deflected_shape import known_map
from flight_fmu import whole_map
from inertia_maps import with_masses
from other_load_maps import with_further_tables, with_own_further
from parameter_maps import with_parameters
from raw_fmu import Fmu2
from scaled_maps import whole_scaled_map
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

Change = Any
"""Of an array: another one, a function of the old one, or None for none."""


def linear_map() -> InverseMap:
    """A linear map with all that one can hold."""
    return with_parameters(with_sensors(with_temperature(with_own_further(whole_scaled_map(1, seed=1, n=24)))))


MAPS: dict[str, Callable[[], InverseMap]] = {
    "linear": cache(linear_map),
    "nonlinear": cache(lambda: with_further_tables(whole_map())),
    "parameters": known_map,
    "masses": cache(lambda: with_masses(whole_map())),
}

NOT_FINITE = "holds a value that is not finite"
POWERS = "expected parameters of the map, ascending, and powers to 3"

LINEAR: tuple[tuple[str, Change, str], ...] = (
    ("linear.level_slope", np.float64(1.5), "expected a number from 0 to 1"),
    ("linear.dynamic_pressure_error", np.float64(1.5), "expected a number from 0 to 1"),
    ("envelope.score_limit", np.float64(0.0), "expected numbers above zero, found 0"),
    ("filter.noise", lambda old: old[:-1], "expected "),
    ("filter.noise", put(0, 0.0), "expected numbers above zero, found 0"),
    ("filter.rate", put(1, -1.0), "expected numbers above zero, found -1"),
    ("filter.white_navigation", np.float64(1.5), "expected a number from 0 to 1"),
    ("filter.largest_time", np.float64(1e-12), "expected a number above the smallest time"),
    ("other_loads.like", put(0, 5.5), "expected numbers of loads"),
    ("other_loads.array_value", put(1, 4.0), "expected 0 to 3"),
    ("other_loads.array_size", put(2, 20.0), "expected rows of the loads"),
    ("other_loads.array_size", put(2, 0.0), "expected rows of the loads"),
    ("other_loads.spread_unseen", lambda old: old[1:], "expected "),
    ("other_loads.spread_unseen", put(0, np.nan), f"{NOT_FINITE} (number 0)"),
    ("parameters.maximum", lambda old: old[:-1], "expected 3 numbers, found 2 numbers"),
    ("parameters.maximum", put(1, -1e9), "expected no number below the minimum"),
    ("parameters.span", put(1, 0.0), "expected numbers above zero, found 0"),
    ("parameters.names", lambda old: np.where(old == 0, ord("x"), old), "expected texts with an end"),
    ("sensors.scale", lambda old: np.ones(999), "expected 0 to "),
    ("sensors.scale", put(0, 0.0), "expected numbers above zero, found 0"),
    ("sensors.largest", lambda old: old[1:], "expected "),
    ("sensors.largest", put(1, 0.0), "expected numbers above zero, found 0"),
    ("sensors.thrust_response", put(0, np.nan), f"{NOT_FINITE} (number 0)"),
    ("thermal.prior_std", lambda old: old[:0], "expected 1 to 4096 values along axis 0, found 0"),
    ("thermal.prior_std", put(0, 0.0), "expected numbers above zero, found 0"),
    ("thermal.sensor_operator", lambda old: old[:-1], "expected "),
    ("thermal.mode_strain", put((0, 0), np.nan), f"{NOT_FINITE} (number 0)"),
    ("thermal.isothermal_covariance", put((0, 0), -1.0), "expected numbers above zero, found -1"),
)

NONLINEAR: tuple[tuple[str, Change, str], ...] = (
    ("flight.mach_knots", put(1, 0.0), "expected numbers that increase"),
    ("flight.table", lambda old: old[1:], "expected "),
    ("flight.row", put(1, 5.0), "expected rows that ascend without a gap"),
    ("flight.channel", put(0, 0.5), "expected channels of the table"),
    ("flight.channel", put(0, -1.0), "expected channels of the table"),
    ("flight.start_iterations", np.int32(3), "expected an even number"),
    ("flight.warm_iterations", np.int32(-1), "expected a whole number from 0 to 1000, found -1"),
    ("flight.pressure_range", put(0, 0.0), "expected a range above zero"),
    ("flight.gauge_covariance", put((2, 2), 0.0), "expected numbers above zero, found 0"),
    ("flight.shapes", lambda old: np.ones((17, old.shape[1])), "expected 0 to 16 values along axis 0, found 17"),
    ("flight.common_gain", None, "is missing"),
    ("flight_loads.variance", lambda old: old[1:], "expected "),
    ("flight_loads.variance", put(0, np.nan), f"{NOT_FINITE} (number 0)"),
    ("flight_loads.table", lambda old: old[..., :-1], "expected "),
    ("flight_loads.row", put(0, 1.0), "expected rows that ascend without a gap"),
)

OF_PARAMETERS: tuple[tuple[str, Change, str], ...] = (
    ("parameter_tables.mean", lambda old: old[:0], "expected 1 to 64 values along axis 0, found 0"),
    ("parameter_tables.basis", lambda old: old[:, :-1], "expected "),
    ("parameter_tables.row_weight", lambda old: old[:, :, :-1], "expected "),
    ("parameter_tables.largest_score", np.float64(-1.0), "expected a number from 0 to "),
    ("parameter_tables.spread", put(0, -1.0), "expected no number below zero"),
    ("parameter_tables.power", put(0, 4.0), POWERS),
    ("parameter_tables.parameter", put(0, 9.0), POWERS),
    ("parameter_tables.product", lambda old: old[:-1], "expected "),
    ("parameter_tables.product", put((-1, -1), np.inf), NOT_FINITE),
)

OF_MASSES: tuple[tuple[str, Change, str], ...] = (
    ("inertia.channels", np.int64(10), "expected 11"),
    ("inertia.channels", np.int64(40), "expected at most the number of sensors"),
    ("inertia.vibrations", np.int64(40), "expected at most the number of modes"),
    ("inertia.vibrations", None, "is missing"),
    ("vehicle.mass", np.float64(0.0), "expected numbers above zero, found 0"),
)

CASES = [
    (name, *case)
    for name, cases in (
        ("linear", LINEAR),
        ("nonlinear", NONLINEAR),
        ("parameters", OF_PARAMETERS),
        ("masses", OF_MASSES),
    )
    for case in cases
]


@pytest.mark.parametrize(
    ("name", "array", "change", "text"), CASES, ids=[f"{case[0]} {case[1]}" for case in CASES]
)
def test_an_array_that_cannot_be_is_refused(
    tmp_path: Path, name: str, array: str, change: Change, text: str
) -> None:
    """Parts whose sizes depend on each other are blamed as a part."""
    held, part = MAPS[name](), array.partition(".")[0]
    said = refusal(Fmu2(with_arrays(held, tmp_path, {array: change}), held.n_gauges))
    named = f"'{part}." if part in ("flight_loads", "parameter_tables") else f"'{array}': {text}"
    assert named in said
    assert text in said
