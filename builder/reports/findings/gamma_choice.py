"""The weight of the prior in a map of Case 2: gamma by each rule, and the L-curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.inverse.loads.covariance import load_covariance_by_terms
from builder.inverse.solution import Problem, Solution
from builder.reports.findings.coefficient_sources import coefficient_scales
from builder.reports.findings.symmetry_classes import class_fractions, mirror_operators
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.linear.regularisation import RULES, LCurve, expected_data, l_curve, select_gamma
from strainfmu.linear.state_map import GaussianMap, gaussian_map

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
