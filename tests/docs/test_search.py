"""Search of the site: what users type leads to a page written for them.

The site is built, and its own search runs in Chromium: ``pytest -m slow tests/docs/test_search.py``. Needs the
extra ``docs``.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from chromium import PROGRAM, Browser
from snippets import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")]

EXPECTED = {
    "calibrate": {"howto/calibrate_map", "explanation/calibration", "howto/design_ground_test"},
    "accuracy": {"evidence/accuracy"},
    "temperature": {"explanation/temperature"},
    "C_m": {"reference/conventions"},
    "ground test": {"howto/design_ground_test", "howto/calibrate_map", "reference/load_test_file"},
    "units": {"reference/conventions"},
    "export fmu": {"tutorials/fmu_in_tools", "reference/cli"},
    "csv": {"howto/estimate_recorded", "howto/recorder_channels", "tutorials/recorder_to_loads"},
    "uncertainty": {"explanation/sigma"},
    "can bridge": {"howto/run_bridge", "explanation/can"},
    "zero offset": {"howto/tare"},
    "own channel names": {"howto/recorder_channels"},
    "install": {"index", "tutorials/first_map"},
    "gain": {"explanation/sigma", "howto/calibrate_map", "explanation/calibration"},
    "simulink": {"tutorials/fmu_in_tools"},
    "angle of attack": {"reference/conventions", "explanation/envelope", "explanation/nonlinear_estimator"},
    "virtual bus": {"tutorials/bus", "howto/run_bridge"},
    "dynamic pressure unknown": {"howto/estimate_recorded", "explanation/nonlinear_estimator"},
    "broken gauge": {"howto/settings_and_health", "evidence/fault_detection"},
    "control deflection": {"reference/vehicle_file", "howto/estimate_in_python", "howto/bring_cfd"},
    "nonlinear": {"explanation/nonlinear_estimator"},
    "section loads": {"howto/estimate_in_python", "reference/conventions", "reference/files"},
    "speed": {"evidence/speed"},
}
"""What users type, and the pages of which one is among the first three results."""

SECTIONS = ("tutorials/", "howto/", "explanation/", "evidence/", "reference/")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Return the first three pages that the search finds for each."""
    pytest.importorskip("sphinx_gallery")
    folder = tmp_path_factory.mktemp("site")
    options = ["-q", "-D", "plot_gallery=0", "-d", str(folder / "doctrees")]
    command = [sys.executable, "-m", "sphinx", *options, str(ROOT / "docs"), str(folder / "html")]
    subprocess.run(command, check=True)
    return found_in(folder / "html", folder / "profile")


def found_in(site: Path, profile: Path) -> dict[str, list[str]]:
    """Return the first three pages, once each, that the search of a built site finds."""
    browser = Browser(profile, (site / "search.html").as_uri())
    try:
        browser.wait("typeof Search !== 'undefined' && Search.hasIndex()", bool)
        search = "Search._performSearch(...Search._parseQuery({})).reverse().slice(0, 3).map(one => one[0])"
        return {words: browser.value(search.format(json.dumps(words))) for words in EXPECTED}
    finally:
        browser.close()


def test_most_words_lead_to_a_page_for_users(results: dict[str, list[str]]) -> None:
    """At least 21 of the 23."""
    lost = {
        words: pages
        for words, pages in results.items()
        if not any(page == "index" or (page.startswith(SECTIONS) and page != "reference/api") for page in pages)
    }
    assert len(lost) <= 2, lost


def test_most_words_lead_to_the_page_about_them(results: dict[str, list[str]]) -> None:
    """At least 21 of the 23."""
    missed = {words: pages for words, pages in results.items() if not EXPECTED[words] & set(pages)}
    assert len(missed) <= 2, missed
