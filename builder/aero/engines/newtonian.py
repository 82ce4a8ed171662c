"""Modified Newtonian flow as an engine: pressure from local inclination, for any shape, blunt or finned.

Options, as the vehicle file names them:

``stagnation``
    ``rayleigh_pitot`` (default): C_p,max behind a normal shock, 1.81 at M 5. ``classical``: C_p,max = 2. On
    slender pointed bodies both are too low at M 5 to 7, ``classical`` by less
    (``docs/explanation/aerodynamics.md``).
``leeward``
    ``ambient`` (default), ``prandtl_meyer`` (sharp bodies) or ``matched`` (blunt bodies).

Aft-facing nodes (normals within 30 deg of the axis) are the base: flow separates there, and they keep the ambient
pressure whatever ``leeward`` is. Not modelled: shadows of one part of the body on another (a fin behind a wider
body is loaded as if it were alone), interference of shocks, viscosity.

The pressure follows from the local inclination to the free stream alone. The inclination delta is the angle
between the free stream and the surface, pi/2 where it meets the surface square; sin(delta) = -n . V/|V| with n
outward. Windward (delta > 0): C_p = C_p,max sin^2(delta) (Lees). Leeward:

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

from collections.abc import Mapping
from dataclasses import dataclass
from math import asin, cos, degrees, radians, sin, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from builder.aero.engine import Flow, FlowKey
from builder.aero.euler.scheme.gas import GAMMA
from builder.aero.surface.edges import FEATURE_ANGLE, prepare_surface
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError, InputError
from strainfmu.flight_condition import FlightCondition

if TYPE_CHECKING:
    from builder.aero.deflections import Deflection

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


METHOD_VERSION = 1
"""Raised whenever results change, so that stored flows of an older version are solved again."""
BASE_ANGLE = radians(30.0)


@dataclass(frozen=True, eq=False)
class NewtonianEngine:
    """Pressure from the inclination of the nodes' normals to the free stream.

    Attributes
    ----------
    surface : nodes doubled at sharp edges, triangles facing outward (:func:`newtonian_engine` makes it so).
    stagnation : one of :data:`builder.aero.engines.newtonian.STAGNATION`.
    leeward : one of :data:`builder.aero.engines.newtonian.LEEWARD`.
    deflections : how the surface moves with each flow parameter, in the order of a condition's.

    Raises
    ------
    InputError
        An option is not one of these, or ``matched`` is requested without the stagnation pressure it starts from.
    """

    surface: SurfaceMesh
    stagnation: str = "rayleigh_pitot"
    leeward: str = "ambient"
    deflections: tuple[Deflection, ...] = ()

    def __post_init__(self) -> None:
        for name, value, allowed in (
            ("stagnation", self.stagnation, STAGNATION),
            ("leeward", self.leeward, LEEWARD),
        ):
            if value not in allowed:
                raise InputError(f"{name}: '{value}' found, must be one of {', '.join(allowed)}")
        if self.leeward == "matched" and self.stagnation != "rayleigh_pitot":
            raise InputError(f"stagnation: '{self.stagnation}' found, leeward 'matched' needs 'rayleigh_pitot'")

    @property
    def name(self) -> str:
        return "newtonian"

    def inputs(self) -> Mapping[str, Any]:
        return {
            "engine": self.name,
            "method_version": METHOD_VERSION,
            "surface": self.surface.digest(),
            "stagnation": self.stagnation,
            "leeward": self.leeward,
            **({"deflections": {d.name: d.digest() for d in self.deflections}} if self.deflections else {}),
        }

    def conditions(self) -> None:
        return None

    def flow_key(self, condition: FlightCondition) -> FlowKey:
        """Return (M, alpha [rad], beta [rad], flow parameters), rounded; altitude does not change p/p_inf."""
        values = (
            *(condition.mach_number, condition.angle_of_attack, condition.sideslip_angle),
            *condition.parameters[: len(self.deflections)],
        )
        return tuple(round(value, 9) for value in values)

    def solve(self, key: FlowKey) -> Flow:
        # Two numbers are Mach number and angle of attack, without sideslip.
        mach_number, angle_of_attack, sideslip = (*key, 0.0)[:3]
        wind = np.array(
            [cos(angle_of_attack) * cos(sideslip), -sin(sideslip), sin(angle_of_attack) * cos(sideslip)]
        )
        sine = -self._moved(key[3:]).node_normal @ wind
        if self.leeward == "matched":
            _check_blunt(mach_number, float(sine.max()))
        ratio = inclination_pressure_ratio(mach_number, sine, self.stagnation, self.leeward)
        base = self.surface.node_normal[:, 0] >= cos(BASE_ANGLE)
        return Flow(key=key, arrays={"pressure_ratio": np.where(base & (sine < 0.0), 1.0, ratio)})

    def _moved(self, parameters: tuple[float, ...]) -> SurfaceMesh:
        """Return the surface at values of the flow parameters; those that are not given leave it as it is."""
        shifts = [
            deflection.shift_at(value) for deflection, value in zip(self.deflections, parameters, strict=False)
        ]
        return SurfaceMesh(self.surface.point + sum(shifts), self.surface.triangle) if shifts else self.surface

    def pressure_ratio(self, flow: Flow, condition: FlightCondition) -> FloatArray:
        return flow.arrays["pressure_ratio"]


def newtonian_engine(
    mesh: SurfaceMesh, stagnation: str = "rayleigh_pitot", leeward: str = "ambient"
) -> tuple[NewtonianEngine, tuple[str, ...]]:
    """Return the engine of a surface from a file, and notes on what was changed on it.

    Raises
    ------
    InputError
        The surface is not closed but for its base (:func:`builder.aero.surface.edges.prepare_surface`), or an
        option is wrong.
    """
    surface, notes = prepare_surface(mesh, FEATURE_ANGLE)
    return NewtonianEngine(surface, stagnation, leeward), notes


def _check_blunt(mach_number: float, largest_sine: float) -> None:
    """Refuse ``matched`` where no part of the body is steep enough for it to start."""
    needed = matching_point(mach_number).inclination
    if largest_sine < sin(needed):
        raise FlowReachError(
            f"leeward: 'matched' needs a blunt nose, inclined by {degrees(needed):.3g} deg or more at Mach number"
            f" {mach_number:g}; the steepest node has {degrees(np.arcsin(max(largest_sine, 0.0))):.3g} deg:"
            " use 'prandtl_meyer'"
        )
