"""A vehicle file from one end to the other: ``strainfmu demo`` and ``strainfmu check``."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from rich.console import Console

from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.demo_results import show_result, write_readme
from strainfmu.cli.commands.maps import (
    ESTIMATOR_OPTION,
    REBUILD_OPTION,
    SNAPSHOTS_OPTION,
    STRUCTURE_OPTION,
    Estimator,
)
from strainfmu.cli.commands.number_ranges import within
from strainfmu.cli.named_vehicle import naming

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
    from builder.pipeline.demonstration.demo import AS_BUILT_SEED, run_demo
    from builder.pipeline.pipeline import FilesGiven
    from builder.vehicle.file import IC3X

    console = Console()
    reporter = ConsoleReporter(console, is_verbose=verbose)
    start = perf_counter()
    if can:
        from strainfmu.can.demo import check_multicast, private_port

        # Refused before the long work, not after it.
        check_multicast(private_port())
    given = FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild)
    with naming(vehicle or IC3X):
        result = run_demo(
            vehicle or IC3X,
            output,
            reporter,
            given,
            None if perfect else AS_BUILT_SEED,
            estimator,
            ground_test=as_built,
        )
    write_readme(result, reporter.lines)
    show_result(console, result, verbose)
    if can:
        _fly_over_bus(console, output, can_duration, can_authenticated)
    console.print(f"{perf_counter() - start:.1f} s in all", highlight=False, soft_wrap=True)


def _fly_over_bus(console: Console, folder: Path, duration: float, is_authenticated: bool) -> None:
    """Fly plant and estimator as sender and bridge, and show the results of both."""
    from strainfmu.can.demo import CYCLE_TIME, fly_over_bus
    from strainfmu.cli.commands.can_send import score_table

    with ConsoleReporter(console).stage(f"CAN bus: sender -> bridge, {duration:g} s at {1.0 / CYCLE_TIME:g} Hz"):
        flown = fly_over_bus(folder, duration, is_authenticated)
    console.print(score_table(flown.score, "Over the CAN bus: the bridge's results against truth"))
    console.print(flown.bridge, highlight=False, markup=False, soft_wrap=True)


def check(vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")]) -> None:
    """Check a vehicle file, its gauges, the reach of the flow solver, and the manoeuvre of the demonstration.

    Solves the flows at the lowest and highest Mach number and angle of attack, which takes seconds.

    Example:

        strainfmu check my_vehicle.toml
    """
    from strainfmu.cli.inspection.vehicle import check_vehicle

    check_vehicle(vehicle, Console())
