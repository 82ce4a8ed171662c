"""Tables of flow parameters as the compiled estimator has them: sums of few tables, and products of errors."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.numerics.fixed_order import product
from strainfmu.estimator.tables.parameter_tables import ParameterTables

ROUND_OFF = 1e-13
"""Rest of a table, in parts of its row's largest value, that counts as none."""


def factors(slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return few tables over incidence and roll angle of the wind whose sums all of ``slope`` are.

    All rows are interpolated alike between the snapshots: their tables hold as many numbers as there are angles
    of attack and sideslip in these.

    Parameters
    ----------
    slope : (n_M + 2, n_a + 2, J, n, n_m, 2).

    Returns
    -------
    Basis (k, n_a + 2, n_m, 2), orthonormal, and weights (n_M + 2, J, n, k) of its tables.
    """
    largest = np.max(np.abs(slope), axis=(0, 1, 2, 4, 5))
    scale = np.where(largest > 0.0, largest, 1.0)
    scaled = np.moveaxis(slope, 1, 3) / scale[:, None, None, None]
    rest = scaled.reshape(-1, scaled[0, 0, 0].size)
    basis, weight = list[FloatArray](), list[FloatArray]()
    while True:
        sizes = np.max(np.abs(rest), axis=1)
        first = int(np.argmax(sizes))
        if sizes[first] <= ROUND_OFF or len(basis) == rest.shape[1]:
            break
        row = rest[first] / sizes[first]
        row = row / np.sqrt(product(row[None], row[:, None])[0, 0])
        along = product(rest, row[:, None])
        rest = rest - along * row
        basis.append(row)
        weight.append(along[:, 0])
    found = np.array(basis).reshape(-1, *scaled.shape[3:])
    of_rows = np.array(weight).T.reshape(*scaled.shape[:3], -1) * scale[:, None]
    return found, of_rows


def error_products(tables: ParameterTables, n_d: int, n_loads: int) -> FloatArray:
    """Return (k, size) products of errors.

    They are of what no parameter makes, of pairs of one parameter's powers, and of each spread.
    """
    found, powers = [_product(tables.error, tables.error, n_d, n_loads)], powers_of(tables)
    for own in powers:
        for first, a in enumerate(own):
            for b in own[first:]:
                both = _product(tables.unit_error[a], tables.unit_error[b], n_d, n_loads)
                if a != b:
                    both = both + _product(tables.unit_error[b], tables.unit_error[a], n_d, n_loads)
                found.append(both)
    return np.array([*found, *(_product(one, one, n_d, n_loads) for one in tables.spread_error)])


def powers_of(tables: ParameterTables) -> list[list[int]]:
    """Return the numbers of the powers of each parameter."""
    own = tables.powers.parameter
    return [np.flatnonzero(own == one).tolist() for one in range(len(tables.powers.mean))]


def _product(a: FloatArray, b: FloatArray, n_d: int, n_loads: int) -> FloatArray:
    """Return what the estimator needs of ``a`` (n, k) times ``b`` (n, k) transposed, as one row.

    Strain with strain, the five loads with strain and with each other, the others with strain, each of the
    others with itself.
    """
    n = n_d + 5
    strain, loads, others = b[:n_d].T.copy(), b[n_d:n].T.copy(), slice(n, n_d + n_loads)
    parts = (
        product(a[:n_d], strain),
        product(a[n_d:n], strain),
        product(a[n_d:n], loads),
        product(a[others], strain),
        np.sum(a[others] * b[others], axis=1),
    )
    return np.concatenate([part.ravel() for part in parts])
