"""Cones that differ a little from a circular one: conical flow linearised about Taylor and Maccoll's.

The shock is fitted. The surface is theta = theta_c + e cos(n phi) in spherical angles about the axis. With n = 1
it is a circular cone at the incidence e (Stone, J. Math. Phys. 27, 1948), with n = 2 a slightly elliptic one
(Ferri, Ness and Kaplita, J. Aero. Sci. 20, 1953). Entropy is that behind the shock on every ray; the layer at the
wall where it changes has no thickness.
"""

from math import cos, sin, tan

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

GAMMA = 1.4


def behind(angle: float, mach_number: float) -> np.ndarray:
    """Return u/a_inf, v/a_inf, p/(gamma p_inf), rho/rho_inf and their ln(p/rho^gamma) behind a shock [rad]."""
    normal = mach_number * sin(angle)
    density = 6.0 * normal**2 / (5.0 + normal**2)
    pressure = (1.0 + 7.0 / 6.0 * (normal**2 - 1.0)) / GAMMA
    entropy = np.log(pressure) - GAMMA * np.log(density)
    return np.array([mach_number * cos(angle), -normal / density, pressure, density, entropy])


def wall_response(half_angle: float, mach_number: float, n: int) -> tuple[float, float]:
    """Return Cp on the circular cone, and d Cp / d e along phi = 0 for the surface theta_c + e cos(n phi)."""
    enthalpy = 1.0 / (GAMMA - 1.0) + 0.5 * mach_number**2

    def base(angle: float, u: float, v: float) -> tuple[float, float, float]:
        """Return V', a^2 and its derivative of the flow over the circular cone."""
        sound2 = (GAMMA - 1.0) * (enthalpy - 0.5 * (u * u + v * v))
        slope = (u * v * v - sound2 * (2.0 * u + v / tan(angle))) / (sound2 - v * v)
        return slope, sound2, -(GAMMA - 1.0) * (u * v + v * slope)

    def density(sound2: float, entropy: float) -> float:
        return float((sound2 / GAMMA * np.exp(-entropy)) ** (1.0 / (GAMMA - 1.0)))

    def shock_state(shock: float) -> tuple[np.ndarray, float]:
        """Return u, v, u1, v1, sin(theta) w1 and entropy perturbation behind a shock moved by cos(n phi)."""
        step = 1e-5
        at = behind(shock, mach_number)
        rate = (behind(shock + step, mach_number) - behind(shock - step, mach_number)) / (2.0 * step)
        slope, _, _ = base(shock, at[0], at[1])
        across = n * (at[1] + mach_number * sin(shock))
        return np.array([at[0], at[1], rate[0] - at[1], rate[1] - slope, across]), float(rate[4])

    def rates(angle: float, y: np.ndarray, s1: float, s0: float) -> list[float]:
        u, v, u1, v1, w1 = y
        slope, sound2, sound2_slope = base(angle, u, v)
        rho = density(sound2, s0)
        rho_slope = rho / sound2 * sound2_slope / (GAMMA - 1.0)
        bracket = u * u1 + v * v1 + sound2 * s1 / (GAMMA * (GAMMA - 1.0))
        p1 = -rho * bracket
        # Continuity is linear in v1'; what does not hold v1' comes first.
        rest = v * u1 + u * v1 + slope * v1 + sound2_slope * s1 / (GAMMA * (GAMMA - 1.0))
        p1_slope = -rho_slope * bracket - rho * rest
        rho1 = p1 / sound2 - rho * s1 / GAMMA
        rho1_slope = p1_slope / sound2 - p1 * sound2_slope / sound2**2 - rho_slope * s1 / GAMMA
        source = rho * (2.0 * u1 + v1 / tan(angle) + n * w1 / sin(angle) ** 2)
        source += rho1 * (2.0 * u + slope + v / tan(angle)) + v * rho1_slope + v1 * rho_slope
        v1_slope = -source / (rho * (1.0 - v * v / sound2))
        w1_slope = (n * p1 / rho - u * w1) / v
        return [v, slope, v1, v1_slope, w1_slope]

    def to_wall(shock: float) -> tuple[float, np.ndarray, float, float]:
        start, s1 = shock_state(shock)
        s0 = float(behind(shock, mach_number)[4])

        def wall(angle: float, y: np.ndarray, *args: float) -> float:
            return float(y[1]) + 1e-9 * mach_number

        vars(wall)["terminal"] = True  # scipy reads this from the function itself
        path = solve_ivp(
            rates, (shock, 1e-3), start, args=(s1, s0), events=wall, method="DOP853", rtol=1e-9, atol=1e-12
        )
        return float(path.t_events[0][0]), path.y_events[0][0], s1, s0

    low = np.arcsin(1.0 / mach_number) + 1e-4
    shock = brentq(lambda angle: to_wall(angle)[0] - half_angle, max(low, half_angle * 1.01), half_angle + 0.25)
    angle, (u, v, u1, v1, _), s1, s0 = to_wall(shock)
    _, sound2, _ = base(angle, u, v)
    rho = density(sound2, s0)
    scale = 2.0 * u / v1  # of the shock's motion to that of the wall, by no flow through the wall
    p1 = -rho * (u * u1 + v * v1 + sound2 * s1 / (GAMMA * (GAMMA - 1.0)))
    dynamic = 0.5 * mach_number**2
    return (rho * sound2 / GAMMA - 1.0 / GAMMA) / dynamic, scale * p1 / dynamic
