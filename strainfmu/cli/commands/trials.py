"""Trials: ``strainfmu trial``, ``strainfmu stress`` and ``strainfmu compare``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.maps import (
    ESTIMATOR_OPTION,
    REBUILD_OPTION,
    SNAPSHOTS_OPTION,
    STRUCTURE_OPTION,
    Estimator,
)
from strainfmu.cli.commands.number_ranges import within

if TYPE_CHECKING:
    from builder.pipeline.trial_run import TrialResult

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
    given = {**locals(), "only": only or (), "formats": formats or ()}
    _show_trial(builder.run_trial, given)


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
    _show_trial(builder.stress, dict(locals()))


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
    _show_trial(builder.compare, dict(locals()))


def _show_trial(run: Callable[..., TrialResult], given: dict[str, Any]) -> None:
    """Run a trial as the options say, and print its table."""
    console, start = Console(), perf_counter()
    result = run(**given, progress=ConsoleReporter(console))
    _show(console, result)
    written = ", ".join(str(path) for path in result.files)
    console.print(
        f"{written}: {perf_counter() - start:.1f} s in all", highlight=False, markup=False, soft_wrap=True
    )


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
