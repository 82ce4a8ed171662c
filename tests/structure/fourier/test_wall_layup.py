"""Walls of several thicknesses and materials, ring frames, masses in free flight: against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from builder.structure.fourier.fourier_elasticity import rigid_motions, roll_integral
from builder.structure.fourier.free_flight import inertia_matrix
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import _wall_surfaces, shell_mesh
from builder.structure.fourier.strain_operator import HarmonicResponse, harmonic_response
from builder.structure.wall import FlightMasses, Material, RingFrame, Wall, WallRegion
from builder.vehicle.shape.geometry import chain_segments
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

ALUMINIUM, STEEL = Material(70e9, 0.33), Material(200e9, 0.29)
RADIUS, LENGTH = 0.1, 1.6
NOSE = 0.4
BODY = chain_segments([(NOSE, np.arctan(RADIUS / NOSE), np.arctan(RADIUS / NOSE)), (LENGTH, 0.0, 0.0)])
WALL = Wall(0.003, 0.1, ALUMINIUM)
STEP = 1e-4
X = np.linspace(0.0, LENGTH, 161)
LENGTH_OF_ELEMENTS = 0.012


def response(
    wall: Wall, stations: FloatArray, harmonics: int = 1, size: float = LENGTH_OF_ELEMENTS
) -> HarmonicResponse:
    return harmonic_response(shell_mesh(BODY, wall, size, 1), wall.material, stations, X, harmonics)


def total_mass(mesh: MeridianMesh) -> float:
    """Return the mass of a body [kg], by its acceleration along its axis."""
    axial = rigid_motions(mesh, 0)
    return float((axial.T @ (inertia_matrix(mesh, 0) @ axial))[0, 0]) * roll_integral(0)


def uniform(wall: Wall, stations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return axial and hoop strain [1/Pa] of the inner surface under uniform outer pressure."""
    found = response(wall, stations, 0)
    return found.meridional[:, 0].sum(axis=1), found.hoop[:, 0].sum(axis=1)


def tube_strain(thickness: float, material: Material, axial_force: float = -np.pi * RADIUS**2) -> FloatArray:
    """Return axial and hoop strain [1/Pa] inside a long tube under unit outer pressure (Lame) and axial force."""
    inner = RADIUS - thickness
    hoop = -2.0 * RADIUS**2 / (RADIUS**2 - inner**2)
    axial = axial_force / (np.pi * (RADIUS**2 - inner**2))
    nu, young = material.poisson_ratio, material.youngs_modulus
    return np.array([axial - nu * hoop, hoop - nu * axial]) / young


@pytest.mark.parametrize("angles", [(12.0, 2.0), (2.0, 12.0)])
def test_the_inner_surface_is_a_wall_thickness_from_the_outer_one(angles: tuple[float, float]) -> None:
    """Two cones: inside a corner the surfaces go on along their tangents until they meet."""
    body = chain_segments([(end, *np.radians([one, one])) for end, one in zip((1.0, 2.0), angles, strict=True)])
    wall = Wall(0.02, 0.3, STEEL)
    _, inner = _wall_surfaces(body, wall, 0.3, 0.05)
    corner = np.array([1.0, float(body.radius(np.array([1.0]))[0])])
    slope = np.radians(angles)
    distance = np.stack([(inner - corner) @ [-np.sin(one), np.cos(one)] for one in slope])
    at = np.argmin(np.abs(distance + 0.02).sum(axis=0))  # on both
    np.testing.assert_allclose(distance[:, at], -0.02, atol=1e-12)
    np.testing.assert_allclose(distance[0, : at + 1], -0.02, atol=1e-12)
    np.testing.assert_allclose(distance[1, at:], -0.02, atol=1e-12)


def test_a_stepped_tube_of_two_metals_has_the_strain_of_each_of_its_parts() -> None:
    """Within 0.2 %, more than six decay lengths from every step."""
    wall = replace(
        WALL,
        profile=((0.7, 1.0), (0.7 + STEP, 2.0)),
        regions=(WallRegion(start=1.0, end=LENGTH, material=STEEL),),
    )
    found = np.array(uniform(wall, np.array([0.55, 0.85, 1.3])))
    parts = ((0.003, ALUMINIUM), (0.006, ALUMINIUM), (0.006, STEEL))
    np.testing.assert_allclose(found, np.array([tube_strain(*part) for part in parts]).T, rtol=2e-3)


def test_thickness_between_stations_is_linear() -> None:
    """A wall given by two equal thicknesses, or by a wall of that thickness, is the same wall."""
    twice = replace(WALL, profile=((0.3, 2.0), (1.5, 2.0)))
    plain = replace(WALL, thickness=0.006)
    stations = np.array([0.55, 0.9])
    np.testing.assert_allclose(uniform(twice, stations), uniform(plain, stations), rtol=2e-4)


def test_a_frame_is_a_thick_piece_of_wall() -> None:
    """Drawn as a ring, and as a step of the thickness on finer elements: strain beside it within 6 %."""
    width, depth = 0.02, 0.006
    frame = replace(WALL, frames=(RingFrame(station=0.9, width=width, depth=depth),))
    share = 1.0 + depth / WALL.thickness
    front, aft = 0.9 - 0.5 * width, 0.9 + 0.5 * width
    step = replace(WALL, profile=((front - STEP, 1.0), (front, share), (aft, share), (aft + STEP, 1.0)))
    stations = np.array([0.87, 0.94])
    mesh = shell_mesh(BODY, step, 0.006, 3)
    thick = harmonic_response(mesh, ALUMINIUM, stations, X, 2)
    ring, bare = (response(one, stations, 2, 0.006) for one in (frame, WALL))
    for name in ("meridional", "hoop"):
        found, expected, without = (getattr(one, name).sum(axis=2) for one in (ring, thick, bare))
        scale = np.abs(expected).max(axis=0)
        assert (np.abs(found - expected) < 0.06 * scale).all(), name
        assert (np.abs(without - expected).max(axis=0) > 0.2 * scale).any(), name


def test_a_bulkhead_stops_ovalisation() -> None:
    """Beside a closed bulkhead the hoop strain of harmonic 2 is a twentieth of that of the bare wall."""
    bulkhead = replace(WALL, frames=(RingFrame(station=0.9, width=0.01, depth=None),))
    stations = np.array([0.91])
    closed, bare = (np.abs(response(one, stations, 2).hoop[:, 2].sum()) for one in (bulkhead, WALL))
    assert closed < 0.05 * bare


def flying(density: float = 2700.0, **masses: object) -> Wall:
    return replace(WALL, flight=FlightMasses(density=density, **masses))  # type: ignore[arg-type]  # fields by name


def test_axial_strain_in_free_flight_is_that_of_the_mass_behind() -> None:
    """N(x) = -F m_behind / m, with a point mass and a cover; within 0.2 % of the strain of the nose's force."""
    wall = flying(points=((1.2, 5.0),), covers=((1.4, 1.5, 30.0),))
    stations = np.array([0.7, 1.0, 1.35])
    mesh = shell_mesh(BODY, wall, LENGTH_OF_ELEMENTS, 1)
    section = np.pi * (RADIUS**2 - (RADIUS - WALL.thickness) ** 2)
    cover = 30.0 * 2.0 * np.pi * RADIUS * 0.1
    behind = 2700.0 * section * (LENGTH - stations) + cover + np.where(stations < 1.2, 5.0, 0.0)
    force = -np.pi * RADIUS**2 * behind / total_mass(mesh)
    expected = np.array([tube_strain(WALL.thickness, ALUMINIUM, one) for one in force]).T
    error = np.abs(np.array(uniform(wall, stations)) - expected)
    assert (error < 2e-3 * np.abs(expected).max(axis=1)[:, None]).all()


def test_mass_is_that_of_the_drawing() -> None:
    """Cone, cavity and cylinder: within 0.1 %; of two metals each part its own."""
    plain = total_mass(shell_mesh(BODY, flying(), LENGTH_OF_ELEMENTS, 1))
    heavy = replace(flying(), regions=(WallRegion(start=1.0, end=LENGTH, material=STEEL, density=7800.0),))
    section = np.pi * (RADIUS**2 - (RADIUS - WALL.thickness) ** 2)
    more = total_mass(shell_mesh(BODY, heavy, LENGTH_OF_ELEMENTS, 1)) - plain
    assert more == pytest.approx((7800.0 - 2700.0) * section * (LENGTH - 1.0), rel=1e-4)


def test_heavy_masses_behind_hold_as_a_clamp_does() -> None:
    """Harmonic 1, far ahead of them: axial strain within 1 % of that of a clamped wall."""
    heavy = flying(points=((1.3, 1e7), (1.6, 1e7)))
    stations = np.array([0.7, 0.9])
    free, clamped = (response(one, stations).meridional[:, 1].sum(axis=1) for one in (heavy, WALL))
    np.testing.assert_allclose(free, clamped, rtol=0.01)


def test_a_stiff_foundation_is_a_clamp_and_a_soft_one_carries_the_same_force() -> None:
    stations = np.array([0.7, 1.0])
    clamped = response(WALL, stations).meridional.sum(axis=2)
    for stiffness, tolerance in ((1e16, 1e-5), (1e11, 5e-3)):
        held = replace(WALL, foundation=(stiffness, stiffness))
        np.testing.assert_allclose(response(held, stations).meridional.sum(axis=2), clamped, rtol=tolerance)


FAULTS = {
    "two overlap": (
        (RingFrame(station=0.9, width=0.02, depth=0.01), RingFrame(station=0.915, width=0.02, depth=0.01)),
        "expected its front behind",
    ),
    "in the tip": ((RingFrame(station=0.05, width=0.02, depth=0.001),), "expected it on the hollow part"),
    "beyond the axis": ((RingFrame(station=0.9, width=0.02, depth=0.2),), "expected a depth below 97 mm"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_frame_is_refused(fault: str) -> None:
    frames, message = FAULTS[fault]
    with pytest.raises(InputError, match=message):
        shell_mesh(BODY, replace(WALL, frames=frames), LENGTH_OF_ELEMENTS, 1)


def test_a_mass_off_the_body_is_refused() -> None:
    with pytest.raises(InputError, match="point mass at 2 m: expected a station of the body"):
        total_mass(shell_mesh(BODY, flying(points=((2.0, 1.0),)), LENGTH_OF_ELEMENTS, 1))
