"""The demonstration: all stages from a vehicle file to an FMU that flies in a system simulation.

Every stage writes a file into one folder. A stage whose inputs have not changed is not run again.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from builder.campaign.snapshot_transfer import snapshots_on
from builder.campaign.snapshots import load_snapshots
from builder.figures import demonstration as figures
from builder.figures.comparison.flown_estimators import estimator_errors
from builder.figures.drawing.canvas import save
from builder.pipeline.built_sensors import flown_sensors
from builder.pipeline.chosen_estimator import Estimators, with_estimator
from builder.pipeline.demonstration.as_built_demo import CALIBRATED, AsBuiltRun
from builder.pipeline.demonstration.common_files import (
    ESTIMATOR,
    FLIGHT,
    STEP_SIZE,
    digest_of,
    make_coefficients,
    make_estimator,
    make_flight,
    make_pictures,
)
from builder.pipeline.demonstration.flight_trial import (
    SCORE_VERSION,
    Flown,
    bound_in_flight,
    flown_estimators,
    score_flight,
)
from builder.pipeline.demonstration.free_demo import fly_free_shape
from builder.pipeline.demonstration.held_out_score import held_out_score
from builder.pipeline.demonstration.manoeuvre import manoeuvre_warnings
from builder.pipeline.map_files import (
    make_independent_flows,
    make_map,
    map_parts,
    solid_structure_of,
    true_structure_of,
)
from builder.pipeline.pipeline import FilesGiven, Pipeline
from builder.pipeline.stages import check_before_long_work
from builder.pipeline.used_files import FLOWS, MAP, SNAPSHOTS, open_pipeline
from builder.reporting import Reporter
from builder.structure.as_built.counts import counts_in_flight
from builder.structure.as_built.structure import refuse_beyond_calibration
from builder.structure.as_built.vehicle import AsBuilt, exactly_built
from builder.structure.as_built_kinds import IN_NOISE
from builder.structure.gauge_checks import gauge_roll_angles
from builder.trial.readings import ANGLES
from builder.truth.as_built import drawn
from builder.truth.independent_model import FlownPhysics, flown_physics, refuse_without_independent_model
from builder.truth.revolution.flight_tables import flight_model
from builder.truth.revolution.flow_table import load_flow_table
from builder.truth.revolution.flows import truth_knots
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.shape.geometry import surface_grid
from strainfmu.cosim.models import flight_model as flight_model_file
from strainfmu.cosim.models.flight_model import check_envelope, save_flight_model
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.cosim.systems.master import matching_connections, simulate
from strainfmu.cosim.systems.recording import Recording
from strainfmu.cosim.systems.system import System
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import Q_SOURCE, QSource
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map
from strainfmu.files import write_bytes_atomically
from strainfmu.fmu.export import export_plant

AS_BUILT_SEED = 1
"""Seed of the hardware errors of the vehicle that flies."""

HELD_OUT_VERSION = 3
"""Raised whenever the score on held-out conditions is another of the same files."""

MEASURED = {f"estimator.{Q_SOURCE}": float(QSource.INDEPENDENT)}
"""Start value of the flight, in which the dynamic pressure is a measurement of its own."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DemoResult:
    """The result of a demonstration.

    Attributes
    ----------
    vehicle : name of the vehicle.
    folder : where the files are.
    flight : duration and rate of the flight, in words.
    files : names of the files, in the order of the stages, with what each holds.
    reused : files that were up to date.
    physics : the flow model that flies, and the flow model of the map.
    score : accuracy of the flown FMU, as in ``summary.json``.
    held_out : of a map of imported results, the score on results that maps are made without, as in
        ``summary.json``; empty for others.
    errors_in_sigma : names of the errors that the stated sigmas hold.
    estimators : of a map with tables over the flight state, the accuracy of each estimator on the flown strains,
        by name, as in ``summary.json``; empty for others.
    states : of a vehicle that was tested on the ground, the accuracy of its map before and after the test and if
        all were known, by name, as in ``summary.json``; empty for others.
    """

    vehicle: str
    folder: Path
    flight: str
    files: dict[str, str]
    reused: tuple[str, ...]
    physics: FlownPhysics
    score: dict[str, Any]
    held_out: dict[str, Any]
    errors_in_sigma: tuple[str, ...]
    estimators: dict[str, Any]
    states: dict[str, Any]


def refuse_without_demo(vehicle: Vehicle) -> None:
    """Refuse a vehicle that no demonstration flies.

    Raises
    ------
    InputError
        Names the entry.
    """
    if vehicle.structure.external is not None:
        raise InputError(
            f"structure.{vehicle.structure.external}: no demonstration flies it, the vehicle that flies needs a "
            "wall of the vehicle file; `strainfmu build` makes its map"
        )
    refuse_without_independent_model(vehicle)


def run_demo(
    vehicle_path: Path,
    folder: Path,
    reporter: Reporter,
    given: FilesGiven | None = None,
    as_built: int | None = AS_BUILT_SEED,
    estimator: Estimators | None = None,
    ground_test: int | None = None,
) -> DemoResult:
    """Run all stages for one vehicle file and return the result; files as :func:`run_build` takes them.

    ``as_built`` is the seed that the hardware errors of the vehicle that flies are drawn with, at the sizes of the
    section [noise]; with None it is exactly the vehicle of the file. ``estimator`` replaces the entry of the
    section [map]. ``ground_test`` is the seed of a vehicle drawn from the section [calibration] instead, which is
    tested on the ground and flies with the map that the test calibrates.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong, or a condition is outside the solver's reach.
    StrainfmuError
        A file could not be written or an FMU failed.
    """
    vehicle = with_estimator(load_vehicle(vehicle_path), estimator)
    if vehicle.sensors is not None and ground_test is not None:
        raise InputError("sensors: expected none with --ground-test, whose test is of strain gauges alone")
    pipeline, conditions = open_pipeline(vehicle, folder, reporter, given or FilesGiven())
    vehicle = pipeline.vehicle
    check_before_long_work(vehicle, conditions)
    refuse_without_demo(vehicle)
    if ground_test is not None:
        refuse_beyond_calibration(vehicle, vehicle.gauges.layout)
    if not vehicle.is_of_revolution:
        return _free_demo(pipeline, as_built)
    manoeuvre = vehicle.manoeuvre()
    check_envelope(*truth_knots(vehicle), load_trajectory(manoeuvre), manoeuvre)
    make_map(pipeline)
    snapshots = load_snapshots(pipeline.path(SNAPSHOTS))
    of_revolution = snapshots.grid is not None
    flown = load_trajectory(manoeuvre)
    for warning in manoeuvre_warnings(vehicle, flown, snapshots.conditions(), of_revolution):
        reporter.note(warning)
    physics = flown_physics(vehicle, snapshots.engine)
    reporter.note(physics.sentence)
    run = (
        None if ground_test is None else AsBuiltRun(pipeline=pipeline, vehicle_path=vehicle_path, seed=ground_test)
    )
    if run is None:
        _flight_model(pipeline, vehicle_as_built(vehicle, as_built), as_built)
    else:
        run.make_test()
        run.make_maps()
        make_independent_flows(pipeline)
        run.make_flight_model()
    _fmus(pipeline, MAP if run is None else CALIBRATED, takes_zeros=run is not None)
    recording = _flight(pipeline, MEASURED | ({} if run is None else run.start_values()))
    held_out = _held_out(pipeline) if snapshots.engine == "table" else {}
    _figures(pipeline, recording, physics)
    estimators = _estimators(pipeline, recording, physics) if run is None else {}
    return _result(
        pipeline,
        load_inverse_map(pipeline.path(MAP if run is None else CALIBRATED)),
        recording,
        physics,
        held_out=held_out,
        estimators=estimators,
        states={} if run is None else run.score(recording),
    )


def _result(
    pipeline: Pipeline,
    inverse_map: InverseMap,
    recording: Recording,
    physics: FlownPhysics,
    *,
    held_out: dict[str, Any],
    estimators: dict[str, Any],
    states: dict[str, Any],
) -> DemoResult:
    """Score the flight of ``inverse_map``, write ``summary.json`` and return the result."""
    score = score_flight(recording, bound=bound_in_flight(inverse_map, recording))
    more = {"held_out": held_out, "physics": physics.record(), "estimators": estimators, "as_built": states}

    def make(path: Path) -> None:
        values = {**score, **{name: entry for name, entry in more.items() if entry}}
        write_bytes_atomically(path, json.dumps(values, indent=1, allow_nan=False).encode())

    inputs = {"version": SCORE_VERSION, "flight": pipeline.made_from(FLIGHT), **more}
    pipeline.make("summary.json", "accuracy of the flown FMU, as numbers", inputs, make)
    return DemoResult(
        vehicle=pipeline.vehicle.name,
        folder=pipeline.path("summary.json").parent,
        flight=f"{recording.time[-1]:.6g} s at {1.0 / STEP_SIZE:g} Hz",
        files=pipeline.files,
        reused=tuple(pipeline.reused),
        physics=physics,
        score=score,
        held_out=held_out,
        errors_in_sigma=errors_in_sigma(inverse_map),
        estimators=estimators,
        states=states,
    )


def _free_demo(pipeline: Pipeline, as_built: int | None) -> DemoResult:
    """Run the demonstration of a vehicle given by sections or by a surface."""
    vehicle = pipeline.vehicle
    recording = fly_free_shape(pipeline, vehicle_as_built(vehicle, as_built))
    snapshots = load_snapshots(pipeline.path(SNAPSHOTS))
    flown = load_trajectory(vehicle.manoeuvre(), tuple(vehicle.conditions.parameters))
    for warning in manoeuvre_warnings(vehicle, flown, snapshots.conditions(), False):
        pipeline.reporter.note(warning)
    physics, made = flown_physics(vehicle, vehicle.aerodynamics.engine), load_inverse_map(pipeline.path(MAP))
    return _result(pipeline, made, recording, physics, held_out={}, estimators={}, states={})


def _flight_model(pipeline: Pipeline, built: AsBuilt, seed: int | None) -> None:
    """Make the flight model of a vehicle as ``built``; ``seed`` draws the errors of its auxiliary sensors."""
    vehicle = pipeline.vehicle
    make_independent_flows(pipeline)

    def make(path: Path) -> None:
        noise_std = float(load_inverse_map(pipeline.path(MAP)).noise_std[0])
        flows, structure = load_flow_table(pipeline.path(FLOWS)), true_structure_of(pipeline)
        found = flown_sensors(vehicle, structure.surface)
        random = None if seed is None else np.random.default_rng([seed, 1])
        sensors = None if found is None else found.built(built, random)
        save_flight_model(flight_model(vehicle, flows, structure, built, noise_std, sensors), path)

    inputs = {
        "schema_version": flight_model_file.SCHEMA_VERSION,
        "map": pipeline.made_from(MAP),
        "flows": pipeline.made_from(FLOWS),
        "as built": built.record(IN_NOISE),
    }
    pipeline.make("flight_model.h5", "the vehicle that flies: the independent model, as built", inputs, make)


def errors_in_sigma(inverse_map: InverseMap) -> tuple[str, ...]:
    """Return the names of the errors that the sigmas of ``inverse_map`` hold, of the estimator it is for."""
    held = inverse_map.provenance
    names = [term["name"] for term in held.get("noise_terms", [])]
    if inverse_map.manifold is not None:
        of_tables = [term["name"] for term in held.get("table_error_terms", [])]
        names = [name for name in names if name not in ("truncated modes", *of_tables)] + of_tables
    terms = tuple(names)
    return (*terms, "dynamic pressure") if inverse_map.dynamic_pressure_error > 0.0 else terms


def vehicle_as_built(vehicle: Vehicle, seed: int | None) -> AsBuilt:
    """Return the hardware errors of the vehicle that flies, drawn with ``seed``; none for None."""
    counts = counts_in_flight(vehicle, gauge_roll_angles(vehicle))
    if seed is None:
        return exactly_built(counts)
    return drawn(vehicle.noise, counts, np.random.default_rng(seed))


def _fmus(pipeline: Pipeline, map_name: str, takes_zeros: bool) -> None:
    """Package the map ``map_name``, with inputs for zero offsets where a ground test gives some, and the plant."""
    trajectory = pipeline.vehicle.manoeuvre()
    with pipeline.reporter.stage("FMUs") as progress:
        make_estimator(pipeline, map_name, takes_zeros)
        progress(1, 2)
        pipeline.make(
            "plant.fmu",
            "FMI 2.0 co-simulation FMU: the vehicle on its manoeuvre, noisy strains out",
            {
                "flight_model": pipeline.made_from("flight_model.h5"),
                "trajectory": trajectory.read_bytes().hex(),
                "library": digest_of("plant"),
            },
            lambda path: export_plant(pipeline.path("flight_model.h5"), trajectory, path),
        )
        progress(2, 2)


def _flight(pipeline: Pipeline, start_values: dict[str, float]) -> Recording:
    stop_time = load_trajectory(pipeline.vehicle.manoeuvre()).stop_time
    fmus = {name: pipeline.path(f"{name}.fmu") for name in ("plant", "estimator")}

    def fly() -> Recording:
        system = System(fmus, matching_connections("plant", "estimator", fmus), start_values)
        with pipeline.reporter.stage("System simulation: plant -> estimator") as progress:
            return simulate(
                system, stop_time, STEP_SIZE, progress=lambda time: progress(round(100 * time / stop_time), 100)
            )

    inputs = {
        "fmus": pipeline.made_from("plant.fmu", ESTIMATOR),
        "step": STEP_SIZE,
        "start": start_values,
    }
    return make_flight(pipeline, "every signal of the system simulation", inputs, fly)


def _held_out(pipeline: Pipeline) -> dict[str, Any]:
    """Return the score on results that maps are made without; empty where there are too few results."""

    def make(path: Path) -> None:
        flies = load_inverse_map(pipeline.path(MAP))
        vehicle = with_estimator(pipeline.vehicle, "linear" if flies.manifold is None else "nonlinear")
        snapshots, structure = map_parts(pipeline)
        found = held_out_score(vehicle, snapshots, structure, pipeline.reporter, solid_structure_of(pipeline))
        write_bytes_atomically(path, json.dumps(found or {}, indent=1, allow_nan=False).encode())

    inputs = {
        "map": pipeline.made_from(MAP),
        "snapshots": pipeline.made_from(SNAPSHOTS),
        "version": HELD_OUT_VERSION,
    }
    pipeline.make("held_out.json", "accuracy on imported results that maps are made without", inputs, make)
    entries: dict[str, Any] = json.loads(pipeline.path("held_out.json").read_text(encoding="utf-8"))
    if not entries:
        pipeline.reporter.note("no score on held-out conditions: there are too few imported results")
    for line in entries.get("not_built", []):
        pipeline.reporter.note(f"held-out conditions: no map without {line}")
    return entries


def _title(pipeline: Pipeline, physics: FlownPhysics) -> str:
    """Return the title of figures of the flight."""
    return pipeline.vehicle.name + ("" if physics.is_that_of_map else f" (flies {physics.model})")


def _figures(pipeline: Pipeline, recording: Recording, physics: FlownPhysics) -> None:
    vehicle, settings = pipeline.vehicle, pipeline.vehicle.resolution.map
    surface = surface_grid(vehicle.body(), settings.surface_stations, settings.surface_roll_angles)
    snapshots = snapshots_on(load_snapshots(pipeline.path(SNAPSHOTS)), surface)
    inverse_map = load_inverse_map(pipeline.path(MAP))
    title = vehicle.name
    of_flight = _title(pipeline, physics)
    of_pressure = {"snapshots": pipeline.made_from(SNAPSHOTS), "title": title}
    of_all = {
        **of_pressure,
        "title": of_flight,
        "map": pipeline.made_from(MAP),
        "flight": pipeline.made_from(FLIGHT),
    }
    drawings: list[tuple[str, str, dict[str, Any], Callable[[], figures.Figure]]] = [
        (
            "overview.png",
            "figure: load, gauges and estimate in one picture",
            of_all,
            lambda: figures.overview(snapshots, surface, inverse_map, recording, of_flight),
        ),
        (
            "pressure_unrolled.png",
            "figure: pressure of three conditions on the unrolled surface",
            of_pressure,
            lambda: figures.pressure_unrolled(snapshots, surface, title),
        ),
        (
            "pressure_on_body.png",
            "figure: the same on the body",
            of_pressure,
            lambda: figures.pressure_on_body(snapshots, surface, title),
        ),
        (
            "gauges.png",
            "figure: gauge layout",
            {"map": pipeline.made_from(MAP)},
            lambda: figures.gauges(inverse_map, surface),
        ),
    ]
    with pipeline.reporter.stage("Figures") as progress:
        for done, (name, holds, inputs, draw) in enumerate(drawings, start=1):
            pipeline.make(name, holds, inputs, partial(_save, draw))
            progress(done, len(drawings))
        make_coefficients(pipeline, recording, of_flight)
        make_pictures(pipeline)


def _estimators(pipeline: Pipeline, recording: Recording, physics: FlownPhysics) -> dict[str, Any]:
    """Fly both estimators of a map with tables on the same strains; return their accuracy, empty for others."""
    inverse_map = load_inverse_map(pipeline.path(MAP))
    if inverse_map.manifold is None:
        return {}

    def make(path: Path) -> None:
        with pipeline.reporter.stage("Linear and nonlinear estimator on the same strains"):
            flown = flown_estimators(inverse_map, recording, estimator="estimator")
        entries = {name: of_flight.entry() for name, of_flight in flown.items()}
        write_bytes_atomically(path, json.dumps(entries, indent=1, allow_nan=False).encode())
        save(_errors_figure(recording, flown, _title(pipeline, physics)), path.with_suffix(".png"))

    inputs = {
        "map": pipeline.made_from(MAP),
        "flight": pipeline.made_from(FLIGHT),
        "version": SCORE_VERSION,
    }
    holds = "linear and nonlinear estimator on the same strains, as numbers (and as a figure, estimators.png)"
    pipeline.make("estimators.json", holds, inputs, make)
    entries: dict[str, Any] = json.loads(pipeline.path("estimators.json").read_text(encoding="utf-8"))
    return entries


def _errors_figure(recording: Recording, flown: dict[str, Flown], title: str) -> figures.Figure:
    errors = {name: (of_flight.error, of_flight.made.std) for name, of_flight in flown.items()}
    angles = slice(len(COEFFICIENT_NAMES), len(COEFFICIENT_NAMES) + len(ANGLES))
    error, std = (part[:, angles] for part in errors["nonlinear"])
    return estimator_errors(recording.time, errors, (error, std), title)


def _save(draw: Callable[[], figures.Figure], path: Path) -> None:
    save(draw(), path)
