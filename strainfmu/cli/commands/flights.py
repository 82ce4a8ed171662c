"""Closed-loop flight: ``strainfmu fly``, and the native plant alone: ``strainfmu plant``."""

from __future__ import annotations

from math import degrees, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.number_ranges import within

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
    figures: Annotated[bool, typer.Option(help="Draw every run.")] = True,
) -> None:
    """Fly a scenario in closed loop: plant, estimator and autopilot, each an FMU.

    One run per feedback, with the plant's true coefficients or the estimator's: a table, recordings, figures. Ends
    with exit code 1 if the loop does not hold its angle of attack.

    Examples:

        strainfmu fly ic3x_flight.toml --files demo -o flight

        strainfmu fly ic3x_flight.toml --files demo --ssp flight.ssp
    """
    from strainfmu.cli.flight_figure import save_flight_figure
    from strainfmu.cosim.flight import flight_result, flight_system
    from strainfmu.cosim.flight import fly as run_flight
    from strainfmu.cosim.models.flight_model import load_flight_model
    from strainfmu.cosim.scenario import load_scenario
    from strainfmu.cosim.systems.recording import save_csv, save_hdf5
    from strainfmu.cosim.systems.ssp import check_ssp_path, write_ssp
    from strainfmu.errors import StrainfmuError
    from strainfmu.fmu.flight_export import export_flight

    if ssp is not None:
        check_ssp_path(ssp)
    console = Console()
    reporter = ConsoleReporter(console)
    loaded = load_scenario(scenario, files)
    model = load_flight_model(loaded.flight_model)
    with reporter.stage("FMUs"):
        fmus = export_flight(loaded, output)
    written = [*fmus.values()]
    results: dict[str, FlightResult] = {}
    for feedback in loaded.feedback:
        with reporter.stage(f"Flight: feedback of {feedback}") as progress:
            try:
                recording = run_flight(
                    loaded, fmus, feedback, lambda time: progress(round(100 * time / loaded.stop_time), 100)
                )
            except StrainfmuError:
                if results:  # what was flown before stays worth reading
                    _print_results(console, loaded, results)
                raise
        results[feedback] = flight_result(loaded, recording, model)
        stem = output / f"flight_{feedback}"
        save_hdf5(recording, stem.with_suffix(".h5"))
        save_csv(recording, stem.with_suffix(".csv"))
        written += [stem.with_suffix(".h5"), stem.with_suffix(".csv")]
        if figures:
            save_flight_figure(loaded, recording, feedback, stem.with_suffix(".png"))
            written.append(stem.with_suffix(".png"))
    if ssp is not None:
        system = flight_system(loaded, fmus, loaded.feedback[-1])
        with_connectors = ssp.with_name(f"{ssp.stem}_connectors{ssp.suffix}")
        for path, connectors in ((ssp, False), (with_connectors, True)):
            write_ssp(system, path, loaded.name, loaded.stop_time, loaded.step_size, connectors)
            written.append(path)
    _print_results(console, loaded, results)
    for path in written:
        console.print(f"{path}: written", highlight=False, markup=False, soft_wrap=True)
    if not all(result.holds for result in results.values()):
        console.print("the loop does not hold its angle of attack", highlight=False)
        raise typer.Exit(1)


def plant(
    flight_model: Annotated[Path, typer.Argument(metavar="FLIGHT_MODEL", help="flight_model.h5 of a demo.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="FMU to write.")] = Path("plant.fmu"),
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
        typer.Option(
            metavar="KM",
            callback=within(0.0, 71.0, "km"),
            help="Start value. Default: 20. Not with --motion trajectory.",
        ),
    ] = None,
    angle_of_attack: Annotated[
        float | None,
        typer.Option(
            metavar="DEG",
            callback=within(-60.0, 60.0, "deg"),
            help="Start value. Default: 0. Not with --motion trajectory.",
        ),
    ] = None,
    sideslip: Annotated[
        float | None,
        typer.Option(
            metavar="DEG",
            callback=within(-60.0, 60.0, "deg"),
            help="Start value. Default: 0. Not with --motion trajectory.",
        ),
    ] = None,
) -> None:
    """Package a flight model as a native FMU: strains with noise and gauge faults, and the true coefficients.

    Examples:

        strainfmu plant demo/flight_model.h5 -o plant.fmu

        strainfmu plant demo/flight_model.h5 --motion trajectory --trajectory manoeuvre.csv
    """
    from strainfmu.cosim.models.flight_model import load_flight_model
    from strainfmu.errors import InputError
    from strainfmu.fmu.plant_export import export_native_plant
    from strainfmu.interface.plant_variables import FlightStart, Motion

    names = [item.name.lower() for item in Motion]
    if motion not in names:
        raise InputError(f"--motion: expected one of {', '.join(names)}, got '{motion}'")
    given = {
        "--mach-number": mach_number,
        "--altitude": altitude,
        "--angle-of-attack": angle_of_attack,
        "--sideslip": sideslip,
    }
    named = [name for name, value in given.items() if value is not None]
    if named and motion == Motion.TRAJECTORY.name.lower():
        raise InputError(f"{named[0]}: not with --motion trajectory, whose table states it")
    knots = load_flight_model(flight_model).mach_knots
    middle = 0.5 * float(knots[0] + knots[-1])
    mach, km, incidence, slip = (
        default if value is None else value
        for value, default in zip(given.values(), (middle, 20.0, 0.0, 0.0), strict=True)
    )
    start = FlightStart(
        mach_number=mach, altitude=1e3 * km, angle_of_attack=radians(incidence), sideslip_angle=radians(slip)
    )
    export_native_plant(flight_model, output, Motion[motion.upper()], start, trajectory)
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
