"""A canvas for figures: blank figures that need no display, PNG files that repeat to the byte, colours.

Colours: ends of a scale that a blunt tip or an edge of a fin does not shift, and one for each of many parts.

Words and signs of figures: one for each quantity and estimator, whatever files call them.

Fields and points on the unrolled body: station against roll angle.

Strain gauges in figures: their kinds by direction, and strokes along it on the unrolled body.

Values at places of a figure: collected while it is drawn, shown by a page under the pointer.
"""

from __future__ import annotations

import io
import re
from colorsys import hls_to_rgb
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from builder.aero.surface.mesh import SurfaceMesh
from builder.structure.observability import angle_from_meridian, direction_names
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import StrainfmuError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.files import write_bytes_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOUR_MAP = "viridis"
THIS_MAP, AT_BEST = "tab:blue", "tab:orange"
"""Colours of a map and of the best map of the same gauges."""

RESOLUTION = 130
"""Dots per inch of PNG files."""


def blank_figure(width: float, height: float) -> Figure:
    """Return an empty figure of the given size [in] that needs no display.

    Raises
    ------
    StrainfmuError
        matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise StrainfmuError("figures need matplotlib: pip install 'strainfmu[report]'") from error
    return Figure(figsize=(width, height), layout="constrained")


def settle(figure: Figure, resolution: float) -> None:
    """Place the axes of a figure for good, so that saving it at ``resolution`` [dots per inch] draws it once.

    With a layout still to find, matplotlib draws everything once more, unseen, and then finds it.
    """
    engine = figure.get_layout_engine()
    if engine is not None:
        figure.set_dpi(resolution)
        engine.execute(figure)
        figure.set_layout_engine(None)


def save(figure: Figure, path: Path, resolution: float = RESOLUTION) -> None:
    """Write a figure as PNG, atomically; ``resolution`` in dots per inch.

    Raises
    ------
    StrainfmuError
        The file could not be written.
    """
    image = io.BytesIO()
    settle(figure, resolution)
    # Without the program's name and version the same figure gives the same file.
    figure.savefig(image, format="png", dpi=resolution, metadata={"Software": None})
    write_bytes_atomically(path, image.getvalue())


SHOWN_SHARE = 0.98
"""Of the area, whose values the colours distinguish where the others are peaks."""
PEAK = 4.0
"""Highest value over the highest of :data:`SHOWN_SHARE` from which it is a peak, drawn in the last colour."""
LEAST_SPREAD = 0.1
"""Of the highest value shown; a body that is more alike, as a blunt cone without incidence, shows its tip."""


def colour_ends(surface: SurfaceMesh, values: FloatArray) -> dict[str, float]:
    """Return ``vmin`` and ``vmax`` of values (n_p,) at the nodes of a surface."""
    mean, area = values[surface.triangle].mean(axis=1), surface.area
    rising = np.argsort(mean)
    below = int(np.searchsorted(np.cumsum(area[rising]), SHOWN_SHARE * area.sum()))
    low, top, high = values.min(), values.max(), mean[rising[min(below, len(mean) - 1)]]
    peaked = top > PEAK * high and high - low > LEAST_SPREAD * high
    return {"vmin": float(low), "vmax": float(high if peaked else top)}


def ends_beyond(image: Any, values: FloatArray) -> Literal["max", "neither"]:
    """Return which end of the colour bar of ``image`` marks values beyond it."""
    return "max" if values.max() > image.get_clim()[1] else "neither"


_DARK = "1f77b4 ff7f0e 2ca02c d62728 9467bd 8c564b e377c2 7f7f7f bcbd22 17becf"
_LIGHT = "aec7e8 ffbb78 98df8a ff9896 c5b0d5 c49c94 f7b6d2 c7c7c7 dbdb8d 9edae5"
GOLDEN_ANGLE, LIGHTNESS = 0.618034, (0.35, 0.55, 0.75)


def part_colours(count: int) -> list[str]:
    """Return ``count`` colours as "#rrggbb", no two of them equal: matplotlib's tab20, then hues in between."""
    colours = f"{_DARK} {_LIGHT}".split()
    for k in range(count - len(colours)):
        colour = hls_to_rgb(GOLDEN_ANGLE * k % 1.0, LIGHTNESS[k % len(LIGHTNESS)], 0.65)
        colours.append("".join(f"{round(255.0 * part):02x}" for part in colour))
    return [f"#{colour_shown}" for colour_shown in colours[:count]]


ESTIMATORS = {"nonlinear": "nonlinear estimator", "linear": "linear map"}
"""What documents say, by the name in files."""

_COEFFICIENT = re.compile(r"\b(C_[ANY]|M_[PYR])\b")
_FREE_STREAM = re.compile(r"(\bp/)?\b([pq])_inf\b")


def estimator_in_words(name: str) -> str:
    """Return what documents call an estimator; a name that they share with files as it is."""
    return ESTIMATORS.get(name, name)


def with_signs(text: str) -> str:
    """Return ``text`` with coefficients and free-stream quantities as matplotlib sets mathematics.

    >>> with_signs("C_A over q_inf [1]")
    '$C_A$ over $q_\\\\infty$ [1]'
    """
    return _FREE_STREAM.sub(r"$\1\2_\\infty$", _COEFFICIENT.sub(r"$\1$", text))


def roll_degrees(point: FloatArray) -> FloatArray:
    """Return the roll angle [deg] of points (.., 3) in 0..360; a hair before 360 counts as 0."""
    roll = np.degrees(np.arctan2(point[..., 1], point[..., 2])) % 360.0
    return np.where(roll > 360.0 - 1e-9, 0.0, roll)


def at_roll_angles(values: FloatArray, roll_angle: FloatArray, requested: FloatArray) -> FloatArray:
    """Interpolate (n_x, n_roll) values periodically to roll angles ``requested`` [rad] in 0..2 pi."""
    angle = np.append(roll_angle, 2.0 * np.pi)
    closed = np.concatenate([values, values[:, :1]], axis=1)
    return np.stack([np.interp(requested, angle, row) for row in closed])


def unrolled_triangles(
    surface: SurfaceMesh, values: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Return points, roll angles [deg], triangles and values (n_p,) of a surface cut open at 0 deg.

    Triangles across the cut get nodes of their own beyond 360 deg. Nodes on the axis have no roll angle; their
    triangles are left out.
    """
    point, roll, triangle = surface.point, roll_degrees(surface.point), surface.triangle
    off_axis = np.hypot(point[:, 1], point[:, 2]) > 1e-9 * float(np.ptp(point[:, 0]))
    triangle = triangle[off_axis[triangle].all(axis=1)]
    across = np.ptp(roll[triangle], axis=1) > 180.0
    corner = triangle[across].ravel()
    once_round = np.where(roll[corner] < 180.0, roll[corner] + 360.0, roll[corner])
    added = len(point) + np.arange(len(corner)).reshape(-1, 3)
    return (
        np.concatenate([point, point[corner]]),
        np.concatenate([roll, once_round]),
        np.concatenate([triangle[~across], added]),
        np.concatenate([values, values[corner]]),
    )


KINDS = ("axial", "hoop", "inclined")
SENSOR = "auxiliary sensors"
"""What figures call the rows of a map that are no strain gauges."""

KIND_COLOURS = {"axial": "tab:blue", "hoop": "tab:red", "inclined": "tab:green"}
KIND_MARKERS = {"axial": "o", "hoop": "s", "inclined": "D", SENSOR: "^"}
KIND_OFFSETS = {"axial": -9.0, "hoop": 9.0, "inclined": 0.0, SENSOR: 0.0}
"""Roll angle [deg] by which marks of a kind are moved: gauges at one position would hide each other."""

_ANGLES_NAMED = 2
"""Distinct angles to the meridian that a legend names; more of them are "inclined"."""


def gauge_kinds(position: FloatArray, direction: FloatArray) -> dict[str, BoolArray]:
    """Return (n,) which gauges (n, 3) are of each kind that occurs: along the meridian, across it, or neither.

    Every gauge is of one kind.
    """
    names = np.array([name if name in KINDS else "inclined" for name in direction_names(position, direction)])
    return {kind: names == kind for kind in KINDS if (names == kind).any()}


def kinds_of_map(inverse_map: InverseMap) -> dict[str, BoolArray]:
    """Return (n_d,) which rows of a map are gauges of each kind that occurs, and which are auxiliary sensors."""
    n, rows = inverse_map.n_strain_gauges, np.arange(inverse_map.n_gauges)
    rows_of_kind = gauge_kinds(inverse_map.gauge_position[:n], inverse_map.gauge_direction[:n])
    kinds = {kind: np.append(of_kind, rows[n:] < n) for kind, of_kind in rows_of_kind.items()}
    return kinds if n == len(rows) else kinds | {SENSOR: rows >= n}


def shown_bias(inverse_map: InverseMap, bias: FloatArray) -> tuple[FloatArray, str]:
    """Return (n_d,) numbers for the colours of a bias (n_d,) [m/m], and their label.

    Beside auxiliary sensors, whose units differ, a bias counts in standard deviations of the row's noise.
    """
    if inverse_map.has_auxiliary_sensors:
        return bias / inverse_map.noise_std, "bias [sigma of its noise]"
    return 1e6 * bias, "bias [um/m]"


def kind_label(kind: str, position: FloatArray, direction: FloatArray) -> str:
    """Return a kind and the number of its gauges (n, 3) for a legend; inclined ones by angle, as "45 deg, 9"."""
    if kind == "inclined":
        angles: NDArray[np.float64] = np.unique(np.round(np.degrees(angle_from_meridian(position, direction)), 0))
        if len(angles) <= _ANGLES_NAMED:
            kind = " and ".join(f"{angle:g}" for angle in sorted(angles.tolist(), reverse=True)) + " deg"
    return f"{kind}, {len(position)}"


def draw_strokes(axis: Any, position: FloatArray, direction: FloatArray, size: float) -> None:
    """Draw one stroke per gauge (n, 3) over station [m] and roll angle [deg], along its direction.

    Colours are the kinds'; the legend counts them.
    """
    turn = np.round(np.degrees(angle_from_meridian(position, direction)), 1)
    roll = roll_degrees(position)
    for kind, chosen in gauge_kinds(position, direction).items():
        label: str | None = kind_label(kind, position[chosen], direction[chosen])
        for angle in np.unique(turn[chosen]).tolist():
            along = chosen & (turn == angle)
            axis.plot(
                position[along, 0],
                roll[along],
                linestyle="none",
                marker=(2, 2, angle - 90.0),
                markersize=size,
                markeredgewidth=2.0,
                color=KIND_COLOURS[kind],
                label=label,
            )
            label = None


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
        by_axis = dict[int, list[Area]]()
        for area in dict.fromkeys(area for _, areas in self.texts for area in areas):
            by_axis.setdefault(id(area.axis), []).append(area)
        rectangles = dict[Area, Rectangle]()
        for of_axis in by_axis.values():
            rectangles |= zip(of_axis, _in_figure(self.figure, of_axis), strict=True)
        return tuple(Place(text, tuple(rectangles[area] for area in areas)) for text, areas in self.texts)


def _in_figure(figure: Figure, areas: list[Area]) -> list[Rectangle]:
    """Return left, top, width and height of ``areas`` of the axes, over the figure's, as it is laid out."""
    axis = areas[0].axis
    within = np.sort([axis.get_xlim(), axis.get_ylim()], axis=1)
    ends = np.clip([[area.x, area.y] for area in areas], within[:, :1], within[:, 1:])  # area, x or y, end
    corners = axis.transData.transform(ends.swapaxes(1, 2).reshape(-1, 2)).reshape(-1, 2, 2)
    # Points of 1/72 in; dots go with the figure's resolution.
    pad = np.array([area.pad for area in areas]) * (figure.dpi / 72.0)
    size = np.array([figure.bbox.width, figure.bbox.height])
    low, high = (corners.min(axis=1) - pad) / size, (corners.max(axis=1) + pad) / size
    of_figure = np.column_stack([low[:, 0], 1.0 - high[:, 1], high - low])
    return [(x, y, width, height) for x, y, width, height in of_figure.tolist()]
