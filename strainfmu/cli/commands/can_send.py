"""The virtual sender: ``strainfmu send``."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from strainfmu.cli.commands.bus_options import check_bus_options, cycle_time_of
from strainfmu.cli.commands.can_bus import (
    BaseOption,
    ContextOption,
    CycleTimeOption,
    ExtendedOption,
    FreshnessOption,
    KeyOption,
    ProfileOption,
    ResultBaseOption,
    identifiers_of,
)
from strainfmu.cli.commands.number_ranges import DURATION_S, PRESSURE_PA, within
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from strainfmu.can.tools.answers import Score
    from strainfmu.can.tools.sender import SentFlight
    from strainfmu.can.tools.strain_sources import FlownSample


def send(
    source: Annotated[Path, typer.Argument(metavar="MAP", help="Inverse map (map.h5), or the FMU made of it.")],
    interface: Annotated[str, typer.Option(help="python-can interface: socketcan, udp_multicast, pcan ...")],
    channel: Annotated[str, typer.Option(help="Its channel: can0, 239.74.163.2 ...")],
    plant: Annotated[
        Path | None,
        typer.Option(metavar="X.fmu", help="Plant FMU whose strains are sent. Not with --scenario, --data."),
    ] = None,
    scenario: Annotated[
        Path | None,
        typer.Option(
            metavar="X.toml", help="Scenario, flown in closed loop, then sent. Not with --plant, --data."
        ),
    ] = None,
    files: Annotated[
        Path | None, typer.Option(metavar="DIR", help="With --scenario: folder of map.h5 and flight_model.h5.")
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Recorded strains (CSV, HDF5 ...), a row per cycle. Not with --plant, --scenario."
        ),
    ] = None,
    dynamic_pressure: Annotated[
        float | None,
        typer.Option(
            metavar="PA",
            callback=within(*PRESSURE_PA, "Pa"),
            help="With --data: fixed dynamic pressure, instead of its column.",
        ),
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option("--bus-option", metavar="KEY=VALUE", help="Option of the interface.")
    ] = None,
    context: ContextOption = None,
    profile: ProfileOption = "fd64",
    cycle_time: CycleTimeOption = 10.0,
    id_base: BaseOption = "0x300",
    result_base: ResultBaseOption = "0x380",
    extended: ExtendedOption = False,
    key: KeyOption = None,
    freshness: FreshnessOption = None,
    duration: Annotated[
        float, typer.Option(metavar="S", callback=within(*DURATION_S, "s"), help="Longest duration.")
    ] = 20.0,
    faults: Annotated[
        int,
        typer.Option(metavar="N", callback=within(0, 100_000), help="Faults to inject, spread over the flight."),
    ] = 0,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND", help="With --faults: kind of fault; may be given several times. Default: all."
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(callback=within(0, 2**31 - 1), help="Seed of the faults."),
    ] = 1,
    tare_at: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            callback=within(*DURATION_S, "s"),
            help="Time at which to ask for a tare; with 'bridge --tare'.",
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="X.json", help="Write the errors of the bridge's results, if the truth is known."),
    ] = None,
) -> None:
    """Send strains on a CAN bus as a vehicle would, with faults on request.

    Receives the bridge's results meanwhile (profiles fd64 and fd64-sec), and compares them with the truth
    where it is known.

    Examples:

        strainfmu send demo/map.h5 --plant demo/plant.fmu --interface socketcan --channel vcan0

        strainfmu send map.h5 --scenario ic3x_flight.toml --files demo --interface socketcan --channel vcan0

        strainfmu send map.h5 --data flight.h5 --faults 20 --seed 7 --interface socketcan --channel vcan0
    """
    from strainfmu.can.bridge.bus.opening import configured
    from strainfmu.can.bridge.options import BridgeOptions
    from strainfmu.can.bridge.setup import bus_settings, input_layout, map_gauge_names, map_reading_units

    if sum(item is not None for item in (plant, scenario, data)) != 1:
        raise InputError("--plant, --scenario, --data: expected one of them, got none")
    period = cycle_time_of(cycle_time)
    if not cycle_time <= 1e3 * duration:
        raise InputError(
            f"--cycle-time {cycle_time:g} ms, --duration {duration:g} s: the duration must hold a cycle"
        )
    identifiers = identifiers_of(id_base, result_base, extended)
    options = BridgeOptions(
        interface=interface,
        channel=channel,
        bus_options=tuple(option or ()),
        bus_context=context,
        profile=profile,
        dbc=None,
        mapping=None,
        cycle_time=period,
        identifiers=identifiers,
        key_file=key,
        freshness_file=freshness,
        tare=None if tare_at is None else source,
    )
    check_bus_options(interface, bus_settings(options).options)
    names, readings = map_gauge_names(source), map_reading_units(source)
    layout, _ = input_layout(options, names, readings=readings)
    from strainfmu.can.tools.sender import planned_faults

    planned = planned_faults(
        fault or (),
        faults,
        seed=seed,
        n_cycles=round(duration / layout.cycle_time),
        is_authenticated=layout.is_authenticated,
    )
    samples = _samples(
        names,
        readings,
        plant=plant,
        scenario=scenario,
        files=files,
        data=data,
        dynamic_pressure=dynamic_pressure,
        cycle_time=layout.cycle_time,
        duration=duration,
    )
    console = Console()
    for line in configured(bus_settings(options)):
        console.print(str(line), highlight=False, markup=False, soft_wrap=True)
    with samples as opened:
        sent, score = _send(options, layout, opened, planned, duration, tare_at)
    console.print(_sent_table(sent))
    if score is not None:
        console.print(score_table(score, "Results heard on the bus against truth"))
    if report is not None:
        from strainfmu.files import write_bytes_atomically

        if score is None:
            raise InputError("--report: no results in form fd with a known truth, nothing to report")
        write_bytes_atomically(report, json.dumps(asdict(score), indent=1).encode())


def _samples(
    names: tuple[str, ...],
    readings: dict[str, str],
    *,
    plant: Path | None,
    scenario: Path | None,
    files: Path | None,
    data: Path | None,
    dynamic_pressure: float | None,
    cycle_time: float,
    duration: float,
) -> AbstractContextManager[Iterator[FlownSample]]:
    """Return the source that the options name."""
    from strainfmu.can.tools.strain_sources import plant_samples, recorded_samples, scenario_samples

    if plant is not None:
        return plant_samples(plant, len(names), cycle_time=cycle_time, duration=duration, readings=tuple(readings))
    if scenario is not None:
        return scenario_samples(scenario, files, cycle_time)
    assert data is not None
    return recorded_samples(data, names, dynamic_pressure, readings)


def _send(
    options: Any,
    layout: Any,
    samples: Iterator[FlownSample],
    faults: list[Any],
    duration: float,
    tare_at: float | None,
) -> tuple[SentFlight, Score | None]:
    """Open the bus twice, to send and to listen; return what was sent, and what came back."""
    from itertools import islice
    from time import sleep

    from strainfmu.can.bridge.bus.opening import open_bus, shut_down
    from strainfmu.can.bridge.results.layouts import result_layouts
    from strainfmu.can.bridge.setup import bus_settings, form_of_profile
    from strainfmu.can.tools.answers import Listener, score_answers
    from strainfmu.can.tools.sender import send_flight
    from strainfmu.can.wire.strain_encoder import frame_of

    settings = bus_settings(options)
    trip = _first_trip(options, layout, faults)
    form = "fd" if form_of_profile(options.profile) == "fd" else "classic-le"
    answer = result_layouts(form, options.identifiers, layout.cycle_time)[0]
    own = frame_of(answer, bytes(answer.length))
    bus = open_bus(settings)
    heard = open_bus(settings) if form == "fd" else None
    try:
        listener = None if heard is None else Listener(heard, answer)
        with stop_request() as stopped:
            limited = islice(samples, round(duration / layout.cycle_time))
            sent = send_flight(
                bus,
                layout,
                samples=limited,
                faults=faults,
                stopped=stopped,
                own=own,
                trip=trip,
                tare_at=tare_at,
            )
        if listener is None:
            return sent, None
        sleep(3.0 * layout.cycle_time + 0.2)  # the answer to the last cycle
        received = listener.finish()
        known = bool(sent.truth) and bool(received)
        return sent, score_answers(
            received, answer, truth=sent.truth, cycle_time=layout.cycle_time
        ) if known else None
    finally:
        shut_down(bus)
        if heard is not None:
            shut_down(heard)


def _first_trip(options: Any, layout: Any, faults: list[Any]) -> int:
    """Return the trip counter of authenticated frames; those of the restarts to come follow it."""
    from strainfmu.can.bridge.keepers.freshness_file import FIRST_TRIP, freshness_file, next_trip
    from strainfmu.can.tools.faults import FaultKind

    if layout.key is None:
        return FIRST_TRIP
    path = options.freshness_file or freshness_file(options.key_file, "sender")
    return next_trip(path, layout.key, 1 + sum(fault.kind is FaultKind.RESTART for fault in faults))


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
    from strainfmu.can.tools.sender import lateness_text

    table = Table(title="Sender", show_header=False)
    rate = sent.cycles / sent.duration if sent.duration > 0.0 else 0.0
    table.add_row("cycles", f"{sent.cycles} in {sent.duration:.2f} s, {rate:.1f} Hz")
    table.add_row("frames", f"{sent.frames}, not sent {sent.not_sent}")
    table.add_row("behind their time", lateness_text(sent))
    for name, number in sorted(sent.faults.items()):
        table.add_row(f"fault {name}", str(number))
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
