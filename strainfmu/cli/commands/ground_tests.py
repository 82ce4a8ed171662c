"""Ground tests: ``strainfmu loadtest`` plans one, ``calibrate`` and ``equations`` make a map of it."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

import builder
from strainfmu.cli.commands.printed import say, say_finished
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from builder.calibration.plan.load_plan import LoadPlan
    from builder.pipeline.calibrate import Calibration


def loadtest(*, vehicle: Path, output: Path, template: bool, **options: Any) -> None:
    """Propose a ground test, or write the file of one to fill in."""
    start = perf_counter()
    if template:
        errors = {name: options[name] for name in ("load_error", "cell_error")}
        builder.loadtest_template(vehicle, output, **errors)
        say(f"{output}: written", f"fill it in, then: strainfmu calibrate map.h5 {output} -o calibrated.h5")
        return
    designed = builder.loadtest(vehicle, output=output, **options, progress=True)
    _show_plan(designed.plan)
    say(*designed.lines)
    say_finished(", ".join(map(str, designed.files)), start)


def _show_plan(plan: LoadPlan) -> None:
    from builder.pipeline.load_test_proposal import sigma_rows

    table = Table(title="Sigma in flight over the sigma of a vehicle known exactly")
    table.add_column("", justify="right")
    table.add_column("applied, after all above")
    for name in COEFFICIENT_NAMES:
        table.add_column(name, justify="right")
    for row, (name, ratio) in enumerate(sigma_rows(plan), start=-1):
        table.add_row(str(row) if row > 0 else "", escape(name), *(f"{value:.3g}" for value in ratio))
    Console().print(table)
    say(f"{plan.candidates} load cases compared.")


def calibrate(**options: Any) -> None:
    """Calibrate a map and print the verdict."""
    from builder.processors import keep_freed_memory, one_thread_of_blas

    keep_freed_memory()
    with one_thread_of_blas():
        _show_verdict(builder.calibrate(**options, progress=True))


def equations(**options: Any) -> None:
    """Fit load equations and print them."""
    result = builder.equations(**options)
    say(*result.lines, ", ".join(str(path) for path in result.files))


def _show_verdict(result: Calibration) -> None:
    from builder.calibration.estimate.remarks import remarks

    estimate = result.estimate
    lines = [*result.notes, *(fault.line for fault in result.faults)]
    lines.append(
        f"{estimate.n_readings} readings in {int(estimate.used.any(axis=1).sum())} cases, chi-square per reading "
        f"{estimate.per_reading:.3g}, squared distance from the files {estimate.from_priors:.3g} "
        "(1 is expected of both)"
    )
    lines += [f"warning: {line}" for line in (*remarks(estimate), *result.outside.lines)]
    if result.verdict is not None:
        lines.append(f"{result.verdict.title}:")
        lines += [f"  {line}" for line in result.verdict.reasons]
        lines += [f"would help most: {line}" for line in result.verdict.helps]
    say(*lines, ", ".join(str(path) for path in result.files))
