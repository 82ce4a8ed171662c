"""A trade study from its file to its table: designs that share flows share files, Dask workers do the designs."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from builder.campaign.dask_workers import on_dask
from builder.figures.comparison.trade_study import trade_study_figure
from builder.figures.drawing.canvas import save
from builder.pipeline.map_files import make_independent_flows, make_snapshots
from builder.pipeline.pipeline import Pipeline
from builder.pipeline.used_files import FLOWS, SNAPSHOTS
from builder.processors import processors
from builder.reporting import Reporter
from builder.study.design_score import DesignScore, Task, run_design
from builder.study.study_file import Design, StudyFile, designs_of, load_study, vehicle_of
from builder.vehicle.file import Vehicle
from builder.workspace import Workspace
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.files import fingerprint, write_bytes_atomically

CSV, PARQUET, FIGURE = "study.csv", "study.parquet", "study.png"

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
class StudyResult:
    """The result of a study.

    Attributes
    ----------
    rows : a row of the table for each design that was scored.
    faults : one line for each design that was not.
    files : that were written.
    """

    rows: list[dict[str, Any]]
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
    vehicles = [vehicle_of(path, study, one) for one in designs]
    tasks = _tasks(study, designs, vehicles, folder.resolve(), reporter)
    by_folder = {one.folder: one for one in _scores(tasks, reporter, workers, scheduler)}
    found = [by_folder[one.folder] for one in tasks]
    rows = [table_row(design, one.score) for design, one in zip(designs, found, strict=True) if one.score]
    faults = [f"{d.name} ({d.text}): {one.fault}" for d, one in zip(designs, found, strict=True) if one.fault]
    return StudyResult(rows=rows, faults=faults, files=_write(study, rows, folder) if rows else [])


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
        flows = shared[key]
        has_table = vehicle.is_of_revolution
        tasks.append(
            Task(
                vehicle=vehicle,
                folder=folder / design.name,
                trial=study.trial,
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
) -> Iterator[DesignScore]:
    """Yield the scores as designs are done."""
    count = min(workers or processors(), len(tasks))
    with reporter.stage(f"Designs: {len(tasks)}") as progress:
        if count == 1 and scheduler is None:
            found: Iterator[DesignScore] = map(run_design, tasks)
        else:
            found = on_dask(run_design, tasks, scheduler, count, reporter.note, MEMORY_LIMIT)
        for done, one in enumerate(found, start=1):
            yield one
            progress(done, len(tasks))


def table_row(design: Design, score: dict[str, Any]) -> dict[str, Any]:
    """Return the row of a design: number, swept values, then the score, each quantity with its coefficient."""
    row: dict[str, Any] = {"design": design.number, **design.values, "gauges": score["gauges"]}
    for quantity in ("rms", "sigma", "rms_percent_of_range", "coverage_percent"):
        row |= {f"{quantity}_{name}": score[quantity][name] for name in COEFFICIENT_NAMES}
    return {**row, **{name: score[name] for name in ("detected_percent", "undetected_percent", "samples")}}


def _write(study: StudyFile, rows: list[dict[str, Any]], folder: Path) -> list[Path]:
    """Write the table, as CSV and where pyarrow is installed as Parquet, and the figure; return the files."""
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_bytes_atomically(folder / CSV, text.getvalue().encode())
    files = [folder / CSV]
    if find_spec("pyarrow") is not None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        content = io.BytesIO()
        pq.write_table(pa.Table.from_pylist(rows), content)
        write_bytes_atomically(folder / PARQUET, content.getvalue())
        files.append(folder / PARQUET)
    if find_spec("matplotlib") is not None:
        save(trade_study_figure(rows, list(study.sweep)), folder / FIGURE)
        files.append(folder / FIGURE)
    return files
