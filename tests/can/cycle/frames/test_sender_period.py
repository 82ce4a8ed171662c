"""The period of the sender against the stated one, in virtual time."""

from __future__ import annotations

from dataclasses import replace
from math import isnan

import numpy as np
import pytest
from can_case import CYCLE, Projection, Truth, layout_of

from strainfmu.can.cycle.core import BridgeCore, bridge_core
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.frames.sender_period import SenderPeriod
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.can.wire.strain_encoder import StrainEncoder

pytestmark = pytest.mark.fast


def sent(core: BridgeCore, layout: InputLayout, numbers: range, begin: float, period: float) -> list[CycleResult]:
    """Return the answers to cycles of a sender of ``period`` [s], whose clock stands at ``begin`` [s] then."""
    encoder, truth, results = StrainEncoder(layout), Truth(4, 1), []
    for index, number in enumerate(numbers):
        time = begin + index * period
        strain, pressure = truth.cycle(number)
        frames = encoder.encode(strain, pressure, cycle=number, sample_time=time)
        for place, frame in enumerate(frames):
            results += core.receive(replace(frame, time=time + 1e-6 * place))
    return [result for result in results if result.counter is not None]


def new_core(layout: InputLayout, tolerance: float = 0.2) -> BridgeCore:
    return bridge_core(layout, Projection(4), BridgeSettings(period_tolerance=tolerance), start=0.0)


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
@pytest.mark.parametrize("period", [5e-3, 20e-3])
def test_another_period_than_the_stated_one_is_unconfirmed_until_it_agrees(profile: str, period: float) -> None:
    layout = layout_of(profile, 4)
    core = new_core(layout)
    results = sent(core, layout, range(80), 0.0, period)
    assert {result.quality for result in results[34:]} == {Quality.UNCONFIRMED}
    assert all(result.causes & Cause.PERIOD for result in results[34:])
    assert core.period.text == f"period: expected 10 ms, measured {1e3 * period:g} ms"
    results = sent(core, layout, range(80, 180), 80 * period, CYCLE)
    assert {result.quality for result in results[40:]} == {Quality.VALID}
    assert core.period.text == "period: measured 10 ms, as expected"


def test_a_period_within_the_tolerance_is_valid() -> None:
    layout = layout_of("fd64", 4)
    for tolerance, quality in ((0.2, Quality.VALID), (0.05, Quality.UNCONFIRMED)):
        core = new_core(layout, tolerance)
        assert sent(core, layout, range(60), 0.0, 1.1 * CYCLE)[-1].quality is quality
        assert core.period.measured == pytest.approx(1.1 * CYCLE)


def test_lost_cycles_do_not_change_the_period() -> None:
    layout, random = layout_of("fd64", 4), np.random.default_rng(4)
    core, encoder, truth, n_results = new_core(layout), StrainEncoder(layout), Truth(4, 1), 0
    for number in np.flatnonzero(random.random(200) > 0.4).tolist():
        strain, pressure = truth.cycle(number)
        for frame in encoder.encode(strain, pressure, cycle=number, sample_time=number * CYCLE):
            for result in core.receive(replace(frame, time=number * CYCLE)):
                n_results += 1
                assert not result.causes & Cause.PERIOD
    assert n_results > 100
    assert core.period.measured == pytest.approx(CYCLE)


def test_times_of_reception_give_the_period_where_nothing_else_does() -> None:
    for period, bunch, is_wrong in ((0.01, 1, False), (0.01, 4, False), (0.02, 4, True), (0.005, 2, True)):
        measured = SenderPeriod(0.01, 0.2, tick=0.0, bits=0, modulus=0)
        for number in range(80):
            pause = 3.0 if number >= 50 else 0.0
            last = measured.take(pause + (number // bunch) * bunch * period + 1e-4 * (number % bunch), 0, -1)
        assert last is is_wrong, (period, bunch)


def test_few_cycles_state_no_period() -> None:
    measured = SenderPeriod(0.01, 0.2, tick=1e-6, bits=32, modulus=256)
    for number in range(32):
        assert not measured.take(0.0, 20_000 * number, number)
    assert isnan(measured.measured)
    assert measured.text == ""
    assert measured.take(0.0, 20_000 * 32, 32)
    measured.forget()
    assert measured.take(0.0, 0, 0), "it is wrong until a measurement agrees"
