"""A sender, a bridge core and an oracle in virtual time; the oracle knows nothing of how the core decides."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import compress, count
from math import ceil, inf

import numpy as np
from can_faults import Fault, FaultKind
from composed_frames import ResultFrames
from fault_injection import FaultySender, frozen_gauges, growth_of

from strainfmu.can.authentic import AuthenticationKey
from strainfmu.can.dbc_writer import dbc_text
from strainfmu.can.encoder import StrainEncoder, cycles_apart
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import FrameLayout, InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeOptions, BridgeSettings
from strainfmu.can.profiles import SECURED_PROFILE, Identifiers, profile_layout, result_form_of
from strainfmu.can.quality import BusState, Cause, Quality
from strainfmu.can.result_frames import result_layouts
from strainfmu.cosim.estimators.step import StepResult
from strainfmu.estimator.health import HealthState

CYCLE = 0.01
N_GAUGES = 30
SIZES = {"fd64": N_GAUGES, "fd64-sec": N_GAUGES, "classic-le": 10}
"""Gauges of a layout of each profile."""
GAP = BridgeSettings().recovery_cycles + 3
"""Cycles between two faults in which the bridge recovers."""
QUANTUM = 0.25e-6
KEY = AuthenticationKey(bytes(range(16)))
HIDDEN = 1e-4
"""Difference of delays of a bus in order, which no clock shows [s]."""
MIN_STUCK_CYCLES = 25
"""Shortest run of equal readings with which a gauge is stuck."""
ACCEPTING = BridgeSettings(restart="accept")
"""For senders that hear no result."""
NOISE = 2e-6
"""Noise of the true strains [m/m], which the estimator states."""
OWN = Frame(identifier=0x380, data=bytes(64), is_fd=True)


def mixed_layout(n_gauges: int = N_GAUGES) -> InputLayout:
    """Return fd64 whose last frame of strains comes in every fifth cycle, and is held for two of its periods."""
    layout = layout_of("fd64", n_gauges)
    *fast, slow = layout.strain_frames
    slow = replace(slow, layout=replace(slow.layout, cycle_time=5.0 * CYCLE), hold=10.0 * CYCLE)
    return replace(layout, name="mixed", strain_frames=(*fast, slow))


def gauge_names(n_gauges: int = N_GAUGES) -> list[str]:
    return [f"gauge {i}" for i in range(n_gauges)]


def layout_of(profile: str, n_gauges: int = N_GAUGES, cycle_time: float = CYCLE) -> InputLayout:
    key = KEY if profile == SECURED_PROFILE else None
    return profile_layout(
        profile, gauge_names(n_gauges), cycle_time=cycle_time, identifiers=Identifiers(), key=key
    )


def dbc_text_of(profile: str, n_gauges: int = 54, extended: bool = False) -> str:
    """The DBC file of a profile and its results."""
    return dbc_text(frames_of(profile, n_gauges, extended), "test")


def frames_of(profile: str, n_gauges: int = 54, extended: bool = False) -> list[FrameLayout]:
    """Every frame of a profile: input, then results."""
    identifiers = Identifiers(is_extended=extended)
    layout = profile_layout(profile, gauge_names(n_gauges), cycle_time=CYCLE, identifiers=identifiers)
    results = result_layouts(result_form_of(profile), identifiers, CYCLE)
    return [*(frame.layout for frame in layout.frames), *results]


def bus_options(profile: str) -> BridgeOptions:
    """The options of a bus with the frames of a profile, every CYCLE."""
    return BridgeOptions(interface="virtual", channel="test", profile=profile, cycle_time=CYCLE)


class Ears:
    """A sender that hears every result; ``clock`` is its clock by the bridge's [s]."""

    def __init__(
        self, sender: StrainEncoder | FaultySender, clock: Callable[[float], float] = lambda time: time
    ) -> None:
        self._sender, self._clock, self._number = sender, clock, count()

    def hear(self, results: list[Result]) -> list[Result]:
        """Have the sender hear ``results``; return them."""
        for result in results:
            number = next(self._number) % 256
            if result.counter is not None:
                self._sender.hear(result.counter, number, self._clock(result.time))
        return results


LOSING = frozenset({FaultKind.LOSS, FaultKind.CORRUPTION, FaultKind.BURST_ERROR, FaultKind.SEQUENCE})
"""Faults that take single cycles away."""


class Projection:
    """A step whose first four outputs are projections of all strains and whose fifth is q_inf.

    A single wrong or foreign strain moves them by far more than quantisation does.
    """

    def __init__(self, n_gauges: int) -> None:
        self.weights = np.random.default_rng(5).uniform(0.5, 1.5, size=(4, n_gauges))
        self._gain = 1e6 * self.weights
        self.health = HealthState.OK
        self.noise_std: np.ndarray | None = np.full(n_gauges, NOISE)

    def __call__(self, strain: np.ndarray, dynamic_pressure: float, step_size: float) -> StepResult:
        missing = not np.isfinite(strain).all()
        health = HealthState.DEGRADED if missing else self.health
        return StepResult(self.outputs(strain, dynamic_pressure), np.ones(5), int(health), 1.0)

    def outputs(self, strain: np.ndarray, dynamic_pressure: float) -> np.ndarray:
        known = strain if np.isfinite(strain).all() else np.nan_to_num(strain)
        return np.append(self.projected(known), dynamic_pressure)

    def projected(self, strain: np.ndarray) -> np.ndarray:
        """Return the first four outputs (.., 4) of strains (.., n) that are all known."""
        return np.asarray(strain @ self._gain.T)


@dataclass(frozen=True)
class Truth:
    """What happened on the vehicle, by cycle: strains move by more than quantisation every cycle."""

    n_gauges: int
    seed: int

    def cycle(self, number: int) -> tuple[np.ndarray, float]:
        """Return strains [m/m] and q_inf [Pa] of a cycle."""
        return true_strain(self.n_gauges, self.seed, number), true_pressure(number)


@lru_cache(maxsize=20_000)
def true_strain(n_gauges: int, seed: int, number: int) -> np.ndarray:
    """Return strains (n_gauges,) [m/m] of a cycle, which many campaigns have in common."""
    random, gauge = np.random.default_rng((seed, number)), np.arange(n_gauges)
    slow = 300e-6 * np.sin(2.0 * np.pi * number / 700.0 + gauge) + 500e-6
    strain = np.asarray(slow + NOISE * random.normal(size=n_gauges))
    strain.flags.writeable = False
    return strain


def true_pressure(number: int) -> float:
    """Return q_inf [Pa] of a cycle."""
    return 9e4 + 10.0 * number % 2e4


@dataclass
class Campaign:
    """What a run in virtual time came to.

    Attributes
    ----------
    false_valid : results of quality VALID that no allowed truth explains, in words.
    late_recovery : faults after whose end results were not VALID in time.
    """

    results: list[Result]
    core: Machine
    false_valid: list[str]
    late_recovery: list[Fault]

    @property
    def qualities(self) -> Counter[Quality]:
        return Counter(result.quality for result in self.results)


def run_campaign(
    layout: InputLayout,
    faults: list[Fault],
    n_cycles: int,
    seed: int = 1,
    settings: BridgeSettings | None = None,
    keep: bool = True,
    change: Callable[[int, list[Frame]], list[Frame]] | None = None,
    step: Projection | None = None,
    make_core: Callable[..., Machine] = Machine,
) -> Campaign:
    """Send ``n_cycles`` with ``faults`` through a core and judge every result.

    ``change`` may alter the frames of a cycle further; ``keep`` False keeps no results, for long runs;
    ``make_core`` takes what ``Machine`` takes.
    """
    settings = settings or BridgeSettings()
    step = step or Projection(layout.n_gauges)
    core = make_core(layout, step, settings, start=0.0, own=[OWN.key])
    composer = ResultFrames(result_layouts("fd", Identifiers(), layout.cycle_time), 1)
    sender = FaultySender(layout, faults, OWN)
    truth = Truth(layout.n_gauges, seed)
    oracle = Oracle(layout, faults, truth, step, settings)
    ears, results = Ears(sender), list[Result]()
    for number in range(n_cycles):
        time = number * layout.cycle_time
        frames = sender.cycle(number, time, *truth.cycle(number))
        if change is not None:
            frames = change(number, frames)
        new = []
        for frame in frames:
            if frame.key == OWN.key and frame.data == OWN.data:
                core.own.sending(frame)
            new += core.receive(frame)
        new += core.advance(time + 0.99 * layout.cycle_time)
        if core.bus_state is BusState.BUS_OFF and not sender.bus_off:
            core.restart(time + 0.99 * layout.cycle_time)
        for result in new:
            composer.of_result(result)  # whatever it is, it can be sent
            oracle.judge(result)
        ears.hear(new)
        if new and new[-1].causes & Cause.UNPROVEN_RESTART and not any(_lasts(fault, number) for fault in faults):
            core.confirm()  # somebody has looked at the sender
        if keep:
            results += new
        assert core.account.unaccounted == 0
    core.finish(n_cycles * layout.cycle_time)
    assert core.account.pending == 0
    return Campaign(results, core, oracle.false_valid, oracle.late_recoveries(n_cycles))


def _lasts(fault: Fault, number: int) -> bool:
    """Return whether a fault acts, or has ended shortly before."""
    return fault.start <= number < fault.start + fault.cycles + 5


class Oracle:
    """Knows the truth at every time, the frames sent and the faults, and uses nothing else."""

    def __init__(
        self, layout: InputLayout, faults: list[Fault], truth: Truth, step: Projection, settings: BridgeSettings
    ) -> None:
        self._layout, self._truth, self._step, self._settings = layout, truth, step, settings
        self._faults = sorted(faults, key=lambda fault: fault.start)
        self._first = 0
        self._tolerance = 0.5 * 0.25 * self._step.weights.sum(axis=1).max() + 1e-3
        self._valid_cycles: set[int] = set()
        self.false_valid: list[str] = []
        held_frames = [frame for frame in layout.strain_frames if frame.hold is not None]
        self._slow = [gauge for frame in held_frames for gauge in frame.gauges]
        self._every = max([cycles_apart(frame, layout.cycle_time) for frame in held_frames], default=1)

    def judge(self, result: Result) -> None:
        """Compare a result with every truth that is young enough; of a stuck gauge, with its reading."""
        if result.quality is not Quality.VALID:
            return
        now = result.time
        cycle = self._layout.cycle_time
        last = int(now / cycle + 1e-9)
        self._valid_cycles.add(last)
        oldest = max(int(np.floor((now - (self._settings.max_age + 1.5) * cycle) / cycle)), 0)
        known = {n: self._with_held([self._truth.cycle(n)[0]], oldest, last) for n in range(oldest, last + 1)}
        fits = self._fit(result, [strain for strains in known.values() for strain in strains])
        fitting = list(compress((n for n, strains in known.items() for _ in strains), fits))
        is_excused = any(self._fit(result, self._with_held(self._stuck(last, oldest), oldest, last)))
        if fitting and not is_excused:
            # The frames of a cycle begin to be sent when it is sampled.
            hidden = now - max(fitting) * cycle - result.age - result.age_uncertainty
            if hidden > (
                HIDDEN if self._layout.state is not None else 0.2 * cycle
            ):  # a constant delay counts as none
                self.false_valid.append(f"{1e3 * hidden:.3f} ms older than stated at {now:.4f} s")
        elif not is_excused:
            self.false_valid.append(f"strains at {now:.4f} s, sampled {result.sample_time}, {result.causes!r}")
        q_oldest = max(int((now - (self._settings.pressure_max_age + 1.5) * cycle) / cycle), 0)
        pressures = map(true_pressure, range(q_oldest, last + 1))
        if min(abs(result.coefficients[4] - q) for q in pressures) > 0.1:
            self.false_valid.append(f"dynamic pressure {result.coefficients[4]:.6g} Pa at {now:.4f} s")

    def _fit(self, result: Result, strains: list[np.ndarray]) -> list[bool]:
        """Return which of ``strains`` give the coefficients of a result."""
        if not strains:
            return []
        apart = np.abs(result.coefficients[:4] - self._step.projected(np.array(strains))).max(axis=1)
        return (apart <= self._tolerance).tolist()

    def _stuck(self, last: int, oldest: int) -> list[np.ndarray]:
        """Return truths with stuck gauges as they were, for as long as the documented detection of that takes."""
        held_readings, strains = self._held_readings(last), []
        for number in range(oldest, last + 1) if held_readings else ():
            strain = self._truth.cycle(number)[0].copy()
            strain[list(held_readings)] = list(held_readings.values())
            strains.append(strain)
        return strains

    def _held_readings(self, last: int) -> dict[int, float]:
        """Return the readings of stuck gauges that need not be found yet."""
        readings = {}
        for fault in self._faults_near(last):
            gauges, limit = list[int](), 0
            if fault.kind is FaultKind.STUCK_GAUGE:
                gauges = [int(np.random.default_rng(fault.seed).integers(self._layout.n_gauges))]
                limit = self._settings.stuck_cycles or MIN_STUCK_CYCLES
            elif fault.kind is FaultKind.PARTIAL_FREEZE:
                gauges = frozen_gauges(self._layout, fault)
                limit = 4 if len(gauges) > 3 else 8  # repetitions that few gauges are given
            for gauge in gauges:
                periods = (limit + 1) * self._every if gauge in self._slow else limit
                if last < fault.start + periods + self._unseen(fault, last):
                    readings[gauge] = self._truth.cycle(fault.start)[0][gauge]
        return readings

    def _with_held(self, strains: list[np.ndarray], oldest: int, last: int) -> list[np.ndarray]:
        """Return ``strains`` with every reading of the held gauges that they may be used with.

        Those of two of their own periods; of a frozen sender for as long as the documented detection takes.
        """
        if not self._slow:
            return strains
        first = max(oldest - 2 * self._every, 0)
        sampled = set(range(first, last + 1))  # which of them are sent differs after a restart
        kinds = (FaultKind.FREEZE, FaultKind.PARTIAL_FREEZE)
        limits = dict.fromkeys(kinds, 5 * self._every)
        limits[FaultKind.STUCK_GAUGE] = (MIN_STUCK_CYCLES + 1) * self._every
        near = [fault for fault in self._faults_near(last) if fault.kind in kinds]
        sampled |= {fault.start for fault in near if last < fault.start + limits[fault.kind] + self._every}
        stuck = {gauge: value for gauge, value in self._held_readings(last).items() if gauge in self._slow}
        candidates = []
        for strain in strains:
            for number in sampled:
                with_slow = strain.copy()
                with_slow[self._slow] = self._truth.cycle(number)[0][self._slow]
                candidates.append(with_slow)
                if stuck:
                    with_slow = with_slow.copy()
                    with_slow[list(stuck)] = list(stuck.values())
                    candidates.append(with_slow)
        return candidates

    def _unseen(self, fault: Fault, last: int) -> int:
        """Return the cycles since a fault began that are late behind a restart or by a delay, or may be lost."""
        late = self._settings.late_cycles + 1
        faults = self._faults_near(last)
        lost = max(
            (earlier.cycles for earlier in faults if earlier.start == fault.start and earlier.kind in LOSING),
            default=0,
        )
        creeps = [
            earlier for earlier in faults if earlier.kind is FaultKind.CREEP and earlier.is_active(fault.start)
        ]
        lost += sum(ceil(growth_of(earlier) * (last - earlier.start + 1)) for earlier in creeps)
        # Cycles that a gateway holds back are seen one after the other when it releases them.
        delays = [
            earlier for earlier in faults if earlier.kind is FaultKind.DELAY and earlier.is_active(fault.start)
        ]
        lost += sum(earlier.start + earlier.cycles - fault.start for earlier in delays)
        restarts = [earlier for earlier in faults if earlier.kind is FaultKind.RESTART]
        return lost + sum(late for delay in restarts if delay.start + late > fault.start)

    def _faults_near(self, last: int) -> list[Fault]:
        """Return the faults that have begun and whose effect may not be over."""
        while self._first < len(self._faults) and self._faults[self._first].start < last - 200:
            self._first += 1
        near = []
        for fault in self._faults[self._first :]:
            if fault.start > last:
                break
            near.append(fault)
        return near

    def late_recoveries(self, n_cycles: int) -> list[Fault]:
        """Return faults after whose end, by the stated number of cycles, results were not VALID."""
        late = []
        for fault in self._faults:
            end = fault.start + fault.cycles
            due = end + self._settings.recovery_cycles * self._every
            if self._second_sender_is_reported(due):
                continue
            if due < n_cycles and not self._valid_cycles & {due - 1, due}:
                late.append(fault)
        return late

    def _second_sender_is_reported(self, number: int) -> bool:
        """Return whether a second sender that was heard more than once is still reported, as documented."""
        kinds = (FaultKind.CONFLICT, FaultKind.RECORDING, FaultKind.REPLAY)
        shortest = alarm = self._settings.second_sender_cycles
        end, until = -inf, -inf
        for fault in self._faults:
            if fault.kind not in kinds or fault.start > number:
                continue
            since = fault.start - end
            alarm = shortest if since > 10.0 * alarm else 4.0 * alarm if since > shortest else alarm
            end = fault.start + fault.cycles
            until = max(until, end + alarm) if alarm > shortest else until
        return number <= until + 1


def run_core(layout: InputLayout, frames: list[Frame], n: int, **options: float) -> tuple[list[Result], Machine]:
    """Results and core of a bridge that got ``frames``, every one of them accounted for; options are its."""
    core = Machine(layout, Projection(n), BridgeSettings(), start=0.0, **options)
    results = [result for frame in frames for result in core.receive(frame)]
    results += core.advance(frames[-1].time + 0.5 * CYCLE)
    core.finish(frames[-1].time + CYCLE)
    assert core.account.unaccounted == 0
    return results, core
