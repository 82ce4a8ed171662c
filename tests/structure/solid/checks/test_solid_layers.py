"""Elements through thick walls, and meshes that are not of the vehicle file's body."""

from dataclasses import replace

import numpy as np
import pytest

from builder.reporting import Silent
from builder.structure.solid.case import SolidCase, case_of_body
from builder.structure.solid.checks import WARN_BELOW, fourier_reference_strain, largest_amplitude, layers_needed
from builder.structure.solid.gauge_rows import gauges_at
from builder.structure.solid.mesh_checks import mesh_misfits
from builder.structure.solid.mesh_choice import MeshChoice, make_mesh
from builder.structure.solid.solid_mesh import SUPPORT, SolidMesh
from builder.structure.solid.solid_model import solve_solid_structure
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import full_mesh, swept_wall
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import chain_segments

METAL = Material(110e9, 0.31)
BODY = chain_segments([(0.5, np.radians(20.0), np.radians(20.0)), (1.0, 0.0, 0.0)])
THICK, THIN = Wall(0.05, 0.3, METAL), Wall(0.004, 0.1, METAL)
"""Of the cylinder of radius 182 mm behind the cone."""


@pytest.mark.fast
def test_layers_follow_the_wall() -> None:
    """One through thin walls; through 50 mm as many as the locking check needs, more at smaller radii."""
    assert layers_needed(THIN, np.array([0.03, 0.18]), n_sectors=32) == 1
    assert layers_needed(THICK, np.array([0.5]), n_sectors=32) == 1
    assert layers_needed(THICK, np.array([0.18]), n_sectors=32) == 2
    assert layers_needed(THICK, np.array([0.10, 0.18]), n_sectors=32) == 4
    assert layers_needed(THICK, np.array([0.18]), n_sectors=32, fewest=3) == 3


def thick_case(mesh: MeshChoice) -> SolidCase:
    """The body with a wall of 50 mm and hoop gauges inside, on the cylinder and on the cone."""
    roll, x, angle = np.radians([0.0, 45.0, 0.0]), np.array([0.7, 0.7, 0.45]), BODY.angle(np.array([0.45]))[0]
    inside = BODY.radius(x) - THICK.thickness / np.cos([0.0, 0.0, angle])
    position = np.column_stack([x, inside * np.sin(roll), inside * np.cos(roll)])
    gauges = gauges_at(position, np.column_stack([0.0 * x, np.cos(roll), -np.sin(roll)]))
    return case_of_body(
        vehicle="thick wall",
        body=BODY,
        wall=THICK,
        density=None,
        support=Clamped(SUPPORT),
        mesh=mesh,
        layouts={"hoop": gauges},
    )


def test_thick_wall_against_the_fourier_model() -> None:
    """Largest error of a gauge's strain over harmonics 0 to 4. Found: 2.6 % with one layer, 0.2 % with two.

    Two solid models and the Fourier model beside each take the seconds.
    """
    cases = {layers: thick_case(MeshChoice(resolution="coarse", layers=layers)) for layers in (1, 2)}
    strain = largest_amplitude(fourier_reference_strain(BODY, THICK, list(cases[1].layouts.values())))
    error = {}
    for layers, case in cases.items():
        found = solve_solid_structure(case, Silent())
        error[layers] = float((found.mesh_error / strain).max())
        assert (min(found.settings["locking"].values()) >= WARN_BELOW) == (layers == 2)
    assert error[1] > 0.02
    assert error[2] < 0.005


@pytest.mark.fast
def test_layers_are_of_the_mesh_and_its_record() -> None:
    for layers, expected in ((None, 1), (2, 2)):
        choice = MeshChoice(resolution="coarse", layers=layers)
        assert choice.inputs()["layers"] == expected
        sector = make_mesh(BODY, THICK, choice)
        assert len(sector.surface[SUPPORT]) == expected


@pytest.fixture(scope="module")
def mesh() -> SolidMesh:
    """The thin wall as a mesh that could have come from a file."""
    return full_mesh(swept_wall(BODY, THIN, "coarse"))


@pytest.mark.fast
def test_a_mesh_of_the_vehicle_fits(mesh: SolidMesh) -> None:
    assert mesh_misfits(mesh, BODY, THIN) == []
    # Within what meshers leave: 1 % of the wall.
    assert mesh_misfits(mesh, BODY, replace(THIN, thickness=0.00404)) == []


@pytest.mark.fast
@pytest.mark.parametrize(
    ("scale", "thickness", "words"),
    [
        ((1.0, 1.0, 1.0), 0.005, "wall thickness of the mesh: expected 5 mm, got 4 mm"),
        ((1.0, 1.0, 1.0), 0.0039, "wall thickness of the mesh: expected 3.9 mm, got 4 mm"),
        ((1.01, 1.0, 1.0), 0.004, "length of the mesh: expected 1 m, got 1.01 m"),
        (
            (1.0, 1.015, 1.015),
            0.004,
            "outer radius of the mesh at x = 0.5 m: expected 182 mm, got 184.7 mm",
        ),
    ],
)
def test_what_of_a_mesh_is_not_the_vehicles(
    mesh: SolidMesh, scale: tuple[float, float, float], thickness: float, words: str
) -> None:
    other = replace(mesh, node=mesh.node * scale)
    found = mesh_misfits(other, BODY, replace(THIN, thickness=thickness))
    assert list(map(str, found)) == [words]
