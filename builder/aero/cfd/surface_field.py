"""A quantity on a surface, as a flow solver wrote it: one form for all file formats."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from builder.aero.cfd.formats.cart3d import read_cart3d
from builder.aero.cfd.formats.point_table import read_point_table
from builder.aero.cfd.formats.surface_files import VTK_FORMATS
from builder.aero.cfd.formats.vtk_files import read_vtk
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

Location = Literal["node", "cell"]

FIELD_FORMATS = (*VTK_FORMATS, ".triq", ".csv")


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceField:
    """Values at points or in cells of a surface.

    Attributes
    ----------
    point : (n, 3) [m].
    triangle : (m, 3) point numbers, or None for a cloud of points.
    values : (n,) at the points, or one per cell of the file, in the file's unit.
    location : 'node' or 'cell'.
    array : name of the quantity in the file.
    face : (m,) the entry of ``values`` that holds on each triangle; None where values are at nodes.
    normal : (n, 3) outward normals of a cloud's points, where the file gives them; need not be of unit length.
    """

    point: FloatArray
    triangle: IntArray | None
    values: FloatArray
    location: Location
    array: str
    face: IntArray | None = None
    normal: FloatArray | None = None


def read_field(path: Path, array: str | None, location: Location | None, metres_per_unit: float) -> SurfaceField:
    """Read one quantity on a surface; the format is known by the suffix.

    Parameters
    ----------
    path : .vtk, .vtp, .vtu, .triq (Cart3D, ASCII) or .csv (points).
    array : name of the quantity in the file; None is enough where there is no other (in .triq it means Cp).
    location : 'node' or 'cell', needed where arrays of that name are at both.
    metres_per_unit : of the file's coordinates.

    Raises
    ------
    InputError
        The file is missing, damaged or of another format, the array is not there or not settled, or a value is
        not finite.
    """
    suffix = path.suffix.lower()
    if suffix in VTK_FORMATS:
        field = _vtk_field(path, array, location)
    elif suffix == ".triq":
        triangulation = read_cart3d(path)
        name = _choose(path, array or "Cp", list(triangulation.scalars), "scalars")
        _only_at_nodes(path, location)
        field = SurfaceField(
            point=triangulation.point,
            triangle=triangulation.triangle,
            values=triangulation.scalars[name],
            location="node",
            array=name,
        )
    elif suffix == ".csv":
        _only_at_nodes(path, location)
        table = read_point_table(path, array, metres_per_unit)
        field = SurfaceField(
            point=table.point,
            triangle=None,
            values=table.values,
            location="node",
            array=table.column,
            normal=table.normal,
        )
    else:
        raise InputError(f"{path}: '{path.suffix}' found, CFD results must be {', '.join(FIELD_FORMATS)}")
    return _checked(path, field, metres_per_unit)


def _vtk_field(path: Path, array: str | None, location: Location | None) -> SurfaceField:
    surface = read_vtk(path)
    arrays_at: dict[Location, Mapping[str, FloatArray]] = {
        "node": surface.node_arrays,
        "cell": surface.cell_arrays,
    }
    available: list[tuple[Location, str]] = [
        (place, name) for place, arrays in arrays_at.items() if location in (None, place) for name in arrays
    ]
    fitting = [(place, name) for place, name in available if array in (None, name)]
    listed = ", ".join(f"'{name}' ({place})" for place, name in available) or "none"
    if not fitting:
        unread = f"; no scalars of real numbers: {', '.join(surface.other_arrays)}" if surface.other_arrays else ""
        raise InputError(
            f"{path}: no array {f'{array!r}' if array else 'of values'} found; there are: {listed}{unread}"
        )
    if len(fitting) > 1:
        entry = "location" if array else "array"
        raise InputError(
            f"{path}: {len(fitting)} arrays could be meant, name one with '{entry}'; there are: {listed}"
        )
    place, name = fitting[0]
    at_nodes = place == "node"
    face = None if at_nodes else surface.face
    return SurfaceField(
        point=surface.point,
        triangle=surface.triangle,
        values=arrays_at[place][name],
        location=place,
        array=name,
        face=face,
    )


def _choose(path: Path, name: str, names: list[str], kind: str) -> str:
    if name not in names:
        raise InputError(f"{path}: no array '{name}' found; {kind} there: {', '.join(names)}")
    return name


def _only_at_nodes(path: Path, location: Location | None) -> None:
    if location == "cell":
        raise InputError(f"{path}: location 'cell' found, a {path.suffix} file holds values at points ('node')")


def _checked(path: Path, field: SurfaceField, metres_per_unit: float) -> SurfaceField:
    """Keep the points and cells that belong to the surface, in metres; refuse values that are not finite."""
    point, triangle, values, face = field.point, field.triangle, field.values, field.face
    if triangle is not None:
        a, b, c = (point[triangle[:, k]] for k in range(3))
        # Not "area > 0": a triangle with a coordinate that is no number must reach the check below.
        with np.errstate(over="ignore", invalid="ignore"):
            solid = ~(np.linalg.norm(np.cross(b - a, c - a), axis=1) == 0.0)
        triangle, face = triangle[solid], None if face is None else face[solid]
        if not len(triangle):
            raise InputError(f"{path}: no surface triangle with an area found")
        used, inverse = np.unique(triangle, return_inverse=True)
        point, triangle = point[used], inverse.reshape(-1, 3).astype(np.int64)
        if face is None:
            values = values[used]
        else:
            used_faces, face = np.unique(face, return_inverse=True)
            values, face = values[used_faces], face.astype(np.int64)
    if not np.isfinite(point).all():
        wild = np.isfinite(point).sum(axis=1) < 3
        raise InputError(f"{path}: point {_first(wild)} has a coordinate that is not finite")
    if not np.isfinite(values).all():
        bad = ~np.isfinite(values)
        what = "point" if face is None else "cell"
        raise InputError(
            f"{path}: array '{field.array}': {int(bad.sum())} of {len(values)} values are not finite, the first "
            f"at {what} {_first(bad)} of the surface"
        )
    return SurfaceField(
        point=metres_per_unit * point,
        triangle=triangle,
        values=values,
        location=field.location,
        array=field.array,
        face=face,
        normal=field.normal,
    )


def _first(mask: NDArray[np.bool_]) -> int:
    return int(np.flatnonzero(mask)[0])
