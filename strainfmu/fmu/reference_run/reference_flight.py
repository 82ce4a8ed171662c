"""What every reference run of an estimator is made of, for any map: a flight, and errors about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

_ROUND_OFF = 1e-9
"""Variance, of the largest, below which it is round-off."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ReferenceFlight:
    """A flight of n samples as a map of n_d gauges has it, without errors, and the size of these.

    Attributes
    ----------
    strain : (n, n_d) rows of the map [m/m].
    loads : (n, 5) [N, N m].
    load_per_coefficient : (n, 5) q_inf S and q_inf S L [N, N m].
    covariance : (n, n_d, n_d) of the errors of strain as the map states them [(m/m)^2].
    residual_precision : (n_d, n_d) of what the estimate leaves of the strain, amid the flight [1/(m/m)^2].
    noise_std : (n_d,) of what differs from sample to sample, a part of them [m/m].
    load_strain_covariance : (n, 5, n_d) of their loads with them, as with pressure that no state holds.
    air_data : (n,) true, by name of the output of the FMU.
    """

    strain: FloatArray
    loads: FloatArray
    load_per_coefficient: FloatArray
    covariance: FloatArray
    residual_precision: FloatArray
    noise_std: FloatArray
    load_strain_covariance: FloatArray
    air_data: Mapping[str, FloatArray] = field(default_factory=dict)

    def sample(self, seed: int) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return (n, n_d) strains with errors [m/m], and the true outputs (n,) by name.

        All but the noise belongs to hardware and flow: it lasts, and its load is part of the truth.
        """
        random, (n, n_d) = np.random.Generator(np.random.PCG64(seed)), self.strain.shape
        lasting, noise = random.standard_normal(n_d), random.standard_normal((n, n_d))
        values, vectors = np.linalg.eigh(self.covariance - np.diag(self.noise_std**2))
        values = np.maximum(values, 0.0)
        above = values + _ROUND_OFF * np.max(np.diagonal(self.covariance, axis1=1, axis2=2), axis=1, keepdims=True)
        # The symmetric root, without what is round-off in it, is the only one that every machine finds alike.
        along = values / np.sqrt(above) * np.einsum("kji,j->ki", vectors, lasting)
        strain = np.einsum("kij,kj->ki", vectors, along)
        weighted = along / above
        loads = np.einsum("kli,kij,kj->kl", self.load_strain_covariance, vectors, weighted, optimize=True)
        coefficients = (self.loads + loads) / self.load_per_coefficient
        truth = dict(zip(COEFFICIENT_NAMES, coefficients.T, strict=True))
        return self.strain + strain + self.noise_std * noise, {**truth, **self.air_data}


def white_noise(noise_std: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (n_d,) ``noise_std`` as far as the ``covariance`` (n_d, n_d) of the gauges includes it."""
    included = np.linalg.eigvalsh(covariance / np.outer(noise_std, noise_std))[0]
    return np.asarray(noise_std * np.sqrt(np.clip(included, 0.0, 1.0)))
