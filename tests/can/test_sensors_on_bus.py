"""Auxiliary sensors on the bus, by a mapping and by every profile: what Python estimates of the same readings.

Maps that a mapping is for have temperature sensors too.
"""

import struct
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bus_run import paced_bridge
from can_case import CYCLE, bus_options
from flight_fmu import whole_map
from flight_maps import exact_response
from scaled_maps import NOMINAL, whole_scaled_map
from sensor_maps import ROWS, with_sensors
from thermal_maps import REFERENCE, with_temperature

from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeOptions, BridgeSettings
from strainfmu.can.profiles import PROFILES
from strainfmu.can.quality import Cause, Quality
from strainfmu.can.replay import estimate_log
from strainfmu.can.sender import send_flight
from strainfmu.can.setup import input_layout, make_machine, stated_in, write_dbc
from strainfmu.can.strain_sources import FlownSample
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import StepResult
from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.files import write_bytes_atomically
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.sensor_variables import THRUST, reading_units, sensor_names, temperature_names

pytestmark = pytest.mark.fast

RACK = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 256 R: 8 A
 SG_ S1 : 0|16@1- (0.25,0) [0|0] "um/m" B
 SG_ S2 : 16|16@1- (0.25,0) [0|0] "um/m" B
BO_ 300 Aux: 8 A
 SG_ port : 0|16@1+ (0.1,0) [0|0] "kPa" B
 SG_ turn : 16|16@1- (0.01,0) [0|0] "deg/s2" B
 SG_ push : 32|16@1+ (0.5,0) [0|0] "kN" B
 SG_ bare : 48|16@1+ (1,0) [0|0] "" B
VAL_ 300 port 65000 "SNA" ;
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 10;
"""
UNITS = {"sensor.port_0_2m": "Pa", "sensor.imu_pitch": "rad/s2", "thrust": "N"}
BOTH = {"port_0.2m": "Aux.port", "sensor.imu_pitch": "Aux.turn"}
PUSH = {"signal": "Aux.push"}
TRUSTED = 4
"""First cycle in which frames of the cycle's own rate are trusted."""


class Sensing:
    """An estimator that takes auxiliary sensors and keeps what it was given."""

    reading_units = UNITS
    other_inputs = tuple(UNITS)

    def __init__(self) -> None:
        self.given: list[dict[str, float]] = []

    def __call__(self, strain: np.ndarray, pressure: float, step_size: float, **readings: float) -> StepResult:
        self.given.append(readings)
        return StepResult(np.append(strain, [0.0, 0.0, 0.0]), np.ones(5), int(HealthState.OK), 1.0)


def layout_of(sensors: dict[str, Any], units: Mapping[str, str] = UNITS, **more: Any) -> InputLayout:
    mapping = {"cycle_time_ms": 10, "strain": {"g1": "R.S1", "g2": "R.S2"}, "sensors": sensors, **more}
    return mapped_layout(
        database_of(RACK, "rack.dbc"), mapping, gauge_names=("g1", "g2"), name="map.toml", readings=units
    )


def flown(
    layout: InputLayout, codes: Callable[[int], tuple[int, int, int] | None]
) -> tuple[dict[int, dict[str, float]], list[Result]]:
    """Send strains and, ahead of them, the raw numbers of the sensors; return what was given, and the results."""
    step, results, given = Sensing(), list[Result](), dict[int, dict[str, float]]()
    core = Machine(layout, step, BridgeSettings(), start=0.0, dynamic_pressure=9e4)
    for k in range(30):
        found = codes(k)
        if found is not None:
            results += core.receive(Frame(identifier=300, data=struct.pack("<HhHH", *found, 0), time=k * CYCLE))
        data = struct.pack("<hh4x", 400 + 3 * k, 800 - 3 * k)
        results += core.receive(Frame(identifier=256, data=data, time=k * CYCLE + 1e-4))
        results += core.advance((k + 0.9) * CYCLE)
        if step.given:
            given[k] = step.given.pop()
    return given, results


def test_each_sensor_has_its_unit_and_counts_with_the_strains_of_its_cycle() -> None:
    given, results = flown(layout_of(BOTH, thrust=PUSH), lambda k: (700 + k, 10 * k - 90, 3 + k))
    for k in range(TRUSTED, 30):
        expected = 1e2 * (700 + k), np.radians(0.01 * (10 * k - 90)), 500.0 * (3 + k)
        assert given[k] == pytest.approx(dict(zip(UNITS, expected, strict=True)))
        assert results[k].quality is Quality.UNPROTECTED
        assert not results[k].causes
        assert results[k].other_inputs == given[k]


def test_a_lost_frame_is_no_reading_after_two_cycles() -> None:
    given, results = flown(layout_of(BOTH), lambda k: None if 10 <= k < 20 else (700 + k, 10, 3))
    unknown = [k for k in range(TRUSTED, 30) if np.isnan(given[k]["sensor.port_0_2m"])]
    assert unknown == list(range(11, 20))
    assert THRUST not in given[29]
    assert all(bool(result.causes & Cause.SENSOR) is (k in unknown) for k, result in enumerate(results))


@pytest.mark.parametrize("code", [65000, 65535, 0])
def test_a_sensor_without_a_value_is_lost_alone_and_at_once(code: int) -> None:
    given, _ = flown(layout_of(BOTH), lambda k: (code if k >= 10 else 700, 10 + k, 3))
    assert [k for k in range(TRUSTED, 30) if np.isnan(given[k]["sensor.port_0_2m"])] == list(range(10, 30))
    assert not any(np.isnan(given[k]["sensor.imu_pitch"]) for k in range(TRUSTED, 30))


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: layout_of({"wing": "Aux.port"}), r"sensors: expected a sensor \(port_0_2m, .*\), got 'wing'"),
        (lambda: layout_of(BOTH, units={}), r"\(none, the estimator has no auxiliary sensors\)"),
        (lambda: layout_of({}, units={}, thrust=PUSH), "thrust: expected none, the estimator does not take it"),
        (lambda: layout_of({**BOTH, "port_0_2m": "Aux.bare"}), "expected one signal for 'port_0_2m', got 2"),
        (lambda: layout_of({"port_0_2m": "Aux.bare"}), r"'Aux.bare': unit: expected a unit of .*port_0_2m \(Pa"),
        (lambda: layout_of({"imu_pitch": "R.S1"}), "expected a unit of|expected a frame without strains"),
    ],
)
def test_a_wrong_mapping_is_refused(make: Callable[[], InputLayout], text: str) -> None:
    with pytest.raises(InputError, match=text):
        make()


# --- with an estimator -------------------------------------------------------------------------------------------


def held_map(kind: str) -> InverseMap:
    if kind == "nonlinear":
        return with_sensors(whole_map())
    return with_sensors(whole_scaled_map(2, seed=4, n=24, n_states=30))


def samples_of(held: InverseMap, count: int) -> list[FlownSample]:
    """Readings that move, of which the first sensors and temperatures, or thrust, are lost in some cycles."""
    random, n, found = np.random.default_rng(1), held.n_strain_gauges, []
    names, scale = sensor_names(held), held.sensors.scale
    for k in range(count):
        row = held.mean_strain + held.noise_std * random.normal(size=held.n_gauges)
        if held.manifold is not None:
            row = exact_response(6.0, 0.03 + 1e-3 * k, 0.01, 5500.0)[: held.n_gauges]
            row = row + 2e-7 * random.normal(size=held.n_gauges)
        thrust = nan if k % 5 == 4 else 20.0 * k
        read = row * scale + np.nan_to_num(thrust) * held.sensors.thrust_response
        read[n : n + k % 3] = nan
        readings = dict(zip(names, read[n:].tolist(), strict=True)) | {THRUST: thrust}
        warm = REFERENCE + 0.5 * random.normal(size=held.thermal.n_sensors)
        warm[: k % 4] = nan
        readings |= dict(zip(temperature_names(held.thermal), warm.tolist(), strict=True))
        pressure = NOMINAL if held.manifold is None else 0.7 * 5500.0 * 36.0
        found.append(FlownSample(read[:n], pressure, np.full(5, nan), readings=readings))
    return found


def expected_of(held: InverseMap, estimator: Estimator, result: Result) -> Estimate:
    """Return what Python estimates of the strains and readings that the bridge used."""
    given = result.other_inputs
    readings = [*result.strain, *(given.get(name, nan) for name in sensor_names(held))]
    warm = [given[name] for name in temperature_names(held.thermal)]
    known = {"thrust": given.get(THRUST, 0.0)} | ({"temperature": warm} if warm else {})
    return estimator.track(np.array(readings), result.dynamic_pressure, **known)


def check_results(held: InverseMap, results: list[Result], samples: list[FlownSample]) -> None:
    """Compare the results of trusted cycles with Python's, and what they used with what was sent."""
    estimator, names = Estimator(held), sensor_names(held)
    taken = (*names, *temperature_names(held.thermal))
    trusted = [k for k, one in enumerate(results) if one.quality.has_coefficients]
    assert len(trusted) >= len(samples) - TRUSTED
    for k in trusted:
        used, sent = results[k].other_inputs, samples[k].readings
        expected = expected_of(held, estimator, results[k])
        np.testing.assert_allclose(results[k].coefficients, expected.coefficients, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(results[k].coefficients_std, expected.coefficients_std, rtol=1e-6)
        assert results[k].health == expected.health
        if k >= TRUSTED:
            np.testing.assert_allclose([used[n] for n in taken], [sent[n] for n in taken], rtol=1e-6)
            assert used[THRUST] == pytest.approx(sent[THRUST], nan_ok=True)
            # Thrust that is not known loses the sensors that it moves.
            n_lost = sum(np.isnan(sent[name]) or (np.isnan(sent[THRUST]) and "axial" in name) for name in names)
            assert (results[k].quality is Quality.DEGRADED) is bool(n_lost > 0)


def text_of(held: InverseMap) -> tuple[str, str]:
    """Return a DBC file with gauges, temperatures, sensors and thrust of ``held`` as floats, and its mapping."""
    lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: A B"]
    rows = dict.fromkeys(("strain", "temperature", "sensors", "thrust"), "")
    kinds = [("strain", "um/m", name) for name in map(str, held.gauge_names[: held.n_strain_gauges])]
    kinds += [("temperature", "K", name) for name in held.thermal.sensor_names]
    units = reading_units(held)
    names = (*ROWS, "signal")
    kinds += [
        ("thrust" if one == THRUST else "sensors", units[one].replace("1", "m/m"), name)
        for one, name in zip(units, names, strict=True)
    ]
    floats = []
    for number, (kind, unit, name) in enumerate(kinds):
        frame = f"F{number}"
        lines += [f"BO_ {256 + number} {frame}: 8 A", f' SG_ v : 0|64@1- (1,0) [0|0] "{unit}" B']
        floats.append(f"SIG_VALTYPE_ {256 + number} v : 2;")
        rows[kind] += f'"{name}" = "{frame}.v"\n'
    mapping = "cycle_time_ms = 10\n" + "".join(f"[{kind}]\n{of}" for kind, of in rows.items())
    return "\n".join([*lines, *floats, ""]), mapping


def through_core(
    source: Path, options: BridgeOptions, samples: list[FlownSample], step: Any = None
) -> list[Result]:
    results: list[Result] = []
    with open_step(source) as ready:
        core, *_ = make_machine(ready.step, options, gauge_names=ready.gauge_names, start=0.0)
        encoder = StrainEncoder(core.layout)
        for k, sample in enumerate(samples):
            frames = encoder.encode(sample.strain, sample.dynamic_pressure, k, k * CYCLE, readings=sample.readings)
            for frame in frames:
                results += core.receive(replace(frame, time=k * CYCLE))
            results += core.advance((k + 0.9) * CYCLE)
    return results


@pytest.mark.parametrize(("kind", "source"), [("linear", "map.h5"), ("nonlinear", "e.fmu")])
def test_a_mapping_estimates_as_python_does(kind: str, source: str, tmp_path: Path) -> None:
    held = with_temperature(held_map(kind))
    save_inverse_map(held, tmp_path / "map.h5")
    if source == "e.fmu":
        export_estimator(tmp_path / "map.h5", tmp_path / source, ExportOptions(platforms=["linux64"]))
    for name, text in zip(("rack.dbc", "rack.toml"), text_of(held), strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    samples = samples_of(held, 16)
    options = BridgeOptions(
        interface="virtual",
        channel="sensors",
        dbc=tmp_path / "rack.dbc",
        mapping=tmp_path / "rack.toml",
        dynamic_pressure=samples[0].dynamic_pressure,
    )
    check_results(held, through_core(tmp_path / source, options, samples), samples)


def test_a_sensor_that_is_not_mapped_is_left_out(tmp_path: Path) -> None:
    held = held_map("linear")
    save_inverse_map(held, tmp_path / "map.h5")
    text, mapping = text_of(held)
    (tmp_path / "rack.dbc").write_text(text, encoding="utf-8")
    kept = [line for line in mapping.splitlines() if not line.startswith('"port_0deg"') and "signal" not in line]
    (tmp_path / "rack.toml").write_text("\n".join(line for line in kept if line != "[thrust]"), encoding="utf-8")
    options = BridgeOptions(
        interface="virtual", channel="sensors", dbc=tmp_path / "rack.dbc", mapping=tmp_path / "rack.toml"
    )
    options = replace(options, dynamic_pressure=NOMINAL)
    last = through_core(tmp_path / "map.h5", options, samples_of(held, 10))[-1]
    assert "sensor.port_0deg" not in last.other_inputs
    assert THRUST not in last.other_inputs
    expected = expected_of(held, Estimator(held), last)
    assert not expected.valid[held.n_strain_gauges]
    np.testing.assert_allclose(last.coefficients, expected.coefficients, rtol=1e-12)
    assert last.quality is Quality.DEGRADED


@pytest.mark.parametrize("profile", PROFILES)
def test_every_profile_holds_them(profile: str, tmp_path: Path) -> None:
    held = held_map("linear")
    save_inverse_map(held, tmp_path / "map.h5")
    key = None
    if profile == "fd64-sec":
        write_bytes_atomically(key := tmp_path / "key", bytes(range(16)).hex().encode(), is_private=True)
    options = BridgeOptions(
        interface="virtual", channel="sensors", profile=profile, cycle_time=CYCLE, key_file=key, restart="accept"
    )
    samples = samples_of(held, 12)
    check_results(held, through_core(tmp_path / "map.h5", options, samples), samples)
    write_dbc(tmp_path / "map.h5", tmp_path / "m.dbc", bus_options(profile))
    text = (tmp_path / "m.dbc").read_text(encoding="cp1252")
    names, units, _ = stated_in(tmp_path / "map.h5")
    assert all(f" SG_ {name.removeprefix('sensor.')} :" in text for name in units)
    assert names == held.gauge_names[: held.n_strain_gauges]


def test_a_live_run_and_its_replay(tmp_path: Path) -> None:
    """A bridge on the virtual bus, fed by the virtual sender, and what its record gives again."""
    held = held_map("linear")
    save_inverse_map(held, tmp_path / "map.h5")
    fmu, log = tmp_path / "e.fmu", tmp_path / "run.blf"
    export_estimator(tmp_path / "map.h5", fmu, ExportOptions(platforms=["linux64"]))
    options = BridgeOptions(interface="virtual", channel="sensors-live", cycle_time=CYCLE)
    results: list[Result] = []
    samples = samples_of(held, 25)
    watched = {"record": log, "also": results.append, "publish": None, "publish_rate": 1.0}
    with paced_bridge(fmu, options, **watched) as paced:
        layout, _ = input_layout(options, *stated_in(fmu)[:2])
        sender = paced.sender(layout)
        send_flight(paced, layout, samples=samples, clock=paced.clock, sleep=paced.sleep, sender=sender)
    answered = [one for one in results if one.quality.has_coefficients]
    assert len(answered) >= 20
    estimator = Estimator(held)
    for one in answered:
        np.testing.assert_allclose(
            one.coefficients, expected_of(held, estimator, one).coefficients, rtol=1e-6, atol=1e-9
        )
    assert {name for one in answered[1:] for name in one.other_inputs} == set(reading_units(held))
    summary = estimate_log(fmu, log, tmp_path / "e.csv", options=lambda found: found or options)
    assert summary.compared == summary.equal > 20
    assert summary.results == len(answered)
