"""The update: what rows that are read say of outputs, in a linear model with Gaussian errors.

With a scale s (the pressure ratio of ``eq:scaled-model``, or 1)

    y = y_fixed + s (y_mean + X x + N u) + e,   x free,  u ~ N(0, I),  e ~ N(0, R),
    f = f_fixed + s (f_mean + F x + M u) + g,   cov(e, g) = C,  cov g = V.

:func:`prepare` decomposes the model for the rows in use; :func:`condition` gives every output, its covariance and
the residual of many samples at any s from one decomposition; :func:`joseph` gives the covariance of what a gain
makes of a model that it was not made for.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, inverse_root
from strainfmu.errors import InputError

CHECKED = 1e-10
"""Precision of a row over its own precision from which other rows check it; less is round-off."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A model of n rows and m outputs; fields are those above, and have one row of each row or output.

    ``fixed``, ``mean``, ``free``, ``columns`` and ``noise`` are y_fixed, y_mean, X, N and R; with ``output_``
    before them f_fixed, f_mean, F, M and V; ``cross`` (n, m) is C.
    """

    fixed: FloatArray
    mean: FloatArray
    free: FloatArray
    columns: FloatArray
    noise: FloatArray
    output_fixed: FloatArray
    output_mean: FloatArray
    output_free: FloatArray
    output_columns: FloatArray
    output_noise: FloatArray
    cross: FloatArray


def model_of(n: int, m: int, **parts: FloatArray) -> Model:
    """Return the model of n rows and m outputs with ``parts`` by name; others are 0, and have no columns."""
    widths = {"mean": (), "fixed": (), "free": (0,), "columns": (0,)}
    zero = {name: np.zeros((n, *width)) for name, width in (widths | {"noise": (n,), "cross": (m,)}).items()}
    zero |= {f"output_{name}": np.zeros((m, *width)) for name, width in (widths | {"noise": (m,)}).items()}
    return Model(**(zero | parts))


class Prepared(NamedTuple):
    """A ``model`` turned to n_w directions in which its rows are independent; the first ``n_free`` hold x.

    ``whitening`` (n_w, n) has the directions, of unit noise, 0 for rows that are not in use; ``singular`` (n_w,)
    is the signal over noise of each at s = 1. Outputs per direction are ``of_free`` (m, n_x), H, by free states,
    ``of_columns`` (m, n_w), G, by u, and ``of_noise`` (m, n_w), B, by what goes with noise. ``unseen`` (m, m) is
    the covariance of outputs by what no row shows of u, ``remainder`` (m, m) is V - B B'.
    """

    model: Model
    whitening: FloatArray
    singular: FloatArray
    n_free: int
    of_free: FloatArray
    of_columns: FloatArray
    of_noise: FloatArray
    unseen: FloatArray
    remainder: FloatArray


class Posterior(NamedTuple):
    """Outputs of k samples: ``mean`` (k, m), ``covariance`` (k, m, m), ``gain`` (k, m, n).

    Of the rows: ``precision`` P (k, n, n), blind to free states, ``chi_square`` (k,), leave-one-out residuals
    ``standardised`` (k, n). All are 0 for rows that are not in use, residuals also for those that no other checks.
    """

    mean: FloatArray
    covariance: FloatArray
    gain: FloatArray
    precision: FloatArray
    chi_square: FloatArray
    standardised: FloatArray


def prepare(model: Model, used: BoolArray) -> Prepared:
    """Return ``model`` decomposed for the rows ``used`` (n,).

    R = L L'. A QR decomposition of L^-1 X takes the free states out, a singular value decomposition of what is
    left of L^-1 N gives ``eq:scaled-decomposition``.
    """
    n_x, n_w = model.free.shape[1], int(used.sum())
    if n_w < n_x:
        raise InputError(f"{n_x} free states: expected as many rows in use at least, got {n_w}")
    inverse = inverse_root(model.noise[np.ix_(used, used)])
    free, columns, cross = (inverse @ block[used] for block in (model.free, model.columns, model.cross))

    scale = np.abs(free).max(axis=0, initial=1e-300)
    q, t = np.linalg.qr(free / scale, mode="complete")
    of_free = np.linalg.solve(t[:n_x].T, (model.output_free / scale).T).T
    turned_columns = q[:, n_x:].T @ columns
    rotation, singular, right = np.linalg.svd(turned_columns, full_matrices=len(turned_columns) > columns.shape[1])
    turned = np.hstack([q[:, :n_x], q[:, n_x:] @ rotation]).T

    amplitudes = model.output_columns - of_free @ (turned[:n_x] @ columns)
    n_seen = len(singular)
    of_columns = np.zeros((len(amplitudes), n_w))
    of_columns[:, n_x : n_x + n_seen] = amplitudes @ right[:n_seen].T
    rest = amplitudes - amplitudes @ right.T @ right
    of_noise = cross.T @ turned.T
    whitening = np.zeros((n_w, len(used)))
    whitening[:, used] = turned @ inverse
    singular = np.concatenate([np.zeros(n_x), singular, np.zeros(n_w - n_x - n_seen)])
    unseen, remainder = _square(rest), model.output_noise - _square(of_noise)
    outputs = {"of_free": of_free, "of_columns": of_columns, "of_noise": of_noise, "unseen": unseen}
    return Prepared(model, whitening, singular, n_x, **outputs, remainder=remainder)


def condition(prepared: Prepared, rows: FloatArray, scale: FloatArray) -> Posterior:
    """Return the posterior of the samples ``rows`` (k, n), each at its ``scale`` s (k,).

    With u = 1 / (1 + s^2 S^2) and w the whitened residual: ``eq:scaled-loads``, ``eq:scaled-chi-square``, and
    the terms of g, whose noise B u w is what the residual reveals of it.
    """
    model, n_x, s = prepared.model, prepared.n_free, scale[:, None]
    u = 1.0 / (1.0 + (s * prepared.singular) ** 2)
    u[:, :n_x] = 0.0
    expected = model.fixed + s * model.mean
    residual = np.where(prepared.whitening.any(axis=0), rows - expected, 0.0)
    w = residual @ prepared.whitening.T

    per_direction = (s * s * prepared.singular * u)[:, None] * prepared.of_columns + u[:, None] * prepared.of_noise
    per_direction[:, :, :n_x] = prepared.of_free
    factor = s[:, :, None] * np.sqrt(u)[:, None] * (prepared.of_columns - prepared.singular * prepared.of_noise)
    factor[:, :, :n_x] = prepared.of_free - prepared.of_noise[:, :n_x]
    covariance = _square(factor) + (s * s)[:, :, None] * prepared.unseen + prepared.remainder

    precision = prepared.whitening.T @ (u[:, :, None] * prepared.whitening)
    variance, slope = np.diagonal(precision, axis1=1, axis2=2), (w * u) @ prepared.whitening
    checked = variance > CHECKED / np.diag(model.noise)
    z = np.where(checked, slope / np.sqrt(np.where(checked, variance, 1.0)), 0.0)
    mean = model.output_fixed + s * model.output_mean + (per_direction @ w[:, :, None])[:, :, 0]
    gain, chi_square = per_direction @ prepared.whitening, np.sum(u * w * w, axis=1)
    return Posterior(mean, covariance, gain, precision, chi_square, z)


def joseph(truth: Model, gain: FloatArray, scale: FloatArray, added: FloatArray | None = None) -> FloatArray:
    """Return (k, m, m) covariance of the outputs by ``gain`` G (k, m, n) at ``scale`` s (k,) under ``truth``.

    G R G' - G C - C' G' + V + s^2 (M - G N)(M - G N)' + G D G', with D = ``added`` (k, n, n) the error of the rows
    beyond R. The gain must be unbiased for free states, G X = F.
    """
    transposed, crossed = np.swapaxes(gain, 1, 2), gain @ truth.cross
    of_noise = gain @ truth.noise @ transposed - crossed - np.swapaxes(crossed, 1, 2) + truth.output_noise
    of_columns = scale[:, None, None] * (truth.output_columns - gain @ truth.columns)
    of_added = 0.0 if added is None else gain @ added @ transposed
    return np.asarray(of_noise + _square(of_columns) + of_added)


def _square(factor: FloatArray) -> FloatArray:
    return factor @ np.swapaxes(factor, -1, -2)
