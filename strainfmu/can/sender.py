"""A virtual sender: samples as frames on a bus, and the results that it hears, compared with the truth."""

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from math import isfinite
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.can.authentic import FIRST_TRIP
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame, error_line, import_can, to_message
from strainfmu.can.frame_layout import FrameLayout, InputLayout
from strainfmu.can.profiles import E2E_COUNTER
from strainfmu.can.quality import Quality
from strainfmu.can.signals import SignalPlan
from strainfmu.can.strain_sources import FlownSample
from strainfmu.errors import StrainfmuError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

_RANGE_OF_NONE = 1e-9
_ANSWERED = "AnsweredCounter"


@dataclass(kw_only=True)
class Score:
    """Estimates against truth over the cycles that were answered with coefficients.

    Attributes
    ----------
    cycles, answered, published : number of cycles sent, with a result, with coefficients.
    rms_error, mean_sigma : (5,) [1]; the error is NaN where the truth is not known.
    rms_error_of_range : (5,) over the range of the truth, NaN where it is constant.
    coverage : (5,) fraction with the truth inside 3 sigma, NaN where it is not known.
    qualities : results by quality.
    """

    cycles: int
    answered: int
    published: int
    rms_error: list[float]
    rms_error_of_range: list[float]
    mean_sigma: list[float]
    coverage: list[float]
    qualities: dict[str, int] = field(default_factory=dict)

    @property
    def has_errors(self) -> bool:
        """Whether there are results with coefficients, and a truth to compare them with."""
        return any(isfinite(error) for error in self.rms_error)


class Answers:
    """Keeps the results that are heard on a bus, in a thread of its own.

    Parameters
    ----------
    layouts : of the result frames, in any form.
    on_answer : called with the counter of the cycle that a result answers, the result's own, and the sample time
        that it states [ticks], None where its form has none.
    """

    def __init__(
        self,
        bus: Any,
        layouts: Sequence[FrameLayout],
        on_answer: Callable[[int, int, int | None], None] = lambda *_: None,
    ) -> None:
        self._bus, self._on_answer = bus, on_answer
        answering = [layout for layout in layouts if layout.cycle_time is not None]
        self._plans = {layout.identifier: SignalPlan(layout) for layout in answering}
        self._last = next(
            layout.identifier for layout in answering if _ANSWERED in [signal.name for signal in layout.signals]
        )
        self._counter = [signal.name for signal in self._plans[self._last].signals].index(E2E_COUNTER)
        self.results: list[dict[str, float]] = []
        """Values by the names of their signals; of frames of one result the last of each."""
        self._values: dict[str, float] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="CAN listener", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        can = import_can()
        while not self._stop.is_set():
            try:
                message = self._bus.recv(0.1)
            except (can.CanError, OSError, ValueError):
                continue
            if message is not None:
                self.take(message.arbitration_id, bytes(message.data))

    def take(self, identifier: int, data: bytes) -> None:
        """Take in a frame."""
        plan = self._plans.get(identifier)
        if plan is None or len(data) != plan.length:
            return
        raw = plan.raw(data)
        codes = (signal.no_value_codes for signal in plan.signals)
        known = [number not in of_signal for of_signal, number in zip(codes, raw.tolist(), strict=True)]
        values = np.where(known, plan.physical(raw), np.nan).tolist()
        self._values |= zip((signal.name for signal in plan.signals), values, strict=True)
        if identifier == self._last:
            self.results.append(dict(self._values))
            # A classic result always names a cycle; one that answers none names none that the bridge knows.
            sampled = self._values.get("SampleTime")
            if sampled is None or isfinite(sampled):
                ticks = None if sampled is None else int(sampled)
                self._on_answer(int(self._values[_ANSWERED]), int(values[self._counter]), ticks)

    def finish(self) -> list[dict[str, float]]:
        """End the thread and return all results."""
        self._stop.set()
        self._thread.join(2.0)
        return self.results


def score_answers(
    received: Sequence[Mapping[str, float]], truth: Sequence[FloatArray], modulus: int = 256
) -> Score:
    """Compare results with the truth of the cycles that they answer, which count from 0.

    Parameters
    ----------
    received : values of results by the names of their signals.
    truth : (5,) per cycle [1].
    modulus : number of values of the cycle's counter; 0: there is none, and which cycle is answered is not known.
    """
    names = (*COEFFICIENT_NAMES, *(f"sigma_{name}" for name in COEFFICIENT_NAMES))
    qualities = [Quality(int(result["Quality"])) for result in received]
    answered = [result for result, quality in zip(received, qualities, strict=True) if quality.has_coefficients]
    values = np.array([[result[name] for name in names] for result in answered]).reshape(-1, 10)
    # A counter is of the cycle next to the one answered before.
    half, steps = modulus // 2, np.diff([int(result[_ANSWERED]) for result in answered], prepend=0)
    cycles = np.cumsum((steps + half) % max(modulus, 1) - half).astype(int)
    known = (cycles >= 0) & (cycles < len(truth)) & (modulus > 0)
    used = known & np.isfinite(values).all(axis=1)
    estimate, sigma = values[used, :5], values[used, 5:]
    true = np.array(truth).reshape(-1, 5)[cycles[used]]
    error = estimate - true
    spread = np.ptp(true, axis=0) if used.any() else np.zeros(5)
    with np.errstate(invalid="ignore", divide="ignore"):
        rms = np.sqrt((error**2).mean(axis=0)) if used.any() else np.full(5, np.nan)
        of_range = np.where(spread > _RANGE_OF_NONE, rms / spread, np.nan)
    inside = (np.abs(error) <= 3.0 * sigma).mean(axis=0) if used.any() else np.full(5, np.nan)
    nothing = np.full(5, np.nan)
    return Score(
        cycles=len(truth),
        answered=len(set(cycles[known].tolist())) if modulus else len(answered),
        published=int(used.sum()),
        rms_error=rms.tolist(),
        rms_error_of_range=of_range.tolist(),
        mean_sigma=(sigma.mean(axis=0) if used.any() else nothing).tolist(),
        coverage=np.where(np.isfinite(rms), inside, np.nan).tolist(),
        qualities=dict(Counter(quality.name for quality in qualities)),
    )


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

    ``trip`` is the trip counter of authenticated frames; ``start`` is when the sender's clock began [s], by
    ``clock``.
    """

    def __init__(
        self, layout: InputLayout, trip: int = FIRST_TRIP, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._layout, self._encoder, self._clock = layout, StrainEncoder(layout, trip), clock
        self.start = clock()

    def hear(self, answered: int, counter: int, sample_time: int | None = None) -> None:
        """Take in that a result was heard just now, as of :meth:`StrainEncoder.hear`; any thread may say so."""
        self._encoder.hear(answered, counter, self._clock() - self.start, sample_time)

    def cycle(
        self, number: int, time: float, strain: FloatArray, dynamic_pressure: float, **inputs: Any
    ) -> list[Frame]:
        """Return the frames of the cycle ``number`` at ``time`` [s], with their times, in order.

        ``inputs`` as of :meth:`StrainEncoder.encode`.
        """
        frames = self._encoder.encode(strain, dynamic_pressure, cycle=number, sample_time=time, **inputs)
        spacing = 0.2 * self._layout.cycle_time / len(frames)
        return [replace(frame, time=time + index * spacing) for index, frame in enumerate(frames)]


def send_flight(
    bus: Any,
    layout: InputLayout,
    samples: Iterable[FlownSample],
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
    stopped: Callable[[], bool] = lambda: False,
    tare_at: float | None = None,
    sender: Any = None,
) -> SentFlight:
    """Send one sample per cycle of ``layout`` on ``bus`` until there are no more, or ``stopped`` returns True.

    Every cycle has its own time from the start, so that delays do not add up; a late sender sends without a pause
    until it has caught up.

    Parameters
    ----------
    tare_at : when a tare is asked for [s]; None for never.
    sender : what composes the frames, as :class:`Sender` does; None for that.

    Raises
    ------
    StrainfmuError
        The bus accepts no frames any more.
    """
    sender = sender or Sender(layout, clock=clock)
    can = import_can()
    sent = SentFlight()
    start = sender.start = clock()
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
