"""The flow over a sphere behind its bow shock, from the stagnation point to well past the sonic line.

It is steady, inviscid and axisymmetric about the wind. In polar coordinates about the sphere's centre (lengths
over its radius, theta from the stagnation point) the layer between wall and shock is r = 1 + eta delta(theta),
eta from 0 to 1. Unknown are delta, the velocities u along r and v along theta, and the entropy
s = ln(p/rho^gamma); total enthalpy is constant. They are polynomials in theta, even or odd about the axis, and in
eta. At every node, those on wall and shock too, stand continuity and both components of Crocco's equation,
v omega = -T ds/dr and u omega = T/r ds/dtheta; the wall has u = 0 and the entropy of a normal shock, the shock its
jump. That is more equations than unknowns, and the sum of their squares is made smallest (Gauss and Newton).
Nothing need be stated about the sonic line: only the flow that passes it smoothly is a polynomial.

Free-stream density and speed of sound are 1, as everywhere in :mod:`builder.aero.euler`. First guess:
F. S. Billig, J. Spacecraft 4, 822 (1967), for the shock, and modified Newtonian pressure on the wall.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebval, chebval2d, chebvander
from numpy.typing import NDArray
from scipy.linalg import lstsq

from builder.aero.euler.scheme.gas import GAMMA, total_enthalpy
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError

NODES_ALONG = 18
"""Nodes along theta."""
DEGREE_ACROSS = 12
"""Degree of the polynomials across the layer ..."""
FAR_DEGREE_ACROSS = 16
"""... and the degree of a flow past FAR, where the layer is thick and its entropy lies close to the wall."""
FAR = np.radians(82.0)
MAX_ITERATIONS = 15
SMALLEST_MOVE = 1e-8
"""Change of an unknown that ends the iteration."""
LARGEST_RESIDUAL = 1e-3
"""Residual above which a flow is not taken for a solution: with it the wall pressure is wrong by about 0.1 %."""
BATCH = 64
"""Unknowns that are varied at once."""

Values = NDArray[Any]
"""Real, or complex where a derivative is taken."""


class Layer(NamedTuple):
    """Unknowns at all nodes: delta (.., n_theta), and u, v, s (.., n_theta, n_eta)."""

    delta: Values
    u: Values
    v: Values
    s: Values


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of the layer and derivatives on them, for one Mach number.

    Attributes
    ----------
    mach_number : of the free stream.
    reach : largest theta [rad].
    """

    mach_number: float
    reach: float

    @property
    def degree(self) -> int:
        """Degree across the layer."""
        return DEGREE_ACROSS if self.reach < FAR else FAR_DEGREE_ACROSS

    @property
    def enthalpy(self) -> float:
        return float(total_enthalpy(self.mach_number))

    @cached_property
    def theta(self) -> FloatArray:
        """(n_theta,) from ``reach`` falling to just off the axis [rad]."""
        return np.asarray(self.reach * _chebyshev(2 * NODES_ALONG)[0][:NODES_ALONG])

    @cached_property
    def eta(self) -> FloatArray:
        """(n_eta,) from 0 (wall) to 1 (shock)."""
        return np.asarray(0.5 * (1.0 - _chebyshev(self.degree + 1)[0]))

    @cached_property
    def along(self) -> tuple[FloatArray, FloatArray]:
        """d/dtheta (n_theta, n_theta) of a function that is even about the axis, and of one that is odd."""
        matrix = _chebyshev(2 * NODES_ALONG)[1] / self.reach
        near, far = matrix[:NODES_ALONG, :NODES_ALONG], matrix[:NODES_ALONG, : NODES_ALONG - 1 : -1]
        return near + far, near - far

    @cached_property
    def across(self) -> FloatArray:
        """d/deta (n_eta, n_eta), to be multiplied from the right."""
        return np.asarray(-2.0 * _chebyshev(self.degree + 1)[1].T)

    def behind_shock(self, delta: Values) -> tuple[Values, Values, Values]:
        """Return u, v, s (.., n_theta) just behind the shock (NACA Report 1135, eqs. 128 to 130)."""
        slope = delta @ self.along[0].T / (1.0 + delta)
        normal_r = 1.0 / np.sqrt(1.0 + slope * slope)
        normal_theta = -slope * normal_r
        u, v = -self.mach_number * np.cos(self.theta), self.mach_number * np.sin(self.theta)
        normal = u * normal_r + v * normal_theta
        square = normal * normal
        loss = normal * (((GAMMA - 1.0) * square + 2.0) / ((GAMMA + 1.0) * square) - 1.0)
        return u + loss * normal_r, v + loss * normal_theta, entropy_behind(square)

    def unpack(self, unknown: Values) -> Layer:
        """Return the layer of unknowns (.., n): delta, v on the wall, and u, v, s between wall and shock."""
        n, shape = NODES_ALONG, unknown.shape[:-1]
        delta, on_wall = unknown[..., :n], unknown[..., n : 2 * n]
        inside = unknown[..., 2 * n :].reshape(*shape, 3, n, self.degree - 1)
        zero = np.zeros_like(delta)
        wall = (zero, on_wall, zero + entropy_behind(self.mach_number**2))
        shock = self.behind_shock(delta)
        u, v, s = (
            np.concatenate([wall[k][..., None], inside[..., k, :, :], shock[k][..., None]], axis=-1)
            for k in range(3)
        )
        return Layer(delta, u, v, s)

    def residual(self, unknown: Values) -> Values:
        """Return the equations' residuals (.., m) of unknowns (.., n), made comparable by the Mach number."""
        delta, u, v, s = self.unpack(unknown)
        even, odd = self.along
        thickness = delta[..., None]
        r = 1.0 + self.eta * thickness
        # At constant r, not at constant eta.
        shift = self.eta * (delta @ even.T)[..., None] / thickness
        u_eta, v_eta, s_eta = u @ self.across, v @ self.across, s @ self.across
        u_theta, v_theta, s_theta = even @ u - shift * u_eta, odd @ v - shift * v_eta, even @ s - shift * s_eta
        u_r, v_r, s_r = u_eta / thickness, v_eta / thickness, s_eta / thickness
        sound = (GAMMA - 1.0) * (self.enthalpy - 0.5 * (u * u + v * v))
        temperature = sound / (GAMMA * (GAMMA - 1.0))
        vorticity = v_r + (v - u_theta) / r
        density_r = -(u * u_r + v * v_r) / sound - s_r / (GAMMA - 1.0)
        density_theta = -(u * u_theta + v * v_theta) / sound - s_theta / (GAMMA - 1.0)
        cotangent = 1.0 / np.tan(self.theta)[:, None]
        mass = u_r + 2.0 * u / r + (v_theta + v * cotangent) / r + u * density_r + v / r * density_theta
        m = self.mach_number
        radial = (v * vorticity + temperature * s_r) / m**2
        tangential = (u * vorticity - temperature * s_theta / r) / m**2
        return np.stack([mass / m, radial, tangential], axis=-3).reshape(*unknown.shape[:-1], -1)

    def jacobian(self, unknown: FloatArray) -> FloatArray:
        """Return d residual/d unknown (m, n), by complex steps: exact to round-off."""
        columns = []
        for first in range(0, unknown.size, BATCH):
            index = np.arange(first, min(first + BATCH, unknown.size))
            varied = np.tile(unknown.astype(complex), (index.size, 1))
            varied[np.arange(index.size), index] += 1e-30j
            columns.append(self.residual(varied).imag * 1e30)
        return np.concatenate(columns).T

    def first_guess(self) -> FloatArray:
        """Return unknowns (n,) with Billig's shock, Newtonian pressure on the wall, straight lines between."""
        m = self.mach_number
        stand_off, curvature = 0.143 * np.exp(3.24 / m**2), 1.143 * np.exp(0.54 / (m - 1.0) ** 1.2)
        tangent = np.tan(np.arcsin(1.0 / m))
        y = np.linspace(0.0, 8.0, 4000)
        bend = np.sqrt(1.0 + (y * tangent / curvature) ** 2) - 1.0
        upstream = 1.0 + stand_off - curvature / tangent**2 * bend
        delta = np.interp(self.theta, np.arctan2(y, upstream), np.hypot(y, upstream)) - 1.0
        shock = self.behind_shock(delta)
        pressure = np.maximum(np.cos(np.minimum(self.theta, 1.1)) ** 2, 1.0 / (1.2 * m * m))
        on_wall = np.sqrt(2.0 * self.enthalpy * (1.0 - pressure ** ((GAMMA - 1.0) / GAMMA)))
        wall = (np.zeros_like(delta), on_wall, np.full_like(delta, entropy_behind(m * m)))
        inside = [
            start[:, None] + (end - start)[:, None] * self.eta[1:-1]
            for start, end in zip(wall, shock, strict=True)
        ]
        return np.concatenate([delta, on_wall, np.ravel(inside)])


@dataclass(frozen=True, eq=False)
class SphereFlow:
    """The flow over a sphere of radius 1 up to theta = ``reach`` [rad].

    Attributes
    ----------
    nodes : where it was solved.
    delta : (2 n_theta,) Chebyshev coefficients of the layer's thickness over theta/reach.
    u, v, s : (2 n_theta, n_eta) coefficients of velocities and entropy, over theta/reach and 2 eta - 1.
    residual : largest residual of the equations.
    """

    nodes: Nodes
    delta: FloatArray
    u: FloatArray
    v: FloatArray
    s: FloatArray
    residual: float

    def shock_radius(self, theta: FloatArray) -> FloatArray:
        """Return the shock's distance from the centre at theta [rad]."""
        return np.asarray(1.0 + chebval(theta / self.nodes.reach, self.delta))

    def state(self, theta: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return p, rho, u, v at theta [rad] and r, shapes alike; points off the layer count as on its edge."""
        eta = np.clip((r - 1.0) / (self.shock_radius(theta) - 1.0), 0.0, 1.0)
        point = (theta / self.nodes.reach, 2.0 * eta - 1.0)
        u, v, s = (
            np.asarray(chebval2d(*point, coefficients), dtype=float) for coefficients in (self.u, self.v, self.s)
        )
        sound = (GAMMA - 1.0) * (self.nodes.enthalpy - 0.5 * (u * u + v * v))
        density: FloatArray = np.exp((np.log(sound / GAMMA) - s) / (GAMMA - 1.0))
        return density * sound / GAMMA, density, u, v

    def wall_pressure(self, theta: FloatArray) -> FloatArray:
        """Return p on the wall at theta [rad], of which only the size counts."""
        return self.state(np.abs(theta), np.ones_like(theta))[0]


@lru_cache(maxsize=64)
def solve_sphere(mach_number: float, reach: float) -> SphereFlow:
    """Solve the flow over a sphere at ``mach_number`` up to theta = ``reach`` [rad].

    Raises
    ------
    FlowReachError
        The equations are not solved within LARGEST_RESIDUAL.
    """
    nodes = Nodes(float(mach_number), float(reach))
    with np.errstate(all="ignore"):  # far from a solution there may be no state
        unknown, residual = _smallest_residual(nodes)
    worst = float(np.max(np.abs(residual)))
    if not worst < LARGEST_RESIDUAL:
        raise FlowReachError(f"euler: the flow over the spherical tip is not found at Mach number {mach_number:g}")
    return _as_polynomials(nodes, nodes.unpack(unknown), worst)


def _smallest_residual(nodes: Nodes) -> tuple[FloatArray, FloatArray]:
    """Return the unknowns that solve the equations of ``nodes`` best, and the residual (m,) that is left."""
    unknown = nodes.first_guess()
    residual = nodes.residual(unknown)
    for _ in range(MAX_ITERATIONS):
        move = lstsq(nodes.jacobian(unknown), -residual, lapack_driver="gelsy", check_finite=False)[0]
        share, nearer = 1.0, None
        while nearer is None and share > 1e-3:
            nearer = _nearer(nodes, unknown + share * move, residual)
            share *= 0.5
        if nearer is None:
            break
        unknown, residual = nearer
        if np.max(np.abs(move)) < SMALLEST_MOVE:
            break
    return unknown, residual


def _nearer(nodes: Nodes, unknown: FloatArray, before: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return ``unknown`` and its residual where that is smaller than ``before``, else None."""
    if not np.all(unknown[:NODES_ALONG] > 0.0):
        return None
    residual = nodes.residual(unknown)
    smaller = float(residual @ residual) < float(before @ before)
    return (unknown, np.asarray(residual)) if smaller else None


def entropy_behind(square: Values | float) -> Values:
    """Return s behind a shock of which the normal Mach number has that square."""
    pressure = (1.0 + 2.0 * GAMMA / (GAMMA + 1.0) * (square - 1.0)) / GAMMA
    density = (GAMMA + 1.0) * square / ((GAMMA - 1.0) * square + 2.0)
    return np.asarray(np.log(pressure) - GAMMA * np.log(density))


def _as_polynomials(nodes: Nodes, layer: Layer, residual: float) -> SphereFlow:
    n = NODES_ALONG
    along = chebvander(nodes.theta / nodes.reach, 2 * n - 1)
    across = chebvander(2.0 * nodes.eta - 1.0, nodes.degree)

    def coefficients(values: Values, first: int) -> FloatArray:
        """Return (2 n, ..) of values (n, ..) at the nodes; ``first`` is 0 for even functions, 1 for odd."""
        values_of = np.zeros((2 * n, *values.shape[1:]))
        values_of[first::2] = np.linalg.solve(along[:, first::2], values)
        return np.asarray(values_of if values.ndim == 1 else np.linalg.solve(across, values_of.T).T)

    delta, u, v, s = (np.real(values) for values in layer)
    return SphereFlow(
        nodes, coefficients(delta, 0), coefficients(u, 0), coefficients(v, 1), coefficients(s, 0), residual
    )


@lru_cache(maxsize=8)
def _chebyshev(n: int) -> tuple[FloatArray, FloatArray]:
    """Return n points cos(k pi/(n - 1)) and the derivative on them (Trefethen, Spectral Methods, program 6)."""
    k = np.arange(n)
    x = np.cos(np.pi * k / (n - 1))
    weight = np.where((k == 0) | (k == n - 1), 2.0, 1.0) * (-1.0) ** k
    derivative = np.outer(weight, 1.0 / weight) / (x[:, None] - x[None, :] + np.eye(n))
    return x, derivative - np.diag(derivative.sum(axis=1))
