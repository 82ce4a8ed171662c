"""A virtual sender: samples as frames on a bus, paced by a monotonic clock, with optional faults."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.can.bridge.keepers.freshness_file import FIRST_TRIP
from strainfmu.can.e2e.clock import Clock, monotonic
from strainfmu.can.tools.fault_injection import FaultySender
from strainfmu.can.tools.faults import NEED_A_KEY, Fault, FaultKind, random_faults
from strainfmu.can.tools.strain_sources import FlownSample
from strainfmu.can.wire.frame import Frame, to_message
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.can.wire.libraries import error_line, import_can
from strainfmu.errors import InputError, StrainfmuError

SETTLING_CYCLES = 40
"""Cycles without faults at the start, in which the bridge comes to trust its input."""

FAILURES_IN_A_ROW = 200
"""Failed frames in a row after which the sender gives up."""

_SHORTEST_SLEEP = 1e-4


@dataclass(eq=False, kw_only=True)
class SentFlight:
    """Summary of a sender's run.

    Attributes
    ----------
    cycles, frames, not_sent : numbers of cycles, of frames sent and not sent; a bus may refuse a faulty frame.
    duration : [s].
    lateness : of each cycle's first frame [s].
    truth : true coefficients (5,) by cycle.
    faults : number of faults that began, by kind.
    """

    cycles: int = 0
    frames: int = 0
    not_sent: int = 0
    duration: float = 0.0
    lateness: list[float] = field(default_factory=list)
    truth: list[FloatArray] = field(default_factory=list)
    faults: Counter[str] = field(default_factory=Counter)


def send_flight(
    bus: Any,
    layout: InputLayout,
    samples: Iterable[FlownSample],
    faults: Sequence[Fault] = (),
    clock: Clock = monotonic,
    sleep: Callable[[float], None] = time.sleep,
    stopped: Callable[[], bool] = lambda: False,
    own: Frame | None = None,
    trip: int = FIRST_TRIP,
    tare_at: float | None = None,
) -> SentFlight:
    """Send one sample per cycle of ``layout`` on ``bus`` until there are no more, or ``stopped`` returns True.

    Every cycle has its own time from the start, so that delays do not add up; a late sender sends without a pause
    until it has caught up.

    Parameters
    ----------
    own : a frame of the bridge, for the fault OWN_IDENTIFIER.
    trip : trip counter of authenticated frames.
    tare_at : when a tare is asked for [s]; None for never.

    Raises
    ------
    StrainfmuError
        The bus accepts no frames any more.
    """
    sender = FaultySender(layout, list(faults), own, trip=trip)
    can = import_can()
    sent = SentFlight()
    start = clock()
    in_a_row = 0
    for cycle, sample in zip(count(), samples, strict=False):
        if stopped():
            break
        begin = cycle * layout.cycle_time
        frames = sender.cycle(
            cycle,
            begin,
            strain=sample.strain,
            dynamic_pressure=sample.dynamic_pressure,
            mach_number=sample.mach_number,
            altitude=sample.altitude,
            readings=sample.readings,
            tare_request=None if tare_at is None else int(begin >= tare_at),
        )
        for index, frame in enumerate(frames):
            wait = start + frame.time - clock()
            if wait > _SHORTEST_SLEEP:
                sleep(wait)
            if index == 0:
                sent.lateness.append(max(clock() - start - begin, 0.0))
            try:
                bus.send(to_message(frame))
            except (can.CanError, OSError, ValueError) as error:
                sent.not_sent += 1
                in_a_row += 1
                if in_a_row >= FAILURES_IN_A_ROW:
                    raise StrainfmuError(f"the bus accepts no frames: {error_line(error)}") from error
                continue
            in_a_row = 0
            sent.frames += 1
        sent.cycles += 1
        sent.truth.append(sample.truth)
        wait = start + (cycle + 1) * layout.cycle_time - clock()
        if wait > _SHORTEST_SLEEP:
            sleep(wait)
    sent.duration = clock() - start
    sent.faults = Counter(fault.kind.value for fault in faults if fault.start < sent.cycles)
    return sent


def planned_faults(
    kinds: Sequence[str], n_faults: int, seed: int, n_cycles: int, is_authenticated: bool = False
) -> list[Fault]:
    """Return ``n_faults`` faults of ``kinds`` (all that act if there are none), spread over ``n_cycles``.

    Raises
    ------
    InputError
        There is no such kind, it does not act on these frames, or the flight is too short for so many.
    """
    known = {kind.value: kind for kind in FaultKind if is_authenticated or kind not in NEED_A_KEY}
    for name in kinds:
        if name in {kind.value for kind in FaultKind} - set(known):
            raise InputError(f"fault: '{name}' acts on authenticated frames alone; state --profile fd64-sec")
        if name not in known:
            raise InputError(f"fault: expected one of {', '.join(known)}, got '{name}'")
    if n_faults == 0:
        return []
    longest = 12
    gap = (n_cycles - SETTLING_CYCLES) // n_faults - longest
    if gap < 1:
        minimum = SETTLING_CYCLES + n_faults * (longest + 1)
        raise InputError(f"faults: expected at least {minimum} cycles for {n_faults} of them, got {n_cycles}")
    chosen = tuple(known[name] for name in kinds) or tuple(known.values())
    return random_faults(n_faults, chosen, seed=seed, gap=gap, longest=longest, first=SETTLING_CYCLES)


def lateness_text(sent: SentFlight) -> str:
    """Return percentiles of the lateness as text."""
    if not sent.lateness:
        return "-"
    values = 1e3 * np.percentile(sent.lateness, (50.0, 99.0, 100.0))
    return ", ".join(f"p{p} {v:.2f}" for p, v in zip((50, 99, 100), values, strict=True)) + " ms"
