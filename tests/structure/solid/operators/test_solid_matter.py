"""Regions of several materials and masses that a mesh carries: closed forms, files, vehicle file."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from changed_vehicle import change
from solid_bodies import cube, swept_tube

from builder.structure.solid.case import structure_case
from builder.structure.solid.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.matter import Matter, PointMass, carried_inertia, free_flight
from builder.structure.solid.mesh_files import read_mesh, write_mesh
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from builder.structure.solid.strain_solution import solve_strain
from builder.structure.solid.supports import rigid_motions
from builder.structure.wall import Material
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

SOFT, STIFF = Material(70e9, 0.0), Material(210e9, 0.0)
POINTS = (
    PointMass(mass=7.0, position=(0.3, -0.02, 0.05), surface=SUPPORT),
    PointMass(mass=2.0, position=(-0.1, 0.0, 0.0), surface=EXTERNAL),
)


def bar() -> SolidMesh:
    """Unit cube of two regions that meet at x = 0.5 m, pressed at x = 0."""
    mesh = cube("hexahedron20", 2)
    sides = mesh.surface
    return replace(
        mesh,
        region=(mesh.node[mesh.element, 0].mean(axis=1) > 0.5).astype(np.int64),
        region_names=("front", "aft"),
        surface={EXTERNAL: sides["x0"], INTERNAL: sides["y0"], SUPPORT: sides["x1"]},
    )


def test_carried_masses_have_the_inertia_of_points() -> None:
    """R^T M R of what is carried is the sum of m R(p)^T R(p), whatever surface carries it."""
    mesh, centre = swept_tube(), np.array([0.4, -0.1, 0.2])
    found = rigid_motions(mesh.node, centre).T @ carried_inertia(
        mesh, Matter(material=SOFT, points=POINTS), centre
    )
    motion = [rigid_motions(np.array([one.position]), centre) for one in POINTS]
    expected = sum(one.mass * r.T @ r for one, r in zip(POINTS, motion, strict=True))
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_bar_of_two_metals_in_flight_carries_the_mass_behind() -> None:
    """Strain -a (mass behind)/(E A) with a = p A/m: a mass at the aft end, a cover on the front."""
    mesh, x = bar(), np.array([0.15, 0.35, 0.6, 0.9])
    rows = gauge_rows(
        mesh, gauges_at(np.column_stack([x, 0.0 * x, 0.5 + 0.0 * x]), np.tile([1.0, 0.0, 0.0], (4, 1)))
    )
    matter = Matter(
        material=STIFF,
        density=8000.0,
        of_region={"front": (SOFT, 2000.0)},
        points=(PointMass(mass=3000.0, position=(1.2, 0.5, 0.5), surface=SUPPORT),),
        covers=((0.0, 0.1, 500.0), (0.6, 0.9, 1e4)),  # the second covers nothing of the front
    )
    flight = free_flight(mesh, matter)
    assert flight.mass == pytest.approx(1000.0 + 4000.0 + 3000.0 + 500.0, rel=1e-12)
    assert flight.centre[0] == pytest.approx((250.0 + 3000.0 + 3600.0) / 8500.0, rel=1e-12)
    found = solve_strain(mesh, matter, None, rows, None).strain_operator.sum(axis=1) * 1e6
    behind = 3000.0 + np.where(x < 0.5, 4000.0 + 2000.0 * (0.5 - x), 8000.0 * (1.0 - x))
    young = np.where(x < 0.5, SOFT.youngs_modulus, STIFF.youngs_modulus)
    np.testing.assert_allclose(found, -1e6 / 8500.0 * behind / young, rtol=1e-9)


def test_regions_come_back_from_a_file(tmp_path: Path) -> None:
    """Also where the index of regions is 0 and 1 and looks like the mark of a group."""
    mesh = bar()
    write_mesh(tmp_path / "bar.vtu", mesh, with_surfaces=True)
    read = read_mesh(tmp_path / "bar.vtu")
    found = np.array(read.region_names)[read.region]
    np.testing.assert_array_equal(found, np.array(mesh.region_names)[mesh.region])


ENTRIES = """checked_by = "finned_body_check.vtu"
support = "free_flight"
mesh_materials = { Wall = "steel" }
point_masses = [{ x_m = 1.1, z_m = 0.02, mass_kg = 3.0, on = "support" }]
covers = [{ start_x_m = 0.5, end_x_m = 0.9, mass_kg_per_m2 = 2.0 }]
"""
STEEL = "[materials.steel]\nyoungs_modulus_GPa = 200.0\npoisson_ratio = 0.29\ndensity_kg_per_m3 = 7850.0\n"


def finned(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the shipped finned body in free flight, with a material and masses for its mesh."""
    for path in VEHICLES.glob("finned_body*"):
        shutil.copy(path, folder)
    own = ("poisson_ratio = 0.33\n", f"poisson_ratio = 0.33\ndensity_kg_per_m3 = 2700.0\n\n{STEEL}")
    path = folder / "finned_body.toml"
    change(path, ('checked_by = "finned_body_check.vtu"\n', ENTRIES), own, *changes)
    return path


def test_entries_of_the_vehicle_file(tmp_path: Path) -> None:
    case = structure_case(load_vehicle(finned(tmp_path)), ["body"])
    assert case.matter.materials(("wall",))["wall"].youngs_modulus == 200e9
    assert case.matter.densities(("wall",)) == {"wall": 7850.0}
    assert case.matter.points == (PointMass(mass=3.0, position=(1.1, 0.0, 0.02), surface="support"),)
    assert case.matter.covers == ((0.5, 0.9, 2.0),)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('"steel" }', '"brass" }'), "mesh_materials.Wall: expected one of [materials], steel, got 'brass'"),
        (("{ Wall", "{ fin"), "structure.mesh_materials: expected regions of the mesh, wall, got 'fin'"),
        (
            ('on = "support"', 'on = "tray"'),
            "point_masses.1.on: expected a surface of the mesh, external, internal",
        ),
        ((', on = "support"', ""), "point_masses.1.on: entry is missing, the surface of the mesh that carries it"),
        (("density_kg_per_m3 = 2700.0\n", ""), "'free_flight' needs material.density_kg_per_m3"),
        (("density_kg_per_m3 = 7850.0\n", ""), "'free_flight' needs materials.steel.density_kg_per_m3"),
        (('support = "free_flight"\n', ""), "point_masses: expected none with support 'clamped_aft'"),
    ],
)
def test_wrong_regions_and_masses_are_one_line(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = finned(tmp_path, change)
    with pytest.raises(InputError) as caught:
        structure_case(load_vehicle(path), ["body"])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_mesh_does_not_check_itself_under_another_name(tmp_path: Path) -> None:
    """Nor with its nodes and elements in another order; the difference would be 0, and be called the error."""
    path = finned(tmp_path)
    first = read_mesh(tmp_path / "finned_body.vtu")
    random = np.random.default_rng(1)
    order = random.permutation(first.n_nodes)
    number = np.argsort(order)
    shuffled = replace(
        first,
        node=first.node[order],
        element=number[first.element][random.permutation(len(first.element))],
        surface={name: number[facet] for name, facet in first.surface.items()},
    )
    write_mesh(tmp_path / "finned_body_check.vtu", shuffled, with_surfaces=True)
    line = rf"^structure.checked_by: expected another mesh than the first, got its {len(first.element)} elements"
    with pytest.raises(InputError, match=line):
        structure_case(load_vehicle(path), ["body"])
    moved = replace(shuffled, node=shuffled.node * [1.0, 1.0, 1.0 + 1e-9])
    write_mesh(tmp_path / "finned_body_check.vtu", moved, with_surfaces=True)
    structure_case(load_vehicle(path), ["body"])
