"""Trade studies: ``strainfmu study``."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.number_ranges import within
from strainfmu.errors import StrainfmuError
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from builder.study import StudyResult

WIDTH = 120
"""Smallest width of the table [characters]."""

ROWS = 40
"""Designs that are shown; the files have all."""


def study(
    file: Annotated[Path, typer.Argument(metavar="STUDY", help="File of the study (study.toml).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("study"),
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            callback=within(1, 1000),
            help="Designs at a time on this machine. Default: the number of processors.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Dask scheduler, such as tcp://host:8786, whose workers share the folder."
        ),
    ] = None,
) -> None:
    """Build and fly a vehicle with other values of its entries: one table of all combinations.

    The file names the vehicle file and the entries that are swept. Each combination is a design: its map is built
    and estimates the flights of vehicles of the truth model, with installation errors and noise drawn.

    Writes study.csv, study.parquet (with pyarrow) and study.png, and the map of each design in its own folder.
    Designs that share flows solve them once. An interrupted study continues, and a second run reuses what is up to
    date.

    Examples:

        strainfmu study study.toml -o study

        strainfmu study study.toml -o study --workers 1
    """
    given, console, start = dict(locals()), Console(), perf_counter()
    result = builder.run_study(**given, progress=ConsoleReporter(console))
    if result.rows:
        _show(console, result)
    written = ", ".join(str(path) for path in result.files) or "no design was scored"
    console.print(
        f"{written}: {perf_counter() - start:.1f} s in all", highlight=False, markup=False, soft_wrap=True
    )
    if result.faults:
        raise StrainfmuError("\n".join(result.faults))


def _show(console: Console, result: StudyResult) -> None:
    first, designs = result.rows[0], dict[int, list[dict[str, Any]]]()
    for row in result.rows:
        designs.setdefault(row["design"], []).append(row)
    entries = list(first)[1 : list(first).index("gauges")]
    table = Table(title="rms error of the coefficients [1]")
    for heading in ("design", *entries, *COEFFICIENT_NAMES, "undetected [%]"):
        table.add_column(escape(heading.rpartition(".")[2]), justify="right")
    for number, (every, *loads) in list(designs.items())[:ROWS]:
        table.add_row(
            str(number),
            *(escape(str(every[name])) for name in entries),
            *(f"{row['rms']:.2e}" for row in loads[: len(COEFFICIENT_NAMES)]),
            f"{every['undetected_percent']:.2f} +- {every['undetected_percent_error']:.2f}",
        )
    Console(width=max(console.width, WIDTH)).print(table)
    if len(designs) > ROWS:
        console.print(f"{len(designs) - ROWS} more designs in the files", highlight=False)
