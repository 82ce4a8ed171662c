"""The first screen of a report: every sentence follows from a number, and goes with it."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chromium import PROGRAM, Browser
from clipping import set_width, show

from builder.reports.build_report.build_findings import BuildReport
from builder.reports.build_report.build_page import UNMEASURED, WELL, first_screen, write_numbers
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES


def sentence(lines: tuple[str, ...], beginning: str) -> str | None:
    """The sentence that begins so, None where there is none."""
    return next((line for line in lines if line.startswith(beginning)), None)


def with_range(report: BuildReport, index: int, width_over_sigma: float) -> BuildReport:
    """The report with another range of one coefficient."""
    found = report.in_use.coefficients
    limits = found.range.copy()
    limits[index] = 0.0, width_over_sigma * found.std[index]
    return replace(report, in_use=replace(report.in_use, coefficients=replace(found, range=limits)))


def test_each_coefficient_stands_where_its_sigma_puts_it(report: BuildReport) -> None:
    """Once, by sigma over its range: well up to 5 %, not at all from 29 %, where the range alone tells as much."""
    screen = first_screen(report)
    for name, fraction in zip(COEFFICIENT_NAMES, report.in_use.coefficients.std_of_range, strict=True):
        expected = (
            screen.well if fraction <= WELL else screen.badly if fraction < UNMEASURED else screen.unmeasured
        )
        line = sentence(expected, f"{name},")
        assert line is not None
        stated = re.search(r"([\d.]+) % of the range", line)
        assert stated is not None
        assert float(stated[1]) == pytest.approx(100.0 * fraction, rel=0.05)
        assert re.search(r"; [\d.]+ % of its variance is from [a-z ,]+( \((noise|map)\.\w+\))?\.$", line)
        assert (
            sum(
                f"\n{name}," in "\n" + "\n".join(lines) for lines in (screen.well, screen.badly, screen.unmeasured)
            )
            == 1
        )
    for widths, where in ((100.0, "well"), (10.0, "badly"), (2.0, "unmeasured"), (0.0, "unmeasured")):
        lines = getattr(first_screen(with_range(report, 0, widths)), where)
        line = sentence(lines, "C_A,")
        assert line is not None
        assert ("in every snapshot" in line) == (widths == 0.0)


def test_blindness_and_its_cure(report: BuildReport) -> None:
    """All gauges lie on planes of symmetry and one class is blind. Off the planes the cure is not offered."""
    screen = first_screen(report)
    line = sentence(screen.unmeasured, "Pressure odd in y, odd in z")
    assert line is not None
    assert "no gauge responds" in line
    assert sentence(screen.helps, "A gauge off the planes y = 0 and z = 0") is not None
    position = report.inverse_map.gauge_position.copy()
    position[0, 1:] = 0.1, 0.1
    moved = replace(report, inverse_map=replace(report.inverse_map, gauge_position=position))
    assert sentence(first_screen(moved).helps, "A gauge off") is None
    seen = replace(report, symmetries=tuple(one for one in report.symmetries if not one.blind))
    assert sentence(first_screen(seen).unmeasured, "Pressure") is None


def test_a_mode_below_the_noise_is_not_measured(report: BuildReport) -> None:
    strain = report.observability.mode_strain.copy()
    assert sentence(first_screen(report).unmeasured, "POD mode 2,") is None
    strain[1] = 0.1 * np.sqrt(np.mean(report.inverse_map.noise_std**2) / report.inverse_map.n_gauges)
    silent = replace(report, observability=replace(report.observability, mode_strain=strain))
    assert "below the noise" in str(sentence(first_screen(silent).unmeasured, "POD mode 2,"))


def test_a_mode_that_is_hardly_removed_is_measured_badly(report: BuildReport) -> None:
    """A state of the map, and one that is truncated, each with what the best linear map would remove."""
    observed = report.observability
    removed, at_best = observed.mode_removed.copy(), observed.mode_removed_at_best.copy()
    removed[1], at_best[1] = 0.1234, 0.75
    assert sentence(first_screen(report).badly, "POD mode 2,") is None
    weak = replace(report, observability=replace(observed, mode_removed=removed, mode_removed_at_best=at_best))
    line = str(sentence(first_screen(weak).badly, "POD mode 2,"))
    assert "12.3 % of it is removed; the best linear map would remove 75 %." in line
    first = np.arange(len(removed)) == 0
    truncated = replace(weak, observability=replace(weak.observability, is_state=first))
    assert "it is no state of this map" in str(sentence(first_screen(truncated).badly, "POD mode 2,"))


def test_sigma_without_sources(report: BuildReport) -> None:
    """Without one source it is the root of the sum of the others."""
    found = report.in_use.coefficients
    for k, name in enumerate(found.names):
        others = np.delete(found.variance, k, axis=0).sum(axis=0)
        scale = found.std.max()
        np.testing.assert_allclose(found.std_without([name]), np.sqrt(others), rtol=1e-6, atol=1e-6 * scale)
    assert found.std_without(found.names) == pytest.approx(0.0, abs=1e-6 * found.std.max())
    np.testing.assert_allclose(found.std_without([]), found.std)


def test_what_helps_is_computed(report: BuildReport) -> None:
    """The largest source of the worst coefficient and what it leaves; the gauge whose loss costs most."""
    helps = first_screen(report).helps
    found, of_range = report.in_use.coefficients, report.in_use.coefficients.std_of_range
    worst = int(np.argmax(of_range))
    source = int(np.argmax(found.variance[:, worst]))
    rest = np.delete(found.variance[:, worst], source).sum()
    line = str(sentence(helps, f"The source to reduce first is {found.names[source]}"))
    stated = [float(text) for text in re.findall(r"([\d.]+) %", line)]
    width = found.range[worst, 1] - found.range[worst, 0]
    assert stated == pytest.approx([100.0 * np.sqrt(rest) / width, 100.0 * of_range[worst]], rel=0.06, abs=0.01)
    costly = int(np.argmax(report.gauges.growth.max(axis=1)))
    line = str(sentence(helps, "The gauge to protect, or to double, is"))
    assert report.inverse_map.gauge_names[costly] in line
    assert float(re.findall(r"([\d.]+) % more", line)[0]) == pytest.approx(
        100.0 * (report.gauges.growth.max() - 1.0), rel=0.05
    )


def test_page_and_numbers_hold_the_same_sentences(report: BuildReport, html: str, tmp_path: Path) -> None:
    write_numbers(report, tmp_path)
    summary = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["summary"]
    assert summary == first_screen(report).as_json()
    opening = html[: html.index("<nav")].replace("&#x27;", "'")
    for lines in summary.values():
        assert all(line in opening for line in lines)
    found = report.in_use.coefficients
    assert all(name in opening for name in found.groups)
    hardware = re.search(r"(\d+) of the sources are installation errors. Without them .* C_N ([\d.]+) %", opening)
    assert (hardware is not None) == bool(found.hardware)
    if hardware:
        assert int(hardware[1]) == len(found.hardware)
        without = found.std_without(found.hardware)[1] / (found.range[1, 1] - found.range[1, 0])
        assert float(hardware[2]) == pytest.approx(100.0 * without, rel=0.01)


@pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")
def test_the_answer_fits_the_first_screen(browser: Browser, html: str, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text(html, encoding="utf-8")
    show(browser, tmp_path / "report.html")
    set_width(browser, 1280)
    cards = "[...document.querySelectorAll('.card')]"
    bottoms = browser.value(f"{cards}.map(one => one.getBoundingClientRect().bottom)")
    assert len(bottoms) == 4
    assert max(bottoms) <= 900.0
