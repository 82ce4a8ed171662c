"""Surface pressure: ``strainfmu snapshots`` solves flows, ``surface`` and ``convert`` serve other programs."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from rich.console import Console

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
    from builder.aero.engines.registry import make_engine
    from builder.campaign.failures import ConditionsMissing, missing_line
    from builder.campaign.notes import campaign_notes
    from builder.campaign.run import run_campaign
    from builder.campaign.scheduling import Scheduling
    from builder.campaign.snapshot_fit import replaced_line
    from builder.campaign.vehicle_campaign import vehicle_campaign
    from builder.vehicle.conditions.flight_conditions import condition_set, count_repeated
    from builder.vehicle.file import load_vehicle

    start = perf_counter()
    scheduling = Scheduling(scheduler, workers)
    loaded = load_vehicle(vehicle)
    chosen = [condition_set(name) for name in sets or ()]
    console = Console()
    reporter = ConsoleReporter(console)
    source = make_engine(loaded, engine, loaded.resolution.map, grid, reporter.note)
    given = {"set": list(sets or ()), "engine": engine, "grid": grid}
    campaign = vehicle_campaign(loaded, source, chosen, {name: value for name, value in given.items() if value})
    repeated = count_repeated(campaign.conditions)
    if repeated:
        reporter.note(f"{repeated} conditions are in the sets more than once: kept in each, solved once")
    replaced = replaced_line(output, campaign)
    if replaced:
        reporter.note(replaced)
    result = run_campaign(campaign, output, scheduling, reporter)
    for note in campaign_notes(result):
        reporter.note(note)
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
    from builder.aero.cfd.formats.surface_export import write_surface
    from builder.aero.engines.registry import make_engine
    from builder.vehicle.file import load_vehicle

    loaded = load_vehicle(vehicle)
    # Imported results need this surface before they exist, so it is never theirs that is asked for.
    engine = "euler" if loaded.aerodynamics.surface is None else "newtonian"
    write_surface(output, make_engine(loaded, engine, loaded.resolution.map).surface, closed)
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
    from builder.campaign.field_export import export_snapshots
    from builder.campaign.snapshots import load_snapshots

    files = export_snapshots(load_snapshots(snapshots), output, file_format)
    Console().print(
        f"{files[-1]}: written, with {len(files) - 1} files next to it", highlight=False, soft_wrap=True
    )
