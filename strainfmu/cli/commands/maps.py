"""Inverse maps: ``strainfmu build``, ``export``, ``inspect``, ``bench``."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
import strainfmu
from builder.pipeline.progress_bars import ConsoleReporter
from builder.vehicle.named_file import naming
from strainfmu.cli.commands.number_ranges import within
from strainfmu.errors import InputError

if TYPE_CHECKING:
    from strainfmu.fmu.checks.worst_step import EventCost

SNAPSHOTS_OPTION = typer.Option(
    "--snapshots", metavar="FILE", help="Snapshots to use, from anywhere. Default: snapshots.h5 of the folder."
)
STRUCTURE_OPTION = typer.Option(
    "--structure", metavar="FILE", help="Structure to use, from anywhere. Default: structure.h5 of the folder."
)
REBUILD_OPTION = typer.Option(
    "--rebuild", help="Make the files of the folder again from the vehicle file, whatever options made them."
)
Estimator = Literal["auto", "linear", "nonlinear"]
ESTIMATOR_OPTION = typer.Option("--estimator", help="Estimator, instead of the vehicle file's.")


def build(
    vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for what is made.")] = Path("map"),
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    structure: Annotated[Path | None, STRUCTURE_OPTION] = None,
    rebuild: Annotated[bool, REBUILD_OPTION] = False,
    estimator: Annotated[Estimator | None, ESTIMATOR_OPTION] = None,
) -> None:
    """Build the inverse map of a vehicle, and a report on what the gauges can measure.

    Writes snapshots.h5, map.h5 and report.html. A snapshots.h5 or structure.h5 of the folder is used again if
    it fits the vehicle file. If it does not fit, the command ends with one line that says why.

    The report states what the layout observes, the uncertainty of each coefficient, the contribution of each
    gauge and the cost of its loss. The numbers are in report.json and, as CSV, in the folder report_tables.

    Examples:

        strainfmu build my_vehicle.toml -o results

        strainfmu build my_vehicle.toml -o results --snapshots flows/fine.h5 --structure meshed/structure.h5

        strainfmu build my_vehicle.toml -o results --estimator nonlinear
    """
    given, console = dict(locals()), Console()
    with naming(vehicle):
        path = builder.build(**given, progress=ConsoleReporter(console))
    for written in (path, path.with_name("report.html")):
        if written.is_file():
            console.print(f"{written}: written", highlight=False, markup=False, soft_wrap=True)


def export(
    inverse_map: Annotated[Path, typer.Argument(metavar="MAP", help="Inverse map (map.h5).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="FMU to write; with --kind c: folder.")] = Path(
        "estimator.fmu"
    ),
    kind: Annotated[
        str,
        typer.Option(
            help="native: compiled, needs nothing of its host; python: PythonFMU; c: C sources, for computers"
            " without FMI."
        ),
    ] = "native",
    fmi: Annotated[str, typer.Option(help="Version of FMI: 2 or, native only, 3.")] = "2",
    scalars: Annotated[
        bool,
        typer.Option(
            "--scalars",
            help="With --fmi 3: the scalar variables of FMI 2, for tools without arrays, as fmpy.simulate_fmu.",
        ),
    ] = False,
    platforms: Annotated[
        str, typer.Option(help="Native: all, or some of linux64, win64, darwin64, aarch64-linux, aarch64-darwin.")
    ] = "all",
    bus: Annotated[
        Path | None,
        typer.Option(
            metavar="TOML", help="With --fmi 3: strains and results are CAN frames (FMI-LS-BUS) of a bus file."
        ),
    ] = None,
    estimator: Annotated[
        Literal["linear"] | None,
        typer.Option(help="linear: the linear estimator of a map that includes both."),
    ] = None,
    inputs: Annotated[
        Literal["minimal", "full"],
        typer.Option(
            help="minimal: strain, dynamic pressure and its source, Mach number, altitude, static pressure, tare. "
            "full: also valid of each gauge and all other air data."
        ),
    ] = "minimal",
    zero_inputs: Annotated[
        bool,
        typer.Option(
            "--zero-inputs", help="Add inputs for the zero offsets of the gauges. With FMI 2, or with --scalars."
        ),
    ] = False,
    tare_known: Annotated[
        Path | None,
        typer.Option(
            metavar="TOML", help="Strain of own weight and air during a tare, from 'tare --known-output'."
        ),
    ] = None,
) -> None:
    """Package an inverse map as an FMU, or as C sources. Two exports of one map are equal to the byte.

    Native FMUs of the linear estimator are for co-simulation and model exchange, all others for co-simulation.

    Sources come with the map as a constant, CMakeLists.txt, an example, a program that measures memory and time
    of a step on the target, and README.txt. The folder must be a new one.

    Examples:

        strainfmu export results/map.h5 -o estimator.fmu

        strainfmu export results/map.h5 -o estimator.fmu --inputs full

        strainfmu export results/map.h5 -o estimator.fmu --fmi 3 --platforms linux64,win64

        strainfmu export results/map.h5 -o estimator.fmu --fmi 3 --scalars

        strainfmu export results/map.h5 -o estimator.fmu --estimator linear

        strainfmu export results/map.h5 -o estimator.fmu --zero-inputs --tare-known known.toml

        strainfmu export results/map.h5 -o ecu.fmu --fmi 3 --bus bus.toml

        strainfmu export results/map.h5 -o loads_c --kind c
    """
    given = dict(locals())
    if platforms != "all":
        given["platforms"] = [name.strip() for name in platforms.split(",")]
    found = strainfmu.export(**given)
    Console().print(f"{output}: written", highlight=False, markup=False, soft_wrap=True)
    if kind == "c":
        from strainfmu.fmu.c_folder import bounds_in

        Console().print(bounds_in(output), highlight=False, markup=False, soft_wrap=True)
    if kind == "native" and found == "nonlinear":
        note = "note: for co-simulation alone; --estimator linear has model exchange"
        Console().print(note, highlight=False, markup=False, soft_wrap=True)
    if fmi.removesuffix(".0") == "3" and not scalars and bus is None:
        note = (
            "note: strain and coefficients are arrays, which fmpy.simulate_fmu does not take; --scalars has none"
        )
        Console().print(note, highlight=False, markup=False, soft_wrap=True)
    if kind == "python":
        from strainfmu.fmu.documentation.index_page import PYTHON_FOLDERS, PYTHON_HOSTS

        for note in (
            f"{PYTHON_HOSTS}; the native kind runs in any",
            f"{PYTHON_FOLDERS}; the native kind runs from any",
        ):
            Console().print(f"note: {note}.", highlight=False, markup=False, soft_wrap=True)


def crosscheck(
    fmu: Annotated[Path, typer.Argument(metavar="FMU", help="Any FMU exported by this program.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write.")] = Path("crosscheck"),
) -> None:
    """Run an FMU in every importer that is installed; leave input, reference, options and results.

    Importers: fmpy, and ecospy and libcosimpy if they are installed. Ends with exit code 1 if a result differs
    from the reference.

    Example:

        strainfmu crosscheck estimator.fmu -o compatibility
    """
    from strainfmu.fmu.checks.crosscheck import check_results

    results = strainfmu.crosscheck(fmu, output)
    for result in results:
        Console().print(result.line, highlight=False, markup=False, soft_wrap=True)
    Console().print(f"{output}: written", highlight=False, markup=False, soft_wrap=True)
    check_results(results)


def inspect(
    artefact: Annotated[
        Path, typer.Argument(metavar="FILE", help="map.h5, structure.h5, snapshots.h5 or an FMU.")
    ],
    figures: Annotated[
        Path | None,
        typer.Option(
            "-o", "--figures", help="Folder for figures. Default: FILE's name with _figures; none of a map."
        ),
    ] = None,
) -> None:
    """Show the content of a map, a structure, a file of snapshots or an FMU.

    Map: gauges, validity range, uncertainty, provenance; with -o, figures of the value of each gauge.

    Structure: gauges, what each layout observes, strain patterns.

    Snapshots: conditions, coefficients, health of the flows; figures of pressure and forces.

    FMU of any maker: kind, platforms, variables, files; for an estimator also its map and validity.

    Examples:

        strainfmu inspect results/map.h5

        strainfmu inspect estimator.fmu

        strainfmu inspect results/snapshots.h5 -o figures
    """
    strainfmu.inspect(artefact, figures, console=Console())


def bench(
    folder: Annotated[
        Path, typer.Argument(help="Folder of a finished demo: its map and its FMUs are timed.")
    ] = Path("demo"),
    structure: Annotated[
        Path | None,
        typer.Option(metavar="VEHICLE", help="Vehicle file whose structure is timed. Not with --mesh, --worst."),
    ] = None,
    solver: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="With --structure or --mesh: solver; may be given several times."),
    ] = None,
    largest: Annotated[
        int,
        typer.Option(callback=within(1, 10**9), help="With --structure: largest number of degrees of freedom."),
    ] = 5_000_000,
    mesh: Annotated[
        Path | None,
        typer.Option(
            metavar="VEHICLE", help="Vehicle file whose meshes are compared. Not with --structure, --worst."
        ),
    ] = None,
    snapshots: Annotated[
        Path | None, typer.Option(metavar="FILE", help="With --mesh, required: snapshots.h5 of `strainfmu build`.")
    ] = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="With --mesh: table to write (CSV).")
    ] = Path("mesh_study.csv"),
    worst: Annotated[
        bool,
        typer.Option("--worst", help="Time the slowest steps of the native FMUs. Not with --structure, --mesh."),
    ] = False,
    random_steps: Annotated[
        int,
        typer.Option(
            "--random-steps", callback=within(1, 10**7), help="With --worst: steps with events at random."
        ),
    ] = 20_000,
) -> None:
    """Time the steps of the estimator: in Python, and as FMUs through fmpy.

    The table compares each with the bare product of matrix and strains. With the extra `rivals`, it includes
    learning estimators of scikit-learn.

    One other measurement is chosen by an option:

    --worst: the slowest steps of the native FMUs, such as the loss of gauges or a changed zero offset, and steps
    with events at random.

    --mesh: errors due to the mesh of the structure, in gauge strains and in a map built on each mesh.

    --structure: time and memory of the three-dimensional structure, size by size.

    Examples:

        strainfmu bench demo

        strainfmu bench --structure my_vehicle.toml --solver cyclic --solver superlu

        strainfmu bench --mesh my_vehicle.toml --snapshots results/snapshots.h5

        strainfmu bench demo --worst
    """
    if worst:
        return _show_worst_steps(strainfmu.bench_worst(folder, random_steps=random_steps), folder, random_steps)
    if mesh is not None:
        from builder.reports.mesh_study import study_table

        if snapshots is None:
            raise InputError(
                "bench --mesh: --snapshots FILE is missing: `strainfmu build VEHICLE` leaves snapshots.h5"
            )
        only, reporter = solver[0] if solver else None, ConsoleReporter(Console())
        print(study_table(builder.bench_meshes(mesh, snapshots, output, solver=only, reporter=reporter)))
        return print(f"{output}: written")
    if structure is not None:
        from builder.structure.solid.growth import growth_table

        rows_of_sizes = []
        for row in builder.bench_structure(structure, solver=solver or ["cyclic"], largest=largest):
            rows_of_sizes.append(row)
            print(f"{row.solver}, {row.n_dof:,} degrees of freedom: done", flush=True)
        return print(growth_table(rows_of_sizes))
    rows = strainfmu.bench(folder)
    rows |= _rival_costs(folder / "map.h5")
    table = Table(title=escape(f"One step, {folder}: median of repeated runs in one process"))
    for heading in ("what", "time per step", "of the bare product"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for name, seconds in rows.items():
        table.add_row(name, f"{1e6 * seconds:.2f} us", f"{seconds / next(iter(rows.values())):.1f} x")
    Console().print(table)


def _show_worst_steps(found: Mapping[str, Mapping[str, EventCost]], folder: Path, random_steps: int) -> None:
    """Print the slowest steps of the native FMUs of a map, and ``random_steps`` with events at random."""
    from strainfmu.fmu.checks.worst_step import AT_RANDOM, EVENTS, REPEATS, processor_name

    n = strainfmu.load_inverse_map(folder / "map.h5").n_gauges
    title = f"Steps of {n} gauges, {processor_name()}: median and largest of {REPEATS}, processor time in us"
    table = Table(title=escape(title))
    table.add_column("what happens in the step", justify="left")
    for name in found:
        table.add_column(name, justify="right")
    for event in (*EVENTS, AT_RANDOM):
        costs = [one.get(event) for one in found.values()]
        parts = [() if one is None else (one.median, *_some(one.rare), one.largest) for one in costs]
        table.add_row(event, *(" to ".join(f"{float(f'{1e6 * cost:.3g}'):,g}" for cost in part) for part in parts))
    table.caption = escape(f"The last row: median, 99.99 % and largest of {random_steps:,} steps.")
    Console(width=max(Console().width, 150)).print(table)


def _some(value: float | None) -> tuple[float, ...]:
    return () if value is None else (value,)


def _rival_costs(map_path: Path) -> dict[str, float]:
    """Return the time per step [s] of learning estimators; none without tables or without scikit-learn."""
    manifold = strainfmu.load_inverse_map(map_path).manifold
    if manifold is None:
        return {}
    if find_spec("sklearn") is None:
        print("learning estimators: not timed, they need strainfmu[rivals]")
        return {}
    from builder.trial.other_estimators import step_costs

    return step_costs(manifold)
