"""Rolling moment and section loads on the bus: frames of their own behind the others."""

import csv
from dataclasses import replace
from pathlib import Path

import can
import cantools
import numpy as np
import pytest
from can_case import CYCLE, bus_options
from composed_frames import ResultFrames
from other_load_maps import STATIONS, groups_at, with_own_further
from page_results import altered
from scaled_maps import NOMINAL, scaled_map

from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame, to_message
from strainfmu.can.machine import Result
from strainfmu.can.options import BridgeOptions
from strainfmu.can.profiles import Identifiers, profile_layout
from strainfmu.can.quality import Quality
from strainfmu.can.replay import estimate_log
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.setup import make_machine, write_dbc
from strainfmu.cosim.estimators.source import open_step
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.estimator.other_loads import SECTIONS as FAMILY
from strainfmu.fmu.export import ExportOptions, export_estimator

pytestmark = pytest.mark.fast

FORMS = ("fd", "classic-le")
SECTIONS = [f"section_{name}_{i}" for name in (load.key for load in FAMILY.loads) for i in (1, 2, 3)]


@pytest.mark.parametrize("form", FORMS)
def test_frames_of_an_estimator_without_such_loads_are_as_before(form: str) -> None:
    before = result_layouts(form, Identifiers(), CYCLE)
    after = result_layouts(form, Identifiers(), CYCLE, groups_at(STATIONS))
    assert after[: len(before)] == before
    assert len(before) == (3 if form == "fd" else 9)
    assert len(after) - len(before) == (4 if form == "fd" else 1 + 6 * 3)
    assert len({frame.key for frame in after}) == len({frame.protection for frame in after}) == len(after)
    alone = result_layouts(form, Identifiers(), CYCLE, groups_at([]))
    assert [frame.name for frame in alone[len(before) :]] == ["RollingMoment"]


@pytest.mark.parametrize(
    ("profile", "source"),
    [("fd64", "map.h5"), ("fd64", "e.fmu"), ("classic-le", "map.h5")],
)
def test_the_bus_holds_what_python_estimates(profile: str, source: str, tmp_path: Path) -> None:
    held = with_own_further(scaled_map(2, seed=4))
    save_inverse_map(held, tmp_path / "map.h5")
    if source == "e.fmu":
        export_estimator(tmp_path / "map.h5", tmp_path / source, ExportOptions())
    write_dbc(tmp_path / source, tmp_path / "m.dbc", bus_options(profile))
    database = cantools.database.load_file(tmp_path / "m.dbc")
    options = BridgeOptions(interface="virtual", channel="loads", profile=profile, cycle_time=CYCLE)
    random = np.random.default_rng(1)
    with open_step(tmp_path / source) as ready:
        core, layouts, configuration, _ = make_machine(ready.step, options, ready.gauge_names, start=0.0)
        encoder, composer = StrainEncoder(core.layout), ResultFrames(layouts, configuration)
        results: list[Result] = []
        for k in range(8):
            strain = held.mean_strain + 1e-6 * random.normal(size=held.n_gauges)
            for frame in encoder.encode(strain, NOMINAL, k, k * CYCLE):
                results += core.receive(replace(frame, time=k * CYCLE))
    used = results[-1]
    expected = Estimator(held).step(used.strain, used.dynamic_pressure)
    values: dict = {}
    for frame in composer.of_result(used):
        values |= database.decode_message(frame.identifier, frame.data, decode_choices=False)
    is_fd = profile == "fd64"
    coefficient = [values["M_R"], values["sigma_M_R"]]
    exact = [expected.other_coefficients[0], expected.other_coefficients_std[0]]
    np.testing.assert_allclose(coefficient, exact, rtol=1e-6, atol=0.0 if is_fd else 2.51e-4)
    np.testing.assert_allclose([values[name] for name in SECTIONS], expected.other_loads[1:], rtol=2e-7)
    deviations = np.array([values[f"sigma_{name}"] for name in SECTIONS])
    std = expected.other_loads_std[1:]
    if is_fd:
        np.testing.assert_allclose(deviations, std, rtol=2e-7)
    else:
        assert deviations.tolist() == np.ceil(std).tolist(), "never smaller than they are"
    assert values["AnsweredCounter"] == used.counter


@pytest.mark.parametrize("form", FORMS)
def test_what_is_not_known_is_not_available(form: str) -> None:
    layouts = result_layouts(form, Identifiers(), CYCLE, groups_at([1.0]))
    composer = ResultFrames(layouts, 1)
    held = {"M_R": 0.25, "sigma.M_R": 0.01, "section.axial[1]": 1e3, "sigma.section.axial[1]": 2.2}
    result = Result(
        time=1.0,
        quality=Quality.VALID,
        causes=0,
        valid=np.ones(3, dtype=bool),
        strain=np.zeros(3),
        other_outputs=held,
    )
    known = decoded(layouts, composer, result)
    assert known["M_R"] == pytest.approx(0.25)
    assert known["sigma_M_R"] == pytest.approx(0.01)
    assert known["section_axial_1"] == 1e3
    assert known["sigma_section_axial_1"] == (pytest.approx(2.2) if form == "fd" else 3.0)
    assert str(known["section_torsion_1"]) == "nan", "the estimator gave none"
    beyond = altered(result, other_outputs={**held, "sigma.section.axial[1]": 7e4})
    shown = decoded(layouts, composer, beyond)["sigma_section_axial_1"]
    assert shown == 7e4 if form == "fd" else str(shown) == "NotAvailable"
    for quality in (Quality.STALE, Quality.INVALID, Quality.NO_DATA):
        nothing = decoded(layouts, composer, altered(result, quality=quality))
        for name in ("M_R", "sigma_M_R", "section_axial_1", "sigma_section_axial_1"):
            assert str(nothing[name]) in ("nan", "NotAvailable")


def decoded(layouts: tuple, composer: ResultFrames, result: Result) -> dict:
    """Return the values of all signals of a result, by cantools."""
    from strainfmu.can.dbc_writer import dbc_text

    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    values: dict = {}
    for frame in composer.of_result(result):
        values |= database.decode_message(frame.identifier, frame.data)
    return values


def test_a_log_gives_them_as_columns(tmp_path: Path) -> None:
    """Recorded by another logger: frames alone, without description and results."""
    held = with_own_further(scaled_map(2, seed=4))
    save_inverse_map(held, tmp_path / "map.h5")
    options = BridgeOptions(interface="virtual", channel="loads", cycle_time=CYCLE)
    encoder = StrainEncoder(profile_layout("fd64", held.gauge_names, cycle_time=CYCLE))
    random, estimator = np.random.default_rng(1), Estimator(held)
    with can.Logger(tmp_path / "run.asc") as logger:
        for k in range(12):
            strain = held.mean_strain + 1e-6 * random.normal(size=held.n_gauges)
            for i, frame in enumerate(encoder.encode(strain, NOMINAL, k, k * CYCLE)):
                logger(with_time(frame, 100.0 + k * CYCLE + 1e-4 * i))
    estimate_log(tmp_path / "map.h5", tmp_path / "run.asc", tmp_path / "e.csv", options=lambda _: options)
    with (tmp_path / "e.csv").open(encoding="utf-8") as lines:
        rows = [row for row in csv.reader(lines) if not row[0].startswith("#")]
    names, last = [name.partition(" [")[0] for name in rows[0]], rows[-1]
    held_back = dict(zip(names, last, strict=True))
    expected = estimator.step(quantised(strain), NOMINAL)
    assert float(held_back["M_R"]) == pytest.approx(expected.other_coefficients[0], rel=1e-6)
    assert float(held_back["sigma.section.torsion[3]"]) == pytest.approx(expected.other_loads_std[-1], rel=1e-9)
    first = dict(zip(names, rows[1], strict=True))
    assert first["quality"] != "1"
    assert first["section.axial[1]"] in ("", "nan", "NaN")


def with_time(frame: Frame, time: float) -> can.Message:
    message = to_message(frame)
    message.timestamp = time
    return message


def quantised(strain: np.ndarray) -> np.ndarray:
    """Return strains as fd64 holds them."""
    return 0.25e-6 * np.rint(strain / 0.25e-6)
