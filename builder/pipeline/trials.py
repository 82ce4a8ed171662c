"""Trials of every kind from their files: ``strainfmu trial``, ``stress`` and ``compare``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from builder.pipeline import trial_run
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
    estimator: Literal["auto", "linear", "nonlinear"] | None = None,
    progress: AnyProgress = None,
) -> TrialResult:
    """Try errors on a map: which it includes in sigma, which health flags, which stay undetected.

    The file lists cases: where they fly, what is wrong with vehicle, gauges, air data or flow. A truth model of
    the vehicle flies them. Shipped files: stress, manoeuvres, uncertainty, incidence, false_alarms, lost_gauges,
    heating, ground_test, ground_test_size; closed_loop takes a scenario of ``strainfmu fly``, not a vehicle.

    A load is wrong outside 3 sigma. A sample is flagged when health is neither OK nor DEGRADED, and undetected
    when it is wrong and not flagged. Each fraction has its statistical error; a verdict is ok, missed or open (too
    few samples).

    Writes trial.csv and trial.png. Finished cases are kept: an interrupted trial continues, and a second run
    reuses what is up to date.

    On the command line::

        strainfmu trial stress my_vehicle.toml --map results/map.h5 -o stress
        strainfmu trial my_errors.toml my_vehicle.toml --only "bias of one gauge" --draws 100
        strainfmu trial uncertainty --map demo/map.h5 --flows demo/independent_flows.h5

    Parameters
    ----------
    file : file of the trial (TOML), or the name of a shipped one, such as "stress".
    vehicle : vehicle file (TOML). Default: the IC3X surrogate that is shipped.
    output : folder for the results.
    inverse_map : map to test (map.h5). Default: built in the folder. Not with the options of a build.
    flows : flows of the truth model to fly, such as independent_flows.h5. Default: solved in the folder.
    only : errors to try. Default: all.
    estimators : estimators to try: "linear", "nonlinear", "linear 10 s". Default: the file's.
    conditions : flight conditions of each case.
    draws : draws of vehicle and noise at every condition.
    training : flights that train each learning estimator.
    seed : seed of all draws.
    formats : formats of the table: "csv", "parquet", "json". Default: "csv".
    workers : cases at a time on this machine; each takes memory of its own.
    scheduler : Dask scheduler, such as tcp://host:8786, whose workers share the files.
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
    estimator: Literal["auto", "linear", "nonlinear"] | None = None,
    workers: int = 1,
    progress: AnyProgress = None,
) -> TrialResult:
    """Try some sixty kinds of error on a map: the trial ``stress``, or ``manoeuvres`` with ``flights``.

    Flies a truth model of the vehicle with installation errors, failed gauges, temperature, flights beyond the
    envelope, and the pressure of another flow model.

    ``flights`` flies turns, steps, gusts, drifts of air data and failures at 100 Hz instead. Each estimator takes
    them as single samples and with filters of 1 s and 10 s.

    ``strainfmu trial --help`` says what the columns mean. A vehicle given by sections or a surface needs a flow
    for every flight; it flies a quarter of them beyond the envelope.

    Writes trial.csv, trial.png, and stress.json in the form of earlier versions. Flows are kept as they are
    solved: an interrupted run continues, and a second run reuses what is up to date.

    On the command line::

        strainfmu stress my_vehicle.toml -o stress
        strainfmu stress my_vehicle.toml -o stress --map results/map.h5 --conditions 500
        strainfmu stress my_vehicle.toml -o manoeuvres --flights

    Parameters
    ----------
    vehicle, output, inverse_map, conditions, draws, seed, workers, progress : as :func:`run_trial` takes them.
    flights : fly manoeuvres over time; without ``conditions``.
    snapshots, structure, rebuild, estimator : as :func:`build` takes them.
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
    """Try estimators of eight kinds on the same readings: the trial ``compare``.

    The kinds are the linear maps of both cases, the nonlinear estimator and a Kalman filter with a random
    walk. The extra ``rivals`` adds regression tree, random forest, gradient boosting and multi-layer perceptron.

    Each is scored with gauge noise alone and with installation errors, with all air-data inputs and with q_inf
    only: rms errors over the Cramer-Rao bound, coverage of 3 sigma, air data, error of the pressure field.

    Writes trial.csv and trial.png. Flows are kept as they are solved: an interrupted run continues, and a second
    run reuses what is up to date.

    On the command line::

        strainfmu compare my_vehicle.toml -o compare
        strainfmu compare my_vehicle.toml -o compare --snapshots flows/fine.h5 --conditions 1000

    Parameters
    ----------
    vehicle, output, conditions, draws, training, seed, workers, progress : as :func:`run_trial` takes them.
    snapshots, structure, rebuild : as :func:`build` takes them.
    """
    return run_trial("compare", **locals())
