"""Reconstruction of states at faces from cell averages (compiled).

Slopes are taken of p, rho and of the cross-flow velocity's cylindrical components less the free stream's: so
an axisymmetric flow stays axisymmetric and a uniform stream uniform. u follows from total enthalpy.
"""

from typing import NamedTuple

import numpy as np

from builder.aero.euler.scheme.gas import GAMMA, axial_velocity, is_supersonic
from builder.compiled import compiled, inlined
from strainfmu.arrays import FloatArray

State = tuple[float, float, float, float, float]
"""p, rho, u, v, w."""

Ray = tuple[float, float]
"""Sine and cosine of a roll angle."""


class Stream(NamedTuple):
    """The free stream: velocity along x, y, z and total enthalpy (c_inf = 1)."""

    u: float
    v: float
    w: float
    enthalpy: float


@inlined
def limited(a: float, b: float) -> float:
    """Return the smaller of two differences, or 0 where they disagree in sign (minmod)."""
    if a * b <= 0.0:
        return 0.0
    return a if abs(a) < abs(b) else b


@inlined
def smooth_mean(a: float, b: float, slight: float) -> float:
    """Return the mean of two differences, weighted towards the smaller one (van Albada, van Leer, Roberts 1982).

    Differences whose square is below ``slight`` are averaged plainly: smooth extrema are not clipped, and the
    scheme is a differentiable function of its data there, so that it settles.
    """
    weight_a, weight_b = b * b + slight, a * a + slight
    return (weight_a * a + weight_b * b) / (weight_a + weight_b)


@inlined
def slight_differences(p: FloatArray, rho: FloatArray, cell_size: float, slight: FloatArray) -> None:
    """Fill slight (4, n_r) with the squares of the differences of ``wave`` that pass for smooth at p, rho (n_r,).

    ``cell_size`` h is the cell's fraction of the layer, or its angle: the threshold h^1.5 (Venkatakrishnan, J.
    Comput. Phys. 118, 1995) lies above the h^2 of a smooth extremum and below the jump of a shock.
    """
    cube = cell_size * cell_size * cell_size
    for i in range(p.size):
        slight[0, i] = cube * p[i] * p[i]
        slight[1, i] = cube * rho[i] * rho[i]
        slight[2, i] = slight[3, i] = cube * GAMMA * p[i] / rho[i]


@compiled
def radial_slopes(wave: FloatArray, half: FloatArray) -> None:
    """Fill half (4, n_phi, n_r) with half the differences of ``wave`` over each cell outward.

    The first cell takes the smaller of the next two differences; the last, which ends at the shock, none.
    """
    n_phi, n_r = half.shape[1], half.shape[2]
    slight = np.empty((4, n_r))
    for j in range(n_phi):
        slight_differences(wave[0, j + 1], wave[1, j + 1], 1.0 / n_r, slight)
        for k in range(4):
            row = wave[k, j + 1]
            for i in range(1, n_r - 1):
                half[k, j, i] = 0.5 * smooth_mean(row[i] - row[i - 1], row[i + 1] - row[i], slight[k, i])
            half[k, j, 0] = 0.5 * limited(row[1] - row[0], row[2] - row[1])
            half[k, j, n_r - 1] = 0.0


@compiled
def circumferential_slopes(wave: FloatArray, step: float, half: FloatArray) -> None:
    """Fill half (4, n_phi, n_r) with half the differences of ``wave`` over each cell in roll angle."""
    n_phi, n_r = half.shape[1], half.shape[2]
    slight = np.empty((4, n_r))
    for j in range(n_phi):
        slight_differences(wave[0, j + 1], wave[1, j + 1], step, slight)
        for k in range(4):
            before, centre, after = wave[k, j], wave[k, j + 1], wave[k, j + 2]
            for i in range(n_r):
                half[k, j, i] = 0.5 * smooth_mean(centre[i] - before[i], after[i] - centre[i], slight[k, i])


@inlined
def lateral(radial: float, around: float, ray: Ray, stream: Stream) -> tuple[float, float]:
    """Return v, w of cylindrical components relative to the free stream on ``ray``."""
    sine, cosine = ray
    return radial * sine + around * cosine + stream.v, radial * cosine - around * sine + stream.w


@inlined
def face_state(p: float, rho: float, radial: float, around: float, ray: Ray, stream: Stream) -> State:
    """Return (p, rho, u, v, w) of the given values at a face on ``ray``."""
    v, w = lateral(radial, around, ray, stream)
    return p, rho, axial_velocity(p, rho, v, w, stream.enthalpy), v, w


@inlined
def reconstruct(
    wave: FloatArray, half: FloatArray, j: int, i: int, side: float, ray: Ray, stream: Stream
) -> tuple[State, int]:
    """Return the state at a face of cell (j, i): its values plus ``side`` times half its differences.

    Where that state has no supersonic axial flow left, the cell's own values serve, and 1 is returned with it.
    """
    p, rho, radial, around = wave[0, j + 1, i], wave[1, j + 1, i], wave[2, j + 1, i], wave[3, j + 1, i]
    dp, drho = side * half[0, j, i], side * half[1, j, i]
    dradial, daround = side * half[2, j, i], side * half[3, j, i]
    v, w = lateral(radial + dradial, around + daround, ray, stream)
    fit = is_supersonic(p + dp, rho + drho, v, w, stream.enthalpy)
    share = 1.0 if fit else 0.0
    return face_state(
        p + share * dp, rho + share * drho, radial + share * dradial, around + share * daround, ray, stream
    ), 0 if fit else 1
