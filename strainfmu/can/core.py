"""The bridge without threads and sockets: frames and times in, results out, every frame accounted for.

All that it does follows from the frames, their times of reception and the times it is advanced to; so a recording
gives the same results as the live run.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from strainfmu.can.acceptance import Acceptance
from strainfmu.can.bus_state import BusState, state_after
from strainfmu.can.cycle_assembler import Arrival, Cycle, CycleAssembler, Limits, Verdict
from strainfmu.can.decoded_cycle import DecodedCycle, StrainDecoder
from strainfmu.can.dynamic_pressure import HeldPressure
from strainfmu.can.frame import Frame
from strainfmu.can.frame_account import FrameAccount, FrameClass
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.guards import ALL_GUARDS, Guards
from strainfmu.can.plausibility import BoolArray, GaugeChecks
from strainfmu.can.quality import Cause, Quality
from strainfmu.can.reception import Reception, TrailerVerdict
from strainfmu.can.result import CycleResult, Step, StepRefused, quality_of_step
from strainfmu.can.sample_clock import SampleClock
from strainfmu.can.settings import BridgeSettings
from strainfmu.errors import InputError

_CATCH_UP = 10
"""Status results at most in one go after the bridge itself stood still."""

_KEPT_SKIPS = 10_000

_READABLE = (None, FrameClass.NOT_TRUSTED)
"""What a trailer may say of strains that are read."""

_LONGEST_STEP = 100
"""Cycles that one step of the FMU spans at most."""

_REFUSALS, _REFUSALS_PER_CYCLE = 20.0, 2.0
"""Results without coefficients at once, and for long: a babbling input must not make the bridge babble."""


class BridgeCore:
    """One layout of input frames in front of one estimator.

    Parameters
    ----------
    layout : the frames of the input.
    step : the estimator.
    settings : limits and times.
    start : local monotonic clock [s] at the start.
    own_keys : keys of the frames that the bridge sends.
    dynamic_pressure : q_inf of the whole run [Pa], or None to take it from its frame.
    guards : ALL_GUARDS, except where a test shows what a guard is for.

    Raises
    ------
    InputError
        The layout has no frame of q_inf and none is given, or own identifiers are among those of the input.
    """

    def __init__(
        self,
        layout: InputLayout,
        step: Step,
        settings: BridgeSettings,
        start: float,
        own_keys: Iterable[int] = (),
        dynamic_pressure: float | None = None,
        guards: Guards = ALL_GUARDS,
    ) -> None:
        own_keys = frozenset(own_keys)
        _check_input(layout, own_keys, dynamic_pressure)
        self.layout, self.settings, self.guards = layout, settings, guards
        self.account = FrameAccount()
        self.bus_state = BusState.ERROR_ACTIVE
        # When status results were passed over, the only thing that depends on when :meth:`advance` is called: a
        # replay needs to know. Pairs of when the first was due and of the time advanced to [s].
        self.skips: list[tuple[float, float]] = []
        self._step = step
        self._acceptance = Acceptance(layout, own_keys, settings, guards)
        self._reception = Reception(layout, settings, guards)
        self._assembler = CycleAssembler(_limits(layout, settings, guards))
        self._clock = _clock(layout, settings)
        self._decoder = StrainDecoder(layout, guards)
        self._gauges = GaugeChecks(layout.n_gauges, layout.cycle_time, settings, guards)
        self._pressure = HeldPressure(layout.pressure_frame, dynamic_pressure, layout.cycle_time, settings, guards)
        self._held = np.full(layout.n_gauges, np.nan)
        self._noted = Cause.NONE
        self._believed = False
        self._last_cycle = start
        self._refusals, self._last_refill = _REFUSALS, start
        self._last_step: float | None = None
        self._next_status = start + settings.timeout * layout.cycle_time

    # --- frames and time in -----------------------------------------------------------------------------------

    def receive(self, frame: Frame) -> list[CycleResult]:
        """Take in one frame; return the results that are ready by then, in order."""
        results = self.advance(frame.time)
        self.account.received += 1
        refused = self._acceptance.refused(frame)
        if refused is None:
            return results + self._take(frame)
        if refused is FrameClass.UNKNOWN_IDENTIFIER:
            self.account.settle_unknown(frame.key, frame.time)
            return results
        self.account.settle(refused, frame.time)
        if refused is FrameClass.ERROR_FRAME:
            self.bus_state = state_after(self.bus_state, frame)
            if self.bus_state is not BusState.ERROR_ACTIVE:
                self.note(Cause.BUS)
        elif refused is FrameClass.SHED:
            self.note(Cause.OVERLOAD)
        return results

    def advance(self, now: float) -> list[CycleResult]:
        """Return the results that are due by ``now`` [s]: of cycles at their deadline, and of silence."""
        results = []
        while True:
            deadline = self._assembler.deadline
            if deadline is not None and deadline <= min(now, self._next_status):
                results += self._close(self._assembler.due(deadline), deadline)
            elif self._next_status <= now:
                results += self._be_silent(now)
            else:
                return results

    @property
    def next_event(self) -> float:
        """When :meth:`advance` has something to do at the latest [s]."""
        deadline = self._assembler.deadline
        return self._next_status if deadline is None else min(deadline, self._next_status)

    def note(self, cause: Cause) -> None:
        """Have ``cause`` in the next result: of what the core cannot see, such as a queue that ran over."""
        self._noted |= cause

    def restart(self, now: float) -> None:
        """Begin anew after the bus was reopened: nothing is believed before it has proven itself again."""
        self.finish(now)
        self._forget_sender()
        self._pressure.reset()
        self.bus_state = BusState.ERROR_ACTIVE
        self.note(Cause.BUS)

    def finish(self, now: float) -> None:
        """Settle the frames of an open cycle at the end."""
        for cycle in self._assembler.reset():
            for _ in cycle.arrivals:
                self._settle(FrameClass.UNFINISHED, now)

    @property
    def drift_ppm(self) -> float:
        """How much slower than ours the sender's clock runs [ppm]; NaN if not known."""
        return float("nan") if self._clock is None else self._clock.drift_ppm

    # --- one frame --------------------------------------------------------------------------------------------

    def _take(self, frame: Frame) -> list[CycleResult]:
        """Check a frame of the input and hand it to whom it concerns."""
        slot = self._reception.slot_of(frame)
        if slot is None:
            self.account.settle(FrameClass.NOT_USABLE, frame.time)
            return []
        arrival, refused = self._reception.check(self._reception.arrival(slot, frame))
        if refused is not None:
            self.account.settle(refused, frame.time)
            return []
        if slot < self._reception.n_strain or slot == self._reception.trailer:
            return self._offer(arrival)
        self._take_pressure(arrival)
        return []

    def _take_pressure(self, arrival: Arrival) -> None:
        """Hold the dynamic pressure of a frame."""
        time = arrival.frame.time
        if not self._reception.is_trusted(arrival.slot):
            self.account.settle(FrameClass.NOT_TRUSTED, time)
            return
        usable = self._pressure.take(arrival.raw, time)
        self.account.settle(FrameClass.USED if usable else FrameClass.NOT_USABLE, time)

    def _offer(self, arrival: Arrival) -> list[CycleResult]:
        """Put a frame into its cycle; return the results of the cycles that it ends."""
        verdict, closed = self._assembler.offer(arrival)
        time = arrival.frame.time
        if verdict is Verdict.RESTARTED:
            self._forget_sender()
            self._pressure.reset()
            self.note(Cause.CLOCK_JUMP)
        if verdict in (Verdict.LATE, Verdict.REPEATED):
            self.account.settle(FrameClass.LATE if verdict is Verdict.LATE else FrameClass.REPEATED, time)
        else:
            self.account.pending += 1
        return self._close(closed, time)

    def _forget_sender(self) -> None:
        """Begin anew with a sender that was restarted."""
        self._reception.forget()
        if self._clock is not None:
            self._clock.reset()

    # --- one cycle --------------------------------------------------------------------------------------------

    def _close(self, cycles: Iterable[Cycle], now: float) -> list[CycleResult]:
        """Turn closed cycles into results."""
        results = []
        for cycle in cycles:
            self._last_cycle = now
            self._next_status = now + self.settings.timeout * self.layout.cycle_time
            result = self._result_of(cycle, now)
            if result.quality.has_coefficients or self._may_refuse(now):
                results.append(result)
            else:
                self.note(result.causes)
        return results

    def _may_refuse(self, now: float) -> bool:
        """Take a token for a result without coefficients; false if there is none left."""
        cycles = max(now - self._last_refill, 0.0) / self.layout.cycle_time
        self._last_refill = now
        self._refusals = min(self._refusals + cycles * _REFUSALS_PER_CYCLE, _REFUSALS)
        if self._refusals < 1.0:
            return False
        self._refusals -= 1.0
        return True

    def _result_of(self, cycle: Cycle, now: float) -> CycleResult:
        """Judge a closed cycle, step the estimator with what is valid, and settle the frames."""
        reception, arrivals = self._reception, cycle.arrivals
        causes, self._noted = self._noted, Cause.NONE
        if reception.miss(arrivals):
            causes |= Cause.PARTIAL_CYCLE
        trailer = reception.check_trailer(arrivals)
        # Strains whose CRC fits are looked at even while they are not trusted yet.
        readable = trailer.refused in _READABLE
        strains = [a for a in arrivals.values() if a.slot < reception.n_strain and readable]
        decoded = self._decoder.decode(strains, trailer.status)
        believable = self._gauges.update(
            decoded.strain, decoded.raw, decoded.present, decoded.refused, cycle.first_time
        )
        age, of_time = self._age(cycle, now, decoded, trailer)
        trusted = reception.trusted_gauges(arrivals)
        causes |= trailer.cause | of_time
        if decoded.status and self.guards.sender_status:
            causes |= Cause.SENDER_STATUS
        if (decoded.present & ~trusted).any():
            causes |= Cause.NOT_TRUSTED
        if (decoded.present & ~believable).any():
            causes |= Cause.GAUGE_INVALID
        refused = trailer.refused or (FrameClass.TOO_OLD if of_time else None)
        valid = np.zeros_like(believable) if refused else believable & trusted
        self._settle_cycle(cycle, refused, valid)
        return self._answer(cycle, now, causes, valid, decoded, age)

    def _age(
        self, cycle: Cycle, now: float, decoded: DecodedCycle, trailer: TrailerVerdict
    ) -> tuple[float, Cause]:
        """Return the age of the strains at ``now`` [s], and the cause if they may not be used for it."""
        age, causes = now - cycle.first_time, Cause.NONE
        limit = self.settings.max_age * self.layout.cycle_time
        ticks = self._named(cycle).sample_time if trailer.refused in _READABLE else None
        if self._clock is not None and ticks is not None:
            reading = self._clock.read(cycle.first_time, ticks)
            age += reading.age
            if reading.jumped and self.guards.clock_jump:
                causes |= Cause.CLOCK_JUMP
            if reading.restarted and self.guards.clock_jump:
                self._reception.forget()
                # Its clock may be short enough for a restart to look like a delay.
                self._pressure.reset()
        if age > limit and self.guards.age:
            causes |= Cause.OLD
        if self.guards.frozen and self.settings.stuck_cycles:
            # Strains that the sender repeats are as old as when they were new.
            frozen = self._gauges.frozen(decoded.present, cycle.first_time)
            age += frozen
            if frozen > 0.0 and age > limit:
                causes |= Cause.FROZEN
        return age, causes

    def _named(self, cycle: Cycle) -> Arrival:
        """Return the frame whose sample time and counter name a cycle."""
        trailer = self._reception.trailer
        return cycle.first if trailer is None else cycle.arrivals.get(trailer, cycle.first)

    def _answer(
        self, cycle: Cycle, now: float, causes: Cause, valid: BoolArray, decoded: DecodedCycle, age: float
    ) -> CycleResult:
        """Return the result of a judged cycle."""
        pressure = self._pressure.value(now)
        if np.isnan(pressure):
            causes |= Cause.DYNAMIC_PRESSURE
        strain = np.where(valid, decoded.strain, np.nan)
        if not self.guards.completeness:
            strain = np.where(decoded.present, strain, self._held)
            valid, causes = valid | ~decoded.present, causes & ~Cause.PARTIAL_CYCLE
        named = self._named(cycle)
        result = CycleResult(
            now,
            Quality.INVALID,
            causes,
            valid,
            strain,
            pressure,
            age,
            named.sample_time,
            named.counter,
            arrival=max(arrival.frame.time for arrival in cycle.arrivals.values()),
        )
        if valid.any():
            self._held = strain
            return self._estimated(result)
        if causes & (Cause.OLD | Cause.FROZEN):
            return replace(result, quality=Quality.STALE)
        return result if self._believed else replace(result, quality=Quality.NO_DATA)

    def _estimated(self, result: CycleResult) -> CycleResult:
        """Step the estimator and put its outputs into ``result``."""
        try:
            step = self._step(result.strain, result.dynamic_pressure, self._step_size(result.time))
        except StepRefused:
            return replace(result, causes=result.causes | Cause.STEP_FAILED)
        quality, causes = quality_of_step(step, result.causes, self.layout.is_protected, self.guards.health)
        finite = np.isfinite(step.coefficients).all() and np.isfinite(step.coefficients_std).all()
        if quality.has_coefficients and not finite and self.guards.finite_output:
            quality, causes = Quality.INVALID, causes | Cause.STEP_FAILED
        if np.isnan(result.dynamic_pressure):
            quality = Quality.INVALID
        judged = replace(result, quality=quality, causes=causes, chi_square=step.chi_square, health=step.health)
        if not quality.has_coefficients:
            return judged
        self._believed = True
        return replace(judged, coefficients=step.coefficients, coefficients_std=step.coefficients_std)

    def _step_size(self, now: float) -> float:
        """Return the time since the last step [s], in whole cycles."""
        cycles = 1 if self._last_step is None else round((now - self._last_step) / self.layout.cycle_time)
        self._last_step = now
        return min(max(cycles, 1), _LONGEST_STEP) * self.layout.cycle_time

    def _settle_cycle(self, cycle: Cycle, refused: FrameClass | None, valid: BoolArray) -> None:
        """Put the frames of a closed cycle into their classes."""
        for arrival in cycle.arrivals.values():
            used = valid
            if arrival.slot != self._reception.trailer:
                used = valid[list(self.layout.strain_frames[arrival.slot].gauges)]
            kind = FrameClass.USED if used.any() else FrameClass.NOT_USABLE
            if refused is not None:
                kind = refused
            elif not self._reception.is_trusted(arrival.slot):
                kind = FrameClass.NOT_TRUSTED
            self._settle(kind, arrival.frame.time)

    def _settle(self, kind: FrameClass, time: float) -> None:
        """Put one frame of a cycle into its class."""
        self.account.pending -= 1
        self.account.settle(kind, time)

    # --- silence ----------------------------------------------------------------------------------------------

    def _be_silent(self, now: float) -> list[CycleResult]:
        """Return the status of a cycle in which nothing came."""
        time, period = self._next_status, self.layout.cycle_time
        # After the bridge itself stood still, the status of all that time is of no use to anyone.
        behind = int((now - time) / period) - _CATCH_UP
        if behind > 0 and len(self.skips) < _KEPT_SKIPS:
            self.skips.append((time, now))
        time += max(behind, 0) * period
        self._next_status = time + period
        if not self.guards.silence:
            return []
        self._reception.miss_cycle()
        silent = time - self._last_cycle
        quality = Quality.STALE if silent <= self.settings.invalid_after * period else Quality.INVALID
        causes, self._noted = self._noted | Cause.SILENT, Cause.NONE
        none = self._decoder.empty()
        return [
            CycleResult(time, quality if self._believed else Quality.NO_DATA, causes, none.present, none.strain)
        ]


def _check_input(layout: InputLayout, own_keys: frozenset[int], dynamic_pressure: float | None) -> None:
    """Refuse what cannot work."""
    if layout.pressure_frame is None and dynamic_pressure is None:
        raise InputError(f"{layout.name}: no frame holds the dynamic pressure; state it by --dynamic-pressure")
    if dynamic_pressure is not None and not 0.0 < dynamic_pressure < float("inf"):
        raise InputError(f"dynamic pressure: {dynamic_pressure:g} Pa found, a positive number wanted")
    common = own_keys & {frame.layout.key for frame in layout.frames}
    if common:
        raise InputError(
            f"identifier 0x{min(common) & 0x1FFFFFFF:X}: is both input and result; choose another base"
        )


def _limits(layout: InputLayout, settings: BridgeSettings, guards: Guards) -> Limits:
    """Return what a cycle of ``layout`` is."""
    n_strain = len(layout.strain_frames)
    n_slots = n_strain + (layout.trailer is not None)
    bits = None
    if layout.is_timed:
        first = layout.strain_frames[0]
        bits = first.layout.signals[first.sample_time or 0].length
    return Limits(
        n_slots,
        None if layout.trailer is None else n_strain,
        settings.deadline * layout.cycle_time,
        bits,
        settings.late_cycles * n_slots,
        guards.order,
    )


def _clock(layout: InputLayout, settings: BridgeSettings) -> SampleClock | None:
    """Return the clock that follows the sender's sample times, None if there are none."""
    frame = layout.strain_frames[0] if layout.is_timed else layout.trailer
    if frame is None or frame.sample_time is None:
        return None
    bits = frame.layout.signals[frame.sample_time].length
    tolerance = settings.jump_tolerance * layout.cycle_time
    return SampleClock(frame.tick, bits, settings.clock_drift, tolerance, settings.jump_confirmations)
