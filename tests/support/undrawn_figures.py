"""Figures that are made, saved as a point, and not drawn."""

from collections.abc import Callable
from io import BytesIO
from typing import Any


def blank_image(kind: str) -> bytes:
    """Return the smallest picture of a kind, "png" or "svg"."""
    if kind == "svg":
        return b'<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>'
    from PIL import Image

    stream = BytesIO()
    Image.new("L", (1, 1)).save(stream, kind)
    return stream.getvalue()


def draw_nothing(replace: Callable[[Any, str, Any], None]) -> None:
    """Have figures for the product's files neither arranged nor drawn; ``replace`` is as ``setattr``."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    drawn = Figure.savefig

    def savefig(figure: Figure, target: Any, **options: Any) -> None:
        if isinstance(target, BytesIO):
            target.write(blank_image(options["format"]))
        else:
            drawn(figure, target, **options)

    replace(Figure, "savefig", savefig)
    replace(ConstrainedLayoutEngine, "execute", lambda engine, figure: None)
