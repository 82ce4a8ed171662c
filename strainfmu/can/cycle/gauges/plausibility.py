"""Plausibility of each gauge of a cycle by its values alone: no value, range, jump, stuck, exactly zero."""

from __future__ import annotations

import ctypes

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.can.cycle.gauges.freeze_watch import FALSE_ALARM, FreezeWatch
from strainfmu.can.cycle.gauges.noise import GaugeNoise, like_gauges
from strainfmu.can.cycle.gauges.verdicts import FROZEN, JUMPS, OUT_OF_RANGE, ZERO
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.compiled import ARRAY, INTEGER, NUMBER, Record, function, pointer
from strainfmu.can.wire.cycle_plan import DecodedCycle
from strainfmu.estimator.numerics.quantisation import longest_repetition
from strainfmu.estimator.setting_inputs import OF_READINGS
from strainfmu.estimator.signal_names import VALID

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

_MEMORY, _FIRST_MEMORY = 1024.0, 16.0
"""Cycles over which the part is averaged in which no gauge changes, and as many at the start."""

_ALL_VALID, _HAS_FROZEN, _ALL_ZERO, _LEARNED = 1, 2, 4, 8
"""Flags of strainbus.h."""

_FAULTS = (OUT_OF_RANGE, JUMPS, FROZEN, ZERO)
"""In the order of strainbus.h."""


class _Checks(Record):
    position = 6
    _fields_ = (
        *((name, INTEGER) for name in ("n", "heal_cycles", "looks_for_frozen", "is_dated")),
        *((name, NUMBER) for name in ("cycle_time", OF_READINGS, "rate_limit", "zero_jump", "round_off")),
        *((name, NUMBER) for name in ("pace_factor", "fading")),
        *((name, ARRAY) for name in ("period", "cycles_apart", "stuck_cycles", "zero_cycles", "is_fast")),
        *((name, ARRAY) for name in ("difference", "last_strain", "last_good", "good_time", "pace", "changed")),
        *((name, ARRAY) for name in ("heard", "unheard", "last_raw", "repeats", "zeros", "good")),
        *((name, ARRAY) for name in ("seen", "stuck", "fault", VALID, "frozen_for")),
        ("may_be_chance", INTEGER),
        *((name, NUMBER) for name in ("rare", "unchanged", "memory", "memory_length")),
        ("last_run", INTEGER),
        ("watch", ARRAY),
    )


class GaugeChecks:
    """Checks n_d gauges over successive cycles, in compiled code.

    ``periods`` (n_d,) [s] are of gauges that come more slowly than cycles; None if none does.
    Cycles that are ``is_dated`` have a sample time.
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
        is_dated: bool = False,
    ) -> None:
        n = n_gauges
        self._settings = settings
        periods = np.full(n, cycle_time) if periods is None else periods
        # Gauges that come in every cycle, where others come more slowly.
        is_fast = periods / cycle_time < 1.5
        self._watch = self.new_watch(noise or like_gauges(n))
        self._stuck_cycles, self._zero_cycles = np.zeros(n), np.zeros(n, dtype=np.int64)
        self._good, self._valid = np.full(n, settings.heal_cycles, dtype=np.int64), np.zeros(n, dtype=bool)
        self._fault, self._frozen_for = np.zeros((len(_FAULTS), n), dtype=bool), np.zeros(3)
        self.record = _Checks(
            n=n,
            heal_cycles=settings.heal_cycles,
            looks_for_frozen=settings.stuck_cycles != 0,
            is_dated=is_dated,
            cycle_time=cycle_time,
            **self.limits(),
            round_off=ROUND_OFF,
            pace_factor=_PACE,
            fading=_FADING,
            period=periods,
            cycles_apart=periods / cycle_time,
            stuck_cycles=self._stuck_cycles,
            zero_cycles=self._zero_cycles,
            is_fast=is_fast & ~is_fast.all(),
            difference=np.zeros(n),
            last_strain=np.full(n, np.nan),
            last_good=np.full(n, np.nan),
            good_time=np.zeros(n),
            pace=np.zeros(n),
            changed=np.full(n, np.inf),
            # When each gauge was heard last, and for how long it had not been heard before its last change, in s.
            heard=np.full(n, np.nan),
            unheard=np.zeros(n),
            last_raw=np.zeros(n, dtype=np.int64),
            repeats=np.zeros(n, dtype=np.int64),
            zeros=np.zeros(n, dtype=np.int64),
            good=self._good,
            seen=np.zeros(n, dtype=bool),
            stuck=np.zeros(n, dtype=bool),
            fault=self._fault,
            valid=self._valid,
            frozen_for=self._frozen_for,
            may_be_chance=0,
            rare=FALSE_ALARM**2,
            unchanged=0.0,
            memory=_FIRST_MEMORY,
            memory_length=_MEMORY,
            last_run=0,
            watch=self._watch.record,
        )
        self._now = ctypes.c_double()
        self._at, self._at_now = pointer(self.record), pointer(self._now)
        self._begin, self._end = function("sb_checks_update", _Checks), function("sb_checks_end", _Checks)
        self._find_age = function("sb_checks_frozen", _Checks)
        self._ages = self._frozen_for.data
        self._own = DecodedCycle(n)
        self.every_gauge = np.ones(n, dtype=bool)
        """(n_d,) True."""
        self.every_gauge.setflags(write=False)
        self.has_frozen = False
        """Gauges of the last cycle repeat readings, or scatter too little, together."""
        self.all_zero = False
        """All gauges of the last cycle read exactly zero, which none of them does under load."""
        self._count_on(self._watch.noise_ratio)

    def limits(self) -> dict[str, float]:
        """Return the limits of strains and their changes [m/m], by the fields of the record."""
        stated = self._settings
        return {
            OF_READINGS: stated.sensor_range,
            "rate_limit": stated.rate_limit,
            "zero_jump": stated.zero_jump,
        }

    def new_watch(self, noise: GaugeNoise) -> FreezeWatch:
        """Return the watch for gauges that are frozen together."""
        return FreezeWatch(noise)

    def update(
        self, strain: FloatArray, raw: IntArray, present: BoolArray, refused: BoolArray, now: float
    ) -> BoolArray:
        """Return as :meth:`judge` does which gauges are valid of a cycle that is given by its arrays.

        Parameters
        ----------
        strain : (n_d,) strains [m/m], arbitrary where not present.
        raw : (n_d,) raw numbers of the strains.
        present : (n_d,) gauges whose frame has arrived.
        refused : (n_d,) gauges that report "no value", or are outside their signal's limits.
        now : arrival of the cycle [s].
        """
        own = self._own
        own.strain[:], own.raw[:], own.present[:], own.refused[:] = strain, raw, present, refused
        return self.judge(own, now)

    def judge(self, cycle: DecodedCycle, now: float) -> BoolArray:
        """Return (n_d,) which gauges are valid of a cycle that came at ``now`` [s]; not to be written to."""
        self._now.value = now
        return self._judged(self._begin(self._at, cycle.address, self._at_now), cycle)

    def _judged(self, flags: int, cycle: DecodedCycle) -> BoolArray:
        """Return (n_d,) which gauges are valid by what compiled code found."""
        if flags == _LEARNED:
            self.learn()
            flags = self._end(self._at, cycle.address, self._at_now)
        self.has_frozen, self.all_zero = flags & _HAS_FROZEN != 0, flags & _ALL_ZERO != 0
        return self.every_gauge if flags & _ALL_VALID else self._valid.copy()

    def learn(self) -> None:
        """Derive from the usual scatter what is too many repetitions; compiled code says when."""
        self._watch.learn()
        self._count_on(self._watch.noise_ratio)

    @property
    def noise_ratio(self) -> FloatArray:
        """(n_d,) noise in quantisation steps that is counted on, see :class:`FreezeWatch`."""
        return self._watch.noise_ratio

    @property
    def faults(self) -> dict[str, BoolArray]:
        """Gauges (n_d,) that failed each check of the last cycle, by its words."""
        return dict(zip(_FAULTS, self._fault.copy(), strict=True))

    def _count_on(self, noise_ratio: FloatArray) -> None:
        """Derive how many equal readings and zeros are too many from the noise [quantisation steps]."""
        stated = self._settings
        ratios, which = np.unique(noise_ratio, return_inverse=True)
        longest = [min(longest_repetition(ratio, RARE), _LONGEST_COUNT) for ratio in ratios.tolist()]
        by_noise = np.ceil(longest)[which]
        self._stuck_cycles[:] = np.maximum(by_noise, MIN_STUCK_CYCLES)
        if stated.stuck_cycles is not None:
            self._stuck_cycles[:] = stated.stuck_cycles or np.inf
        # At least 1: none is reached where there is no zero.
        self._zero_cycles[:] = np.maximum(by_noise, MIN_ZERO_CYCLES)
        if stated.zero_cycles is not None:
            self._zero_cycles[:] = stated.zero_cycles

    def frozen(self, cycle: DecodedCycle, now: float) -> tuple[float, float]:
        """Return for how long [s] no gauge of ``cycle`` has changed, and for how much longer that may be.

        A value that repeats itself may have begun in any of the lost frames before it came for the first
        time: that counts. The second number is the same of a value that has come once.
        """
        self._now.value = now
        self._find_age(self._at, cycle.address, self._at_now)
        return self._ages[0], self._ages[1]

    def refuse_zeros(self, present: BoolArray) -> BoolArray:
        """Return (n_d,) that no gauge of the last cycle is valid, whose ``present`` ones read exactly zero."""
        self._fault[:] = False
        self._fault[_FAULTS.index(ZERO)] = present
        self._good[present] = 0
        return np.zeros_like(present)
