"""The page in a browser: live data, a restart of the bridge, what is outside."""

import threading
from pathlib import Path

import pytest
from bus_run import live_run
from chromium import PROGRAM, Browser
from clipping import WIDTHS, clipped
from page_results import OUTSIDE, publisher, result
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.can.machine import Result
from strainfmu.can.quality import Quality
from strainfmu.monitor.server import Monitor

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")


def test_chromium_shows_what_is_outside_and_what_is_not_known(tmp_path: Path, monitor: Monitor) -> None:
    browser = Browser(tmp_path / "profile", monitor.url)
    mouth = publisher(monitor.listens_at[1], score_limit=3.0)
    names = ("health", "health_text", "envelope", "mach_number", "altitude_m")
    shown = "[" + ",".join(f"document.getElementById('{name}').textContent" for name in names) + "].join('|')"
    try:
        browser.wait("document.getElementById('quality')?.textContent", lambda found: found == "waiting")
        for of_result, expected in (
            (
                result(Quality.SUSPECT, **OUTSIDE),
                "OUTSIDE|not usable: the coefficients are outside what the map covers"
                "|4.3, limit 3.0|6.020|20.10 km",
            ),
            (
                result(Quality.VALID, health=0),
                "OK|usable: residual as expected|not known, limit 3.0|not known|not known",
            ),
        ):

            def is_shown(found: str, of_result: Result = of_result, expected: str = expected) -> bool:
                mouth.result(of_result)
                return found == expected

            browser.wait(shown, is_shown)
            for width in WIDTHS:
                assert clipped(browser, width) == []
    finally:
        browser.close()
        mouth.close()


@pytest.mark.slow
def test_chromium_shows_live_data_and_goes_on_after_a_restart(
    synthetic: SyntheticFiles, tmp_path: Path, monitor: Monitor
) -> None:
    browser = Browser(tmp_path / "profile", monitor.url)
    address = "{}:{}".format(*monitor.listens_at)
    try:
        browser.wait("document.getElementById('quality')?.textContent", lambda found: found == "waiting")
        counted = []
        for number in (1, 2):  # the second bridge is a new one: the page is not touched meanwhile
            running = threading.Thread(
                target=live_run, args=(synthetic.estimator_1, f"monitor{number}", 200), kwargs={"publish": address}
            )
            running.start()
            browser.wait("document.getElementById('quality').textContent", lambda found: found == "VALID")
            browser.wait("document.getElementById('now_C_N').textContent", lambda found: " ± " in found)
            received = "[...document.querySelectorAll('#account dt')].map(cell => cell.textContent).join()"
            counted.append(browser.wait(received, lambda found: "received," in found and "used," in found))
            assert browser.value("document.querySelectorAll('g.gauge').length") == N_GAUGES
            # One for each coefficient, in pieces where a busy machine left gaps.
            browser.wait(
                "document.querySelectorAll('polygon.band').length", lambda found: found and found % 5 == 0
            )
            running.join()
            browser.wait("document.getElementById('quality').textContent", lambda found: found == "GONE")
            assert "bridge silent" in browser.value("document.getElementById('link').textContent")
            assert "BRIDGE GONE" in browser.value("document.getElementById('alarm').textContent")
        assert len(counted) == 2
        browser.screenshot(tmp_path / "page.png")
        assert (tmp_path / "page.png").stat().st_size > 10_000
        for width in WIDTHS:
            assert clipped(browser, width) == []
    finally:
        browser.close()
