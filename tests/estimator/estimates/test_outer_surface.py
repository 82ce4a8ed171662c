"""Places on any surface by station and roll angle: those that are seen from outside."""

import numpy as np
import pytest

from strainfmu.estimator.outer_surface import outermost_places

pytestmark = pytest.mark.fast

STATION, ROLL = np.linspace(0.13, 0.97, 7), np.radians(np.arange(0.0, 360.0, 15.0))


def tube(width: float, height: float, count: int = 90) -> tuple[np.ndarray, np.ndarray]:
    """An elliptic cone of half axes ``width`` along y and ``height`` along z at x = 1, as points and triangles."""
    x, angle = np.meshgrid(np.linspace(0.1, 1.0, 12), 2.0 * np.pi * np.arange(count) / count, indexing="ij")
    point = np.column_stack([x.ravel(), (x * width * np.sin(angle)).ravel(), (x * height * np.cos(angle)).ravel()])
    row, column = np.meshgrid(np.arange(11), np.arange(count), indexing="ij")
    a, b = row * count + column, row * count + (column + 1) % count
    triangles = np.concatenate([np.stack([a, b, a + count], -1), np.stack([b, b + count, a + count], -1)])
    return point, triangles.reshape(-1, 3)


def test_rays_meet_the_outer_surface_at_station_and_angle() -> None:
    outer, inner = tube(0.4, 0.2), tube(0.3, 0.1)
    point = np.concatenate([inner[0], outer[0]])
    triangle = np.concatenate([inner[1], outer[1] + len(inner[0])])
    seen = outermost_places(point, triangle, STATION, ROLL)
    x, y, z = (seen.of(column) for column in point.T)
    np.testing.assert_allclose(x, np.broadcast_to(STATION[:, None], x.shape), atol=1e-12)
    np.testing.assert_allclose(y * np.cos(ROLL) - z * np.sin(ROLL), 0.0, atol=1e-12)
    radius = STATION[:, None] / np.hypot(np.sin(ROLL) / 0.4, np.cos(ROLL) / 0.2)
    np.testing.assert_allclose(y * np.sin(ROLL) + z * np.cos(ROLL), radius, rtol=5e-3)


def test_a_ray_that_meets_nothing_takes_the_place_beside_it() -> None:
    point, triangle = tube(0.2, 0.2)
    point[:, 1] += 0.5  # the axis is outside
    seen = outermost_places(point, triangle, STATION, ROLL)
    np.testing.assert_allclose(seen.weight.sum(axis=-1), 1.0)
    assert seen.weight.min() >= 0.0
    x, y, z = (seen.of(column) for column in point.T)
    np.testing.assert_allclose(x, np.broadcast_to(STATION[:, None], x.shape), atol=1e-12)
    limit = np.arcsin(0.2 * STATION / 0.5)[:, None]  # half the angle that the body takes up
    off = np.abs(np.angle(np.exp(1j * (np.arctan2(y, z) - ROLL))))
    needed = np.maximum(np.abs(np.angle(np.exp(1j * (ROLL - np.pi / 2.0)))) - limit, 0.0)
    np.testing.assert_allclose(off, needed, atol=0.03)
