"""One body given by its profile, by circular sections, and by triangles with an imported mesh: the same loads."""

from math import radians
from pathlib import Path

import numpy as np
import pytest

import builder
from builder.aero.cfd.formats.stl import write_stl
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.structure.mapped_structure import mapped_operator
from builder.structure.solid.mesh_files import write_mesh
from builder.structure.solid.swept_mesh import SweptResolution, full_mesh, swept_wall
from builder.structure.structure_file import Structure
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import chain_segments, surface_grid
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.slow

LENGTH, HALF_ANGLE, TIP = 1.2, 8.0, 0.15
BASE = LENGTH * np.tan(radians(HALF_ANGLE))

PROFILE = f"""[[profile]]
kind = "cone"
half_angle_deg = {HALF_ANGLE}
end_x_m = {LENGTH}

[structure]
solid_tip_length_m = {TIP}
"""
SECTIONS = f"""[shape]
sections = "sections.csv"

[structure]
solid_tip_length_m = {TIP}
"""
SURFACE = f"""[shape]
surface = "body.stl"
unit = "mm"
length_m = {LENGTH}

[structure]
mesh = "body.vtu"
checked_by = "coarser.vtu"
"""
REST = f"""model = "solid"
wall_thickness_mm = 4.0

[material]
youngs_modulus_GPa = 70.0
poisson_ratio = 0.33

[reference]
area_m2 = {np.pi * BASE**2:.8f}
length_m = {2.0 * BASE:.8f}
moment_station_m = 0.8

[gauges]
layout = "rows"

[gauges.layouts.rows]
rows = [
    {{ roll_angle_deg = 0.0, directions = ["axial", "hoop"], first_x_m = 0.30, last_x_m = 1.10, count = 5 }},
    {{ roll_angle_deg = 90.0, directions = ["axial", "hoop"], first_x_m = 0.30, last_x_m = 1.10, count = 5 }},
    {{ roll_angle_deg = 180.0, directions = ["axial", "hoop"], first_x_m = 0.30, last_x_m = 1.10, count = 5 }},
    {{ roll_angle_deg = 270.0, directions = ["axial", "hoop"], first_x_m = 0.30, last_x_m = 1.10, count = 5 }},
]

[conditions]
mach_number = [5.0, 6.0]
angle_of_attack_deg = [-6.0, -3.0, 0.0, 3.0, 6.0]
sideslip_angle_deg = [-4.0, 0.0, 4.0]
altitude_km = 20.0

[aerodynamics]
engine = "newtonian"

[noise]
std_um_per_m = 0.5
gauge_position_mm = 0.0
gauge_orientation_deg = 0.0
layout_roll_deg = 0.0

[map]
case = 2
symmetry = "listed"
alarm_levels = "nominal"

[truth]
mach_number = [5.0, 5.3, 5.7, 6.0]
total_incidence_deg = [1.0, 3.0, 5.0, 7.0]
manoeuvre = "m.csv"
engine = "newtonian"
"""
RESOLUTION = """
[resolution.{name}]
radial_cells = 10
circumferential_cells = 14
surface_stations = 60
surface_roll_angles = 64
harmonics = 12
element_length_mm = 15.0
wall_layers = 1
"""


def write_files(folder: Path) -> None:
    """Write the three vehicle files and what they name."""
    for name, shape in (("profile", PROFILE), ("sections", SECTIONS), ("surface", SURFACE)):
        text = f'name = "cone by {name}"\n\n' + shape + REST
        text += "".join(RESOLUTION.format(name=one) for one in ("map", "truth"))
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    rows = [
        f"{x},{x * np.tan(radians(HALF_ANGLE)):.9f},{x * np.tan(radians(HALF_ANGLE)):.9f}" for x in (0.0, LENGTH)
    ]
    (folder / "sections.csv").write_text("x_m,half_width_m,half_height_m\n" + "\n".join(rows), encoding="utf-8")
    body = chain_segments([(LENGTH, radians(HALF_ANGLE), radians(HALF_ANGLE))])
    wall = Wall(thickness=0.004, solid_tip_length=TIP, material=Material(70e9, 0.33))
    triangles = mesh_of_grid(surface_grid(body, 60, 64))
    write_stl(folder / "body.stl", 1000.0 * triangles.point, triangles.triangle)
    for name, size in (("body", SweptResolution(0.03, 1, 32)), ("coarser", SweptResolution(0.04, 1, 24))):
        write_mesh(folder / f"{name}.vtu", full_mesh(swept_wall(body, wall, size)), with_surfaces=True)


def test_coefficients_from_the_same_strains_agree(tmp_path: Path) -> None:
    """Within the sigmas, and within 1 % of the range of the snapshots."""
    write_files(tmp_path)
    maps: dict[str, InverseMap] = {}
    strain, spread, pressure = np.empty(0), np.empty(0), np.empty(0)
    for name in ("profile", "sections", "surface"):
        vehicle = builder.load_vehicle(tmp_path / f"{name}.toml")
        snapshots, structure = builder.take_snapshots(vehicle), builder.solve_structure(vehicle)
        maps[name] = builder.build_map(vehicle, snapshots=snapshots, structure=structure)
        if name == "profile":  # the strains of all three
            chosen = slice(None, None, 2)
            net = (snapshots.pressure - snapshots.internal_pressure[:, None])[chosen]
            assert isinstance(structure, Structure)
            target = SurfaceMesh(structure.point, structure.triangle)
            operator = mapped_operator(structure.strain_operator, target, snapshots)[1]
            strain = net @ operator[np.array(structure.layout) == "rows"].T
            spread = np.ptp(snapshots.coefficients(), axis=0)
            pressure = np.array([one.dynamic_pressure for one in snapshots.conditions()])[chosen]
    strain = strain + 0.5e-6 * np.random.default_rng(1).standard_normal(strain.shape)
    found = {name: Estimator(one).estimate(strain, pressure) for name, one in maps.items()}
    for name in ("sections", "surface"):
        apart = np.abs(found[name].coefficients - found["profile"].coefficients)
        sigmas = (apart / found["profile"].coefficients_std).max(axis=0)
        share = apart.max(axis=0) / spread
        print(f"{name} against profile: largest difference {100 * share} % of the range, {sigmas} sigma")
        assert np.all(sigmas <= 1.0)
        assert np.all(share <= 0.01)
