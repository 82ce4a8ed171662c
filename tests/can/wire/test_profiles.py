"""The profiles as data: the bytes of a cycle are those on record, and every file of the folder is a profile."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from strainfmu.can.wire.authenticator import AuthenticationKey
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.can.wire.profiles import PROFILES, SECURED_PROFILE, Identifiers, profile_layout
from strainfmu.can.wire.strain_encoder import StrainEncoder

RECORD = Path(__file__).with_name("profile_frames.csv")
"""Frames by profile, identifier and name, as strainfmu sent them when the profiles were code."""

GAUGES = ("front axial", "front-hoop", "7", "a", "b/c")
READINGS = {"sensor.P1": "Pa", "sensor.n x": "m/s2", "thrust": "N"}


def layout_of(profile: str) -> InputLayout:
    key = AuthenticationKey(bytes(range(16))) if profile == SECURED_PROFILE else None
    return profile_layout(profile, GAUGES, 0.01, Identifiers(0x123, 0x700), key, has_tare=True, readings=READINGS)


def frames_of(layout: InputLayout) -> list[Frame]:
    """Return the frames of two cycles; in the first nothing but q_inf and strains is known."""
    encoder = StrainEncoder(layout, trip=3)
    strain = np.array([1e-6, -2.5e-4, np.nan, 0.0, 8.1e-3])
    return [
        *encoder.encode(strain, 54_321.0, 7, 1.234567),
        *encoder.encode(
            -strain,
            12_345.5,
            400,
            90.5,
            status=1,
            mach_number=6.123,
            altitude=20_002.0,
            readings=dict(zip(READINGS, (101_325.0, -3.5, 1e4), strict=True)),
            tare_request=2,
        ),
    ]


def record() -> list[list[str]]:
    """Return what RECORD holds."""
    rows = []
    for profile in PROFILES:
        layout = layout_of(profile)
        names = {frame.layout.identifier: frame.layout.name for frame in layout.frames}
        rows += [
            [profile, f"{frame.identifier:x}", names[frame.identifier], frame.data.hex()]
            for frame in frames_of(layout)
        ]
    return rows


@pytest.mark.parametrize("profile", PROFILES)
def test_frames_are_those_on_record(profile: str) -> None:
    with RECORD.open(newline="") as file:
        expected = [row for row in csv.reader(file) if row[0] == profile]
    assert expected
    assert [row for row in record() if row[0] == profile] == expected


def test_a_profile_is_a_file() -> None:
    folder = Path(__file__).parents[3] / "strainfmu" / "can" / "profiles"
    assert {*PROFILES, "signals"} == {path.stem for path in folder.iterdir()}
