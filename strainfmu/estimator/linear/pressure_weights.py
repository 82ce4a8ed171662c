"""Estimate, covariance and residual at any dynamic pressure, with any gauges lost, from one decomposition.

With R the lost gauges, the model predicts their residual from the others: with D = diag(sqrt(u)), it is the r_R
that makes |D (w_K + V_R r_R)| least. The unchanged gain, fed with that prediction, gives the estimate of a map
without R (:mod:`strainfmu.estimator.linear.masks`); the covariance grows by J P_RR^-1 J', J the gain's columns R,
P_RR = V_R' D^2 V_R. A QR decomposition of D V_R stands for P_RR throughout. Formulas of all gauges:
:mod:`strainfmu.estimator.linear.decomposition`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.linear.decomposition import Decomposition

ROWS = 64
"""Samples of one matrix product. For larger ones BLAS starts threads, which cost more than they save here."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledEstimate:
    """What strain says of the loads, for k samples with the same gauges in use.

    Attributes
    ----------
    loads : (k, 5) what strain adds to f_0 + s f_mean [N, N m].
    load_covariance : (k, 5, 5) [(N, N m)^2].
    chi_square : (k,) [1].
    standardised_residual : (k, n_d) z [1]; 0 for lost gauges and those that no other checks.
    load_per_pressure : (k, 5) derivative by s, at fixed weights, of the loads that strain adds to f_0 + s f_mean
        [N, N m].
    further : (k, m) the same loads of the m further ones; variances alone.
    """

    loads: FloatArray
    load_covariance: FloatArray
    chi_square: FloatArray
    standardised_residual: FloatArray
    load_per_pressure: FloatArray
    further: FloatArray
    further_variance: FloatArray
    further_per_pressure: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class PressureWeights:
    """Weights at k pressure ratios.

    Attributes
    ----------
    unresolved : (k, n_d) u [1]: the fraction of the prior variance that the data leave; 0 for free directions.
    load_per_direction : (k, n_l, n_d) loads per whitened strain w [N, N m], the further ones last.
    load_covariance : (k, 5, 5) of the five loads [(N, N m)^2].
    further_variance : (k, n_l - 5) [(N, N m)^2].
    lost_basis : (k, n_d, m) Q of D V_R = Q T, or None where no gauge is lost.
    lost_triangle : (k, m, m) T [1/(m/m)], or None.
    """

    unresolved: FloatArray
    load_per_direction: FloatArray
    load_covariance: FloatArray
    further_variance: FloatArray
    lost_basis: FloatArray | None
    lost_triangle: FloatArray | None


def pressure_weights(parts: Decomposition, pressure_ratio: FloatArray, lost: BoolArray) -> PressureWeights:
    """Return the weights at ``pressure_ratio`` s (k,) without the gauges ``lost`` (n_d,).

    The lost gauges must leave the states identified.
    """
    s, root = pressure_ratio[:, None], parts.singular_values
    scaled = s * root
    unresolved = 1.0 / (1.0 + scaled * scaled)
    unresolved[:, : parts.n_free] = 0.0
    weight = s * scaled * unresolved
    weight[:, : parts.n_free] = 1.0
    per_direction = weight[:, None, :] * parts.load_per_direction
    spread = (s * s) * unresolved
    spread[:, : parts.n_free] = 1.0
    n = parts.load_per_direction.shape[1]
    five, further = parts.load_per_direction[:5], parts.load_per_direction[5:]
    squares = five[:, None, :] * five[None, :, :]
    covariance = (spread @ squares.reshape(25, n).T).reshape(-1, 5, 5) + (s * s)[:, :, None] * parts.unseen[:5, :5]
    variance = spread @ (further * further).T + (s * s) * np.diag(parts.unseen)[5:]
    basis = triangle = None
    if lost.any():
        columns = parts.whitening[:, lost]
        basis, triangle = np.linalg.qr(np.sqrt(unresolved)[:, :, None] * columns)
        growth = np.linalg.solve(triangle.transpose(0, 2, 1), (per_direction @ columns).transpose(0, 2, 1))
        of_five = growth[:, :, :5]
        covariance = covariance + of_five.transpose(0, 2, 1) @ of_five
        variance = variance + np.sum(growth[:, :, 5:] ** 2, axis=1)
    return PressureWeights(
        unresolved=unresolved,
        load_per_direction=per_direction,
        load_covariance=covariance,
        further_variance=variance,
        lost_basis=basis,
        lost_triangle=triangle,
    )


def scaled_estimate(
    parts: Decomposition,
    weights: PressureWeights,
    *,
    residual: FloatArray,
    mean_strain: FloatArray,
    lost: BoolArray,
    min_precision: FloatArray,
) -> ScaledEstimate:
    """Return the estimate from ``residual`` d - d_0 - s m (k, n_d) [m/m], whatever it holds of lost gauges.

    Parameters
    ----------
    mean_strain : (n_d,) m [m/m].
    lost : (n_d,) gauges that are not in use.
    min_precision : (n_d,) precision [1/(m/m)^2] below which a gauge counts as checked by no other.
    """
    root = np.sqrt(weights.unresolved)
    w, whitened = _known(parts, weights, root, np.where(lost, 0.0, residual), lost)
    # The derivative of the residual by s is that of strains -m.
    of_mean, _ = _known(parts, weights, root, np.where(lost, 0.0, mean_strain)[None, :], lost)
    loads, per_pressure = (_loads(weights.load_per_direction, one) for one in (w, -of_mean))
    return ScaledEstimate(
        loads=loads[:, :5],
        load_covariance=weights.load_covariance,
        chi_square=np.vecdot(whitened, whitened),
        standardised_residual=_standardised(parts, weights, root, whitened, lost, min_precision),
        load_per_pressure=per_pressure[:, :5],
        further=loads[:, 5:],
        further_variance=weights.further_variance,
        further_per_pressure=per_pressure[:, 5:],
    )


def gain_and_precision(
    parts: Decomposition, pressure_ratio: float, lost: BoolArray
) -> tuple[FloatArray, FloatArray, PressureWeights]:
    """Return G (n_l, n_d) [N, N m] and P (n_d, n_d) [1/(m/m)^2] at s, zero for the ``lost`` gauges, and the
    weights."""
    weights = pressure_weights(parts, np.array([pressure_ratio]), lost)
    root = np.sqrt(weights.unresolved[0])
    w, whitened = parts.whitening, root[:, None] * parts.whitening
    if weights.lost_basis is not None and weights.lost_triangle is not None:
        basis = weights.lost_basis[0]
        w = w - parts.whitening[:, lost] @ np.linalg.solve(weights.lost_triangle[0], basis.T @ whitened)
        whitened = whitened - basis @ (basis.T @ whitened)
    gain, precision = weights.load_per_direction[0] @ w, whitened.T @ whitened
    gain[:, lost] = 0.0
    precision[lost, :] = precision[:, lost] = 0.0
    return gain, precision, weights


def _known(
    parts: Decomposition, weights: PressureWeights, root: FloatArray, residual: FloatArray, lost: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return w and D w (k, n_d) of residuals whose lost gauges are predicted from the others."""
    w = product_with(parts.whitening, residual)
    whitened = root * w
    if weights.lost_basis is None or weights.lost_triangle is None:
        return w if len(w) == len(whitened) else np.broadcast_to(w, whitened.shape), whitened
    along = np.einsum("knm,kn->km", weights.lost_basis, whitened)
    of_lost = np.linalg.solve(weights.lost_triangle, along[:, :, None])[:, :, 0]
    whitened = whitened - np.einsum("knm,km->kn", weights.lost_basis, along)
    # Once more: the first pass leaves the round-off of what it took out.
    whitened -= np.einsum("knm,kn,klm->kl", weights.lost_basis, whitened, weights.lost_basis, optimize=True)
    return w - of_lost @ parts.whitening[:, lost].T, whitened


def _standardised(
    parts: Decomposition,
    weights: PressureWeights,
    root: FloatArray,
    whitened: FloatArray,
    lost: BoolArray,
    min_precision: FloatArray,
) -> FloatArray:
    """Return z (k, n_d) = (P r)_i / sqrt(P_ii)."""
    precision = weights.unresolved @ (parts.whitening * parts.whitening)
    if weights.lost_basis is not None:
        cross = np.einsum("knm,kn,ni->kmi", weights.lost_basis, root, parts.whitening, optimize=True)
        precision = precision - np.sum(cross * cross, axis=1)
    checked = (precision > min_precision) & ~lost
    slope = product_with(parts.whitening.T, root * whitened)
    return np.where(checked, slope / np.sqrt(np.where(checked, precision, 1.0)), 0.0)


def _loads(per_direction: FloatArray, w: FloatArray) -> FloatArray:
    """Return (k, n_l) loads of w (k, n_d)."""
    return np.asarray(np.matmul(per_direction, w[:, :, None])[:, :, 0])


def product_with(matrix: FloatArray, values: FloatArray) -> FloatArray:
    """Return ``matrix`` (m, n) times each of ``values`` (n,) or (k, n)."""
    if values.ndim == 1:
        return np.asarray(matrix @ values)
    k, n = values.shape
    whole = k - k % ROWS
    out = np.empty((k, len(matrix)))
    blocks = (whole // ROWS, ROWS)
    np.matmul(values[:whole].reshape(*blocks, n), matrix.T, out=out[:whole].reshape(*blocks, len(matrix)))
    np.matmul(values[whole:], matrix.T, out=out[whole:])
    return out
