"""Closed-loop flight: ``strainfmu fly``, and the native plant alone: ``strainfmu plant``."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
import strainfmu
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.printed import say

if TYPE_CHECKING:
    from strainfmu.cosim.flight import FlightResult
    from strainfmu.cosim.scenario import Scenario


def fly(*, output: Path, figures: bool, **options: Any) -> None:
    """Fly a scenario, draw it and print the table; exit code 1 if the loop does not hold its angle of attack."""
    flown = strainfmu.fly(output=output, **options, progress=ConsoleReporter(Console()).stage)
    written = [*flown.files, *(builder.flight_figures(flown, output) if figures else ())]
    _print_results(Console(), flown.scenario, flown.results)
    say(*(f"{path}: written" for path in written))
    if flown.fault is not None:
        raise flown.fault
    if not all(result.holds for result in flown.results.values()):
        say("the loop does not hold its angle of attack")
        raise typer.Exit(1)


def plant(*, output: Path, **options: Any) -> None:
    """Write the FMU of a plant."""
    strainfmu.plant(output=output, **options)
    say(f"{output}: written")


def _print_results(console: Console, scenario: Scenario, results: dict[str, FlightResult]) -> None:
    """Print one column per run."""
    from strainfmu.cosim.flight import fault_text

    table = Table(title=escape(f"{scenario.name}: {scenario.stop_time:g} s at {1.0 / scenario.step_size:g} Hz"))
    table.add_column("")
    for feedback in results:
        table.add_column(f"feedback of {feedback}", justify="right")
    shown = list(results.values())
    rows = {
        "tracking error, rms": [f"{degrees(r.tracking_error):.3f} deg" for r in shown],
        "largest error when settled": [f"{degrees(r.settled_error):.3f} deg" for r in shown],
        "inferred angle, rms error": [f"{degrees(r.angle_error):.3f} deg" for r in shown],
        "C_N, rms error": [f"{r.coefficient_error[0]:.2e}" for r in shown],
        "M_P, rms error": [f"{r.coefficient_error[1]:.2e}" for r in shown],
        "health": [", ".join(f"{name} {fraction:.2%}" for name, fraction in r.health.items()) for r in shown],
    }
    for index, event in enumerate(scenario.faults):
        reports = [r.faults[index] for r in shown]
        rows[escape(fault_text(event))] = [
            f"{_after(report.reported_after, 'reported')}, {_after(report.isolated_after, 'isolated')}"
            for report in reports
        ]
    for name, cells in rows.items():
        table.add_row(name, *cells)
    console.print(table)
    if {"truth", "estimate"} <= results.keys():
        ratio = results["estimate"].tracking_error / results["truth"].tracking_error
        console.print(f"Tracking error with the estimate: {ratio:.3f} of that with truth.", highlight=False)


def _after(seconds: float | None, what: str) -> str:
    return f"not {what}" if seconds is None else f"{what} after {1e3 * seconds:.0f} ms"
