"""``strainfmu picture``: the vehicle in three dimensions, with its gauges."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from strainfmu.cli.commands.number_ranges import within


def picture(
    folder: Annotated[
        Path, typer.Argument(help="Folder with map.h5 and snapshots.h5, as build and demo leave it.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write: .png, .glb or .vtp.")],
    case: Annotated[
        int | None,
        typer.Option(
            metavar="NUMBER",
            callback=within(1, 1e6),
            help="Number of the snapshot whose pressure is shown. Default: of greatest incidence.",
        ),
    ] = None,
    excluded: Annotated[
        list[str] | None,
        typer.Option("--excluded", metavar="GAUGE", help="Gauge to draw in black; may be given several times."),
    ] = None,
) -> None:
    """Draw the vehicle in three dimensions: pressure on its surface, a bar for each gauge.

    A .png is a still from two sides, a .glb can be turned in any browser's viewer, a .vtp is for ParaView.

    Examples:

        strainfmu picture demo -o vehicle.glb

        strainfmu picture demo -o vehicle.png --case 12 --excluded A1 --excluded A2
    """
    from builder.campaign.snapshots import load_snapshots
    from builder.figures.scene.picture_files import write_picture
    from builder.figures.scene.scene import scene_of_snapshot
    from strainfmu.errors import InputError
    from strainfmu.estimator.map.inverse_map import load_inverse_map

    for name in ("map.h5", "snapshots.h5"):
        if not (folder / name).is_file():
            raise InputError(f"{folder}: expected {name}, as `strainfmu build` and `demo` leave it, got none")
    one, snapshots = load_inverse_map(folder / "map.h5"), load_snapshots(folder / "snapshots.h5")
    scene = scene_of_snapshot(snapshots, one, one.vehicle, None if case is None else case - 1, excluded or ())
    write_picture(scene, output)
    Console().print(
        f"{output}: {scene.title}; {len(scene.gauge_names)} gauges, written",
        highlight=False,
        markup=False,
        soft_wrap=True,
    )
