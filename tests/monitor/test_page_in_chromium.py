"""The page in a browser: what an operator reads in five states of a real run, keys, and nothing cut off."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import PROGRAM, Browser
from clipping import WIDTHS, clipped, set_width
from multicast import skip_without_multicast
from operator_states import TestRange, running_range
from other_load_maps import groups_at
from page_results import altered
from synthetic_vehicle import synthetic_inverse_map

from strainfmu.can.machine import Result
from strainfmu.can.page_message import EstimatorFacts, GaugePosition
from strainfmu.can.publisher import Publisher
from strainfmu.can.quality import Cause, FrameAccount, Quality
from strainfmu.can.strain_sources import FlownSample
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.estimator.other_loads import SECTIONS as FAMILY
from strainfmu.fmu.export import export_estimator
from strainfmu.monitor.server import Monitor

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")

N_GAUGES = 30
"""More than one frame holds, so that a lost one leaves some."""

TEXT = "document.body.innerText"
FOCUSED = "document.activeElement.id || document.activeElement.className"


def flown(n_cycles: int) -> list[FlownSample]:
    """Return pressure states that move, seen by the gauges of the synthetic map with its noise."""
    inverse_map, random = synthetic_inverse_map(1, N_GAUGES), np.random.default_rng(2)
    state = 1e5 * np.sin(0.05 * np.arange(n_cycles)[:, None] + np.arange(3.0))
    strain = inverse_map.mean_strain + state @ inverse_map.state_operator.T
    strain += 1e-7 * random.normal(size=strain.shape)
    return [FlownSample(one, 95.8e3, np.full(5, np.nan)) for one in strain]


@pytest.fixture(scope="module")
def on_range(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[TestRange, Browser]]:
    skip_without_multicast()
    folder = tmp_path_factory.mktemp("range")
    save_inverse_map(synthetic_inverse_map(1, N_GAUGES), folder / "map.h5")
    export_estimator(folder / "map.h5", folder / "estimator.fmu")
    with running_range(folder / "estimator.fmu", flown(400), record=folder / "run.blf") as state:
        browser = Browser(folder / "profile", state.url)
        try:
            yield state, browser
        finally:
            browser.close()


def press(browser: Browser, key: str) -> None:
    codes = {"Tab": 9, "ArrowRight": 39, "ArrowDown": 40}
    for kind in ("keyDown", "keyUp"):
        browser.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=codes[key])


def shows(*texts: str) -> Callable[[Any], bool]:
    return lambda found: isinstance(found, str) and all(text in found for text in texts)


def is_whole(browser: Browser) -> None:
    for width in WIDTHS:
        assert clipped(browser, width) == []


def test_all_good(on_range: tuple[TestRange, Browser]) -> None:
    _, browser = on_range
    found = browser.wait(
        TEXT,
        shows("VALID", "every gauge valid", f"{N_GAUGES} of {N_GAUGES}", "none suspect", "limit", "ERROR_ACTIVE"),
    )
    for text in (
        "udp_multicast:",
        "run.blf",
        " ± ",
        "(3 sigma)",
        "C_N [1], normal",
        "-60 s",
        "x aft of the nose tip [m]",
    ):
        assert text in found
    browser.wait("document.body.classList.contains('old')", lambda found: not found)
    browser.wait("document.getElementById('alarm').hidden", bool)
    browser.wait("document.querySelectorAll('polygon.band').length", lambda found: found >= 5)
    # Its own number in the middle of every band, and the limit of chi-square as a line.
    browser.wait("document.querySelectorAll('#chart_chi polyline.limit').length", lambda found: found >= 1)
    is_whole(browser)


def test_loads_instead_of_coefficients(on_range: tuple[TestRange, Browser]) -> None:
    _, browser = on_range
    browser.value("document.getElementById('view_loads').click()")
    browser.wait(TEXT, shows("Normal force [kN]", "Pitching moment [kN m]"))
    browser.wait("document.getElementById('now_C_N').textContent", shows(" ± "))
    is_whole(browser)
    browser.value("document.getElementById('view_coefficients').click()")
    browser.wait(TEXT, shows("C_N [1], normal"))


def test_everything_is_reached_by_keys(on_range: tuple[TestRange, Browser]) -> None:
    _, browser = on_range
    browser.value("document.activeElement.blur()")
    visited = []
    for _ in range(5):
        press(browser, "Tab")
        visited.append(browser.value(FOCUSED))
    assert visited == ["skip", "gauges", "events", "view_coefficients", "span_60"]
    browser.value("document.getElementById('gauges').focus()")
    press(browser, "ArrowRight")
    first = browser.wait("document.getElementById('chosen').textContent", shows("µm/m, used"))
    press(browser, "ArrowRight")
    browser.wait("document.getElementById('chosen').textContent", lambda found: "µm/m" in found and found != first)


def test_one_suspect(on_range: tuple[TestRange, Browser]) -> None:
    state, browser = on_range
    state.enter("suspect")
    browser.wait(
        TEXT, shows("SUSPECT", "suspect: G4", "above its limit", "gauge G4 suspect", "does not fit the others")
    )
    # The gauge, and the legend's.
    browser.wait("document.querySelectorAll('.mark.suspect').length", lambda found: found == 2)
    is_whole(browser)


def test_a_lost_frame(on_range: tuple[TestRange, Browser]) -> None:
    state, browser = on_range
    state.enter("lost_frame")
    found = browser.wait(
        TEXT,
        shows(
            "DEGRADED",
            "PARTIAL_CYCLE: frames of the cycle are missing, or come after trust.deadline_cycles",
            f"27 of {N_GAUGES}",
        ),
    )
    assert "3 gauges not used: no frame — G27, G28, G29" in found
    browser.wait("document.querySelectorAll('.mark.masked').length", lambda found: found == 3 + 1)
    is_whole(browser)


def test_bus_off(on_range: tuple[TestRange, Browser]) -> None:
    state, browser = on_range
    state.enter("bus_off")
    browser.wait(TEXT, shows("BUS OFF: the controller has left the bus", "The bridge opens it again", "SILENT"))
    browser.wait(TEXT, lambda found: "no value: " in found or "STALE" in found)
    is_whole(browser)
    state.enter("good")
    browser.wait(TEXT, shows("every gauge valid"))


def test_bridge_gone(on_range: tuple[TestRange, Browser]) -> None:
    state, browser = on_range
    state.enter("gone")
    found = browser.wait(TEXT, shows("BRIDGE GONE: nothing received for", "Everything below is old", "GONE"))
    assert "bridge gone" in found  # in the list of events
    assert browser.value("document.body.classList.contains('old')")
    browser.wait("document.querySelector('#chart_C_N').textContent", shows("last", "-20 s", "-60 s"))
    marks = "[...document.querySelectorAll('.current h2')].map(one => getComputedStyle(one, '::before').content)"
    assert set(browser.value(marks)) == {'"OLD · "'}
    is_whole(browser)


FURTHER_LOADS = "document.getElementById('other_loads').innerText"


def test_rolling_moment_and_section_loads(tmp_path: Path) -> None:
    """Hidden of an estimator without them; whole at every width; no numbers without quality."""
    strain, stations = np.arange(3.0) * 1e-6, (0.6, 1.2, 1.75, 2.5, 3.6)
    held = {"M_R": -0.0123, "sigma.M_R": 0.001, "moment.roll": -456.0, "sigma.moment.roll": 37.0}
    for number, unit in enumerate((load.key for load in FAMILY.loads), start=1):
        for k in range(1, 6):
            held |= {f"section.{unit}[{k}]": -1234.5 * number - k, f"sigma.section.{unit}[{k}]": 10.0 * k}
    shown = Result(
        time=1.0,
        quality=Quality.VALID,
        causes=Cause.NONE,
        valid=np.isfinite(strain),
        strain=strain,
        other_outputs=held,
    )
    monitor = Monitor(("127.0.0.1", 0), ("127.0.0.1", 0))
    browser = Browser(tmp_path / "profile", monitor.url)
    gauges = [GaugePosition(f"g{k}", 1.0 + k, 90.0 * k) for k in range(3)]
    publishers = [
        Publisher(
            monitor.listens_at, gauges, rate=1e4, account=FrameAccount, facts=EstimatorFacts(load_groups=one)
        )
        for one in ((), groups_at(stations))
    ]

    def shows_of(publisher: Publisher, result: Result, *texts: str) -> Callable[[Any], bool]:
        def is_shown(found: Any) -> bool:
            publisher.result(result)
            return shows(*texts)(found)

        return is_shown

    try:
        browser.wait(TEXT, shows_of(publishers[0], shown, "VALID"))
        assert browser.value("document.getElementById('other_loads').hidden") is True
        browser.wait(FURTHER_LOADS, shows_of(publishers[1], shown, "C_l -0.0123 ± 0.0030, -0.456 ± 0.111 kN m"))
        table = browser.value(FURTHER_LOADS)
        assert "1.75" in table
        assert "-7.409 ± 0.060" in table, "torsion of the second section"
        for width in WIDTHS:
            assert clipped(browser, width) == []
        stale = altered(shown, quality=Quality.STALE)
        browser.wait(FURTHER_LOADS, shows_of(publishers[1], stale, "no value: STALE"))
        assert "±" not in browser.value("document.querySelector('#load_tables tbody').innerText")
    finally:
        browser.close()
        for publisher in publishers:
            publisher.close()
        monitor.close()


OVERLAPPING = """(() => {
  const box = document.getElementById("gauges").getBoundingClientRect();
  const marks = [...document.querySelectorAll("g.gauge .mark")].map(one => one.getBoundingClientRect());
  const apart = (a, b) => a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top;
  const over = marks.some((a, k) => marks.some((b, j) => j > k && !apart(a, b)));
  const out = marks.some(one => one.bottom > box.bottom || one.right > box.right || one.left < box.left);
  return [marks.length, over, out].join();
})()"""


def test_gauges_anywhere_around_do_not_cover_each_other(tmp_path: Path) -> None:
    """Between 270 and 360 deg, three at one place, and close together as on a wing."""
    at = [(0.5, 315.0)] * 3 + [(0.1 * k, 45.0 + k) for k in range(1, 12)] + [(0.05 * k, 359.0) for k in range(8)]
    gauges = [GaugePosition(f"g{k}", x, angle) for k, (x, angle) in enumerate(at)]
    strain = np.arange(len(gauges)) * 1e-6
    shown = Result(
        time=1.0, quality=Quality.VALID, causes=Cause.NONE, valid=np.isfinite(strain), strain=strain, health=0
    )
    monitor = Monitor(("127.0.0.1", 0), ("127.0.0.1", 0))
    browser = Browser(tmp_path / "profile", monitor.url)
    publisher = Publisher(monitor.listens_at, gauges, rate=1e4, account=FrameAccount)
    try:
        for width in WIDTHS:
            set_width(browser, width)

            def is_clear(found: Any) -> bool:
                publisher.result(shown)
                return bool(found == f"{len(gauges)},false,false")

            browser.wait(OVERLAPPING, is_clear)
            assert clipped(browser, width) == []
    finally:
        browser.close()
        publisher.close()
        monitor.close()


SEEN_AT_ONCE = """(() => {
  const box = id => document.getElementById(id).getBoundingClientRect();
  const ends = ["usable", "usable_since", "usable_age", "usable_why", "now_loads"].map(id => box(id).bottom);
  return [Math.max(...ends) <= window.innerHeight, ...["usable", "usable_why", "now_loads"].map(
    id => document.getElementById(id).innerText)].join("|");
})()"""


def test_the_first_view_answers_whether_loads_may_be_used(tmp_path: Path) -> None:
    """At 1280 and 390 px, without scrolling: usable or not, since when, why; loads with their bands; age."""
    gauges = [GaugePosition(f"g{k}", 0.1 * k, 90.0 * k) for k in range(4)]
    good = Result(
        time=1.0,
        quality=Quality.DEGRADED,
        causes=Cause.GAUGE_INVALID,
        usable=True,
        valid=np.array([True, True, True, False]),
        strain=np.arange(4) * 1e-6,
        coefficients=np.array([0.11, 0.22, 0.33, 0.44, 0.55]),
        coefficients_std=np.full(5, 0.001),
        age=0.002,
        age_uncertainty=0.001,
        health=4,
    )
    bad = altered(good, quality=Quality.UNCONFIRMED, usable=False, causes=Cause.UNPROVEN_RESTART)
    monitor = Monitor(("127.0.0.1", 0), ("127.0.0.1", 0))
    browser = Browser(tmp_path / "profile", monitor.url)
    publisher = Publisher(monitor.listens_at, gauges, rate=1e4, account=FrameAccount)

    def seen(result: Result, *texts: str) -> Callable[[Any], bool]:
        def is_seen(found: Any) -> bool:
            publisher.result(result)
            return shows("true|", *texts)(found)

        return is_seen

    try:
        for width in (1280, 390):
            set_width(browser, width)
            browser.wait(
                SEEN_AT_ONCE, seen(good, "|\u2713 LOADS USABLE|", "a gauge has no value", "0.2200 \u00b1 0.0030")
            )
            browser.wait(SEEN_AT_ONCE, seen(bad, "LOADS NOT USABLE", "confirm the sender"))
        publishers = browser.value("document.getElementById('link').textContent")
        assert "from 127.0.0.1:" in publishers
    finally:
        browser.close()
        publisher.close()
        monitor.close()
