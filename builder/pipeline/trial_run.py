"""A trial from a vehicle file to its table: maps, flows of the independent model, cases, files of results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial, wraps
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np
from pydantic import BaseModel

from builder.calibration.score.ground_rows import CALIBRATION, ground_rows, refuse_unknown_tests
from builder.calibration.score.ground_world import GroundWorld, ground_world
from builder.campaign import snapshots as snapshots_file
from builder.campaign.journal import Journal
from builder.campaign.snapshots import load_snapshots
from builder.figures.comparison.trial import trial_figure
from builder.figures.drawing.canvas import save
from builder.manifold.mirror_images import with_mirror_images
from builder.manifold.snapshot_grid import snapshot_grid
from builder.pipeline.built_sensors import flown_sensors, sensor_names_of
from builder.pipeline.chosen_estimator import Estimators, with_estimator
from builder.pipeline.map_files import (
    load_map_parts,
    make_independent_flows,
    make_map,
    make_map_parts,
    make_snapshots,
)
from builder.pipeline.pipeline import FilesGiven, Pipeline
from builder.pipeline.shape_flows import make_shape_flows
from builder.pipeline.stages import check_before_long_work
from builder.pipeline.used_files import FLOWS as LEVEL_FLOWS
from builder.pipeline.used_files import MAP, SNAPSHOTS, STRUCTURE, open_pipeline
from builder.reporting import Reporter, Silent
from builder.structure.as_built.as_built_structure import refuse_unheld
from builder.structure.fourier.fourier_model import place_layouts
from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.case import structure_case
from builder.structure.structure_file import load_structure
from builder.trial.added import temperature_of
from builder.trial.cases import Case, GroundTests, Plan, TrialFile, cases_for, load_trial
from builder.trial.compared import NONLINEAR, ComparedWorld, compared_estimators, knowing, maps_for, refuse_unknown
from builder.trial.conditions import flown_conditions
from builder.trial.estimators import available
from builder.trial.flows import stress_flow_inputs, stress_flows
from builder.trial.other_estimators import REGRESSIONS
from builder.trial.run import Score, run_tasks, scored, tasks_of
from builder.trial.score import ALL, Row
from builder.trial.table import write_table
from builder.trial.world import World
from builder.truth.independent_model import other_physics, refuse_without_independent_model
from builder.truth.revolution import flow_table as flow_table_file
from builder.truth.revolution.flow_table import load_truth_flows, save_flow_table
from builder.truth.revolution.strain import true_structure
from builder.truth.shape import flying_structure
from builder.vehicle.file import Vehicle, load_vehicle
from builder.workspace import Cache, Workspace
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
    """The table of a trial, the vehicle's name, and the files that were written.

    Attributes
    ----------
    rows : one per case, estimator and load; load "all" is the sample as a whole. Columns, as far as they apply:

        - ``case``, ``error``, ``size``, ``class`` (drawn, alone, beyond, unobservable), ``estimator``, ``load``;
        - ``samples``, ``vehicles``, ``flights`` : numbers of them;
        - ``right_ok_percent``, ``right_flagged_percent``, ``wrong_flagged_percent``, ``undetected_percent``,
          ``no_estimate_percent`` : parts of the samples, 100 % together;
        - ``covered_percent``, ``covered_1_percent`` : samples with an estimate inside 3 sigma and 1 sigma;
        - ``flagged_percent`` : health neither OK nor DEGRADED, or no estimate;
        - ``alarm_percent`` : health INCONSISTENT or SUSPECT;
        - ``.._error``, ``.._upper`` : standard error of a fraction, clustered by vehicle and flight, and its upper
          limit at 95 %;
        - ``rms``, ``bias``, ``sigma``, ``rms_z`` : rms error, mean error, mean sigma [1, angles: rad], rms of the
          error over sigma;
        - ``bound``, ``over_bound``, ``over_single`` : Cramer-Rao bound, rms error over it, and over the one of
          single samples;
        - ``over_exact`` : rms error after a ground test over the exactly known vehicle's;
        - ``sets``, ``worst_set``, ``worst_set_percent`` : lost gauges or tested vehicles, and the set with the
          smallest coverage;
        - ``refused_percent``, ``named_percent``, ``silent_percent``, ``blamed_percent`` : load "test": refused,
          naming the error, accepting it with coverage below 99 %, blaming sound parts;
        - ``health`` : fraction of each state [%];
        - ``verdict``, ``why`` : ok, open or missed, and what is off.
    """

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


class Prepared(NamedTuple):
    """What the cases of a trial are flown in: the vehicle, a function that makes the world, what it is made from,
    how it is flown, and what scores a case."""

    vehicle: Vehicle
    make_world: Callable[[], Any]
    inputs: dict[str, Any]
    plan: Plan
    score: Score = scored


def run_trial(
    file: Path, vehicle_path: Path, folder: Path, reporter: Reporter, options: TrialOptions
) -> TrialResult:
    """Try the cases of ``file`` on a map; write ``trial.csv``, ``trial.png`` and the rows of each case to
    ``folder``.

    The map is made by ``build`` in ``folder``, or it is one that is given. Errors are the independent model's; of
    a body of revolution its structure is the Fourier model whatever the map is built on, of any other shape
    another mesh. A trial of estimators of several kinds, and one of ground tests, makes maps of its own: for the
    errors of each case, or for every vehicle as its test says.

    Raises
    ------
    InputError
        A file is wrong, the map does not fit the vehicle or the trial, or there is no independent model of it.
    StrainfmuError
        A file could not be written.
    """
    trial = load_trial(file).changed(options.changes)
    prepare = (
        prepared_comparison if trial.trial.training else prepared_ground_tests if trial.ground else prepared_map
    )
    prepared = prepare(trial, vehicle_path, folder, reporter, options)
    cases = cases_for(prepared.vehicle, trial, options.only)
    inputs = {**prepared.inputs, "vehicle": prepared.vehicle.model_dump(exclude={"description", "truth"})}
    tasks = tasks_of(cases, prepared.plan, prepared.make_world, inputs, prepared.score)
    results = run_tasks(tasks, folder / CASES, reporter, workers=options.workers, scheduler=options.scheduler)
    rows = list[Row]()
    for case, result in zip(cases, results, strict=True):
        if isinstance(result, str):
            reporter.note(f"{case.error}, {case.size}: left out: {result}")
        else:
            rows += result
    for row in rows:
        if row["estimator"] == CALIBRATION:
            reporter.note(line_of_tests(row, rows))
    return written(prepared.vehicle.name, cases, rows, folder, options.formats)


def prepared_map(
    trial: TrialFile, vehicle_path: Path, folder: Path, reporter: Reporter, options: TrialOptions
) -> Prepared:
    """Make the map in ``folder``, or take the one that is given, and flows."""
    entry = with_estimator(load_vehicle(vehicle_path), options.estimator)
    if any(case.heating for case in trial.cases):
        entry = entry.model_copy(update={TEMPERATURE: temperature_of(entry)})
    if options.map_path is None:
        pipeline = opened(trial, entry, folder, reporter, options)
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
        pipeline = Pipeline(vehicle, Workspace(folder, Cache(vehicle.beside("."))), reporter)
        pipeline.use(MAP, options.map_path, _content_of(options.map_path, inverse_map_file))
    for line in other_physics(vehicle):
        reporter.note(line)
    plan = trial.trial.model_copy(update={"estimators": available(inverse_map, trial.trial.estimators)})
    make_trial_flows(pipeline, vehicle, trial, options)
    structure = pipeline.path(STRUCTURE)
    files = pipeline.path(MAP), pipeline.path(FLOWS), structure if structure.is_file() else None
    inputs = {"map": _content_of(pipeline.path(MAP), inverse_map_file), "flows": pipeline.made_from(FLOWS)}
    return Prepared(vehicle, partial(world_of, vehicle, *files, plan.conditions, plan.seed), inputs, plan)


def prepared_comparison(
    trial: TrialFile, vehicle_path: Path, folder: Path, reporter: Reporter, options: TrialOptions
) -> Prepared:
    """Make what maps for the errors of each case are built from, and flows; without scikit-learn its regressions
    are left out, with a note."""
    names, training = trial.trial.estimators, trial.trial.training
    assert training is not None
    refuse_unknown(names)
    needing = [name for name in names if name.partition(", ")[0] in REGRESSIONS]
    if needing and find_spec("sklearn") is None:
        names = [name for name in names if name not in needing]
        reporter.note(f"left out, they need strainfmu[rivals]: {', '.join(needing)}")
    plan = trial.trial.model_copy(update={"estimators": names})
    pipeline = opened(trial, load_vehicle(vehicle_path), folder, reporter, options)
    make_map_parts(pipeline)
    vehicle = knowing(pipeline.flown or pipeline.vehicle, is_exact=False, case=1)
    for line in other_physics(vehicle):
        reporter.note(line)
    snapshots = load_snapshots(pipeline.path(SNAPSHOTS))
    if not vehicle.is_of_revolution:
        snapshot_grid(with_mirror_images(snapshots, snapshots.surface))  # refused here, before the long work
    elif snapshots.station is None:
        raise InputError("compare: expected a body of revolution with rings of nodes, got a free surface")
    make_trial_flows(pipeline, vehicle, trial, options)
    solid = [STRUCTURE] if pipeline.vehicle.structure.model == "solid" else []
    files = pipeline.path(SNAPSHOTS), pipeline.path(STRUCTURE) if solid else None, pipeline.path(FLOWS)
    world = partial(compared_world, vehicle, *files, plan.conditions, plan.seed, training)
    inputs = {"made from": pipeline.made_from(SNAPSHOTS, FLOWS, *solid), "training": training}
    return Prepared(vehicle, world, inputs, plan, partial(scored, make_estimators=compared_estimators))


def prepared_ground_tests(
    trial: TrialFile, vehicle_path: Path, folder: Path, reporter: Reporter, options: TrialOptions
) -> Prepared:
    """Make snapshots and flows, which ground tests of vehicles of an independent truth are made from."""
    plan, tests = trial.trial, trial.ground
    assert tests is not None
    refuse_unknown_tests(plan.estimators, trial.cases)
    pipeline = opened(trial, load_vehicle(vehicle_path), folder, reporter, options)
    vehicle = pipeline.vehicle
    refuse_unheld(vehicle, vehicle.gauges.layout)
    make_snapshots(pipeline)
    if options.flows is not None:
        pipeline.use(LEVEL_FLOWS, options.flows, _content_of_flows(options.flows, vehicle))
    make_independent_flows(pipeline)
    files = pipeline.path(SNAPSHOTS), pipeline.path(LEVEL_FLOWS)
    inputs = {"made from": pipeline.made_from(SNAPSHOTS, LEVEL_FLOWS), "ground": tests.model_dump()}
    world = partial(tested_world, vehicle, *files, plan.conditions, tests)
    return Prepared(vehicle, world, inputs, plan, ground_rows)


def opened(
    trial: TrialFile, vehicle: Vehicle, folder: Path, reporter: Reporter, options: TrialOptions
) -> Pipeline:
    """Open the folder of a trial that makes its own maps.

    Raises
    ------
    InputError
        A map is given, or the trial cannot be flown with the vehicle.
    """
    if options.map_path is not None:
        raise InputError("--map: expected none, this trial makes maps for its vehicles and errors; leave it out")
    pipeline, conditions = open_pipeline(vehicle, folder, reporter, options.given)
    refuse_vehicle(pipeline.flown or pipeline.vehicle, trial)
    check_before_long_work(pipeline.vehicle, conditions)
    return pipeline


SHARES = ("refused", "named", "silent", "gauges_blamed", "cases_blamed")
"""Of the tests of a case: what the calibration says."""


def line_of_tests(said: Row, rows: list[Row]) -> str:
    """Return what the calibration says of the tests of a case, and largest errors over the exactly known
    vehicle."""
    over = [row for row in rows if row["case"] == said["case"] and "over_exact" in row]
    shares = ", ".join(f"{name.replace('_', ' ')} {said[f'{name}_percent']:.4g} %" for name in SHARES)
    ratios = dict[str, list[str]]()
    for row in over:
        ratios.setdefault(row["estimator"], []).append(f"{row['load']} {row['over_exact']:.2f}")
    texts = [f"; {name}, rms over exactly known: {' '.join(parts)}" for name, parts in ratios.items()]
    return f"{said['case']}: {said['samples']} tests, {shares}{''.join(texts)}"


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


@once
def compared_world(
    vehicle: Vehicle,
    snapshots: Path,
    structure: Path | None,
    flows: Path,
    conditions: int,
    seed: int,
    training: int,
) -> ComparedWorld:
    """Return the world of a comparison."""
    parts = load_map_parts(vehicle, snapshots, structure, Silent())
    maps = maps_for(vehicle, *parts, is_exact=False)
    return ComparedWorld(
        **true_world(vehicle, flows, structure),
        inverse_map=maps[NONLINEAR],
        made={False: maps},
        conditions=conditions,
        seed=seed,
        snapshots=parts[0],
        map_structure=parts[1],
        training=training,
    )


@once
def tested_world(
    vehicle: Vehicle, snapshots: Path, flows: Path, conditions: int, options: GroundTests
) -> GroundWorld:
    """Return the world of ground tests."""
    table = load_truth_flows(flows, vehicle)
    return ground_world(vehicle, load_snapshots(snapshots), table, conditions, options)


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


def make_trial_flows(pipeline: Pipeline, vehicle: Vehicle, trial: TrialFile, options: TrialOptions) -> None:
    """Make the flows of the independent model, or take the ones that are given.

    They go beyond the envelope, but for cases that all fly in the same square of angles.
    """
    cases_for(vehicle, trial, options.only)  # refused here, before the long work
    cases = cases_for(vehicle, trial)
    squares = {case.where.square for case in cases}
    square = squares.pop() if len(squares) == 1 else None
    holds = f"flows of the independent model {'beyond' if square is None else 'inside'} the envelope"
    if options.flows is not None:
        pipeline.use(FLOWS, options.flows, _content_of_flows(options.flows, vehicle))
        return
    if not vehicle.is_of_revolution:
        conditions = shape_conditions(vehicle, cases, trial.trial.conditions, trial.trial.seed)
        make_shape_flows(pipeline, vehicle, conditions, FLOWS, holds)
        return

    def write(path: Path) -> None:
        with Journal(path) as journal:
            save_flow_table(stress_flows(vehicle, pipeline.reporter, journal, square=square), path)
            journal.remove()

    inputs = {"schema_version": flow_table_file.SCHEMA_VERSION, **stress_flow_inputs(vehicle, square)}
    pipeline.make(FLOWS, holds, inputs, write, shared=True)


def _content_of(path: Path, module: ModuleType) -> str:
    return content_hash_of(path, module.SCHEMA, module.SCHEMA_VERSION)


def _content_of_flows(path: Path, vehicle: Vehicle) -> str:
    return _content_of(path, flow_table_file if vehicle.is_of_revolution else snapshots_file)


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
