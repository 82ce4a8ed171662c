"""Loads as they are applied rather than as they are stated: of another size, at another place, on another pad."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from builder.calibration.ground_test.load_test import KnownLoad, LoadErrors
from builder.structure.loads import applied
from builder.structure.loads.applied import Load, Vector
from builder.structure.loads.temperature import TemperatureField


def scaled(load: Load, factor: float) -> Load:
    """Return ``load`` times ``factor``."""
    match load:
        case applied.PadForce() | applied.PointForce() | applied.SurfaceForce():
            return replace(load, force=_times(load.force, factor))
        case applied.PadPressure():
            return replace(load, push=factor * load.push)
        case applied.SurfacePressure():
            return replace(load, pressure=factor * load.pressure)
        case applied.SectionLoad():
            return replace(load, force=_times(load.force, factor), moment=_times(load.moment, factor))
        case applied.Weight():
            return replace(load, gravity=factor * load.gravity)
        case applied.Acceleration():
            return replace(load, linear=_times(load.linear, factor), angular=_times(load.angular, factor))
        case applied.DistributedForce():
            return replace(load, force_per_length=factor * load.force_per_length)
        case TemperatureField():
            return replace(load, inner=factor * load.inner, outer=factor * load.outer)
        case applied.ApparentStrain():
            return replace(load, strain=factor * load.strain)


def moved(load: Load, along: float = 0.0, around: float = 0.0, longer: float = 0.0) -> Load:
    """Return a pad moved ``along`` the body [m] and ``around`` it [rad] and ``longer`` by a factor 1 + it.

    A force keeps its direction; loads that are no pads stay as they are.
    """
    if not isinstance(load, applied.PadForce | applied.PadPressure):
        return load
    return replace(
        load,
        station=load.station + along,
        roll_angle=load.roll_angle + around,
        half_length=load.half_length * (1.0 + longer),
    )


def as_applied(known: KnownLoad, errors: LoadErrors, common: float, random: np.random.Generator) -> Load:
    """Return a load whose errors are drawn; ``common`` is the relative error of the load cell."""
    own, along, around, longer = random.standard_normal(4).tolist()
    factor = (1.0 + known.std * own) * (1.0 + common * known.on_load_cell)
    return moved(
        scaled(known.load, factor),
        along=errors.pad_position * along,
        around=errors.pad_roll * around,
        longer=errors.pad_shape * max(longer, -3.0),
    )


def _times(vector: Vector, factor: float) -> Vector:
    x, y, z = vector
    return factor * x, factor * y, factor * z
