"""The update: what rows that are read say of outputs, in a linear model with Gaussian errors.

With a scale s (the pressure ratio of ``eq:scaled-model``, or 1)

    y = y_fixed + s (y_mean + X x + N u) + e,   x free,  u ~ N(0, I),  e ~ N(0, R),
    f = f_fixed + s (f_mean + F x + M u) + g,   cov(e, g) = C,  cov g = V.

:func:`prepare` decomposes the model for the rows in use; :func:`condition` gives every output, its covariance and
the residual of many samples at any s from one decomposition; :func:`joseph` gives the covariance of what a gain
makes of a model that it was not made for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError

CHECKED = 1e-10
"""Precision of a row over its own precision from which other rows check it; less is round-off."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A model of n rows and m outputs, symbols as above.

    Attributes
    ----------
    fixed, mean : (n,) y_fixed and y_mean.
    free : (n, n_x) X, columns without a prior.
    columns : (n, k) N, columns per standard deviation.
    noise : (n, n) R.
    output_fixed, output_mean : (m,) f_fixed and f_mean.
    output_free, output_columns : (m, n_x) F and (m, k) M.
    cross : (n, m) C.
    output_noise : (m, m) V.
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
    cross: FloatArray
    output_noise: FloatArray


def model_of(n: int, m: int, **parts: FloatArray) -> Model:
    """Return the model of n rows and m outputs with ``parts`` by name; others are 0, and have no columns."""
    shapes: dict[str, tuple[int, ...]] = {
        **dict.fromkeys(("fixed", "mean"), (n,)),
        **dict.fromkeys(("output_fixed", "output_mean"), (m,)),
        **dict.fromkeys(("free", "columns"), (n, 0)),
        **dict.fromkeys(("output_free", "output_columns"), (m, 0)),
        "noise": (n, n),
        "cross": (n, m),
        "output_noise": (m, m),
    }
    return Model(**({name: np.zeros(shape) for name, shape in shapes.items()} | parts))


@dataclass(frozen=True, kw_only=True, eq=False)
class Prepared:
    """A model turned to directions in which its rows are independent; the first n_x of them hold the free states.

    Attributes
    ----------
    model : the model.
    whitening : (n_w, n) directions of the n_w rows in use, of unit noise; 0 for rows that are not in use.
    singular : (n_w,) S, signal over noise of each direction at s = 1; 0 for free states.
    n_free : n_x.
    of_free : (m, n_x) outputs per whitened free direction, H.
    of_columns : (m, n_w) outputs per amplitude of the other directions, G; 0 for free ones.
    of_noise : (m, n_w) outputs that go with the noise of each direction, B.
    unseen : (m, m) covariance of outputs in directions of u that no row shows.
    remainder : (m, m) V - B B'.
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Posterior:
    """What k samples say.

    Attributes
    ----------
    mean : (k, m) outputs, and their ``covariance`` (k, m, m).
    gain : (k, m, n) outputs per row; 0 for rows that are not in use.
    precision : (k, n, n) P of the rows, blind to free states; 0 for rows that are not in use.
    chi_square : (k,).
    standardised : (k, n) leave-one-out residuals z; 0 for rows that no other checks.
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

    Raises
    ------
    InputError
        There are fewer rows than free states.
    """
    n_x, n_w = model.free.shape[1], int(used.sum())
    if n_w < n_x:
        raise InputError(f"{n_x} free states: expected as many rows in use at least, got {n_w}")
    size = np.sqrt(np.diag(model.noise)[used])  # rows of unlike units and noise cost no digits
    root = size[:, None] * np.linalg.cholesky(model.noise[np.ix_(used, used)] / np.outer(size, size))
    inverse = np.linalg.inv(root)
    free, columns, cross = (inverse @ one[used] for one in (model.free, model.columns, model.cross))

    scale = np.abs(free).max(axis=0, initial=1e-300)
    q, t = np.linalg.qr(free / scale, mode="complete")
    of_free = np.linalg.solve(t[:n_x].T, (model.output_free / scale).T).T
    left, singular, right = np.linalg.svd(q[:, n_x:].T @ columns)
    turned = np.hstack([q[:, :n_x], q[:, n_x:] @ left]).T

    amplitudes = (model.output_columns - of_free @ (turned[:n_x] @ columns)) @ right.T
    n_seen = len(singular)
    of_columns = np.zeros((len(amplitudes), n_w))
    of_columns[:, n_x : n_x + n_seen] = amplitudes[:, :n_seen]
    of_noise = cross.T @ turned.T
    whitening = np.zeros((n_w, len(used)))
    whitening[:, used] = turned @ inverse
    return Prepared(
        model=model,
        whitening=whitening,
        singular=np.concatenate([np.zeros(n_x), singular, np.zeros(n_w - n_x - n_seen)]),
        n_free=n_x,
        of_free=of_free,
        of_columns=of_columns,
        of_noise=of_noise,
        unseen=amplitudes[:, n_seen:] @ amplitudes[:, n_seen:].T,
        remainder=model.output_noise - of_noise @ of_noise.T,
    )


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
    left = s[:, :, None] * np.sqrt(u)[:, None] * (prepared.of_columns - prepared.singular * prepared.of_noise)
    left[:, :, :n_x] = prepared.of_free - prepared.of_noise[:, :n_x]
    covariance = left @ np.swapaxes(left, 1, 2) + (s * s)[:, :, None] * prepared.unseen + prepared.remainder

    weighted = u[:, :, None] * prepared.whitening
    precision = prepared.whitening.T @ weighted
    variance = np.diagonal(precision, axis1=1, axis2=2)
    checked = variance > CHECKED / np.diag(model.noise)
    slope = (w * u) @ prepared.whitening
    return Posterior(
        mean=model.output_fixed + s * model.output_mean + (per_direction @ w[:, :, None])[:, :, 0],
        covariance=covariance,
        gain=per_direction @ prepared.whitening,
        precision=precision,
        chi_square=np.sum(u * w * w, axis=1),
        standardised=np.where(checked, slope / np.sqrt(np.where(checked, variance, 1.0)), 0.0),
    )


def joseph(truth: Model, gain: FloatArray, scale: FloatArray, added: FloatArray | None = None) -> FloatArray:
    """Return (k, m, m) covariance of the outputs by ``gain`` G (k, m, n) at ``scale`` s (k,) under ``truth``.

    (G L - C' L'^-1)(..)' + V - C' R^-1 C + s^2 (M - G N)(M - G N)' + G D G', with R = L L' and D = ``added``
    (k, n, n) what rows err by beyond R. The gain must be unbiased for free states, G X = F.
    """
    root = np.linalg.cholesky(truth.noise)
    regression = np.linalg.solve(root, truth.cross).T
    of_noise = gain @ root - regression
    of_columns = scale[:, None, None] * (truth.output_columns - gain @ truth.columns)
    remainder = truth.output_noise - regression @ regression.T
    of_added = 0.0 if added is None else gain @ added @ np.swapaxes(gain, 1, 2)
    return np.asarray(_square(of_noise) + _square(of_columns) + remainder + of_added)


def _square(factor: FloatArray) -> FloatArray:
    return factor @ np.swapaxes(factor, 1, 2)
