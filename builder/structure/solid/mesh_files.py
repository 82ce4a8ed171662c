"""Volume meshes of other programs: Gmsh .msh, Nastran .bdf, Abaqus .inp, .vtu and whatever else meshio reads.

Names come from physical groups (Gmsh), element and node sets (Abaqus), group numbers with names given besides the
file (Nastran, Gmsh), or arrays of 0 and 1 on cells or points named like the surface (.vtu). Case does not matter.

Solid meshes with fields at their nodes as .vtu, for ParaView.
"""

import contextlib
import io
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from builder.structure.solid.elements import boundary_facets
from builder.structure.solid.mesh_checks import check_mesh, match_facets
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh, surfaces_of_hollow_body
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically

ELEMENT_TYPE = {
    "tetra10": "tetrahedron10",
    "hexahedron20": "hexahedron20",
    "tetra": "tetrahedron4",
    "hexahedron": "hexahedron8",
}
FACET_CORNERS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
FACET_CELL = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"}
NO_VOLUME = (*FACET_CORNERS, "vertex", "line", "line3")
GROUP_NUMBERS = ("gmsh:physical", "nastran:ref", "medit:ref", "cell_tags")
DEFAULT_REGION = "wall"


@dataclass(frozen=True, eq=False)
class NamedCells:
    """Cells of one kind and the named groups they are in.

    Attributes
    ----------
    cell : (k, n) node numbers.
    group : per name (lower case) which cells (k,) are in it.
    """

    cell: IntArray
    group: Mapping[str, BoolArray]


def read_mesh(
    path: Path,
    unit: float = 1.0,
    group_names: Mapping[int, str] | None = None,
    name_by_position: bool = False,
    length: float | None = None,
    hollow: bool = True,
) -> SolidMesh:
    """Read and check a volume mesh in body axes (x aft from the nose, y starboard, z up).

    All volume cells must be of one kind. A surface is given by facets or by its nodes; facets are taken from the
    faces of the elements, so their turn in the file does not matter. Named groups of volume cells that contain
    each element once are regions; without such groups all elements are of one region, ``wall``.

    Parameters
    ----------
    path : the file; its ending is the format.
    unit : length of the file's unit [m]: 0.001 for mm.
    group_names : names of group numbers (Gmsh physical tags, Nastran property numbers) that the file has none for.
    name_by_position : find the surfaces by :func:`surfaces_of_hollow_body` instead of by names.
    length, hollow : as in :func:`check_mesh`.

    Raises
    ------
    InputError
        The file is missing or damaged, cells are mixed or of a kind not known, a surface is missing, or the mesh
        fails :func:`check_mesh`.
    StrainfmuError
        meshio is not installed.
    """
    if not (np.isfinite(unit) and unit > 0.0):
        raise InputError(f"{path}: unit {unit:g} m must be greater than 0")
    raw = _read(path)
    try:
        blocks = _named_cells(raw, dict(group_names or {}))
        kind = _volume_kind(blocks)
        volume = blocks[kind]
        element_type = ELEMENT_TYPE[kind]
        node = np.ascontiguousarray(raw.points, dtype=np.float64) * unit
        if node.shape[1] != 3:
            raise InputError(f"points of {node.shape[1]} coordinates found, must be 3")
        region, region_names = _regions(volume)
        if name_by_position:
            surface = surfaces_of_hollow_body(element_type, node, volume.cell)
        else:
            surface = _surfaces(element_type, volume.cell, blocks, _node_sets(raw))
        mesh = SolidMesh(
            element_type=element_type,
            node=node,
            element=volume.cell,
            region=region,
            region_names=region_names,
            surface=surface,
        )
        check_mesh(mesh, length, hollow)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return mesh


def _meshio() -> Any:
    try:
        import meshio
    except ImportError as error:
        raise StrainfmuError('foreign meshes need the package meshio: pip install "strainfmu[mesh]"') from error
    return meshio


def _read(path: Path) -> Any:
    """Let meshio read the file; it prints and ends the process where it should raise, so both are caught."""
    meshio = _meshio()
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            raw = meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = "" if isinstance(error, SystemExit) else str(error)
        reason = f"it does not know {reason}" if isinstance(error, KeyError) else reason
        reason = " ".join(f"{printed.getvalue()} {reason}".split())[:200]
        raise InputError(f"{path}: meshio cannot read it: {reason or type(error).__name__}") from error
    # Nastran grid points in a coordinate system of their own: meshio keeps its number and leaves them as they are.
    if np.any(raw.point_data.get("nastran:ref", 0)):
        raise InputError(
            f"{path}: grid points in another than the basic coordinate system found, export in the basic one"
        )
    return raw


def _named_cells(raw: Any, names: dict[int, str]) -> dict[str, NamedCells]:
    """Join the blocks of each kind of cell, with the groups of all ways a format may name them."""
    names = {int(tag): name for name, (tag, _) in raw.field_data.items()} | names
    parts: dict[str, list[tuple[IntArray, dict[str, BoolArray]]]] = {}
    for i, block in enumerate(raw.cells):
        n = len(block.data)
        group: dict[str, BoolArray] = {}
        for name, members in raw.cell_sets.items():
            if not name.startswith("gmsh:") and members[i] is not None:
                group[name.lower()] = np.isin(np.arange(n), np.asarray(members[i], dtype=np.int64))
        for key, arrays in raw.cell_data.items():
            value = np.squeeze(arrays[i])
            if key in GROUP_NUMBERS:
                for tag in np.unique(value).tolist():
                    name = names.get(tag, f"group {tag}").lower()
                    group[name] = group.get(name, False) | (value == tag)
            elif key != "region" and value.ndim == 1 and np.isin(value, (0, 1)).all():
                group[key.lower()] = value == 1
        parts.setdefault(block.type, []).append((np.asarray(block.data, dtype=np.int64), group))
    return {kind: _joined(blocks) for kind, blocks in parts.items()}


def _joined(blocks: list[tuple[IntArray, dict[str, BoolArray]]]) -> NamedCells:
    names = dict.fromkeys(name for _, group in blocks for name in group)
    nowhere = [np.zeros(len(cell), dtype=bool) for cell, _ in blocks]
    group = {
        name: np.concatenate([groups.get(name, none) for (_, groups), none in zip(blocks, nowhere, strict=True)])
        for name in names
    }
    return NamedCells(
        np.concatenate([cell for cell, _ in blocks]), {name: mask for name, mask in group.items() if mask.any()}
    )


def _volume_kind(blocks: Mapping[str, NamedCells]) -> str:
    """Return meshio's name of the one kind of volume cells."""
    kinds = {kind: len(block.cell) for kind, block in blocks.items() if kind not in NO_VOLUME}
    if len(kinds) == 1 and next(iter(kinds)) in ELEMENT_TYPE:
        return next(iter(kinds))
    counts = " and ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no volume cells"
    hint = "; hexahedra of 27 nodes: export the incomplete (serendipity) form" if "hexahedron27" in kinds else ""
    raise InputError(f"{counts} found, must be one kind of {', '.join(ELEMENT_TYPE)}{hint}")


def _regions(volume: NamedCells) -> tuple[IntArray, tuple[str, ...]]:
    """Return the region (m,) of each element and their names."""
    parts = {name: mask for name, mask in volume.group.items() if not mask.all()}
    groups_of_all = [name for name, mask in volume.group.items() if mask.all() and not name.startswith("group ")]
    if not parts:
        return np.zeros(len(volume.cell), dtype=np.int64), (groups_of_all[0] if groups_of_all else DEFAULT_REGION,)
    membership = np.stack(list(parts.values()))
    count = membership.sum(axis=0)
    if (count == 1).all():
        return membership.argmax(axis=0).astype(np.int64), tuple(parts)
    if (count == 0).any() and not groups_of_all:
        raise InputError(f"{(count == 0).sum()} elements are in none of the groups {sorted(parts)}")
    if (count > 1).any() and not groups_of_all:
        raise InputError(f"{(count > 1).sum()} elements are in several of the groups {sorted(parts)}")
    return np.zeros(len(volume.cell), dtype=np.int64), (groups_of_all[0],)


def _node_sets(raw: Any) -> dict[str, IntArray]:
    """Return the nodes of each named set of points."""
    sets = {name.lower(): np.asarray(members, dtype=np.int64) for name, members in raw.point_sets.items()}
    for name, value in raw.point_data.items():
        if np.ndim(value) == 1 and np.isin(value, (0, 1)).all():
            sets[name.lower()] = np.flatnonzero(value)
    return sets


def _surfaces(
    element_type: str, element: IntArray, blocks: Mapping[str, NamedCells], node_sets: Mapping[str, IntArray]
) -> dict[str, IntArray]:
    """Return the facets of each surface: from groups of facets, else from a node set of one of our names."""
    boundary, _ = boundary_facets(element_type, element)
    chosen: dict[str, list[IntArray]] = {}
    for kind, block in blocks.items():
        for name, mask in block.group.items() if kind in FACET_CORNERS else ():
            match = match_facets(element_type, boundary, _corners(kind, block.cell[mask], boundary))
            if (match < 0).any() and name in (EXTERNAL, INTERNAL, SUPPORT):
                raise InputError(
                    f"surface '{name}': {(match < 0).sum()} of {len(match)} facets are not outer faces of elements"
                )
            chosen.setdefault(name, []).append(match[match >= 0])
    corner = boundary[:, : 3 if element_type.startswith("tetra") else 4]
    for name in (EXTERNAL, INTERNAL, SUPPORT):
        if name not in chosen and name in node_sets:
            chosen[name] = [np.flatnonzero(np.isin(corner, node_sets[name]).all(axis=1))]
    return {name: boundary[np.unique(np.concatenate(facets))] for name, facets in chosen.items()}


def _corners(kind: str, facet: IntArray, boundary: IntArray) -> IntArray:
    """Return (f, n_f) facets as wide as the facets of the boundary, of which the corners alone are used."""
    wide = np.full((len(facet), boundary.shape[1]), -1, dtype=np.int64)
    corners = FACET_CORNERS[kind]
    wide[:, :corners] = facet[:, :corners]
    return wide


def write_mesh(
    path: Path, mesh: SolidMesh, fields: Mapping[str, FloatArray] | None = None, with_surfaces: bool = False
) -> None:
    """Write a mesh as VTK XML (.vtu): compressed, quadratic cells kept, atomically.

    The cell array ``region`` holds the index of each element's region. With surfaces, facets follow the elements
    as cells of their own (region -1), and a cell array of 0 and 1 per name marks them, and the regions where
    there are several: what :func:`builder.structure.solid.mesh_files.read_mesh` reads back.

    Parameters
    ----------
    path : the file; its ending must be .vtu.
    mesh : the mesh.
    fields : per name the values (n,) or (n, 3) at the nodes, in any unit; the name should state it.
    with_surfaces : whether to write the facets.
    """
    if path.suffix.lower() != ".vtu":
        raise InputError(f"{path}: ending '{path.suffix}' found, must be .vtu")
    arrays = {escape(name): _checked(name, values, mesh) for name, values in (fields or {}).items()}
    names, facets = (tuple(mesh.surface), tuple(mesh.surface.values())) if with_surfaces else ((), ())
    kind = {name: cell for cell, name in ELEMENT_TYPE.items()}[mesh.element_type]
    cells = [(kind, mesh.element), *((FACET_CELL[facet.shape[1]], facet) for facet in facets)]
    regions = [mesh.region.astype(np.int64), *(np.full(len(facet), -1) for facet in facets)]
    marks = {"region": regions}
    for number, name in enumerate(names, start=1):
        marks[escape(name)] = [
            np.full(len(cell), block == number, dtype=np.uint8) for block, (_, cell) in enumerate(cells)
        ]
    if with_surfaces and len(mesh.region_names) > 1:
        for number, name in enumerate(mesh.region_names):
            marks[escape(name)] = [(region == number).astype(np.uint8) for region in regions]
    with tempfile.TemporaryDirectory() as folder:  # meshio writes to a path alone
        file = Path(folder) / "mesh.vtu"
        _meshio().vtu.write(file, _meshio().Mesh(mesh.node, cells, arrays, marks))
        write_bytes_atomically(path, file.read_bytes())


def _checked(name: str, values: FloatArray, mesh: SolidMesh) -> FloatArray:
    field = np.asarray(values, dtype=np.float64)
    if field.shape not in ((mesh.n_nodes,), (mesh.n_nodes, 3)):
        raise InputError(
            f"field '{name}': shape {field.shape} found, must be ({mesh.n_nodes},) or ({mesh.n_nodes}, 3)"
        )
    if not np.isfinite(field).all():
        raise InputError(f"field '{name}': a value is not finite")
    return field
