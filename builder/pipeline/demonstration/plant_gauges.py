"""The gauges of a vehicle as built for its flight model: reading per harmonic of the pressure."""

from __future__ import annotations

import numpy as np

from builder.structure.as_built.structure import AsBuiltStructure
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.as_built_kinds import AS_BUILT
from builder.truth.revolution.flight_tables import PlantGauges
from strainfmu.arrays import FloatArray


def plant_gauges(structure: AsBuiltStructure, parameters: AsBuilt, n_harmonics: int) -> PlantGauges:
    """Return the gauges of a vehicle as built, harmonics of the pressure 0 to ``n_harmonics``.

    Strain per cos(m phi) and sin(m phi) is taken to a crest of the pressure at the gauge's own roll angle. That
    holds for an uneven wall as well, whose strain goes round the body otherwise than the pressure does.
    """
    grid, n_d = structure.surface, structure.n_gauges
    operator = structure.strain_operator(parameters).reshape(n_d, len(grid.x), grid.n_roll)
    m = np.arange(n_harmonics + 1)
    angle = np.outer(grid.roll_angle, m)
    cosine, sine = (np.moveaxis(operator @ wave(angle), 1, 2) for wave in (np.cos, np.sin))
    roll = structure.placed.roll_angle
    c, s = (wave(np.outer(roll, m))[:, :, None] for wave in (np.cos, np.sin))
    response: FloatArray = np.stack([cosine * c + sine * s, cosine * s - sine * c], axis=-1)
    return PlantGauges(
        names=structure.gauges.names,
        roll_angle=roll,
        response=response,
        internal_pressure=0.0,
        apparent_strain=parameters.zero,
        record={kind.name: getattr(parameters, kind.name).tolist() for kind in AS_BUILT},
    )
