"""Forces and moments of a surface pressure: the rows of G C_map."""

from collections.abc import Iterable

import numpy as np

from builder.aero.surface.mesh import Surface, grid_of, mesh_load_operator, mesh_of
from builder.vehicle.shape.geometry import SurfaceGrid
from builder.vehicle.shape.shape_entries import ReferenceQuantities
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition

# Gauss-Legendre on 0..1: exact for the cubic integrands of linear pressure on a linear meridian.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_POINTS, _WEIGHTS = 0.5 * (_POINTS + 1.0), 0.5 * _WEIGHTS


def load_operator(grid: SurfaceGrid, moment_station: float, ahead_of: float = np.inf) -> FloatArray:
    """Return the loads per nodal pressure, (5, n_nodes) [m2, m2, m2, m3, m3].

    Rows: axial force F_x, normal force F_z, side force F_y, pitching moment (nose-up), yawing moment (nose
    to starboard) about the point (moment_station, 0, 0). F = integral of -p n dS with n outward (paper, eq. for
    q_coeff: G C_map); apply it to p - p_internal. Pressure is linear in x and trigonometric in roll; the
    meridian is linear between stations. With ``ahead_of`` [m]: of the part ahead of that station.
    """
    x, r = grid.x, grid.radius
    axial, lateral, moment = np.zeros(len(x)), np.zeros(len(x)), np.zeros(len(x))
    dx, dr = np.diff(x), np.diff(r)
    part = np.clip(np.divide(ahead_of - x[:-1], dx, out=np.ones_like(dx), where=dx > 0.0), 0.0, 1.0)
    part[(dx == 0.0) & (x[:-1] >= ahead_of)] = 0.0
    for point, share in zip(_POINTS, _WEIGHTS, strict=True):
        t, weight = part * point, part * share
        at_x, at_r = x[:-1] + t * dx, r[:-1] + t * dr
        for shape, shift in ((1.0 - t, 0), (t, 1)):
            k = np.arange(len(dx)) + shift
            np.add.at(axial, k, weight * shape * at_r * dr)
            np.add.at(lateral, k, -weight * shape * at_r * dx)
            # Pressure acts along the outward normal (-dr, dx): its arm about the moment point has both parts.
            np.add.at(moment, k, weight * shape * at_r * ((at_x - moment_station) * dx + at_r * dr))
    step = 2.0 * np.pi / grid.n_roll
    cosine, sine = np.cos(grid.roll_angle), np.sin(grid.roll_angle)
    around = np.ones(grid.n_roll)
    rows = [
        np.outer(axial, around),
        np.outer(lateral, cosine),
        np.outer(lateral, sine),
        np.outer(moment, cosine),
        np.outer(moment, sine),
    ]
    return step * np.stack([row.ravel() for row in rows])


def load_operator_on(surface: Surface, moment_station: float) -> FloatArray:
    """Return the loads per nodal pressure, (5, n) [m2, m2, m2, m3, m3], on a grid or on triangles."""
    grid = grid_of(surface)
    if grid is not None:
        return load_operator(grid, moment_station)
    return mesh_load_operator(mesh_of(surface), moment_station)


def coefficient_scale(dynamic_pressure: float, reference: ReferenceQuantities) -> FloatArray:
    """Return (5,) factors from loads [N, N m] to C_A, C_N, C_Y, M_P, M_Y at q_inf [Pa]."""
    force = 1.0 / (dynamic_pressure * reference.area)
    return force * np.array([1.0, 1.0, 1.0, 1.0 / reference.length, 1.0 / reference.length])


def coefficient_scales_at(conditions: Iterable[FlightCondition], reference: ReferenceQuantities) -> FloatArray:
    """Return (N, 5) factors from loads [N, N m] to coefficients, a row per flight condition."""
    return np.array([coefficient_scale(condition.dynamic_pressure, reference) for condition in conditions])


def coefficients_of(
    net_pressure: FloatArray,
    loads: FloatArray,
    conditions: Iterable[FlightCondition],
    reference: ReferenceQuantities,
) -> FloatArray:
    """Return (N, 5) C_A, C_N, C_Y, M_P, M_Y [1].

    Parameters
    ----------
    net_pressure : (N, n_p) p - p_internal [Pa].
    loads : (5, n_p) load operator [m2, m3].
    conditions : N flight conditions.
    reference : S and L.
    """
    coefficients: FloatArray = net_pressure @ loads.T * coefficient_scales_at(conditions, reference)
    return coefficients
