"""The period of the sender against the stated one, in virtual time."""

from dataclasses import replace

import numpy as np
import pytest
from can_case import CYCLE, Ears, Projection, Truth, layout_of

from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause, Quality

pytestmark = pytest.mark.fast


def sent(
    core: Machine, encoder: StrainEncoder, ears: Ears, numbers: range, begin: float, period: float
) -> list[Result]:
    """Return the answers to cycles of a sender of ``period`` [s], whose clock stands at ``begin`` [s] then."""
    truth, results = Truth(4, 1), list[Result]()
    for index, number in enumerate(numbers):
        time = begin + index * period
        strain, pressure = truth.cycle(number)
        frames = encoder.encode(strain, pressure, cycle=number, sample_time=time)
        for place, frame in enumerate(frames):
            results += ears.hear(core.receive(replace(frame, time=time + 1e-6 * place)))
    return [result for result in results if result.counter is not None]


def new_core(layout: InputLayout, tolerance: float = 0.2) -> Machine:
    return Machine(layout, Projection(4), BridgeSettings(period_tolerance=tolerance), start=0.0)


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
@pytest.mark.parametrize("period", [5e-3, 20e-3])
def test_another_period_than_the_stated_one_is_unconfirmed_until_it_agrees(profile: str, period: float) -> None:
    layout = layout_of(profile, 4)
    core, encoder = new_core(layout), StrainEncoder(layout)
    ears = Ears(encoder)
    results = sent(core, encoder, ears, range(80), 0.0, period)
    assert {result.quality for result in results[34:]} == {Quality.UNCONFIRMED}
    assert all(result.causes & Cause.PERIOD for result in results[34:])
    assert core.period_text == f"period: expected 10 ms, measured {1e3 * period:g} ms"
    results = sent(core, encoder, ears, range(80, 180), 80 * period, CYCLE)
    assert {result.quality for result in results[40:]} == {Quality.VALID}
    assert core.period_text == "period: measured 10 ms, as expected"


def test_a_period_within_the_tolerance_is_valid() -> None:
    layout = layout_of("fd64", 4)
    for tolerance, quality in ((0.2, Quality.VALID), (0.05, Quality.UNCONFIRMED)):
        core, encoder = new_core(layout, tolerance), StrainEncoder(layout)
        assert sent(core, encoder, Ears(encoder), range(60), 0.0, 1.1 * CYCLE)[-1].quality is quality
        assert core.period_text.endswith("11 ms, as expected") is (tolerance > 0.1)


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
    assert core.period_text == "period: measured 10 ms, as expected"


@pytest.mark.parametrize(
    ("period", "bunch", "is_wrong"), [(0.01, 1, False), (0.01, 4, False), (0.02, 2, True), (0.005, 2, True)]
)
def test_times_of_reception_give_the_period_where_nothing_else_does(
    period: float, bunch: int, is_wrong: bool
) -> None:
    timed = layout_of("fd64", 4)
    frames = tuple(replace(frame, sample_time=None) for frame in timed.strain_frames)
    layout = replace(timed, state=None, strain_frames=frames)
    core, encoder, truth, results = new_core(layout), StrainEncoder(layout), Truth(4, 1), []
    for number in range(80):
        time = (number // bunch) * bunch * period + 1e-4 * (number % bunch)
        for frame in encoder.encode(*truth.cycle(number), cycle=number, sample_time=0.0):
            results += core.receive(replace(frame, time=time))
    assert bool(results[-1].causes & Cause.PERIOD) is is_wrong


def test_few_cycles_state_no_period() -> None:
    layout = layout_of("fd64", 4)
    core, encoder = new_core(layout), StrainEncoder(layout)
    results = sent(core, encoder, Ears(encoder), range(15), 0.0, 2 * CYCLE)
    assert not any(result.causes & Cause.PERIOD for result in results)
    assert core.period_text == ""
