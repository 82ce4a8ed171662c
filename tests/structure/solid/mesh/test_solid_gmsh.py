"""Gmsh's tetrahedra of the vehicle's wall, of STEP and of STL files, and Gmsh's own files read back."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from installed_gmsh import gmsh_or_skip

from builder.structure.solid.gmsh_mesh import (
    ORIGIN,
    STRETCH,
    X_AXIS,
    gmsh_model,
    graded_wall_mesh,
    step_mesh,
    stl_mesh,
)
from builder.structure.solid.mesh_checks import check_mesh, element_volumes, exact_wall, surface_area
from builder.structure.solid.mesh_files import read_mesh
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import BodyOfRevolution, chain_segments
from strainfmu.errors import InputError, StrainfmuError

METAL = Material(70e9, 0.33)
WALL = Wall(thickness=0.01, solid_tip_length=0.25, material=METAL)


@pytest.fixture(scope="module")
def gmsh() -> Any:
    return gmsh_or_skip()


@pytest.fixture(scope="module")
def body() -> BodyOfRevolution:
    """Cone, then an ogive that ends as a cylinder."""
    return chain_segments([(0.5, 0.15, 0.15), (1.0, 0.15, 0.0)])


@pytest.fixture(scope="module")
def mesh(gmsh: Any, body: BodyOfRevolution) -> SolidMesh:
    return graded_wall_mesh(body, WALL, 0.9)


def assert_size(mesh: SolidMesh, exact: dict[str, float], rel: float) -> None:
    assert element_volumes(mesh).sum() == pytest.approx(exact["volume"], rel=rel)
    for name in (EXTERNAL, INTERNAL, SUPPORT):
        assert surface_area(mesh, name) == pytest.approx(exact[name], rel=rel)


def test_wall_has_its_size_and_names(mesh: SolidMesh, body: BodyOfRevolution) -> None:
    """Volume and areas against integrals over the meridian: 0.01 %."""
    check_mesh(mesh, length=1.0)
    assert sorted(mesh.surface) == ["cavity_front", EXTERNAL, INTERNAL, SUPPORT]
    assert_size(mesh, exact_wall(body, WALL), 1e-4)
    front = mesh.node[mesh.surface["cavity_front"]]
    assert np.ptp(front[..., 0]) < 1e-12
    assert np.allclose(mesh.node[mesh.surface[SUPPORT]][..., 0], 1.0, rtol=0, atol=1e-12)


def test_nodes_lie_on_the_surfaces(mesh: SolidMesh, body: BodyOfRevolution) -> None:
    """Middle nodes too, but for the few edges made straight at the tip."""
    x, y, z = mesh.node[np.unique(mesh.surface[EXTERNAL])].T
    off = np.abs(np.hypot(y, z) - body.radius(np.clip(x, 0.0, 1.0)))
    assert np.quantile(off, 0.98) < 1e-5
    assert off[x > 0.1].max() < 1e-4
    assert off.max() < 2e-3


def test_middle_nodes_are_those_of_their_edges(mesh: SolidMesh) -> None:
    """VTK's order: Gmsh's would put two middles of each element on a wrong edge."""
    edges = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    for middle, (a, b) in enumerate(edges, 4):
        ends = mesh.node[mesh.element[:, [a, b]]]
        off = np.linalg.norm(mesh.node[mesh.element[:, middle]] - ends.mean(axis=1), axis=1)
        assert (off < 0.15 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)).all()


def test_finer_is_finer(mesh: SolidMesh, body: BodyOfRevolution) -> None:
    assert len(graded_wall_mesh(body, WALL, 0.6).element) > 1.3 * len(mesh.element)


def test_graded_mesh_follows_the_decay_length(gmsh: Any, body: BodyOfRevolution) -> None:
    """Edges round the axis over sqrt(r t) alike fore and aft, and those along it twice as long: 25 %."""
    mesh = graded_wall_mesh(body, WALL, 0.7)
    check_mesh(mesh, length=1.0)
    assert_size(mesh, exact_wall(body, WALL), 1e-3)
    corner = mesh.node[mesh.surface[EXTERNAL][:, :3]]
    edge = (np.roll(corner, -1, axis=1) - corner).reshape(-1, 3)
    middle = (0.5 * (np.roll(corner, -1, axis=1) + corner)).reshape(-1, 3)
    radius = np.hypot(middle[:, 1], middle[:, 2])
    along = np.hypot(edge[:, 0], np.einsum("ec,ec->e", edge[:, 1:], middle[:, 1:]) / radius)
    around = np.sqrt(np.maximum(np.sum(edge**2, axis=1) - along**2, 0.0))
    for start, end in ((0.35, 0.6), (0.75, 1.0)):
        here = (middle[:, 0] > start) & (middle[:, 0] < end)
        share = np.quantile(around[here] / np.sqrt(radius[here] * WALL.thickness), 0.9)
        assert share == pytest.approx(0.7, rel=0.25)
        assert np.quantile(along[here], 0.9) == pytest.approx(STRETCH * np.quantile(around[here], 0.9), rel=0.25)
    with pytest.raises(InputError, match="relative_length 0 must be greater than 0"):
        graded_wall_mesh(body, WALL, 0.0)


def test_session_of_the_caller_is_left_alone(gmsh: Any) -> None:
    gmsh.initialize(interruptible=False)
    try:
        gmsh.model.add("mine")
        with gmsh_model("block") as session:
            session.model.occ.addBox(0, 0, 0, 1, 1, 1)
        assert gmsh.isInitialized()
        assert gmsh.model.getCurrent() == "mine"
    finally:
        gmsh.finalize()


@pytest.fixture
def cup(gmsh: Any) -> Iterator[Any]:
    """Cylinder of 1 m length and 0.2 m radius, bored 0.15 m wide from x = 0.3 aft, drawn in Gmsh in metres."""
    with gmsh_model("cup") as session:
        outside = session.model.occ.addCylinder(*ORIGIN, *X_AXIS, 0.2)
        inside = session.model.occ.addCylinder(*(0.3, 0, 0), *X_AXIS, 0.15)
        session.model.occ.cut([(3, outside)], [(3, inside)])
        session.model.occ.synchronize()
        yield session


CUP = {
    "volume": np.pi * (0.2**2 - 0.7 * 0.15**2),
    EXTERNAL: np.pi * (2.0 * 0.2 + 0.2**2),
    INTERNAL: np.pi * (2.0 * 0.15 * 0.7 + 0.15**2),
    SUPPORT: np.pi * (0.2**2 - 0.15**2),
}


def test_step_file(cup: Any, tmp_path: Path) -> None:
    """Written in millimetres: what is drawn as 1 is 1 mm."""
    cup.option.setString("Geometry.OCCTargetUnit", "MM")
    cup.write(str(tmp_path / "cup.step"))
    text = (tmp_path / "cup.step").read_text()
    assert "MILLI" in text
    mesh = step_mesh(tmp_path / "cup.step", 0.05e-3)
    metre = replace(mesh, node=1e3 * mesh.node)
    check_mesh(metre, length=1.0)
    assert_size(metre, CUP, 1e-3)


def test_step_file_of_a_full_turn_that_ends_in_a_point(gmsh: Any, tmp_path: Path) -> None:
    """Hollow cone of 1 m, drawn in one turn, which Gmsh alone fails to mesh; graded towards the axis."""
    with gmsh_model("cone") as session:
        outside = session.model.occ.addCone(*ORIGIN, *X_AXIS, 0.0, 0.2)
        inside = session.model.occ.addCone(*(0.3, 0, 0), *(0.7, 0, 0), 0.04, 0.18)
        session.model.occ.cut([(3, outside)], [(3, inside)])
        session.model.occ.synchronize()
        session.option.setString("Geometry.OCCTargetUnit", "M")
        session.write(str(tmp_path / "cone.step"))
    mesh = step_mesh(tmp_path / "cone.step", 0.05, graded_from=0.2)
    check_mesh(mesh, length=1.0)
    assert len(mesh.region_names) == 1
    hollow = np.pi * 0.7 / 3.0 * (0.04**2 + 0.04 * 0.18 + 0.18**2)
    assert element_volumes(mesh).sum() == pytest.approx(np.pi * 0.2**2 / 3.0 - hollow, rel=1e-3)
    assert surface_area(mesh, EXTERNAL) == pytest.approx(np.pi * 0.2 * np.hypot(1.0, 0.2), rel=1e-3)
    assert surface_area(mesh, SUPPORT) == pytest.approx(np.pi * (0.2**2 - 0.18**2), rel=1e-3)
    fore, aft = (mesh.node[mesh.element[:, 0], 0] < 0.5), (mesh.node[mesh.element[:, 0], 0] > 0.8)
    size = np.linalg.norm(mesh.node[mesh.element[:, 1]] - mesh.node[mesh.element[:, 0]], axis=1)
    assert np.median(size[fore]) < 0.8 * np.median(size[aft])


def test_stl_file(cup: Any, tmp_path: Path) -> None:
    """The surface is that of the file's triangles, chords of 0.03 m: 0.5 %."""
    cup.option.setNumber("Mesh.MeshSizeMax", 0.03)
    cup.model.mesh.generate(2)
    cup.write(str(tmp_path / "cup.stl"))
    mesh = stl_mesh(tmp_path / "cup.stl", 0.06, 1.0)
    check_mesh(mesh, length=1.0)
    assert_size(mesh, CUP, 5e-3)
    inches = stl_mesh(tmp_path / "cup.stl", 0.06 * 0.0254, 0.0254)
    assert np.ptp(inches.node[:, 0]) == pytest.approx(0.0254, rel=1e-9)


def test_stl_with_a_closed_cavity(gmsh: Any, tmp_path: Path) -> None:
    """Ball of radius 0.5 m with a hollow of 0.3 m: two shells; no plane base, so the names are not used."""
    with gmsh_model("ball") as session:
        outside, inside = (session.model.occ.addSphere(0, 0, 0, radius) for radius in (0.5, 0.3))
        session.model.occ.cut([(3, outside)], [(3, inside)])
        session.model.occ.synchronize()
        session.option.setNumber("Mesh.MeshSizeMax", 0.08)
        session.model.mesh.generate(2)
        session.write(str(tmp_path / "ball.stl"))
    mesh = stl_mesh(tmp_path / "ball.stl", 0.15, 1.0)
    assert element_volumes(mesh).sum() == pytest.approx(4.0 / 3.0 * np.pi * (0.5**3 - 0.3**3), rel=0.02)
    assert surface_area(mesh, INTERNAL) == pytest.approx(4.0 * np.pi * 0.3**2, rel=0.02)


def test_open_stl_is_refused(gmsh: Any, tmp_path: Path) -> None:
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    (tmp_path / "one.stl").write_text(f"solid one\n{facet}endsolid one\n")
    with pytest.raises(InputError, match=r"one.stl: not closed: 3 of 3 edges do not join two triangles"):
        stl_mesh(tmp_path / "one.stl", 0.1, 1.0)


def test_damaged_files_are_one_line(gmsh: Any, tmp_path: Path) -> None:
    for name in ("part.step", "part.stl"):
        (tmp_path / name).write_text("nothing of the kind")
        with pytest.raises(StrainfmuError, match=name) as found:
            step_mesh(tmp_path / name, 0.1) if name.endswith("step") else stl_mesh(tmp_path / name, 0.1, 1.0)
        assert "\n" not in str(found.value)


def test_bad_arguments_are_refused(tmp_path: Path, body: BodyOfRevolution) -> None:
    with pytest.raises(InputError, match="no such file"):
        step_mesh(tmp_path / "none.step", 0.1)
    (tmp_path / "part.stl").write_text("solid\nendsolid\n")
    with pytest.raises(InputError, match="file_unit nan m must be greater than 0"):
        stl_mesh(tmp_path / "part.stl", 0.1, float("nan"))


def test_missing_gmsh_is_one_line(monkeypatch: pytest.MonkeyPatch, body: BodyOfRevolution) -> None:
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(
        StrainfmuError, match=r'pip install "strainfmu\[mesh\]", on Debian also apt-get install libglu1'
    ):
        graded_wall_mesh(body, WALL, 0.9)


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("hexahedra", [False, True])
def test_file_of_gmsh_with_physical_groups(gmsh: Any, tmp_path: Path, version: float, hexahedra: bool) -> None:
    """A tube in Gmsh's own file and node order, in millimetres, through the importer; hexahedra by extrusion."""
    pytest.importorskip("meshio", reason="needs the extra mesh (meshio)")
    with gmsh_model("tube") as session:
        occ = session.model.occ
        ring = occ.cut([(2, occ.addDisk(0, 0, 0, 120, 120))], [(2, occ.addDisk(0, 0, 0, 100, 100))])[0]
        occ.rotate(ring, *ORIGIN, *(0, 1, 0), 0.5 * np.pi)
        layers = {"numElements": [2], "recombine": True} if hexahedra else {}
        tube = occ.extrude(ring, 300, 0, 0, **layers)
        occ.synchronize()
        session.model.addPhysicalGroup(3, [tag for dim, tag in tube if dim == 3], name="Skin")
        for name, inside in _sides(session).items():
            session.model.addPhysicalGroup(2, inside, name=name)
        session.option.setNumber("Mesh.MeshSizeMax", 40.0)
        session.option.setNumber("Mesh.SecondOrderIncomplete", 1)
        session.option.setNumber("Mesh.MshFileVersion", version)
        if hexahedra:
            session.option.setNumber("Mesh.RecombineAll", 1)
            session.option.setNumber("Mesh.SubdivisionAlgorithm", 1)
        session.model.mesh.generate(3)
        session.model.mesh.setOrder(2)
        session.write(str(tmp_path / "tube.msh"))
    mesh = read_mesh(tmp_path / "tube.msh", 1e-3, length=0.3)
    assert mesh.element_type == ("hexahedron20" if hexahedra else "tetrahedron10")
    assert mesh.region_names == ("skin",)
    assert element_volumes(mesh).sum() == pytest.approx(np.pi * (0.12**2 - 0.10**2) * 0.3, rel=1e-3)
    assert surface_area(mesh, EXTERNAL) == pytest.approx(2.0 * np.pi * 0.12 * 0.3, rel=1e-3)
    assert surface_area(mesh, SUPPORT) == pytest.approx(np.pi * (0.12**2 - 0.10**2), rel=1e-3)


def _sides(session: Any) -> dict[str, list[int]]:
    """Tell the faces of the tube apart by their size."""
    sides: dict[str, list[int]] = {EXTERNAL: [], INTERNAL: [], SUPPORT: []}
    for _, tag in session.model.getEntities(2):
        low_x, _, _, high_x, high_y, _ = session.model.getBoundingBox(2, tag)
        if high_x - low_x > 1.0:
            sides[EXTERNAL if high_y > 110.0 else INTERNAL].append(tag)
        elif low_x > 299.0:
            sides[SUPPORT].append(tag)
    return sides


def test_step_file_of_two_solids(gmsh: Any, tmp_path: Path) -> None:
    """Two bars end to end: joined at their common face, two regions of the right volumes [mm]."""
    with gmsh_model("bars") as session:
        for start, length in ((0, 1), (1, 3)):
            session.model.occ.addBox(start, 0, 0, length, 1, 1)
        session.model.occ.synchronize()
        session.option.setString("Geometry.OCCTargetUnit", "MM")
        session.write(str(tmp_path / "bars.step"))
    mesh = step_mesh(tmp_path / "bars.step", 0.5e-3)
    check_mesh(mesh, length=4e-3, hollow=False)
    assert len(mesh.region_names) == 2
    volume = element_volumes(mesh)
    assert sorted(volume[mesh.region == i].sum() for i in range(2)) == pytest.approx([1e-9, 3e-9], rel=1e-6)
