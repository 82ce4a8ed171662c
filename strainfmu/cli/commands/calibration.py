"""A ground test turns the map of the drawing into that of the vehicle as built: ``strainfmu calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.maps import SNAPSHOTS_OPTION

if TYPE_CHECKING:
    from builder.pipeline.calibrate import Calibration


def calibrate(
    inverse_map: Annotated[Path, typer.Argument(metavar="MAP", help="Map of the vehicle as drawn.")],
    test: Annotated[Path, typer.Argument(metavar="TEST", help="File of the ground test (loadtest.toml).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The calibrated map.")] = Path("calibrated.h5"),
    vehicle: Annotated[
        Path | None, typer.Option(help="Vehicle file of the map. Default: the one that the test names.")
    ] = None,
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    accept: Annotated[
        bool, typer.Option("--accept", help="Write the map although no error with a name explains the readings.")
    ] = False,
) -> None:
    """Estimate the vehicle as built from a ground test and make its map.

    The model tells what every gauge should read under the loads of the test, the test what it did read. Gains,
    directions and places of the gauges, wall, modulus, mass, support and the errors of the loads follow by
    Bayes' rule from the tolerances of the vehicle file's section `calibration`. A mass that differs is named.
    Gauges and load cases that do not fit are named and left out. Taper and second harmonic of the wall are
    taken for zero, and noise for what is stated: a warning says by how much they are not, and what to do.
    Readings that no vehicle near its tolerances has, and that no fault or noise with a name explains, are
    refused: check loads, units and signs. The map has the strain operator as built, and in its noise what the
    test left unknown; a report of the same name is written beside it, and the zeros of the gauges
    (calibrated_zeros.toml), which `estimate`, `bridge` and `replay` take by --zeros. Snapshots are taken from
    the map's folder.

    Examples:

        strainfmu calibrate out/map.h5 loadtest.toml -o out/calibrated.h5

        strainfmu calibrate map.h5 loadtest.toml --vehicle my_vehicle.toml --snapshots flows/fine.h5
    """
    from builder.pipeline.calibrate import run_calibrate

    console = Console()
    result = run_calibrate(
        inverse_map,
        test,
        output,
        ConsoleReporter(console),
        vehicle_path=vehicle,
        snapshots_path=snapshots,
        accept=accept,
    )
    _show(console, result)


def _show(console: Console, result: Calibration) -> None:
    from builder.calibration.estimate.remarks import remarks

    found = result.estimate
    lines = [*result.notes, *(fault.line for fault in result.faults)]
    lines.append(
        f"{found.n_readings} readings in {len(found.model.test.cases)} cases, chi-square per reading "
        f"{found.per_reading:.3g} (1 is expected)"
    )
    lines += [f"warning: {line}" for line in (*remarks(found), *result.outside.lines)]
    lines.append(", ".join(str(path) for path in result.files))
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
