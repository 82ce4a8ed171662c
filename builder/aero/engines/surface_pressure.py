"""Pressure at the vehicle's surface nodes from the flow solver's wall pressure.

On a body of revolution the flow depends on Mach number and total incidence alone; angle of attack and
sideslip only roll it. So one solution at the stations of the surface grid gives every condition
of the same (M, a_T), by rotation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray


def pressure_at_stations(pieces: Sequence[tuple[FloatArray, FloatArray]], grid: SurfaceGrid) -> FloatArray:
    """Interpolate a flow's wall pressure linearly in x to the stations of ``grid``.

    Parameters
    ----------
    pieces : per smooth piece of the meridian, stations (n,) [m] and p/p_inf (n, n_phi).

    Returns
    -------
    (n_x, n_phi) p/p_inf. Never interpolated across a slope break; towards the ends of a smooth piece, where no
    marching step has its middle, the nearest value holds.
    """
    joints = np.flatnonzero(np.diff(grid.x) == 0.0) + 1
    parts = np.split(np.arange(len(grid.x)), joints)
    if len(parts) != len(pieces):
        raise ValueError(f"{len(pieces)} smooth pieces solved, surface grid has {len(parts)}")
    ratio = np.empty((len(grid.x), pieces[0][1].shape[1]))
    for part, (x, pressure) in zip(parts, pieces, strict=True):
        for j in range(pressure.shape[1]):
            ratio[part, j] = np.interp(grid.x[part], x, pressure[:, j])
    return ratio


def pressure_ratio_on_surface(
    ratio: FloatArray, roll_angle: FloatArray, grid: SurfaceGrid, leeward_roll_angle: float
) -> FloatArray:
    """Roll a half-body pressure so that its leeward meridian lies at ``leeward_roll_angle`` [rad].

    Parameters
    ----------
    ratio : (n_x, n_phi) p/p_inf at ``roll_angle`` (n_phi,) from the leeward meridian, 0..pi.

    Returns
    -------
    (n_nodes,) p/p_inf at the nodes of ``grid``; modified Akima interpolation round the body, which
    swings little next to the leeward shock (within 0.5 % of the range round the body).
    """
    away = np.mod(grid.roll_angle - leeward_roll_angle, 2.0 * np.pi)
    away = np.minimum(away, 2.0 * np.pi - away)
    angles = np.concatenate([-roll_angle[::-1], roll_angle, 2.0 * np.pi - roll_angle[::-1]])
    mirrored = np.concatenate([ratio[:, ::-1], ratio, ratio[:, ::-1]], axis=1)
    return Akima1DInterpolator(angles, mirrored, axis=1, method="makima")(away).ravel()
