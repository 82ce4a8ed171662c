"""Signals of any start, length, byte order and kind: decoded and encoded as cantools does."""

from __future__ import annotations

import struct
from collections import OrderedDict
from dataclasses import replace

import cantools
import numpy as np
import pytest
from can_case import CYCLE, KEY, gauge_names, layout_of
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given, settings
from hypothesis import strategies as st

from strainfmu.can.cycle.frames.decoder import StrainDecoder
from strainfmu.can.wire.dbc_signals import signal_layout
from strainfmu.can.wire.frame_layout import FLOAT, SIGNED, UNSIGNED, FrameLayout, SignalLayout
from strainfmu.can.wire.profiles import PROFILES, SECURED_PROFILE, profile_layout
from strainfmu.can.wire.signal_plan import SignalPlan
from strainfmu.can.wire.strain_encoder import StrainEncoder
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


@st.composite
def signals(draw: st.DrawFn) -> Signal:
    """Draw a signal of cantools that fits into 64 bytes."""
    is_float = draw(st.booleans())
    length = draw(st.sampled_from([16, 32, 64])) if is_float else draw(st.integers(1, 64))
    first = draw(st.integers(0, 512 - length))
    little = draw(st.booleans())
    start = first if little else 8 * (first // 8) + 7 - first % 8
    scale = draw(st.sampled_from([1, 0.25, -0.5, 1e-6, 1000]))
    return Signal(
        "s",
        start,
        length,
        "little_endian" if little else "big_endian",
        is_signed=is_float or draw(st.booleans()),
        conversion=BaseConversion.factory(scale, draw(st.sampled_from([0, -100, 0.5])), is_float=is_float),
    )


@given(signal=signals(), seed=st.integers(0, 1 << 30))
@settings(max_examples=300, deadline=None)
def test_decoding_is_that_of_cantools(signal: Signal, seed: int) -> None:
    data = np.random.default_rng(seed).bytes(64)
    message = Message(1, "m", 64, [signal], is_fd=True)
    plan = SignalPlan(FrameLayout(name="m", identifier=1, length=64, signals=(signal_layout(signal),), is_fd=True))
    expected = message.decode(data)["s"]
    raw = plan.raw(data)
    # Equal to round-off of one product and one sum; of floats, NaN and infinity as they are.
    np.testing.assert_allclose(plan.physical(raw)[0], float(expected), rtol=1e-12, atol=1e-12)


@given(signal=signals(), number=st.integers(0, (1 << 64) - 1))
@settings(max_examples=300, deadline=None)
def test_encoding_is_that_of_cantools(signal: Signal, number: int) -> None:
    message = Message(1, "m", 64, [signal], is_fd=True)
    layout = signal_layout(signal)
    plan = SignalPlan(FrameLayout(name="m", identifier=1, length=64, signals=(layout,), is_fd=True))
    if layout.kind == FLOAT:
        value = (float(number % 60000) - 30000.0) * layout.scale + layout.offset
    else:
        # Up to 52 bits a float64 is exact.
        bits = min(layout.length, 52)
        raw = number % (1 << bits) - (1 << (bits - 1) if layout.kind == SIGNED else 0)
        value = raw * layout.scale + layout.offset
    theirs = message.encode({"s": value}, strict=False)
    np.testing.assert_allclose(
        plan.physical(plan.raw(plan.encode(np.array([value]))))[0],
        float(message.decode(theirs)["s"]),
        rtol=1e-9,
        atol=1e-9 * max(abs(layout.scale), 1.0),
    )


def test_whole_frames_are_those_of_cantools() -> None:
    """27 strains and the header of fd64 side by side, 200 random frames, bit for bit."""
    from strainfmu.can.wire.dbc_writer import dbc_text

    layout = layout_of("fd64").strain_frames[0].layout
    message = cantools.database.load_string(dbc_text([layout], "test"), "dbc").messages[0]
    plan = SignalPlan(layout)
    random = np.random.default_rng(3)
    for _ in range(200):
        data = random.bytes(64)
        decoded = message.decode(data, decode_choices=False)
        values = plan.physical(plan.raw(data))
        assert [decoded[signal.name] for signal in layout.signals] == values.tolist()


@st.composite
def frames(draw: st.DrawFn) -> tuple[FrameLayout, list[float]]:
    """Draw a frame of signals one behind the other, most of them of whole bytes, and a value of each."""
    placed, end = [], 0
    values: list[float] = []
    any_number = st.one_of(
        st.integers(-300, 70_000),
        st.floats(-1e3, 1e3),
        st.sampled_from([np.nan, np.inf, -np.inf, 1e39, -0.0, 2**32 - 1, -(2**31), 3.4e38]),
    )
    for number in range(draw(st.integers(2, 7))):
        kind = draw(st.sampled_from([UNSIGNED, SIGNED, FLOAT]))
        length = draw(st.sampled_from([16, 32, 32] if kind == FLOAT else [4, 8, 16, 32]))
        is_limited = draw(st.booleans())
        placed.append(
            SignalLayout(
                name=f"s{number}",
                start=end,
                length=length,
                kind=kind,
                scale=draw(st.sampled_from([1.0, 1.0, 0.5])),
                minimum=-5.0 if is_limited else None,
                maximum=100.0 if is_limited else None,
                not_available=draw(st.sampled_from([None, 1])),
            )
        )
        end += length
        values.append(draw(any_number))
    return FrameLayout(name="m", identifier=1, length=64, signals=tuple(placed), is_fd=True), values


@given(drawn=frames())
@settings(max_examples=150, deadline=None)
def test_a_frame_is_encoded_as_its_signals_are_one_by_one(drawn: tuple[FrameLayout, list[float]]) -> None:
    layout, values = drawn
    plan, expected = SignalPlan(layout), 0
    try:
        for signal, value in zip(layout.signals, values, strict=True):
            alone = SignalPlan(replace(layout, signals=(signal,)))
            expected |= int.from_bytes(alone.encode([value]), "little")
    except InputError:
        with pytest.raises(InputError):
            plan.encode(values)
        return
    assert plan.encode(values) == expected.to_bytes(64, "little")


@given(value=st.one_of(st.floats(-65504.0, 65504.0), st.floats(-1e-4, 1e-4), st.just(np.nan)))
@settings(max_examples=200, deadline=None)
def test_floats_are_encoded_as_by_struct(value: float) -> None:
    for length, code in ((16, "<e"), (32, "<f"), (64, "<d")):
        signal = SignalLayout(name="s", start=0, length=length, kind=FLOAT)
        plan = SignalPlan(FrameLayout(name="m", identifier=1, length=8, signals=(signal,)))
        assert plan.encode([value]) == struct.pack(code, value).ljust(8, b"\0")


@given(halves=st.integers(-(1 << 53), 1 << 53), bits=st.integers(54, 64))
@settings(max_examples=200, deadline=None)
def test_halves_are_rounded_to_even_up_to_the_last_that_there_are(halves: int, bits: int) -> None:
    signal = SignalLayout(name="s", start=0, length=bits, kind=SIGNED)
    plan = SignalPlan(FrameLayout(name="m", identifier=1, length=8, signals=(signal,)))
    assert plan.raw(plan.encode([0.5 * halves]))[0] == round(0.5 * halves)


def test_what_cannot_be_encoded_is_not_available_or_refused() -> None:
    strain = SignalLayout(
        name="s",
        start=0,
        length=16,
        kind=SIGNED,
        scale=0.25,
        minimum=-8191.5,
        maximum=8191.5,
        not_available=-32768,
    )
    plan = SignalPlan(FrameLayout(name="m", identifier=1, length=8, signals=(strain,)))
    for value in (np.nan, np.inf, 8192.0, -8192.0, 1e30):
        assert plan.raw(plan.encode(np.array([value])))[0] == -32768
    assert plan.raw(plan.encode(np.array([-8191.5])))[0] == -32766
    counter = SignalPlan(
        FrameLayout(
            name="m", identifier=1, length=8, signals=(SignalLayout(name="c", start=0, length=8, kind=UNSIGNED),)
        )
    )
    with pytest.raises(InputError, match=r"'c': expected .*, got 300$"):
        counter.encode(np.array([300.0]))


@pytest.mark.parametrize(
    ("signal", "text"),
    [
        (SignalLayout(name="s", start=60, length=16), "beyond the frame"),
        (SignalLayout(name="s", start=3, length=16, byte_order="big"), None),
        (SignalLayout(name="s", start=59, length=16, byte_order="big"), "beyond the frame"),
        (SignalLayout(name="s", start=0, length=0), "0 bits"),
        (SignalLayout(name="s", start=0, length=24, kind=FLOAT), "float of 24 bits"),
        (SignalLayout(name="s", start=0, length=16, scale=0.0), "scale 0"),
        (SignalLayout(name="s", start=0, length=16, scale=float("nan")), "scale nan"),
    ],
)
def test_signals_that_cannot_be_are_refused(signal: SignalLayout, text: str | None) -> None:
    layout = FrameLayout(name="m", identifier=1, length=8, signals=(signal,))
    if text is None:
        SignalPlan(layout)
        return
    with pytest.raises(InputError, match=text):
        SignalPlan(layout)


@pytest.mark.parametrize("profile", PROFILES)
def test_profiles_carry_strains_to_half_a_quantum(profile: str) -> None:
    layout = layout_of(profile, 54)
    random = np.random.default_rng(8)
    strain = random.uniform(-8e-3, 8e-3, 54)
    strain[5] = np.nan
    frames = OrderedDict(
        (frame.key, frame) for frame in StrainEncoder(layout).encode(strain, 1.25e5, cycle=0, sample_time=12.5)
    )
    assert len(frames) == layout.cycle_length == len(layout.frames) - 1, "all but navigation, which is not known"
    from strainfmu.can.cycle.frames.assembler import Arrival
    from strainfmu.can.cycle.frames.reception import Reception
    from strainfmu.can.settings import BridgeSettings

    reception = Reception(layout, BridgeSettings())
    taken = [reception.take(frames[item.layout.key]) for item in layout.strain_frames]
    arrivals = [one for one in taken if isinstance(one, Arrival)]
    assert len(arrivals) == len(layout.strain_frames)
    decoder = StrainDecoder(layout)
    cycle = decoder.decode({one.slot: one.frame.data for one in arrivals}, 0, decoder.new_cycle())
    assert cycle.present.all()
    assert np.flatnonzero(cycle.refused).tolist() == [5]
    # 0.125 um/m of 16 bits; float32 keeps 24 bits of 8191 um/m.
    tolerance = 0.126e-6
    np.testing.assert_allclose(np.delete(cycle.strain, 5), np.delete(strain, 5), atol=tolerance)


@pytest.mark.parametrize("profile", PROFILES)
def test_no_frame_of_a_profile_passes_the_check_of_another(profile: str) -> None:
    """Each protected frame has a data ID of its own, which its CRC covers."""
    layout = profile_layout(
        profile,
        gauge_names(60),
        cycle_time=CYCLE,
        key=KEY if profile == SECURED_PROFILE else None,
        has_tare=True,
        readings={f"sensor.s{k}": "m/m" for k in range(30)},
    )
    found = [one.layout.protection.data_id for one in layout.frames if one.layout.protection is not None]
    assert len(set(found)) == len(found) > 4
