"""The judgement of closed cycles: decoded, checked gauge by gauge, dated, stepped through the estimator."""

from __future__ import annotations

from math import isnan

import numpy as np

from strainfmu.arrays import BoolArray
from strainfmu.can.cycle.estimate.result import CycleResult, no_numbers, result_without_fields
from strainfmu.can.cycle.estimate.step import EstimatorStep
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.assembler import Arrival, Cycle
from strainfmu.can.cycle.frames.decoder import STATUS_DEGRADED
from strainfmu.can.cycle.frames.held_strains import WholeCycle
from strainfmu.can.cycle.frames.reception import TrailerVerdict
from strainfmu.can.cycle.gauges.plausibility import ROUND_OFF
from strainfmu.can.cycle.gauges.verdicts import GaugeVerdicts
from strainfmu.can.cycle.parts import CycleParts
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.e2e.sample_clock import ClockReading, SenderClock
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.cycle_plan import DecodedCycle
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE

_READABLE = (None, FrameClass.NOT_TRUSTED)
"""Verdicts of a trailer with which strains are decoded."""

_UNUSABLE = Cause.CLOCK_JUMP | Cause.OLD | Cause.FROZEN
"""Causes by time with which strains are not used."""

# Members of an Enum by name: through its class each use takes as long as a call.
_USED, _NOTHING = FrameClass.USED, Cause.NONE


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
        self._period = layout.cycle_time
        self._max_age = settings.max_age * layout.cycle_time
        self._reception, self._flow = parts.reception, parts.flow
        self._trailer = parts.reception.trailer
        self._clock, self._pace = parts.clock, parts.pace
        self._seen, self._proof = parts.seen, parts.proof
        self._decoder, self._gauges = parts.decoder, parts.gauges
        # The cycle that is judged, and one that is looked at beside it.
        self._decoded, self._beside = parts.decoder.new_cycle(), parts.decoder.new_cycle()
        self._no_gauge = np.zeros(layout.n_gauges, dtype=bool)
        self._no_gauge.setflags(write=False)
        self._held, self._taring = parts.held, parts.taring
        self._may_be_held_back = False
        self._passed_over: Cycle | None = None
        self._gauges_of = [np.array(frame.gauges, dtype=np.intp) for frame in layout.strain_frames]
        self._last_sample: tuple[float, float] | None = None
        self.has_published = False
        """Coefficients have been published since the start."""

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

    def pass_over(self, cycle: Cycle, is_usable: bool) -> None:
        """Remember the frames of a closed cycle that is not judged; ``is_usable`` unless its check has failed."""
        self._seen.add(self._strain_data(cycle))
        self._passed_over = cycle if is_usable else None

    @property
    def drift_ppm(self) -> float:
        """How much slower than ours the sender's clock runs [ppm]; NaN if not known."""
        return float("nan") if self._clock is None else self._clock.drift_ppm

    def take_flow(self, arrival: Arrival) -> FrameClass:
        """Hold the flow or navigation of a frame; return the frame's class."""
        if not self._reception.is_trusted(arrival.slot):
            return FrameClass.NOT_TRUSTED
        frame = self._layout.frames[arrival.slot]
        usable = self._flow.take(frame, arrival, self._strain_time(arrival.frame.time))
        return _USED if usable else FrameClass.NOT_USABLE

    def take_held(self, arrival: Arrival) -> FrameClass:
        """Hold a frame of strains that comes more slowly than cycles; return its class."""
        assert self._held is not None
        self._held.take(arrival)
        if not self._reception.is_trusted(arrival.slot):
            return FrameClass.NOT_TRUSTED
        own = self._decoder.decode([arrival], 0, self._beside)
        usable = own.present & ~own.refused & np.isfinite(own.strain)
        return FrameClass.USED if usable.any() else FrameClass.NOT_USABLE

    def take_command(self, arrival: Arrival) -> FrameClass:
        """Take in a command of the sender; return its frame's class. One of another time than now is none."""
        if not self._reception.is_trusted(arrival.slot):
            return FrameClass.NOT_TRUSTED
        frame, now = self._layout.frames[arrival.slot], self._strain_time(arrival.frame.time)
        is_usable = arrival.status <= STATUS_DEGRADED and frame.request is not None
        if self._taring is None or now is None or arrival.sample_time is None or not is_usable:
            return FrameClass.NOT_USABLE
        clock = frame.layout.signals[frame.sample_time or 0]
        whole = frame.tick * (1 << clock.length)
        apart = (arrival.sample_time * frame.tick - now + 0.5 * whole) % whole - 0.5 * whole
        if abs(apart) > self._settings.max_age * self._layout.cycle_time:
            return FrameClass.TOO_OLD
        self._taring.ask(arrival.plan.numbers(arrival.frame.data)[frame.request or 0])
        return FrameClass.USED

    def keep_pace(self, cycle: Cycle) -> None:
        """Note the arrival of a closed cycle, before it is judged or skipped."""
        self._may_be_held_back = self._pace.take(cycle.first_time)

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
        reception, whole = self._reception, None if self._held is None else self._held.complete(cycle)
        arrivals = cycle.arrivals if whole is None else whole.arrivals
        if reception.miss(arrivals):
            causes |= Cause.PARTIAL_CYCLE
        trailer = reception.check_trailer(arrivals)
        if reception.has_second_sender(now):
            causes |= Cause.SECOND_SENDER
        # Strains whose CRC fits are checked even while they are not trusted yet.
        strains = list(arrivals.values()) if trailer.refused in _READABLE else []
        if self._trailer is not None:
            strains = [arrival for arrival in strains if arrival.slot < reception.n_strain]
        decoded = self._decoded
        if whole is None:
            arguments = self._decoder.arguments(strains, trailer.status, decoded)
            plausible = self._gauges.judge_frames(arguments, decoded, cycle.first_time)
        else:
            plausible = self._plausible(self._decoder.decode(strains, trailer.status, decoded), cycle, whole)
        if self._gauges.all_zero and self._is_dead(decoded, now):
            plausible = self._gauges.refuse_zeros(decoded.present)
        age, uncertainty, of_time = self._age(cycle, now, decoded, trailer)
        trusted = reception.trusted_gauges(arrivals)
        if trailer.cause or of_time:
            causes |= trailer.cause | of_time
        if decoded.status:
            causes |= Cause.SENDER_STATUS
        all_trusted = trusted is reception.every_gauge or _is_full(trusted)
        all_plausible = plausible is self._gauges.every_gauge or _is_full(plausible)
        if not all_trusted and (decoded.present & ~trusted).any():
            causes |= Cause.NOT_TRUSTED
        if not all_plausible and (decoded.present & ~plausible).any():
            causes |= Cause.GAUGE_INVALID
        if self._gauges.has_frozen:
            causes |= Cause.FROZEN
        refused = trailer.refused or (FrameClass.TOO_OLD if of_time and of_time & _UNUSABLE else None)
        classes: FrameClass | list[FrameClass] = _USED
        valid, verdicts = plausible, None
        if refused or not (all_trusted and all_plausible):
            valid = np.zeros_like(plausible) if refused else plausible & trusted
            classes = [self._class_of(arrival, refused, valid) for arrival in cycle.arrivals.values()]
            verdicts = GaugeVerdicts(
                present=decoded.present.copy(),
                trusted=trusted,
                refused=decoded.refused.copy(),
                plausible=plausible,
                faults=self._gauges.faults,
                cycle="" if refused is None else refused.value,
            )
        answer = self._answer(
            cycle,
            now,
            causes=causes,
            valid=valid,
            decoded=decoded,
            age=(age, uncertainty),
            verdicts=verdicts,
        )
        if whole is not None:
            answer.held = whole.held
            answer.age += whole.held
        if self._taring is not None and self._taring.is_active:
            answer.causes |= self._taring.take(answer, self._flow.stated_pressure(now))
        return answer, classes

    def _plausible(self, decoded: DecodedCycle, cycle: Cycle, whole: WholeCycle) -> BoolArray:
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

    def _age(
        self, cycle: Cycle, now: float, decoded: DecodedCycle, trailer: TrailerVerdict
    ) -> tuple[float, float, Cause]:
        """Return the age of the strains at ``now`` [s], its uncertainty [s], and the causes if it is in doubt."""
        age, uncertainty, causes = now - cycle.first_time, np.nan, _NOTHING
        limit = self._max_age
        readable = trailer.refused in _READABLE
        is_new = self._seen.add(self._strain_data(cycle)) if readable else False
        named = cycle.first if self._trailer is None else self._named(cycle)
        ticks = named.sample_time if readable else None
        if self._clock is not None and ticks is not None:
            reading = self._clock.read(cycle.first_time, ticks)
            age, uncertainty = age + reading.age, reading.uncertainty
            if reading.jumped:
                causes |= Cause.CLOCK_JUMP
            if reading.restarted:
                self._reception.forget()
            if reading.hides_delay or uncertainty > self._settings.max_uncertainty:
                causes |= Cause.HIDDEN_DELAY
            if not reading.jumped or reading.restarted:
                self._last_sample = cycle.first_time, self._clock.seconds(ticks)
            self._prove(cycle, self._clock, reading, ticks, is_new)
        elif self._clock is None and self._proof is not None and readable:
            self._proof.take_untimed(cycle.first_time, is_new)
        if self._proof is not None and not self._proof.is_proven:
            causes |= Cause.UNPROVEN_RESTART
        if age > limit or (self._clock is None and self._may_be_held_back):
            causes |= Cause.OLD
        if self._settings.stuck_cycles != 0:
            # Strains that the sender repeats have the age of their first occurrence.
            frozen, unheard = (
                self._gauges.ages if self._held is None else self._gauges.frozen(decoded, cycle.first_time)
            )
            age += frozen
            if frozen > 0.0 and age > limit:
                causes |= Cause.FROZEN
            if unheard > 0.0 and not self._has_changed_since(self._passed_over, cycle, decoded=decoded):
                # They may have been frozen in the cycles that were lost: the next ones will tell.
                uncertainty = unheard if isnan(uncertainty) else uncertainty + unheard
                if unheard > self._settings.hidden_age * (1.0 + 1e-9):
                    causes |= Cause.HIDDEN_DELAY
        self._passed_over = None
        return age, uncertainty, causes

    def _has_changed_since(self, passed: Cycle | None, cycle: Cycle, decoded: DecodedCycle) -> bool:
        """Return whether any gauge differs from a cycle that came just before and was passed over."""
        if passed is None or cycle.first_time - passed.first_time > 1.5 * self._period:
            return False
        strains = [arrival for arrival in passed.arrivals.values() if arrival.slot < self._reception.n_strain]
        before = self._decoder.decode(strains, 0, self._beside)
        return bool(((before.raw != decoded.raw) & before.present & decoded.present).any())

    def _prove(self, cycle: Cycle, clock: SenderClock, reading: ClockReading, ticks: int, is_new: bool) -> None:
        """Follow whether the sender is proven; a proven restart is one of q_inf too."""
        counter, is_proven = self._named(cycle).counter, reading.restarted
        if self._proof is not None:
            is_proven = self._proof.take(
                clock, reading, local=cycle.first_time, ticks=ticks, counter=counter, is_new=is_new
            )
        if is_proven:
            clock.accept()
            # The clock of q_inf may be so short that a restart looks like a delay.
            self._flow.reset()

    def _strain_time(self, now: float) -> float | None:
        """Return the time at ``now`` [s] by the clock of the strains [s], None if their sender is not proven."""
        if self._last_sample is None or (self._proof is not None and not self._proof.is_proven):
            return None
        local, seconds = self._last_sample
        return seconds + now - local

    def _strain_data(self, cycle: Cycle) -> list[bytes]:
        """Return what identifies the strains of a cycle: each protected frame, or all that a trailer covers."""
        if self._trailer is None:
            return [arrival.frame.data for arrival in cycle.arrivals.values()]
        return [b"".join([arrival.frame.data for _, arrival in sorted(cycle.arrivals.items())])]

    def _named(self, cycle: Cycle) -> Arrival:
        """Return the frame whose sample time and counter identify a cycle."""
        trailer = self._trailer
        return cycle.first if trailer is None else cycle.arrivals.get(trailer, cycle.first)

    def _class_of(self, arrival: Arrival, refused: FrameClass | None, valid: BoolArray) -> FrameClass:
        """Return the class of one frame of a judged cycle."""
        if refused is not None:
            return refused
        if not self._reception.is_trusted(arrival.slot):
            return FrameClass.NOT_TRUSTED
        used = valid if arrival.slot == self._reception.trailer else valid[self._gauges_of[arrival.slot]]
        return FrameClass.USED if used.any() else FrameClass.NOT_USABLE

    def _answer(
        self,
        cycle: Cycle,
        now: float,
        *,
        causes: Cause,
        valid: BoolArray,
        decoded: DecodedCycle,
        age: tuple[float, float],
        verdicts: GaugeVerdicts | None,
    ) -> CycleResult:
        """Return the result of a judged cycle; ``age`` and its uncertainty in s."""
        flow = self._flow.state(now)
        if isnan(flow.dynamic_pressure) and self._flow.has_pressure:
            causes |= Cause.DYNAMIC_PRESSURE
        causes = causes | flow.lost if flow.lost else causes
        if flow.hides_delay:
            causes |= Cause.HIDDEN_DELAY
        # Without verdicts all gauges are valid.
        is_whole = verdicts is None or _is_full(valid)
        strain = decoded.strain.copy() if is_whole else np.where(valid, decoded.strain, np.nan)
        step = None
        if verdicts is None or np.count_nonzero(valid):
            step, quality, causes = self._step(strain, flow, now, causes)
        elif causes & (Cause.OLD | Cause.FROZEN):
            quality = Quality.STALE
        else:
            quality = Quality.INVALID if self.has_published else Quality.NO_DATA
        published = step is not None and quality.has_coefficients
        self.has_published = self.has_published or published
        if step is not None and causes and causes & Cause.UNPROVEN_RESTART:
            # Until the strains are proven, q_inf of their sender is not used: there may be no coefficients.
            quality = Quality.UNCONFIRMED
        named = self._named(cycle)
        result = result_without_fields()
        result.time, result.arrival, result.quality, result.causes = now, cycle.last_time, quality, causes
        result.valid, result.strain, result.verdicts = valid, strain, verdicts
        result.dynamic_pressure = flow.dynamic_pressure
        result.mach_number, result.altitude = flow.mach_number, flow.altitude
        result.further_inputs = flow.further.copy()  # the state is used again
        result.age, result.age_uncertainty = age
        result.held = 0.0
        result.sample_time, result.counter = named.sample_time, named.counter
        if step is None:
            result.chi_square, result.health, result.further = np.nan, None, {}
        else:
            result.chi_square, result.health, result.further = step.chi_square, step.health, step.further
        result.envelope_score = result.further.get(ENVELOPE_SCORE, np.nan)
        if step is not None and published:
            result.coefficients, result.coefficients_std = step.coefficients, step.coefficients_std
        else:
            result.coefficients, result.coefficients_std = no_numbers(), no_numbers()
        return result


def _is_full(mask: BoolArray) -> bool:
    """Return whether all of a mask is True."""
    return 0 not in mask.tobytes()  # of so few elements four times as fast as mask.all()
