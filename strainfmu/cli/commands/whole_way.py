"""A vehicle file from one end to the other: ``strainfmu demo`` and ``strainfmu check``."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
from builder.pipeline.progress_bars import ConsoleReporter
from builder.vehicle.named_file import naming
from strainfmu.cli.commands.demo_results import show_result, write_readme
from strainfmu.cli.commands.maps import (
    ESTIMATOR_OPTION,
    REBUILD_OPTION,
    SNAPSHOTS_OPTION,
    STRUCTURE_OPTION,
    Estimator,
)
from strainfmu.cli.commands.number_ranges import within

VehicleArgument = Annotated[
    Path | None,
    typer.Option("--vehicle", help="Vehicle file (TOML). Default: the IC3X surrogate that is shipped."),
]


def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("demo"),
    vehicle: VehicleArgument = None,
    can: Annotated[
        bool, typer.Option("--can", help="Fly once more over a CAN bus: sender and bridge as two processes.")
    ] = False,
    can_duration: Annotated[
        float,
        typer.Option(metavar="S", callback=within(0.1, 1e5, "s"), help="With --can: duration of that flight."),
    ] = 20.0,
    can_authenticated: Annotated[
        bool,
        typer.Option("--can-authenticated", help="With --can: profile fd64-sec, with a key made for that flight."),
    ] = False,
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    structure: Annotated[Path | None, STRUCTURE_OPTION] = None,
    rebuild: Annotated[bool, REBUILD_OPTION] = False,
    perfect: Annotated[
        bool,
        typer.Option(
            "--perfect", help="Fly the vehicle of the file, without installation errors. Not with --as-built."
        ),
    ] = False,
    as_built: Annotated[
        int | None,
        typer.Option(
            "--as-built",
            metavar="SEED",
            callback=within(0, 2**31 - 1),
            help="Draw a vehicle within tolerances, test it on the ground, calibrate, fly; not with --perfect.",
        ),
    ] = None,
    estimator: Annotated[Estimator | None, ESTIMATOR_OPTION] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Print stages, notes, detection thresholds and the list of files.")
    ] = False,
) -> None:
    """Build the map of a vehicle, package it as an FMU, and fly the FMU in a system simulation.

    Solves the flow, builds the inverse map, exports the FMU and flies it against the truth model of the
    vehicle. The vehicle flown has installation errors: gains, gauge places, wall and more are drawn at their
    specified sizes. A second run reuses the
    files that are up to date.

    Prints the accuracy in about a dozen lines. README.txt of the folder has the stages, notes, detection
    thresholds and files.

    Examples:

        strainfmu demo

        strainfmu demo -o results --vehicle my_vehicle.toml

        strainfmu demo --perfect

        strainfmu demo --as-built 7 -o tested

        strainfmu demo --estimator linear -o linear

        strainfmu demo --can
    """
    given, console = dict(locals()), Console()
    reporter = ConsoleReporter(console, is_verbose=verbose)
    start = perf_counter()
    del given["verbose"]
    with naming(vehicle or builder.IC3X):
        result = builder.demo(**given, progress=reporter)
    write_readme(result, reporter.lines)
    show_result(console, result, verbose)
    if result.over_bus is not None:
        from strainfmu.cli.commands.can_send import score_table

        console.print(score_table(result.over_bus.score, "Over the CAN bus: the bridge's results against truth"))
        console.print(result.over_bus.bridge, highlight=False, markup=False, soft_wrap=True)
    console.print(f"{perf_counter() - start:.1f} s in all", highlight=False, soft_wrap=True)


def check(vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")]) -> None:
    """Check a vehicle file, its gauges, the reach of the flow solver, and the manoeuvre of the demonstration.

    Solves the flows at the lowest and highest Mach number and angle of attack, which takes seconds.

    Example:

        strainfmu check my_vehicle.toml
    """
    console = Console()
    found = builder.check(vehicle, progress=ConsoleReporter(console))
    table = Table(title=escape(f"{vehicle}: {found.name}"), show_header=False)
    for row in found.rows:
        table.add_row(*map(escape, row))
    console.print(table)
    for line in found.lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
