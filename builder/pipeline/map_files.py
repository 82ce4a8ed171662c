"""The files of a map: snapshots, structure, inverse map and the report on it, each made by one stage."""

from dataclasses import asdict
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from builder.campaign import snapshots as snapshots_file
from builder.campaign.campaign_run import Campaign, run_campaign
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.inverse.problem import AnyStructure, inverse_problem
from builder.inverse.solution import Problem
from builder.pipeline.estimator_choice import with_estimator
from builder.pipeline.measured_levels import (
    alarm_levels_wanted,
    level_conditions,
    with_measured_levels,
    with_shape_levels,
)
from builder.pipeline.pipeline import FLOWS, MAP, SNAPSHOTS, STRUCTURE, FilesGiven, Pipeline, open_pipeline
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.pipeline.stages import (
    check_before_long_work,
    fourier_structure,
    make_flow_table,
    make_shape_flows,
    map_from,
    note_campaign,
    on_snapshots,
    snapshot_campaign,
    solved_true_structure,
)
from builder.reporting import Reporter, Silent
from builder.reports.build_report import build_page
from builder.reports.build_report.build_findings import BuildReport, build_report
from builder.reports.build_report.build_sections import blind_line, model_form_line
from builder.reports.page.origin import input_files
from builder.structure import structure_file
from builder.structure.external.external_structure import external_inputs, external_structure
from builder.structure.solid.case import SolidCase, structure_case
from builder.structure.solid.solid_model import solve_solid_structure, update_structure
from builder.structure.structure_file import Structure, load_structure, save_structure
from builder.trial.readings import World
from builder.truth.flights import ENGINES_IN_WORDS
from builder.truth.flow_table import flow_inputs, load_flow_table, truth_knots
from builder.truth.true_structure import TrueStructure
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.map_needs import doubtful_entries, unused_entries, used_layouts
from builder.workspace import Cache
from strainfmu.estimator.map import inverse_map as inverse_map_file
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.estimator.signal_names import TEMPERATURE

MAP_METHOD_VERSION = 26
"""Raised whenever the same files give another map, so that maps are made again."""


def build(
    vehicle: str | Path,
    output: str | Path = "map",
    *,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    rebuild: bool = False,
    estimator: Literal["auto", "linear", "nonlinear"] | None = None,
    progress: AnyProgress = None,
) -> Path:
    """Build the inverse map of a vehicle, and a report on what the gauges can measure.

    Writes snapshots.h5, map.h5 and report.html. A snapshots.h5 or structure.h5 of the folder is used again if
    it fits the vehicle file. If it does not fit, the command ends with one line that says why.

    The report states what the layout observes, the uncertainty of each coefficient, the contribution of each
    gauge and the cost of its loss. The numbers are in report.json and, as CSV, in the folder report_tables.

    On the command line::

        strainfmu build my_vehicle.toml -o results
        strainfmu build my_vehicle.toml -o results --snapshots flows/fine.h5 --structure meshed/structure.h5
        strainfmu build my_vehicle.toml -o results --estimator nonlinear

    Parameters
    ----------
    vehicle : vehicle file (TOML).
    output : folder for what is made.
    snapshots : snapshots to use, from anywhere. Default: snapshots.h5 of the folder.
    structure : structure to use, from anywhere. Default: structure.h5 of the folder.
    rebuild : make the files of the folder again from the vehicle file, whatever options made them.
    estimator : estimator, instead of the vehicle file's.
    progress : True for progress bars.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong; a file to be used does not fit it; or a condition is
        outside the solver's reach.
    StrainfmuError
        A file could not be written.
    """
    files_given = FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild)
    loaded = with_estimator(load_vehicle(vehicle), estimator)
    pipeline, conditions = open_pipeline(loaded, Path(output), reporter_of(progress), files_given)
    check_before_long_work(pipeline.vehicle, conditions)
    make_map(pipeline)
    _report(pipeline, Path(vehicle))
    return pipeline.path(MAP)


def make_map(pipeline: Pipeline) -> None:
    """Make or take the snapshots, the structure if it is a file of its own, and the map."""
    for line in unused_entries(pipeline.vehicle):
        pipeline.reporter.note(line)
    make_map_parts(pipeline)
    conditions = load_snapshots(pipeline.path(SNAPSHOTS)).conditions()
    for line in doubtful_entries(pipeline.vehicle, conditions):
        pipeline.reporter.note(f"warning: {line}")
    _inverse_map(pipeline)


def make_map_parts(pipeline: Pipeline) -> None:
    """Make or take the files that a map is made from: snapshots, and the structure if it is a file of its own."""
    if pipeline.vehicle.structure.external is not None:
        make_snapshots(pipeline)
        _external_structure(pipeline)
        return
    if pipeline.vehicle.structure.model == "solid":
        _solid_structure(pipeline)
    make_snapshots(pipeline)


def make_snapshots(pipeline: Pipeline) -> None:
    """Make or take the snapshots."""
    holds = "surface pressure at every flight condition"
    if pipeline.take(SNAPSHOTS, holds):
        return
    campaign = snapshot_campaign(pipeline.vehicle, pipeline.reporter)

    def write(path: Path) -> None:
        note_campaign(run_campaign(campaign, path, Scheduling(), pipeline.reporter), pipeline.reporter)

    pipeline.make(SNAPSHOTS, holds, snapshot_inputs(pipeline.vehicle, campaign), write, shared=True)


def cached_snapshots(vehicle: Vehicle) -> Path | None:
    """Return the snapshots of the vehicle file that another command left, None where there are none."""
    campaign = snapshot_campaign(vehicle, Silent())
    return Cache(vehicle.beside(".")).find(SNAPSHOTS, snapshot_inputs(vehicle, campaign))


def cached_structure(vehicle: Vehicle) -> Path | None:
    """Return the three-dimensional structure that another command left, None where there is none."""
    return Cache(vehicle.beside(".")).find(STRUCTURE, solid_inputs(structure_case(vehicle, used_layouts(vehicle))))


def cached_flows(vehicle: Vehicle) -> Path | None:
    """Return the flows of the independent model that another command left, None where there are none."""
    return Cache(vehicle.beside(".")).find(FLOWS, flow_inputs(vehicle, *truth_knots(vehicle.truth)))


def snapshot_inputs(vehicle: Vehicle, campaign: Campaign) -> dict[str, Any]:
    """Return what the snapshots depend on."""
    surface = campaign.engine.surface
    return {
        "schema_version": snapshots_file.SCHEMA_VERSION,
        "vehicle": vehicle.name,
        "engine": campaign.engine.inputs(),
        "engine_entries": vehicle.aerodynamics.model_dump(),
        "surface": sha256(surface.point.tobytes() + surface.triangle.tobytes()).hexdigest(),
        "conditions": [condition.as_row() for condition in campaign.conditions],
        "flows": [campaign.engine.flow_key(condition) for condition in campaign.conditions],
        "internal_pressure": campaign.internal_pressure,
        "reference": asdict(campaign.reference),
    }


def _structural_inputs(vehicle: Vehicle) -> dict[str, Any]:
    """Return the entries of the vehicle file that strains and coefficients depend on."""
    tables = {
        name: vehicle.beside(entry.file).read_bytes().hex()
        for name, entry in vehicle.gauges.layouts.items()
        if entry.file is not None and vehicle.beside(entry.file).is_file()
    }
    for name in ("covariance_file", "nuisance_file"):
        file = getattr(vehicle.noise, name)
        if file is not None and vehicle.beside(file).is_file():
            tables[f"noise.{name}"] = vehicle.beside(file).read_bytes().hex()
    parts = vehicle.model_dump(
        include={"name", "structure", "material", "materials", "reference", "gauges", "noise", "map", "sensors"}
    )
    temperature = vehicle.temperature
    warm = {} if temperature is None else {TEMPERATURE: temperature.model_dump()}
    heavy = {} if vehicle.mass is None else {"mass": vehicle.mass.model_dump()}
    return {**parts, **warm, **heavy, "tables": tables}


def _solid_structure(pipeline: Pipeline) -> None:
    holds = "strain per pressure of the three-dimensional structure"
    if pipeline.take(STRUCTURE, holds):
        return
    case = structure_case(pipeline.vehicle, used_layouts(pipeline.vehicle))

    def write(path: Path) -> None:
        used = update_structure(path, case, pipeline.reporter)[0].statistics
        size, solver = used["degrees_of_freedom"], used["solver"]
        pipeline.reporter.note(f"{size} dofs; solver {solver}, licence {used['licence']}")

    pipeline.make(STRUCTURE, holds, solid_inputs(case), write, shared=True)


def cached_or_solved_structure(vehicle: Vehicle, reporter: Reporter) -> Structure:
    """Return the three-dimensional structure of the map's layouts, as another command left it, or solved."""
    file = cached_structure(vehicle)
    if file is None:
        return solve_solid_structure(structure_case(vehicle, used_layouts(vehicle)), reporter)
    reporter.note(f"{STRUCTURE}: from {file.parent}, reused")
    return load_structure(file)


def solid_inputs(case: SolidCase) -> dict[str, Any]:
    """Return what the structure of a case depends on."""
    return {"schema_version": structure_file.SCHEMA_VERSION, **case.made_from()}


def _external_structure(pipeline: Pipeline) -> None:
    """Make the structure of another code's file, on the snapshots' surface."""
    holds = "strain per pressure, of another structural code"
    if pipeline.take(STRUCTURE, holds):
        return
    vehicle = pipeline.vehicle

    def write(path: Path) -> None:
        save_structure(external_structure(vehicle, load_snapshots(pipeline.path(SNAPSHOTS))), path)

    inputs = {
        "schema_version": structure_file.SCHEMA_VERSION,
        "files": external_inputs(vehicle),
        "snapshots": pipeline.made_from(SNAPSHOTS),
        **_structural_inputs(vehicle),
    }
    pipeline.make(STRUCTURE, holds, inputs, write)


def solid_structure_of(pipeline: Pipeline) -> Structure | None:
    """Return the three-dimensional structure, None where the map is built on the Fourier model."""
    if pipeline.vehicle.structure.model != "solid":
        return None
    return load_structure(pipeline.path(STRUCTURE))


def map_parts(pipeline: Pipeline) -> tuple[Snapshots, AnyStructure]:
    """Return what the map is made from, solved once per run."""
    if pipeline.map_parts is None:
        solid = pipeline.path(STRUCTURE) if pipeline.vehicle.structure.model == "solid" else None
        pipeline.map_parts = load_map_parts(pipeline.vehicle, pipeline.path(SNAPSHOTS), solid, pipeline.reporter)
    return pipeline.map_parts


def map_problem(pipeline: Pipeline) -> Problem:
    """Return what the map is solved from, made once per run: the report needs it too."""
    if pipeline.problem is None:
        pipeline.problem = inverse_problem(pipeline.vehicle, *map_parts(pipeline))
    return pipeline.problem


def load_map_parts(
    vehicle: Vehicle, snapshots: Path, solid: Path | None, reporter: Reporter
) -> tuple[Snapshots, AnyStructure]:
    """Return snapshots and structure of their files; without a file the structure is the Fourier model."""
    loaded = load_snapshots(snapshots)
    structure = load_structure(solid) if solid else fourier_structure(vehicle, used_layouts(vehicle), reporter)
    return loaded, on_snapshots(structure, loaded, reporter)


def _inverse_map(pipeline: Pipeline) -> None:
    vehicle = pipeline.vehicle

    flown = pipeline.flown or vehicle
    calibrates = alarm_levels_wanted(flown, pipeline.reporter)
    if calibrates and flown.is_axisymmetric:
        make_independent_flows(pipeline)
    elif calibrates:
        holds = "flows of the independent model, which set the alarm levels"
        make_shape_flows(pipeline, flown, level_conditions(flown), FLOWS, holds)

    def write(path: Path) -> None:
        snapshots, structure = map_parts(pipeline)
        solid = solid_structure_of(pipeline)
        made = map_from(
            vehicle,
            snapshots,
            structure,
            pipeline.reporter,
            solid,
            problem=map_problem(pipeline),
            compares=not calibrates,
        )
        if calibrates and not flown.is_axisymmetric:
            of_levels = load_snapshots(pipeline.path(FLOWS))
            made = with_shape_levels(flown, made, solid, of_levels, pipeline.reporter)
        elif calibrates:
            flows = load_flow_table(pipeline.path(FLOWS), flown)
            world = World(vehicle=flown, structure=true_structure_of(pipeline), flows=flows, inverse_map=made)
            made = with_measured_levels(world, pipeline.reporter)
        save_inverse_map(made, path)

    inputs = {
        "schema_version": inverse_map_file.SCHEMA_VERSION,
        "method_version": MAP_METHOD_VERSION,
        "independent flows": pipeline.made_from(FLOWS) if calibrates else [],
        "snapshots": pipeline.made_from(SNAPSHOTS),
        "resolution": vehicle.resolution.map.model_dump(),
        **_structural_inputs(vehicle),
    }
    if vehicle.structure.model == "solid":
        inputs["structure"] = pipeline.made_from(STRUCTURE)
    holds = "the inverse map: strain to loads, with covariance"
    pipeline.make(MAP, holds, inputs, write, files_given=pipeline.files_given.as_text(), shared=True)


def make_independent_flows(pipeline: Pipeline) -> None:
    """Make or take the flows of the independent model, once per run; they set the map's alarm levels, and are what
    flies."""
    vehicle = pipeline.vehicle
    engine = ENGINES_IN_WORDS[vehicle.truth_engine()]
    holds = f"flows of the vehicle that flies, by {engine} on finer meshes"
    if FLOWS in pipeline.files or pipeline.take(FLOWS, holds):
        return
    make_flow_table(pipeline, vehicle, truth_knots(vehicle.truth), FLOWS, holds)


def true_structure_of(pipeline: Pipeline) -> TrueStructure:
    """Return the structure of the independent model, solved once per run."""
    if pipeline.true_structure is None:
        pipeline.true_structure = solved_true_structure(pipeline.vehicle, pipeline.reporter)
    return pipeline.true_structure


def _report(pipeline: Pipeline, vehicle_path: Path) -> None:
    """Make the report on the map and its gauges: a page, and its numbers."""
    files = input_files(_report_files(pipeline, vehicle_path))

    @cache
    def report() -> BuildReport:
        snapshots, structure = map_parts(pipeline)
        inverse_map = load_inverse_map(pipeline.path(MAP))
        with pipeline.reporter.stage("Report: what the gauges observe"):
            problem = map_problem(pipeline)
            findings = build_report(
                pipeline.vehicle, snapshots, structure, inverse_map, files=files, problem=problem
            )
        pipeline.reporter.note(blind_line(findings))
        if (line := model_form_line(findings)) is not None:
            pipeline.reporter.note(line)
        return findings

    def page(path: Path) -> None:
        findings = report()
        with pipeline.reporter.stage("Report: figures"):
            build_page.write_report_page(findings, path)

    def numbers(path: Path) -> None:
        build_page.write_numbers(report(), path.parent)

    inputs = {
        "map": pipeline.made_from(MAP),
        "schema_version": build_page.SCHEMA_VERSION,
        "files": [asdict(file) for file in files],
    }
    pipeline.make(build_page.JSON_NAME, "numbers of the report; report_tables holds them as CSV", inputs, numbers)
    if find_spec("matplotlib") is None:
        pipeline.reporter.note(f"{build_page.PAGE_NAME}: not made, its figures need strainfmu[report]")
        return
    pipeline.make(
        build_page.PAGE_NAME,
        "report: what this layout observes, uncertainty of the map, value of the gauges",
        inputs,
        page,
    )


def files_of_vehicle(vehicle: Vehicle, vehicle_path: Path) -> dict[str, Path]:
    """Return the vehicle file and the files that it names for gauges and noise, by what they are."""
    layout = vehicle.gauges.layouts[vehicle.gauges.layout].file
    named = {
        "gauges": layout,
        "covariance of the noise": vehicle.noise.covariance_file,
        "nuisance modes": vehicle.noise.nuisance_file,
    }
    files = {content: vehicle.beside(name) for content, name in named.items() if name is not None}
    return {"vehicle file": vehicle_path, **files}


def _report_files(pipeline: Pipeline, vehicle_path: Path) -> dict[str, Path]:
    """Return the files that a report follows from, by what they are."""
    vehicle = pipeline.vehicle
    files = files_of_vehicle(vehicle, vehicle_path)
    files["snapshots"] = pipeline.path(SNAPSHOTS)
    if pipeline.path(STRUCTURE).is_file() and vehicle.structure.model == "solid":
        files["structure"] = pipeline.path(STRUCTURE)
    return {**files, "map": pipeline.path(MAP)}
