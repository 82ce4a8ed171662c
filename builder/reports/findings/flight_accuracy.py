"""What the nonlinear estimator knows over the envelope: standard deviations by Mach number and total incidence."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees

import numpy as np

from builder.reports.findings.envelope_states import NAVIGATION, envelope, estimated_at
from builder.reports.page.page_tables import Column, Table, make_table
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, MACH_NUMBER, STATIC_PRESSURE
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap


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
