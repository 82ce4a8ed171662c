"""The CAN bus: ``strainfmu bridge``, ``dbc``, and the virtual sender ``send``."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

import strainfmu
from strainfmu.cli.commands.printed import say
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from strainfmu.can.listener import BridgeSummary, ResultCounts
    from strainfmu.can.observed import ObservedBridge
    from strainfmu.can.sender import Score, SentFlight


def bridge(**options: Any) -> None:
    """Run a bridge until a signal or its duration ends it, and print its summary."""

    def _stopped(observed: ObservedBridge) -> AbstractContextManager[None]:
        return on_signals(observed.bridge.stop, observed.bridge.confirm)

    run = strainfmu.bridge(**options, say=say, running=_stopped)
    shown_table("Bridge", summary_rows(run.summary))
    say(*run.notes)


PERCENTILES = (50.0, 99.0, 99.9, 100.0)


def summary_rows(summary: BridgeSummary) -> list[tuple[str, str]]:
    """Return the rows of the table of a run."""
    load = 100.0 * summary.cpu / summary.duration if summary.duration > 0.0 else 0.0
    rows = [
        ("duration", f"{summary.duration:.1f} s"),
        ("processor time", f"{summary.cpu:.2f} s, {load:.1f} % of one core"),
        *result_rows(summary),
    ]
    if summary.account.unknown:
        rows.append(("unknown identifiers", summary.account.unknown_text()))
    if len(summary.latency):
        rows.append(("last frame in to results out", percentiles_text(summary.latency, PERCENTILES)))
    rows.append(("frames sent", f"{summary.sent}, {summary.send_failures} failed"))
    drops = "not known" if summary.kernel_drops is None else str(summary.kernel_drops)
    rows.append(("dropped by the system", drops))
    rows.append(("failed receptions", f"{summary.failures}"))
    rows.append(("messages that are no frames", f"{summary.malformed}"))
    if summary.last_malformed:
        rows.append(("the last of these", summary.last_malformed))
    if summary.period_text:
        rows.append(("sender's period", summary.period_text.removeprefix("period: ")))
    if summary.reconnects or summary.last_fault:
        rows.append(("bus reopened", f"{summary.reconnects} times; last fault: {summary.last_fault}"))
    return rows


def result_rows(summary: ResultCounts) -> list[tuple[str, str]]:
    """Return rows of results by quality and by cause, estimates by state of health, and of all frames by class."""
    from strainfmu.can.quality import Cause, all_words
    from strainfmu.cosim.estimators.step import health_name

    rows = [(f"results {quality.name}", f"{n}") for quality, n in sorted(summary.qualities.items())]
    words = all_words()["cause"]
    for cause in Cause:
        if count := sum(n for causes, n in summary.causes.items() if causes & cause):
            rows.append((f"cause {cause.name}: {words[str(cause.name)]}", f"{count}"))
    rows += [(f"health {health_name(state)}", f"{n}") for state, n in sorted(summary.healths.items())]
    if summary.navigated:
        rows.append(("results with Mach number and altitude", f"{summary.navigated}"))
    rows += [(f"frames: {name}", f"{count}") for name, count in summary.account.rows()]
    return [*rows, ("frames: not accounted for", f"{summary.account.unaccounted}")]


def percentiles_text(seconds: Iterable[float], percentiles: Sequence[float]) -> str:
    """Return percentiles of times [s] in words."""
    values = 1e3 * np.percentile(list(seconds), percentiles)
    return ", ".join(f"p{p:g} {v:.2f}" for p, v in zip(percentiles, values, strict=True)) + " ms"


def shown_table(title: str, rows: Iterable[tuple[str, str]]) -> None:
    """Print a table of rows of a name and a text."""
    table = Table(title=title, show_header=False)
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def dbc(*, source: Path, output: Path, template: Path | None, **options: Any) -> None:
    """Write a DBC file, or a bus file to fill in."""
    if template is None:
        say(f"{output}: written, {strainfmu.dbc(source, output, **options)} frames")
    else:
        strainfmu.dbc_template(source, template)
        say(f"{template}: written")


@contextmanager
def on_signals(stop: Callable[[], object], confirm: Callable[[], object] | None = None) -> Iterator[None]:
    """Call ``stop`` on the first SIGINT or SIGTERM, the second one as ever, and ``confirm`` on each SIGUSR1."""

    def stopped(number: int, _: object) -> None:
        signal.signal(number, previous[number])
        stop()

    handlers: dict[int, Callable[[int, Any], object]] = dict.fromkeys((signal.SIGINT, signal.SIGTERM), stopped)
    if confirm is not None and hasattr(signal, "SIGUSR1"):
        handlers[signal.SIGUSR1] = lambda *_: confirm()
    previous = {number: signal.getsignal(number) for number in handlers}
    for number, handler in handlers.items():
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, handler_before in previous.items():
            signal.signal(number, handler_before)


def send(**options: Any) -> None:
    """Send strains until a signal or the end, and print what was sent and what came back."""
    with stop_request() as stopped:
        result = strainfmu.send(**options, say=say, stopped=stopped)
    shown_table("Sender", _sent_rows(result.sent))
    if result.score is not None and result.score.has_errors:
        Console().print(score_table(result.score, "Results heard on the bus against truth"))
    elif result.score is not None:
        say(f"results heard on the bus: {_score_caption(result.score)}")


@contextmanager
def stop_request() -> Iterator[Callable[[], bool]]:
    """Take the first SIGINT or SIGTERM as a request to end in good order; yield whether there was one."""
    asked: list[bool] = []
    with on_signals(lambda: asked.append(True)):
        yield lambda: bool(asked)


def _sent_rows(sent: SentFlight) -> list[tuple[str, str]]:
    """Return what was sent, as rows of a table."""
    rate = sent.cycles / sent.duration if sent.duration > 0.0 else 0.0
    return [
        ("cycles", f"{sent.cycles} in {sent.duration:.2f} s, {rate:.1f} Hz"),
        ("frames", f"{sent.frames}, not sent {sent.not_sent}"),
        ("behind their time", percentiles_text(sent.lateness, (50, 99, 100)) if sent.lateness else "-"),
    ]


def score_table(score: Score, title: str) -> Table:
    """Return errors against truth, with the columns of the demonstration."""
    table = Table(title=title, caption=_score_caption(score))
    for heading in ("coefficient", "rms error", "of its range", "mean sigma", "truth within 3 sigma"):
        table.add_column(heading, justify="left" if heading == "coefficient" else "right")
    for i, name in enumerate(COEFFICIENT_NAMES):
        of_range = score.rms_error_of_range[i]
        table.add_row(
            name,
            f"{score.rms_error[i]:.2e}",
            f"{of_range:.2%}" if of_range >= 0.0 else "-",
            f"{score.mean_sigma[i]:.2e}",
            f"{100.0 * score.coverage[i]:.2f} %",
        )
    return table


def _score_caption(score: Score) -> str:
    qualities = ", ".join(f"{name} {number}" for name, number in sorted(score.qualities.items()))
    return f"{score.answered} of {score.cycles} cycles answered, {score.published} with coefficients; {qualities}"
