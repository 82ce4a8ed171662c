"""Tables of further parameters of the flow as the native FMU reads them: a section of ``resources/map.bin``.

The content of the section is eight 32-bit sizes, of which the last is zero, and float64 values in the order of
:func:`parameter_tables_section`. ``fmus/native/estimator/flight_known.h`` describes them to the C code.
"""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.fixed_order import product
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.manifold.estimator import LARGEST_USED_SCORE
from strainfmu.estimator.manifold.further_tables import FurtherTables
from strainfmu.estimator.manifold.manifold_map import ManifoldMap
from strainfmu.estimator.manifold.parameter_tables import ParameterTables
from strainfmu.fmu.flight_resource import ChannelTables, channel_tables
from strainfmu.fmu.resource_sections import section, sized_numbers

SECTION = b"KNOWN\0\0\0"


def parameter_tables_section(
    inverse_map: InverseMap, manifold: ManifoldMap, tables: ParameterTables, further: FurtherTables | None
) -> bytes:
    """Return the section of the parameters' ``tables``; ``further`` are the further loads that the FMU states."""
    powers, n = tables.powers, manifold.response.shape[2]
    n_further = 0 if further is None else len(further.variance)
    roll_angle = np.arctan2(*inverse_map.gauge_position[:, 1:].T)
    of_rows = _channels(manifold.response, tables.slope[:, :, :, :n], roll_angle)
    numbers = [
        np.array([LARGEST_USED_SCORE]),
        powers.mean,
        powers.spread,
        powers.parameter,
        powers.power,
        powers.offset,
        *_in_order(of_rows, len(manifold.response), manifold.fixed_response),
    ]
    sizes = [len(powers.mean), len(powers.power), *_sizes(of_rows), n_further]
    if further is not None:
        of_loads = _channels(further.response, tables.slope[:, :, :, n:], np.zeros(0))
        numbers += _in_order(of_loads, len(further.response), further.fixed_response)
        sizes += _sizes(of_loads)
    products = _products(tables, manifold.tables.n_gauges, n_further)
    return section(SECTION, sized_numbers(sizes, [*(np.asarray(one, dtype=float) for one in numbers), *products]))


def _channels(response: FloatArray, slope: FloatArray, roll_angle: FloatArray) -> ChannelTables:
    """Return the tables ``response`` of the mean and ``slope`` (n_M + 2, n_a + 2, J, n, n_m, 2) of each power, one
    after another along the Mach number, without repetition: all of them in the same channels."""
    return channel_tables(np.concatenate([response, *np.moveaxis(slope, 2, 0)]), roll_angle)


def _sizes(channels: ChannelTables) -> tuple[int, int]:
    return channels.table.shape[2], len(channels.row)


def _in_order(channels: ChannelTables, n_mach: int, fixed: FloatArray) -> list[FloatArray]:
    """Return the slopes, then the tables of the mean, ``n_mach`` along the Mach number, and the ``fixed`` part."""
    mean, *others = channels.arrays
    return [mean[n_mach:], mean[:n_mach], *others, fixed]


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
