"""A trial of estimators of several kinds, on maps that are built for the errors of each case."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from builder.campaign.snapshots import load_snapshots
from builder.manifold.mirror_images import with_mirror_images
from builder.manifold.snapshot_grid import snapshot_grid
from builder.pipeline.map_files import load_map_parts, make_map_parts
from builder.pipeline.trial_run import (
    FLOWS,
    TrialOptions,
    TrialResult,
    finished,
    make_trial_flows,
    once,
    opened,
    true_world,
)
from builder.pipeline.used_files import SNAPSHOTS, STRUCTURE
from builder.reporting import Reporter, Silent
from builder.trial.cases import cases_for, load_trial
from builder.trial.compared import NONLINEAR, ComparedWorld, compared_estimators, knowing, maps_for, refuse_unknown
from builder.trial.regressions import REGRESSIONS
from builder.trial.run import scored
from builder.truth.independent_model import other_physics
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError


def run_comparison(
    file: Path, vehicle_path: Path, folder: Path, reporter: Reporter, options: TrialOptions
) -> TrialResult:
    """Try estimators of several kinds on the same readings, as :func:`~builder.pipeline.trial_run.run_trial`.

    Without scikit-learn its regressions are left out, with a note.

    Raises
    ------
    InputError
        A file is wrong, a map is given, or there is no independent model of the vehicle.
    StrainfmuError
        A file could not be written.
    """
    trial = load_trial(file).changed(options.changes)
    assert trial.compare is not None
    refuse_unknown(trial.trial.estimators)
    names = _installed(trial.trial.estimators, reporter)
    plan = trial.trial.model_copy(update={"estimators": names})
    pipeline, flown = opened(trial, vehicle_path, folder, reporter, options)
    make_map_parts(pipeline)
    vehicle = knowing(flown, is_exact=False, case=1)
    for line in other_physics(vehicle):
        reporter.note(line)
    snapshots = load_snapshots(pipeline.path(SNAPSHOTS))
    if not vehicle.is_of_revolution:
        snapshot_grid(with_mirror_images(snapshots, snapshots.surface))  # refused here, before the long work
    elif snapshots.station is None:
        raise InputError("compare: expected a body of revolution with rings of nodes, got a free surface")
    make_trial_flows(pipeline, vehicle, cases_for(vehicle, trial), plan, options.flows)
    solid = pipeline.vehicle.structure.model == "solid"
    files = pipeline.path(SNAPSHOTS), pipeline.path(STRUCTURE) if solid else None, pipeline.path(FLOWS)
    cases = cases_for(vehicle, trial, options.only)
    return finished(
        pipeline,
        vehicle,
        cases,
        plan,
        options,
        make_world=compared_world,
        world=(vehicle, *files, plan.conditions, plan.seed, trial.compare.training),
        inputs={
            "made from": pipeline.made_from(SNAPSHOTS, FLOWS, *([STRUCTURE] if solid else [])),
            "training": trial.compare.training,
        },
        score=partial(scored, make_estimators=compared_estimators),
    )


def _installed(names: Sequence[str], reporter: Reporter) -> list[str]:
    """Return the estimators of ``names`` without regressions where there is no scikit-learn."""
    missing = [name for name in names if name.partition(", ")[0] in REGRESSIONS and find_spec("sklearn") is None]
    if missing:
        reporter.note(f"left out, they need strainfmu[rivals]: {', '.join(missing)}")
    return [name for name in names if name not in missing]


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
    return ComparedWorld(
        **true_world(vehicle, flows, structure),
        inverse_map=maps_for(vehicle, *parts, is_exact=False)[NONLINEAR],
        conditions=conditions,
        seed=seed,
        snapshots=parts[0],
        map_structure=parts[1],
        training=training,
    )
