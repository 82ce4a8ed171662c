"""Strain of the gauges by inertia: of the wall, of covers and of masses, for every field of acceleration that is
linear in place.

Material at r moves against the specific force f + dw/dt x d + P d with d = r - r_0 from a unit at r_0 on the
axis, angular acceleration dw/dt and P = w w' - w'w 1 of the angular rates w. Its nodal forces are minus the mass
matrix times that field, which quadratic elements hold exactly; only harmonics 0, 1 and 2 occur. A body that
nothing holds is balanced by the inertia of its rigid motions, as under air loads: f and dw/dt strain nothing.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from builder.structure.fourier.fourier_elasticity import (
    FourierStiffness,
    HarmonicSolver,
    assemble_stiffness,
    factor_harmonic,
    rigid_motions,
    roll_integral,
)
from builder.structure.fourier.free_flight import FlyingSolver, inertia_matrix
from builder.structure.fourier.inner_surface import PlacedGauges
from builder.structure.fourier.meridian_mesh import MeridianMasses, MeridianMesh
from builder.structure.fourier.strain_operator import distinct_stations, station_index, strain_rows
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray

HARMONICS = 3
ITERATIONS = 12
BLIND = 1e-9
"""Strain of a mode over that across the other axis, below which no gauge sees it."""

N_RIGID, N_FIELDS = 5, 11
"""Fields of a rigid body without rates, and all: f along x, y, z [m/s2]; dw/dt about y, z [rad/s2]; P xx, yy, zz,
xy, xz, yz [rad2/s2]."""


def acceleration_fields(mesh: MeridianMesh, unit: float) -> FloatArray:
    """Return amplitudes (11, 2, 3, n_nodes, 3) at unit values; the unit is at the station ``unit`` [m].

    Axes: field, family, harmonic, node, component x, r, phi. In the first family x and r go as cos(m phi), phi as
    sin(m phi); in the second as sin(m phi) and -cos(m phi).
    """
    x, r = mesh.node.T
    d, one, none = x - unit, np.ones_like(x), np.zeros_like(x)

    def of(x_part: FloatArray, r_part: FloatArray, phi_part: FloatArray) -> FloatArray:
        return np.column_stack([x_part, r_part, phi_part])

    field = np.zeros((N_FIELDS, 2, HARMONICS, len(x), 3))
    field[0, 0, 0] = of(one, none, none)
    field[1, 1, 1] = of(none, one, -one)
    field[2, 0, 1] = of(none, one, -one)
    field[3, 0, 1] = of(r, -d, d)
    field[4, 1, 1] = of(-r, d, -d)
    field[5, 0, 0] = of(d, none, none)
    field[6, 0, 0] = field[7, 0, 0] = of(none, 0.5 * r, none)
    field[6, 0, 2] = of(none, -0.5 * r, 0.5 * r)
    field[7, 0, 2] = -field[6, 0, 2]
    field[8, 1, 1] = field[9, 0, 1] = of(r, d, -d)
    field[10, 1, 2] = of(none, r, -r)
    return field


def inertia_strain(
    mesh: MeridianMesh,
    material: Material,
    gauges: PlacedGauges,
    parts: Mapping[str, MeridianMasses],
    unit: float,
) -> dict[str, FloatArray]:
    """Return strain (n_d, 11) [m/m] of the gauges per unit field of acceleration, by the inertia of each part.

    Parameters
    ----------
    mesh : the wall with its support; in free flight with the masses that balance loads.
    material : of the wall.
    gauges : on the inner surface.
    parts : masses by name of the part.
    unit : station from which fields are linear [m].

    Raises
    ------
    InputError
        A mass lies outside the body.
    """
    stations = distinct_stations(gauges.x)
    stiffness, field = assemble_stiffness(mesh, material), acceleration_fields(mesh, unit)
    strain = {name: np.zeros((len(gauges.x), N_FIELDS)) for name in parts}
    for m in range(HARMONICS):
        rows = strain_rows(mesh, stations, m)
        adjoint = _solver(mesh, stiffness, m).solve(rows.reshape(-1, mesh.n_dof).T).T.reshape(rows.shape)
        for name, masses in parts.items():
            # Masses on the axis stay there under fields of the second harmonic.
            of_harmonic = masses if m < 2 else replace(masses, points=())
            inertia = inertia_matrix(replace(mesh, masses=of_harmonic), m)
            for family in range(2):
                force = -(inertia @ field[:, family, m].reshape(N_FIELDS, -1).T)
                strain[name] += _at_gauges(gauges, stations, adjoint @ force, m, family)
    return strain


def rigid_inertia(mesh: MeridianMesh, unit: float) -> FloatArray:
    """Return (5, 5) the mass matrix of the first five fields, a rigid body's but for roll [kg, kg m, kg m2]."""
    field = acceleration_fields(mesh, unit)[:N_RIGID]
    found = np.zeros((N_RIGID, N_RIGID))
    for m in range(2):
        inertia = roll_integral(m) * inertia_matrix(mesh, m)
        for family in range(2):
            rows = field[:, family, m].reshape(N_RIGID, -1)
            found += rows @ (inertia @ rows.T)
    return found


def bending_strain(
    mesh: MeridianMesh, material: Material, gauges: PlacedGauges, masses: MeridianMasses
) -> FloatArray:
    """Return strain (n_d, 2) of the gauges [1] by the first bending mode across y and across z.

    Each is over the strain of the gauge that it strains most; 0 of one that no gauge sees. The mode is found by
    iterations with the inverse of the stiffness: the next mode of a beam has at least 2.7 times its frequency, and
    decays by its square.
    """
    stiffness, inertia = assemble_stiffness(mesh, material), inertia_matrix(replace(mesh, masses=masses), 1)
    solver, stations = _solver(mesh, stiffness, 1), distinct_stations(gauges.x)
    rigid = rigid_motions(mesh, 1) if mesh.masses is not None else np.zeros((mesh.n_dof, 0))
    moved = inertia @ rigid
    of_rigid = rigid.T @ moved
    x = mesh.node[:, 0] / mesh.node[:, 0].max()
    mode = np.column_stack([np.zeros_like(x), x**2, -(x**2)]).reshape(-1, 1)
    for _ in range(ITERATIONS):
        force = inertia @ mode
        force = force - moved @ np.linalg.solve(of_rigid, rigid.T @ force)
        mode = solver.solve(force)
        mode = mode / np.sqrt((mode.T @ (inertia @ mode)).item())
    by_mode = strain_rows(mesh, stations, 1) @ mode
    strain = np.hstack([_at_gauges(gauges, stations, by_mode, 1, family) for family in (1, 0)])
    most = np.abs(strain).max(axis=0)
    is_seen = most > BLIND * most.max()
    return np.where(is_seen, strain, 0.0) / np.where(is_seen, most, 1.0)


def _solver(mesh: MeridianMesh, stiffness: FourierStiffness, m: int) -> HarmonicSolver | FlyingSolver:
    flies = m < 2 and mesh.masses is not None
    return FlyingSolver(mesh, stiffness, m) if flies else factor_harmonic(mesh, stiffness, m)


def _at_gauges(gauges: PlacedGauges, stations: FloatArray, strain: FloatArray, m: int, family: int) -> FloatArray:
    """Return (n_d, k) strain of the gauges by amplitudes ``strain`` (n, 3, k) of a harmonic at ``stations``."""
    phase = m * gauges.roll_angle[:, None]
    even, odd = (np.cos(phase), np.sin(phase)) if family == 0 else (np.sin(phase), -np.cos(phase))
    c, s = gauges.meridional[:, None], gauges.circumferential[:, None]
    meridional, hoop, shear = strain[station_index(stations, gauges.x)].transpose(1, 0, 2)
    return np.asarray(even * (c**2 * meridional + s**2 * hoop) + odd * 2.0 * c * s * shear)
