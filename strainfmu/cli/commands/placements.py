"""Placement of gauges and review of layouts: ``strainfmu place`` and ``strainfmu review``."""

from __future__ import annotations

from math import radians
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.table import Table

import builder
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.load_tests import numbers
from strainfmu.cli.commands.number_ranges import number, within
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from builder.pipeline.gauge_placement import ProposedGauges


def place(
    vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")],
    gauges: Annotated[
        int, typer.Option(metavar="N", callback=within(1, 2000), help="Number of gauges to place.")
    ] = 36,
    output: Annotated[Path, typer.Option("-o", "--output", help="Layout file to write (CSV).")] = Path(
        "layout.csv"
    ),
    stations: Annotated[
        str, typer.Option(help="Stations of the candidates in m: numbers with commas, or first:last:step.")
    ] = "",
    roll_angles: Annotated[
        str, typer.Option(help="Roll angles of the candidates in deg: numbers with commas, or first:last:step.")
    ] = "",
    directions: Annotated[
        str, typer.Option(help="Directions at each point: some of axial, hoop, 45, -45, rosette, with commas.")
    ] = "axial,hoop",
    spacing: Annotated[
        float, number(0.0, 1e4, "mm", "Smallest distance of gauges that are not at one point.")
    ] = 20.0,
    forbid: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ZONE", help="Zone without gauges: x1:x2 in m, or x1:x2@roll1:roll2 in deg. Repeatable."
        ),
    ] = None,
    keep: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Layout file (CSV) of gauges that are placed in any case.")
    ] = None,
    pairs: Annotated[
        str, typer.Option(help="Place pairs: mirror (roll angles phi and -phi) or opposite (phi and phi + 180).")
    ] = "",
    budget: Annotated[
        float | None, number(1e-6, 1e9, "cost", "Largest cost of all gauges, instead of their number.")
    ] = None,
    costs: Annotated[str, typer.Option(help="Cost of a gauge by its direction, as axial=1,hoop=1.5.")] = "",
    cable: Annotated[
        str,
        typer.Option(
            metavar="COST@X", help="Cost of a metre of cable along the body to station X in m; with --budget."
        ),
    ] = "",
    kinds: Annotated[
        int | None,
        typer.Option(metavar="K", callback=within(1, 4), help="Use at most K of the directions, the best ones."),
    ] = None,
    goal: Annotated[str, typer.Option(help="What to minimise: loads, field, air-data or d-optimal.")] = "loads",
    loads: Annotated[
        str, typer.Option(help="Weights of the loads, as C_A=1,M_P=2; loads that are not named have 0.")
    ] = "",
    estimator: Annotated[
        str,
        typer.Option(help="linear or nonlinear. Default: as map.h5 next to the snapshots, else map.estimator."),
    ] = "",
    starts: Annotated[int, typer.Option(callback=within(1, 1000), help="Starts of the exchanges.")] = 20,
    robust: Annotated[
        bool, typer.Option("--robust", help="Keep every sigma within 1.3 times after the loss of any one gauge.")
    ] = False,
    losses: Annotated[
        int, typer.Option(callback=within(1, 2), help="Gauges lost together that --robust is about, 1 or 2.")
    ] = 1,
    curves: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Figure of accuracy against the number of gauges (PNG).")
    ] = None,
    snapshots: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Flows in flight (snapshots.h5). Default: local inclination."),
    ] = None,
) -> None:
    """Place gauges so that the loads are as certain as possible, and write the layout.

    Candidates are all directions at a grid of stations and roll angles on the inner surface. The criterion is the
    estimator's own uncertainty over the flight states of the snapshots, installation errors included. Prints the
    sigmas with the layout in use and with the placed gauges, and how far any other choice could be below.

    Examples:

        strainfmu place my_vehicle.toml --gauges 36 -o layout.csv --snapshots results/snapshots.h5

        strainfmu place my_vehicle.toml --gauges 24 --forbid 1.2:1.5 --forbid 0:4@80:100 --pairs mirror --robust
    """
    given, console, start = dict(locals()), Console(), perf_counter()
    found = builder.place(
        **given
        | {
            "stations": _series("--stations", stations) if stations else None,
            "roll_angles": _radians(_series("--roll-angles", roll_angles)) if roll_angles else None,
            "directions": [one.strip() for one in directions.split(",")],
            "forbid": [_zone(one) for one in forbid or ()],
            "costs": _named("--costs", costs),
            "cable": _cable(cable) if cable else (0.0, 0.0),
            "loads": _named("--loads", loads) if loads else None,
            "estimator": _estimator(estimator),
        },
        progress=ConsoleReporter(console),
    )
    written = str(output) if curves is None else f"{output}, {curves}"
    _show(console, found)
    console.print(
        f"{written}: {perf_counter() - start:.1f} s in all", highlight=False, markup=False, soft_wrap=True
    )


def review(
    vehicle: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")],
    layout: Annotated[
        str, typer.Option(help="A layout of the vehicle file, or a layout file (CSV). Default: that in use.")
    ] = "",
    output: Annotated[Path, typer.Option("-o", "--output", help="Page to write, with a PDF next to it.")] = Path(
        "review.html"
    ),
    estimator: Annotated[
        str,
        typer.Option(help="linear or nonlinear. Default: as map.h5 next to the snapshots, else map.estimator."),
    ] = "",
    snapshots: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Flows in flight (snapshots.h5). Default: local inclination."),
    ] = None,
) -> None:
    """Review a gauge layout: what it observes, what each gauge contributes, and which losses it does not bear.

    The page names the weakest load and the reason, the gauges that could go, and the one gauge that would help
    most.

    Examples:

        strainfmu review my_vehicle.toml --layout layout.csv -o review.html --snapshots results/snapshots.h5
    """
    given, console, start = dict(locals()), Console(), perf_counter()
    given |= {"layout": layout or None, "estimator": _estimator(estimator)}
    found = builder.review(**given, progress=ConsoleReporter(console))
    name, gain = found.best
    written = [output, *([pdf] if (pdf := output.with_suffix(".pdf")).is_file() else [])]
    for line in (
        f"weakest: {found.weakest_line}",
        *found.weak_points,
        f"could go: {', '.join(found.spare) or 'none'}",
        f"would help most: {name}, the criterion falls by {100.0 * gain:.2f} %",
        f"{', '.join(map(str, written))}: {perf_counter() - start:.1f} s in all",
    ):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _estimator(text: str) -> Literal["linear", "nonlinear"] | None:
    """Return the estimator of ``--estimator``, None where it was not given."""
    known: dict[str, Literal["linear", "nonlinear"]] = {"linear": "linear", "nonlinear": "nonlinear"}
    if text and text not in known:
        raise InputError(f"--estimator: expected linear or nonlinear, got '{text}'")
    return known.get(text)


def _show(console: Console, found: ProposedGauges) -> None:
    placement, study = found.placement, found.study
    own = study.parts.vehicle.gauges.layout
    table = Table(title="Sigma over the flight states [1e-4]")
    table.add_column("layout")
    table.add_column("gauges", justify="right")
    for name in COEFFICIENT_NAMES:
        table.add_column(name, justify="right")
    own_count = int(study.candidates.n_gauges[list(study.own)].sum())
    table.add_row(own, str(own_count), *(f"{1e4 * one:.3g}" for one in placement.own_sigmas))
    table.add_row("placed", str(len(placement.layout.names)), *(f"{1e4 * one:.3g}" for one in placement.sigmas))
    ratio = placement.sigmas / placement.own_sigmas
    table.add_row("ratio", "", *(f"{one:.3f}" for one in ratio))
    worst = placement.lost.ratio.max(axis=0)
    table.add_row("loss of one, at most times", "", *(f"{one:.3f}" for one in worst))
    if placement.lost.pair_ratio is not None:
        worst = placement.lost.pair_ratio.max(axis=(0, 1))
        table.add_row("loss of two, at most times", "", *(f"{one:.3f}" for one in worst))
    console.print(table)
    names = study.candidates.gauges.names
    order = (-placement.worth).argsort(kind="stable")
    table = Table(title="What each contributes: the criterion without it")
    table.add_column("gauges")
    table.add_column("rises by", justify="right")
    for one in order.tolist():
        site = study.candidates.of([placement.sites[one]])
        table.add_row(", ".join(names[gauge] for gauge in site), f"{100.0 * placement.worth[one]:.2f} %")
    console.print(table)
    for line in (*placement.remarks, f"bound gap: {placement.gap_percent:.2f} %"):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _series(option: str, text: str) -> list[float]:
    """Return numbers with commas, or first:last:step."""
    if ":" not in text:
        return numbers(option, text)
    parts = numbers(option, text.replace(":", ","))
    if len(parts) != 3 or parts[2] <= 0.0 or parts[1] < parts[0] or (parts[1] - parts[0]) / parts[2] > 1e5:
        raise InputError(f"{option}: expected first:last:step with a positive step, got '{text}'")
    first, last, step = parts
    return [round(first + step * k, 9) for k in range(int((last - first) / step + 1e-9) + 1)]


def _named(option: str, text: str) -> dict[str, float]:
    found = {}
    for part in filter(None, (one.strip() for one in text.split(","))):
        name, equals, value = part.partition("=")
        if not equals:
            raise InputError(f"{option}: expected name=number with commas, got '{part}'")
        found[name.strip()] = numbers(option, value)[0]
    return found


def _cable(text: str) -> tuple[float, float]:
    """Return cost of a metre of cable and the station that it runs to [m]."""
    parts = numbers("--cable", text.replace("@", ","))
    if len(parts) != 2 or parts[0] < 0.0 or text.count("@") != 1:
        raise InputError(f"--cable: expected COST@X with a cost from 0 per metre, got '{text}'")
    return parts[0], parts[1]


def _zone(text: str) -> tuple[float, ...]:
    along, _, around = text.partition("@")
    parts = numbers("--forbid", along.replace(":", ","))
    angles = numbers("--forbid", around.replace(":", ",")) if around else []
    if len(parts) != 2 or len(angles) not in (0, 2) or parts[0] > parts[1]:
        raise InputError(f"--forbid: expected x1:x2 in m or x1:x2@roll1:roll2 in deg, got '{text}'")
    return (*parts, *_radians(angles))


def _radians(angles: list[float]) -> tuple[float, ...]:
    return tuple(map(radians, angles))
