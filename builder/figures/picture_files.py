"""A scene as a file: .png (a still), .glb (to turn in a browser: a node per gauge), .vtp (ParaView).

glTF has y up and metres; a rotation of the root node keeps body axes in the coordinates below it (x aft,
y starboard, z up). Source: glTF 2.0 specification, Khronos Group (ISO/IEC 12113:2022).
"""

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from builder.aero.cfd.formats.vtk_files import write_vtk
from builder.campaign.snapshots import load_snapshots
from builder.figures.drawing import COLOUR_MAP, colour_ends, save
from builder.figures.scene import BOX, BOX_SIDES, STATE_COLOURS, Scene, scene_of_snapshot, solid_view
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.files import write_bytes_atomically

_FLOAT, _UNSIGNED, _BYTE = 5126, 5125, 5121
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_BODY_UP = [-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
"""Quaternion that turns z up into y up."""


class _Buffer:
    """Arrays of the binary part, and how they are read."""

    def __init__(self) -> None:
        self.content = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, array: NDArray[Any], kind: int, target: int, *, normalised: bool = False) -> int:
        """Add an array (n,) or (n, k); return the number of its accessor."""
        data = np.ascontiguousarray(array).tobytes()
        self.views.append(
            {"buffer": 0, "byteOffset": len(self.content), "byteLength": len(data), "target": target}
        )
        self.content += data + bytes(-len(data) % 4)
        width = 1 if array.ndim == 1 else array.shape[1]
        entry: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": kind,
            "count": len(array),
            "type": _TYPES[width],
        }
        if normalised:
            entry["normalized"] = True
        if width == 3:
            entry |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        self.accessors.append(entry)
        return len(self.accessors) - 1

    def mesh(self, point: FloatArray, normal: FloatArray, triangle: NDArray[Any], **more: int) -> dict[str, Any]:
        """Add a mesh; return its primitive."""
        vertex, index = 34962, 34963
        attributes = {
            "POSITION": self.add(point.astype("<f4"), _FLOAT, vertex),
            "NORMAL": self.add(normal.astype("<f4"), _FLOAT, vertex),
            **{name: value for name, value in more.items() if name == "COLOR_0"},
        }
        indices = self.add(triangle.astype("<u4").ravel(), _UNSIGNED, index)
        return {"attributes": attributes, "indices": indices, "material": more["material"]}


def write_glb(scene: Scene, path: Path) -> None:
    """Write a scene, values as colours of the surface, atomically.

    Raises
    ------
    StrainfmuError
        The file could not be written, or matplotlib, whose colours these are, is missing.
    """
    buffer = _Buffer()
    states = list(dict.fromkeys(scene.states))
    materials = [_material("surface", (1.0, 1.0, 1.0))]
    materials += [_material(f"gauge, {state}", _linear(STATE_COLOURS[state])) for state in states]
    colour = buffer.add(_colours(scene), _BYTE, 34962, normalised=True)
    normal = scene.surface.node_normal.copy()
    normal[np.linalg.norm(normal, axis=1) == 0.0] = (-1.0, 0.0, 0.0)  # nodes without a triangle
    body = buffer.mesh(scene.surface.point, normal, scene.surface.triangle, COLOR_0=colour, material=0)
    point, normals, triangle = _box()
    bars = [buffer.mesh(point, normals, triangle, material=1 + k) for k in range(len(states))]
    nodes: list[dict[str, Any]] = [{"name": scene.title, "rotation": _BODY_UP, "children": []}]
    nodes.append({"name": "surface", "mesh": 0, "extras": {"values": scene.label}})
    for name, state, place, frame in zip(scene.gauge_names, scene.states, scene.place, scene.frame, strict=True):
        matrix = np.zeros((4, 4))
        matrix[:3, :3], matrix[3, :3], matrix[3, 3] = (
            frame,
            place,
            1.0,
        )  # columns of the matrix, one after the other
        nodes.append(
            {
                "name": name,
                "mesh": 1 + states.index(state),
                "matrix": matrix.ravel().tolist(),
                "extras": {"state": state},
            }
        )
    nodes[0]["children"] = list(range(1, len(nodes)))
    document = {
        "asset": {"version": "2.0", "generator": "strainfmu"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": [{"primitives": [primitive]} for primitive in (body, *bars)],
        "materials": materials,
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.content)}],
    }
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<I4s", len(text), b"JSON") + text
    parts += struct.pack("<I4s", len(buffer.content), b"BIN\0") + buffer.content
    write_bytes_atomically(path, struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts)


def _material(name: str, colour: tuple[float, ...]) -> dict[str, Any]:
    surface = {"baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7}
    return {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True}


def _linear(colour: tuple[float, ...]) -> tuple[float, ...]:
    """Return a colour of a screen (sRGB) as glTF counts it, in proportion to light."""
    return tuple(value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in colour)


def _colours(scene: Scene) -> NDArray[np.uint8]:
    """Return (n, 4) red, green, blue and opacity at the nodes."""
    try:
        from matplotlib import colormaps
    except ImportError as error:
        raise StrainfmuError("pictures need matplotlib: pip install 'strainfmu[report]'") from error
    ends = colour_ends(scene.surface, scene.values)
    span = max(ends["vmax"] - ends["vmin"], 1e-300)
    table = np.array([[*_linear(tuple(colour[:3])), 1.0] for colour in colormaps[COLOUR_MAP](np.arange(256))])
    step = np.clip((scene.values - ends["vmin"]) / span * 255.0, 0.0, 255.0)
    return np.round(255.0 * table[np.nan_to_num(step).astype(int)]).astype(np.uint8)


def _box() -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Return points and normals (24, 3) and triangles (12, 3) of a box whose sides are flat."""
    point = BOX[BOX_SIDES]
    normal = np.cross(point[:, 1] - point[:, 0], point[:, 2] - point[:, 0])
    first = 4 * np.arange(6)[:, None]
    triangle = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return point.reshape(-1, 3), np.repeat(normal, 4, axis=0), triangle


FORMATS = (".png", ".glb", ".vtp")


def picture(
    folder: str | Path, output: str | Path, *, case: int | None = None, excluded: Sequence[str] = ()
) -> Scene:
    """Draw the vehicle in three dimensions: pressure on its surface, a bar for each gauge.

    A .png is a still from two sides, a .glb can be turned in any browser's viewer, a .vtp is for ParaView.

    On the command line::

        strainfmu picture demo -o vehicle.glb
        strainfmu picture demo -o vehicle.png --case 12 --excluded A1 --excluded A2

    Parameters
    ----------
    folder : folder with map.h5 and snapshots.h5, as build and demo leave it.
    output : file to write: .png, .glb or .vtp.
    case : number of the snapshot, from 1, whose pressure is shown. Default: of greatest incidence.
    excluded : gauges to draw in black.

    Raises
    ------
    InputError
        A file is missing, a gauge or a snapshot is not there, or the suffix is none of these.
    StrainfmuError
        The file could not be written, or matplotlib or, for .vtp, VTK is missing.
    """
    folder = Path(folder)
    for name in ("map.h5", "snapshots.h5"):
        if not (folder / name).is_file():
            raise InputError(f"{folder}: expected {name}, as `strainfmu build` and `demo` leave it, got none")
    inverse_map, snapshots = load_inverse_map(folder / "map.h5"), load_snapshots(folder / "snapshots.h5")
    number = None if case is None else case - 1
    scene = scene_of_snapshot(snapshots, inverse_map, inverse_map.vehicle, number, excluded)
    write_picture(scene, Path(output))
    return scene


def write_picture(scene: Scene, path: Path) -> None:
    """Write ``scene`` in the format of the path's suffix, atomically.

    A .vtp has the surface and the bars of the gauges with the arrays ``value``, NaN at bars, and ``gauge``, the
    number of the gauge from 0 and -1 at the surface.

    Raises
    ------
    InputError
        The suffix is none of :data:`FORMATS`.
    StrainfmuError
        The file could not be written, or matplotlib or, for .vtp, VTK is missing.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"{path}: expected a file {', '.join(FORMATS)}, got '{path.suffix}'")
    if suffix == ".glb":
        write_glb(scene, path)
    elif suffix == ".png":
        save(solid_view(scene), path)
    else:
        mesh, values, gauge = scene.with_bars()
        write_vtk(path, mesh, {"value": values, "gauge": gauge})
