"""What the nonlinear estimator knows over the envelope: standard deviations by Mach number and total incidence."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees

import numpy as np

from builder.reports.page.tables import Column, Table, make_table
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.manifold.air_data import AIR_DATA_NAMES
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimates
from strainfmu.estimator.manifold.flight_health import RANGE_TOLERANCE
from strainfmu.estimator.manifold.gauss_newton import linearise_anew
from strainfmu.estimator.manifold.navigation import NAVIGATION as QUANTITIES
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate

ALL, PRESSURE_ALONE = "M, p_inf and q_inf", "q_inf only"
NAVIGATION = (ALL, PRESSURE_ALONE)
"""What is known beside strain, each with the deviation of the map."""

MACHS, INCIDENCES, ROLLS = 13, 12, 8
"""Flight states of the envelope; deviations are rms values over the roll angles of the wind that it holds."""


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
        """Return (2, i, m) the deviation of one of the air data."""
        return np.asarray(self.air_data_std[..., AIR_DATA_NAMES.index(name)])

    def is_identified(self, name: str) -> FloatArray:
        """Return (2, i, m) the part of the roll angles at which it is identified."""
        return np.asarray(self.identified[..., AIR_DATA_NAMES.index(name)])


def flight_accuracy(inverse_map: InverseMap) -> FlightAccuracy | None:
    """Return the deviations over the envelope of the map; None for a map without tables."""
    if inverse_map.manifold is None:
        return None
    estimator = ManifoldEstimator(inverse_map)
    manifold = estimator.manifold
    low, high = manifold.mach_range.tolist()
    mach = np.linspace(low, high, MACHS)
    middle, half = manifold.crossflow
    incidence = float((np.abs(middle) + half).max()) * np.arange(1, INCIDENCES + 1) / INCIDENCES
    roll = 2.0 * np.pi * np.arange(ROLLS) / ROLLS
    states = np.zeros((INCIDENCES, MACHS, ROLLS, 4))
    states[..., MACH] = mach[:, None]
    states[..., U] = incidence[:, None, None] * np.cos(roll)
    states[..., W] = incidence[:, None, None] * np.sin(roll)
    states[..., LOG_PRESSURE] = np.log(manifold.pressure_range).mean()
    state = states.reshape(-1, 4)
    inside = np.all(np.abs(states[..., U : W + 1] - middle) <= (1.0 + RANGE_TOLERANCE) * half, axis=-1)
    flown = [_estimated(estimator, state, navigation) for navigation in NAVIGATION]
    return FlightAccuracy(
        mach_number=mach,
        total_incidence=incidence,
        static_pressure=float(np.exp(state[0, LOG_PRESSURE])),
        coefficient_std=np.sqrt(np.stack([_over_rolls(one.coefficients_std**2, inside) for one in flown])),
        air_data_std=np.sqrt(np.stack([_over_rolls(one.air_data.std**2, inside) for one in flown])),
        identified=np.stack([_over_rolls(one.air_data.is_identified, inside) for one in flown]),
    )


def _estimated(estimator: ManifoldEstimator, state: FloatArray, navigation: str) -> FlightEstimates:
    """Return the estimates for the strain of the tables at ``state`` (k, 4), linearised there."""
    manifold, pressure = estimator.manifold, np.exp(state[:, LOG_PRESSURE])
    known = dict.fromkeys((*QUANTITIES, "altitude", *(f"{name}_std" for name in QUANTITIES)), np.full(1, np.nan))
    known["dynamic_pressure"] = 0.5 * HEAT_CAPACITY_RATIO * state[:, MACH] ** 2 * pressure
    if navigation == ALL:
        known.update(mach_number=state[:, MACH], static_pressure=pressure)
    strain = evaluate(manifold.tables, state).value[:, : estimator.inverse_map.n_gauges]
    flow = {name: np.broadcast_to(value, len(state)) for name, value in known.items()}
    inputs = estimator.checked_inputs(strain, None, flow)
    return estimator.estimated(inputs, lambda samples, rows: linearise_anew(manifold, state[rows], samples))


def _over_rolls(values: FloatArray | BoolArray, inside: BoolArray) -> FloatArray:
    """Return (i, m, n) the mean of ``values`` (k, n) over the roll angles that are ``inside`` (i, m, r) the ranges
    of the map, NaN where none is."""
    count = inside.sum(axis=2)[:, :, None]
    total = np.sum(values.reshape(*inside.shape, -1), axis=2, where=inside[..., None])
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def flight_accuracy_table(of: FlightAccuracy) -> Table:
    """One row per navigation, total incidence and Mach number."""
    shown = [AIR_DATA_NAMES.index(name) for name in ("total_incidence", "mach_number", "static_pressure")]
    rows: list[tuple[object, ...]] = []
    for n, known in enumerate(NAVIGATION):
        for i, incidence in enumerate(np.degrees(of.total_incidence).tolist()):
            for m, mach in enumerate(of.mach_number.tolist()):
                incidence_std, mach_std, pressure_std = of.air_data_std[n, i, m, shown].tolist()
                identified = (100.0 * of.identified[n, i, m, shown]).tolist()
                air = (degrees(incidence_std), mach_std, 1e-3 * pressure_std)
                rows.append((known, incidence, mach, *of.coefficient_std[n, i, m].tolist(), *air, *identified))
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
    caption = f"The nonlinear estimator over the envelope, at p_inf = {1e-3 * of.static_pressure:.4g} kPa."
    return make_table("flight_accuracy", caption, columns, rows)
