"""The pressure field of Case 2: modes that the gauges observe, variance, estimates and samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.pressure_modes import LowRankPrior
from strainfmu.estimator.state_map import GaussianMap, WhitenedSpectrum

NODES_AT_ONCE = 4096
"""Nodes treated together: memory beyond prior and result is the memory of so many rows."""


def data_informed_modes(prior: LowRankPrior, spectrum: WhitenedSpectrum, n_modes: int | None = None) -> FloatArray:
    """Return the first modes b_k = F v_k (n_p, n_modes) [Pa] (paper, eq. eigproblem), by falling eigenvalue.

    b_j^T Z^T Gamma^-1 Z b_k = lambda_k where j = k and 0 elsewhere. By default all modes that the gauges observe.

    Raises
    ------
    InputError
        There are fewer modes.
    """
    available = len(spectrum.singular_values)
    n_modes = available if n_modes is None else n_modes
    if not 1 <= n_modes <= available:
        raise InputError(f"modes: {n_modes} found, must be 1 to {available}")
    modes: FloatArray = prior.factor @ spectrum.right[:, :n_modes]
    return modes


def project_on_modes(
    pressure: FloatArray, mean: FloatArray, modes: FloatArray, weights: FloatArray | None = None
) -> FloatArray:
    """Return the pressures (.., n_p) [Pa] nearest to ``pressure`` in mean + span of ``modes`` (n_p, r).

    The source names no inner product for its projection. Here it is the orthogonal one, which is the best for r
    modes, in the Euclidean norm or in the norm of positive ``weights`` (n_p,).
    """
    root = np.ones(len(mean)) if weights is None else np.sqrt(weights)
    basis, _ = np.linalg.qr(modes * root[:, None])
    nearest: FloatArray = mean + ((pressure - mean) * root) @ basis @ basis.T / root
    return nearest


@dataclass(frozen=True, eq=False)
class FieldVariance:
    """Variance of the pressure at every node.

    Attributes
    ----------
    prior, posterior : (n_p,) before and after the data [Pa^2].
    """

    prior: FloatArray
    posterior: FloatArray

    @property
    def fraction_removed(self) -> FloatArray:
        """(n_p,) 1 - posterior / prior: the fraction determined by the data; 0 where the prior has no variance.

        Negative where a gamma far below 1 makes the estimate worse than the mean.
        """
        fraction = np.zeros(len(self.prior))
        np.divide(self.prior - self.posterior, self.prior, out=fraction, where=self.prior > 0.0)
        return fraction


def field_variance(prior: LowRankPrior, solved: GaussianMap, nodes_at_once: int = NODES_AT_ONCE) -> FieldVariance:
    """Return the prior variance and the variance of the error at every node, some nodes at a time."""
    factor = solved.error_factor()
    before, after = np.empty(len(prior.mean)), np.empty(len(prior.mean))
    for nodes in _blocks(len(prior.mean), nodes_at_once):
        rows = prior.factor[nodes]
        before[nodes] = np.einsum("ij,ij->i", rows, rows)
        of_error = rows @ factor
        after[nodes] = np.einsum("ij,ij->i", of_error, of_error)
    return FieldVariance(before, after)


def estimated_field(prior: LowRankPrior, solved: GaussianMap, strain: FloatArray) -> FloatArray:
    """Return the estimated pressure (.., n_p) [Pa] of ``strain`` (.., n_d) [m/m]."""
    states = strain @ solved.strain_gain.T + solved.state_offset
    field: FloatArray = prior.mean + states @ prior.factor.T
    return field


def posterior_samples(
    prior: LowRankPrior, solved: GaussianMap, strain: FloatArray, n_samples: int, seed: int
) -> FloatArray:
    """Return ``n_samples`` fields (n_samples, n_p) [Pa] round the estimate of one ``strain`` (n_d,) [m/m].

    Their covariance is F R R^T F^T with R of :meth:`GaussianMap.error_factor`; with gamma = 1 they are draws from
    the posterior. Equal seeds give equal samples.
    """
    states = solved.strain_gain @ strain + solved.state_offset
    normal = np.random.default_rng(seed).normal(size=(n_samples, prior.n_states))
    fields: FloatArray = prior.mean + (states + normal @ solved.error_factor().T) @ prior.factor.T
    return fields


def _blocks(n: int, size: int) -> Iterator[slice]:
    return (slice(first, min(first + size, n)) for first in range(0, n, size))
