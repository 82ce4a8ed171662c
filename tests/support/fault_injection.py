"""Seeded faults injected into a stream of strain frames, as sensors, senders, gateways and buses cause them.

A faulty sender is driven cycle by cycle, in any time: a test in virtual time and a sender on a real bus inject the
same faults.
"""

import heapq
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from math import nan

import numpy as np
from altered_frames import AlteredFrames, of_other_length, with_flipped_bits
from can_faults import Fault, FaultKind

from strainfmu.arrays import FloatArray
from strainfmu.can.authentic import FIRST_TRIP
from strainfmu.can.encoder import StrainEncoder, frame_of
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import DYNAMIC_PRESSURE, NAVIGATION, InputLayout


@dataclass(eq=False, kw_only=True)
class Sample:
    """Values of one cycle, which faults of sensors and senders change."""

    strain: FloatArray
    dynamic_pressure: float
    counter: int
    sample_time: float
    status: int = 0
    mach_number: float = nan
    altitude: float = nan
    readings: Mapping[str, float] = field(default_factory=dict)


class FaultySender:
    """Encodes cycles of strains and injects faults into them.

    Parameters
    ----------
    layout : frames to send.
    faults : in any order.
    own : a frame of the bridge, for OWN_IDENTIFIER.
    trip : trip counter of authenticated frames; a restart takes the next one.

    The first session is the trip's number, not the second of the clock: the same faults give the same bytes.
    """

    def __init__(
        self, layout: InputLayout, faults: list[Fault], own_frame: Frame | None = None, trip: int = FIRST_TRIP
    ) -> None:
        self._layout, self._own = layout, own_frame
        self._faults = sorted(faults, key=lambda fault: fault.start)
        self._next = 0
        self._active: list[Fault] = []
        self._encoder = StrainEncoder(layout, trip, session=trip)
        self._altered = AlteredFrames(layout, self._encoder)
        self._waiting: list[tuple[float, int, Frame]] = []
        self._order = count()
        self._held: dict[Fault, Sample] = {}
        self._history: list[list[Frame]] = []
        self._went_out: list[list[Frame]] = []
        self._counter_shift = 0
        self._clock_shift = 0.0
        self._release = self._queued = 0.0
        self._recordings: dict[Fault, list[list[Frame]]] = {}
        self._heard = set[Fault]()
        self.bus_off = False

    def cycle(
        self,
        number: int,
        time: float,
        strain: FloatArray,
        dynamic_pressure: float,
        *,
        mach_number: float = nan,
        altitude: float = nan,
        readings: Mapping[str, float] | None = None,
        tare_request: int | None = None,
    ) -> list[Frame]:
        """Return the frames that go out from ``time`` [s] until a cycle later, with their times, in order.

        Parameters
        ----------
        number : of the cycle; one more each call.
        strain : (n_d,) true strains [m/m].
        dynamic_pressure : true q_inf [Pa].
        mach_number, altitude : true Mach number [1] and altitude [m], NaN where the vehicle has no navigation.
        readings : of auxiliary sensors, and thrust, as of :meth:`StrainEncoder.encode`.
        tare_request : number in the frame that asks for a tare; None leaves that out.
        """
        self._activate(number)
        sample = Sample(
            strain=np.array(strain, dtype=float),
            dynamic_pressure=dynamic_pressure,
            counter=number + self._counter_shift,
            sample_time=time + self._clock_shift,
            mach_number=mach_number,
            altitude=altitude,
            readings=readings or {},
        )
        for fault in self._active:
            self._falsify(fault, number, time=time, sample=sample)
        frames = self._encoder.encode(
            sample.strain,
            sample.dynamic_pressure,
            cycle=sample.counter,
            sample_time=sample.sample_time,
            status=sample.status,
            mach_number=sample.mach_number,
            altitude=sample.altitude,
            readings=sample.readings,
            tare_request=tare_request,
        )
        spacing = 0.2 * self._layout.cycle_time / len(frames)
        frames = [replace(frame, time=time + index * spacing) for index, frame in enumerate(frames)]
        self._history.append(frames)
        del self._history[:-60]
        self.bus_off = any(fault.kind is FaultKind.BUS_OFF for fault in self._active)
        # What a second sender repeats is what has become of the first one's frames.
        for fault in sorted(self._active, key=lambda fault: fault.kind is FaultKind.CONFLICT):
            random = np.random.default_rng((fault.seed, number))
            frames = self._disturb(fault, number, time=time, frames=frames, random=random)
        if self._queued > time:
            frames = [replace(f, time=max(f.time, self._queued + 1e-6 * i)) for i, f in enumerate(frames)]
        for frame in frames:
            heapq.heappush(self._waiting, (frame.time, next(self._order), frame))
        sent = []
        while self._waiting and self._waiting[0][0] < time + self._layout.cycle_time:
            sent.append(heapq.heappop(self._waiting)[2])
        self._went_out.append(sent)
        del self._went_out[:-60]
        return sent

    def hear(self, answered: int, counter: int, time: float) -> None:
        """Take in that a result was heard at ``time`` [s], as of :meth:`StrainEncoder.hear`."""
        self._encoder.hear(answered, counter, time + self._clock_shift)

    def _activate(self, number: int) -> None:
        """Bring the list of active faults up to date."""
        self._active = [fault for fault in self._active if fault.is_active(number)]
        while self._next < len(self._faults) and self._faults[self._next].start <= number:
            fault = self._faults[self._next]
            self._next += 1
            if fault.is_active(number):
                self._active.append(fault)
        self._held = {fault: sample for fault, sample in self._held.items() if fault in self._active}

    # --- faults of sensors and senders ------------------------------------------------------------------------

    def _falsify(self, fault: Fault, number: int, time: float, sample: Sample) -> None:
        """Change the values of one cycle."""
        random = np.random.default_rng(fault.seed)
        gauge = int(random.integers(len(sample.strain)))
        first = number == fault.start
        old_sample = self._held.setdefault(fault, replace(sample, strain=sample.strain.copy()))
        match fault.kind:
            case FaultKind.FREEZE:
                sample.strain = old_sample.strain.copy()
            case FaultKind.PARTIAL_FREEZE:
                gauges = frozen_gauges(self._layout, fault)
                sample.strain[gauges] = old_sample.strain[gauges]
            case FaultKind.STUCK_GAUGE:
                sample.strain[gauge] = old_sample.strain[gauge]
            case FaultKind.ZERO_GAUGE:
                sample.strain[gauge] = 0.0
            case FaultKind.NO_VALUE:
                sample.strain[random.random(len(sample.strain)) < 0.3] = np.nan
            case FaultKind.JUMP:
                sample.strain[gauge] += 4e-3 if (number - fault.start) % 2 == 0 else -4e-3
            case FaultKind.SENDER_STATUS:
                sample.status = 2
                sample.strain *= random.normal(size=len(sample.strain))
            case FaultKind.RESTART if first:
                self._counter_shift = -number
                self._clock_shift = -time
                sample.counter, sample.sample_time = 0, 0.0
                self._encoder.begin()
            case FaultKind.CLOCK_JUMP if first and not self._restarts(number):
                self._clock_shift += float(random.uniform(5.0, 1000.0)) * self._layout.cycle_time
                sample.sample_time = time + self._clock_shift
            case FaultKind.PRESSURE_NONE:
                sample.dynamic_pressure = nan
            case FaultKind.NAVIGATION_NONE:
                sample.mach_number = sample.altitude = nan
            case _:
                return

    def _restarts(self, number: int) -> bool:
        """Return whether the sender is restarted in a cycle: a clock that has just begun does not jump."""
        return any(fault.kind is FaultKind.RESTART and fault.start == number for fault in self._active)

    # --- faults of buses and gateways ---------------------------------------------------------------------------

    def _disturb(
        self, fault: Fault, number: int, time: float, frames: list[Frame], random: np.random.Generator
    ) -> list[Frame]:
        """Change the frames of one cycle."""
        index = int(random.integers(len(frames))) if frames else 0
        end = time + self._layout.cycle_time
        match fault.kind:
            case FaultKind.LOSS:
                return [frame for frame in frames if random.random() < 0.6]
            case FaultKind.SILENCE | FaultKind.BUS_OFF:
                off = Frame(identifier=0x40, data=bytes(8), time=time, is_error=True)
                return [off] if fault.kind is FaultKind.BUS_OFF and number == fault.start else []
            case FaultKind.REPETITION:
                return sorted((f for f in frames for _ in range(int(random.integers(1, 4)))), key=lambda f: f.time)
            case FaultKind.SEQUENCE if frames:
                late = replace(frames[index], time=end + 0.05 * self._layout.cycle_time)
                return [*frames[:index], *frames[index + 1 :], late]
            case FaultKind.REPLAY:
                old = self._history[int(random.integers(len(self._history)))]
                shift = 0.5 * self._layout.cycle_time
                return [*frames, *(replace(f, time=time + shift + i * 1e-6) for i, f in enumerate(old))]
            case FaultKind.CREEP:
                delay = growth_of(fault) * (number - fault.start + 1) * self._layout.cycle_time
                self._queued = max((frame.time + delay for frame in frames), default=0.0)
                return [replace(frame, time=frame.time + delay) for frame in frames]
            case FaultKind.RECORDING:
                length = 2 + fault.seed % 50
                recorded = self._recordings.setdefault(fault, self._went_out[-length:])
                again = recorded[number - fault.start] if number - fault.start < len(recorded) else []
                return [replace(frame, time=time + i * 1e-6) for i, frame in enumerate(again)]
            case FaultKind.CONFLICT:
                # Behind the true frames until it was heard once: nobody can know of one that comes first.
                is_behind = fault not in self._heard or random.random() < 0.5
                later = 0.3 * self._layout.cycle_time if is_behind else -1e-6
                repeats = [
                    replace(frame, time=frame.time + later) for frame in self._altered.with_other_strains(frames)
                ]
                if any(frame.time < end for frame in repeats):
                    self._heard.add(fault)
                return sorted([*frames, *repeats], key=lambda frame: frame.time)
            case FaultKind.FORGERY if self._layout.is_authenticated:
                return [self._altered.forged(frame) for frame in frames]
            case FaultKind.EARLIER_RUN if self._layout.is_authenticated:
                return [self._altered.of_earlier_run(frame) for frame in frames]
            case FaultKind.MIXED_RATES if (number - fault.start) % 5 != 4:
                slow = self._layout.strain_frames[fault.seed % len(self._layout.strain_frames)]
                return [frame for frame in frames if frame.key != slow.layout.key]
            case FaultKind.PRESSURE_SILENCE:
                return self._without(frames, DYNAMIC_PRESSURE)
            case FaultKind.NAVIGATION_SILENCE:
                return self._without(frames, *NAVIGATION)
            case FaultKind.DELAY:
                self._release = max(self._release, (fault.start + fault.cycles) * self._layout.cycle_time)
                release = max(self._release, time)
                order = 1e-5 * (number - fault.start)  # in order among those held back
                return [replace(frame, time=release + order + i * 1e-6) for i, frame in enumerate(frames)]
            case FaultKind.JITTER:
                jitter = 0.4 * self._layout.cycle_time * random.random()
                return [replace(frame, time=frame.time + jitter) for frame in frames]
            case _:
                return self._insert(fault, time, frames=frames, random=random)

    def _without(self, frames: list[Frame], *quantities: str) -> list[Frame]:
        """Return ``frames`` but for those that hold one of ``quantities``."""
        of_quantities = [self._layout.frame_of(quantity) for quantity in quantities]
        keys = {frame.layout.key for frame in of_quantities if frame is not None}
        return [frame for frame in frames if frame.key not in keys]

    def _insert(self, fault: Fault, time: float, frames: list[Frame], random: np.random.Generator) -> list[Frame]:
        """Change frames one by one, or insert others."""
        arrival = time + 0.4 * self._layout.cycle_time
        known = [frame_of(item.layout, bytes(item.layout.length)) for item in self._layout.frames]
        match fault.kind:
            case FaultKind.LENGTH:
                return [replace(f, data=of_other_length(f, random)) for f in frames]
            case FaultKind.FORMAT:
                return [replace(f, is_fd=not f.is_fd) for f in frames]
            case FaultKind.IDENTIFIER_WIDTH:
                return [replace(f, is_extended=not f.is_extended) for f in frames]
            case FaultKind.CORRUPTION | FaultKind.BURST_ERROR:
                wide = fault.kind is FaultKind.CORRUPTION
                return [
                    replace(f, data=with_flipped_bits(f.data, wide, random)) if random.random() < 0.5 else f
                    for f in frames
                ]
            case FaultKind.OUT_OF_RANGE:
                return self._altered.at_end_of_range(frames, fault)
            case FaultKind.MASQUERADE | FaultKind.CONFIGURATION:
                return self._altered.of_other_sender(fault, frames)
            case FaultKind.BABBLING:
                known_frame = known[int(random.integers(len(known)))]
                garbage = [
                    replace(known_frame, data=random.bytes(len(known_frame.data)), time=arrival + i * 1e-7)
                    for i in range(200)
                ]
                return [*frames, *garbage]
            case FaultKind.UNKNOWN_IDENTIFIER:
                return [
                    *frames,
                    *(
                        Frame(identifier=0x7FF - i % 50, data=bytes(8), time=arrival + i * 1e-7)
                        for i in range(100)
                    ),
                ]
            case FaultKind.OWN_IDENTIFIER if self._own is not None:
                return [*frames, replace(self._own, time=arrival)]
            case FaultKind.SECOND_BRIDGE if self._own is not None:
                return [*frames, replace(self._own, time=arrival, data=random.bytes(len(self._own.data)))]
            case FaultKind.ERROR_FRAMES:
                return [*frames, *(replace(f, time=arrival, is_error=True, data=f.data[::-1]) for f in known)]
            case FaultKind.REMOTE_FRAMES:
                return [*frames, *(replace(f, time=arrival, is_remote=True, data=b"", is_fd=False) for f in known)]
            case _:
                return frames


def frozen_gauges(layout: InputLayout, fault: Fault) -> list[int]:
    """Return the gauges of a partial freeze: all but one by an even seed, a frame's gauges by an odd one."""
    frames = layout.strain_frames
    if fault.seed % 2 and len(frames) > 1:
        return list(frames[fault.seed // 2 % len(frames)].gauges)
    alive = fault.seed // 2 % layout.n_gauges
    return [gauge for gauge in range(layout.n_gauges) if gauge != alive]


def growth_of(fault: Fault) -> float:
    """Return by how many cycles the delay grows in each cycle of a creep."""
    return 0.02 + 0.18 * float(np.random.default_rng(fault.seed).random())
