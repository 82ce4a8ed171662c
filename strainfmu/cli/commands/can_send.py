"""The virtual sender: ``strainfmu send``."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

import strainfmu
from strainfmu.cli.commands.can_bus import (
    BusOption,
    BusOptionsOption,
    ChannelOption,
    InterfaceOption,
    ProfileOption,
    SetOption,
)
from strainfmu.cli.commands.number_ranges import DURATION_S, within
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from strainfmu.can.sender import Score, SentFlight


def send(
    data: Annotated[
        Path | None,
        typer.Argument(
            metavar="DATA",
            help="Recorded strains (CSV, HDF5 ..), a row per cycle, or a scenario (TOML), flown in closed loop.",
        ),
    ] = None,
    bus: BusOption = None,
    settings: SetOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    option: BusOptionsOption = None,
    profile: ProfileOption = None,
    plant: Annotated[
        Path | None, typer.Option(metavar="X.fmu", help="Plant FMU whose strains are sent, instead of DATA.")
    ] = None,
    gauges: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="MAP",
            help="Map or FMU whose gauges the frames hold (input.gauges).",
        ),
    ] = None,
    duration: Annotated[
        float, typer.Option(metavar="S", callback=within(*DURATION_S, "s"), help="Longest duration.")
    ] = 20.0,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="X.json", help="Write the errors of the bridge's results; a plant or a scenario has the truth."
        ),
    ] = None,
) -> None:
    """Send strains on a CAN bus as a vehicle would.

    Receives the bridge's results meanwhile, names them in its frames, and compares them with the truth where it is
    known. A tare, a DBC file and all else are entries of the bus file.

    Examples:

        strainfmu send --plant demo/plant.fmu --map demo/map.h5 --interface socketcan --channel vcan0

        strainfmu send flight.h5 --bus bus.toml --set tare.at_s=5

        strainfmu send ic3x_flight.toml --map demo/map.h5 --interface socketcan --channel vcan0
    """
    given, console = dict(locals()), Console()
    given |= {"settings": settings or (), "option": option or ()}

    def say(line: str) -> None:
        console.print(line, highlight=False, markup=False, soft_wrap=True)

    with stop_request() as stopped:
        found = strainfmu.send(**given, say=say, stopped=stopped)
    console.print(_sent_table(found.sent))
    if found.score is not None and found.score.has_errors:
        console.print(score_table(found.score, "Results heard on the bus against truth"))
    elif found.score is not None:
        say(f"results heard on the bus: {_score_caption(found.score)}")


@contextmanager
def stop_request() -> Iterator[Any]:
    """Let the first SIGINT or SIGTERM be a request to end in good order; the second one as ever."""
    asked: list[int] = []

    def ask(number: int, _: object) -> None:
        asked.append(number)
        signal.signal(number, previous[signal.Signals(number)])

    previous = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in previous:
        signal.signal(number, ask)
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


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
