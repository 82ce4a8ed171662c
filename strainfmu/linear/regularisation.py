"""Choice of gamma: four rules and the L-curve, all on the spectrum of the whitened problem.

With L^-1 A = U S V^T, lambda = S^2 and z = U^T L^-1 (d - m), the residual is
r2(gamma) = sum_k (gamma / (lambda_k + gamma))^2 z_k^2 + |z beyond the spectrum|^2 and the data determine
dof(gamma) = sum_k lambda_k / (lambda_k + gamma) states. Every rule depends on mean squares of z alone, so one
gamma can be chosen for an ensemble of flights.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

Rule = Literal["morozov", "corrected_discrepancy", "gcv", "evidence"]
RULES: tuple[Rule, ...] = get_args(Rule)
"""Names of the rules, see :func:`select_gamma`."""

SMALLEST, LARGEST = 1e-12, 1e12
"""Range of gamma that is searched."""

HALVINGS = 60
"""Of an interval of ln gamma, down to round-off."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DataSpectrum:
    """Statistics of the data that the rules use.

    Attributes
    ----------
    eigenvalues : (k,) lambda, falling.
    mean_square : (k,) mean of z_k^2 over the flights.
    outside : mean of the sum of z^2 beyond k, which no state explains.
    n_gauges : n_d.
    """

    eigenvalues: FloatArray
    mean_square: FloatArray
    outside: float
    n_gauges: int

    def residual(self, gamma: float) -> float:
        """Return the mean of |L^-1 (d - m - A q)|^2."""
        return float(np.sum((gamma / (self.eigenvalues + gamma)) ** 2 * self.mean_square)) + self.outside

    def solution(self, gamma: float) -> float:
        """Return the mean of |q|^2."""
        return float(np.sum(self.eigenvalues * self.mean_square / (self.eigenvalues + gamma) ** 2))

    def degrees_of_freedom(self, gamma: float) -> float:
        """Return the number of states that the data determine."""
        return float(np.sum(self.eigenvalues / (self.eigenvalues + gamma)))


def expected_data(eigenvalues: FloatArray, n_gauges: int) -> DataSpectrum:
    """Return the expected data of prior and noise: E z_k^2 = lambda_k + 1.

    With a prior made of the snapshots these are the means over the snapshots' own strain (but for a factor
    (N - 1) / N) with noise added.

    Parameters
    ----------
    eigenvalues : (k,) lambda, falling, k at most n_d.
    n_gauges : n_d.
    """
    return DataSpectrum(
        eigenvalues=eigenvalues,
        mean_square=eigenvalues + 1.0,
        outside=float(n_gauges - len(eigenvalues)),
        n_gauges=n_gauges,
    )


def measured_data(eigenvalues: FloatArray, whitened_data: FloatArray) -> DataSpectrum:
    """Return the data of measured strain as z = U^T L^-1 (d - m), ``whitened_data`` (.., n_d) [1]."""
    z2 = np.mean(np.atleast_2d(whitened_data) ** 2, axis=0)
    k = len(eigenvalues)
    return DataSpectrum(
        eigenvalues=eigenvalues, mean_square=z2[:k], outside=float(np.sum(z2[k:])), n_gauges=len(z2)
    )


def select_gamma(rule: Rule, data: DataSpectrum) -> float:
    """Return gamma by one of the rules.

    ``morozov``: r2 = n_d (Morozov 1966; the paper's |Z q - d| = sigma sqrt(n_d), here in whitened strain). As the
    estimate has used dof of the data, it smooths more than the noise requires.
    ``corrected_discrepancy``: r2 = n_d - dof, which holds on average at gamma = 1 for a calibrated prior.
    ``gcv``: minimum of r2 / (n_d - dof)^2 (Golub, Heath & Wahba, Technometrics 21, 1979).
    ``evidence``: maximum marginal likelihood of d under q ~ N(0, I/gamma) (MacKay, Neural Computation 4, 1992).
    """
    if rule == "morozov":
        return _root(rule, lambda gamma: data.residual(gamma) - data.n_gauges)
    if rule == "corrected_discrepancy":
        return _root(rule, lambda gamma: data.residual(gamma) - data.n_gauges + data.degrees_of_freedom(gamma))
    if rule == "gcv":
        return _minimum(
            rule,
            lambda gamma: data.residual(gamma) / (data.n_gauges - data.degrees_of_freedom(gamma)) ** 2,
        )
    if rule == "evidence":
        return _minimum(rule, lambda gamma: -log_evidence(data, gamma))
    raise InputError(f"map.gamma: '{rule}' found, must be a positive number or one of {', '.join(RULES)}")


def log_evidence(data: DataSpectrum, gamma: float) -> float:
    """Return the mean log marginal likelihood of d under q ~ N(0, I/gamma), up to a constant."""
    ratio = data.eigenvalues / gamma
    return -0.5 * float(np.sum(data.mean_square / (1.0 + ratio) + np.log1p(ratio)))


@dataclass(frozen=True, eq=False, kw_only=True)
class LCurve:
    """Norm of the residual against norm of the solution (Hansen, Discrete Inverse Problems, 2010, section 4.7).

    Attributes
    ----------
    gamma : (n,) rising.
    residual_norm, solution_norm : (n,) root of the mean of |L^-1 (d - m - A q)|^2 and of |q|^2.
    curvature : (n,) of the curve in logarithms of both norms.
    corner : gamma of the largest curvature. A diagnostic, not a rule: it moves with the noise of one record.
    """

    gamma: FloatArray
    residual_norm: FloatArray
    solution_norm: FloatArray
    curvature: FloatArray
    corner: float


def l_curve(data: DataSpectrum, gamma: FloatArray) -> LCurve:
    """Return the L-curve at ``gamma`` (n,), rising and positive."""
    residual = np.sqrt([data.residual(value) for value in gamma])
    solution = np.sqrt([data.solution(value) for value in gamma])
    t, x, y = np.log(gamma), np.log(residual), np.log(solution)
    dx, dy = np.gradient(x, t), np.gradient(y, t)
    curvature = (dx * np.gradient(dy, t) - dy * np.gradient(dx, t)) / np.maximum(dx**2 + dy**2, 1e-300) ** 1.5
    # Where neither norm changes, the curve has no direction.
    curvature[np.hypot(dx, dy) < 1e-6] = 0.0
    return LCurve(
        gamma=gamma,
        residual_norm=residual,
        solution_norm=solution,
        curvature=curvature,
        corner=float(gamma[int(np.argmax(curvature))]),
    )


def _grid() -> FloatArray:
    return np.logspace(np.log10(SMALLEST), np.log10(LARGEST), 241)


def _root(rule: str, excess: Callable[[float], float]) -> float:
    """Return the largest gamma where ``excess`` goes from negative to positive."""
    grid = _grid()
    value = np.array([excess(gamma) for gamma in grid])
    crossing = np.flatnonzero((value[:-1] < 0.0) & (value[1:] >= 0.0))
    if not len(crossing):
        why = (
            "the misfit stays above the noise: the noise is too small or the model does not hold"
            if value[-1] >= 0.0
            else "the misfit stays below the noise: the noise is too large for these data"
        )
        raise InputError(f"map.gamma: no gamma fulfils '{rule}', {why}")
    low, high = np.log(grid[crossing[-1]]), np.log(grid[crossing[-1] + 1])
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(float(np.exp(middle))) < 0.0 else (low, middle)
    return float(np.exp(0.5 * (low + high)))


def _minimum(rule: str, cost: Callable[[float], float]) -> float:
    """Return the gamma of minimum ``cost``, from a scan and golden sections round its best point (Kiefer 1953)."""
    grid = _grid()
    best = int(np.argmin([cost(gamma) for gamma in grid]))
    if best in (0, len(grid) - 1):
        where = "smallest" if best == 0 else "largest"
        raise InputError(f"map.gamma: '{rule}' finds its optimum at the {where} gamma searched, {grid[best]:g}")
    low, high = np.log(grid[best - 1]), np.log(grid[best + 1])
    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    while high - low > 1e-10:
        lower, upper = high - ratio * (high - low), low + ratio * (high - low)
        if cost(float(np.exp(lower))) < cost(float(np.exp(upper))):
            high = upper
        else:
            low = lower
    return float(np.exp(0.5 * (low + high)))
