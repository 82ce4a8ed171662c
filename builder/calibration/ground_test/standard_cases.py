"""Load cases of a plain ground test: pads over the body in two planes and more, own weight in four attitudes."""

from __future__ import annotations

import numpy as np

from builder.calibration.ground_test.candidate_cases import PlannedCase
from builder.structure.loads.applied import Load, PadForce, Weight

STATIONS = (0.14, 0.28, 0.43, 0.67, 0.86)
"""Of the pads, over the length of the body."""

PUSH = 1000.0
"""Force of a pad at the foremost station [N]; the aft half of the body takes twice as much."""

HALF_LENGTH, HALF_ANGLE = 0.05, float(np.deg2rad(30.0))

ROLL_ANGLES = (0.0, 90.0, 180.0, 270.0, 45.0, 135.0, 225.0, 315.0)
"""In the order in which pads are added [deg]."""


def pads(count: int, length: float) -> list[PadForce]:
    """Return the first ``count`` pads that press inwards on a body of ``length`` [m].

    Pairs of stations and planes come first, so that few pads see the whole body already.
    """
    order = [(2, 0), (0, 1), (4, 1), (0, 0), (4, 0), (2, 1), (1, 0), (3, 1), (1, 1), (3, 0)]
    order += [(k, turn) for turn in (2, 3, 4, 5, 6, 7) for k in (2, 0, 4, 1, 3)]
    forces = []
    for station, turn in order[:count]:
        roll = float(np.deg2rad(ROLL_ANGLES[turn]))
        push = PUSH * (1.0 if station < 3 else 2.0)
        force = (0.0, -push * float(np.sin(roll)), -push * float(np.cos(roll)))
        forces.append(
            PadForce(
                station=STATIONS[station] * length,
                roll_angle=roll,
                half_length=HALF_LENGTH,
                half_angle=HALF_ANGLE,
                force=force,
            )
        )
    return forces


def weights() -> list[Weight]:
    """Return own weight in four attitudes, the vehicle level."""
    return [Weight(up_roll_angle=float(np.deg2rad(roll))) for roll in ROLL_ANGLES[:4]]


def standard_load_cases(count: int, length: float, weighs: bool = True) -> list[PlannedCase]:
    """Return ``count`` pads, the vehicle upright, and own weight in four attitudes; where the vehicle ``weighs``
    nothing, no load and the pads."""
    upright = (Weight(),) if weighs else ()
    named: list[tuple[str, tuple[Load, ...]]]
    named = [(f"pad {number}", (pad, *upright)) for number, pad in enumerate(pads(count, length), start=1)]
    of_weight = [(f"attitude {number}", (weight,)) for number, weight in enumerate(weights(), start=1)]
    named = [*named, *of_weight] if weighs else [("no load", ()), *named]
    return [PlannedCase(name=name, loads=loads) for name, loads in named]
