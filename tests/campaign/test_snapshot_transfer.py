"""Snapshots on another surface: loads kept, another body refused."""

from dataclasses import replace

import numpy as np
import pytest

from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots, snapshots_on
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid, chain_segments, surface_grid
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast

CONDITION = FlightCondition(6.0, 0.05, 0.02, 20e3)


@pytest.fixture(scope="module")
def body() -> BodyOfRevolution:
    return chain_segments([(1.0, 0.15, 0.15), (2.0, 0.02, 0.02)])


def snapshots_at_nodes(grid: SurfaceGrid) -> Snapshots:
    """One condition on a free surface; pressure varies along and round the body and jumps at the slope break."""
    mesh = mesh_of_grid(grid)
    x, y, z = mesh.point.T
    slope = np.repeat(grid.angle, grid.n_roll)
    pressure = CONDITION.ambient_pressure * (1.0 + 40.0 * slope**2 + 0.1 * x - 2.0 * z + y)
    return Snapshots(
        vehicle="body",
        engine="newtonian",
        settings={},
        condition=np.array([CONDITION.as_tuple()]),
        pressure=pressure[None],
        internal_pressure=np.array([CONDITION.ambient_pressure]),
        reference=np.array([0.1, 0.3, 1.0]),
        point=mesh.point,
        triangle=mesh.triangle,
        station=None,
        radius=None,
        meridian_angle=None,
        solved=np.array([True]),
        flow=np.array([0]),
        momentum_error=np.array([np.nan]),
        repairs=np.array([0]),
    )


def test_loads_are_kept(body: BodyOfRevolution) -> None:
    """From 60 x 48 nodes as a free surface to 40 x 36: five coefficients within 1e-10 of the largest.

    The pressures are those of the same field at the new nodes within 1 % of p_inf.
    """
    source, wanted = snapshots_at_nodes(surface_grid(body, 60, 48)), surface_grid(body, 40, 36)
    found = snapshots_on(source, wanted)
    assert found.grid is not None
    scale = np.abs(source.coefficients()).max()
    np.testing.assert_allclose(found.coefficients(), source.coefficients(), rtol=0.0, atol=1e-10 * scale)
    expected = snapshots_at_nodes(wanted).pressure
    np.testing.assert_allclose(found.pressure, expected, rtol=0.0, atol=0.01 * CONDITION.ambient_pressure)


def test_snapshots_that_are_there_already_are_left_alone(body: BodyOfRevolution) -> None:
    grid = surface_grid(body, 40, 36)
    there = replace(snapshots_at_nodes(grid), station=grid.x, radius=grid.radius, meridian_angle=grid.angle)
    assert snapshots_on(there, grid) is there


def test_another_body_is_refused(body: BodyOfRevolution) -> None:
    longer = surface_grid(chain_segments([(1.0, 0.15, 0.15), (2.4, 0.02, 0.02)]), 40, 36)
    with pytest.raises(InputError, match=r"snapshots of the newtonian engine: mapping: "):
        snapshots_on(snapshots_at_nodes(longer), surface_grid(body, 40, 36))
