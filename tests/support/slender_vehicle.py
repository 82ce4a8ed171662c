"""A vehicle with linear loads, flight model and inverse map of which agree exactly: closed forms for flights.

With the total incidence a and the roll angle phi_T of the flow, strain is p_inf (e0 + e1 a cos(phi - phi_T) +
e2 a^2 cos 2 (phi - phi_T)) on two kinds of gauges, C_A constant, C_T = c1 a, M_T = m1 a. So five states carry
everything.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from strainfmu.atmosphere import dynamic_pressure, pressure_and_temperature
from strainfmu.cosim.models.flight_model import FlightModel, save_flight_model
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map

ANGLES = 8
MACH_NUMBER, ALTITUDE = 6.0, 20e3
NOISE_STD = 2.4e-7
C_A, NORMAL_SLOPE, MOMENT_SLOPE = 0.015, 3.0, -0.2
AREA, LENGTH, BASE_AREA = 0.108, 0.371, 0.0
# Per Pa of ambient pressure, for both kinds of gauges: [constant, a, a^2].
STRAINS = np.array([[1e-9, 3e-7, 1e-7], [-3e-10, -8e-8, 6e-7]])

NAMES = tuple(f"G{i + 1}" for i in range(2 * ANGLES))
ROLL_ANGLE = np.tile(2.0 * np.pi * np.arange(ANGLES) / ANGLES, 2)
KIND = np.repeat([0, 1], ANGLES)


def slender_flight_model() -> FlightModel:
    """The flight model: one cell of Mach number, two of incidence."""
    knots = np.radians([0.0, 6.0, 12.0])
    strain, coefficient = np.zeros((1, 2, 4, 4, 2, 3, 2)), np.zeros((1, 2, 4, 4, 3))
    for j, a in enumerate(knots[:-1].tolist()):
        strain[0, j, 0, 0, :, 0, 0] = STRAINS[:, 0]
        strain[0, j, 0, 0, :, 1, 0], strain[0, j, 0, 1, :, 1, 0] = STRAINS[:, 1] * a, STRAINS[:, 1]
        for q, factor in enumerate((a**2, 2.0 * a, 1.0)):
            strain[0, j, 0, q, :, 2, 0] = STRAINS[:, 2] * factor
        coefficient[0, j, 0, 0] = C_A, NORMAL_SLOPE * a, MOMENT_SLOPE * a
        coefficient[0, j, 0, 1] = 0.0, NORMAL_SLOPE, MOMENT_SLOPE
    return FlightModel(
        vehicle="slender vehicle",
        gauge_names=NAMES,
        gauge_roll_angle=ROLL_ANGLE,
        gauge_channel=KIND,
        mach_knots=np.array([5.0, 7.0]),
        incidence_knots=knots,
        strain_table=strain,
        coefficient_table=coefficient,
        strain_of_internal_pressure=np.zeros(len(NAMES)),
        internal_pressure=None,
        base_area=BASE_AREA,
        reference_area=AREA,
        reference_length=LENGTH,
        noise_std=NOISE_STD,
    )


def slender_inverse_map() -> InverseMap:
    """The map of Case 1: states p_inf (1, a cos phi_T, a sin phi_T, a^2 cos 2 phi_T, a^2 sin 2 phi_T)."""
    gain_1, gain_2 = STRAINS[KIND, 1], STRAINS[KIND, 2]
    angle = ROLL_ANGLE
    operator = np.column_stack(
        (
            STRAINS[KIND, 0],
            gain_1 * np.cos(angle),
            gain_1 * np.sin(angle),
            gain_2 * np.cos(2 * angle),
            gain_2 * np.sin(2 * angle),
        )
    )
    scale = dynamic_pressure(MACH_NUMBER, ALTITUDE) / pressure_and_temperature(ALTITUDE)[0] * AREA
    loads = np.zeros((5, 5))
    loads[0, 0], loads[1, 1], loads[2, 2] = scale * C_A, scale * NORMAL_SLOPE, scale * NORMAL_SLOPE
    loads[3, 1], loads[4, 2] = scale * LENGTH * MOMENT_SLOPE, scale * LENGTH * MOMENT_SLOPE
    n = len(NAMES)
    noise = np.full(n, NOISE_STD)
    return InverseMap(
        vehicle="slender vehicle",
        case=1,
        gauge_names=NAMES,
        gauge_position=np.column_stack((np.full(n, 2.0), 0.1 * np.sin(angle), 0.1 * np.cos(angle))),
        gauge_direction=np.tile([1.0, 0.0, 0.0], (n, 1)),
        noise_std=noise,
        state_operator=operator,
        gauge_covariance=np.diag(noise**2),
        error_strain=np.zeros((n, 0)),
        error_load=np.zeros((5, 0)),
        regularisation=0.0,
        load_per_state=loads,
        load_of_mean=np.zeros(5),
        mean_strain=np.zeros(n),
        strain_range=np.full(n, 3e-4),
        coefficient_range=np.array([[0.0, 0.02], [-0.6, 0.6], [-0.6, 0.6], [-0.05, 0.05], [-0.05, 0.05]]),
        reference_area=AREA,
        reference_length=LENGTH,
        nominal_dynamic_pressure=dynamic_pressure(MACH_NUMBER, ALTITUDE),
    )


SCENARIO = """
name = "slender vehicle"
stop_time_s = {stop_time}
[flight]
mach_number = 6.0
altitude_km = 20.0
angle_of_attack_deg = 2.0
[[command]]
time_s = 0.0
angle_of_attack_deg = 2.0
[[command]]
time_s = 0.5
angle_of_attack_deg = 5.0
"""


@dataclass(frozen=True)
class SlenderFiles:
    """Where map, flight model and scenario lie, all in one folder."""

    folder: Path
    scenario: Path


def make_slender_files(folder: Path, stop_time: float = 5.0) -> SlenderFiles:
    """Write map, flight model and a scenario with one step."""
    save_flight_model(slender_flight_model(), folder / "flight_model.h5")
    save_inverse_map(slender_inverse_map(), folder / "map.h5")
    (folder / "steps.toml").write_text(SCENARIO.format(stop_time=stop_time))
    return SlenderFiles(folder, folder / "steps.toml")
