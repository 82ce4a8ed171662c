"""Linear tetrahedra of a swept mesh: the wall in a structural model of constant-strain elements.

For comparison alone. Linear elements lose most of a thin wall's ovalisation, and their strain is constant in each
element; published models are nevertheless made of them. Every sector is cut in the same way, so the mesh stays
cyclic and the cyclic solver serves. The cut runs the same way round everywhere: the mesh has no plane of symmetry,
as meshes of free tetrahedra have none.

Three discretisations of one structure, with the same pressure nodes and the same gauges.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from builder.campaign.snapshots import Snapshots
from builder.reporting import Progress
from builder.reproduce.paper_readings import ALL
from builder.reproduce.protocol import Sizes
from builder.structure.fourier.fourier_model import structural_model
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.mapped_structure import mapped_operator
from builder.structure.solid.cyclic import SectorRows, rows_in_sectors, sector_rows
from builder.structure.solid.elements import CurvedFacets, boundary_facets, foot_point
from builder.structure.solid.gauge_layouts import solid_gauges
from builder.structure.solid.gauge_rows import Gauges, gauge_rows
from builder.structure.solid.matter import Matter
from builder.structure.solid.nodal_loads import triangulated_surface
from builder.structure.solid.solid_mesh import EXTERNAL, HEXAHEDRON, SUPPORT, SolidMesh
from builder.structure.solid.strain_solution import solve_strain
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import SweptSector, full_mesh, swept_wall
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.records import load_record, save_record

TETRAHEDRON = "tetrahedron4"

# Corners of a hexahedron by their index along, round and through (0 or 1), in VTK's order.
_CORNER = {
    (0, 0, 0): 0,
    (1, 0, 0): 1,
    (1, 1, 0): 2,
    (0, 1, 0): 3,
    (0, 0, 1): 4,
    (1, 0, 1): 5,
    (1, 1, 1): 6,
    (0, 1, 1): 7,
}


def tetrahedral_sector(sector: SweptSector) -> SweptSector:
    """Return the corners of a sector of hexahedra, each cut into six linear tetrahedra round one diagonal.

    Kuhn's cut: one tetrahedron per order in which the three axes are walked from the first corner to the last.
    Faces of neighbours are cut alike, because the reference axes of all elements run the same way.

    Raises
    ------
    InputError
        The sector is not of quadratic hexahedra.
    """
    if sector.element_type != HEXAHEDRON:
        raise InputError(f"mesh: element type '{sector.element_type}' found, must be {HEXAHEDRON}")
    corner = sector.element[:, :8]
    used = np.unique(corner % sector.n_nodes)
    number = np.full(sector.n_nodes, -1)
    number[used] = np.arange(len(used))

    def renumbered(nodes: IntArray) -> IntArray:
        return number[nodes % sector.n_nodes] + len(used) * (nodes // sector.n_nodes)

    element = renumbered(corner[:, _kuhn_tetrahedra()].reshape(-1, 4))
    outside, _ = boundary_facets(TETRAHEDRON, element)
    surface = {name: _cut(renumbered(facet[:, :4]), outside) for name, facet in sector.surface.items()}
    return replace(sector, node=sector.node[used], element=element, surface=surface, element_type=TETRAHEDRON)


def _kuhn_tetrahedra() -> IntArray:
    """Return (6, 4) local corners of the tetrahedra, each of positive volume."""
    tetrahedra = []
    for order in permutations(range(3)):
        corner, path = [0, 0, 0], [_CORNER[0, 0, 0]]
        for axis in order:
            corner[axis] = 1
            path.append(_CORNER[corner[0], corner[1], corner[2]])
        # An odd order of the axes turns the tetrahedron inside out.
        odd = sum(a > b for i, a in enumerate(order) for b in order[i + 1 :]) % 2
        tetrahedra.append([path[0], path[2], path[1], path[3]] if odd else path)
    return np.array(tetrahedra, dtype=np.int64)


def _cut(quadrilaterals: IntArray, triangles: IntArray) -> IntArray:
    """Return the rows of ``triangles`` (t, 3) that are halves of ``quadrilaterals`` (f, 4)."""
    halves = {frozenset(four) - {corner} for four in quadrilaterals.tolist() for corner in four}
    is_cut = [frozenset(three) in halves for three in triangles.tolist()]
    return triangles[np.array(is_cut, dtype=bool)]


def element_strain_rows(mesh: SolidMesh, gauges: Gauges) -> csr_array:
    """Return B (n_gauges, n_dof) [1/m]: the constant strain of the one facet that a gauge lies on.

    What point-wise evaluation of the strain of linear elements gives. The strain is that at the facet's middle,
    wherever on the facet the gauge is, so the readings of mirrored gauges are not mirrored. A gauge on the line
    between facets is read from one of them. Gauges are moved onto the facets, which lie on chords of the circle.

    Raises
    ------
    InputError
        The mesh is not of linear tetrahedra, or a surface does not exist.
    """
    if mesh.element_type != TETRAHEDRON:
        raise InputError(f"mesh: element type '{mesh.element_type}' found, must be {TETRAHEDRON}")
    row, column, entry = [], [], []
    facets = {name: mesh.named_surface(name) for name in dict.fromkeys(gauges.surface)}
    curved = {name: CurvedFacets(mesh.element_type, mesh.node[facet]) for name, facet in facets.items()}
    for i, (name, position) in enumerate(zip(gauges.surface, gauges.position, strict=True)):
        node = facets[name][foot_point(curved[name], position).facet]
        weight = _strain_of_triangle(mesh.node[node], gauges.direction[i])
        row.append(np.full(9, i))
        column.append((3 * node[:, None] + np.arange(3)).ravel())
        entry.append(weight.ravel())
    index = (np.concatenate(row), np.concatenate(column))
    return csr_array(coo_array((np.concatenate(entry), index), shape=(len(gauges.name), mesh.n_dof)))


def _strain_of_triangle(corner: FloatArray, direction: FloatArray) -> FloatArray:
    """Return (3, 3) strain per displacement [1/m] of a triangle (3, 3) [m] along ``direction`` (3,) in it."""
    edge = (corner[1:] - corner[0]).T
    part = np.linalg.lstsq(edge, direction, rcond=None)[0]  # the direction, projected onto the plane
    along = edge @ part
    length = float(np.linalg.norm(along))
    by_arc = np.array([-part.sum(), *part]) / length
    weight: FloatArray = np.outer(by_arc, along / length)
    return weight


SCHEMA = "strainfmu.reproduce.strain_model"
SCHEMA_VERSION = 1

CHECKED_SNAPSHOTS = 8
"""Number of snapshots on which the transfer of pressure to the structure's surface is checked."""

TETRAHEDRA, RECOVERED, HEXAHEDRA, FOURIER = "tetrahedra", "tetrahedra_recovered", "hexahedra", "fourier"


@dataclass(frozen=True, eq=False, kw_only=True)
class StrainModel:
    """Strain of every gauge per pressure at the snapshots' nodes.

    Attributes
    ----------
    name : of the model.
    gauge_names : (n_g,) of all readings.
    position, direction : (n_g, 3) [m] and unit vectors, body axes, as requested.
    operator : (n_g, n_p) Z_p [1/Pa].
    facts : size of the mesh.
    """

    name: str
    gauge_names: tuple[str, ...]
    position: FloatArray
    direction: FloatArray
    operator: FloatArray
    facts: dict[str, Any]

    def operator_of(self, names: Sequence[str]) -> FloatArray:
        """Return Z_p (n_d, n_p) [1/Pa] of the gauges ``names``, in their order."""
        return self.operator[self.indices(names)]

    def indices(self, names: Sequence[str]) -> list[int]:
        """Return the rows of the gauges ``names``.

        Raises
        ------
        InputError
            There is no gauge with one of the names.
        """
        index = {name: i for i, name in enumerate(self.gauge_names)}
        missing = [name for name in names if name not in index]
        if missing:
            raise InputError(f"strain model {self.name}: no gauge '{missing[0]}'")
        return [index[name] for name in names]


def save_model(model: StrainModel, path: Path) -> None:
    """Write a model atomically."""
    save_record(model, path, SCHEMA, SCHEMA_VERSION, {"position": "m", "operator": "1/Pa"})


def load_model(path: Path) -> StrainModel:
    """Read a model.

    Raises
    ------
    InputError
        The file is missing, damaged, or of another schema or version.
    """
    return load_record(StrainModel, path, SCHEMA, SCHEMA_VERSION)


def tetrahedral_model(
    vehicle: Vehicle, sizes: Sizes, snapshots: Snapshots, recovered: bool, progress: Progress | None = None
) -> StrainModel:
    """Return linear tetrahedra, their gauges read element by element, or by patch recovery where ``recovered``.

    The first follows the source's words: it "maps the discrete displacements to discrete strains using the
    strain-displacement relation" at the gauges' positions, on linear elements.
    """
    sector = tetrahedral_sector(swept_wall(vehicle.body(), wall_of(vehicle), sizes.tetrahedra))
    mesh, gauges = full_mesh(sector), _gauges(vehicle)
    rows = gauge_rows(mesh, gauges, near_surface=True) if recovered else element_strain_rows(mesh, gauges)
    return _solid_model(
        name=RECOVERED if recovered else TETRAHEDRA,
        vehicle=vehicle,
        sector=sector,
        gauges=gauges,
        snapshots=snapshots,
        rows=rows_in_sectors(sector, rows),
        progress=progress,
    )


def hexahedral_model(
    vehicle: Vehicle, sizes: Sizes, snapshots: Snapshots, progress: Progress | None = None
) -> StrainModel:
    """Return swept hexahedra of second order, gauges at their positions by patch recovery."""
    sector = swept_wall(vehicle.body(), wall_of(vehicle), sizes.hexahedra)
    gauges = _gauges(vehicle)
    return _solid_model(
        name=HEXAHEDRA,
        vehicle=vehicle,
        sector=sector,
        gauges=gauges,
        snapshots=snapshots,
        rows=sector_rows(sector, gauges),
        progress=progress,
    )


def fourier_model(vehicle: Vehicle) -> StrainModel:
    """Return the semi-analytic model; its resolution and pressure nodes are the vehicle's."""
    model = structural_model(vehicle, vehicle.resolution.map, [ALL])
    layout = model.layouts[ALL]
    used = vehicle.resolution.map
    facts = {"element_length_mm": used.element_length_mm, "layers": used.wall_layers, "harmonics": used.harmonics}
    return StrainModel(
        name=FOURIER,
        gauge_names=layout.names,
        position=layout.position,
        direction=layout.direction,
        operator=model.strain_operator(ALL),
        facts=facts,
    )


def _gauges(vehicle: Vehicle) -> Gauges:
    return solid_gauges(vehicle, ALL, shell_mesh(vehicle.body(), wall_of(vehicle), 0.01 * vehicle.body().length))


def _solid_model(
    name: str,
    vehicle: Vehicle,
    sector: SweptSector,
    gauges: Gauges,
    snapshots: Snapshots,
    rows: SectorRows,
    progress: Progress | None,
) -> StrainModel:
    """Solve for the strain of ``rows`` per pressure at the snapshots' nodes, base ring clamped."""
    solved = solve_strain(
        mesh=sector,
        matter=Matter(material=wall_of(vehicle).material),
        support=Clamped(SUPPORT),
        rows=rows,
        solver_name=None,
        progress=progress,
    )
    surface = triangulated_surface(full_mesh(sector), EXTERNAL)
    _, operator = mapped_operator(solved.strain_operator, surface, _some(snapshots))
    facts = {
        "elements": len(sector.element) * sector.n_sectors,
        "nodes": sector.n_nodes * sector.n_sectors,
        "dofs": sector.n_dof * sector.n_sectors,
        "element_type": sector.element_type,
        **solved.statistics,
    }
    return StrainModel(
        name=name,
        gauge_names=gauges.name,
        position=gauges.position,
        direction=gauges.direction,
        operator=operator,
        facts=facts,
    )


def _some(snapshots: Snapshots) -> Snapshots:
    """Return the snapshots on which a transfer is checked, evenly spread."""
    n = len(snapshots.condition)
    chosen = np.unique(np.linspace(0, n - 1, CHECKED_SNAPSHOTS).astype(int))
    per_snapshot = ("condition", "pressure", "internal_pressure", "solved", "momentum_error", "repairs")
    chosen_fields = {name: getattr(snapshots, name)[chosen] for name in per_snapshot}
    mass_error = None if snapshots.mass_error is None else snapshots.mass_error[chosen]
    return replace(snapshots, flow=np.arange(len(chosen)), mass_error=mass_error, **chosen_fields)
