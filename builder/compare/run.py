"""The comparison from a vehicle file to its table: maps, flows, estimators, scores, figure."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from builder.compare.aims import Aim, aims
from builder.compare.candidate import GIVEN
from builder.compare.flights import Effort
from builder.compare.flown import FLOWS, flown_pair, make_flows
from builder.compare.rivals import RIVALS
from builder.compare.score import AIR_DATA_KEYS
from builder.compare.trial import Trial, all_entries
from builder.figures.comparison.rivals import compare_figure
from builder.figures.drawing.canvas import save
from builder.pipeline.map_files import make_map_parts, map_parts
from builder.pipeline.pipeline import FilesGiven, Pipeline
from builder.pipeline.stages import check_before_long_work
from builder.pipeline.used_files import SNAPSHOTS, STRUCTURE, open_pipeline
from builder.reporting import Reporter
from builder.truth.independent_model import other_physics, refuse_without_independent_model
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from strainfmu.files import write_bytes_atomically

JSON, CSV, FIGURE = "compare.json", "compare.csv", "compare.png"

VERSION = 8
"""Raised whenever the scores change otherwise than by their inputs, so that they are made again."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CompareResult:
    """The result of a comparison.

    Attributes
    ----------
    vehicle : name.
    entries : of ``compare.json``, in its order.
    aims : what the nonlinear estimator is aimed at.
    files : that were made or are up to date.
    """

    vehicle: str
    entries: list[dict[str, Any]]
    aims: list[Aim]
    files: list[Path]


def run_compare(
    vehicle_path: Path,
    folder: Path,
    reporter: Reporter,
    *,
    effort: Effort | None = None,
    given: FilesGiven | None = None,
) -> CompareResult:
    """Score every estimator on the same readings; write ``compare.json``, ``.csv`` and ``.png`` to ``folder``.

    Readings come from the independent model. Of a body of revolution its structure is the Fourier model,
    whatever the maps are built on; of any other shape another mesh. Without scikit-learn its estimators are left
    out, with a note.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong; or there is no independent model of it.
    StrainfmuError
        A file could not be written.
    """
    effort = effort or Effort()
    pipeline, conditions = open_pipeline(load_vehicle(vehicle_path), folder, reporter, given or FilesGiven())
    refuse_without_independent_model(pipeline.flown or pipeline.vehicle)
    check_before_long_work(pipeline.vehicle, conditions)
    make_map_parts(pipeline)
    vehicle = pipeline.flown or pipeline.vehicle
    for line in other_physics(vehicle):
        reporter.note(line)
    make_flows(pipeline, vehicle, effort)
    _scores(pipeline, vehicle, effort)
    entries = json.loads(pipeline.path(JSON).read_text(encoding="utf-8"))
    pipeline.make(
        CSV,
        "the same as a table",
        {"scores": entries},
        lambda path: write_bytes_atomically(path, table_csv(entries).encode()),
    )
    _figure(pipeline, entries)
    names = [name for name in (JSON, CSV, FIGURE) if pipeline.path(name).is_file()]
    return CompareResult(
        vehicle=vehicle.name,
        entries=entries,
        aims=aims(entries, is_shipped=vehicle_path.resolve() == IC3X.resolve()),
        files=[pipeline.path(name) for name in names],
    )


def _scores(pipeline: Pipeline, vehicle: Vehicle, effort: Effort) -> None:
    has_rivals = find_spec("sklearn") is not None
    if not has_rivals:
        pipeline.reporter.note(f"left out, they need strainfmu[rivals]: {', '.join(RIVALS)}")

    def write(path: Path) -> None:
        snapshots, structure = map_parts(pipeline)
        flights = flown_pair(pipeline, vehicle, structure, effort)
        trial = Trial(
            vehicle=vehicle,
            snapshots=snapshots,
            structure=structure,
            flown=flights.flown,
            example=flights.example,
            effort=effort,
            has_rivals=has_rivals,
        )
        entries = all_entries(trial, pipeline.reporter)
        write_bytes_atomically(path, (json.dumps(entries, indent=1, allow_nan=False) + "\n").encode())

    inputs: dict[str, Any] = {
        "version": VERSION,
        "snapshots": pipeline.made_from(SNAPSHOTS),
        "flows": pipeline.made_from(FLOWS),
        "structure": pipeline.made_from(STRUCTURE) if pipeline.vehicle.structure.model == "solid" else [],
        "effort": asdict(effort),
        "rivals": has_rivals,
        "vehicle": vehicle.model_dump(exclude={"description", "truth"}),
    }
    pipeline.make(JSON, "errors, coverage and cost of every estimator", inputs, write)


def table_csv(entries: list[dict[str, Any]]) -> str:
    """Return the table of ``compare.json`` as CSV: a row per estimator, errors and air-data inputs."""
    columns = {
        **{f"rms_{name}": ("rms", name) for name in entries[0]["rms"]},
        **{f"bound_{name}": ("bound", name) for name in entries[0]["bound"]},
        **{f"coverage_percent_{name}": ("coverage_percent", name) for name in entries[0]["coverage_percent"]},
        **{f"p95_{name}": ("air_data_p95", name) for name in AIR_DATA_KEYS},
    }
    plain = (
        "field_median_percent",
        "field_p95_percent",
        "example_field_p95_percent",
        "step_microseconds",
        "samples",
    )
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["estimator", "errors", "air_data_inputs", *columns, *plain, "navigation"])
    for one in entries:
        inner = [one[group][name] for group, name in columns.values()]
        known = one["air_data_inputs"]
        row = [one["estimator"], one["errors"], known, *inner, *(one[name] for name in plain), known]
        writer.writerow(["" if value is None else value for value in row])
    return stream.getvalue()


def _figure(pipeline: Pipeline, entries: list[dict[str, Any]]) -> None:
    if find_spec("matplotlib") is None:
        pipeline.reporter.note(f"{FIGURE}: not made, it needs strainfmu[report]")
        return
    name = pipeline.vehicle.name
    inputs = {"scores": entries, "title": name}
    shown = [one for one in entries if one["air_data_inputs"] == GIVEN]
    pipeline.make(FIGURE, "the same as a figure", inputs, lambda path: save(compare_figure(shown, name), path))
