"""The CAN bus: ``strainfmu bridge``, ``dbc``, and the virtual sender ``send``."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

import strainfmu
from strainfmu.cli.commands.printed import say
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from strainfmu.can.observed import ObservedBridge
    from strainfmu.can.sender import Score, SentFlight


def bridge(**options: Any) -> None:
    """Run a bridge until a signal or its duration ends it, and print its summary."""
    from strainfmu.can.bridge import summary_table

    def _stopped(observed: ObservedBridge) -> AbstractContextManager[None]:
        return on_signals(observed.bridge.stop, observed.bridge.confirm)

    run = strainfmu.bridge(**options, say=say, running=_stopped)
    Console().print(summary_table(run.summary))
    say(*run.notes)


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
    console = Console()
    console.print(_sent_table(result.sent))
    if result.score is not None and result.score.has_errors:
        console.print(score_table(result.score, "Results heard on the bus against truth"))
    elif result.score is not None:
        say(f"results heard on the bus: {_score_caption(result.score)}")


@contextmanager
def stop_request() -> Iterator[Callable[[], bool]]:
    """Take the first SIGINT or SIGTERM as a request to end in good order; yield whether there was one."""
    asked: list[bool] = []
    with on_signals(lambda: asked.append(True)):
        yield lambda: bool(asked)


def _sent_table(sent: SentFlight) -> Table:
    """Return what was sent, as a table."""
    from strainfmu.can.sender import lateness_text

    table = Table(title="Sender", show_header=False)
    rate = sent.cycles / sent.duration if sent.duration > 0.0 else 0.0
    table.add_row("cycles", f"{sent.cycles} in {sent.duration:.2f} s, {rate:.1f} Hz")
    table.add_row("frames", f"{sent.frames}, not sent {sent.not_sent}")
    table.add_row("behind their time", lateness_text(sent))
    return table


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
