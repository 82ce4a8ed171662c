"""The coarse ogive with entries changed, and a small vehicle like it that solves in a second."""

import shutil
from pathlib import Path

from changed_vehicle import replaced
from ogive import OGIVE

from builder.reporting import Silent
from builder.structure.solid.case import structure_case
from builder.structure.solid.mesh_choice import MeshChoice
from builder.structure.solid.solid_model import solve_solid_structure
from builder.structure.structure_file import Structure
from builder.vehicle.file import load_vehicle
from builder.vehicle.map_needs import used_layouts

ROWS = """rows = [
    { roll_angle_deg = 0.0, directions = ["axial", "hoop"], x_m = [0.35, 0.6] },
    { roll_angle_deg = 97.0, directions = ["axial", "hoop"], x_m = [0.6] },
]"""
OUTER = ("97.0, directions", '97.0, surface = "outer", directions')
PRESSURE = "internal_pressure_Pa = 3000.0"
SMALL = (
    ("start_half_angle_deg = 16.0", "start_half_angle_deg = 20.0"),
    ("end_x_m = 1.0", "end_x_m = 0.4"),
    ("end_x_m = 2.5", "end_x_m = 0.8"),
    ("wall_thickness_mm = 3.0", "wall_thickness_mm = 6.0"),
    ('file = "gauges.csv"', ROWS),
)
FREE_FLIGHT = (
    (PRESSURE, f'{PRESSURE}\nsupport = "free_flight"'),
    ("poisson_ratio", "density_kg_per_m3 = 2700.0\npoisson_ratio"),
)


def write_vehicle(path: Path, *changes: tuple[str, str]) -> Path:
    """Write the ogive's file with texts replaced once each, its tables beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(replaced(OGIVE.read_text(encoding="utf-8"), *changes), encoding="utf-8")
    for table in ("gauges.csv", "manoeuvre.csv"):
        shutil.copy(OGIVE.parent / table, path.parent / table)
    return path


def small(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write a short, thick-walled vehicle: an ogive of 0.4 m, a cylinder of 0.4 m, radius 71 mm, wall 6 mm."""
    return write_vehicle(folder / "small.toml", *SMALL, *changes)


def solved(path: Path) -> Structure:
    """Solve the vehicle of a file on the coarse swept mesh."""
    vehicle = load_vehicle(path)
    choice = MeshChoice(resolution="coarse")
    return solve_solid_structure(structure_case(vehicle, used_layouts(vehicle), choice), Silent())
