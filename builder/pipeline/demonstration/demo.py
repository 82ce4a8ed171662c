"""The demonstration: all stages from a vehicle file to an FMU that flies in a system simulation.

Every stage writes a file into one folder. A stage whose inputs have not changed is not run again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from builder.campaign.snapshots import load_snapshots, snapshots_on
from builder.figures import demonstration as figures
from builder.figures.comparison import estimator_errors
from builder.figures.drawing import save
from builder.pipeline.demonstration.as_built_demo import CALIBRATED, AsBuiltRun
from builder.pipeline.demonstration.flight_scores import (
    SCORE_VERSION,
    flown_estimators,
    held_out_score,
    score_flight,
)
from builder.pipeline.demonstration.flown_shape import (
    ESTIMATOR,
    FLIGHT,
    FLIGHT_MODEL,
    PLANT,
    STEP_SIZE,
    checked_manoeuvre,
    digest_of,
    fly_free_shape,
    make_coefficients,
    make_estimator,
    make_figure,
    make_flight,
    make_flight_model,
    make_numbers,
    make_pictures,
    manoeuvre_warnings,
)
from builder.pipeline.estimator_choice import estimator_of, with_estimator
from builder.pipeline.map_files import make_map, map_parts, solid_structure_of, true_structure_of
from builder.pipeline.pipeline import MAP, SNAPSHOTS, FilesGiven, Pipeline, open_pipeline
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.pipeline.stages import check_before_long_work
from builder.structure.as_built.as_built_structure import refuse_unheld
from builder.structure.as_built.as_built_vehicle import AsBuilt, exactly_built
from builder.structure.as_built.wall_regions import counts_of
from builder.structure.as_built_kinds import IN_NOISE
from builder.structure.gauge_checks import gauge_roll_angles
from builder.trial.readings import ANGLES
from builder.truth.flights import FlownPhysics, drawn_vehicle, flown_physics
from builder.truth.shape import refuse_without_independent_model
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.shape.geometry import surface_grid
from strainfmu.cosim.models.trajectory import Trajectory
from strainfmu.cosim.systems.master import matching_connections, simulate
from strainfmu.cosim.systems.recording import Recording
from strainfmu.cosim.systems.system import System
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import Q_SOURCE, QSource
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map
from strainfmu.fmu.export import export_plant

if TYPE_CHECKING:
    from builder.pipeline.demonstration.bus_flight import BusFlight

AS_BUILT_SEED = 1
"""Seed of the hardware errors of the vehicle that flies."""

HELD_OUT_VERSION = 4
"""Raised whenever the score on held-out conditions is another of the same files."""


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
    errors_in_sigma : names of the errors that the stated sigmas include.
    summary : ``summary.json``: accuracy of the flown FMU; where there are any, ``held_out`` on imported results
        that maps are made without, ``estimators`` of a map with tables on the flown strains, and ``as_built``, the
        map of a vehicle that was tested on the ground before and after the test and if all were known.
    over_bus : the flight over a CAN bus; None without one.
    """

    vehicle: str
    folder: Path
    flight: str
    files: dict[str, str]
    reused: tuple[str, ...]
    physics: FlownPhysics
    errors_in_sigma: tuple[str, ...]
    summary: dict[str, Any]
    over_bus: BusFlight | None = None


def refuse_without_demo(vehicle: Vehicle) -> None:
    """Refuse a vehicle that no demonstration flies."""
    if vehicle.structure.external is not None:
        raise InputError(
            f"structure.{vehicle.structure.external}: no demonstration flies it, the vehicle that flies needs a "
            "wall of the vehicle file; `strainfmu build` makes its map"
        )
    refuse_without_independent_model(vehicle)


def demo(
    output: str | Path = "demo",
    vehicle: str | Path | None = None,
    *,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    rebuild: bool = False,
    perfect: bool = False,
    as_built: int | None = None,
    estimator: Literal["auto", "linear", "nonlinear"] | None = None,
    can: bool = False,
    can_duration: float = 20.0,
    can_authenticated: bool = False,
    progress: AnyProgress = None,
) -> DemoResult:
    """Build the map of a vehicle, package it as an FMU, and fly the FMU in a system simulation.

    Solves the flow, builds the inverse map, exports the FMU and flies it against the truth model of the vehicle.
    The vehicle flown has installation errors: gains, gauge places, wall and more are drawn at their specified
    sizes. A second run reuses the files that are up to date.

    Prints the accuracy in about a dozen lines. README.txt of the folder has the stages, notes, detection
    thresholds and files.

    On the command line::

        strainfmu demo
        strainfmu demo -o results --vehicle my_vehicle.toml
        strainfmu demo --perfect
        strainfmu demo --as-built 7 -o tested
        strainfmu demo --estimator linear -o linear
        strainfmu demo --can

    Parameters
    ----------
    output : folder for the results.
    vehicle : vehicle file (TOML). Default: the IC3X surrogate that is shipped.
    snapshots, structure, rebuild : as :func:`build` takes them.
    perfect : fly the vehicle of the file, without installation errors. Not with ``as_built``.
    as_built : seed: draw a vehicle within tolerances, test it on the ground, calibrate, fly; not with ``perfect``.
    estimator : estimator, instead of the vehicle file's.
    can : fly once more over a CAN bus: sender and bridge as two processes.
    can_duration : with ``can``: duration of that flight [s].
    can_authenticated : with ``can``: profile fd64-sec, with a key made for that flight.
    progress : True for progress bars.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong, or a condition is outside the solver's reach.
    StrainfmuError
        A file could not be written or an FMU failed.
    """
    path, reporter, ground_test = Path(vehicle or IC3X), reporter_of(progress), as_built
    seed = None if perfect else AS_BUILT_SEED
    loaded = with_estimator(load_vehicle(path), estimator)
    if loaded.sensors is not None and ground_test is not None:
        raise InputError("sensors: expected none with --as-built, whose test is of strain gauges alone")
    files_given = FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild)
    pipeline, conditions = open_pipeline(loaded, Path(output), reporter, files_given)
    if can:
        from builder.pipeline.demonstration.bus_flight import (
            CYCLE_TIME,
            check_multicast,
            fly_over_bus,
            private_port,
        )

        check_multicast(private_port())  # refused before the long work, not after it
    result = _flown(pipeline, conditions, path, seed, ground_test)
    if not can:
        return result
    with reporter.stage(f"CAN bus: sender -> bridge, {can_duration:g} s at {1.0 / CYCLE_TIME:g} Hz"):
        return replace(result, over_bus=fly_over_bus(Path(output), can_duration, can_authenticated))


def _flown(
    pipeline: Pipeline, conditions: int | None, vehicle_path: Path, as_built: int | None, ground_test: int | None
) -> DemoResult:
    vehicle, reporter = pipeline.vehicle, pipeline.reporter
    check_before_long_work(vehicle, conditions)
    refuse_without_demo(vehicle)
    if ground_test is not None:
        refuse_unheld(vehicle, vehicle.gauges.layout)
    of_revolution = vehicle.is_axisymmetric
    path = checked_manoeuvre(vehicle, (pipeline.flown or vehicle).flight_conditions())
    make_map(pipeline)
    snapshots = load_snapshots(pipeline.path(SNAPSHOTS))
    is_rolled = of_revolution and snapshots.grid is not None
    for warning in manoeuvre_warnings(vehicle, path, snapshots.conditions(), is_rolled):
        reporter.note(warning)
    physics = flown_physics(vehicle, snapshots.engine if of_revolution else vehicle.aerodynamics.engine)
    if not of_revolution:
        recording = fly_free_shape(pipeline, path, vehicle_as_built(vehicle, as_built))
        return _result(pipeline, MAP, recording, physics)
    reporter.note(physics.sentence)
    if ground_test is None:
        flown_vehicle = vehicle_as_built(vehicle, as_built)
        inputs, seed = {"as built": flown_vehicle.record(IN_NOISE)}, None if as_built is None else [as_built, 1]
        make_flight_model(pipeline, inputs, lambda: true_structure_of(pipeline), flown_vehicle, seed)
        recording = _flight(pipeline, MAP, path, {})
    else:
        run = AsBuiltRun(pipeline=pipeline, vehicle_path=vehicle_path, seed=ground_test)
        run.make_test()
        run.make_maps()
        make_flight_model(pipeline, run.inputs, lambda: run.truth, run.flown_vehicle)
        recording = _flight(pipeline, CALIBRATED, path, run.start_values())
    more = {"held_out": _held_out(pipeline) if snapshots.engine == "table" else {}}
    title = vehicle.name + ("" if physics.is_that_of_map else f" (flies {physics.model})")
    _figures(pipeline, recording, title)
    if ground_test is None:
        more["estimators"] = _estimators(pipeline, recording, title)
        return _result(pipeline, MAP, recording, physics, **more)
    return _result(pipeline, CALIBRATED, recording, physics, **more, as_built=run.score(recording))


def _result(
    pipeline: Pipeline, map_name: str, recording: Recording, physics: FlownPhysics, **more: dict[str, Any]
) -> DemoResult:
    """Score the flight of the map ``map_name``, write ``summary.json`` with what is known ``more``, and return the
    result."""
    inverse_map = load_inverse_map(pipeline.path(map_name))
    more = {"physics": physics.record(), **{name: entries for name, entries in more.items() if entries}}
    inputs = pipeline.inputs(FLIGHT, version=SCORE_VERSION, **more)
    holds = "accuracy of the flown FMU, as numbers"
    summary = make_numbers(
        pipeline, "summary.json", holds, inputs, lambda: {**score_flight(recording, inverse_map), **more}
    )
    return DemoResult(
        vehicle=pipeline.vehicle.name,
        folder=pipeline.path("summary.json").parent,
        flight=f"{recording.time[-1]:.6g} s at {1.0 / STEP_SIZE:g} Hz",
        files=pipeline.files,
        reused=tuple(pipeline.reused),
        physics=physics,
        errors_in_sigma=errors_in_sigma(inverse_map),
        summary=summary,
    )


def errors_in_sigma(inverse_map: InverseMap) -> tuple[str, ...]:
    """Return the names of the errors that the sigmas of ``inverse_map`` hold, of the estimator it is for."""
    provenance = inverse_map.provenance
    names = [term["name"] for term in provenance.get("noise_terms", [])]
    if inverse_map.manifold is not None:
        of_tables = [term["name"] for term in provenance.get("table_error_terms", [])]
        names = [name for name in names if name not in ("truncated modes", *of_tables)] + of_tables
    terms = tuple(names)
    return (*terms, "dynamic pressure") if inverse_map.dynamic_pressure_error > 0.0 else terms


def vehicle_as_built(vehicle: Vehicle, seed: int | None) -> AsBuilt:
    """Return the hardware errors of the vehicle that flies, drawn with ``seed``; none for None."""
    counts = counts_of(vehicle, gauge_roll_angles(vehicle), in_flight=True)
    if seed is None:
        return exactly_built(counts)
    return drawn_vehicle(vehicle.noise, counts, np.random.default_rng(seed))


def _flight(pipeline: Pipeline, map_name: str, path: Trajectory, zeros: dict[str, float]) -> Recording:
    """Package the map ``map_name``, with inputs for ``zeros`` where a ground test gives some, and the plant; fly
    both. The dynamic pressure is a measurement of its own."""
    manoeuvre, stop_time = pipeline.vehicle.manoeuvre(), path.stop_time
    with pipeline.reporter.stage("FMUs") as progress:
        make_estimator(pipeline, map_name, takes_zeros=bool(zeros))
        progress(1, 2)
        pipeline.make(
            PLANT,
            "FMI 2.0 co-simulation FMU: the vehicle on its manoeuvre, noisy strains out",
            pipeline.inputs(FLIGHT_MODEL, trajectory=manoeuvre.read_bytes().hex(), library=digest_of("plant")),
            lambda path: export_plant(pipeline.path(FLIGHT_MODEL), manoeuvre, path),
        )
        progress(2, 2)
    fmus = {"plant": pipeline.path(PLANT), "estimator": pipeline.path(ESTIMATOR)}
    start_values = {f"estimator.{Q_SOURCE}": float(QSource.INDEPENDENT), **zeros}

    def fly() -> Recording:
        system = System(fmus, matching_connections("plant", "estimator", fmus), start_values)
        with pipeline.reporter.stage("System simulation: plant -> estimator") as progress:
            return simulate(
                system, stop_time, STEP_SIZE, progress=lambda time: progress(round(100 * time / stop_time), 100)
            )

    inputs = {"fmus": pipeline.made_from(PLANT, ESTIMATOR), "step": STEP_SIZE, "start": start_values}
    return make_flight(pipeline, "every signal of the system simulation", inputs, fly)


def _held_out(pipeline: Pipeline) -> dict[str, Any]:
    """Return the score on results that maps are made without; empty where there are too few results."""

    def score() -> dict[str, Any]:
        vehicle = with_estimator(pipeline.vehicle, estimator_of(load_inverse_map(pipeline.path(MAP))))
        snapshots, structure = map_parts(pipeline)
        return held_out_score(vehicle, snapshots, structure, pipeline.reporter, solid_structure_of(pipeline)) or {}

    inputs = pipeline.inputs(MAP, SNAPSHOTS, version=HELD_OUT_VERSION)
    holds = "accuracy on imported results that maps are made without"
    entries = make_numbers(pipeline, "held_out.json", holds, inputs, score)
    if not entries:
        pipeline.reporter.note("no score on held-out conditions: there are too few imported results")
    for line in entries.get("not_built", []):
        pipeline.reporter.note(f"held-out conditions: no map without {line}")
    return entries


def _figures(pipeline: Pipeline, recording: Recording, of_flight: str) -> None:
    vehicle, settings = pipeline.vehicle, pipeline.vehicle.resolution.map
    surface = surface_grid(vehicle.body(), *settings.surface_nodes)
    snapshots = snapshots_on(load_snapshots(pipeline.path(SNAPSHOTS)), surface)
    inverse_map = load_inverse_map(pipeline.path(MAP))
    title = vehicle.name
    of_pressure = pipeline.inputs(SNAPSHOTS, title=title)
    of_all = pipeline.inputs(SNAPSHOTS, MAP, FLIGHT, title=of_flight)
    overview = partial(figures.overview, snapshots, surface, inverse_map, recording, of_flight)
    on_body = partial(figures.pressure_on_body, snapshots, surface, title)
    with pipeline.reporter.stage("Figures"):
        make_figure(pipeline, "overview.png", "load, gauges and estimate in one picture", of_all, overview)
        holds = "pressure of three conditions on the body"
        make_figure(pipeline, "pressure_on_body.png", holds, of_pressure, on_body)
        gauges = partial(figures.gauges, inverse_map, surface)
        make_figure(pipeline, "gauges.png", "gauge layout", pipeline.inputs(MAP), gauges)
        make_coefficients(pipeline, recording, of_flight)
        make_pictures(pipeline)


def _estimators(pipeline: Pipeline, recording: Recording, title: str) -> dict[str, Any]:
    """Fly both estimators of a map with tables on the same strains; return their accuracy, empty for others."""
    inverse_map = load_inverse_map(pipeline.path(MAP))
    if inverse_map.manifold is None:
        return {}

    def entries() -> dict[str, Any]:
        with pipeline.reporter.stage("Linear and nonlinear estimator on the same strains"):
            flown = flown_estimators(inverse_map, recording, estimator="estimator")
        errors = {name: (of_flight.error, of_flight.made.std) for name, of_flight in flown.items()}
        angles = slice(len(COEFFICIENT_NAMES), len(COEFFICIENT_NAMES) + len(ANGLES))
        error, std = (part[:, angles] for part in errors["nonlinear"])
        figure = estimator_errors(recording.time, errors, (error, std), title)
        save(figure, pipeline.path("estimators.png"))
        return {name: of_flight.record() for name, of_flight in flown.items()}

    inputs = pipeline.inputs(MAP, FLIGHT, version=SCORE_VERSION)
    holds = "linear and nonlinear estimator on the same strains, as numbers (and as a figure, estimators.png)"
    return make_numbers(pipeline, "estimators.json", holds, inputs, entries)
