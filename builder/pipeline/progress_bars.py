"""Progress bars: stages and notes of long work on a console."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


class ConsoleReporter:
    """A reporter that shows stages as progress bars and notes as lines."""

    def __init__(self, console: Console) -> None:
        self.console = console

    @contextmanager
    def stage(self, title: str) -> Iterator[Callable[[int, int], None]]:
        columns = (
            TextColumn("{task.description:<40}", markup=False),
            BarColumn(bar_width=30),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
        )
        start = perf_counter()
        with Progress(*columns, console=self.console, transient=True) as bars:
            task = bars.add_task(title, total=None)
            yield lambda done, of: bars.update(task, completed=done, total=of)
        took = f"{title:<40} {perf_counter() - start:6.1f} s"
        self.console.print(took, highlight=False, markup=False, soft_wrap=True)

    def note(self, text: str) -> None:
        self.console.print(f"  {text}", style="dim", highlight=False, markup=False, soft_wrap=True)
