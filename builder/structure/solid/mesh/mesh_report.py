"""Summary of a mesh as rows for print: counts, quality of elements, volumes, areas, masses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from builder.structure.fourier.meridian_mesh import quadratic_shape
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.solid.elements.element_faces import FACE_CORNERS
from builder.structure.solid.elements.element_quality import determinant_ratio, jacobians, scaled_jacobian
from builder.structure.solid.elements.elements import MASS_DEGREE, reference_element, reference_facet
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

Row = tuple[str, float, str]

CHUNK = 20_000  # elements at once, to bound memory


def element_volumes(mesh: SolidMesh) -> FloatArray:
    """Return the volume (m,) of each element [m3], curved edges included."""
    reference = reference_element(mesh.element_type, MASS_DEGREE[mesh.element_type])
    volume = np.empty(len(mesh.element))
    for start in range(0, len(mesh.element), CHUNK):
        part = slice(start, start + CHUNK)
        determinant = np.linalg.det(jacobians(mesh.element_type, mesh.node, mesh.element[part], reference.point))
        volume[part] = determinant @ reference.weight
    return volume


def surface_area(mesh: SolidMesh, name: str) -> float:
    """Return the area of a named surface [m2], curved edges included.

    Raises
    ------
    InputError
        The mesh has no surface of that name.
    """
    reference = reference_facet(mesh.element_type)
    position = mesh.node[mesh.named_surface(name)]
    tangent = np.einsum("qad,fac->fqcd", reference.gradient, position)
    normal = np.cross(tangent[..., 0], tangent[..., 1])
    return float((np.linalg.norm(normal, axis=-1) @ reference.weight).sum())


def facet_size(mesh: SolidMesh, name: str) -> float:
    """Return the median length of the longest edge of a surface's facets [m], along the chord.

    Raises
    ------
    InputError
        The mesh has no surface of that name.
    """
    corner = mesh.node[mesh.named_surface(name)[:, : FACE_CORNERS[mesh.element_type]]]
    return float(np.median(np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=-1).max(axis=1)))


def facet_size_round_axis(mesh: SolidMesh, name: str, radius: float) -> float:
    """Return the size [m] of a surface's facets round the x axis, referred to a radius [m].

    Facets lock by their length over sqrt(r t): the median of length / sqrt(r) counts, times the root of
    ``radius``. A facet's length is taken along its edge that reaches furthest round the axis.

    Raises
    ------
    InputError
        The mesh has no surface of that name.
    """
    corner = mesh.node[mesh.named_surface(name)[:, : FACE_CORNERS[mesh.element_type]], 1:]
    following = np.roll(corner, -1, axis=1)
    middle = np.linalg.norm(0.5 * (corner + following), axis=-1)
    twice_area = np.abs(corner[..., 0] * following[..., 1] - corner[..., 1] * following[..., 0])
    along = np.divide(twice_area, middle**1.5, out=np.zeros_like(middle), where=middle > 0.0)
    return float(np.median(along.max(axis=1)) * np.sqrt(radius))


def exact_wall(body: BodyOfRevolution, wall: Wall) -> dict[str, float]:
    """Return the volume [m3] (key ``volume``) and the areas [m2] by surface name of the wall as drawn.

    By integrals over the meridian, exact for cones (Pappus) and to rounding for arcs.
    """
    meridian = shell_mesh(body, wall, body.length / 1000.0)
    outside, inside = meridian.node[meridian.outer_edge], meridian.node[meridian.inner_edge]
    return {
        "volume": _revolved_volume(outside) - _revolved_volume(inside),
        EXTERNAL: _revolved_area(outside),
        INTERNAL: _revolved_area(inside),
        SUPPORT: float(np.pi * (outside[-1, -1, 1] ** 2 - inside[-1, -1, 1] ** 2)),
    }


def _at_points(edge: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return radius, dx and dr (n, 5) of parabolic edges (n, 3, 2) at Gauss points, weights included."""
    xi, weight = np.polynomial.legendre.leggauss(5)
    shape, slope = quadratic_shape(xi)
    d_x, d_r = np.moveaxis(slope @ edge * weight[:, None], -1, 0)
    return (shape @ edge)[..., 1], d_x, d_r


def _revolved_volume(edge: FloatArray) -> float:
    r, d_x, _ = _at_points(edge)
    return float(np.pi * (r**2 * d_x).sum())


def _revolved_area(edge: FloatArray) -> float:
    r, d_x, d_r = _at_points(edge)
    return float(2.0 * np.pi * (r * np.hypot(d_x, d_r)).sum())


def mesh_report(
    mesh: SolidMesh, density: Mapping[str, float] | None = None, exact: Mapping[str, float] | None = None
) -> list[Row]:
    """Return the properties of a mesh as rows (what, value, unit).

    Parameters
    ----------
    mesh : the mesh.
    density : by name of region [kg/m3]; with it, the mass of each region and the total.
    exact : the volume [m3] (key ``volume``) and areas [m2] by surface name of the body meant, as of
        :func:`exact_wall`; with it, relative errors.

    Raises
    ------
    InputError
        A region has no density, or a density is not positive.
    """
    quality = scaled_jacobian(mesh.element_type, mesh.node, mesh.element)
    worst = mesh.node[mesh.element[quality.argmin()]].mean(axis=0)
    volume = element_volumes(mesh)
    ratio = determinant_ratio(mesh.element_type, mesh.node, mesh.element)
    rows: list[Row] = [
        ("nodes", mesh.n_nodes, ""),
        ("displacement components", mesh.n_dof, ""),
        (f"elements, {mesh.element_type}", len(mesh.element), ""),
        ("scaled Jacobian, minimum", float(quality.min()), ""),
        ("scaled Jacobian, mean", float(quality.mean()), ""),
        *((f"worst element at {axis}", float(at), "m") for axis, at in zip("xyz", worst, strict=True)),
        ("minimum determinant over mean", float(ratio.min()), ""),
        ("volume", float(volume.sum()), "m3"),
    ]
    for name in mesh.surface:
        rows += [
            (f"surface {name}, facets", len(mesh.surface[name]), ""),
            (f"surface {name}, area", surface_area(mesh, name), "m2"),
            (f"surface {name}, facet size", facet_size(mesh, name), "m"),
        ]
    return rows + _errors(rows, exact or {}) + _masses(mesh, volume, density)


def _errors(rows: Sequence[Row], exact: Mapping[str, float]) -> list[Row]:
    """Return relative errors of the volume and areas that are known."""
    found = {what: value for what, value, _ in rows}
    label = {name: "volume" if name == "volume" else f"surface {name}, area" for name in exact}
    return [
        (f"{label[name]}, error", 100.0 * (found[label[name]] / value - 1.0), "%")
        for name, value in exact.items()
        if label[name] in found
    ]


def _masses(mesh: SolidMesh, volume: FloatArray, density: Mapping[str, float] | None) -> list[Row]:
    if density is None:
        return []
    rows: list[Row] = []
    for i, name in enumerate(mesh.region_names):
        if not density.get(name, 0.0) > 0.0:
            raise InputError(
                f"density of region '{name}': {density.get(name)} found, must be greater than 0 kg/m3"
            )
        rows.append((f"mass of {name}", density[name] * float(volume[mesh.region == i].sum()), "kg"))
    return [*rows, ("mass", sum(value for _, value, _ in rows), "kg")]


def report_text(rows: Sequence[Row]) -> str:
    """Return rows as lines of text, values aligned, counts without decimals."""
    width = max(len(what) for what, _, _ in rows)
    texts = [f"{value:d}" if isinstance(value, int) else f"{value:.6g}" for _, value, _ in rows]
    lines = [f"{what:<{width}}  {text:>12} {unit}" for (what, _, unit), text in zip(rows, texts, strict=True)]
    return "\n".join(line.rstrip() for line in lines)
