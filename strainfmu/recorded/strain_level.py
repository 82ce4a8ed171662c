"""The level of recorded strains against the map's, and the unit that would explain a difference."""

from dataclasses import dataclass
from math import log10
from pathlib import Path

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.settings import SENSOR_RANGE
from strainfmu.units import PRESSURE_UNITS

TOO_HIGH = 10.0
"""Times the level of the snapshots above which strains are refused: no flight is so far beyond a map."""

TOO_LOW = 1.0 / 300.0
"""Fraction of the level at the data's q_inf below which strains are refused: gauge noise alone gives more."""

_UNITS = (("um/m", 1e-6), ("mm/m", 1e-3), ("percent", 1e-2), ("m/m", 1.0))
_PRESSURE_UNITS = ("Pa", "hPa", "kPa", "bar", "MPa", "psi", "psf")
_FLOWN = (0.008, 4.0)
"""Largest strain of a recording over the snapshots' strain: 0.016 on the shipped vehicle without incidence."""
_TYPICAL = 0.4

_QUANTILE = 0.99
"""Of a gauge's |strain| in a block: single spikes do not count."""

_RISE = 1.001
"""Ratio of strains to the level so far below which they do not raise it: a flight repeats its largest strains."""

_EXPLAINED = 5.0
"""Largest factor between a dynamic pressure in another unit and the one that the strains suggest."""

_OF_NOISE = 20.0
"""Expected strains over the noise from which on a low level means anything."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LevelReference:
    """What a map expects of strains.

    Attributes
    ----------
    strain_range : (n_d,) largest |strain| over the snapshots [m/m].
    noise_std : (n_d,) standard deviation of the gauge noise [m/m], 0 where it is not known.
    dynamic_pressure : q_inf at which that is so [Pa].
    sensor_range : largest |strain| of a working gauge [m/m].
    pressure_range : smallest and largest q_inf that the map covers [Pa], None where that is not known.
    """

    strain_range: FloatArray
    noise_std: FloatArray
    dynamic_pressure: float
    sensor_range: float = SENSOR_RANGE
    pressure_range: tuple[float, float] | None = None

    @property
    def observed(self) -> BoolArray:
        """(n_d,) of bool, gauges whose strain is above their noise."""
        return np.asarray((self.strain_range > 10.0 * self.noise_std) & (self.strain_range > 0.0))

    def ratio(self, level: FloatArray) -> float:
        """Return the median over the gauges of ``level`` (n_d,) [m/m] over the range; NaN if no gauge shows it."""
        observed = self.observed & np.isfinite(level)
        return float(np.median(level[observed] / self.strain_range[observed])) if observed.any() else float("nan")


def likely_units(ratio: float, factor: float) -> tuple[str, ...]:
    """Return the units that strains may be in, likeliest first, which exceed the map's ``ratio`` times as read.

    ``factor`` converts the unit stated to m/m. Two units where both leave a level that a recording may have:
    percent and mm/m are a factor of 10 apart. Empty if no unit explains the ratio.
    """
    level = {name: ratio * value / factor for name, value in _UNITS if abs(value - factor) > 1e-9 * factor}
    possible = [name for name in level if _FLOWN[0] <= level[name] <= _FLOWN[1]]
    return tuple(sorted(possible, key=lambda name: abs(log10(level[name] / _TYPICAL))))


def level_of(strain: FloatArray) -> FloatArray:
    """Return (n_d,) the level of each gauge in ``strain`` (n, n_d) [m/m], NaN where it has no value."""
    return raised_level(np.full(strain.shape[1], np.nan), np.abs(strain))


def raised_level(level: FloatArray, size: FloatArray) -> FloatArray:
    """Return (n_d,) the larger of ``level`` and the level of |strain| (n, n_d) [m/m], NaN where both are none.

    The level in a block is made for those gauges alone of which enough strains are above ``level``.
    """
    n, raised = len(size), level.copy()
    above = np.count_nonzero(size > np.where(np.isnan(level), -1.0, _RISE * level), axis=0)
    known = np.full(len(level), n) if np.isfinite(size.sum()) else np.count_nonzero(np.isfinite(size), axis=0)
    some = np.flatnonzero((known > 0) & (above + 1 > (1.0 - _QUANTILE) * known))
    if len(some):
        quantile = np.quantile if known.min() == n else np.nanquantile
        raised[some] = np.fmax(level[some], quantile(size[:, some], _QUANTILE, axis=0))
    return raised


@dataclass(frozen=True, eq=False)
class LevelCheck:
    """Compares the level (n_d,) of the gauges of a file [m/m] with the map's, at its largest q_inf [Pa].

    Attributes
    ----------
    factor : of the unit of the strains, to m/m.
    refuses : whether another level is refused; else a note says so.
    source : the quantity that q_inf comes from, and the factor of its unit to Pa; None of an altitude.
    """

    path: Path
    reference: LevelReference
    factor: float
    refuses: bool = True
    source: tuple[str, float] | None = (DYNAMIC_PRESSURE, 1.0)

    def refuse_high(self, level: FloatArray, pressure: float) -> None:
        """Refuse a level so far that is far above the map's.

        Raises
        ------
        InputError
            It is.
        """
        if self.refuses and (above := self._above(level, pressure)) > TOO_HIGH:
            raise InputError(self._text(above, level))

    def notes(self, level: FloatArray, pressure: float) -> list[str]:
        """Return what is to be said of the level of the whole file, nothing where it may be a flight's.

        Raises
        ------
        InputError
            The level is far below the level of the map at the same dynamic pressure.
        """
        above, below = self._above(level, pressure), self._below(level, pressure)
        if self.reference.ratio(level) == 0.0:
            return [f"{self.path}: half of the gauges or more read 0 throughout"]
        if below < TOO_LOW and self.refuses:
            raise InputError(self._text(below, level))
        if above > TOO_HIGH or below < TOO_LOW:
            return [self._text(above if above > TOO_HIGH else below, level)]
        return self._pressure_notes(level, pressure)

    def _pressure_notes(self, level: FloatArray, q: float) -> list[str]:
        """Return a note on a q_inf that the map does not cover, and that would fit the strains in another unit."""
        reference, nominal = self.reference, self.reference.dynamic_pressure
        low, high = reference.pressure_range or (0.1 * nominal, 10.0 * nominal)
        suggested = reference.ratio(level) / _TYPICAL * nominal
        if self.source is None or not q > 0.0 or low <= q <= high or not suggested > 0.0:
            return []
        name, factor = self.source
        in_unit = {unit: q * PRESSURE_UNITS[unit] / factor for unit in _PRESSURE_UNITS}
        likely = [unit for unit, value in in_unit.items() if 1.0 / _EXPLAINED < value / suggested < _EXPLAINED]
        if not likely or max(q / suggested, suggested / q) < TOO_HIGH:
            return []
        likely.sort(key=lambda unit: abs(log10(in_unit[unit] / suggested)))
        advice = "give it in Pa" if name.startswith("-") else f"state the unit, as in '{name} [{likely[0]}]'"
        covered = f"what the map covers, {low:.4g} to {high:.4g} Pa"
        if reference.pressure_range is None:
            covered = f"the nominal one, {nominal:.4g} Pa"
        return [
            f"{self.path}: {name}: q_inf is {q:.4g} Pa at most, {q / nominal:.1g} times {covered}, and strains "
            f"do not fit it: likely in {' or '.join(likely)}; {advice}"
        ]

    def _above(self, level: FloatArray, pressure: float) -> float:
        """Return the level over the map's, at a q_inf that may be above the map's."""
        return self.reference.ratio(level) / max(1.0, min(self._flown(pressure), 10.0))

    def _below(self, level: FloatArray, pressure: float) -> float:
        """Return the level over the map's at the data's largest q_inf; NaN where noise would hide the strains."""
        reference, part = self.reference, min(self._flown(pressure), 1.0)
        noise = reference.noise_std[reference.observed]
        expected = part * reference.strain_range[reference.observed]
        if not part >= 0.1 or not len(noise) or float(np.median(expected - _OF_NOISE * noise)) <= 0.0:
            return float("nan")
        return reference.ratio(level) / part

    def _flown(self, pressure: float) -> float:
        """Return the data's largest q_inf over the nominal one, 0 where none is known."""
        return float(np.fmax(pressure / self.reference.dynamic_pressure, 0.0))

    def _text(self, ratio: float, level: FloatArray) -> str:
        observed, units = self.reference.observed & np.isfinite(level), likely_units(ratio, self.factor)
        read, expected = (1e6 * float(np.max(values[observed])) for values in (level, self.reference.strain_range))
        likely, example = "no unit explains it", ""
        if units:
            names = (name for name, value in _UNITS if abs(value - self.factor) <= 1e-9 * self.factor)
            likely = f"likely in {' or '.join(units)}, not {next(names, f'{self.factor:g} m/m')}"
            example = f", as in 'strain[1] [{units[0]}]'"
        advice = f"; state the unit{example}, or give --accept-strain-level" if self.refuses else ""
        return (
            f"{self.path}: strains are {ratio:.2g} times the map's, {read:.3g} um/m against {expected:.3g} um/m: "
            f"{likely}{advice}"
        )
