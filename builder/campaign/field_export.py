"""Snapshots for other programs: one file per flight condition, and the manifest that reads them back."""

import io
from math import degrees
from pathlib import Path
from typing import Literal

import numpy as np

from builder.aero.cfd.formats.cart3d import write_cart3d
from builder.aero.cfd.formats.point_table import NORMALS
from builder.aero.cfd.formats.vtk_files import write_vtk
from builder.aero.cfd.units import pressure_coefficient
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots, load_snapshots
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically
from strainfmu.flight_condition import FlightCondition

FIELD_FORMATS = ("vtu", "triq", "csv")
MANIFEST = "manifest.toml"
COLLECTION = "snapshots.pvd"

# What each format holds, as the manifest's entries declare it.
_DECLARED = {
    "vtu": 'quantity = "p"\nunit = "Pa"\narray = "p"\n',
    "triq": 'quantity = "Cp"\narray = "Cp"\n',
    "csv": 'quantity = "p"\nunit = "Pa"\narray = "p_Pa"\n',
}


def convert(
    snapshots: str | Path, output: str | Path, *, file_format: Literal["vtu", "triq", "csv"] = "vtu"
) -> list[Path]:
    """Write every snapshot as a file of its own, and the manifest that imports them again.

    On the command line::

        strainfmu convert results/snapshots.h5 -o fields --format vtu

    Parameters
    ----------
    snapshots : surface pressures of a campaign (snapshots.h5).
    output : folder for the files and their manifest.
    file_format : "vtu" (ParaView), "triq" (Cart3D) or "csv".
    """
    return export_snapshots(load_snapshots(snapshots), Path(output), file_format)


def export_snapshots(snapshots: Snapshots, folder: Path, file_format: str) -> list[Path]:
    """Write every snapshot's surface field into ``folder``, then the manifest that names them.

    Each .vtu holds p [Pa], p/p_inf and Cp at the nodes (and snapshots.pvd lists them for ParaView, numbered
    from 1), each .csv the same with coordinates [m] and normals, each .triq Cp alone: that is the only one of
    Cart3D's scalars that a surface pressure settles.

    Returns
    -------
    The files written, the manifest last.

    Raises
    ------
    InputError
        The format is none of these.
    StrainfmuError
        A file could not be written, or needs VTK and that is not installed.
    """
    if file_format not in FIELD_FORMATS:
        raise InputError(f"--format: '{file_format}' found, must be one of {', '.join(FIELD_FORMATS)}")
    conditions = snapshots.conditions()
    names = [f"case_{number:04d}.{file_format}" for number in range(1, len(conditions) + 1)]
    mesh = snapshots.surface
    for name, condition, pressure in zip(names, conditions, snapshots.pressure, strict=True):
        _write_field(folder / name, mesh, pressure, condition)
    files = [folder / name for name in names]
    if file_format == "vtu":
        files.append(folder / COLLECTION)
        write_bytes_atomically(files[-1], _collection(names).encode("ascii"))
    files.append(folder / MANIFEST)
    write_bytes_atomically(files[-1], _manifest(names, conditions, file_format).encode("utf-8"))
    return files


def _write_field(path: Path, mesh: SurfaceMesh, pressure: FloatArray, condition: FlightCondition) -> None:
    ratio = pressure / condition.ambient_pressure
    cp = pressure_coefficient(ratio, condition.mach_number)
    if path.suffix == ".vtu":
        write_vtk(path, mesh, {"p": pressure, "p_over_p_inf": ratio, "Cp": cp})
    elif path.suffix == ".triq":
        write_cart3d(path, mesh.point, mesh.triangle, np.ones(len(mesh.triangle), dtype=np.int64), cp)
    else:
        names = ["x_m", "y_m", "z_m", *NORMALS, "p_Pa", "p_over_p_inf", "Cp"]
        columns = [*mesh.point.T, *mesh.node_normal.T, pressure, ratio, cp]
        text = io.StringIO()
        np.savetxt(text, np.stack(columns, axis=1), "%.12g", ",", header=",".join(names), comments="")
        write_bytes_atomically(path, text.getvalue().encode("ascii"))


def _manifest(names: list[str], conditions: list[FlightCondition], file_format: str) -> str:
    lines = [_DECLARED[file_format] + 'length_unit = "m"\naxes = "aft starboard up"\n']
    for name, condition in zip(names, conditions, strict=True):
        lines.append(
            f'[[case]]\nfile = "{name}"\n'
            f"mach_number = {_toml(condition.mach_number)}\n"
            f"angle_of_attack_deg = {_toml(degrees(condition.angle_of_attack))}\n"
            f"sideslip_angle_deg = {_toml(degrees(condition.sideslip_angle))}\n"
            f"altitude_km = {_toml(1e-3 * condition.altitude)}\n"
        )
    return "\n".join(lines)


def _toml(value: float) -> str:
    """Return a TOML float of 12 digits: enough to distinguish conditions, without a conversion's last bits."""
    return repr(float(f"{value:.12g}"))


def _collection(names: list[str]) -> str:
    """Return a ParaView collection of the files, the number of the condition as its time."""
    sets = "".join(f'    <DataSet timestep="{i}" file="{name}"/>\n' for i, name in enumerate(names, start=1))
    return f'<VTKFile type="Collection" version="0.1">\n  <Collection>\n{sets}  </Collection>\n</VTKFile>\n'
