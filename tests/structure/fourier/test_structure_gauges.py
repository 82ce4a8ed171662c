"""Placing gauges: station, roll angle, direction; and every refusal."""

import numpy as np
import pytest

from builder.structure.fourier.inner_surface import PlacedGauges, place_gauges
from builder.structure.fourier.meridian_mesh import MeridianMesh, tube_mesh
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

FIVE = np.deg2rad(5.0)


def on_cone(body: BodyOfRevolution, x: float, roll: float, outwards: float = 0.0) -> np.ndarray:
    """(1, 3) point on the inner surface of the 5 deg cone, moved outwards along the normal [m]."""
    radius = float(body.radius(x)) + (outwards - 0.004) / np.cos(FIVE)
    return np.array([[x, radius * np.sin(roll), radius * np.cos(roll)]])


def directions(roll: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors (3,) meridional, circumferential and normal on the 5 deg cone."""
    s, c = np.sin(FIVE), np.cos(FIVE)
    return (
        np.array([c, s * np.sin(roll), s * np.cos(roll)]),
        np.array([0.0, np.cos(roll), -np.sin(roll)]),
        np.array([-s, c * np.sin(roll), c * np.cos(roll)]),
    )


@pytest.mark.parametrize("roll", [0.0, 1.1, np.pi, -2.0])
def test_gauge_in_any_tangential_direction(mesh: MeridianMesh, body: BodyOfRevolution, roll: float) -> None:
    meridional, circumferential, _ = directions(roll)
    measured = 3.0 * (np.cos(0.4) * meridional - np.sin(0.4) * circumferential)
    placed = place_gauges(mesh, on_cone(body, 0.8, roll), measured[None])
    assert placed.x[0] == 0.8
    assert np.exp(1j * placed.roll_angle[0]) == pytest.approx(np.exp(1j * roll), rel=1e-12)
    assert placed.meridional[0] == pytest.approx(np.cos(0.4), rel=1e-10)
    assert placed.circumferential[0] == pytest.approx(-np.sin(0.4), rel=1e-10)


def place_one(mesh: MeridianMesh, position: np.ndarray, direction: np.ndarray) -> PlacedGauges:
    return place_gauges(mesh, position, np.atleast_2d(direction), ["row A 3"])


def test_gauge_slightly_off_the_surface_is_taken(mesh: MeridianMesh, body: BodyOfRevolution) -> None:
    assert place_one(mesh, on_cone(body, 0.8, 0.3, 0.45e-3), directions(0.3)[0]).x[0] == 0.8


@pytest.mark.parametrize(
    ("outwards", "message"),
    [(1.3e-3, "row A 3: position is 1.30 mm outside"), (-0.7e-3, "row A 3: position is 0.70 mm inside")],
)
def test_gauge_off_the_surface_is_refused(
    mesh: MeridianMesh, body: BodyOfRevolution, outwards: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        place_one(mesh, on_cone(body, 0.8, 0.3, outwards), directions(0.3)[0])


@pytest.mark.parametrize(
    ("x", "message"),
    [
        (0.09, "row A 3: x = 0.09 m is ahead of the hollow part"),
        (3.7, "aft of the base"),
        (np.nan, "x = nan"),
    ],
)
def test_gauge_outside_the_hollow_part_is_refused(mesh: MeridianMesh, x: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        place_one(mesh, np.array([[x, 0.0, 0.004]]), np.array([1.0, 0.0, 0.0]))


@pytest.mark.parametrize("length", [0.0, np.nan])
def test_direction_without_length_is_refused(mesh: MeridianMesh, body: BodyOfRevolution, length: float) -> None:
    with pytest.raises(InputError, match="row A 3: direction has no length"):
        place_one(mesh, on_cone(body, 0.8, 0.3), length * np.ones(3))


def test_direction_out_of_the_surface_is_refused(mesh: MeridianMesh, body: BodyOfRevolution) -> None:
    meridional, _, normal = directions(0.3)

    def lean(degrees: float) -> np.ndarray:
        return np.cos(np.deg2rad(degrees)) * meridional + np.sin(np.deg2rad(degrees)) * normal

    assert place_one(mesh, on_cone(body, 0.8, 0.3), lean(4.9)).meridional[0] == pytest.approx(1.0, rel=1e-12)
    with pytest.raises(InputError, match=r"row A 3: direction leans 5\.2 deg out of the inner surface"):
        place_one(mesh, on_cone(body, 0.8, 0.3), lean(-5.2))


def test_message_counts_gauges_from_one(mesh: MeridianMesh, body: BodyOfRevolution) -> None:
    position = np.concatenate([on_cone(body, 0.8, 0.3), on_cone(body, 0.9, 0.3, 2e-3)])
    with pytest.raises(InputError, match="gauge 2: position is"):
        place_gauges(mesh, position, np.tile(directions(0.3)[0], (2, 1)))


def test_shapes_must_agree(mesh: MeridianMesh) -> None:
    with pytest.raises(InputError, match="must be"):
        place_gauges(mesh, np.zeros((2, 3)), np.zeros((1, 3)))


def test_solid_body_has_no_inner_surface() -> None:
    bar = tube_mesh(np.array([0.0, 1.0]), np.zeros(2), np.full(2, 0.1), 0.1)
    with pytest.raises(InputError, match="no inner surface"):
        place_gauges(bar, np.array([[0.5, 0.0, 0.1]]), np.array([[1.0, 0.0, 0.0]]))


@pytest.mark.parametrize(
    ("x", "inner", "outer", "message"),
    [
        ([0.0, 0.0], [0.1, 0.1], [0.2, 0.2], "stations must increase"),
        ([0.0, 1.0], [0.1, 0.2], [0.2, 0.2], "inner radius < outer radius"),
    ],
)
def test_impossible_tube_is_refused(x: list[float], inner: list[float], outer: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        tube_mesh(np.array(x), np.array(inner), np.array(outer), 0.1)
