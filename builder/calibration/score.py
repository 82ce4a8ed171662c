"""Calibration scored on vehicles drawn at random: errors in flight before, after, and if all were known.

Each vehicle is drawn from the tolerances of the section [calibration], is tested and flies on the independent
model: another mesh, its own wall solved for, other flows. The map sees the readings of its test alone.

    python -m builder.calibration.score VEHICLE SNAPSHOTS FLOWS --vehicles 40 --cases 12 -o score.json
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.loads import coefficient_scale, load_operator
from builder.calibration.as_built_parameters import AsBuiltParameters, drawn, prior_std
from builder.calibration.as_built_structure import AsBuiltStructure, as_built_structure
from builder.calibration.calibrated_map import Remaining, calibrated_map, remaining_terms
from builder.calibration.estimate import Estimate
from builder.calibration.faults import calibrate_with_faults
from builder.calibration.load_test import LoadCase, LoadErrors, LoadTest
from builder.calibration.readings_model import ReadingsModel
from builder.calibration.standard_cases import standard_cases
from builder.campaign.snapshot_transfer import snapshots_on
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.inverse.ensemble import ensemble_of
from builder.structure.loads.loaded_structure import LoadProperties
from builder.truth.flow_table import FlowTable, harmonics_at, load_flow_table
from builder.truth.held_out import held_out_conditions
from builder.vehicle.file import Vehicle, load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.step import Estimator
from strainfmu.flight_condition import FlightCondition

READING_STD = 0.05e-6
"""Of a reading that is the mean over a window [m/m]."""

HARMONICS = 14
"""Of loads: pads of half angle 30 deg need 12."""

DENSITY = 4430.0
"""Where the vehicle file names none: titanium [kg/m3]."""

KINDS: dict[str, dict[str, Any]] = {
    "case 1": {"case": 1},
    "case 2": {"case": 2},
    "manifold": {"estimator": "manifold"},
}
"""Entries of [map] of the maps that are scored."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Flights:
    """Held-out flights: net pressure (k, n_p) [Pa] on the nodes of the independent model, and the truth."""

    conditions: tuple[FlightCondition, ...]
    pressure: FloatArray
    coefficients: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Setup:
    """What all vehicles of a score share.

    ``structure`` is the map's, ``truth`` that of the independent model; its wall is solved for again for every
    vehicle where ``solve_walls``, and follows from its tables otherwise. ``models`` hold the test by the number of
    its pads, without readings; ``std`` is what vehicles are drawn from.
    """

    vehicle: Vehicle
    snapshots: Snapshots
    structure: AsBuiltStructure
    flights: Flights
    truth: AsBuiltStructure
    solve_walls: bool
    models: dict[int, ReadingsModel]
    std: AsBuiltParameters
    draws: int


def flights_of(vehicle: Vehicle, table: FlowTable, structure: AsBuiltStructure, count: int) -> Flights:
    """Return ``count`` held-out flights on the nodes of ``structure``."""
    conditions = held_out_conditions(vehicle, table, count, np.random.default_rng(31))
    mach, incidence, wind, ambient, dynamic = (
        np.array([getattr(one, name) for one in conditions])
        for name in (
            "mach_number",
            "total_incidence",
            "leeward_roll_angle",
            "ambient_pressure",
            "dynamic_pressure",
        )
    )
    harmonic, grid = harmonics_at(table, mach, incidence), structure.surface
    m = np.arange(harmonic.shape[-1])
    ratio = np.array([h @ np.cos(np.outer(m, grid.roll_angle - at)) for h, at in zip(harmonic, wind, strict=True)])
    net = ambient[:, None] * (ratio.reshape(len(ratio), -1) - 1.0)
    reference = vehicle.reference_quantities()
    scale = np.array([coefficient_scale(q, reference) for q in dynamic])
    loads = net @ load_operator(grid, reference.moment_station).T
    return Flights(conditions=tuple(conditions), pressure=net, coefficients=loads * scale)


def blank_test(vehicle: Vehicle, structure: AsBuiltStructure, cases: int, errors: LoadErrors) -> LoadTest:
    """Return a test without readings: pads, and own weight in four attitudes."""
    n_d = structure.n_gauges
    found = [
        LoadCase(name=name, loads=loads, reading=np.zeros(n_d), reading_std=np.full(n_d, READING_STD))
        for name, loads in standard_cases(cases, vehicle.body().length, errors)
    ]
    return LoadTest(gauge_names=structure.gauges.names, cases=tuple(found), errors=errors)


def measured(truth: AsBuiltStructure, built: AsBuiltParameters, test: LoadTest, seed: int) -> FloatArray:
    """Return the readings (n_cases, n_d) of one vehicle: its loads are not quite those that are stated."""
    random, n_d = np.random.default_rng(seed), truth.n_gauges
    cell = test.errors.common * random.standard_normal()
    found = []
    for case in test.cases:
        reading = built.zero + case.reading_std * random.standard_normal(n_d)
        for one in case.loads:
            factor = 1.0 + one.std * random.standard_normal() + (cell if one.on_load_cell else 0.0)
            reading = reading + factor * truth.load_strain(built, [one.load])
        found.append(reading)
    return np.array(found)


def flown(
    setup: Setup, inverse_map: InverseMap, kind: str, strain: FloatArray, seed: int
) -> tuple[FloatArray, FloatArray]:
    """Return errors and sigmas (n, 5) of the coefficients in the flights, each with several draws of noise."""
    random, conditions = np.random.default_rng(seed), setup.flights.conditions
    mach, altitude, q, ambient = (
        np.repeat([getattr(one, name) for one in conditions], setup.draws)
        for name in ("mach_number", "altitude", "dynamic_pressure", "ambient_pressure")
    )
    read = np.repeat(strain, setup.draws, axis=0)
    read = read + inverse_map.noise_std * random.standard_normal(read.shape)
    truth = np.repeat(setup.flights.coefficients, setup.draws, axis=0)
    if kind == "manifold":
        flight = ManifoldEstimator(inverse_map).estimate(read, q, mach_number=mach, static_pressure=ambient)
        return flight.coefficients - truth, flight.coefficients_std
    known = Estimator(inverse_map).estimate(read, q, mach_number=mach, altitude=altitude)
    return known.coefficients - truth, known.coefficients_std


def of_vehicle(setup: Setup, number: int, cases: Sequence[int], kinds: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Return one row for each map of vehicle ``number``."""
    built = drawn(setup.std, np.random.default_rng([7, number]))
    truth = setup.truth
    if setup.solve_walls:
        resolution, layout = setup.vehicle.resolution.truth, setup.vehicle.gauges.layout
        properties = setup.structure.states.forces[0].properties
        truth = as_built_structure(setup.vehicle, layout, resolution, properties, built.wall_thickness, HARMONICS)
    strain = setup.flights.pressure @ truth.strain_operator(built).T
    zero = np.zeros((len(setup.std.vector),) * 2)
    known = Remaining(parameters=built, covariance=zero)
    drawing = Remaining(parameters=setup.structure.exactly_built(), covariance=np.diag(setup.std.vector**2))
    states: list[tuple[str, Remaining, dict[str, Any]]] = [("exact", known, {}), ("before", drawing, {})]
    for count in cases:
        blank = setup.models[count]
        model = blank.with_readings(measured(truth, built, blank.test, number))
        found, faults = calibrate_with_faults(model)
        states.append((f"{count} cases", remaining_of(found), facts_of(found, len(faults))))
    ensemble = ensemble_of(setup.vehicle, setup.snapshots)
    terms = [remaining_terms(setup.structure, remaining, ensemble) for _, remaining, _ in states]
    for kind in kinds:
        entry = setup.vehicle.map.model_copy(update=KINDS[kind])
        vehicle = setup.vehicle.model_copy(update={"map": entry})
        for (state, remaining, facts), noise in zip(states, terms, strict=True):
            left = built.zero - remaining.parameters.zero if state != "before" else 0.0 * built.zero
            made = calibrated_map(vehicle, setup.snapshots, setup.structure, remaining, terms=noise)
            error, sigma = flown(setup, made, kind, strain + left, number)
            yield {"vehicle": number, "map": kind, "state": state, **facts, **errors_of(error, sigma)}


def remaining_of(found: Estimate) -> Remaining:
    """Return what a test left of the vehicle."""
    n = found.model.n_built
    return Remaining(parameters=found.parameters, covariance=found.covariance[:n, :n])


def facts_of(found: Estimate, faults: int) -> dict[str, Any]:
    """Return how a test was fitted."""
    return {"chi_square_per_reading": found.chi_square / found.n_readings, "faults": faults, "steps": found.steps}


def errors_of(error: FloatArray, sigma: FloatArray) -> dict[str, Any]:
    """Return mean squares and coverage of errors (n, 5) of the coefficients."""
    with np.errstate(invalid="ignore"):
        inside = np.abs(error) <= 3.0 * sigma
    return {
        "mean_square": np.nanmean(error**2, axis=0).tolist(),
        "coverage_percent": (100.0 * inside.mean(axis=0)).tolist(),
        "sigma": np.nanmean(sigma, axis=0).tolist(),
    }


def summary(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return pooled rms errors over those of the exactly known vehicle, and coverage, by map and state."""
    found = []
    for kind in dict.fromkeys(row["map"] for row in rows):
        of_kind = [row for row in rows if row["map"] == kind]
        exact = np.mean([row["mean_square"] for row in of_kind if row["state"] == "exact"], axis=0)
        for state in dict.fromkeys(row["state"] for row in of_kind):
            of_state = [row for row in of_kind if row["state"] == state]
            coverage = np.array([row["coverage_percent"] for row in of_state])
            square = np.mean([row["mean_square"] for row in of_state], axis=0)
            chi = [row["chi_square_per_reading"] for row in of_state if "chi_square_per_reading" in row]
            found.append(
                {
                    "map": kind,
                    "state": state,
                    "vehicles": len(of_state),
                    "rms": dict(zip(COEFFICIENT_NAMES, np.sqrt(square).tolist(), strict=True)),
                    "ratio": np.sqrt(square / exact).round(3).tolist(),
                    "coverage_percent": coverage.mean(axis=0).round(2).tolist(),
                    "worst_vehicle_percent": float(coverage.mean(axis=1).min().round(1)),
                    "chi_square_per_reading": None if not chi else [min(chi), float(np.mean(chi)), max(chi)],
                    "faults": sum(row.get("faults", 0) for row in of_state),
                }
            )
    return found


def setup_of(vehicle: Vehicle, snapshots: Snapshots, table: FlowTable, options: argparse.Namespace) -> Setup:
    """Solve what all vehicles share; the vehicle's map then holds no errors of the hardware but the test's."""
    noise = vehicle.noise.without_hardware_errors()
    vehicle = vehicle.model_copy(update={"noise": noise})
    layout = vehicle.gauges.layout
    properties = LoadProperties(density=vehicle.material.density_kg_per_m3 or DENSITY)
    structure, truth = (
        as_built_structure(vehicle, layout, resolution, properties, max_harmonic=HARMONICS)
        for resolution in (vehicle.resolution.map, vehicle.resolution.truth)
    )
    std = prior_std(vehicle.calibration, structure.n_gauges, structure.n_regions)
    errors = LoadErrors(common=0.0, pad_position=0.0, pad_roll=0.0, pad_shape=0.0)
    return Setup(
        vehicle=vehicle,
        snapshots=snapshots_on(snapshots, structure.surface),
        structure=structure,
        flights=flights_of(vehicle, table, truth, options.flights),
        truth=truth,
        solve_walls=options.solve_walls,
        models={
            count: ReadingsModel(structure, blank_test(vehicle, structure, count, errors), std)
            for count in options.cases
        },
        std=std,
        draws=options.draws,
    )


def main() -> None:
    """Score vehicles and write rows and their summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vehicle", type=Path)
    parser.add_argument("snapshots", type=Path)
    parser.add_argument("flows", type=Path)
    parser.add_argument("--vehicles", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases", type=int, nargs="+", default=[12])
    parser.add_argument("--maps", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--flights", type=int, default=60)
    parser.add_argument("--draws", type=int, default=8)
    parser.add_argument("--solve-walls", action="store_true")
    parser.add_argument("-o", "--output", type=Path, default=Path("calibration_score.json"))
    options = parser.parse_args()
    setup = setup_of(
        load_vehicle(options.vehicle),
        load_snapshots(options.snapshots),
        load_flow_table(options.flows),
        options,
    )
    rows: list[dict[str, Any]] = []
    for number in range(options.first, options.first + options.vehicles):
        rows += of_vehicle(setup, number, options.cases, options.maps)
        options.output.write_text(json.dumps({"rows": rows, "summary": summary(rows)}, indent=1))
        print(f"vehicle {number}", flush=True)
    for line in summary(rows):
        print(json.dumps(line))


if __name__ == "__main__":
    main()
