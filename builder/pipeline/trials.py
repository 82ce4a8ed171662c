"""Trials of every kind from their files: ``strainfmu trial``, ``stress`` and ``compare``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from builder.pipeline import trial_run
from builder.pipeline.chosen_estimator import Estimators
from builder.pipeline.closed_loop_trial import run_closed_loop
from builder.pipeline.pipeline import FilesGiven
from builder.pipeline.stages import AnyProgress, reporter_of
from builder.pipeline.trial_run import SUFFIXES, TrialOptions, TrialResult
from builder.trial.cases import load_trial, trial_path
from builder.trial.table import stress_entries
from builder.vehicle.file import IC3X, VEHICLES
from builder.vehicle.named_file import naming
from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically


def run_trial(
    file: str | Path,
    vehicle: str | Path | None = None,
    output: str | Path = "trial",
    *,
    inverse_map: str | Path | None = None,
    flows: str | Path | None = None,
    only: Sequence[str] = (),
    estimators: Sequence[str] | None = None,
    conditions: int | None = None,
    draws: int | None = None,
    training: int | None = None,
    seed: int | None = None,
    formats: Sequence[str] = (),
    workers: int = 1,
    scheduler: str | None = None,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    rebuild: bool = False,
    estimator: Estimators | None = None,
    progress: AnyProgress = None,
) -> TrialResult:
    """Try errors on a map: which it includes in sigma, which health flags, which stay undetected.

    Finished cases are kept: an interrupted trial continues, and a second run reuses what is up to date.

    Parameters
    ----------
    file : file of the trial (TOML), or the name of a shipped one, such as "stress".
    vehicle : vehicle file; None for the shipped vehicle. Of a trial in closed loop, the scenario.
    output : folder for the results.
    inverse_map : map to test; None to build it in the folder.
    flows : flows of the truth model to fly; None to solve them in the folder.
    only : errors to try; all by default.
    estimators : such as "linear", "nonlinear", "linear 10 s"; None for the file's.
    conditions, draws, training, seed : flight conditions of each case, draws of vehicle and noise at each, flights
        that train each learning estimator, and the seed of all; None for the file's.
    formats : of the table: some of "csv", "parquet", "json"; none for "csv".
    workers : cases at a time on this machine.
    scheduler : address of a Dask scheduler whose workers share the files.
    snapshots, structure, rebuild, estimator : as :func:`build` takes them.
    progress : True for progress bars.

    Raises
    ------
    InputError
        A file is wrong, the map does not fit the vehicle, or there is no truth model of it.
    StrainfmuError
        A file could not be written.
    """
    suffixes = tuple(f".{name}" for name in formats or ("csv",))
    if unknown := [suffix for suffix in suffixes if suffix not in SUFFIXES]:
        raise InputError(f"--format: expected csv, parquet or json, got {unknown[0][1:]}")
    changes = {
        "conditions": conditions,
        "vehicles": draws,
        "seed": seed,
        "estimators": None if estimators is None else list(estimators),
        "training": training,
    }
    options = TrialOptions(
        only=tuple(only),
        changes={name: value for name, value in changes.items() if value is not None},
        map_path=None if inverse_map is None else Path(inverse_map),
        flows=None if flows is None else Path(flows),
        given=FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild),
        estimator=estimator,
        formats=suffixes,
        workers=workers,
        scheduler=scheduler,
    )
    path, folder, reporter = trial_path(str(file)), Path(output), reporter_of(progress)
    trial = load_trial(path)
    if trial.closed_loop is not None:
        scenario = Path(vehicle or VEHICLES / "ic3x_flight.toml")
        return run_closed_loop(trial.closed_loop, scenario, folder, reporter, options)
    flown = Path(vehicle or IC3X)
    with naming(flown):
        return trial_run.run_trial(path, flown, folder, reporter, options)


def stress(
    vehicle: str | Path | None = None,
    output: str | Path = "stress",
    *,
    inverse_map: str | Path | None = None,
    conditions: int = 200,
    draws: int = 20,
    seed: int = 1,
    flights: bool = False,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    rebuild: bool = False,
    estimator: Estimators | None = None,
    workers: int = 1,
    progress: AnyProgress = None,
) -> TrialResult:
    """Try some sixty kinds of error on a map: the trial "stress", or manoeuvres over time with ``flights``.

    Parameters are as :func:`run_trial` takes them. The results are in stress.json too.
    """
    given: dict[str, Any] = dict(locals())
    file = "manoeuvres" if given.pop("flights") else "stress"
    result = run_trial(file, **given)
    text = json.dumps(stress_entries(result.cases, result.rows), indent=1, allow_nan=False) + "\n"
    write_bytes_atomically(Path(output) / "stress.json", text.encode())
    return result


def compare(
    vehicle: str | Path | None = None,
    output: str | Path = "compare",
    *,
    conditions: int | None = None,
    draws: int | None = None,
    training: int | None = None,
    seed: int | None = None,
    workers: int = 1,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    rebuild: bool = False,
    progress: AnyProgress = None,
) -> TrialResult:
    """Try estimators of eight kinds on the same readings, the trial "compare"; parameters of :func:`run_trial`."""
    return run_trial("compare", **locals())
