"""What all vehicles of a calibration's score share: flights, structures, and the test without readings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builder.aero.loads.operator import coefficient_scale, load_operator
from builder.calibration.as_built.outside_errors import OutsideStructures, outside_structures
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.ground_test.candidate_cases import Candidate
from builder.calibration.ground_test.load_test import LoadCase, LoadErrors, LoadTest
from builder.calibration.ground_test.simulated import known_loads
from builder.calibration.ground_test.standard_cases import standard_cases
from builder.campaign.snapshot_transfer import snapshots_on
from builder.campaign.snapshots import Snapshots
from builder.structure.as_built.structure import AsBuiltStructure, as_built_structure
from builder.structure.as_built.vehicle import AsBuilt, prior_std
from builder.structure.loads.loaded_structure import LoadProperties
from builder.trial.conditions import held_out_conditions
from builder.truth.revolution.flow_table import FlowTable, flow_states, harmonics_at, ratio_on
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition

READING_STD = 0.05e-6
"""Of a reading that is the mean over a window [m/m]."""

HARMONICS = 14
"""Of loads: pads of half angle 30 deg need 12."""

DENSITY = 4430.0
"""Where the vehicle file names none: titanium [kg/m3]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Flights:
    """Held-out flights: net pressure (k, n_p) [Pa] on the nodes of the independent model, and the truth."""

    conditions: tuple[FlightCondition, ...]
    pressure: FloatArray
    coefficients: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Setup:
    """What all vehicles of a score share.

    Attributes
    ----------
    vehicle : its map holds no errors of the hardware but those that the test leaves.
    snapshots : on the nodes of ``structure``.
    structure : the map's.
    truth : the independent model, its wall by tables of its own.
    solve_walls : solve the wall of every vehicle instead.
    outside : structures with errors that the calibration does not know; None where none are scored.
    models : the test by the number of its pads, without readings.
    cases : of the largest test; the smaller ones begin with the same pads.
    errors : of the loads.
    std : what vehicles are drawn from.
    draws : of noise for each flight.
    """

    vehicle: Vehicle
    snapshots: Snapshots
    structure: AsBuiltStructure
    flights: Flights
    truth: AsBuiltStructure
    solve_walls: bool
    outside: OutsideStructures | None
    models: dict[int, ReadingsModel]
    cases: tuple[Candidate, ...]
    errors: LoadErrors
    std: AsBuilt
    draws: int

    def truth_of(self, built: AsBuilt) -> AsBuiltStructure:
        """Return the independent model of a vehicle."""
        if not self.solve_walls:
            return self.truth
        return as_built_structure(
            self.vehicle,
            self.vehicle.gauges.layout,
            self.vehicle.resolution.truth,
            properties_of(self.vehicle),
            built.wall_thickness,
            HARMONICS,
            known_taper=built.wall_taper,
        )


@dataclass(frozen=True, kw_only=True)
class SetupOptions:
    """Choices of a score.

    Attributes
    ----------
    cases : numbers of pads of the tests.
    flights, draws : held-out flights, and draws of noise for each.
    errors : of the loads, drawn and known to the calibration.
    solve_walls, with_outside : as in :class:`Setup`.
    """

    cases: tuple[int, ...]
    flights: int = 60
    draws: int = 8
    errors: LoadErrors
    solve_walls: bool = False
    with_outside: bool = False


def setup_of(vehicle: Vehicle, snapshots: Snapshots, table: FlowTable, options: SetupOptions) -> Setup:
    """Solve what all vehicles of a score share."""
    vehicle = vehicle.model_copy(update={"noise": vehicle.noise.without_hardware_errors()})
    layout, properties = vehicle.gauges.layout, properties_of(vehicle)
    structure = as_built_structure(vehicle, layout, vehicle.resolution.map, properties, max_harmonic=HARMONICS)
    known = np.zeros(structure.n_regions) if options.solve_walls else None
    truth = as_built_structure(vehicle, layout, vehicle.resolution.truth, properties, known, HARMONICS)
    std = prior_std(vehicle.calibration, structure.counts)
    return Setup(
        vehicle=vehicle,
        snapshots=snapshots_on(snapshots, structure.surface),
        structure=structure,
        flights=flights_of(vehicle, table, truth.surface, options.flights),
        truth=truth,
        solve_walls=options.solve_walls,
        outside=outside_structures(vehicle, properties, HARMONICS) if options.with_outside else None,
        models={
            count: ReadingsModel(structure, blank_test(vehicle, structure, count, options.errors), std)
            for count in options.cases
        },
        cases=cases_of_test(vehicle, max(options.cases)),
        errors=options.errors,
        std=std,
        draws=options.draws,
    )


def properties_of(vehicle: Vehicle) -> LoadProperties:
    """Return what known loads need; a vehicle whose file names no density is of titanium."""
    return LoadProperties(density=vehicle.material.density_kg_per_m3 or DENSITY)


def flights_of(vehicle: Vehicle, table: FlowTable, grid: SurfaceGrid, count: int) -> Flights:
    """Return ``count`` held-out flights, with the pressure [Pa] on the nodes of ``grid``."""
    conditions = held_out_conditions(vehicle, table, count, np.random.default_rng(31))
    mach, incidence, wind = flow_states(conditions)
    ambient = np.array([one.ambient_pressure for one in conditions])
    dynamic = np.array([one.dynamic_pressure for one in conditions])
    ratio = ratio_on(harmonics_at(table, mach, incidence), wind, grid.roll_angle)
    net = ambient[:, None] * (ratio - 1.0)
    reference = vehicle.reference_quantities()
    scale = np.array([coefficient_scale(q, reference) for q in dynamic])
    loads = net @ load_operator(grid, reference.moment_station).T
    return Flights(conditions=tuple(conditions), pressure=net, coefficients=loads * scale)


def cases_of_test(vehicle: Vehicle, count: int) -> tuple[Candidate, ...]:
    """Return ``count`` pads, and own weight in four attitudes."""
    found = standard_cases(count, vehicle.body().length, LoadErrors())
    return tuple(Candidate(name=name, loads=tuple(one.load for one in loads)) for name, loads in found)


def blank_test(vehicle: Vehicle, structure: AsBuiltStructure, count: int, errors: LoadErrors) -> LoadTest:
    """Return a test without readings: ``count`` pads, and own weight in four attitudes."""
    return load_test_of(structure, cases_of_test(vehicle, count), errors)


def load_test_of(
    structure: AsBuiltStructure, cases: Sequence[Candidate], errors: LoadErrors, reading_std: float = READING_STD
) -> LoadTest:
    """Return the test of ``cases`` without readings, whose standard deviation will be ``reading_std`` [m/m]."""
    n_d = structure.n_gauges
    found = [
        LoadCase(
            name=one.name,
            loads=known_loads(one, errors),
            reading=np.zeros(n_d),
            reading_std=np.full(n_d, reading_std),
        )
        for one in cases
    ]
    return LoadTest(gauge_names=structure.gauges.names, cases=tuple(found), errors=errors)


def rows_of_test(count: int, largest: int, n_cases: int) -> Sequence[int]:
    """Return the rows of ``count`` pads and of the attitudes among the cases of the largest test."""
    return [*range(count), *range(largest, n_cases)]


def score_parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """Return the parser of ``python -m builder.calibration.score.NAME`` with the files that it reads."""
    found = argparse.ArgumentParser(
        prog=f"python -m builder.calibration.score.{name}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    found.add_argument("vehicle", type=Path, help="vehicle file")
    found.add_argument("snapshots", type=Path, help="snapshots.h5 of its map")
    found.add_argument("flows", type=Path, help="independent_flows.h5")
    return found
