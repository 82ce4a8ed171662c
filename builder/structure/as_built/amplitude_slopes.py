"""Derivatives of strain amplitudes by the parameters of a wall as built: closed, from the tables themselves.

Tables are polynomials in the wall and in the stations of the gauges, so that one row of a table is what one
parameter changes. Directions of gauges and their roll angles do not change amplitudes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.structure.as_built.response_tables import ResponseTable, at_gauges
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.as_built.wall_harmonics import WAVES
from strainfmu.arrays import FloatArray, IntArray

UNEVEN = {
    "wall_cosine": (0, 0),
    "wall_sine": (0, 1),
    "wall_second_cosine": (1, 0),
    "wall_second_sine": (1, 1),
}
"""Number of the wall's harmonic, and quarters of its period that it is rolled by."""

CLAMP = {"clamp_axial": 0, "clamp_transverse": 1}
"""Rows of the soft part."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AmplitudeSlope:
    """Derivative of amplitudes by one parameter.

    Attributes
    ----------
    even : (.., n_m, n_d, 3) of the part that goes round the body as the load does; None for none.
    uneven : harmonic of the wall, quarters of its period that it is rolled by, and (3 sides, .., n_m, n_d, 3);
        None for none.
    """

    even: FloatArray | None = None
    uneven: tuple[int, int, FloatArray] | None = None


def amplitude_slope(
    table: ResponseTable, built: AsBuilt, thickness: FloatArray, station: IntArray, key: tuple[str, int]
) -> AmplitudeSlope:
    """Return the derivative by parameter ``key``: its kind, and the number of its region or joint.

    ``thickness`` (n_t,) is what the rows of :attr:`ResponseTable.wall` are multiplied by, ``station`` (n_d,) the
    gauges'. What a table has no row of changes nothing.
    """
    kind, number = key
    if kind == "axial_shift":
        return AmplitudeSlope(even=_along(table, built, station))
    if kind in UNEVEN:
        wave, turned = UNEVEN[kind]
        load = None if table.uneven_load is None else table.uneven_load[wave, turned, number][..., station, :]
        part = table.uneven[wave, turned, number][..., station, :]
        return AmplitudeSlope(even=load, uneven=(WAVES[wave], turned, part) if part.any() else None)
    row = _row(table, built, thickness, kind, number)
    return AmplitudeSlope(even=None if row is None else row[..., station, :])


def _along(table: ResponseTable, built: AsBuilt, station: IntArray) -> FloatArray | None:
    if table.along is None:
        return None
    slope = table.along[..., station, :]
    if table.along_twice is None:
        return slope
    shift = at_gauges(built.axial_shift, table.nominal.ndim - 3)[..., None]
    return np.asarray(slope + 2.0 * shift * table.along_twice[..., station, :])


def _row(table: ResponseTable, built: AsBuilt, thickness: FloatArray, kind: str, number: int) -> FloatArray | None:
    """Return the derivative (.., n_m, n_s, 3) by thickness, taper, mass, clamp, joint or modulus."""
    if kind in ("wall_thickness", "wall_taper"):
        k = number + (built.n_regions if kind == "wall_taper" else 0)
        return table.wall[k] + 2.0 * thickness[k] * table.wall_twice[k] if len(table.wall) else None
    if kind == "region_mass":
        return None if table.region_mass is None else table.region_mass[number]
    if kind == "region_modulus":
        row = len(CLAMP) + built.counts.joint + number
        return table.soft[row] / (1.0 + built.region_modulus[number]) ** 2 if row < len(table.soft) else None
    row = CLAMP[kind] if kind in CLAMP else len(CLAMP) + number
    return table.soft[row] if row < len(table.soft) else None
