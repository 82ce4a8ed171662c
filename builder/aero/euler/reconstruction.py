"""From cell averages to states at faces (compiled).

Slopes are taken of p, rho and of the cross-flow velocity's cylindrical components less the free stream's: so
an axisymmetric flow stays axisymmetric and a uniform stream uniform. u follows from total enthalpy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from builder.aero.euler.compiled import compiled
from builder.aero.euler.gas import GAMMA, axial_velocity

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
State = tuple[float, float, float, float, float]
"""p, rho, u, v, w."""


@compiled
def limited(a: float, b: float) -> float:
    """Return the smaller of two differences, or 0 where they disagree in sign (minmod).

    Sharper limiters leave the bow shock, which lies along the grid, unsteady on the windward side at
    high Mach number (wall pressure +-1 %) and change C_N by less than 0.5 %.
    """
    if a * b <= 0.0:
        return 0.0
    return a if abs(a) < abs(b) else b


@compiled
def face_state(
    p: float,
    rho: float,
    radial: float,
    around: float,
    sine: float,
    cosine: float,
    cross_flow: float,
    enthalpy: float,
) -> State:
    """Return (p, rho, u, v, w) of the given values at a face whose ray has (sine, cosine)."""
    v = radial * sine + around * cosine
    w = radial * cosine - around * sine + cross_flow
    return p, rho, axial_velocity(p, rho, v, w, enthalpy), v, w


@compiled
def reconstruct(
    wave: FloatArray,
    j: int,
    i: int,
    half: FloatArray,
    side: float,
    sine: float,
    cosine: float,
    cross_flow: float,
    enthalpy: float,
    repairs: IntArray,
) -> State:
    """Return the state at a face: the values wave (4, :, :) of cell (j, i) plus ``side`` times half slopes (4,).

    Where that state has no supersonic axial flow left, the cell's own values serve, and ``repairs`` counts it.
    """
    p, rho, radial, around = wave[0, j, i], wave[1, j, i], wave[2, j, i], wave[3, j, i]
    state = face_state(
        p + side * half[0],
        rho + side * half[1],
        radial + side * half[2],
        around + side * half[3],
        sine,
        cosine,
        cross_flow,
        enthalpy,
    )
    if state[0] > 0.0 and state[2] * state[2] * state[1] > GAMMA * state[0]:
        return state
    repairs[0] += 1
    return face_state(p, rho, radial, around, sine, cosine, cross_flow, enthalpy)
