"""Known loads on the three-dimensional model against CalculiX's own loads: point force, weight, temperature."""

from pathlib import Path

import calculix_deck as calculix
import numpy as np
import pytest

from builder.structure.loads.applied import Load, PointForce, Weight
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.loads.solid import solid_structure
from builder.structure.loads.temperature import temperature_mode
from builder.structure.solid.checks import ring_mesh
from builder.structure.solid.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.solid_mesh import EXTERNAL, SUPPORT
from builder.structure.solid.supports import Clamped
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray

pytestmark = pytest.mark.skipif(not calculix.installed(), reason="needs CalculiX: apt-get install calculix-ccx")

METAL = Material(110e9, 0.31)
LENGTH, INSIDE, OUTSIDE = 0.5, 0.092, 0.100
RHO, ALPHA = 4430.0, 9e-6
MESH = ring_mesh("hexahedron20", INSIDE, OUTSIDE, LENGTH, (14, 24, 1))
FORCE = np.array([200.0, -300.0, 500.0])


def a_node() -> int:
    """Return a node of the outer surface near x = 0.15 m, roll angle 40 deg."""
    node = np.unique(MESH.surface[EXTERNAL])
    aim = np.array([MESH.node[:, 0].min() + 0.15, OUTSIDE * np.sin(0.7), OUTSIDE * np.cos(0.7)])
    return int(node[np.linalg.norm(MESH.node[node] - aim, axis=1).argmin()])


def field(node: FloatArray) -> FloatArray:
    """Return the temperature [K]: 30 to 60 K along the body, 10 % more outside than inside, times cos(phi - 1)."""
    x, y, z = node.T
    depth = (np.hypot(y, z) - INSIDE) / (OUTSIDE - INSIDE)
    start = MESH.node[:, 0].min()
    return (30.0 + 60.0 * (x - start)) * (0.95 + 0.1 * depth) * np.cos(np.arctan2(y, z) - 1.0)


def case(name: str) -> tuple[Load, str, str, np.ndarray | None]:
    """Return the load, CalculiX's further lines of the material and of the step, and its nodal forces."""
    x, y, z = MESH.node[a_node()]
    start = MESH.node[:, 0].min()
    if name == "point force":
        force = np.zeros((MESH.n_nodes, 3))
        force[a_node()] = FORCE
        return PointForce(station=x, roll_angle=float(np.arctan2(y, z)), force=tuple(FORCE)), "", "", force
    if name == "weight":
        # Nose up by 30 deg, +y up.
        c, s = np.cos(0.5), np.sin(0.5)
        load = Weight(up_roll_angle=0.5 * np.pi, nose_elevation=0.5, gravity=1e4)
        return load, f"*DENSITY\n{RHO}\n", f"*DLOAD\nEALL,GRAV,1e4,{s:.12f},{-c:.12f},0.\n", None
    ends = np.array([start, start + LENGTH])
    middle = 30.0 + 60.0 * (ends - start)
    mode = temperature_mode(ends, middle, harmonic=1, roll_angle=1.0, through_wall=0.1 * middle)
    lines = "".join(f"{i},{value:.12e}\n" for i, value in enumerate(field(MESH.node), 1))
    expansion = f"*EXPANSION, ZERO=0.\n{ALPHA}\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNALL,0.\n"
    return mode, expansion, f"*TEMPERATURE\n{lines}", None


@pytest.mark.parametrize("name", ["point force", "weight", "temperature"])
def test_gauges_read_what_calculix_moves(name: str, tmp_path: Path) -> None:
    """Strain of our gauge rows on CalculiX's displacement: 1e-4 of the largest."""
    load, of_material, of_step, force = case(name)
    middle = MESH.node[:, 0].min() + np.array([0.22, 0.3])
    position, direction = [], []
    for x in middle:
        for phi in (0.1, 1.3, 4.0):
            position += [[x, INSIDE * np.sin(phi), INSIDE * np.cos(phi)]] * 2
            direction += [[1.0, 0.0, 0.0], [0.0, np.cos(phi), -np.sin(phi)]]
    gauges = gauges_at(np.array(position), np.array(direction))
    properties = LoadProperties(density=RHO, expansion=ALPHA)
    ours = gauge_strain(solid_structure(MESH, METAL, gauges, [Clamped(SUPPORT)], properties), [load])
    text = calculix.deck(MESH, METAL, np.unique(MESH.surface[SUPPORT]), force, None)
    # Material lines that are none of the material, as initial conditions, may follow it.
    text = text.replace("*SOLID SECTION", of_material.split("*INITIAL")[0] + "*SOLID SECTION")
    if "*INITIAL" in of_material:
        text = text.replace("*BOUNDARY", "*INITIAL" + of_material.split("*INITIAL")[1] + "*BOUNDARY")
    text = text.replace("*NODE PRINT", of_step + "*NODE PRINT")
    calculix.run(tmp_path, text)
    theirs = gauge_rows(MESH, gauges) @ calculix.printed_displacement(tmp_path, MESH.n_nodes).ravel()
    np.testing.assert_allclose(ours, theirs, atol=1e-4 * np.abs(theirs).max())
