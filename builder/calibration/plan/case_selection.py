"""Which load cases to apply: each next one is that which leaves the smallest sigmas of the coefficients in flight.

What a case teaches of the vehicle as built follows from the linear model of the calibration (Bayes' rule for a
normal prior); what that is worth in flight from the estimator's own weights. The readings are not needed.

Source: Fedorov, Theory of Optimal Experiments, 1972 (sequential design); for ground tests Lokos and Stauf, NASA
TM-2004-212853, who chose among cases that were applied.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.sparse import csr_array

from builder.reporting import Progress
from strainfmu.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class CaseSensitivity:
    """What a load case would determine.

    Attributes
    ----------
    jacobian : (n_d, n) reading per parameter, each at one standard deviation of its prior [m/m].
    error : (n_d, k) reading per error of the case's own loads, at one standard deviation each [m/m].
    noise_std : (n_d,) of a reading [m/m].
    """

    jacobian: csr_array
    error: FloatArray
    noise_std: FloatArray

    @property
    def noise_covariance(self) -> FloatArray:
        """(n_d, n_d) of what the parameters do not explain [(m/m)^2]."""
        return np.asarray(np.diag(self.noise_std**2) + self.error @ self.error.T)


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightSensitivity:
    """What the parameters do in flight.

    Attributes
    ----------
    jacobian : of each of the flights, (n_d, n) strain per parameter at one standard deviation of its prior [m/m].
    state_operator : (n_d, n_q) strain per state of the map.
    noise_covariance : (n_d, n_d) of a vehicle known exactly [(m/m)^2].
    regularisation : of the map, 0 in Case 1.
    coefficient_per_state : (5, n_q) [1].
    """

    jacobian: tuple[csr_array, ...]
    state_operator: FloatArray
    noise_covariance: FloatArray
    regularisation: float
    coefficient_per_state: FloatArray

    def sigmas(self, error_covariance: FloatArray) -> FloatArray:
        """Return sigma (5,) of the coefficients where the structure's errors leave a covariance (n_d, n_d) of
        strain."""
        factor = cho_factor(self.noise_covariance + error_covariance)
        size = np.linalg.norm(self.state_operator, axis=0)
        scaled = self.state_operator / size
        information = scaled.T @ cho_solve(factor, scaled) + np.diag(self.regularisation / size**2)
        part = self.coefficient_per_state / size
        return np.sqrt(np.einsum("cq,qc->c", part, np.linalg.solve(information, part.T)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Knowledge:
    """What is known of the parameters so far.

    Attributes
    ----------
    flight : what the parameters do in flight.
    covariance : (n, n) of the parameters over their priors.
    """

    flight: FlightSensitivity
    covariance: FloatArray

    def after(self, case: CaseSensitivity) -> Knowledge:
        """Return what is known when a case has been applied."""
        cross = (case.jacobian @ self.covariance).T
        factor = cho_factor(case.jacobian @ cross + case.noise_covariance)
        covariance = self.covariance - cross @ cho_solve(factor, cross.T)
        return Knowledge(flight=self.flight, covariance=0.5 * (covariance + covariance.T))

    @cached_property
    def error_covariance(self) -> FloatArray:
        """(n_d, n_d) covariance of strain that the parameters leave, averaged over the flights."""
        return np.mean([slope @ (slope @ self.covariance).T for slope in self.flight.jacobian], axis=0)

    @property
    def sigmas(self) -> FloatArray:
        """(5,) of the coefficients in flight [1]."""
        return self.flight.sigmas(self.error_covariance)

    def sigmas_after(self, case: CaseSensitivity) -> FloatArray:
        """Return :attr:`sigmas` when a case has been applied."""
        cross = case.jacobian @ self.covariance
        root = np.linalg.cholesky(case.jacobian @ cross.T + case.noise_covariance)
        known = solve_triangular(root, cross, lower=True).T
        determined = [slope @ known for slope in self.flight.jacobian]
        return self.flight.sigmas(self.error_covariance - np.mean([part @ part.T for part in determined], axis=0))


def no_knowledge(flight: FlightSensitivity) -> Knowledge:
    """Return what the priors say."""
    return Knowledge(flight=flight, covariance=np.eye(flight.jacobian[0].shape[1]))


def select_cases(
    start: Knowledge,
    candidates: Sequence[CaseSensitivity],
    count: int,
    progress: Progress | None = None,
    once: bool = False,
) -> list[tuple[int, Knowledge]]:
    """Return ``count`` cases by their numbers, each the best next one, and what is known after each.

    The best one leaves the smallest product of the five sigmas. A candidate may be chosen again, which averages
    its noise, or ``once``, while there are any. Worths are taken to fall from case to case: a candidate whose last
    known worth is below one that is already up to date is not worked out (lazy greedy; Minoux, 1978).
    """
    known, chosen = start, list[tuple[int, Knowledge]]()
    worth = np.full(len(candidates), np.inf)
    for done in range(min(count, len(candidates)) if once else count):
        level, fresh = log_product(known.sigmas), np.zeros(len(worth), dtype=bool)
        while not fresh[best := int(np.argmax(worth))]:
            worth[best], fresh[best] = level - log_product(known.sigmas_after(candidates[best])), True
        known = known.after(candidates[best])
        chosen.append((best, known))
        worth[best] = -np.inf if once else worth[best]
        if progress is not None:
            progress(done + 1, count)
    return chosen


def log_product(sigmas: FloatArray) -> float:
    """Return the logarithm of the product of the five sigmas."""
    return float(np.sum(np.log(sigmas)))
