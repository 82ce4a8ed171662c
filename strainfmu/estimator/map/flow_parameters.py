"""Flow parameters, such as deflections of controls: their ranges in the snapshots of a map.

The linear estimate does not use them: the prior holds all values of the snapshots. The nonlinear one does where
their standard deviation is stated (:mod:`strainfmu.estimator.tables.parameter_tables`). A value that is known and
out of range shows that the map does not hold, whatever strain and coefficients say.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.arguments import per_sample

PARAMETER_TOLERANCE = 0.01
"""Part of its range by which a parameter may leave it: errors of a sensor of deflection, and of rounding."""

LARGEST_SCORE = 1e9
"""Score of a value that is no finite number, infinity."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlowParameters:
    """The n_p parameters of a map, in units of the vehicle file.

    Attributes
    ----------
    names : n_p names, as in the vehicle file.
    minimum, maximum : (n_p,) over the snapshots.
    """

    names: tuple[str, ...]
    minimum: FloatArray
    maximum: FloatArray

    @property
    def span(self) -> FloatArray:
        """(n_p,) width of each range; of a value that the snapshots hold fixed its size, at least 1."""
        width = self.maximum - self.minimum
        return np.asarray(np.where(width > 0.0, width, np.maximum(np.abs(self.maximum), 1.0)))

    def values(
        self, given: Mapping[str, ArrayLike] | None, samples: int, argument: str = "parameters"
    ) -> FloatArray:
        """Return (samples, n_p) the values ``given`` by name, NaN of those that are not.

        ``argument`` is what errors call ``given``.

        Raises
        ------
        InputError
            ``given`` names nothing, the map has no parameter of a name, or a value is no number or not one of each
            sample.
        """
        found = np.full((samples, len(self.names)), np.nan)
        if given is None:
            return found
        known = ", ".join(self.names) or "none"
        if not isinstance(given, Mapping):
            raise InputError(f"{argument}: expected values by name, of the map's {known}, got {given!r}")
        for name, value in given.items():
            if name not in self.names:
                raise InputError(f"{argument}: expected the parameters of the map, {known}, got '{name}'")
            found[:, self.names.index(name)] = per_sample(name, value, samples)
        return found

    def stds(self, given: Mapping[str, ArrayLike] | None, samples: int) -> FloatArray:
        """Return (samples, n_p) standard deviations ``given`` by name, as :meth:`values`; errors as there, and for
        one below 0."""
        found = self.values(given, samples, "parameters_std")
        if np.any(found < 0.0):
            raise InputError(f"parameters_std: expected numbers from 0 on, got {np.nanmin(found):g}")
        return found

    def outside(self, score: FloatArray) -> tuple[str, ...]:
        """Return the names of those that leave their range, by their ``score`` (n_p,)."""
        return tuple(
            name for name, one in zip(self.names, score.tolist(), strict=True) if one > PARAMETER_TOLERANCE
        )


def flow_parameters(inverse_map: Any) -> FlowParameters:
    """Return the parameters of ``inverse_map``, none of one whose snapshots have none."""
    ranges: dict[str, list[float]] = inverse_map.provenance.get("parameters", {})
    bounds = np.array([*ranges.values()], dtype=float).reshape(-1, 2)
    return FlowParameters(names=tuple(ranges), minimum=bounds[:, 0], maximum=bounds[:, 1])
