"""Equilibrium of an influence matrix, seen from outside: a lateral force bends a clamped body by its lever.

The axial strain of a gauge under a lateral force is in proportion to the force's distance ahead of it, and zero
under forces behind it, whatever the structure between. Nodes in another order, swapped axes, a wrong length show.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from builder.structure.solid.gauge_rows import Gauges
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

STATIONS = 24
"""Bins of equal numbers of nodes along the body, over which forces are spread."""
FEWEST = 4
"""Bins ahead of a gauge from which it is judged."""
NEAR = 0.03
"""Of the body's length: forces nearer than this to a gauge bend the wall under it."""
LEAST_R2, LARGEST_SHIFT = 0.9, 0.05
"""Of the straight line; and of its zero from the gauge, over the body's length."""
AXIAL = 0.9
"""Direction cosine to the axis from which a gauge counts as axial."""


def check_equilibrium(path: Path, node: FloatArray, strain_per_force: FloatArray, gauges: Gauges) -> None:
    """Refuse strains (k, n, 3) [1/N] per force at nodes (n, 3) [m] that no clamped body can have.

    Raises
    ------
    InputError
        The axial gauges' strain is no straight line with its zero at the gauge, or of the wrong sign.
    """
    found = lateral_lines(node, strain_per_force, gauges)
    if not len(found):
        return
    r2, shift, slope = np.median(found, axis=0)
    words = (
        f"axial strain linear in the station of a lateral force, zero at the gauge (middle of {len(found)} gauges)"
    )
    if r2 < LEAST_R2:
        raise InputError(
            f"{path}: equilibrium: expected {words}, got R2 {r2:.2g}: nodes and strains in one order? "
            "x aft, y starboard, z up?"
        )
    if abs(shift) > LARGEST_SHIFT:
        raise InputError(
            f"{path}: equilibrium: expected {words}, got the zero {100.0 * abs(shift):.2g} % of the length "
            f"{'aft' if shift > 0.0 else 'ahead'} of it: another length, unit or gauge?"
        )
    if slope > 0.0:
        raise InputError(
            f"{path}: equilibrium: expected compression on the side a force ahead pushes to, got tension"
        )


def lateral_lines(node: FloatArray, strain_per_force: FloatArray, gauges: Gauges) -> FloatArray:
    """Return (m, 3) of the axial gauges that can be judged: R2, shift of the zero over the length, sign.

    The sign is taken of strain on the side that a force ahead pushes to: compression, below 0, in a clamped
    body.
    """
    x, length = node[:, 0], float(np.ptp(node[:, 0]))
    order = np.argsort(x, kind="stable")
    bins = [part for part in np.array_split(order, STATIONS) if len(part)]
    station = np.array([x[part].mean() for part in bins])
    unit = gauges.direction / np.linalg.norm(gauges.direction, axis=1, keepdims=True)
    found = []
    for gauge in np.flatnonzero(np.abs(unit[:, 0]) > AXIAL):
        at = gauges.position[gauge]
        off_axis = float(np.hypot(at[1], at[2]))
        ahead = station < at[0] - NEAR * length
        if ahead.sum() < FEWEST or off_axis == 0.0:
            continue
        across = strain_per_force[gauge, :, 1:] @ (at[1:] / off_axis)
        mean = np.array([across[part].mean() for part in bins])[ahead]
        slope, start = np.polyfit(station[ahead], mean, 1)
        rest = mean - (slope * station[ahead] + start)
        r2 = 1.0 - float(rest @ rest) / max(float(np.sum((mean - mean.mean()) ** 2)), 1e-300)
        zero = -start / slope if slope else np.inf
        # A force ahead pushes its side into compression, the less the nearer it is: strain rises with the station.
        found.append([r2, (zero - at[0]) / length, -np.sign(slope)])
    return np.array(found).reshape(-1, 3)
