"""Small bodies and direct solutions that the tests of the solid structure share."""

from collections.abc import Mapping
from itertools import permutations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from builder.structure.fourier.meridian_mesh import End, MeridianMesh, tube_mesh
from builder.structure.solid.cyclic import CircularOperator, _symmetric, pressure_operator
from builder.structure.solid.elements import CORNERS, Quadrature, boundary_facets, element_edges, reference_nodes
from builder.structure.solid.nodal_loads import normals_at_nodes, surface_nodes
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.supports import (
    Foundation,
    Restraint,
    foundation_stiffness,
    free_motions,
)
from builder.structure.solid.swept_mesh import EDGE_NODES, REGION, SweptSector, full_mesh, sector_window, sweep
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray

ELEMENT_TYPES = ("hexahedron20", "tetrahedron10", "hexahedron8", "tetrahedron4")
GUIDED = "guided"
METAL = Material(110e9, 0.31)
SIDES = ("x0", "x1", "y0", "y1", "z0", "z1")


def cube(element_type: str, n: int, shake: float = 0.0, bend: float = 0.0) -> SolidMesh:
    """Mesh the unit cube with n x n x n cells; surfaces x0 to z1.

    ``shake`` moves inner corners at random by that share of a cell, edges staying straight; ``bend`` moves every
    inner node smoothly, so that edges and faces are curved.
    """
    cell = np.stack(np.meshgrid(*(np.arange(n),) * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    if CORNERS[element_type] == 8:
        corner = (cell + reference_nodes("hexahedron8")) / n
    else:
        corner = np.concatenate([(cell + tet) / n for tet in _kuhn()])
    place, number = np.unique(np.rint(corner.reshape(-1, 3) * n), axis=0, return_inverse=True)
    inside = ((place > 0) & (place < n)).all(axis=1, keepdims=True)
    place = place / n + shake / n * inside * np.random.default_rng(3).uniform(-1.0, 1.0, place.shape)
    element = number.reshape(len(corner), -1)
    if element_type in ("hexahedron20", "tetrahedron10"):
        edge = np.sort(element[:, element_edges(element_type)], axis=-1)
        ends, middle = np.unique(edge.reshape(-1, 2), axis=0, return_inverse=True)
        element = np.concatenate([element, len(place) + middle.reshape(edge.shape[:2])], axis=1)
        place = np.concatenate([place, place[ends].mean(axis=1)])
    facet, _ = boundary_facets(element_type, element)
    surface = {}
    for axis in range(3):
        for side in (0, 1):
            on = (np.abs(place[facet][..., axis] - side) < 1e-9).all(axis=1)
            surface[f"{'xyz'[axis]}{side}"] = facet[on]
    place = place + bend * np.prod(np.sin(np.pi * place), axis=1, keepdims=True) * [1.0, -0.7, 0.5]
    return SolidMesh(
        element_type=element_type,
        node=place,
        element=element,
        region=np.zeros(len(element), dtype=np.int64),
        region_names=(REGION,),
        surface=surface,
    )


def _kuhn() -> list[FloatArray]:
    """Return the six tetrahedra (4, 3) of the unit cube around its diagonal, right-handed."""
    tets = []
    for order in permutations(range(3)):
        tet = np.zeros((4, 3))
        for k, axis in enumerate(order):
            tet[k + 1 :, axis] = 1.0
        if np.linalg.det(tet[1:] - tet[0]) < 0.0:
            tet[[1, 2]] = tet[[2, 1]]
        tets.append(tet)
    return tets


def swept_meridian(meridian: MeridianMesh, n_sectors: int) -> SweptSector:
    """Sweep a hollow meridian mesh; its surfaces are external, internal, support (clamped) and guided.

    Raises
    ------
    InputError
        The mesh reaches the axis, or there are too few sectors.
    """
    edges = meridian.element[:, EDGE_NODES].reshape(-1, 3)
    supports = {
        name: edges[np.isin(edges, nodes).all(axis=1)]
        for name, nodes in ((SUPPORT, meridian.clamped_node), (GUIDED, meridian.guided_node))
    }
    named = {EXTERNAL: meridian.outer_edge, INTERNAL: meridian.inner_edge, **supports}
    return sweep(meridian.node, meridian.element, named, n_sectors)


def tube(
    length: float,
    inner_radius: float,
    outer_radius: float,
    element_length: float,
    n_sectors: int,
    n_layers: int = 1,
    front: End = "free",
    aft: End = "clamped",
) -> SweptSector:
    """Sweep a straight tube with x from 0 to ``length`` [m]."""
    ends = np.array([0.0, length])
    radii = np.full(2, inner_radius), np.full(2, outer_radius)
    return swept_meridian(tube_mesh(ends, *radii, element_length, n_layers, front, aft), n_sectors)


def with_planes_of_symmetry(mesh: SolidMesh, *surfaces: str, springs: Foundation | None = None) -> Restraint:
    """Hold nodes of plane surfaces along their normals; ``springs`` hold besides."""
    node, direction = [], []
    for name in surfaces:
        facet = mesh.named_surface(name)
        node.append(np.unique(facet))
        normal = normals_at_nodes(mesh.element_type, mesh.node[facet])[0, 0]
        direction.append(np.tile(normal, (len(node[-1]), 1)))
    free = free_motions(mesh.n_nodes, np.concatenate(node), np.concatenate(direction))
    none = csr_array((mesh.n_dof, mesh.n_dof))
    return Restraint(free, none if springs is None else foundation_stiffness(mesh, springs))


def sector_stiffness(
    sector: SweptSector, materials: Mapping[str, Material], quadrature: Quadrature | None = None
) -> CircularOperator:
    """Return the stiffness [N/m] of a swept mesh in sector frames, that nothing holds."""
    return _symmetric(sector, assemble_stiffness(sector_window(sector), materials, quadrature))


def harmonic_field(
    sector: SweptSector,
    harmonic: int,
    pressure: FloatArray,
    material: Material = METAL,
    quadrature: Quadrature | None = None,
) -> FloatArray:
    """Return displacements (n_dof, k) [m] of all sectors under pressures f(x) cos(m phi) on the external surface.

    ``pressure`` (n_p, k) is f at the sector's external nodes [Pa]; (n_p,) gives (n_dof,). Held where clamped and,
    axially, where guided; one complex system in sector frames.
    """
    n, w = sector.n_sectors, np.exp(2j * np.pi * harmonic / sector.n_sectors)
    stiffness = sector_stiffness(sector, {REGION: material}, quadrature).harmonic(harmonic)
    place = sector.node[surface_nodes(sector, EXTERNAL)]
    phase = np.exp(1j * harmonic * np.arctan2(place[:, 1], place[:, 2]))
    wave = phase[:, None] * pressure.reshape(len(place), -1)
    force = pressure_operator(sector, EXTERNAL).harmonic(harmonic) @ wave
    fixed = np.zeros((sector.n_nodes, 3), dtype=bool)
    if GUIDED in sector.surface:
        fixed[surface_nodes(sector, GUIDED), 0] = True
    if SUPPORT in sector.surface:
        fixed[surface_nodes(sector, SUPPORT)] = True
    free = np.flatnonzero(~fixed.ravel())
    amplitude = np.zeros((sector.n_dof, wave.shape[1]), dtype=complex)
    matrix = csr_array(stiffness)[free][:, free].astype(complex).tocsc()
    amplitude[free] = splu(matrix, permc_spec="MMD_AT_PLUS_A").solve(force[free])
    turns = np.stack([sector.rotation(s) for s in range(n)])
    in_frames = (w ** np.arange(n)[:, None, None] * amplitude).real.reshape(n, -1, 3, wave.shape[1])
    field = np.einsum("sij,snjk->snik", turns, in_frames).reshape(-1, wave.shape[1])
    return np.asarray(field if pressure.ndim == 2 else field[:, 0])


def swept_tube(n_sectors: int = 12, element_length: float = 0.05) -> SolidMesh:
    """Mesh a short clamped tube, radii 0.12 and 0.13 m, 0.2 m long."""
    return full_mesh(tube(0.2, 0.12, 0.13, element_length, n_sectors))
