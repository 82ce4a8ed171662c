"""What becomes of readings: gauges, or auxiliary sensors, that fail; seven verbs; and sets of gauges that are
lost."""

from __future__ import annotations

from itertools import combinations
from math import radians
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from builder.vehicle.toml.toml_sections import Section
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap

MICRO = 1e-6


class Gauges(NamedTuple):
    """Gauges, or auxiliary sensors: station [m], roll angle [rad] and noise [m/m, or their unit], each (n_d,)."""

    station: FloatArray
    roll_angle: FloatArray
    noise_std: FloatArray


class Fault(Section):
    """What becomes of the readings of ``of`` gauges, drawn, or of all: first another source, then times and added.

    Attributes
    ----------
    of : number of gauges, drawn; None for all.
    sensors : whether auxiliary sensors fail instead of gauges.
    frozen : they keep what they read in one of the flights.
    swapped : they read in reverse order.
    exchanged : opposite rows of equal stations, as by two connectors: all, or in each flight the pair that is
        nearest to the plane of the flow direction. A row is the gauges of one roll angle.
    lost : no reading.
    times : factor.
    add_um_per_m, add_sigmas : what is added, the latter over the noise of each gauge.
    shape : of what is added: even, as the cosine from leeward, or linear from 0 at the first station to the last.
    noise_times : noise over the stated one.
    """

    of: int | None = Field(default=None, ge=1)
    sensors: bool = False
    frozen: bool = False
    swapped: bool = False
    exchanged: Literal["nearest", "all"] | None = None
    lost: bool = False
    times: float = 1.0
    add_um_per_m: float = 0.0
    add_sigmas: float = 0.0
    shape: Literal["even", "cosine", "linear"] = "even"
    noise_times: float = Field(default=1.0, ge=1.0)

    def readings(
        self, strain: FloatArray, gauges: Gauges, leeward: FloatArray, random: np.random.Generator
    ) -> FloatArray:
        """Return what is read instead of ``strain`` (n, n_d); ``leeward`` (n,) is the leeward meridian [rad]."""
        out, n_d = strain.copy(), strain.shape[1]
        which: Any = slice(None) if self.of is None else random.choice(n_d, size=min(self.of, n_d), replace=False)
        if self.frozen:
            out[:, which] = strain[int(random.integers(len(strain))), which]
        if self.swapped:
            out[:, which] = strain[:, which[::-1]]
        if self.exchanged is not None:
            _exchange(opposite_rows(gauges), self.exchanged == "all", strain, out, leeward)
        if self.lost:
            out[:, which] = np.nan
        added = MICRO * self.add_um_per_m * self._shape(gauges, leeward) + self.add_sigmas * gauges.noise_std
        out[:, which] = self.times * out[:, which] + np.broadcast_to(added, strain.shape)[:, which]
        if self.noise_times > 1.0:
            out += np.sqrt(self.noise_times**2 - 1.0) * gauges.noise_std * random.standard_normal(strain.shape)
        return out

    def _shape(self, gauges: Gauges, leeward: FloatArray) -> FloatArray:
        if self.shape == "cosine":
            return np.cos(gauges.roll_angle - leeward[:, None])
        x = gauges.station
        return (x - x.min()) / (np.ptp(x) or 1.0) if self.shape == "linear" else np.ones(len(x))


def opposite_rows(gauges: Gauges) -> list[tuple[float, IntArray, IntArray]]:
    """Return angle [rad] and gauges of each pair of opposite rows of equal stations."""
    roll = np.mod(np.round(np.degrees(gauges.roll_angle), 3), 360.0)
    pairs = []
    for angle in np.unique(roll[roll < 180.0]):
        near, far = np.flatnonzero(roll == angle), np.flatnonzero(roll == angle + 180.0)
        if len(near) == len(far) and np.allclose(gauges.station[near], gauges.station[far]):
            pairs.append((radians(angle), near, far))
    return pairs


def _exchange(
    pairs: list[tuple[float, IntArray, IntArray]],
    every: bool,
    strain: FloatArray,
    out: FloatArray,
    leeward: FloatArray,
) -> None:
    """Exchange opposite rows in ``out``."""
    in_plane = np.abs([np.cos(leeward - angle) for angle, _, _ in pairs])
    for number, (_, near, far) in enumerate(pairs):
        rows = np.arange(len(strain)) if every else np.flatnonzero(in_plane.argmax(axis=0) == number)
        out[np.ix_(rows, near)], out[np.ix_(rows, far)] = strain[np.ix_(rows, far)], strain[np.ix_(rows, near)]


class NoSuchGaugesError(InputError):
    """A layout has no such gauges to lose."""


class Lost(Section):
    """Sets of gauges that are lost, one set after another, in the same flights.

    Attributes
    ----------
    gauges : ``count`` rows, every combination; each direction, axial or hoop; each direction of each row; each
        direction and each row; or all but ``count``, drawn.
    count : number of them; 0 for half of the gauges.
    sets : number of sets that are drawn.
    samples : of each set, the next ones of the trial; 0 for all.
    """

    gauges: Literal["rows", "direction", "direction of a row", "direction and row", "all but"]
    count: int = Field(default=1, ge=0)
    sets: int = Field(default=20, ge=1)
    samples: int = Field(default=0, ge=0)

    def in_use(self, inverse_map: InverseMap, random: np.random.Generator) -> dict[str, BoolArray]:
        """Return the gauges that are in use (n_d,), by the name of what is lost.

        Raises
        ------
        NoSuchGaugesError
            The layout has no such set.
        """
        roll, axial = gauge_rows(inverse_map)
        rows, n_d, sets = np.unique(roll).tolist(), len(roll), dict[str, BoolArray]()
        if self.gauges == "rows":
            for lost in combinations(rows, self.count):
                sets[" and ".join(f"{row:g}" for row in lost) + " deg"] = ~np.isin(roll, lost)
        elif self.gauges == "all but":
            for _ in range(self.sets if self.count < n_d else 0):
                gauges = np.sort(random.choice(n_d, size=self.count or n_d // 2, replace=False))
                sets["all but " + " ".join(f"{gauge + 1}" for gauge in gauges)] = np.isin(np.arange(n_d), gauges)
        else:
            for direction, other in (("hoop", axial), ("axial", ~axial)):
                if self.gauges == "direction":
                    sets[direction] = other
                for row in rows if self.gauges != "direction" else ():
                    if self.gauges == "direction of a row":
                        sets[f"{direction} at {row:g} deg"] = other | (roll != row)
                    else:
                        sets[f"{direction} and {row:g} deg"] = other & (roll != row)
        if not (sensible := {name: gauges for name, gauges in sets.items() if 0 < gauges.sum() < n_d}):
            raise NoSuchGaugesError(f"no such gauges to lose among {n_d} in {len(rows)} rows")
        return sensible


def gauge_rows(inverse_map: InverseMap) -> tuple[FloatArray, BoolArray]:
    """Return the roll angle (n_d,) [deg] of the meridian that each gauge is on, and whether it reads along the
    axis."""
    _, y, z = inverse_map.gauge_position.T
    roll = np.round(np.mod(np.degrees(np.arctan2(y, z)), 360.0), 3) % 360.0
    return np.asarray(roll), np.abs(inverse_map.gauge_direction[:, 0]) > np.sqrt(0.5)
