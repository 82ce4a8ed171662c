"""Flights of an independent model, whatever the shape of the vehicle: what any vehicle as built reads there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from builder.structure.as_built.vehicle import AsBuilt, Counts
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition


class Flights(Protocol):
    """k flights.

    Attributes
    ----------
    conditions : k flight conditions.
    coefficients : (k, 5) C_A, C_N, C_Y, M_P, M_Y [1].
    rolling : (k,) M_R [1]; None for a body of revolution, which has none.
    ambient_pressure, dynamic_pressure, internal_pressure : (k,) p_inf, q_inf and that stated inside [Pa].
    counts : numbers of what has errors of its own in a vehicle.
    """

    @property
    def conditions(self) -> Sequence[FlightCondition]: ...

    @property
    def counts(self) -> Counts: ...

    @property
    def coefficients(self) -> FloatArray: ...

    @property
    def rolling(self) -> FloatArray | None: ...

    @property
    def ambient_pressure(self) -> FloatArray: ...

    @property
    def dynamic_pressure(self) -> FloatArray: ...

    @property
    def internal_pressure(self) -> FloatArray: ...

    def read(
        self, built: AsBuilt, rows: slice = slice(None), random: np.random.Generator | None = None
    ) -> FloatArray:
        """Return (k, n_d) strain [m/m], without noise, that a vehicle as ``built`` reads in the flights ``rows``;
        (v, n_d) of v vehicles in one flight. ``random`` draws what a vehicle does not state, where there is
        more."""
        ...
