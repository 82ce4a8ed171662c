"""Loads as they are applied rather than as they are stated: of another size, at another place, on another pad."""

from dataclasses import fields, replace

import numpy as np

from builder.calibration.ground_test.load_entries import times
from builder.calibration.ground_test.load_test import LoadCase
from builder.structure.loads import applied
from builder.structure.loads.applied import Load
from strainfmu.arrays import FloatArray

DIRECTED = applied.PadForce | applied.PointForce | applied.SurfaceForce | applied.SectionLoad
"""Loads that are a force of a direction of their own."""

ALONG = 1e-6
"""Part of a force across the body below which it points along it."""

PLACED = applied.PadForce | applied.PadPressure | applied.PointForce
"""Loads that have a place on the outer surface."""

WHERE = frozenset(
    ("station", "roll_angle", "half_length", "half_angle", "surface", "up_roll_angle", "nose_elevation")
)
"""Fields of loads that do not change with their size."""


def scaled(load: Load, factor: float) -> Load:
    """Return ``load`` times ``factor``."""
    sizes = [field.name for field in fields(load) if field.name not in WHERE]
    return replace(load, **{name: times(getattr(load, name), factor) for name in sizes})


def moved(load: Load, along: float = 0.0, around: float = 0.0, longer: float = 0.0) -> Load:
    """Return a pad or point moved ``along`` the body [m] and ``around`` it [rad], a pad ``longer`` by a factor 1 +
    it.

    A force keeps its direction; loads that have no place stay as they are.
    """
    if not isinstance(load, PLACED):
        return load
    shifted = replace(load, station=load.station + along, roll_angle=load.roll_angle + around)
    if isinstance(shifted, applied.PointForce):
        return shifted
    return replace(shifted, half_length=shifted.half_length * (1.0 + longer))


def tilted(load: Load, first: float = 0.0, second: float = 0.0) -> Load:
    """Return a load whose force is turned by small angles [rad] about the two axes across it; its size stays.

    Loads without a force of a direction of their own stay as they are.
    """
    if not isinstance(load, DIRECTED) or not any(load.force) or not (first or second):
        return load
    force = np.asarray(load.force)
    size = float(np.linalg.norm(force))
    across = _across(force)
    turned = force / size + first * across[0] + second * across[1]
    x, y, z = (size * turned / np.linalg.norm(turned)).tolist()
    return replace(load, force=(x, y, z))


def elsewhere(load: Load, error: FloatArray) -> Load:
    """Return a load with an ``error`` (5,) of place along and around the body, of length, and two tilts."""
    along, around, longer, first, second = error.tolist()
    return moved(tilted(load, first, second), along=along, around=around, longer=longer)


def common_turns(load: Load) -> FloatArray:
    """Return (2, 2) both angles of :func:`tilted` that turn a force towards +x, and across that and itself, by 1.

    They are zero where a load has no direction of its own, or its force points along x.
    """
    if not isinstance(load, DIRECTED) or not any(load.force):
        return np.zeros((2, 2))
    force = np.asarray(load.force)
    around = np.cross([1.0, 0.0, 0.0], force / np.linalg.norm(force))
    if np.linalg.norm(around) < ALONG:
        return np.zeros((2, 2))
    return np.asarray(_across(force) @ np.array([[1.0, 0.0, 0.0], around]).T)


def _across(force: FloatArray) -> FloatArray:
    """Return (2, 3) the axes across a force that it is tilted towards."""
    return np.asarray(np.linalg.svd(force[None] / np.linalg.norm(force))[2][1:])


def change_by(load: applied.PadForce | applied.PointForce, more: Load) -> FloatArray:
    """Return (3,) factor less 1 and both angles of :func:`tilted` that add the force of ``more`` to ``load``."""
    if not isinstance(more, applied.PadForce | applied.PointForce) or not any(load.force):
        return np.zeros(3)
    force, added = np.asarray(load.force), np.asarray(more.force)
    size = float(np.linalg.norm(force))
    return np.array([force @ added / size**2, *(_across(force) @ added / size)])


def hanging(
    load: applied.PadForce | applied.PadPressure | applied.PointForce, case: LoadCase, mass: float
) -> Load:
    """Return the weight of ``mass`` [kg] that hangs where ``load`` of a case acts, in the attitude of the case.

    The vehicle lies with +z up where the case states no weight.
    """
    weights = [known.load for known in case.loads if isinstance(known.load, applied.Weight)]
    x, y, z = (mass * (weights[0] if weights else applied.Weight()).acceleration).tolist()
    if isinstance(load, applied.PadPressure):
        return applied.PadForce(
            station=load.station,
            roll_angle=load.roll_angle,
            half_length=load.half_length,
            half_angle=load.half_angle,
            force=(x, y, z),
        )
    return replace(load, force=(x, y, z))


def is_along(load: Load, second: Load) -> bool:
    """Return whether the forces of two loads have one direction or opposite ones."""
    if not isinstance(load, DIRECTED) or not isinstance(second, DIRECTED):
        return False
    a, b = np.asarray(load.force), np.asarray(second.force)
    return bool(np.linalg.norm(np.cross(a, b)) <= ALONG * np.linalg.norm(a) * np.linalg.norm(b))


def cell_force(load: Load) -> float:
    """Return the force that a load cell reads of a load [N]; 0 where it reads none, as of a pressure."""
    if isinstance(load, applied.PadPressure):
        return abs(load.push)
    return float(np.linalg.norm(load.force)) if isinstance(load, DIRECTED) else 0.0
