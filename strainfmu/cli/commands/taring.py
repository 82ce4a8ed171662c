"""Zeros of the gauges from a recording: ``strainfmu tare``."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console

import builder
import strainfmu
from strainfmu.cli.commands.number_ranges import number, within
from strainfmu.errors import InputError, StrainfmuError

if TYPE_CHECKING:
    from strainfmu.estimator.zeros.tare import Tare

DateOrderOption = Annotated[
    Literal["day", "month"] | None,
    typer.Option("--date-order", help="What stands first in dates of figures, such as 03/04/2026."),
]


def tare(
    inverse_map: Annotated[Path, typer.Argument(metavar="MAP", help="Inverse map (map.h5).")],
    recording: Annotated[
        Path,
        typer.Argument(metavar="RECORDING", help="CSV, HDF5, MDF, TDMS, MAT, Parquet, as for `estimate`."),
    ],
    window: Annotated[
        str, typer.Option(metavar="FROM:TO", help="Times of the recording, in s, in which the loads are known.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Zero offsets to write (TOML).")] = Path(
        "zeros.toml"
    ),
    channels: Annotated[
        Path | None, typer.Option(metavar="TOML", help="Which channel of the recorder is which gauge.")
    ] = None,
    date_order: DateOrderOption = None,
    max_dynamic_pressure: Annotated[
        float, number(0.0, 1e5, "Pa", "Largest dynamic pressure in the window.")
    ] = 100.0,
    largest_zero: Annotated[float, number(1.0, 5e4, "um/m", "Largest plausible zero offset.")] = 2000.0,
    largest_drift: Annotated[float, number(0.0, 5e4, "um/m", "Largest drift over the window.")] = 2.0,
    vehicle: Annotated[
        Path | None,
        typer.Option(
            metavar="TOML", help="Vehicle file: subtracts the strain of own weight or air, of the options below."
        ),
    ] = None,
    weight_up_roll_deg: Annotated[
        float | None,
        typer.Option(
            metavar="DEG",
            callback=within(-360.0, 360.0, "deg"),
            help="With --vehicle: roll angle of the meridian that is up.",
        ),
    ] = None,
    weight_nose_deg: Annotated[
        float,
        typer.Option(
            metavar="DEG",
            callback=within(-90.0, 90.0, "deg"),
            help="With --weight-up-roll-deg: elevation of the nose.",
        ),
    ] = 0.0,
    ambient_pressure: Annotated[
        float, number(0.0, 1e6, "Pa", "With --vehicle: pressure of the air inside and outside.")
    ] = 0.0,
    known_output: Annotated[
        Path | None,
        typer.Option(
            metavar="TOML", help="With --vehicle: write the strain of the known loads (tare.known of a bus file)."
        ),
    ] = None,
    accept: Annotated[
        bool, typer.Option("--accept", help="Write the zero offsets although a check refuses them.")
    ] = False,
) -> None:
    """Find the zero offsets of the gauges: mean of a window of a recording, with standard deviations.

    The window has 64 samples or more. The command refuses a window in which the loads are not known: with
    dynamic pressure, with readings that drift or move, or with values too large for zero offsets.

    Own weight and ambient pressure are loads too. State them with --vehicle, or every estimate includes them
    with the wrong sign.

    Examples:

        strainfmu tare map.h5 ground.csv --window 0:10 -o zeros.toml

        strainfmu tare map.h5 ground.tdms --window 5:65 --channels channels.toml --vehicle my_vehicle.toml
        --weight-up-roll-deg 0 --ambient-pressure 101325
    """
    from strainfmu.estimator.zeros.tare_verdict import refusal

    known, known_of = None, dict[str, str | float]()
    if vehicle is not None:
        known, known_of = builder.known_strain(
            inverse_map,
            vehicle,
            weight_up_roll_deg=weight_up_roll_deg,
            weight_nose_deg=weight_nose_deg,
            ambient_pressure=ambient_pressure,
            known_output=known_output,
        )
    console = Console()
    try:
        found = strainfmu.tare(
            inverse_map,
            recording,
            _window(window),
            output,
            channels=channels,
            date_order=date_order,
            max_dynamic_pressure=max_dynamic_pressure,
            largest_zero=largest_zero,
            largest_drift=largest_drift,
            known=known,
            known_of=known_of,
            accept=accept,
        )
    except StrainfmuError as error:
        _show_notes(console, recording, getattr(error, "__notes__", ()))
        raise
    _show_notes(console, recording, (*found.notes, *(f"accepted: {why}" for why in [refusal(found)] if why)))
    console.print(_summary(found), highlight=False, markup=False, soft_wrap=True)
    console.print(f"{output}: written", highlight=False, markup=False, soft_wrap=True)


def _show_notes(console: Console, recording: Path, notes: Sequence[str]) -> None:
    for note in notes:
        console.print(f"{recording}: {note}", highlight=False, markup=False, soft_wrap=True)


def _window(text: str) -> tuple[float, float]:
    begin, colon, end = text.partition(":")
    try:
        numbers = float(begin), float(end)
    except ValueError as error:
        raise InputError(f"--window: expected FROM:TO in seconds, as 0:10, got '{text}'") from error
    if not colon or not all(map(isfinite, numbers)):
        raise InputError(f"--window: expected FROM:TO in seconds, as 0:10, got '{text}'")
    return numbers


def _summary(found: Tare) -> str:
    import numpy as np

    zeros = 1e6 * found.zeros.value
    known = found.zeros.std < 0.01
    std = 1e6 * found.zeros.std[known]
    if not known.any():
        return f"no zeros from {found.samples} samples"
    return (
        f"{int(known.sum())} zeros from {found.samples} samples: rms {np.sqrt(np.mean(zeros**2)):.4g} um/m, "
        f"standard deviations {std.min():.2g} to {std.max():.2g} um/m each and "
        f"{1e6 * found.zeros.common_std:.2g} um/m in common (readings remember: factor {found.memory:.2g})"
    )
