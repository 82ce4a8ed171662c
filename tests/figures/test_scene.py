"""The vehicle in three dimensions: files read again, bars on the surface, what hides what."""

import json
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from builder.aero.cfd.formats.vtk_files import read_vtk
from builder.aero.surface.mesh import mesh_of_grid
from builder.figures.picture_files import write_picture
from builder.figures.scene import (
    BOX_SIDES,
    OBLIQUE_VIEWS,
    STATE_COLOURS,
    Scene,
    scene_of,
    scene_of_snapshot,
    solid_view,
)
from builder.vehicle.shape.geometry import chain_segments, surface_grid
from strainfmu.errors import InputError
from strainfmu.estimator.map.sensors import strain_rows

pytestmark = pytest.mark.fast

GRID = surface_grid(chain_segments([(2.0, 0.1, 0.1)]), 12, 32)
ROLL = np.radians([0.0, 90.0, 180.0, 270.0])


def scene(excluded: tuple[str, ...] = (), sensors: Any = None) -> Scene:
    """Return a cone of 5.7 deg, pressure falling from 3 to 1 along it, with an axial and a hoop gauge at 1 m."""
    out = np.column_stack([np.zeros(4), np.sin(ROLL), np.cos(ROLL)])
    across = np.column_stack([np.zeros(4), np.cos(ROLL), -np.sin(ROLL)])
    aft = np.cos(0.1) * np.array([1.0, 0.0, 0.0]) + np.sin(0.1) * out
    one: Any = SimpleNamespace(
        gauge_position=np.tile(0.09 * out + [1.0, 0.0, 0.0], (2, 1)),
        gauge_direction=np.concatenate([aft, across]),
        gauge_names=tuple(f"{kind}{k}" for kind in "AH" for k in range(4)),
        n_gauges=8,
        vehicle="cone",
        sensors=sensors or strain_rows(8),
    )
    surface = mesh_of_grid(GRID)
    return scene_of(surface, 3.0 - surface.point[:, 0], "p/p_inf [1]", one, "cone", excluded)


def test_bars_lie_on_the_surface_along_the_gauges() -> None:
    """Gauges inside a wall are drawn on its outside: middle on the cone, frame right-handed, bar outwards."""
    one = scene()
    assert one.states == ("axial",) * 4 + ("hoop",) * 4
    size = np.linalg.norm(one.frame, axis=2)
    np.testing.assert_allclose(size, np.tile([0.04, 0.01, 0.004], (8, 1)))
    radius = np.hypot(*one.place[:, 1:].T)
    np.testing.assert_allclose(radius, one.place[:, 0] * np.tan(0.1), atol=3e-3)
    assert np.all(np.linalg.det(one.frame) > 0.0)
    outward = one.frame[:, 2, 1:] / size[:, 2:]
    np.testing.assert_allclose(outward, np.tile(np.column_stack([np.sin(ROLL), np.cos(ROLL)]), (2, 1)), atol=0.15)
    box = one.bar_points[:, BOX_SIDES]
    normal = np.cross(box[:, :, 1] - box[:, :, 0], box[:, :, 2] - box[:, :, 0])
    from_middle = box.mean(axis=2) - one.place[:, None]
    assert np.all(np.einsum("gsi,gsi->gs", normal, from_middle) > 0.0)


def test_excluded_gauges_and_other_sensors() -> None:
    assert scene(("A1",)).states[1] == "excluded"
    with pytest.raises(InputError, match="excluded: expected gauges of the map, A0 and so on, got 'B9'"):
        scene(("B9",))
    rest = scene(sensors=SimpleNamespace(is_strain=np.arange(8) != 2))
    assert rest.gauge_names == ("A0", "A1", "A3", "H0", "H1", "H2", "H3")


def test_snapshots_of_another_vehicle_are_refused() -> None:
    """The pressure of one body is not drawn with the gauges of another."""
    snapshots: Any = SimpleNamespace(reference=np.array([0.2, 0.6, 1.0]))
    one: Any = SimpleNamespace(reference_area=0.2, reference_length=0.5)
    with pytest.raises(InputError, match=r"area 0\.2 m2 and length 0\.5 m, got 0\.2 m2 and 0\.6 m"):
        scene_of_snapshot(snapshots, one, "cone")


def test_glb_holds_what_the_scene_does(tmp_path: Path) -> None:
    """Container, accessors and placement by the specification; a node for each gauge, found at its place."""
    one, path = scene(("H3",)), tmp_path / "vehicle.glb"
    write_picture(one, path)
    content = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON"
    document = json.loads(content[20 : 20 + size])
    binary_size, kind = struct.unpack_from("<I4s", content, 20 + size)
    assert kind == b"BIN\0"
    binary = content[28 + size :]
    assert len(binary) == binary_size == document["buffers"][0]["byteLength"]
    types = {5126: ("<f4", 4), 5125: ("<u4", 4), 5121: ("u1", 1)}
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}

    def array(number: int) -> np.ndarray:
        entry = document["accessors"][number]
        view, (kind, each) = document["bufferViews"][entry["bufferView"]], types[entry["componentType"]]
        count = entry["count"] * width[entry["type"]]
        assert view["byteLength"] == count * each
        assert view["byteOffset"] % 4 == 0
        return np.frombuffer(binary, kind, count, view["byteOffset"]).reshape(entry["count"], -1)

    body = document["meshes"][0]["primitives"][0]
    np.testing.assert_allclose(array(body["attributes"]["POSITION"]), one.surface.point, atol=1e-6)
    np.testing.assert_array_equal(array(body["indices"]).reshape(-1, 3), one.surface.triangle)
    colour = array(body["attributes"]["COLOR_0"])
    assert len(colour) == one.surface.n_nodes
    assert colour[np.argmax(one.values), 0] > colour[np.argmin(one.values), 0]  # yellow and violet
    nodes = {node["name"]: node for node in document["nodes"]}
    x, y, z, w = document["nodes"][0]["rotation"]
    assert (2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)) == pytest.approx((1.0, 0.0))  # z up becomes y up
    for name, place, frame, state in zip(one.gauge_names, one.place, one.frame, one.states, strict=True):
        matrix = np.array(nodes[name]["matrix"]).reshape(4, 4).T
        np.testing.assert_allclose(matrix[:3, 3], place)
        np.testing.assert_allclose(matrix[:3, :3].T, frame)
        mesh = document["meshes"][nodes[name]["mesh"]]["primitives"][0]
        assert document["materials"][mesh["material"]]["name"] == f"gauge, {state}"
    assert nodes["H3"]["extras"]["state"] == "excluded"


def test_glb_and_vtp_are_read_by_vtk(tmp_path: Path) -> None:
    pytest.importorskip("vtkmodules")
    from vtkmodules.vtkIOGeometry import vtkGLTFReader

    one = scene()
    write_picture(one, tmp_path / "vehicle.vtp")
    read = read_vtk(tmp_path / "vehicle.vtp")
    assert len(read.triangle) == len(one.surface.triangle) + 12 * 8
    np.testing.assert_allclose(read.node_arrays["value"][: one.surface.n_nodes], one.values)
    bars = read.point[read.node_arrays["gauge"] == 5.0]
    np.testing.assert_allclose(bars.mean(axis=0), one.place[5], atol=1e-12)
    write_picture(one, tmp_path / "vehicle.glb")
    reader: Any = vtkGLTFReader()
    reader.SetFileName(str(tmp_path / "vehicle.glb"))
    reader.Update()
    blocks = [reader.GetOutput()]
    cells = 0
    while blocks:
        block = blocks.pop()
        if hasattr(block, "GetNumberOfBlocks"):
            blocks += [block.GetBlock(k) for k in range(block.GetNumberOfBlocks())]
        elif block is not None:
            cells += block.GetNumberOfCells()
            top = np.array(block.GetBounds())
            assert np.all(np.abs(top) <= 2.1)
    assert cells == len(one.surface.triangle) + 12 * 8


def test_a_still_shows_the_near_side_alone() -> None:
    """From port above and from starboard below: every gauge once, none through the body; as many colours."""
    figure = solid_view(scene(("A0",)))
    seen = []
    for axis, (_, view) in zip(figure.axes, OBLIQUE_VIEWS, strict=False):
        bars = axis.collections[1].get_facecolors()[:, :3]
        seen.append(len(bars))
        assert {tuple(np.round(one / one.max(), 1)) for one in bars if one.max() > 0.0} <= {
            tuple(np.round(np.array(one) / max(one), 1)) for one in STATE_COLOURS.values() if max(one) > 0.0
        }
        away = np.column_stack([np.zeros(4), np.sin(ROLL), np.cos(ROLL)]) @ view[2]
        near = int((away > 0.05).sum())
        assert 2 * near <= len(bars) <= 6 * near  # two gauges at each place, one to three sides of a bar
    assert all(seen)
    legend = figure.axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["axial, 3", "hoop, 4", "excluded, 1"]


def test_other_formats_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a file \.png, \.glb, \.vtp, got '\.obj'"):
        write_picture(scene(), tmp_path / "vehicle.obj")


def test_the_inside_of_an_open_end_is_grey() -> None:
    """The pressure acts outside: what is seen of the wall's inner face has no colour of the scale."""
    figure = solid_view(scene())
    for axis in figure.axes[: len(OBLIQUE_VIEWS)]:
        paint = axis.collections[0].get_facecolors()[:, :3]
        is_grey = np.ptp(paint, axis=1) < 1e-12
        assert 0.0 < is_grey.mean() < 0.6
