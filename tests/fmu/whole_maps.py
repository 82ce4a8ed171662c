"""Two small maps that have all that a map can have: a linear one, and one with tables over the flight state."""

from functools import cache

import numpy as np
from flight_fmu import whole_map
from other_load_maps import with_further_tables, with_own_further
from parameter_maps import with_parameter_tables, with_parameters
from scaled_maps import whole_scaled_map
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from strainfmu.estimator.map.inverse_map import InverseMap

N_LINEAR, N_T = 24, 4
"""Sensors of the linear map, temperature sensors of both."""


@cache
def linear_with_everything() -> InverseMap:
    """Case 1 in form "dynamic_pressure" with temperature, auxiliary sensors, section loads and flow parameters."""
    strain = 1e-7 * np.random.default_rng(3).normal(size=(N_LINEAR, 6))
    warm = with_temperature(whole_scaled_map(1, seed=5, n=N_LINEAR, n_states=3), mode_strain=strain)
    return with_parameters(with_own_further(with_sensors(warm)))


@cache
def flight_with_everything() -> InverseMap:
    """Tables over the flight state with the same, whose tables follow the flow parameters."""
    return with_temperature(with_sensors(with_parameter_tables(with_further_tables(whole_map()))))


MAPS = {"linear": linear_with_everything, "flight": flight_with_everything}
