"""A trial of ground tests: maps that are made for every vehicle, as its test says."""

from __future__ import annotations

from pathlib import Path

from builder.calibration.score.ground_rows import CALIBRATION, ground_rows, refuse_unknown
from builder.calibration.score.ground_world import GroundWorld, ground_world
from builder.campaign.snapshots import load_snapshots
from builder.pipeline.map_files import make_independent_flows, make_snapshots
from builder.pipeline.trial_run import TrialOptions, TrialResult, finished, once, opened
from builder.pipeline.used_files import FLOWS, SNAPSHOTS
from builder.reporting import Reporter
from builder.structure.as_built.structure import refuse_beyond_calibration
from builder.trial.cases import cases_for, load_trial
from builder.trial.ground import GroundTests
from builder.trial.score import Row
from builder.truth.revolution import flow_table as flow_table_file
from builder.truth.revolution.flows import load_truth_flows
from builder.vehicle.file import Vehicle
from strainfmu.files import content_hash_of


def run_ground_tests(
    file: Path, vehicle_path: Path, folder: Path, reporter: Reporter, options: TrialOptions
) -> TrialResult:
    """Test vehicles of an independent truth and fly the maps that follow, as
    :func:`~builder.pipeline.trial_run.run_trial`.

    Raises
    ------
    InputError
        A file is wrong, a map is given, or no ground test calibrates the vehicle.
    StrainfmuError
        A file could not be written.
    """
    trial = load_trial(file).changed(options.changes)
    assert trial.ground is not None
    plan = trial.trial
    refuse_unknown(plan.estimators)
    pipeline, _ = opened(trial, vehicle_path, folder, reporter, options)
    vehicle = pipeline.vehicle
    refuse_beyond_calibration(vehicle, vehicle.gauges.layout)
    make_snapshots(pipeline)
    if options.flows is not None:
        schema = flow_table_file.SCHEMA, flow_table_file.SCHEMA_VERSION
        pipeline.use(FLOWS, options.flows, content_hash_of(options.flows, *schema))
    make_independent_flows(pipeline)
    cases = cases_for(vehicle, trial, options.only)
    result = finished(
        pipeline,
        vehicle,
        cases,
        plan,
        options,
        make_world=tested_world,
        world=(vehicle, pipeline.path(SNAPSHOTS), pipeline.path(FLOWS), plan.conditions, trial.ground),
        inputs={
            "made from": pipeline.made_from(SNAPSHOTS, FLOWS),
            "ground": trial.ground.model_dump(),
        },
        score=ground_rows,
    )
    for row in result.rows:
        if row["estimator"] == CALIBRATION:
            reporter.note(_line(row, result.rows))
    return result


def _line(said: Row, rows: list[Row]) -> str:
    """Return what the calibration says of the tests of a case, and largest errors over the exactly known
    vehicle."""
    over = [row for row in rows if row["case"] == said["case"] and "over_exact" in row]
    shares = ", ".join(f"{name.replace('_', ' ')} {said[f'{name}_percent']:.4g} %" for name in SHARES)
    ratios = dict[str, list[str]]()
    for row in over:
        ratios.setdefault(row["estimator"], []).append(f"{row['load']} {row['over_exact']:.2f}")
    texts = [f"; {name}, rms over exactly known: {' '.join(parts)}" for name, parts in ratios.items()]
    return f"{said['case']}: {said['samples']} tests, {shares}{''.join(texts)}"


SHARES = ("refused", "named", "silent", "gauges_blamed", "cases_blamed")


@once
def tested_world(
    vehicle: Vehicle, snapshots: Path, flows: Path, conditions: int, options: GroundTests
) -> GroundWorld:
    """Return the world of ground tests."""
    table = load_truth_flows(flows, vehicle)
    return ground_world(vehicle, load_snapshots(snapshots), table, conditions, options)
