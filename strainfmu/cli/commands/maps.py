"""Inverse maps: ``strainfmu build``, ``export``, ``inspect``, ``bench``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
import strainfmu
from builder.pipeline.progress_bars import ConsoleReporter
from builder.vehicle.toml.reading import naming
from strainfmu.cli.commands.printed import say
from strainfmu.errors import InputError

if TYPE_CHECKING:
    from builder.pipeline.gauge_growth import GaugeRow
    from strainfmu.cli.peers import PeerRow
    from strainfmu.fmu.checks.worst_step import EventCost


def build(*, vehicle: Path, **options: Any) -> None:
    """Build a map and print the files."""
    from builder.processors import keep_freed_memory, one_thread_of_blas

    keep_freed_memory()
    with naming(vehicle), one_thread_of_blas():
        path = builder.build(vehicle, **options, progress=True)
    say(*(f"{file}: written" for file in (path, path.with_name("report.html")) if file.is_file()))


def export(*, output: Path, **options: Any) -> None:
    """Export a map, and print what to know of the kind."""
    estimator, kind = strainfmu.export(output=output, **options), options["kind"]
    say(f"{output}: written")
    if kind == "c":
        from strainfmu.fmu.c_folder import bounds_in

        say(bounds_in(output))
    if kind == "native" and estimator == "nonlinear":
        say("note: for co-simulation alone; --estimator linear has model exchange")
    if options["fmi"].removesuffix(".0") == "3" and not options["scalars"] and options["bus"] is None:
        say("note: strain and coefficients are arrays, which fmpy.simulate_fmu does not take; --scalars has none")
    if kind == "python":
        from strainfmu.fmu.documentation.index_page import PYTHON_FOLDERS, PYTHON_HOSTS

        say(f"note: {PYTHON_HOSTS}; the native kind runs in any.")
        say(f"note: {PYTHON_FOLDERS}; the native kind runs from any.")


def crosscheck(*, fmu: Path, output: Path) -> None:
    """Run an FMU in every importer; exit code 1 if a result differs."""
    from strainfmu.fmu.checks.crosscheck import check_results

    results = strainfmu.crosscheck(fmu, output)
    say(*(result.line for result in results), f"{output}: written")
    check_results(results)


def inspect(**options: Any) -> None:
    """Show a file."""
    strainfmu.inspect(**options, console=Console())


def bench(
    *,
    folder: Path,
    structure: Path | None,
    solver: list[str],
    largest: int,
    mesh: Path | None,
    snapshots: Path | None,
    output: Path,
    gauges: Path | None,
    most: int,
    growth: Path,
    worst: bool,
    peers: bool,
    random_steps: int,
) -> None:
    """Time what the options choose, and print a table."""
    if peers:
        return _show_peers(strainfmu.bench_peers(folder))
    if worst:
        return _show_worst_steps(strainfmu.bench_worst(folder, random_steps=random_steps), folder, random_steps)
    if snapshots is None and (mesh is not None or gauges is not None):
        option = "--mesh" if mesh is not None else "--gauges"
        raise InputError(
            f"bench {option}: --snapshots FILE is missing: `strainfmu build VEHICLE` leaves snapshots.h5"
        )
    if gauges is not None and snapshots is not None:
        return _show_gauges(builder.bench_gauges(gauges, snapshots, growth, most=most), growth)
    if mesh is not None and snapshots is not None:
        from builder.reports.mesh_study import study_table

        only, reporter = solver[0] if solver else None, ConsoleReporter(Console())
        print(study_table(builder.bench_meshes(mesh, snapshots, output, solver=only, reporter=reporter)))
        return print(f"{output}: written")
    if structure is not None:
        from builder.reports.growth import growth_table

        rows_of_sizes = []
        for row in builder.bench_structure(structure, solver=solver, largest=largest):
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


def _show_gauges(rows: Iterable[GaugeRow], growth: Path) -> None:
    """Print what maps of more and more gauges cost, line by line."""
    print(f"{'gauges':>6}  build s  load ms  step us  nonlinear  one lost  third lost  reading us  file MB")
    for row in rows:
        times = f"{row.build:>7.1f}  {1e3 * row.load:>7.2f}  {1e6 * row.linear:>7.1f}  {1e6 * row.nonlinear:>9.1f}"
        lost = f"{1e6 * row.one_lost:>8.0f}  {1e6 * row.third_lost:>10.0f}"
        print(f"{row.gauges:>6}  {times}  {lost}  {1e6 * row.reading:>10.1f}  {row.file:>7.2f}", flush=True)
    print(f"{growth}, {growth.with_suffix('.png')}: written")


def _show_peers(rows: Sequence[PeerRow]) -> None:
    """Print what this package and others need for the same work, over this package's time."""
    from strainfmu.fmu.checks.worst_step import processor_name

    table = Table(title=escape(f"The same work by others, {processor_name()}: processor time"), box=SIMPLE_HEAD)
    for heading in ("task", "program", "gives", "time", "of strainfmu's"):
        table.add_column(heading, justify="right" if heading in ("time", "of strainfmu's") else "left")
    ours = rows[0]
    for row in rows:
        first, cells = row.task != ours.task or row is ours, ("-", row.reason)
        ours = row if first else ours
        if not row.reason:
            cells = f"{float(f'{1e6 * row.seconds:.3g}'):,g} us", f"{row.seconds / ours.seconds:.2g} x"
        table.add_row(*(escape(cell) for cell in (row.task if first else "", row.program, row.gives, *cells)))
    Console(width=max(Console().width, 150)).print(table)


def _show_worst_steps(measured: Mapping[str, Mapping[str, EventCost]], folder: Path, random_steps: int) -> None:
    """Print the slowest steps of the native FMUs of a map, and ``random_steps`` with events at random."""
    from strainfmu.fmu.checks.worst_step import AT_RANDOM, EVENTS, REPEATS, processor_name

    n = strainfmu.load_inverse_map(folder / "map.h5").n_gauges
    title = f"Steps of {n} gauges, {processor_name()}: median and largest of {REPEATS}, processor time in us"
    table = Table(title=escape(title))
    table.add_column("what happens in the step", justify="left")
    for name in measured:
        table.add_column(name, justify="right")
    for event in (*EVENTS, AT_RANDOM):
        costs = [events.get(event) for events in measured.values()]
        parts = [() if times is None else (times.median, *_some(times.rare), times.largest) for times in costs]
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
    from builder.trial.compared import step_costs

    return step_costs(manifold)
