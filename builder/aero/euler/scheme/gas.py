"""Relations of a perfect gas with constant total enthalpy (non-dimensional, compiled).

Sources: NACA Report 1135 (oblique shock, Prandtl-Meyer); Anderson, Modern Compressible Flow, ch. 4, 9.
"""

import math

from builder.compiled import compiled, inlined
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO

GAMMA = HEAT_CAPACITY_RATIO

MIN_PRESSURE_RATIO = 1e-3
SLIGHT_TURN = 3e-4
"""Turn into the wall [rad] below which pressure follows from a series."""
VACUUM_ANGLE = 0.5 * math.pi * (math.sqrt((GAMMA + 1.0) / (GAMMA - 1.0)) - 1.0)
"""Largest Prandtl-Meyer angle [rad]: expansion into vacuum."""


@compiled
def total_enthalpy(mach_number: float) -> float:
    """Return the total enthalpy of the free stream (c_inf = 1)."""
    return 1.0 / (GAMMA - 1.0) + 0.5 * mach_number * mach_number


@inlined
def axial_velocity(pressure: float, density: float, v: float, w: float, enthalpy: float) -> float:
    """Return u from constant total enthalpy, or 0 where none is left for it."""
    square = 2.0 * (enthalpy - GAMMA / (GAMMA - 1.0) * (pressure / density)) - v * v - w * w
    return math.sqrt(max(square, 0.0))


@inlined
def is_supersonic(pressure: float, density: float, v: float, w: float, enthalpy: float) -> bool:
    """Return whether a state of constant total enthalpy has an axial velocity above its speed of sound."""
    # Times the density: no division.
    square = density * (2.0 * enthalpy - v * v - w * w) - 2.0 * GAMMA / (GAMMA - 1.0) * pressure
    return (pressure > 0.0) & (square > GAMMA * pressure)


@inlined
def primitive(
    mass: float, momentum: float, lateral_y: float, lateral_z: float, enthalpy: float
) -> tuple[float, float, float, float, float]:
    """Return (p, rho, u, v, w) of E = (mass, momentum, lateral_y, lateral_z).

    Total enthalpy makes u the larger root of a quadratic; where the axial Mach number falls to 1 the
    roots meet, and beyond there is no state: p = u = 0 is returned then.
    """
    per_mass = 1.0 / mass
    v = lateral_y * per_mass
    w = lateral_z * per_mass
    a = 0.5 * (GAMMA + 1.0) / (GAMMA - 1.0)
    b = GAMMA / (GAMMA - 1.0) * momentum * per_mass
    discriminant = b * b - 4.0 * a * (enthalpy - 0.5 * (v * v + w * w))
    u = (b + math.sqrt(max(discriminant, 0.0))) * (0.5 / a)
    exists = discriminant > 0.0
    return momentum - mass * u if exists else 0.0, mass / u, u if exists else 0.0, v, w


@compiled
def prandtl_meyer_angle(mach_number: float) -> float:
    """Return the Prandtl-Meyer angle nu(M) [rad]."""
    k = math.sqrt((GAMMA + 1.0) / (GAMMA - 1.0))
    root = math.sqrt(max(mach_number * mach_number - 1.0, 0.0))
    return k * math.atan(root / k) - math.atan(root)


@compiled
def expanded_pressure_ratio(mach_number: float, turning: float) -> float:
    """Return p2/p1 of an isentropic turn away by ``turning`` [rad] >= 0 (Newton on nu(M2)).

    A turn towards vacuum ends at ``MIN_PRESSURE_RATIO``: below it the pressure on the wall is negligible.
    """
    target = prandtl_meyer_angle(mach_number) + turning
    if target >= VACUUM_ANGLE:
        return MIN_PRESSURE_RATIO
    m, error = mach_number, turning
    for _ in range(30):
        slope = math.sqrt(max(m * m - 1.0, 1e-12)) / (m * (1.0 + 0.5 * (GAMMA - 1.0) * m * m))
        step = error / slope
        m = min(m + step, 10.0 * m)
        # The step after this one would be about its square.
        if abs(step) < 1e-7 * m:
            break
        error = target - prandtl_meyer_angle(m)
    before = 1.0 + 0.5 * (GAMMA - 1.0) * mach_number * mach_number
    after = 1.0 + 0.5 * (GAMMA - 1.0) * m * m
    return max((before / after) ** (GAMMA / (GAMMA - 1.0)), MIN_PRESSURE_RATIO)


@compiled
def compressed_pressure_ratio(mach_number: float, turning: float) -> float:
    """Return p2/p1 of the weak oblique shock that turns the flow by ``turning`` [rad] > 0; -1 if detached.

    Closed form for the shock angle: Anderson (2003), eqs. 4.19 to 4.21.
    """
    m2 = mach_number * mach_number
    tangent2 = math.tan(turning) ** 2
    a = 1.0 + 0.5 * (GAMMA - 1.0) * m2
    b = 1.0 + 0.5 * (GAMMA + 1.0) * m2
    argument = (m2 - 1.0) ** 2 - 3.0 * a * b * tangent2
    if argument <= 0.0:
        return -1.0
    scale = math.sqrt(argument)
    c = 1.0 + 0.25 * (GAMMA + 1.0) * m2 * m2 + 0.5 * (GAMMA - 1.0) * m2
    chi = ((m2 - 1.0) ** 3 - 9.0 * a * c * tangent2) / scale**3
    if chi < -1.0:
        return -1.0
    tan_shock = (m2 - 1.0 + 2.0 * scale * math.cos((4.0 * math.pi + math.acos(min(chi, 1.0))) / 3.0)) / (
        3.0 * a * math.tan(turning)
    )
    normal2 = m2 * tan_shock * tan_shock / (1.0 + tan_shock * tan_shock)
    return 1.0 + 2.0 * GAMMA / (GAMMA + 1.0) * (normal2 - 1.0)


@compiled
def wall_pressure(pressure: float, density: float, speed: float, outflow_angle: float) -> float:
    """Return the pressure after the flow is turned parallel to the wall.

    ``outflow_angle`` [rad] is the angle by which the flow leaves the wall: positive turns expand it back,
    negative ones compress it through a shock. Returns -1 where the shock would be detached.
    Source: Abbett, Boundary condition calculation procedures for inviscid supersonic flow (1973).
    """
    mach_number = speed / math.sqrt(GAMMA * pressure / density)
    if outflow_angle >= 0.0:
        return pressure * expanded_pressure_ratio(mach_number, outflow_angle)
    if outflow_angle > -SLIGHT_TURN and mach_number > 1.05:
        # Busemann's second-order series, which a shock differs from in third order: the closed form of the
        # shock loses its digits here.
        square = mach_number**2 - 1.0
        first = GAMMA * mach_number**2 / math.sqrt(square)
        second = 0.25 * GAMMA * mach_number**2 * ((GAMMA + 1.0) * mach_number**4 - 4.0 * square) / square**2
        return pressure * (1.0 - first * outflow_angle + second * outflow_angle**2)
    return pressure * compressed_pressure_ratio(mach_number, -outflow_angle)
