"""VTK files (.vtk legacy, .vtp, .vtu): surfaces with their arrays in, fields out.

Legacy files are checked for completeness, as VTK's reader fills what is missing at the end with arbitrary memory.
Format: "VTK File Formats", simple legacy formats (VTK User's Guide). Only the last block of a file can be cut
short, so only its size is compared with what its heading declares.

The process that reads VTK files, one after another: starting it takes longer than reading a small file.
"""

import atexit
import importlib.util
import io
import json
import os
import re
import subprocess
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.cfd.formats.text_numbers import read_file
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically

_CHILD = Path(__file__).with_name("vtk_child.py")
_LONGEST = 600.0


class VtkProcess:
    """Starts the process with the first file, and again after a file on which it ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: subprocess.Popen[bytes] | None = None
        self._owner = 0

    def read(self, path: Path) -> bytes:
        """Return the .npz image of the surface in a file.

        Raises
        ------
        InputError
            VTK refuses the file, breaks down on it, or does not end.
        """
        with self._lock:
            process = self._started()
            late = threading.Event()
            timer = threading.Timer(_LONGEST, _kill, (process, late))
            timer.daemon = True
            timer.start()
            try:
                answer = _ask(process, path)
            finally:
                timer.cancel()
            if answer is None:
                self._running = None
                code = _ended(process)
        if answer is None and late.is_set():
            raise InputError(f"{path}: damaged: VTK's reader did not end within {_LONGEST:g} s")
        if answer is None:
            raise InputError(f"{path}: damaged: VTK's reader broke down on it (exit code {code})")
        word, content = answer
        if word == b"refused":
            raise InputError(f"{path}: {content.decode('utf-8', 'replace')}")
        return content

    @property
    def number(self) -> int | None:
        """The process's number; None where none runs."""
        return None if self._running is None else self._running.pid

    def end(self) -> None:
        """End the process."""
        with self._lock:
            if self._running is not None and self._owner == os.getpid():
                _ended(self._running)
            self._running = None

    def _started(self) -> subprocess.Popen[bytes]:
        """Return the process; a copy of this one made by fork has its own."""
        if self._running is None or self._owner != os.getpid() or self._running.poll() is not None:
            self._running = subprocess.Popen(
                [sys.executable, "-P", str(_CHILD)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
            self._owner = os.getpid()
        return self._running


def _kill(process: subprocess.Popen[bytes], late: threading.Event) -> None:
    late.set()
    process.kill()


def _ask(process: subprocess.Popen[bytes], path: Path) -> tuple[bytes, bytes] | None:
    """Return word and content of the answer on a file, None where the process ended without one."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps(str(path)).encode() + b"\n")
        process.stdin.flush()
    except OSError:
        return None
    word, _, length = process.stdout.readline().partition(b" ")
    if not length.endswith(b"\n"):
        return None
    content = process.stdout.read(int(length))
    return (word, content) if len(content) == int(length) else None


def _ended(process: subprocess.Popen[bytes]) -> int:
    """Close the process's pipes, wait for its end and return its exit code."""
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with suppress(OSError):
                stream.close()
    return process.wait()


VTK_PROCESS = VtkProcess()
atexit.register(VTK_PROCESS.end)


_BYTES = {
    "bit": 0.125,
    "char": 1,
    "unsigned_char": 1,
    "short": 2,
    "unsigned_short": 2,
    "int": 4,
    "unsigned_int": 4,
    "float": 4,
    "long": 8,
    "unsigned_long": 8,
    "vtkIdType": 4,
    "vtktypeint64": 8,
    "double": 8,
}
_TYPE = rb"(?P<type>" + b"|".join(name.encode() for name in _BYTES) + rb")"
_HEADINGS = (
    rb"POINTS (?P<n>\d+) " + _TYPE,
    rb"(?:POLYGONS|CELLS|TRIANGLE_STRIPS|LINES|VERTICES) (?P<offsets>\d+) (?P<n>\d+)",
    rb"CELL_TYPES (?P<n>\d+)",
    rb"(?:VECTORS|NORMALS) \S+ " + _TYPE,
    rb"SCALARS \S+ " + _TYPE + rb"(?: (?P<k>\d+))?[ \t\r]*\nLOOKUP_TABLE \S+",
    rb"\S+ (?P<k>\d+) (?P<n>\d+) " + _TYPE,
)
# Version 5 lists offsets and connectivity instead of one block of cells.
_SPLIT_CELLS = re.compile(rb"^(?:OFFSETS|CONNECTIVITY) (\S+)[ \t\r]*\n", re.MULTILINE | re.IGNORECASE)
_PARENT = re.compile(rb"^(?:POINT_DATA|CELL_DATA) (\d+)", re.MULTILINE | re.IGNORECASE)
_COMPILED = [re.compile(rb"^" + h + rb"[ \t\r]*\n", re.MULTILINE | re.IGNORECASE) for h in _HEADINGS]


def check_whole(path: Path, content: bytes) -> None:
    """Refuse a legacy file whose last block holds less than its heading declares.

    Raises
    ------
    InputError
        Numbers are missing at the end, or the last may be cut in two.
    """
    binary = re.match(rb"[^\n]*\n[^\n]*\n\s*BINARY", content, re.IGNORECASE) is not None
    headings = [match for pattern in _COMPILED for match in pattern.finditer(content)]
    if not headings:
        raise InputError(f"{path}: cut short: no block of data found")
    last = max(headings, key=lambda match: match.end())
    block = content[last.end() :]
    groups = last.groupdict()
    parts = _SPLIT_CELLS.findall(block) if groups.get("offsets") else []
    if parts:
        block = _SPLIT_CELLS.sub(b"", block)
        groups["type"] = parts[0]
        count = int(groups["offsets"]) + int(groups["n"])
    elif groups.get("n") is not None:
        count = int(groups["n"]) * int(groups.get("k") or 1)
    else:
        tuples = _PARENT.findall(content[: last.start()])
        components = 3 if last.group(0)[:7].upper() in (b"VECTORS", b"NORMALS") else int(groups.get("k") or 1)
        count = int(tuples[-1]) * components if tuples else 0
    if binary:
        size = _BYTES.get(groups["type"].decode(), 1) if groups.get("type") else 4
        count_read, expected, what = len(block), int(count * size), "bytes"
    else:
        count_read, expected, what = len(block.split(b"METADATA")[0].split()), count, "numbers"
    if count_read < expected:
        heading = last.group(0).split(b"\n")[0].decode("ascii", "replace")
        raise InputError(f"{path}: cut short: {count_read} {what} found behind '{heading}', must be {expected}")
    if not binary and count_read == expected and not content[-1:].isspace():
        raise InputError(f"{path}: cut short: the last number has no line end behind it")


_WRITTEN_TYPE = {".vtu": "UnstructuredGrid", ".vtp": "PolyData"}


@dataclass(frozen=True, eq=False, kw_only=True)
class VtkSurface:
    """The surface cells of a VTK file.

    Attributes
    ----------
    point : (n, 3) all points of the file, in its length unit.
    triangle : (m, 3) point numbers; quads, polygons and strips are cut into triangles.
    face : (m,) the cell of the file that each triangle is cut from.
    node_arrays, cell_arrays : name to (n,) values at points, to (number of cells,) values in cells.
    other_arrays : names of what is no scalar of real numbers.
    """

    point: FloatArray
    triangle: IntArray
    face: IntArray
    node_arrays: Mapping[str, FloatArray]
    cell_arrays: Mapping[str, FloatArray]
    other_arrays: tuple[str, ...]


def require_vtk() -> None:
    """Refuse to go on without VTK; the message names the extra to install.

    Raises
    ------
    StrainfmuError
        VTK is not installed.
    """
    if importlib.util.find_spec("vtkmodules") is None:
        raise StrainfmuError('VTK files need the package vtk: pip install "strainfmu[cfd]"')


def read_vtk(path: Path) -> VtkSurface:
    """Read the surface cells of a legacy VTK, .vtp or .vtu file, ASCII or binary, compressed or not.

    VTK's own readers do it, in a process of their own (:mod:`builder.aero.cfd.formats.vtk_files`).

    Raises
    ------
    InputError
        The file is missing, empty, damaged or cut short, or holds no surface cells.
    StrainfmuError
        VTK is not installed.
    """
    content = read_file(path)
    require_vtk()
    if b"<VTKFile" in content[:4096] and b"</VTKFile>" not in content[-4096:]:
        raise InputError(f"{path}: cut short: </VTKFile> is missing at its end")
    if content.startswith(b"# vtk DataFile"):
        check_whole(path, content)
    with np.load(io.BytesIO(VTK_PROCESS.read(path)), allow_pickle=False) as archive:
        return VtkSurface(
            point=archive["point"],
            triangle=archive["triangle"],
            face=archive["face"],
            node_arrays={str(name): archive[f"node_{i}"] for i, name in enumerate(archive["node_names"])},
            cell_arrays={str(name): archive[f"cell_{i}"] for i, name in enumerate(archive["cell_names"])},
            other_arrays=tuple(map(str, archive["others"])),
        )


def write_vtk(path: Path, mesh: SurfaceMesh, node_arrays: Mapping[str, FloatArray]) -> None:
    """Write a surface with (n,) node arrays as .vtu or .vtp, binary and compressed, atomically.

    Raises
    ------
    StrainfmuError
        VTK is not installed, or the file could not be written.
    """
    require_vtk()
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

    flat = _WRITTEN_TYPE[path.suffix.lower()] == "PolyData"
    data = _vtk_data(mesh, node_arrays, flat)
    writer: Any = vtkXMLPolyDataWriter() if flat else vtkXMLUnstructuredGridWriter()
    writer.SetInputData(data)
    writer.SetDataModeToAppended()
    writer.SetCompressorTypeToZLib()
    writer.WriteToOutputStringOn()
    if not writer.Write():
        raise StrainfmuError(f"{path}: VTK could not compose the file")
    write_bytes_atomically(path, writer.GetOutputString().encode("latin-1"))


def _vtk_data(mesh: SurfaceMesh, node_arrays: Mapping[str, FloatArray], flat: bool) -> Any:
    """Return polydata (``flat``) or an unstructured grid of triangles."""
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import VTK_TRIANGLE, vtkCellArray, vtkPolyData, vtkUnstructuredGrid

    points = vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(mesh.point), deep=True))
    offsets = 3 * np.arange(len(mesh.triangle) + 1, dtype=np.int64)
    triangles = vtkCellArray()
    triangles.SetData(
        numpy_to_vtkIdTypeArray(offsets, deep=True), numpy_to_vtkIdTypeArray(mesh.triangle.ravel(), deep=True)
    )
    data: Any = vtkPolyData() if flat else vtkUnstructuredGrid()
    data.SetPoints(points)
    if flat:
        data.SetPolys(triangles)
    else:
        data.SetCells(VTK_TRIANGLE, triangles)
    for name, values in node_arrays.items():
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        data.GetPointData().AddArray(array)
    return data
