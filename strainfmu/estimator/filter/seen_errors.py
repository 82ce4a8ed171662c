"""Errors in the directions that gauges see, and the rest of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray

LARGEST_NUMBER = 18
"""Directions that are estimated over time."""

SMALLEST_SIZE = 0.2
"""Size of a direction in standard deviations of the other errors, below which it is not estimated."""

COMMON_SIZE, COMMON_FRACTION = 1.0, 0.3
"""Variance in those of the noise, and part of the sum of all, from which an error is one that gauges have in
common."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenErrors:
    """Errors of unit variance that are estimated, and the covariance of the rest.

    Attributes
    ----------
    strain, load : (n_d, r), (5, r) per standard deviation of the r directions; 0 of one that is not estimated.
    rest_strain, rest_load : (n_d, n_d), (5, 5) covariances of the rest.
    rest_cross : (5, n_d) covariance of loads with strain of the rest.
    direction : (k, r) the directions in the k columns of the errors, each of unit length.
    """

    strain: FloatArray
    load: FloatArray
    rest_strain: FloatArray
    rest_load: FloatArray
    rest_cross: FloatArray
    direction: FloatArray


def seen_errors(
    error_strain: FloatArray, error_load: FloatArray, scale: float, std: FloatArray, number: int | None = None
) -> SeenErrors:
    """Split the errors ``error_strain`` (n_d, k), ``error_load`` (5, k) by what gauges see of them.

    ``scale`` times the errors is their usual size, ``std`` (n_d,) the deviation of the other errors of each gauge.
    ``number`` is that of the directions, None for as many as are estimated. Of more the further ones are 0.
    """
    _, size, turn = np.linalg.svd(scale * error_strain / std[:, None], full_matrices=True)
    seen = int(np.sum(size > SMALLEST_SIZE))
    number = min(LARGEST_NUMBER, seen) if number is None else number
    r = min(number, seen)
    kept, rest = turn[:r].T, turn[r:].T
    none = ((0, 0), (0, number - r))
    strain, load = error_strain @ rest, error_load @ rest
    return SeenErrors(
        strain=np.pad(error_strain @ kept, none),
        load=np.pad(error_load @ kept, none),
        rest_strain=strain @ strain.T,
        rest_load=load @ load.T,
        rest_cross=load @ strain.T,
        direction=turn[:number].T,
    )


def white_and_lasting(covariance: FloatArray, noise_std: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Split the gauges' ``covariance`` (n_d, n_d), noise of ``noise_std`` (n_d,) and errors that last.

    Returns the variances (n_d,) of the noise, columns (n_d, c) of errors that gauges have in common, and the
    covariance (n_d, n_d) of the other errors that last.
    """
    turned = covariance / (noise_std[:, None] * noise_std)
    size, vector = np.linalg.eigh(turned)
    # A covariance below that of the noise has less noise than stated.
    white = min(1.0, float(size[0]))
    size = np.maximum(size - white, 0.0)
    common = size > max(COMMON_SIZE, COMMON_FRACTION * float(size.sum()))
    columns = noise_std[:, None] * vector * np.sqrt(size)
    rest = columns[:, ~common]
    return white * noise_std**2, columns[:, common], rest @ rest.T
