"""Derivatives of strain amplitudes by the parameters of a wall as built: closed, from the tables themselves.

Tables are polynomials in the wall and in the stations of the gauges, so that one row of a table is what one
parameter changes. Directions of gauges and their roll angles do not change amplitudes.

Derivatives of what gauges as built read, under known loads and per pressure, by the parameters of a vehicle.

They are closed: by gain, modulus and mass from the reading itself, by the direction of the gauges from the same
strain with other weights, by wall, clamp, joints and stations from the tables, see
:mod:`builder.structure.as_built.reading_slopes`. By the roll angle they are differences of the phases alone.
"""

from collections.abc import Callable, Sequence

import numpy as np

from builder.structure.as_built.as_built_vehicle import AsBuilt, Key, slope_by_factor, times_gauges
from builder.structure.as_built.gauge_strain_terms import WallGauges, gain_of, operator_of
from builder.structure.as_built.response_tables import (
    QUARTER,
    LoadResponse,
    ResponseTable,
    at_stations,
    side_phases,
    uneven_amplitudes,
)
from builder.structure.as_built.wall_changes import WAVES
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


Terms = Sequence[tuple[FloatArray | float, FloatArray]]
"""Amplitudes (.., n_m, n_s, 3) at stations, each with its factor (n_d,) at the gauges, or 1."""

Parts = Sequence[tuple[int, int, FloatArray]]
"""Harmonic of an uneven wall, quarters of its period that it is rolled by, and (3 sides, .., n_m, n_s, 3)."""

Weights = tuple[FloatArray, FloatArray]


def amplitude_terms(table: ResponseTable, as_built: AsBuilt, thickness: FloatArray) -> Terms:
    """Return the amplitudes of one vehicle that go round the body as the load does."""
    shift = as_built.axial_shift
    change = ((shift, table.along), (shift**2, table.along_twice))
    return [
        (1.0, at_stations(table, as_built, thickness)),
        *((size, change_per_size) for size, change_per_size in change if change_per_size is not None),
    ]


def amplitude_slope(
    table: ResponseTable, as_built: AsBuilt, thickness: FloatArray, key: tuple[str, int]
) -> tuple[Terms, Parts]:
    """Return the derivative by parameter ``key``: its kind, and the number of its region or joint.

    ``thickness`` (n_t,) is what the rows of :attr:`ResponseTable.wall` are multiplied by. What a table has no row
    of changes nothing.
    """
    kind, number = key
    if kind == "axial_shift":
        change = ((1.0, table.along), (2.0 * as_built.axial_shift, table.along_twice))
        return [(size, change_per_size) for size, change_per_size in change if change_per_size is not None], ()
    if kind in UNEVEN:
        wave, turned = UNEVEN[kind]
        part = table.uneven[wave, turned, number]
        load = [] if table.uneven_load is None else [(1.0, table.uneven_load[wave, turned, number])]
        return load, [(WAVES[wave], turned, part)] if part.any() else ()
    row = _row(table, as_built, thickness, kind, number)
    return [] if row is None else [(1.0, row)], ()


def _row(
    table: ResponseTable, as_built: AsBuilt, thickness: FloatArray, kind: str, number: int
) -> FloatArray | None:
    """Return the derivative (.., n_m, n_s, 3) by thickness, taper, mass, clamp, joint or modulus."""
    if kind in ("wall_thickness", "wall_taper"):
        k = number + (as_built.n_regions if kind == "wall_taper" else 0)
        return table.wall[k] + 2.0 * thickness[k] * table.wall_twice[k] if len(table.wall) else None
    if kind == "region_mass":
        return None if table.region_mass is None else table.region_mass[number]
    if kind == "region_modulus":
        row = len(CLAMP) + as_built.counts.joint + number
        return table.soft[row] / (1.0 + as_built.region_modulus[number]) ** 2 if row < len(table.soft) else None
    row = CLAMP[kind] if kind in CLAMP else len(CLAMP) + number
    return table.soft[row] if row < len(table.soft) else None


ROLL_STEP = 1e-4
"""Step of the differences by the roll angle [rad]."""

OF_ROLL = ("circumferential_shift", "layout_roll")
OF_DIRECTION = ("orientation", "row_orientation", "transverse_sensitivity")


class _Slopes:
    """Derivatives of one vehicle; what they have in common is found once.

    ``read`` returns readings (n_d, ..) of amplitudes, uneven parts, roll angles and weights of direction; they are
    linear in amplitudes and weights.
    """

    def __init__(
        self,
        on_wall: WallGauges,
        table: ResponseTable,
        as_built: AsBuilt,
        thickness: FloatArray,
        read: Callable[[Terms, Parts, FloatArray, Weights], FloatArray],
    ) -> None:
        self._wall, self._table, self._built, self._thickness, self._read = (
            on_wall,
            table,
            as_built,
            thickness,
            read,
        )
        self._even = amplitude_terms(table, as_built, thickness)
        self._uneven = tuple(uneven_amplitudes(table, as_built))
        self._roll, self._weights = on_wall.roll_angle(as_built), on_wall.direction_weights(as_built)
        self._by_direction = on_wall.direction_slopes(as_built)
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
        even, uneven = amplitude_slope(self._table, self._built, self._thickness, key)
        return self._read(even, uneven, self._roll, self._weights)

    def _of_roll(self) -> FloatArray:
        if self._by_roll is None:
            plus, minus = (
                self._read(self._even, self._uneven, self._roll + step, self._weights)
                for step in (ROLL_STEP, -ROLL_STEP)
            )
            self._by_roll = (plus - minus) / (2.0 * ROLL_STEP)
        return self._by_roll


def load_slopes(
    on_wall: WallGauges, response: LoadResponse, as_built: AsBuilt, thickness: FloatArray, keys: Sequence[Key]
) -> tuple[FloatArray, dict[Key, FloatArray]]:
    """Return readings (n_d, ..) under the loads of ``response``, and their derivatives by ``keys`` [m/m per unit].

    ``thickness`` is as in :func:`~builder.structure.as_built.response_tables.even_amplitudes`.
    """

    lead = response.table.nominal.shape[1:-3]

    def read(even: Terms, parts: Parts, roll: FloatArray, weights: Weights) -> FloatArray:
        return _read(lead, on_wall.station, even, parts, roll, weights)

    slopes = _Slopes(on_wall, response.table, as_built, thickness, read)
    by_stress, by_mass = (np.asarray(share_of) * 1.0 for share_of in (response.by_stress, response.by_mass))
    share = (1.0 + as_built.mass[0] * by_mass) / (1.0 + as_built.youngs_modulus[0] * by_stress)
    gain = gain_of(as_built)
    reading = times_gauges(slopes.value, gain) * share
    by_key = {}
    for key in keys:
        slope = slope_by_factor(key[0], reading, as_built, by_stress, by_mass)
        by_key[key] = times_gauges(slopes.by(key), gain) * share if slope is None else slope
    return reading + np.asarray(response.constant).T, by_key


def operator_slopes(
    on_wall: WallGauges,
    table: ResponseTable,
    as_built: AsBuilt,
    *,
    thickness: FloatArray,
    grid: SurfaceGrid,
    keys: Sequence[Key],
) -> dict[Key, FloatArray]:
    """Return the derivatives (n_d, n_p) of the strain operator on ``grid`` by ``keys`` [1/Pa per unit]."""

    shape = (*table.nominal.shape[:-2], len(on_wall.station), 3)

    def read(even: Terms, parts: Parts, roll: FloatArray, weights: Weights) -> FloatArray:
        amplitude = np.zeros(shape)
        for factor, term in even:
            amplitude += np.reshape(factor, (-1, 1)) * term[..., on_wall.station, :]
        gauges = on_wall.at_roll(amplitude, parts, roll=roll, weights=weights, lead=len(shape) - 3)
        return operator_of(gauges, as_built, grid)

    slopes = _Slopes(on_wall, table, as_built, thickness, read)
    by_key = {}
    for key in keys:
        slope = slope_by_factor(key[0], slopes.value, as_built, by_mass=0.0)
        by_key[key] = slopes.by(key) if slope is None else slope
    return by_key


def read_load(on_wall: WallGauges, table: ResponseTable, as_built: AsBuilt, thickness: FloatArray) -> FloatArray:
    """Return readings (.., n_d) of one vehicle under the loads of ``table``, without gain, mass and modulus."""
    even, uneven = amplitude_terms(table, as_built, thickness), tuple(uneven_amplitudes(table, as_built))
    roll, weights = on_wall.roll_angle(as_built), on_wall.direction_weights(as_built)
    reading = _read(table.nominal.shape[1:-3], on_wall.station, even, uneven, roll, weights)
    return np.moveaxis(reading, 0, -1)


def _read(
    lead: tuple[int, ...], station: IntArray, even: Terms, parts: Parts, roll: FloatArray, weights: Weights
) -> FloatArray:
    """Return readings (n_d, *lead) at roll angles (n_d,) of amplitudes (2, *lead, n_m, n_s, 3)."""
    reading = np.zeros((len(station), int(np.prod(lead))))
    at_stations, weight = _AtStations(station), np.column_stack(weights)
    changed = [(factor, amplitude) for factor, amplitude in even if np.any(factor)]
    if changed:
        phase = np.arange(changed[0][1].shape[-3])[:, None] * roll
        waves = at_stations.waves(np.cos(phase), np.sin(phase), weight)
        for factor, amplitude in changed:
            reading += np.reshape(factor, (-1, 1)) * at_stations.product(amplitude, waves)
    for wave, turned, sides in parts:
        phases = side_phases(roll - turned * QUARTER / wave, sides.shape[-3], wave)
        for (cosine, sine, at_side), part in zip(phases, sides, strict=True):
            waves = at_stations.waves(cosine, sine, weight)
            reading += at_side[:, None] * at_stations.product(part, waves)
    return reading.reshape(-1, *lead)


class _AtStations:
    """Gauges by their ``station`` (n_d,), each in a column of its own there: one product of matrices for each."""

    def __init__(self, station: IntArray) -> None:
        count, order = np.bincount(station), np.argsort(station, kind="stable")
        self._station, self._most = station, int(count.max(initial=0))
        self._column = np.empty(len(station), dtype=np.int64)
        self._column[order] = np.arange(len(station)) - np.repeat(np.cumsum(count) - count, count)

    def waves(self, cosine: FloatArray, sine: FloatArray, weight: FloatArray) -> FloatArray:
        """Return (stations, 3 n_m 2, columns) of harmonics (n_m, n_d) where gauges make ``weight`` (n_d, 3) of the
        strain."""
        waves = np.empty((len(self._station), 3, len(cosine), 2))
        waves[:, :2, :, 0], waves[:, :2, :, 1] = cosine.T[:, None], sine.T[:, None]
        waves[:, 2, :, 0], waves[:, 2, :, 1] = sine.T, -cosine.T
        waves *= weight[:, :, None, None]
        placed = np.zeros((int(self._station.max(initial=-1)) + 1, 6 * len(cosine), self._most))
        placed[self._station, :, self._column] = waves.reshape(len(waves), -1)
        return placed

    def product(self, amplitude: FloatArray, waves: FloatArray) -> FloatArray:
        """Return readings (n_d, n) of amplitudes (2, .., n_m, n_s, 3), n in all that stand between."""
        n_m, n_s, _ = amplitude.shape[-3:]
        rows = amplitude.reshape(2, -1, n_m, n_s, 3).transpose(3, 1, 4, 2, 0).reshape(n_s, -1, 6 * n_m)
        return np.asarray((rows[: len(waves)] @ waves)[self._station, :, self._column])
