"""Checks of a mesh before anything is computed on it; each fault is one line.

Summary of a mesh as rows for print: counts, quality of elements, volumes, areas, masses.

Comparison of a mesh that is read with the vehicle file: its length, its radius, its wall.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from builder.structure.fourier.meridian_mesh import quadratic_shape
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.solid.elements import (
    FACE_CORNERS,
    MASS_DEGREE,
    all_faces,
    boundary_facets,
    determinant_ratio,
    face_keys,
    jacobians,
    reference_element,
    reference_facet,
    scaled_jacobian,
)
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution
from builder.workspace import Misfit
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

FOLDED_BELOW = -1e-9  # minimum determinant over the mean: rounding at an element collapsed to a point
SAME_PLACE = 1e-8  # of the mesh's size
LENGTH_TOLERANCE = 0.02
KNOWN_UNITS = {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254, "foot": 0.3048}


def check_mesh(mesh: SolidMesh, length: float | None = None, hollow: bool = True) -> None:
    """Refuse a mesh that would give wrong numbers, or none.

    Parameters
    ----------
    mesh : the mesh.
    length : length of the vehicle along x [m], if known: finds a wrong unit.
    hollow : there must be a surface ``internal``. Otherwise a body without a cavity, such as a wing, passes too.

    Raises
    ------
    InputError
        The first fault found: wrong scale, missing surface, node in no element, doubled nodes, separate parts,
        inverted element, facet that is not an outer face of an element, turned inward or listed twice.
    """
    if length is not None:
        refuse_wrong_scale(mesh, length)
    for name in (EXTERNAL, SUPPORT):
        mesh.named_surface(name)
    if not len(mesh.surface.get(INTERNAL, ())):
        refuse_unnamed_cavity(mesh, hollow)
    refuse_unused_nodes(mesh)
    refuse_doubled_nodes(mesh)
    refuse_separate_parts(mesh)
    refuse_inverted_elements(mesh)
    refuse_foreign_facets(mesh)


def refuse_wrong_scale(mesh: SolidMesh, length: float) -> None:
    """Refuse a mesh whose length along x is not the length of the vehicle [m], to 2 %."""
    x = mesh.node[:, 0]
    mesh_length = float(np.ptp(x))
    ratio = mesh_length / length
    if abs(ratio - 1.0) <= LENGTH_TOLERANCE:
        return
    guess = [unit for unit, metre in KNOWN_UNITS.items() if abs(ratio * metre - 1.0) < 5.0 * LENGTH_TOLERANCE]
    hint = f"; read it with the unit {guess[0]} ({KNOWN_UNITS[guess[0]]:g} m)" if guess else ""
    raise InputError(f"mesh: {mesh_length:.6g} m long in x, the vehicle {length:.6g} m{hint}")


def refuse_unnamed_cavity(mesh: SolidMesh, hollow: bool) -> None:
    """Refuse a mesh without a surface ``internal`` that needs it (``hollow``), or has faces without a name."""
    names = ", ".join(sorted(mesh.surface))
    if hollow:
        raise InputError(
            f"mesh: no surface '{INTERNAL}', found {names}: a profile has a wall round a cavity; a body without "
            "one is given by shape.surface and structure.mesh"
        )
    face, _ = boundary_facets(mesh.element_type, mesh.element)
    named = np.concatenate([match_facets(mesh.element_type, face, facet) for facet in mesh.surface.values()])
    bare = np.delete(np.arange(len(face)), named[named >= 0])
    if len(bare):
        raise InputError(
            f"mesh: no surface '{INTERNAL}', and {len(bare)} outer faces of elements are on none of {names}, "
            f"the first at {_at(mesh.node[face[bare[0]]].mean(axis=0))}: name the cavity's '{INTERNAL}'; of a "
            "body without one every face is on a surface"
        )


def refuse_unused_nodes(mesh: SolidMesh) -> None:
    """Refuse nodes that no element has: they would make the stiffness singular."""
    used = np.zeros(mesh.n_nodes, dtype=bool)
    used[mesh.element] = True
    lost = np.flatnonzero(~used)
    if len(lost):
        raise InputError(
            f"mesh: {len(lost)} nodes are in no element, the first is node {lost[0]} at {_at(mesh.node[lost[0]])}"
        )


def refuse_doubled_nodes(mesh: SolidMesh) -> None:
    """Refuse two nodes at one point: the body would be cut there."""
    size = float(np.linalg.norm(np.ptp(mesh.node, axis=0)))
    pairs = cKDTree(mesh.node).query_pairs(SAME_PLACE * size, output_type="ndarray")
    if len(pairs):
        a, b = pairs[np.lexsort(pairs.T[::-1])][0]
        raise InputError(
            f"mesh: {len(pairs)} pairs of nodes at one point, the first are nodes {a} and {b} at "
            f"{_at(mesh.node[a])}; merge coincident nodes in the mesher"
        )


def refuse_separate_parts(mesh: SolidMesh) -> None:
    """Refuse a mesh of parts that share no node: only one of them would be held."""
    n, n_elements = mesh.n_nodes, len(mesh.element)
    # A graph of nodes and elements, each element joined to its nodes.
    joined = n + np.repeat(np.arange(n_elements), mesh.element.shape[1])
    graph = csr_array((np.ones(joined.size), (mesh.element.ravel(), joined)), shape=(n + n_elements,) * 2)
    count, label = connected_components(graph, directed=False)
    part = label[:n]
    if count == 1:
        return
    sizes = np.bincount(part, minlength=count)
    smallest = int(sizes.argmin())
    inside = mesh.node[part == smallest]
    box = ", ".join(
        f"{axis} {low:.4g} to {high:.4g}"
        for axis, low, high in zip("xyz", inside.min(0), inside.max(0), strict=True)
    )
    raise InputError(
        f"mesh: {count} parts that share no node; the smallest has {sizes[smallest]} of {mesh.n_nodes} nodes, in "
        f"the box {box} m"
    )


def refuse_inverted_elements(mesh: SolidMesh) -> None:
    """Refuse elements turned inside out or folded."""
    ratio = determinant_ratio(mesh.element_type, mesh.node, mesh.element)
    folded = np.flatnonzero(ratio < FOLDED_BELOW)
    if len(folded):
        first = folded[0]
        raise InputError(
            f"mesh: {len(folded)} of {len(mesh.element)} elements are inverted or folded, the first is element "
            f"{first} at {_at(mesh.node[mesh.element[first]].mean(axis=0))}"
        )


def refuse_foreign_facets(mesh: SolidMesh) -> None:
    """Refuse facets that are not outer faces of elements, point inward, or are listed twice."""
    faces = all_faces(mesh.element_type, mesh.element)
    _, number, count = np.unique(
        face_keys(mesh.element_type, faces), axis=0, return_inverse=True, return_counts=True
    )
    outer = faces[count[number.ravel()] == 1]
    for name, facet in mesh.surface.items():
        match = match_facets(mesh.element_type, outer, facet)
        _refuse(mesh, name, facet, match < 0, "are not outer faces of elements")
        turned = ~_same_turn(outer[match], facet, FACE_CORNERS[mesh.element_type])
        _refuse(mesh, name, facet, turned, "point inward or have their nodes in another order than their element")
        first = np.unique(match, return_index=True)[1]
        again = np.ones(len(facet), dtype=bool)
        again[first] = False
        _refuse(mesh, name, facet, again, "are listed twice")


def match_facets(element_type: str, face: IntArray, facet: IntArray) -> IntArray:
    """Return (f,) the face (k, n_f) with the same corners as each facet (f, n_f), -1 where there is none."""
    keys = np.concatenate([face_keys(element_type, face), face_keys(element_type, facet)])
    label = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    index = np.full(label.max() + 1, -1, dtype=np.int64)
    index[label[: len(face)]] = np.arange(len(face))
    return index[label[len(face) :]]


def _same_turn(face: IntArray, facet: IntArray, n_corners: int) -> NDArray[np.bool_]:
    """Whether each facet is its face, begun at any corner: same turn, same middles."""
    same = np.zeros(len(facet), dtype=bool)
    for shift in range(n_corners):
        rolled = np.concatenate(
            [np.roll(face[:, k : k + n_corners], -shift, axis=1) for k in range(0, face.shape[1], n_corners)],
            axis=1,
        )
        same |= (rolled == facet).all(axis=1)
    return same


def _refuse(mesh: SolidMesh, name: str, facet: IntArray, fault: NDArray[np.bool_], what: str) -> None:
    wrong = np.flatnonzero(fault)
    if len(wrong):
        where = _at(mesh.node[facet[wrong[0]]].mean(axis=0))
        raise InputError(
            f"mesh: surface '{name}': {len(wrong)} of {len(facet)} facets {what}, the first is facet {wrong[0]} "
            f"at {where}"
        )


def _at(point: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in point) + ") m"


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
    """Return the area of a named surface [m2], curved edges included."""
    reference = reference_facet(mesh.element_type)
    position = mesh.node[mesh.named_surface(name)]
    tangent = np.einsum("qad,fac->fqcd", reference.gradient, position)
    normal = np.cross(tangent[..., 0], tangent[..., 1])
    return float((np.linalg.norm(normal, axis=-1) @ reference.weight).sum())


def facet_size(mesh: SolidMesh, name: str) -> float:
    """Return the median length of the longest edge of a surface's facets [m], along the chord."""
    corner = mesh.node[mesh.named_surface(name)[:, : FACE_CORNERS[mesh.element_type]]]
    return float(np.median(np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=-1).max(axis=1)))


def facet_size_round_axis(mesh: SolidMesh, name: str, radius: float) -> float:
    """Return the size [m] of a surface's facets round the x axis, referred to a radius [m].

    Facets lock by their length over sqrt(r t): the median of length / sqrt(r) counts, times the root of
    ``radius``. A facet's length is taken along its edge that reaches furthest round the axis.
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
        *(
            (f"worst element at {axis}", float(coordinate), "m")
            for axis, coordinate in zip("xyz", worst, strict=True)
        ),
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
    values = {what: value for what, value, _ in rows}
    label = {name: "volume" if name == "volume" else f"surface {name}, area" for name in exact}
    return [
        (f"{label[name]}, error", 100.0 * (values[label[name]] / value - 1.0), "%")
        for name, value in exact.items()
        if label[name] in values
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


BODY_LENGTH_TOLERANCE = 0.005  # of the length
RADIUS_TOLERANCE = 0.01  # of the base radius, at all but a few nodes
WALL_TOLERANCE = 0.02  # of the thickness, in the middle over the nodes
OTHER_NODES = 5.0  # per cent of the nodes, such as those on the front of a cut tip
SAMPLES = 20_000  # of the outer line, between which a distance is 1e-3 of a thin wall at most


def mesh_misfits(mesh: SolidMesh, body: BodyOfRevolution, wall: Wall) -> list[Misfit]:
    """Return in what a mesh in body axes differs from ``body`` and ``wall``: length, radius, wall thickness.

    Corners of facets are compared: they lie on the surface even where facets are flat.
    """
    outside, inside = _meridian(mesh, EXTERNAL), _meridian(mesh, INTERNAL)
    misfits = []
    length = float(outside[:, 0].max())
    if abs(length - body.length) > BODY_LENGTH_TOLERANCE * body.length:
        misfits.append(
            Misfit(entry="length of the mesh", expected=f"{body.length:.4g} m", actual=f"{length:.4g} m")
        )
    meant = body.radius(np.clip(outside[:, 0], 0.0, body.length))
    off = np.abs(outside[:, 1] - meant)
    if np.percentile(off, 100.0 - OTHER_NODES) > RADIUS_TOLERANCE * body.base_radius:
        worst = int(off.argmax())
        misfits.append(
            Misfit(
                entry=f"outer radius of the mesh at x = {outside[worst, 0]:.4g} m",
                expected=f"{1e3 * meant[worst]:.4g} mm",
                actual=f"{1e3 * outside[worst, 1]:.4g} mm",
            )
        )
    thickness = wall_thickness(outside, inside)
    if abs(thickness - wall.thickness) > WALL_TOLERANCE * wall.thickness:
        misfits.append(
            Misfit(
                entry="wall thickness of the mesh",
                expected=f"{1e3 * wall.thickness:.4g} mm",
                actual=f"{1e3 * thickness:.4g} mm",
            )
        )
    return misfits


def wall_thickness(outside: FloatArray, inside: FloatArray) -> float:
    """Return the median distance [m] of points [x, r] (k, 2) inside from the line through those outside (n, 2)."""
    order = np.lexsort((-outside[:, 1], outside[:, 0]))  # of a plane across the axis the outermost point
    x, first = np.unique(outside[order, 0], return_index=True)
    station = np.linspace(x[0], x[-1], SAMPLES)
    line = np.column_stack([station, np.interp(station, x, outside[order, 1][first])])
    return float(np.median(cKDTree(line).query(inside)[0]))


def _meridian(mesh: SolidMesh, surface: str) -> FloatArray:
    """Return [x, r] (n, 2) [m] of the corners of a surface's facets."""
    corner = np.unique(mesh.named_surface(surface)[:, : FACE_CORNERS[mesh.element_type]])
    node = mesh.node[corner]
    return np.column_stack([node[:, 0], np.hypot(node[:, 1], node[:, 2])])
