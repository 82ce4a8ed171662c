"""Trials of every kind from their files, ``strainfmu trial``, ``stress`` and ``compare``: maps, flows of the
independent model, cases, tables."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np

from builder.calibration.score.ground_rows import ground_rows, refuse_unknown_tests
from builder.calibration.score.ground_world import ground_world
from builder.campaign import snapshots as snapshots_file
from builder.campaign.snapshots import load_snapshots
from builder.figures.comparison import trial_figure
from builder.figures.drawing import save
from builder.manifold.condition_tables import snapshot_grid
from builder.manifold.state_tables import with_mirror_images
from builder.pipeline.built_sensors import flown_sensors, sensor_names_of
from builder.pipeline.closed_loop_trial import closed_loop_rows
from builder.pipeline.estimator_choice import estimator_of, with_estimator
from builder.pipeline.map_files import (
    load_map_parts,
    make_independent_flows,
    make_map,
    make_map_parts,
    make_snapshots,
)
from builder.pipeline.pipeline import FLOWS as LEVEL_FLOWS
from builder.pipeline.pipeline import MAP, SNAPSHOTS, STRUCTURE, FilesGiven, Pipeline, open_pipeline
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.pipeline.stages import check_before_long_work, make_flow_table, make_shape_flows
from builder.processors import one_thread_of_blas
from builder.reporting import Reporter, Silent
from builder.structure.as_built.as_built_structure import refuse_unheld
from builder.structure.gauge_checks import gauges_in_use
from builder.structure.structure_file import load_structure
from builder.trial.cases import Case, Plan, TrialFile, cases_for, load_trial
from builder.trial.compared import (
    NONLINEAR,
    REGRESSIONS,
    ComparedWorld,
    compared_estimators,
    knowing,
    maps_for,
    refuse_unknown,
)
from builder.trial.conditions import flown_conditions, stress_knots
from builder.trial.estimators import available
from builder.trial.faults import temperature_of
from builder.trial.readings import World
from builder.trial.run import Score, run_tasks, scored, tasks_of
from builder.trial.score import ALL, Row
from builder.trial.table import line_of, stress_entries, write_table
from builder.truth import flow_table as flow_table_file
from builder.truth.flights import other_physics
from builder.truth.flow_table import load_flow_table
from builder.truth.shape import flying_structure, refuse_without_independent_model
from builder.truth.true_structure import true_structure
from builder.vehicle.file import IC3X, VEHICLES, Vehicle, load_vehicle
from builder.vehicle.toml.reading import naming
from builder.workspace import Cache, Misfit, Workspace, refuse_misfits
from strainfmu.errors import InputError
from strainfmu.estimator.map import inverse_map as inverse_map_file
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.estimator.valid_ranges import RECORDED_KEYS
from strainfmu.files import content_hash_of, write_bytes_atomically
from strainfmu.flight_condition import ALTITUDE, CONDITION_QUANTITIES, FlightCondition

FLOWS, CASES, TABLE, FIGURE = "trial_flows.h5", "cases", "trial", "trial.png"

SUFFIXES = (".csv", ".parquet", ".json")


@dataclass(frozen=True, eq=False, kw_only=True)
class TrialResult:
    """The table of a trial, the vehicle's name, and the files that were written.

    ``rows`` are one per case, estimator and load, by the columns of ``trial.csv``.
    """

    vehicle: str
    cases: list[Case]
    rows: list[Row]
    files: list[Path]


def run_trial(
    file: str | Path,
    vehicle: str | Path | None = None,
    output: str | Path = "trial",
    *,
    inverse_map: str | Path | None = None,
    flows: str | Path | None = None,
    only: Sequence[str] = (),
    estimators: Sequence[str] | None = None,
    conditions: int | None = None,
    draws: int | None = None,
    training: int | None = None,
    seed: int | None = None,
    formats: Sequence[str] = (),
    workers: int = 1,
    scheduler: str | None = None,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    rebuild: bool = False,
    estimator: Literal["auto", "linear", "nonlinear"] | None = None,
    progress: AnyProgress = None,
) -> TrialResult:
    """Try errors on a map: which it includes in sigma, which health flags, which stay undetected.

    The file lists cases: where they fly, what is wrong with vehicle, gauges, air data or flow. A truth model of
    the vehicle flies them. Shipped files: stress, manoeuvres, uncertainty, incidence, false_alarms, lost_gauges,
    heating, ground_test, ground_test_size; closed_loop takes a scenario of ``strainfmu fly``, not a vehicle.

    A load is wrong outside 3 sigma. A sample is flagged when health is neither OK nor DEGRADED, and undetected
    when it is wrong and not flagged. Each fraction has its statistical error; a verdict is ok, missed or open (too
    few samples).

    Writes trial.csv and trial.png. Finished cases are kept: an interrupted trial continues, and a second run
    reuses what is up to date.

    On the command line::

        strainfmu trial stress my_vehicle.toml --map results/map.h5 -o stress
        strainfmu trial my_errors.toml my_vehicle.toml --only "bias of one gauge" --draws 100
        strainfmu trial uncertainty --map demo/map.h5 --flows demo/independent_flows.h5

    Parameters
    ----------
    file : file of the trial (TOML), or the name of a shipped one, such as "stress".
    vehicle : vehicle file (TOML). Default: the IC3X surrogate that is shipped.
    output : folder for the results.
    inverse_map : map to test (map.h5). Default: built in the folder. Not with the options of a build.
    flows : flows of the truth model to fly, such as independent_flows.h5. Default: solved in the folder.
    only : errors to try. Default: all.
    estimators : estimators to try: "linear", "nonlinear", "linear 10 s". Default: the file's.
    conditions : flight conditions of each case.
    draws : draws of vehicle and noise at every condition.
    training : flights that train each learning estimator.
    seed : seed of all draws.
    formats : formats of the table: "csv", "parquet", "json". Default: "csv".
    workers : cases at a time on this machine; each takes memory of its own.
    scheduler : Dask scheduler, such as tcp://host:8786, whose workers share the files.
    snapshots, structure, rebuild, estimator : as :func:`build` takes them.
    progress : True for progress bars.

    Raises
    ------
    InputError
        A file is wrong, the map does not fit the vehicle, or there is no truth model of it.
    StrainfmuError
        A file could not be written.
    """
    suffixes = tuple(f".{name}" for name in formats or ("csv",))
    if unknown := [suffix for suffix in suffixes if suffix not in SUFFIXES]:
        raise InputError(f"--format: expected csv, parquet or json, got {unknown[0][1:]}")
    wanted: dict[str, Any] = {"conditions": conditions, "vehicles": draws, "seed": seed, "training": training}
    wanted["estimators"] = None if estimators is None else list(estimators)
    trial = load_trial(file).changed({k: value for k, value in wanted.items() if value is not None})
    folder, reporter = Path(output), reporter_of(progress)
    map_path, flows_path = (None if path is None else Path(path) for path in (inverse_map, flows))
    if trial.closed_loop is not None:
        scenario = Path(vehicle or VEHICLES / "ic3x_flight.toml")
        name, rows = closed_loop_rows(trial.closed_loop, scenario, map_path, only, reporter)
        return _written(name, [], rows, folder, suffixes, reporter)
    with naming(path := Path(vehicle or IC3X)):
        entry = with_estimator(load_vehicle(path), estimator)
        if any(case.heating for case in trial.cases):
            entry = entry.model_copy(update={TEMPERATURE: temperature_of(entry)})
        if map_path is not None:
            pipeline = _with_map(entry, trial, map_path, folder, reporter)
        else:
            files_given = FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild)
            pipeline, listed = open_pipeline(entry, folder, reporter, files_given)
            refuse_vehicle(pipeline.flown or pipeline.vehicle, trial)
            check_before_long_work(pipeline.vehicle, listed)
            if flows_path is not None and entry.is_axisymmetric:
                pipeline.use(LEVEL_FLOWS, flows_path, _content_of(flows_path, flow_table_file))
        make = _comparison if trial.trial.training else _ground_tests if trial.ground else _flights_of_map
        flown, trial, make_world, inputs, score = make(pipeline, trial, only, flows_path)
        inputs["vehicle"] = flown.model_dump(exclude={"description", "truth"})
        tasks = tasks_of(cases_for(flown, trial, only), trial.trial, make_world, inputs, score)
        with naming(trial.path):
            results = run_tasks(tasks, folder / CASES, reporter, workers=workers, scheduler=scheduler)
    rows = list[Row]()
    for task, result in zip(tasks, results, strict=True):
        if isinstance(result, str):
            reporter.note(f"{task.case.error}, {task.case.size}: left out: {result}")
        else:
            rows += result
    if not rows:
        raise InputError(f"{trial.path}: expected cases that this vehicle can fly, got {len(tasks)}, all left out")
    return _written(entry.name, [task.case for task in tasks], rows, folder, suffixes, reporter)


def stress(
    vehicle: str | Path | None = None,
    output: str | Path = "stress",
    *,
    inverse_map: str | Path | None = None,
    conditions: int = 200,
    draws: int = 20,
    seed: int = 1,
    flights: bool = False,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    rebuild: bool = False,
    estimator: Literal["auto", "linear", "nonlinear"] | None = None,
    workers: int = 1,
    progress: AnyProgress = None,
) -> TrialResult:
    """Try some sixty kinds of error on a map: the trial ``stress``, or ``manoeuvres`` with ``flights``.

    Flies a truth model of the vehicle with installation errors, failed gauges, temperature, flights beyond the
    envelope, and the pressure of another flow model.

    ``flights`` flies turns, steps, gusts, drifts of air data and failures at 100 Hz instead. Each estimator takes
    them as single samples and with filters of 1 s and 10 s.

    ``strainfmu trial --help`` says what the columns mean. A vehicle given by sections or a surface needs a flow
    for every flight; it flies a quarter of them beyond the envelope.

    Writes trial.csv, trial.png, and stress.json in the form of earlier versions. Flows are kept as they are
    solved: an interrupted run continues, and a second run reuses what is up to date.

    On the command line::

        strainfmu stress my_vehicle.toml -o stress
        strainfmu stress my_vehicle.toml -o stress --map results/map.h5 --conditions 500
        strainfmu stress my_vehicle.toml -o manoeuvres --flights

    Parameters
    ----------
    vehicle, output, inverse_map, conditions, draws, seed, workers, progress : as :func:`run_trial` takes them.
    flights : fly manoeuvres over time; without ``conditions``.
    snapshots, structure, rebuild, estimator : as :func:`build` takes them.
    """
    arguments: dict[str, Any] = dict(locals())
    file = "manoeuvres" if arguments.pop("flights") else "stress"
    result = run_trial(file, **arguments)
    text = json.dumps(stress_entries(result.cases, result.rows), indent=1, allow_nan=False) + "\n"
    write_bytes_atomically(Path(output) / "stress.json", text.encode())
    return result


def compare(
    vehicle: str | Path | None = None,
    output: str | Path = "compare",
    *,
    conditions: int | None = None,
    draws: int | None = None,
    training: int | None = None,
    seed: int | None = None,
    workers: int = 1,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    rebuild: bool = False,
    progress: AnyProgress = None,
) -> TrialResult:
    """Try estimators of eight kinds on the same readings: the trial ``compare``.

    The kinds are the linear maps of both cases, the nonlinear estimator and a Kalman filter with a random
    walk. The extra ``rivals`` adds regression tree, random forest, gradient boosting and multi-layer perceptron.

    Each is scored with gauge noise alone and with installation errors, with all air-data inputs and with q_inf
    only: rms errors over the Cramer-Rao bound, coverage of 3 sigma, air data, error of the pressure field.

    Writes trial.csv and trial.png. Flows are kept as they are solved: an interrupted run continues, and a second
    run reuses what is up to date.

    On the command line::

        strainfmu compare my_vehicle.toml -o compare
        strainfmu compare my_vehicle.toml -o compare --snapshots flows/fine.h5 --conditions 1000

    Parameters
    ----------
    vehicle, output, conditions, draws, training, seed, workers, progress : as :func:`run_trial` takes them.
    snapshots, structure, rebuild : as :func:`build` takes them.
    """
    return run_trial("compare", **locals())


def _with_map(entry: Vehicle, trial: TrialFile, path: Path, folder: Path, reporter: Reporter) -> Pipeline:
    """Return the pipeline of a trial of the map at ``path``.

    Raises
    ------
    InputError
        The map does not fit the vehicle, or the trial makes maps of its own.
    """
    if trial.trial.training or trial.ground:
        raise InputError("--map: expected none, this trial makes maps for its vehicles and errors; leave it out")
    inverse_map = load_inverse_map(path)
    vehicle = of_map(entry, inverse_map)
    refuse_vehicle(vehicle, trial)
    check_fit(vehicle, inverse_map, path)
    pipeline = Pipeline(vehicle, Workspace(folder, Cache(vehicle.beside("."))), reporter)
    pipeline.use(MAP, path, _content_of(path, inverse_map_file))
    return pipeline


Parts = tuple[Vehicle, TrialFile, Callable[[], Any], dict[str, Any], Score]
"""What the tasks of a trial are made of: vehicle and file, a function that makes the world, what that depends on,
and a function that returns the rows of a case."""


def _flights_of_map(pipeline: Pipeline, trial: TrialFile, only: Sequence[str], flows: Path | None) -> Parts:
    """Return the parts of a trial of a map, which is made where none is given, after flows.

    Errors are the independent model's; of a body of revolution its structure is the Fourier model whatever the map
    is built on, of any other shape another mesh.
    """
    if MAP not in pipeline.elsewhere:
        make_map(pipeline)
    inverse_map = load_inverse_map(pipeline.path(MAP))
    vehicle = with_estimator(pipeline.flown or pipeline.vehicle, estimator_of(inverse_map))
    with naming(trial.path):
        trial = trial.changed({"estimators": available(inverse_map, trial.trial.estimators)})
    plan = trial.trial
    _make_flows(pipeline, vehicle, trial, only, flows)
    structure = pipeline.path(STRUCTURE)
    files = pipeline.path(MAP), pipeline.path(FLOWS), structure if structure.is_file() else None
    inputs = {"map": _content_of(pipeline.path(MAP), inverse_map_file), "flows": pipeline.made_from(FLOWS)}
    return vehicle, trial, partial(world_of, vehicle, *files, plan), inputs, scored


def _comparison(pipeline: Pipeline, trial: TrialFile, only: Sequence[str], flows: Path | None) -> Parts:
    """Return the parts of a trial of estimators of several kinds, whose maps are built for the errors of each
    case; without scikit-learn its regressions are left out, with a note."""
    refuse_unknown(names := trial.trial.estimators)
    needing = [name for name in names if name.partition(", ")[0] in REGRESSIONS]
    if needing and find_spec("sklearn") is None:
        trial = trial.changed({"estimators": [name for name in names if name not in needing]})
        pipeline.reporter.note(f"left out, they need strainfmu[rivals]: {', '.join(needing)}")
    make_map_parts(pipeline)
    vehicle = knowing(pipeline.flown or pipeline.vehicle, is_exact=False, case=1)
    snapshots = load_snapshots(pipeline.path(SNAPSHOTS))
    if not vehicle.is_axisymmetric:
        snapshot_grid(with_mirror_images(snapshots, snapshots.surface))  # refused here, before the long work
    elif snapshots.station is None:
        raise InputError("compare: expected a body of revolution with rings of nodes, got a free surface")
    _make_flows(pipeline, vehicle, trial, only, flows)
    solid = [STRUCTURE] if pipeline.vehicle.structure.model == "solid" else []
    files = pipeline.path(SNAPSHOTS), pipeline.path(STRUCTURE) if solid else None, pipeline.path(FLOWS)
    inputs = {"made from": pipeline.made_from(SNAPSHOTS, FLOWS, *solid), "training": trial.trial.training}
    world = partial(_compared_world, vehicle, *files, trial.trial)
    return vehicle, trial, world, inputs, partial(scored, make_estimators=compared_estimators)


def _ground_tests(pipeline: Pipeline, trial: TrialFile, only: Sequence[str], _: Path | None) -> Parts:
    """Return the parts of a trial of ground tests of vehicles of an independent truth, after the flows."""
    plan, tests, vehicle = trial.trial, trial.ground, pipeline.vehicle
    assert tests is not None
    refuse_unknown_tests(plan.estimators, trial.cases)
    refuse_unheld(vehicle, vehicle.gauges.layout)
    make_snapshots(pipeline)
    make_independent_flows(pipeline)
    files = pipeline.path(SNAPSHOTS), pipeline.path(LEVEL_FLOWS)
    inputs = {"made from": pipeline.made_from(SNAPSHOTS, LEVEL_FLOWS), "ground": tests.model_dump()}
    world = partial(ground_world, vehicle, *files, plan.conditions, tests)
    return vehicle, trial, partial(_without_threads, world), inputs, partial(_without_threads, ground_rows)


def _without_threads(make: Callable[..., Any], *given: Any) -> Any:
    """Return what ``make`` makes of ``given``, on matrices too small for threads of BLAS."""
    with one_thread_of_blas():
        return make(*given)


def _written(
    vehicle: str, cases: list[Case], rows: list[Row], folder: Path, formats: Sequence[str], reporter: Reporter
) -> TrialResult:
    """Write the rows to ``folder``, and the figure of samples where there are some; print other rows."""
    for row in rows:
        if "rms" not in row and not row["load"].startswith(ALL):
            reporter.note(line_of(row))
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
    if moves and not vehicle.is_axisymmetric:
        raise InputError("motion: expected a body of revolution, got a shape that needs a flow for every sample")
    refuse_without_independent_model(vehicle)


def world_of(
    vehicle: Vehicle,
    inverse_map: Path | InverseMap,
    flows: Path,
    structure: Path | None,
    plan: Plan,
    made_by: type[World] = World,
    **more: Any,
) -> World:
    """Return the world of a trial, ``made_by`` with ``more`` attributes.

    ``structure`` is the file of the map's structure, whose check is the mesh that flies, of another shape than a
    body of revolution.
    """
    parts: dict[str, Any] = {"vehicle": vehicle, "conditions": plan.conditions, "seed": plan.seed, **more}
    parts["inverse_map"] = inverse_map if isinstance(inverse_map, InverseMap) else load_inverse_map(inverse_map)
    if not vehicle.is_axisymmetric:
        known = None if structure is None else load_structure(structure)
        return made_by(structure=flying_structure(vehicle, known, Silent()), flows=load_snapshots(flows), **parts)
    true = true_structure(vehicle)
    sensors = flown_sensors(vehicle, true.surface)
    as_built = None if sensors is None else sensors.as_built
    table = load_flow_table(flows, vehicle)
    return made_by(structure=true, flows=table, sensors=as_built, **parts)


def _compared_world(vehicle: Vehicle, snapshots: Path, structure: Path | None, flows: Path, plan: Plan) -> World:
    parts = load_map_parts(vehicle, snapshots, structure, Silent())
    maps = maps_for(vehicle, *parts, is_exact=False)
    more = {
        "_made": {False: maps},
        "snapshots": parts[0],
        "map_structure": parts[1],
        "training": plan.training or 0,
    }
    return world_of(vehicle, maps[NONLINEAR], flows, structure, plan, ComparedWorld, **more)


def _make_flows(
    pipeline: Pipeline, vehicle: Vehicle, trial: TrialFile, only: Sequence[str], flows_path: Path | None
) -> None:
    """Make the flows of the independent model beyond the envelope, or take the ones that are given."""
    for line in other_physics(vehicle):
        pipeline.reporter.note(line)
    cases_for(vehicle, trial, only)  # refused here, before the long work
    cases = cases_for(vehicle, trial)
    holds = "flows of the independent model beyond the envelope"
    if flows_path is not None:
        pipeline.use(
            FLOWS,
            flows_path,
            _content_of(flows_path, flow_table_file if vehicle.is_axisymmetric else snapshots_file),
        )
    elif not vehicle.is_axisymmetric:
        conditions = shape_conditions(vehicle, cases, trial.trial.conditions, trial.trial.seed)
        make_shape_flows(pipeline, vehicle, conditions, FLOWS, holds)
    else:
        make_flow_table(pipeline, vehicle, stress_knots(vehicle), FLOWS, holds, failed={})


def _content_of(path: Path, module: ModuleType) -> str:
    return content_hash_of(path, module.SCHEMA, module.SCHEMA_VERSION)


def shape_conditions(vehicle: Vehicle, cases: Sequence[Case], count: int, seed: int) -> list[FlightCondition]:
    """Return a condition of every flow that ``cases`` need, whatever its altitude."""
    places = {str(case.where): case.where for case in cases}
    flown = [
        condition
        for where in places.values()
        for condition in flown_conditions(where, vehicle, None, count, np.random.default_rng(seed))
    ]
    return list({(condition.as_row()[:3], condition.parameters): condition for condition in flown}.values())


def of_map(vehicle: Vehicle, inverse_map: InverseMap) -> Vehicle:
    """Return ``vehicle`` with the estimator of ``inverse_map`` and the flight conditions that it states."""
    recorded = inverse_map.provenance
    ranges = {
        quantity.column: sorted(
            {round((1e-3 if quantity.name == ALTITUDE else 1.0) * float(value), 9) for value in recorded[key]}
        )
        for quantity in CONDITION_QUANTITIES
        if isinstance(recorded.get(key := RECORDED_KEYS[quantity.name]), list)
    }
    conditions = vehicle.conditions.model_copy(update=ranges)
    of_form = {} if inverse_map.form == "absolute" else {"gamma": 1.0}
    entries = vehicle.map.model_copy(update={"form": inverse_map.form, **of_form})
    changes: dict[str, object] = {"conditions": conditions, "map": entries}
    changes |= {} if inverse_map.has_temperature else {TEMPERATURE: None}
    return with_estimator(vehicle.model_copy(update=changes), estimator_of(inverse_map))


def check_fit(vehicle: Vehicle, inverse_map: InverseMap, path: Path) -> None:
    """Refuse a map (``path``) whose gauges or references differ from ``vehicle``, before anything is solved.

    Raises
    ------
    InputError
        Names what differs, or a gauge is not on the vehicle's surface.
    """
    n, reference = inverse_map.n_strain_gauges, vehicle.reference_quantities()
    masses = ("without masses", "with masses")
    entries = {
        f"gauges of layout '{vehicle.gauges.layout}'": (gauges_in_use(vehicle).name, inverse_map.gauge_names[:n]),
        "auxiliary sensors": (sensor_names_of(vehicle), inverse_map.gauge_names[n:]),
        "map": (masses[vehicle.mass is not None], masses[inverse_map.has_masses]),
        "reference area [m2]": (f"{reference.area:.6g}", f"{inverse_map.reference_area:.6g}"),
        "reference length [m]": (f"{reference.length:.6g}", f"{inverse_map.reference_length:.6g}"),
    }
    misfits = [
        Misfit(entry=entry, expected=_in_words(expected), actual=_in_words(actual))
        for entry, (expected, actual) in entries.items()
        if expected != actual
    ]
    refuse_misfits(path, misfits)


def _in_words(value: str | Sequence[str]) -> str:
    return value if isinstance(value, str) else f"{len(value)}: {', '.join(value)[:80] or 'none'}"
