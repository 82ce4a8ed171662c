"""The Gaussian prior of Case 2 as a factor F: Gamma_pr = F F^T is never formed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.inverse.modes.pod import PressureModes, mean_snapshot
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False)
class LowRankPrior:
    """p = mean + F q with q standard normal (paper, eq. prior_cov: Gamma_pr = F F^T).

    Attributes
    ----------
    mean : (n_p,) p_bar [Pa].
    factor : (n_p, n_q) F [Pa].
    """

    mean: FloatArray
    factor: FloatArray

    @property
    def n_states(self) -> int:
        return self.factor.shape[1]


def prior_of_snapshots(snapshots: FloatArray) -> LowRankPrior:
    """Return the prior of ``snapshots`` (N, n_p) [Pa]: F = (p_j - p_bar) / sqrt(N - 1), N states.

    Raises
    ------
    InputError
        Fewer than two snapshots, or snapshots that are all equal.
    """
    mean = mean_snapshot(snapshots)
    factor = snapshots - mean
    factor /= np.sqrt(len(snapshots) - 1)
    if np.linalg.norm(factor) <= 1e-10 * np.linalg.norm(mean):
        raise InputError("the snapshots are all equal: no prior")
    return LowRankPrior(mean, factor.T)


def prior_of_modes(modes: PressureModes, n_modes: int) -> LowRankPrior:
    """Return the prior truncated to the first ``n_modes`` POD modes: F = V_r diag(standard deviations).

    Raises
    ------
    InputError
        The snapshots hold fewer modes.
    """
    available = modes.modes.shape[1]
    if not 1 <= n_modes <= available:
        raise InputError(
            f"map.prior_modes: {n_modes} found, at most {available} with {modes.n_snapshots} snapshots"
        )
    return LowRankPrior(modes.mean, modes.modes[:, :n_modes] * modes.coefficient_std()[:n_modes])
