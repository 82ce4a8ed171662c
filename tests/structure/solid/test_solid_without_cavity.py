"""A body without a cavity, such as a wing: solved on its own mesh, or refused in a line that says why."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from changed_vehicle import replaced
from mapped_blocks import HEXAHEDRON, mapped_mesh, plane
from solid_bodies import swept_tube

from builder.reporting import Silent
from builder.structure.solid.case import structure_case
from builder.structure.solid.checks import check_solid_elements
from builder.structure.solid.mesh_checks import check_mesh
from builder.structure.solid.mesh_files import write_mesh
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from builder.structure.solid.solid_model import solve_solid_structure
from builder.vehicle.file import load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

YOUNG, POISSON = 70e9, 0.33
LENGTH, WIDTH, THICKNESS = 1.0, 0.16, 0.04
VEHICLE = f"""
name = "bar"
shape = {{ surface = "bar.stl", unit = "m", length_m = {LENGTH} }}
structure = {{ wall_thickness_mm = 40.0, model = "solid", mesh = "bar.vtu" }}
material = {{ youngs_modulus_GPa = 70.0, poisson_ratio = {POISSON} }}
reference = {{ area_m2 = 0.1, length_m = 1.0, moment_station_m = 0.5 }}
aerodynamics = {{ engine = "newtonian" }}
noise = {{ model = "paper", std_um_per_m = 1.0 }}
map = {{ case = 2, symmetry = "listed" }}

[conditions]
mach_number = [5.0]
angle_of_attack_deg = [0.0, 2.0]
sideslip_angle_deg = [0.0]
altitude_km = 20.0

[gauges]
layout = "skin"

[gauges.layouts.skin]
rows = [{{ roll_angle_deg = 0.0, directions = ["axial", "hoop"], x_m = [0.2, 0.5], surface = "outer" }}]
"""


def box(u: FloatArray, v: FloatArray, w: FloatArray) -> FloatArray:
    return np.column_stack([LENGTH * u, WIDTH * (v - 0.5), THICKNESS * (w - 0.5)])


@pytest.fixture(scope="module")
def bar() -> SolidMesh:
    """A bar along x of 20-node hexahedra, held at its aft end; every other face is external."""
    aft = plane(0, LENGTH)
    return mapped_mesh([(box, (8, 2, 1))], {EXTERNAL: lambda place: ~aft(place), SUPPORT: aft})


def vehicle_file(folder: Path, mesh: SolidMesh, *changes: tuple[str, str]) -> Path:
    path = folder / "bar.toml"
    path.write_text(replaced(VEHICLE, *changes))
    write_mesh(folder / "bar.vtu", mesh, with_surfaces=True)
    return path


def test_uniform_pressure_compresses_a_solid_body_alike(bar: SolidMesh, tmp_path: Path) -> None:
    """Hydrostatic: -p (1 - 2 nu)/E in every direction, away from the clamp, and with no pressure inside."""
    vehicle = load_vehicle(vehicle_file(tmp_path, bar))
    found = solve_solid_structure(structure_case(vehicle, ["skin"]), Silent())
    strain = found.strain_operator.sum(axis=1)
    np.testing.assert_allclose(strain, -(1.0 - 2.0 * POISSON) / YOUNG, rtol=0.01)
    assert found.settings["locking"] == {}


def test_gauges_of_a_solid_body_are_outside(bar: SolidMesh, tmp_path: Path) -> None:
    vehicle = load_vehicle(vehicle_file(tmp_path, bar, (', surface = "outer"', "")))
    message = r"gauges\.layouts\.skin\.rows\.1\.surface: expected 'outer' on a mesh without a cavity, got 'inner'"
    with pytest.raises(InputError, match=message):
        structure_case(vehicle, ["skin"])


def test_pressure_inside_needs_an_inside(bar: SolidMesh, tmp_path: Path) -> None:
    inside = ("wall_thickness_mm = 40.0", "wall_thickness_mm = 40.0, internal_pressure_Pa = 3000.0")
    vehicle = load_vehicle(vehicle_file(tmp_path, bar, inside))
    with pytest.raises(InputError, match=r"internal_pressure_Pa: expected 'ambient' with a mesh without a cavity"):
        structure_case(vehicle, ["skin"])


def test_forgotten_name_of_a_cavity_is_no_solid_body() -> None:
    tube = swept_tube()
    nameless = replace(tube, surface={name: facet for name, facet in tube.surface.items() if name != INTERNAL})
    with pytest.raises(InputError, match=r"no surface 'internal', and \d+ outer faces of elements are on none of"):
        check_mesh(nameless, hollow=False)
    with pytest.raises(InputError, match=r"a body without one is given by shape\.surface"):
        check_mesh(nameless)


def test_linear_elements_of_a_solid_body_are_refused() -> None:
    with pytest.raises(InputError, match="hexahedron8 of a body without a cavity bend too little"):
        check_solid_elements("hexahedron8")
    check_solid_elements("hexahedron8", allow_locking=True)
    check_solid_elements(HEXAHEDRON)
