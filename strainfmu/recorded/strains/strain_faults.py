"""Strains of a recording that no gauge has measured: rows held by the recorder, rows of zeros, railed channels.

They are taken out of the blocks ahead of the estimate, which cannot detect the first two: strains of another time
fit the map as well as new ones. A row is held if no gauge changes, to the last bit, for longer than noise and
resolution allow. A railed channel reads what no flow of the map gives any gauge.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum, auto
from math import ceil, exp, inf, log
from pathlib import Path

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.numerics.quantisation import LARGEST_RATIO, common_step, longest_repetition
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.columns.flight_pressure import flown_pressure
from strainfmu.recorded.columns.strain_level import TOO_HIGH, LevelReference
from strainfmu.recorded.strains.repeats import RunLengths, repeated


class RowFault(StrEnum):
    """Faults of a whole row, as the output names them; of single gauges it names these."""

    HELD = auto()
    ZERO = auto()


HELD, ZERO = (one.value for one in RowFault)

SHORTEST_HELD, SHORTEST_RAILED = 9, 24
"""Repetitions in a row that count, of all gauges and of one: a recorder may repeat channels that are slower."""

_FALSE_ALARM, _RARE = 1e-12, 1e-9
"""Largest probability of as many repetitions, of all gauges and of one."""

_UNKNOWN_NOISE = 0.5
"""Noise in steps of the resolution where the estimator states none."""

_LARGEST_OVER = 10.0
"""Largest dynamic pressure that counts, in nominal ones of the map; taken where it is not known."""

_SAMPLED = 20
"""Rows of a block in which the resolution is looked for."""

_NAMED = 3


@dataclass
class _Found:
    """Rows with one fault: how many, the time of the first [s], and the largest |reading| [m/m]."""

    rows: int = 0
    begin: float = float("nan")
    largest: float = 0.0

    def add(self, time: FloatArray, has_fault: BoolArray, reading: FloatArray | None = None) -> None:
        if not has_fault.any():
            return
        self.begin = self.begin if self.rows else float(time[np.argmax(has_fault)])
        self.rows += int(has_fault.sum())
        if reading is not None:
            self.largest = max(self.largest, float(np.abs(reading[has_fault]).max()))


class StrainFaults:
    """Takes out of successive blocks what no gauge has measured.

    Parameters
    ----------
    path : file that the notes name.
    gauge_names : n_d names.
    reference : strains that the estimator expects.
    zero : (n_d,) or one zero that it subtracts [m/m].
    accepts_held : whether held rows stay as they are.
    """

    def __init__(
        self,
        path: Path,
        gauge_names: tuple[str, ...],
        reference: LevelReference,
        *,
        zero: FloatArray | float = 0.0,
        accepts_held: bool = False,
    ) -> None:
        self._path, self._names, self._reference = path, gauge_names, reference
        self._zero, self._accepts_held = zero, accepts_held
        self._resolution = inf
        self._of_gauges, self._of_rows = RunLengths(len(gauge_names)), RunLengths(1)
        self._is_first = True
        self._held, self._zeros, self._railed = _Found(), _Found(), dict[str, _Found]()
        self.missing: Counter[str] = Counter()
        """Number of strains without a value, by gauge."""

    def without(self, blocks: Iterable[tuple[StrainBlock, int]]) -> Iterator[tuple[StrainBlock, int]]:
        """Yield ``blocks`` with the faults of their rows; strains with one are NaN. Looks one block ahead."""
        before: tuple[StrainBlock, int, BoolArray] | None = None
        last = np.full(len(self._names), inf)
        for block, done in blocks:
            same = repeated(block.strain, last)
            last = block.strain[-1]
            if before is not None:
                yield self._checked(before[0], before[2], same), before[1]
            before = block, done, same
        if before is not None:
            yield self._checked(before[0], before[2], before[2][:0]), before[1]

    def notes(self) -> list[str]:
        """Return a line on every kind of fault."""
        notes = []
        if self._held.rows:
            what = (
                "estimated all the same"
                if self._accepts_held
                else "which are left out; --accept-held estimates them"
            )
            notes.append(
                f"{self._path}: no gauge changes in {self._held.rows} rows, to the last bit, the first at "
                f"{self._held.begin:g} s: the recorder holds its last values, {what}"
            )
        if self._zeros.rows:
            notes.append(
                f"{self._path}: all gauges read exactly zero in {self._zeros.rows} rows, the first at "
                f"{self._zeros.begin:g} s: left out"
            )
        ranked = sorted(self._railed.items(), key=lambda item: -item[1].rows)
        for name, found in ranked[:_NAMED]:
            notes.append(
                f"{self._path}: '{name}' reads {1e6 * found.largest:.6g} um/m, which no flow of the map gives, in "
                f"{found.rows} rows, the first at {found.begin:g} s: left out there; --exclude '{name}' leaves it "
                "out everywhere"
            )
        if len(ranked) > _NAMED:
            notes.append(
                f"{self._path}: {len(ranked) - _NAMED} other gauges do so too: the column strain_faults names them"
            )
        return notes

    def _checked(self, block: StrainBlock, same: BoolArray, following: BoolArray) -> StrainBlock:
        """Return ``block`` with its faults; ``same`` of its rows, and of those ``following``, as of RunLengths."""
        strain, known = block.strain, np.isfinite(block.strain)
        if not known.all():
            missing = (len(known) - np.count_nonzero(known, axis=0)).tolist()
            self.missing.update({name: k for name, k in zip(self._names, missing, strict=True) if k})
        self._resolution = min(self._resolution, common_step(strain[:_SAMPLED][known[:_SAMPLED]]))
        has_values, longest = known.any(axis=1), self._longest()
        zero = has_values & _is_zero(strain) & ~(block.dynamic_pressure <= 0.0)
        row_same = _all(same) & has_values
        runs = self._of_rows.take(row_same[:, None], _all(following)[:, None])[:, 0]
        if self._is_first:  # nothing shows that the first row of the file is new
            row_same[0], self._is_first = True, False
        held = row_same & ~zero & (runs >= _longest_of_all(longest[known.any(axis=0)]))
        bearable = self._bearable(block)
        alone = _alone(same)
        if self._is_bearable(strain, bearable):
            self._of_gauges.skip(alone)
            return self._marked(block, held=held, zero=zero, railed=np.zeros(same.shape, dtype=bool))
        railed = self._is_railed(strain, bearable, self._of_gauges.take(alone, _alone(following)), longest)
        return self._marked(block, held=held, zero=zero, railed=railed & ~(zero | held)[:, None])

    def _marked(self, block: StrainBlock, *, held: BoolArray, zero: BoolArray, railed: BoolArray) -> StrainBlock:
        """Return ``block`` without strains of rows (n,) and of gauges (n, n_d) with a fault; count them."""
        time, strain = block.time, block.strain
        if not (held.any() or zero.any() or railed.any()):
            return replace(block, faults=("",) * len(time))
        self._held.add(time, held)
        self._zeros.add(time, zero)
        for gauge in np.flatnonzero(railed.any(axis=0)).tolist():
            name = self._names[gauge]
            self._railed.setdefault(name, _Found()).add(time, railed[:, gauge], strain[:, gauge])
        faults = [HELD if h else ZERO if z else "" for h, z in zip(held.tolist(), zero.tolist(), strict=True)]
        for row in np.flatnonzero(railed.any(axis=1)).tolist():
            faults[row] = ";".join(self._names[gauge] for gauge in np.flatnonzero(railed[row]))
        taken = railed | (zero if self._accepts_held else zero | held)[:, None]
        return replace(block, strain=np.where(taken, np.nan, strain), faults=tuple(faults))

    def _longest(self) -> FloatArray:
        """Return (n_d,) how many repetitions of its reading each gauge has with a probability of 1/e."""
        noise = self._reference.noise_std
        step = self._resolution if 0.0 < self._resolution < inf else 1.0
        ratio = np.where(noise > 0.0, np.minimum(noise / step, LARGEST_RATIO), _UNKNOWN_NOISE)
        return np.array([longest_repetition(one, exp(-1.0)) for one in ratio.tolist()])

    def _bearable(self, block: StrainBlock) -> FloatArray:
        """Return (n,) the largest |strain| of any flow of the map at the dynamic pressure of each row [m/m]."""
        reference = self._reference
        nominal = flown_pressure(block.dynamic_pressure, block.flow) / reference.dynamic_pressure
        over = np.clip(np.where(np.isfinite(nominal), nominal, _LARGEST_OVER), 1.0, _LARGEST_OVER)
        return np.asarray((float(reference.strain_range.max()) or inf) * over)

    def _is_bearable(self, strain: FloatArray, bearable: FloatArray) -> bool:
        """Return whether no reading (n, n_d) is beyond what a gauge bears, or beyond ``bearable`` (n,) [m/m]."""
        beyond = np.abs(strain - self._zero) > bearable[:, None]
        return not (beyond.any() or np.any(np.abs(strain) > self._reference.sensor_range))

    def _is_railed(
        self, strain: FloatArray, bearable: FloatArray, runs: IntArray, longest: FloatArray
    ) -> BoolArray:
        """Return (n, n_d) which readings are beyond what a gauge bears, or any flow of the map gives.

        The latter: far beyond ``bearable`` (n,) [m/m], or beyond it and without change. Where most gauges are
        beyond, another flow or unit it is, and their median takes the place of the map's strains.
        """
        level = np.abs(strain - self._zero) / bearable[:, None]
        has_values = np.asarray(np.isfinite(strain).any(axis=1))
        usual = np.nanmedian(np.where(has_values[:, None], level, 0.0), axis=1)
        level /= np.maximum(usual, 1.0)[:, None]
        stands_still = runs >= np.maximum(SHORTEST_RAILED, -log(_RARE) * longest)
        beyond = (level > TOO_HIGH) | ((level > 1.0) & stands_still)
        return np.asarray(beyond | (np.abs(strain) > self._reference.sensor_range))


def _is_zero(strain: FloatArray) -> BoolArray:
    """Return (n,) whether all readings (n, n_d) of a row are 0 or none."""
    found = ~(np.abs(strain[:, 0]) > 0.0)
    rows = np.flatnonzero(found)
    found[rows] = ~np.any(np.abs(strain[rows]) > 0.0, axis=1)
    return found


def _alone(same: BoolArray) -> BoolArray:
    """Return (n, n_d) which gauges repeat their reading in rows in which others change."""
    changes = ~_all(same)
    return same & changes[:, None]


def _all(mask: BoolArray) -> BoolArray:
    """Return (n,) whether all of each row of ``mask`` (n, n_d) are true."""
    return np.asarray(mask.all(axis=1))


def _longest_of_all(longest: FloatArray) -> float:
    """Return how many repetitions of all readings at once are too many; ``longest`` of each gauge."""
    rate = float((1.0 / longest).sum())
    return max(SHORTEST_HELD, ceil(-log(_FALSE_ALARM) / rate)) if rate > 0.0 else inf
