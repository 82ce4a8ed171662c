"""Tables without repetition, as the compiled estimator evaluates them.

**Channels.** Gauges that are rotations of each other have one table. A gauge at roll angle phi reads

    y = p_inf sum_m (E_m cos m(phi - phi_T) + O_m sin m(phi - phi_T)),

E and O the parts of its table that are even and odd about its own meridian. O is zero of every gauge along or
across its meridian, and E is the same all around a station.

**Factors.** Tables of what flow parameters change are sums of few tables; their errors are products.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import atan2, cos, sin

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.nonlinear_map import ParameterTables
from strainfmu.estimator.map.schema import MapRecord, entry
from strainfmu.estimator.numerics import product

ROUND_OFF = 1e-13
"""Difference of two tables, and rest of a table, in parts of their largest value, that counts as none."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ChannelTables(MapRecord, where="tables without repetition"):
    """Tables of strain and loads without repetition."""

    # fmt: off
    table: FloatArray = entry("n_mach+2 n_incidence+2 n_channels n_harmonics", "1/Pa, m2, m3",
        "coefficients of each channel, per p_inf")
    row: FloatArray = entry("n_terms", "", "row of the response that a term adds to, ascending")
    channel: FloatArray = entry("n_terms", "", "channel of each term")
    cosine: FloatArray = entry("n_terms n_harmonics", "1", "factors of cos m phi_T in a term")
    sine: FloatArray = entry("n_terms n_harmonics", "1", "the same of sin m phi_T")
    fixed_response: FloatArray = entry("n_rows", "m/m, N, N.m", "part that does not follow p_inf")
    # fmt: on


def channel_tables(response: FloatArray, fixed_response: FloatArray, roll_angle: FloatArray) -> ChannelTables:
    """Return the tables ``response`` (n_M + 2, n_a + 2, n_r, n_m, 2) without repetition.

    ``fixed_response`` (n_r,) is the part of the response that does not follow p_inf.
    ``roll_angle`` (n_d,) is the roll angle of the gauges [rad], the first n_d of the n_r rows.
    """
    channels, terms = list[FloatArray](), list[tuple[int, int, FloatArray, FloatArray]]()
    for row, (of_cosine, of_sine) in enumerate(np.ascontiguousarray(np.moveaxis(response, (2, 4), (0, 1)))):
        largest = float(max(np.max(np.abs(of_cosine)), np.max(np.abs(of_sine))))
        position = float(roll_angle[row]) if row < len(roll_angle) else 0.0
        phase = _symmetry_angle(of_cosine, of_sine, position, ROUND_OFF * largest)
        for first, second, value in _parts(of_cosine, of_sine, phase):
            if np.max(np.abs(value)) > ROUND_OFF * largest or (first is phase[0] and largest == 0.0):
                terms.append((row, _channel_of(channels, value), first, second))
    row_of, channel_of, cosine, sine = (np.array(values) for values in zip(*terms, strict=True))
    return ChannelTables(
        table=np.stack(channels, axis=2),
        row=row_of.astype(float),
        channel=channel_of.astype(float),
        cosine=cosine,
        sine=sine,
        fixed_response=fixed_response,
    )


_Phase = tuple[FloatArray, FloatArray]


def _parts(of_cosine: FloatArray, of_sine: FloatArray, phase: _Phase) -> list[tuple[FloatArray, ...]]:
    """Return factors of cos m phi_T and of sin m phi_T, and table, of the even part and of the odd part."""
    c, s = phase
    return [(c, s, of_cosine * c + of_sine * s), (s, -c, of_cosine * s - of_sine * c)]


def _symmetry_angle(of_cosine: FloatArray, of_sine: FloatArray, position: float, round_off: float) -> _Phase:
    """Return cos m phi and sin m phi (n_m,) of the angle about which the table is even, if there is one.

    Of ``position``, the angle of the first harmonic, and 0, the angle is the one with the smallest odd part; odd
    parts that differ by no more than ``round_off`` are the same.
    """

    def odd_part(phase: _Phase) -> float:
        return float(np.max(np.abs(of_cosine * phase[1] - of_sine * phase[0])))

    phases = [_phase(position, of_cosine.shape[2])]
    if odd_part(phases[0]) <= round_off:
        return phases[0]
    a, b = of_cosine[:, :, 1:2], of_sine[:, :, 1:2]
    of_first = 0.5 * atan2(2.0 * float(np.sum(a * b)), float(np.sum(a * a - b * b)))
    phases += [_phase(phi, of_cosine.shape[2]) for phi in (of_first, 0.0)]
    odd = [odd_part(phase) for phase in phases]
    return next(phase for phase, size in zip(phases, odd, strict=True) if size <= min(odd) + round_off)


@lru_cache(maxsize=256)
def _phase(phi: float, n_harmonics: int) -> _Phase:
    """Return cos m phi and sin m phi (n_m,); gauges share their roll angles."""
    harmonics = range(n_harmonics)
    return np.array([cos(m * phi) for m in harmonics]), np.array([sin(m * phi) for m in harmonics])


def _channel_of(channels: list[FloatArray], value: FloatArray) -> int:
    """Return the number of the channel that is ``value``, which joins ``channels`` if none is."""
    size = np.abs(value)
    limit, largest = ROUND_OFF * float(np.max(size)), int(np.argmax(size))
    for number, channel in enumerate(channels):
        # Most of them differ where this one is largest.
        is_near = abs(channel.flat[largest] - value.flat[largest]) <= limit
        if is_near and np.max(np.abs(channel - value)) <= limit:
            return number
    channels.append(value)
    return len(channels) - 1


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
    of_rows = np.array(weight).T.reshape(*scaled.shape[:3], -1) * scale[:, None]
    return np.array(basis).reshape(-1, *scaled.shape[3:]), of_rows


def error_products(tables: ParameterTables, n_d: int, n_loads: int) -> FloatArray:
    """Return (k, size) products of errors.

    They are of what no parameter makes, of pairs of one parameter's powers, and of each spread.
    """
    products = [_product(tables.error, tables.error, n_d, n_loads)]
    for parameter in range(len(tables.powers.mean)):
        powers = np.flatnonzero(tables.powers.parameter == parameter).tolist()
        for first, a in enumerate(powers):
            for b in powers[first:]:
                both = _product(tables.unit_error[a], tables.unit_error[b], n_d, n_loads)
                if a != b:
                    both = both + _product(tables.unit_error[b], tables.unit_error[a], n_d, n_loads)
                products.append(both)
    return np.array([*products, *(_product(spread, spread, n_d, n_loads) for spread in tables.spread_error)])


def _product(a: FloatArray, b: FloatArray, n_d: int, n_loads: int) -> FloatArray:
    """Return what the estimator needs of ``a`` (n, k) times ``b`` (n, k) transposed, as one row.

    Strain with strain, the five loads with strain and with each other, the others with strain, each of the
    others with itself.
    """
    n = n_d + 5
    strain, loads, rest = b[:n_d].T.copy(), b[n_d:n].T.copy(), slice(n, n_d + n_loads)
    parts = (
        product(a[:n_d], strain),
        product(a[n_d:n], strain),
        product(a[n_d:n], loads),
        product(a[rest], strain),
        np.sum(a[rest] * b[rest], axis=1),
    )
    return np.concatenate([part.ravel() for part in parts])
