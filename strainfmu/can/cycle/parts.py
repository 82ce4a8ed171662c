"""The parts that frames and cycles pass through on the way to a result, made for one layout of input frames.

Each part holds guards of its own: it refuses what it can prove wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from strainfmu.can.cycle.estimate.held_flow import HeldFlow, HeldValue
from strainfmu.can.cycle.estimate.taring import Taring
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.arrival_pace import ArrivalPace
from strainfmu.can.cycle.frames.assembler import CycleAssembler, Limits
from strainfmu.can.cycle.frames.decoder import StrainDecoder
from strainfmu.can.cycle.frames.held_strains import HeldStrains, gauge_periods, held_strains
from strainfmu.can.cycle.frames.own_frames import OwnFrames
from strainfmu.can.cycle.frames.reception import Reception
from strainfmu.can.cycle.frames.restart_proof import ProofLimits, RestartProof, SeenFrames, StrainTime
from strainfmu.can.cycle.frames.sender_period import SenderPeriod
from strainfmu.can.cycle.gauges.noise import gauge_noise
from strainfmu.can.cycle.gauges.plausibility import GaugeChecks
from strainfmu.can.cycle.gauges.repeated_strains import RepeatedStrains
from strainfmu.can.e2e.sample_clock import ClockLimits, SampleClock, SenderClock
from strainfmu.can.e2e.synchronised_clock import SynchronisedClock
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame_layout import DYNAMIC_PRESSURE, FlowSignal, InputFrame, InputLayout, is_reading


@dataclass(frozen=True, eq=False, kw_only=True)
class CycleParts:
    """The parts in the order in which data pass them.

    Attributes
    ----------
    own : frames that the bridge sends.
    acceptance : which frames are taken in.
    reception : CRC, counter and E2E state of each frame.
    assembler : frames put together to cycles.
    pace : whether cycles may have been held back.
    sender_period : the period of the sender, measured.
    clock : age of the strain readings by the sender's clock; None where frames have no sample time.
    seen : frames received in this run.
    proof : whether a sender whose time jumped is proven; None where none is needed or none can be given.
    strain_time : time by the clock of the strains.
    decoder : strains of a closed cycle.
    gauges : plausibility of each gauge.
    flow : dynamic pressure and navigation.
    held : strains that come more slowly than cycles; None where all come in every cycle.
    taring : takes the zeros of the gauges on command; None where that is not allowed.
    repeats : strains of earlier cycles; None where strains may repeat themselves.
    """

    own: OwnFrames
    acceptance: Acceptance
    reception: Reception
    assembler: CycleAssembler
    pace: ArrivalPace
    sender_period: SenderPeriod
    clock: SenderClock | None
    seen: SeenFrames
    proof: RestartProof | None
    strain_time: StrainTime
    decoder: StrainDecoder
    gauges: GaugeChecks
    flow: HeldFlow
    held: HeldStrains | None = None
    taring: Taring | None = None
    repeats: RepeatedStrains | None = None


def cycle_parts(
    layout: InputLayout,
    settings: BridgeSettings,
    own: OwnFrames,
    dynamic_pressure: float | None,
    noise_std: ArrayLike | None = None,
) -> CycleParts:
    """Return the parts for ``layout``.

    Parameters
    ----------
    own : frames that the bridge sends.
    dynamic_pressure : q_inf of the whole run [Pa], or None to take it from its frame.
    noise_std : (n_d,) or one standard deviation of the gauges' noise [m/m], None where not known.
    """
    period, seen, proof = layout.cycle_time, SeenFrames(), restart_proof(layout, settings)
    strain_time = StrainTime(proof)
    return CycleParts(
        own=own,
        acceptance=Acceptance(layout, own, settings),
        reception=Reception(layout, settings),
        assembler=CycleAssembler(cycle_limits(layout, settings), cycle_lengths(layout)),
        pace=ArrivalPace(settings.max_age * period, settings.rate / period),
        sender_period=sender_period(layout, settings),
        clock=strain_clock(layout, settings),
        seen=seen,
        proof=proof,
        strain_time=strain_time,
        decoder=StrainDecoder(layout),
        gauges=gauge_checks(layout, settings, noise_std),
        flow=HeldFlow(held_values(layout, settings), dynamic_pressure, seen, strain_time, layout.constants),
        held=held_strains(layout),
        repeats=repeated_strains(layout, settings, noise_std),
    )


def repeated_strains(
    layout: InputLayout, settings: BridgeSettings, noise_std: ArrayLike | None
) -> RepeatedStrains | None:
    """Return what remembers strains; None where a sender may repeat a stimulus, or strains may be constant."""
    if settings.accepts_restart or settings.stuck_cycles == 0:
        return None
    return RepeatedStrains(gauge_noise(layout, noise_std))


def gauge_checks(
    layout: InputLayout,
    settings: BridgeSettings,
    noise_std: ArrayLike | None,
    checks: type[GaugeChecks] = GaugeChecks,
) -> GaugeChecks:
    """Return the ``checks`` of the gauges of ``layout``; ``noise_std`` as of :func:`cycle_parts`."""
    noise = gauge_noise(layout, noise_std)
    frame = _dated(layout)
    return checks(
        layout.n_gauges,
        layout.cycle_time,
        settings,
        noise,
        periods=gauge_periods(layout),
        is_dated=frame is not None and frame.sample_time is not None,
    )


def cycle_limits(layout: InputLayout, settings: BridgeSettings) -> Limits:
    """Return what a cycle of ``layout`` is."""
    n_strain = len(layout.strain_frames)
    n_slots = n_strain - len(layout.held_slots) + (layout.trailer is not None)
    bits = None
    if layout.is_timed:
        first = layout.first_of_cycle
        bits = first.layout.signals[first.sample_time or 0].length
    return Limits(
        n_slots=n_slots,
        trailer=None if layout.trailer is None else n_strain,
        deadline=settings.deadline * layout.cycle_time,
        clock_bits=bits,
        late_limit=settings.late_cycles * n_slots,
    )


def cycle_lengths(layout: InputLayout) -> list[int]:
    """Return the bytes of the frames that a cycle may hold: strains, then the trailer."""
    return [
        frame.layout.length for frame in layout.frames[: len(layout.strain_frames) + (layout.trailer is not None)]
    ]


def strain_clock(layout: InputLayout, settings: BridgeSettings) -> SenderClock | None:
    """Return the clock that follows the sample times of cycles, None if they have none."""
    return sender_clock(_dated(layout), layout.cycle_time, settings, is_counted=True)


def restart_proof(layout: InputLayout, settings: BridgeSettings) -> RestartProof | None:
    """Return the proof of a sender that restarts; None where none is needed or none can be given.

    Synchronised times date a recording, and authenticated frames are never accepted twice. Strains without sample
    time that may be constant repeat themselves in any case.
    """
    frame = _dated(layout)
    is_timed = frame is not None and frame.sample_time is not None
    if layout.is_authenticated or (is_timed and settings.synchronised is not None):
        return None
    if not is_timed and settings.stuck_cycles == 0:
        return None
    protection = None if frame is None else frame.layout.protection
    limits = ProofLimits(
        period=layout.cycle_time,
        new_frames=settings.jump_confirmations,
        startup_time=settings.startup_time,
        pause=settings.max_age * layout.cycle_time,
        max_delta=settings.max_delta,
        counter_modulus=None if protection is None else protection.counter_modulus,
        accepts=settings.accepts_restart,
    )
    return RestartProof(limits)


def sender_period(layout: InputLayout, settings: BridgeSettings) -> SenderPeriod:
    """Return what measures the period of cycles: of the frame that dates them, else of their first one."""
    frame = _dated(layout) or layout.first_of_cycle
    is_timed, protection = frame.sample_time is not None, frame.layout.protection
    return SenderPeriod(
        layout.cycle_time,
        settings.period_tolerance,
        tick=frame.tick if is_timed else 0.0,
        bits=frame.layout.signals[frame.sample_time or 0].length if is_timed else 0,
        modulus=0 if protection is None else protection.counter_modulus,
    )


def _dated(layout: InputLayout) -> InputFrame | None:
    """Return the frame whose sample time dates a cycle, if it holds one."""
    return layout.first_of_cycle if layout.is_timed else layout.trailer


def held_values(layout: InputLayout, settings: BridgeSettings) -> list[HeldValue]:
    """Return what holds the quantities of the flow frames."""
    return [
        HeldValue(
            frame,
            source,
            max_age=flow_max_age(layout, frame, source, settings),
            clock=sender_clock(frame, layout.cycle_time, settings),
            tolerance=settings.jump_tolerance * layout.cycle_time,
            new_frames=0 if settings.accepts_restart else settings.jump_confirmations,
        )
        for frame in layout.flow_frames
        for source in frame.flow
    ]


def flow_max_age(layout: InputLayout, frame: InputFrame, source: FlowSignal, settings: BridgeSettings) -> float:
    """Return for how long a quantity of the flow is held [s].

    That of a frame with a time-out of its own is held for that.
    """
    if frame.timeout is not None:
        return frame.timeout
    is_pressure = source.quantity == DYNAMIC_PRESSURE
    cycles = settings.pressure_max_age if is_pressure else settings.navigation_max_age
    cycles = settings.sensor_max_age if is_reading(source.quantity) else cycles
    return cycles * max(layout.cycle_time, frame.layout.cycle_time or 0.0)


def sender_clock(
    frame: InputFrame | None, cycle_time: float, settings: BridgeSettings, is_counted: bool = False
) -> SenderClock | None:
    """Return a clock that follows the sample times of ``frame``, None if it has none; ``cycle_time`` in s.

    ``is_counted`` holds them against the frame's counter.
    """
    if frame is None or frame.sample_time is None:
        return None
    bits = frame.layout.signals[frame.sample_time].length
    if settings.synchronised is not None:
        return SynchronisedClock(
            frame.tick, bits, shift=settings.synchronised_shift, accuracy=settings.synchronised
        )
    protection = frame.layout.protection
    limits = ClockLimits(
        rate=settings.clock_rate,
        tolerance=settings.clock_tolerance,
        hidden=settings.hidden_age,
        jump_tolerance=settings.jump_tolerance * cycle_time,
        confirmations=settings.jump_confirmations,
        learn=settings.learn_time,
        period=cycle_time,
        modulus=protection.counter_modulus if is_counted and protection is not None else 0,
    )
    return SampleClock(frame.tick, bits, limits)
