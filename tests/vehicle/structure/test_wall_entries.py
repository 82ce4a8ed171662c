"""Entries of [structure] beyond one wall of one material: read into the wall, refused in one line each."""

from pathlib import Path

import pytest
from changed_vehicle import write_changed

from builder.structure.gauge_checks import check_gauges
from builder.structure.wall import wall_of
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

FREE = 'support = "free_flight"\n'
STEEL = "\n[materials.steel]\nyoungs_modulus_GPa = 200.0\npoisson_ratio = 0.29\n"
CLAMPED = 'support = "clamped_aft"'


def written(folder: Path, structure: str, *changes: tuple[str, str], more: str = "") -> Path:
    """Write the shipped vehicle with further lines in [structure]."""
    path = write_changed(folder, *changes, ("[structure]\n", f"[structure]\n{structure}\n"))
    with path.open("a", encoding="utf-8") as file:
        file.write(more)
    return path


def test_the_wall_holds_what_the_file_says(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "wall_thickness_at = [{ x_m = 1.0, thickness_mm = 4.0 }, { x_m = 2.0, thickness_mm = 6.0 }]\n"
        'regions = [{ start_x_m = 2.5, end_x_m = 3.6, material = "steel" }]\n'
        "frames = [{ x_m = 1.2, width_mm = 10.0, depth_mm = 20.0 },"
        '{ x_m = 2.2, width_mm = 8.0, depth_mm = "closed" }]',
        more=STEEL,
    )
    wall = wall_of(load_vehicle(path))
    assert wall.thickness_at(1.5) == pytest.approx(5e-3)
    assert wall.thickness_at(3.0) == pytest.approx(6e-3)
    assert wall.regions[0].material.youngs_modulus == 200e9
    assert [frame.depth for frame in wall.frames] == [0.02, None]
    assert wall.frames[0].ends == pytest.approx((1.195, 1.205))
    assert not wall.is_plain


FAULTS = {
    "stations fall": (
        "wall_thickness_at = [{ x_m = 2.0, thickness_mm = 4.0 }, { x_m = 1.0, thickness_mm = 6.0 }]",
        "wall_thickness_at: expected stations that rise, got 1 after 2",
    ),
    "no thickness": ("wall_thickness_at = [{ x_m = 2.0, thickness_mm = 0.0 }]", r"thickness_mm"),
    "unknown material": (
        'regions = [{ start_x_m = 0.0, end_x_m = 1.0, material = "wood" }]',
        r"structure\.regions\.1\.material: expected one of \[materials\], none, got 'wood'",
    ),
    "region turned round": (
        'regions = [{ start_x_m = 1.0, end_x_m = 0.5, material = "wood" }]',
        "expected a station behind start_x_m 1, got 0.5",
    ),
    "frame without depth": ('frames = [{ x_m = 1.0, width_mm = 5.0, depth_mm = "open" }]', "'closed', got 'open'"),
    "mass on a clamped body": (
        "point_masses = [{ x_m = 1.0, mass_kg = 5.0 }]",
        "point_masses: expected none with support 'clamped_aft'",
    ),
    "cover on a clamped body": (
        "covers = [{ start_x_m = 0.1, end_x_m = 1.0, mass_kg_per_m2 = 5.0 }]",
        "covers: expected none with support 'clamped_aft'",
    ),
    "both codes": ('influence = "z.h5"\nstrain_per_snapshot = "s.csv"', "expected one of strain_per_snapshot and"),
    "facets alone": ('influence_facets = "f.csv"', "influence_facets: expected influence with it"),
    "results without gauges": (
        'nastran_results = ["a.op2"]',
        "nastran_results, nastran_gauges: expected both or neither, got one",
    ),
    "results of no table": (
        'nastran_results = ["a.op2"]\nnastran_gauges = "g.csv"',
        "nastran_results: expected strain_per_snapshot or influence with it, got none",
    ),
    "code and model": ('influence = "z.h5"', r"model: expected none with influence, got 'fourier'"),
    "code and second mesh": (
        'influence = "z.h5"\nchecked_by = "b.msh"',
        "checked_by: expected none with influence",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_entry_is_refused(tmp_path: Path, fault: str) -> None:
    entry, message = FAULTS[fault]
    with pytest.raises(InputError, match=message):
        load_vehicle(written(tmp_path, entry))


def test_free_flight_needs_the_density_of_every_material(tmp_path: Path) -> None:
    region = 'regions = [{ start_x_m = 0.0, end_x_m = 1.0, material = "steel" }]'
    path = written(tmp_path, region, (CLAMPED, FREE), more=STEEL)
    with pytest.raises(InputError, match=r"needs materials\.steel\.density_kg_per_m3"):
        load_vehicle(path)


def test_a_gauge_under_a_frame_is_refused(tmp_path: Path) -> None:
    """The shipped gauges have a station at 0.35 m."""
    path = written(tmp_path, "frames = [{ x_m = 0.352, width_mm = 10.0, depth_mm = 8.0 }]")
    with pytest.raises(InputError, match=r"expected a station next to the ring frame from 0\.347 to 0\.357 m"):
        check_gauges(load_vehicle(path))


@pytest.mark.parametrize("name", ["launcher", "blunt_cone"])
def test_a_shipped_surrogate_says_so_and_places_its_gauges(name: str) -> None:
    vehicle = load_vehicle(VEHICLES / f"{name}.toml")
    assert "surrogate" in vehicle.name
    assert "surrogate" in vehicle.description
    assert sum(check_gauges(vehicle).values()) >= 50
