"""Solid meshes with fields at their nodes as .vtu, for ParaView."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from builder.structure.solid.mesh.solid_mesh import SolidMesh
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically

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
    there are several: what :func:`builder.structure.solid.mesh.mesh_import.read_mesh` reads back.

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
