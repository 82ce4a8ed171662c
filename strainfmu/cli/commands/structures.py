"""Three-dimensional structures: ``strainfmu structure`` computes the strain of gauges per surface pressure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

import builder
from strainfmu.cli.commands.number_ranges import within


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
    given, console, start = dict(locals()), Console(), perf_counter()
    if export_loads is not None:
        return _say(
            console, builder.export_loads(vehicle, export_loads, load_format, snapshots=_beside(output, snapshots))
        )
    for name in ("export_loads", "load_format", "export_influence"):
        del given[name]
    log = _StageLog(console)
    if export_influence is not None:
        names = ("resolution", "solver", "model", "layouts", "allow_locking", "mesh_unit", "by_position")
        options = {name: given[name] for name in names}
        return _say(console, builder.export_influence(vehicle, export_influence, **options, progress=log))
    found = builder.run_structure(**given, progress=log)
    _say(console, found.lines)
    if found.up_to_date is False:
        for title, seconds, peak in log.rows:
            log.note(f"{title:<30} {seconds:7.2f} s   peak memory {peak / 2**30:5.2f} GiB")
    if found.up_to_date is not None:
        state = "up to date, not computed again" if found.up_to_date else "written"
        log.note(f"{output}: {state}, {perf_counter() - start:.1f} s in all")


def _beside(output: Path, snapshots: Path | None) -> Path:
    return snapshots or output.parent / "snapshots.h5"


def _say(console: Console, lines: Sequence[str]) -> None:
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
