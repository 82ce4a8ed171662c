"""Further loads that are known combinations of the five loads of a map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from strainfmu.estimator.further_loads import FurtherLoads
from strainfmu.estimator.inverse_map import InverseMap

STATION = np.array([0.8])
COMBINATION = np.random.default_rng(8).standard_normal((7, 5))
"""(7, 5) further loads, of the rolling moment and one section, per load."""


def with_further(inverse_map: InverseMap, combination: np.ndarray = COMBINATION) -> InverseMap:
    """Return ``inverse_map`` with further loads that are ``combination`` (7, 5) times its loads."""

    def of(rows: np.ndarray | None) -> np.ndarray | None:
        return None if rows is None else combination @ rows

    x = inverse_map.strain_load_covariance
    further = FurtherLoads(
        section_station=STATION,
        load_per_state=combination @ inverse_map.load_per_state,
        load_of_mean=combination @ inverse_map.load_of_mean,
        variance=np.diag(combination @ inverse_map.load_covariance @ combination.T).copy(),
        strain_load_covariance=None if x is None else x @ combination.T,
        error_load=of(inverse_map.error_load),
        fixed_load=of(inverse_map.fixed_load),
    )
    return replace(inverse_map, further=further)
