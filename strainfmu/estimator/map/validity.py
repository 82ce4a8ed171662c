"""Flow parameters of a map: the ranges that its snapshots cover, and when a flight is outside.

The linear estimate does not use parameters, such as deflections of controls: the prior
holds all values of the snapshots. The nonlinear one does where their standard deviation is stated
(:mod:`strainfmu.estimator.map.nonlinear_map`). A value that is known and out of range shows that the map does not
hold, whatever strain and coefficients say.
"""

from dataclasses import dataclass
from math import radians
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.schema import MapRecord, entry

PARAMETER_TOLERANCE = 0.01
"""Part of its range by which a parameter may leave it: errors of a sensor of deflection, and of rounding."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FlowParameters(MapRecord, where="flow parameters"):
    """The n_p parameters of a map, in units of the vehicle file."""

    names: tuple[str, ...] = entry("n_p", "", "as in the vehicle file")
    minimum: FloatArray = entry("n_p", "", "over the snapshots", place="parameters.minimum")
    maximum: FloatArray = entry("n_p", "", "the same", place="parameters.maximum")

    @property
    def span(self) -> FloatArray:
        """(n_p,) width of each range; of a value that the snapshots hold fixed its size, at least 1."""
        width = self.maximum - self.minimum
        return np.asarray(np.where(width > 0.0, width, np.maximum(np.abs(self.maximum), 1.0)))

    def outside(self, score: FloatArray) -> tuple[str, ...]:
        """Return the names of those that leave their range, by their ``score`` (n_p,)."""
        return tuple(name for name, excess in zip(self.names, score, strict=True) if excess > PARAMETER_TOLERANCE)


def parameter_names_of(inverse_map: Any) -> tuple[str, ...]:
    """Return the names of the parameters of ``inverse_map``, as in the vehicle file."""
    return tuple(inverse_map.provenance.get("parameters", {}))


def flow_parameters(inverse_map: Any) -> FlowParameters:
    """Return the parameters of ``inverse_map``, none of one whose snapshots have none."""
    ranges: dict[str, list[float]] = inverse_map.provenance.get("parameters", {})
    bounds = np.array([*ranges.values()], dtype=float).reshape(-1, 2)
    return FlowParameters(names=parameter_names_of(inverse_map), minimum=bounds[:, 0], maximum=bounds[:, 1])


def incidence_per_force(inverse_map: Any) -> float:
    """Return the largest total incidence of the snapshots over the largest lateral coefficient [rad].

    The lateral force of a slender body grows at least in proportion to the incidence, so that no smaller incidence
    gives a coefficient. 0 where nothing is known of it: for maps without full symmetry, whose lateral force need
    not be 0 without incidence.
    """
    stated = inverse_map.provenance.get("total_incidence_deg")
    if inverse_map.provenance.get("symmetry") != "full" or not isinstance(stated, list) or not stated:
        return 0.0
    incidence, force = radians(max(stated)), float(np.abs(inverse_map.coefficient_range[1:3]).max())
    return incidence / force if incidence > 0.0 and force > 0.0 else 0.0
