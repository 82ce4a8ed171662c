"""The judgement of closed cycles: decoded, checked gauge by gauge, dated, stepped through the estimator."""

from __future__ import annotations

from math import inf, isnan, nan
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.can.cycle.estimate.result import CycleResult, no_numbers, result_without_fields
from strainfmu.can.cycle.estimate.step import EstimatorStep
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.assembler import Arrival, Cycle
from strainfmu.can.cycle.frames.decoder import STATUS_DEGRADED
from strainfmu.can.cycle.frames.held_strains import WholeCycle
from strainfmu.can.cycle.gauges.plausibility import ROUND_OFF
from strainfmu.can.cycle.gauges.verdicts import GaugeVerdicts
from strainfmu.can.cycle.parts import CycleParts
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.compiled import ARRAY, INTEGER, NUMBER, Record, address, function, pointer
from strainfmu.can.wire.cycle_plan import DecodedCycle
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE
from strainfmu.estimator.signal_names import STRAIN, VALID

_REFUSED = (
    None,
    FrameClass.UNVERIFIED,
    FrameClass.REPEATED,
    FrameClass.WRONG_SEQUENCE,
    FrameClass.NOT_TRUSTED,
    FrameClass.TOO_OLD,
)
"""Class of all frames of a cycle that is not used, in the order of strainbus.h."""

_UNUSABLE = Cause.CLOCK_JUMP | Cause.OLD | Cause.FROZEN | Cause.REPEATS
"""Causes by time with which strains are not used."""

_CAUSES, _WHY, _N_VALID, _LOST, _NAMED, _SAMPLE_TIME, _COUNTER, _STATUS, _CHECKED, _N_FOUND = range(10)
"""Places of what a judgement found, of strainbus.h."""

_MEASURED = (None, FrameClass.NOT_TRUSTED, FrameClass.TOO_OLD)
"""Why a cycle may be refused whose numbers are correct, so that they show the period."""

_TO_LEARN, _TO_SEE_ZERO = 1, 2
"""Results of strainbus.h."""

# Members of an Enum by name: through its class each use takes as long as a call.
_USED, _NOTHING = FrameClass.USED, Cause.NONE


class JudgeRecord(Record):
    """The parts that a cycle passes in compiled code, what is known of the flow, and the result."""

    position = 16
    _fields_ = (
        ("assembler", ARRAY),
        ("slot", ARRAY),
        ("n_strain", INTEGER),
        *((name, ARRAY) for name in ("is_held", "decoder", "cycle", "checks", "seen", "repeats")),
        *((name, ARRAY) for name in ("clock", "proof")),
        *((name, ARRAY) for name in ("strain_time", "value")),
        *((name, INTEGER) for name in ("n_values", "pressure", "is_fixed")),
        *((name, NUMBER) for name in ("period", "max_age", "max_uncertainty", "hidden_age")),
        *((name, INTEGER) for name in ("n_late", "longest_late", "worst_status", "unusable")),
        ("passed", ARRAY),
        *((name, INTEGER) for name in ("has_passed", "may_be_held_back")),
        *((name, NUMBER) for name in ("passed_time", "changed_age", "changed_doubt")),
        *((name, INTEGER) for name in ("trailer_status", "has_frozen")),
        *((name, ARRAY) for name in ("nothing", "plausible", "trusted", VALID, STRAIN, "known", "age", "found")),
    )


class CycleJudge:
    """Judges one cycle after the other, in the order in which they are closed.

    Parameters
    ----------
    layout : the frames of the input.
    step : of the same layout.
    parts : of the same layout; the reception learns which frames are missing.
    """

    def __init__(
        self, layout: InputLayout, step: EstimatorStep, settings: BridgeSettings, parts: CycleParts
    ) -> None:
        self._layout, self._step, self._settings = layout, step, settings
        self._reception, self._flow = parts.reception, parts.flow
        self._trailer = parts.reception.trailer
        self._clock, self._pace = parts.clock, parts.pace
        self.period = parts.sender_period
        """The period of the sender, measured."""
        self._proof, self._strain_time, self._repeats = parts.proof, parts.strain_time, parts.repeats
        self._decoder, self._gauges = parts.decoder, parts.gauges
        n = layout.n_gauges
        # The cycle that is judged, and held frames that are looked at beside it.
        self._decoded, self._beside = parts.decoder.new_cycle(), parts.decoder.new_cycle()
        self._passed = parts.decoder.new_cycle()
        self._no_gauge, self._every_gauge = np.zeros(n, dtype=bool), np.ones(n, dtype=bool)
        self._no_gauge.setflags(write=False)
        self._every_gauge.setflags(write=False)
        self._held, self._taring = parts.held, parts.taring
        self._gauges_of = [np.array(frame.gauges, dtype=np.intp) for frame in layout.strain_frames]
        self._is_timed = [frame.sample_time is not None for frame in layout.frames]
        self._plausible, self._trusted = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        self._valid, self._strain = np.zeros(n, dtype=bool), np.zeros(n)
        found, ages, now = np.zeros(_N_FOUND, dtype=np.int64), np.zeros(2), np.zeros(1)
        self._found: Any = found.data
        self._ages: Any = ages.data
        self._now: Any = now.data
        self.record = self._new_record(parts, found, ages)
        self._at, self._at_now = pointer(self.record), pointer(now)
        self._now_kept = now
        self._judge_cycle, self._learned, self._go_on, self._verify, self._decode, self._pass_over = (
            function(f"sb_judge_{name}", JudgeRecord)
            for name in ("cycle", "learned", "go_on", "verify", "decode", "pass_over")
        )
        self.has_published = False
        """Coefficients have been published since the start."""

    def _new_record(self, parts: CycleParts, found: IntArray, ages: FloatArray) -> JudgeRecord:
        layout, settings, flow = self._layout, self._settings, parts.flow
        slots, n_strain = parts.reception.slots, len(layout.strain_frames)
        is_held = np.zeros(len(slots), dtype=bool)
        is_held[list(layout.held_slots)] = True
        return JudgeRecord(
            assembler=parts.assembler.record,
            slot=np.array([address(slot) for slot in slots], dtype=np.uint64),
            n_strain=n_strain,
            is_held=is_held,
            decoder=parts.decoder.plan.record,
            cycle=self._decoded.record,
            checks=parts.gauges.record,
            seen=parts.seen.words,
            repeats=None if parts.repeats is None else parts.repeats.record,
            clock=None if parts.clock is None else parts.clock.record,
            proof=None if parts.proof is None else parts.proof.record,
            strain_time=parts.strain_time.record,
            value=flow.addresses,
            n_values=len(flow.addresses),
            pressure=-1 if flow.pressure is None else flow.pressure,
            is_fixed=flow.is_fixed,
            period=layout.cycle_time,
            max_age=settings.max_age * layout.cycle_time,
            max_uncertainty=inf if settings.max_uncertainty is None else settings.max_uncertainty,
            hidden_age=settings.hidden_age,
            n_late=0,
            longest_late=settings.recovery_cycles,
            worst_status=STATUS_DEGRADED,
            unusable=int(_UNUSABLE),
            passed=self._passed.record,
            has_passed=0,
            may_be_held_back=0,
            passed_time=0.0,
            changed_age=nan,
            changed_doubt=nan,
            trailer_status=0,
            has_frozen=0,
            nothing=np.zeros(sum(frame.layout.length for frame in layout.frames), dtype=np.uint8),
            plausible=self._plausible,
            trusted=self._trusted,
            valid=self._valid,
            strain=self._strain,
            known=flow.known,
            age=ages,
            found=found,
        )

    def forget_sender(self) -> None:
        """Start again with a sender that may have been restarted; its clock shows whether it was."""
        self._reception.forget()
        if self._held is not None:
            self._held.forget()

    def confirm_sender(self) -> None:
        """Take the sender for proven, and its present delay for the smallest: somebody has checked both."""
        self._flow.confirm()
        if self._clock is not None:
            self._clock.accept()
            self._clock.anchor()
        if self._proof is not None:
            self._proof.confirm()
        if self._repeats is not None:
            self._repeats.forget()

    def pass_over(self, cycle: Cycle) -> FrameClass | None:
        """Check and remember a closed cycle that is not judged; return the class if it is refused."""
        why = _REFUSED[self._pass_over(self._at, cycle.address)]
        self.period.forget()
        self._hear_trailer(cycle)
        return why

    def _hear_trailer(self, cycle: Cycle) -> None:
        """Look for a second sender in the check of the cycle's trailer, if there was one."""
        if self._found[_CHECKED] and self._trailer is not None:
            self._reception.hear(self._trailer, cycle.time_of(self._trailer))

    @property
    def drift_ppm(self) -> float:
        """How much slower than ours the sender's clock runs [ppm]; NaN if not known."""
        return float("nan") if self._clock is None else self._clock.drift_ppm

    def take_flow(self, arrival: Arrival) -> FrameClass:
        """Hold the flow or navigation of a frame; return the frame's class."""
        if not self._reception.is_trusted(arrival.slot):
            return FrameClass.NOT_TRUSTED
        frame = self._layout.frames[arrival.slot]
        usable = self._flow.take(frame, arrival)
        return _USED if usable else FrameClass.NOT_USABLE

    def take_held(self, arrival: Arrival) -> FrameClass:
        """Hold a frame of strains that comes more slowly than cycles; return its class."""
        assert self._held is not None
        self._held.take(arrival)
        if not self._reception.is_trusted(arrival.slot):
            return FrameClass.NOT_TRUSTED
        own = self._decoder.decode({arrival.slot: arrival.frame.data}, arrival.status, self._beside)
        usable = own.present & ~own.refused & np.isfinite(own.strain)
        return FrameClass.USED if usable.any() else FrameClass.NOT_USABLE

    def remember(self, frame: Frame) -> None:
        """Remember the strains of a frame with a correct CRC that was refused by its counter or time."""
        slot = self._reception.protected_strains.get(frame.key)
        if self._repeats is not None and slot is not None:
            self._repeats.remember(self._gauges, self._decoder.decode({slot: frame.data}, 0, self._beside))

    def take_command(self, arrival: Arrival) -> FrameClass:
        """Take in a command of the sender; return its frame's class. One of another time than now is none."""
        if not self._reception.is_trusted(arrival.slot):
            return FrameClass.NOT_TRUSTED
        frame, now = self._layout.frames[arrival.slot], self._strain_time.at(arrival.frame.time)
        is_usable = arrival.status <= STATUS_DEGRADED and frame.request is not None
        if self._taring is None or isnan(now) or arrival.sample_time is None or not is_usable:
            return FrameClass.NOT_USABLE
        clock = frame.layout.signals[frame.sample_time or 0]
        whole = frame.tick * (1 << clock.length)
        apart = (arrival.sample_time * frame.tick - now + 0.5 * whole) % whole - 0.5 * whole
        if abs(apart) > self._settings.max_age * self._layout.cycle_time:
            return FrameClass.TOO_OLD
        self._taring.ask(int(arrival.plan.raw(arrival.frame.data)[frame.request or 0]))
        return FrameClass.USED

    def keep_pace(self, cycle: Cycle) -> None:
        """Note the arrival of a closed cycle, before it is judged or skipped; a sample time shows more."""
        if self._clock is None:
            self.record.may_be_held_back = self._pace.take(cycle.first_time)

    def judge(self, cycle: Cycle, now: float, causes: Cause) -> tuple[CycleResult, FrameClass | list[FrameClass]]:
        """Step the estimator with what is valid of a closed cycle.

        Parameters
        ----------
        now : time at which it was closed [s].
        causes : noted since the last result.

        Returns
        -------
        The result, and the class of each of the cycle's frames in their order, or of all of them.
        """
        self._now[0] = now
        whole = None if self._held is None else self._held.complete(cycle)
        if whole is None:
            stopped = self._judge_cycle(self._at, cycle.address, self._at_now)
            if stopped:
                self._resume(stopped, cycle, now)
        else:
            self._judge_held(cycle, whole, now)
        found = self._found
        if found[_CHECKED]:
            self._hear_trailer(cycle)
        if self._reception.has_second_sender(now):
            causes |= Cause.SECOND_SENDER
        if found[_CAUSES]:
            causes |= Cause(found[_CAUSES])
        refused = _REFUSED[found[_WHY]]
        if self._has_wrong_period(cycle, refused):
            causes |= Cause.PERIOD
        classes: FrameClass | list[FrameClass] = _USED
        valid, verdicts = self._every_gauge, None
        if found[_N_VALID] != len(valid):
            valid = self._valid.copy()
            classes = [self._class_of(slot, refused, valid) for slot in cycle.slots]
            verdicts = GaugeVerdicts(
                present=self._decoded.present.copy(),
                trusted=self._trusted.copy(),
                refused=self._decoded.refused.copy(),
                plausible=self._plausible.copy(),
                faults=self._gauges.faults,
                cycle="" if refused is None else refused.value,
            )
        answer = self._answer(cycle, now, causes=causes, valid=valid, verdicts=verdicts)
        if whole is not None:
            answer.held = whole.held
            answer.age += whole.held
        if self._taring is not None and self._taring.is_active:
            answer.causes |= self._taring.take(answer, self._flow.stated_pressure(now))
        return answer, classes

    def _has_wrong_period(self, cycle: Cycle, refused: FrameClass | None) -> bool:
        """Measure the sender's period with a cycle; return whether it is not the stated one."""
        period, found = self.period, self._found
        if self.record.may_be_held_back:  # a gateway releases cycles at a pace of its own
            period.forget()
        elif refused in _MEASURED:
            return period.take(cycle.first_time, found[_SAMPLE_TIME], found[_COUNTER])
        return period.is_wrong

    def _resume(self, stopped: int, cycle: Cycle, now: float) -> None:
        """Go on with a cycle where compiled code has stopped."""
        if stopped == _TO_LEARN:
            self._gauges.learn()
            stopped = self._learned(self._at, cycle.address, self._at_now)
        if stopped == _TO_SEE_ZERO:
            if self._is_dead(self._decoded, now):
                self._plausible[:] = self._gauges.refuse_zeros(self._decoded.present)
            self._go_on(self._at, cycle.address, self._at_now)

    def _judge_held(self, cycle: Cycle, whole: WholeCycle, now: float) -> None:
        """Judge a cycle with held frames, whose gauges are checked once, when they have come."""
        self._verify(self._at, cycle.address)
        self._decode(self._at, cycle.address)
        decoded = self._decoded
        self._plausible[:] = self._plausible_of(decoded, cycle, whole)
        if self._gauges.all_zero and self._is_dead(decoded, now):
            self._plausible[:] = self._gauges.refuse_zeros(decoded.present)
        self._gauges.frozen(decoded, cycle.first_time)
        self.record.has_frozen = self._gauges.has_frozen
        self._go_on(self._at, cycle.address, self._at_now)

    def _plausible_of(self, decoded: DecodedCycle, cycle: Cycle, whole: WholeCycle) -> BoolArray:
        """Return (n_d,) which gauges of a cycle are plausible; held ones are checked once, when they have come."""
        assert self._held is not None
        present, now = decoded.present, cycle.first_time
        checked = self._gauges.update(
            np.where(whole.fresh, decoded.strain, np.nan),
            decoded.raw,
            present=present & whole.fresh,
            refused=decoded.refused,
            now=now,
        )
        return self._held.verdicts(checked, whole.fresh) & present

    def _is_dead(self, decoded: DecodedCycle, now: float) -> bool:
        """Return whether all gauges read exactly zero, those that are held included, although there is a load."""
        is_zero = (decoded.raw == 0) | (np.abs(decoded.strain) <= ROUND_OFF)
        return bool(is_zero[decoded.present].all()) and self._flow.stated_pressure(now) > 0.0

    def silence(self, time: float, quality: Quality, causes: Cause) -> CycleResult:
        """Return the result at ``time`` [s] of a cycle in which nothing came."""
        if self._reception.has_second_sender(time):
            causes |= Cause.SECOND_SENDER
        strain = np.full(self._layout.n_gauges, np.nan)
        return CycleResult(time=time, quality=quality, causes=causes, valid=self._no_gauge, strain=strain)

    def _class_of(self, slot: int, refused: FrameClass | None, valid: BoolArray) -> FrameClass:
        """Return the class of one frame of a judged cycle."""
        if refused is not None:
            return refused
        if not self._reception.is_trusted(slot):
            return FrameClass.NOT_TRUSTED
        used = valid if slot == self._trailer else valid[self._gauges_of[slot]]
        return FrameClass.USED if used.any() else FrameClass.NOT_USABLE

    def _answer(
        self, cycle: Cycle, now: float, *, causes: Cause, valid: BoolArray, verdicts: GaugeVerdicts | None
    ) -> CycleResult:
        """Return the result of a judged cycle."""
        found = self._found
        flow, strain = self._flow.state(found[_LOST] != 0), self._strain.copy()
        causes = causes | flow.lost if flow.lost else causes
        step = None
        if found[_N_VALID]:
            step, quality, causes = self._step(strain, valid, flow, now, causes)
        elif causes & (Cause.OLD | Cause.FROZEN | Cause.REPEATS):
            quality = Quality.STALE
        else:
            quality = Quality.INVALID if self.has_published else Quality.NO_DATA
        published = step is not None and quality.has_coefficients
        self.has_published = self.has_published or published
        if step is not None and causes and causes & Cause.UNPROVEN_RESTART:
            # Until the strains are proven, q_inf of their sender is not used: there may be no coefficients.
            quality = Quality.UNCONFIRMED
        named = found[_NAMED]
        result = result_without_fields()
        result.time, result.arrival, result.quality, result.causes = now, cycle.last_time, quality, causes
        result.valid, result.strain, result.verdicts = valid, strain, verdicts
        result.dynamic_pressure = flow.dynamic_pressure
        result.mach_number, result.altitude = flow.mach_number, flow.altitude
        result.other_inputs = flow.other_inputs.copy()  # the state is used again
        result.age, result.age_uncertainty = self._ages
        result.held, result.gap = 0.0, nan
        result.sample_time = found[_SAMPLE_TIME] if self._is_timed[named] else None
        result.counter = found[_COUNTER] if found[_COUNTER] >= 0 else None
        if step is None:
            result.chi_square, result.health, result.other_outputs = np.nan, None, {}
        else:
            result.chi_square, result.health, result.other_outputs = (
                step.chi_square,
                step.health,
                step.other_outputs,
            )
        result.envelope_score = result.other_outputs.get(ENVELOPE_SCORE, np.nan)
        if step is not None and published:
            result.coefficients, result.coefficients_std = step.coefficients, step.coefficients_std
        else:
            result.coefficients, result.coefficients_std = no_numbers(), no_numbers()
        return result
