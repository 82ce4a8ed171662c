"""Tables of further parameters of the flow as the native FMU reads them: a section of ``resources/map.bin``.

The content of the section is eight 32-bit sizes, of which the last is zero, and float64 values in the order of
:func:`parameter_tables_section`. ``fmus/native/estimator/tables/flight_known.h`` describes them to the C code.
"""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.manifold.estimator import LARGEST_USED_SCORE
from strainfmu.estimator.numerics.fixed_order import product
from strainfmu.estimator.resource.sections import section, sized_numbers
from strainfmu.estimator.tables.manifold_map import ManifoldMap
from strainfmu.estimator.tables.parameter_tables import ParameterTables

SECTION = b"KNOWN\0\0\0"


ROUND_OFF = 1e-13
"""Rest of a table, in parts of its row's largest value, that counts as none."""


def parameter_tables_section(manifold: ManifoldMap, tables: ParameterTables, n_further: int) -> bytes:
    """Return the section of the parameters' ``tables``, with those of ``n_further`` further loads, all or none."""
    powers, n = tables.powers, manifold.response.shape[2] + n_further
    basis, weight = factors(tables.slope[:, :, :, :n])
    numbers = (
        np.array([LARGEST_USED_SCORE]),
        powers.mean,
        powers.spread,
        np.asarray(powers.parameter, dtype=float),
        np.asarray(powers.power, dtype=float),
        powers.offset,
        basis,
        weight,
        *_products(tables, manifold.tables.n_gauges, n_further),
    )
    sizes = (len(powers.mean), len(powers.power), len(basis), n_further)
    return section(SECTION, sized_numbers(sizes, numbers))


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


def _products(tables: ParameterTables, n_d: int, n_further: int) -> list[FloatArray]:
    """Return products of errors: of what no parameter makes, pairs of one parameter's powers, each spread."""
    found, powers = [_product(tables.error, tables.error, n_d, n_further)], powers_of(tables)
    for own in powers:
        for first, a in enumerate(own):
            for b in own[first:]:
                both = _product(tables.unit_error[a], tables.unit_error[b], n_d, n_further)
                if a != b:
                    both = both + _product(tables.unit_error[b], tables.unit_error[a], n_d, n_further)
                found.append(both)
    return [*found, *(_product(one, one, n_d, n_further) for one in tables.spread_error)]


def powers_of(tables: ParameterTables) -> list[list[int]]:
    """Return the numbers of the powers of each parameter."""
    own = tables.powers.parameter
    return [np.flatnonzero(own == one).tolist() for one in range(len(tables.powers.mean))]


def _product(a: FloatArray, b: FloatArray, n_d: int, n_further: int) -> FloatArray:
    """Return what the estimator needs of ``a`` (n, k) times ``b`` (n, k) transposed, as one row.

    Strain with strain, loads with strain, loads with loads, further loads with strain, each further load with
    itself.
    """
    n = n_d + 5
    strain, loads, further = b[:n_d].T.copy(), b[n_d:n].T.copy(), slice(n, n + n_further)
    parts = (
        product(a[:n_d], strain),
        product(a[n_d:n], strain),
        product(a[n_d:n], loads),
        product(a[further], strain),
        np.sum(a[further] * b[further], axis=1),
    )
    return np.concatenate([part.ravel() for part in parts])
