"""Figures that show their values: numbers of the report at their places, in a browser with and without scripts."""

import re
import time
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import PROGRAM, Browser
from clipping import set_width, show
from page_checks import assert_self_contained
from report_case import ReportCase

from builder.figures import gauge_figures as gauges
from builder.figures.drawing import (
    COLOUR_MAP,
    Place,
    ValuedFigure,
    blank_figure,
    column,
    digits,
    mark,
    roll_degrees,
)
from builder.reports.build_report.build_findings import BuildReport
from builder.reports.build_report.build_tables import report_tables
from builder.reports.page.html import SCRIPT, Page, Picture, Section, page_html

MAX_SIZE = 3_000_000


def pictures(page: Page) -> list[Picture]:
    """The page's figures of the map, in order; curves and surfaces of flows have no values in text."""
    of_map = [section for section in page.sections if section.title != "Aerodynamics"]
    return [block for section in of_map for block in section.blocks if isinstance(block, Picture)]


def texts(one: Picture) -> list[str]:
    """The texts of a figure, in order."""
    return [place.text for place in one.places]


def test_every_figure_of_numbers_has_texts_and_the_page_stays_small(
    report: BuildReport, page: Page, html: str
) -> None:
    view, *others = pictures(page)
    assert len(others) == (9 if report.gamma else 7)
    assert not view.places
    assert all(one.places for one in others)
    assert assert_self_contained(html).tags.count("script") == 1
    assert html.count('<svg class="values"') == len(others)
    assert html.count("<path d=") == html.count("<title>") - 1
    assert len(html.encode()) < MAX_SIZE


def test_texts_hold_the_numbers_of_the_tables(report: BuildReport, page: Page) -> None:
    """Four digits of every value: modes, singular values, classes, coefficients, gauges, pairs, eigenvalues."""
    tables = report_tables(report)
    modes, values, classes, coefficients, of_gauges, pairs = map(texts, pictures(page)[2:8])
    for text, row in zip(modes, tables["modes"].rows, strict=False):
        state = "state of the map" if row[1] else "no state"
        assert text.splitlines()[:2] == [f"mode {row[0]}, {state}", f"{digits(row[3])} % of the variance"]
        assert f"removed by this map {digits(row[8])} %\nat best {digits(row[9])} %" in text
    for text, (number, value) in zip(values, tables["singular_values"].rows, strict=True):
        assert text.startswith(f"number {number}\n{digits(value)} um/m per kPa rms\n")
    for text, row in zip(classes, tables["classes"].rows, strict=False):
        assert text.startswith(f"{row[0]}\n{digits(row[4])} % of the snapshots' variance\n")
    *groups, total = tables["source_groups"].rows
    for k, row in enumerate(groups):
        for i, alone in enumerate(row[1:]):
            percent = 100.0 * (alone / total[1 + i]) ** 2
            assert coefficients[5 * k + i].splitlines()[1] == f"{digits(percent)} % of the variance"
            assert coefficients[5 * k + i].endswith(f"sigma of it alone {digits(alone)}")
    ranges = coefficients[5 * len(groups) : 5 * len(groups) + 5]
    for text, row in zip(ranges, tables["coefficients"].rows, strict=True):
        assert text.startswith(f"{row[0]}: sigma {digits(row[1])}, 3 sigma {digits(3.0 * row[1])}\n")
        assert text.endswith(f"{digits(3.0 * row[4])} % of the range {digits(row[2])} to {digits(row[3])}")
    assert f"C_N and M_P: {digits(tables['correlations'].rows[1][4])}" in coefficients
    for text, row in zip(of_gauges, tables["gauges"].rows, strict=True):
        assert text.startswith(f"{row[0]}, {row[3]}\nx {row[1]:.4g} m, roll {row[2]:.4g} deg\n")
        assert f"lost: C_N +{row[8]:.3g} %" in text
        assert f"detectable bias {row[12]:.3g} um/m" in text
    one, other, *growth = tables["worst_pairs"].rows[0]
    assert f"{one} and {other} lost: +{digits(max(growth))} %" in pairs
    n = report.inverse_map.n_gauges
    assert len(pairs) == n * (n + 1) // 2
    if report.gamma:
        for text, row in zip(texts(pictures(page)[8]), tables["eigenvalues"].rows, strict=True):
            lines = [f"mode {row[0]}", row[3], f"eigenvalue {digits(row[1])}", f"filter factor {digits(row[2])}"]
            assert text.splitlines() == [line for line in lines if line]
        curve = texts(pictures(page)[9])
        for text, row in zip(curve, tables["l_curve"].rows, strict=False):
            assert text == f"gamma {digits(row[0])}\nresidual {digits(row[1])}, states {digits(row[2])}"


def test_the_unrolled_body_shows_the_closest_node(report: BuildReport, page: Page) -> None:
    cells = texts(pictures(page)[1])
    observed, point = report.observability, report.surface.point
    angle, radius = roll_degrees(point), float(np.hypot(point[:, 1], point[:, 2]).mean())
    for text in (cells[0], cells[440], cells[1799], cells[731]):
        x, roll, *shown = map(float, re.findall(r"(?<![\w])-?[\d.]+(?:e[+-]\d+)?", text))
        turn = np.abs(roll - angle)
        arc = np.radians(np.minimum(turn, 360.0 - turn)) * radius
        closest = np.hypot(point[:, 0] - x, arc)
        near = np.flatnonzero(closest <= closest.min() + 1e-3)  # positions have four digits
        expected = [
            (100.0 * observed.node_removed[k], 1e-3 * observed.node_mean[k], 1e-3 * observed.node_std[k])
            for k in near
        ]
        assert any(shown == pytest.approx(one, rel=1e-3) for one in expected)


def test_mean_and_spread_at_the_nodes_are_those_of_the_ensemble(report: BuildReport, reported: ReportCase) -> None:
    """Over all flows of the map, rolled ones too; without weights the POD's standard deviation is over N - 1."""
    ensemble = reported.problem.ensemble
    members, weight = np.concatenate(list(ensemble.members())), ensemble.member_weight
    mean = weight @ members
    np.testing.assert_allclose(report.observability.node_mean, mean, rtol=1e-9)
    spread = np.sqrt(weight @ (members - mean) ** 2)
    count = len(ensemble.conditions)
    found = report.observability.node_std
    np.testing.assert_allclose(found, spread * np.sqrt(count / (count - 1.0)), rtol=0.02, atol=0.02 * spread.max())


def colours_at(shown: ValuedFigure) -> list[list[Any]]:
    """The colour in the middle of each rectangle of each text, as drawn, (3,) in 0..1."""
    from matplotlib.image import imread

    stream = BytesIO()
    shown.figure.savefig(stream, format="png", dpi=110)
    pixels = imread(BytesIO(stream.getvalue()))
    height, width = pixels.shape[:2]
    return [
        [pixels[int((y + 0.5 * h) * height), int((x + 0.5 * w) * width), :3] for x, y, w, h in one.rectangles]
        for one in shown.places()
    ]


def test_texts_lie_where_their_numbers_are_drawn(report: BuildReport) -> None:
    """The colour at the middle of both cells of a pair, and of a gauge's mark, is the colour of its number."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    one, value, scale = report.inverse_map, report.gauges, colormaps[COLOUR_MAP]
    of = {"growth": value.growth}
    drawn = gauges.pair_loss(one, **of, pairs=value.pairs, pair_growth=value.pair_growth)
    largest = 100.0 * (value.pair_growth.max() - 1.0)
    norm = LogNorm(largest / 1e3, largest)
    found = colours_at(drawn)
    for (text, areas), colours in zip(drawn.texts, found, strict=True):
        assert len(colours) == len(areas) == (1 if " and " not in text else 2)
        expected = scale(float(norm(max(float(re.findall(r"\+([\d.e+-]+) %", text)[0]), largest / 1e3))))[:3]
        assert all(colour == pytest.approx(expected, abs=0.02) for colour in colours)
    drawn = gauges.gauge_loss(one, **of, detectable_bias=value.detectable_bias, leverage=value.leverage)
    grown = 100.0 * (value.growth - 1.0)
    for k, colours in enumerate(colours_at(drawn)):
        assert colours[1] == pytest.approx(scale(grown[k, 1] / grown[:, 1].max())[:3], abs=0.02)


@pytest.mark.fast
def test_areas_follow_the_axes() -> None:
    """On a logarithmic axis that is turned round; a column ends with the axes; what lies beyond has no height."""
    shown = ValuedFigure(blank_figure(4.0, 2.0))
    axis = shown.figure.add_axes((0.25, 0.2, 0.5, 0.6))
    axis.set(xlim=(1.0, 100.0), ylim=(3.0, -1.0), xscale="log")
    shown.annotate(mark(axis, 10.0, 1.0, 7.2), text="middle")
    shown.annotate(column(axis, 5.5, 9.0), text="lower decade")
    shown.annotate(column(axis, 500.0), text="beyond")
    middle, decade, beyond = (one.rectangles[0] for one in shown.places())
    assert middle == pytest.approx((0.475, 0.45, 0.05, 0.1))  # 14.4 pt of 288 and of 144
    assert decade == pytest.approx((0.25, 0.2, 0.25, 0.6))
    assert beyond[2] == 0.0


def test_gauges_without_substitute_and_large_layouts(report: BuildReport, monkeypatch: pytest.MonkeyPatch) -> None:
    """An infinite growth is said in words; the matrix of very many gauges has no texts."""
    one, value = report.inverse_map, report.gauges
    growth = value.growth.copy()
    growth[3] = np.inf
    drawn = gauges.gauge_loss(one, growth=growth, detectable_bias=value.detectable_bias, leverage=value.leverage)
    assert "lost: C_A not identified" in drawn.texts[3][0]
    pairs = {"growth": growth, "pairs": value.pairs, "pair_growth": value.pair_growth}
    drawn = gauges.pair_loss(one, **pairs)
    assert f"{one.gauge_names[3]} lost: not identified" in [text for text, _ in drawn.texts]
    monkeypatch.setattr(gauges, "MAX_MATRIX", one.n_gauges - 1)
    assert gauges.pair_loss(one, **pairs).texts == []


@pytest.mark.fast
def test_names_in_texts_are_no_markup() -> None:
    name = "</title></svg><script>alert(1)</script><!--"
    still = Picture(
        content=b"", kind="svg", caption="c", alternative="a", places=(Place(name, ((0.1, 0.1, 0.2, 0.2),)),)
    )
    found = assert_self_contained(page_html(Page("p", (), (Section("s", (still,)),))))
    assert found.tags.count("script") == 1
    assert name in found.text
    assert (
        "script"
        not in assert_self_contained(page_html(Page("p", (), (Section("s", (replace(still, places=()),)),)))).tags
    )


IN_FIGURE = "document.querySelectorAll('figure')[{number}].querySelectorAll('svg.values path')[{place}]"

MIDDLE = """((one, scrolls) => {
  const [x0, y0, x1, y1] = one.getAttribute("d").match(/[0-9]+/g).map(Number);
  const box = one.ownerSVGElement.getBoundingClientRect();
  const at = [box.x + box.width * (x0 + x1) / 8000, box.y + box.height * (y0 + y1) / 8000];
  if (scrolls) {
    one.closest(".picture").scrollBy(at[0] - innerWidth / 2, 0);
    scrollBy(0, at[1] - innerHeight / 2);
  }
  return at;
})"""
"""The middle of a shape's first rectangle in the window, to which the page is scrolled before."""


def point_at(browser: Browser, number: int, place: int, touch: bool = False) -> str:
    """Move the pointer to a place of a figure, or touch it, until a text is shown, and return the text."""
    one = IN_FIGURE.format(number=number, place=place)
    browser.value(f"{MIDDLE}({one}, true)")
    x, y = browser.value(f"{MIDDLE}({one}, false)")
    shown = "(box => !box.hidden && box.textContent)(document.getElementById('value'))"
    for step in range(100):  # while the page still scrolls, it hides the text
        if touch:
            browser.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
            browser.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        else:
            browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + step % 2, y=y)
        time.sleep(0.05)
        if text := browser.value(shown):
            return str(text)
    raise AssertionError(f"figure {number}, place {place}: no text")


@pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")
def test_a_browser_shows_values_and_fetches_nothing(
    browser: Browser, report: BuildReport, page: Page, html: str, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    path.write_text(html, encoding="utf-8")
    set_width(browser, 1280)
    show(browser, path)
    assert browser.value("performance.getEntriesByType('resource').map(one => one.name)") == []
    # The shapes lie over the picture, pixel by pixel.
    boxes = browser.value(
        "[...document.querySelectorAll('svg.values')].flatMap(one => [one, one.parentNode.querySelector('img')]"
        ".map(one => (box => [box.x, box.y, box.width, box.height])(one.getBoundingClientRect())))"
    )
    assert len(boxes) == 2 * (9 if report.gamma else 7)
    assert all(over == pytest.approx(under, abs=0.5) for over, under in zip(boxes[::2], boxes[1::2], strict=True))
    gauge = point_at(browser, 6, 0)
    assert gauge == texts(pictures(page)[6])[0]
    assert gauge.startswith(f"{report.inverse_map.gauge_names[0]}, ")
    assert point_at(browser, 1, 731) == texts(pictures(page)[1])[731]
    browser.call("Input.dispatchKeyEvent", type="keyDown", key="Escape")
    assert browser.value("document.getElementById('value').hidden")


@pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")
def test_texts_stay_inside_a_narrow_window(browser: Browser, page: Page, html: str, tmp_path: Path) -> None:
    """By touch; wide pictures scroll in their own box, the page does not."""
    path = tmp_path / "report.html"
    path.write_text(html, encoding="utf-8")
    set_width(browser, 390)
    show(browser, path)
    assert browser.value("document.documentElement.scrollWidth") <= 390
    for place in (0, len(pictures(page)[6].places) - 1):
        assert point_at(browser, 6, place, touch=True) == texts(pictures(page)[6])[place]
        left, right, top = browser.value(
            "(box => [box.left, box.right, box.top])(document.getElementById('value').getBoundingClientRect())"
        )
        assert left >= 0.0
        assert right <= 390.0
        assert top >= 0.0


@pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")
def test_without_scripts_the_shapes_have_titles(browser: Browser, page: Page, html: str, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text(html.replace(f"<script>\n{SCRIPT}</script>", ""), encoding="utf-8")
    set_width(browser, 1280)
    show(browser, path)
    title = browser.value(IN_FIGURE.format(number=7, place=1) + ".querySelector('title').textContent")
    assert title == texts(pictures(page)[7])[1]
