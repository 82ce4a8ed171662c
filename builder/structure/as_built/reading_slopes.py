"""Derivatives of strain amplitudes by the parameters of a wall as built: closed, from the tables themselves.

Tables are polynomials in the wall and in the stations of the gauges, so that one row of a table is what one
parameter changes. Directions of gauges and their roll angles do not change amplitudes.

Derivatives of what gauges as built read, under known loads and per pressure, by the parameters of a vehicle.

They are closed: by gain, modulus and mass from the reading itself, by the direction of the gauges from the same
strain with other weights, by wall, clamp, joints and stations from the tables, see
:mod:`builder.structure.as_built.reading_slopes`. By the roll angle they are differences of the phases alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from builder.structure.as_built.as_built_vehicle import AsBuilt, Key, slope_by_factor, times_gauges
from builder.structure.as_built.gauge_strain_terms import WallGauges, gain_of, operator_of
from builder.structure.as_built.response_tables import (
    QUARTER,
    LoadResponse,
    ResponseTable,
    at_gauges,
    even_amplitudes,
    side_phases,
    uneven_amplitudes,
)
from builder.structure.as_built.wall_harmonics import WAVES
from builder.vehicle.shape.geometry import SurfaceGrid
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


ROLL_STEP = 1e-4
"""Step of the differences by the roll angle [rad]."""

OF_ROLL = ("circumferential_shift", "layout_roll")
OF_DIRECTION = ("orientation", "row_orientation", "transverse_sensitivity")

Weights = tuple[FloatArray, FloatArray]
Parts = Sequence[tuple[int, int, FloatArray]]


class _Slopes:
    """Derivatives of one vehicle; what they have in common is found once.

    ``read`` returns readings (n_d, ..) of even amplitudes, uneven parts, roll angles and weights of direction;
    they are linear in amplitudes and weights.
    """

    def __init__(
        self,
        on_wall: WallGauges,
        table: ResponseTable,
        built: AsBuilt,
        thickness: FloatArray,
        read: Callable[[FloatArray, Parts, FloatArray, Weights], FloatArray],
    ) -> None:
        self._wall, self._table, self._built, self._thickness, self._read = on_wall, table, built, thickness, read
        self._even = even_amplitudes(table, built, thickness, on_wall.station)
        self._uneven = tuple(uneven_amplitudes(table, built, on_wall.station))
        self._roll, self._weights = on_wall.roll_angle(built), on_wall.direction_weights(built)
        self._by_direction = on_wall.direction_slopes(built)
        self._by_roll: FloatArray | None = None
        self.value = read(self._even, self._uneven, self._roll, self._weights)

    def by(self, key: Key) -> FloatArray:
        """Return the derivative (n_d, ..) by ``key``, which is none of gain, modulus and mass."""
        kind, number = key
        if kind in OF_ROLL:
            slope = self._of_roll()
            return slope if kind == "layout_roll" else times_gauges(slope, 1.0 / self._wall.radius)
        if kind in OF_DIRECTION:
            slope = self._read(self._even, self._uneven, self._roll, self._by_direction[kind])
            return times_gauges(slope, (self._wall.row == number) * 1.0) if kind == "row_orientation" else slope
        return self._of_amplitudes(
            amplitude_slope(self._table, self._built, self._thickness, self._wall.station, key)
        )

    def _of_roll(self) -> FloatArray:
        if self._by_roll is None:
            plus, minus = (
                self._read(self._even, self._uneven, self._roll + step, self._weights)
                for step in (ROLL_STEP, -ROLL_STEP)
            )
            self._by_roll = (plus - minus) / (2.0 * ROLL_STEP)
        return self._by_roll

    def _of_amplitudes(self, slope: AmplitudeSlope) -> FloatArray:
        if slope.even is None and slope.uneven is None:
            return np.zeros_like(self.value)
        even = np.zeros_like(self._even) if slope.even is None else slope.even
        parts = () if slope.uneven is None else (slope.uneven,)
        return self._read(even, parts, self._roll, self._weights)


def load_slopes(
    on_wall: WallGauges, response: LoadResponse, built: AsBuilt, thickness: FloatArray, keys: Sequence[Key]
) -> tuple[FloatArray, dict[Key, FloatArray]]:
    """Return readings (n_d, ..) under the loads of ``response``, and their derivatives by ``keys`` [m/m per unit].

    ``thickness`` is as in :func:`~builder.structure.as_built.response_tables.even_amplitudes`.
    """

    def read(even: FloatArray, parts: Parts, roll: FloatArray, weights: Weights) -> FloatArray:
        normal, shear = weights
        strain = strain_at_roll(even, parts, roll)
        return np.moveaxis((normal * strain[..., :2]).sum(axis=-1) + shear * strain[..., 2], -1, 0)

    slopes = _Slopes(on_wall, response.table, built, thickness, read)
    by_stress, by_mass = (np.asarray(one) * 1.0 for one in (response.by_stress, response.by_mass))
    share = (1.0 + built.mass[0] * by_mass) / (1.0 + built.youngs_modulus[0] * by_stress)
    gain = gain_of(built)
    reading = times_gauges(slopes.value, gain) * share
    by_key = {}
    for key in keys:
        slope = slope_by_factor(key[0], reading, built, by_stress, by_mass)
        by_key[key] = times_gauges(slopes.by(key), gain) * share if slope is None else slope
    return reading + np.asarray(response.constant).T, by_key


def operator_slopes(
    on_wall: WallGauges,
    table: ResponseTable,
    built: AsBuilt,
    *,
    thickness: FloatArray,
    grid: SurfaceGrid,
    keys: Sequence[Key],
) -> dict[Key, FloatArray]:
    """Return the derivatives (n_d, n_p) of the strain operator on ``grid`` by ``keys`` [1/Pa per unit]."""

    def read(even: FloatArray, parts: Parts, roll: FloatArray, weights: Weights) -> FloatArray:
        gauges = on_wall.at_roll(even, parts, roll=roll, weights=weights, lead=table.nominal.ndim - 3)
        return operator_of(gauges, built, grid)

    slopes = _Slopes(on_wall, table, built, thickness, read)
    by_key = {}
    for key in keys:
        slope = slope_by_factor(key[0], slopes.value, built, by_mass=0.0)
        by_key[key] = slopes.by(key) if slope is None else slope
    return by_key


def strain_at_roll(even: FloatArray, parts: Parts, roll: FloatArray) -> FloatArray:
    """Return strain (.., n_d, 3) at roll angles (n_d,) of amplitudes (2, .., n_m, n_d, 3) and uneven parts."""
    n_m = even.shape[-3]
    phase = np.arange(n_m)[:, None] * roll
    strain = _at_roll(even, np.cos(phase), np.sin(phase))
    for wave, turned, sides in parts:
        phases = side_phases(roll - turned * QUARTER / wave, n_m, wave)
        for (cosine, sine, factor), part in zip(phases, sides, strict=True):
            strain = strain + factor[:, None] * _at_roll(part, cosine, sine)
    return strain


def _at_roll(amplitude: FloatArray, cosine: FloatArray, sine: FloatArray) -> FloatArray:
    """Return strain (.., n_d, 3) of amplitudes (2, .., n_m, n_d, 3) where the harmonics are (n_m, n_d)."""
    first, second = amplitude
    strain = first * np.stack([cosine, cosine, sine], axis=-1)
    strain += second * np.stack([sine, sine, -cosine], axis=-1)
    return np.asarray(strain.sum(axis=-3))
