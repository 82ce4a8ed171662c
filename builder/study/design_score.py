"""One design of a trade study: its map built, and tried on flights of the independent model."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from builder.campaign.snapshots import load_snapshots
from builder.pipeline.map_files import make_independent_flows, make_map, solid_structure_of, true_structure_of
from builder.pipeline.pipeline import FilesGiven, Pipeline
from builder.pipeline.shape_flows import make_shape_flows
from builder.pipeline.used_files import FLOWS, MAP, open_pipeline
from builder.reporting import Reporter, Silent
from builder.study.study_file import Trial
from builder.trial.conditions import conditions_in_ranges, drawn_altitudes_km
from builder.trial.estimators import of_map
from builder.trial.levels import level_readings, stated_readings
from builder.trial.readings import Readings
from builder.trial.score import by_name, rounded, score_of
from builder.trial.world import World
from builder.truth.revolution.flow_table import load_flow_table
from builder.truth.shape.flights import shape_flights
from builder.truth.shape.structure import flying_structure
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map
from strainfmu.files import write_bytes_atomically

SCORE, TRIAL_FLOWS = "score.json", "trial_flows.h5"

VERSION = 1
"""Raised whenever the scores change otherwise than by their inputs, so that they are made again."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """What a worker needs for one design: its ``folder``, ``snapshots`` and ``flows`` that it shares with others,
    None for flows of its own, and what identifies these."""

    vehicle: Vehicle
    folder: Path
    trial: Trial
    snapshots: Path
    flows: Path | None
    flows_made_from: str


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignScore:
    """The ``score`` of the design in ``folder``, or the ``fault`` that ended it, one line."""

    folder: Path
    score: dict[str, Any] | None = None
    fault: str = ""


def run_design(task: Task, reporter: Reporter | None = None) -> DesignScore:
    """Build and try a design, or take what is up to date in its folder; faults are returned."""
    try:
        return DesignScore(folder=task.folder, score=_score(task, reporter or Silent()))
    except StrainfmuError as error:
        return DesignScore(folder=task.folder, fault="; ".join(str(error).splitlines()))


def _score(task: Task, reporter: Reporter) -> dict[str, Any]:
    given = FilesGiven(snapshots=task.snapshots)
    pipeline, _ = open_pipeline(task.vehicle, task.folder, reporter, given)
    if task.flows is not None:
        pipeline.use(FLOWS, task.flows, task.flows_made_from)
    make_map(pipeline)
    vehicle = pipeline.flown or pipeline.vehicle
    inputs = {
        "version": VERSION,
        "map": pipeline.made_from(MAP),
        "trial": task.trial.model_dump(),
        "flows": task.flows_made_from,
        "vehicle": vehicle.model_dump(exclude={"description"}),
    }
    if not vehicle.is_of_revolution:
        conditions = conditions_in_ranges(
            vehicle,
            drawn_altitudes_km(vehicle),
            task.trial.conditions,
            np.random.default_rng(task.trial.seed),
        )
        make_shape_flows(pipeline, vehicle, conditions, TRIAL_FLOWS, "flows of the trial")

    def write(path: Path) -> None:
        inverse_map = load_inverse_map(pipeline.path(MAP))
        found = score_in_flights(inverse_map, trial_flights(pipeline, vehicle, inverse_map, task.trial))
        write_bytes_atomically(path, (json.dumps(found, indent=1, allow_nan=False) + "\n").encode())

    pipeline.make(SCORE, "errors and uncertainty of the design in the trial", inputs, write)
    found: dict[str, Any] = json.loads(pipeline.path(SCORE).read_text(encoding="utf-8"))
    return found


def trial_flights(pipeline: Pipeline, vehicle: Vehicle, inverse_map: InverseMap, trial: Trial) -> Readings:
    """Return what vehicles of the independent model read in the trial.

    Raises
    ------
    InputError
        There is no independent model, or the vehicle has auxiliary sensors.
    """
    if vehicle.sensors is not None:
        raise InputError("sensors: expected none, a trade study flies strain gauges alone")
    if vehicle.is_of_revolution:
        make_independent_flows(pipeline)
        flows = load_flow_table(pipeline.path(FLOWS))
        world = World(vehicle=vehicle, structure=true_structure_of(pipeline), flows=flows, inverse_map=inverse_map)
        return level_readings(world, seed=trial.seed, vehicles=trial.draws, conditions=trial.conditions)
    structure = flying_structure(vehicle, solid_structure_of(pipeline), pipeline.reporter)
    snapshots = load_snapshots(pipeline.path(TRIAL_FLOWS))
    world = World(vehicle=vehicle, structure=structure, flows=snapshots, inverse_map=inverse_map)
    flights, random = shape_flights(vehicle, structure, snapshots), np.random.default_rng(trial.seed)
    return stated_readings(world, flights, random, trial.draws)


def score_in_flights(inverse_map: InverseMap, read: Readings) -> dict[str, Any]:
    """Return rms error, mean standard deviation and coverage of 3 sigma of each coefficient, and health."""
    made = of_map(inverse_map)(read)
    error = made.value - read.truth
    score = score_of(COEFFICIENT_NAMES, error, made.std, truth=read.truth, health=made.health)
    return {
        "gauges": inverse_map.n_gauges,
        "samples": score.samples,
        "rms": by_name(score.names, score.rms, rounded),
        "rms_percent_of_range": by_name(score.names, 100.0 * score.rms_of_range, rounded),
        "sigma": by_name(score.names, score.mean_std, rounded),
        "coverage_percent": by_name(score.names, 100.0 * score.coverage_3, rounded),
        "detected_percent": 100.0 * score.detected,
        "undetected_percent": 100.0 * score.undetected,
    }
