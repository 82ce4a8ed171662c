"""The scripts of a page whose figures show their values: plotly.js, packed, and what draws the figures with it.

plotly.js comes with the Python package plotly. It stands in the page once, compressed to a third of its size;
browsers since 2023 unpack it. Without it, or without scripts, a page shows its still pictures.
"""

from __future__ import annotations

import json
from base64 import b64encode
from functools import cache
from gzip import compress
from importlib.util import find_spec

from builder.figures.drawing.hover import HoverFigure

NEEDS_PLOTLY = "Figures are stills: values under the pointer need plotly, pip install 'strainfmu[report]'."
POLICY = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "font-src data:; base-uri 'none'; form-action 'none'"
)
"""Content security policy of every page: a browser fetches nothing for it."""


def available() -> bool:
    """Return whether plotly is installed."""
    return find_spec("plotly") is not None


def figure_data(figure: HoverFigure) -> str:
    """Return the element that holds a figure's data."""
    # "<" could end the element, or begin a comment in it.
    text = json.dumps(figure, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json">{text}</script>'


@cache
def packed_plotly() -> str:
    """Return plotly.js as gzip in base 64.

    Raises
    ------
    ImportError
        plotly is not installed.
    """
    from plotly.offline import get_plotlyjs

    return b64encode(compress(get_plotlyjs().encode(), mtime=0)).decode("ascii")


def scripts() -> str:
    """Return the elements that draw the figures, for the end of the page."""
    packed = f'<script type="application/octet-stream" id="plotly">{packed_plotly()}</script>'
    return f"{packed}\n<script>\n{DRAW}</script>"


DRAW = """\
"use strict";
(async () => {
  const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), one => one.charCodeAt(0));
  const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const plotly = document.createElement("script");
  plotly.textContent = await new Response(unpacked).text();
  document.head.append(plotly);
  for (const figure of document.querySelectorAll("figure.hover")) {
    const still = figure.querySelector("img");
    const drawn = document.createElement("div");
    still.after(drawn);
    const { data, layout } = JSON.parse(figure.querySelector("script").textContent);
    await Plotly.newPlot(drawn, data, layout, { responsive: true, displaylogo: false });
    still.hidden = true;
  }
  document.documentElement.dataset.figures = "drawn";
})().catch(error => {
  document.documentElement.dataset.figures = "stills";
  console.error("figures are stills:", error);
});
"""
