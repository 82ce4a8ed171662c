"""Which gauges of a cycle can be believed, by their values alone: no value, range, jump, stuck, exactly zero."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.can.settings import BridgeSettings

_ROUND_OFF = 1e-15
"""Largest |strain| [m/m] that scale and offset may leave of exactly zero."""

_PACE = 3.0
"""Changes of one cycle that a strain may fall to exactly zero by."""


class GaugeChecks:
    """Looks at n_d gauges over successive cycles.

    A gauge found bad is used again after ``heal_cycles`` good values in a row. A gauge whose frame is
    missing keeps what it was.
    """

    def __init__(self, n_gauges: int, cycle_time: float, settings: BridgeSettings) -> None:
        self._settings = settings
        self._longest_unchanged = (settings.stuck_cycles - 0.5) * cycle_time if settings.stuck_cycles else np.inf
        self._last_raw = np.zeros(n_gauges, dtype=np.int64)
        self._last_strain = np.full(n_gauges, np.nan)
        self._cycle_time = cycle_time
        self._last_good = np.full(n_gauges, np.nan)
        self._good_time = np.zeros(n_gauges)
        self._pace = np.zeros(n_gauges)
        self._changed = np.full(n_gauges, np.inf)
        self._repeats = np.zeros(n_gauges)
        self._zeros = np.zeros(n_gauges, dtype=np.int64)
        self._good = np.full(n_gauges, settings.heal_cycles, dtype=np.int64)
        self._seen = np.zeros(n_gauges, dtype=bool)

    def update(
        self, strain: FloatArray, raw: IntArray, present: BoolArray, refused: BoolArray, now: float
    ) -> BoolArray:
        """Return (n_d,) which gauges of a cycle are valid.

        Parameters
        ----------
        strain : (n_d,) strains [m/m], anything where not present.
        raw : (n_d,) raw numbers they were decoded from.
        present : (n_d,) gauges whose frame is there.
        refused : (n_d,) gauges that say themselves that they have no value, or are outside their signal's limits.
        now : when the cycle came [s].
        """
        finite = np.isfinite(strain)
        bad = refused | ~finite
        bad |= self._out_of_range(strain)
        bad |= self._jumping(strain)
        bad |= self._stuck(raw, present, now)
        bad |= self._dropped_to_zero(strain, raw, present)
        good = present & ~bad
        self._good += good
        self._good[present & bad] = 0
        np.copyto(self._last_strain, strain, where=present & finite)
        self._keep_pace(strain, good, now)
        return good & (self._good >= self._settings.heal_cycles)

    def _out_of_range(self, strain: FloatArray) -> BoolArray:
        """Find gauges beyond what a sensor can measure."""
        return ~(np.abs(strain) <= self._settings.sensor_range)

    def _jumping(self, strain: FloatArray) -> BoolArray:
        """Find gauges that changed too much since the last cycle."""
        return np.abs(strain - self._last_strain) > self._settings.rate_limit  # false against NaN

    def _keep_pace(self, strain: FloatArray, good: BoolArray, now: float) -> None:
        """Remember good strains, and how fast they change [m/m per cycle]."""
        cycles = np.maximum((now - self._good_time) / self._cycle_time, 1.0)
        pace = np.abs(strain - self._last_good) / cycles
        np.copyto(self._pace, pace, where=good & np.isfinite(pace))  # the first good strain has none
        np.copyto(self._last_good, strain, where=good)
        self._good_time[good] = now

    def frozen(self, present: BoolArray, now: float) -> float:
        """Return for how long not one of the gauges that are ``present`` has changed by ``now`` [s]."""
        return float(self._unchanged(now)[present].min()) if present.any() else 0.0

    def _unchanged(self, now: float) -> FloatArray:
        """Return (n_d,) for how long each gauge has had one value [s].

        By time, so that lost cycles do not make it younger; and by number, so that cycles held back do not either.
        """
        return np.maximum(now - self._changed, self._repeats * self._cycle_time)

    def _stuck(self, raw: IntArray, present: BoolArray, now: float) -> BoolArray:
        """Find gauges that have had one value for too long."""
        same = present & self._seen & (raw == self._last_raw)
        changed = present & ~same
        self._changed[changed] = now
        self._repeats += same
        self._repeats[changed] = 0.0
        np.copyto(self._last_raw, raw, where=present)
        self._seen |= present
        return same & (self._unchanged(now) >= self._longest_unchanged)

    def _dropped_to_zero(self, strain: FloatArray, raw: IntArray, present: BoolArray) -> BoolArray:
        """Find gauges at exactly zero, which amplifiers send on an error (HBK QuantumX: default for integers).

        With an offset that is another number than the strain zero; both are taken for it.
        """
        zero = present & ((raw == 0) | (np.abs(strain) <= _ROUND_OFF))
        self._zeros += zero
        self._zeros[present & ~zero] = 0
        if not (self._settings.zero_cycles and zero.any()):
            return np.zeros_like(present)
        # A strain that moves through zero may well meet it: only a fall out of its own pace is one at once.
        usual = self._settings.zero_jump + _PACE * self._pace
        fell = np.abs(strain - self._last_good) > usual
        return zero & (fell | (self._zeros >= self._settings.zero_cycles))
