"""Figures of the FMUs' pages: ticks, steps, and what is not finite; pages whose long tables fold."""

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from slender_vehicle import make_slender_files

from strainfmu.fmu.documentation.run_panels import Line, Panel, nice_ticks, run_figure
from strainfmu.fmu.export import export_estimator
from strainfmu.fmu.plant_export import export_autopilot, export_native_plant, export_schedule
from strainfmu.interface.plant_variables import FlightStart, Motion
from strainfmu.pages import ROWS_OPEN

pytestmark = pytest.mark.fast

START = FlightStart(mach_number=6.0, altitude=20e3, angle_of_attack=0.05)


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (0.0, 1.0, [0.0, 0.5, 1.0]),
        (-0.31, 0.29, [-0.2, 0.0, 0.2]),
        (2.0, 2.9e6, [1e6, 2e6]),
        (0.9, 1.1, [0.9, 0.95, 1.0, 1.05, 1.1]),
    ],
)
def test_ticks_are_round(low: float, high: float, ticks: list[float]) -> None:
    assert nice_ticks(low, high) == pytest.approx(ticks)


@pytest.mark.parametrize("seed", range(20))
def test_any_axis_has_some_ticks(seed: int) -> None:
    random = np.random.default_rng(seed)
    low = random.normal() * 10.0 ** random.uniform(-9, 9)
    high = low + abs(low) * 10.0 ** random.uniform(-3, 3)
    ticks = nice_ticks(low, high)
    assert 2 <= len(ticks) <= 11
    assert low - 1e-9 * abs(low) <= ticks[0] < ticks[-1] <= high + 1e-9 * abs(high)


def test_a_figure_is_whole_without_some_values() -> None:
    time = np.linspace(0.0, 1.0, 5)
    values = np.array([0.0, 1.0, np.nan, 1.0, np.inf])
    panels = [
        Panel(title="a < b", lines=[Line(name="x & y", values=values, spread=np.full(5, 0.1))]),
        Panel(title="flat", lines=[Line(name="0", values=np.zeros(5), steps=True)], words=[(0.0, "none")]),
        Panel(title="nothing", lines=[Line(name="-", values=np.full(5, np.nan))]),
    ]
    figure = run_figure(time, panels, "three panels")
    root = etree.fromstring(figure)
    lines = root.findall(".//{*}polyline")
    assert [len(line.get("points").split()) for line in lines] == [3, 9, 0]
    assert "nan" not in figure
    assert "inf" not in figure
    height = float(root.get("viewBox").split()[3])
    assert all(0.0 <= float(y) <= height for y in re.findall(r"\d,([\d.]+)", figure))


@pytest.mark.parametrize("kind", ["estimator", "inputs", "short_period", "autopilot", "schedule"])
def test_every_page_has_a_figure_and_folds_its_long_tables(tmp_path: Path, kind: str) -> None:
    files = make_slender_files(tmp_path)
    vehicle, path = tmp_path / "flight_model.h5", tmp_path / "one.fmu"
    if kind == "estimator":
        export_estimator(tmp_path / "map.h5", path)
    elif kind == "autopilot":
        export_autopilot(vehicle, path, START)
    elif kind == "schedule":
        from strainfmu.cosim.flight import scheduled_signals
        from strainfmu.cosim.models.flight_model import load_flight_model
        from strainfmu.cosim.scenario import load_scenario

        export_schedule(scheduled_signals(load_scenario(files.scenario), load_flight_model(vehicle)), path)
    else:
        export_native_plant(vehicle, path, Motion[kind.upper()], START)
    with zipfile.ZipFile(path) as archive:
        page = archive.read("documentation/index.html").decode()
    root = etree.HTML(page)
    figures = root.findall(".//{*}svg")
    assert len(figures) == 1
    assert len(figures[0].findall(".//{*}polyline")) >= (1 if kind == "schedule" else 5)
    assert len([t for t in figures[0].findall(".//{*}text") if t.get("class") == "tick"]) > 8
    tables = root.findall(".//table")
    long = [table for table in tables if len(table.findall(".//tr")) > ROWS_OPEN + 1]
    assert all(table.getparent().tag == "details" for table in long)
    assert bool(long) == (kind != "schedule")
