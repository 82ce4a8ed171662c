"""A vehicle file from one end to the other: ``strainfmu demo`` and ``strainfmu check``."""

from pathlib import Path
from time import perf_counter
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
from builder.pipeline.progress_bars import ConsoleReporter
from builder.vehicle.toml.reading import naming
from strainfmu.cli.commands.demo_results import show_result, write_readme
from strainfmu.cli.commands.printed import say


def demo(*, vehicle: Path | None, verbose: bool, **options: Any) -> None:
    """Run the demonstration, print its accuracy and write its README.txt."""
    from builder.processors import keep_freed_memory, one_thread_of_blas

    console, start = Console(), perf_counter()
    reporter = ConsoleReporter(console, is_verbose=verbose)
    keep_freed_memory()
    with naming(vehicle or builder.IC3X), one_thread_of_blas():
        result = builder.demo(vehicle=vehicle, **options, progress=reporter)
    write_readme(result, reporter.lines)
    show_result(console, result, verbose)
    if result.over_bus is not None:
        from strainfmu.cli.commands.can_bus import score_table

        console.print(score_table(result.over_bus.score, "Over the CAN bus: the bridge's results against truth"))
        say(result.over_bus.bridge)
    say(f"{perf_counter() - start:.1f} s in all")


def check(*, vehicle: Path) -> None:
    """Check a vehicle file and print what it describes."""
    result = builder.check(vehicle, progress=True)
    table = Table(title=escape(f"{vehicle}: {result.name}"), show_header=False)
    for row in result.rows:
        table.add_row(*map(escape, row))
    Console().print(table)
    say(*result.lines)
