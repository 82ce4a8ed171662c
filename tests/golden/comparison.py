"""How far two results of the same samples are apart, in standard deviations of the one that is kept."""

import numpy as np
from inputs import Results

NEAR_THRESHOLD = "near_threshold"
"""Field that is not 0 of samples of which a statistic is so near to its threshold that health may be either."""

LEAST_STD = 1e-5
"""Standard deviation over the value below which the last digits of the value decide."""

WHOLE = frozenset(
    (
        "health",
        "valid_gauges",
        "suspect_gauge",
        "suspects",
        "degrees_of_freedom",
        "is_identified",
        "air_data_used",
        "is_linear",
        "fits",
    )
)
"""Fields of whole numbers and flags, which are equal."""

_SMALLEST = 1e-300


def differences(expected: Results, found: Results) -> dict[str, np.ndarray]:
    """Return for each field of ``found`` (k,) the largest difference from ``expected`` in each sample.

    Values count in their standard deviations, standard deviations and thresholds relative to themselves,
    chi-square and scores relative to themselves or to 1, whole numbers as they are. A number for one that is none
    is infinite.
    """
    apart = {}
    for name, ours in found.items():
        theirs = expected[name][: len(ours)]
        k = len(theirs)
        ours = ours[:k]
        assert ours.shape == theirs.shape, f"{name}: {ours.shape} found, {theirs.shape} in the file"
        one = _difference(ours, theirs, _unit(name, expected, k)).reshape(k, -1)
        apart[name] = one.max(axis=1, initial=0.0)
    return apart


def _unit(name: str, expected: Results, k: int) -> np.ndarray:
    """Return what a difference of a field is counted in."""
    value = expected[name][:k]
    if name in WHOLE:
        return np.ones(value.shape)
    if name.endswith("_std") or name == "chi_square_limit":
        return np.abs(value)
    std = expected.get(f"{name}_std")
    if std is None:
        return np.maximum(np.abs(value), 1.0)
    of_misfit = np.ones(k) if name.startswith("air_data") else _misfit(expected)[:k]
    return np.maximum(std[:k] * of_misfit.reshape(k, *(1,) * (value.ndim - 1)), LEAST_STD * np.abs(value))


def _misfit(expected: Results) -> np.ndarray:
    """Return (k,) by how much more than what is allowed the sensors disagree, at least 1.

    Loads of a sample that does not fit are sums of readings as far off as that.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.sqrt(expected["chi_square"] / expected["chi_square_limit"])
    return np.where(ratio > 1.0, ratio, 1.0)


def _difference(ours: np.ndarray, theirs: np.ndarray, unit: np.ndarray) -> np.ndarray:
    ours, theirs = ours.astype(np.float64), theirs.astype(np.float64)
    finite = np.isfinite(ours) & np.isfinite(theirs)
    same = (ours == theirs) | (np.isnan(ours) & np.isnan(theirs))
    size = np.where(np.isfinite(unit) & (unit > 0.0), unit, _SMALLEST)
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.where(finite, np.abs(ours - theirs) / size, np.inf)
    return np.where(same, 0.0, apart)
