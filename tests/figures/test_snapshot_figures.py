"""Figures of a campaign show what the snapshots hold: lines and centres against a cone's conical flow."""

from math import cos, pi, radians
from pathlib import Path

import numpy as np
import pytest
from sweeps import crossed

from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.figures import snapshot_figures
from builder.figures.drawing import save
from builder.vehicle.flight_conditions import condition_grid
from builder.vehicle.shape.geometry import chain_segments, surface_grid

HALF_ANGLE = radians(10.0)
LENGTH = 2.0


def cone_snapshots(free_surface: bool) -> Snapshots:
    """Pressure on a cone, linear in incidence, alike along x: Cp = 0.07 - 0.65 a_T cos(roll from leeward)."""
    grid = surface_grid(chain_segments([(LENGTH, HALF_ANGLE, HALF_ANGLE)]), 80, 96)
    mesh = mesh_of_grid(grid)
    conditions = condition_grid([5.0, 6.0], [0.0, 2.0, 4.0], [0.0, 3.0], 20e3)
    pressure = np.array(
        [
            np.tile(
                c.ambient_pressure
                + c.dynamic_pressure
                * (0.07 - 0.65 * c.total_incidence * np.cos(grid.roll_angle - c.leeward_roll_angle)),
                len(grid.x),
            )
            for c in conditions
        ]
    )
    count, radius = len(conditions), float(grid.radius[-1])
    return Snapshots(
        vehicle="cone",
        engine="closed form",
        settings={},
        condition=np.array([c.as_tuple() for c in conditions]),
        pressure=pressure,
        internal_pressure=np.array([c.ambient_pressure for c in conditions]),
        reference=np.array([pi * radius**2, 2.0 * radius, 0.9]),
        point=mesh.point,
        triangle=mesh.triangle,
        station=None if free_surface else grid.x,
        radius=None if free_surface else grid.radius,
        meridian_angle=None if free_surface else grid.angle,
        solved=np.ones(count, dtype=bool),
        flow=np.arange(count),
        momentum_error=np.full(count, np.nan),
        repairs=np.zeros(count, dtype=np.int64),
    )


@pytest.mark.fast
@pytest.mark.parametrize(("free_surface", "tolerance"), [(False, 5e-4), (True, 4e-3)])
def test_centre_of_pressure_of_a_cone(free_surface: bool, tolerance: float) -> None:
    """(2/3) L sec^2(theta), the moment of the axial pressures included, at any incidence (conical flow)."""
    snapshots = cone_snapshots(free_surface)
    normal, axial, centre = snapshot_figures.in_plane_forces(snapshots)
    still = snapshots.total_incidence == 0.0
    assert np.isnan(centre[still]).all()
    np.testing.assert_allclose(centre[~still], 2.0 / 3.0 * LENGTH / cos(HALF_ANGLE) ** 2, rtol=tolerance)
    np.testing.assert_allclose(axial, 0.07, rtol=tolerance)
    # Integral of Cp cos(roll) over the lateral surface, over the base area: half the amplitude over tan(theta).
    expected = 0.5 * 0.65 * snapshots.total_incidence / np.tan(HALF_ANGLE)
    np.testing.assert_allclose(normal, expected, rtol=tolerance, atol=1e-12)
    station, running = snapshot_figures.running_load(snapshots, len(snapshots.condition) - 1)
    width = LENGTH / len(station)
    assert running.sum() * width == pytest.approx(normal[-1], rel=1e-9)
    np.testing.assert_allclose(running, 2.0 * station / LENGTH**2 * normal[-1], atol=0.05 * running.max())


@pytest.mark.fast
@pytest.mark.parametrize("free_surface", [False, True])
def test_centre_lines_are_windward_and_leeward(free_surface: bool) -> None:
    """Within 1 % of the amplitude: interpolation between roll angles, and the width of the strip of nodes."""
    snapshots = cone_snapshots(free_surface)
    index = 5
    incidence = snapshots.total_incidence[index]
    for side, sign in ((0.0, -1.0), (pi, 1.0)):
        for x, cp in snapshot_figures.centre_line(snapshots, index, side):
            assert np.all(np.diff(x) > 0.0)
            np.testing.assert_allclose(cp, 0.07 + sign * 0.65 * incidence, rtol=0.0, atol=0.0065 * incidence)


@pytest.mark.parametrize(
    ("name", "free_surface"), crossed(["surface_maps", "centre_lines", "force_curves"], [False, True])
)
def test_every_figure_is_drawn(name: str, free_surface: bool, tmp_path: Path) -> None:
    figure = getattr(snapshot_figures, name)(cone_snapshots(free_surface))
    save(figure, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    labelled = [axis for axis in figure.axes if axis.get_ylabel()]
    assert len(labelled) >= 2
    assert any("[" in axis.get_xlabel() for axis in figure.axes)
