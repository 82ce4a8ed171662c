"""Which gauges of a cycle can be believed, by their values alone: no value, range, jump, stuck, exactly zero."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from strainfmu.can.guards import ALL_GUARDS, Guards
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.signal_plan import FloatArray, IntArray

BoolArray = NDArray[np.bool_]

_NEVER = np.iinfo(np.int64).max
_PACE = 3.0
"""Changes of one cycle that a strain may fall to exactly zero by."""


class GaugeChecks:
    """Looks at n_d gauges over successive cycles.

    A gauge found bad is used again after ``heal_cycles`` good values in a row. A gauge whose frame is
    missing keeps what it was.
    """

    def __init__(self, n_gauges: int, settings: BridgeSettings, guards: Guards = ALL_GUARDS) -> None:
        self._settings, self._guards = settings, guards
        self._last_raw = np.zeros(n_gauges, dtype=np.int64)
        self._last_strain = np.full(n_gauges, np.nan)
        self._last_good = np.zeros(n_gauges)
        self._last_change = np.zeros(n_gauges)
        self._unchanged = np.zeros(n_gauges, dtype=np.int64)
        self._zeros = np.zeros(n_gauges, dtype=np.int64)
        self._good = np.full(n_gauges, settings.heal_cycles, dtype=np.int64)
        self._seen = np.zeros(n_gauges, dtype=bool)

    def update(self, strain: FloatArray, raw: IntArray, present: BoolArray, refused: BoolArray) -> BoolArray:
        """Return (n_d,) which gauges of a cycle are valid.

        Parameters
        ----------
        strain : (n_d,) strains [m/m], anything where not present.
        raw : (n_d,) raw numbers they were decoded from.
        present : (n_d,) gauges whose frame is there.
        refused : (n_d,) gauges that say themselves that they have no value, or are outside their signal's limits.
        """
        settings, guards = self._settings, self._guards
        bad = refused | ~np.isfinite(strain)
        if guards.range:
            bad |= ~(np.abs(strain) <= settings.sensor_range)
        if guards.rate:
            bad |= np.abs(strain - self._last_strain) > settings.rate_limit  # false against NaN
        bad |= self._stuck(raw, present)
        bad |= self._dropped_to_zero(raw, present)
        good = present & ~bad
        self._good = np.where(present, np.where(bad, 0, self._good + 1), self._good)
        valid = good & (self._good >= settings.heal_cycles)
        self._last_strain = np.where(present & np.isfinite(strain), strain, self._last_strain)
        self._last_change = np.where(good, np.abs(strain - self._last_good), self._last_change)
        self._last_good = np.where(good, strain, self._last_good)
        return valid

    def frozen_cycles(self, present: BoolArray) -> int:
        """Return for how many cycles not one of the gauges that are ``present`` has changed."""
        return int(self._unchanged[present].min()) if present.any() else 0

    def _stuck(self, raw: IntArray, present: BoolArray) -> BoolArray:
        """Count equal values in a row."""
        same = present & self._seen & (raw == self._last_raw)
        self._unchanged = np.where(present, np.where(same, self._unchanged + 1, 0), self._unchanged)
        self._last_raw = np.where(present, raw, self._last_raw)
        self._seen |= present
        limit = self._settings.stuck_cycles or _NEVER
        return (self._unchanged >= limit) & self._guards.stuck

    def _dropped_to_zero(self, raw: IntArray, present: BoolArray) -> BoolArray:
        """Find gauges at exactly zero, which amplifiers send on an error (HBK QuantumX: default for integers)."""
        zero = present & (raw == 0)
        self._zeros = np.where(present, np.where(zero, self._zeros + 1, 0), self._zeros)
        limit = self._settings.zero_cycles or _NEVER
        # A strain that moves through zero may well meet it: only a fall out of its own pace is one at once.
        usual = self._settings.zero_jump + _PACE * self._last_change
        fell = (np.abs(self._last_good) > usual) & bool(self._settings.zero_cycles)
        return zero & (fell | (self._zeros >= limit)) & self._guards.zero
