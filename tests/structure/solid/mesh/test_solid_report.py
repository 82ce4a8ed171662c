"""Counts, volumes, areas and masses against the exact ones of known bodies; fields that ParaView reads back."""

from pathlib import Path

import numpy as np
import pytest

from builder.pipeline.structure_run import report_text
from builder.structure.solid.checks import ring_mesh
from builder.structure.solid.mesh_checks import (
    element_volumes,
    exact_wall,
    facet_size,
    facet_size_round_axis,
    mesh_report,
    surface_area,
)
from builder.structure.solid.mesh_files import write_mesh
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, NODES_PER_ELEMENT, SUPPORT
from builder.structure.solid.swept_mesh import full_mesh, swept_wall
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import chain_segments
from strainfmu.errors import InputError, StrainfmuError

pytestmark = pytest.mark.fast

A, B, WIDTH, AROUND = 0.10, 0.12, 0.3, 24


@pytest.mark.parametrize("element_type", sorted(NODES_PER_ELEMENT))
def test_volume_and_areas_of_a_ring(element_type: str) -> None:
    """A polygonal ring exactly for linear elements; the circle to (pi/24)^4/45 relative for quadratic ones."""
    mesh = ring_mesh(element_type, A, B, WIDTH, (2, AROUND, 2))
    half = np.pi / AROUND
    around, across, rtol = 2.0 * np.pi, np.pi, 2e-5
    if element_type in ("hexahedron8", "tetrahedron4"):
        around, across, rtol = 2.0 * AROUND * np.sin(half), AROUND * np.sin(half) * np.cos(half), 1e-12
    assert surface_area(mesh, EXTERNAL) == pytest.approx(around * B * WIDTH, rel=rtol)
    assert surface_area(mesh, INTERNAL) == pytest.approx(around * A * WIDTH, rel=rtol)
    assert surface_area(mesh, SUPPORT) == pytest.approx(across * (B**2 - A**2), rel=rtol)
    assert element_volumes(mesh).sum() == pytest.approx(across * (B**2 - A**2) * WIDTH, rel=rtol)


def test_exact_wall_of_a_cone() -> None:
    """Half-angle a: areas and volumes by Pappus; the inner face is the same cone moved aft by t / sin a."""
    angle, thickness, tip, length = np.deg2rad(10.0), 0.01, 0.2, 1.0
    slope = np.tan(angle)
    exact = exact_wall(chain_segments([(length, angle, angle)]), Wall(thickness, tip, Material(70e9, 0.3)))
    shift = thickness / np.sin(angle)
    front, back = (tip - shift) * slope, (length - shift) * slope
    assert exact[EXTERNAL] == pytest.approx(np.pi * slope * length**2 / np.cos(angle), rel=1e-12)
    assert exact[INTERNAL] == pytest.approx(np.pi * (front + back) * (length - tip) / np.cos(angle), rel=1e-12)
    assert exact[SUPPORT] == pytest.approx(np.pi * ((length * slope) ** 2 - back**2), rel=1e-12)
    cavity = np.pi / 3.0 * (length - tip) * (front**2 + front * back + back**2)
    assert exact["volume"] == pytest.approx(np.pi / 3.0 * slope**2 * length**3 - cavity, rel=1e-12)


def test_swept_mesh_of_a_vehicle_has_its_volume_and_areas() -> None:
    """Cone and ogive: within 2e-5 of the exact ones, the bore through the tip included."""
    body = chain_segments([(1.0, 0.12, 0.12), (2.0, 0.12, 0.0)])
    wall = Wall(0.005, 0.1, Material(70e9, 0.3))
    rows = mesh_report(full_mesh(swept_wall(body, wall, "coarse")), exact=exact_wall(body, wall))
    errors = {what: value for what, value, unit in rows if unit == "%"}
    assert len(errors) == 4
    assert max(abs(value) for value in errors.values()) < 2e-3


def test_rows_hold_counts_quality_and_mass() -> None:
    mesh = ring_mesh("hexahedron20", A, B, WIDTH, (3, AROUND, 1))
    rows = mesh_report(mesh, {"wall": 2700.0})
    value = {what: number for what, number, _ in rows}
    assert value["elements, hexahedron20"] == 3 * AROUND
    assert value["displacement components"] == 3 * value["nodes"] == mesh.n_dof
    assert value["mass"] == pytest.approx(2700.0 * np.pi * (B**2 - A**2) * WIDTH, rel=2e-5)
    assert 0.9 < value["scaled Jacobian, minimum"] <= value["scaled Jacobian, mean"] <= 1.0
    assert value["surface external, facet size"] == pytest.approx(WIDTH / 3.0)
    text = report_text(rows).splitlines()
    assert len(text) == len(rows)
    assert text[2].split()[-1] == str(3 * AROUND)


def test_worst_element_is_placed() -> None:
    mesh = ring_mesh("hexahedron8", A, B, WIDTH, (3, AROUND, 1))
    bent = mesh.node.copy()
    bent[np.argmin(np.linalg.norm(bent - [0.1, 0.0, B], axis=1))] += [0.05, 0.0, 0.0]
    rows = mesh_report(type(mesh)(**{**mesh.__dict__, "node": bent}))
    value = {what: number for what, number, _ in rows}
    assert abs(value["worst element at x"] - 0.1) < 0.08
    assert value["worst element at z"] > 0.09


@pytest.mark.parametrize("density", [{}, {"wall": 0.0}, {"wall": -1.0}])
def test_region_without_density_is_refused(density: dict[str, float]) -> None:
    with pytest.raises(InputError, match="density of region 'wall'"):
        mesh_report(ring_mesh("hexahedron8", A, B, WIDTH, (1, 6, 1)), density)


def test_facet_size_is_the_longest_edge() -> None:
    assert facet_size(ring_mesh("hexahedron20", A, B, 0.5, (1, 40, 1)), INTERNAL) == pytest.approx(0.5)


def test_facet_size_round_the_axis_is_its_chord() -> None:
    """Facets 0.5 m long in x and a fortieth of a turn: the chord; referred to twice the radius, sqrt(2) of it."""
    ring = ring_mesh("hexahedron20", A, B, 0.5, (1, 40, 1))
    chord = 2.0 * A * np.sin(np.pi / 40)
    assert facet_size_round_axis(ring, INTERNAL, A) == pytest.approx(chord, rel=0.01)
    assert facet_size_round_axis(ring, INTERNAL, 2.0 * A) == pytest.approx(np.sqrt(2.0) * chord, rel=0.01)


def test_vtk_reads_what_is_written(tmp_path: Path) -> None:
    """Points, quadratic cells and fields through VTK's own reader; more than one compressed block."""
    pytest.importorskip("vtkmodules", reason="needs the extra cfd (vtk)")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    mesh = ring_mesh("hexahedron20", A, B, WIDTH, (40, 160, 1))
    assert mesh.node.nbytes > 1 << 20
    pressure = np.cos(mesh.node[:, 0])
    write_mesh(tmp_path / "ring.vtu", mesh, {"displacement_m": 2.0 * mesh.node, "pressure <Pa>": pressure})
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "ring.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfCells() == len(mesh.element)
    assert {grid.GetCellType(i) for i in range(0, len(mesh.element), 500)} == {25}
    np.testing.assert_array_equal(vtk_to_numpy(grid.GetPoints().GetData()), mesh.node)
    np.testing.assert_array_equal(vtk_to_numpy(grid.GetCells().GetConnectivityArray()), mesh.element.ravel())
    data = grid.GetPointData()
    np.testing.assert_array_equal(vtk_to_numpy(data.GetArray("displacement_m")), 2.0 * mesh.node)
    np.testing.assert_array_equal(vtk_to_numpy(data.GetArray("pressure <Pa>")), pressure)


def test_bad_fields_and_places_are_refused(tmp_path: Path) -> None:
    mesh = ring_mesh("hexahedron20", A, B, WIDTH, (1, 6, 1))
    with pytest.raises(InputError, match=r"ending '.vtk' found, must be .vtu"):
        write_mesh(tmp_path / "ring.vtk", mesh)
    with pytest.raises(InputError, match=r"field 'p': shape \(5,\) found"):
        write_mesh(tmp_path / "ring.vtu", mesh, {"p": np.zeros(5)})
    with pytest.raises(InputError, match="field 'p': a value is not finite"):
        write_mesh(tmp_path / "ring.vtu", mesh, {"p": np.full(mesh.n_nodes, np.nan)})
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StrainfmuError, match="could not be written"):
        write_mesh(tmp_path / "file" / "ring.vtu", mesh)
    assert not (tmp_path / "ring.vtu").exists()
