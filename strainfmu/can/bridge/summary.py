"""The summary of a run, and its table."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from math import isnan
from typing import TYPE_CHECKING

import numpy as np

from strainfmu.can.cycle.frames.account import FrameAccount
from strainfmu.can.cycle.states.quality import Quality
from strainfmu.cosim.estimators.step import health_name

if TYPE_CHECKING:
    from rich.table import Table

PERCENTILES = (50.0, 99.0, 99.9, 100.0)


@dataclass(eq=False, kw_only=True)
class BridgeSummary:
    """Summary of a run.

    Attributes
    ----------
    duration, cpu : of the run, and processor time of the whole process in it [s].
    account : of all frames.
    qualities : results by quality.
    healths : estimates by state of health.
    navigated : number of results with both Mach number and altitude.
    latency : [s] from the last frame of an answered cycle to its results on the bus; the latest 200,000.
    sent, send_failures, failures, reconnects : frames sent and not sent, failed receptions, buses reopened.
    malformed, last_malformed : number of messages that were no frames, and why the last one was none.
    kernel_drops : datagrams that the system dropped, None where that is not known.
    queue_highest : maximum number of waiting frames.
    drift_ppm : how much slower than ours the sender's clock ran; NaN if not known.
    period_text : the sender's period in words, "" where it was not measured.
    last_fault : last failure of the bus.
    """

    duration: float
    cpu: float
    account: FrameAccount
    qualities: Counter[Quality] = field(default_factory=Counter)
    healths: Counter[int] = field(default_factory=Counter)
    navigated: int = 0
    latency: np.ndarray = field(default_factory=lambda: np.empty(0))
    sent: int = 0
    send_failures: int = 0
    failures: int = 0
    malformed: int = 0
    last_malformed: str = ""
    reconnects: int = 0
    kernel_drops: int | None = None
    queue_highest: int = 0
    drift_ppm: float = float("nan")
    period_text: str = ""
    last_fault: str = ""


def summary_rows(summary: BridgeSummary) -> list[tuple[str, str]]:
    """Return the rows of the table of a run."""
    rows = [("duration", f"{summary.duration:.1f} s")]
    load = 100.0 * summary.cpu / summary.duration if summary.duration > 0.0 else 0.0
    rows.append(("processor time", f"{summary.cpu:.2f} s, {load:.1f} % of one core"))
    rows += [(f"results {quality.name}", f"{n}") for quality, n in sorted(summary.qualities.items())]
    rows += health_rows(summary.healths, summary.navigated)
    rows += [(f"frames: {name}", f"{count}") for name, count in summary.account.rows()]
    rows.append(("frames: not accounted for", f"{summary.account.unaccounted}"))
    if summary.account.unknown:
        rows.append(("unknown identifiers", summary.account.unknown_text()))
    if len(summary.latency):
        values = 1e3 * np.percentile(summary.latency, PERCENTILES)
        text = ", ".join(f"p{p:g} {v:.2f}" for p, v in zip(PERCENTILES, values, strict=True))
        rows.append(("last frame in to results out", f"{text} ms"))
    rows.append(("frames sent", f"{summary.sent}, {summary.send_failures} failed"))
    drops = "not known" if summary.kernel_drops is None else str(summary.kernel_drops)
    rows.append(("dropped by the system", drops))
    rows.append(("failed receptions", f"{summary.failures}"))
    rows.append(("messages that are no frames", f"{summary.malformed}"))
    if summary.last_malformed:
        rows.append(("the last of these", summary.last_malformed))
    rows.append(("maximum of frames waiting", f"{summary.queue_highest}"))
    if summary.period_text:
        rows.append(("sender's period", summary.period_text.removeprefix("period: ")))
    if not isnan(summary.drift_ppm):
        rows.append(("sender's clock slower by", f"{summary.drift_ppm:.1f} ppm"))
    if summary.reconnects or summary.last_fault:
        rows.append(("bus reopened", f"{summary.reconnects} times; last fault: {summary.last_fault}"))
    return rows


def health_rows(healths: Counter[int], navigated: int) -> list[tuple[str, str]]:
    """Return rows of estimates by state of health, and of results with navigation if there are any."""
    rows = [(f"health {health_name(state)}", f"{n}") for state, n in sorted(healths.items())]
    if navigated:
        rows.append(("results with Mach number and altitude", f"{navigated}"))
    return rows


def summary_table(summary: BridgeSummary) -> Table:
    """Return the table of a run, for a rich console."""
    from rich.table import Table

    table = Table(title="Bridge", show_header=False)
    for name, text in summary_rows(summary):
        table.add_row(name, text)
    return table
