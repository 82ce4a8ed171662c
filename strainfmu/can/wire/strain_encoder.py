"""The encoder of strains into the frames of a layout, with counters and CRCs; times are the caller's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray
from strainfmu.can.wire.authenticator import authenticated, freshness_of
from strainfmu.can.wire.crc import protect
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import (
    ALTITUDE,
    DYNAMIC_PRESSURE,
    MACH_NUMBER,
    FrameLayout,
    InputFrame,
    InputLayout,
    temperature_name,
)
from strainfmu.can.wire.signal_plan import SignalPlan
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class _Sample:
    """Values of one cycle: (n_d,) strains [m/m], flow by quantity [SI], sender's clock [s], sender's status,
    number of a command."""

    strain: FloatArray
    flow: dict[str, float]
    sample_time: float
    status: int
    request: int


class StrainEncoder:
    """Composes the frames of successive cycles in the order of their transmission: flow, strains, trailer.

    A frame without q_inf is left out until something in it was known; from then on it is sent every cycle.

    Parameters
    ----------
    layout : frames to compose.
    trip : trip counter of authenticated frames; one more each start of the sender, or receivers refuse its frames.

    Raises
    ------
    InputError
        Frames are to be authenticated, and the layout has no key.
    """

    def __init__(self, layout: InputLayout, trip: int = 1) -> None:
        if layout.is_authenticated and layout.key is None:
            raise InputError(
                f"{layout.name}: frames are authenticated, and no key is given: state it as input.key"
            )
        self._layout = layout
        self.trip = trip
        self._plans = [SignalPlan(frame.layout) for frame in layout.frames]
        self._first_of_flow = len(layout.strain_frames) + (layout.trailer is not None)
        self._sent = [_holds_pressure(frame) for frame in layout.flow_frames]

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
            status=status,
            request=tare_request or 0,
        )
        layout, frames, covered = self._layout, [], b""
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
            frames.append(self._frame(len(layout.frames) - 1, sample, cycle))
        return frames

    def _frame(self, slot: int, sample: _Sample, cycle: int, covered: bytes = b"") -> Frame:
        """Return the frame number ``slot`` of the layout; its CRC is also over ``covered``."""
        item = self._layout.frames[slot]
        layout = item.layout
        values = np.array([float(s.initial or 0) * s.scale + s.offset for s in layout.signals])
        if item.indices:
            values[list(item.indices)] = sample.strain[list(item.gauges)] / np.array(item.to_strain)
        for signal in item.flow:
            values[signal.index] = (sample.flow.get(signal.quantity, nan) - signal.offset) / signal.to_si
        if item.request is not None:
            values[item.request] = sample.request
        if item.status is not None:
            values[item.status] = sample.status
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


def _holds_pressure(frame: InputFrame) -> bool:
    return any(signal.quantity == DYNAMIC_PRESSURE for signal in frame.flow)


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
