"""Ground tests: ``strainfmu calibrate`` makes the vehicle's map as built, ``equations`` one without a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

import builder
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.maps import SNAPSHOTS_OPTION

if TYPE_CHECKING:
    from builder.pipeline.calibrate import Calibration


def calibrate(
    inverse_map: Annotated[Path, typer.Argument(metavar="MAP", help="Map of the vehicle as drawn (map.h5).")],
    test: Annotated[Path, typer.Argument(metavar="TEST", help="File of the ground test (loadtest.toml).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The calibrated map.")] = Path("calibrated.h5"),
    vehicle: Annotated[
        Path | None, typer.Option(help="Vehicle file of the map. Default: the one that the test names.")
    ] = None,
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    accept: Annotated[
        bool, typer.Option("--accept", help="Write the map although no known error explains the readings.")
    ] = False,
) -> None:
    """Estimate the vehicle as built from a ground test and make its map.

    The model predicts the reading of every gauge under the loads of the test. Gains, directions and places of
    the gauges, wall, modulus, mass, support and errors of the loads follow by Bayes' rule from the tolerances
    of the vehicle file's section `calibration`. A mass that differs is named.

    Gauges and load cases that do not fit are named and left out. Readings that no vehicle within its
    tolerances can have are refused: check loads, units and signs.

    The new map includes what the test left unknown in its noise. A report of the same name is written with it
    (.html and .pdf; load equations as .csv). It says whether to accept the test or to repeat parts of it. Check
    loads (check = true in the test's file) are predicted and not fitted. The zero offsets of the gauges are
    written as well (calibrated_zeros.toml), which `estimate`, `bridge` and `replay` take by --zeros.

    `strainfmu loadtest` proposes a test; `strainfmu loadtest --template` writes the file for a test of your own.

    Examples:

        strainfmu calibrate out/map.h5 loadtest.toml -o out/calibrated.h5

        strainfmu calibrate map.h5 loadtest.toml --vehicle my_vehicle.toml --snapshots flows/fine.h5
    """
    given, console = dict(locals()), Console()
    from builder.processors import one_thread_of_blas

    with one_thread_of_blas():
        _show(console, builder.calibrate(**given, progress=ConsoleReporter(console)))


def equations(
    test: Annotated[Path, typer.Argument(metavar="TEST", help="File of the test without a model.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The map.")] = Path("equations.h5"),
    accept: Annotated[
        bool, typer.Option("--accept", help="Write the map although the equations do not predict the loads.")
    ] = False,
) -> None:
    """Fit load equations to applied loads and readings, and make their map. No model is needed.

    Each load is a sum of gauge readings by least squares over the rows of a table: all gauges, gauges chosen by
    their T values, or a ridge. Rows without load are the zeros, marked rows are predicted and not fitted.

    The map estimates the same loads as the equations, in FMUs, recordings and on the bus. Redundant gauges check
    each other; a report and the coefficients with their standard errors are written next to the map (.html, .pdf,
    .csv).

    Examples:

        strainfmu equations wing_test.toml -o wing.h5
    """
    from builder.pipeline.equations import equations as fit

    console = Console()
    result = fit(test, output, accept=accept)
    for line in (*result.lines, ", ".join(str(path) for path in result.files)):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _show(console: Console, result: Calibration) -> None:
    from builder.calibration.estimate.remarks import remarks

    found = result.estimate
    lines = [*result.notes, *(fault.line for fault in result.faults)]
    lines.append(
        f"{found.n_readings} readings in {int(found.used.any(axis=1).sum())} cases, chi-square per reading "
        f"{found.per_reading:.3g}, squared distance from the files {found.from_priors:.3g} (1 is expected of both)"
    )
    lines += [f"warning: {line}" for line in (*remarks(found), *result.outside.lines)]
    if result.verdict is not None:
        lines.append(f"{result.verdict.title}:")
        lines += [f"  {line}" for line in result.verdict.reasons]
        lines += [f"would help most: {line}" for line in result.verdict.helps]
    lines.append(", ".join(str(path) for path in result.files))
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
