"""Placement of gauges and review of layouts: ``strainfmu place`` and ``strainfmu review``."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

import builder
from strainfmu.cli.commands.printed import say, say_finished
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from builder.pipeline.place_and_review import ProposedGauges


def place(*, output: Path, curves: Path | None, **options: Any) -> None:
    """Place gauges and print the layout's sigmas."""
    start = perf_counter()
    _show(builder.place(output=output, curves=curves, **options, progress=True))
    say_finished(output if curves is None else f"{output}, {curves}", start)


def review(*, output: Path, **options: Any) -> None:
    """Review a layout and print which gauges could go, and which would help."""
    start = perf_counter()
    judged = builder.review(output=output, **options, progress=True)
    name, gain = judged.best
    say(f"could go: {', '.join(judged.spare) or 'none'}")
    say(f"would help most: {name}, the criterion falls by {100.0 * gain:.2f} %")
    written = [output, *([pdf] if (pdf := output.with_suffix(".pdf")).is_file() else [])]
    say_finished(", ".join(map(str, written)), start)


def _show(proposed: ProposedGauges) -> None:
    console, placement, study = Console(), proposed.placement, proposed.study
    layout = study.parts.vehicle.gauges.layout
    table = Table(title="Sigma over the flight states [1e-4]")
    table.add_column("layout")
    table.add_column("gauges", justify="right")
    for name in COEFFICIENT_NAMES:
        table.add_column(name, justify="right")
    own_count = int(study.candidates.n_gauges[list(study.layout_sites)].sum())
    table.add_row(layout, str(own_count), *(f"{1e4 * value:.3g}" for value in placement.own_sigmas))
    table.add_row(
        "placed", str(len(placement.layout.names)), *(f"{1e4 * value:.3g}" for value in placement.sigmas)
    )
    ratio = placement.sigmas / placement.own_sigmas
    table.add_row("ratio", "", *(f"{value:.3f}" for value in ratio))
    worst = placement.lost.ratio.max(axis=0)
    table.add_row("loss of one, at most times", "", *(f"{value:.3f}" for value in worst))
    if placement.lost.pair_ratio is not None:
        worst = placement.lost.pair_ratio.max(axis=(0, 1))
        table.add_row("loss of two, at most times", "", *(f"{value:.3f}" for value in worst))
    console.print(table)
    names = study.candidates.gauges.names
    order = (-placement.worth).argsort(kind="stable")
    table = Table(title="What each contributes: the criterion without it")
    table.add_column("gauges")
    table.add_column("rises by", justify="right")
    for index in order.tolist():
        site = study.candidates.gauges_of([placement.sites[index]])
        table.add_row(", ".join(names[gauge] for gauge in site), f"{100.0 * placement.worth[index]:.2f} %")
    console.print(table)
    say(*placement.remarks, f"bound gap: {placement.gap_percent:.2f} %")
