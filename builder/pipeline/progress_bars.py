"""Progress bars: stages and notes of long work on a console."""

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

from builder.reporting import Reporter, Silent

ALWAYS_SHOWN = ("warning", "no score on held-out", "held-out conditions")
"""Beginnings of the notes that are shown in any case, as are files used as they are."""


class ConsoleReporter:
    """A reporter that shows stages as progress bars and notes as lines.

    Attributes
    ----------
    is_verbose : whether finished stages and all notes are shown; otherwise warnings, and files used as they are.
    lines : one for each finished stage and note, shown or not.
    """

    def __init__(self, console: Console, is_verbose: bool = True) -> None:
        self.console, self.is_verbose = console, is_verbose
        self.lines: list[str] = []

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
        is_shown = self.console.is_terminal  # elsewhere a bar leaves an empty line
        with Progress(*columns, console=self.console, transient=True, disable=not is_shown) as bars:
            task = bars.add_task(title, total=None)
            yield lambda done, total: bars.update(task, completed=done, total=total)
        took = f"{title:<40} {perf_counter() - start:6.1f} s"
        self.lines.append(took)
        if self.is_verbose:
            self.console.print(took, highlight=False, markup=False, soft_wrap=True)

    def note(self, text: str) -> None:
        self.lines.append(f"  {text}")
        if self.is_verbose or text.startswith(ALWAYS_SHOWN) or "used as it is" in text:
            self.console.print(f"  {text}", style="dim", highlight=False, markup=False, soft_wrap=True)


AnyProgress = bool | Reporter | None
"""None or False for silence, True for progress bars, or a reporter of the caller's."""


def reporter_of(progress: AnyProgress) -> Reporter:
    """Return the reporter that ``progress`` asks for."""
    if progress is None or progress is False:
        return Silent()
    return ConsoleReporter(Console()) if progress is True else progress
