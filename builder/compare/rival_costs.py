"""What a step of the learning estimators costs, and a step of the product."""

from __future__ import annotations

import numpy as np

from builder.compare.candidate import GIVEN
from builder.compare.flights import ALTITUDES_KM, Readings
from builder.compare.rivals import RIVALS, RivalCandidate
from builder.compare.training import training_flights
from strainfmu.estimator.tables.manifold_map import ManifoldMap

TRAINING = 500
"""Flights that each learns from: fewer than in a comparison, which its time per step hardly depends on."""


def rival_costs(manifold: ManifoldMap, seed: int = 1) -> dict[str, float]:
    """Return the median time per step [s] of each learning estimator, in Python; needs scikit-learn."""
    random = np.random.default_rng(seed)
    training, calibration = (
        training_flights(manifold=manifold, altitudes_km=ALTITUDES_KM, count=count, random=random)
        for count in (TRAINING, TRAINING // 4)
    )
    read = Readings(
        strain=calibration.strain[None],
        dynamic_pressure=calibration.dynamic_pressure,
        dynamic_pressure_std=np.nan,
        mach_number=calibration.mach_number,
        static_pressure=np.full(len(calibration.mach_number), np.nan),
    )

    def cost(name: str) -> float:
        rival = RivalCandidate(name=name, training=training, calibration=calibration, navigation=GIVEN, seed=seed)
        return 1e-6 * rival.step_microseconds(read, GIVEN)

    return {f"{name} of scikit-learn, trained on {TRAINING:,} flights": cost(name) for name in RIVALS}
