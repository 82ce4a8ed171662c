"""The profiles as data: the bytes of a cycle are those on record, and every file of the folder is a profile."""

import csv
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from strainfmu.can.authentic import AuthenticationKey
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.profiles import PROFILES, SECURED_PROFILE, Identifiers, profile_layout

RECORD = Path(__file__).with_name("profile_frames.csv")
"""Frames by profile and version, identifier and name; of version 1 as sent when the profiles were code."""

GAUGES = ("front axial", "front-hoop", "7", "a", "b/c")
READINGS = {"sensor.P1": "Pa", "sensor.n x": "m/s2", "thrust": "N"}


def layout_of(profile: str, version: int) -> InputLayout:
    key = AuthenticationKey(bytes(range(16))) if profile == SECURED_PROFILE else None
    layout = profile_layout(
        profile, GAUGES, 0.01, Identifiers(0x123, 0x700), key, has_tare=True, readings=READINGS
    )
    return layout if version == 2 else replace(layout, state=None)


def frames_of(layout: InputLayout) -> list[Frame]:
    """Return the frames of two cycles; in the first nothing but q_inf and strains is known."""
    encoder = StrainEncoder(layout, trip=3, session=500)
    strain = np.array([1e-6, -2.5e-4, np.nan, 0.0, 8.1e-3])
    first = encoder.encode(strain, 54_321.0, 7, 1.234567)
    encoder.hear(7, 9, 90.4968)
    return [
        *first,
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
    for profile, version in product(PROFILES, (1, 2)):
        layout = layout_of(profile, version)
        names = {frame.layout.identifier: frame.layout.name for frame in layout.frames}
        rows += [
            [f"{profile} {version}", f"{frame.identifier:x}", names[frame.identifier], frame.data.hex()]
            for frame in frames_of(layout)
        ]
    return rows


def test_a_result_that_comes_after_counters_have_come_round_is_not_named() -> None:
    """A delay of 256 cycles looked like none: the result answers a cycle of the same counter before."""
    encoder, strain = StrainEncoder(layout_of("fd64", 2), session=1), np.zeros(len(GAUGES))
    for cycle in range(257):
        encoder.encode(strain, 1e4, cycle, 0.01 * cycle)
    for sample_time, named in ((0, 0xFFFF_FFFF), (2_560_000, 2_560_000)):
        encoder.hear(0, 9, 2.565, sample_time)
        state = encoder.encode(strain, 1e4, 257, 2.57)[0]
        assert int.from_bytes(state.data[8:12], "little") == named


@pytest.mark.parametrize("profile", [f"{one} {version}" for one in PROFILES for version in (1, 2)])
def test_frames_are_those_on_record(profile: str) -> None:
    with RECORD.open(newline="") as file:
        expected = [row for row in csv.reader(file) if row[0] == profile]
    assert expected
    assert [row for row in record() if row[0] == profile] == expected


def test_a_profile_is_a_file() -> None:
    folder = Path(__file__).parents[2] / "strainfmu" / "can" / "profiles"
    assert {*PROFILES, "results", "signals"} == {path.stem for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("profile", "n", "first"),
    [
        ("fd64", 2000, 0x300),
        ("fd64", 4096, 0x200),
        (SECURED_PROFILE, 2000, 0x300),
        (SECURED_PROFILE, 4096, 0x200),
        ("classic-le", 300, 0x300),
    ],
)
def test_frames_of_many_gauges_stay_ahead_of_the_results(profile: str, n: int, first: int) -> None:
    """Up to 2,000 gauges have the identifiers of versions 1 and 2; no two frames of a cycle share a DataID."""
    layout = profile_layout(profile, [f"g{k}" for k in range(n)], 0.1, has_tare=True, readings=READINGS)
    identifiers = sorted(frame.layout.identifier for frame in layout.frames)
    assert [first - 1, first] == identifiers[:2] or identifiers[0] == first
    assert identifiers[-1] < 0x380
    data_ids = [frame.layout.protection.data_id for frame in layout.frames if frame.layout.protection]
    assert profile == "classic-le" or len(set(data_ids)) == len(data_ids)
