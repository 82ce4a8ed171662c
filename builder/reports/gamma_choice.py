"""How strongly a map of Case 2 leans on its prior: the gamma of each rule, and the L-curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.aero.surface_mesh import SurfaceMesh
from builder.inverse.case_2 import GaussianMap, gaussian_map
from builder.inverse.coefficients import load_covariance_by_terms
from builder.inverse.regularisation import LCurve, expected_data, l_curve, select_gamma
from builder.inverse.solution import Problem, Solution
from builder.reports.coefficient_sources import coefficient_scales
from builder.reports.symmetry_classes import class_shares, mirror_operators
from builder.vehicle.gamma_rules import RULES
from builder.vehicle.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.inverse_map import InverseMap

CURVE_DECADES = (-6.0, 6.0)
CURVE_POINTS = 241


@dataclass(frozen=True)
class GammaOfRule:
    """One rule and what its gamma would give.

    Attributes
    ----------
    rule : its name, "this map" for the gamma in use.
    gamma : [1], or None where the rule finds none; ``why_not`` says why.
    degrees_of_freedom : number of states that the data decide.
    n_recoverable : eigenvalues of at least gamma.
    coefficient_std : (5,) sigma [1], or None.
    """

    rule: str
    gamma: float | None
    why_not: str
    degrees_of_freedom: float
    n_recoverable: int
    coefficient_std: FloatArray | None


@dataclass(frozen=True)
class GammaChoice:
    """What the spectrum of a map of Case 2 says.

    Attributes
    ----------
    eigenvalues : (k,) lambda of the prior-preconditioned Hessian, falling.
    filter_factors : (k,) lambda / (lambda + gamma).
    mode_classes : (k, 4) share of each class of symmetry in the modes' pressure, area-weighted [1]; NaN where the
        surface has no such symmetry.
    gamma : in use.
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
    def found(self) -> list[tuple[str, float]]:
        """Name and gamma of the rules that find one, the gamma in use first."""
        return [(one.rule.replace("_", " "), float(one.gamma)) for one in self.rules if one.gamma is not None]


def gamma_choice(
    inverse_map: InverseMap, problem: Problem, solution: Solution, surface: SurfaceGrid | SurfaceMesh
) -> GammaChoice | None:
    """Return what the rules say of a map of Case 2, None of one of Case 1, which has no gamma.

    Data are those that prior and noise lead to expect: the mean over flights like the snapshots'.
    """
    solved = solution.solved
    if not isinstance(solved, GaussianMap):
        return None
    data, loads = expected_data(solved.spectrum), problem.load_operator @ solution.field_modes
    rules = [_at(inverse_map, loads, solution, solved, "this map", solved.regularisation)]
    for rule in RULES:
        try:
            rules.append(_at(inverse_map, loads, solution, solved, rule, select_gamma(rule, data)))
        except InputError as error:
            rules.append(GammaOfRule(rule, None, str(error).partition(", ")[2] or str(error), np.nan, 0, None))
    # Mode j of the Hessian is column j of V among the states: the pressure F V_j.
    pressure = solution.field_modes @ solved.spectrum.right[:, : len(solved.spectrum.singular_values)]
    middle = np.log10(solved.regularisation)
    low, high = min(CURVE_DECADES[0], middle - 2.0), max(CURVE_DECADES[1], middle + 2.0)
    return GammaChoice(
        solved.spectrum.eigenvalues,
        solved.filter_factors,
        class_shares(pressure, problem.node_area, mirror_operators(surface)),
        solved.regularisation,
        tuple(rules),
        l_curve(data, np.logspace(low, high, CURVE_POINTS)),
    )


def _at(
    inverse_map: InverseMap,
    load_per_state: FloatArray,
    solution: Solution,
    solved: GaussianMap,
    rule: str,
    gamma: float,
) -> GammaOfRule:
    other = gaussian_map(
        solved.state_operator, solved.mean_strain, solved.noise_covariance, gamma, solved.spectrum
    )
    covariance = load_covariance_by_terms(
        other, load_per_state, solution.noise, inverse_map.strain_load_covariance
    )
    return GammaOfRule(
        rule,
        gamma,
        "",
        float(np.sum(other.filter_factors)),
        other.n_recoverable,
        coefficient_scales(inverse_map) * np.sqrt(np.diag(covariance)),
    )
