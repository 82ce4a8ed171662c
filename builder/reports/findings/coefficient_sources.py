"""Uncertainty of each coefficient, split by the sources of its variance."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from builder.inverse.loads.covariance import load_error_factors
from builder.inverse.noise.error_list import INSTALLATION, error_named
from builder.inverse.solution import Problem, Solution
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.gain import load_covariance, load_gain

OF_STATES = "prior and gamma"
TRUNCATED = "truncated modes"
AIR_DATA = {
    "Mach number": "noise.navigation_mach_number",
    "static pressure": "noise.navigation_static_pressure_percent",
    "dynamic pressure of navigation": "noise.dynamic_pressure_percent",
}
"""Sources that air data are, with their entries."""

OF_RANGES = "ranges of the map"
GROUPS = {
    **dict.fromkeys((OF_STATES, OF_RANGES, TRUNCATED), "prior and truncation"),
    **dict.fromkeys(AIR_DATA, "air data"),
}
"""Groups of sources that are no errors of :mod:`builder.inverse.noise.error_list`."""

UNCHANGED = 1e-6
"""Fraction of sigma: a range below it is round-off, such as the range of C_Y without sideslip."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CoefficientSources:
    """The five coefficients at the nominal dynamic pressure.

    Attributes
    ----------
    std : (5,) sigma [1].
    range : (5, 2) minimum and maximum over the snapshots [1].
    correlation : (5, 5) of the errors [1].
    names : n sources, independent of each other.
    variance : (n, 5) contribution of each source to the variance of each coefficient [1]; columns add up to std^2.
    """

    std: FloatArray
    range: FloatArray
    correlation: FloatArray
    names: tuple[str, ...]
    variance: FloatArray

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Group of each source: gauge noise, installation, model form, inertia and so on."""
        return tuple(GROUPS.get(name) or error_named(name).group for name in self.names)

    def of_group(self, group: str) -> tuple[str, ...]:
        """Return the sources of a group."""
        return tuple(name for name, its in zip(self.names, self.groups, strict=True) if its == group)

    @property
    def group_variance(self) -> dict[str, FloatArray]:
        """(5,) contribution of each group to the variances [1]."""
        groups = np.array(self.groups)
        return {name: self.variance[groups == name].sum(axis=0) for name in dict.fromkeys(self.groups)}

    @property
    def hardware(self) -> tuple[str, ...]:
        """The sources that are errors of the vehicle and its gauges as built."""
        return self.of_group(INSTALLATION)

    @property
    def std_of_range(self) -> FloatArray:
        """(5,) sigma over the width of the range [1]; infinite where a coefficient is constant."""
        width = self.range[:, 1] - self.range[:, 0]
        fraction = np.full(5, np.inf)
        np.divide(self.std, width, out=fraction, where=width > UNCHANGED * self.std)
        return fraction

    def std_without(self, left_out: Collection[str]) -> FloatArray:
        """Return (5,) sigma [1] without the named sources, with the same gain."""
        chosen = np.array([name in left_out for name in self.names], dtype=bool)
        return np.sqrt(np.maximum(self.std**2 - self.variance[chosen].sum(axis=0), 0.0))


def coefficient_scales(inverse_map: InverseMap) -> FloatArray:
    """Return (5,) coefficient per load [1/N, 1/(N m)] at the nominal dynamic pressure."""
    length = inverse_map.reference_length
    per_force = inverse_map.nominal_dynamic_pressure * inverse_map.reference_area
    return 1.0 / (per_force * np.array([1.0, 1.0, 1.0, length, length]))


def coefficient_sources(inverse_map: InverseMap, problem: Problem, solution: Solution) -> CoefficientSources:
    """Return the sources of each coefficient's variance; the map is the one of ``problem`` and ``solution``.

    The sources are the factors of :func:`builder.inverse.loads.covariance.load_error_factors`: each noise term,
    and in Case 2 what the gain does not resolve of the states, which depends on the prior and gamma.
    """
    scale, gain = coefficient_scales(inverse_map), load_gain(inverse_map)
    # The solution's own states: the map may hold only the observable ones.
    load_per_state = problem.load_operator @ solution.field_modes
    of_states, of_noise = load_error_factors(
        solution.solved, load_per_state, gain, solution.noise, inverse_map.strain_load_covariance
    )
    parts = {term.name: part for term, part in zip(solution.noise.terms, of_noise, strict=True)}
    if inverse_map.case == 2:
        parts[OF_STATES] = of_states
    covariance = load_covariance(inverse_map)[FIVE_LOADS, FIVE_LOADS]
    std = np.sqrt(np.diag(covariance))
    return CoefficientSources(
        std=scale * std,
        range=inverse_map.coefficient_range,
        correlation=covariance / np.outer(std, std),
        names=tuple(parts),
        variance=np.stack([scale**2 * np.sum(part[FIVE_LOADS] ** 2, axis=1) for part in parts.values()]),
    )
