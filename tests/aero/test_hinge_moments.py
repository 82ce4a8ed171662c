"""Hinge moments of regions of a surface against closed forms, and entries that are wrong."""

from typing import Any

import numpy as np
import pytest

from builder.aero.load_groups import hinge_operator, other_load_fields, other_load_operator, six_loads
from builder.aero.surface.mesh import SurfaceMesh
from builder.vehicle.map_options import MapEntry
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

STRIP = {"from_m": [0.2, -1.0, -0.1], "to_m": [0.7, 1.0, 0.1]}
FLAP = {"name": "flap", "region": "strip", "point_m": [0.2, 0.0, 0.0], "direction": [0.0, 2.0, 0.0]}
PLATE = SurfaceMesh(
    np.array([[0.0, -0.5, 0.0], [1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [0.0, 0.5, 0.0]]),
    np.array([[0, 1, 2], [0, 2, 3]]),
)
"""A plate of 1 m2 in z = 0, its normal up."""


def entry(*hinges: dict[str, Any], region: dict[str, Any] | None = None) -> MapEntry:
    return MapEntry.model_validate({"regions": {"strip": region or STRIP}, "hinge_moments": list(hinges)})


def test_pressure_on_a_flap_turns_it_about_its_hinge() -> None:
    """Pressure from above on the strip 0.2 < x < 0.7 pushes its aft edge down, from z to x: about +y."""
    row = hinge_operator(PLATE, entry(FLAP))
    assert row @ np.full(4, 3.0) == pytest.approx([3.0 * 0.5 * 0.25], rel=1e-14)
    # Of pressure x: integral of x (x - 0.2) over the strip.
    linear = (0.7**3 - 0.2**3) / 3.0 - 0.2 * (0.7**2 - 0.2**2) / 2.0
    assert row @ PLATE.point[:, 0] == pytest.approx([linear], rel=1e-13)


def test_the_line_counts_by_its_direction_and_not_by_the_point_on_it() -> None:
    one, moved, turned, along = hinge_operator(
        PLATE,
        entry(
            FLAP,
            FLAP | {"name": "moved", "point_m": [0.2, 7.0, 0.0]},
            FLAP | {"name": "turned", "direction": [0.0, -0.3, 0.0]},
            FLAP | {"name": "along the force", "direction": [0.0, 0.0, 1.0]},
        ),
    )
    np.testing.assert_allclose(moved, one, rtol=1e-13)
    np.testing.assert_allclose(turned, -one, rtol=1e-15)
    np.testing.assert_array_equal(along, 0.0)


def fin() -> SurfaceMesh:
    """A closed box 0 < x < 0.2, -0.3 < y < 0.3, -0.01 < z < 0.01, its normals outward."""
    corner = np.array([[x, y, z] for x in (0.0, 0.2) for y in (-0.3, 0.3) for z in (-0.01, 0.01)])
    side = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return SurfaceMesh(corner, np.array([(a, *two) for a, b, c, d in side for two in ((b, c), (c, d))]))


def test_uniform_pressure_on_a_fin_acts_as_on_its_root() -> None:
    """Uniform pressure does nothing on a closed surface: on the part y > 0.1 it acts as opposite to the cut there,
    a force p A inboard at its centre."""
    mesh, area = fin(), 0.2 * 0.02
    assert mesh.vector_area.sum(axis=0) == pytest.approx(0.0, abs=1e-16)
    outboard = {"from_m": [-1.0, 0.1, -1.0], "to_m": [1.0, 1.0, 1.0]}
    about_z = {"name": "z", "region": "strip", "point_m": [0.5, 0.0, 0.3], "direction": [0.0, 0.0, 1.0]}
    skew = about_z | {"name": "skew", "point_m": [0.1, 0.0, 0.02], "direction": [3.0, 0.0, 4.0]}
    moments = hinge_operator(mesh, entry(about_z, skew, region=outboard)) @ np.full(8, 7.0)
    # (r - a) x F with F = -7 A e_y: along z -(0.1 - 0.5) 7 A, along x (0 - 0.02) 7 A.
    np.testing.assert_allclose(moments, [0.4 * 7.0 * area, 0.6 * -0.02 * 7.0 * area], rtol=1e-12)


def test_hinge_moments_stand_behind_the_other_loads() -> None:
    whole = other_load_operator(PLATE, entry(FLAP).model_copy(update={"section_stations_m": (0.5,)}), 0.1)
    np.testing.assert_array_equal(whole[0], six_loads(PLATE, 0.1)[5])
    np.testing.assert_array_equal(whole[1:7], six_loads(PLATE, 0.5, 0.5))
    np.testing.assert_array_equal(whole[7:], hinge_operator(PLATE, entry(FLAP)))


def test_a_bending_moment_is_that_of_the_section_in_its_plane() -> None:
    bending = [{"name": f"joint {a}", "station_m": 0.5, "roll_angle_deg": a} for a in (0.0, 90.0, 30.0, 210.0)]
    asked = MapEntry.model_validate({"bending_moments": bending})
    section = six_loads(PLATE, 0.5, 0.5)
    found = other_load_operator(PLATE, asked, 0.1)[1:]
    np.testing.assert_array_equal(found[0], section[3])
    np.testing.assert_allclose(found[1], section[4], rtol=0.0, atol=1e-16)
    np.testing.assert_allclose(found[2], np.sqrt(0.75) * section[3] + 0.5 * section[4], rtol=1e-14)
    np.testing.assert_allclose(found[3], -found[2], rtol=1e-14)
    # Pressure from above on 0 < x < 0.5 pushes the nose down: -p A 0.25 m.
    assert found[0] @ np.full(4, 3.0) == pytest.approx(-3.0 * 0.5 * 0.25, rel=1e-14)
    lines = other_load_fields(asked)["bending_lines"]
    of_forces = np.cross(PLATE.point - lines.point[2], [0.0, 0.0, -1.0]) @ lines.direction[2]
    nose_up = np.cross(PLATE.point - lines.point[0], [0.0, 0.0, -1.0]) @ lines.direction[0]
    np.testing.assert_allclose(of_forces, np.sqrt(0.75) * nose_up, rtol=1e-14)


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"station_m": 1.5}, r"map.bending_moments.2.station_m: expected 0 to 1 m, got 1.5"),
        ({"name": "joint"}, r"bending_moments.2.name: expected another than before, got 'joint'"),
        ({"roll_angle_deg": 400.0}, "less than or equal to 360"),
    ],
)
def test_wrong_bending_moments_are_refused(changed: dict[str, Any], fault: str) -> None:
    one = {"name": "joint", "station_m": 0.5}
    with pytest.raises((ValueError, InputError), match=fault):
        other_load_operator(
            PLATE, MapEntry.model_validate({"bending_moments": [one, one | {"name": "other"} | changed]}), 0.1
        )


def test_region_without_surface_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"map.hinge_moments.1.region: expected a box .* got 'strip', which holds none"
    ):
        hinge_operator(PLATE, entry(FLAP, region={"from_m": [0.2, -1.0, 0.1], "to_m": [0.7, 1.0, 0.2]}))


@pytest.mark.parametrize(
    ("changed", "region", "fault"),
    [
        ({"region": "fin"}, STRIP, r"hinge_moments.1.region: expected one of \[map.regions\], strip, got 'fin'"),
        ({"direction": [0.0, 0.0, 0.0]}, STRIP, r"expected a vector that is not zero, got \[0.0, 0.0, 0.0\]"),
        ({"name": ""}, STRIP, "at least 1 character"),
        (
            {},
            {"from_m": [0.2, 0.0, 0.0], "to_m": [0.7, 0.0, 1.0]},
            "to_m: expected numbers above from_m",
        ),
    ],
)
def test_wrong_entries_are_refused(changed: dict[str, Any], region: dict[str, Any], fault: str) -> None:
    with pytest.raises(ValueError, match=fault):
        entry(FLAP | changed, region=region)


def test_names_are_unique() -> None:
    with pytest.raises(ValueError, match=r"hinge_moments.2.name: expected another than before, got 'flap'"):
        entry(FLAP, FLAP)
