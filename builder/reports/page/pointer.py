"""Values of a figure under the pointer: transparent shapes over the picture, each with its text as title.

A browser shows a title after a moment, without scripts. A few lines of script show it at once, under touch, too.
"""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from builder.figures.drawing.values import Place, Rectangle

POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'"
)
"""Content security policy of every page: a browser fetches nothing for it."""

UNITS = 4000
"""Units of the shapes along each side of a picture: integers keep pages small."""


def overlay(places: Iterable[Place]) -> str:
    """Return the shapes for ``places`` as SVG that fills the box of its picture; empty without places."""
    shapes = "".join(map(_shape, places))
    if not shapes:
        return ""
    size = f'viewBox="0 0 {UNITS} {UNITS}" preserveAspectRatio="none"'
    return f'<svg class="values" {size} role="group" aria-label="Values in the figure">\n{shapes}</svg>\n'


def _shape(place: Place) -> str:
    """Return one path with its title; nothing for a text without any area."""
    path = "".join(map(_outline, place.rectangles))
    return f'<path d="{path}"><title>{escape(place.text, quote=False)}</title></path>\n' if path else ""


def _outline(rectangle: Rectangle) -> str:
    left, top, width, height = rectangle
    x0, y0, x1, y1 = (round(UNITS * value) for value in (left, top, left + width, top + height))
    return f"M{x0} {y0}H{x1}V{y1}H{x0}z" if x1 > x0 and y1 > y0 else ""


POINTER_STYLE = """\
.picture > div { position: relative; display: inline-block; max-width: 100%; } .picture img { display: block; }
.picture svg.values { position: absolute; left: 0; top: 0; width: 100%; height: 100%; }
svg.values path { fill: transparent; vector-effect: non-scaling-stroke; }
svg.values path:hover { fill: rgb(255 255 255 / 0.4); stroke: #000; stroke-width: 1px; }
#value { position: fixed; z-index: 1; pointer-events: none; white-space: pre-line; max-width: 90vw;
  padding: 0.25rem 0.5rem; background: #fff; border: 1px solid #444; font-size: 0.85rem; line-height: 1.35;
  font-variant-numeric: tabular-nums; }
#value[hidden] { display: none; }
@media screen and (max-width: 700px) { .picture { overflow-x: auto; }
  .picture > div { min-width: 42rem; max-width: none; } }
@media print { #value { display: none; } }
"""

SCRIPT = """\
"use strict";
const box = document.body.appendChild(document.createElement("div"));
box.id = "value";
box.setAttribute("role", "tooltip");
box.hidden = true;
const hide = () => { box.hidden = true; };
const show = event => {
  const place = event.target instanceof Element ? event.target.closest("svg.values path") : null;
  if (!place) return hide();
  const title = place.querySelector("title");
  if (title) {  // the browser would show it a second time
    place.setAttribute("aria-label", title.textContent);
    title.remove();
  }
  box.textContent = place.getAttribute("aria-label");
  box.hidden = false;
  const { offsetWidth: width, offsetHeight: height } = box;
  const gap = event.pointerType === "touch" ? 32 : 14;
  const above = event.clientY - gap - height;
  const below = event.clientY + gap;
  const isAbove = above >= 0 && (event.pointerType === "touch" || below + height > innerHeight);
  box.style.left = `${Math.max(4, Math.min(event.clientX + gap, innerWidth - width - 4))}px`;
  box.style.top = `${isAbove ? above : below}px`;
};
document.addEventListener("pointermove", show);
document.addEventListener("pointerdown", show);
// A finger leaves the page when it is lifted: its text stays to be read.
document.addEventListener("pointerleave", event => { if (event.pointerType !== "touch") hide(); });
document.addEventListener("scroll", hide, { capture: true, passive: true });
document.addEventListener("keydown", event => { if (event.key === "Escape") hide(); });
"""
