"""A vehicle file from one end to the other: ``strainfmu demo`` and ``strainfmu check``."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from builder.figures.drawing.words import estimator_in_words
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
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from builder.pipeline.demonstration.demo import DemoResult

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
) -> None:
    """Build the map of a vehicle, package it as an FMU, and fly the FMU in a system simulation.

    Solves the flow, builds the inverse map, exports the FMU and flies it against the truth model of the
    vehicle. The vehicle flown has installation errors: gains, gauge places, wall and more are drawn at their
    specified sizes. A second run reuses the files that are up to date.

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
    start = perf_counter()
    if can:
        from strainfmu.can.tools.two_processes import check_multicast, private_port

        # Refused before the long work, not after it.
        check_multicast(private_port())
    given = FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild)
    with naming(vehicle or IC3X):
        result = run_demo(
            vehicle or IC3X,
            output,
            ConsoleReporter(console),
            given,
            None if perfect else AS_BUILT_SEED,
            estimator,
            ground_test=as_built,
        )
    _show_result(console, result)
    if can:
        _fly_over_bus(console, output, can_duration, can_authenticated)
    console.print(f"{perf_counter() - start:.1f} s in all", highlight=False, soft_wrap=True)


def _fly_over_bus(console: Console, folder: Path, duration: float, is_authenticated: bool) -> None:
    """Fly plant and estimator as sender and bridge, and show the results of both."""
    from strainfmu.can.tools.two_processes import CYCLE_TIME, fly_over_bus
    from strainfmu.cli.commands.can_send import score_table

    with ConsoleReporter(console).stage(f"CAN bus: sender -> bridge, {duration:g} s at {1.0 / CYCLE_TIME:g} Hz"):
        flown = fly_over_bus(folder, duration, is_authenticated)
    console.print(score_table(flown.score, "Over the CAN bus: the bridge's results against truth"))
    console.print(flown.bridge, highlight=False, markup=False, soft_wrap=True)


def _accuracy_table(title: str, scores: dict[str, Any]) -> Table:
    """Return a table of rms errors and coverage of the coefficients, two columns for each of ``scores``."""
    table = Table(title=title)
    table.add_column("")
    for name in scores:
        table.add_column(f"{name}: rms error", justify="right")
        table.add_column("truth within 3 sigma", justify="right")
    for coefficient in COEFFICIENT_NAMES:
        cells = [
            text
            for one in scores.values()
            for text in (f"{one['rms'][coefficient]:.2e}", f"{one['coverage_percent'][coefficient]:.2f} %")
        ]
        table.add_row(f"{coefficient} [1]", *cells)
    return table


def _show_estimators(console: Console, estimators: dict[str, Any]) -> None:
    """Show the accuracy of each estimator on the same strains."""
    in_words = {estimator_in_words(name): scores for name, scores in estimators.items()}
    table = _accuracy_table("Linear and nonlinear estimator on the same strains", in_words)
    air = estimators["nonlinear"]["air_data"]
    for name in ("angle_of_attack", "sideslip_angle"):
        cells = [f"{degrees(air['rms'][name]):.3f}", f"{air['coverage_percent'][name]:.2f} %"]
        table.add_row(escape(f"{name.replace('_', ' ')} [deg]"), "-", "-", *cells)
    console.print(table)


def _show_states(console: Console, states: dict[str, Any]) -> None:
    """Show the accuracy of the map before the ground test, after it, and if the vehicle were known."""
    console.print(
        _accuracy_table("The map before and after the ground test, and of the vehicle known exactly", states)
    )


def _score_table(title: str, score: dict[str, Any]) -> Table:
    """Return a table of a score, as files of results hold it."""
    table = Table(title=escape(title))
    for heading in ("coefficient [1]", "rms error", "of its range", "mean sigma", "truth within 3 sigma"):
        table.add_column(escape(heading), justify="left" if heading.startswith("coefficient") else "right")
    for name, error in score["rms_error"].items():
        of_range = score["rms_error_of_range"][name]
        table.add_row(
            name,
            f"{error:.2e}",
            "-" if of_range is None else f"{of_range:.2%}",
            f"{score['mean_sigma'][name]:.2e}",
            f"{100.0 * score['coverage'][name]:.2f} %",
        )
    return table


def _health_line(score: dict[str, Any]) -> str:
    """Return how often health is OK, and what it does not detect."""
    silent = [f"{name} {part:.2%}" for name, part in score["undetected"].items() if part > 0.0]
    return (
        f"Health OK in {score['healthy']:.2%} of the samples; truth beyond 3 sigma with health OK: "
        f"{', '.join(silent) or 'none'}."
    )


def _show_held_out(console: Console, score: dict[str, Any]) -> None:
    """Show the score on results that maps are made without, ahead of a flight with another physics."""
    console.print(_score_table("Held-out conditions of the imported results: estimate against truth", score))
    console.print(
        f"Maps made without {', '.join(score['left_out'])} in turn estimate what they are made without, "
        f"{score['flows']} flows inside the range of Mach numbers. {_health_line(score)}",
        highlight=False,
        markup=False,
        soft_wrap=True,
    )


def _show_result(console: Console, result: DemoResult) -> None:
    if result.held_out:
        _show_held_out(console, result.held_out)
    score = result.score
    console.print(
        _score_table(f"{result.vehicle}: the FMU's estimate against truth, {result.physics.model}", score.record())
    )
    if not result.physics.is_that_of_map:
        console.print(result.physics.sentence, highlight=False, markup=False, soft_wrap=True)
    console.print(
        f"Sigma holds: {', '.join(result.errors_in_sigma)}.", highlight=False, markup=False, soft_wrap=True
    )
    times = ", ".join(f"{name} {1e6 * value:.0f} us" for name, value in score.step_time.items())
    console.print(
        f"Time per step (median, through fmpy): {times}. {_health_line(score.record())}",
        highlight=False,
        soft_wrap=True,
    )
    if result.estimators:
        _show_estimators(console, result.estimators)
    if result.states:
        _show_states(console, result.states)
    files = Table(title=escape(f"Files in {result.folder}"), show_header=False, box=None)
    for name, holds in result.files.items():
        files.add_row(name, holds, "reused" if name in result.reused else "new")
    console.print(files)


def check(vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")]) -> None:
    """Check a vehicle file, its gauges, the reach of the flow solver, and the manoeuvre of the demonstration.

    Solves the flows at the lowest and highest Mach number and angle of attack, which takes seconds.

    Example:

        strainfmu check my_vehicle.toml
    """
    from strainfmu.cli.inspection.vehicle import check_vehicle

    check_vehicle(vehicle, Console())
