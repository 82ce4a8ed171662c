"""Structures of another code, as ``strainfmu structure`` handles them: loads out, strains in."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from strainfmu.errors import InputError

if TYPE_CHECKING:
    from builder.structure.solid.model import SolidCase
    from builder.vehicle.file import Vehicle


def needed_snapshots(path: Path | None, beside: Path, why: str) -> Path:
    """Return the snapshots to use: the given ones, else ``snapshots.h5`` next to a file.

    Raises
    ------
    InputError
        There are none; ``why`` says what needs them.
    """
    found = path or beside / "snapshots.h5"
    if not found.is_file():
        raise InputError(f"{found}: no such file; {why} needs snapshots: strainfmu snapshots VEHICLE -o {found}")
    return found


def write_loads(vehicle: Vehicle, snapshots: Path, folder: Path, file_format: str, console: Console) -> None:
    """Write the load cases of ``snapshots`` for another structural code, and say what to do with them."""
    from builder.campaign.snapshot_fit import body_misfits
    from builder.campaign.snapshots import load_snapshots
    from builder.structure.external.load_cases import load_cases
    from builder.structure.external.load_export import NASTRAN, export_loads
    from builder.structure.solid.case import solid_case
    from builder.vehicle.map_needs import used_layouts
    from builder.workspace import refuse_misfits

    loaded = load_snapshots(snapshots)
    refuse_misfits(snapshots, body_misfits(loaded, vehicle.body()))
    cases, layouts = load_cases(vehicle, loaded), solid_case(vehicle, used_layouts(vehicle)).layouts
    files = export_loads(cases, layouts, vehicle.gauges.layout, folder, file_format)
    _say(
        console, f"{folder}: {len(cases.names)} load cases on {len(cases.surface.point)} nodes, {len(files)} files"
    )
    if file_format == NASTRAN:
        _say(
            console, f"run them as SUBCASEs, and name {files[-1]} and the results in the vehicle file: [structure]"
        )
        return _say(console, "strain_per_snapshot, nastran_results, nastran_gauges")
    _say(console, f"fill in {files[-1]}, and name it in the vehicle file: [structure] strain_per_snapshot")


def write_influence_of(case: SolidCase, vehicle: Vehicle, output: Path, console: Console) -> None:
    """Write the influence matrix of a mesh of ours."""
    from builder.structure.external.influence_export import export_influence

    if output.suffix.lower() not in (".h5", ".hdf5"):
        raise InputError(f"--export-influence: expected a file .h5, got {output}")
    found = export_influence(case, vehicle.gauges.layout, output)
    _say(console, f"{output}: {len(found.column)} gauges, forces at {len(found.node)} nodes, written")


def write_external(vehicle: Vehicle, snapshots: Path, output: Path, console: Console) -> None:
    """Write the structure behind the file that the vehicle file names."""
    from builder.campaign.snapshots import load_snapshots
    from builder.structure.external.structure import external_structure
    from builder.structure.structure_file import save_structure

    made = external_structure(vehicle, load_snapshots(snapshots))
    save_structure(made, output)
    for layout in made.layouts:
        _say(console, f"layout {layout}: {len(made.gauges_of(layout))} gauges, {len(made.point)} pressure nodes")
    _say(console, f"{output}: {made.model.replace('_', ' ')}, {made.size}, written")


def _say(console: Console, text: str) -> None:
    console.print(text, highlight=False, markup=False, soft_wrap=True)
