"""Cart3D triangulations: .tri (geometry) and .triq (annotated with values at the vertices), ASCII.

Format (NASA Ames, Cart3D documentation, "Surface Triangulation File Formats"), free format throughout:
``nVerts nTris [nScalars]``, then per vertex x y z, per triangle three vertex numbers from 1 on (anticlockwise seen
from the flow), per triangle a component number (may be missing in .tri), per vertex nScalars values. The first
scalar is Cp. flowCart writes six: Cp, rho, u, v, w, p, made dimensionless with rho_inf and a_inf, so that
p_inf is 1/gamma.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builder.aero.cfd.formats.text_numbers import numbers_of, read_file
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically

SCALARS = ("Cp", "rho", "u", "v", "w", "p")
"""Names of the six scalars that flowCart writes."""


@dataclass(frozen=True, eq=False)
class Triangulation:
    """What a .tri or .triq file holds.

    Attributes
    ----------
    point : (n, 3) vertices, in the file's length unit.
    triangle : (m, 3) vertex numbers from 0 on.
    scalars : name to (n,) values; empty for a .tri.
    """

    point: FloatArray
    triangle: IntArray
    scalars: dict[str, FloatArray]


def read_cart3d(path: Path) -> Triangulation:
    """Read a .tri or .triq file (ASCII).

    Raises
    ------
    InputError
        The file is missing, empty, binary or of the wrong length, a word is no number, or a triangle names a
        vertex that does not exist.
    """
    content = read_file(path)
    if b"\0" in content:
        raise InputError(f"{path}: binary Cart3D file found, only ASCII is read; write it as ASCII")
    annotated = path.suffix.lower() == ".triq"
    n_header = 3 if annotated else 2
    header_line, _, body = content.lstrip().partition(b"\n")
    first_line = content[: len(content) - len(content.lstrip())].count(b"\n") + 1
    header = numbers_of(path, header_line, first_line)
    if len(header) != n_header or (header != np.round(header)).any() or (header < 1).any():
        expected = "nVerts nTris nScalars" if annotated else "nVerts nTris"
        text = header_line.decode("ascii", "replace").strip()[:60]
        raise InputError(f"{path}: line {first_line}: {text!r} found, must be {expected}, each at least 1")
    counts = [int(value) for value in header]
    values = numbers_of(path, body, first_line + 1)
    return _divide(path, values, counts[0], counts[1], counts[2] if annotated else 0)


def _divide(path: Path, values: FloatArray, n_point: int, n_triangle: int, n_scalar: int) -> Triangulation:
    """Cut the numbers behind the header into vertices, triangles, components and scalars."""
    bare = 3 * n_point + 3 * n_triangle
    complete = bare + n_triangle + n_scalar * n_point
    if len(values) != complete and not (n_scalar == 0 and len(values) == bare):
        raise InputError(
            f"{path}: {len(values)} numbers behind the header, must be {complete} for {n_point} vertices, "
            f"{n_triangle} triangles, {n_scalar} scalars"
        )
    point = values[: 3 * n_point].reshape(-1, 3)
    triangle = values[3 * n_point : bare].reshape(-1, 3)
    wrong = (triangle < 1) | (triangle > n_point) | (triangle != np.round(triangle))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise InputError(
            f"{path}: triangle {row + 1} names vertex {triangle[row, column]:g}, whole numbers from 1 to "
            f"{n_point} allowed"
        )
    table = values[len(values) - n_scalar * n_point :].reshape(n_point, n_scalar) if n_scalar else np.empty((0, 0))
    names = SCALARS if n_scalar == len(SCALARS) else ("Cp", *(f"scalar_{k}" for k in range(2, n_scalar + 1)))
    scalars = {name: table[:, k].copy() for k, name in enumerate(names[:n_scalar])}
    return Triangulation(point, triangle.astype(np.int64) - 1, scalars)


def write_cart3d(
    path: Path, point: FloatArray, triangle: IntArray, component: IntArray, cp: FloatArray | None = None
) -> None:
    """Write a .tri, or with Cp (n,) at the vertices (n, 3) a .triq of one scalar; ASCII, atomically.

    ``component`` (m,) numbers the parts of the surface from 1 on, triangle by triangle.

    Raises
    ------
    StrainfmuError
        The file could not be written.
    """
    header = f"{len(point)} {len(triangle)}" + ("" if cp is None else " 1")
    lines = [header]
    lines += [f"{x:.16g} {y:.16g} {z:.16g}" for x, y, z in point.tolist()]
    lines += [f"{a} {b} {c}" for a, b, c in (triangle + 1).tolist()]
    lines += [str(number) for number in component.tolist()]
    lines += [] if cp is None else [f"{value:.16g}" for value in cp.tolist()]
    write_bytes_atomically(path, ("\n".join(lines) + "\n").encode("ascii"))
