"""Number of elements through the wall that a swept mesh needs, by the locking check.

One layer of quadratic hexahedra carries the bending of thin walls. In a thick one, strain is no longer linear
through the wall: on a ring of radius 4 t a single layer loses 2 % of the hoop strain under cos 2 phi and 6 % under
cos 4 phi.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from builder.structure.solid.checks.locking import WARN_BELOW, WallElements, locking_ratios
from builder.structure.solid.mesh.swept_mesh import HEXAHEDRON, SweptMesh
from builder.structure.wall import Material, Wall
from strainfmu.arrays import FloatArray

MOST_LAYERS = 8
SMALLEST_RADIUS = 1.25  # of the thickness: nearer to the axis the closed forms of a ring say little of the wall


def layers_needed(wall: Wall, radius: FloatArray, n_sectors: int, fewest: int = 1) -> int:
    """Return the fewest layers whose loss of bending the locking check accepts without a warning.

    Parameters
    ----------
    wall : thickness and material.
    radius : (k,) outer radii [m] at which it must hold: of the base and at the gauges.
    n_sectors : elements round the axis.
    fewest : layers to begin with.

    Returns
    -------
    At most :data:`MOST_LAYERS`, whether they suffice or not: the locking check itself follows.
    """
    at_least = SMALLEST_RADIUS * wall.thickness
    # The smallest radius needs most layers, the largest has the longest elements round the axis.
    ends = sorted({max(at_least, float(np.min(radius))), max(at_least, float(np.max(radius)))})
    for layers in range(fewest, MOST_LAYERS):
        if all(_kept(wall.thickness, wall.material, one, n_sectors, layers) >= WARN_BELOW for one in ends):
            return layers
    return MOST_LAYERS


@cache
def _kept(thickness: float, material: Material, radius: float, n_sectors: int, layers: int) -> float:
    """Return the smallest fraction of the hoop strain over the harmonics of the locking check."""
    elements = WallElements(
        element_type=HEXAHEDRON,
        size=2.0 * np.pi * radius / n_sectors,
        layers=layers,
        quadrature=SweptMesh.quadrature,
    )
    return min(locking_ratios(elements, radius, thickness, material).values())
