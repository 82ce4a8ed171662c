"""The pressure field of Case 2: what the gauges see of it, what is left uncertain, and samples of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from builder.inverse.case_2 import GaussianMap, WhitenedSpectrum
from builder.inverse.prior import LowRankPrior
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

NODES_AT_ONCE = 4096
"""Nodes treated together: memory beyond prior and result stays of this many rows."""


def data_informed_modes(prior: LowRankPrior, spectrum: WhitenedSpectrum, n_modes: int | None = None) -> FloatArray:
    """Return the first modes b_k = F v_k (n_p, n_modes) [Pa] (paper, eq. eigproblem), by falling eigenvalue.

    b_j^T Z^T Gamma^-1 Z b_k = lambda_k where j = k and 0 elsewhere. By default all that a gauge sees.

    Raises
    ------
    InputError
        There are fewer modes.
    """
    most = len(spectrum.singular_values)
    n_modes = most if n_modes is None else n_modes
    if not 1 <= n_modes <= most:
        raise InputError(f"modes: {n_modes} found, must be 1 to {most}")
    modes: FloatArray = prior.factor @ spectrum.right[:, :n_modes]
    return modes


def project_on_modes(
    pressure: FloatArray, mean: FloatArray, modes: FloatArray, weights: FloatArray | None = None
) -> FloatArray:
    """Return the pressures (.., n_p) [Pa] nearest to ``pressure`` in mean + span of ``modes`` (n_p, r).

    The published projection names no inner product; here it is the orthogonal one, the best that r modes can do,
    in the Euclidean norm or in that of positive ``weights`` (n_p,).
    """
    root = np.ones(len(mean)) if weights is None else np.sqrt(weights)
    basis, _ = np.linalg.qr(modes * root[:, None])
    nearest: FloatArray = mean + ((pressure - mean) * root) @ basis @ basis.T / root
    return nearest


@dataclass(frozen=True)
class FieldVariance:
    """Variance of the pressure at every node.

    Attributes
    ----------
    prior, posterior : (n_p,) before and after the data [Pa^2].
    """

    prior: FloatArray
    posterior: FloatArray

    @property
    def share_removed(self) -> FloatArray:
        """(n_p,) 1 - posterior / prior: what was measured there; 0 where the prior has no variance.

        Negative where a gamma far below 1 makes the estimate worse than the mean.
        """
        share = np.zeros(len(self.prior))
        np.divide(self.prior - self.posterior, self.prior, out=share, where=self.prior > 0.0)
        return share


def field_variance(prior: LowRankPrior, solved: GaussianMap, nodes_at_once: int = NODES_AT_ONCE) -> FieldVariance:
    """Return prior variance and variance of the error at every node, a chunk of nodes at a time."""
    factor = solved.error_factor()
    before, after = np.empty(len(prior.mean)), np.empty(len(prior.mean))
    for nodes in _chunks(len(prior.mean), nodes_at_once):
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


def _chunks(n: int, size: int) -> Iterator[slice]:
    return (slice(first, min(first + size, n)) for first in range(0, n, size))
