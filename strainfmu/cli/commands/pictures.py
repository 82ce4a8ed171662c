"""``strainfmu picture``: the vehicle in three dimensions, with its gauges."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

import builder
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
    scene = builder.picture(folder, output, case=case, excluded=excluded or ())
    Console().print(
        f"{output}: {scene.title}; {len(scene.gauge_names)} gauges, written",
        highlight=False,
        markup=False,
        soft_wrap=True,
    )
