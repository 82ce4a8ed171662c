"""An imported mesh of two materials that carries point masses, in free flight, against CalculiX."""

from dataclasses import replace
from pathlib import Path

import calculix_deck as calculix
import numpy as np
import pytest

from builder.structure.solid.checks import ring_mesh
from builder.structure.solid.elements import FACE_CORNERS
from builder.structure.solid.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.matter import Matter, PointMass, free_flight
from builder.structure.solid.mesh_files import read_mesh, write_mesh
from builder.structure.solid.nodal_loads import pressure_load, split_surface
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from builder.structure.solid.strain_solution import solve_strain
from builder.structure.wall import Material

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not calculix.installed(), reason="needs CalculiX: apt-get install calculix-ccx"),
]

LENGTH, INSIDE, OUTSIDE = 0.8, 0.09, 0.10
TITANIUM, STEEL = (Material(110e9, 0.31), 4430.0), (Material(200e9, 0.29), 7850.0)
STATIONS, ROLLS = (0.15, 0.2, 0.45, 0.55, 0.65), np.deg2rad([0.0, 90.0, 225.0])
"""Away from x = 0.32 m, where the material changes and CalculiX averages the strain of both sides."""
MATTER = Matter(
    material=STEEL[0],
    density=STEEL[1],
    of_region={"front": TITANIUM},
    points=(
        PointMass(mass=12.0, position=(0.85, 0.02, -0.03), surface=SUPPORT),
        PointMass(mass=5.0, position=(-0.05, 0.0, 0.04), surface="front_ring"),
    ),
)
STEP = 1.0
"""Time step of CalculiX [s], thousands of periods of the body."""


def body(path: Path) -> SolidMesh:
    """Return an open cone of two regions, read from a file."""
    tube = ring_mesh("hexahedron20", INSIDE, OUTSIDE, LENGTH, (30, 48, 2))
    x = tube.node[:, 0] - tube.node[:, 0].min()
    shrunk = (0.6 + 0.4 * x / LENGTH)[:, None] * tube.node[:, 1:]
    middle = x[tube.element].mean(axis=1)
    surface = {"front_ring" if name == "front" else name: facet for name, facet in tube.surface.items()}
    mesh = replace(
        tube,
        node=np.column_stack([x, shrunk]),
        region=(middle > 0.4 * LENGTH).astype(np.int64),
        region_names=("front", "aft"),
        surface=surface,
    )
    write_mesh(path, mesh, with_surfaces=True)
    return read_mesh(path, length=LENGTH)


def test_strain_under_inertia_relief(tmp_path: Path) -> None:
    """Gauges on nodes: accelerations within 1e-6, strain within 0.5 % of its root mean square."""
    mesh = body(tmp_path / "body.vtu")
    corner = np.unique(mesh.surface[INTERNAL][:, : FACE_CORNERS[mesh.element_type]])
    x, y, z = mesh.node[corner].T
    around = np.mod(np.arctan2(y, z), 2.0 * np.pi)
    node, direction = [], []
    for station in STATIONS:
        for roll in ROLLS:
            turn = np.abs(np.angle(np.exp(1j * (around - roll))))
            found = corner[np.argmin(np.abs(x - station) + turn)]
            p = mesh.node[found]
            along = np.array([1.0, *(0.4 / LENGTH * INSIDE * p[1:] / np.hypot(*p[1:]))])
            node += [found, found]
            direction += [along / np.linalg.norm(along), np.array([0.0, p[2], -p[1]]) / np.hypot(*p[1:])]
    rows = gauge_rows(mesh, gauges_at(mesh.node[node], np.array(direction)))
    surface, column = split_surface(mesh, EXTERNAL)
    point = surface.point
    phi = np.arctan2(point[:, 1], point[:, 2])
    pressure = 1e5 * (1.0 + point[:, 0]) * (1.0 + 0.5 * np.cos(phi) + 0.3 * np.sin(phi) + 0.2 * np.cos(2.0 * phi))
    ours = solve_strain(mesh, MATTER, None, rows, None).strain_operator @ pressure
    force = (pressure_load(mesh, EXTERNAL, column) @ pressure).reshape(-1, 3)
    calculix.run(tmp_path, calculix.free_flight_deck(mesh, MATTER, force, STEP, "C3D20R"))
    flight = free_flight(mesh, MATTER)
    moved = (flight.rigid @ flight.accelerations(force.reshape(-1, 1))).reshape(-1, 3) * STEP**2 / 4.0
    shift = calculix.printed_displacement(tmp_path, mesh.n_nodes) - moved
    assert np.linalg.norm(shift) < 1e-6 * np.linalg.norm(moved)
    tensor = calculix.nodal_strain(tmp_path, mesh.n_nodes)[node]
    theirs = np.einsum("gi,gij,gj->g", direction, tensor, direction)
    print(f"strain differs by {np.linalg.norm(ours - theirs) / np.linalg.norm(theirs):.2%} rms")
    without = solve_strain(mesh, replace(MATTER, points=()), None, rows, None).strain_operator @ pressure
    assert np.linalg.norm(ours - theirs) < 5e-3 * np.linalg.norm(theirs)
    assert np.linalg.norm(without - theirs) > 0.1 * np.linalg.norm(theirs)
