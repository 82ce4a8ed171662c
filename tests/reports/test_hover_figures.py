"""Figures that show their values: numbers of the report, drawn without a network; stills without plotly."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import PROGRAM, Browser
from clipping import DRAWN, set_width, show
from page_checks import assert_self_contained
from report_case import ReportCase

from builder.figures.drawing.hover import numbers
from builder.figures.drawing.unrolled import roll_degrees
from builder.figures.map import hover_gauges
from builder.reports.build_report.report import BuildReport
from builder.reports.build_report.tables import report_tables
from builder.reports.page.hover_scripts import figure_data
from builder.reports.page.html import Page, Picture, Section, page_html

pytest.importorskip("plotly")

MAX_SIZE = 6_000_000
FIGURE = re.compile(r'<script type="application/json">(.*?)</script>', re.DOTALL)


def figures(html: str) -> list[dict[str, Any]]:
    """The data of a page's figures, in order."""
    return [json.loads(text) for text in FIGURE.findall(html)]


def test_the_page_holds_plotly_once_and_stays_small(report: BuildReport, html: str) -> None:
    page = assert_self_contained(html)
    assert page.anchors.count("plotly") == 1
    assert len(html.encode()) < MAX_SIZE
    assert len(figures(html)) == (8 if report.gamma else 6)
    assert html.count('<figure class="hover">') == len(figures(html))


def test_plotly_knows_every_entry(html: str) -> None:
    from plotly.graph_objects import Figure

    for one in figures(html):
        Figure(one)


def test_without_plotly_figures_are_stills(
    report: BuildReport, page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("builder.reports.page.hover_scripts.find_spec", lambda name: None)
    found = assert_self_contained(page_html(page))
    assert "script" not in found.tags
    assert "pip install 'strainfmu[report]'" in found.text
    assert len(found.alternatives) == (10 if report.gamma else 8)


def test_figures_hold_the_numbers_of_the_tables(report: BuildReport, html: str) -> None:
    """Four digits of every value: modes, singular values, coefficients, gauges, pairs, eigenvalues."""
    tables, drawn = report_tables(report), figures(html)

    def column(name: str, index: int) -> Any:
        return [row[index] for row in tables[name].rows]

    modes, values, coefficients, gauges, pairs = (one["data"] for one in drawn[1:6])
    count = len(modes[0]["x"])
    assert [row[0] for row in modes[0]["customdata"]] == numbers(column("modes", 3)[:count])
    assert [row[1] for row in modes[0]["customdata"]] == numbers(column("modes", 8)[:count])
    assert values[0]["y"] == numbers(column("singular_values", 1))
    assert [one["name"] for one in coefficients[:-2]] == column("sources", 0)
    for bar, row in zip(coefficients[:-2], tables["sources"].rows, strict=True):
        np.testing.assert_allclose(bar["y"], row[1:], rtol=1e-3)
    assert [row[0] for row in coefficients[-2]["customdata"]] == numbers(column("coefficients", 1))
    assert len(gauges[0]["text"]) == report.inverse_map.n_gauges
    for text, row in zip(gauges[0]["text"], tables["gauges"].rows, strict=True):
        assert text.startswith(f"{row[0]}, {row[3]}<br>x {row[1]:.4g} m, roll {row[2]:.4g} deg")
        assert f"lost: C_N +{row[8]:.3g} %" in text
        assert f"detectable bias {row[12]:.3g} um/m" in text
    names = list(report.inverse_map.gauge_names)
    one, other, *growth = tables["worst_pairs"].rows[0]
    of_pair = pairs[0]["customdata"][names.index(one)][names.index(other)]
    assert of_pair == pytest.approx(max(growth), rel=1e-3)
    if report.gamma:
        eigenvalues = drawn[6]["data"][0]
        assert [row[0] for row in eigenvalues["customdata"]] == numbers(column("eigenvalues", 1))


def test_the_unrolled_body_shows_the_closest_node(report: BuildReport, html: str) -> None:
    over = figures(html)[0]["data"][3]
    assert over["opacity"] == 0.0
    observed, point = report.observability, report.surface.point
    angle, radius = roll_degrees(point), float(np.hypot(point[:, 1], point[:, 2]).mean())
    for i, j in ((0, 0), (20, 40), (48, 99), (31, 7)):
        turn = np.abs(over["y"][i] - angle)
        arc = np.radians(np.minimum(turn, 360.0 - turn)) * radius
        closest = np.hypot(point[:, 0] - over["x"][j], arc)
        near = np.flatnonzero(closest <= closest.min() + 1e-3)  # positions have four digits
        shown = over["customdata"][i][j]
        expected = [
            (100.0 * observed.node_removed[k], 1e-3 * observed.node_mean[k], 1e-3 * observed.node_std[k])
            for k in near
        ]
        assert any(shown == pytest.approx(one, rel=1e-3) for one in expected)


def test_mean_and_spread_at_the_nodes_are_those_of_the_ensemble(report: BuildReport, case: ReportCase) -> None:
    """Over all flows of the map, rolled ones too; without weights the POD's standard deviation is over N - 1."""
    ensemble = case.problem.ensemble
    members, weight = np.concatenate(list(ensemble.members())), ensemble.member_weight
    mean = weight @ members
    np.testing.assert_allclose(report.observability.node_mean, mean, rtol=1e-9)
    spread = np.sqrt(weight @ (members - mean) ** 2)
    count = len(ensemble.conditions)
    found = report.observability.node_std
    np.testing.assert_allclose(found, spread * np.sqrt(count / (count - 1.0)), rtol=0.02, atol=0.02 * spread.max())


def test_gauges_without_substitute_and_large_layouts(report: BuildReport, monkeypatch: pytest.MonkeyPatch) -> None:
    """An infinite growth is said in words and has a black edge; the matrix of many gauges stays a still."""
    one, value = report.inverse_map, report.gauges
    growth = value.growth.copy()
    growth[3] = np.inf
    drawn = hover_gauges.gauge_values(
        one, growth=growth, detectable_bias=value.detectable_bias, leverage=value.leverage
    )
    marks = drawn["data"][0]
    assert "lost: C_A not identified" in marks["text"][3]
    assert marks["marker"]["line"]["width"][3] > marks["marker"]["line"]["width"][2]
    assert all(np.isfinite(marks["marker"]["color"]))
    monkeypatch.setattr(hover_gauges, "MAX_MATRIX", one.n_gauges - 1)
    assert hover_gauges.pair_loss(one, growth=growth, pairs=value.pairs, pair_growth=value.pair_growth) is None


@pytest.mark.fast
def test_names_in_figures_end_nothing() -> None:
    text = figure_data({"data": [{"name": "</script><script>alert(1)</script><!--"}], "layout": {}})
    assert text.count("<") == 2
    assert json.loads(text[text.index(">") + 1 : text.rindex("<")])["data"][0]["name"].startswith("</script>")
    hover = {"data": [], "layout": {}}
    still = Picture(content=b"", kind="svg", caption="c", alternative="a", hover=hover)
    assert "plotly" in assert_self_contained(page_html(Page("p", (), (Section("s", (still,)),)))).anchors


def value_under_pointer(browser: Browser, selector: str, number: int, across: float = 0.5) -> str:
    """The text that appears with the pointer on an element of figure ``number``, at a fraction of its width."""
    browser.value(f"document.querySelectorAll('figure.hover')[{number}].scrollIntoView({{block: 'center'}})")
    x, y = browser.value(
        f"(box => [box.x + {across} * box.width, box.y + 0.5 * box.height])"
        f"(document.querySelectorAll('figure.hover')[{number}].querySelector('{selector}').getBoundingClientRect())"
    )
    shown = f"document.querySelectorAll('figure.hover')[{number}].querySelector('.hoverlayer').textContent"
    for step in (3, 0):
        browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + step, y=y)
    return str(browser.wait(shown, bool, 10.0))


@pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")
def test_a_browser_shows_values_and_fetches_nothing(
    browser: Browser, report: BuildReport, html: str, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    path.write_text(html, encoding="utf-8")
    set_width(browser, 1280)
    show(browser, path, DRAWN)
    assert browser.value("performance.getEntriesByType('resource').map(one => one.name)") == []
    stills = "[...document.querySelectorAll('figure.hover > img')].filter(one => !one.hidden).length"
    assert browser.value(stills) == 0
    over = value_under_pointer(browser, ".nsewdrag", 0, across=0.43)
    assert re.search(r"roll [\d.]+ deg.*variance removed -?[\d.]+ %.*mean [\d.]+ kPa", over)
    gauge = value_under_pointer(browser, ".scatterlayer .point", 4)
    assert gauge.startswith(f"{report.inverse_map.gauge_names[0]}, ")
    assert "lost: C_A +" in gauge
