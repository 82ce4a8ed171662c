"""The shipped vehicle at a coarse resolution, its structure and real snapshots."""

from collections.abc import Sequence
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inverse_case import Case, snapshots_at
from once import once

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.aero.euler.planes import marching_grid_of
from builder.aero.load_operator import load_operator
from builder.campaign.scheduling import Scheduling, solve_flows
from builder.campaign.snapshots import Snapshots, load_snapshots, save_snapshots
from builder.inverse.problem import gauge_noise_covariance
from builder.structure.fourier.fourier_model import StructuralModel, structural_model
from builder.truth.flow_table import (
    FlowTable,
    flow_keys,
    flow_states,
    flow_table,
    knot_weights,
    truth_engine,
    truth_knots,
    truth_surface,
)
from builder.truth.true_structure import TrueFlights, TrueStructure, flights_of_flows, true_structure
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.flight_conditions import condition_grid
from builder.vehicle.map_options import MapEntry
from builder.vehicle.model_entries import Resolution, Resolutions
from strainfmu.flight_condition import FlightCondition
from strainfmu.linear.pressure_modes import LowRankPrior, prior_of_snapshots, proper_orthogonal_decomposition

COARSE = Resolution(
    radial_cells=12,
    circumferential_cells=16,
    surface_stations=40,
    surface_roll_angles=24,
    harmonics=10,
    element_length_mm=40.0,
    wall_layers=1,
)


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    """The shipped vehicle with a linear map, which is what most tests are about, and fewer flows of the truth."""
    shipped = load_vehicle(IC3X)
    linear = shipped.map.model_copy(update={"estimator": "linear"})
    truth = shipped.truth.model_copy(update={"total_incidence_deg": [1.0, 3.0, 5.0, 7.0, 9.0, 11.0]})
    resolution = Resolutions(map=COARSE, truth=COARSE)
    return shipped.model_copy(update={"resolution": resolution, "map": linear, "truth": truth})


@pytest.fixture(scope="session")
def paper_vehicle(vehicle: Vehicle) -> Vehicle:
    """The vehicle with the map of the source: pressure in Pa, angles as listed, no hardware errors."""
    return with_paper_map(vehicle)


def with_paper_map(vehicle: Vehicle, **entry: Any) -> Vehicle:
    """Return ``vehicle`` with a map in form "absolute" of the listed angles, without hardware errors."""
    changed = MapEntry(form="absolute", symmetry="listed", **entry)
    return vehicle.model_copy(update={"map": changed, "noise": vehicle.noise.without_hardware_errors()})


@pytest.fixture(scope="session")
def structure(vehicle: Vehicle) -> StructuralModel:
    return structural_model(vehicle, COARSE, list(vehicle.gauges.layouts))


@pytest.fixture(scope="session")
def snapshots(
    vehicle: Vehicle,
    structure: StructuralModel,
    compiled_solver: None,
    tmp_path_factory: pytest.TempPathFactory,
) -> Snapshots:
    """The 90 conditions of the vehicle file."""

    def solve(folder: Path) -> None:
        engine = EulerEngine(vehicle.body(), marching_grid_of(COARSE), structure.surface)
        save_snapshots(snapshots_at(engine, vehicle, vehicle.flight_conditions()), folder / "snapshots.h5")

    return load_snapshots(once(tmp_path_factory, "coarse_snapshots", solve) / "snapshots.h5")


@pytest.fixture(scope="session")
def prior_snapshots(vehicle: Vehicle, structure: StructuralModel, compiled_solver: None) -> Snapshots:
    """The 243 conditions of the published prior: M {5, 6, 7}, a and b {-8, -6, .. 8} deg at 20 km."""
    angles = list(np.arange(-8.0, 9.0, 2.0))
    engine = EulerEngine(vehicle.body(), marching_grid_of(COARSE), structure.surface)
    return snapshots_at(engine, vehicle, condition_grid([5.0, 6.0, 7.0], angles, angles, 20e3))


@pytest.fixture(scope="session")
def prior(prior_snapshots: Snapshots) -> LowRankPrior:
    return prior_of_snapshots(prior_snapshots.pressure)


@pytest.fixture(scope="session")
def held_out_of_prior(vehicle: Vehicle, structure: StructuralModel) -> Snapshots:
    """24 conditions inside the envelope of the prior that are not among its snapshots."""
    random = np.random.default_rng(12)
    conditions = [
        FlightCondition(
            mach_number=float(mach), angle_of_attack=radians(alpha), sideslip_angle=radians(beta), altitude=20e3
        )
        for mach, alpha, beta in random.uniform([5.0, -8.0, -8.0], [7.0, 8.0, 8.0], size=(24, 3))
    ]
    engine = EulerEngine(vehicle.body(), marching_grid_of(COARSE), structure.surface)
    return snapshots_at(engine, vehicle, conditions)


@pytest.fixture(scope="session")
def held_out(vehicle: Vehicle, structure: StructuralModel) -> Snapshots:
    """24 conditions inside the envelope that are not among the snapshots."""
    random = np.random.default_rng(11)
    conditions = [
        FlightCondition(
            mach_number=float(mach), angle_of_attack=radians(alpha), sideslip_angle=radians(beta), altitude=20e3
        )
        for mach, alpha, beta in random.uniform([5.0, 0.0, 0.0], [7.0, 10.0, 10.0], size=(24, 3))
    ]
    engine = EulerEngine(vehicle.body(), marching_grid_of(COARSE), structure.surface)
    return snapshots_at(engine, vehicle, conditions)


@pytest.fixture(scope="session")
def case(vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots) -> Case:
    layout = vehicle.gauges.layout
    z_p = structure.strain_operator(layout)
    return Case(
        strain_operator=z_p,
        loads=load_operator(structure.surface, vehicle.reference.moment_station_m),
        modes=proper_orthogonal_decomposition(snapshots.pressure),
        noise_std=np.sqrt(np.diag(gauge_noise_covariance(vehicle, snapshots, structure))),
        internal_pressure=float(snapshots.internal_pressure[0]),
    )


@pytest.fixture(scope="session")
def truth_flows(vehicle: Vehicle, compiled_solver: None) -> dict[FlowKey, Flow]:
    """The flows at the knots of the flight model."""
    solved = solve_flows(truth_engine(vehicle), flow_keys(*truth_knots(vehicle.truth)), Scheduling(workers=0))
    return {solution.flow.key: solution.flow for solution in solved}


@pytest.fixture(scope="session")
def true_model(vehicle: Vehicle) -> TrueStructure:
    """The structure of the independent model."""
    return true_structure(vehicle)


@pytest.fixture(scope="session")
def table(vehicle: Vehicle, truth_flows: dict[FlowKey, Flow]) -> FlowTable:
    """The pressure of the independent model."""
    mach, incidence = truth_knots(vehicle.truth)
    return flow_table(vehicle.name, truth_surface(vehicle), vehicle.resolution.truth, mach, incidence, truth_flows)


def true_flights(
    vehicle: Vehicle, structure: TrueStructure, table: FlowTable, conditions: Sequence[FlightCondition]
) -> TrueFlights:
    """Return the flights at ``conditions``, between the flows of ``table``."""
    mach, incidence, _ = flow_states(conditions)
    return flights_of_flows(vehicle, structure, table.flows, knot_weights(table, mach, incidence), conditions)
