"""What a vehicle as built may have different from its drawing, as one vector.

The kinds are listed in :data:`builder.structure.as_built_kinds.AS_BUILT`; the vector has their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from builder.structure.as_built_kinds import AS_BUILT, KINDS
from builder.vehicle.map.calibration import Calibration
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

GAUGE_KINDS = tuple(kind.name for kind in AS_BUILT if kind.extent == "gauge")
"""Parameters of each gauge on its own."""

HELD_KINDS = tuple(kind.name for kind in AS_BUILT if kind.taken_for_zero)
"""Parameters of each region that the section [calibration] takes for zero unless it says otherwise."""


class Counts(NamedTuple):
    """Numbers of gauges, regions of the wall, rows of gauges at one roll angle, and joints: extents of kinds."""

    gauge: int
    region: int
    row: int = 0
    joint: int = 0


@dataclass(frozen=True, eq=False, kw_only=True)
class AsBuiltParameters:
    """Errors of a vehicle with n_d gauges and n_r regions of the wall; zero is the vehicle of the file.

    Attributes
    ----------
    gauge_gain : (n_d,) relative error of each gauge's gain [1].
    orientation : (n_d,) turn of each gauge in the surface, from the meridian towards the roll angle [rad].
    axial_shift, circumferential_shift : (n_d,) of each gauge along the surface [m].
    transverse_sensitivity : (n_d,) reading per strain across the gauge [1].
    zero : (n_d,) reading without load [m/m].
    common_gain : (1,) relative error of all gains together [1].
    layout_roll : (1,) turn of all gauges round the axis [rad].
    youngs_modulus : (1,) relative error [1].
    wall_thickness : (n_r,) relative error of the mean round the body [1].
    wall_cosine, wall_sine : (n_r,) relative thickness that goes as cos phi and sin phi [1].
    wall_taper : (n_r,) relative thickness by which a region is thicker at its aft end, and thinner at its fore end
        [1].
    wall_second_cosine, wall_second_sine : (n_r,) relative thickness that goes as cos 2 phi and sin 2 phi [1].
    mass : (1,) relative error of own weight and inertia [1].
    region_mass : (n_r,) the same of each region, besides [1].
    clamp_axial, clamp_transverse : (1,) length of the wall's material that yields under the same traction as the
        clamp does, along and across the body [m].
    region_modulus : (n_r,) relative error of Young's modulus of each region, besides [1].
    row_orientation : (n_rows,) turn of all gauges at one roll angle, besides [rad].
    joint_softness : (n_joints,) length of the wall's material that yields as each joint does [m].
    """

    gauge_gain: FloatArray
    orientation: FloatArray
    axial_shift: FloatArray
    circumferential_shift: FloatArray
    transverse_sensitivity: FloatArray
    zero: FloatArray
    common_gain: FloatArray
    layout_roll: FloatArray
    youngs_modulus: FloatArray
    wall_thickness: FloatArray
    wall_cosine: FloatArray
    wall_sine: FloatArray
    wall_taper: FloatArray
    wall_second_cosine: FloatArray
    wall_second_sine: FloatArray
    mass: FloatArray
    region_mass: FloatArray
    clamp_axial: FloatArray
    clamp_transverse: FloatArray
    region_modulus: FloatArray
    row_orientation: FloatArray
    joint_softness: FloatArray

    def __post_init__(self) -> None:
        for kind, size in _sizes(self.counts).items():
            if np.shape(getattr(self, kind)) != (size,):
                raise InputError(f"{kind}: expected ({size},) values, got {np.shape(getattr(self, kind))}")

    @property
    def vector(self) -> FloatArray:
        """(n,) all parameters, in the order of the attributes."""
        return np.concatenate([getattr(self, one.name) for one in fields(self)])

    @property
    def counts(self) -> Counts:
        """Numbers of what has parameters of its own."""
        parts = self.gauge_gain, self.wall_thickness, self.row_orientation, self.joint_softness
        return Counts(*(len(one) for one in parts))

    @property
    def n_gauges(self) -> int:
        return len(self.gauge_gain)

    @property
    def n_regions(self) -> int:
        return len(self.wall_thickness)

    def of_vector(self, vector: FloatArray) -> AsBuiltParameters:
        """Return the parameters of ``vector`` (n,), as many of each kind as here."""
        parts = slices(self.counts)
        return AsBuiltParameters(**{kind: np.asarray(vector[part], dtype=float) for kind, part in parts.items()})


def _sizes(counts: Counts) -> dict[str, int]:
    of = {"vehicle": 1, **counts._asdict()}
    return {kind.name: of[kind.extent] for kind in AS_BUILT}


def slices(counts: Counts) -> dict[str, slice]:
    """Return where each kind stands in the vector."""
    found, start = {}, 0
    for kind, size in _sizes(counts).items():
        found[kind] = slice(start, start + size)
        start += size
    return found


def parameter_names(gauge_names: Sequence[str], counts: Counts) -> tuple[str, ...]:
    """Return a name for every entry of the vector."""
    of: dict[str, Sequence[str]] = {
        extent: [f"{extent} {k + 1}" for k in range(count)] for extent, count in counts._asdict().items()
    }
    of["gauge"] = gauge_names
    return tuple(f"{kind.in_words} {one}".rstrip() for kind in AS_BUILT for one in of.get(kind.extent, [""]))


def in_words(kind: str) -> str:
    """Return the name of a kind as it is printed."""
    return KINDS[kind].in_words


def exactly_built(counts: Counts) -> AsBuiltParameters:
    """Return the vehicle of the file, without errors."""
    return AsBuiltParameters(**{kind: np.zeros(size) for kind, size in _sizes(counts).items()})


def prior_std(entry: Calibration, counts: Counts) -> AsBuiltParameters:
    """Return the standard deviation of every parameter before a test, from the section [calibration]."""
    return AsBuiltParameters(
        **{kind: np.full(size, KINDS[kind].prior_std(entry)) for kind, size in _sizes(counts).items()}
    )


def drawn(std: AsBuiltParameters, random: np.random.Generator) -> AsBuiltParameters:
    """Return a vehicle whose errors are drawn from normal distributions of the standard deviations ``std``."""
    vector = std.vector
    return std.of_vector(vector * random.standard_normal(len(vector)))
