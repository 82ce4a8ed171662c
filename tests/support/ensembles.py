"""Ensembles of pressure fields that come from no campaign."""

import numpy as np

from builder.inverse.ensemble import Ensemble
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition


def listed_ensemble(pressure: FloatArray, internal_pressure: float = 0.0) -> Ensemble:
    """Return ``pressure`` (N, n_p) [Pa] as it is listed, at one condition and in form "absolute"."""
    n, condition = len(pressure), FlightCondition(6.0, 0.0, 0.0, 20e3)
    return Ensemble(
        pressure=pressure,
        fixed_pressure=internal_pressure,
        conditions=(condition,) * n,
        scale=np.ones((n, 5)),
        fixed_scale=np.ones((n, 5)),
        ambient_pressure=np.full(n, condition.ambient_pressure),
        nominal_dynamic_pressure=condition.dynamic_pressure,
        grid=None,
    )
