"""The pressure on the unrolled body as a browser draws it."""

import time
from pathlib import Path

import pytest
from chromium import PROGRAM, Browser
from clipping import WIDTHS, clipped, set_width
from field_maps import N_D, field_map
from test_field_display import cycle

from strainfmu.can.page_message import FieldMessages, GaugePosition
from strainfmu.can.publisher import Publisher
from strainfmu.can.quality import FrameAccount, Quality
from strainfmu.monitor.server import Monitor

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")

DRAWN = """[document.getElementById("field_section").hidden, document.querySelectorAll("#field image").length,
  document.getElementById("field_range").textContent].join("|")"""


def test_pressure_is_drawn_and_goes_with_the_estimate(tmp_path: Path) -> None:
    monitor = Monitor(("127.0.0.1", 0), ("127.0.0.1", 0))
    browser = Browser(tmp_path / "profile", monitor.url)
    positions = [GaugePosition(f"g{k}", 0.1 * (k % 9), 40.0 * (k // 9)) for k in range(N_D)]
    publisher = Publisher(
        monitor.listens_at, positions, rate=50.0, account=FrameAccount, field=FieldMessages(field_map())
    )
    quality = Quality.VALID

    def shows(words: str) -> bool:
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            publisher.result(cycle(quality))
            if words in str(browser.value(DRAWN)):
                return True
            time.sleep(0.05)
        return False

    try:
        browser.wait(DRAWN, lambda drawn: str(drawn).startswith("true|0"))  # once the page is there
        assert shows("kPa (dark)")
        assert str(browser.value(DRAWN)).startswith("false|1")
        for width in WIDTHS:
            set_width(browser, width)
            assert shows("kPa (dark)")
            assert clipped(browser, width) == []
        quality = Quality.STALE
        assert shows("false|0|no estimate")
    finally:
        browser.close()
        publisher.close()
        monitor.close()
