"""Snapshots of one side of a symmetric body, with their mirror images."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from builder.aero.mapping.pressure_map import mirror_operator
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots
from strainfmu.arrays import FloatArray

SIDESLIP = 2
"""Column of the sideslip angle in the conditions of snapshots."""


def with_mirror_images(snapshots: Snapshots, mesh: SurfaceMesh) -> Snapshots:
    """Return ``snapshots``; snapshots of one sideslip sign alone with their mirror images in the plane y = 0.

    They stay as they are where the surface is not symmetric, and with flow parameters: a deflection may have a
    mirror image of its own.
    """
    sideslip = snapshots.condition[:, SIDESLIP]
    one_sided = float(sideslip.min()) * float(sideslip.max()) >= 0.0 and bool(np.any(sideslip != 0.0))
    if not one_sided or snapshots.parameter_names:
        return snapshots
    mirror = mirror_operator(mesh, axis=1)
    if mirror is None:
        return snapshots
    rows = np.flatnonzero(sideslip != 0.0)
    condition = snapshots.condition[rows].copy()
    condition[:, SIDESLIP] *= -1.0
    pressure: FloatArray = np.asarray((mirror @ snapshots.pressure[rows].T).T)
    changed = {"condition": condition, "pressure": pressure, "solved": np.zeros(len(rows), dtype=bool)}
    names = ("condition", "pressure", "internal_pressure", "solved", "flow", "momentum_error", "repairs")
    both: dict[str, Any] = {
        name: np.concatenate([getattr(snapshots, name), changed.get(name, getattr(snapshots, name)[rows])])
        for name in (*names, *(() if snapshots.mass_error is None else ("mass_error",)))
    }
    return replace(snapshots, **both)
