"""Fourier models of a tube with gauges, for closed forms of beams, rings and thermoelasticity."""

import numpy as np

from builder.structure.fourier.inner_surface import PlacedGauges
from builder.structure.fourier.meridian_mesh import End, tube_mesh
from builder.structure.loads.applied import (
    Load,
)
from builder.structure.loads.fourier import FourierStructure, fourier_structure
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.wall import Material

E, NU = 110e9, 0.31
METAL = Material(E, NU)
RHO, ALPHA = 4430.0, 9e-6
LENGTH, A, B = 2.0, 0.096, 0.100
AREA, INERTIA = np.pi * (B**2 - A**2), np.pi * (B**4 - A**4) / 4.0
X, ROLL = np.array([0.7, 1.0, 1.3]), np.deg2rad([0.0, 60.0, 90.0, 200.0])
PROPERTIES = LoadProperties(density=RHO, expansion=ALPHA)


def gauges(x: np.ndarray, roll: np.ndarray) -> PlacedGauges:
    """Axial, hoop and +45 deg gauges at every station and roll angle: gauge = (station, roll angle, kind)."""
    grid = np.meshgrid(x, roll, np.deg2rad([0.0, 90.0, 45.0]), indexing="ij")
    station, phi, angle = (part.ravel() for part in grid)
    return PlacedGauges(x=station, roll_angle=phi, meridional=np.cos(angle), circumferential=np.sin(angle))


def tube(
    front: End = "free",
    aft: End = "clamped",
    a: float = A,
    b: float = B,
    length: float = LENGTH,
    size: float = 0.012,
) -> FourierStructure:
    mesh = tube_mesh(
        x=np.array([0.0, length]),
        inner_radius=np.array([a, a]),
        outer_radius=np.array([b, b]),
        element_length=size,
        n_layers=2,
        front=front,
        aft=aft,
    )
    return fourier_structure(mesh, METAL, gauges(0.5 * length * X, ROLL), PROPERTIES, max_harmonic=12)


def read(structure: FourierStructure, *loads: Load) -> np.ndarray:
    """Return (3, 4, 3) strain of station, roll angle, and axial, hoop and 45 deg gauge."""
    return gauge_strain(structure, loads).reshape(len(X), len(ROLL), 3)
