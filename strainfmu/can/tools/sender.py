"""A virtual sender: samples as frames on a bus, paced by a monotonic clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.can.bridge.keepers.freshness_file import FIRST_TRIP
from strainfmu.can.e2e.clock import Clock, monotonic
from strainfmu.can.tools.strain_sources import FlownSample
from strainfmu.can.wire.frame import Frame, to_message
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.can.wire.libraries import error_line, import_can
from strainfmu.can.wire.strain_encoder import StrainEncoder
from strainfmu.errors import StrainfmuError

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
    """

    cycles: int = 0
    frames: int = 0
    not_sent: int = 0
    duration: float = 0.0
    lateness: list[float] = field(default_factory=list)
    truth: list[FloatArray] = field(default_factory=list)


class Sender:
    """Encodes cycle after cycle: the frames of a cycle of ``layout`` follow each other within a fifth of it.

    ``trip`` is the trip counter of authenticated frames.
    """

    def __init__(self, layout: InputLayout, trip: int = FIRST_TRIP) -> None:
        self._layout, self._encoder = layout, StrainEncoder(layout, trip)

    def cycle(
        self, number: int, time: float, strain: FloatArray, dynamic_pressure: float, **given: Any
    ) -> list[Frame]:
        """Return the frames of the cycle ``number`` at ``time`` [s], with their times, in order.

        ``given`` as of :meth:`StrainEncoder.encode`.
        """
        frames = self._encoder.encode(strain, dynamic_pressure, cycle=number, sample_time=time, **given)
        spacing = 0.2 * self._layout.cycle_time / len(frames)
        return [replace(frame, time=time + index * spacing) for index, frame in enumerate(frames)]


def send_flight(
    bus: Any,
    layout: InputLayout,
    samples: Iterable[FlownSample],
    clock: Clock = monotonic,
    sleep: Callable[[float], None] = time.sleep,
    stopped: Callable[[], bool] = lambda: False,
    trip: int = FIRST_TRIP,
    tare_at: float | None = None,
    sender: Any = None,
) -> SentFlight:
    """Send one sample per cycle of ``layout`` on ``bus`` until there are no more, or ``stopped`` returns True.

    Every cycle has its own time from the start, so that delays do not add up; a late sender sends without a pause
    until it has caught up.

    Parameters
    ----------
    trip : trip counter of authenticated frames.
    tare_at : when a tare is asked for [s]; None for never.
    sender : what composes the frames, as :class:`Sender` does; None for that.

    Raises
    ------
    StrainfmuError
        The bus accepts no frames any more.
    """
    sender = sender or Sender(layout, trip)
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
    return sent


def lateness_text(sent: SentFlight) -> str:
    """Return percentiles of the lateness as text."""
    if not sent.lateness:
        return "-"
    values = 1e3 * np.percentile(sent.lateness, (50.0, 99.0, 100.0))
    return ", ".join(f"p{p} {v:.2f}" for p, v in zip((50, 99, 100), values, strict=True)) + " ms"
