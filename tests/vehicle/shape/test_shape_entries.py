"""Section [shape] of the vehicle file, and the entries that go with each kind of shape."""

from pathlib import Path

import pytest
from changed_vehicle import TEXT, refusal

from builder.vehicle.file import IC3X, load_vehicle

pytestmark = pytest.mark.fast

PROFILE = TEXT[TEXT.index("[[profile]]") : TEXT.index("[structure]")]
SECTIONS = '[shape]\nsections = "s.csv"\n\n'
SURFACE = '[shape]\nsurface = "s.stl"\nunit = "mm"\n\n'
SOLID = ('model = "fourier"', 'model = "solid"')
REFERENCE = ("moment_station_m = 2.0", "moment_station_m = 2.0\narea_m2 = 0.1\nlength_m = 0.4")


def test_profile_may_stand_in_the_section(tmp_path: Path) -> None:
    path = tmp_path / "v.toml"
    path.write_text(TEXT.replace(PROFILE, PROFILE.replace("[[profile]]", "[[shape.profile]]")), encoding="utf-8")
    assert load_vehicle(path).body() == load_vehicle(IC3X).body()


def test_sections_need_their_entries(tmp_path: Path) -> None:
    text = refusal(tmp_path, (PROFILE, SECTIONS))
    assert "reference.area_m2: entry is missing" in text
    assert "structure.model: expected 'solid' with shape.sections, got 'fourier'" in text


def test_surface_needs_its_entries(tmp_path: Path) -> None:
    text = refusal(tmp_path, (PROFILE, SURFACE), SOLID, REFERENCE)
    assert "aerodynamics.engine: expected 'newtonian' or 'table' with shape.surface, got 'euler'" in text
    assert "structure.mesh: entry is missing" in text
    assert "structure.solid_tip_length_m: expected none" in text


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ("", "expected the outer shape either as [[profile]] or in [shape], got neither"),
        (SECTIONS + PROFILE, "either as [[profile]] or in [shape], got both"),
        ('[shape]\nsections = "s.csv"\nsurface = "s.stl"\n', "shape: expected one of profile, sections, surface"),
        ('[shape]\nsurface = "s.stl"\n', "shape: surface: expected unit or length_m with it"),
        ('[shape]\nsections = "s.csv"\nunit = "mm"\n', "shape: unit, length_m: expected with surface alone"),
        ('[shape]\nsurface = "s.stl"\nunit = "furlong"\n', "shape.unit: expected 'm', 'mm'"),
    ],
)
def test_wrong_shapes_are_one_line(tmp_path: Path, shape: str, message: str) -> None:
    assert message in refusal(tmp_path, (PROFILE, shape))
