"""Errors of the linear and the nonlinear estimator by total incidence, on flows of the independent model.

Vehicles have installation errors drawn, at Mach numbers and altitudes between the snapshots'. Both
estimators are given the same readings and air data. LINEAR is a map of the linear estimator alone, of `strainfmu
build --estimator linear`. It does not include the difference of flow models, and errs less at small incidence than
the linear estimator within a map of both.

    python -m builder.stress.incidence VEHICLE MAP FLOWS --linear LINEAR
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import radians
from pathlib import Path

import numpy as np

from builder.stress.run import vehicle_and_flows
from builder.stress.study import run_study, study_parser
from builder.trial.conditions import drawn_altitudes_km, drawn_conditions, wind_angles
from builder.trial.readings import ReadFlights, readings
from builder.trial.run import estimates
from builder.trial.score import Score, score_of
from builder.trial.vehicles import drawn_vehicles
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure, true_structure
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map

BANDS_DEG = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 14.0)
"""Ends of the bands of total incidence [deg], as far as FLOWS go."""


def bands(table: FlowTable, ends_deg: Sequence[float] = BANDS_DEG) -> list[tuple[float, float]]:
    """Return (low, high) [rad] of the bands that ``table`` covers."""
    ends = [radians(one) for one in ends_deg]
    return [(low, high) for low, high in pairwise(ends) if high <= float(table.incidence_knots[-1]) + 1e-9]


def flown_in_band(
    inverse_map: InverseMap,
    vehicle: Vehicle,
    structure: TrueStructure,
    table: FlowTable,
    band: tuple[float, float],
    *,
    conditions: int,
    vehicles: int,
    seed: int = 1,
) -> ReadFlights:
    """Return what ``vehicles`` read at each of ``conditions``, at total incidences [rad] in ``band`` on any side.

    The splines of ``table`` interpolate the flows; they are symmetric at zero incidence.
    """
    random = np.random.default_rng([seed, round(1e6 * band[0])])
    mach = vehicle.conditions.mach_number
    flights = drawn_conditions(
        conditions,
        random,
        angles=lambda: wind_angles(float(random.uniform(*band)), float(random.uniform(0.0, 2.0 * np.pi))),
        mach_numbers=(max(min(mach), float(table.mach_knots[0])), min(max(mach), float(table.mach_knots[-1]))),
        altitudes_km=drawn_altitudes_km(vehicle),
        is_inside=lambda one: True,
    )
    flown = drawn_vehicles(vehicle, structure, table, flights)
    return readings(inverse_map, vehicle.noise, flown, random, vehicles)


def errors_by_incidence(
    inverse_map: InverseMap,
    linear: InverseMap,
    vehicle: Vehicle,
    structure: TrueStructure,
    table: FlowTable,
    *,
    conditions: int,
    vehicles: int,
    seed: int = 1,
    ends_deg: Sequence[float] = BANDS_DEG,
) -> Iterator[tuple[tuple[float, float], Score, Score]]:
    """Return band [rad], and scores of the maps ``linear`` and ``inverse_map`` there.

    Raises
    ------
    InputError
        ``table`` does not cover the map, or the Fourier model cannot do the vehicle.
    """
    estimators = Estimator(linear.without_tables()), Estimator(inverse_map)
    for band in bands(table, ends_deg):
        flown = flown_in_band(
            inverse_map, vehicle, structure, table, band, conditions=conditions, vehicles=vehicles, seed=seed
        )
        truth = np.repeat(flown.coefficients, vehicles, axis=0)
        found = [estimates(one, flown) for one in estimators]
        of_linear, of_nonlinear = (
            score_of(COEFFICIENT_NAMES, one.coefficients - truth, one.std, health=one.health) for one in found
        )
        yield band, of_linear, of_nonlinear


def line_of(band: tuple[float, float], linear: Score, nonlinear: Score) -> str:
    """Return a line of the table: rms errors of the linear estimator, and of the nonlinear one over them."""
    low, high = np.degrees(band)
    rms = " ".join(f"{1e4 * one:6.1f}" for one in linear.rms.tolist())
    over = " ".join(f"{one:5.2f}" for one in (nonlinear.rms / linear.rms).tolist())
    least = 100.0 * float(nonlinear.coverage_3.min())
    return f"{f'{low:.3g} to {high:.3g}':14s}{rms}   {over}   {least:6.2f}"


def main() -> None:
    """Print the table."""
    parser = study_parser("incidence", __doc__)
    parser.add_argument("--linear", type=Path, help="map of the linear estimator alone; by default MAP's")
    parser.add_argument("--conditions", type=int, default=400, help="in each band of incidence")
    parser.add_argument("--vehicles", type=int, default=10, help="vehicles as built at each condition")
    options = parser.parse_args()
    if min(options.conditions, options.vehicles) < 1 or options.seed < 0:
        raise InputError("expected --conditions and --vehicles from 1 on and --seed from 0 on")
    inverse_map = load_inverse_map(options.map)
    if inverse_map.manifold is None:
        raise InputError(f"{options.map}: expected tables of the nonlinear estimator, got a linear map")
    linear = inverse_map if options.linear is None else load_inverse_map(options.linear)
    vehicle, table = vehicle_and_flows(options.vehicle, inverse_map, options.map, options.flows)
    trial = {"conditions": options.conditions, "vehicles": options.vehicles, "seed": options.seed}
    names = " ".join(f"{name:>6s}" for name in COEFFICIENT_NAMES)
    print(f"{'incidence':14s}{names}   rms error of the linear estimator [1e-4]; nonlinear over it;")
    print(f"{'[deg]':14s}{'':34s}   smallest part of the nonlinear estimates inside 3 sigma [%]")
    for one in errors_by_incidence(inverse_map, linear, vehicle, true_structure(vehicle), table, **trial):
        print(line_of(*one), flush=True)


if __name__ == "__main__":
    run_study(main)
