"""Studies of maps: ``strainfmu trial``, ``stress``, ``compare`` and ``study``, and ``reproduce`` of the paper."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
from strainfmu.cli.commands.printed import say, say_finished
from strainfmu.errors import SeveralErrors
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from builder.pipeline.trials import TrialResult
    from builder.study import StudyResult


WIDTH = 180
"""Smallest width of the table [characters]: it is of no use broken into columns of two letters."""


def trial(**options: Any) -> None:
    """Run a trial and print its table."""
    _show_trial(builder.run_trial, options)


def stress(**options: Any) -> None:
    """Run the trial of some sixty errors and print its table."""
    _show_trial(builder.stress, options)


def compare(**options: Any) -> None:
    """Run the trial of other estimators and print its table."""
    _show_trial(builder.compare, options)


def _show_trial(run: Callable[..., TrialResult], options: dict[str, Any]) -> None:
    """Run a trial as the options say, and print its table."""
    start = perf_counter()
    result = run(**options, progress=True)
    _show_errors(result)
    say_finished(", ".join(str(path) for path in result.files), start)


def _show_errors(result: TrialResult) -> None:
    from builder.trial.table import HEADINGS, TITLES, cells_of, in_order, loads_of, reasons

    wide, loads = Console(width=max(Console().width, WIDTH)), loads_of(result.rows)
    for name, rows in in_order(result.rows).items():
        title = escape(f"{result.vehicle}: {TITLES[name]}; samples [%]")
        table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
        for number, heading in enumerate(HEADINGS):
            is_text = number < 2 or heading == "verdict"
            table.add_column(heading, justify="left" if is_text else "right", no_wrap=not is_text)
        for row in rows:
            table.add_row(*(escape(cell) for cell in cells_of(row, loads[row["case"], row["estimator"]])))
        wide.print(table)
    say(*reasons(result.rows))


ROWS = 40
"""Designs that are shown; the files have all."""


def study(**options: Any) -> None:
    """Build and try the designs of a study, and print their table."""
    start = perf_counter()
    result = builder.run_study(**options, progress=True)
    if result.rows:
        _show_designs(result)
    say_finished(", ".join(str(path) for path in result.files) or "no design was scored", start)
    if result.faults:
        raise SeveralErrors("\n".join(result.faults))


def _show_designs(result: StudyResult) -> None:
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
    Console(width=max(Console().width, WIDTH)).print(table)
    if len(designs) > ROWS:
        say(f"{len(designs) - ROWS} more designs in the files")


def reproduce(*, output: Path, quick: bool) -> None:
    """Reproduce the paper and print published and own values."""
    start = perf_counter()
    from builder.reproduce.setups import TITLES

    made = builder.reproduce_paper(output, quick=quick, progress=True)
    table = Table(title="Published and ours" + (" on coarse grids, not converged" if quick else ""))
    for heading in ("quantity", "published", *TITLES.values()):
        table.add_column(heading, justify="left" if heading == "quantity" else "right")
    for row in made.parity:
        table.add_row(row.published.quantity, row.published.value, *(row.shown(key) for key in TITLES))
    Console().print(table)
    for verdict in made.verdicts:
        where = [title for key, title in TITLES.items() if verdict.holds[key]]
        say(f"{verdict.text}: {'; '.join(where) if where else 'nowhere'}")
    say(f"{output / 'report.html'}: written, {perf_counter() - start:.1f} s in all")
