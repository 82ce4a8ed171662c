"""Uncertainty of each coefficient, split by the sources of its variance.

Covariance of estimated loads, for any gain, summed over the noise terms.

The weight of the prior in a map of Case 2: gamma by each rule, and the L-curve.
"""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.inverse.noise.error_list import INSTALLATION, error_named
from builder.inverse.noise.model import NoiseModel
from builder.inverse.solution import Problem, Solution
from builder.reports.findings.prior_observability import class_fractions, mirror_operators
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray, inverse_root
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.gain import load_covariance, load_gain, nominal, state_model
from strainfmu.linear.regularisation import RULES, LCurve, expected_data, l_curve, select_gamma
from strainfmu.linear.state_map import GaussianMap, StateMap, gaussian_map


def load_covariance_by_terms(
    solved: StateMap,
    load_per_state: FloatArray,
    noise: NoiseModel,
    strain_load_covariance: FloatArray | None = None,
) -> FloatArray:
    """Return the (n_f, n_f) covariance of the loads' estimation error [(N, N m)^2].

    The sum of the squares of :func:`load_error_factors` (Joseph's form) holds for any gain and cannot be negative.
    With gamma = 1 it is the posterior covariance.
    :func:`strainfmu.estimator.reference.gain.load_covariance` gives the same from a finished map, which no longer
    holds the terms.

    Parameters
    ----------
    solved : the state map.
    load_per_state : (n_f, n_q) M [N, N m per state].
    noise : the terms that occur; they may differ from those that the gain was weighted with.
    strain_load_covariance : (n_d, n_f) X of the gain G (:func:`~strainfmu.estimator.reference.gain.state_model`);
        None for G = M T.
    """
    operator, noise_covariance = solved.state_operator, solved.noise_covariance
    model = state_model(operator, noise_covariance, solved.regularisation, load_per_state, strain_load_covariance)
    gain = nominal(model).gain
    of_states, of_noise = load_error_factors(solved, load_per_state, gain, noise, strain_load_covariance)
    factor = np.hstack([of_states, *of_noise])
    covariance: FloatArray = factor @ factor.T
    return covariance


def load_error_factors(
    solved: StateMap,
    load_per_state: FloatArray,
    gain: FloatArray,
    noise: NoiseModel,
    strain_load_covariance: FloatArray | None,
) -> tuple[FloatArray, list[FloatArray]]:
    """Return the factors of the error of f = G (d - m) + f_mean, one standard deviation per column [N, N m].

    They are (n_f, j) of the states, and (n_f, k) of each noise term.

    They are G N_i - M_i of each noise term (strain factor N_i, load M_i) and (G A - M) q of the states. A
    truncated mode acts twice, through the strain and by its own load, and the two are correlated.

    Parameters
    ----------
    solved, load_per_state, noise, strain_load_covariance : as of :func:`load_covariance_by_terms`.
    gain : (n_f, n_d) G [N, N m].
    """
    of_states = load_per_state
    if strain_load_covariance is not None and solved.unresolved.size:
        # G A - M = (M - X' Gamma^-1 A) (T A - I), whose last factor is known without cancellation.
        whitening = inverse_root(solved.noise_covariance)
        of_residual = (whitening @ strain_load_covariance).T @ whitening
        of_states = load_per_state - of_residual @ solved.state_operator
    of_noise = [term.by_gain(gain) - (0.0 if term.load is None else term.load) for term in noise.terms]
    return of_states @ solved.unresolved, of_noise


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

    The sources are the factors of :func:`load_error_factors`: each noise term, and in Case 2 what the gain does
    not resolve of the states, which depends on the prior and gamma.
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
    covariance = load_covariance(inverse_map, gain)[FIVE_LOADS, FIVE_LOADS]
    std = np.sqrt(np.diag(covariance))
    return CoefficientSources(
        std=scale * std,
        range=inverse_map.coefficient_range,
        correlation=covariance / np.outer(std, std),
        names=tuple(parts),
        variance=np.stack([scale**2 * np.sum(part[FIVE_LOADS] ** 2, axis=1) for part in parts.values()]),
    )


CURVE_DECADES = (-6.0, 6.0)
CURVE_POINTS = 241


@dataclass(frozen=True, eq=False, kw_only=True)
class GammaOfRule:
    """One rule and the map that its gamma would give.

    Attributes
    ----------
    rule : its name, "this map" for the gamma in use.
    gamma : [1], or None where the rule finds none; ``why_not`` gives the reason.
    degrees_of_freedom : number of states that the data determine.
    n_recoverable : eigenvalues of at least gamma.
    coefficient_std : (5,) sigma [1], or None.
    """

    rule: str
    gamma: float | None
    why_not: str
    degrees_of_freedom: float
    n_recoverable: int
    coefficient_std: FloatArray | None


@dataclass(frozen=True, eq=False, kw_only=True)
class GammaChoice:
    """Gamma of a map of Case 2, and its spectrum.

    Attributes
    ----------
    eigenvalues : (k,) lambda of the prior-preconditioned Hessian, falling.
    filter_factors : (k,) lambda / (lambda + gamma).
    mode_classes : (k, 4) fraction of each class of symmetry in the modes' pressure, area-weighted [1]; NaN where
        the surface has no such symmetry.
    gamma : the value in use.
    rules : the gamma in use first, then every rule.
    curve : the L-curve; a diagnostic.
    """

    eigenvalues: FloatArray
    filter_factors: FloatArray
    mode_classes: FloatArray
    gamma: float
    rules: tuple[GammaOfRule, ...]
    curve: LCurve

    @property
    def rule_gammas(self) -> list[tuple[str, float]]:
        """Name and gamma of the rules that find one, the gamma in use first."""
        return [
            (choice.rule.replace("_", " "), float(choice.gamma))
            for choice in self.rules
            if choice.gamma is not None
        ]


def gamma_choice(
    inverse_map: InverseMap, problem: Problem, solution: Solution, surface: SurfaceGrid | SurfaceMesh
) -> GammaChoice | None:
    """Return gamma by every rule for a map of Case 2; None for a map of Case 1, which has no gamma.

    The data are those expected from prior and noise: the mean over flights like the snapshots'.
    """
    solved = solution.solved
    if not isinstance(solved, GaussianMap):
        return None
    data, loads = (
        expected_data(solved.spectrum.eigenvalues, len(solved.spectrum.left_vectors)),
        problem.load_operator @ solution.field_modes,
    )
    scales = coefficient_scales(inverse_map)

    def of_rule(rule: str, gamma: float) -> GammaOfRule:
        """Return what the map would be with ``gamma``."""
        solved_map = gaussian_map(
            state_operator=solved.state_operator,
            mean_strain=solved.mean_strain,
            noise_covariance=solved.noise_covariance,
            regularisation=gamma,
            spectrum=solved.spectrum,
        )
        covariance = load_covariance_by_terms(
            solved_map, loads, solution.noise, inverse_map.strain_load_covariance
        )
        return GammaOfRule(
            rule=rule,
            gamma=gamma,
            why_not="",
            degrees_of_freedom=float(np.sum(solved_map.filter_factors)),
            n_recoverable=solved_map.n_recoverable,
            coefficient_std=scales * np.sqrt(np.diag(covariance)[FIVE_LOADS]),
        )

    rules = [of_rule("this map", solved.regularisation)]
    for rule in RULES:
        try:
            rules.append(of_rule(rule, select_gamma(rule, data)))
        except InputError as error:
            rules.append(
                GammaOfRule(
                    rule=rule,
                    gamma=None,
                    why_not=str(error).partition(", ")[2] or str(error),
                    degrees_of_freedom=np.nan,
                    n_recoverable=0,
                    coefficient_std=None,
                )
            )
    # Mode j of the Hessian is column j of V among the states: the pressure F V_j.
    pressure = solution.field_modes @ solved.spectrum.right_vectors[:, : len(solved.spectrum.singular_values)]
    middle = np.log10(solved.regularisation)
    low, high = min(CURVE_DECADES[0], middle - 2.0), max(CURVE_DECADES[1], middle + 2.0)
    return GammaChoice(
        eigenvalues=solved.spectrum.eigenvalues,
        filter_factors=solved.filter_factors,
        mode_classes=class_fractions(pressure, problem.node_area, mirror_operators(surface)),
        gamma=solved.regularisation,
        rules=tuple(rules),
        curve=l_curve(data, np.logspace(low, high, CURVE_POINTS)),
    )
