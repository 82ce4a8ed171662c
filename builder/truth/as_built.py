"""A vehicle as built: the errors of its hardware, drawn at the sizes that the section [noise] states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray

MICRO = 1e-6


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
    def each(std: float) -> FloatArray:
        return scale * std * random.standard_normal(of_gauges)

    def one(std: float) -> Any:
        value = scale * std * random.standard_normal(of_vehicle)
        return value if of_vehicle else float(value)

    return AsBuilt(
        gauge_gain=each(0.01 * entry.gauge_gain_percent),
        common_gain=one(0.01 * entry.common_gain_percent),
        axial_shift=each(1e-3 * entry.gauge_position_mm),
        circumferential_shift=each(1e-3 * entry.gauge_position_mm),
        orientation=each(float(np.deg2rad(entry.gauge_orientation_deg))),
        layout_roll=one(float(np.deg2rad(entry.layout_roll_deg))),
        wall_thickness=one(0.01 * entry.wall_thickness_percent),
        apparent_strain=one(MICRO * entry.apparent_strain_um_per_m) + np.zeros(of_gauges),
        internal_pressure=one(0.01 * entry.internal_pressure_percent),
        dynamic_pressure=one(0.01 * entry.dynamic_pressure_percent),
    )
