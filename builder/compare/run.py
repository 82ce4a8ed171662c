"""The comparison from a vehicle file to its table: maps, flows, estimators, scores, figure."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from builder.campaign.journal import Journal
from builder.campaign.snapshots import Snapshots
from builder.compare.aims import Aim, aims
from builder.compare.candidate import (
    GIVEN,
    NAVIGATION,
    NO_DYNAMIC_PRESSURE,
    Candidate,
    LinearCandidate,
    ManifoldCandidate,
)
from builder.compare.field import table_field, true_field
from builder.compare.flights import (
    ERRORS,
    Effort,
    altitudes,
    random_conditions,
    readings,
    vehicle_that_flies,
    with_errors,
)
from builder.compare.random_walk import RandomWalkCandidate
from builder.compare.rivals import RIVALS, RivalCandidate
from builder.compare.score import AIR_DATA_KEYS, scored
from builder.compare.training import training_flights
from builder.figures.canvas import save
from builder.figures.compare import compare_figure
from builder.inverse.build import AnyStructure, build_inverse_map, inverse_problem
from builder.manifold.build import with_manifold
from builder.pipeline.map_files import make_map_parts, map_parts, true_structure_of
from builder.pipeline.pipeline import FilesGiven, Pipeline
from builder.pipeline.stages import check_before_long_work
from builder.pipeline.used_files import SNAPSHOTS, STRUCTURE, open_pipeline
from builder.reporting import Reporter
from builder.structure.fourier.model import refuse_beyond_fourier
from builder.truth import flow_table as flow_table_file
from builder.truth.flow_table import FlowTable, load_flow_table, save_flow_table
from builder.truth.flows import independent_flows, truth_inputs
from builder.truth.strain import TrueFlights, TrueStructure, true_flights, without_faint_harmonics
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.inverse_map import COEFFICIENT_NAMES
from strainfmu.files import write_bytes_atomically

FLOWS, JSON, CSV, FIGURE = "compare_flows.h5", "compare.json", "compare.csv", "compare.png"

VERSION = 1
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

    Readings are those of the independent model, whose structure is the Fourier model whatever the maps are built
    on. Without scikit-learn its estimators are left out, with a note.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong; the body is no body of revolution; or the independent model
        cannot represent it.
    StrainfmuError
        A file could not be written.
    """
    effort = effort or Effort()
    pipeline, conditions = open_pipeline(load_vehicle(vehicle_path), folder, reporter, given or FilesGiven())
    refuse_beyond_fourier(pipeline.vehicle, [pipeline.vehicle.gauges.layout])
    check_before_long_work(pipeline.vehicle, conditions)
    make_map_parts(pipeline)
    vehicle = pipeline.flown or pipeline.vehicle
    _flows(pipeline, vehicle)
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


def _flows(pipeline: Pipeline, vehicle: Vehicle) -> None:
    flies = vehicle_that_flies(vehicle)

    def write(path: Path) -> None:
        with Journal(path) as journal:
            save_flow_table(independent_flows(flies, pipeline.reporter, journal), path)
            journal.remove()

    inputs = {"schema_version": flow_table_file.SCHEMA_VERSION, **truth_inputs(flies)}
    pipeline.make(FLOWS, "flows of the independent model between the conditions of the map", inputs, write)


def _scores(pipeline: Pipeline, vehicle: Vehicle, effort: Effort) -> None:
    has_rivals = find_spec("sklearn") is not None
    if not has_rivals:
        pipeline.reporter.note(f"left out, they need strainfmu[rivals]: {', '.join(RIVALS)}")

    def write(path: Path) -> None:
        snapshots, structure = map_parts(pipeline)
        trial = Trial(
            vehicle=vehicle,
            snapshots=snapshots,
            structure=structure,
            truth=true_structure_of(pipeline),
            table=load_flow_table(pipeline.path(FLOWS)),
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """What every estimator of a comparison is made from and scored on.

    Attributes
    ----------
    snapshots, structure : of the maps.
    truth, table : structure and flows of the independent model.
    has_rivals : whether scikit-learn is there.
    """

    vehicle: Vehicle
    snapshots: Snapshots
    structure: AnyStructure
    truth: TrueStructure
    table: FlowTable
    effort: Effort
    has_rivals: bool


def all_entries(trial: Trial, reporter: Reporter) -> list[dict[str, Any]]:
    """Return the entries of every estimator under both kinds of error; errors as :func:`run_compare`."""
    vehicle, effort, grid = trial.vehicle, trial.effort, trial.structure.surface
    if not isinstance(grid, SurfaceGrid):
        raise InputError("compare: expected a body of revolution with rings of nodes, got a free surface")
    random = np.random.default_rng(effort.seed)
    conditions = random_conditions(vehicle, effort.conditions, random)
    flights = without_faint_harmonics(
        true_flights(vehicle=vehicle, structure=trial.truth, table=trial.table, conditions=conditions)
    )
    field = true_field(table=trial.table, of_table=trial.truth.surface, grid=grid, conditions=flights.conditions)
    entries: list[dict[str, Any]] = []
    for number, errors in enumerate(ERRORS):
        found = _entries_with(
            trial=trial,
            errors=errors,
            flown=(flights, field),
            random=np.random.default_rng([effort.seed, number]),
            reporter=reporter,
        )
        entries += [{"estimator": one["estimator"], "errors": errors, **one} for one in found]
    return entries


def _entries_with(
    trial: Trial,
    errors: str,
    flown: tuple[TrueFlights, FloatArray],
    random: np.random.Generator,
    reporter: Reporter,
) -> list[dict[str, Any]]:
    flights, field = flown
    with reporter.stage(f"Estimators, {errors}: maps and training") as progress:
        candidates = candidates_of(trial=trial, errors=errors, random=random, progress=progress)
    read = readings(
        trial.vehicle,
        trial.truth,
        flights,
        errors=errors,
        noise_std=_noise_std(candidates),
        draws=trial.effort.draws,
        random=random,
    )
    entries: list[dict[str, Any]] = []
    with reporter.stage(f"Estimators, {errors}: flights") as progress:
        for done, found in enumerate(
            scored(candidates=candidates, read=read, flights=flights, true_field=field), start=1
        ):
            entries = found
            progress(done, trial.effort.draws)
    return entries


def _noise_std(candidates: list[tuple[Candidate, str]]) -> FloatArray:
    first = candidates[0][0]
    assert isinstance(first, LinearCandidate)
    return first.inverse_map.noise_std


def candidates_of(
    trial: Trial, errors: str, random: np.random.Generator, progress: Callable[[int, int], None]
) -> list[tuple[Candidate, str]]:
    """Return every estimator with each navigation, linear maps first, all of them knowing of ``errors``."""
    of, rivals = 4 + len(NAVIGATION) * len(RIVALS) * trial.has_rivals, RIVALS if trial.has_rivals else {}
    of_case = {case: with_errors(trial.vehicle, errors, case) for case in (1, 2)}
    maps = {case: build_inverse_map(one, trial.snapshots, trial.structure) for case, one in of_case.items()}
    progress(2, of)
    full = with_manifold(
        inverse_map=maps[1], vehicle=of_case[1], snapshots=trial.snapshots, structure=trial.structure
    )
    problem = inverse_problem(of_case[1], trial.snapshots, trial.structure)
    field = table_field(vehicle=of_case[1], snapshots=trial.snapshots, structure=trial.structure, problem=problem)
    manifold = ManifoldCandidate(full, field)
    known: list[Candidate] = [
        LinearCandidate("linear Case 1", maps[1]),
        LinearCandidate("linear Case 2", maps[2]),
        manifold,
        RandomWalkCandidate(maps[2]),
    ]
    found = [(one, navigation) for one in known for navigation in NAVIGATION]
    found.append((manifold, NO_DYNAMIC_PRESSURE))
    progress(4, of)
    assert full.manifold is not None
    count = trial.effort.training
    training, calibration = (
        training_flights(manifold=full.manifold, altitudes=altitudes(trial.vehicle), count=n, random=random)
        for n in (count, count // 3)
    )
    for done, (name, navigation) in enumerate(
        ((name, navigation) for name in rivals for navigation in NAVIGATION), start=5
    ):
        rival = RivalCandidate(
            name=name,
            training=training,
            calibration=calibration,
            navigation=navigation,
            seed=trial.effort.seed,
        )
        found.append((rival, navigation))
        progress(done, of)
    return found


def table_csv(entries: list[dict[str, Any]]) -> str:
    """Return the table of ``compare.json`` as CSV: a row per estimator, errors and navigation."""
    columns = {
        **{f"rms_{name}": ("rms", name) for name in COEFFICIENT_NAMES},
        **{f"coverage_percent_{name}": ("coverage_percent", name) for name in COEFFICIENT_NAMES},
        **{f"p95_{name}": ("air_data_p95", name) for name in AIR_DATA_KEYS},
    }
    plain = ("field_median_percent", "field_p95_percent", "step_microseconds", "samples")
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["estimator", "errors", "navigation", *columns, *plain])
    for one in entries:
        inner = [one[group][name] for group, name in columns.values()]
        row = [one["estimator"], one["errors"], one["navigation"], *inner, *(one[name] for name in plain)]
        writer.writerow(["" if value is None else value for value in row])
    return stream.getvalue()


def _figure(pipeline: Pipeline, entries: list[dict[str, Any]]) -> None:
    if find_spec("matplotlib") is None:
        pipeline.reporter.note(f"{FIGURE}: not made, it needs strainfmu[report]")
        return
    name = pipeline.vehicle.name
    inputs = {"scores": entries, "title": name}
    shown = [one for one in entries if one["navigation"] == GIVEN]
    pipeline.make(FIGURE, "the same as a figure", inputs, lambda path: save(compare_figure(shown, name), path))
