"""Ground tests with known loads: ``strainfmu loadtest``."""

from __future__ import annotations

from math import isfinite, radians
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.number_ranges import number, within
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from builder.calibration.plan.load_plan import LoadPlan


def loadtest(
    vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")],
    template: Annotated[
        bool,
        typer.Option("--template", help="Write a file to fill in for a test of your own. Not with other loads."),
    ] = False,
    cases: Annotated[
        int, typer.Option(metavar="N", callback=within(1, 200), help="Load cases, in addition to own weight.")
    ] = 12,
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")] = Path("loadtest.toml"),
    force: Annotated[float, number(0.0, 1e7, "N", "Largest force on a pad.")] = 1500.0,
    directions: Annotated[
        str, typer.Option(help="Directions of a pad's force: some of in, out, axial, around, with commas.")
    ] = "in",
    stations: Annotated[
        str, typer.Option(help="Stations of the pads in m, with commas. Default: ten along the hollow part.")
    ] = "",
    roll_angles: Annotated[
        str, typer.Option(help="Roll angles of the pads in deg, with commas.")
    ] = "0,45,90,135,180,225,270,315",
    attitudes: Annotated[
        str,
        typer.Option(
            help="Attitudes of the vehicle: roll angles in deg of the meridian that points up, with commas."
        ),
    ] = "0,90,180,270",
    pad_length: Annotated[float, number(1.0, 1e4, "mm", "Length of a pad.")] = 100.0,
    pad_angle: Annotated[float, number(1.0, 180.0, "deg", "Angle that a pad spans.")] = 60.0,
    pressure: Annotated[float, number(0.0, 1e5, "kPa", "Internal pressure; 0: none.")] = 0.0,
    axial: Annotated[float, number(0.0, 1e7, "N", "Axial force; 0: none.")] = 0.0,
    largest_strain: Annotated[
        float, number(1.0, 1e5, "um/m", "Largest strain of any gauge; loads are lowered to it.")
    ] = 1000.0,
    load_error: Annotated[float, number(0.0, 100.0, "%", "Error of each load, 1 sigma.")] = 0.5,
    cell_error: Annotated[float, number(0.0, 100.0, "%", "Error of all loads together, 1 sigma.")] = 0.5,
    noise: Annotated[
        float | None,
        number(1e-4, 1e3, "um/m", "Noise of one sample of the recorder, 1 sigma. Default: the vehicle file's."),
    ] = None,
    samples: Annotated[
        int, typer.Option(metavar="N", callback=within(1, 10**6), help="Samples that a reading is the mean of.")
    ] = 25,
    steps: Annotated[
        int, typer.Option(metavar="N", callback=within(1, 20), help="Steps of loading, and as many of unloading.")
    ] = 2,
    checks: Annotated[
        int, typer.Option(metavar="N", callback=within(0, 50), help="Check loads, which the fit does not see.")
    ] = 2,
    repeats: Annotated[
        int,
        typer.Option(metavar="N", callback=within(0, 200), help="Load cases that are applied again at the end."),
    ] = 1,
    setup_time: Annotated[float, number(0.0, 1e4, "min", "Time to set up a case or an attitude.")] = 15.0,
    reading_time: Annotated[
        float, number(0.0, 1e4, "min", "Time to apply a load, wait until it stands and record it.")
    ] = 1.0,
    snapshots: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Flows in flight (snapshots.h5). Default: local inclination."),
    ] = None,
) -> None:
    """Propose the load cases of a ground test, in the order in which they lower the uncertainty in flight.

    Prints the gain of each case, what the test leaves undetermined and the time it takes. Writes a file of the
    test, to be filled in after it, and a figure. Each load is applied in steps, and removed in steps down to
    zero; check loads, repeated cases and zero readings are part of the file.

    For bodies of revolution that are held, with any wall, frames and materials; for others `strainfmu equations`
    needs no model. Own weight comes first, in each attitude; it needs material.density_kg_per_m3 in the vehicle
    file. Section `calibration` of the vehicle file states the tolerances of the vehicle as built.

    With --template, writes a file of examples instead, for a test that you have designed or done yourself.

    Examples:

        strainfmu loadtest my_vehicle.toml --template -o loadtest.toml

        strainfmu loadtest my_vehicle.toml --cases 12 -o loadtest.toml

        strainfmu loadtest my_vehicle.toml --force 800 --stations 0.6,1.2,2.4 --directions in,around --pressure 100
    """
    given, console, start = dict(locals()), Console(), perf_counter()
    if given.pop("template"):
        builder.loadtest_template(vehicle, output, load_error=load_error, cell_error=cell_error)
        lines = (f"{output}: written", f"fill it in, then: strainfmu calibrate map.h5 {output} -o calibrated.h5")
        for line in lines:
            console.print(line, highlight=False, markup=False, soft_wrap=True)
        return
    given |= {
        "directions": [one.strip() for one in directions.split(",")],
        "stations": numbers("--stations", stations) if stations else None,
        "roll_angles": [*map(radians, numbers("--roll-angles", roll_angles))],
        "attitudes": [*map(radians, numbers("--attitudes", attitudes))],
    }
    found = builder.loadtest(**given, progress=ConsoleReporter(console))
    _show(console, found.plan)
    for line in found.lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    console.print(
        f"{', '.join(map(str, found.files))}: {perf_counter() - start:.1f} s in all",
        highlight=False,
        markup=False,
        soft_wrap=True,
    )


def _show(console: Console, plan: LoadPlan) -> None:
    from builder.pipeline.load_test_proposal import sigma_rows

    table = Table(title="Sigma in flight over the sigma of a vehicle known exactly")
    table.add_column("", justify="right")
    table.add_column("applied, after all above")
    for name in COEFFICIENT_NAMES:
        table.add_column(name, justify="right")
    for row, (name, ratio) in enumerate(sigma_rows(plan), start=-1):
        table.add_row(str(row) if row > 0 else "", escape(name), *(f"{one:.3g}" for one in ratio))
    console.print(table)
    console.print(f"{plan.candidates} load cases compared.", highlight=False)


def numbers(option: str, text: str) -> list[float]:
    """Return the finite numbers of an option's text, separated by commas."""
    try:
        found = [float(one) for one in text.split(",")]
    except ValueError as error:
        raise InputError(f"{option}: expected numbers with commas, got '{text}'") from error
    if not all(map(isfinite, found)):
        raise InputError(f"{option}: expected finite numbers, got '{text}'")
    return found
