"""The incidence that a lateral force needs, by which a linear map compares measured angles with its loads."""

from __future__ import annotations

from math import radians

import numpy as np

from strainfmu.estimator.map.inverse_map import InverseMap

LEAST_PART_OF_SLOPE = 0.8
"""Of the smallest incidence per lateral force over that at the largest incidence: curves over Mach number and roll
angle differ."""


def incidence_per_force(inverse_map: InverseMap) -> float:
    """Return the largest total incidence of the snapshots over the largest lateral coefficient [rad].

    The lateral force of a slender body grows at least in proportion to the incidence, so that no smaller incidence
    gives a coefficient. 0 where nothing is known of it: for maps without full symmetry, whose lateral force need
    not be 0 without incidence.
    """
    held = inverse_map.provenance
    stated = held.get("total_incidence_deg")
    if held.get("symmetry") != "full" or not isinstance(stated, list) or not stated:
        return 0.0
    incidence, force = radians(max(stated)), float(np.abs(inverse_map.coefficient_range[1:3]).max())
    return incidence / force if incidence > 0.0 and force > 0.0 else 0.0
