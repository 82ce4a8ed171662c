"""Estimators with an envelope behind the bus: OUTSIDE and its cause, the same of a map and of an FMU."""

import re
import struct
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import isnan, nan
from pathlib import Path

import numpy as np
import pytest
from can_case import ACCEPTING
from scaled_maps import NOMINAL, scaled_map
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_inverse_map

from strainfmu.atmosphere import dynamic_pressure
from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.page_message import health_text
from strainfmu.can.profiles import profile_layout
from strainfmu.can.quality import Cause, Quality
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import Step, other_inputs
from strainfmu.estimator.air_inputs import LAST_INPUTS
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.contents import stated_contents

CYCLE = 0.01
NAMES = [f"G{i}" for i in range(N_GAUGES)]
MACH, ALTITUDE = 6.0, 20e3
PRESSURE = dynamic_pressure(MACH, ALTITUDE)


@pytest.fixture(scope="module")
def bounded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map in form "absolute" that knows where it holds, and the FMU of it beside."""
    folder = tmp_path_factory.mktemp("bounded")
    ranged = replace(
        synthetic_inverse_map(1),
        dynamic_pressure_range=np.array([0.5, 2.0]) * PRESSURE,
        mach_number_range=np.array([5.0, 7.0]),
        altitude_range=np.array([15e3, 25e3]),
        envelope_direction=np.eye(5),
        envelope_limit=np.full(5, 1e3),
    )
    save_inverse_map(ranged, folder / "map.h5")
    export_estimator(folder / "map.h5", folder / "estimator.fmu", ExportOptions(inputs="full"))
    return folder


def strains(n_cycles: int) -> np.ndarray:
    """Return (n_cycles, n_d) strains that fit the map."""
    inverse_map = synthetic_inverse_map(1)
    state = 1e5 * np.sin(0.05 * np.arange(n_cycles)[:, None] + np.arange(3.0))
    noise = 1e-7 * np.random.default_rng(2).normal(size=(n_cycles, N_GAUGES))
    return np.asarray(inverse_map.mean_strain + state @ inverse_map.state_operator.T + noise)


def last_result(step: Step, q: float = PRESSURE, mach_number: float = nan, altitude: float = nan) -> Result:
    layout = profile_layout("fd64", NAMES, CYCLE)
    core, encoder, results = Machine(layout, step, ACCEPTING, start=0.0), StrainEncoder(layout), []
    for k, strain in enumerate(strains(12)):
        frames = encoder.encode(
            strain, q, cycle=k, sample_time=k * CYCLE, mach_number=mach_number, altitude=altitude
        )
        for index, frame in enumerate(frames):
            results += core.receive(replace(frame, time=k * CYCLE + 1e-5 * index))
    return results[-1]


@contextmanager
def opened(folder: Path, name: str) -> Iterator[Step]:
    with open_step(folder / name) as ready:
        yield ready.step


@pytest.mark.parametrize("name", ["map.h5", "estimator.fmu"])
@pytest.mark.parametrize(
    ("flow", "health", "text"),
    [
        ({"mach_number": MACH, "altitude": ALTITUDE}, HealthState.OK, None),
        ({}, HealthState.OK, None),
        ({"mach_number": 7.5}, HealthState.OUTSIDE, "Mach number or altitude is outside"),
        ({"altitude": 30e3}, HealthState.OUTSIDE, "Mach number or altitude is outside"),
        ({"q": 1.9 * PRESSURE, "mach_number": MACH, "altitude": ALTITUDE}, HealthState.OUTSIDE, "do not agree"),
        ({"q": 2.5 * PRESSURE}, HealthState.OUTSIDE, "^the dynamic pressure is outside the map's range$"),
    ],
)
def test_a_flight_beyond_the_map_is_outside_and_never_valid(
    bounded: Path, name: str, flow: dict[str, float], health: HealthState, text: str | None
) -> None:
    with opened(bounded, name) as step:
        result = last_result(step, **flow)
    assert result.health == health
    expected = (Quality.VALID, Cause.NONE) if text is None else (Quality.SUSPECT, Cause.HEALTH)
    assert (result.quality, result.causes) == expected
    assert np.isfinite(result.coefficients).all()
    assert result.envelope_score == 0.0
    found = health_text(result, stated_contents(bounded / "estimator.fmu").envelope_score_limit)
    if text is None:
        assert found is None
    else:
        assert found is not None
        assert re.search(text, found)


def test_coefficients_beyond_the_map_are_named(bounded: Path, tmp_path: Path) -> None:
    narrow = replace(synthetic_inverse_map(1), envelope_direction=np.eye(5), envelope_limit=np.full(5, -1e3))
    save_inverse_map(narrow, tmp_path / "map.h5")
    with opened(tmp_path, "map.h5") as step:
        result = last_result(step)
    assert (result.quality, result.health) == (Quality.SUSPECT, HealthState.OUTSIDE)
    limit = stated_contents(bounded / "estimator.fmu").envelope_score_limit
    assert limit is not None
    assert result.envelope_score > limit
    assert health_text(result, limit) == "the coefficients are outside what the map covers"
    assert health_text(result, None) == "outside what the map covers"


def test_an_fmu_without_such_inputs_works_as_before(bounded: Path, tmp_path: Path) -> None:
    """The same FMU with other names for what is new: the bridge goes by the names."""
    with zipfile.ZipFile(bounded / "estimator.fmu") as whole, zipfile.ZipFile(tmp_path / "old.fmu", "w") as old:
        for entry in whole.infolist():
            content = whole.read(entry)
            if entry.filename == "modelDescription.xml":
                for name in (b'"mach_number"', b'"altitude"', b'"health.envelope_score"'):
                    assert content.count(b"name=" + name) == 1
                    content = content.replace(b"name=" + name, b'name="other.' + name[1:])
            old.writestr(entry, content)
    with opened(tmp_path, "old.fmu") as step:
        assert other_inputs(step) == ("dynamic_pressure_std", *LAST_INPUTS)
        result = last_result(step, mach_number=7.5, altitude=ALTITUDE)
    assert (result.quality, result.mach_number) == (Quality.VALID, pytest.approx(7.5))
    assert isnan(result.envelope_score)


HUGE = (
    """VERSION ""
NS_ :
BS_:
BU_: A B
"""
    + "".join(
        f'BO_ {256 + i} R{i}: 8 A\n SG_ a : 0|32@1- (1,0) [0|0] "um/m" B\n SG_ b : 32|32@1- (1,0) [0|0] "um/m" B\n'
        for i in range(3)
    )
    + """BO_ 300 Air: 8 A
 SG_ q : 0|32@1- (1,0) [0|0] "Pa" B
"""
    + "".join(f"SIG_VALTYPE_ {256 + i} {s} : 1;\n" for i in range(3) for s in "ab")
    + "SIG_VALTYPE_ 300 q : 1;\n"
)


@pytest.mark.parametrize("q", [9e9, 1.01e7, float("inf")])
def test_an_absurd_dynamic_pressure_gives_no_coefficients(synthetic: SyntheticFiles, q: float) -> None:
    mapping = {
        "cycle_time_ms": 10,
        "strain": {f"G{2 * i + j}": f"R{i}.{'ab'[j]}" for i in range(3) for j in range(2)},
        "dynamic_pressure": {"signal": "Air.q"},
    }
    layout = mapped_layout(database_of(HUGE, "x.dbc"), mapping, gauge_names=NAMES, name="map.toml")
    results: list[Result] = []
    with opened(synthetic.map_1.parent, synthetic.estimator_1.name) as step:
        core = Machine(layout, step, BridgeSettings(), start=0.0)
        for k, strain in enumerate(strains(12)):
            time, pressure = k * CYCLE, PRESSURE if k < 9 else q
            core.receive(Frame(identifier=300, data=struct.pack("<f4x", pressure), time=time))
            for i in range(3):
                data = struct.pack("<2f", *(1e6 * strain[2 * i : 2 * i + 2]))
                results += core.receive(Frame(identifier=256 + i, data=data, time=time + 1e-4 * (i + 1)))
    assert results[8].quality is Quality.UNPROTECTED
    assert results[-1].health == HealthState.NO_COEFFICIENTS
    assert results[-1].quality is Quality.INVALID
    assert results[-1].causes & Cause.DYNAMIC_PRESSURE
    assert isnan(results[-1].dynamic_pressure)
    assert np.isnan(results[-1].coefficients).all()


@pytest.mark.parametrize("name", ["map.h5", "estimator.fmu"])
def test_a_map_per_dynamic_pressure_behind_the_bus(tmp_path: Path, name: str) -> None:
    """Strains in proportion to q_inf: right at twice the nominal, outside beyond the range, nothing without."""
    n = 18
    inverse_map = replace(scaled_map(1, 3, n), dynamic_pressure_range=np.array([0.5, 3.0]) * NOMINAL)
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    if name.endswith(".fmu"):
        export_estimator(tmp_path / "map.h5", tmp_path / name, ExportOptions(inputs="full"))
    layout = profile_layout("fd64", inverse_map.gauge_names, CYCLE)
    found = {}
    with opened(tmp_path, name) as step:
        for factor in (2.0, 3.5, nan):
            core, encoder = Machine(layout, step, ACCEPTING, start=0.0), StrainEncoder(layout)
            results: list[Result] = []
            for k in range(12):
                strain = 2.0 * inverse_map.mean_strain + 1e-6 * np.random.default_rng(k).normal(size=n)
                for frame in encoder.encode(strain, factor * NOMINAL, cycle=k, sample_time=k * CYCLE):
                    results += core.receive(replace(frame, time=k * CYCLE))
            found[factor] = results[-1]
    assert [(one.health, one.quality) for one in found.values()] == [
        (HealthState.OK, Quality.VALID),
        (HealthState.OUTSIDE, Quality.SUSPECT),
        (HealthState.NO_COEFFICIENTS, Quality.INVALID),
    ]
    assert np.isfinite(found[2.0].coefficients).all()
