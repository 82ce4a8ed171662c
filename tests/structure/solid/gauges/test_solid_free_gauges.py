"""Gauges on any surface, and the wall of a body of sections."""

from dataclasses import replace
from functools import cache
from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest

from builder.structure.solid.gauge_layouts import GaugeSurface, free_gauges, surface_axes
from builder.structure.solid.mesh_checks import check_mesh
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SolidMesh
from builder.structure.solid.swept_mesh import SweptResolution, section_wall
from builder.structure.wall import Material, Wall
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.gauges.gauge_entries import GaugeLayoutEntry, Gauges
from builder.vehicle.shape.sectioned_body import SectionedBody
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

BODY = SectionedBody(
    station=np.array([0.0, 1.0]),
    half_width=np.array([0.0, 0.25]),
    half_height=np.array([0.0, 0.125]),
    exponent=np.array([2.0, 2.0]),
    centre_z=np.zeros(2),
)
WALL = Wall(0.003, 0.3, Material(70e9, 0.3))


@cache
def wall_mesh() -> SolidMesh:
    return section_wall(BODY, WALL, SweptResolution(0.08, 1, 24))


def vehicle_with(folder: Path, text: str) -> Vehicle:
    """Return a vehicle whose layout ``a`` is the table ``text``; its shape is not looked at."""
    (folder / "g.csv").write_text(text, encoding="utf-8")
    loaded = load_vehicle(IC3X)
    layouts = {"a": GaugeLayoutEntry(file=str(folder / "g.csv"), largest_distance_mm=5.0)}
    noise = loaded.noise.model_copy(update={"of_layout": None})
    return loaded.model_copy(update={"gauges": Gauges(layout="a", layouts=layouts), "noise": noise})


def test_wall_has_its_thickness_along_the_normal() -> None:
    mesh = wall_mesh()
    check_mesh(mesh, 1.0)
    inner = GaugeSurface(mesh, INTERNAL)
    for x, roll in ((0.5, 10.0), (0.7, 60.0), (0.8, 90.0), (0.6, 200.0)):
        outer = BODY.point(x, radians(roll))
        foot = inner.foot(outer)
        assert np.linalg.norm(foot.offset) == pytest.approx(0.003, rel=0.02)


def test_solid_tip_too_short_is_refused() -> None:
    with pytest.raises(InputError, match=r"the wall of 3 mm fills the body at x = 0.01 m"):
        section_wall(BODY, replace(WALL, solid_tip_length=0.01), SweptResolution(0.08, 1, 24))


def test_gauges_by_position_roll_angle_node_and_element_agree(tmp_path: Path) -> None:
    """A gauge on a corner node of the inner surface, given four ways and in two directions."""
    mesh = wall_mesh()
    facet = mesh.named_surface(INTERNAL)[40]
    node = int(facet[0])
    x, y, z = mesh.node[node]
    roll = np.rad2deg(np.arctan2(y, z))
    by_angle = {
        "x_m,y_m,z_m": f"{x},{y},{z + 1e-4}",
        "x_m,roll_angle_deg": f"{x},{roll}",
        "node": f"{node + 1}",
    }
    for columns, place in by_angle.items():
        gauges = free_gauges(
            vehicle_with(tmp_path, f"name,{columns},angle_deg\ng,{place},0\nh,{place},90\n"), "a", mesh
        )
        np.testing.assert_allclose(gauges.position, np.tile([x, y, z], (2, 1)), atol=2e-4)
        along, across = surface_axes(mesh, gauges)
        np.testing.assert_allclose(gauges.direction, [along[0], across[0]], atol=5e-3)
        assert along[0, 0] > 0.9
        # Increasing roll angle: from +z towards +y.
        assert across[0] @ [0.0, cos(radians(roll)), -sin(radians(roll))] > 0.8
    element = int(np.flatnonzero(np.isin(mesh.element, facet).sum(axis=1) == 8)[0])
    table = f"name,element,direction_x,direction_y,direction_z\ng,{element + 1},1,0,0\n"
    gauges = free_gauges(vehicle_with(tmp_path, table), "a", mesh)
    assert np.linalg.norm(gauges.position[0] - mesh.node[facet].mean(axis=0)) < 2e-3


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("name,x_m,angle_deg\ng,0.5,0\n", "expected the columns name, x_m"),
        ("name,node,angle_deg\ng,0.5,0\n", r"gauge 'g': node: expected a whole number, 1 .. \d+, got 0.5"),
        ("name,node,angle_deg\ng,99999999,0\n", r"number up to 1e\+06, got '99999999'"),
        (
            "name,x_m,roll_angle_deg,angle_deg\ng,0.1,0,0\n",
            "expected a station with the internal surface under it",
        ),
        (
            "name,x_m,y_m,z_m,angle_deg\ng,0.8,0,0.2,0\n",
            r"expected at most 5 mm from surface 'internal', got 1\d\d mm",
        ),
        ("name,x_m,roll_angle_deg,angle_deg\ng,0.5,0,0\ng,0.6,0,0\n", "line 3: name: expected each name once"),
        ("name,x_m,roll_angle_deg,angle_deg\ng,0.5,up,0\n", "column roll_angle_deg: expected a number, got 'up'"),
        (
            "name,x_m,roll_angle_deg,direction_x,direction_y,direction_z\ng,0.5,0,0,0,1\n",
            "expected a direction along the surface, got one across it",
        ),
    ],
)
def test_wrong_tables_are_one_line(tmp_path: Path, table: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        free_gauges(vehicle_with(tmp_path, table), "a", wall_mesh())
    assert "\n" not in str(caught.value)


def test_gauge_on_the_wrong_side_is_named(tmp_path: Path) -> None:
    outer = GaugeSurface(wall_mesh(), EXTERNAL).at_roll_angle(0.8, 0.0, "g").point
    table = f"name,x_m,y_m,z_m,angle_deg\ng,{outer[0]},{outer[1]},{outer[2]},0\n"
    vehicle = vehicle_with(tmp_path, table)
    entry = vehicle.gauges.layouts["a"].model_copy(update={"largest_distance_mm": 1.0})
    vehicle = vehicle.model_copy(update={"gauges": Gauges(layout="a", layouts={"a": entry})})
    with pytest.raises(InputError, match=r"from surface 'internal', got 3 mm .*; it lies on surface 'external'"):
        free_gauges(vehicle, "a", wall_mesh())
