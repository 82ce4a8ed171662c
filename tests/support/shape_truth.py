"""The independent model of the elliptic cone of :mod:`shape_case`: the same beam, gauges displaced by chance."""

import numpy as np
from shape_case import N_D, shape_structure

from builder.aero.surface.mesh import SurfaceMesh
from builder.structure.as_built.displaced_structure import WAYS
from builder.truth.shape import ShapeStructure


def beam(surface: SurfaceMesh) -> ShapeStructure:
    """Return the beam of the map on ``surface``; what displaced gauges read more is a tenth of it per unit."""
    structure = shape_structure(surface)
    z_p = structure.strain_operator("four_rows")
    share = 0.1 * np.random.default_rng(2).standard_normal((WAYS - 1, N_D, 1))
    return ShapeStructure(
        names=structure.layouts["four_rows"].names,
        position=structure.layouts["four_rows"].position,
        operator=np.concatenate([z_p[None], share * z_p]),
        surface=surface,
    )
