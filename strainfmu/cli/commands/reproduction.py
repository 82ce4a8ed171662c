"""The source paper done again: ``strainfmu reproduce``."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

import builder
from builder.pipeline.progress_bars import ConsoleReporter


def reproduce(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("reproduction"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Coarse grids: minutes instead of a quarter of an hour.")
    ] = False,
) -> None:
    """Reproduce the tables and figures of the source paper with the shipped vehicle.

    Three set-ups: linear tetrahedra as in the paper, a converged mesh, and data of another mesh than the
    map's. Writes report.html, numbers.json, tables/*.csv and figures/*.png. A second run reuses what is up to
    date.

    Examples:

        strainfmu reproduce --quick

        strainfmu reproduce -o paper
    """
    given, console, start = dict(locals()), Console(), perf_counter()
    from builder.reproduce.setups import TITLES

    made = builder.reproduce_paper(**given, progress=ConsoleReporter(console))
    table = Table(title="Published and ours" + (" on coarse grids, not converged" if quick else ""))
    for heading in ("quantity", "published", *TITLES.values()):
        table.add_column(heading, justify="left" if heading == "quantity" else "right")
    for row in made.parity:
        table.add_row(row.published.quantity, row.published.value, *(row.shown(key) for key in TITLES))
    console.print(table)
    for one in made.verdicts:
        where = [title for key, title in TITLES.items() if one.holds[key]]
        console.print(
            f"{one.text}: {'; '.join(where) if where else 'nowhere'}",
            highlight=False,
            markup=False,
            soft_wrap=True,
        )
    console.print(
        f"{output / 'report.html'}: written, {perf_counter() - start:.1f} s in all",
        highlight=False,
        soft_wrap=True,
    )
