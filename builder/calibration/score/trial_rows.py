"""What goes wrong in ground tests of independent vehicles: a row for each error, and what should be said of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from builder.calibration.ground_test.load_changes import DIRECTED
from builder.calibration.ground_test.load_test import LoadTest
from builder.calibration.score.setup import READING_STD
from builder.calibration.score.wrong_cases import AppliedTest, Spoil, case_spoils, with_another
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.loads.applied import Load
from strainfmu.arrays import FloatArray

Change = Callable[[AsBuilt, np.random.Generator], AsBuilt]

TILT = float(np.deg2rad(5.0))
"""Angle by which all pads push towards the tail [rad]."""

SUPPORT, JOINT = 0.03, 0.03
"""Compliance of the clamp and softness of the joint: what lengths of the wall would yield as much [m]."""

MODULUS = 0.03
"""Error of Young's modulus of each piece of the wall, of either sign."""

DRIFT, HYSTERESIS = 1e-6, 0.01
"""Standard deviation of what zeros drift by until the last case [m/m]; part of a case's strain that the next one
still reads."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Row:
    """One error.

    Attributes
    ----------
    name : of the row.
    said : part of the line that names the error; empty where nothing is to be said.
    spoil : changes the readings and returns the load cases that should be named, and their kinds.
    vehicle : changes the vehicle.
    load : changes what is applied.
    noise : standard deviation of the readings, stated and true [m/m].
    limit : most times the rms error of the exactly known vehicle, where the error is a parameter of the test.
    """

    name: str
    said: str = ""
    spoil: Spoil = field(default=lambda reading, random, applied: {})
    vehicle: Change = field(default=lambda built, random: built)
    load: Callable[[Load], Load] = field(default=lambda load: load)
    noise: tuple[float, float] = (READING_STD, READING_STD)
    limit: float | None = None


def rows_of(test: LoadTest) -> dict[str, Row]:
    """Return the rows by name; rows of single cases and pairs last."""
    found = [
        Row(name="faultless", limit=1.25),
        Row(name="noise 0.5 um/m", noise=(0.5e-6, 0.5e-6), limit=1.6),
        Row(name="noise 1 um/m", noise=(1e-6, 1e-6)),
        Row(name="noise 3 times as stated", said="scatter", noise=(READING_STD, 3.0 * READING_STD)),
        *(
            Row(
                name=f"mass {percent:+d} %",
                said="mass:" if abs(percent) >= 3 else "",
                vehicle=_mass(percent),
                limit=1.25,
            )
            for percent in (1, 2, 3, 5, -3)
        ),
        Row(name="pads tilted 5 deg", said="direction", load=_tilted),
        Row(name="soft support", said="clamp", vehicle=_soft_support),
        Row(name="soft joint", said="joint", vehicle=_soft_joint),
        Row(name="modulus of 7 regions", said="modulus", vehicle=_moduli),
        Row(name="drift and hysteresis", said="drift", spoil=_drift),
    ]
    spoils = case_spoils(test)
    found += [Row(name=name, said="case", spoil=one) for name, one in spoils.items()]
    found += [
        Row(name=f"{name} and another", said="case", spoil=with_another(spoils, one))
        for name, one in spoils.items()
    ]
    return {row.name: row for row in found}


def _mass(percent: int) -> Change:
    return lambda built, random: built.changed(mass=0.01 * percent)


def _tilted(load: Load) -> Load:
    """Return a force turned by :data:`TILT` towards the tail; its size stays."""
    if not isinstance(load, DIRECTED) or not any(load.force):
        return load
    force = np.asarray(load.force)
    size = float(np.linalg.norm(force))
    turned = np.cos(TILT) * force + np.sin(TILT) * size * np.array([1.0, 0.0, 0.0])
    x, y, z = (size * turned / np.linalg.norm(turned)).tolist()
    return replace(load, force=(x, y, z))


def _soft_support(built: AsBuilt, random: np.random.Generator) -> AsBuilt:
    return built.changed(clamp_axial=np.array([SUPPORT]), clamp_transverse=np.array([SUPPORT]))


def _soft_joint(built: AsBuilt, random: np.random.Generator) -> AsBuilt:
    return built.changed(joint_softness=np.full(built.counts.joint, JOINT))


def _moduli(built: AsBuilt, random: np.random.Generator) -> AsBuilt:
    return built.changed(region_modulus=MODULUS * random.choice([-1.0, 1.0], built.n_regions))


def _drift(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
    time = np.linspace(0.0, 1.0, len(reading))
    reading += time[:, None] * DRIFT * random.standard_normal(reading.shape[1])
    each = HYSTERESIS * (1.0 + 0.3 * random.standard_normal(reading.shape[1]))
    reading[1:] += each * applied.strain[:-1]
    return {}
