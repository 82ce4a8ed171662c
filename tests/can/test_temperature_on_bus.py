"""Temperatures from a user's DBC file: each sensor for itself, at its own period, NaN when it is lost."""

import struct
from collections.abc import Callable
from math import isnan
from typing import Any

import numpy as np
import pytest
from can_case import CYCLE, Projection

from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause, Quality
from strainfmu.cosim.estimators.step import StepResult
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

RACK = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 256 R: 8 A
 SG_ S1 : 0|16@1- (0.25,0) [0|0] "um/m" B
 SG_ S2 : 16|16@1- (0.25,0) [0|0] "um/m" B
BO_ 300 Warm: 8 A
 SG_ nose : 0|16@1+ (0.1,-50) [0|0] "degC" B
 SG_ aft : 16|16@1+ (0.1,0) [0|0] "K" B
 SG_ bare : 32|16@1+ (1,0) [0|0] "" B
VAL_ 300 nose 65000 "SNA" ;
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 10;
BA_ "GenMsgCycleTime" BO_ 300 50;
"""
BOTH = {"nose tip": "Warm.nose", "temperature[2]": "Warm.aft"}
EVERY = 5
"""Cycles from one frame of temperatures to the next."""

TRUSTED = 15
"""First cycle in which frames of temperatures are trusted: the fourth of them."""


class Warmed(Projection):
    """An estimator that takes temperatures and keeps what it was given."""

    sensor_names = ("nose tip", "aft", "fin")
    other_inputs = ("temperature[1]", "temperature[2]", "temperature[3]")

    def __init__(self) -> None:
        super().__init__(2)
        self.given: list[dict[str, float]] = []

    def __call__(  # type: ignore[override]  # a step of further inputs
        self, strain: np.ndarray, dynamic_pressure: float, step_size: float, **temperature: float
    ) -> StepResult:
        self.given.append(dict(temperature))
        return super().__call__(strain, dynamic_pressure, step_size)


def layout_of(
    temperature: dict[str, Any], names: tuple[str, ...] = Warmed.sensor_names, **more: Any
) -> InputLayout:
    mapping = {"cycle_time_ms": 10, "strain": {"g1": "R.S1", "g2": "R.S2"}, "temperature": temperature, **more}
    return mapped_layout(
        database_of(RACK, "rack.dbc"), mapping, gauge_names=("g1", "g2"), name="map.toml", sensor_names=names
    )


def flown(
    layout: InputLayout, codes: Callable[[int], tuple[int, int] | None], cycles: int = 60
) -> tuple[list[dict[str, float]], list[Result]]:
    """Send strains in every cycle and, in every fifth, ``codes`` of both temperatures where there are any.

    Returns what the estimator was given, and the results, of every cycle.
    """
    step, results = Warmed(), list[Result]()
    core = Machine(layout, step, BridgeSettings(), start=0.0, dynamic_pressure=9e4)
    for k in range(cycles):
        found = codes(k) if k % EVERY == 0 else None
        if found is not None:
            warm = struct.pack("<3H2x", *found, 0)
            results += core.receive(Frame(identifier=300, data=warm, time=k * CYCLE))
        data = struct.pack("<hh4x", 400 + 3 * k, 800 - 3 * k)
        results += core.receive(Frame(identifier=256, data=data, time=k * CYCLE))
        results += core.advance((k + 0.9) * CYCLE)
    assert core.account.unaccounted == 0
    # The estimator is not stepped until the strains are trusted.
    early: list[dict[str, float]] = [{}] * (cycles - len(step.given))
    return early + step.given, results


def unknown(given: list[dict[str, float]], name: str) -> list[int]:
    """Return the cycles without a value, from the first on in which frames are trusted."""
    return [k for k, one in enumerate(given) if k >= TRUSTED and isnan(one[name])]


def test_each_sensor_has_its_unit_and_is_held_between_its_frames() -> None:
    given, results = flown(layout_of(BOTH), lambda k: (700 + k, 3000 - k))
    for k in range(TRUSTED, 60):
        last = k - k % EVERY
        nose, aft = 0.1 * (700 + last) - 50.0 + 273.15, 0.1 * (3000 - last)
        assert given[k] == pytest.approx({"temperature[1]": nose, "temperature[2]": aft})
        assert results[k].quality is Quality.UNPROTECTED
        assert not results[k].causes


def test_a_lost_frame_is_no_temperature_after_two_of_its_periods() -> None:
    given, results = flown(layout_of(BOTH), lambda k: None if 30 <= k < 50 else (700, 3000), 80)
    lost = unknown(given, "temperature[1]")
    # The last frame is that of cycle 25, held for 100 ms.
    assert lost == list(range(35, 50))
    assert all(bool(results[k].causes & Cause.TEMPERATURE) is (k in lost) for k in range(len(results)))
    assert all(result.quality is Quality.UNPROTECTED for result in results[3:])


def test_the_mapping_states_another_time_out() -> None:
    given, _ = flown(layout_of(BOTH, timeout_ms={"Warm": 65}), lambda k: None if k >= 30 else (700, 3000))
    assert unknown(given, "temperature[1]") == list(range(32, 60))


@pytest.mark.parametrize("code", [65000, 65535, 0])
def test_a_sensor_without_a_value_is_lost_alone_and_at_once(code: int) -> None:
    given, results = flown(layout_of(BOTH), lambda k: (code if k >= 30 else 700, 3000))
    assert unknown(given, "temperature[1]") == list(range(30, 60))
    assert not unknown(given, "temperature[2]")
    assert results[30].causes == Cause.TEMPERATURE


def test_temperatures_need_not_come() -> None:
    given, results = flown(layout_of(BOTH), lambda _: None)
    assert unknown(given, "temperature[1]") == list(range(TRUSTED, 60))
    assert all(not result.causes and result.quality is Quality.UNPROTECTED for result in results[3:])


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: layout_of({"wing": "Warm.nose"}), r"temperature: expected a sensor \(nose tip, .*\), got 'wing'"),
        (
            lambda: layout_of(BOTH, names=()),
            r"expected a sensor \(none, the estimator has no temperature sensors\)",
        ),
        (
            lambda: layout_of({"aft": "Warm.aft", "temperature[2]": "Warm.nose"}),
            r"expected one signal for 'temperature\[2\]', got 2",
        ),
        (lambda: layout_of({"aft": "Warm.bare"}), r"'Warm.bare': unit: expected a unit of temperature \(K, degC"),
        (lambda: layout_of({"aft": "Warm.none"}), "no signal 'none' in frame 'Warm'"),
        (
            lambda: layout_of({"aft": "R.S1"}, units={"R.S1": "K"}),
            "expected a unit of strain|expected a frame without strains",
        ),
        (lambda: layout_of({"aft": "Warm.aft", "fin": "Warm.aft"}), r"found for both"),
        (
            lambda: layout_of(BOTH, timeout_ms={"R": 100}),
            "temperatures, sensors, thrust, parameters or slow",
        ),
    ],
)
def test_a_wrong_mapping_is_refused(make: Callable[[], InputLayout], text: str) -> None:
    with pytest.raises(InputError, match=text):
        make()
