"""Surfaces and fields between programs: against meshio as another writer and reader, and closed forms."""

from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest

from builder.aero.cfd.formats.surface_files import close_openings, open_edges, read_surface, write_surface
from builder.aero.cfd.surface_field import read_field
from builder.aero.surface.edges import merge_nodes
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.campaign.snapshots import Snapshots, save_snapshots
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.errors import InputError

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def body() -> SurfaceMesh:
    """Return the shipped vehicle's surface, nodes doubled at the tip and at the slope break."""
    return mesh_of_grid(surface_grid(load_vehicle(IC3X).body(), 60, 32))


def volume(mesh: SurfaceMesh) -> float:
    """Return the enclosed volume [m3] by the divergence theorem."""
    return float(np.einsum("mi,mi->", mesh.point[mesh.triangle].mean(axis=1), mesh.vector_area)) / 3.0


@pytest.mark.parametrize("suffix", [".stl", ".tri", ".vtp", ".vtu"])
def test_closed_surface_is_watertight(body: SurfaceMesh, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"body{suffix}"
    write_surface(path, body, closed=True)
    closed = read_surface(path)
    assert len(open_edges(closed)) == 0
    # Each edge twice: V - E + F = 2 for one closed body without holes (Euler).
    assert closed.n_nodes - 3 * len(closed.triangle) // 2 + len(closed.triangle) == 2
    assert np.linalg.norm(closed.vector_area.sum(axis=0)) < 1e-6 * closed.area.sum()
    # Two frusta whose cross-section is a regular 32-gon; STL holds single precision.
    area = 0.5 * 32 * np.sin(2 * np.pi / 32)
    break_radius = 1.75 * np.tan(np.radians(5.0))
    base_radius = break_radius + 1.85 * np.tan(np.radians(1.0))
    frusta = 1.75 * break_radius**2 + 1.85 * (break_radius**2 + break_radius * base_radius + base_radius**2)
    assert volume(closed) == pytest.approx(area * frusta / 3.0, rel=1e-5)


@pytest.mark.fast
def test_open_surface_is_open_at_the_base_alone(body: SurfaceMesh, tmp_path: Path) -> None:
    write_surface(tmp_path / "body.stl", body)
    surface = read_surface(tmp_path / "body.stl", scale=1e3)
    rim = open_edges(surface)
    assert len(rim) == 32
    np.testing.assert_allclose(surface.point[rim][:, :, 0], 3600.0, rtol=1e-6)


def test_cap_is_a_part_of_its_own(body: SurfaceMesh, tmp_path: Path) -> None:
    write_surface(tmp_path / "body.tri", body, closed=True)
    lines = (tmp_path / "body.tri").read_text().splitlines()
    n_triangles = int(lines[0].split()[1])
    assert lines[-32:] == ["2"] * 32
    assert set(lines[-n_triangles:-32]) == {"1"}


def test_an_opening_that_is_not_flat(body: SurfaceMesh) -> None:
    bent = merge_nodes(body, 1e-9)
    rim = np.unique(open_edges(bent))
    point = bent.point.copy()
    point[rim, 0] += 0.05 * np.sign(point[rim, 1] * point[rim, 2])
    with pytest.raises(InputError, match="not flat"):
        close_openings(SurfaceMesh(point, bent.triangle))


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.stl", {"binary": True}),
        ("a.stl", {"binary": False}),
        ("a.obj", {}),
        ("a.vtk", {"binary": True}),
        ("a.vtk", {"binary": False}),
        ("a.vtk", {"binary": True, "file_format": "vtk42"}),
        ("a.vtk", {"binary": False, "file_format": "vtk42"}),
        ("a.vtu", {"binary": True}),
        ("a.vtu", {"binary": True, "compression": None}),
        ("a.vtu", {"binary": False}),
    ],
)
def test_surfaces_of_another_writer(
    body: SurfaceMesh, tmp_path: Path, name: str, options: dict[str, object]
) -> None:
    mesh = merge_nodes(body, 1e-9)
    meshio.Mesh(mesh.point, [("triangle", mesh.triangle)]).write(tmp_path / name, **options)
    read = read_surface(tmp_path / name)
    assert read.n_nodes == mesh.n_nodes
    assert read.area.sum() == pytest.approx(mesh.area.sum(), rel=1e-6)  # STL: single precision
    assert volume(close_openings(read)) == pytest.approx(volume(close_openings(mesh)), rel=1e-5)


@pytest.mark.parametrize("name", ["body.stl", "body.vtu"])
def test_another_reader_reads_ours(body: SurfaceMesh, tmp_path: Path, name: str) -> None:
    write_surface(tmp_path / name, body)
    read = meshio.read(tmp_path / name)
    corners = read.points[read.cells_dict["triangle"]]
    ours = merge_nodes(body, 1e-9)
    np.testing.assert_allclose(corners, ours.point[ours.triangle], atol=1e-6)


@pytest.mark.fast
def test_polydata_as_openfoam_writes_it(tmp_path: Path) -> None:
    """foamToVTK's patches: polygons of any count, p both in cells (its own) and at points (interpolated)."""
    (tmp_path / "wall.vtk").write_text(
        "# vtk DataFile Version 2.0\nwall\nASCII\nDATASET POLYDATA\nPOINTS 6 float\n"
        "0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 0\n2 1 0\nPOLYGONS 2 9\n4 0 1 2 3\n3 1 4 5\n"
        "CELL_DATA 2\nFIELD attributes 2\np 1 2 float\n10 20\nU 3 2 float\n0 0 0 0 0 0\n"
        "POINT_DATA 6\nFIELD attributes 1\np 1 6 float\n1 2 3 4 5 6\n"
    )
    cells = read_field(tmp_path / "wall.vtk", "p", "cell", 1e-3)
    assert cells.face is not None
    assert cells.triangle is not None
    assert sorted(cells.values[cells.face]) == [10.0, 10.0, 20.0]
    assert SurfaceMesh(cells.point, cells.triangle).area.sum() == pytest.approx(1.5e-6)
    assert read_field(tmp_path / "wall.vtk", "p", "node", 1.0).values.tolist() == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("version", [42, 51])
def test_polydata_as_vtk_writes_it(body: SurfaceMesh, tmp_path: Path, binary: bool, version: int) -> None:
    """Geometry alone: the file ends with its cells, in one block (4.2) or as offsets and connectivity (5.1)."""
    from vtkmodules.vtkIOLegacy import vtkPolyDataWriter
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    write_surface(tmp_path / "a.vtp", body)
    reader, writer = vtkXMLPolyDataReader(), vtkPolyDataWriter()
    reader.SetFileName(str(tmp_path / "a.vtp"))
    writer.SetInputConnection(reader.GetOutputPort())
    writer.SetFileName(str(tmp_path / "a.vtk"))
    (writer.SetFileTypeToBinary if binary else writer.SetFileTypeToASCII)()
    writer.SetFileVersion(version)
    writer.Write()
    whole = read_surface(tmp_path / "a.vtp")
    assert read_surface(tmp_path / "a.vtk").area.sum() == pytest.approx(whole.area.sum(), rel=1e-4)
    content = (tmp_path / "a.vtk").read_bytes()
    (tmp_path / "a.vtk").write_bytes(content[:-40])
    with pytest.raises(InputError, match="cut short"):
        read_surface(tmp_path / "a.vtk")


def test_triangle_strips(tmp_path: Path) -> None:
    (tmp_path / "a.vtk").write_text(
        "# vtk DataFile Version 3.0\nstrip\nASCII\nDATASET POLYDATA\nPOINTS 4 double\n"
        "0 0 0\n1 0 0\n0 1 0\n1 1 0\nTRIANGLE_STRIPS 1 5\n4 0 1 2 3\n"
        "POINT_DATA 4\nSCALARS p double 1\nLOOKUP_TABLE default\n1 2 3 4\n"
    )
    field = read_field(tmp_path / "a.vtk", None, None, 1.0)
    assert field.triangle is not None
    mesh = SurfaceMesh(field.point, field.triangle)
    np.testing.assert_allclose(mesh.vector_area, [[0, 0, 0.5], [0, 0, 0.5]])


@pytest.mark.fast
@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "1 facets begun, 0 complete"),
        ("a.stl", b"\0" * 80 + b"\2\0\0\0" + b"\0" * 50, "cut short"),
        ("a.tri", b"3 1\n0 0 0\n1 0 0\n0 1 0\n1 2 3 1 2\n", "14 numbers"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "node 3 of 3"),
        ("a.obj", b"v 0 0\n", "line 1"),
        ("a.iges", b"x", "'.iges' found"),
    ],
)
def test_damaged_surfaces(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=f"{name}.*{words}"):
        read_surface(tmp_path / name)


def test_commands(snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path, run: Run) -> None:
    code, printed, errors = run("surface", IC3X, "-o", tmp_path / "body.stl", "--closed")
    assert (code, errors) == (0, "")
    assert "body.stl: written" in printed.replace("\n", "")
    assert len(open_edges(read_surface(tmp_path / "body.stl"))) == 0
    code, _, errors = run("surface", IC3X, "-o", tmp_path / "body.step")
    assert code == 2
    assert "got '.step'" in errors
    save_snapshots(snapshots, tmp_path / "snapshots.h5")
    assert run("convert", tmp_path / "snapshots.h5", "-o", tmp_path / "out")[0] == 0
    names = {"case_0001.vtu", "case_0002.vtu", "snapshots.pvd", "manifest.toml"}
    assert {file.name for file in (tmp_path / "out").iterdir()} == names
    code, _, errors = run("convert", tmp_path / "snapshots.h5", "-o", tmp_path / "out", "--format", "plt")
    assert code == 2
    assert "'plt' is not one of 'vtu', 'triq', 'csv'" in errors
