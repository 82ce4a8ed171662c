"""Errors of many kinds on a map: ``strainfmu stress``."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

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

if TYPE_CHECKING:
    from builder.stress.run import StressResult


def stress(
    vehicle: Annotated[
        Path | None, typer.Argument(help="Vehicle file (TOML). Default: the IC3X surrogate that is shipped.")
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("stress"),
    inverse_map: Annotated[
        Path | None,
        typer.Option(
            "--map", metavar="MAP", help="Map to test (map.h5). Default: the vehicle's, built in the folder."
        ),
    ] = None,
    conditions: Annotated[
        int, typer.Option(metavar="N", callback=within(1, 10_000), help="Flight conditions of each kind of error.")
    ] = 200,
    draws: Annotated[
        int,
        typer.Option(
            metavar="N",
            callback=within(1, 10_000),
            help="Vehicles, and noise, at every condition; of the nonlinear estimator a fourth.",
        ),
    ] = 20,
    seed: Annotated[int, typer.Option(callback=within(0, 2**31 - 1), help="Seed of all draws.")] = 1,
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    structure: Annotated[Path | None, STRUCTURE_OPTION] = None,
    rebuild: Annotated[bool, REBUILD_OPTION] = False,
    estimator: Annotated[Estimator | None, ESTIMATOR_OPTION] = None,
) -> None:
    """Try some sixty kinds of error on a map: how many samples health flags, how many are wrong without a word.

    Flies an independent, finer model of the vehicle: each hardware error, gauges off, temperature, flights beyond
    the envelope, another engine's pressure. Silent is a sample with a coefficient outside 3 sigma while health is
    OK; flagged is any other health, DEGRADED too. Classes: within (envelope, and twice the stated sizes), outside
    (beyond), unobservable (the strain is that of another flight). Of sections or a surface every flight has a flow
    of its own; beyond the envelope fly a quarter of them.

    Writes stress.json, stress.csv and stress.png. Flows are kept as they are solved: an ended run goes on, a
    second run reuses what is up to date. Without --map, snapshots and structure are taken as by `build`.

    Examples:

        strainfmu stress my_vehicle.toml -o stress

        strainfmu stress my_vehicle.toml -o stress --map results/map.h5 --conditions 500
    """
    from builder.pipeline.pipeline import FilesGiven
    from builder.stress.run import run_stress
    from builder.stress.score import Effort
    from builder.vehicle.file import IC3X
    from strainfmu.errors import InputError

    given = FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild)
    of_build = {**given.as_text(), **({"--rebuild": ""} if rebuild else {})}
    of_build |= {} if estimator is None else {"--estimator": estimator}
    if inverse_map is not None and of_build:
        named = next(iter(of_build))
        raise InputError(f"--map: expected without {named}, which is for building a map, got both")
    console, start = Console(), perf_counter()
    with naming(vehicle or IC3X):
        result = run_stress(
            vehicle or IC3X,
            output,
            ConsoleReporter(console),
            effort=Effort(conditions=conditions, draws=draws, seed=seed),
            map_path=inverse_map,
            given=given,
            estimator=estimator,
        )
    _show(console, result)
    written = ", ".join(str(path) for path in result.files)
    console.print(
        f"{written}: {perf_counter() - start:.1f} s in all", highlight=False, markup=False, soft_wrap=True
    )


def _show(console: Console, result: StressResult) -> None:
    table = Table(title=escape(f"{result.vehicle}: errors on the independent model, share of the samples [%]"))
    for heading in ("error", "size", "class", "flagged", "silent", ""):
        table.add_column(heading, justify="right" if heading in ("flagged", "silent") else "left")
    for one in result.entries:
        table.add_row(
            escape(one["error"]),
            escape(one["size"]),
            one["class"],
            f"{one['flagged_percent']:.2f}",
            f"{one['silent_percent']:.2f}",
            "missed" if one["missed"] else "",
        )
    console.print(table)
    for line in result.missed:
        console.print(f"target missed: {line}", highlight=False, markup=False, soft_wrap=True)
