"""Trials: ``strainfmu trial``, ``strainfmu stress`` and ``strainfmu compare``."""

from __future__ import annotations

import json
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.maps import (
    ESTIMATOR_OPTION,
    REBUILD_OPTION,
    SNAPSHOTS_OPTION,
    STRUCTURE_OPTION,
    Estimator,
)
from strainfmu.cli.commands.number_ranges import within
from strainfmu.cli.named_vehicle import naming

if TYPE_CHECKING:
    from builder.pipeline.trial_run import TrialOptions, TrialResult

WIDTH = 160
"""Smallest width of the table [characters]: it is of no use broken into columns of two letters."""

VEHICLE_ARGUMENT = typer.Argument(help="Vehicle file (TOML). Default: the IC3X surrogate that is shipped.")
OUTPUT_OPTION = typer.Option("-o", "--output", help="Folder for the results.")
MAP_OPTION = typer.Option(
    "--map",
    metavar="MAP",
    help="Map to test (map.h5). Default: built in the folder. Not with the options of a build.",
)
CONDITIONS_OPTION = typer.Option(
    metavar="N", callback=within(1, 1_000_000), help="Flight conditions of each case."
)
DRAWS_OPTION = typer.Option(
    metavar="N", callback=within(1, 100_000), help="Draws of vehicle and noise at every condition."
)
SEED_OPTION = typer.Option(callback=within(0, 2**31 - 1), help="Seed of all draws.")
WORKERS_OPTION = typer.Option(
    metavar="N", callback=within(1, 1000), help="Cases at a time on this machine; each takes memory of its own."
)
SCHEDULER_OPTION = typer.Option(
    metavar="ADDRESS", help="Dask scheduler, such as tcp://host:8786, whose workers share the files."
)


def trial(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="File of the trial (TOML), or the name of a shipped one.")
    ],
    vehicle: Annotated[Path | None, VEHICLE_ARGUMENT] = None,
    output: Annotated[Path, OUTPUT_OPTION] = Path("trial"),
    inverse_map: Annotated[Path | None, MAP_OPTION] = None,
    flows: Annotated[
        Path | None,
        typer.Option(
            metavar="FLOWS",
            help="Flows of the truth model to fly, such as independent_flows.h5. Default: solved in the folder.",
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="ERROR", help="Errors to try, one an option. Default: all."),
    ] = None,
    estimators: Annotated[
        list[str] | None,
        typer.Option(
            "--estimators",
            metavar="NAME",
            help="Estimators to try, one an option: linear, nonlinear, 'linear 10 s'. Default: the file's.",
        ),
    ] = None,
    conditions: Annotated[int | None, CONDITIONS_OPTION] = None,
    draws: Annotated[int | None, DRAWS_OPTION] = None,
    seed: Annotated[int | None, SEED_OPTION] = None,
    formats: Annotated[
        list[str] | None,
        typer.Option("--format", metavar="csv|parquet|json", help="Formats of the table, one an option."),
    ] = None,
    workers: Annotated[int, WORKERS_OPTION] = 1,
    scheduler: Annotated[str | None, SCHEDULER_OPTION] = None,
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    structure: Annotated[Path | None, STRUCTURE_OPTION] = None,
    rebuild: Annotated[bool, REBUILD_OPTION] = False,
    estimator: Annotated[Estimator | None, ESTIMATOR_OPTION] = None,
) -> None:
    """Try errors on a map: which it includes in sigma, which health flags, which stay undetected.

    The file lists cases: where they fly, what is wrong with vehicle, gauges, air data or flow. A truth model of
    the vehicle flies them. Shipped files: stress, manoeuvres, uncertainty, incidence, false_alarms, lost_gauges,
    heating, ground_test, ground_test_size; closed_loop takes a scenario of `strainfmu fly` instead of the vehicle.

    A load is wrong outside 3 sigma. A sample is flagged when health is neither OK nor DEGRADED, and undetected
    when it is wrong and not flagged. Each fraction has its statistical error; a verdict is ok, missed or open (too
    few samples).

    Writes trial.csv and trial.png. Finished cases are kept: an interrupted trial continues, and a second run
    reuses what is up to date.

    Examples:

        strainfmu trial stress my_vehicle.toml --map results/map.h5 -o stress

        strainfmu trial my_errors.toml my_vehicle.toml --only "bias of one gauge" --draws 100

        strainfmu trial uncertainty --map demo/map.h5 --flows demo/independent_flows.h5
    """
    from builder.pipeline.trial_run import SUFFIXES, TrialOptions
    from strainfmu.errors import InputError

    suffixes = tuple(f".{name}" for name in formats or ["csv"])
    if unknown := [suffix for suffix in suffixes if suffix not in SUFFIXES]:
        raise InputError(f"--format: expected csv, parquet or json, got {unknown[0][1:]}")
    options = TrialOptions(
        only=tuple(only or ()),
        changes=_changes(conditions, draws, seed, estimators),
        map_path=inverse_map,
        flows=flows,
        given=_given(snapshots, structure, rebuild),
        estimator=estimator,
        formats=suffixes,
        workers=workers,
        scheduler=scheduler,
    )
    _run(file, vehicle, output, options)


def stress(
    vehicle: Annotated[Path | None, VEHICLE_ARGUMENT] = None,
    output: Annotated[Path, OUTPUT_OPTION] = Path("stress"),
    inverse_map: Annotated[Path | None, MAP_OPTION] = None,
    conditions: Annotated[int, CONDITIONS_OPTION] = 200,
    draws: Annotated[int, DRAWS_OPTION] = 20,
    seed: Annotated[int, SEED_OPTION] = 1,
    flights: Annotated[
        bool, typer.Option("--flights", help="Fly manoeuvres over time; without --conditions.")
    ] = False,
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    structure: Annotated[Path | None, STRUCTURE_OPTION] = None,
    rebuild: Annotated[bool, REBUILD_OPTION] = False,
    estimator: Annotated[Estimator | None, ESTIMATOR_OPTION] = None,
    workers: Annotated[int, WORKERS_OPTION] = 1,
) -> None:
    """Try some sixty kinds of error on a map: the trial `stress`, or `manoeuvres` with --flights.

    Flies a truth model of the vehicle with installation errors, failed gauges, temperature, flights beyond the
    envelope, and the pressure of another flow model.

    --flights flies turns, steps, gusts, drifts of air data and failures at 100 Hz instead. Each estimator takes
    them as single samples and with filters of 1 s and 10 s.

    `strainfmu trial --help` says what the columns mean. A vehicle given by sections or a surface needs a flow for
    every flight; it flies a quarter of them beyond the envelope.

    Writes trial.csv, trial.png, and stress.json in the form of earlier versions. Flows are kept as they are
    solved: an interrupted run continues, and a second run reuses what is up to date.

    Examples:

        strainfmu stress my_vehicle.toml -o stress

        strainfmu stress my_vehicle.toml -o stress --map results/map.h5 --conditions 500

        strainfmu stress my_vehicle.toml -o manoeuvres --flights
    """
    from builder.pipeline.trial_run import TrialOptions
    from builder.trial.table import stress_entries

    options = TrialOptions(
        changes=_changes(conditions, draws, seed, None),
        map_path=inverse_map,
        given=_given(snapshots, structure, rebuild),
        estimator=estimator,
        workers=workers,
    )
    result = _run("manoeuvres" if flights else "stress", vehicle, output, options)
    text = json.dumps(stress_entries(result.cases, result.rows), indent=1, allow_nan=False) + "\n"
    from strainfmu.files import write_bytes_atomically

    write_bytes_atomically(output / "stress.json", text.encode())


def compare(
    vehicle: Annotated[Path | None, VEHICLE_ARGUMENT] = None,
    output: Annotated[Path, OUTPUT_OPTION] = Path("compare"),
    conditions: Annotated[int | None, CONDITIONS_OPTION] = None,
    draws: Annotated[int | None, DRAWS_OPTION] = None,
    training: Annotated[
        int | None,
        typer.Option(
            metavar="N", callback=within(1200, 10_000_000), help="Flights that train each learning estimator."
        ),
    ] = None,
    seed: Annotated[int | None, SEED_OPTION] = None,
    workers: Annotated[int, WORKERS_OPTION] = 1,
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    structure: Annotated[Path | None, STRUCTURE_OPTION] = None,
    rebuild: Annotated[bool, REBUILD_OPTION] = False,
) -> None:
    """Try estimators of eight kinds on the same readings: the trial `compare`.

    The kinds are the linear maps of both cases, the nonlinear estimator and a Kalman filter with a random
    walk. The extra `rivals` adds regression tree, random forest, gradient boosting and multi-layer perceptron.

    Each is scored with gauge noise alone and with installation errors, with all air-data inputs and with q_inf
    only: rms errors over the Cramer-Rao bound, coverage of 3 sigma, air data, error of the pressure field.

    Writes trial.csv and trial.png. Flows are kept as they are solved: an interrupted run continues, and a second
    run reuses what is up to date.

    Examples:

        strainfmu compare my_vehicle.toml -o compare

        strainfmu compare my_vehicle.toml -o compare --snapshots flows/fine.h5 --conditions 1000
    """
    from builder.pipeline.trial_run import TrialOptions

    training_changes = {} if training is None else {"training": training}
    options = TrialOptions(
        changes=_changes(conditions, draws, seed, None) | training_changes,
        given=_given(snapshots, structure, rebuild),
        workers=workers,
    )
    _run("compare", vehicle, output, options)


def _changes(
    conditions: int | None, draws: int | None, seed: int | None, names: list[str] | None
) -> dict[str, Any]:
    """Return what options change in the plan of a file."""
    changes = {"conditions": conditions, "vehicles": draws, "seed": seed, "estimators": names}
    return {name: value for name, value in changes.items() if value is not None}


def _given(snapshots: Path | None, structure: Path | None, rebuild: bool) -> Any:
    from builder.pipeline.pipeline import FilesGiven

    return FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild)


def _run(file: str, vehicle: Path | None, output: Path, options: TrialOptions) -> TrialResult:
    from builder.pipeline.closed_loop_trial import run_closed_loop
    from builder.pipeline.trial_run import run_trial
    from builder.trial.cases import load_trial, trial_path
    from builder.vehicle.file import IC3X, VEHICLES

    console, start = Console(), perf_counter()
    reporter, path = ConsoleReporter(console), trial_path(file)
    trial = load_trial(path)
    if trial.closed_loop is not None:
        loop = trial.closed_loop
        result = run_closed_loop(loop, vehicle or VEHICLES / "ic3x_flight.toml", output, reporter, options)
    else:
        with naming(vehicle or IC3X):
            result = run_trial(path, vehicle or IC3X, output, reporter, options)
    _show(console, result)
    written = ", ".join(str(path) for path in result.files)
    console.print(
        f"{written}: {perf_counter() - start:.1f} s in all", highlight=False, markup=False, soft_wrap=True
    )
    return result


def _show(console: Console, result: TrialResult) -> None:
    from builder.trial.table import (
        ERROR_TITLE,
        HEADINGS,
        TITLES,
        cells_of,
        error_cells,
        in_order,
        loads_of,
        reasons,
    )

    wide, loads = Console(width=max(console.width, WIDTH)), loads_of(result.rows)
    for name, rows in in_order(result.rows).items():
        title = escape(f"{result.vehicle}: {TITLES[name]}; samples [%]")
        table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
        for number, heading in enumerate(HEADINGS):
            is_text = number < 2 or heading == "verdict"
            table.add_column(heading, justify="left" if is_text else "right", no_wrap=not is_text)
        for row in rows:
            table.add_row(*(escape(cell) for cell in cells_of(row, loads[row["case"], row["estimator"]])))
        wide.print(table)
    if errors := error_cells(result.rows):
        table = Table(title=f"{escape(result.vehicle)}: {ERROR_TITLE}", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for number, heading in enumerate(errors[0]):
            table.add_column(escape(heading), justify="left" if number < 2 else "right", no_wrap=number > 1)
        for cells in errors[1:]:
            table.add_row(*(escape(cell) for cell in cells))
        wide.print(table)
    for line in reasons(result.rows):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
