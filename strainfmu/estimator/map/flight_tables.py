"""Strain and loads of a body of revolution over the flight state, as tensor-product splines.

The flight state is x = (M, u, w, ln p_inf) with u = a_T cos phi_T, w = a_T sin phi_T, a_T the total incidence and
phi_T the roll angle of the leeward meridian. The pressure of a flow is p_inf sum_m P_m(M, a_T) cos m(phi - phi_T),
so that every linear response to it is

    y = p_inf sum_m (A_m(M, a_T) cos m phi_T + B_m(M, a_T) sin m phi_T) + y_fixed.

u and w go through zero incidence without a jump where the polar angle phi_T has one.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.numerics import local_basis

MIN_INCIDENCE = 1e-7
"""Rounds the cone a_T = |(u, w)| off at its tip [rad]."""

N_STATES = 4
MACH, U, W, LOG_PRESSURE = range(N_STATES)
"""Places of M [1], u, w [rad] and ln(p_inf / Pa) in the flight state."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightTables:
    """Tables for n_d gauges, then n_f loads, as a map holds them in the fields of the same names."""

    mach_knots: FloatArray
    incidence_knots: FloatArray
    response: FloatArray
    fixed_response: FloatArray

    @cached_property
    def by_harmonic(self) -> FloatArray:
        """(n_M + 2, n_a + 2, 2 n_m, n_d + n_f) the same coefficients, grouped by harmonic."""
        cells, n = self.response.shape[:2], self.response.shape[2]
        return np.ascontiguousarray(np.swapaxes(self.response.reshape(*cells, n, -1), 2, 3))


class Response(NamedTuple):
    """Strains then loads (k, n_d + n_f), and their derivatives by the flight state (k, n_d + n_f, 4)."""

    value: FloatArray
    jacobian: FloatArray


def evaluate(tables: FlightTables, state: FloatArray) -> Response:
    """Return the response at ``state`` (k, 4)."""
    mach, u, w, log_pressure = state.T
    incidence = np.sqrt(u * u + w * w + MIN_INCIDENCE * MIN_INCIDENCE)
    at_wind = _harmonics(u, w, incidence, tables.response.shape[3])
    sums, by_mach, by_incidence, by_u, by_w = _sums(tables, mach, incidence, at_wind)
    pressure = np.exp(log_pressure)[:, None]
    value = pressure * sums
    jacobian = np.stack(
        [
            pressure * by_mach,
            pressure * ((u / incidence)[:, None] * by_incidence + by_u),
            pressure * ((w / incidence)[:, None] * by_incidence + by_w),
            value,
        ],
        axis=2,
    )
    return Response(value + tables.fixed_response, jacobian)


def values(tables: FlightTables, state: FloatArray) -> FloatArray:
    """Return strains then loads (k, n_d + n_f) at ``state`` (k, 4), without derivatives: a third of the time."""
    mach, u, w, log_pressure = state.T
    incidence = np.sqrt(u * u + w * w + MIN_INCIDENCE * MIN_INCIDENCE)
    at_wind = _harmonics(u, w, incidence, tables.response.shape[3])
    sums = _sums(tables, mach, incidence, at_wind, count=1)[0]
    return np.asarray(np.exp(log_pressure)[:, None] * sums + tables.fixed_response)


def _sums(
    tables: FlightTables,
    mach: FloatArray,
    incidence: FloatArray,
    at_wind: tuple[FloatArray, ...],
    count: int = 5,
) -> FloatArray:
    """Return (5, k, n_d + n_f) sums over harmonics, their derivatives by M and a_T, and by u and w at one a_T: the
    first ``count`` of these."""
    wind, by_u, by_w = at_wind
    of_mach, of_incidence = local_basis(tables.mach_knots, mach), local_basis(tables.incidence_knots, incidence)
    factors = (
        (of_mach.value, of_incidence.value, wind),
        (of_mach.derivative, of_incidence.value, wind),
        (of_mach.value, of_incidence.derivative, wind),
        (of_mach.value, of_incidence.value, by_u),
        (of_mach.value, of_incidence.value, by_w),
    )[:count]
    n = tables.response.shape[2]
    sums = np.empty((len(factors), len(mach), n))
    cells = np.stack([of_mach.cell, of_incidence.cell], axis=1)
    # Samples of one cell have their 16 coefficients of each harmonic in common.
    for i, j in set(map(tuple, cells.tolist())):
        rows = np.flatnonzero((cells[:, 0] == i) & (cells[:, 1] == j))
        local = tables.by_harmonic[i : i + 4, j : j + 4].reshape(-1, n)
        weight = [
            (first[rows, :, None] * second[rows, None, :]).reshape(len(rows), -1, 1)
            * third[rows].reshape(len(rows), 1, -1)
            for first, second, third in factors
        ]
        sums[:, rows] = np.reshape(np.reshape(weight, (-1, len(local))) @ local, (len(factors), len(rows), n))
    return sums


def _harmonics(u: FloatArray, w: FloatArray, incidence: FloatArray, n_m: int) -> tuple[FloatArray, ...]:
    """Return cos and sin of m phi_T (k, n_m, 2), and their derivatives by u and w [1/rad]."""
    cosine, sine = u / incidence, w / incidence
    cube = incidence**3
    d_cosine = (incidence * incidence - u * u) / cube, -u * w / cube
    d_sine = -u * w / cube, (incidence * incidence - w * w) / cube
    value, by_u, by_w = (np.zeros((len(u), n_m, 2)) for _ in range(3))
    value[:, 0, 0] = 1.0
    powers = np.cumprod(np.broadcast_to((cosine + 1j * sine)[:, None], (len(u), n_m - 1)), axis=1)
    value[:, 1:, 0], value[:, 1:, 1] = powers.real, powers.imag
    order, c, s = np.arange(1, n_m), value[:, :-1, 0], value[:, :-1, 1]
    for by, dc, ds in ((by_u, d_cosine[0], d_sine[0]), (by_w, d_cosine[1], d_sine[1])):
        dc, ds = dc[:, None], ds[:, None]
        by[:, 1:, 0], by[:, 1:, 1] = order * (c * dc - s * ds), order * (s * dc + c * ds)
    return value, by_u, by_w
