"""Taylor-Maccoll flow over a cone without incidence, integrated."""

from math import asin, cos, pi, sin, tan

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

GAMMA = 1.4


def taylor_maccoll_surface(half_angle: float, mach_number: float) -> tuple[float, float]:
    """Return p/p_inf and M on a cone, by integration from the shock inwards.

    Anderson, Modern Compressible Flow, ch. 10. NaN where the shock is detached.
    """

    def behind_shock(shock: float) -> tuple[float, float, float]:
        """Return the flow's Mach number and deflection behind an oblique shock, and p02/p01."""
        normal2 = (mach_number * sin(shock)) ** 2
        deflection = np.arctan(
            2.0 / tan(shock) * (normal2 - 1.0) / (mach_number**2 * (GAMMA + np.cos(2.0 * shock)) + 2.0)
        )
        after2 = (1.0 + 0.2 * normal2) / (GAMMA * normal2 - 0.2)
        pressure = 1.0 + 2.0 * GAMMA / (GAMMA + 1.0) * (normal2 - 1.0)
        density = 6.0 * normal2 / (5.0 + normal2)
        total = density * (density / pressure) ** 2.5  # (rho2/rho1)^(g/(g-1)) (p1/p2)^(1/(g-1))
        return np.sqrt(after2) / sin(shock - deflection), deflection, total

    def slope(angle: float, velocity: np.ndarray) -> list[float]:
        radial, across = velocity
        a = 0.5 * (GAMMA - 1.0) * (1.0 - radial**2 - across**2)
        turn = (radial * across**2 - a * (2.0 * radial + across / tan(angle))) / (a - across**2)
        return [across, turn]

    def wall_flow(angle: float, velocity: np.ndarray) -> float:
        return float(velocity[1])

    vars(wall_flow)["terminal"] = True  # scipy reads this from the function itself

    def cone_of(shock: float) -> tuple[float, float, float]:
        """Return the cone's half-angle, its p/p_inf and its M."""
        mach2, deflection, total = behind_shock(shock)
        speed = (5.0 / mach2**2 + 1.0) ** -0.5
        start = [speed * cos(shock - deflection), -speed * sin(shock - deflection)]
        path = solve_ivp(slope, (shock, 1e-4), start, events=wall_flow, method="DOP853", rtol=1e-11, atol=1e-13)
        angle, radial = path.t_events[0][0], path.y_events[0][0][0]
        surface2 = 5.0 * radial**2 / (1.0 - radial**2)
        return angle, total * ((1.0 + 0.2 * mach_number**2) / (1.0 + 0.2 * surface2)) ** 3.5, np.sqrt(surface2)

    low = asin(1.0 / mach_number) + 1e-5
    steepest = minimize_scalar(lambda angle: -cone_of(angle)[0], bounds=(low, 0.5 * pi - 1e-4), method="bounded").x
    if cone_of(steepest)[0] < half_angle:
        return float("nan"), float("nan")
    shock = brentq(lambda angle: cone_of(angle)[0] - half_angle, low, steepest, xtol=1e-12)
    return cone_of(shock)[1:]


def taylor_maccoll_pressure(half_angle: float, mach_number: float) -> float:
    """Return p/p_inf on a cone."""
    return taylor_maccoll_surface(half_angle, mach_number)[0]
