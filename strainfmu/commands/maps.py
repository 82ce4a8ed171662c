"""Inverse maps: ``strainfmu build``, ``export``, ``inspect``, ``bench``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from strainfmu.console import ConsoleReporter


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
    console.print(f"{path}: written", highlight=False, soft_wrap=True)


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
    Console().print(f"{output}: written", highlight=False, soft_wrap=True)


def inspect(
    artefact: Annotated[Path, typer.Argument(metavar="FILE", help="map.h5, structure.h5 or snapshots.h5.")],
    figures: Annotated[
        Path | None,
        typer.Option("-o", "--figures", help="Folder for figures. Default: FILE's name with _figures."),
    ] = None,
) -> None:
    """Show what a map, a structure or a file of snapshots holds.

    Of a map: gauges, validity range, uncertainty, provenance.

    Of a structure: gauges, what each layout can see, strain patterns.

    Of snapshots: conditions, coefficients, health of the flows; figures of pressure and forces.

    Examples:

        strainfmu inspect results/map.h5

        strainfmu inspect results/snapshots.h5 -o figures
    """
    from strainfmu.inspection import inspect_artefact

    inspect_artefact(artefact, figures, Console())


def bench(
    folder: Annotated[
        Path, typer.Argument(help="Folder of a finished demo: its map and its FMUs are timed.")
    ] = Path("demo"),
    structure: Annotated[
        Path | None,
        typer.Option(metavar="VEHICLE", help="Time the 3-D structure of this vehicle file instead, size by size."),
    ] = None,
    solver: Annotated[
        list[str] | None, typer.Option(help="Solver of the structure; may be given several times.")
    ] = None,
    largest: Annotated[int, typer.Option(help="Largest number of degrees of freedom.")] = 5_000_000,
) -> None:
    """Time what runs in the loop: bare product, numpy estimator, FMUs through fmpy. Or the structure's growth.

    Examples:

        strainfmu bench demo

        strainfmu bench --structure my_vehicle.toml --solver cyclic --solver superlu
    """
    if structure is not None:
        from builder.structure.solid.growth import SIZES, growth_rows, growth_table

        sizes = [size for size in SIZES if size <= largest]
        rows_of_sizes = []
        for row in growth_rows(structure, solver or ["cyclic"], sizes):
            rows_of_sizes.append(row)
            print(f"{row.solver}, {row.n_dof:,} degrees of freedom: done", flush=True)
        print(growth_table(rows_of_sizes))
        return
    from strainfmu.bench import bench_loop

    rows = bench_loop(folder / "map.h5", folder / "estimator.fmu", folder / "plant.fmu")
    table = Table(title=f"One step, {folder}: median of repeated runs in one process")
    for heading in ("what", "time per step", "of the bare product"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for name, seconds in rows.items():
        table.add_row(name, f"{1e6 * seconds:.2f} us", f"{seconds / next(iter(rows.values())):.1f} x")
    Console().print(table)
