"""A ground test of a case, and what all tests of a trial have in common; :mod:`builder.calibration.score` makes
them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, PositiveFloat

from builder.vehicle.toml.sections import Section

Wrong = Literal[
    "kgf",
    "lbf",
    "case sign",
    "no load",
    "wrong load",
    "duplicate",
    "mislabelled",
    "interchanged",
    "attitude",
    "10 kg more",
    "balanced again",
    "gauges swapped",
    "gauge sign",
    "gauge unit",
    "dead gauge",
]
"""Errors of single load cases and gauges, see :mod:`builder.calibration.score.wrong_cases`."""


class GroundTest(Section):
    """The test of one vehicle, and what goes wrong with vehicle, rig and readings.

    Attributes
    ----------
    pads : of the test, in addition to its attitudes.
    reading_std_um_per_m, noise_times : stated standard deviation of a reading; the true one over it.
    said : part of a line that names the error; empty where nothing is to be said.
    wrong, and_another : an error of a load case or gauge, which is to be named as such; with one more of any kind.
    mass_percent : the vehicle is heavier.
    clamp_m, joint_m : softness, what lengths of the wall would yield as much.
    modulus_percent : error of Young's modulus of each piece of the wall, of either sign, drawn.
    taper_percent : the wall of each piece is thicker at its aft end, and thinner at its fore end.
    second_harmonic_percent : standard deviation of cosine and sine of twice the roll angle in its thickness.
    tilt_deg : all pads push towards the tail.
    drift_um_per_m : standard deviation of what zeros drift by until the last case.
    hysteresis_percent : part of a case's strain that the next one still reads.
    """

    pads: int = Field(default=12, ge=1)
    reading_std_um_per_m: PositiveFloat = 0.05
    noise_times: float = Field(default=1.0, ge=0.0)
    said: str = ""
    wrong: Wrong | None = None
    and_another: bool = False
    mass_percent: float = 0.0
    clamp_m: float = Field(default=0.0, ge=0.0)
    joint_m: float = Field(default=0.0, ge=0.0)
    modulus_percent: float = 0.0
    taper_percent: float = 0.0
    second_harmonic_percent: float = Field(default=0.0, ge=0.0)
    tilt_deg: float = 0.0
    drift_um_per_m: float = Field(default=0.0, ge=0.0)
    hysteresis_percent: float = 0.0


class GroundTests(Section):
    """What all tests have in common.

    Attributes
    ----------
    walls : "smooth" vary smoothly along the body; "stated" by the regions and sizes of [calibration].
    proposed : the test that `strainfmu loadtest` proposes; otherwise pads at even distances.
    load_cell_percent : error that all loads have in common.
    draws : of gauge noise for each flight.
    """

    walls: Literal["smooth", "stated"] = "smooth"
    proposed: bool = True
    load_cell_percent: float = Field(default=0.5, ge=0.0)
    draws: int = Field(default=8, ge=1)
