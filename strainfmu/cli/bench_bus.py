"""The table of the bus benchmark: ``strainfmu bench --bus``."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table

from strainfmu.can.bridge.summary import PERCENTILES
from strainfmu.can.tools.bus_bench import BusRun, CoreCost, bus_run, core_cost, linear_cost


def bench_bus(folder: Path, rate: float, duration: float, burners: int) -> None:
    """Run the benchmark of the bus on the map and the estimator FMU in ``folder``, and print its table.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`~strainfmu.can.tools.bus_bench.bus_run`.
    """
    cost, linear = core_cost(folder), linear_cost(folder)
    run = bus_run(folder, rate, duration, burners)
    title = f"Bus, {folder}: fd64, {rate:g} Hz for {duration:g} s, {burners} niced burners"
    table = Table(title=title, show_header=False)
    for name, text in bus_rows(cost, run, linear):
        table.add_row(name, text)
    Console().print(table)


def bus_rows(cost: CoreCost, run: BusRun, linear: CoreCost | None = None) -> list[tuple[str, str]]:
    """Return the rows of the table; ``linear`` is the cost with the linear estimator of the same map."""
    account = run.summary.account
    rows = [
        ("virtual time: core", _cost_text(cost.core)),
        ("virtual time: with results, page, recorder", _cost_text(cost.observed)),
    ]
    if linear is not None:
        rows += [
            ("virtual time, linear estimator: core", _cost_text(linear.core)),
            ("virtual time, linear estimator: with results, page, recorder", _cost_text(linear.observed)),
        ]
    rows += [
        ("cycles sent, of these on time", f"{run.sent}, {run.on_time}"),
        ("sender's own lateness", _percentiles((50, 99, 100), run.lateness)),
        ("on-time cycles VALID", f"{run.outcome['VALID']} ({run.valid:.2%})"),
    ]
    rows += [(f"on-time cycles {text}", str(n)) for text, n in run.outcome.most_common() if text != "VALID"]
    if len(run.summary.latency):
        values = tuple(_of(run.summary.latency, PERCENTILES))
        rows.append(("last frame in to results out", _percentiles(PERCENTILES, values)))
    rows += [(f"frames: {name}", str(count)) for name, count in account.rows()]
    rows.append(("frames: not accounted for", str(account.unaccounted)))
    drops = run.summary.kernel_drops
    rows.append(("dropped by the system", "not known" if drops is None else str(drops)))
    heard = f"{run.python_can_received} of {run.python_can_sent} frames"
    rows += [
        ("load of the bridge, page and recorder on", f"{run.load:.1%} of a core"),
        ("load of python-can's own loop", f"{run.python_can_load:.1%} of a core, {heard}"),
    ]
    return rows


def _cost_text(seconds: float) -> str:
    return f"{1e6 * seconds:.1f} us a cycle, {1.0 / seconds:,.0f} cycles/s"


def _of(values: object, percentiles: tuple[float, ...]) -> list[float]:
    import numpy as np

    found: list[float] = np.percentile(np.asarray(values), percentiles).tolist()
    return found


def _percentiles(names: tuple[float, ...], values: tuple[float, ...]) -> str:
    return ", ".join(f"p{name:g} {1e3 * value:.2f}" for name, value in zip(names, values, strict=True)) + " ms"
