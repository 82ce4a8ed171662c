"""Bridge cores that each lack one guard: a part of the shipped core replaced by a subclass or a null object.

Tests run the same faults through the shipped core and through one of these, to show what the guard is for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

from weakened_parts import (
    AcceptsAnyRange,
    AcceptsJumps,
    AcceptsStuck,
    AcceptsZero,
    AgelessCycles,
    AlwaysProven,
    AnswersNoSilence,
    DecodesAnyRange,
    DecodesNoValueCodes,
    HasNoDoubt,
    HearsNoStatus,
    HearsOneSender,
    HoldsAnyRange,
    HoldsForEver,
    HoldsMissingGauges,
    HoldsNoValueCodes,
    HoldsWhateverStatus,
    IgnoresHealth,
    NeverFrozen,
    NeverHeldBack,
    NeverSheds,
    OwnsEveryResult,
    PublishesAnything,
    ReceivesAnyConfiguration,
    ReceivesAnyCounter,
    ReceivesAnyCrc,
    RepeatsTogether,
    ScattersTooLittle,
    TakesAnyAuthenticator,
    TakesAnyFormat,
    TakesAnyFreshness,
    TakesAnyOrder,
    TakesErrorFrames,
    TakesRemoteFrames,
    TrustsEveryState,
    forgets_delay,
    never_jumps,
)

from strainfmu.can.cycle.core import BridgeCore
from strainfmu.can.cycle.estimate.held_flow import HeldFlow, HeldValue
from strainfmu.can.cycle.estimate.step import EstimatorStep
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.arrival_pace import ArrivalPace
from strainfmu.can.cycle.frames.assembler import CycleAssembler
from strainfmu.can.cycle.frames.decoder import StrainDecoder
from strainfmu.can.cycle.frames.own_frames import OwnFrames
from strainfmu.can.cycle.frames.reception import Reception
from strainfmu.can.cycle.frames.restart_proof import RestartProof, StrainTime
from strainfmu.can.cycle.gauges.plausibility import GaugeChecks
from strainfmu.can.cycle.judgement import CycleJudge
from strainfmu.can.cycle.parts import (
    cycle_lengths,
    cycle_limits,
    cycle_parts,
    flow_max_age,
    gauge_checks,
    sender_clock,
)
from strainfmu.can.e2e.sample_clock import SenderClock
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.cosim.estimators.step import Step, noise_of

MakeCore = Callable[..., BridgeCore]
"""Makes a core from what ``bridge_core`` takes."""


def core_without(
    *weak: type, clock: Callable[[SenderClock], None] | None = None, ignores_own_keys: bool = False
) -> MakeCore:
    """Return a maker of cores with the subclasses ``weak`` as parts, and with clocks that ``clock`` weakens."""

    def chosen(part: type) -> type:
        return next((one for one in weak if issubclass(one, part)), part)

    def make(
        layout: InputLayout, step: Step, settings: BridgeSettings, *, start: float, own_keys: Iterable[int] = ()
    ) -> BridgeCore:
        own = OwnFrames(() if ignores_own_keys else own_keys)
        whole = cycle_parts(layout, settings, own=own, dynamic_pressure=None)

        def weakened(one: SenderClock | None) -> SenderClock | None:
            if clock is not None and one is not None:
                clock(one)
            return one

        proof = None if whole.proof is None else chosen(RestartProof)(whole.proof.limits)
        strain_time = StrainTime(proof)
        parts = replace(
            whole,
            acceptance=chosen(Acceptance)(layout, own, settings),
            reception=chosen(Reception)(layout, settings),
            assembler=chosen(CycleAssembler)(cycle_limits(layout, settings), cycle_lengths(layout)),
            pace=chosen(ArrivalPace)(settings.max_age * layout.cycle_time, settings.rate / layout.cycle_time),
            clock=weakened(whole.clock),
            proof=proof,
            strain_time=strain_time,
            decoder=chosen(StrainDecoder)(layout),
            gauges=gauge_checks(layout, settings, noise_of(step), chosen(GaugeChecks)),
            flow=HeldFlow(
                [
                    chosen(HeldValue)(
                        frame,
                        source,
                        max_age=flow_max_age(layout, frame, source, settings),
                        clock=weakened(sender_clock(frame, layout.cycle_time, settings)),
                        tolerance=settings.jump_tolerance * layout.cycle_time,
                    )
                    for frame in layout.flow_frames
                    for source in frame.flow
                ],
                None,
                whole.seen,
                strain_time,
            ),
        )
        judge = chosen(CycleJudge)(layout, chosen(EstimatorStep)(layout, step), settings, parts)
        return chosen(BridgeCore)(layout, settings, start=start, parts=parts, judge=judge)

    return make


WITHOUT: dict[str, MakeCore] = {
    "own_frames": core_without(ignores_own_keys=True),
    "second_bridge": core_without(OwnsEveryResult),
    "second_sender": core_without(HearsOneSender),
    "creep": core_without(HasNoDoubt, clock=forgets_delay),
    "restart_proof": core_without(AlwaysProven),
    "error_frames": core_without(TakesErrorFrames),
    "remote_frames": core_without(TakesRemoteFrames),
    "format": core_without(TakesAnyFormat),
    "babbling": core_without(NeverSheds),
    "crc": core_without(ReceivesAnyCrc),
    "counter": core_without(ReceivesAnyCounter),
    "configuration": core_without(ReceivesAnyConfiguration),
    "state_machine": core_without(TrustsEveryState),
    "order": core_without(TakesAnyOrder),
    "completeness": core_without(HoldsMissingGauges),
    "silence": core_without(AnswersNoSilence),
    "age": core_without(AgelessCycles),
    "pace": core_without(NeverHeldBack),
    "clock_jump": core_without(clock=never_jumps),
    "frozen": core_without(NeverFrozen),
    "partial_freeze": core_without(RepeatsTogether),
    "dither": core_without(ScattersTooLittle),
    "stuck": core_without(AcceptsStuck),
    "zero": core_without(AcceptsZero),
    "not_available": core_without(DecodesNoValueCodes, HoldsNoValueCodes),
    "range": core_without(DecodesAnyRange, AcceptsAnyRange, HoldsAnyRange),
    "rate": core_without(AcceptsJumps),
    "sender_status": core_without(HearsNoStatus, HoldsWhateverStatus),
    "pressure_age": core_without(HoldsForEver),
    "health": core_without(IgnoresHealth),
    "finite_output": core_without(PublishesAnything),
    "authenticator": core_without(TakesAnyAuthenticator),
    "freshness": core_without(TakesAnyFreshness),
}
"""A core without each guard, by what it guards."""
