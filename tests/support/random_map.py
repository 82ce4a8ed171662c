"""Maps made of random numbers, for tests of the run-time alone; their matrices by the book, from scipy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from strainfmu.estimator.map.inverse_map import InverseMap

N_GAUGES = 8
N_STATES = 3


@dataclass(frozen=True)
class GaussianModel:
    """d = m + A q + e, f = f_mean + M q + g; e and g jointly Gaussian, gamma = 0 where q is free.

    Attributes
    ----------
    a, m : (n_d, n_q) A, (n_d,) m.
    noise_covariance : (n_d, n_d) Gamma of e.
    gamma : what the estimate is made with.
    load_per_state, load_of_mean : (5, n_q) M, (5,) f_mean.
    strain_load_covariance : (n_d, 5) cov(e, g).
    load_noise_covariance : (5, 5) cov(g).
    """

    a: np.ndarray
    m: np.ndarray
    noise_covariance: np.ndarray
    gamma: float
    load_per_state: np.ndarray
    load_of_mean: np.ndarray
    strain_load_covariance: np.ndarray
    load_noise_covariance: np.ndarray

    def without(self, missing: np.ndarray) -> GaussianModel:
        """The same vehicle without the gauges ``missing`` (n_d,) of bool."""
        keep = ~missing
        return replace(
            self,
            a=self.a[keep],
            m=self.m[keep],
            noise_covariance=self.noise_covariance[np.ix_(keep, keep)],
            strain_load_covariance=self.strain_load_covariance[keep],
        )

    def columns(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(n_d, n_d) covariance of errors without load, (n_d, 5) strain and (5, 5) load of errors with load."""
        load = cholesky(self.load_noise_covariance, lower=True)
        strain = solve_triangular(load, self.strain_load_covariance.T, lower=True).T
        return self.noise_covariance - strain @ strain.T, strain, load

    def gain(self) -> np.ndarray:
        """(n_q, n_d) T, from the normal equations of states scaled to unit sensitivity."""
        weight = cho_solve((cholesky(self.noise_covariance, lower=True), True), np.eye(len(self.m)))
        hessian = self.a.T @ weight @ self.a + self.gamma * np.eye(self.a.shape[1])
        size = np.sqrt(np.diag(hessian))
        scaled = hessian / np.outer(size, size)
        return np.linalg.solve(scaled, self.a.T @ weight / size[:, None]) / size[:, None]

    def load_gain(self) -> np.ndarray:
        """(5, n_d) G by the joint Gaussian: states by T, and E(g | e) of what they leave."""
        of_residual = np.linalg.solve(self.noise_covariance, self.strain_load_covariance).T
        return self.load_per_state @ self.gain() + of_residual @ (np.eye(len(self.m)) - self.a @ self.gain())

    def precision(self) -> np.ndarray:
        """(n_d, n_d) P of d - m by the model: whatever gamma, the prior is standard normal."""
        if self.gamma > 0.0:
            whitening = self.whitening()
            return whitening.T @ whitening
        weight = cho_solve((cholesky(self.noise_covariance, lower=True), True), np.eye(len(self.m)))
        return weight - weight @ self.a @ self.gain()

    def whitening(self) -> np.ndarray:
        """(n_d, n_d) W, W' W = P: the inverse Cholesky factor of d's covariance, or the symmetric root of P."""
        if self.gamma > 0.0:
            covariance = self.noise_covariance + self.a @ self.a.T
            return solve_triangular(cholesky(covariance, lower=True), np.eye(len(self.m)), lower=True)
        std = np.sqrt(np.diag(self.noise_covariance))
        values, vectors = np.linalg.eigh(self.precision() * np.outer(std, std))
        values[: self.a.shape[1]] = 0.0  # a projection's: but for round-off they are
        return (vectors * np.sqrt(values)) @ vectors.T / std

    def load_covariance(self) -> np.ndarray:
        """(5, 5) covariance of the error of G (d - m) + f_mean, term by term."""
        gain = self.load_gain()
        cross = gain @ self.strain_load_covariance
        covariance = gain @ self.noise_covariance @ gain.T - cross - cross.T + self.load_noise_covariance
        if self.gamma > 0.0:
            bias = self.load_per_state - gain @ self.a
            covariance = covariance + bias @ bias.T
        return covariance

    def draw(self, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """(n, n_d) strains and (n, 5) loads."""
        random = np.random.default_rng(seed)
        x = self.strain_load_covariance
        joint = np.block([[self.noise_covariance, x], [x.T, self.load_noise_covariance]])
        size = np.sqrt(np.diag(joint))
        root = size[:, None] * cholesky(joint / np.outer(size, size), lower=True)
        error = random.normal(size=(n, len(joint))) @ root.T
        q = random.normal(size=(n, self.a.shape[1]))
        strain = self.m + q @ self.a.T + error[:, : len(self.m)]
        return strain, self.load_of_mean + q @ self.load_per_state.T + error[:, len(self.m) :]


def random_model(
    gamma: float = 0.0, full: bool = True, n_gauges: int = 27, n_states: int = 5, seed: int = 1
) -> GaussianModel:
    """States of falling strain, 300 to 3 sigma; ``full``: truncated modes up to 10 sigma, which carry load too."""
    random = np.random.default_rng(seed)
    sigma = 2e-7 * random.uniform(0.5, 2.0, n_gauges)
    a = 2e-7 * random.normal(size=(n_gauges, n_states)) * np.geomspace(300.0, 3.0, n_states)
    truncated = 2e-7 * random.normal(size=(n_gauges, 6)) * np.geomspace(10.0, 0.1, 6)
    truncated *= float(full)
    of_truncated = random.normal(size=(5, 6)) * float(full)
    return GaussianModel(
        a,
        1e-5 * random.normal(size=n_gauges),
        np.diag(sigma**2) + truncated @ truncated.T,
        gamma,
        10.0 * random.normal(size=(5, n_states)),
        100.0 * random.normal(size=5),
        truncated @ of_truncated.T,
        of_truncated @ of_truncated.T + np.eye(5) * 1e-2,
    )


def map_of(model: GaussianModel, name: str = "vehicle") -> InverseMap:
    """The finished map of ``model``."""
    n_gauges = len(model.a)
    covariance, error_strain, error_load = model.columns()
    return InverseMap(
        vehicle=name,
        case=2 if model.gamma > 0.0 else 1,
        gauge_names=tuple(f"G{i}" for i in range(n_gauges)),
        gauge_position=np.random.default_rng(2).normal(size=(n_gauges, 3)),
        gauge_direction=np.tile([1.0, 0.0, 0.0], (n_gauges, 1)),
        noise_std=np.sqrt(np.diag(model.noise_covariance)),
        state_operator=model.a,
        gauge_covariance=covariance,
        error_strain=error_strain,
        error_load=error_load,
        regularisation=model.gamma,
        load_per_state=model.load_per_state,
        load_of_mean=model.load_of_mean,
        mean_strain=model.m,
        strain_range=np.full(n_gauges, 1e-4),
        coefficient_range=np.tile([-1.0, 1.0], (5, 1)),
        reference_area=0.2,
        reference_length=0.5,
        nominal_dynamic_pressure=1.2e5,
        provenance={"layout": "test", "mach_number": [5.0, 7.0]},
    )


def random_map(seed: int = 1) -> InverseMap:
    """A map of Case 1 with 8 gauges and 3 states."""
    model = random_model(full=False, n_gauges=N_GAUGES, n_states=N_STATES, seed=seed)
    return map_of(model, f"vehicle {seed} – Ω")


def missing(n_gauges: int, *gauges: int) -> np.ndarray:
    """(n_gauges,) true for ``gauges``."""
    mask = np.zeros(n_gauges, dtype=bool)
    mask[list(gauges)] = True
    return mask


def nothing_of(*names: str) -> dict[str, Any]:
    """Return changes of a map, for :func:`dataclasses.replace`, that leave its fields ``names`` out."""
    return dict.fromkeys(names)
