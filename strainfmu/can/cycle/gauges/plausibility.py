"""Plausibility of each gauge of a cycle by its values alone: no value, range, jump, stuck, exactly zero."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.can.cycle.gauges.freeze_watch import FreezeWatch
from strainfmu.can.cycle.gauges.noise import GaugeNoise, like_gauges
from strainfmu.can.cycle.gauges.verdicts import FROZEN, JUMPS, OUT_OF_RANGE, ZERO
from strainfmu.can.settings import BridgeSettings
from strainfmu.estimator.numerics.quantisation import longest_repetition

ROUND_OFF = 1e-15
"""Maximum |strain| [m/m] that the round-off of scale and offset leaves of exactly zero."""

_PACE = 3.0
"""Maximum plausible fall to exactly zero, in changes of one cycle."""

_FADING = 0.9
"""Factor per cycle on the largest recent change, which the last one may be far below by chance."""

RARE = 1e-9
"""Maximum probability per gauge and cycle with which a healthy one repeats its reading, or zero, for too long."""

MIN_STUCK_CYCLES, MIN_ZERO_CYCLES = 25, 5
"""Smallest numbers of equal readings and of zeros that are too many, however large the noise."""

_LONGEST_COUNT = 1e6

_MARGIN = 1e-9
"""Relative margin for the round-off of the limits of a layout's strains."""

_RECENT = 8
"""Quiet cycles whose changes are brought into the pace together."""

_LONGEST_QUIET = 100
"""Quiet cycles after which the times of change are brought up to date."""


class GaugeChecks:
    """Checks n_d gauges over successive cycles.

    ``periods`` (n_d,) [s] are those of gauges that come more slowly than cycles; None if none does.
    A bad gauge is used again after ``heal_cycles`` good values in a row. A gauge whose frame is missing keeps its
    state.
    """

    def __init__(
        self,
        n_gauges: int,
        cycle_time: float,
        settings: BridgeSettings,
        noise: GaugeNoise | None = None,
        *,
        periods: FloatArray | None = None,
    ) -> None:
        self._settings = settings
        self._cycle_time = cycle_time
        self._periods = np.full(n_gauges, cycle_time) if periods is None else periods
        self._cycles_apart = self._periods / cycle_time
        # Gauges that come in every cycle, where others come more slowly.
        is_fast = self._cycles_apart < 1.5
        self._fast = np.flatnonzero(is_fast & ~is_fast.all())
        # Limits of every gauge: a number is made an array of in every call, which takes as long as the comparison.
        self._largest = np.full(n_gauges, settings.sensor_range)
        self._largest_change = np.full(n_gauges, settings.rate_limit)
        self._round_off = np.full(n_gauges, ROUND_OFF)
        self._zero_jump = np.full(n_gauges, settings.zero_jump)
        self._nothing = np.zeros(n_gauges, dtype=np.int64)
        self._one = np.ones(n_gauges, dtype=np.int64)
        # What no raw number of the layout can be need not be looked for.
        noise = noise or like_gauges(n_gauges)
        self._never_beyond = noise.largest < (1.0 - _MARGIN) * settings.sensor_range
        self._only_raw_zero = noise.smallest > (1.0 + _MARGIN) * ROUND_OFF
        self._begin_gauges(n_gauges)
        self._begin_cycles(n_gauges)
        self.faults: dict[str, BoolArray] = {}
        """Gauges (n_d,) that failed each check of the last cycle, by its words."""
        self._watch = self.new_watch(noise)
        self._counted_on: FloatArray | None = None
        self._count_on(self._watch.noise_ratio)
        self.has_frozen = False
        """Gauges of the last cycle repeat readings, or scatter too little, together."""
        self.all_zero = False
        """All gauges of the last cycle read exactly zero, which none of them does under load."""

    def _begin_gauges(self, n_gauges: int) -> None:
        """Begin with gauges of which none has been heard."""
        self._last_raw = np.zeros(n_gauges, dtype=np.int64)
        self._last_strain = np.full(n_gauges, np.nan)
        self._last_good = np.full(n_gauges, np.nan)
        self._good_time = np.zeros(n_gauges)
        self._pace = np.zeros(n_gauges)
        self._changed = np.full(n_gauges, np.inf)
        # When each gauge was heard last, and for how long it had not been heard before its last change, both in s.
        self._heard = np.full(n_gauges, np.nan)
        self._unheard = np.zeros(n_gauges)
        self._repeats = np.zeros(n_gauges, dtype=np.int64)
        self._zeros = np.zeros(n_gauges, dtype=np.int64)
        self._good = np.full(n_gauges, self._settings.heal_cycles, dtype=np.int64)
        self._seen = np.zeros(n_gauges, dtype=bool)

    def _begin_cycles(self, n_gauges: int) -> None:
        """Begin with no cycle, and none quiet."""
        # Changes of the quiet cycles that the pace does not hold yet [m/m], and their lengths [cycles].
        self._recent = np.zeros((_RECENT, n_gauges))
        self._changes, self._lengths = list(self._recent), list[float]()
        # Times of the quiet cycles that the times of change do not hold yet.
        self._times: list[float] = []
        self._flags, self._zero = np.empty(n_gauges, dtype=bool), np.empty(n_gauges, dtype=bool)
        self.every_gauge = np.ones(n_gauges, dtype=bool)
        """(n_d,) True."""
        self.every_gauge.setflags(write=False)
        # Every gauge was good in the last cycle, at the time given, and is not on its way to be left out.
        self._is_quiet, self._has_zeros, self._last_time = False, False, 0.0
        # No gauge has been zero for more cycles in a row than this.
        self._most_zeros = 0
        # No gauge has repeated its reading more often in a row than this.
        self._most_repeats = 0
        self._changed_at = np.nan
        # Frames of this cycle's gauges were lost just before.
        self._had_pause = False

    def new_watch(self, noise: GaugeNoise) -> FreezeWatch:
        """Return the watch for gauges that are frozen together."""
        return FreezeWatch(noise)

    def update(
        self,
        strain: FloatArray,
        raw: IntArray,
        present: BoolArray,
        refused: BoolArray,
        now: float,
        is_clean: bool = False,
    ) -> BoolArray:
        """Return (n_d,) which gauges of a cycle are valid; the array is not to be written to.

        Parameters
        ----------
        strain : (n_d,) strains [m/m], arbitrary where not present.
        raw : (n_d,) raw numbers of the strains.
        present : (n_d,) gauges whose frame has arrived.
        refused : (n_d,) gauges that report "no value", or are outside their signal's limits.
        now : arrival of the cycle [s].
        is_clean : all gauges are present and none is refused. False if that is not known.
        """
        if is_clean and self._is_quiet and self._stays_quiet(strain, raw, now):
            frozen = self._frozen_together(strain, None)
            return self.every_gauge if frozen is None else self._left_out(frozen)
        return self._checked(strain, raw, present=present, refused=refused, now=now)

    def _stays_quiet(self, strain: FloatArray, raw: IntArray, now: float) -> bool:
        """Take in a cycle in which nothing can be found, after one in which nothing was found.

        What it asks for is enough for every check below to pass, and costs a fifth of them. If it is not met,
        nothing is changed, False is returned and the checks decide.
        """
        difference = strain - self._last_strain
        change = np.absolute(difference, self._changes[len(self._lengths)])
        # Looked for in its bytes, which takes a quarter of the time of all() of so few; False of NaN.
        flags = self._flags
        np.less_equal(change, self._largest_change, flags)
        if 0 in flags.tobytes():
            return False
        if not self._never_beyond and 0 in (np.abs(strain) <= self._largest).tobytes():
            return False
        zero, zeros = self._zero, None
        np.equal(raw, self._nothing, zero)
        if not self._only_raw_zero:
            zero |= np.abs(strain) <= self._round_off
        if 1 in zero.tobytes():
            if 0 not in zero.tobytes():
                return False
            zeros = (self._zeros + self._one) * zero
            # A change within this has not fallen to zero, whatever the gauge's pace.
            fell = change > self._zero_jump
            if 1 in fell.tobytes() and 1 in (fell & zero).tobytes():
                return False
            if not self._none_is_zero(zeros):
                return False
        if not self._none_is_stuck():
            return False
        if zeros is not None:
            self._zeros, self._has_zeros = zeros, True
        elif self._has_zeros:
            self._zeros, self._has_zeros, self._most_zeros = np.zeros_like(self._zeros), False, 0
        differs, repeats = flags, self._repeats
        np.not_equal(raw, self._last_raw, differs)
        if 1 in differs.tobytes():
            self._changed_at = now
        np.add(repeats, self._one, repeats)
        np.putmask(repeats, differs, self._nothing)
        self._had_pause = now - self._last_time > 1.5 * self._cycle_time
        self._times.append(now)
        if len(self._times) == _LONGEST_QUIET:
            self._date_changes()
        cycles = (now - self._last_time) / self._cycle_time
        self._lengths.append(cycles if cycles > 1.0 else 1.0)
        if len(self._lengths) == _RECENT:
            self._add_changes()
        self._difference, self.all_zero = difference, False
        self._last_raw, self._last_strain, self._last_good = raw, strain, strain
        self._last_time = now
        return True

    def _add_changes(self) -> None:
        """Bring the pace up to the last quiet cycle."""
        n = len(self._lengths)
        if n == 0:
            return
        recent = self._recent[:n]
        weights = [_FADING ** (n - 1 - index) / length for index, length in enumerate(self._lengths)]
        np.multiply(recent, np.array(weights)[:, None], out=recent)
        self._pace = np.maximum(np.maximum.reduce(recent, axis=0), _FADING**n * self._pace)
        self._lengths.clear()

    def _date_changes(self) -> None:
        """Bring the times of change, and of the last good value, up to the last quiet cycle."""
        n = len(self._times)
        if n == 0:
            return
        recent = self._repeats < n
        which = n - 1 - self._repeats[recent]
        times = np.array(self._times)
        self._changed[recent] = times[which]
        # All gauges were heard in the cycle before.
        self._unheard[recent] = self._lost(np.diff(times, prepend=self._heard[0]), self._cycle_time)[which]
        self._good_time.fill(self._times[-1])
        self._heard.fill(self._times[-1])
        self._times.clear()

    def _none_is_zero(self, zeros: IntArray) -> bool:
        """Return whether no gauge has been zero for too long; ``zeros`` (n_d,) in a row, this cycle's included."""
        self._most_zeros += 1
        if self._most_zeros >= self._least_zeros:
            self._most_zeros = int(zeros.max())
        return self._most_zeros < self._least_zeros or bool((zeros < self._zero_cycles).all())

    def _none_is_stuck(self) -> bool:
        """Return whether no gauge can be stuck, even if none has changed in this cycle."""
        self._most_repeats += 1
        if self._most_repeats >= self._least_repeats:
            self._most_repeats = int(self._repeats.max()) + 1
        return self._most_repeats < self._least_repeats

    def _frozen_together(self, strain: FloatArray, present: BoolArray | None) -> BoolArray | None:
        """Return which gauges of this cycle are frozen together, None if none is; ``present`` None for all."""
        frozen = self._watch.update(strain, self._difference, self._repeats, present)
        if self._watch.noise_ratio is not self._counted_on:
            self._count_on(self._watch.noise_ratio)
        self.has_frozen = frozen is not None and self._settings.stuck_cycles != 0
        return frozen if self.has_frozen else None

    def _left_out(self, frozen: BoolArray) -> BoolArray:
        """Return the valid gauges of a cycle in which nothing else than ``frozen`` was found."""
        self.faults = {FROZEN: frozen}
        self._good[frozen] = 0
        self._is_quiet = False
        return ~frozen

    def _count_on(self, noise_ratio: FloatArray) -> None:
        """Derive how many equal readings and zeros are too many from the noise [quantisation steps]."""
        self._counted_on, stated, n = noise_ratio, self._settings, len(noise_ratio)
        ratios, which = np.unique(noise_ratio, return_inverse=True)
        longest = [min(longest_repetition(ratio, RARE), _LONGEST_COUNT) for ratio in ratios.tolist()]
        by_noise = np.ceil(longest)[which]
        stuck = np.maximum(by_noise, MIN_STUCK_CYCLES)
        if stated.stuck_cycles is not None:
            stuck = np.full(n, stated.stuck_cycles or np.inf)
        self._stuck_cycles, self._least_repeats = stuck, float(stuck.min())
        # At least 1: none is reached where there is no zero. Integers, as the counts are that they limit.
        self._zero_cycles = np.maximum(by_noise, MIN_ZERO_CYCLES).astype(np.int64)
        if stated.zero_cycles is not None:
            self._zero_cycles = np.full(n, stated.zero_cycles, dtype=np.int64)
        self._least_zeros = int(self._zero_cycles.min())

    def _checked(
        self, strain: FloatArray, raw: IntArray, present: BoolArray, refused: BoolArray, now: float
    ) -> BoolArray:
        """Apply every check to a cycle; parameters and result as of :meth:`update`."""
        self._date_changes()
        self._add_changes()
        finite = np.isfinite(strain)
        self._difference = strain - self._last_strain
        bad = refused | ~finite
        stuck = self._stuck(raw, present, now)
        frozen = self._frozen_together(strain, present)
        self.faults = {
            OUT_OF_RANGE: self._out_of_range(strain),
            JUMPS: self._jumping(self._difference),
            FROZEN: stuck if frozen is None else stuck | frozen,
            ZERO: self._dropped_to_zero(strain, raw, present),
        }
        for failed in self.faults.values():
            bad |= failed
        good = present & ~bad
        self._good += good
        self._good[present & bad] = 0
        self._last_strain = np.where(present & finite, strain, self._last_strain)
        self._keep_pace(strain, good, now)
        valid = good & (self._good >= self._settings.heal_cycles)
        self._is_quiet, self._most_zeros = bool(valid.all()), int(self._zeros.max())
        self._has_zeros = self._most_zeros > 0
        self._last_time, self._most_repeats = now, int(self._repeats.max())
        return valid

    def _out_of_range(self, strain: FloatArray) -> BoolArray:
        """Find gauges beyond the range of a sensor."""
        return ~(np.abs(strain) <= self._settings.sensor_range)

    def _jumping(self, difference: FloatArray) -> BoolArray:
        """Find gauges that changed too much since their last value."""
        return np.abs(difference) > self._settings.rate_limit  # false of NaN

    def _keep_pace(self, strain: FloatArray, good: BoolArray, now: float) -> None:
        """Keep good strains and their rates of change [m/m per cycle]."""
        cycles = np.maximum((now - self._good_time) / self._cycle_time, 1.0)
        pace = np.maximum(np.abs(strain - self._last_good) / cycles, _FADING * self._pace)
        # The first good strain has no pace. New arrays, as the old ones may be those of a result.
        self._pace = np.where(good & np.isfinite(pace), pace, self._pace)
        self._last_good = np.where(good, strain, self._last_good)
        self._good_time[good] = now

    def frozen(self, present: BoolArray, now: float) -> tuple[float, float]:
        """Return for how long [s] none of the ``present`` gauges has changed, and for how much longer that may be.

        A value that repeats itself may have begun in any of the lost frames before it came for the first
        time: that counts. The second number is the same of a value that has come once.
        """
        if (not self._fast.size and self._changed_at == now and not self._had_pause) or not present.any():
            return 0.0, 0.0
        self._date_changes()
        # By the clock, which lost cycles do not shorten, or by the number of cycles, which those held back do not.
        since = np.maximum(now - self._changed, self._repeats * self._periods)
        repeated = since + np.where(self._repeats > 0, self._unheard, 0.0)
        known = float(repeated[present].min())
        here = self._fast[present[self._fast]]
        run = int(self._repeats[here].min()) if here.size else 0
        if run and not self._watch.may_be_chance(here, run):
            # A slow gauge that has just come is not newer than fast ones that have not changed for cycles.
            known = max(known, float(repeated[here].min()))
        return known, max(float((since + self._unheard)[present].min()) - known, 0.0)

    def refuse_zeros(self, present: BoolArray) -> BoolArray:
        """Return (n_d,) that no gauge of the last cycle is valid, whose ``present`` ones read exactly zero."""
        self.faults = {ZERO: present}
        self._good[present] = 0
        self._is_quiet = False
        return np.zeros_like(present)

    @staticmethod
    def _lost(pause: FloatArray, period: FloatArray | float) -> FloatArray:
        """Return the time [s] of whole periods that are missing in times between frames; 0 where NaN."""
        return np.fmax(np.rint(pause / period) - 1.0, 0.0) * period

    def _stuck(self, raw: IntArray, present: BoolArray, now: float) -> BoolArray:
        """Find gauges that have repeated their reading too often."""
        same = present & self._seen & (raw == self._last_raw)
        changed = present & ~same
        if changed.any():
            self._changed_at = now
        self._changed[changed] = now
        lost = self._lost(now - self._heard, self._periods)
        self._unheard[changed] = lost[changed]
        self._had_pause = bool(lost[present].any())
        self._heard[present] = now
        self._repeats += same
        self._repeats[changed] = 0
        self._last_raw = np.where(present, raw, self._last_raw)
        self._seen |= present
        # Readings count, not the time: in a pause a healthy gauge gives none that could differ.
        return same & (self._repeats >= self._stuck_cycles)

    def _dropped_to_zero(self, strain: FloatArray, raw: IntArray, present: BoolArray) -> BoolArray:
        """Find gauges at exactly zero, which amplifiers send on an error (HBK QuantumX: default for integers).

        With an offset, raw zero and strain zero differ; both count.
        """
        zero = present & ((raw == 0) | (np.abs(strain) <= ROUND_OFF))
        self._zeros += zero
        self._zeros[present & ~zero] = 0
        self.all_zero = bool(present.any() and (zero == present).all())
        if not zero.any():
            return np.zeros_like(present)
        # A strain that passes through zero may well meet it: only a fall faster than its own pace counts at once.
        usual = self._settings.zero_jump + _PACE * self._pace * self._cycles_apart
        fell = np.abs(strain - self._last_good) > usual
        return zero & (fell | (self._zeros >= self._zero_cycles))
