"""Volume meshes of other programs: Gmsh .msh, Nastran .bdf, Abaqus .inp, .vtu and whatever else meshio reads.

Names come from physical groups (Gmsh), element and node sets (Abaqus), group numbers with names given besides the
file (Nastran, Gmsh), or arrays of 0 and 1 on cells or points named like the surface (.vtu). Case does not matter.

Solid meshes with fields at their nodes as .vtu, for ParaView.
"""

from __future__ import annotations

import base64
import contextlib
import io
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

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


def _read(path: Path) -> Any:
    """Let meshio read the file; it prints and ends the process where it should raise, so both are caught."""
    try:
        import meshio
    except ImportError as error:
        raise StrainfmuError('foreign meshes need the package meshio: pip install "strainfmu[mesh]"') from error
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
        name: np.concatenate([own.get(name, none) for (_, own), none in zip(blocks, nowhere, strict=True)])
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
    found = " and ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no volume cells"
    hint = "; hexahedra of 27 nodes: export the incomplete (serendipity) form" if "hexahedron27" in kinds else ""
    raise InputError(f"{found} found, must be one kind of {', '.join(ELEMENT_TYPE)}{hint}")


def _regions(volume: NamedCells) -> tuple[IntArray, tuple[str, ...]]:
    """Return the region (m,) of each element and their names."""
    parts = {name: mask for name, mask in volume.group.items() if not mask.all()}
    whole = [name for name, mask in volume.group.items() if mask.all() and not name.startswith("group ")]
    if not parts:
        return np.zeros(len(volume.cell), dtype=np.int64), (whole[0] if whole else DEFAULT_REGION,)
    membership = np.stack(list(parts.values()))
    count = membership.sum(axis=0)
    if (count == 1).all():
        return membership.argmax(axis=0).astype(np.int64), tuple(parts)
    if (count == 0).any() and not whole:
        raise InputError(f"{(count == 0).sum()} elements are in none of the groups {sorted(parts)}")
    if (count > 1).any() and not whole:
        raise InputError(f"{(count > 1).sum()} elements are in several of the groups {sorted(parts)}")
    return np.zeros(len(volume.cell), dtype=np.int64), (whole[0],)


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
            found = match_facets(element_type, boundary, _corners(kind, block.cell[mask], boundary))
            if (found < 0).any() and name in (EXTERNAL, INTERNAL, SUPPORT):
                raise InputError(
                    f"surface '{name}': {(found < 0).sum()} of {len(found)} facets are not outer faces of elements"
                )
            chosen.setdefault(name, []).append(found[found >= 0])
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


# Cell types of vtkCellType.h: of the elements and of their facets.
ELEMENT_CELL = {"hexahedron20": 25, "tetrahedron10": 24, "hexahedron8": 12, "tetrahedron4": 10}
FACET_CELL = {"hexahedron20": 23, "tetrahedron10": 22, "hexahedron8": 9, "tetrahedron4": 5}
TYPE_NAME = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}
BLOCK = 1 << 20  # bytes compressed at once


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

    Raises
    ------
    InputError
        The ending is another, or a field is of the wrong shape or not finite.
    StrainfmuError
        The file cannot be written.
    """
    if path.suffix.lower() != ".vtu":
        raise InputError(f"{path}: ending '{path.suffix}' found, must be .vtu")
    arrays = {name: _checked(name, values, mesh) for name, values in (fields or {}).items()}
    facets = list(mesh.surface.items()) if with_surfaces else []
    n_facets = [len(facet) for _, facet in facets]
    counts = [len(mesh.element), sum(n_facets)]
    width = np.repeat([mesh.element.shape[1], facets[0][1].shape[1] if facets else 0], counts)
    cell_arrays = {"region": np.concatenate([mesh.region, np.full(counts[1], -1)]).astype(np.int64)}
    for i, (name, _) in enumerate(facets):
        of_surface = np.repeat(np.arange(len(facets)), n_facets) == i
        cell_arrays[name] = np.concatenate([np.zeros(counts[0], dtype=bool), of_surface]).astype(np.uint8)
    if with_surfaces and len(mesh.region_names) > 1:
        for i, name in enumerate(mesh.region_names):
            cell_arrays[name] = (cell_arrays["region"] == i).astype(np.uint8)
    cell_type = np.repeat([ELEMENT_CELL[mesh.element_type], FACET_CELL[mesh.element_type]], counts)
    connectivity = np.concatenate([mesh.element.ravel(), *(facet.ravel() for _, facet in facets)])
    parts = [
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
        f'<Piece NumberOfPoints="{mesh.n_nodes}" NumberOfCells="{sum(counts)}">\n<PointData>\n',
        *(_data_array(name, values) for name, values in arrays.items()),
        "</PointData>\n<CellData>\n",
        *(_data_array(name, values) for name, values in cell_arrays.items()),
        "</CellData>\n<Points>\n",
        _data_array("Points", mesh.node),
        "</Points>\n<Cells>\n",
        _data_array("connectivity", connectivity),
        _data_array("offsets", np.cumsum(width, dtype=np.int64)),
        _data_array("types", cell_type.astype(np.uint8)),
        "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
    ]
    write_bytes_atomically(path, "".join(parts).encode())


def _checked(name: str, values: FloatArray, mesh: SolidMesh) -> FloatArray:
    field = np.asarray(values, dtype=np.float64)
    if field.shape not in ((mesh.n_nodes,), (mesh.n_nodes, 3)):
        raise InputError(
            f"field '{name}': shape {field.shape} found, must be ({mesh.n_nodes},) or ({mesh.n_nodes}, 3)"
        )
    if not np.isfinite(field).all():
        raise InputError(f"field '{name}': a value is not finite")
    return field


def _data_array(name: str, values: NDArray[np.generic]) -> str:
    """Return a DataArray element: compressed blocks, base64 (The VTK User's Guide, XML file formats)."""
    code = values.dtype.str[1:]
    raw = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes()
    blocks = [zlib.compress(raw[start : start + BLOCK]) for start in range(0, len(raw), BLOCK)]
    rest = len(raw) % BLOCK
    header = np.array([len(blocks), BLOCK, rest, *map(len, blocks)], dtype="<u8").tobytes()
    text = (base64.b64encode(header) + base64.b64encode(b"".join(blocks))).decode()
    components = f'NumberOfComponents="{values.shape[1]}" ' if values.ndim == 2 else ""
    return (
        f'<DataArray type="{TYPE_NAME[code]}" Name={quoteattr(name)} {components}'
        f'format="binary">{text}</DataArray>\n'
    )
