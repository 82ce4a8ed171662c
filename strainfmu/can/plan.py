"""The plan of an input for the compiled machine: its frames, signals and limits as flat tables."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from math import erf, nan, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray
from strainfmu.can.frame_layout import (
    DYNAMIC_PRESSURE,
    FLOAT,
    LARGEST_PARAMETER,
    ROLES,
    FlowSignal,
    InputFrame,
    InputLayout,
    is_parameter,
    is_parameter_std,
    is_reading,
    is_temperature,
)
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause
from strainfmu.can.signals import PLAN, SIGNAL, SLOT, int64, pointer, signal_table
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import SAMPLE_INPUTS
from strainfmu.recorded.checks import LARGEST_RATIO

_STRAIN, _HELD, _TRAILER, _STATE, _FLOW, _COMMAND = range(6)
"""Kinds of a frame, in the order of bus.h."""

_SENSIBLE = {sample_input.name: (sample_input.smallest, sample_input.largest) for sample_input in SAMPLE_INPUTS}
"""Smallest and largest value of a quantity that may be used, in SI units, whatever its signal allows."""

_SENSIBLE_TEMPERATURE = (1.0, 5e3)
"""The same of a temperature [K]."""

UNKNOWN_NOISE = 0.5
"""Noise in quantisation steps where neither the map nor an option states it."""

_USUAL_STRAIN = 1e-3
"""Strain [m/m] at which the resolution of a float is taken."""

_MANTISSA_BITS = {16: 10, 32: 23, 64: 52}

_IN_CYCLES = ("max_age", "deadline", "timeout", "invalid_after", "pressure_max_age")
_AS_STATED = ("sensor_range", "rate_limit", "zero_jump", "period_tolerance", "burst")
"""Limits of a plan that are settings, in cycles there or as they are."""


class Plan:
    """The tables of an input.

    Parameters
    ----------
    layout : the frames.
    settings : limits and times.
    dynamic_pressure : q_inf of the whole run [Pa], None to take it from its frame.
    noise_std : (n_d,) or one standard deviation of the gauges' noise [m/m], None where it is not known.
    is_answered : results go out, so that a sender can name what it has heard.
    counters : counter of the first result, and number of its values.

    Attributes
    ----------
    record : ``SbPlan``.
    tables : the arrays that it names.
    slots : first slot of each identifier, by key.
    quantities : of the flow, by their place in a result.
    bridge_alarm : time for which a second bridge is reported after its last frame [s].
    """

    def __init__(
        self,
        layout: InputLayout,
        settings: BridgeSettings,
        *,
        dynamic_pressure: float | None = None,
        noise_std: ArrayLike | None = None,
        is_answered: bool = True,
        counters: tuple[int, int] = (0, 256),
    ) -> None:
        # The state of the sender lies ahead of the strains, because a trailer covers both.
        frames = sorted(layout.frames, key=lambda frame: _kind(frame) != _STATE)
        self.frames = frames
        self.bridge_alarm = settings.alarm_cycles * layout.cycle_time
        self.quantities = tuple(signal.quantity for frame in frames for signal in frame.flow)
        self._places = {name: place for place, name in enumerate(self.quantities)}
        codes: list[int] = []
        tables = [signal_table(frame.layout, codes) for frame in frames]
        for frame, table in zip(frames, tables, strict=True):
            self._set_targets(frame, table, layout, settings)
        self._slots = np.zeros(len(frames), dtype=SLOT)
        rows: list[Any] = []
        for slot, frame, table in zip(self._slots, frames, tables, strict=True):
            # First what is measured in it, then the numbers about it.
            measured = [*frame.indices, *(source.index for source in frame.flow)]
            slot["first"], slot["n_signals"] = len(rows), len(measured)
            rows += [table[index] for index in measured]
            for role in ROLES:
                index = getattr(frame, role)
                slot[role] = -1 if index is None else len(rows)
                rows += [] if index is None else [table[index]]
                if role == "heard_delay" and index is not None:
                    rows[-1]["factor"] = 1e-3  # of a millisecond
            self._describe(slot, frame, layout, settings)
            if frame.layout.multiplexer is not None:
                signal, slot["value"] = frame.layout.multiplexer
                slot["selector"] = len(rows)
                rows.append(signal_table(replace(frame.layout, signals=(signal,)))[0])
        self._signals = np.array(rows, dtype=SIGNAL)
        self._codes = np.array([int64(code) for code in codes] or [0], dtype=np.int64)
        self._change = change_rates(layout, noise_std)
        self.slots = self._link(frames)
        # Each frame of an identifier may come once a cycle.
        number = Counter(frame.layout.key for frame in frames)
        self._slots["rate"] = [settings.rate * number[frame.layout.key] / layout.cycle_time for frame in frames]
        self.record = self._record(layout, settings, dynamic_pressure, is_answered)
        self.record["first_result"], self.record["n_counters"] = counters

    def _link(self, frames: Sequence[InputFrame]) -> dict[int, int]:
        """Chain the slots of an identifier; return the first of each."""
        first: dict[int, int] = {}
        last: dict[int, int] = {}
        self._slots["next"] = -1
        for slot, frame in enumerate(frames):
            key = frame.layout.key
            if key in last:
                self._slots[last[key]]["next"] = slot
            first.setdefault(key, slot)
            last[key] = slot
        return first

    def _set_targets(self, frame: InputFrame, table: Any, layout: InputLayout, settings: BridgeSettings) -> None:
        """Set what the signals of a frame are of, and the range of what may be used."""
        for index, gauge, factor in zip(frame.indices, frame.gauges, frame.to_strain, strict=True):
            table[index]["target"], table[index]["factor"] = gauge, factor
        for source in frame.flow:
            row = table[source.index]
            row["target"], row["factor"], row["added"] = self._places[source.quantity], source.to_si, source.offset
            row["smallest"], row["largest"] = sensible(source.quantity)
            row["max_age"] = flow_max_age(layout, frame, source, settings)
            row["lost"] = int(_lost_cause(source.quantity))

    def _describe(self, slot: Any, frame: InputFrame, layout: InputLayout, settings: BridgeSettings) -> None:
        """Write what is known of a frame."""
        frame_layout, protection = frame.layout, frame.layout.protection
        slot["length"], slot["is_fd"], slot["kind"] = frame_layout.length, frame_layout.is_fd, _kind(frame)
        slot["profile"] = 0 if protection is None else protection.profile
        slot["data_id"] = 0 if protection is None else protection.data_id
        slot["crc_end"] = -1 if protection is None or protection.end is None else protection.end
        slot["is_secured"], slot["selector"] = frame_layout.secured is not None, -1
        initial = None if frame.configuration is None else frame_layout.signals[frame.configuration].initial
        slot["expected"] = initial or 0
        slot["period"] = frame_layout.cycle_time or layout.cycle_time
        ages = [flow_max_age(layout, frame, source, settings) for source in frame.flow]
        slot["hold"] = max(ages) if ages else frame.hold or 0.0
        slot["tick"], slot["shares_clock"] = frame.tick, layout.shares_clock

    def _record(
        self, layout: InputLayout, settings: BridgeSettings, dynamic_pressure: float | None, is_answered: bool
    ) -> Any:
        """Return the whole plan."""
        kinds = [_kind(frame) for frame in self.frames]
        ends = np.cumsum([frame.layout.length for frame in self.frames])
        self._slots["data"] = ends - [frame.layout.length for frame in self.frames]
        covered = [slot for slot, kind in enumerate(kinds) if kind in (_STRAIN, _HELD)]
        dated = layout.first_of_cycle if layout.is_timed else layout.trailer or layout.first_of_cycle
        is_dated, period = dated.sample_time is not None, layout.cycle_time
        protection, stuck = dated.layout.protection, settings.stuck_cycles
        record = np.zeros(1, dtype=PLAN)
        pressure = self._places.get(DYNAMIC_PRESSURE, -1)
        values = {
            "cycle": period,
            **{name: getattr(settings, name) * period for name in _IN_CYCLES},
            **{name: getattr(settings, name) for name in _AS_STATED},
            "tolerance": settings.clock_tolerance,
            "alarm": settings.second_sender_cycles * period,
            "tick": dated.tick,
            "synchronised": -1.0 if settings.synchronised is None else settings.synchronised,
            "shift": settings.synchronised_shift,
            "fixed_pressure": nan if dynamic_pressure is None else dynamic_pressure,
            "n_slots": len(self.frames),
            "n_gauges": layout.n_gauges,
            "n_flow": len(self.quantities),
            "n_cycle": sum(kind in (_STRAIN, _TRAILER) for kind in kinds),
            "trailer": kinds.index(_TRAILER) if _TRAILER in kinds else -1,
            "state": kinds.index(_STATE) if _STATE in kinds else -1,
            "pressure": pressure,
            "n_data": int(ends[-1]),
            "covered": int(self._slots["data"][covered[0]]),
            "n_covered": sum(self.frames[slot].layout.length for slot in covered),
            "is_timed": layout.is_timed,
            "bits": dated.layout.signals[dated.sample_time or 0].length if is_dated else 1,
            "modulus": 0 if protection is None else protection.counter_modulus,
            "is_answered": is_answered,
            "accepts": settings.restart == "accept",
            "is_protected": layout.is_protected,
            "is_authentic": layout.is_authenticated,
            "heal": settings.heal_cycles,
            "late_limit": settings.late_cycles,
            "recovery": settings.recovery_cycles,
            "stuck": -1 if stuck is None else stuck,
        }
        for name, value in values.items():
            record[name] = value
        self.tables = {"slot": self._slots, "signal": self._signals, "code": self._codes, "change": self._change}
        for name, table in self.tables.items():
            record[name] = pointer(table).value
        return record


def _kind(frame: InputFrame) -> int:
    """Return the kind of a frame, in the numbers of bus.h."""
    if frame.indices:
        return _STRAIN if frame.hold is None else _HELD
    if frame.is_trailer:
        return _TRAILER
    if frame.session is not None:
        return _STATE
    return _COMMAND if frame.request is not None else _FLOW


def sensible(quantity: str) -> tuple[float, float]:
    """Return the smallest and largest value of a quantity of the flow that may be used [SI]."""
    if is_parameter(quantity) or is_reading(quantity):
        return -LARGEST_PARAMETER, LARGEST_PARAMETER
    if is_parameter_std(quantity):
        return 0.0, LARGEST_PARAMETER
    return _SENSIBLE.get(quantity, _SENSIBLE_TEMPERATURE)


def _lost_cause(quantity: str) -> Cause:
    """Return the cause that a quantity was known and is not any more; q_inf has one of its own."""
    if quantity == DYNAMIC_PRESSURE:
        return Cause.NONE
    if is_temperature(quantity):
        return Cause.TEMPERATURE
    return Cause.SENSOR if is_reading(quantity) else Cause.NAVIGATION


def flow_max_age(layout: InputLayout, frame: InputFrame, source: FlowSignal, settings: BridgeSettings) -> float:
    """Return for how long a quantity of the flow is held [s]; of a frame with a time-out of its own, for that."""
    if frame.timeout is not None:
        return frame.timeout
    cycles = settings.pressure_max_age if source.quantity == DYNAMIC_PRESSURE else settings.navigation_max_age
    cycles = settings.sensor_max_age if is_reading(source.quantity) else cycles
    return cycles * max(layout.cycle_time, frame.layout.cycle_time or 0.0)


def change_rates(layout: InputLayout, noise_std: ArrayLike | None) -> FloatArray:
    """Return (n_d,) the smallest probability with which noise changes the reading of a gauge at rest.

    At the middle of a quantisation step, where it is smallest, a reading is left with the probability of a
    change of more than half a step. ``noise_std`` as of :class:`Plan`.

    Raises
    ------
    InputError
        A standard deviation is not positive, or there are too few or too many.
    """
    n = layout.n_gauges
    step = quantisation_steps(layout)
    std = UNKNOWN_NOISE * step if noise_std is None else np.asarray(noise_std, dtype=float)
    if std.shape not in ((), (n,)) or not (np.isfinite(std) & (std > 0.0)).all():
        raise InputError(f"gauge noise: expected one or {n} positive numbers, got {str(noise_std)[:60]}")
    ratio = np.minimum(np.full(n, std) / step, LARGEST_RATIO)
    return np.array([1.0 - erf(0.5 / (value * sqrt(2.0))) for value in ratio.tolist()])


def quantisation_steps(layout: InputLayout) -> FloatArray:
    """Return (n_d,) the quantisation steps of the gauges [m/m]."""
    step = np.empty(layout.n_gauges)
    for item in layout.strain_frames:
        for index, gauge, factor in zip(item.indices, item.gauges, item.to_strain, strict=True):
            signal = item.layout.signals[index]
            is_float = signal.kind == FLOAT
            step[gauge] = abs(signal.scale) * factor
            if is_float:
                step[gauge] = _USUAL_STRAIN * 2.0 ** -_MANTISSA_BITS[signal.length]
    return step
