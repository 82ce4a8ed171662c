"""Layouts of gauges that are moved or turned a little: their strain shows the effect of placement errors.

The rows of moved gauges are further right-hand sides of the one factorisation, so they cost little.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from builder.structure.solid.gauges.gauge_rows import Gauges
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray

STEP = 1e-3
"""How far gauges are moved along the surface [m]."""

AFT, FORE, AROUND, BACK = "moved aft", "moved fore", "moved around", "moved back"
TURNED_AROUND, TURNED_BACK = "turned around", "turned back"

DISPLACED = (AFT, FORE, AROUND, BACK, TURNED_AROUND, TURNED_BACK)


def displaced_name(layout: str, how: str) -> str:
    """Return the name of ``layout`` displaced, ``how`` being one of the six ways."""
    return f"{layout} ({how})"


def is_displaced(name: str) -> bool:
    """Return whether a layout's name is one of :func:`displaced_name`."""
    return any(name.endswith(f" ({how})") for how in DISPLACED)


def displaced_gauges(layout: str, gauges: Gauges, body: BodyOfRevolution) -> dict[str, Gauges]:
    """Return ``gauges`` of ``layout``, by name, moved by 1 mm four ways and turned by 45 degrees two ways.

    Aft is along the meridian, around is with the roll angle; directions keep their angle to the meridian. Turning
    is from the meridian towards the roll angle. As strain goes with twice the angle, e(45 deg) - e(-45 deg) is
    exactly its derivative by the angle, where the gauge has no length.
    """
    x, radius = gauges.position[:, 0], np.hypot(gauges.position[:, 1], gauges.position[:, 2])
    roll = np.arctan2(gauges.position[:, 1], gauges.position[:, 2])
    angle, zero = body.angle(x), np.zeros(len(x))
    aft = np.column_stack([np.cos(angle), np.sin(angle) * np.sin(roll), np.sin(angle) * np.cos(roll)])
    around = np.column_stack([zero, np.cos(roll), -np.sin(roll)])
    found = {
        AFT: replace(gauges, position=gauges.position + STEP * aft),
        FORE: replace(gauges, position=gauges.position - STEP * aft),
        AROUND: _rolled(gauges, STEP / radius),
        BACK: _rolled(gauges, -STEP / radius),
        TURNED_AROUND: _turned(gauges, aft, around, 1.0),
        TURNED_BACK: _turned(gauges, aft, around, -1.0),
    }
    return {displaced_name(layout, how): one for how, one in found.items()}


def displaced_on_surface(layout: str, gauges: Gauges, aft: FloatArray, around: FloatArray) -> dict[str, Gauges]:
    """Return ``gauges`` displaced as by :func:`displaced_gauges`, on any surface.

    ``aft`` and ``around`` (n, 3) are unit vectors in the surface, along x and towards the roll angle.
    """
    found = {
        AFT: replace(gauges, position=gauges.position + STEP * aft),
        FORE: replace(gauges, position=gauges.position - STEP * aft),
        AROUND: replace(gauges, position=gauges.position + STEP * around),
        BACK: replace(gauges, position=gauges.position - STEP * around),
        TURNED_AROUND: _turned(gauges, aft, around, 1.0),
        TURNED_BACK: _turned(gauges, aft, around, -1.0),
    }
    return {displaced_name(layout, how): one for how, one in found.items()}


def _rolled(gauges: Gauges, angle: FloatArray) -> Gauges:
    """Return the gauges rolled by their ``angle`` (n,) [rad] round the axis, from +z towards +y."""
    c, s = np.cos(angle), np.sin(angle)

    def turn(vector: FloatArray) -> FloatArray:
        x, y, z = vector.T
        return np.column_stack([x, c * y + s * z, c * z - s * y])

    return replace(gauges, position=turn(gauges.position), direction=turn(gauges.direction))


def _turned(gauges: Gauges, aft: FloatArray, around: FloatArray, sign: float) -> Gauges:
    """Return the gauges with directions turned by 45 degrees in the plane of ``aft`` and ``around`` (n, 3)."""
    along = np.sum(gauges.direction * aft, axis=1, keepdims=True)
    across = np.sum(gauges.direction * around, axis=1, keepdims=True)
    return replace(gauges, direction=(along - sign * across) * aft + (sign * along + across) * around)
