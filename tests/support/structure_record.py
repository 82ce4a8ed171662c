"""A small structure to show: a cylinder whose gauges weigh pressure by known functions."""

import numpy as np

from builder.aero.surface.mesh import mesh_of_grid
from builder.structure.structure_file import Structure
from builder.vehicle.shape.geometry import SurfaceGrid

STATIONS, ROLL_ANGLES = 41, 24
LENGTH, RADIUS = 2.0, 0.1

NAMES = ("axial_0", "axial_90", "hoop_0", "hoop_45", "slanted [45]", "axial_0", "hoop_180")
LAYOUTS = ("first", "first", "first", "first", "first", "second", "second")
ROLL_DEG = (0.0, 90.0, 0.0, 45.0, 200.0, 0.0, 180.0)
PLACE = (0.5, 0.5, 1.0, 1.0, 1.5, 0.5, 1.0)
ANGLE_DEG = (0.0, 0.0, 90.0, 90.0, 45.0, 0.0, 90.0)
LENGTHS = (0.0, 0.0, 0.003, 0.003, 0.0, 0.0, 0.0)


def small_structure() -> Structure:
    """Gauge i weighs pressure with (1 + cos(phi - phi_i) + cos(2 (phi - phi_i))) 1e-9/(Pa m2), alike along x.

    Gauges at 0, 90 and 180 deg are blind to sin(2 phi); the one at 45 deg and the slanted one are not.
    """
    x = np.linspace(0.0, LENGTH, STATIONS)
    mesh = mesh_of_grid(
        SurfaceGrid(x=x, radius=np.full(STATIONS, RADIUS), angle=np.zeros(STATIONS), n_roll=ROLL_ANGLES)
    )
    roll, angle = np.radians(ROLL_DEG), np.radians(ANGLE_DEG)
    away = np.arctan2(mesh.point[:, 1], mesh.point[:, 2]) - roll[:, None]
    across = np.stack([np.zeros(7), np.cos(roll), -np.sin(roll)], axis=1)
    return Structure(
        vehicle="cylinder",
        model="imported",
        settings={
            "support": {"kind": "clamped", "surface": "support"},
            "locking": {"0": 1.0, "2": 0.9991},
            "mesh_report": [["elements, tetrahedron10", 1234, ""], ["volume", 0.25, "m3"]],
            "made_from": {"mesh": "fingerprint of the mesh"},
        },
        statistics={"elements": 1234, "degrees_of_freedom": 9876, "solver": "superlu", "licence": "BSD-3-Clause"},
        gauge_names=NAMES,
        layout=LAYOUTS,
        gauge_position=np.stack([PLACE, RADIUS * np.sin(roll), RADIUS * np.cos(roll)], axis=1),
        gauge_direction=np.cos(angle)[:, None] * [1.0, 0.0, 0.0] + np.sin(angle)[:, None] * across,
        gauge_length=np.array(LENGTHS),
        gauge_surface=("external",) * 7,
        point=mesh.point,
        triangle=mesh.triangle,
        normal=mesh.node_normal,
        strain_operator=1e-9 * (1.0 + np.cos(away) + np.cos(2.0 * away)) * mesh.node_area,
        mesh_error=np.full(7, 2.5e-12),
    )
