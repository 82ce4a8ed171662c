"""Surfaces of vehicles from files and sections: units, holes, places where they cut themselves, symmetries."""

from math import radians
from pathlib import Path

import numpy as np
import pytest

from builder.aero.cfd.formats.stl import write_stl
from builder.aero.engines.euler import FullBodyEngine
from builder.aero.euler.planes import MarchingGrid
from builder.aero.shapes import pierced_places, sections_mesh, surface_of_file
from builder.aero.surface.mesh import SurfaceMesh, mesh_load_operator, mesh_of_grid
from builder.vehicle.shape.geometry import chain_segments, surface_grid
from builder.vehicle.shape.sectioned_body import SectionedBody
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition
from tests.aero.triangulated_shapes import box, cone

pytestmark = pytest.mark.fast


def stl(folder: Path, mesh: SurfaceMesh, scale: float = 1.0) -> Path:
    path = folder / "body.stl"
    write_stl(path, scale * mesh.point, mesh.triangle)
    return path


def elliptic_cone(height: float = 0.125) -> SectionedBody:
    return SectionedBody(
        station=np.array([0.0, 1.0]),
        half_width=np.array([0.0, 0.25]),
        half_height=np.array([0.0, height]),
        exponent=np.array([2.0, 2.0]),
        centre_z=np.zeros(2),
    )


@pytest.mark.parametrize(("unit", "length"), [("mm", None), ("mm", 1.0), (None, 1.0)])
def test_unit_is_named_or_found_out(tmp_path: Path, unit: str | None, length: float | None) -> None:
    """A closed cone in mm: its base is left out, its sides stay."""
    path = stl(tmp_path, cone(0.2, 24, closed=True), 1000.0)
    surface, notes = surface_of_file(path, unit, length)
    assert np.ptp(surface.point[:, 0]) == pytest.approx(1.0, rel=1e-6)
    assert surface.area.sum() == pytest.approx(cone(0.2, 24).area.sum(), rel=1e-5)
    assert notes == ()


def test_wrong_unit_is_named(tmp_path: Path) -> None:
    path = stl(tmp_path, cone(0.2, 24, closed=True), 1000.0)
    with pytest.raises(InputError, match=r"expected a length of 1 m, got 1000 m in m; in mm it is 1 m"):
        surface_of_file(path, "m", 1.0)
    with pytest.raises(InputError, match=r"shape.length_m: got 1.5 m, expected the file's 1000 in one of m, mm"):
        surface_of_file(path, None, 1.5)


def test_hole_is_refused_with_its_place(tmp_path: Path) -> None:
    whole = mesh_of_grid(surface_grid(chain_segments([(1.0, 0.2, 0.2)]), 12, 16))
    path = stl(tmp_path, SurfaceMesh(whole.point, np.delete(whole.triangle, 60, axis=0)))
    with pytest.raises(InputError, match=r"edges have one triangle only, the first at \(0\.\d+"):
        surface_of_file(path, "m", None)


def test_flipped_triangles_are_turned_and_counted(tmp_path: Path) -> None:
    whole = cone(0.2, 24, closed=True)
    triangle = whole.triangle.copy()
    triangle[:5] = triangle[:5, ::-1]
    surface, notes = surface_of_file(stl(tmp_path, SurfaceMesh(whole.point, triangle)), "m", None)
    assert "5 of 48 triangles were turned" in notes[0]
    assert (surface.vector_area[:, 0] < 0.0).all()


def test_nose_elsewhere_is_refused(tmp_path: Path) -> None:
    moved = cone(0.2, 24, closed=True)
    path = stl(tmp_path, SurfaceMesh(moved.point + np.array([0.5, 0.0, 0.0]), moved.triangle))
    with pytest.raises(InputError, match=r"expected the nose at x = 0, x aft, got the foremost node at x = 0.5 m"):
        surface_of_file(path, "m", None)


def test_surface_that_cuts_itself_is_refused(tmp_path: Path) -> None:
    """A fin pushed through a box without being joined to it."""
    body, fin = box([0.0, -0.1, -0.1], [1.0, 0.1, 0.1], (6, 2, 2)), box([0.5, -0.01, 0.05], [0.8, 0.013, 0.3])
    both = SurfaceMesh(
        np.concatenate([body.point, fin.point]), np.concatenate([body.triangle, fin.triangle + body.n_nodes])
    )
    assert len(pierced_places(body)) == 0
    assert pierced_places(both)[:, 2] == pytest.approx(0.1, abs=0.1)
    with pytest.raises(InputError, match=r"it cuts itself, \d+ edges pierce a triangle, the first at \("):
        surface_of_file(stl(tmp_path, both), "m", None)


def test_flow_over_sections_has_the_symmetries_of_the_body() -> None:
    engine = FullBodyEngine(elliptic_cone(), MarchingGrid(n_radial=8, n_circumferential=8), 12, 24)
    loads = mesh_load_operator(engine.surface, 0.6)
    conditions = [
        FlightCondition(6.0, radians(alpha), radians(beta), 20e3)
        for alpha, beta in ((4.0, 2.0), (-4.0, 2.0), (4.0, -2.0))
    ]
    keys = {engine.flow_key(condition) for condition in conditions}
    assert len(keys) == 1
    flow = engine.solve(keys.pop())
    one, down, port = (loads @ (engine.pressure_ratio(flow, condition) - 1.0) for condition in conditions)
    room = 5e-3 * np.abs(one).max()  # squares are cut along one diagonal
    np.testing.assert_allclose(down, one * [1.0, -1.0, 1.0, -1.0, 1.0], atol=room)
    np.testing.assert_allclose(port, one * [1.0, 1.0, -1.0, 1.0, -1.0], atol=room)
    assert one[1] > 10.0 * room
    assert flow.momentum_error < 1e-2


def test_sections_mesh_of_a_circle_is_that_of_the_profile() -> None:
    round_one = sections_mesh(elliptic_cone(0.25), 20, 36)
    same = mesh_of_grid(
        surface_grid(chain_segments([(1.0, float(np.arctan(0.25)), float(np.arctan(0.25)))]), 20, 36)
    )
    np.testing.assert_allclose(round_one.point, same.point, atol=1e-9)
    np.testing.assert_array_equal(round_one.triangle, same.triangle)
