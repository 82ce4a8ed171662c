"""What is checked of a recording while it is estimated: faults and level of its strains, gaps of the flow.

Strains that no gauge has measured are taken out of the blocks ahead of the estimate: rows that the recorder held,
rows of zeros, railed channels. The estimate cannot detect the first two: strains of another time fit the map as
well as new ones. A row is held if no gauge changes, to the last bit, for longer than noise and resolution allow. A
railed channel reads what no flow of the map gives any gauge. A gauge that repeats its own reading for as long,
while others change, stands still; it is named, and on demand taken out.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from math import ceil, erf, exp, inf, log, sqrt

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.signal_names import ZERO
from strainfmu.recorded.names import some_of
from strainfmu.recorded.samples import Samples
from strainfmu.recorded.selection import Selection, flown_pressure
from strainfmu.recorded.strain_level import TOO_HIGH, LevelCheck, raised_level

HELD = "held"
"""Fault of a whole row, as :data:`ZERO` is one, in the output; of single gauges it names these."""

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

_SLOW = 0.5
"""Part of the rows with a value of a quantity below which it is taken for a slower channel."""


LARGEST_RATIO = 4.0
"""Noise in steps above which more makes no difference: of steps so fine hardly a reading is repeated."""

_ROUND_OFF = 1e-9


def longest_repetition(ratio: float, probability: float) -> float:
    """Return how many equal readings in a row are less probable than ``probability``, at the worst strain.

    That is the middle of a quantisation step, as exactly zero is; infinite where the noise never leaves it.

    Parameters
    ----------
    ratio : standard deviation of the noise in quantisation steps.
    """
    inside = erf(0.5 / (ratio * sqrt(2.0)))
    return inf if inside >= 1.0 else log(probability) / log(inside)


def common_step(values: FloatArray) -> float:
    """Return the largest step of which all ``values`` (n,) are multiples; round-off of the largest if none is.

    It is their greatest common divisor by Euclid's algorithm: the resolution of what was written with few digits,
    or in counts of a converter.
    """
    sizes = [abs(value) for value in values.tolist()]
    smallest = _ROUND_OFF * max(sizes, default=0.0)
    step = 0.0
    for size in sizes:
        rest = step
        step = size
        while rest > smallest:
            step, rest = rest, abs(step - rest * round(step / rest))
        if 0.0 < step <= 2.0 * smallest:
            return smallest
    return max(step, smallest)


@dataclass
class FaultRows:
    """Rows with one fault: how many, the time of the first [s], and the largest |reading| [m/m]."""

    rows: int = 0
    begin: float = float("nan")
    largest: float = 0.0

    def add(self, time: FloatArray, has_fault: BoolArray, reading: FloatArray | None = None) -> None:
        """Count the rows (n,) that have the fault."""
        if not has_fault.any():
            return
        self.begin = self.begin if self.rows else float(time[np.argmax(has_fault)])
        self.rows += int(has_fault.sum())
        if reading is not None:
            self.largest = max(self.largest, float(np.abs(reading[has_fault]).max()))

    def take(self, later: FaultRows) -> None:
        """Add rows that come later."""
        self.begin = self.begin if self.rows else later.begin
        self.rows += later.rows
        self.largest = max(self.largest, later.largest)


class RunLengths:
    """Lengths of runs of repetitions in ``n`` columns, block by block."""

    def __init__(self, n: int) -> None:
        self.carried = np.zeros(n, dtype=np.int64)

    def take(self, same: BoolArray, following: BoolArray, shortest: FloatArray | float = 0.0) -> IntArray:
        """Return (k, n) how many repetitions there are in the run to which each row of a block belongs.

        Parameters
        ----------
        same : (k, n) whether the rows of the block repeat the row before.
        following : (m, n) the same of rows of the next block, as far as runs are followed into it.
        shortest : (n,) run that counts; where no run reaches half of it in the block, all lengths are 0.
        """
        k = len(same)
        if not same.any() or not np.any(np.count_nonzero(same, axis=0) + self.carried >= 0.5 * shortest):
            self.carried = np.where(same.all(axis=0), self.carried + k, np.argmin(same[::-1], axis=0))
            return np.broadcast_to(np.int64(0), same.shape)
        both = np.vstack([same, following])
        row = np.arange(len(both))[:, None]
        begin = np.maximum.accumulate(np.where(both, -1, row), axis=0)
        so_far = np.where(begin >= 0, row - begin, self.carried + row + 1)
        is_end = np.vstack([~both[1:], np.ones_like(both[:1])])
        end = np.minimum.accumulate(np.where(is_end, row, len(both))[::-1], axis=0)[::-1]
        self.carried = so_far[k - 1]
        return np.asarray(np.take_along_axis(so_far, end, axis=0)[:k])


@dataclass(eq=False)
class FaultCounts:
    """What is counted of the strains of a recording, or of a part of it.

    Attributes
    ----------
    rows : rows that were checked.
    missing : number of strains without a value, by gauge, of those that are not left out.
    railed, dead : gauges beyond what a flow gives, and gauges that repeat their reading, by name.
    held, zero : rows in which no gauge changes, and in which all read zero.
    known : rows with a value, by quantity of the flow.
    level, pressure : (n_d,) level of each gauge [m/m], and largest q_inf [Pa].
    """

    rows: int = 0
    missing: Counter[str] = field(default_factory=Counter)
    railed: dict[str, FaultRows] = field(default_factory=dict)
    dead: dict[str, FaultRows] = field(default_factory=dict)
    held: FaultRows = field(default_factory=FaultRows)
    zero: FaultRows = field(default_factory=FaultRows)
    known: Counter[str] = field(default_factory=Counter)
    level: FloatArray = field(default_factory=lambda: np.array(np.nan))
    pressure: float = float("nan")

    def take(self, later: FaultCounts) -> None:
        """Add the counts of rows that come later."""
        self.level, self.pressure = np.fmax(self.level, later.level), float(np.fmax(self.pressure, later.pressure))
        self.rows += later.rows
        self.missing.update(later.missing)
        self.known.update(later.known)
        self.held.take(later.held)
        self.zero.take(later.zero)
        for mine, others in ((self.railed, later.railed), (self.dead, later.dead)):
            for name, rows in others.items():
                mine.setdefault(name, FaultRows()).take(rows)


@dataclass(eq=False)
class DataChecks:
    """Checks the blocks of one file, and takes out what no gauge has measured.

    Attributes
    ----------
    selection : what is read of the file, by an estimator that states the strains it expects.
    zero : (n_d,) or one zero that it subtracts [m/m].
    accepts_level, accepts_held : whether strains of another level, and rows that do not change, are estimated.
    leaves_out_dead : whether readings of gauges that repeat themselves are taken out.
    counts : of the rows that count; those around them are checked and not counted.
    """

    selection: Selection
    zero: FloatArray | float = 0.0
    accepts_level: bool = False
    accepts_held: bool = False
    leaves_out_dead: bool = False
    counts: FaultCounts = field(default_factory=FaultCounts)

    def __post_init__(self) -> None:
        selection = self.selection
        assert selection.wanted.reference is not None, "an estimator states it"
        self._reference, self._names = selection.wanted.reference, selection.wanted.gauge_names
        self._largest_zero = float(np.max(np.abs(self.zero), initial=0.0))
        self._resolution, self._longest = inf, np.full(len(self._names), 1.0)
        self._of_gauges, self._of_rows = RunLengths(len(self._names)), RunLengths(1)
        self._same: BoolArray | None = None
        self._sizes: FloatArray = np.empty((0, 0))
        factor, pressure = selection.strain_factor, selection.pressure_name
        self._level = LevelCheck(selection.path, self._reference, factor, not self.accepts_level, pressure)

    def notes(self) -> list[str]:
        """Return what is to be said of the whole file.

        Raises
        ------
        InputError
            The level of the strains is far below the map's.
        """
        path, excluded, counts = self.selection.path, self.selection.excluded, self.counts
        repeats, zeros = counts.held, counts.zero
        ahead = [f"{path}: left out by --exclude: {', '.join(excluded)}"] if excluded else []
        ahead, notes = [*ahead, *self._level.notes(counts.level, counts.pressure)], list[str]()
        if repeats.rows:
            advice = "which are left out; --accept-held estimates them"
            notes.append(
                f"no gauge changes in {repeats.rows} rows, to the last bit, the first at {repeats.begin:g} s: the "
                f"recorder holds its last values, {'estimated all the same' if self.accepts_held else advice}"
            )
        if zeros.rows:
            notes.append(
                f"all gauges read exactly zero in {zeros.rows} rows, the first at {zeros.begin:g} s: left out"
            )
        railed, dead = (
            sorted(faults.items(), key=lambda item: -item[1].rows) for faults in (counts.railed, counts.dead)
        )
        notes += [
            f"'{name}' reads {1e6 * fault.largest:.6g} um/m, which no flow of the map gives, in {fault.rows} "
            f"rows, the first at {fault.begin:g} s: left out there; --exclude '{name}' leaves it out everywhere"
            for name, fault in railed[:_NAMED]
        ]
        if len(railed) > _NAMED:
            notes.append(f"{len(railed) - _NAMED} other gauges do so too: the column strain_faults names them")
        if dead:
            shown = "; ".join(
                f"'{name}' in {fault.rows}, from {fault.begin:g} s on" for name, fault in dead[:_NAMED]
            )
            more = f", and {len(dead) - _NAMED} other gauges" if len(dead) > _NAMED else ""
            advice = f"--exclude {','.join(name for name, _ in dead)}, or --exclude auto, leaves them out"
            notes.append(
                f"gauges that stand still while others change, of {counts.rows} rows: {shown}{more}: "
                f"{'left out there by --exclude auto' if self.leaves_out_dead else advice}"
            )
        slow = {name: known for name, known in counts.known.items() if 1 < known < _SLOW * counts.rows}
        if slow and self.selection.channel_map is None:
            shown = some_of([f"{name} ({known})" for name, known in slow.items()])
            notes.append(
                f"values in few of {counts.rows} rows: {shown}; the others have none. --channels channels.toml "
                "interpolates slower channels at the times of the strains"
            )
        return [*ahead, *(f"{path}: {note}" for note in notes)]

    def checked(self, block: Samples, following: Samples | None) -> Samples:
        """Return a block with the faults of its rows; strains with one are NaN. Blocks come in order.

        Raises
        ------
        InputError
            The level of the strains is far above the map's.
        """
        is_first, counts = self._same is None, self.counts if block.is_counted else FaultCounts()
        same = repeated(block.strain, np.full(len(self._names), inf)) if self._same is None else self._same
        same_next = same[:0] if following is None else repeated(following.strain, block.strain[-1])
        self._same, strain, known = same_next, block.strain, np.isfinite(block.strain)
        if not known.all():
            missing = zip(self._names, (len(known) - np.count_nonzero(known, axis=0)).tolist(), strict=True)
            counts.missing.update({name: k for name, k in missing if k and name not in self.selection.excluded})
        self._find_resolution(strain[:_SAMPLED][known[:_SAMPLED]])
        has_values, longest = known.any(axis=1), self._longest
        zero = has_values & _is_zero(strain) & ~(block.dynamic_pressure <= 0.0)
        of_rows, next_rows = np.asarray(same.all(axis=1)), np.asarray(same_next.all(axis=1))
        row_same = of_rows & has_values
        runs = self._of_rows.take(row_same[:, None], next_rows[:, None])[:, 0]
        if is_first:  # nothing shows that the first row that is read is new
            row_same[0] = True
        is_held = row_same & ~zero & (runs >= _longest_of_all(longest[known.any(axis=0)]))
        alone, following_alone = same & known & ~of_rows[:, None], same_next & ~next_rows[:, None]
        limit = np.maximum(SHORTEST_RAILED, -log(_RARE) * longest)
        flown, size = flown_pressure(block.flow), self._size(strain)
        bearable = self._bearable(flown)
        most = np.minimum(bearable, self._reference.sensor_range - self._largest_zero)
        is_bearable = not np.any(np.fmax.reduce(size, axis=1) > most)
        runs = self._of_gauges.take(alone, following_alone, limit if is_bearable else 0.0)
        stands_still, railed = runs >= limit, np.zeros_like(same)
        dead = railed
        if stands_still.any() or not is_bearable:
            is_sound = ~(zero | is_held)[:, None]
            railed = self._is_railed(strain, size, bearable, stands_still) & is_sound
            dead = stands_still & known & ~railed & is_sound
        counts.rows += len(block.time)
        marked = self._marked(block, counts, is_held=is_held, zero=zero, railed=railed, dead=dead)
        if counts is self.counts:
            size = size if marked.strain is strain else self._size(marked.strain)
            counts.level = raised_level(np.broadcast_to(counts.level, size.shape[1:]), size)
            with np.errstate(invalid="ignore"):
                counts.pressure = float(np.fmax(counts.pressure, np.fmax.reduce(flown)))
            self._level.refuse_high(counts.level, counts.pressure)
        for name, values in block.flow.items():
            counts.known[name] += int(np.isfinite(values).sum())
        return marked

    def _size(self, strain: FloatArray) -> FloatArray:
        """Return (n, n_d) sizes of strains without their zeros, in memory that the next call takes again."""
        if self._sizes.shape != strain.shape:
            self._sizes = np.empty_like(strain)
        return np.abs(strain - self.zero if self._largest_zero else strain, out=self._sizes)

    def _marked(
        self,
        block: Samples,
        counts: FaultCounts,
        *,
        is_held: BoolArray,
        zero: BoolArray,
        railed: BoolArray,
        dead: BoolArray,
    ) -> Samples:
        """Return ``block`` without strains of rows (n,) and of gauges (n, n_d) with a fault; count them."""
        time, strain = block.time, block.strain
        for kinds, faults in ((counts.railed, railed), (counts.dead, dead)):
            for gauge in np.flatnonzero(faults.any(axis=0)).tolist():
                rows = kinds.setdefault(self._names[gauge], FaultRows())
                rows.add(time, faults[:, gauge], strain[:, gauge])
        if self.leaves_out_dead:
            railed = railed | dead
        if not (is_held.any() or zero.any() or railed.any()):
            return replace(block, faults=("",) * len(time))
        counts.held.add(time, is_held)
        counts.zero.add(time, zero)
        texts = [HELD if h else ZERO if z else "" for h, z in zip(is_held.tolist(), zero.tolist(), strict=True)]
        for row in np.flatnonzero(railed.any(axis=1)).tolist():
            texts[row] = ";".join(self._names[gauge] for gauge in np.flatnonzero(railed[row]))
        taken = railed | (zero if self.accepts_held else zero | is_held)[:, None]
        return replace(block, strain=np.where(taken, np.nan, strain), faults=tuple(texts))

    def _find_resolution(self, strain: FloatArray) -> None:
        """Find the resolution of readings (n,), and how often each gauge repeats with a probability of 1/e.

        Of steps that are fine against the noise of every gauge, finer ones make no difference.
        """
        noise = self._reference.noise_std
        if self._resolution * LARGEST_RATIO <= noise.min():
            return
        step = min(self._resolution, common_step(strain))
        if step != self._resolution:
            self._resolution = step
            step = step if 0.0 < step < inf else 1.0
            ratio = np.where(noise > 0.0, np.minimum(noise / step, LARGEST_RATIO), _UNKNOWN_NOISE)
            self._longest = np.array([longest_repetition(number, exp(-1.0)) for number in ratio.tolist()])

    def _bearable(self, flown: FloatArray) -> FloatArray:
        """Return (n,) the largest |strain| of any flow of the map [m/m] at q_inf ``flown`` (n,) [Pa]."""
        reference = self._reference
        nominal = flown / reference.dynamic_pressure
        over = np.clip(np.where(np.isfinite(nominal), nominal, _LARGEST_OVER), 1.0, _LARGEST_OVER)
        return np.asarray((float(reference.strain_range.max()) or inf) * over)

    def _is_railed(
        self, strain: FloatArray, size: FloatArray, bearable: FloatArray, stands_still: BoolArray
    ) -> BoolArray:
        """Return (n, n_d) which readings are beyond what a gauge bears, or any flow of the map gives.

        The latter: far beyond ``bearable`` (n,) [m/m], or beyond it and without change. Where most gauges are
        beyond, another flow or unit it is, and their median takes the place of the map's strains.
        """
        level = size / bearable[:, None]
        has_values = np.asarray(np.isfinite(strain).any(axis=1))
        usual = np.nanmedian(np.where(has_values[:, None], level, 0.0), axis=1)
        level /= np.maximum(usual, 1.0)[:, None]
        is_beyond = (level > TOO_HIGH) | ((level > 1.0) & stands_still)
        return np.asarray(is_beyond | (np.abs(strain) > self._reference.sensor_range))


def repeated(strain: FloatArray, last: FloatArray) -> BoolArray:
    """Return (n, n_d) which of ``strain`` (n, n_d) repeat the row before, ``last`` (n_d,) before the first.

    They are equal to the last bit, or no values both.
    """
    same = np.empty_like(strain, dtype=bool)
    np.equal(strain[1:], strain[:-1], out=same[1:])
    np.equal(strain[0], last, out=same[0])
    without = np.isnan(strain)
    if without.any():
        same[1:] |= without[1:] & without[:-1]
        same[0] |= without[0] & np.isnan(last)
    return same


def _is_zero(strain: FloatArray) -> BoolArray:
    """Return (n,) whether all readings (n, n_d) of a row are 0 or none."""
    is_zero = ~(np.abs(strain[:, 0]) > 0.0)
    rows = np.flatnonzero(is_zero)
    is_zero[rows] = ~np.any(np.abs(strain[rows]) > 0.0, axis=1)
    return is_zero


def _longest_of_all(longest: FloatArray) -> float:
    """Return how many repetitions of all readings at once are too many; ``longest`` of each gauge."""
    rate = float((1.0 / longest).sum())
    return max(SHORTEST_HELD, ceil(-log(_FALSE_ALARM) / rate)) if rate > 0.0 else inf
