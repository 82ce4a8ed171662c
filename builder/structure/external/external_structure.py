"""The structure of another code, by the entry of the vehicle file that names its file, and influence matrices.

Forces on fewer nodes: how much strain depends on the number of nodes that are loaded.

Equilibrium of an influence matrix, seen from outside: a lateral force bends a clamped body by its lever.

The axial strain of a gauge under a lateral force is in proportion to the force's distance ahead of it, and zero
under forces behind it, whatever the structure between. Nodes in another order, swapped axes, a wrong length show.

Z_p from an influence matrix: strain per force at nodes times the nodal forces of a pressure on their facets.

The influence matrix of a mesh of ours, in the form that other codes' matrices are read in.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots
from builder.structure.external import strain_per_snapshot
from builder.structure.external.influence_file import Influence, read_influence, write_influence
from builder.structure.external.load_export import columns_found, strain_columns
from builder.structure.external.nastran.results import nastran_strains
from builder.structure.external.strain_per_snapshot import structure_of_operator
from builder.structure.external.strain_table import SubcaseStrains
from builder.structure.solid.case import SolidCase, structure_case
from builder.structure.solid.gauge_rows import Gauges
from builder.structure.solid.nodal_loads import facet_pressure_load, facet_triangles, split_facets, surface_nodes
from builder.structure.solid.solid_mesh import EXTERNAL
from builder.structure.solid.solid_model import strain_per_force
from builder.structure.structure_file import MeshCheck, Structure
from builder.vehicle.file import Vehicle
from builder.vehicle.map_needs import used_layouts
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

NEIGHBOURS = 6
"""Kept nodes that a force is spread over."""

MOMENT = 1e6
"""Weight of the force's place against the weight of small weights."""


@dataclass(frozen=True, eq=False)
class ThinnedNodes:
    """Forces carried over to some of the nodes.

    Attributes
    ----------
    spread : (n, n) the part of the force at node i (row) that node j takes; columns of nodes left out are empty.
    n_nodes : number of nodes that take forces.
    factor : error of all nodes over the difference of the two, for an error in proportion to the spacing's square.
    """

    spread: csr_array
    n_nodes: int
    factor: float

    def on_kept(self, strain_per_force: FloatArray) -> FloatArray:
        """Return (k, n, 3) strain per force [1/N] at each node, carried over to the kept ones first."""
        return np.stack([(self.spread @ strain_per_force[:, :, axis].T).T for axis in range(3)], axis=2)


def thinned(surface: SurfaceMesh) -> ThinnedNodes:
    """Return the forces of all nodes of ``surface`` on a third of them, no two of which are neighbours.

    Every force keeps its size, and its moment as far as the kept nodes round it span its place.
    """
    nodes = _apart(surface)
    n, m = surface.n_nodes, min(NEIGHBOURS, len(nodes))
    distance, nearest = cKDTree(surface.point[nodes]).query(surface.point, k=m)
    distance, nearest = distance.reshape(n, m), nearest.reshape(n, m)
    scale = distance[:, -1:] + 1e-300
    arm = (surface.point[nodes[nearest]] - surface.point[:, None]) / scale[:, :, None]
    near = 1.0 / ((distance / scale) ** 2 + 1e-6)  # weights are dear far away
    rows = np.concatenate([np.ones((n, 1, m)), arm.transpose(0, 2, 1)], axis=1)  # sum of weights, and place
    gram = np.einsum("nim,nm,njm->nij", rows, near, rows) + np.eye(4) / MOMENT
    wanted = np.zeros((n, 4, 1))
    wanted[:, 0] = 1.0
    weight = near * np.einsum("nim,ni->nm", rows, np.linalg.solve(gram, wanted)[:, :, 0])
    weight /= weight.sum(axis=1, keepdims=True)
    weight[nodes], nearest[nodes] = np.eye(m)[0], np.arange(len(nodes))[:, None]
    place = (np.repeat(np.arange(n), m), nodes[nearest].ravel())
    spread = csr_array((weight.ravel(), place), shape=(n, n))
    return ThinnedNodes(spread, len(nodes), 1.0 / max(n / len(nodes) - 1.0, 1e-3))


def _apart(surface: SurfaceMesh) -> IntArray:
    """Return nodes of which no two share a triangle, as many as fit in one pass; all others are next to one."""
    corner = surface.triangle
    row, column = corner[:, [0, 1, 2, 1, 2, 0]].ravel(), corner[:, [1, 2, 0, 0, 1, 2]].ravel()
    n = surface.n_nodes
    graph = csr_array((np.ones(len(row), dtype=np.int8), (row, column)), shape=(n, n))
    taken, blocked = [], np.zeros(n, dtype=bool)
    for node in range(n):
        if not blocked[node]:
            taken.append(node)
            blocked[graph.indices[graph.indptr[node] : graph.indptr[node + 1]]] = True
    return np.array(taken, dtype=np.int64)


STATIONS = 24
"""Bins of equal numbers of nodes along the body, over which forces are spread."""
FEWEST = 4
"""Bins ahead of a gauge from which it is judged."""
NEAR = 0.03
"""Of the body's length: forces nearer than this to a gauge bend the wall under it."""
LEAST_R2, LARGEST_SHIFT = 0.9, 0.05
"""Of the straight line; and of its zero from the gauge, over the body's length."""
AXIAL = 0.9
"""Direction cosine to the axis from which a gauge counts as axial."""


def check_equilibrium(path: Path, node: FloatArray, strain_per_force: FloatArray, gauges: Gauges) -> None:
    """Refuse strains (k, n, 3) [1/N] per force at nodes (n, 3) [m] that no clamped body can have.

    Raises
    ------
    InputError
        The axial gauges' strain is no straight line with its zero at the gauge, or of the wrong sign.
    """
    lines = lateral_lines(node, strain_per_force, gauges)
    if not len(lines):
        return
    r2, shift, slope = np.median(lines, axis=0)
    words = (
        f"axial strain linear in the station of a lateral force, zero at the gauge (middle of {len(lines)} gauges)"
    )
    if r2 < LEAST_R2:
        raise InputError(
            f"{path}: equilibrium: expected {words}, got R2 {r2:.2g}: nodes and strains in one order? "
            "x aft, y starboard, z up?"
        )
    if abs(shift) > LARGEST_SHIFT:
        raise InputError(
            f"{path}: equilibrium: expected {words}, got the zero {100.0 * abs(shift):.2g} % of the length "
            f"{'aft' if shift > 0.0 else 'ahead'} of it: another length, unit or gauge?"
        )
    if slope > 0.0:
        raise InputError(
            f"{path}: equilibrium: expected compression on the side a force ahead pushes to, got tension"
        )


def lateral_lines(node: FloatArray, strain_per_force: FloatArray, gauges: Gauges) -> FloatArray:
    """Return (m, 3) of the axial gauges that can be judged: R2, shift of the zero over the length, sign.

    The sign is taken of strain on the side that a force ahead pushes to: compression, below 0, in a clamped
    body.
    """
    x, length = node[:, 0], float(np.ptp(node[:, 0]))
    order = np.argsort(x, kind="stable")
    bins = [part for part in np.array_split(order, STATIONS) if len(part)]
    station = np.array([x[part].mean() for part in bins])
    unit = gauges.direction / np.linalg.norm(gauges.direction, axis=1, keepdims=True)
    lines = []
    for gauge in np.flatnonzero(np.abs(unit[:, 0]) > AXIAL):
        position = gauges.position[gauge]
        off_axis = float(np.hypot(position[1], position[2]))
        ahead = station < position[0] - NEAR * length
        if ahead.sum() < FEWEST or off_axis == 0.0:
            continue
        across = strain_per_force[gauge, :, 1:] @ (position[1:] / off_axis)
        mean = np.array([across[part].mean() for part in bins])[ahead]
        slope, start = np.polyfit(station[ahead], mean, 1)
        rest = mean - (slope * station[ahead] + start)
        r2 = 1.0 - float(rest @ rest) / max(float(np.sum((mean - mean.mean()) ** 2)), 1e-300)
        zero = -start / slope if slope else np.inf
        # A force ahead pushes its side into compression, the less the nearer it is: strain rises with the station.
        lines.append([r2, (zero - position[0]) / length, -np.sign(slope)])
    return np.array(lines).reshape(-1, 3)


MODEL = "influence"


def structure_of_influence(
    path: Path,
    facets: Path | None,
    vehicle: Vehicle,
    layouts: Mapping[str, Gauges],
    results: SubcaseStrains | None = None,
) -> Structure:
    """Return the structure behind the influence matrix of ``path``, on the surface of its loaded nodes.

    What the number of loaded nodes does to strain is measured by leaving out two nodes of three.

    Parameters
    ----------
    path, facets : the file, and the file of the facets of a CSV file.
    vehicle : gives body and support.
    layouts : those a map needs; displaced ones may be missing.
    results : strains per subcase, where the file names subcases instead of strains.

    Raises
    ------
    InputError
        A file is wrong, does not fit the gauges, or its strains are out of equilibrium with its forces.
    """
    influence = read_influence(path, facets, results)
    columns = columns_found(path, influence.column, layouts, vehicle.gauges.layout)
    index = [influence.column.index(name) for names in columns.values() for name in names]
    strain = influence.strain_per_force[index]
    outward = _outward(influence)
    surface, column = split_facets(influence.node, influence.facet) if influence.split else (outward, None)
    if vehicle.structure.support == "clamped_aft":
        in_use = layouts[vehicle.gauges.layout]
        rows = [influence.column.index(name) for name in columns[vehicle.gauges.layout]]
        check_equilibrium(path, influence.node, influence.strain_per_force[rows], in_use)
    load = facet_pressure_load(influence.node, influence.facet, column)
    flat = strain.reshape(len(strain), -1)
    thin = thinned(outward)
    check = MeshCheck(
        against=f"forces on {thin.n_nodes} of its {len(influence.node)} nodes",
        factor=thin.factor,
        strain_operator=np.asarray(thin.on_kept(strain).reshape(len(strain), -1) @ load),
    )
    return structure_of_operator(
        np.asarray(flat @ load),
        surface,
        {name: layouts[name] for name in columns},
        vehicle.name,
        vehicle.body(),
        model=MODEL,
        path=path,
        statistics={"loaded_nodes": len(influence.node)},
        check=check,
    )


def _outward(influence: Influence) -> SurfaceMesh:
    """Return the facets as triangles.

    Raises
    ------
    InputError
        The facets face inwards.
    """
    surface = SurfaceMesh(influence.node, facet_triangles(influence.facet))
    away = influence.node - np.array([1.0, 0.0, 0.0]) * influence.node[:, :1]
    middle = away[surface.triangle].mean(axis=1)
    if np.einsum("mi,mi->", surface.vector_area, middle) < 0.0:
        raise InputError(f"{influence.path}: facet: expected nodes anticlockwise seen from outside, got clockwise")
    return surface


def external_inputs(vehicle: Vehicle) -> list[str]:
    """Return the content of the files of the structure.

    Raises
    ------
    InputError
        The file is missing.
    """
    entry = vehicle.structure
    named = [entry.influence_facets, entry.nastran_gauges, *entry.nastran_results]
    named_paths = [vehicle.beside(name) for name in named if name is not None]
    files = [path for path in named_paths if path.is_file()]
    return [sha256(path.read_bytes()).hexdigest() for path in (external_file(vehicle), *files)]


def external_file(vehicle: Vehicle) -> Path:
    """Return the path of the file of the structure.

    Raises
    ------
    InputError
        It is missing.
    """
    entry = vehicle.structure.external
    assert entry is not None
    path = vehicle.beside(getattr(vehicle.structure, entry))
    if not path.is_file():
        raise InputError(f"structure.{entry}: {path}: no such file")
    return path


def external_structure(vehicle: Vehicle, snapshots: Snapshots) -> Structure:
    """Return the structure behind the file that the vehicle file names, for the layouts its map needs.

    Raises
    ------
    InputError
        The file is missing or wrong, or does not fit snapshots or gauges.
    """
    vehicle.body()  # refuses other shapes, whose gauges lie on a mesh of ours
    layouts, path = structure_case(vehicle, used_layouts(vehicle)).layouts, external_file(vehicle)
    results = nastran_strains(vehicle, layouts)
    if vehicle.structure.external == strain_per_snapshot.MODEL:
        return strain_per_snapshot.structure_of_strains(path, vehicle, snapshots, layouts, results)
    named = vehicle.structure.influence_facets
    facets = None if named is None else vehicle.beside(named)
    return structure_of_influence(path, facets, vehicle, layouts, results)


def influence_of(vehicle: Vehicle) -> tuple[Influence, dict[str, tuple[str, ...]]]:
    """Return the strain per force of a mesh, or of a matrix of another code, and the columns of the layout in use
    and of its displaced gauges, as far as they are there.

    Raises
    ------
    InputError
        A file is missing or wrong.
    """
    entry, in_use = vehicle.structure, vehicle.gauges.layout
    if entry.external is None:
        case = structure_case(vehicle, [in_use])
        influence, layouts = solved_influence(case, in_use, Path("structure")), case.layouts
    else:
        layouts = structure_case(vehicle, [in_use]).layouts
        facets = None if entry.influence_facets is None else vehicle.beside(entry.influence_facets)
        influence = read_influence(external_file(vehicle), facets, nastran_strains(vehicle, layouts))
    return influence, columns_found(influence.path, influence.column, layouts, in_use)


def solved_influence(case: SolidCase, in_use: str, path: Path) -> Influence:
    """Solve ``case`` under unit forces at the nodes of its external surface.

    ``in_use`` is the layout whose gauges go by their own names, ``path`` the name of the matrix.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`builder.structure.solid.solid_model.solve_solid_structure`.
    """
    mesh, strain = strain_per_force(case)
    node = surface_nodes(mesh, EXTERNAL)
    columns = strain_columns(case.layouts, in_use)
    return Influence(
        path=path,
        node=mesh.node[node],
        facet=np.searchsorted(node, mesh.named_surface(EXTERNAL)),
        column=tuple(name for names in columns.values() for name in names),
        strain_per_force=strain,
        split=not mesh.is_swept,
    )


def written_influence(case: SolidCase, in_use: str, path: Path) -> Influence:
    """Write the matrix of :func:`solved_influence`; errors as there, or the file could not be written."""
    influence = solved_influence(case, in_use, path)
    write_influence(influence)
    return influence
