"""The sub-commands: arguments in, calls into the packages, tables out."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from strainfmu import __version__, campaign_commands
from strainfmu.console import ConsoleReporter
from strainfmu.inverse_map import COEFFICIENT_NAMES, content_hash_of, load_inverse_map

if TYPE_CHECKING:
    from builder.demo import DemoResult

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Aerodynamic loads in real time from structural strain.",
    context_settings={"help_option_names": ["-h", "--help"]},
)

VehicleArgument = Annotated[
    Path | None,
    typer.Option("--vehicle", help="Vehicle file (TOML). Default: the IC3X surrogate that is shipped."),
]


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"strainfmu {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave."),
    ] = False,
) -> None:
    """Aerodynamic loads in real time from structural strain."""


@app.command()
def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("demo"),
    vehicle: VehicleArgument = None,
) -> None:
    """From a vehicle file to an FMU flying in a system simulation.

    Solves the flow, builds the inverse map, packages it as an FMU, and flies it against an independent, finer
    model of the vehicle. A second run reuses what is up to date.

    Examples:

        strainfmu demo

        strainfmu demo -o results --vehicle my_vehicle.toml
    """
    from builder.demo import run_demo
    from builder.vehicle import IC3X

    console = Console()
    start = perf_counter()
    result = run_demo(vehicle or IC3X, output, ConsoleReporter(console))
    _show_result(console, result)
    console.print(f"{perf_counter() - start:.1f} s in all", highlight=False)


def _show_result(console: Console, result: DemoResult) -> None:
    score = result.score
    table = Table(title=f"{result.vehicle}: the FMU's estimate against truth, independent finer model")
    for heading in ("coefficient [1]", "rms error", "of its range", "mean sigma", "truth within 3 sigma"):
        table.add_column(heading, justify="left" if heading.startswith("coefficient") else "right")
    for i, name in enumerate(COEFFICIENT_NAMES):
        table.add_row(
            name,
            f"{score.rms_error[i]:.2e}",
            f"{score.rms_error_of_range[i]:.2%}" if score.rms_error_of_range[i] >= 0.0 else "-",
            f"{score.mean_sigma[i]:.2e}",
            f"{100.0 * score.coverage[i]:.2f} %",
        )
    console.print(table)
    times = ", ".join(f"{name} {1e6 * value:.0f} us" for name, value in score.step_time.items())
    console.print(
        f"Time per step (median, through fmpy): {times}. Health OK in {score.healthy:.2%} of the samples.",
        highlight=False,
    )
    files = Table(title=f"Files in {result.folder}", show_header=False, box=None)
    for name, holds in result.files.items():
        files.add_row(name, holds, "reused" if name in result.reused else "new")
    console.print(files)


@app.command()
def check(vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")]) -> None:
    """Check a vehicle file, its gauges and its manoeuvre without solving anything.

    Example:

        strainfmu check my_vehicle.toml
    """
    from math import degrees

    from builder.aero.engines import make_engine
    from builder.flight_tables import truth_knots
    from builder.structural_model import check_gauges, check_map_size
    from builder.vehicle import load_vehicle
    from strainfmu.cosim.flight_model import check_envelope
    from strainfmu.cosim.trajectory import load_trajectory

    loaded = load_vehicle(vehicle)
    body = loaded.body()
    gauges = check_gauges(loaded)
    check_map_size(loaded, gauges[loaded.gauges.layout])
    manoeuvre = loaded.beside(loaded.truth.manoeuvre)
    trajectory = load_trajectory(manoeuvre)
    check_envelope(*truth_knots(loaded), trajectory, manoeuvre)
    conditions = loaded.flight_conditions()
    table = Table(title=f"{vehicle}: {loaded.name}", show_header=False)
    table.add_row("length, base radius", f"{body.length:.4g} m, {body.base_radius:.4g} m")
    table.add_row("tip half-angle", f"{degrees(body.tip_angle):.4g} deg")
    table.add_row("slope breaks", ", ".join(f"{x:.4g} m" for x in body.slope_breaks) or "none")
    for name, count in gauges.items():
        table.add_row(f"layout {name}{' (in use)' if name == loaded.gauges.layout else ''}", f"{count} gauges")
    engine = make_engine(loaded, None, loaded.resolution.map)
    flows = len({engine.flow_key(condition) for condition in conditions})
    table.add_row("snapshots", f"{len(conditions)} conditions, {flows} distinct flows ({engine.name})")
    table.add_row("manoeuvre", f"{trajectory.stop_time:.4g} s")
    Console().print(table)


@app.command()
def build(
    vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for snapshots.h5 and map.h5.")] = Path(
        "map"
    ),
) -> None:
    """Build the inverse map of a vehicle: snapshots.h5 and map.h5.

    Example:

        strainfmu build my_vehicle.toml -o results
    """
    from builder.demo import run_build

    console = Console()
    path = run_build(vehicle, output, ConsoleReporter(console))
    console.print(f"{path}: written", highlight=False)


app.command()(campaign_commands.snapshots)


@app.command()
def export(
    inverse_map: Annotated[Path, typer.Argument(metavar="MAP", help="Inverse map (map.h5).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="FMU to write.")] = Path("estimator.fmu"),
) -> None:
    """Package an inverse map as an FMI 2.0 co-simulation FMU.

    Example:

        strainfmu export results/map.h5 -o estimator.fmu
    """
    from strainfmu.fmu.export import export_estimator

    export_estimator(inverse_map, output)
    Console().print(f"{output}: written", highlight=False)


@app.command()
def inspect(
    inverse_map: Annotated[Path, typer.Argument(metavar="MAP", help="Inverse map (map.h5).")],
) -> None:
    """Show what an inverse map holds: gauges, validity range, uncertainty, provenance.

    Example:

        strainfmu inspect results/map.h5
    """
    import numpy as np

    loaded = load_inverse_map(inverse_map)
    q = loaded.nominal_dynamic_pressure
    reference = loaded.reference_area * np.array([1, 1, 1, loaded.reference_length, loaded.reference_length])
    sigma = np.sqrt(np.diag(loaded.load_covariance)) / (q * reference)
    console = Console()
    summary = Table(title=f"{inverse_map}: {loaded.vehicle}", show_header=False)
    summary.add_row("content hash", content_hash_of(inverse_map))
    summary.add_row("gauges, states", f"{loaded.n_gauges}, {len(loaded.state_offset)}")
    summary.add_row("gauge noise sigma", f"{1e6 * loaded.noise_std.mean():.4g} um/m")
    summary.add_row("reference area, length", f"{loaded.reference_area:.6g} m2, {loaded.reference_length:.6g} m")
    for key, value in loaded.provenance.items():
        summary.add_row(key, str(value))
    console.print(summary)
    table = Table(title=f"Coefficients over the snapshots, and sigma at q_inf = {1e-3 * q:.4g} kPa")
    for heading in ("coefficient [1]", "least", "greatest", "sigma"):
        table.add_column(heading, justify="right")
    for name, (low, high), one in zip(COEFFICIENT_NAMES, loaded.coefficient_range, sigma, strict=True):
        table.add_row(name, f"{low:.4f}", f"{high:.4f}", f"{one:.4f}")
    console.print(table)


@app.command()
def bench(
    folder: Annotated[
        Path, typer.Argument(help="Folder of a finished demo: its map and its FMUs are timed.")
    ] = Path("demo"),
) -> None:
    """Time what runs in the loop, side by side: bare product, numpy estimator, FMUs through fmpy.

    Example:

        strainfmu bench demo
    """
    from strainfmu.bench import bench_loop

    rows = bench_loop(folder / "map.h5", folder / "estimator.fmu", folder / "plant.fmu")
    table = Table(title=f"One step, {folder}: median of repeated runs in one process")
    for heading in ("what", "time per step", "of the bare product"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for name, seconds in rows.items():
        table.add_row(name, f"{1e6 * seconds:.2f} us", f"{seconds / next(iter(rows.values())):.1f} x")
    Console().print(table)


from strainfmu import surface_commands as surface_commands  # noqa: E402  adds commands to app
