"""Flights while the wall warms, scored: with temperature sensors, without, and against flights that stay cold.

Strain is the independent model's, each flight with hardware errors of its own; thermal strain is solved on
the mesh of that model. The rise grows evenly with time, from nose to base in a straight line.

    python -m builder.stress.hot_flights VEHICLE SNAPSHOTS FLOWS --flights 300
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builder.campaign.snapshot_transfer import snapshots_on
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.noise.thermal import thermal_structure
from builder.manifold.build import with_manifold
from builder.structure.fourier.model import structural_model, with_mesh_error
from builder.structure.loads.gauge_strain import gauge_strain, gauge_temperature
from builder.structure.loads.temperature import temperature_mode
from builder.trial.conditions import held_out_conditions
from builder.trial.estimators import known_by
from builder.trial.readings import navigation_at
from builder.trial.score import Score, score_of
from builder.truth.as_built import drawn_many
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.flows import load_truth_flows
from builder.truth.revolution.strain import TrueStructure, one_flight, true_flights, true_strain, true_structure
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.model_entries import Resolutions
from builder.vehicle.structure.temperature import Temperature, TemperatureSensor
from strainfmu.arrays import FloatArray
from strainfmu.errors import StrainfmuError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.flight_condition import FlightCondition

MICRO, PER_100K, CELSIUS = 1e-6, 1e-4, 273.15

SENSOR_STATIONS = (0.11, 0.36, 0.61, 0.86)
"""Of the standard sensors, over the length of the body; one on each surface of the wall."""


@dataclass(frozen=True, kw_only=True)
class Heating:
    """Rise at the end of the heating [K]: of the wall at nose and base, outer less inner surface at the nose, and
    what one side is warmer by, relative to the rise."""

    nose: float = 80.0
    aft: float = 10.0
    through_wall: float = 0.0
    side: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class HotFlights:
    """n flights, each by a vehicle and at a time of its own.

    Attributes
    ----------
    conditions : n flight conditions.
    dynamic_pressure : (n,) as stated [Pa].
    coefficients : (n, 5) true ones.
    cold, hot : (n, n_d) readings of the same flights with the wall at its reference temperature and warm [m/m].
    temperature : (n, n_t) of the sensors [K].
    """

    conditions: Sequence[FlightCondition]
    dynamic_pressure: FloatArray
    coefficients: FloatArray
    cold: FloatArray
    hot: FloatArray
    temperature: FloatArray


def standard_temperature(length: float) -> Temperature:
    """Return a section [temperature] with eight sensors for a body of ``length`` [m]."""
    sensors = [
        one
        for share in SENSOR_STATIONS
        for one in (
            TemperatureSensor(name=f"inner {share:g}", x_m=share * length, surface="inner"),
            TemperatureSensor(name=f"outer {share:g}", x_m=share * length, surface="outer"),
        )
    ]
    return Temperature(
        expansion_um_per_m_per_K=9.0,
        modulus_percent_per_100K=-4.5,
        gauge_factor_percent_per_100K=-1.0,
        apparent_strain_um_per_m=(0.05, -0.002),
        apparent_strain_scatter_um_per_m_per_K=0.01,
        sensor=sensors,
    )


def hot_flights(
    vehicle: Vehicle,
    structure: TrueStructure,
    table: FlowTable,
    count: int,
    heating: Heating,
    noise_std: FloatArray,
) -> HotFlights:
    """Fly ``count`` vehicles; ``noise_std`` (n_d,) is the gauges' own [m/m].

    Raises
    ------
    InputError
        A condition is outside the table, or the Fourier model cannot do the vehicle.
    """
    entry = vehicle.temperature
    assert entry is not None
    random, n_d = np.random.default_rng(41), len(noise_std)
    conditions = held_out_conditions(vehicle, table, count, random)
    flights = true_flights(vehicle, structure, table, conditions)
    built = [drawn_many(vehicle.noise, structure.counts, 1, random) for _ in conditions]
    cold = np.concatenate([true_strain(structure, one_flight(flights, k), one) for k, one in enumerate(built)])
    q = flights.dynamic_pressure * [1.0 + float(np.reshape(one.dynamic_pressure, -1)[0]) for one in built]
    share = random.uniform(0.0, 1.0, (count, 1))
    strain, rise, sensors = _of_heating(vehicle, entry, heating)
    scatter = MICRO * entry.apparent_strain_scatter_um_per_m_per_K * random.standard_normal((count, n_d))
    warm = share * rise
    sheet = sum(
        (MICRO * c * warm**k for k, c in enumerate(entry.apparent_strain_um_per_m, start=1)), scatter * warm
    )
    softer = 1.0 + PER_100K * entry.modulus_percent_per_100K * warm
    factor = 1.0 + PER_100K * entry.gauge_factor_percent_per_100K * warm
    hot = factor * (cold / softer + share * strain + sheet)
    noise = noise_std * random.standard_normal(cold.shape)
    of_sensors = [one.std_K for one in entry.sensor] * random.standard_normal((count, len(entry.sensor)))
    return HotFlights(
        conditions=conditions,
        dynamic_pressure=q,
        coefficients=flights.coefficients,
        cold=cold + noise,
        hot=hot + noise,
        temperature=entry.reference_degC + CELSIUS + share * sensors + of_sensors,
    )


def _of_heating(
    vehicle: Vehicle, entry: Temperature, heating: Heating
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return at its end the gauges' strain [m/m] and rise (n_d,) [K], and the rise at the sensors (n_t,) [K]."""
    resolution = Resolutions(map=vehicle.resolution.truth, truth=vehicle.resolution.truth)
    structure = thermal_structure(vehicle.model_copy(update={"resolution": resolution}), entry)
    ends = np.array([0.0, vehicle.body().length])
    rise, through = np.array([heating.nose, heating.aft]), np.array([heating.through_wall, 0.0])
    fields = [
        temperature_mode(ends, rise, through_wall=through),
        temperature_mode(ends, heating.side * rise, harmonic=1, roll_angle=0.7),
    ]
    x = np.array([one.x_m for one in entry.sensor])
    roll = np.radians([one.roll_angle_deg for one in entry.sensor])
    depth = np.array([float(one.surface == "outer") for one in entry.sensor])
    return (
        gauge_strain(structure, fields),
        np.sum([gauge_temperature(structure, one) for one in fields], axis=0),
        np.sum([one.at(x, roll, depth) for one in fields], axis=0),
    )


def maps_of(vehicle: Vehicle, snapshots: Snapshots) -> tuple[InverseMap, InverseMap]:
    """Return the map of a vehicle without its section [temperature] and with it, tables of both included."""
    resolution, layout = vehicle.resolution.map, vehicle.gauges.layout
    structure = with_mesh_error(structural_model(vehicle, resolution, [layout]), vehicle, resolution)
    on = snapshots_on(snapshots, structure.surface)
    found = []
    for entry in (None, vehicle.temperature):
        one = vehicle.model_copy(update={TEMPERATURE: entry})
        found.append(with_manifold(build_inverse_map(one, on, structure), one, on, structure))
    return found[0], found[1]


def lines_of(flights: HotFlights, cold: InverseMap, warm: InverseMap) -> list[str]:
    """Return a table: rms errors of the coefficients, C_A's over the cold flights' error, coverage, flagged."""
    head = "".join(f"{name:>7s}" for name in COEFFICIENT_NAMES)
    rows = [f"{'rms error in 1e-4':52s}{head}{'C_A/cold':>10s}{'3 sigma %':>11s}{'not OK %':>10s}"]
    n = warm.thermal.n_sensors
    none = np.full_like(flights.temperature, np.nan)
    for kind in ("linear", "nonlinear"):
        first = None
        for name, held, strain, temperature in (
            ("cold flight, map without temperature", cold, flights.cold, None),
            (f"{n} sensors", warm, flights.hot, flights.temperature),
            ("no sensors", warm, flights.hot, none),
            ("map without temperature", cold, flights.hot, None),
        ):
            score = _score(flights, held, kind, strain, temperature)
            first = first or float(score.rms[0])
            text = "".join(f"{1e4 * value:7.1f}" for value in score.rms)
            inside, flagged = 100.0 * score.coverage_3.mean(), 100.0 * score.detected
            rows.append(f"{kind + ': ' + name:52s}{text}{score.rms[0] / first:10.2f}{inside:11.2f}{flagged:10.1f}")
    return rows


def _score(
    flights: HotFlights, held: InverseMap, kind: str, strain: FloatArray, temperature: FloatArray | None
) -> Score:
    estimator = Estimator(held.without_tables() if kind == "linear" else held)
    known = known_by(estimator, navigation_at(flights.conditions))
    found = estimator.estimate(strain, flights.dynamic_pressure, temperature=temperature, **known)
    error = found.coefficients - flights.coefficients
    return score_of(COEFFICIENT_NAMES, error, found.coefficients_std, health=found.health)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m builder.stress.hot_flights",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("vehicle", type=Path, help="vehicle file; without [temperature] a standard one is used")
    parser.add_argument("snapshots", type=Path, help="snapshots.h5 of its map")
    parser.add_argument("flows", type=Path, help="independent_flows.h5")
    parser.add_argument("--flights", type=int, default=300)
    parser.add_argument("--nose", type=float, default=80.0, help="rise at the nose, K")
    parser.add_argument("--aft", type=float, default=10.0, help="rise at the base, K")
    parser.add_argument("--through-wall", type=float, default=0.0, help="outer less inner surface at the nose, K")
    parser.add_argument("--side-percent", type=float, default=0.0, help="what one side is warmer by, of the rise")
    options = parser.parse_args()
    vehicle = load_vehicle(options.vehicle)
    if vehicle.temperature is None:
        vehicle = vehicle.model_copy(update={TEMPERATURE: standard_temperature(vehicle.body().length)})
    table = load_truth_flows(options.flows, vehicle)
    cold, warm = maps_of(vehicle, load_snapshots(options.snapshots))
    heating = Heating(
        nose=options.nose, aft=options.aft, through_wall=options.through_wall, side=0.01 * options.side_percent
    )
    flights = hot_flights(vehicle, true_structure(vehicle), table, options.flights, heating, cold.noise_std)
    print("\n".join(lines_of(flights, cold, warm)))


if __name__ == "__main__":
    try:
        main()
    except StrainfmuError as error:
        sys.exit(f"strainfmu: {error}")
