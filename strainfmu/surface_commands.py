"""The sub-commands that hand out the vehicle's surface and the fields on it, for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from strainfmu.commands import app


@app.command()
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
    from builder.aero.cfd.surface_export import write_surface
    from builder.aero.engines import make_engine
    from builder.vehicle import load_vehicle

    loaded = load_vehicle(vehicle)
    # Imported results need this surface before they exist, so it is never theirs that is asked for.
    engine = "euler" if loaded.aerodynamics.surface is None else "newtonian"
    write_surface(output, make_engine(loaded, engine, loaded.resolution.map).surface, closed)
    Console().print(f"{output}: written", highlight=False)


@app.command()
def convert(
    snapshots: Annotated[Path, typer.Argument(help="Surface pressures of a campaign (snapshots.h5).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the files and their manifest.")],
    file_format: Annotated[str, typer.Option("--format", help="vtu (ParaView), triq (Cart3D) or csv.")] = "vtu",
) -> None:
    """Write every snapshot as a file of its own, and the manifest that imports them again.

    Example:

        strainfmu convert results/snapshots.h5 -o fields --format vtu
    """
    from builder.aero.cfd.field_export import export_snapshots
    from builder.snapshots import load_snapshots

    files = export_snapshots(load_snapshots(snapshots), output, file_format)
    Console().print(f"{files[-1]}: written, with {len(files) - 1} files beside it", highlight=False)
