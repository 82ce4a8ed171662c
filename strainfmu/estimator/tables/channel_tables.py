"""Tables over the flight state without repetition, as the compiled estimator evaluates them.

Gauges that are rotations of each other have one table. A gauge at roll angle phi reads

    y = p_inf sum_m (E_m cos m(phi - phi_T) + O_m sin m(phi - phi_T)),

E and O the parts of its table that are even and odd about its own meridian. O is zero of every gauge along or
across its meridian, and E is the same all around a station.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import atan2, cos, sin

import numpy as np

from strainfmu.arrays import FloatArray

ROUND_OFF = 1e-13
"""Difference of two tables, in parts of their largest value, that counts as none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelTables:
    """Tables of strain and loads without repetition.

    Attributes
    ----------
    table : (n_M + 2, n_a + 2, n_c, n_m) spline coefficients of each channel per p_inf.
    row, channel : (n_t,) row of the response that a term adds to, ascending, and its channel.
    cosine, sine : (n_t, n_m) factors of cos m phi_T and sin m phi_T in a term.
    """

    table: FloatArray
    row: FloatArray
    channel: FloatArray
    cosine: FloatArray
    sine: FloatArray


def channel_tables(response: FloatArray, roll_angle: FloatArray) -> ChannelTables:
    """Return the tables ``response`` (n_M + 2, n_a + 2, n_r, n_m, 2) without repetition.

    ``roll_angle`` (n_d,) is the roll angle of the gauges [rad], the first n_d of the n_r rows.
    """
    found: list[FloatArray] = []
    terms: list[tuple[int, int, FloatArray, FloatArray]] = []
    for row, (of_cosine, of_sine) in enumerate(np.ascontiguousarray(np.moveaxis(response, (2, 4), (0, 1)))):
        largest = float(max(np.max(np.abs(of_cosine)), np.max(np.abs(of_sine))))
        position = float(roll_angle[row]) if row < len(roll_angle) else 0.0
        phase = _own_angle(of_cosine, of_sine, position, ROUND_OFF * largest)
        for first, second, value in _parts(of_cosine, of_sine, phase):
            if np.max(np.abs(value)) > ROUND_OFF * largest or (first is phase[0] and largest == 0.0):
                terms.append((row, _channel_of(found, value), first, second))
    return ChannelTables(
        table=np.stack(found, axis=2),
        row=np.array([term[0] for term in terms], dtype=float),
        channel=np.array([term[1] for term in terms], dtype=float),
        cosine=np.stack([term[2] for term in terms]),
        sine=np.stack([term[3] for term in terms]),
    )


_Phase = tuple[FloatArray, FloatArray]


def _parts(of_cosine: FloatArray, of_sine: FloatArray, phase: _Phase) -> list[tuple[FloatArray, ...]]:
    """Return factors of cos m phi_T and of sin m phi_T, and table, of the even part and of the odd part."""
    c, s = phase
    return [(c, s, of_cosine * c + of_sine * s), (s, -c, of_cosine * s - of_sine * c)]


def _own_angle(of_cosine: FloatArray, of_sine: FloatArray, position: float, round_off: float) -> _Phase:
    """Return cos m phi and sin m phi (n_m,) of the angle about which the table is even, if there is one.

    Of ``position``, the angle of the first harmonic, and 0, the angle is the one with the smallest odd part; odd
    parts that differ by no more than ``round_off`` are the same.
    """

    def odd_part(phase: _Phase) -> float:
        return float(np.max(np.abs(of_cosine * phase[1] - of_sine * phase[0])))

    phases = [_phase(position, of_cosine.shape[2])]
    odd = [odd_part(phases[0])]
    if odd[0] <= round_off:
        return phases[0]
    a, b = of_cosine[:, :, 1:2], of_sine[:, :, 1:2]
    of_first = 0.5 * atan2(2.0 * float(np.sum(a * b)), float(np.sum(a * a - b * b)))
    phases += [_phase(phi, of_cosine.shape[2]) for phi in (of_first, 0.0)]
    odd += [odd_part(phase) for phase in phases[1:]]
    return next(one for one, size in zip(phases, odd, strict=True) if size <= min(odd) + round_off)


@lru_cache(maxsize=256)
def _phase(phi: float, n_harmonics: int) -> _Phase:
    """Return cos m phi and sin m phi (n_m,); gauges share their roll angles."""
    harmonics = range(n_harmonics)
    return np.array([cos(m * phi) for m in harmonics]), np.array([sin(m * phi) for m in harmonics])


def _channel_of(found: list[FloatArray], value: FloatArray) -> int:
    """Return the number of the channel of ``found`` that is ``value``, which joins them if none is."""
    size = np.abs(value)
    limit, largest = ROUND_OFF * float(np.max(size)), int(np.argmax(size))
    for number, one in enumerate(found):
        # Most others differ where this one is largest.
        if abs(one.flat[largest] - value.flat[largest]) <= limit and np.max(np.abs(one - value)) <= limit:
            return number
    found.append(value)
    return len(found) - 1
