"""A canvas for figures: blank figures that need no display, PNG files that repeat to the byte, colours."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from strainfmu.errors import StrainfmuError
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
