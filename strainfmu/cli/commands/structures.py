"""Three-dimensional structures: ``strainfmu structure`` computes the strain of gauges per surface pressure."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

from rich.console import Console

import builder
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.printed import say


class _StageLog(ConsoleReporter):
    """Shows stages as progress bars and notes as lines; finished stages have the peak memory of the process."""

    @contextmanager
    def stage(self, title: str) -> Iterator[Callable[[int, int], None]]:
        from builder.processors import peak_memory

        with super().stage(title) as progress:
            yield progress
        self.lines[-1] += f"   peak memory {peak_memory() / 2**30:5.2f} GiB"

    def note(self, text: str) -> None:
        say(text)


def structure(
    *, vehicle: Path, output: Path, export_loads: Path | None, export_influence: Path | None, **options: Any
) -> None:
    """Compute strain per pressure, or write files for another structural code."""
    start, load_format, snapshots = perf_counter(), options.pop("load_format"), options.pop("snapshots")
    if export_loads is not None:
        snapshots = snapshots or output.parent / "snapshots.h5"
        return say(*builder.export_loads(vehicle, export_loads, load_format, snapshots=snapshots))
    log = _StageLog(Console(), is_verbose=False)
    if export_influence is not None:
        return say(*builder.export_influence(vehicle, export_influence, **options, progress=log))
    result = builder.run_structure(vehicle, output, **options, snapshots=snapshots, progress=log)
    say(*result.lines)
    if result.up_to_date is False:
        say(*log.lines)
    if result.up_to_date is not None:
        state = "up to date, not computed again" if result.up_to_date else "written"
        say(f"{output}: {state}, {perf_counter() - start:.1f} s in all")
