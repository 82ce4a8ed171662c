"""Flight states over the envelope of a map with tables, and what the nonlinear estimator knows there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.air_inputs import QSource
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.policies import RANGE_TOLERANCE

ALL, PRESSURE_ALONE = "M, p_inf and q_inf", "q_inf only"
NAVIGATION = (ALL, PRESSURE_ALONE)
"""What is known in addition to strain, each with the standard deviation of the map."""

MACHS, INCIDENCES, ROLLS = 13, 12, 8
"""Flight states of the envelope; standard deviations are rms values over the aerodynamic roll angles in it."""


FEW = (2, 2)
"""Mach numbers and total incidences at which gauges are lost, and pressure is estimated."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Envelope:
    """Flight states by incidence, Mach number and roll angle.

    Attributes
    ----------
    mach_number : (m,) M [1].
    total_incidence : (i,) [rad].
    static_pressure : p_inf [Pa], the middle of the range of the map.
    state : (i, m, r, 4) flight states.
    inside : (i, m, r) whether the ranges of the map hold each.
    """

    mach_number: FloatArray
    total_incidence: FloatArray
    static_pressure: float
    state: FloatArray
    inside: BoolArray

    @property
    def flown(self) -> FloatArray:
        """(k, 4) the states that the ranges of the map hold."""
        return self.state[self.inside]

    def over_rolls(self, values: FloatArray | BoolArray) -> FloatArray:
        """Return (i, m, n) the mean over the roll angles of ``values`` (k, n) of :attr:`flown`, NaN where the
        ranges of the map hold none."""
        total = np.zeros((*self.inside.shape, values.shape[1]))
        total[self.inside] = values
        count = self.inside.sum(axis=2)[:, :, None]
        return np.where(count > 0, total.sum(axis=2) / np.maximum(count, 1), np.nan)


def envelope(manifold: ManifoldMap, machs: int = MACHS, incidences: int = INCIDENCES) -> Envelope:
    """Return the states at even steps of Mach number and, from the first above 0, of total incidence."""
    low, high = manifold.mach_range.tolist()
    mach = np.linspace(low, high, machs)
    middle, half = manifold.crossflow
    incidence = float((np.abs(middle) + half).max()) * np.arange(1, incidences + 1) / incidences
    roll = 2.0 * np.pi * np.arange(ROLLS) / ROLLS
    state = np.zeros((incidences, machs, ROLLS, 4))
    state[..., MACH] = mach[:, None]
    state[..., U] = incidence[:, None, None] * np.cos(roll)
    state[..., W] = incidence[:, None, None] * np.sin(roll)
    state[..., LOG_PRESSURE] = np.log(manifold.pressure_range).mean()
    return Envelope(
        mach_number=mach,
        total_incidence=incidence,
        static_pressure=float(np.exp(state[0, 0, 0, LOG_PRESSURE])),
        state=state,
        inside=np.all(np.abs(state[..., U : W + 1] - middle) <= (1.0 + RANGE_TOLERANCE) * half, axis=-1),
    )


def strain_at(manifold: ManifoldMap, state: FloatArray) -> FloatArray:
    """Return the strain (k, n_d) of the tables at ``state`` (k, 4)."""
    return np.asarray(evaluate(manifold.tables, state).value[:, : manifold.tables.n_gauges])


def air_data_at(state: FloatArray, navigation: str) -> FloatArray:
    """Return (k, 3) M, p_inf and q_inf at ``state`` (k, 4), NaN of those that ``navigation`` does not give."""
    mach, pressure = state[:, MACH], np.exp(state[:, LOG_PRESSURE])
    air_data = np.column_stack([mach, pressure, 0.5 * HEAT_CAPACITY_RATIO * mach**2 * pressure])
    if navigation == PRESSURE_ALONE:
        air_data[:, :2] = np.nan
    return air_data


def estimated_at(
    estimator: Estimator, state: FloatArray, navigation: str, valid: BoolArray | None = None
) -> Estimate:
    """Return the estimates of the strain of the tables at ``state`` (k, 4), from which they start.

    Air data count as independent measurements.

    ``valid`` (n_d,) is false for gauges to leave out; None for none.
    """
    manifold = estimator.inverse_map.manifold
    assert manifold is not None
    strain = strain_at(manifold, state)
    mach, static, dynamic = air_data_at(state, navigation).T
    return estimator.estimate(
        strain * estimator.inverse_map.sensors.scale,
        dynamic,
        valid=valid,
        mach_number=mach,
        static_pressure=static,
        q_source=QSource.INDEPENDENT,
        start=state,
    )
