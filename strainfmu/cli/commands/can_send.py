"""The virtual sender: ``strainfmu send``."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from strainfmu.cli.commands.bus_options import check_bus_options
from strainfmu.cli.commands.can_bus import (
    BusOption,
    BusOptionsOption,
    ChannelOption,
    InterfaceOption,
    ProfileOption,
    SetOption,
    described_bus,
)
from strainfmu.cli.commands.number_ranges import DURATION_S, within
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from strainfmu.can.sender import Score, SentFlight
    from strainfmu.can.strain_sources import FlownSample


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
    from strainfmu.can.opening import VIRTUAL, VIRTUAL_TEXT
    from strainfmu.can.setup import bus_settings, map_input_layout

    if (plant is None) == (data is None):
        raise InputError(f"DATA, --plant: expected one of them, got {'none' if plant is None else 'both'}")
    described = described_bus(
        bus,
        settings,
        given={"input.gauges": gauges},
        interface=interface,
        channel=channel,
        option=option,
        profile=profile,
    )
    options, source = described.options(), described.gauges
    if source is None:
        raise InputError("--map: expected the map or FMU of the gauges, or input.gauges of the bus file, got none")
    if described.tare_at is not None and options.tare is None:
        options = replace(options, tare=source)
    check_bus_options(options.interface, bus_settings(options).options)
    layout, names, readings = map_input_layout(options, source)
    if not layout.cycle_time <= duration:
        raise InputError(
            f"--duration: expected at least the period of {1e3 * layout.cycle_time:g} ms, got {duration:g} s"
        )
    samples = _samples(
        names,
        readings,
        source=source,
        plant=plant,
        data=data,
        dynamic_pressure=options.dynamic_pressure,
        cycle_time=layout.cycle_time,
        duration=duration,
    )
    console = Console()
    if options.interface == VIRTUAL:
        console.print(VIRTUAL_TEXT, highlight=False, markup=False, soft_wrap=True)
    with samples as opened:
        sent, score = _send(options, layout, opened, duration, described.tare_at)
    console.print(_sent_table(sent))
    if score is not None and score.has_errors:
        console.print(score_table(score, "Results heard on the bus against truth"))
    elif score is not None:
        console.print(f"results heard on the bus: {_score_caption(score)}", highlight=False, soft_wrap=True)
    if report is not None:
        from strainfmu.files import write_bytes_atomically

        if score is None or (score.published and not score.has_errors):
            raise InputError("--report: no results with a known truth, nothing to report")
        write_bytes_atomically(report, json.dumps(asdict(score), indent=1).encode())


def _samples(
    names: tuple[str, ...],
    readings: dict[str, str],
    *,
    source: Path,
    plant: Path | None,
    data: Path | None,
    dynamic_pressure: float | None,
    cycle_time: float,
    duration: float,
) -> AbstractContextManager[Iterator[FlownSample]]:
    """Return the source that the options name; files of a scenario are next to the map ``source``."""
    from strainfmu.can.strain_sources import plant_samples, recorded_samples, scenario_samples

    if plant is not None:
        return plant_samples(plant, len(names), cycle_time=cycle_time, duration=duration, readings=tuple(readings))
    assert data is not None
    if data.suffix.lower() == ".toml":
        return scenario_samples(data, source.parent, cycle_time)
    return recorded_samples(data, names, dynamic_pressure, readings)


def _send(
    options: Any,
    layout: Any,
    samples: Iterator[FlownSample],
    duration: float,
    tare_at: float | None,
) -> tuple[SentFlight, Score | None]:
    """Open the bus twice, to send and to listen; return what was sent, and what came back."""
    from itertools import islice
    from time import sleep

    from strainfmu.can.opening import open_bus, shut_down
    from strainfmu.can.result_layouts import result_layouts
    from strainfmu.can.sender import Answers, Sender, score_answers, send_flight
    from strainfmu.can.setup import bus_settings, result_form

    settings = bus_settings(options)
    sender = Sender(layout, _first_trip(options, layout))
    results = result_layouts(result_form(options, layout), options.identifiers, layout.cycle_time)
    named = layout.trailer or layout.first_of_cycle
    modulus = 0 if named.layout.protection is None else named.layout.protection.counter_modulus
    bus = open_bus(settings)
    heard = open_bus(settings)
    try:
        answers = Answers(heard, results, sender.hear)
        with stop_request() as stopped:
            limited = islice(samples, round(duration / layout.cycle_time))
            sent = send_flight(bus, layout, samples=limited, stopped=stopped, tare_at=tare_at, sender=sender)
        sleep(3.0 * layout.cycle_time + 0.2)  # the answer to the last cycle
        received = answers.finish()
        is_heard = bool(sent.truth) and bool(received)
        return sent, score_answers(received, sent.truth, modulus) if is_heard else None
    finally:
        shut_down(bus)
        shut_down(heard)


def _first_trip(options: Any, layout: Any) -> int:
    """Return the trip counter of authenticated frames."""
    from strainfmu.can.authentic import FIRST_TRIP, freshness_file, next_trip

    if layout.key is None:
        return FIRST_TRIP
    return next_trip(options.freshness_file or freshness_file(options.key_file, "sender"), layout.key)


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
