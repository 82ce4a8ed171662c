"""A scene as a file: .png (a still), .glb (to turn in a browser), .vtp (ParaView)."""

from __future__ import annotations

from pathlib import Path

from builder.aero.cfd.formats.vtk_files import write_vtk
from builder.figures.drawing.canvas import save
from builder.figures.scene.glb import write_glb
from builder.figures.scene.scene import Scene
from builder.figures.scene.solid_view import solid_view
from strainfmu.errors import InputError

FORMATS = (".png", ".glb", ".vtp")


def write_picture(scene: Scene, path: Path) -> None:
    """Write ``scene`` in the format of the path's suffix, atomically.

    A .vtp has the surface and the bars of the gauges with the arrays ``value``, NaN at bars, and ``gauge``, the
    number of the gauge from 0 and -1 at the surface.

    Raises
    ------
    InputError
        The suffix is none of :data:`FORMATS`.
    StrainfmuError
        The file could not be written, or matplotlib or, for .vtp, VTK is missing.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"{path}: expected a file {', '.join(FORMATS)}, got '{path.suffix}'")
    if suffix == ".glb":
        write_glb(scene, path)
    elif suffix == ".png":
        save(solid_view(scene), path)
    else:
        mesh, values, gauge = scene.whole()
        write_vtk(path, mesh, {"value": values, "gauge": gauge})
