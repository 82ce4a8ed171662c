"""Flight states over the envelope of a map with tables, and what the nonlinear estimator knows there.

What the nonlinear estimator knows over the envelope: standard deviations by Mach number and total incidence.
"""

from dataclasses import dataclass
from math import degrees

import numpy as np

from builder.reports.page.page_tables import Column, Table, make_table
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, MACH_NUMBER, STATIC_PRESSURE, QSource
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.policies import POLICIES

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
        inside=np.all(np.abs(state[..., U : W + 1] - middle) <= (1.0 + POLICIES.range_tolerance) * half, axis=-1),
    )


def strain_at(manifold: ManifoldMap, state: FloatArray) -> FloatArray:
    """Return the strain (k, n_d) of the tables at ``state`` (k, 4)."""
    return np.asarray(evaluate(manifold.tables, state).value[:, : manifold.n_gauges])


def air_data_at(state: FloatArray, navigation: str) -> FloatArray:
    """Return (k, 3) M, p_inf and q_inf at ``state`` (k, 4), NaN of those that ``navigation`` does not give."""
    mach, pressure = state[:, MACH], np.exp(state[:, LOG_PRESSURE])
    air_data = np.column_stack([mach, pressure, 0.5 * HEAT_CAPACITY_RATIO * mach**2 * pressure])
    if navigation == PRESSURE_ALONE:
        air_data[:, :2] = np.nan
    return air_data


def estimated_at(estimator: Estimator, state: FloatArray, navigation: str) -> Estimate:
    """Return the estimates of the strain of the tables at ``state`` (k, 4), from which they start.

    Air data count as independent measurements.
    """
    manifold = estimator.inverse_map.manifold
    assert manifold is not None
    strain = strain_at(manifold, state)
    mach, static, dynamic = air_data_at(state, navigation).T
    return estimator.estimate(
        strain * estimator.inverse_map.sensors.scale,
        dynamic,
        mach_number=mach,
        static_pressure=static,
        q_source=QSource.INDEPENDENT,
        start=state,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightAccuracy:
    """Deviations that the estimator states for the strain of its tables, by navigation, incidence, Mach number.

    Attributes
    ----------
    mach_number : (m,) M [1].
    total_incidence : (i,) [rad].
    static_pressure : p_inf [Pa], the middle of the range of the map.
    coefficient_std : (2, i, m, 5) of C_A, C_N, C_Y, M_P, M_Y [1].
    air_data_std : (2, i, m, 7) of the air data, in their units.
    identified : (2, i, m, 7) part of the roll angles at which strain and navigation identify them.
    """

    mach_number: FloatArray
    total_incidence: FloatArray
    static_pressure: float
    coefficient_std: FloatArray
    air_data_std: FloatArray
    identified: FloatArray

    def air_data(self, name: str) -> FloatArray:
        """Return (2, i, m) the standard deviation of one of the air data."""
        return np.asarray(self.air_data_std[..., AIR_DATA_NAMES.index(name)])

    def is_identified(self, name: str) -> FloatArray:
        """Return (2, i, m) the part of the roll angles at which it is identified."""
        return np.asarray(self.identified[..., AIR_DATA_NAMES.index(name)])


def flight_accuracy(inverse_map: InverseMap) -> FlightAccuracy | None:
    """Return the standard deviations over the envelope of the map; None for a map without tables."""
    if inverse_map.manifold is None:
        return None
    estimator, over = Estimator(inverse_map), envelope(inverse_map.manifold)
    flown = [estimated_at(estimator, over.flown, navigation) for navigation in NAVIGATION]
    return FlightAccuracy(
        mach_number=over.mach_number,
        total_incidence=over.total_incidence,
        static_pressure=over.static_pressure,
        coefficient_std=np.sqrt(np.stack([over.over_rolls(estimates.coefficients_std**2) for estimates in flown])),
        air_data_std=np.sqrt(np.stack([over.over_rolls(estimates.air_data.std**2) for estimates in flown])),
        identified=np.stack([over.over_rolls(estimates.air_data.is_identified) for estimates in flown]),
    )


def flight_accuracy_table(accuracy: FlightAccuracy) -> Table:
    """One row per navigation, total incidence and Mach number."""
    shown = [AIR_DATA_NAMES.index(name) for name in ("total_incidence", MACH_NUMBER, STATIC_PRESSURE)]
    rows: list[tuple[object, ...]] = []
    for n, known in enumerate(NAVIGATION):
        for i, incidence in enumerate(np.degrees(accuracy.total_incidence).tolist()):
            for m, mach in enumerate(accuracy.mach_number.tolist()):
                incidence_std, mach_std, pressure_std = accuracy.air_data_std[n, i, m, shown].tolist()
                identified = (100.0 * accuracy.identified[n, i, m, shown]).tolist()
                air = (degrees(incidence_std), mach_std, 1e-3 * pressure_std)
                rows.append(
                    (known, incidence, mach, *accuracy.coefficient_std[n, i, m].tolist(), *air, *identified)
                )
    columns = (
        Column("navigation"),
        Column("total incidence", "deg", ".3g"),
        Column("Mach number", "1", ".3g"),
        *(Column(f"sigma of {name}", "1", ".3g") for name in COEFFICIENT_NAMES),
        Column("sigma of total incidence", "deg", ".2g"),
        Column("sigma of Mach number", "1", ".2g"),
        Column("sigma of p_inf", "kPa", ".2g"),
        *(Column(f"{name} identified", "% of roll angles", ".0f") for name in ("incidence", "M", "p_inf")),
    )
    caption = f"The nonlinear estimator over the envelope, at p_inf = {1e-3 * accuracy.static_pressure:.4g} kPa."
    return make_table("flight_accuracy", caption, columns, rows)
