"""Covariance Gamma of the strain that the pressure states do not explain, term by term.

Each term is a factor N of its covariance N N^T: strain at one standard deviation, column by column. This
marginalises the quantity behind the term: it is estimated implicitly and dropped (Kaipio & Somersalo, Statistical
and Computational Inverse Problems, 2005, section 5.8).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator

from strainfmu.arrays import FloatArray, inverse_root
from strainfmu.errors import InputError
from strainfmu.linear.pressure_modes import PressureModes
from strainfmu.linear.state_map import check_covariance


@dataclass(frozen=True, eq=False)
class NoiseTerm:
    """One source of strain error, independent of the others and of the states.

    Attributes
    ----------
    name : for reports.
    strain : (n_d, k) columns of strain at one standard deviation [m/m], or (n_d,) where each gauge has an error of
        its own.
    load : (n_f, k) loads [N, N m] of the same columns that no state holds, or None where there are none.
    scales : whether the term grows with the dynamic pressure, as errors in proportion to strain do.
    hardware : whether it is an error of the vehicle and its gauges as built.
    """

    name: str
    strain: FloatArray
    load: FloatArray | None = None
    scales: bool = False
    hardware: bool = False

    @property
    def is_own(self) -> bool:
        """Whether each gauge has an error of its own."""
        return self.strain.ndim == 1

    @property
    def columns(self) -> FloatArray:
        """(n_d, k) columns of strain, of errors of each gauge too [m/m]."""
        return np.diag(self.strain) if self.is_own else self.strain

    @property
    def variance(self) -> FloatArray:
        """(n_d,) of the strain [(m/m)^2]."""
        return self.strain**2 if self.is_own else np.sum(self.strain**2, axis=1)

    @property
    def covariance(self) -> FloatArray:
        """(n_d, n_d) of the strain [(m/m)^2]."""
        return np.diag(self.strain**2) if self.is_own else self.strain @ self.strain.T

    def by_gain(self, gain: FloatArray) -> FloatArray:
        """Return (m, k) what ``gain`` (m, n_d) makes of each column of strain."""
        return gain * self.strain if self.is_own else np.asarray(gain @ self.strain)

    def draw(self, random: np.random.Generator, n: int) -> FloatArray:
        """Return (n, n_d) strain of ``n`` draws [m/m]."""
        sizes = random.standard_normal((n, self.strain.shape[-1]))
        return sizes * self.strain if self.is_own else sizes @ self.strain.T

    def whitened(self, rows: FloatArray) -> FloatArray:
        """Return ``rows`` (n_d, m) over errors of this term, a square root of its covariance."""
        return rows / self.strain[:, None] if self.is_own else np.asarray(np.linalg.solve(self.strain, rows))

    def padded(self, above: int, below: int) -> NoiseTerm:
        """Return the term with rows of no strain ahead of its own and behind them."""
        rows = ((above, below),) if self.is_own else ((above, below), (0, 0))
        return replace(self, strain=np.pad(self.strain, rows))

    def strain_and_load(self, n_loads: int) -> FloatArray:
        """Return (n_d + n_loads, k) the columns of strain, and of load below."""
        load = np.zeros((n_loads, self.strain.shape[-1])) if self.load is None else self.load
        return np.vstack([self.columns, load])


UNSEEN = 1e-5
"""Size of a column of errors, over the noise of all gauges, of which their covariance does without."""


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """All terms together."""

    terms: tuple[NoiseTerm, ...]

    @cached_property
    def _parts(self) -> tuple[FloatArray, FloatArray] | None:
        """(n_d,) variance of the errors of each gauge, and (n_d, k) columns of all others over its root.

        None where some gauge has no noise of its own that is independent of the others'.
        """
        if not self.terms[0].is_own:
            return None
        variance = np.sum([term.strain**2 for term in self.terms if term.is_own], axis=0)
        root = np.sqrt(variance)[:, None]
        common = [term.strain / root for term in self.terms if not term.is_own]
        return variance, principal_columns([np.zeros((len(variance), 0)), *common], UNSEEN)

    @cached_property
    def covariance(self) -> FloatArray:
        """(n_d, n_d) Gamma, the sum of all terms' covariances [(m/m)^2]."""
        if self._parts is None:
            return np.asarray(sum(term.covariance for term in self.terms))
        variance, columns = self._parts
        strain = np.sqrt(variance)[:, None] * columns
        covariance = strain @ strain.T
        covariance[np.diag_indices(len(variance))] += variance
        return np.asarray(covariance)

    @cached_property
    def whitening(self) -> FloatArray | LinearOperator:
        """(n_d, n_d) W with W' W = Gamma^-1: it makes errors independent and of unit size.

        Of independent errors D and columns, D^-1/2 N = U S V', it is (I - U (1 - (1 + S^2)^-1/2) U') D^-1/2.

        Raises
        ------
        InputError
            The covariance is not positive definite.
        """
        if self._parts is None:
            check_covariance(self.covariance)
            return inverse_root(self.covariance)
        variance, columns = self._parts
        root, size = np.sqrt(variance), np.linalg.norm(columns, axis=0)
        weighted = (columns / size**2) * (1.0 - 1.0 / np.hypot(1.0, size))

        def whitened(rows: FloatArray) -> FloatArray:
            over_own = (rows.T / root).T
            return np.asarray(over_own - weighted @ (columns.T @ over_own))

        def transposed(rows: FloatArray) -> FloatArray:
            return np.asarray(((rows - columns @ (weighted.T @ rows)).T / root).T)

        products = {"matvec": whitened, "matmat": whitened, "rmatvec": transposed, "rmatmat": transposed}
        return LinearOperator((len(variance), len(variance)), **products, dtype=variance.dtype)

    @cached_property
    def _precision(self) -> FloatArray:
        """(n_d,) the diagonal of Gamma^-1 [1/(m/m)^2]."""
        if self._parts is None:
            return np.asarray(np.sum(self.whitening**2, axis=0))
        variance, columns = self._parts
        square = columns**2
        return np.asarray((1.0 - square @ (1.0 / (1.0 + square.sum(axis=0)))) / variance)

    def fractions(self) -> list[dict[str, Any]]:
        """Return, per term, its name, ``share`` tr(Gamma^-1 Gamma_term) / n_d of the whitened variance [1], and
        ``rms_strain``, the root of the mean variance over the gauges [m/m]. The fractions add up to 1.
        """
        n_gauges = len(self._precision)

        def whitened_variance(term: NoiseTerm) -> float:
            if term.is_own:
                return float(self._precision @ term.variance)
            return float(np.sum((self.whitening @ term.strain) ** 2))

        return [
            {
                "name": term.name,
                "share": whitened_variance(term) / n_gauges,
                "rms_strain": float(np.sqrt(np.sum(term.strain**2) / n_gauges)),
            }
            for term in self.terms
        ]


def fixed_covariance(terms: Iterable[NoiseTerm], without: Collection[str] = ()) -> FloatArray:
    """Return (n_d, n_d) of ``terms`` that do not follow the pressure, leaving out the names ``without``."""
    first, *following = (term for term in terms if not term.scales and term.name not in without)
    covariance = first.covariance
    for term in following:  # in place: of many gauges large arrays
        if term.is_own:
            covariance[np.diag_indices(len(covariance))] += term.variance
        else:
            covariance += term.covariance
    return covariance


def gauge_noise(covariance: FloatArray) -> NoiseTerm:
    """Return the term of the gauges' own noise with ``covariance`` (n_d, n_d) [(m/m)^2], diagonal or full.

    Raises
    ------
    InputError
        The matrix is not symmetric and positive definite.
    """
    check_covariance(covariance)
    variance = np.diag(covariance)
    is_own = np.count_nonzero(covariance) == len(variance)
    root = np.sqrt(variance) if is_own else np.linalg.cholesky(covariance)
    return NoiseTerm("gauge noise", np.asarray(root, dtype=np.float64))


def truncated_modes(
    strain_of_modes: FloatArray, load_of_modes: FloatArray, modes: PressureModes, n_states: int
) -> NoiseTerm:
    """Return the term of the POD modes beyond the first ``n_states``, at their spread over the snapshots.

    Parameters
    ----------
    strain_of_modes : (n_d, k) Z_p V of all modes [1/Pa].
    load_of_modes : (n_f, k) G C_map V of all modes [N/Pa, N m/Pa].
    modes : POD of the snapshots.
    n_states : number of modes that are states.
    """
    std = modes.coefficient_std[n_states:]
    strain, load = strain_of_modes[:, n_states:] * std, load_of_modes[:, n_states:] * std
    return NoiseTerm("truncated modes", strain, load, scales=True)


def pressure_errors(name: str, fields: FloatArray, strain: FloatArray, load: FloatArray) -> NoiseTerm:
    """Return the term of pressure ``fields`` (k, n_p) at one standard deviation that no state holds [Pa].

    Their strain and loads follow by the operators ``strain`` (n_d, n_p), ``load`` (n_f, n_p).
    """
    return NoiseTerm(name, strain @ fields.T, load @ fields.T, scales=True)


def nuisance_modes(name: str, strain: FloatArray, std: FloatArray) -> NoiseTerm:
    """Return a term of ``strain`` columns (n_d, k) per unit of quantities with standard deviations ``std`` (k,).

    For thermal strain a column is the apparent strain of one temperature distribution: of the gauges and of the
    structure together.

    Raises
    ------
    InputError
        A value is not finite, or a standard deviation is negative.
    """
    if strain.ndim != 2 or std.shape != strain.shape[1:]:
        raise InputError(
            f"noise term '{name}': strain {strain.shape}, std {std.shape} found, must be (n_d, k), (k,)"
        )
    return _finite_term(name, strain, std)


def _finite_term(name: str, strain: FloatArray, std: FloatArray | float) -> NoiseTerm:
    if not (np.all(np.isfinite(strain)) and np.all(np.isfinite(std)) and np.all(np.asarray(std) >= 0.0)):
        raise InputError(f"noise term '{name}': values must be finite and standard deviations at least 0")
    return NoiseTerm(name, strain * std)


def gauge_errors(name: str, sensitivity: FloatArray, std: float, weight: FloatArray | None = None) -> NoiseTerm:
    """Return the term of an error that is independent from gauge to gauge, to first order.

    The strain error of gauge i is g_i s_ij in flight j, with g_i of standard deviation ``std``; its variance is
    averaged over the flights. For gains s is the strain itself; for position and orientation its derivative.

    Parameters
    ----------
    name : for reports.
    sensitivity : (N, n_d) strain error per unit of the gauge's error, over N flights [m/m per unit].
    std : standard deviation of the gauge's error [unit].
    weight : (N,) of the flights in the mean, adding up to 1; None for equal ones.

    Raises
    ------
    InputError
        A value is not finite, or the standard deviation is negative.
    """
    rms = np.sqrt(np.average(sensitivity**2, axis=0, weights=weight))
    return replace(_finite_term(name, rms, std), scales=True, hardware=True)


def common_error(name: str, blocks: Sequence[FloatArray]) -> NoiseTerm:
    """Return the term of one error that all gauges have in common, such as an error of the wall's thickness.

    Its covariance is the mean of s s' over the strains s of many flights, the sum of the covariances of ``blocks``
    (n_d, k) of columns [m/m].
    """
    columns = principal_columns(blocks, FAINT_COLUMN * size_of(blocks))
    return replace(nuisance_modes(name, columns, np.ones(columns.shape[1])), scales=True, hardware=True)


FAINT_COLUMN = 5e-7
"""Size, over all of its columns, of a column that errors in many flows do without."""


def size_of(blocks: Sequence[FloatArray]) -> float:
    """Return the size of all columns of ``blocks`` together, the root of their sum of squares."""
    return float(np.sqrt(sum(np.sum(block**2) for block in blocks)))


def principal_columns(blocks: Sequence[FloatArray], least: float) -> FloatArray:
    """Return (m, k) orthogonal columns whose covariance is the sum of the covariances of ``blocks`` (m, n) of
    columns, but for columns up to ``least``.

    Of a block few columns are significant: it is reduced to them by itself first, at a tenth of the limit.
    """
    return _left_factor(np.hstack([_left_factor(block, 0.1 * least) for block in blocks]), least)


def _left_factor(columns: FloatArray, least: float) -> FloatArray:
    """Return U S (m, k) of ``columns`` (m, n) = U S V', the sizes above ``least``, falling: the columns times V.

    The triangular factor R of the columns has the same V and S, at half the cost where m is large.
    """
    _, size, right = np.linalg.svd(np.linalg.qr(columns, mode="r"), full_matrices=False)
    return np.asarray(columns @ right[size > least].T)
