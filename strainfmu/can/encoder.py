"""The encoder of strains into the frames of a layout, with counters and CRCs; times are the caller's.

Profiles have a frame ahead of each cycle, ``SenderState``: number of the sender's run, and the last result that it
heard. With it a bridge bounds the age of the strains, whatever clocks do.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor, isfinite, nan

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray
from strainfmu.can.authentic import authenticated, freshness_of
from strainfmu.can.frame import Frame, protect
from strainfmu.can.frame_layout import (
    ALTITUDE,
    DYNAMIC_PRESSURE,
    MACH_NUMBER,
    FrameLayout,
    InputFrame,
    InputLayout,
    temperature_name,
)
from strainfmu.can.signals import SignalPlan
from strainfmu.errors import InputError

_SESSIONS = 1 << 16
_NONE_HEARD = (1 << 32) - 1
"""Sample time that stands for no result."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Sample:
    """Values of a cycle: (n_d,) strains [m/m], flow by quantity [SI], sender's clock [s], other numbers."""

    strain: FloatArray
    flow: dict[str, float]
    sample_time: float
    numbers: dict[str, float]


class StrainEncoder:
    """Composes the frames of successive cycles in the order of their transmission: state, flow, strains, trailer.

    A frame without q_inf is left out until something in it was known; from then on it is sent every cycle.

    Parameters
    ----------
    layout : frames to compose.
    trip : trip counter of authenticated frames; one more each start of the sender, or receivers refuse its frames.
    session : number of the sender's run, higher each time; None for the trip counter, or for seconds since 1970.

    Raises
    ------
    InputError
        Frames are to be authenticated, and the layout has no key.
    """

    def __init__(self, layout: InputLayout, trip: int = 1, session: int | None = None) -> None:
        if layout.is_authenticated and layout.key is None:
            raise InputError(
                f"{layout.name}: frames are authenticated, and no key is given: state it as input.key"
            )
        self._layout = layout
        self.trip = trip
        number = trip if layout.is_authenticated else int(time.time())
        self.session = (number if session is None else session) % _SESSIONS
        self._heard: tuple[int, int, float] | None = None
        self._ticks: dict[int, int] = {}
        self._plans = [SignalPlan(frame.layout) for frame in layout.frames]
        self._initial = [
            np.array([float(s.initial or 0) * s.scale + s.offset for s in frame.layout.signals])
            for frame in layout.frames
        ]
        self._strains = [[np.array(part) for part in (f.indices, f.gauges, f.to_strain)] for f in layout.frames]
        self._first_of_flow = len(layout.strain_frames) + (layout.trailer is not None)
        quantities = [{signal.quantity for signal in frame.flow} for frame in layout.flow_frames]
        self._sent = [DYNAMIC_PRESSURE in of_frame for of_frame in quantities]

    def begin(self) -> None:
        """Begin a new run, in which no result was heard yet."""
        self.trip, self.session = self.trip + 1, (self.session + 1) % _SESSIONS
        self._heard, self._ticks = None, {}

    def hear(self, answered: int, counter: int, when: float, sample_time: int | None = None) -> None:
        """Record that a result was heard.

        Parameters
        ----------
        answered : counter of the cycle that it answers; a result of silence answers none.
        counter : of the result itself.
        when : sender's clock [s].
        sample_time : of the strains, as the result states it [ticks]; None where its form has none. A result
            that comes after 256 cycles answers an earlier one, and is not named.
        """
        ticks = self._ticks.get(answered)
        if ticks is not None and sample_time in (None, ticks):
            self._heard = counter, ticks, when

    def encode(
        self,
        strain: ArrayLike,
        dynamic_pressure: float,
        cycle: int,
        sample_time: float,
        status: int = 0,
        *,
        mach_number: float = nan,
        altitude: float = nan,
        temperature: Sequence[float] = (),
        readings: Mapping[str, float] | None = None,
        tare_request: int | None = None,
    ) -> list[Frame]:
        """Return the frames of one cycle.

        Parameters
        ----------
        strain : (n_d,) strains [m/m], NaN for "not available".
        dynamic_pressure : q_inf [Pa], NaN for "not available".
        cycle : number of the cycle, and counter of every frame; never twice with the same trip counter.
        sample_time : sender's clock [s].
        status : 0 good, 1 degraded, 2 do not use.
        mach_number, altitude : by navigation [1] and [m], NaN for "not available".
        temperature : of the first sensors [K], NaN for "not available", as all others are.
        readings : of auxiliary sensors, and thrust [N], by name of the estimator's input; others "not available".
        tare_request : number of the command's frame; None leaves that out.

        Raises
        ------
        InputError
            A value does not fit into its signal, and the signal has no "not available".
        """
        warm = {temperature_name(k): value for k, value in enumerate(temperature, start=1)}
        sample = _Sample(
            strain=np.asarray(strain, dtype=float),
            flow={
                DYNAMIC_PRESSURE: dynamic_pressure,
                MACH_NUMBER: mach_number,
                ALTITUDE: altitude,
                **warm,
                **(readings or {}),
            },
            sample_time=sample_time,
            numbers={"status": status, "request": tare_request or 0, **self._state(cycle, sample_time)},
        )
        layout, frames, covered = self._layout, [], b""
        if layout.state is not None:
            frames.append(self._frame(layout.frames.index(layout.state), sample, cycle))
            covered = frames[0].data
        for number, item in enumerate(layout.flow_frames):
            self._sent[number] |= any(isfinite(sample.flow.get(signal.quantity, nan)) for signal in item.flow)
            if self._sent[number]:
                frames.append(self._frame(self._first_of_flow + number, sample, cycle))
        for slot, item in enumerate(layout.strain_frames):
            every = cycles_apart(item, layout.cycle_time)
            if cycle % every:
                continue
            frames.append(self._frame(slot, sample, cycle // every))
            covered += frames[-1].data
        if layout.trailer is not None:
            frames.append(self._frame(len(layout.strain_frames), sample, cycle, covered=covered))
        if layout.command is not None and tare_request is not None:
            frames.append(self._frame(layout.frames.index(layout.command), sample, cycle))
        return frames

    def _state(self, cycle: int, sample_time: float) -> dict[str, float]:
        """Return the numbers of the sender's state, and keep what a result may answer."""
        state, named = self._layout.state, self._layout.trailer or self._layout.first_of_cycle
        if state is None or named.sample_time is None:
            return {}
        clock = named.layout.signals[named.sample_time]
        self._ticks[cycle % 256] = round(sample_time / named.tick) % (1 << clock.length)
        counter, ticks, when = self._heard or (0, _NONE_HEARD, nan)
        delay = state.layout.signals[state.heard_delay or 0]
        longest = ((1 << delay.length) - 2) * delay.scale
        return {
            "session": self.session,
            "heard_counter": counter,
            "heard_time": ticks,
            # Rounded down: it was heard for that long at least.
            "heard_delay": min(floor(1e3 * (sample_time - when) / delay.scale) * delay.scale, longest)
            if isfinite(when)
            else nan,
        }

    def _frame(self, slot: int, sample: _Sample, cycle: int, covered: bytes = b"") -> Frame:
        """Return the frame number ``slot`` of the layout; its CRC is also over ``covered``."""
        item = self._layout.frames[slot]
        layout = item.layout
        values = self._initial[slot].copy()
        if item.indices:
            indices, gauges, to_strain = self._strains[slot]
            values[indices] = sample.strain[gauges] / to_strain
        for signal in item.flow:
            values[signal.index] = (sample.flow.get(signal.quantity, nan) - signal.offset) / signal.to_si
        for role, number in sample.numbers.items():
            if (index := getattr(item, role)) is not None:
                values[index] = number
        if item.sample_time is not None:
            clock = layout.signals[item.sample_time]
            ticks = round(sample.sample_time / item.tick) % (1 << clock.length)
            values[item.sample_time] = ticks * clock.scale + clock.offset
        if layout.multiplexer is not None:
            selector, number = layout.multiplexer
            values[layout.index_of(selector.name)] = number * selector.scale + selector.offset
        data = self._plans[slot].encode(values)
        if layout.protection is not None:
            data = protect(data, layout.protection, counter=cycle, covered=covered)
        if layout.secured is not None and self._layout.key is not None:
            freshness = freshness_of(self.trip, cycle)
            data = authenticated(data, layout.secured, self._layout.key, freshness=freshness)
        return frame_of(layout, data)


def cycles_apart(frame: InputFrame, cycle_time: float) -> int:
    """Return in every how many cycles of ``cycle_time`` [s] a frame of strains is sent."""
    return 1 if frame.hold is None else max(round((frame.layout.cycle_time or cycle_time) / cycle_time), 1)


def frame_of(layout: FrameLayout, data: bytes) -> Frame:
    """Return a frame of ``layout`` with ``data``."""
    return Frame(
        identifier=layout.identifier,
        data=data,
        is_extended=layout.is_extended,
        is_fd=layout.is_fd,
        bitrate_switch=layout.is_fd,
    )
