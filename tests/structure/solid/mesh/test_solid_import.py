"""Meshes of other programs, each written here in the form its own manual gives, read back node by node."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from builder.structure.solid.checks import ring_mesh
from builder.structure.solid.mesh_files import read_mesh, write_mesh
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

meshio = pytest.importorskip("meshio", reason="needs the extra mesh (meshio)")

NAMES = (EXTERNAL, INTERNAL, SUPPORT)
# Node orders that differ from VTK's: C3D20 and C3D10 do not; CHEXA has the upright edges before those of the top.
NASTRAN_HEXAHEDRON = [*range(12), 16, 17, 18, 19, 12, 13, 14, 15]


def ring(element_type: str = "tetrahedron10") -> SolidMesh:
    return ring_mesh(element_type, 0.10, 0.12, 0.3, (3, 12, 1))


def assert_same(found: SolidMesh, wanted: SolidMesh) -> None:
    """Same nodes, elements and surfaces, facets in any order."""
    assert found.element_type == wanted.element_type
    np.testing.assert_allclose(found.node, wanted.node, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found.element, wanted.element)
    for name in NAMES:
        one, other = (np.unique(np.sort(mesh.surface[name], axis=1), axis=0) for mesh in (found, wanted))
        np.testing.assert_array_equal(one, other)


def abaqus(mesh: SolidMesh, surfaces: bool = True) -> str:
    """Elements in two element sets of half each, surfaces as node sets; Abaqus Analysis User's Guide, 2.1."""
    kind = {"tetrahedron10": "C3D10", "hexahedron20": "C3D20", "hexahedron8": "C3D8", "tetrahedron4": "C3D4"}
    lines = ["*Heading", "ring", "*Node"]
    lines += [f"{i}, {x:.16e}, {y:.16e}, {z:.16e}" for i, (x, y, z) in enumerate(mesh.node, 1)]
    half = len(mesh.element) // 2
    for name, part, first in (("Front", mesh.element[:half], 1), ("Rear", mesh.element[half:], half + 1)):
        lines.append(f"*Element, type={kind[mesh.element_type]}, elset={name}")
        for number, nodes in enumerate(part + 1, first):
            text = [str(number), *map(str, nodes)]
            lines += [", ".join(text[:16]) + ("," if len(text) > 16 else "")]
            lines += [", ".join(text[16:])] if len(text) > 16 else []
    for name in NAMES if surfaces else ():
        nodes = np.unique(mesh.surface[name]) + 1
        lines.append(f"*Nset, nset={name.capitalize()}")
        lines += [", ".join(map(str, nodes[i : i + 12])) + "," for i in range(0, len(nodes), 12)]
    return "\n".join([*lines, ""])


def nastran(mesh: SolidMesh) -> str:
    """Free field; facets as shells of property 11, 12, 13; MSC Nastran Quick Reference Guide, bulk data."""
    hexahedra = mesh.element_type == "hexahedron20"
    solid, shell = ("CHEXA", "CQUAD8") if hexahedra else ("CTETRA", "CTRIA6")
    cards = [(solid, 1, nodes) for nodes in mesh.element[:, NASTRAN_HEXAHEDRON if hexahedra else range(10)]]
    for property_number, name in enumerate(NAMES, 11):
        cards += [(shell, property_number, nodes) for nodes in mesh.surface[name]]
    lines = ["SOL 101", "CEND", "BEGIN BULK"]
    lines += [f"GRID,{i},,{x:.14e},{y:.14e},{z:.14e}" for i, (x, y, z) in enumerate(mesh.node, 1)]
    for number, (card, property_number, nodes) in enumerate(cards, 1):
        fields = [str(number), str(property_number), *(str(node + 1) for node in nodes)]
        rows = [fields[i : i + 8] for i in range(0, len(fields), 8)]
        lines += [
            ",".join([card if i == 0 else "+", *row, "+" if i < len(rows) - 1 else ""])
            for i, row in enumerate(rows)
        ]
    return "\n".join([*lines, "ENDDATA", ""])


@pytest.mark.parametrize("element_type", ["tetrahedron10", "hexahedron20", "hexahedron8", "tetrahedron4"])
def test_abaqus(tmp_path: Path, element_type: str) -> None:
    mesh = ring(element_type)
    (tmp_path / "ring.inp").write_text(abaqus(mesh))
    found = read_mesh(tmp_path / "ring.inp", length=0.3)
    assert_same(found, mesh)
    assert found.region_names == ("front", "rear")
    assert np.bincount(found.region).tolist() == [len(mesh.element) // 2] * 2


@pytest.mark.parametrize("element_type", ["tetrahedron10", "hexahedron20"])
def test_nastran_in_millimetres(tmp_path: Path, element_type: str) -> None:
    mesh = ring(element_type)
    (tmp_path / "ring.bdf").write_text(nastran(replace(mesh, node=1e3 * mesh.node)))
    found = read_mesh(tmp_path / "ring.bdf", 1e-3, {11: "external", 12: "internal", 13: "support"}, length=0.3)
    assert_same(found, mesh)
    assert found.region_names == ("wall",)


def test_nastran_with_another_coordinate_system_is_refused(tmp_path: Path) -> None:
    text = nastran(ring()).replace("GRID,7,,", "GRID,7,2,")
    text = "\n".join(
        line.replace(",,", ",0,", 1) if line.startswith("GRID") else line for line in text.split("\n")
    )
    (tmp_path / "ring.bdf").write_text(text)
    with pytest.raises(InputError, match="another than the basic coordinate system"):
        read_mesh(tmp_path / "ring.bdf")


def test_gmsh_physical_names(tmp_path: Path) -> None:
    """Version 2.2; facets turned inward in the file come out outward."""
    mesh = ring()
    facets = [mesh.surface[name][:, [0, 2, 1, 5, 4, 3]] for name in NAMES]
    tags = [np.full(len(cells), tag) for tag, cells in enumerate((mesh.element, *facets), 1)]
    raw = meshio.Mesh(
        mesh.node,
        [("tetra10", mesh.element), *(("triangle6", facet) for facet in facets)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={
            "Skin": np.array([1, 3]),
            **{name.upper(): np.array([i, 2]) for i, name in enumerate(NAMES, 2)},
        },
    )
    meshio.write(tmp_path / "ring.msh", raw, file_format="gmsh22")
    found = read_mesh(tmp_path / "ring.msh")
    assert_same(found, mesh)
    assert found.region_names == ("skin",)


def test_own_vtu_comes_back(tmp_path: Path) -> None:
    mesh = ring("hexahedron20")
    write_mesh(tmp_path / "ring.vtu", mesh, {"temperature_K": np.full(mesh.n_nodes, 300.0)}, with_surfaces=True)
    found = read_mesh(tmp_path / "ring.vtu")
    assert_same(found, mesh)
    assert found.region_names == ("wall",)


def test_names_by_position(tmp_path: Path) -> None:
    """A cup: closed in front, open aft; the wall's inner face and the cavity's front are internal."""
    mesh = ring()
    write_mesh(tmp_path / "ring.vtu", mesh)
    with pytest.raises(InputError, match="no surface 'external'"):
        read_mesh(tmp_path / "ring.vtu")
    with pytest.raises(InputError, match="no surface 'internal'"):  # through the open front both faces are one
        read_mesh(tmp_path / "ring.vtu", name_by_position=True)


def test_mixed_cells_are_refused(tmp_path: Path) -> None:
    mesh = ring()
    wedge = np.arange(6)[None]
    meshio.write(tmp_path / "mixed.vtu", meshio.Mesh(mesh.node, [("tetra10", mesh.element), ("wedge", wedge)]))
    with pytest.raises(InputError, match=r"mixed.vtu: 216 tetra10 and 1 wedge found, must be one kind of tetra10"):
        read_mesh(tmp_path / "mixed.vtu")
    linear = mesh.element[:, :4]
    meshio.write(
        tmp_path / "mixed.vtu", meshio.Mesh(mesh.node, [("tetra10", mesh.element), ("tetra", linear[:2])])
    )
    with pytest.raises(InputError, match="216 tetra10 and 2 tetra found"):
        read_mesh(tmp_path / "mixed.vtu")


def test_surface_mesh_alone_and_full_hexahedra_are_refused(tmp_path: Path) -> None:
    mesh = ring()
    meshio.write(tmp_path / "skin.vtu", meshio.Mesh(mesh.node, [("triangle6", mesh.surface[EXTERNAL])]))
    with pytest.raises(InputError, match="no volume cells found"):
        read_mesh(tmp_path / "skin.vtu")
    meshio.write(tmp_path / "full.vtu", meshio.Mesh(mesh.node, [("hexahedron27", np.arange(27)[None])]))
    with pytest.raises(InputError, match=r"1 hexahedron27 found.*incomplete"):
        read_mesh(tmp_path / "full.vtu")


def test_wrong_unit_is_found(tmp_path: Path) -> None:
    (tmp_path / "ring.inp").write_text(abaqus(replace(ring(), node=1e3 * ring().node)))
    with pytest.raises(
        InputError, match=r"ring.inp: mesh: 300 m long in x, the vehicle 0.3 m; read it with the unit mm"
    ):
        read_mesh(tmp_path / "ring.inp", length=0.3)
    with pytest.raises(InputError, match=r"unit 0 m must be greater than 0"):
        read_mesh(tmp_path / "ring.inp", 0.0)


def test_elements_in_no_or_two_groups_are_refused(tmp_path: Path) -> None:
    text = abaqus(ring()).replace("elset=Rear", "elset=Front_2")
    for extra, match in (
        ("*Elset, elset=Patch\n1, 2, 3,\n", "3 elements are in several of the groups"),
        ("", None),
    ):
        (tmp_path / "ring.inp").write_text(text + extra)
        if match is None:
            assert read_mesh(tmp_path / "ring.inp").region_names == ("front", "front_2")
        else:
            with pytest.raises(InputError, match=match):
                read_mesh(tmp_path / "ring.inp")


def test_group_of_facets_inside_is_refused(tmp_path: Path) -> None:
    """Property 13 given to faces between two elements."""
    mesh = ring("hexahedron20")
    at_cut = mesh.node[mesh.element][..., 0].max(axis=1) < 0.11
    cut = mesh.element[at_cut][:, [1, 2, 6, 5, 9, 18, 13, 17]]
    (tmp_path / "ring.bdf").write_text(nastran(replace(mesh, surface={**mesh.surface, SUPPORT: cut})))
    with pytest.raises(InputError, match="surface 'support': 12 of 12 facets are not outer faces of elements"):
        read_mesh(tmp_path / "ring.bdf", 1.0, {11: "external", 12: "internal", 13: "support"})


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text[: len(text) // 2],
        lambda text: "not a mesh",
        lambda text: "",
        lambda text: text.replace("GRID", "CORD"),
    ],
    ids=["cut short", "text", "empty", "no nodes"],
)
def test_damaged_file_is_one_line(
    tmp_path: Path, spoil: Callable[[str], str], capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "ring.bdf").write_text(spoil(nastran(ring())))
    with pytest.raises(InputError, match=r"ring.bdf: ") as found:
        read_mesh(tmp_path / "ring.bdf")
    assert "\n" not in str(found.value)
    assert capfd.readouterr() == ("", "")


def test_missing_file_and_unknown_ending(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_mesh(tmp_path / "ring.msh")
    (tmp_path / "ring.xyz9").write_text("x")
    with pytest.raises(InputError, match="meshio cannot read it"):
        read_mesh(tmp_path / "ring.xyz9")
