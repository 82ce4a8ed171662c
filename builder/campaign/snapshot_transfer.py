"""Transfer of snapshots from an engine's own surface to the pressure nodes of the vehicle's structure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from builder.aero.mapping.mapping_report import MappingTolerances, check_mapping, mapping_report
from builder.aero.mapping.pressure_map import pressure_map
from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.errors import InputError


def snapshots_on(snapshots: Snapshots, grid: SurfaceGrid) -> Snapshots:
    """Return ``snapshots`` at the nodes of ``grid``; the same where they are there already.

    Forces and moments of p - p_inf are kept exactly
    (:meth:`builder.aero.mapping.pressure_map.PressureMap.conservative`).

    Raises
    ------
    InputError
        The two surfaces do not coincide; the message gives the distance and what was probably meant.
    """
    source, target = snapshots.surface, mesh_of_grid(grid)
    if snapshots.grid is not None and np.array_equal(source.point, target.point):
        return snapshots
    ambient = np.array([condition.ambient_pressure for condition in snapshots.conditions()])[:, None]
    net = snapshots.pressure - ambient
    try:
        transfer = pressure_map(source, target, grid)
        check_mapping(mapping_report(transfer, source, target, net), MappingTolerances())
    except InputError as error:
        raise InputError(f"snapshots of the {snapshots.engine} engine: {error}") from error
    return replace(
        snapshots,
        pressure=ambient + transfer.conservative(net),
        point=target.point,
        triangle=target.triangle,
        station=grid.x,
        radius=grid.radius,
        meridian_angle=grid.angle,
    )
