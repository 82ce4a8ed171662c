"""A trade study from its file to its table: each design built and flown on the independent model; designs that
share flows share files, Dask workers do the designs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from builder.campaign.dask_workers import on_dask
from builder.figures.comparison.trade_study import trade_study_figure
from builder.figures.drawing.canvas import save
from builder.pipeline.map_files import make_independent_flows, make_map, make_snapshots
from builder.pipeline.pipeline import FilesGiven, Pipeline
from builder.pipeline.shape_flows import make_shape_flows
from builder.pipeline.trial_run import shape_conditions, world_of
from builder.pipeline.used_files import FLOWS, MAP, SNAPSHOTS, STRUCTURE, open_pipeline
from builder.processors import processors
from builder.reporting import Reporter, Silent
from builder.study.study_file import Design, StudyFile, designs_of, load_study, vehicle_of
from builder.trial.cases import Plan
from builder.trial.levels import HARDWARE
from builder.trial.run import scored
from builder.trial.score import Row
from builder.trial.table import write_table
from builder.vehicle.file import Vehicle
from builder.workspace import Workspace
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.files import fingerprint, write_bytes_atomically

TABLE, FIGURE, SCORE, TRIAL_FLOWS = "study.csv", "study.png", "score.json", "trial_flows.h5"

VERSION = 2
"""Raised whenever the scores change otherwise than by their inputs, so that they are made again."""

MEMORY_LIMIT = "6 GiB"
"""Of one local worker."""

NOT_OF_FLOWS = {
    "description",
    "material",
    "materials",
    "gauges",
    "noise",
    "map",
    "calibration",
    TEMPERATURE,
    "mass",
    "structure",
}
"""Sections that change no flow; the pressure inside the body apart."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """What a worker needs for one design: its ``folder``, ``snapshots`` and ``flows`` that it shares with others,
    None for flows of its own, and what identifies these."""

    vehicle: Vehicle
    folder: Path
    plan: Plan
    snapshots: Path
    flows: Path | None
    flows_made_from: str


@dataclass(frozen=True, eq=False, kw_only=True)
class StudyResult:
    """The table, a line for each design that was not scored, and the files that were written."""

    rows: list[Row]
    faults: list[str]
    files: list[Path]


def run_study(
    path: Path, folder: Path, reporter: Reporter, *, workers: int | None = None, scheduler: str | None = None
) -> StudyResult:
    """Build and try every design of the study at ``path``; write the table and its figure to ``folder``.

    What is up to date in the folder of a design is not made again, so that a study that was interrupted goes on.

    Parameters
    ----------
    workers : designs at a time on this machine; None for as many as there are processors, 1 for this process.
    scheduler : address of a Dask scheduler whose workers share ``folder``; None for this machine.

    Raises
    ------
    InputError
        The study, or the vehicle of a design, is wrong.
    StrainfmuError
        A flow cannot be solved, a file not be written, or the workers are lost.
    """
    study = load_study(path)
    designs = designs_of(study)
    vehicles = [vehicle_of(path, study, design) for design in designs]
    tasks = _tasks(study, designs, vehicles, folder.resolve(), reporter)
    scores = dict(_scores(tasks, reporter, workers, scheduler))
    rows, faults = list[Row](), list[str]()
    for design, task in zip(designs, tasks, strict=True):
        if isinstance(score := scores[task.folder], str):
            faults.append(f"{design.name} ({design.text}): {score}")
        else:
            rows += [{"design": design.number, **design.values, **row} for row in score]
    files = [folder / TABLE] if rows else []
    if rows and find_spec("pyarrow") is not None:
        files.append((folder / TABLE).with_suffix(".parquet"))
    for file in files:
        write_table(rows, file)
    if rows and find_spec("matplotlib") is not None:
        files.append(folder / FIGURE)
        save(trade_study_figure(rows, list(study.sweep)), folder / FIGURE)
    return StudyResult(rows=rows, faults=faults, files=files)


def _tasks(
    study: StudyFile, designs: Sequence[Design], vehicles: Sequence[Vehicle], folder: Path, reporter: Reporter
) -> list[Task]:
    """Return the tasks; flows are solved here, once for all designs that have the same."""
    shared: dict[str, Pipeline] = {}
    tasks = []
    for design, vehicle in zip(designs, vehicles, strict=True):
        key = flows_key(vehicle)
        if key not in shared:
            pipeline = Pipeline(vehicle, Workspace(folder / f"flows_{len(shared) + 1:04d}"), reporter)
            make_snapshots(pipeline)
            if vehicle.is_of_revolution:
                make_independent_flows(pipeline)
            shared[key] = pipeline
        flows, has_table = shared[key], vehicle.is_of_revolution
        tasks.append(
            Task(
                vehicle=vehicle,
                folder=folder / design.name,
                plan=study.trial.plan,
                snapshots=flows.path(SNAPSHOTS),
                flows=flows.path(FLOWS) if has_table else None,
                flows_made_from=flows.made_from(FLOWS)[0] if has_table else "",
            )
        )
    return tasks


def flows_key(vehicle: Vehicle) -> str:
    """Return what the flows of a vehicle follow from: designs of one key share them."""
    entries = vehicle.model_dump(exclude=NOT_OF_FLOWS)
    return fingerprint({**entries, "internal_pressure": vehicle.structure.internal_pressure_Pa})


def _scores(
    tasks: list[Task], reporter: Reporter, workers: int | None, scheduler: str | None
) -> Iterator[tuple[Path, list[Row] | str]]:
    """Yield the results of :func:`run_design` as designs are done."""
    count = min(workers or processors(), len(tasks))
    with reporter.stage(f"Designs: {len(tasks)}") as progress:
        if count == 1 and scheduler is None:
            results: Iterator[tuple[Path, list[Row] | str]] = map(run_design, tasks)
        else:
            results = on_dask(run_design, tasks, scheduler, count, reporter.note, MEMORY_LIMIT)
        for done, result in enumerate(results, start=1):
            yield result
            progress(done, len(tasks))


def run_design(task: Task, reporter: Reporter | None = None) -> tuple[Path, list[Row] | str]:
    """Build and try a design, or take what is up to date in its folder; return this, and its rows, or the fault
    that ended it."""
    try:
        return task.folder, _rows(task, reporter or Silent())
    except StrainfmuError as error:
        return task.folder, "; ".join(str(error).splitlines())


def _rows(task: Task, reporter: Reporter) -> list[Row]:
    pipeline, _ = open_pipeline(task.vehicle, task.folder, reporter, FilesGiven(snapshots=task.snapshots))
    if task.flows is not None:
        pipeline.use(FLOWS, task.flows, task.flows_made_from)
    make_map(pipeline)
    vehicle, plan = pipeline.flown or pipeline.vehicle, task.plan
    if vehicle.sensors is not None:
        raise InputError("sensors: expected none, a trade study flies strain gauges alone")
    if not vehicle.is_of_revolution:
        conditions = shape_conditions(vehicle, [HARDWARE], plan.conditions, plan.seed)
        make_shape_flows(pipeline, vehicle, conditions, TRIAL_FLOWS, "flows of the trial")

    def write(path: Path) -> None:
        flows, structure = FLOWS if vehicle.is_of_revolution else TRIAL_FLOWS, pipeline.path(STRUCTURE)
        files = pipeline.path(MAP), pipeline.path(flows), structure if structure.is_file() else None
        world = world_of(vehicle, *files, plan.conditions, plan.seed)
        (rows,) = scored(world, HARDWARE, plan).values()
        made = [{"gauges": world.inverse_map.n_gauges, **row} for row in rows]
        write_bytes_atomically(path, json.dumps(made, indent=1).encode())

    inputs = {
        "version": VERSION,
        "map": pipeline.made_from(MAP),
        "trial": plan.model_dump(),
        "flows": task.flows_made_from,
        "vehicle": vehicle.model_dump(exclude={"description"}),
    }
    pipeline.make(SCORE, "errors and uncertainty of the design in the trial", inputs, write)
    rows: list[Row] = json.loads(pipeline.path(SCORE).read_text(encoding="utf-8"))
    return rows
