"""
Cones against Taylor and Maccoll
================================

A cone at zero incidence has an exact solution: the conical flow of Taylor and Maccoll, an ordinary differential
equation from the shock to the wall. The marching Euler solver is held against it.
"""

from math import radians

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import builder

GAMMA = 1.4


def behind_shock(mach_number, shock_angle):
    """Return p/p_inf, radial and circumferential velocity over the limit velocity, and the pressure's scale."""
    normal = mach_number * np.sin(shock_angle)
    ratio = 1.0 + 2.0 * GAMMA / (GAMMA + 1.0) * (normal**2 - 1.0)
    density = (GAMMA + 1.0) * normal**2 / ((GAMMA - 1.0) * normal**2 + 2.0)
    speed = np.sqrt(mach_number**2 / (mach_number**2 + 2.0 / (GAMMA - 1.0)))
    return ratio, speed * np.cos(shock_angle), -speed * np.sin(shock_angle) / density


def conical_flow(mach_number, shock_angle):
    """Return the cone angle [rad] behind a shock, and p/p_inf on that cone."""
    ratio, radial, across = behind_shock(mach_number, shock_angle)

    def slope(angle, velocity):
        u, v = velocity
        sound = 0.5 * (GAMMA - 1.0) * (1.0 - u**2 - v**2)
        return [v, (u * v**2 - sound * (2.0 * u + v / np.tan(angle))) / (sound - v**2)]

    def at_wall(angle, velocity):
        return velocity[1]

    at_wall.terminal = True
    found = solve_ivp(slope, [shock_angle, 1e-3], [radial, across], events=at_wall, rtol=1e-9, atol=1e-12)
    wall = found.y_events[0][0]
    heat = GAMMA / (GAMMA - 1.0)
    return found.t[-1], ratio * ((1.0 - wall @ wall) / (1.0 - radial**2 - across**2)) ** heat


def taylor_maccoll(mach_number, cone_angle):
    """Return p/p_inf on a cone."""
    lowest = np.arcsin(1.0 / mach_number) + 1e-4
    shock = brentq(lambda s: conical_flow(mach_number, s)[0] - cone_angle, lowest, radians(40.0), xtol=1e-10)
    return conical_flow(mach_number, shock)[1]


# %%
# Three cones at three Mach numbers, on a coarse grid.

grid = builder.MarchingGrid(n_radial=24, n_circumferential=12)
mach_numbers, angles = [5.0, 6.0, 7.0], [5.0, 10.0, 15.0]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
for angle in angles:
    cone = builder.chain_segments([(1.0, radians(angle), radians(angle))])
    ours = np.array([builder.solve_flow(cone, m, 0.0, grid).pieces[0][1][-1].mean() for m in mach_numbers])
    exact = np.array([taylor_maccoll(m, radians(angle)) for m in mach_numbers])
    left.plot(mach_numbers, exact, "k-", lw=1)
    left.plot(mach_numbers, ours, "o", label=f"{angle:g} deg")
    right.plot(mach_numbers, 100.0 * (ours / exact - 1.0), "o-", label=f"{angle:g} deg")
left.set(xlabel="Mach number", ylabel="p/p$_\\infty$ on the cone")
left.legend(title="half-angle; line: exact")
right.set(xlabel="Mach number", ylabel="difference [%]")
right.axhline(0.0, color="k", lw=1)
right.grid(alpha=0.3)
plt.show()
