"""A trial from a vehicle file to its table: map, flows of the independent model, cases, files of results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import wraps
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from pydantic import BaseModel

from builder.campaign import snapshots as snapshots_file
from builder.campaign.journal import Journal
from builder.campaign.snapshots import load_snapshots
from builder.figures.comparison.trial import trial_figure
from builder.figures.drawing.canvas import save
from builder.pipeline.built_sensors import flown_sensors, sensor_names_of
from builder.pipeline.chosen_estimator import Estimators, with_estimator
from builder.pipeline.map_files import make_map
from builder.pipeline.pipeline import FilesGiven, Pipeline
from builder.pipeline.shape_flows import make_shape_flows
from builder.pipeline.stages import check_before_long_work
from builder.pipeline.used_files import FLOWS as LEVEL_FLOWS
from builder.pipeline.used_files import MAP, STRUCTURE, open_pipeline
from builder.reporting import Reporter, Silent
from builder.structure.fourier.model import place_layouts
from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.case import structure_case
from builder.structure.structure_file import load_structure
from builder.trial.cases import Case, Plan, TrialFile, cases_for, load_trial
from builder.trial.conditions import flown_conditions
from builder.trial.estimators import available
from builder.trial.flows import stress_flow_inputs, stress_flows
from builder.trial.heating import temperature_of
from builder.trial.run import Score, run_cases, scored
from builder.trial.score import ALL, Row
from builder.trial.table import write_table
from builder.trial.world import World
from builder.truth.independent_model import other_physics, refuse_without_independent_model
from builder.truth.revolution import flow_table as flow_table_file
from builder.truth.revolution.flow_table import save_flow_table
from builder.truth.revolution.flows import load_truth_flows
from builder.truth.revolution.strain import true_structure
from builder.truth.shape.structure import flying_structure
from builder.vehicle.file import Vehicle, load_vehicle
from builder.workspace import Workspace
from strainfmu.errors import InputError
from strainfmu.estimator.map import inverse_map as inverse_map_file
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.map.validity import RECORDED_KEYS
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.files import content_hash_of
from strainfmu.flight_condition import ALTITUDE, CONDITION_QUANTITIES, FlightCondition

FLOWS, CASES, TABLE, FIGURE = "trial_flows.h5", "cases", "trial", "trial.png"

SUFFIXES = (".csv", ".parquet", ".json")

Given = ParamSpec("Given")
Made = TypeVar("Made")


@dataclass(frozen=True, eq=False, kw_only=True)
class TrialResult:
    """The table of a trial, the vehicle's name, and the files that were written."""

    vehicle: str
    cases: list[Case]
    rows: list[Row]
    files: list[Path]


@dataclass(frozen=True, kw_only=True)
class TrialOptions:
    """What a user says of a trial.

    Attributes
    ----------
    only : errors to try; all by default.
    changes : of sections of the file, by entry.
    map_path, flows : map and flows of the independent model that are there; None to make them.
    given, estimator : of the build of a map.
    formats : of the table, by suffix.
    workers, scheduler : local processes, or a Dask scheduler whose workers share the folder.
    """

    only: tuple[str, ...] = ()
    changes: dict[str, object]
    map_path: Path | None = None
    flows: Path | None = None
    given: FilesGiven = field(default_factory=FilesGiven)
    estimator: Estimators | None = None
    formats: tuple[str, ...] = (".csv",)
    workers: int = 1
    scheduler: str | None = None


def run_trial(
    file: Path, vehicle_path: Path, folder: Path, reporter: Reporter, options: TrialOptions
) -> TrialResult:
    """Try the cases of ``file`` on a map; write ``trial.csv``, ``trial.png`` and the rows of each case to
    ``folder``.

    The map is made by ``build`` in ``folder``, or it is one that is given. Errors are the independent model's; of
    a body of revolution its structure is the Fourier model whatever the map is built on, of any other shape
    another mesh.

    Raises
    ------
    InputError
        A file is wrong, the map does not fit the vehicle, or there is no independent model of it.
    StrainfmuError
        A file could not be written.
    """
    trial = load_trial(file).changed(options.changes)
    plan, entry = trial.trial, with_estimator(load_vehicle(vehicle_path), options.estimator)
    if any(case.heating for case in trial.cases):
        entry = entry.model_copy(update={TEMPERATURE: temperature_of(entry)})
    if options.map_path is None:
        pipeline, conditions = open_pipeline(entry, folder, reporter, options.given)
        refuse_vehicle(pipeline.flown or pipeline.vehicle, trial)
        check_before_long_work(pipeline.vehicle, conditions)
        if options.flows is not None and pipeline.vehicle.is_of_revolution:
            pipeline.use(LEVEL_FLOWS, options.flows, _content_of_flows(options.flows, pipeline.vehicle))
        make_map(pipeline)
        inverse_map = load_inverse_map(pipeline.path(MAP))
        vehicle = of_estimator(pipeline.flown or pipeline.vehicle, inverse_map)
    else:
        inverse_map = load_inverse_map(options.map_path)
        vehicle = of_map(entry, inverse_map)
        refuse_vehicle(vehicle, trial)
        check_fit(vehicle, inverse_map, options.map_path)
        pipeline = Pipeline(vehicle, Workspace(folder), reporter)
        schema = inverse_map_file.SCHEMA, inverse_map_file.SCHEMA_VERSION
        pipeline.use(MAP, options.map_path, content_hash_of(options.map_path, *schema))
    for line in other_physics(vehicle):
        reporter.note(line)
    cases = cases_for(vehicle, trial, options.only)
    plan = plan.model_copy(update={"estimators": available(inverse_map, plan.estimators)})
    make_trial_flows(pipeline, vehicle, cases_for(vehicle, trial), plan, options.flows)
    structure = pipeline.path(STRUCTURE)
    return finished(
        pipeline,
        vehicle,
        cases,
        plan,
        options,
        make_world=world_of,
        world=(
            vehicle,
            pipeline.path(MAP),
            pipeline.path(FLOWS),
            structure if structure.is_file() else None,
            plan.conditions,
            plan.seed,
        ),
        inputs={
            "map": content_hash_of(pipeline.path(MAP), inverse_map_file.SCHEMA, inverse_map_file.SCHEMA_VERSION),
            "flows": pipeline.made_from(FLOWS),
        },
    )


def opened(
    trial: TrialFile, vehicle_path: Path, folder: Path, reporter: Reporter, options: TrialOptions
) -> tuple[Pipeline, Vehicle]:
    """Open the folder of a trial that makes its own maps; return the vehicle, as it flies.

    Raises
    ------
    InputError
        A map is given, or the trial cannot be flown with the vehicle.
    """
    if options.map_path is not None:
        raise InputError("--map: expected none, this trial makes maps for its vehicles and errors; leave it out")
    pipeline, conditions = open_pipeline(load_vehicle(vehicle_path), folder, reporter, options.given)
    vehicle = pipeline.flown or pipeline.vehicle
    refuse_vehicle(vehicle, trial)
    check_before_long_work(pipeline.vehicle, conditions)
    return pipeline, vehicle


def finished(
    pipeline: Pipeline,
    vehicle: Vehicle,
    cases: list[Case],
    plan: Plan,
    options: TrialOptions,
    *,
    make_world: Callable[..., Any],
    world: tuple[Any, ...],
    inputs: dict[str, Any],
    score: Score = scored,
) -> TrialResult:
    """Run ``cases`` as :func:`~builder.trial.run.run_cases` and write the table."""
    folder = pipeline.workspace.folder
    rows = run_cases(
        cases,
        plan,
        folder / CASES,
        pipeline.reporter,
        make_world=make_world,
        world=world,
        inputs={**inputs, "vehicle": vehicle.model_dump(exclude={"description", "truth"})},
        score=score,
        workers=options.workers,
        scheduler=options.scheduler,
    )
    return written(vehicle.name, cases, rows, folder, options.formats)


def written(vehicle: str, cases: list[Case], rows: list[Row], folder: Path, formats: Sequence[str]) -> TrialResult:
    """Write the rows to ``folder``, and the figure of samples where there are some."""
    files = [Workspace(folder).path(TABLE).with_suffix(suffix) for suffix in formats]
    for path in files:
        write_table(rows, path)
    if any(row["load"] == ALL for row in rows) and find_spec("matplotlib") is not None:
        files.append(folder / FIGURE)
        save(trial_figure(rows, vehicle), files[-1])
    return TrialResult(vehicle=vehicle, cases=cases, rows=rows, files=files)


def refuse_vehicle(vehicle: Vehicle, trial: TrialFile) -> None:
    """Refuse a vehicle that the trial cannot be flown with, before anything is solved."""
    moves = any(case.motion is not None for case in trial.cases)
    if moves and not vehicle.is_of_revolution:
        raise InputError("motion: expected a body of revolution, got a shape that needs a flow for every sample")
    refuse_without_independent_model(vehicle)


def once(make: Callable[Given, Made]) -> Callable[Given, Made]:
    """Return ``make``, which makes the world of a worker, such that the last arguments give the last world."""
    last = dict[str, Made]()

    @wraps(make)
    def made(*args: Given.args, **kwargs: Given.kwargs) -> Made:
        key = " ".join(one.model_dump_json() if isinstance(one, BaseModel) else str(one) for one in args)
        if key not in last:
            last.clear()
            last[key] = make(*args, **kwargs)
        return last[key]

    return made


@once
def world_of(
    vehicle: Vehicle, inverse_map: Path, flows: Path, structure: Path | None, conditions: int, seed: int
) -> World:
    """Return the world of a trial.

    ``structure`` is the file of the map's structure, whose check is the mesh that flies, of another shape than a
    body of revolution.
    """
    made, world = load_inverse_map(inverse_map), true_world(vehicle, flows, structure)
    return World(**world, inverse_map=made, conditions=conditions, seed=seed)


def true_world(vehicle: Vehicle, flows: Path, structure: Path | None) -> dict[str, Any]:
    """Return the independent model of a vehicle: the arguments of a world by name."""
    if vehicle.is_of_revolution:
        true = true_structure(vehicle)
        sensors = flown_sensors(vehicle, true.surface)
        return {
            "vehicle": vehicle,
            "structure": true,
            "flows": load_truth_flows(flows, vehicle),
            "sensors": sensors,
        }
    known = None if structure is None else load_structure(structure)
    true_shape = flying_structure(vehicle, known, Silent())
    return {"vehicle": vehicle, "structure": true_shape, "flows": load_snapshots(flows)}


def make_trial_flows(
    pipeline: Pipeline, vehicle: Vehicle, cases: Sequence[Case], plan: Plan, given: Path | None
) -> None:
    """Make the flows of the independent model, or take the ones that are given.

    They go beyond the envelope, but for cases that all fly in the same square of angles.
    """
    squares = {case.where.square for case in cases}
    square = squares.pop() if len(squares) == 1 else None
    holds = f"flows of the independent model {'beyond' if square is None else 'inside'} the envelope"
    if given is not None:
        pipeline.use(FLOWS, given, _content_of_flows(given, vehicle))
        return
    if not vehicle.is_of_revolution:
        conditions = shape_conditions(vehicle, cases, plan.conditions, plan.seed)
        make_shape_flows(pipeline, vehicle, conditions, FLOWS, holds)
        return

    def write(path: Path) -> None:
        with Journal(path) as journal:
            save_flow_table(stress_flows(vehicle, pipeline.reporter, journal, square=square), path)
            journal.remove()

    inputs = {"schema_version": flow_table_file.SCHEMA_VERSION, **stress_flow_inputs(vehicle, square)}
    pipeline.make(FLOWS, holds, inputs, write)


def _content_of_flows(path: Path, vehicle: Vehicle) -> str:
    module = flow_table_file if vehicle.is_of_revolution else snapshots_file
    return content_hash_of(path, module.SCHEMA, module.SCHEMA_VERSION)


def shape_conditions(vehicle: Vehicle, cases: Sequence[Case], count: int, seed: int) -> list[FlightCondition]:
    """Return a condition of every flow that ``cases`` need, whatever its altitude."""
    places = {str(case.where): case.where for case in cases}
    flown = [
        condition
        for where in places.values()
        for condition in flown_conditions(where, vehicle, None, count, np.random.default_rng(seed))
    ]
    return list({(one.as_row()[:3], one.parameters): one for one in flown}.values())


def of_map(vehicle: Vehicle, inverse_map: InverseMap) -> Vehicle:
    """Return ``vehicle`` with the estimator of ``inverse_map`` and the flight conditions that it states."""
    recorded = inverse_map.provenance
    ranges = {
        one.column: sorted({(1e-3 if one.name == ALTITUDE else 1.0) * float(value) for value in recorded[key]})
        for one in CONDITION_QUANTITIES
        if isinstance(recorded.get(key := RECORDED_KEYS[one.name]), list)
    }
    conditions = vehicle.conditions.model_copy(update=ranges)
    of_form = {} if inverse_map.form == "absolute" else {"gamma": 1.0}
    entries = vehicle.map.model_copy(update={"form": inverse_map.form, **of_form})
    changes: dict[str, object] = {"conditions": conditions, "map": entries}
    changes |= {} if inverse_map.has_temperature else {TEMPERATURE: None}
    return of_estimator(vehicle.model_copy(update=changes), inverse_map)


def of_estimator(vehicle: Vehicle, inverse_map: InverseMap) -> Vehicle:
    """Return ``vehicle`` with the estimator of ``inverse_map``, which its file may leave to the build."""
    estimator = "linear" if inverse_map.manifold is None else "nonlinear"
    return vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"estimator": estimator})})


def check_fit(vehicle: Vehicle, inverse_map: InverseMap, path: Path) -> None:
    """Refuse a map (``path``) whose gauges or references differ from ``vehicle``, before anything is solved.

    Raises
    ------
    InputError
        Names what differs, or a gauge is not on the vehicle's surface.
    """
    layout = vehicle.gauges.layout
    if vehicle.is_of_revolution:
        names = place_layouts(vehicle, gauge_mesh(vehicle), [layout])[0][layout].names
    else:
        names = structure_case(vehicle, [layout]).layouts[layout].name
    n = inverse_map.n_strain_gauges
    if inverse_map.gauge_names[:n] != names:
        raise InputError(
            f"{path}: expected the {len(names)} gauges of layout '{layout}', got {n} gauges, "
            f"the first named {inverse_map.gauge_names[0]}"
        )
    expected_sensors, sensors = sensor_names_of(vehicle), inverse_map.gauge_names[n:]
    if sensors != expected_sensors:
        raise InputError(
            f"{path}: expected the {len(expected_sensors)} auxiliary sensors of the section [sensors], got "
            f"{len(sensors)}: {', '.join(sensors)[:80] or 'none'}"
        )
    if (vehicle.mass is not None) != inverse_map.has_masses:
        wanted, got = ("with", "without") if vehicle.mass is not None else ("without", "with")
        raise InputError(f"{path}: expected a map {wanted} masses as the vehicle file has them, got one {got}")
    reference = vehicle.reference_quantities()
    for name, expected, got_value in (
        ("reference area [m2]", reference.area, inverse_map.reference_area),
        ("reference length [m]", reference.length, inverse_map.reference_length),
    ):
        if abs(got_value - expected) > 1e-6 * expected:
            raise InputError(f"{path}: {name}: expected {expected:.6g} of the vehicle, got {got_value:.6g}")
