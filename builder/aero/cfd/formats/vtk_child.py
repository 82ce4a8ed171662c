"""Reader of VTK files in a process of its own: ``python -P vtk_child.py``, names in, .npz images out.

Each line of standard input is the name of a file as JSON. The answer on standard output is a line, ``read`` or
``refused`` and a number of bytes, then these: the image, or the reason why the file is refused.

VTK's readers print to the process's standard error, go on with half of the data, and on some damaged files end
the process. Here none of that reaches the caller: what VTK reports as an error becomes a refusal, and a crash the
end of the answers. Only VTK's input modules are loaded, which need no display.
"""

import io
import json
import os
import re
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkPoints, vtkStringOutputWindow
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from vtkmodules.vtkIOLegacy import vtkGenericDataObjectReader
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

# Cell types of vtkCellType.h.
_NOT_AREA = (0, 1, 2, 3, 4, 21, 35, 68, 75)
_STRIP, _PIXEL = 6, 8
_LINEAR_AREA = (5, _STRIP, 7, _PIXEL, 9)
_CURVED_AREA = (22, 23, 28, 30, 34, 36, 69, 70, 76, 77)


class Refusal(Exception):
    """The file cannot be used; the text is the reason."""


def load(path: str) -> Any:
    """Return the data set in the file.

    Raises
    ------
    Refusal
        VTK reports an error, or the data set is neither polydata nor an unstructured grid.
    """
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    with open(path, "rb") as stream:
        start = stream.read(4096)
    reader: Any
    if start.startswith(b"# vtk DataFile"):
        reader = vtkGenericDataObjectReader()
        for what in ("Scalars", "Vectors", "Normals", "Tensors", "ColorScalars", "TCoords", "Fields"):
            getattr(reader, f"ReadAll{what}On")()
    else:
        kind = re.search(rb"<VTKFile[^>]*\btype\s*=\s*[\"'](\w+)[\"']", start)
        name = kind.group(1).decode() if kind else ""
        readers = {"PolyData": vtkXMLPolyDataReader, "UnstructuredGrid": vtkXMLUnstructuredGridReader}
        if name not in readers:
            description = f"VTK XML of type {name!r}" if kind else "no VTK header"
            raise Refusal(
                f"{description} found, must be legacy VTK or VTK XML of type PolyData or UnstructuredGrid"
            )
        reader = readers[name]()
    reader.SetFileName(path)
    reader.Update()
    complaint = re.search(r"ERROR: In [^\n]*\n(?:\w+ \(0x[0-9a-f]+\): )?([^\n]*)", window.GetOutput() or "")
    if complaint:
        raise Refusal(f"damaged or cut short; VTK reports: {complaint.group(1).strip()[:160]}")
    data = reader.GetOutputDataObject(0)
    if not isinstance(data, (vtkPolyData, vtkUnstructuredGrid)):
        description = data.GetClassName() if data is not None else "nothing"
        raise Refusal(f"{description} found, must be polydata or an unstructured grid")
    return data


def cells(array: vtkCellArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return offsets (k + 1,) and point numbers of the cells."""
    if not array.GetNumberOfCells():
        return np.zeros(1, np.int64), np.zeros(0, np.int64)
    offsets = vtk_to_numpy(array.GetOffsetsArray()).astype(np.int64)
    return offsets, vtk_to_numpy(array.GetConnectivityArray()).astype(np.int64)


def area_cells(data: Any) -> list[tuple[NDArray[np.int64], list[NDArray[np.int64]], bool]]:
    """Return (cell numbers, point numbers per cell, whether strips) of the polygons and of the triangle strips."""
    if isinstance(data, vtkPolyData):
        first = data.GetNumberOfVerts() + data.GetNumberOfLines()
        groups = []
        for array, strips in ((data.GetPolys(), False), (data.GetStrips(), True)):
            offsets, connectivity = cells(array)
            number = first + np.arange(len(offsets) - 1)
            groups.append((number, np.split(connectivity, offsets[1:-1]) if len(number) else [], strips))
            first += len(number)
        return groups
    kind = np.fromiter((data.GetCellType(i) for i in range(data.GetNumberOfCells())), dtype=np.int64)
    curved = np.isin(kind, _CURVED_AREA)
    if curved.any():
        raise Refusal(
            f"curved surface cells found (VTK type {kind[curved][0]}), only triangles, quads and polygons"
        )
    offsets, connectivity = cells(data.GetCells())
    area = np.isin(kind, _LINEAR_AREA)
    if not area.any() and not np.isin(kind, _NOT_AREA).all():
        raise Refusal(
            f"{len(kind)} volume cells and no surface cell found; extract the surface first (ParaView: Extract "
            "Surface; solvers: write the wall patches)"
        )
    numbers = [np.flatnonzero(area & (kind != _STRIP)), np.flatnonzero(kind == _STRIP)]
    corners = [[connectivity[offsets[i] : offsets[i + 1]] for i in group] for group in numbers]
    corners[0] = [
        points[[0, 1, 3, 2]] if kind[i] == _PIXEL else points
        for i, points in zip(numbers[0], corners[0], strict=True)
    ]
    return [(numbers[0], corners[0], False), (numbers[1], corners[1], True)]


def triangulate(point: NDArray[np.float64], data: Any) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return triangles (m, 3) and for each the cell (m,) of the file that it is cut from."""
    surface = vtkPolyData()
    points = vtkPoints()
    points.SetData(numpy_to_vtk(point, deep=True))
    surface.SetPoints(points)
    faces = []
    for number, corners, strips in area_cells(data):
        array = vtkCellArray()
        lengths = np.array([len(corner) for corner in corners], dtype=np.int64)
        flat = np.concatenate(corners) if corners else np.zeros(0, np.int64)
        if len(flat) and (flat.min() < 0 or flat.max() >= len(point)):
            wrong = flat.min() if flat.min() < 0 else flat.max()
            raise Refusal(f"a cell names point {wrong}, the file has {len(point)} points")
        offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        array.SetData(numpy_to_vtkIdTypeArray(offsets, deep=True), numpy_to_vtkIdTypeArray(flat, deep=True))
        if corners:
            (surface.SetStrips if strips else surface.SetPolys)(array)
        faces.append(number)
    face = np.concatenate(faces)
    if not len(face):
        raise Refusal("no surface cell found")
    tag = numpy_to_vtk(face, deep=True)
    tag.SetName("face")
    surface.GetCellData().AddArray(tag)
    cut = vtkTriangleFilter()
    cut.PassVertsOff()
    cut.PassLinesOff()
    cut.SetInputData(surface)
    cut.Update()
    result = cut.GetOutput()
    triangle = cells(result.GetPolys())[1].reshape(-1, 3)
    of_face = vtk_to_numpy(result.GetCellData().GetArray("face")).astype(np.int64)
    if len(of_face) != len(triangle) or len(np.unique(of_face)) != len(face):
        lost = len(face) - len(np.unique(of_face))
        raise Refusal(f"{lost} of {len(face)} surface cells could not be cut into triangles (no area, or crossed)")
    return triangle, of_face


def fields(attributes: Any, count: int, where: str) -> tuple[dict[str, NDArray[np.float64]], list[str]]:
    """Return the scalar arrays of real numbers by name, and the names of all others."""
    scalars, unread = {}, []
    for i in range(attributes.GetNumberOfArrays()):
        array = attributes.GetAbstractArray(i)
        name = array.GetName() or f"array {i + 1}"
        if array.GetNumberOfTuples() != count:
            raise Refusal(f"{where} array '{name}': {array.GetNumberOfTuples()} values found, must be {count}")
        real = array.GetNumberOfComponents() == 1 and array.GetDataTypeAsString() in ("float", "double")
        if real:
            scalars[name] = vtk_to_numpy(array).astype(np.float64)
        else:
            unread.append(name)
    return scalars, unread


def image(path: str) -> bytes:
    """Return points, triangles, cell numbers and arrays of a file, as .npz."""
    data = load(path)
    if not data.GetNumberOfPoints():
        raise Refusal("no point found")
    point = vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64)
    triangle, face = triangulate(point, data)
    node, node_others = fields(data.GetPointData(), len(point), "point")
    cell, cell_others = fields(data.GetCellData(), data.GetNumberOfCells(), "cell")
    arrays: dict[str, Any] = {"point": point, "triangle": triangle, "face": face}
    arrays["node_names"] = np.array(list(node), dtype=np.str_)
    arrays["cell_names"] = np.array(list(cell), dtype=np.str_)
    arrays["others"] = np.array(node_others + cell_others, dtype=np.str_)
    arrays |= {f"node_{i}": values for i, values in enumerate(node.values())}
    arrays |= {f"cell_{i}": values for i, values in enumerate(cell.values())}
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


def main() -> None:
    """Answer every line of standard input, until it ends."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what VTK prints is no answer
    for line in sys.stdin.buffer:
        try:
            word, content = "read", image(json.loads(line))
        except Refusal as refusal:
            word, content = "refused", " ".join(str(refusal).split()).encode()
        answers.write(f"{word} {len(content)}\n".encode() + content)
        answers.flush()


if __name__ == "__main__":
    main()
