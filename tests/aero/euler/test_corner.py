"""The fan of a corner: its flow, the grids it is carried through, and what they conserve."""

from math import asin, radians, tan

import numpy as np
import pytest

from builder.aero.euler.bodies import corner
from builder.aero.euler.bodies.corner import WallStream
from builder.aero.euler.bodies.solver import free_stream_of
from builder.aero.euler.bodies.surface_function import body_walls
from builder.aero.euler.planes import MarchingGrid, Plane, free_stream
from builder.aero.euler.scheme.gas import GAMMA, prandtl_meyer_angle
from builder.aero.euler.scheme.grid import Wall, half_body_rays
from builder.aero.euler.scheme.march import decode
from builder.aero.euler.scheme.reconstruction import Stream
from builder.vehicle.shape.geometry import chain_segments

pytestmark = pytest.mark.fast

RAYS = half_body_rays(12)


def walls(before: float, after: float) -> tuple[Wall, Wall]:
    """Return the walls of a cone of 1 m and of the frustum behind it, of half-angles [deg]."""
    body = chain_segments([(1.0, radians(before), radians(before)), (1.5, radians(after), radians(after))])
    first, second = body_walls(body, RAYS)
    return first[-1], second[0]


def stream_along(angle: float, mach_number: float, around: float = 0.0) -> WallStream:
    """Return a stream of Mach number M in the plane through the axis, p = 1/gamma and rho = 1."""
    n = RAYS.cell_sine.size
    return WallStream(
        pressure=np.full(n, 1.0 / GAMMA),
        density=np.ones(n),
        speed=np.full(n, mach_number),
        around=np.full(n, around),
        angle=radians(angle),
    )


@pytest.mark.parametrize("level", [0, 1, 5])
def test_cells_are_thinner_at_the_wall_and_grow_alike(level: int) -> None:
    grid = MarchingGrid(n_radial=36)
    fine = corner.refined_at_wall(grid, level)
    own, thin = (np.diff(one.spacing(one.n_radial)) for one in (grid, fine))
    assert own[0] / thin[0] == pytest.approx(2.0**level, rel=0.02)
    np.testing.assert_allclose(thin[1:] / thin[:-1], own[1] / own[0], rtol=1e-3)


@pytest.mark.parametrize(("cell", "levels"), [(1e-5, 5), (4e-4, 5), (2e-3, 8), (1.0, 10)])
def test_thick_cells_are_halved_more_often(cell: float, levels: int) -> None:
    """16 of them reach up to 0.2 % of the radius at last, within limits: 16 * 2e-3/2^8 of 0.1 is 0.13 %."""
    assert corner.levels_for(cell, 0.1) == levels


def test_only_walls_that_turn_away_alike_on_all_rays_have_a_fan() -> None:
    before, after = walls(10.0, -2.0)
    assert corner.turn_of(before, after) == pytest.approx(radians(12.0), rel=1e-12)
    assert corner.turn_of(*walls(3.0, 8.0)) == pytest.approx(-radians(5.0), rel=1e-12)
    uneven = before._replace(slope=before.slope * np.linspace(1.0, 1.1, before.slope.shape[1]))
    assert corner.turn_of(uneven, after) == 0.0


def test_fan_is_that_of_prandtl_and_meyer() -> None:
    """nu(M) + theta is the same on every ray, each a Mach line; isentropic, and of one total enthalpy."""
    stream = stream_along(10.0, 5.0)
    angle, (p, rho, u, outward) = corner.fan_rays(stream, 0, radians(12.0))
    direction, speed = np.arctan2(outward, u), np.hypot(u, outward)
    mach = speed / np.sqrt(GAMMA * p / rho)
    assert np.all(np.diff(angle) > 0.0)
    assert angle[-1] == pytest.approx(radians(10.0) + asin(0.2), rel=1e-12)
    assert direction[0] == pytest.approx(radians(-2.0), rel=1e-12)
    np.testing.assert_allclose(angle, direction + np.arcsin(1.0 / mach), rtol=1e-12)
    invariant = [prandtl_meyer_angle(m) + d for m, d in zip(mach, direction, strict=True)]
    np.testing.assert_allclose(invariant, prandtl_meyer_angle(5.0) + radians(10.0), rtol=1e-9)
    np.testing.assert_allclose(p / rho**GAMMA, 1.0 / GAMMA, rtol=1e-9)
    np.testing.assert_allclose(3.5 * p / rho + 0.5 * speed**2, 2.5 + 12.5, rtol=1e-12)
    assert corner.pressure_ratio_behind(stream, radians(12.0))[0] == pytest.approx(GAMMA * p[0], rel=1e-12)


def test_another_grid_holds_as_much() -> None:
    """Totals to round-off; a flow that is linear in the cells' areas is kept but for the outermost cells."""
    random = np.random.default_rng(5)
    grid = MarchingGrid(n_radial=20, n_circumferential=12)
    fine, radius = corner.refined_at_wall(grid, 3), np.full(13, 0.2)
    conserved = free_stream(free_stream_of(6.0, 0.05), 12, 20) * (1.0 + 0.1 * random.random((4, 12, 20)))
    plane = Plane(x=1.0, rays=RAYS, conserved=conserved.copy(), outer=0.5 + 0.1 * random.random(13))
    edges = [corner.cell_edges(radius, plane.outer, one.spacing(one.n_radial)) for one in (grid, fine)]
    corner.regrid(plane, radius, grid, fine)
    assert plane.conserved.shape == (4, 12, fine.n_radial)
    before, after = (
        (held * np.diff(edge)).sum(axis=2) for held, edge in zip((conserved, plane.conserved), edges, strict=True)
    )
    np.testing.assert_allclose(after, before, rtol=1e-13)
    linear = [0.5 * (edge[:, 1:] + edge[:, :-1])[None] for edge in edges]
    found = corner.means_between(linear[0], *edges)
    inside = edges[1][:, 1:] < edges[0][:, -2:-1]
    np.testing.assert_allclose(found[0][inside], linear[1][0][inside], rtol=1e-12)


@pytest.mark.parametrize("around", [0.0, 0.3])
def test_fan_let_into_a_stream(around: float) -> None:
    """Mass is kept; at the wall the flow is along it, at the pressure behind; beyond the fan it is as before."""
    before, after = walls(5.0, 0.0)
    grid = corner.refined_at_wall(MarchingGrid(n_radial=24, n_circumferential=12), 5)
    stream, x = stream_along(5.0, 5.0, around), 1.0004
    along = np.array([np.cos(stream.angle), np.sin(stream.angle)]) * 5.0
    v = along[1] * RAYS.cell_sine + around * RAYS.cell_cosine
    w = along[1] * RAYS.cell_cosine - around * RAYS.cell_sine
    one = np.ones(12)
    state = np.stack([along[0] * one, (along[0] ** 2 + 1.0 / GAMMA) * one, along[0] * v, along[0] * w])
    conserved = np.repeat(state[:, :, None], grid.n_radial, axis=2)
    plane = Plane(x=x, rays=RAYS, conserved=conserved.copy(), outer=np.full(13, 0.15))
    pressure = corner.let_fan_in(plane, before, after, stream, grid)
    np.testing.assert_allclose(GAMMA * pressure, corner.pressure_ratio_behind(stream, radians(5.0)), rtol=1e-12)
    spacing = grid.spacing(grid.n_radial)
    straight = before.radius[-1] + tan(stream.angle) * (x - 1.0)
    held = [
        (mass * np.diff(corner.cell_edges(radius, plane.outer, spacing))).sum(axis=1)
        for mass, radius in ((conserved[0], straight), (plane.conserved[0], after.radius[0]))
    ]
    np.testing.assert_allclose(held[1], held[0], rtol=1e-12)
    np.testing.assert_allclose(plane.conserved[:, :, -8:], conserved[:, :, -8:], rtol=1e-12)
    cell, wave = np.empty((5, *conserved.shape[1:])), np.empty((4, 14, grid.n_radial))
    enthalpy = 2.5 + 0.5 * (25.0 + around**2)
    assert decode(plane.conserved, RAYS, Stream(5.0, 0.0, 0.0, enthalpy), cell, wave)
    p, _, u, v, w = cell[:, :, 0]
    np.testing.assert_allclose(p, pressure, rtol=3e-3)
    np.testing.assert_allclose((v * RAYS.cell_sine + w * RAYS.cell_cosine) / u, 0.0, atol=1e-6)
    np.testing.assert_allclose(v * RAYS.cell_cosine - w * RAYS.cell_sine, around, rtol=1e-9)
