"""Three-dimensional structures: ``strainfmu structure`` computes the strain of gauges per surface pressure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from strainfmu.cli.commands.number_ranges import within

if TYPE_CHECKING:
    from builder.structure.structure_file import Structure
    from builder.vehicle.file import Vehicle


@dataclass
class _StageLog:
    """Shows stages as progress bars, notes as lines, and keeps what each stage took.

    Attributes
    ----------
    console : where it is shown.
    rows : title, seconds and peak memory of the process so far [byte] of each finished stage.
    """

    console: Console
    rows: list[tuple[str, float, int]] = field(default_factory=list)

    @contextmanager
    def stage(self, title: str) -> Iterator[Callable[[int, int], None]]:
        from builder.structure.solid.solvers.problem import peak_memory

        columns = TextColumn("{task.description:<30}"), BarColumn(bar_width=30), MofNCompleteColumn()
        start = perf_counter()
        quiet = not self.console.is_terminal
        with Progress(*columns, TimeElapsedColumn(), console=self.console, transient=True, disable=quiet) as bars:
            task = bars.add_task(title, total=None)
            yield lambda done, of: bars.update(task, completed=done, total=of)
        self.rows.append((title, perf_counter() - start, peak_memory()))

    def note(self, text: str) -> None:
        self.console.print(text, highlight=False, markup=False, soft_wrap=True)


def structure(
    vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")] = Path("structure.h5"),
    resolution: Annotated[
        str | None, typer.Option(help="coarse, medium or paper. Default: the vehicle file's.")
    ] = None,
    solver: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Solver. Default: by sectors on a swept mesh, else the fastest installed."
        ),
    ] = None,
    model: Annotated[
        str,
        typer.Option(metavar="swept|gmsh|FILE", help="Mesh: swept hexahedra, Gmsh's tetrahedra, or a file's."),
    ] = "swept",
    layouts: Annotated[
        list[str] | None,
        typer.Option(
            "--layout",
            metavar="NAME",
            help="Gauge layout; may be given several times. Default: all that a map needs.",
        ),
    ] = None,
    allow_locking: Annotated[
        bool, typer.Option("--allow-locking", help="Go on with elements that lose over 10 % of the bending.")
    ] = False,
    mesh_unit: Annotated[
        float,
        typer.Option(
            metavar="METRES",
            callback=within(1e-6, 1e3, "m"),
            help="With --model FILE: length of its unit; 0.001 for mm.",
        ),
    ] = 1.0,
    by_position: Annotated[
        bool,
        typer.Option(
            "--surfaces-by-position", help="With --model FILE: find its surfaces by position, not by name."
        ),
    ] = False,
    export_loads: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Write the snapshots' pressures as load cases. Not with --export-influence."
        ),
    ] = None,
    export_influence: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.h5", help="Write the strain per force at each outer node. Not with --export-loads."
        ),
    ] = None,
    load_format: Annotated[
        str, typer.Option(help="With --export-loads: csv, vtu (ParaView) or bdf (Nastran).")
    ] = "csv",
    snapshots: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Pressures of the load cases. Default: snapshots.h5 next to the output."
        ),
    ] = None,
) -> None:
    """Compute the strain of gauges per surface pressure by three-dimensional elasticity.

    The mesh is checked, described and tested for locking before anything is solved. A file that is up to date
    is not computed again; after a change of gauges the mesh is not checked again.

    Examples:

        strainfmu structure my_vehicle.toml -o structure.h5

        strainfmu structure my_vehicle.toml --resolution paper --layout configuration_1

        strainfmu structure my_vehicle.toml --model wall.msh --mesh-unit 0.001

        strainfmu structure my_vehicle.toml --export-loads loads --snapshots snapshots.h5
    """
    from builder.structure.solid.case import solid_case, structure_case
    from builder.structure.solid.mesh_choice import MeshChoice
    from builder.structure.solid.model import update_structure
    from builder.vehicle.file import load_vehicle
    from builder.vehicle.map_needs import used_layouts
    from builder.workspace import Workspace
    from strainfmu.cli.commands.external_structures import (
        needed_snapshots,
        write_external,
        write_influence_of,
        write_loads,
    )

    start = perf_counter()
    console = Console()
    if export_loads is not None:
        given = needed_snapshots(snapshots, output.parent, "--export-loads")
        return write_loads(load_vehicle(vehicle), given, export_loads, load_format, console)
    log = _StageLog(console)
    Workspace(output.parent)  # refuses a folder that cannot be written, before the long work
    with log.stage("Vehicle"):
        loaded = load_vehicle(vehicle)
        entry = loaded.structure.external
    if entry is not None:
        given = needed_snapshots(snapshots, output.parent, f"structure.{entry}")
        return write_external(loaded, given, output, console)
    with log.stage("Case"):
        choice = MeshChoice(
            source=model,
            resolution=resolution or loaded.structure.resolution,
            unit=mesh_unit,
            by_position=by_position,
        )
        chosen = layouts or used_layouts(loaded)
        case = structure_case(loaded, chosen, choice, solver, allow_locking)
    if export_influence is not None:
        revolved = solid_case(loaded, chosen, choice, solver, allow_locking)
        return write_influence_of(revolved, loaded, export_influence, console)
    made, up_to_date = update_structure(output, case, log)
    for line in _report(made, loaded):
        log.note(line)
    if not up_to_date:
        for title, seconds, peak in log.rows:
            log.note(f"{title:<30} {seconds:7.2f} s   peak memory {peak / 2**30:5.2f} GiB")
    state = "up to date, not computed again" if up_to_date else "written"
    log.note(f"{output}: {state}, {perf_counter() - start:.1f} s in all")


def _report(made: Structure, vehicle: Vehicle) -> Iterator[str]:
    """Yield what a structure holds: the mesh, its locking, the solver, the gauges and their mesh error."""
    from builder.structure.solid.checks.reference_loads import mesh_error_line
    from builder.structure.solid.mesh.mesh_report import report_text

    yield f"{made.vehicle}, {made.model.replace('_', ' ')}"
    yield report_text([(str(what), value, str(unit)) for what, value, unit in made.settings["mesh_report"]])
    ratios = ", ".join(f"cos({m} phi) {100.0 * r:.2f} %" for m, r in made.settings["locking"].items())
    yield f"bending of the wall kept (locking check): {ratios or 'none, a body without a cavity'}"
    used = made.statistics
    yield (
        f"solver {used['solver']}, licence {used['licence']}: relative residual {used['relative_residual']:.0e}, "
        f"of loads that move the whole body {used['probe_residual']:.0e}"
    )
    for layout in made.layouts:
        yield f"layout {layout}: {len(made.gauges_of(layout))} gauges, {len(made.point)} pressure nodes"
    noise = vehicle.noise.std_um_per_m
    yield mesh_error_line(made, None if noise is None else 1e-6 * noise)
