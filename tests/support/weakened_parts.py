"""Parts of a bridge core that each lack one guard, by the part they replace."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.can.cycle.core import BridgeCore
from strainfmu.can.cycle.estimate.held_flow import HeldValue
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.estimate.step import EstimatorStep
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.arrival_pace import ArrivalPace
from strainfmu.can.cycle.frames.assembler import Arrival, Cycle, CycleAssembler, Verdict
from strainfmu.can.cycle.frames.decoder import StrainDecoder
from strainfmu.can.cycle.frames.own_frames import OwnFrames
from strainfmu.can.cycle.frames.reception import Reception
from strainfmu.can.cycle.frames.restart_proof import RestartProof
from strainfmu.can.cycle.gauges.freeze_watch import FreezeWatch
from strainfmu.can.cycle.gauges.noise import GaugeNoise
from strainfmu.can.cycle.gauges.plausibility import GaugeChecks
from strainfmu.can.cycle.gauges.verdicts import GaugeVerdicts
from strainfmu.can.cycle.judgement import CycleJudge
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.e2e.sample_clock import ClockLimits, ClockReading, SampleClock, SenderClock
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.crc import Protection, counter_in, crc_in, crc_of, protect
from strainfmu.can.wire.cycle_plan import CyclePlan, DecodedCycle
from strainfmu.can.wire.frame import EXTENDED_FLAG, Frame
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.cosim.estimators.step import StepResult
from strainfmu.estimator.health import HealthState

# --- acceptance -----------------------------------------------------------------------------------------------


class TakesErrorFrames(Acceptance):
    """Takes error frames for data."""

    def refused(self, frame: Frame) -> FrameClass | None:
        return super().refused(replace(frame, is_error=False))


class TakesRemoteFrames(Acceptance):
    """Takes remote frames for data."""

    def refused(self, frame: Frame) -> FrameClass | None:
        return super().refused(replace(frame, is_remote=False))


class NeverSheds(Acceptance):
    """Lets a babbling sender through."""

    def _without_token(self) -> FrameClass | None:
        return None


class OwnsEveryResult(Acceptance):
    """Takes the results of another bridge for its own."""

    def _comes_back(self, frame: Frame) -> bool:
        return True


def of_any_format(layout: InputLayout, frame: Frame) -> Frame:
    """Return ``frame`` cut or padded to the layout's format of its identifier, of either width."""
    formats = {item.layout.key: item.layout for item in layout.frames}
    own = formats.get(frame.key) or formats.get(frame.key ^ EXTENDED_FLAG)
    if own is None:
        return frame
    data = frame.data.ljust(own.length, b"\0")[: own.length]
    return replace(frame, is_extended=own.is_extended, is_fd=own.is_fd, data=data)


class AcceptsAnyFormat(Acceptance):
    """Takes frames of any length, format and identifier width."""

    def __init__(self, layout: InputLayout, own: OwnFrames | Iterable[int], settings: BridgeSettings) -> None:
        super().__init__(layout, own, settings)
        self._layout = layout

    def refused(self, frame: Frame) -> FrameClass | None:
        return super().refused(of_any_format(self._layout, frame))


# --- reception ------------------------------------------------------------------------------------------------


class ReceivesAnyFormat(Reception):
    """Decodes frames of any length, format and identifier width."""

    def take(self, frame: Frame) -> Arrival | FrameClass:
        return super().take(of_any_format(self._layout, frame))


class Altered(Reception):
    """Takes frames with another counter and a CRC that fits."""

    def take(self, frame: Frame) -> Arrival | FrameClass:
        slot = self._single[frame.key]
        protection = self._layout.frames[slot.index].layout.protection
        assert protection is not None
        assert slot.check is not None
        own = counter_in(frame.data, protection)
        altered = self.altered(frame.data, protection, own, slot.check.record.counter)
        found = super().take(replace(frame, data=altered))
        if isinstance(found, Arrival):
            found.frame, found.counter = frame, own
        return found

    def altered(self, data: bytes, protection: Protection, own: int, last: int) -> bytes:
        raise NotImplementedError  # each subclass alters the frame in its own way


class ReceivesAnyCrc(Altered):
    """Finds every CRC right."""

    def altered(self, data: bytes, protection: Protection, own: int, last: int) -> bytes:
        return protect(data, protection, counter=own)


class ReceivesAnyCounter(Altered):
    """Finds every counter the next in sequence, where the CRC is right."""

    def altered(self, data: bytes, protection: Protection, own: int, last: int) -> bytes:
        fits = crc_in(data, protection) == crc_of(data, protection)
        return protect(data, protection, counter=last + 1) if fits else data


class HearsOneSender(Reception):
    """Takes all frames for those of one sender."""

    def has_second_sender(self, now: float) -> bool:
        return False


class ReceivesAnyConfiguration(Reception):
    """Takes frames of another gauge assignment."""

    def __init__(self, layout: InputLayout, settings: BridgeSettings) -> None:
        super().__init__(layout, settings)
        for slot in self._slots:
            slot.record.place[2] = -1


class TrustsEveryState(Reception):
    """Uses data whatever the E2E state."""

    def is_trusted(self, slot: int) -> bool:
        return True


class TakesAnyAuthenticator(Reception):
    """Takes forged frames for the sender's."""

    def _not_authentic(self, slot: int, data: bytes) -> FrameClass | None:
        found = super()._not_authentic(slot, data)
        return None if found is FrameClass.NOT_AUTHENTIC else found


class TakesAnyFreshness(Reception):
    """Takes authentic frames whenever they were made."""

    def _not_authentic(self, slot: int, data: bytes) -> FrameClass | None:
        found = super()._not_authentic(slot, data)
        return None if found is FrameClass.NOT_FRESH else found


# --- assembly, time -------------------------------------------------------------------------------------------


class TakesAnyOrder(CycleAssembler):
    """Takes frames older than the open cycle."""

    def _in_time(self, arrival: Arrival) -> Verdict:
        return Verdict.ACCEPTED


class NeverHeldBack(ArrivalPace):
    """Takes every cycle for new."""

    def take(self, time: float) -> bool:
        return False


class AgelessClock:
    """A sample clock that finds every sample new."""

    drift_ppm = float("nan")

    def __init__(self, clock: SenderClock) -> None:
        self._clock = clock
        self.reset, self.accept, self.anchor = clock.reset, clock.accept, clock.anchor
        self.seconds, self.seconds_ahead, self.range = clock.seconds, clock.seconds_ahead, clock.range
        self.record = clock.record

    def read(self, local: float, ticks: int) -> ClockReading:
        return replace(self._clock.read(local, ticks), age=0.0)


class NeverJumps(AgelessClock):
    """A sample clock that finds no jump."""

    def read(self, local: float, ticks: int) -> ClockReading:
        return ClockReading(self._clock.read(local, ticks).age)


class ForgetsDelay(AgelessClock):
    """A sample clock that takes 200 ppm for drift, without end and without doubt."""

    def __init__(self, clock: SenderClock) -> None:
        assert isinstance(clock, SampleClock)
        limits = ClockLimits(jump_tolerance=0.1, tolerance=2e-4, hidden=np.inf)
        super().__init__(SampleClock(1e-6, round(np.log2(clock.range / 1e-6)), limits))

    def read(self, local: float, ticks: int) -> ClockReading:
        return replace(self._clock.read(local, ticks), uncertainty=0.0, hides_delay=False)


class AlwaysProven(RestartProof):
    """Takes every jump of the sender's time for a restart."""

    def take(self, clock: SenderClock, reading: ClockReading, **_: object) -> bool:
        return reading.restarted


class AnswersNoSilence(BridgeCore):
    def _answer_silence(self, time: float) -> list[CycleResult]:
        return []


# --- strains --------------------------------------------------------------------------------------------------


def without_codes(plan: CyclePlan) -> CyclePlan:
    """Return ``plan`` whose signals have no raw number for "no value"."""
    plan.record.kept["first_code"][:] = 0
    return plan


def without_limits(plan: CyclePlan) -> CyclePlan:
    """Return ``plan`` whose signals have neither limits nor a converter's ends."""
    kept = plan.record.kept
    kept["low"][:], kept["high"][:], kept["has_ends"][:] = -np.inf, np.inf, 0
    return plan


class DecodesNoValueCodes(StrainDecoder):
    """Takes raw numbers that stand for "no value" for strains."""

    def new_plan(self, *given: Any) -> CyclePlan:
        return without_codes(super().new_plan(*given))


class DecodesAnyRange(StrainDecoder):
    def new_plan(self, *given: Any) -> CyclePlan:
        return without_limits(super().new_plan(*given))


class HearsNoStatus(StrainDecoder):
    def _worst_status(self, arrivals: Sequence[Arrival], trailer_status: int) -> int:
        return 0


class AcceptsAnyRange(GaugeChecks):
    def limits(self) -> dict[str, float]:
        return {**super().limits(), "sensor_range": np.inf}


class AcceptsJumps(GaugeChecks):
    def limits(self) -> dict[str, float]:
        return {**super().limits(), "rate_limit": np.inf}


class AcceptsStuck(GaugeChecks):
    def _count_on(self, noise_ratio: FloatArray) -> None:
        super()._count_on(noise_ratio)
        self._stuck_cycles[:] = np.inf


class AcceptsZero(GaugeChecks):
    def limits(self) -> dict[str, float]:
        return {**super().limits(), "zero_jump": np.inf}

    def _count_on(self, noise_ratio: FloatArray) -> None:
        super()._count_on(noise_ratio)
        self._zero_cycles[:] = np.iinfo(np.int64).max


class IgnoresWatch(FreezeWatch):
    """Finds no gauges that are frozen together."""

    limit, scatter_limit = -np.inf, np.inf


class RepeatsTogether(GaugeChecks):
    def new_watch(self, noise: GaugeNoise) -> FreezeWatch:
        return IgnoresWatch(noise)


class IgnoresScatter(FreezeWatch):
    """Finds gauges that repeat their readings, not those that scatter too little."""

    scatter_limit = np.inf


class ScattersTooLittle(GaugeChecks):
    def new_watch(self, noise: GaugeNoise) -> FreezeWatch:
        return IgnoresScatter(noise)


class NeverFrozen(RepeatsTogether):
    """Finds neither a cycle nor gauges that do not change."""

    @property
    def ages(self) -> tuple[float, float]:
        return 0.0, 0.0


# --- flow and navigation --------------------------------------------------------------------------------------


class HoldsNoValueCodes(HeldValue):
    def new_plan(self, *given: Any) -> CyclePlan:
        return without_codes(super().new_plan(*given))


class HoldsAnyRange(HeldValue):
    def new_plan(self, *given: Any) -> CyclePlan:
        return without_limits(super().new_plan(*given))

    def sensible(self) -> tuple[float, float]:
        return -np.inf, np.inf


class HoldsWhateverStatus(HeldValue):
    @property
    def status(self) -> None:
        return None


class HoldsForEver(HeldValue):
    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.record.max_age = np.inf


# --- judgement ------------------------------------------------------------------------------------------------


class HoldsMissingGauges(CycleJudge):
    """Takes the last strain of a gauge whose frame is missing."""

    _last: FloatArray | None = None

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
        last = np.full_like(decoded.strain, np.nan) if self._last is None else self._last
        held = DecodedCycle(len(last))
        held.present[:], held.status = decoded.present, decoded.status
        held.strain[:] = np.where(decoded.present, decoded.strain, last)
        result = super()._answer(
            cycle,
            now,
            causes=causes & ~Cause.PARTIAL_CYCLE,
            valid=valid | ~decoded.present,
            decoded=held,
            age=age,
            verdicts=verdicts,
        )
        self._last = result.strain
        return result


class IgnoresHealth(EstimatorStep):
    """Judges a step as if the estimator were content."""

    def _quality_of(self, step: StepResult, causes: Cause) -> tuple[Quality, Cause]:
        return super()._quality_of(replace(step, health=int(HealthState.OK)), causes)


class PublishesAnything(EstimatorStep):
    """Publishes coefficients that are no numbers."""

    def _is_finite(self, step: StepResult) -> bool:
        return True
