"""The stages from a vehicle to its inverse map, in memory: plain functions for notebooks and scripts.

The commands run the same functions and put files between them (:mod:`builder.pipeline.map_files`). So a map made
here is the map that ``strainfmu build`` writes, bit for bit.

The flows of the independent model in a folder of results: a table of a body of revolution, and flows at given
conditions of any other shape.
"""

import json
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from warnings import warn

import numpy as np

from builder.aero.engine import FlowKey
from builder.aero.engines.registry import make_engine
from builder.campaign import snapshots as snapshots_file
from builder.campaign.campaign_run import (
    Campaign,
    CampaignResult,
    campaign_notes,
    run_campaign,
    snapshots_in_memory,
    vehicle_campaign,
)
from builder.campaign.failures import failed_conditions, missing_line
from builder.campaign.journal import Journal
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshot_fit import as_flown, flow_record, vehicle_misfits
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.mode_choice import mode_choice_lines
from builder.inverse.noise.hardware_errors import mesh_error_notes
from builder.inverse.problem import AnyStructure, check_noise, check_other_loads, inverse_problem
from builder.inverse.solution import Problem
from builder.manifold.nonlinear_build import with_manifold
from builder.pipeline.estimator_choice import as_chosen, compared_on_left_out, linear_because
from builder.pipeline.measured_levels import (
    alarm_levels_wanted,
    level_conditions,
    with_measured_levels,
    with_shape_levels,
)
from builder.pipeline.pipeline import Pipeline
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.reporting import Reporter
from builder.structure.external.external_structure import external_structure
from builder.structure.fourier.fourier_model import (
    StructuralModel,
    structural_model,
    with_mesh_error,
)
from builder.structure.gauge_checks import check_gauges
from builder.structure.mapped_structure import MappedStructure, mapped_structure
from builder.structure.solid.case import structure_case
from builder.structure.solid.checks import (
    NO_REFERENCE,
    REFERENCE_HARMONICS,
    largest_amplitude,
    reference_pressures,
)
from builder.structure.solid.solid_model import solve_solid_structure
from builder.structure.structure_file import Structure
from builder.structure.structure_fit import on_solid_model, structure_misfits, structure_record
from builder.trial.readings import World
from builder.truth.flow_table import flow_inputs, save_flow_table, solved_flows, truth_knots
from builder.truth.shape import shape_flows
from builder.truth.true_structure import TrueStructure, true_structure
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.flight_conditions import ConditionSet
from builder.vehicle.map_needs import check_map_size, used_layouts, why_linear
from builder.vehicle.model_entries import Resolution
from builder.workspace import refuse_misfits
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.flight_condition import FlightCondition

FLOW_TITLE = "Flow: snapshots"
STRUCTURE_TITLE = "Structure: strain per pressure"


def take_snapshots(
    vehicle: Vehicle | str | Path, *, workers: int | None = 0, progress: AnyProgress = None
) -> Snapshots:
    """Return the surface pressure at the flight conditions of a vehicle.

    Conditions outside the solver's reach are left out: a warning counts them, ``settings["failed"]`` names them.

    Parameters
    ----------
    vehicle : the vehicle, or the path of its file.
    workers : local processes; 0 for threads of this process; None for as many as there are cores. Processes are
        spawned: a script that asks for them needs the usual ``if __name__ == "__main__":``.
    progress : True for progress bars; silent by default.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong, or every condition is outside the solver's reach.
    """
    vehicle, reporter = _vehicle(vehicle), reporter_of(progress)
    campaign = snapshot_campaign(vehicle, reporter)
    result = snapshots_in_memory(campaign, Scheduling(workers=workers), reporter, FLOW_TITLE)
    note_campaign(result, reporter)
    if result.failed:
        warn(missing_line(result.failed, len(result.snapshots.condition)), stacklevel=2)
    return result.snapshots


def solve_structure(
    vehicle: Vehicle | str | Path, *, layouts: list[str] | None = None, progress: AnyProgress = None
) -> StructuralModel | Structure:
    """Return the strain per pressure of a vehicle's gauges, by the structural model of its file.

    The Fourier model gives a :class:`StructuralModel`, whose ``strain_operator(layout)`` is Z_p (n_d, n_p) [1/Pa]
    at the nodes of the snapshots. The solid model gives a :class:`Structure`, whose ``strain_operator`` [1/Pa] is
    at the nodes of its own mesh, all layouts one after another; :func:`build_map` maps it to the snapshots.

    Parameters
    ----------
    vehicle : the vehicle, or the path of its file.
    layouts : names of gauge layouts; by default those that the map needs.
    progress : True for progress bars; silent by default.

    Raises
    ------
    InputError
        The vehicle file is wrong, the wall does not fit the body, or a gauge is not on its surface.
    """
    vehicle, reporter = _vehicle(vehicle), reporter_of(progress)
    if vehicle.structure.external is not None:
        raise InputError(f"structure.{vehicle.structure.external}: needs the snapshots; build_map takes it itself")
    chosen = used_layouts(vehicle) if layouts is None else list(layouts)
    if vehicle.structure.model == "solid":
        return solve_solid_structure(structure_case(vehicle, chosen), reporter)
    return fourier_structure(vehicle, chosen, reporter)


def build_map(
    vehicle: Vehicle | str | Path,
    *,
    snapshots: Snapshots | None = None,
    structure: StructuralModel | MappedStructure | Structure | None = None,
    progress: AnyProgress = None,
) -> InverseMap:
    """Return the inverse map of a vehicle: strain to loads, with covariance.

    Parameters
    ----------
    vehicle : the vehicle, or the path of its file.
    snapshots : from :func:`take_snapshots` or :func:`load_snapshots`; made here by default.
    structure : from :func:`solve_structure`; solved here by default.
    progress : True for progress bars; silent by default.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong; snapshots or structure are of another body, wall or gauges;
        every condition is outside the solver's reach; or the gauges, or the conditions that are left, cannot carry
        the map.
    """
    vehicle, reporter = _vehicle(vehicle), reporter_of(progress)
    if snapshots is not None:
        refuse_misfits("snapshots", vehicle_misfits(snapshots, vehicle))
    if isinstance(structure, Structure):
        vehicle = on_solid_model(vehicle)
        refuse_misfits("structure", structure_misfits(structure, vehicle))
    check_before_long_work(vehicle, None if snapshots is None else len(snapshots.condition))
    if snapshots is None:
        snapshots = take_snapshots(vehicle, progress=reporter)
    if structure is None and vehicle.structure.external is not None:
        structure = external_structure(vehicle, snapshots)
    if structure is None:
        structure = solve_structure(vehicle, progress=reporter)
    solid = structure if isinstance(structure, Structure) else None
    flown = as_flown(vehicle, snapshots)
    flies = alarm_levels_wanted(flown, reporter)
    mapped = on_snapshots(structure, snapshots, reporter)
    inverse_map = map_from(vehicle, snapshots, mapped, reporter, solid, compares=not flies)
    vehicle = flown
    if not flies:
        return inverse_map
    if not vehicle.is_axisymmetric:
        of_levels = shape_flows(vehicle, level_conditions(vehicle), reporter, "Flow: alarm levels")
        return with_shape_levels(vehicle, inverse_map, solid, of_levels, reporter)
    flows = solved_flows(vehicle, *truth_knots(vehicle.truth), reporter, scheduling=Scheduling(workers=0))
    true = solved_true_structure(vehicle, reporter)
    return with_measured_levels(
        World(vehicle=vehicle, structure=true, flows=flows, inverse_map=inverse_map), reporter
    )


def check_before_long_work(vehicle: Vehicle, conditions: int | None = None) -> None:
    """Refuse a vehicle whose gauges, modes, noise or places of loads do not fit, before anything is solved.

    ``conditions`` is the number of flight conditions; by default the number of the vehicle file.

    Raises
    ------
    InputError
        Names the entry of the vehicle file.
    """
    count = len(vehicle.flight_conditions()) if conditions is None else conditions
    check_map_size(vehicle.map, check_gauges(vehicle)[vehicle.gauges.layout], count)
    check_noise(vehicle)
    check_other_loads(vehicle)


def snapshot_campaign(vehicle: Vehicle, reporter: Reporter) -> Campaign:
    """Return the campaign of the vehicle file: its engine over its conditions."""
    engine = make_engine(vehicle, None, vehicle.resolution.map, note=reporter.note)
    return vehicle_campaign(vehicle, engine)


def note_campaign(result: CampaignResult, reporter: Reporter) -> None:
    """Report in a few lines what a campaign did."""
    for note in campaign_notes(result):
        reporter.note(note)


def fourier_structure(vehicle: Vehicle, layouts: list[str], reporter: Reporter) -> StructuralModel:
    """Return strain per pressure of the semi-analytic model at the map's resolution."""
    with reporter.stage(STRUCTURE_TITLE) as progress:
        model = structural_model(vehicle, vehicle.resolution.map, layouts, progress)
        return with_mesh_error(model, vehicle, vehicle.resolution.map)


def on_snapshots(
    structure: StructuralModel | MappedStructure | Structure, snapshots: Snapshots, reporter: Reporter
) -> AnyStructure:
    """Return ``structure`` with strain per pressure at the nodes of the snapshots."""
    if not isinstance(structure, Structure):
        return structure
    with reporter.stage("Structure: pressure onto its surface"):
        return mapped_structure(structure, snapshots)


def map_from(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    reporter: Reporter,
    solid: Structure | None = None,
    *,
    problem: Problem | None = None,
    compares: bool = True,
) -> InverseMap:
    """Return the inverse map from its parts and report what it holds.

    ``solid`` is the three-dimensional structure behind ``structure``, whose mesh error is reported; ``problem``
    is what the map is solved from, where it is known. With
    ``compares``, ``map.estimator`` "auto" is decided here, on snapshots left out; without, a map that can have
    tables has them.
    """
    failed = failed_conditions(snapshots)
    if failed:
        count = len(failed) + len(snapshots.condition)
        reporter.note(
            f"warning: the map is made without {len(failed)} of {count} conditions, which were not solved"
        )
    problem = problem or inverse_problem(vehicle, snapshots, structure)
    if vehicle.map.estimator == "nonlinear":
        inverse_map = with_manifold(None, vehicle, snapshots, structure, problem=problem)
    else:
        inverse_map = build_inverse_map(vehicle, snapshots, structure, problem=problem)
    if vehicle.map.estimator == "auto":
        inverse_map = _by_auto(
            inverse_map,
            vehicle,
            snapshots,
            structure=structure,
            problem=problem,
            reporter=reporter,
            compares=compares,
        )
    inverse_map = replace(
        inverse_map, provenance=_with_sources(inverse_map.provenance, vehicle.resolution.map, snapshots, solid)
    )
    provenance, noise_std = inverse_map.provenance, float(inverse_map.noise_std[0])
    if provenance["symmetry"] != vehicle.map.symmetry:
        reporter.note(
            "map.symmetry: 'full' needs snapshots on stations times roll angles; the angles are taken as listed"
        )
    for line in mode_choice_lines(provenance):
        reporter.note(line)
    reporter.note(
        f"{inverse_map.n_gauges} gauges, sigma {1e6 * noise_std:.3g} um/m; "
        f"{provenance['modes']} modes hold {provenance['energy_of_modes']:.2%} of the energy"
    )
    if solid is not None and "mesh_error" not in provenance:
        reporter.note(mesh_error_line(solid, noise_std))
    for line in (*mesh_error_notes(provenance), f"inertia: {provenance['inertia']}"):
        reporter.note(line)
    return inverse_map


def _by_auto(
    inverse_map: InverseMap,
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    problem: Problem,
    reporter: Reporter,
    compares: bool,
) -> InverseMap:
    """Return ``inverse_map`` with tables where they can be made and, if it ``compares``, are better."""

    def build(chosen: Snapshots) -> InverseMap:
        smaller = inverse_problem(vehicle, chosen, structure)
        return with_manifold(None, vehicle, chosen, structure, problem=smaller)

    with_tables, choice = inverse_map, None if (why := why_linear(vehicle)) is None else linear_because(why)
    if choice is None:
        try:
            with_tables = with_manifold(inverse_map, vehicle, snapshots, structure, problem=problem)
        except InputError as error:
            choice = linear_because(f"no tables can be made ({str(error).removeprefix('map.estimator: ')})")
    if choice is None:
        if not compares:
            return with_tables
        with reporter.stage("Both estimators: a map made without some snapshots"):
            choice = compared_on_left_out(snapshots, problem, build)
    reporter.note(choice.line)
    return as_chosen(inverse_map if choice.used == "linear" else with_tables, choice)


def _with_sources(
    provenance: dict[str, Any], resolution: Resolution, snapshots: Snapshots, solid: Structure | None
) -> dict[str, Any]:
    """Return a map's provenance with what really made its snapshots and its structure.

    The vehicle file's resolution, which options may have set aside, is left out.
    """
    facts = {name: value for name, value in provenance.items() if name != "resolution"}
    used = resolution.model_dump(include={"harmonics", "element_length_mm", "wall_layers"})
    structure = {"model": "fourier", **used} if solid is None else structure_record(solid)
    sources = {"flow": flow_record(snapshots), "structure": structure}
    # In the order that a file gives back, so that maps made in memory and from files are equal.
    return {**facts, **json.loads(json.dumps(sources, sort_keys=True))}


def solved_true_structure(
    vehicle: Vehicle, reporter: Reporter, kinds: Collection[str] | None = None
) -> TrueStructure:
    """Return the structure of the independent model; ``kinds`` as of :func:`true_structure`."""
    with reporter.stage("Structure: the vehicle that flies") as progress:
        return true_structure(vehicle, progress, kinds)


def _vehicle(vehicle: Vehicle | str | Path) -> Vehicle:
    return vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)


KILOPASCAL = 1e3


def mesh_error_line(structure: Structure, noise_std: float | None) -> str:
    """Return one line: middle and largest mesh error per kPa of the reference loads.

    Each is also given as a fraction of the gauge's largest strain under these loads and, with the gauges' noise
    ``noise_std`` [m/m], in units of that.
    """
    if structure.is_external:
        return "mesh error: not known, the structure is another code's"
    if structure.settings["mesh_error_against"] == NO_REFERENCE:
        return "warning: mesh error: not known, structure.checked_by names no second mesh; the sigmas leave it out"
    length = float(structure.point[:, 0].max())
    strain = largest_amplitude(structure.strain_operator @ reference_pressures(structure.point, length))
    order = np.argsort(structure.mesh_error)

    def text(gauge: int) -> str:
        error = KILOPASCAL * float(structure.mesh_error[gauge])
        percent = 100.0 * float(structure.mesh_error[gauge] / strain[gauge])
        in_sigma = "" if noise_std is None else f", {error / noise_std:.2g} sigma"
        return f"{1e6 * error:.2g} um/m ({percent:.2g} % of its strain{in_sigma})"

    return (
        f"mesh error per kPa of pressure of harmonics 0 to {REFERENCE_HARMONICS - 1}, against "
        f"{structure.settings['mesh_error_against']}: middle {text(int(order[len(order) // 2]))}, "
        f"largest {text(int(order[-1]))} at {structure.gauge_names[int(order[-1])]}"
    )


def make_flow_table(
    pipeline: Pipeline,
    vehicle: Vehicle,
    knots: tuple[FloatArray, FloatArray],
    name: str,
    holds: str,
    *,
    failed: dict[FlowKey, str] | None = None,
) -> None:
    """Make the file ``name`` of flows of a body of revolution at ``knots``, Mach numbers and positive incidences
    [rad]. Flows are kept as they are solved; ``failed`` takes those out of reach, as of
    :func:`~builder.truth.flow_table.solved_flows`."""

    def write(path: Path) -> None:
        with Journal(path) as journal:
            save_flow_table(solved_flows(vehicle, *knots, pipeline.reporter, failed=failed, journal=journal), path)
            journal.remove()

    pipeline.make(name, holds, flow_inputs(vehicle, *knots), write, shared=True)


def make_shape_flows(
    pipeline: Pipeline, vehicle: Vehicle, conditions: Sequence[FlightCondition], name: str, holds: str
) -> None:
    """Make the file ``name`` of flows at ``conditions``, on the finer surface.

    Flows are kept as they are solved, and taken from an earlier file of other conditions. Those outside the
    engine's reach are left out.

    Raises
    ------
    FlowReachError
        All of them are.
    """
    engine = make_engine(vehicle, None, vehicle.resolution.truth, note=pipeline.reporter.note)
    campaign = vehicle_campaign(vehicle, engine, (ConditionSet("independent model", tuple(conditions)),))

    def write(path: Path) -> None:
        note_campaign(run_campaign(campaign, path, Scheduling(), pipeline.reporter), pipeline.reporter)

    inputs = {
        "schema_version": snapshots_file.SCHEMA_VERSION,
        "vehicle": vehicle.name,
        "engine": dict(engine.inputs()),
        "conditions": [condition.as_row() for condition in conditions],
        "internal_pressure": campaign.internal_pressure.tolist(),
    }
    pipeline.make(name, holds, inputs, write, shared=True)
