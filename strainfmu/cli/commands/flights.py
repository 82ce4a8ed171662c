"""Closed-loop flight: ``strainfmu fly``, and the native plant alone: ``strainfmu plant``."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
import strainfmu
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.number_ranges import number, within

if TYPE_CHECKING:
    from strainfmu.cosim.flight import FlightResult
    from strainfmu.cosim.scenario import Scenario


def fly(
    scenario: Annotated[
        Path, typer.Argument(help="Scenario file (TOML); docs/reference/scenario.md lists its entries.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for FMUs, recordings, figures.")] = Path(
        "flight"
    ),
    files: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of map.h5 and flight_model.h5. Default: the scenario's own."),
    ] = None,
    ssp: Annotated[
        Path | None,
        typer.Option(metavar="X.ssp", help="Write the system as an SSP package too, and X_connectors.ssp."),
    ] = None,
    fmi: Annotated[
        Literal["2", "3"], typer.Option(help="3: write the FMUs in FMI 3.0 too, into OUTPUT/fmi_3; 2.0 flies.")
    ] = "2",
    figures: Annotated[bool, typer.Option(help="Draw every run.")] = True,
) -> None:
    """Fly a scenario in closed loop: plant, estimator and autopilot, each an FMU.

    One run per feedback, with the plant's true coefficients or the estimator's: a table, recordings, figures. Ends
    with exit code 1 if the loop does not hold its angle of attack.

    Examples:

        strainfmu fly ic3x_flight.toml --files demo -o flight

        strainfmu fly ic3x_flight.toml --files demo --ssp flight.ssp
    """
    console = Console()
    reporter = ConsoleReporter(console)
    flown = strainfmu.fly(scenario, output, files=files, ssp=ssp, fmi=fmi, progress=reporter.stage)
    written = [*flown.files]
    if figures:
        written += builder.flight_figures(flown, output)
    results, loaded = flown.results, flown.scenario
    _print_results(console, loaded, results)
    for path in written:
        console.print(f"{path}: written", highlight=False, markup=False, soft_wrap=True)
    if flown.fault is not None:
        raise flown.fault
    if not all(result.holds for result in results.values()):
        console.print("the loop does not hold its angle of attack", highlight=False)
        raise typer.Exit(1)


def plant(
    flight_model: Annotated[Path, typer.Argument(metavar="FLIGHT_MODEL", help="flight_model.h5 of a demo.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="FMU to write.")] = Path("plant.fmu"),
    fmi: Annotated[Literal["2", "3"], typer.Option(help="2 for FMI 2.0, 3 for FMI 3.0.")] = "2",
    motion: Annotated[
        str, typer.Option(help="inputs, trajectory, or short_period (responds to a control moment).")
    ] = "inputs",
    trajectory: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="With --motion trajectory: the table to fly.")
    ] = None,
    mach_number: Annotated[
        float | None,
        typer.Option(
            callback=within(1.01, 30.0),
            help="Start value. Default: the middle of the model's. Not with --motion trajectory.",
        ),
    ] = None,
    altitude: Annotated[
        float | None,
        number(0.0, 71.0, "km", "Start value. Default: 20. Not with --motion trajectory."),
    ] = None,
    angle_of_attack: Annotated[
        float | None,
        number(-60.0, 60.0, "deg", "Start value. Default: 0. Not with --motion trajectory."),
    ] = None,
    sideslip: Annotated[
        float | None,
        number(-60.0, 60.0, "deg", "Start value. Default: 0. Not with --motion trajectory."),
    ] = None,
    bus: Annotated[
        Path | None, typer.Option(metavar="BUS.toml", help="With --fmi 3: send the strains as CAN frames.")
    ] = None,
    recording: Annotated[
        Path | None, typer.Option(metavar="FILE", help="With --bus: recorded strains to send, a row a cycle.")
    ] = None,
) -> None:
    """Package a flight model as a native FMU: strains with noise and gauge faults, and the true coefficients.

    Examples:

        strainfmu plant demo/flight_model.h5 -o plant.fmu

        strainfmu plant demo/flight_model.h5 --fmi 3 -o plant_3.fmu

        strainfmu plant demo/flight_model.h5 --motion trajectory --trajectory manoeuvre.csv
    """
    strainfmu.plant(**locals())
    Console().print(f"{output}: written", highlight=False, markup=False, soft_wrap=True)


def _print_results(console: Console, scenario: Scenario, results: dict[str, FlightResult]) -> None:
    """Print one column per run."""
    from strainfmu.cosim.flight import fault_text

    table = Table(title=escape(f"{scenario.name}: {scenario.stop_time:g} s at {1.0 / scenario.step_size:g} Hz"))
    table.add_column("")
    for feedback in results:
        table.add_column(f"feedback of {feedback}", justify="right")
    shown = list(results.values())
    rows = {
        "tracking error, rms": [f"{degrees(r.tracking_error):.3f} deg" for r in shown],
        "largest error when settled": [f"{degrees(r.settled_error):.3f} deg" for r in shown],
        "inferred angle, rms error": [f"{degrees(r.angle_error):.3f} deg" for r in shown],
        "C_N, rms error": [f"{r.coefficient_error[0]:.2e}" for r in shown],
        "M_P, rms error": [f"{r.coefficient_error[1]:.2e}" for r in shown],
        "health": [", ".join(f"{name} {fraction:.2%}" for name, fraction in r.health.items()) for r in shown],
    }
    for index, event in enumerate(scenario.faults):
        reports = [r.faults[index] for r in shown]
        rows[escape(fault_text(event))] = [
            f"{_after(report.reported_after, 'reported')}, {_after(report.isolated_after, 'isolated')}"
            for report in reports
        ]
    for name, cells in rows.items():
        table.add_row(name, *cells)
    console.print(table)
    if {"truth", "estimate"} <= results.keys():
        ratio = results["estimate"].tracking_error / results["truth"].tracking_error
        console.print(f"Tracking error with the estimate: {ratio:.3f} of that with truth.", highlight=False)


def _after(seconds: float | None, what: str) -> str:
    return f"not {what}" if seconds is None else f"{what} after {1e3 * seconds:.0f} ms"
