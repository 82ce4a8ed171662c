"""The CAN bus: ``strainfmu bridge`` and ``strainfmu dbc``."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

import strainfmu
from strainfmu.cli.commands.number_ranges import DURATION_S, within

if TYPE_CHECKING:
    from strainfmu.can.bridge import Bridge

BusOption = Annotated[
    Path | None, typer.Option("--bus", metavar="TOML", help="Bus file: interface, frames, clock, trust, record ..")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="TABLE.ENTRY=VALUE",
        help="An entry of the bus file, such as trust.max_age_cycles=10; may be given several times.",
    ),
]
InterfaceOption = Annotated[
    str | None, typer.Option("--interface", help="python-can interface: socketcan, udp_multicast, pcan ...")
]
ChannelOption = Annotated[str | None, typer.Option("--channel", help="Its channel: can0, 239.74.163.2 ...")]
BusOptionsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--bus-option",
        metavar="KEY=VALUE",
        help="Option of the interface, such as bitrate=500000; may be given several times.",
    ),
]
ProfileOption = Annotated[
    str | None,
    typer.Option("--profile", help="fd64, classic-le or fd64-sec. Default: fd64."),
]


def bridge(
    fmu: Annotated[Path, typer.Argument(metavar="FMU", help="Estimator FMU.")],
    bus: BusOption = None,
    settings: SetOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    option: BusOptionsOption = None,
    profile: ProfileOption = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Record the bus: X.blf, X.asc or X.log (candump).")
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", callback=within(*DURATION_S, "s"), help="Stop after this time."),
    ] = None,
) -> None:
    """Estimate loads from strain frames on a CAN bus, and send them back as frames.

    Ends on SIGINT or SIGTERM with a summary. SIGUSR1 confirms a sender whose restart is not proven. The frames are
    described in docs/reference/can.md; `strainfmu dbc` writes them as a DBC file, and a bus file with --template.

    Examples:

        strainfmu bridge estimator.fmu --interface socketcan --channel can0

        strainfmu bridge estimator.fmu --interface udp_multicast --channel 239.74.163.2 --bus-option port=43200

        strainfmu bridge estimator.fmu --bus bus.toml --set trust.max_age_cycles=10 --record run.blf
    """
    given, console = dict(locals()), Console()
    given |= {"settings": settings or (), "option": option or ()}
    from strainfmu.can.bridge import summary_table

    def say(line: str) -> None:
        console.print(line, highlight=False, markup=False, soft_wrap=True)

    found = strainfmu.bridge(**given, say=say, running=lambda one: _stopped_by_signals(one.ready.bridge))
    console.print(summary_table(found.summary))
    for note in found.notes:
        say(note)


def dbc(
    source: Annotated[Path, typer.Argument(metavar="MAP", help="Inverse map (map.h5), or the FMU made of it.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="DBC file to write.")] = Path("strainfmu.dbc"),
    bus: BusOption = None,
    settings: SetOption = None,
    profile: ProfileOption = None,
    template: Annotated[
        Path | None,
        typer.Option(metavar="TOML", help="Write a bus file with every entry instead, to fill in."),
    ] = None,
) -> None:
    """Write the DBC file of the bridge's frames: strains in, results out. With `input.dbc`, results alone.

    Examples:

        strainfmu dbc results/map.h5 -o strains.dbc

        strainfmu dbc results/map.h5 -o strains.dbc --bus bus.toml --set input.id_base=0x100

        strainfmu dbc results/map.h5 --template bus.toml
    """
    if template is not None:
        strainfmu.dbc_template(source, template)
        text = f"{template}: written"
    else:
        n_frames = strainfmu.dbc(source, output, bus=bus, settings=settings or (), profile=profile)
        text = f"{output}: written, {n_frames} frames"
    Console().print(text, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def _stopped_by_signals(running: Bridge) -> Iterator[None]:
    """Let SIGINT and SIGTERM stop the bridge in good order, the second one as ever; SIGUSR1 confirms senders."""

    def stop(number: int, _: object) -> None:
        signal.signal(number, previous[signal.Signals(number)])
        running.stop()

    def confirm(_: int, __: object) -> None:
        running.confirm()

    previous = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in previous:
        signal.signal(number, stop)
    if hasattr(signal, "SIGUSR1"):
        previous[signal.SIGUSR1] = signal.getsignal(signal.SIGUSR1)
        signal.signal(signal.SIGUSR1, confirm)
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
