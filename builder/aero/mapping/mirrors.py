"""Mirror images of pressure on surfaces that have no grid."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from builder.aero.mapping.pressure_map import interpolation_at
from builder.aero.surface.closest_points import closest_points
from builder.aero.surface.mesh import SurfaceMesh

MAX_GAP = 2e-3
"""Gap between a surface and its mirror image, over the body's length, above which it has no such symmetry."""


def mirror_operator(surface: SurfaceMesh, axis: int) -> sparse.csr_array | None:
    """Return sparse (n_p, n_p) M: (M p)(x) = p at the mirror image of x in the plane through the origin across
    ``axis``; None where the surface is not symmetric. The value is taken at the closest point."""
    flip = np.ones(3)
    flip[axis] = -1.0
    closest = closest_points(surface, surface.point * flip, surface.node_normal * flip)
    if closest.gap.max() > MAX_GAP * float(np.ptp(surface.point, axis=0).max()):
        return None
    return interpolation_at(surface, closest)
