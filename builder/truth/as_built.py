"""A vehicle as built: the errors of its hardware, drawn at the sizes that the section [noise] states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.structure.as_built_kinds import KINDS
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray

DRAWN = (
    "gauge_gain",
    "common_gain",
    "axial_shift",
    "circumferential_shift",
    "orientation",
    "layout_roll",
    "wall_thickness",
    "apparent_strain",
    "internal_pressure",
    "dynamic_pressure",
    "clamp_axial",
    "clamp_transverse",
)
"""Kinds in the order in which they are drawn. The wall's thickness is one number, that of all regions."""

DRAWN_IF_STATED = ("clamp_axial", "clamp_transverse")
"""Kinds of these whose size is 0 by default: they take no number of the sequence then."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AsBuilt:
    """Errors of one vehicle with n_d gauges; zero is the vehicle of the file.

    Attributes
    ----------
    gauge_gain : (n_d,) relative error of each gauge's gain [1].
    common_gain : relative error of all gains together [1].
    axial_shift, circumferential_shift : (n_d,) of each gauge along the surface [m].
    orientation : (n_d,) turn of each gauge in the surface, from the meridian towards the roll angle [rad].
    layout_roll : turn of all gauges round the axis [rad].
    wall_thickness : relative error [1].
    apparent_strain : (n_d,) strain that is no strain [m/m].
    internal_pressure : error of the internal pressure over p_inf [1].
    dynamic_pressure : relative error of the stated q_inf [1].
    clamp_axial, clamp_transverse : length of the wall's material that yields as the clamp does, along and across
        the body [m].
    """

    gauge_gain: FloatArray
    common_gain: float | FloatArray
    axial_shift: FloatArray
    circumferential_shift: FloatArray
    orientation: FloatArray
    layout_roll: float | FloatArray
    wall_thickness: float | FloatArray
    apparent_strain: FloatArray
    internal_pressure: float | FloatArray
    dynamic_pressure: float | FloatArray
    clamp_axial: float | FloatArray = 0.0
    clamp_transverse: float | FloatArray = 0.0


def exactly_built(n_gauges: int) -> AsBuilt:
    """Return the vehicle of the file, without errors."""
    zero = np.zeros(n_gauges)
    return AsBuilt(
        gauge_gain=zero,
        common_gain=0.0,
        axial_shift=zero,
        circumferential_shift=zero,
        orientation=zero,
        layout_roll=0.0,
        wall_thickness=0.0,
        apparent_strain=zero,
        internal_pressure=0.0,
        dynamic_pressure=0.0,
    )


def drawn(entry: Noise, n_gauges: int, random: np.random.Generator, scale: float = 1.0) -> AsBuilt:
    """Return a vehicle whose errors are drawn from normal distributions of ``scale`` times the sizes in
    ``entry``."""
    return _drawn(entry, (n_gauges,), (), random, scale)


def drawn_many(entry: Noise, n_gauges: int, count: int, random: np.random.Generator) -> AsBuilt:
    """Return ``count`` vehicles at once: what is (n_d,) of one is (count, n_d) here, and a number is (count,
    1)."""
    return _drawn(entry, (count, n_gauges), (count, 1), random, 1.0)


def _drawn(
    entry: Noise,
    of_gauges: tuple[int, ...],
    of_vehicle: tuple[int, ...],
    random: np.random.Generator,
    scale: float,
) -> AsBuilt:
    found = dict[str, Any]()
    for name in DRAWN:
        kind = KINDS[name]
        size = of_gauges if kind.extent == "gauge" else of_vehicle
        if name in DRAWN_IF_STATED and kind.noise_std(entry) == 0.0:
            found[name] = np.zeros(size) if size else 0.0
            continue
        value = scale * kind.noise_std(entry) * random.standard_normal(size)
        found[name] = value if size else float(value)
    found["apparent_strain"] = found["apparent_strain"] + np.zeros(of_gauges)
    return AsBuilt(**found)
