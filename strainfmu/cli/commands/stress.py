"""Errors of many kinds on a map: ``strainfmu stress``."""

from __future__ import annotations

from itertools import chain
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
    from builder.stress.run import StressResult

FLIGHTS_WIDTH = 150
"""Smallest width of the table of manoeuvres [characters]."""


def stress(
    vehicle: Annotated[
        Path | None, typer.Argument(help="Vehicle file (TOML). Default: the IC3X surrogate that is shipped.")
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("stress"),
    inverse_map: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="MAP",
            help="Map to test (map.h5). Default: built in the folder. Not with the options of a build.",
        ),
    ] = None,
    conditions: Annotated[
        int, typer.Option(metavar="N", callback=within(1, 10_000), help="Flight conditions of each kind of error.")
    ] = 200,
    draws: Annotated[
        int,
        typer.Option(
            metavar="N",
            callback=within(1, 10_000),
            help="Draws of vehicle and noise at every condition.",
        ),
    ] = 20,
    seed: Annotated[int, typer.Option(callback=within(0, 2**31 - 1), help="Seed of all draws.")] = 1,
    flights: Annotated[
        bool,
        typer.Option("--flights", help="Fly manoeuvres over time; without --conditions."),
    ] = False,
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    structure: Annotated[Path | None, STRUCTURE_OPTION] = None,
    rebuild: Annotated[bool, REBUILD_OPTION] = False,
    estimator: Annotated[Estimator | None, ESTIMATOR_OPTION] = None,
) -> None:
    """Try some sixty kinds of error on a map: how many samples health detects, how many wrong ones it does not.

    Flies a truth model of the vehicle with installation errors, failed gauges, temperature, flights beyond the
    envelope, and the pressure of another flow model.

    Undetected: a coefficient is outside 3 sigma and health is OK. Detected: health is anything else, DEGRADED
    too. rms/bound: the rms error of a coefficient over its Cramer-Rao bound, the largest of the five.

    Classes: within (the envelope, up to twice the specified sizes), outside (beyond), unobservable (the strain
    is equal to the strain of another flight). A vehicle given by sections or a surface needs a flow for every
    flight; it flies a quarter of them beyond the envelope.

    --flights flies turns, steps, gusts, drifts of air data and failures at 100 Hz instead, by each estimator as
    single samples and with filters of 1 s and 10 s; it writes stress.json alone.

    Writes stress.json, stress.csv and stress.png. Flows are kept as they are solved: an interrupted run
    continues, and a second run reuses what is up to date.

    Examples:

        strainfmu stress my_vehicle.toml -o stress

        strainfmu stress my_vehicle.toml -o stress --map results/map.h5 --conditions 500

        strainfmu stress my_vehicle.toml -o manoeuvres --flights
    """
    from builder.pipeline.pipeline import FilesGiven
    from builder.stress.run import run_stress
    from builder.stress.score import Effort
    from builder.vehicle.file import IC3X

    given = FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild)
    console, start = Console(), perf_counter()
    with naming(vehicle or IC3X):
        result = run_stress(
            vehicle or IC3X,
            output,
            ConsoleReporter(console),
            effort=Effort(conditions=conditions, draws=draws, seed=seed),
            map_path=inverse_map,
            given=given,
            estimator=estimator,
            over_time=flights,
        )
    (_show_flights if flights else _show)(console, result)
    written = ", ".join(str(path) for path in result.files)
    console.print(
        f"{written}: {perf_counter() - start:.1f} s in all", highlight=False, markup=False, soft_wrap=True
    )


def _show(console: Console, result: StressResult) -> None:
    from builder.figures.comparison.stress import by_class

    missed = ", * target missed" if result.missed else ""
    title = escape(f"{result.vehicle}: errors on the truth model, samples [%]{missed}")
    table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("error, size", overflow="fold")
    for heading in ("class", "detected", "undetected", "rms/bound"):
        table.add_column(heading, justify="left" if heading == "class" else "right", no_wrap=True)
    for one in chain.from_iterable(by_class(result.entries).values()):
        table.add_row(
            escape(f"{one['error']}, {one['size']}"),
            one["class"],
            f"{one['detected_percent']:.2f}",
            f"{one['undetected_percent']:.2f}" + ("*" if one["missed"] else ""),
            _of_bound(one),
        )
    console.print(table)
    for line in result.largest_within:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    _show_missed(console, result)


def _show_missed(console: Console, result: StressResult) -> None:
    for line in result.missed:
        console.print(f"target missed: {line}", highlight=False, markup=False, soft_wrap=True)


def _show_flights(console: Console, result: StressResult) -> None:
    """Print rms errors of filters over the errors of single samples, and the smallest coverage of 3 sigma."""
    names = list(dict.fromkeys(name for one in result.entries for name in one["rms_over_single"]))
    table = Table(title=escape(f"{result.vehicle}: rms error over single samples; undetected, inside 3 sigma [%]"))
    for heading in ("manoeuvre", "estimator", "T [s]"):
        table.add_column(heading, no_wrap=True)
    for heading in (*names, "undetected", "inside"):
        table.add_column(
            heading.replace("angle_of_attack", "alpha").replace("sideslip_angle", "beta"), justify="right"
        )
    for one in [each for each in result.entries if each["time_constant_s"]]:
        ratio = [one["rms_over_single"].get(name) for name in names]
        table.add_row(
            escape(f"{one['error']}, {one['size']}"),
            one["estimator"],
            f"{one['time_constant_s']:g}",
            *("-" if value is None else f"{value:.2f}" for value in ratio),
            f"{one['undetected_percent']:.2f}",
            f"{min(one['coverage_percent'].values()):.1f}",
        )
    # A table of this width is of no use broken into columns of two letters.
    Console(width=max(console.width, FLIGHTS_WIDTH)).print(table)
    _show_missed(console, result)


def _of_bound(one: dict[str, Any]) -> str:
    """Return the largest rms error over its bound; a dash where the map has no tables, or a filter estimates."""
    ratios = [one["rms"][name] / bound for name, bound in one["bound"].items() if bound and one["rms"][name]]
    return f"{max(ratios):.2f}" if ratios else "-"
