"""Parts of a bridge core that each lack one guard, by the part they replace."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.can.cycle.core import BridgeCore, PortRecord
from strainfmu.can.cycle.estimate.held_flow import FlowState, HeldValue
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.estimate.step import EstimatorStep
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.arrival_pace import ArrivalPace
from strainfmu.can.cycle.frames.assembler import Cycle, CycleAssembler
from strainfmu.can.cycle.frames.decoder import StrainDecoder
from strainfmu.can.cycle.frames.reception import Reception
from strainfmu.can.cycle.frames.restart_proof import RestartProof
from strainfmu.can.cycle.gauges.freeze_watch import FreezeWatch
from strainfmu.can.cycle.gauges.noise import GaugeNoise
from strainfmu.can.cycle.gauges.plausibility import GaugeChecks
from strainfmu.can.cycle.judgement import CycleJudge
from strainfmu.can.cycle.parts import CycleParts
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.e2e.sample_clock import SenderClock
from strainfmu.can.e2e.state_machine import VALID, E2EStateMachine
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.crc import Protection, counter_in, protect
from strainfmu.can.wire.cycle_plan import CyclePlan
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

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        for bucket in self.buckets.values():
            bucket.capacity = bucket.tokens = np.inf


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


class TakesAnyFormat(BridgeCore):
    """Takes frames of any length, format and identifier width."""

    def receive(self, frame: Frame, is_answered: bool = True) -> list[CycleResult]:
        return super().receive(of_any_format(self.layout, frame), is_answered)


# --- reception ------------------------------------------------------------------------------------------------


class ReceivesAnyCrc(BridgeCore):
    """Finds every CRC right."""

    def receive(self, frame: Frame, is_answered: bool = True) -> list[CycleResult]:
        protection = protection_of(self.layout, frame)
        if protection is not None:
            frame = replace(frame, data=protect(frame.data, protection, counter_in(frame.data, protection)))
        return super().receive(frame, is_answered)


class ReceivesAnyCounter(BridgeCore):
    """Finds every counter the next in sequence."""

    def receive(self, frame: Frame, is_answered: bool = True) -> list[CycleResult]:
        protection = protection_of(self.layout, frame)
        if protection is not None:
            slot = next(k for k, item in enumerate(self.layout.frames) if item.layout.key == frame.key)
            before = (counter_in(frame.data, protection) - 1) % protection.counter_modulus
            check = self._reception._checks[slot]
            assert check is not None
            check.record.counter = before
        return super().receive(frame, is_answered)


def protection_of(layout: InputLayout, frame: Frame) -> Protection | None:
    """Return the protection of a frame of ``layout``, None of one that is none."""
    own = {item.layout.key: item.layout for item in layout.frames}.get(frame.key)
    return None if own is None or len(frame.data) != own.length else own.protection


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

    def __init__(self, layout: InputLayout, settings: BridgeSettings) -> None:
        super().__init__(layout, settings)
        always = E2EStateMachine(settings.state_machine)
        always.record.state = VALID
        for slot in self._slots:
            slot.trust(always)


class HearsNoStatus(Reception):
    """Takes strains whatever the sender says of them."""

    def __init__(self, layout: InputLayout, settings: BridgeSettings) -> None:
        super().__init__(layout, settings)
        for slot in self._slots:
            slot.record.place[0] = -1


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

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.record.is_timed = 0


class NeverHeldBack(ArrivalPace):
    """Takes every cycle for new."""

    def take(self, time: float) -> bool:
        return False


class AgelessCycles(CycleJudge):
    """Takes every cycle for young enough."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.record.max_age = self.record.max_uncertainty = np.inf


def never_jumps(clock: SenderClock) -> None:
    """Have ``clock`` find no jump."""
    clock.record.is_synchronised, clock.record.accuracy = 1, np.inf


def forgets_delay(clock: SenderClock) -> None:
    """Have ``clock`` take 200 ppm for drift, without end and without doubt."""
    record = clock.record
    record.jump_tolerance, record.tolerance, record.hidden = 0.1, 2e-4, np.inf


class HasNoDoubt(CycleJudge):
    """Takes the age of strains for known."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.record.max_uncertainty = np.inf

    def judge(self, cycle: Cycle, now: float, causes: Cause) -> tuple[CycleResult, FrameClass | list[FrameClass]]:
        result, classes = super().judge(cycle, now, causes)
        result.age_uncertainty = 0.0
        return result, classes


class AlwaysProven(RestartProof):
    """Takes every jump of the sender's time for a restart."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.record.new_frames, self.record.startup_time, self.record.modulus = 0, np.inf, 0


class TakesPartByPart(BridgeCore):
    """Takes every frame in part by part, none at once in compiled code: no guard is missing."""

    def _new_ports(self, parts: CycleParts) -> dict[int, PortRecord]:
        return {}


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

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.record.looks_for_frozen = 0


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


class HoldsMissingGauges(EstimatorStep):
    """Takes the last strain of a gauge that has none."""

    _before: FloatArray | None = None

    def __call__(
        self, strain: FloatArray, valid: BoolArray, flow: FlowState, now: float, causes: Cause
    ) -> tuple[StepResult | None, Quality, Cause]:
        if self._before is not None:
            strain = np.where(np.isnan(strain), self._before, strain)
        self._before = strain
        return super().__call__(strain, valid, flow, now, causes & ~Cause.PARTIAL_CYCLE)


class IgnoresHealth(EstimatorStep):
    """Judges a step as if the estimator were content."""

    def _quality_of(self, step: StepResult, causes: Cause) -> tuple[Quality, Cause]:
        return super()._quality_of(replace(step, health=int(HealthState.OK)), causes)


class PublishesAnything(EstimatorStep):
    """Publishes coefficients that are no numbers."""

    def _is_finite(self, step: StepResult) -> bool:
        return True
