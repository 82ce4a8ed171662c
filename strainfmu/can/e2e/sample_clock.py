"""The sender's clock seen from ours: age of a sample and how well it is known, jumps and drift of the clock.

The delay of a frame is known only relative to the smallest delay so far: a constant transmission time is not part
of the age. A clock that runs slower than ours looks like a delay that grows. So the smallest delay is raised, but
no faster than an oscillator may drift and by no more than is allowed in all; what grows beyond that is age. A
delay that a fast clock hides cannot be seen at all, it is part of the uncertainty.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from strainfmu.can.wire.compiled import INTEGER, NUMBER, Record, function, pointer

_WINDOW = 1.0
"""Length of the windows [s]; the drift is fitted to the smallest delays of these."""

_WINDOWS = 60
"""``SB_MINIMA`` of strainbus.h."""

_JUMPED, _RESTARTED, _HIDES_DELAY, _RESUMED = 1, 2, 4, 8
"""Flags of strainbus.h."""

_STEADY = 0.5
"""Fraction of the jump tolerance by which the delay may shrink while a jump is confirmed."""

_ROUND_OFF = 1e-9
"""Difference of two times [s] that is none."""

_WANDER = 5e-6
"""Largest change of a rate that has been measured [s/s]: of an oscillator in a changing temperature."""

_STRAIGHT = 1e-3
"""Largest width of a band about a straight line [s] in which the smallest delays lie where they give the rate."""


@dataclass(frozen=True, kw_only=True)
class ClockLimits:
    """Limits of a sender's clock.

    Attributes
    ----------
    rate : known rate by which it runs slower than ours [s/s].
    tolerance : largest difference of its rate from that [s/s].
    hidden : largest sum of delays that is taken for drift [s].
    jump_tolerance : by how much a delay may be below the smallest one so far [s].
    confirmations : readings in a row, consistent with each other, that make a jump a restart.
    learn : time [s] over which the rate is measured; a delay that grows steadily for so long counts as rate.
        0: the rate stays the known one.
    period : nominal time of one step of the counter that comes with the sample times [s].
    modulus : number of values of that counter; 0: there is none.
    """

    rate: float = 0.0
    tolerance: float = 1e-4
    hidden: float = 0.01
    jump_tolerance: float
    confirmations: int = 3
    learn: float = 0.0
    period: float = 0.0
    modulus: int = 0


@dataclass(slots=True)  # not frozen: one is made for every frame with a sample time
class ClockReading:
    """What one sample time shows.

    Attributes
    ----------
    age : delay beyond the smallest one so far [s].
    jumped : the time does not continue those before: it went back, or forward by more than the delay can have
        shrunk. Data of the same frame are not to be used.
    restarted : enough readings have confirmed the jump; from the next reading on the new time counts.
    uncertainty : by how much the age may be larger [s].
    hides_delay : as much delay as is allowed has been taken for drift.
    resumed : the time continues the time of before a restart which was not accepted.
    """

    age: float
    jumped: bool = False
    restarted: bool = False
    uncertainty: float = 0.0
    hides_delay: bool = False
    resumed: bool = False


class SenderClock(Protocol):
    """A clock that dates samples; ``range`` is the time after which it wraps [s], ``record`` for compiled code."""

    range: float
    record: ClockRecord

    def read(self, local: float, ticks: int, counter: int = -1) -> ClockReading:
        """Take in a sample time that arrived at ``local`` on our clock [s]."""
        ...

    def reset(self) -> None:
        """Forget the sender."""
        ...

    def accept(self) -> None:
        """Take the time of the last restart for the sender's: the time of before does not come back."""
        ...

    def anchor(self) -> None:
        """Take the delay of the last reading for the smallest one: somebody has checked it."""
        ...

    def seconds(self, ticks: int) -> float:
        """Return a sample time [s]."""
        ...

    @property
    def drift_ppm(self) -> float:
        """How much slower than ours the sender's clock runs [ppm]; NaN if not known."""
        ...


class _Model(ctypes.Structure):
    _fields_ = (
        *((name, INTEGER) for name in ("is_set", "ticks", "readings")),
        *(
            (name, NUMBER)
            for name in ("source", "local", "floor", "lowest", "start", "fastest", "doubt", "either")
        ),
        ("begin", NUMBER),
        *((name, INTEGER) for name in ("counter", "is_new", "new_counter")),
        *((name, NUMBER) for name in ("least_age", "new_begin")),
    )


class _Minima(ctypes.Structure):
    _fields_ = (
        *((name, NUMBER) for name in ("length", "start", "at", "least")),
        ("n", INTEGER),
        ("minimum", NUMBER * (2 * _WINDOWS)),
    )


class _Count(ctypes.Structure):
    _fields_ = (
        ("modulus", INTEGER),
        ("period", NUMBER),
        *((name, INTEGER) for name in ("is_set", "last", "is_measured", "is_irregular")),
        *((name, NUMBER) for name in ("source", "local", "earliest", "latest")),
        *((name, INTEGER) for name in ("n", "n_odd", "steps", "regular_steps", "early_steps", "late_steps")),
        *((name, NUMBER) for name in ("begin", "regular", "kept", "doubt")),
    )


class ClockRecord(Record):
    """A clock for compiled code."""

    position = 3
    _fields_ = (
        *((name, INTEGER) for name in ("bits", "confirmations", "is_synchronised")),
        *((name, NUMBER) for name in ("tick", "range", "pace", "tolerance", "hidden", "jump_tolerance")),
        *((name, NUMBER) for name in ("steady", "round_off", "stated", "wander", "straight", "shift", "accuracy")),
        *((name, _Model) for name in ("known", "jumped", "before")),
        *((name, _Minima) for name in ("drift", "rate")),
        ("count", _Count),
        ("count_before", _Count),
        ("is_learned", INTEGER),
        ("age", NUMBER),
        ("uncertainty", NUMBER),
    )


def clock_record(tick: float, bits: int, **limits: float) -> ClockRecord:
    """Return the record of a clock that nothing is known of; ``limits`` are fields that are not 0."""
    record = ClockRecord.empty()
    record.tick, record.bits, record.range = tick, bits, tick * (1 << bits)
    for name, value in limits.items():
        setattr(record, name, value)
    return record


_without_fields = object.__new__
"""Makes a reading whose fields are all still to be set, in half the time of making one by them."""


class ClockReader:
    """Reads the sample times of one record."""

    def __init__(self, record: ClockRecord) -> None:
        self._record = record
        self._local, self._ticks, self._counter = NUMBER(), INTEGER(), INTEGER()
        self._at = pointer(record), pointer(self._local), pointer(self._ticks), pointer(self._counter)
        self._read = function("sb_clock_read", ClockRecord)

    def __call__(self, local: float, ticks: int, counter: int = -1) -> ClockReading:
        """Take in a sample time that arrived at ``local`` on our clock [s]; ``counter`` is -1 without."""
        self._local.value, self._ticks.value, self._counter.value = local, ticks, counter
        flags, record, reading = self._read(*self._at), self._record, _without_fields(ClockReading)
        reading.age, reading.uncertainty = record.age, record.uncertainty
        reading.jumped, reading.restarted = flags & _JUMPED != 0, flags & _RESTARTED != 0
        reading.hides_delay, reading.resumed = flags & _HIDES_DELAY != 0, flags & _RESUMED != 0
        return reading


class SampleClock:
    """Follows one sender's clock. A jump counts only after later readings have confirmed it.

    Parameters
    ----------
    tick : unit of the sample time [s].
    bits : length of the sample time, which wraps.
    limits : of the clock.
    """

    def __init__(self, tick: float, bits: int, limits: ClockLimits) -> None:
        self.record = record = clock_record(
            tick,
            bits,
            confirmations=limits.confirmations,
            pace=1.0 - limits.rate,
            stated=1.0 - limits.rate,
            wander=min(_WANDER, limits.tolerance),
            straight=_STRAIGHT,
            tolerance=limits.tolerance,
            hidden=limits.hidden,
            jump_tolerance=limits.jump_tolerance,
            steady=_STEADY,
            round_off=_ROUND_OFF,
        )
        record.drift.length, record.rate.length = _WINDOW, limits.learn / _WINDOWS
        record.count.modulus, record.count.period = limits.modulus, limits.period
        self.range = record.range
        """Time after which it wraps [s]."""
        self.read = ClockReader(record)
        self._begin = function("sb_clock_reset", ClockRecord)
        self.reset()

    def reset(self) -> None:
        """Forget the sender."""
        self._begin(pointer(self.record))

    def accept(self) -> None:
        """Take the time of the last restart for the sender's: the time of before does not come back."""
        self.record.before.is_set = 0

    def anchor(self) -> None:
        """Take the delay of the last reading for the smallest one: somebody has checked it."""
        known = self.record.known
        known.lowest = known.fastest = known.floor = known.local - known.source
        known.start, known.doubt, known.either = known.local, 0.0, 0.0
        self.record.count.is_set, self.record.count.doubt = 0, 0.0

    def seconds(self, ticks: int) -> float:
        """Return a sample time [s]."""
        return ticks * self.record.tick

    @property
    def drift_ppm(self) -> float:
        """How much slower than ours the sender's clock runs [ppm]; NaN before there are enough readings."""
        count = self.record.drift.n
        if count < 5:
            return float("nan")
        kept = np.frombuffer(self.record.drift.minimum).reshape(-1, 2)[:count]
        time, minimum = (kept - kept[0]).T
        time = time - time.mean()
        slope = (time @ minimum) / (time @ time)
        return float(1e6 * (slope + 1.0 - self.record.pace))
