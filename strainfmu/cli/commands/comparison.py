"""Estimators of several kinds on the same readings: ``strainfmu compare``."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from builder.figures.drawing.words import estimator_in_words
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.maps import REBUILD_OPTION, SNAPSHOTS_OPTION, STRUCTURE_OPTION
from strainfmu.cli.commands.number_ranges import within
from strainfmu.cli.named_vehicle import naming

if TYPE_CHECKING:
    from builder.compare.run import CompareResult


def compare(
    vehicle: Annotated[
        Path | None, typer.Argument(help="Vehicle file (TOML). Default: the IC3X surrogate that is shipped.")
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("compare"),
    conditions: Annotated[
        int, typer.Option(metavar="N", callback=within(1, 10_000), help="Flight conditions inside the envelope.")
    ] = 300,
    draws: Annotated[
        int,
        typer.Option(
            metavar="N", callback=within(1, 10_000), help="Draws of vehicle and noise at every condition."
        ),
    ] = 8,
    training: Annotated[
        int,
        typer.Option(
            metavar="N",
            callback=within(1200, 10_000_000),
            help="Flights that train each learning estimator.",
        ),
    ] = 12_000,
    seed: Annotated[int, typer.Option(callback=within(0, 2**31 - 1), help="Seed of all draws.")] = 1,
    snapshots: Annotated[Path | None, SNAPSHOTS_OPTION] = None,
    structure: Annotated[Path | None, STRUCTURE_OPTION] = None,
    rebuild: Annotated[bool, REBUILD_OPTION] = False,
) -> None:
    """Score estimators of eight kinds on the same readings of a truth model of the vehicle.

    The kinds are the linear maps of both cases, the nonlinear estimator and a Kalman filter with a random
    walk. The extra `rivals` adds regression tree, random forest, gradient boosting and multi-layer perceptron.

    The scores are rms errors, coverage of 3 sigma, error of the pressure field, air data and cost of a step in
    Python. Each is given for gauge noise alone and for installation errors, with all air-data inputs and with
    q_inf only. Rows of the Cramer-Rao bound state what no unbiased estimate of one reading falls below.

    Writes compare.json, compare.csv and compare.png. Flows are kept as they are solved: an interrupted run
    continues, and a second run reuses what is up to date.

    Examples:

        strainfmu compare my_vehicle.toml -o compare

        strainfmu compare my_vehicle.toml -o compare --snapshots flows/fine.h5 --conditions 1000
    """
    from builder.compare.flights import Effort
    from builder.compare.run import run_compare
    from builder.pipeline.pipeline import FilesGiven
    from builder.vehicle.file import IC3X

    console, start = Console(), perf_counter()
    with naming(vehicle or IC3X):
        result = run_compare(
            vehicle or IC3X,
            output,
            ConsoleReporter(console),
            effort=Effort(conditions=conditions, draws=draws, seed=seed, training=training),
            given=FilesGiven(snapshots=snapshots, structure=structure, rebuild=rebuild),
        )
    _show(console, result)
    written = ", ".join(str(path) for path in result.files)
    console.print(
        f"{written}: {perf_counter() - start:.1f} s in all", highlight=False, markup=False, soft_wrap=True
    )


def _show(console: Console, result: CompareResult) -> None:
    coefficients = list(result.entries[0]["rms"])
    for errors in dict.fromkeys(one["errors"] for one in result.entries):
        title = (
            f"{result.vehicle}, {errors}: rms errors [1e-4]; smallest coverage, field error [%]; angles p95 [deg]"
        )
        table = Table(title=escape(title), box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
        table.add_column("estimator")
        for heading in (*coefficients, "inside 3 sigma", "field median", "field p95", "a", "b", "step [us]"):
            table.add_column(heading, justify="right", min_width=4)
        for one in result.entries:
            if one["errors"] == errors:
                known = _known(one)
                table.add_row(escape(estimator_in_words(one["estimator"]) + known), *_cells(one))
        for known, bound in _bounds(result.entries, errors).items():
            table.add_row(escape(f"Cramer-Rao bound{known}"), *_coefficients(bound))
        console.print(table)
    for aim in result.aims:
        console.print(f"aim of the nonlinear estimator {aim.line}", highlight=False, markup=False, soft_wrap=True)


def _known(one: dict[str, Any]) -> str:
    """Return what an estimator is given, where that is not everything."""
    return "" if one["air_data_inputs"] == "given" else f", {one['air_data_inputs']}"


def _bounds(entries: list[dict[str, Any]], errors: str) -> dict[str, dict[str, Any]]:
    """Return the bound of the coefficients by what is given, the same for every estimator."""
    stated = [one for one in entries if one["errors"] == errors and any(one["bound"].values())]
    return {_known(one): one["bound"] for one in stated}


def _coefficients(values: dict[str, float | None]) -> list[str]:
    return [_text(None if value is None else 1e4 * value, "{:.1f}", "{:.2f}") for value in values.values()]


def _cells(one: dict[str, Any]) -> list[str]:
    air = one["air_data_p95"]
    return [
        *_coefficients(one["rms"]),
        _text(min(share for share in one["coverage_percent"].values() if share is not None), "{:.1f}"),
        _text(one["field_median_percent"], "{:.2f}"),
        _text(one["field_p95_percent"], "{:.2f}"),
        *(_text(air[name], "{:.2f}") for name in ("angle_of_attack_deg", "sideslip_deg")),
        _text(one["step_microseconds"], "{:.0f}"),
    ]


def _text(value: float | None, form: str, below_one: str = "") -> str:
    if value is None:
        return "-"
    return (below_one if below_one and value < 1.0 else form).format(value)
