"""What a reader of a page cannot see: content that does not fit into its box, or into the window."""

import time
from pathlib import Path

from chromium import Browser

WIDTHS = (1280, 768)
"""Widths of the window [px] at which nothing may be clipped."""

PATIENCE = 3.0
"""Time [s] in which figures that are drawn again fit."""

CLIPPED = """(() => {
  document.querySelectorAll("details").forEach(one => { one.open = true; });
  window.dispatchEvent(new Event("resize"));
  const name = one => one.tagName.toLowerCase() + (one.id ? "#" + one.id : "") +
    (one.getAttribute("class") ? "." + one.getAttribute("class") : "");
  const found = [];
  const limit = document.documentElement.clientWidth + 1;
  for (const one of document.querySelectorAll("body, body *")) {
    const box = one.getBoundingClientRect();
    if (!box.width || !box.height || box.right < 0) continue;  // left of the window: hidden on purpose
    const drawn = one instanceof SVGElement && one.ownerSVGElement;  // its place counts, it has no box
    if (!drawn && one.clientWidth && one.scrollWidth > one.clientWidth + 1)
      found.push(`${name(one)}: ${one.scrollWidth} in ${one.clientWidth}`);
    if (box.right > limit || box.left < -1) found.push(`${name(one)}: ends at ${Math.round(box.right)}`);
    if (one.tagName === "text") {
      const svg = one.ownerSVGElement.getBoundingClientRect();
      if (box.right > svg.right + 1 || box.left < svg.left - 1 || box.top < svg.top - 1 ||
          box.bottom > svg.bottom + 1)
        found.push(`text ${one.textContent} beyond its figure`);
    }
  }
  return found;
})()"""
"""Elements wider inside than outside, or beyond the window, and texts that leave their figure; all folds open."""


def set_width(browser: Browser, width: int, height: int = 900) -> None:
    """Give the page's window a size [px]."""
    browser.call(
        "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
    )


def show(browser: Browser, page: Path, condition: str = "true") -> None:
    """Show the file ``page`` and wait until it is loaded and ``condition`` holds in it."""
    url = page.resolve().as_uri()
    browser.call("Page.navigate", url=url)
    browser.wait(f"location.href === '{url}' && document.readyState === 'complete' && ({condition})", bool)


def clipped(browser: Browser, width: int, patience: float = PATIENCE) -> list[str]:
    """Return what is clipped at ``width`` [px]."""
    set_width(browser, width)
    end = time.monotonic() + patience
    while (cut_texts := browser.value(CLIPPED)) and time.monotonic() < end:
        time.sleep(0.1)
    assert isinstance(cut_texts, list)
    return cut_texts
