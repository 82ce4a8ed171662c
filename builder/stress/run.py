"""The stress test from a vehicle file to its table: map, flows beyond the envelope, scores, figure."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from builder.campaign.journal import Journal
from builder.campaign.snapshots import load_snapshots
from builder.figures.comparison.stress import stress_figure
from builder.figures.drawing.canvas import save
from builder.pipeline.built_sensors import flown_sensors, sensor_names_of
from builder.pipeline.chosen_estimator import Estimators, with_estimator
from builder.pipeline.map_files import make_map, true_structure_of
from builder.pipeline.pipeline import FilesGiven, Pipeline
from builder.pipeline.shape_flows import make_shape_flows, shape_structure_of
from builder.pipeline.stages import check_before_long_work
from builder.pipeline.used_files import MAP, open_pipeline
from builder.reporting import Reporter
from builder.stress.flows import stress_flow_inputs, stress_flows
from builder.stress.kinds import all_kinds
from builder.stress.manoeuvre import manoeuvre_set
from builder.stress.manoeuvre_score import manoeuvre_scores, set_inputs
from builder.stress.model import Model, RevolvedModel, ShapeModel
from builder.stress.score import Effort, KindScore, Range
from builder.structure.fourier.model import place_layouts
from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.case import structure_case
from builder.truth.independent_model import other_physics, refuse_without_independent_model
from builder.truth.revolution import flow_table as flow_table_file
from builder.truth.revolution.flow_table import FlowTable, load_flow_table, save_flow_table
from builder.truth.revolution.flows import load_truth_flows
from builder.vehicle.file import Vehicle, load_vehicle
from builder.workspace import Workspace
from strainfmu.errors import FlowReachError, InputError
from strainfmu.estimator.map import inverse_map as inverse_map_file
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map
from strainfmu.estimator.map.validity import RECORDED_KEYS
from strainfmu.files import content_hash_of, write_bytes_atomically
from strainfmu.flight_condition import ALTITUDE, CONDITION_QUANTITIES, FlightCondition

FLOWS, JSON, CSV, FIGURE = "stress_flows.h5", "stress.json", "stress.csv", "stress.png"

VERSION = 5
"""Raised whenever the scores change otherwise than by their inputs, so that they are made again."""

CSV_COLUMNS = (
    *("error", "size", "class", "detected_percent", "undetected_percent", "wrong_percent", "samples", "missed"),
    *("flagged_percent", "silent_percent"),
    *(f"{key}_{name}" for key in ("rms", "bound") for name in COEFFICIENT_NAMES),
)
"""Columns of the table; the columns of flagged and silent samples repeat the fourth and fifth by former names."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StressResult:
    """The result of a stress test.

    Attributes
    ----------
    vehicle : name.
    entries : of ``stress.json``, in its order.
    files : that were made or are up to date.
    """

    vehicle: str
    entries: list[dict[str, Any]]
    files: list[Path]

    @property
    def missed(self) -> list[str]:
        """Targets that are not met, a line each."""
        return [f"{one['error']}, {one['size']}: {text}" for one in self.entries for text in one["missed"]]

    @property
    def largest_within(self) -> list[str]:
        """The largest fractions of the kinds within the envelope and stated sizes, a line each of two kinds."""
        within = [one for one in self.entries if one["class"] == "within"]
        lines = []
        for what in ("detected", "undetected"):
            largest = sorted(within, key=lambda one: -one[f"{what}_percent"])[:2]
            text = "; ".join(f"{one[f'{what}_percent']:.2f} % ({one['error']}, {one['size']})" for one in largest)
            lines.append(f"{what}, the largest of {len(within)} kinds within: {text}")
        return lines if within else []


def run_stress(
    vehicle_path: Path,
    folder: Path,
    reporter: Reporter,
    *,
    effort: Effort | None = None,
    map_path: Path | None = None,
    given: FilesGiven | None = None,
    estimator: Estimators | None = None,
    over_time: bool = False,
) -> StressResult:
    """Try every kind of error on a map; write ``stress.json``, ``stress.csv`` and ``stress.png`` to ``folder``.

    ``over_time`` flies the manoeuvres of ``manoeuvres.toml`` instead, of a body of revolution, and writes
    ``stress.json`` alone.

    The map is made by ``build`` in ``folder``, for ``estimator`` instead of the estimator of the section [map]
    unless it is None; or it is the one at ``map_path``. Errors are the independent model's; of a body of
    revolution its structure is the Fourier model whatever the map is built on, of any other shape another mesh.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong; the map does not fit the vehicle; or there is no
        independent model of it.
    StrainfmuError
        A file could not be written.
    """
    effort = effort or Effort()
    if map_path is None:
        vehicle = with_estimator(load_vehicle(vehicle_path), estimator)
        pipeline, conditions = open_pipeline(vehicle, folder, reporter, given or FilesGiven())
        _refuse_shape_over_time(pipeline.flown or pipeline.vehicle, over_time)
        refuse_without_independent_model(pipeline.flown or pipeline.vehicle)
        check_before_long_work(pipeline.vehicle, conditions)
        make_map(pipeline)
        inverse_map = load_inverse_map(pipeline.path(MAP))
        vehicle = of_estimator(pipeline.flown or pipeline.vehicle, inverse_map)
    else:
        inverse_map = load_inverse_map(map_path)
        vehicle = of_map(load_vehicle(vehicle_path), inverse_map)
        _refuse_shape_over_time(vehicle, over_time)
        refuse_without_independent_model(vehicle)
        check_fit(vehicle, inverse_map, map_path)
        pipeline = Pipeline(vehicle, Workspace(folder), reporter)
        pipeline.use(MAP, map_path, _content(map_path))
    for line in other_physics(vehicle):
        reporter.note(line)
    _flows(pipeline, vehicle, effort)
    if over_time:
        _manoeuvre_scores(pipeline, vehicle, inverse_map, effort)
        entries = json.loads(pipeline.path(JSON).read_text(encoding="utf-8"))
        return StressResult(vehicle=vehicle.name, entries=entries, files=[pipeline.path(JSON)])
    _scores(pipeline, vehicle, inverse_map, effort)
    entries = json.loads(pipeline.path(JSON).read_text(encoding="utf-8"))
    _table(pipeline, entries)
    _figure(pipeline, entries)
    names = [name for name in (JSON, CSV, FIGURE) if pipeline.path(name).is_file()]
    return StressResult(vehicle=vehicle.name, entries=entries, files=[pipeline.path(name) for name in names])


def _refuse_shape_over_time(vehicle: Vehicle, over_time: bool) -> None:
    if over_time and not vehicle.is_of_revolution:
        raise InputError(
            "stress: --flights: expected a body of revolution, got a shape that needs a flow for every sample"
        )


def _content(path: Path) -> str:
    """Return the content hash of a map, so that any change of it renews the scores."""
    return content_hash_of(path, inverse_map_file.SCHEMA, inverse_map_file.SCHEMA_VERSION)


def of_map(vehicle: Vehicle, inverse_map: InverseMap) -> Vehicle:
    """Return ``vehicle`` with the estimator of ``inverse_map`` and the flight conditions that it states."""
    held = inverse_map.provenance
    ranges = {
        one.column: sorted({(1e-3 if one.name == ALTITUDE else 1.0) * float(value) for value in held[key]})
        for one in CONDITION_QUANTITIES
        if isinstance(held.get(key := RECORDED_KEYS[one.name]), list)
    }
    conditions = vehicle.conditions.model_copy(update=ranges)
    absolute = inverse_map.form == "absolute"
    of_form = {} if absolute else {"gamma": 1.0}
    entries = vehicle.map.model_copy(update={"form": inverse_map.form, **of_form})
    return of_estimator(vehicle.model_copy(update={"conditions": conditions, "map": entries}), inverse_map)


def of_estimator(vehicle: Vehicle, inverse_map: InverseMap) -> Vehicle:
    """Return ``vehicle`` with the estimator of ``inverse_map``, which its file may leave to the build."""
    estimator = "linear" if inverse_map.manifold is None else "nonlinear"
    return vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"estimator": estimator})})


def vehicle_and_flows(
    vehicle_path: Path, inverse_map: InverseMap, map_path: Path, flows: Path
) -> tuple[Vehicle, FlowTable]:
    """Return the vehicle of ``inverse_map`` and the ``flows`` of its independent model.

    Raises
    ------
    InputError
        A file is missing or damaged, or the three do not belong together.
    """
    vehicle = of_map(load_vehicle(vehicle_path), inverse_map)
    check_fit(vehicle, inverse_map, map_path)
    return vehicle, load_truth_flows(flows, vehicle)


def _flows(pipeline: Pipeline, vehicle: Vehicle, effort: Effort) -> None:
    holds = "flows of the independent model beyond the envelope"
    if not vehicle.is_of_revolution:
        make_shape_flows(pipeline, vehicle, shape_conditions(vehicle, effort), FLOWS, holds)
        return

    def write(path: Path) -> None:
        with Journal(path) as journal:
            save_flow_table(stress_flows(vehicle, pipeline.reporter, journal), path)
            journal.remove()

    inputs = {"schema_version": flow_table_file.SCHEMA_VERSION, **stress_flow_inputs(vehicle)}
    pipeline.make(FLOWS, holds, inputs, write)


def shape_conditions(vehicle: Vehicle, effort: Effort) -> list[FlightCondition]:
    """Return a condition of every flow that the kinds of error of ``vehicle`` need, whatever its altitude."""
    sets = dict.fromkeys(kind.flights for kind in all_kinds(vehicle))
    flown = [one for draw in sets for one in draw(vehicle, None, effort.conditions, _generator(effort))]
    return list({(one.as_row()[:3], one.parameters): one for one in flown}.values())


def _generator(effort: Effort) -> np.random.Generator:
    return np.random.default_rng(effort.seed)


def _model(pipeline: Pipeline, vehicle: Vehicle) -> Model:
    path = pipeline.path(FLOWS)
    if vehicle.is_of_revolution:
        structure, table = true_structure_of(pipeline), load_flow_table(path)
        sensors = flown_sensors(vehicle, structure.surface)
        return RevolvedModel(vehicle=vehicle, structure=structure, table=table, sensors=sensors)
    return ShapeModel(vehicle=vehicle, structure=shape_structure_of(pipeline), flows=load_snapshots(path))


def _scores(pipeline: Pipeline, vehicle: Vehicle, inverse_map: InverseMap, effort: Effort) -> None:
    def write(path: Path) -> None:
        model = _model(pipeline, vehicle)
        trial = Range(vehicle=vehicle, model=model, inverse_map=inverse_map, effort=effort)
        entries = [score.entry() for score in scores(trial, pipeline.reporter)]
        write_bytes_atomically(path, (json.dumps(entries, indent=1, allow_nan=False) + "\n").encode())

    inputs = {
        "version": VERSION,
        "kinds": [(kind.error, kind.size, kind.group, kind.what) for kind in all_kinds(vehicle)],
        "map": _content(pipeline.path(MAP)),
        "flows": pipeline.made_from(FLOWS),
        "effort": asdict(effort),
        "vehicle": vehicle.model_dump(exclude={"description", "truth"}),
    }
    pipeline.make(JSON, "samples detected and undetected by health, of every kind of error", inputs, write)


def _manoeuvre_scores(pipeline: Pipeline, vehicle: Vehicle, inverse_map: InverseMap, effort: Effort) -> None:
    given = manoeuvre_set()

    def write(path: Path) -> None:
        model = _model(pipeline, vehicle)
        trial = Range(vehicle=vehicle, model=model, inverse_map=inverse_map, effort=effort)
        entries = [score.entry() for score in manoeuvre_scores(trial, given, pipeline.reporter)]
        write_bytes_atomically(path, (json.dumps(entries, indent=1, allow_nan=False) + "\n").encode())

    inputs = {
        "version": VERSION,
        "manoeuvres": set_inputs(given),
        "map": _content(pipeline.path(MAP)),
        "flows": pipeline.made_from(FLOWS),
        "effort": asdict(effort),
        "vehicle": vehicle.model_dump(exclude={"description", "truth"}),
    }
    pipeline.make(JSON, "samples detected and undetected by health, of every manoeuvre", inputs, write)


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
    for name, expected, found in (
        ("reference area [m2]", reference.area, inverse_map.reference_area),
        ("reference length [m]", reference.length, inverse_map.reference_length),
    ):
        if abs(found - expected) > 1e-6 * expected:
            raise InputError(f"{path}: {name}: expected {expected:.6g} of the vehicle, got {found:.6g}")


def scores(trial: Range, reporter: Reporter) -> list[KindScore]:
    """Return the score of every kind of error; a kind whose flights the flows do not reach is left out, with a
    note."""
    kinds = all_kinds(trial.vehicle)
    found = []
    with reporter.stage("Kinds of error") as progress:
        for done, kind in enumerate(kinds, start=1):
            try:
                found.append(trial.score(kind))
            except FlowReachError as error:
                reporter.note(f"{kind.error}, {kind.size}: left out: {error}")
            progress(done, len(kinds))
    return found


def table_csv(entries: list[dict[str, Any]]) -> str:
    """Return the table of ``stress.json`` as CSV: a row per kind of error."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for one in entries:
        of_loads = {f"{key}_{name}": value for key in ("rms", "bound") for name, value in one[key].items()}
        row = {**one, "missed": "; ".join(one["missed"]), **of_loads}
        writer.writerow(["" if row[name] is None else row[name] for name in CSV_COLUMNS])
    return stream.getvalue()


def _table(pipeline: Pipeline, entries: list[dict[str, Any]]) -> None:
    def write(path: Path) -> None:
        write_bytes_atomically(path, table_csv(entries).encode())

    pipeline.make(CSV, "the same as a table", {"scores": entries}, write)


def _figure(pipeline: Pipeline, entries: list[dict[str, Any]]) -> None:
    if find_spec("matplotlib") is None:
        pipeline.reporter.note(f"{FIGURE}: not made, it needs strainfmu[report]")
        return
    name = pipeline.vehicle.name
    inputs = {"scores": entries, "title": name}
    pipeline.make(FIGURE, "the same as a figure", inputs, lambda path: save(stress_figure(entries, name), path))
