"""A scene as a file: .png (a still), .glb (to turn in a browser), .vtp (ParaView)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from builder.aero.cfd.formats.vtk_files import write_vtk
from builder.campaign.snapshots import load_snapshots
from builder.figures.drawing.canvas import save
from builder.figures.scene.glb import write_glb
from builder.figures.scene.scene import Scene, scene_of_snapshot
from builder.figures.scene.solid_view import solid_view
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import load_inverse_map

FORMATS = (".png", ".glb", ".vtp")


def picture(
    folder: str | Path, output: str | Path, *, case: int | None = None, excluded: Sequence[str] = ()
) -> Scene:
    """Draw the vehicle in three dimensions: pressure on its surface, a bar for each gauge.

    A .png is a still from two sides, a .glb can be turned in any browser's viewer, a .vtp is for ParaView.

    On the command line::

        strainfmu picture demo -o vehicle.glb
        strainfmu picture demo -o vehicle.png --case 12 --excluded A1 --excluded A2

    Parameters
    ----------
    folder : folder with map.h5 and snapshots.h5, as build and demo leave it.
    output : file to write: .png, .glb or .vtp.
    case : number of the snapshot, from 1, whose pressure is shown. Default: of greatest incidence.
    excluded : gauges to draw in black.

    Raises
    ------
    InputError
        A file is missing, a gauge or a snapshot is not there, or the suffix is none of these.
    StrainfmuError
        The file could not be written, or matplotlib or, for .vtp, VTK is missing.
    """
    folder = Path(folder)
    for name in ("map.h5", "snapshots.h5"):
        if not (folder / name).is_file():
            raise InputError(f"{folder}: expected {name}, as `strainfmu build` and `demo` leave it, got none")
    inverse_map, snapshots = load_inverse_map(folder / "map.h5"), load_snapshots(folder / "snapshots.h5")
    number = None if case is None else case - 1
    scene = scene_of_snapshot(snapshots, inverse_map, inverse_map.vehicle, number, excluded)
    write_picture(scene, Path(output))
    return scene


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
