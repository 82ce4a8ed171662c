"""Values at places of a figure: collected while it is drawn, shown by a page under the pointer."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENDS = (-np.inf, np.inf)
"""An interval that an axis ends on both sides."""

Rectangle = tuple[float, float, float, float]
"""Left, top, width and height, as fractions of the figure's."""

MARK = 5.0
"""Half the side [pt] of the square about a mark that shows its text."""


def digits(value: float) -> str:
    """Return a number with four significant digits; a dash where it is not finite."""
    return f"{value + 0.0:.4g}" if np.isfinite(value) else "–"


@dataclass(frozen=True, eq=False)
class Area:
    """A rectangle of axes, no larger than these.

    Attributes
    ----------
    axis : matplotlib's axes, with separable coordinates.
    x, y : ends in data coordinates, in either order.
    pad : what is added on every side along x and y [pt].
    """

    axis: Any
    x: tuple[float, float]
    y: tuple[float, float]
    pad: tuple[float, float] = (0.0, 0.0)

    def in_figure(self, figure: Figure) -> Rectangle:
        """Return left, top, width and height over the figure's, as it is laid out."""
        within_x, within_y = sorted(self.axis.get_xlim()), sorted(self.axis.get_ylim())
        corner = np.column_stack([np.clip(self.x, *within_x), np.clip(self.y, *within_y)])
        # Points of 1/72 in; dots go with the figure's resolution.
        pad = np.multiply(self.pad, figure.dpi / 72.0)
        corners = self.axis.transData.transform(corner)
        size = np.array([figure.bbox.width, figure.bbox.height])
        low, high = (corners.min(axis=0) - pad) / size, (corners.max(axis=0) + pad) / size
        return float(low[0]), float(1.0 - high[1]), float(high[0] - low[0]), float(high[1] - low[1])


def mark(axis: Any, x: float, y: float, radius: float = MARK) -> Area:
    """Return the square about a mark at a point in data coordinates; ``radius`` [pt]."""
    return Area(axis, (x, x), (y, y), (radius, radius))


def column(axis: Any, x: float, width: float = 1.0) -> Area:
    """Return all of the axes between ``x`` -+ half of ``width``."""
    return Area(axis, (x - 0.5 * width, x + 0.5 * width), ENDS)


def cell(axis: Any, x: float, y: float, width: float = 1.0, height: float = 1.0) -> Area:
    """Return the rectangle about a point in data coordinates."""
    return Area(axis, (x - 0.5 * width, x + 0.5 * width), (y - 0.5 * height, y + 0.5 * height))


@dataclass(frozen=True)
class Place:
    """A text, lines separated by line feeds, and the rectangles of the figure that show it, as fractions of it."""

    text: str
    rectangles: tuple[Rectangle, ...]


@dataclass(frozen=True, eq=False)
class ValuedFigure:
    """A figure whose marks and cells have texts; a later text lies above an earlier one.

    Attributes
    ----------
    figure : matplotlib's.
    texts : each with its rectangles.
    """

    figure: Figure
    texts: list[tuple[str, tuple[Area, ...]]] = field(default_factory=list)

    def annotate(self, *areas: Area, text: str) -> None:
        """Give some areas one text."""
        self.texts.append((text, areas))

    def places(self) -> tuple[Place, ...]:
        """Return the texts with their rectangles; the figure must have been drawn, so that its layout is final."""
        return tuple(
            Place(text, tuple(area.in_figure(self.figure) for area in areas)) for text, areas in self.texts
        )
