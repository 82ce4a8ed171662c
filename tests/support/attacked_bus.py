"""A bus in virtual time under several faults at once, and an oracle; neither shares code with the product.

Frames come from :mod:`documented_sender`, faults are made here of bytes and times. The oracle knows when every
payload was sampled. A VALID result is false if its strains were sampled at a time that its age and uncertainty
exclude, or if no cycle had such strains. The bridge is used through its core: frames and times in, results out.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from heapq import heappop, heappush
from itertools import count

import numpy as np
from can_case import KEY, Projection
from documented_sender import BASE, DocumentedSender, Sent, rack_text

from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import Identifiers, profile_layout
from strainfmu.can.quality import Cause, Quality

PERIOD = 0.01
N_GAUGES = 30
NAMES = [f"g{i}" for i in range(N_GAUGES)]
JITTER = 2e-4
"""Largest difference of two delays of a bus in order [s]."""

RECOVERY = 100
WAITS = Cause.UNPROVEN_RESTART | Cause.SECOND_SENDER | Cause.PERIOD | Cause.HIDDEN_DELAY | Cause.NOT_AUTHENTIC
"""Causes that say what a bridge waits for."""

SHOW_A_FREEZE = 9
"""Readings that repeat at once by chance in less than 1e-12 of all cycles: fewer do not show a freeze at once."""

Frames = list[tuple[float, Sent]]


@dataclass
class Bus:
    """What is between the vehicle and the bridge at present; faults change it.

    Attributes
    ----------
    clock, counter : what the sender adds to its time [s] and to the number of the cycle.
    delay : of the gateway [s].
    is_on : the sender sends.
    release : when the last of its frames is let go [s].
    held_codes, recorded : last readings; all frames sent.
    """

    random: np.random.Generator
    sender: DocumentedSender
    clock: float = 0.0
    counter: int = 0
    delay: float = 0.0
    is_on: bool = True
    release: float = 0.0
    held_codes: list[np.ndarray] = field(default_factory=list)
    recorded: list[Frames] = field(default_factory=list)


@dataclass
class Act:
    """One fault: from cycle ``start`` to before ``end``; ``seed`` determines what it draws."""

    kind: str
    start: int
    end: int
    size: float


@dataclass
class Found:
    """What the oracle found in a scenario."""

    acts: list[Act]
    too_old: list[str] = field(default_factory=list)
    too_young: list[str] = field(default_factory=list)
    mixed: list[str] = field(default_factory=list)
    foreign: int = 0
    unaccounted: int = 0
    cycles: int = 0
    frames: int = 0
    n_valid: int = 0
    largest_uncertainty: float = 0.0
    is_late: bool = False
    last: str = ""
    beyond: list[str] = field(default_factory=list)
    """Results VALID or DEGRADED whose strains are older than the maximum age."""


STEPS_WITH_DELAY = 11


@lru_cache(maxsize=20_000)
def codes_of(number: int, seed: int) -> np.ndarray:
    """Readings of a cycle: manoeuvres, and noise of 8 codes."""
    random = np.random.default_rng((seed, number + 1_000_000))
    slow = 2000.0 + 1200.0 * np.sin(2.0 * np.pi * number / 700.0 + np.arange(N_GAUGES))
    codes = np.round(slow + 8.0 * random.normal(size=N_GAUGES)).astype(np.int64)
    codes.flags.writeable = False
    return codes


KINDS = (
    "loss",
    "silence",
    "delay",
    "creep",
    "small step ahead",
    "large step ahead",
    "step back",
    "steps with delay",
    "restart",
    "restart under delay",
    "step under delay",
    "duplicate",
    "reorder",
    "one cycle again",
    "recording",
    "same stimulus again",
    "bit flips",
    "burst",
    "data id",
    "configuration",
    "length",
    "freeze",
    "loop",
    "foreign first",
    "foreign behind",
    "second sender",
    "stuck gauge",
    "zero gauge",
    "no value",
    "status",
    "babbling",
    "error and remote frames",
    "fast clock",
    "slow clock",
    "period",
    "jitter",
    "no pressure",
    "counter jump",
)
LONG_KINDS = ("pause", "restart behind a pause", "creep from the start")
"""Pauses of up to an hour, and a delay that grows by up to 100 ppm, through them too."""
FOREIGN = (("foreign first", -1e-4, 12), ("foreign behind", 2e-3, 12), ("second sender", 3e-3, 1))
"""Faults by a foreign sender: when its frames come [s], beside those of the true one, and in which cycles."""


def rack_layout() -> InputLayout:
    """Return the frames of the rack by its DBC file and a mapping."""
    mapping = {
        "strain": {name: f"Rack.{name}" for name in NAMES},
        "dynamic_pressure": {"signal": "Air.q"},
        "sample_time": {"Rack": "Rack.T"},
        "configuration": {"Rack": "Rack.Layout"},
    }
    return mapped_layout(database_of(rack_text(NAMES), "rack"), mapping, gauge_names=NAMES, name="rack")


class Scenario:
    """One run of some hundred cycles."""

    def __init__(
        self,
        profile: str,
        seed: int,
        acts: list[Act],
        n_cycles: int,
        settings: BridgeSettings,
        session: int | None = 7,
    ) -> None:
        self.acts, self.n_cycles, self.seed = acts, n_cycles, seed
        key = KEY if profile == "fd64-sec" else None
        if profile == "rack":
            layout, session = rack_layout(), None
        else:
            layout = profile_layout(profile, NAMES, cycle_time=PERIOD, identifiers=Identifiers(), key=key)
        step = Projection(N_GAUGES)
        self.modulus = 15 if profile == "classic-le" else 256  # of the counter of its results
        self.core: Machine = Machine(layout, step, settings, start=0.0, counters=(0, self.modulus))
        self.is_fd = profile != "classic-le"
        self.random = np.random.default_rng(seed)
        self.bus = Bus(self.random, DocumentedSender(profile, NAMES, PERIOD, session=session))
        self.foreign = DocumentedSender(profile, NAMES, PERIOD, key=bytes(16))  # it does not know the key
        self.sampled: dict[bytes, float] = {}
        self.truth: list[tuple[float, np.ndarray]] = []
        self.foreign_payloads: set[bytes] = set()
        self.wire: list[tuple[float, int, Frame]] = []
        self.order, self.answered = count(), count()
        self.found = Found(acts)
        self.time = self.paused = self.pause = 0.0
        self.max_age = settings.max_age * PERIOD
        self.slope = 1e-4 * sum(act.size for act in acts if act.kind == "creep from the start")
        self.last_fault = max((act.end for act in acts), default=0)
        self.recovered = not acts

    def begin_of(self, number: int) -> float:
        """Return when a cycle begins: pauses without a frame are no cycles."""
        return number * PERIOD + self.paused

    # --- the sender's side

    def active(self, number: int, kind: str) -> list[Act]:
        return [act for act in self.acts if act.kind == kind and act.start <= number < act.end]

    def begins(self, number: int, kind: str) -> list[Act]:
        return [act for act in self.acts if act.kind == kind and act.start == number]

    def ends(self, number: int, kind: str) -> list[Act]:
        return [act for act in self.acts if act.kind == kind and act.end == number]

    def change_clocks(self, number: int, time: float) -> None:
        bus = self.bus
        bus.delay += self.slope * PERIOD
        for act in self.begins(number, "small step ahead"):
            bus.clock += 0.0095 * act.size
        for act in self.begins(number, "large step ahead"):
            bus.clock += 0.02 + 3.0 * act.size
        for act in self.begins(number, "step back"):
            bus.clock -= 0.001 + 3.0 * act.size**2
        for act in self.active(number, "steps with delay"):
            if number - act.start < STEPS_WITH_DELAY:
                bus.clock += 0.0099 * act.size
                bus.delay += 0.0099 * act.size
        for act in self.begins(number, "step under delay"):
            bus.delay += 0.05 + 2.0 * act.size
            bus.clock += (0.05 + 2.0 * act.size) * (1.0 if act.size > 0.5 else 0.4)
        for kind in ("steps with delay", "step under delay", "restart under delay", "delay", "creep"):
            if self.ends(number, kind):
                bus.delay = 0.0
                self.drain(time)
        for act in self.begins(number, "delay"):
            bus.delay += 0.002 + 0.3 * act.size**2
        for act in self.active(number, "creep"):
            bus.delay += PERIOD * 0.05 * act.size
        if self.active(number, "fast clock"):
            bus.clock += 9e-5 * PERIOD
        if self.active(number, "slow clock"):
            bus.clock -= 9e-5 * PERIOD
        for act in self.begins(number, "counter jump"):
            bus.counter += 1 + int(40 * act.size)
        for kind in ("pause", "restart behind a pause"):
            for _ in self.begins(number, kind):
                bus.counter += round(self.pause / PERIOD)
                bus.delay += self.slope * self.pause
                if kind == "restart behind a pause":
                    self.start_again(number, time)
        for kind in ("restart", "restart under delay", "same stimulus again", "recording"):
            if self.begins(number, kind):
                bus.is_on = False
            for act in self.ends(number, kind):
                bus.is_on = True
                if kind == "recording":
                    continue
                self.start_again(number, time)
                if kind == "restart under delay":
                    bus.delay = max(bus.delay, 5.0 * act.size)

    def start_again(self, number: int, time: float) -> None:
        """Begin a new run of the sender, with clock and counter at 0."""
        self.bus.clock, self.bus.counter = -time, -number
        self.bus.sender.start()

    def drain(self, time: float) -> None:
        """Release all that the gateway holds, in order."""
        waiting = sorted(self.wire)
        self.wire = [
            (min(arrival, time + 1e-6 * k), order, frame) for k, (arrival, order, frame) in enumerate(waiting)
        ]
        self.bus.release = min(self.bus.release, time + 1e-6 * len(waiting))

    def payload(self, number: int, time: float) -> np.ndarray:
        """Readings that the sender sends; where it repeats some, they keep the time of their sampling."""
        bus = self.bus
        codes = codes_of(number, self.seed)
        self.truth.append((time, codes))
        if self.active(number, "freeze"):
            return bus.held_codes[-1]
        for act in self.active(number, "loop"):
            first = act.start - 10
            earlier = [codes_of(n, self.seed) for n in range(max(first, 0), act.start)]
            again = earlier[(number - act.start) % len(earlier)]
            self.sampled[again.tobytes()] = time  # a stimulus in a loop is as new as any
            bus.held_codes = [again]
            return again
        for act in self.active(number, "stuck gauge"):
            codes = codes.copy()
            codes[int(29 * act.size)] = codes_of(act.start, self.seed)[int(29 * act.size)]
        for act in self.active(number, "zero gauge"):
            codes = codes.copy()
            codes[int(29 * act.size)] = 0
        for act in self.active(number, "no value"):
            codes = codes.copy()
            codes[int(29 * act.size)] = -32768
        bus.held_codes = [codes]
        return codes

    def send(self, number: int) -> None:
        """Put the frames of a cycle on the wire."""
        bus, random = self.bus, self.random
        pauses = [*self.begins(number, "pause"), *self.begins(number, "restart behind a pause")]
        self.pause = sum(round(3600.0 * act.size**3 / PERIOD) * PERIOD for act in pauses)
        self.paused += self.pause
        time = self.begin_of(number)
        self.change_clocks(number, time)
        if self.active(number, "period") and number % 2:
            bus.counter -= 1
            codes_of(number, self.seed)
            return
        codes = self.payload(number, time)
        self.sampled.setdefault(codes.tobytes(), time)
        status = 2 if self.active(number, "status") else 0
        counter = number + bus.counter
        clock = time + bus.clock
        arrival = max(time + bus.delay + JITTER * 0.5 * random.random(), bus.release)
        if self.active(number, "jitter"):
            arrival = max(arrival + 0.004 * random.random(), bus.release)
        sent = [
            (arrival + 2e-5 * k, frame)
            for k, frame in enumerate(
                bus.sender.cycle(codes, 9e4 + number, counter=max(counter, 0), clock=clock, status=status)
            )
        ]
        if bus.is_on:
            bus.release = arrival + 1e-4
            bus.recorded.append(sent)
            self.put(self.altered(number, sent, max(counter, 0), clock))
        self.put(self.added(number, arrival, codes, counter, clock))

    def altered(self, number: int, sent: Frames, counter: int, clock: float) -> Frames:
        """Return the frames of the sender as faults on the way leave them."""
        random = self.random
        if self.active(number, "silence"):
            return []
        if self.active(number, "loss"):
            sent = [entry for entry in sent if random.random() > 0.4]
        if self.active(number, "no pressure"):
            sent = [entry for entry in sent if entry[1].identifier != BASE]
        if self.active(number, "data id"):
            restarted = self.bus.sender.cycle(
                codes_of(number, self.seed) + 99, 1e4, counter=counter, clock=0.0, data_id_shift=7
            )
            sent = [(time, frame) for (time, _), frame in zip(sent, restarted, strict=False)]
        if self.active(number, "configuration"):
            restarted = self.bus.sender.cycle(
                codes_of(number, self.seed)[::-1], 1e4, counter=counter, clock=clock, configured=77
            )
            sent = [(time, frame) for (time, _), frame in zip(sent, restarted, strict=False)]
        if self.active(number, "length"):
            sent = [(time, Sent(frame.identifier, frame.data[: len(frame.data) * 3 // 4])) for time, frame in sent]
        for kind, width in (("bit flips", 512), ("burst", 8)):
            if self.active(number, kind):
                sent = [(time, _flipped(frame, random, width)) for time, frame in sent]
        if self.active(number, "duplicate"):
            sent = sent + [(time + 2e-3 * random.random(), frame) for time, frame in sent]
        if self.active(number, "reorder"):
            sent = [(time + (PERIOD if random.random() < 0.3 else 0.0), frame) for time, frame in sent]
        return sent

    def added(self, number: int, arrival: float, codes: np.ndarray, counter: int, clock: float) -> Frames:
        """Return the frames of other nodes."""
        random, more = self.random, list[tuple[float, Sent]]()
        recorded = self.bus.recorded
        for kind in ("recording", "same stimulus again"):
            for act in self.active(number, kind):
                place = act.start - (40 if kind == "recording" else act.start) + (number - act.start)
                if 0 <= place < len(recorded):
                    shift = self.begin_of(number) - recorded[place][0][0]
                    more += [(time + shift, frame) for time, frame in recorded[place]]
        if self.active(number, "one cycle again") and len(recorded) > 40:
            old = recorded[int(random.integers(len(recorded) - 1))]
            more += [(arrival + 4e-3 + 1e-5 * k, frame) for k, (_, frame) in enumerate(old)]
        foreign_codes = codes_of(number, self.seed) + random.integers(-200, 200, size=codes.shape)
        for kind, lead, every in FOREIGN:
            for act in self.active(number, kind):
                if (number - act.start) % every:
                    continue
                shift = 100 if kind == "second sender" else 0
                self.foreign.session, self.foreign.heard = self.bus.sender.session, self.bus.sender.heard
                frames = self.foreign.cycle(foreign_codes, 9e4, counter=max(counter, 0) + shift, clock=clock)
                self.foreign_payloads.add(foreign_codes.tobytes())
                more += [(arrival + lead + 1e-5 * k, frame) for k, frame in enumerate(frames)]
        if self.active(number, "babbling"):
            more += [(arrival + 1e-5 * k, Sent(0x301, random.bytes(64 if self.is_fd else 8))) for k in range(20)]
        return more

    def put(self, frames: Frames) -> None:
        for time, frame in frames:
            made = Frame(
                identifier=frame.identifier,
                data=frame.data,
                time=time,
                is_fd=self.is_fd,
                bitrate_switch=self.is_fd,
            )
            heappush(self.wire, (time, next(self.order), made))

    # --- the bridge's side

    def run(self) -> Found:
        """Run the scenario; return what the oracle found."""
        for number in range(self.n_cycles):
            self.send(number)
            now = self.begin_of(number + 1)
            while self.wire and self.wire[0][0] < now - 4e-4:
                arrival, _, frame = heappop(self.wire)
                self.time = max(arrival, self.time)
                frame.time = self.time
                self.found.frames += 1
                self.judge_all(self.core.receive(frame), number)
            if self.active(number, "error and remote frames"):
                for change in ({"is_error": True}, {"is_remote": True}):
                    self.core.receive(Frame(identifier=0x301, data=b"", time=self.time, is_fd=False, **change))
            self.judge_all(self.core.advance(now - 4e-4), number)
            self.time = max(self.time, now - 4e-4)
        self.found.unaccounted = abs(self.core.account.unaccounted)
        self.found.is_late = not self.recovered
        self.found.cycles = self.n_cycles
        return self.found

    def judge_all(self, results: list[Result], number: int) -> None:
        for result in results:
            counter = next(self.answered) % self.modulus
            if self.bus.is_on and result.counter is not None and result.sample_time is not None:
                heard = result.time + self.bus.clock
                self.bus.sender.hear(result.counter, counter, heard, result.sample_time)
            self.judge(result, number)

    def judge(self, result: Result, number: int) -> None:
        findings = self.found
        findings.last = f"{result.quality.name} {result.causes!r}"
        says = number >= self.last_fault + RECOVERY and bool(result.causes & WAITS)
        if self.last_fault <= number <= self.last_fault + RECOVERY + 5:
            is_late = self.bus.delay > 5.0 * PERIOD  # for good: the strains are what they say, too old
            self.recovered |= says or is_late or result.quality is Quality.VALID
        if result.quality is Quality.DEGRADED and result.valid.any():
            self.judge_degraded(result, number)
        if result.quality is not Quality.VALID:
            return
        findings.n_valid += 1
        findings.largest_uncertainty = max(findings.largest_uncertainty, result.age_uncertainty)
        codes = np.round(result.strain / 0.25e-6).astype(np.int64)
        payload = codes.tobytes()
        sampled_at = self.sampled.get(payload)
        if sampled_at is None:
            if payload in self.foreign_payloads:
                findings.foreign += 1
                return
            sampled_at = self.nearly(codes)
            if sampled_at is None and any(act.kind.startswith("foreign") for act in self.acts):
                findings.foreign += 1  # a foreign frame beside a lost one
                return
            if sampled_at is None:
                findings.mixed.append(f"cycle {number}")
                return
        age = result.time - sampled_at
        if age > self.max_age + JITTER:
            findings.beyond.append(f"cycle {number}: VALID, true {1e3 * age:.2f} ms")
        if age > result.age + result.age_uncertainty + JITTER:
            findings.too_old.append(
                f"cycle {number}: true {1e3 * age:.2f}, stated {1e3 * result.age:.2f} +- "
                f"{1e3 * result.age_uncertainty:.2f} ms"
            )
        if age < result.age - result.age_uncertainty - JITTER:
            findings.too_young.append(
                f"cycle {number}: true {1e3 * age:.2f}, stated {1e3 * result.age:.2f} +- "
                f"{1e3 * result.age_uncertainty:.2f} ms"
            )

    def judge_degraded(self, result: Result, number: int) -> None:
        """Judge the age by the newest and the oldest time at which all readings that are used were sampled."""
        used = result.valid
        codes = np.round(result.strain[used] / 0.25e-6).astype(np.int64)
        allowed = sum(act.kind in ("stuck gauge", "zero gauge") for act in self.acts)
        times = [
            time
            for payload, time in self.sampled.items()
            if int((np.frombuffer(payload, dtype=np.int64)[used] != codes).sum()) <= allowed
        ]
        if not times:
            return
        least, most = result.time - max(times), result.time - min(times)
        stated = f"stated {1e3 * result.age:.2f} +- {1e3 * result.age_uncertainty:.2f} ms"
        if least > self.max_age + JITTER:
            self.found.beyond.append(f"cycle {number}: DEGRADED, true {1e3 * least:.2f} ms")
        if used.sum() < SHOW_A_FREEZE and any(act.kind == "freeze" for act in self.acts):
            return
        if least > result.age + result.age_uncertainty + JITTER:
            self.found.too_old.append(f"cycle {number}: DEGRADED, true {1e3 * least:.2f}, {stated}")
        if most < result.age - result.age_uncertainty - JITTER:
            self.found.too_young.append(f"cycle {number}: DEGRADED, true {1e3 * most:.2f}, {stated}")

    def nearly(self, codes: np.ndarray) -> float | None:
        """Return the time of a cycle but for gauges that are at fault and need not be found yet."""
        allowed = sum(act.kind in ("stuck gauge", "zero gauge") for act in self.acts)
        for time, sent_codes in reversed(self.truth):
            if int((sent_codes != codes).sum()) <= allowed:
                return time
        return None


def _flipped(frame: Sent, random: np.random.Generator, width: int) -> Sent:
    data = bytearray(frame.data)
    first = int(random.integers(8 * len(data) - min(width, 8)))
    for _ in range(3):
        bit = first + int(random.integers(8)) if width == 8 else int(random.integers(8 * len(data)))
        data[bit // 8] ^= 1 << bit % 8
    return Sent(frame.identifier, bytes(data))


def draw_acts(seed: int, kinds: tuple[str, ...] = KINDS, first: int = 60, longest: int = 60) -> list[Act]:
    """Return two to five faults that overlap."""
    random = np.random.default_rng((seed, 77))
    acts = []
    for _ in range(int(random.integers(2, 6))):
        kind = kinds[int(random.integers(len(kinds)))]
        start = first + int(random.integers(40))
        length = 3 + int(random.integers(longest))
        acts.append(Act(kind, start, start + length, float(random.random())))
    return acts


def run_scenario(
    profile: str, seed: int, acts: list[Act], settings: BridgeSettings | None = None, session: int | None = 7
) -> Found:
    """Run faults until the bridge has had time to recover from the last of them; return what the oracle found."""
    delay = max((500 * act.size for act in acts if act.kind == "restart under delay"), default=0)
    end = max((act.end for act in acts), default=0)
    scenario = Scenario(
        profile, seed, acts, end + int(delay) + RECOVERY + 20, settings or BridgeSettings(), session
    )
    scenario.last_fault = end + int(delay)
    return scenario.run()


def campaign(
    profile: str,
    seeds: range,
    settings: BridgeSettings | None = None,
    report: Callable[[int, Found], None] | None = None,
    kinds: tuple[str, ...] = KINDS,
    session: int | None = 7,
) -> Counter[str]:
    """Run scenarios; return counts of cycles, frames, VALID results and all that is wrong."""
    total: Counter[str] = Counter()
    for seed in seeds:
        acts = draw_acts(seed, kinds)
        result = run_scenario(profile, seed, acts, settings, session)
        total.update(
            scenarios=1,
            cycles=result.cycles,
            frames=result.frames,
            valid=result.n_valid,
            too_old=len(result.too_old),
            too_young=len(result.too_young),
            mixed=len(result.mixed),
            beyond=len(result.beyond),
            foreign=result.foreign,
            unaccounted=result.unaccounted,
            late=result.is_late,
        )
        if report is not None:
            report(seed, result)
    return total
