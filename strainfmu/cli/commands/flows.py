"""Surface pressure: ``strainfmu snapshots`` solves flows, ``surface`` and ``convert`` serve other programs."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from rich.console import Console

import builder
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.number_ranges import within


def snapshots(
    vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")] = Path("snapshots.h5"),
    sets: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="P1|P2|FILE.csv",
            help="Flight conditions: a set of the source or a CSV file; may be given several times. "
            "Default: the vehicle file's.",
        ),
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(help="euler, newtonian or table. Default: the vehicle file's."),
    ] = None,
    grid: Annotated[
        str | None,
        typer.Option(help="Cells of the euler engine: coarse, medium or fine. Default: the vehicle file's."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers solve, tcp://host:port."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            callback=within(0, 1024),
            help="Local worker processes; 0: threads of this process. Default: one per core.",
        ),
    ] = None,
) -> None:
    """Solve the flow at many flight conditions: surface pressure in one HDF5 file.

    Every distinct flow is solved once and kept: an interrupted run continues, a finished file is reused.
    Conditions outside the reach of the flow model are listed and left out, with exit code 3. Another run tries
    them again.

    Examples:

        strainfmu snapshots my_vehicle.toml -o snapshots.h5

        strainfmu snapshots my_vehicle.toml --set P1 --set P2 --grid medium

        strainfmu snapshots my_vehicle.toml --set conditions.csv --scheduler tcp://cluster:8786
    """
    given, console, start = dict(locals()), Console(), perf_counter()
    from builder.campaign.failures import ConditionsMissing, missing_line

    result = builder.snapshots(**given | {"sets": sets or ()}, progress=ConsoleReporter(console))
    state = "up to date, not written again" if result.up_to_date else "written"
    console.print(
        f"{output}: {state}, {perf_counter() - start:.1f} s in all", highlight=False, markup=False, soft_wrap=True
    )
    if result.failed:
        raise ConditionsMissing(f"{output}: {missing_line(result.failed, len(result.snapshots.condition))}")


def surface(
    vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write: .stl, .tri, .vtp or .vtu.")],
    closed: Annotated[bool, typer.Option("--closed", help="Cover the open base, as volume meshers need.")] = False,
) -> None:
    """Write a vehicle's aerodynamic surface, in body axes (x aft, y starboard, z up) and metres.

    Examples:

        strainfmu surface my_vehicle.toml -o body.stl --closed

        strainfmu surface my_vehicle.toml -o body.tri
    """
    builder.surface(vehicle, output, closed=closed)
    Console().print(f"{output}: written", highlight=False, markup=False, soft_wrap=True)


def convert(
    snapshots: Annotated[Path, typer.Argument(help="Surface pressures of a campaign (snapshots.h5).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the files and their manifest.")],
    file_format: Annotated[str, typer.Option("--format", help="vtu (ParaView), triq (Cart3D) or csv.")] = "vtu",
) -> None:
    """Write every snapshot as a file of its own, and the manifest that imports them again.

    Example:

        strainfmu convert results/snapshots.h5 -o fields --format vtu
    """
    files = builder.convert(**locals())
    Console().print(
        f"{files[-1]}: written, with {len(files) - 1} files next to it", highlight=False, soft_wrap=True
    )
