"""Strains of a whole cycle decoded at once, compared with bits that are read one by one."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest
from can_case import layout_of

from strainfmu.can.cycle.frames.assembler import Arrival
from strainfmu.can.cycle.frames.decoder import StrainDecoder
from strainfmu.can.wire.cycle_plan import CyclePlan
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import (
    BIG,
    FLOAT,
    LITTLE,
    SIGNED,
    UNSIGNED,
    FrameLayout,
    InputFrame,
    InputLayout,
    SignalLayout,
)
from strainfmu.can.wire.signal_plan import SignalPlan

pytestmark = pytest.mark.fast


def numbers_in(data: bytes, signal: SignalLayout) -> tuple[int, float]:
    """Return the raw number of a signal as int64, and its value, bit by bit."""
    word = int.from_bytes(data, "little")
    raw = sum((word >> bit & 1) << place for place, bit in enumerate(signal.bits))
    if signal.kind == FLOAT:
        code = {16: "<e", 32: "<f", 64: "<d"}[signal.length]
        value = float(struct.unpack(code, raw.to_bytes(signal.length // 8, "little"))[0])
        return raw, value * signal.scale + signal.offset
    if signal.kind == SIGNED and raw >> (signal.length - 1):
        raw -= 1 << signal.length
    value = float(raw) * signal.scale + signal.offset
    return raw - (1 << 64) if raw >> 63 == 1 else raw, value


def data_of(arrivals: list[Arrival]) -> dict[int, bytes]:
    return {arrival.slot: arrival.frame.data for arrival in arrivals}


def frames_of(name: str) -> list[FrameLayout]:
    """Return the strain frames of a profile, or two frames of signals of every kind, side by side."""
    if name != "mixed":
        return [frame.layout for frame in layout_of(name).strain_frames]
    signals = (
        SignalLayout(name="a", start=3, length=11, kind=SIGNED, scale=0.5, offset=-7.0),
        SignalLayout(name="b", start=23, length=13, byte_order=BIG, kind=UNSIGNED),
        SignalLayout(name="c", start=32, length=32, kind=FLOAT, scale=2.0),
        SignalLayout(name="d", start=64, length=64, kind=UNSIGNED),
        SignalLayout(name="e", start=135, length=16, byte_order=BIG, kind=FLOAT),
        SignalLayout(name="f", start=144, length=16, byte_order=LITTLE, kind=SIGNED),
    )
    frame = FrameLayout(name="one", identifier=1, length=20, signals=signals, is_fd=True)
    return [frame, replace(frame, name="two", identifier=2, signals=signals[::-1])]


@pytest.mark.parametrize("name", ["fd64", "classic-le", "mixed"])
def test_a_cycle_is_decoded_as_its_frames_are(name: str) -> None:
    frames = frames_of(name)
    chosen = [(f, i) for f, frame in enumerate(frames) for i in range(len(frame.signals))]
    if name == "fd64":  # the strains alone, which are of one kind
        chosen = [(f, i) for f, i in chosen if frames[f].signals[i].kind == SIGNED]
    random = np.random.default_rng(1)
    order = random.permutation(len(chosen))
    plan = CyclePlan(frames, [chosen[k] for k in order])
    for _ in range(50):
        data = [random.bytes(frame.length) for frame in frames]
        expected = [numbers_in(data[f], frames[f].signals[i]) for f, i in (chosen[k] for k in order)]
        raw = plan.raw(data)
        assert raw.tolist() == [number for number, _ in expected]
        assert raw.dtype == np.int64
        np.testing.assert_array_equal(plan.physical(raw), [value for _, value in expected])


@pytest.mark.parametrize("name", ["fd64", "classic-le", "mixed"])
def test_single_numbers_are_read_as_all_are(name: str) -> None:
    random = np.random.default_rng(2)
    for frame in frames_of(name):
        plan = SignalPlan(frame)
        for _ in range(20):
            data = random.bytes(frame.length)
            raw = [numbers_in(data, signal)[0] for signal in frame.signals]
            assert plan.raw(data).tolist() == raw
            picked = random.permutation(len(frame.signals))[:3].tolist()
            found = CyclePlan([frame], [(0, index) for index in picked]).raw([data])
            assert found.tolist() == [raw[index] for index in picked]


@pytest.mark.parametrize(
    "signal",
    [
        SignalLayout(name="s", start=0, length=8, kind=SIGNED),
        SignalLayout(name="s", start=0, length=8, minimum=3.0, maximum=200.0, not_available=255),
        SignalLayout(name="s", start=0, length=8, scale=-0.1, offset=5.0, minimum=-2.0, maximum=1.3),
        SignalLayout(name="s", start=0, length=8, not_available=100, other_no_value=(7, 101)),
        SignalLayout(name="s", start=0, length=8, minimum=0.1, maximum=0.1),
        SignalLayout(name="s", start=0, length=8, scale=1e-9, offset=1e12, maximum=1e12),
        SignalLayout(name="s", start=0, length=16, kind=FLOAT),
    ],
)
def test_what_is_refused_is_what_the_signal_forbids(signal: SignalLayout) -> None:
    """Raw numbers: outside the limits, a code for "no value", or an end of a converter's range."""
    frame = FrameLayout(name="f", identifier=1, length=2, signals=(signal,))
    item = InputFrame(layout=frame, indices=(0,), gauges=(0,), to_strain=(1e-6,))
    layout = InputLayout(name="one", n_gauges=1, strain_frames=(item,))
    decoder = StrainDecoder(layout)
    cycle, plan, seen = decoder.new_cycle(), SignalPlan(frame), set[bool]()
    ends = (-128, 127) if signal.kind == SIGNED else (0, 255)
    for number in range(0, 1 << signal.length, 1 if signal.length == 8 else 61):
        data = number.to_bytes(2, "little")
        arrival = Arrival(slot=0, frame=Frame(identifier=1, data=data), plan=plan)
        decoder.decode(data_of([arrival]), 0, cycle)
        raw, value = numbers_in(data, signal)
        low = -np.inf if signal.minimum is None else signal.minimum
        high = np.inf if signal.maximum is None else signal.maximum
        is_end = signal.kind != FLOAT and raw in ends
        assert cycle.raw[0] == raw
        np.testing.assert_array_equal(cycle.strain[0], value * 1e-6)
        assert cycle.refused[0] == (is_end or raw in signal.no_value_codes or not low <= value <= high), raw
        seen.add(bool(cycle.refused[0]))
    assert seen == ({True} if signal.minimum == 0.1 else {False, True})


def test_frames_that_are_missing_and_a_bad_status() -> None:
    layout = layout_of("classic-le", 6)
    decoder = StrainDecoder(layout)
    cycle, frames = decoder.new_cycle(), layout.strain_frames
    data = bytes(range(1, 9))
    arrivals = [
        Arrival(slot=k, frame=Frame(identifier=1, data=data, time=0.0), plan=SignalPlan(frame.layout))
        for k, frame in enumerate(frames)
    ]
    second = np.isin(np.arange(6), frames[1].gauges)
    decoder.decode(data_of(arrivals[1:]), 0, cycle)
    np.testing.assert_array_equal(cycle.present, second)
    np.testing.assert_array_equal(np.isnan(cycle.strain), ~second)
    assert not cycle.refused.any()
    decoder.decode(data_of(arrivals[1:]), 2, cycle)
    np.testing.assert_array_equal(cycle.refused, second)
    decoder.decode(data_of(arrivals), 1, cycle)
    assert cycle.present.all()
    assert not cycle.refused.any()


def test_floats_side_by_side_are_encoded_as_each_alone() -> None:
    names = ("a", "b", "c")
    signals = tuple(SignalLayout(name=n, start=8 + 40 * i, length=32, kind=FLOAT) for i, n in enumerate(names))
    header = SignalLayout(name="h", start=0, length=8)
    frame = FrameLayout(name="f", identifier=1, length=16, signals=(signals[2], header, *signals[:2]))
    alone = [SignalPlan(replace(frame, signals=(signal,))) for signal in frame.signals]
    plan = SignalPlan(frame)
    for values in ([1.5, 7.0, -2.25, 0.1], [np.nan, 255.0, np.inf, -np.inf], [1e300, 0.0, 3.4e38, -3.5e38]):
        parts = [own.encode([value]) for own, value in zip(alone, values, strict=True)]
        expected = sum(int.from_bytes(part, "little") for part in parts)
        assert int.from_bytes(plan.encode(values), "little") == expected
    with pytest.raises(ValueError, match="expected 4 values, got 3"):
        plan.encode([1.0, 2.0, 3.0])
