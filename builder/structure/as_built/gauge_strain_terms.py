"""What gauges as built make of the strain of a wall of revolution, of one vehicle or of many at once.

Amplitudes are as in :mod:`builder.structure.as_built.response_tables`, per harmonic of a pressure.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built.response_tables import (
    QUARTER,
    ResponseTable,
    at_gauges,
    even_amplitudes,
    is_uneven,
    side_phases,
    uneven_amplitudes,
)
from builder.structure.as_built.wall_changes import quarter_turns
from builder.structure.fourier.inner_surface import PlacedGauges
from builder.structure.fourier.strain_operator import operator_in_roll
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False, kw_only=True)
class BuiltGauges:
    """Gauges of a vehicle as built, without gain.

    Attributes
    ----------
    even, odd : (.., n_m, n_d) response in the gauge's direction: cosine and sine part round the body, of the roll
        angle from the pressure's crest.
    roll_angle : (.., n_d) where the gauge is [rad].
    """

    even: FloatArray
    odd: FloatArray
    roll_angle: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightGauges:
    """What the gauges of a vehicle as built read in flight, per pressure round the body.

    Attributes
    ----------
    names : of the n_d gauges.
    roll_angle : (n_d,) where they are [rad].
    response : (n_d, n_m, n_x, 2) readings per harmonic m of the pressure at a station, as cos and sin of m times
        the roll angle from its crest to the gauge [1/Pa].
    apparent : (n_d,) reading without pressure [m/m].
    per_ambient, per_dynamic : (n_d,) readings in proportion to p_inf and to q_inf [1/Pa].
    record : the errors, for a file.
    """

    names: tuple[str, ...]
    roll_angle: FloatArray
    response: FloatArray
    apparent: FloatArray
    per_ambient: FloatArray
    per_dynamic: FloatArray
    record: dict[str, Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class WallGauges:
    """Gauges on the inner surface of a wall of revolution, by the drawing.

    Attributes
    ----------
    placed : n_d gauges.
    radius : (n_d,) of the inner surface there [m].
    row : (n_d,) number of the row of each gauge: those at one roll angle.
    station : (n_d,) number of the station of each gauge in tables.
    """

    placed: PlacedGauges
    radius: FloatArray
    row: IntArray
    station: IntArray

    def some(self, gauges: slice | IntArray) -> WallGauges:
        """Return some of the ``gauges``."""
        placed = PlacedGauges(**{name: value[gauges] for name, value in vars(self.placed).items()})
        return WallGauges(
            placed=placed, radius=self.radius[gauges], row=self.row[gauges], station=self.station[gauges]
        )

    def roll_angle(self, as_built: AsBuilt) -> FloatArray:
        """Return (.., n_d) where the gauges are [rad]."""
        return np.asarray(
            self.placed.roll_angle + as_built.layout_roll + as_built.circumferential_shift / self.radius
        )

    def direction_weights(self, as_built: AsBuilt) -> tuple[FloatArray, FloatArray]:
        """Return what a gauge makes of meridional and hoop strain (.., n_d, 2), and of shear (.., n_d).

        It reads strain along itself and, times its transverse sensitivity, across.
        """
        c, s = self._direction(as_built)
        across = as_built.transverse_sensitivity
        normal = np.stack([c * c + across * s * s, s * s + across * c * c], axis=-1)
        return normal, 2.0 * c * s * (1.0 - across)

    def direction_slopes(self, as_built: AsBuilt) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Return the derivatives of :meth:`direction_weights` of one vehicle, by the turn of the gauge and by its
        transverse sensitivity."""
        c, s = self._direction(as_built)
        less = 1.0 - as_built.transverse_sensitivity
        both = 2.0 * c * s * less
        by_turn = np.stack([-both, both], axis=-1), 2.0 * (c * c - s * s) * less
        by_across = np.stack([s * s, c * c], axis=-1), -2.0 * c * s
        return {"orientation": by_turn, "row_orientation": by_turn, "transverse_sensitivity": by_across}

    def _direction(self, as_built: AsBuilt) -> tuple[FloatArray, FloatArray]:
        """Return (.., n_d) the gauges' directions along the meridian and round the body."""
        turn = turn_of(as_built, self.row)
        cosine, sine = np.cos(turn), np.sin(turn)
        meridional, circumferential = self.placed.meridional, self.placed.circumferential
        return cosine * meridional - sine * circumferential, sine * meridional + cosine * circumferential

    def parts(self, table: ResponseTable, as_built: AsBuilt, thickness: FloatArray) -> BuiltGauges:
        """Return the response of the gauges under the pressures of ``table``; ``thickness`` as there."""
        roll = self.roll_angle(as_built)
        if roll.ndim > 1 and is_uneven(as_built):
            return _stacked([self.parts(table, as_built.one_of(k), thickness[k]) for k in range(len(roll))])
        amplitude = even_amplitudes(table, as_built, thickness, self.station)
        return self.at_roll(
            amplitude,
            uneven_amplitudes(table, as_built),
            roll=roll,
            weights=self.direction_weights(as_built),
            lead=table.nominal.ndim - 3,
        )

    def at_roll(
        self,
        amplitude: FloatArray,
        parts: Iterable[tuple[int, int, FloatArray]],
        *,
        roll: FloatArray,
        weights: tuple[FloatArray, FloatArray],
        lead: int,
    ) -> BuiltGauges:
        """Return the response of gauges at ``roll`` (.., n_d) [rad] that make ``weights`` of the strain.

        ``amplitude`` (.., n_m, n_d, 3) and ``parts``, at the stations, are as from
        :func:`~builder.structure.as_built.response_tables.even_amplitudes` and
        :func:`~builder.structure.as_built.response_tables.uneven_amplitudes`, per pressure, ``weights`` as from
        :meth:`direction_weights`; ``lead`` is how many dimensions of the table lead.
        """
        n_m = amplitude.shape[-3]
        normal, shear = at_gauges(weights[0], lead, 2), at_gauges(weights[1], lead)
        even, odd = _along(amplitude, normal), amplitude[..., 2] * shear
        phase = np.arange(n_m)[:, None] * roll[..., None, :]
        for wave, turned, sides in parts:
            cosine, sine = np.zeros_like(even), np.zeros_like(even)
            phases = side_phases(roll - turned * QUARTER / wave, n_m, wave)
            for (cos_m, sin_m, factor), part in zip(phases, sides[..., self.station, :], strict=True):
                along, across = _along(part, normal), part[..., 2] * shear
                cosine += factor * (along * cos_m + across * sin_m)
                sine += factor * (along * sin_m - across * cos_m)
            # cos n(phi - pi/2) = cos(n pi/2) cos(n phi) + sin(n pi/2) sin(n phi), and so for the sine.
            c, s = quarter_turns(turned * np.arange(n_m)[:, None], wave)
            cosine, sine = c * cosine - s * sine, s * cosine + c * sine
            even = even + cosine * np.cos(phase) + sine * np.sin(phase)
            odd = odd + cosine * np.sin(phase) - sine * np.cos(phase)
        return BuiltGauges(even=even, odd=odd, roll_angle=roll)


def _along(strain: FloatArray, normal: FloatArray) -> FloatArray:
    """Return what ``normal`` (.., 2) makes of meridional and hoop strain, (.., 3) with shear."""
    return np.asarray(strain[..., 0] * normal[..., 0] + strain[..., 1] * normal[..., 1])


def _stacked(parts: Sequence[BuiltGauges]) -> BuiltGauges:
    return BuiltGauges(
        even=np.stack([part.even for part in parts]),
        odd=np.stack([part.odd for part in parts]),
        roll_angle=np.stack([part.roll_angle for part in parts]),
    )


def turn_of(as_built: AsBuilt, row: IntArray) -> FloatArray:
    """Return (.., n_d) the turn of each gauge in the surface, its own and its row's, ``row`` (n_d,) [rad]."""
    of_row = as_built.row_orientation
    return np.asarray(as_built.orientation + (of_row[..., row] if of_row.shape[-1] > 1 else of_row))


def gain_of(as_built: AsBuilt) -> FloatArray:
    """Return (.., n_d) reading per strain."""
    return np.asarray((1.0 + as_built.common_gain) * (1.0 + as_built.gauge_gain))


def operator_of(gauges: BuiltGauges, as_built: AsBuilt, grid: SurfaceGrid) -> FloatArray:
    """Return Z_p (n_d, n_p) [1/Pa] of one vehicle from its response (n_x, n_m, n_d) to pressure on ``grid``."""
    even, odd = (part.transpose(2, 1, 0) for part in (gauges.even, gauges.odd))
    gain = gain_of(as_built) / (1.0 + as_built.youngs_modulus)
    return np.asarray(gain[:, None] * operator_in_roll(even, odd, gauges.roll_angle, grid))


def rows_of(roll_angle: FloatArray) -> IntArray:
    """Return (n_d,) the row of each gauge, numbered by roll angle."""
    rounded = np.mod(np.round(np.mod(roll_angle, 2.0 * np.pi), 6), np.round(2.0 * np.pi, 6))
    return np.unique(rounded, return_inverse=True)[1]
