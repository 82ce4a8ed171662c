"""Signals of any start, length, byte order and kind: decoded and encoded as cantools does."""

import struct
from dataclasses import replace

import cantools
import numpy as np
import pytest
from can_case import CYCLE, KEY, Projection, gauge_names, layout_of
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given, settings
from hypothesis import strategies as st

from strainfmu.can.dbc_mapping import signal_layout
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import (
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
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import PROFILES, SECURED_PROFILE, profile_layout
from strainfmu.can.quality import REASONS
from strainfmu.can.signals import PLAN, SIGNAL, SLOT, SignalPlan
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("record", [SIGNAL, SLOT, PLAN])
def test_records_of_an_fmu_have_no_bytes_without_a_name(record: np.dtype) -> None:
    """A copy of a record has any bytes in such places: two exports of one map would differ."""
    assert sum(record[name].itemsize for name in record.names or ()) == record.itemsize


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
    from strainfmu.can.dbc_writer import dbc_text

    layout = layout_of("fd64").strain_frames[0].layout
    message = cantools.database.load_string(dbc_text([layout], "test"), "dbc").messages[0]
    plan = SignalPlan(layout)
    random = np.random.default_rng(3)
    for _ in range(200):
        data = random.bytes(64)
        decoded = message.decode(data, decode_choices=False)
        values = plan.physical(plan.raw(data))
        assert [decoded[signal.name] for signal in layout.signals] == values.tolist()


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


def whole_frames(name: str) -> list[FrameLayout]:
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
def test_numbers_and_values_are_those_read_bit_by_bit(name: str) -> None:
    random = np.random.default_rng(2)
    for frame in whole_frames(name):
        plan = SignalPlan(frame)
        for _ in range(50):
            data = random.bytes(frame.length)
            expected = [numbers_in(data, signal) for signal in frame.signals]
            raw = plan.raw(data)
            assert raw.tolist() == [number for number, _ in expected]
            np.testing.assert_array_equal(plan.physical(raw), [value for _, value in expected])


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
    ends, seen = (-128, 127) if signal.kind == SIGNED else (0, 255), set[bool]()
    settings = BridgeSettings(heal_cycles=1, rate_limit=1e300, sensor_range=1e300, stuck_cycles=0, zero_jump=1e300)
    step = Projection(1)
    step.sensor_range = 1e300  # type: ignore[attr-defined]  # as estimators of maps have it
    machine = Machine(layout, step, settings, start=0.0, dynamic_pressure=9e4)
    for k, number in enumerate(range(1, 1 << signal.length, 1 if signal.length == 8 else 61)):
        data = number.to_bytes(2, "little")
        results = machine.receive(Frame(identifier=1, data=data, time=CYCLE * k))
        raw, value = numbers_in(data, signal)
        low = -np.inf if signal.minimum is None else signal.minimum
        high = np.inf if signal.maximum is None else signal.maximum
        is_end = signal.kind != FLOAT and raw in ends
        is_refused = bool(is_end or raw in signal.no_value_codes or not low <= value <= high)
        if k > 3 and results:  # until then its frame is not trusted
            reason = REASONS[results[-1].reasons[0]]
            assert (reason == "no value or out of signal range") is is_refused, raw
            np.testing.assert_array_equal(results[-1].strain[0], np.nan if is_refused else value * 1e-6)
            seen.add(is_refused)
    assert seen == ({True} if signal.minimum == 0.1 else {False, True})


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
    machine = Machine(layout, Projection(54), BridgeSettings(), start=0.0)
    encoder, results = StrainEncoder(layout), []
    for k in range(6):
        frames = encoder.encode(strain, 1.25e5, cycle=k, sample_time=12.5 + CYCLE * k)
        assert len(frames) == layout.cycle_length, "all but navigation, which is not known"
        for frame in frames:
            results += machine.receive(replace(frame, time=CYCLE * k))
    assert np.flatnonzero(~results[-1].valid).tolist() == [5]
    # 0.125 um/m of 16 bits; float32 keeps 24 bits of 8191 um/m.
    tolerance = 0.126e-6
    np.testing.assert_allclose(np.delete(results[-1].strain, 5), np.delete(strain, 5), atol=tolerance)


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
