"""Surface pressure from the local inclination to the free stream alone: modified Newtonian and Prandtl-Meyer.

The inclination delta is the angle between the free stream and the surface, pi/2 where it meets the surface square;
sin(delta) = -n . V/|V| with n outward. Windward (delta > 0): C_p = C_p,max sin^2(delta) (Lees). Leeward:

``ambient``
    p = p_inf in the shadow: Newton's own assumption.
``prandtl_meyer``
    For sharp bodies: isentropic expansion from the free stream by -delta.
``matched``
    For blunt bodies: modified Newtonian down to the inclination at which its pressure gradient along the surface
    equals the gradient of a Prandtl-Meyer expansion, from there Prandtl-Meyer with the stagnation pressure behind
    the normal shock, windward or leeward.

Pressure never falls below vacuum, C_p >= -2/(gamma M^2). Perfect gas, gamma = 1.4.

Tangent cones are another theory: the pressure is that on a cone of half angle delta without incidence.

Sources: L. Lees, "Hypersonic flow", Proc. 5th Int. Aeronautical Conf. (1955); NACA Report 1135, eqs. 44, 100 and
171c; L. G. Kaufman, "Pressure estimation techniques for hypersonic flows over blunt bodies", J. Astronaut. Sci. 10
(1963); M. L. Rasmussen, "On hypersonic flow past an unyawed cone", AIAA J. 5 (1967); J. D. Anderson, Hypersonic
and High-Temperature Gas Dynamics, ch. 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, sqrt

import numpy as np
from scipy.optimize import brentq

from builder.aero.euler.scheme.gas import GAMMA
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError

STAGNATION = ("rayleigh_pitot", "classical")
"""C_p,max: behind a normal shock, or Newton's 2."""
LEEWARD = ("ambient", "prandtl_meyer", "matched")

_EXPONENT = GAMMA / (GAMMA - 1.0)
_K = sqrt((GAMMA + 1.0) / (GAMMA - 1.0))
_NEWTON_STEPS = 50
_PEAK_MACH_NUMBER = 1.72
"""Beyond it the matching condition is met a second time, on the wrong side."""


def pitot_pressure_ratio(mach_number: float) -> float:
    """Return the stagnation pressure behind a normal shock over p_inf (Rayleigh; NACA 1135, eq. 100)."""
    square = mach_number**2
    isentropic = (0.5 * (GAMMA + 1.0) * square) ** _EXPONENT
    shock = ((GAMMA + 1.0) / (2.0 * GAMMA * square - (GAMMA - 1.0))) ** (1.0 / (GAMMA - 1.0))
    return float(isentropic * shock)


def largest_pressure_coefficient(mach_number: float, stagnation: str) -> float:
    """Return C_p,max of one of :data:`STAGNATION`."""
    if stagnation == "classical":
        return 2.0
    return (pitot_pressure_ratio(mach_number) - 1.0) / (0.5 * GAMMA * mach_number**2)


def prandtl_meyer_angle(inverse_mach_number: FloatArray) -> FloatArray:
    """Return nu [rad] at 1/M in 0..1; the inverse keeps expansion into vacuum, 1/M = 0, a number."""
    y = np.asarray(inverse_mach_number, dtype=float)
    root = np.sqrt(1.0 - y**2)
    angle: FloatArray = _K * np.arctan2(root, _K * y) - np.arctan2(root, y)
    return angle


def expanded_to_total(mach_number: float, turning: FloatArray) -> FloatArray:
    """Return p over total pressure after an isentropic turn away by ``turning`` (n,) [rad] from M.

    0 for turns at which the flow has expanded into vacuum. Newton's method on nu(1/M), which is convex and falls:
    from vacuum it approaches without overshoot.
    """
    target = prandtl_meyer_angle(np.array(1.0 / mach_number)) + turning
    y = np.zeros_like(target)
    for _ in range(_NEWTON_STEPS):
        error = np.maximum(prandtl_meyer_angle(y) - target, 0.0)
        # Slope of nu(y): -sqrt(1 - y^2)/(y^2 + (gamma - 1)/2).
        step = error * (y**2 + 0.5 * (GAMMA - 1.0)) / np.sqrt(1.0 - y**2)
        y = y + step
        if step.max(initial=0.0) < 1e-15:
            break
    ratio: FloatArray = (y**2 / (y**2 + 0.5 * (GAMMA - 1.0))) ** _EXPONENT
    return ratio


def _to_total(mach_number: float) -> float:
    return float((1.0 + 0.5 * (GAMMA - 1.0) * mach_number**2) ** -_EXPONENT)


@dataclass(frozen=True)
class MatchingPoint:
    """Where a Prandtl-Meyer expansion takes over from modified Newtonian flow.

    Attributes
    ----------
    mach_number : local Mach number there.
    inclination : of the surface there [rad].
    """

    mach_number: float
    inclination: float


def matching_point(mach_number: float) -> MatchingPoint:
    """Return the matching point at free-stream Mach number ``mach_number``.

    Along the surface modified Newtonian pressure p = p_0 (P + (1 - P) sin^2 delta), P = p_inf/p_0, falls with
    2 p_0 sqrt((Q - P)(1 - Q)) per angle at p = Q p_0, a Prandtl-Meyer expansion with gamma M^2/sqrt(M^2 - 1) p.
    Equal where P = Q (1 - gamma^2 M^4 Q/(4 (M^2 - 1)(1 - Q))), Q = p/p_0 of M isentropically (Kaufman's equation).

    Raises
    ------
    FlowReachError
        The Mach number is too low for the gradients to meet.
    """
    target = 1.0 / pitot_pressure_ratio(mach_number)

    def excess(mach: float) -> float:
        q = _to_total(mach)
        return q * (1.0 - GAMMA**2 * mach**4 * q / (4.0 * (mach**2 - 1.0) * (1.0 - q))) - target

    if excess(_PEAK_MACH_NUMBER) <= 0.0:
        raise FlowReachError(f"leeward: 'matched' has no matching point at Mach number {mach_number:g}")
    mach = float(brentq(excess, 1.0 + 1e-6, _PEAK_MACH_NUMBER, xtol=1e-14))
    sine = sqrt((_to_total(mach) - target) / (1.0 - target))
    return MatchingPoint(mach, asin(sine))


def inclination_pressure_ratio(
    mach_number: float, sine: FloatArray, stagnation: str = "rayleigh_pitot", leeward: str = "ambient"
) -> FloatArray:
    """Return p/p_inf (n,) at surface points inclined to the free stream by the sines ``sine`` (n,).

    Raises
    ------
    FlowReachError
        The free stream is not supersonic, or ``matched`` has no matching point.
    """
    if not mach_number > 1.0:
        raise FlowReachError(f"Mach number {mach_number:g} found, local inclination needs more than 1")
    largest = largest_pressure_coefficient(mach_number, stagnation)
    ratio: FloatArray = 1.0 + 0.5 * GAMMA * mach_number**2 * largest * np.maximum(sine, 0.0) ** 2
    inclination = np.arcsin(np.clip(sine, -1.0, 1.0))
    if leeward == "prandtl_meyer":
        away = sine < 0.0
        ratio[away] = expanded_to_total(mach_number, -inclination[away]) / _to_total(mach_number)
    elif leeward == "matched":
        match = matching_point(mach_number)
        away = inclination < match.inclination
        turning = match.inclination - inclination[away]
        ratio[away] = pitot_pressure_ratio(mach_number) * expanded_to_total(match.mach_number, turning)
    return ratio


def tangent_cone_pressure_ratio(mach_number: float, sine: FloatArray) -> FloatArray:
    """Return p/p_inf (n,) of tangent cones at points inclined by the sines ``sine`` (n,), Prandtl-Meyer leeward.

    C_p / sin^2(delta) = 1 + ((gamma + 1) K^2 + 2) / ((gamma - 1) K^2 + 2) ln((gamma + 1) / 2 + 1 / K^2) with
    K = M sin(delta) (Rasmussen), and not above the stagnation pressure behind a normal shock.

    Raises
    ------
    FlowReachError
        The free stream is not supersonic.
    """
    ratio = inclination_pressure_ratio(mach_number, sine, leeward="prandtl_meyer")
    windward = sine > 0.0
    square = (mach_number * sine[windward]) ** 2
    shape = ((GAMMA + 1.0) * square + 2.0) / ((GAMMA - 1.0) * square + 2.0)
    coefficient = sine[windward] ** 2 * (1.0 + shape * np.log(0.5 * (GAMMA + 1.0) + 1.0 / square))
    cone = 1.0 + 0.5 * GAMMA * mach_number**2 * coefficient
    ratio[windward] = np.minimum(cone, pitot_pressure_ratio(mach_number))
    return ratio
