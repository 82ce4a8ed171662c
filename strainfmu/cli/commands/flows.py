"""Surface pressure: ``strainfmu snapshots``, ``surface`` and ``convert``; ``picture`` shows it."""

from pathlib import Path
from time import perf_counter
from typing import Any

import builder
from strainfmu.cli.commands.printed import say


def snapshots(*, output: Path, **options: Any) -> None:
    """Solve flows, and leave with another exit code where some are missing."""
    start = perf_counter()
    from builder.campaign.failures import ConditionsMissing, missing_line

    result = builder.snapshots(output=output, **options, progress=True)
    state = "up to date, not written again" if result.up_to_date else "written"
    say(f"{output}: {state}, {perf_counter() - start:.1f} s in all")
    if result.failed:
        raise ConditionsMissing(f"{output}: {missing_line(result.failed, len(result.snapshots.condition))}")


def surface(*, output: Path, **options: Any) -> None:
    """Write the surface of a vehicle."""
    builder.surface(output=output, **options)
    say(f"{output}: written")


def convert(**options: Any) -> None:
    """Write files of snapshots."""
    files = builder.convert(**options)
    say(f"{files[-1]}: written, with {len(files) - 1} files next to it")


def picture(*, output: Path, **options: Any) -> None:
    """Draw the vehicle and print the title of the picture."""
    scene = builder.picture(output=output, **options)
    say(f"{output}: {scene.title}; {len(scene.gauge_names)} gauges, written")
