"""The CAN bus: ``strainfmu bridge`` and ``strainfmu dbc``."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from strainfmu.cli.commands.bus_options import check_bus_options, cycle_time_of, refuse_cycle_time
from strainfmu.cli.commands.number_ranges import DURATION_S, PRESSURE_PA, within
from strainfmu.errors import InputError

if TYPE_CHECKING:
    from strainfmu.can.bridge.run_loop import Bridge
    from strainfmu.can.wire.profiles import Identifiers

ProfileOption = Annotated[str, typer.Option(help="fd64, classic-le, classic-be, float2 or fd64-sec.")]
CycleTimeOption = Annotated[
    float, typer.Option(metavar="MS", callback=within(0.1, 10_000.0, "ms"), help="Period of the strain frames.")
]
BaseOption = Annotated[str, typer.Option(metavar="ID", help="Identifier of the first input frame.")]
ResultBaseOption = Annotated[str, typer.Option(metavar="ID", help="Identifier of the first result frame.")]
KeyOption = Annotated[
    Path | None,
    typer.Option("--key", metavar="FILE", help="Key of profile fd64-sec: text, 32 hexadecimal digits (AES-128)."),
]
FreshnessOption = Annotated[
    Path | None,
    typer.Option(
        "--freshness", metavar="FILE", help="Freshness value between runs, with --key. Default: beside the key."
    ),
]
ContextOption = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Section of python-can's configuration files with more bus options."),
]
ZerosOption = Annotated[
    Path | None,
    typer.Option(metavar="TOML", help="Zero offsets of the gauges, of 'strainfmu tare'; subtracted."),
]
ExtendedOption = Annotated[bool, typer.Option("--extended", help="29 bit identifiers.")]


def bridge(
    fmu: Annotated[Path, typer.Argument(metavar="FMU", help="Estimator FMU.")],
    interface: Annotated[str, typer.Option(help="python-can interface: socketcan, udp_multicast, pcan ...")],
    channel: Annotated[str, typer.Option(help="Its channel: can0, 239.74.163.2 ...")],
    option: Annotated[
        list[str] | None,
        typer.Option(
            "--bus-option",
            metavar="KEY=VALUE",
            help="Option of the interface, such as bitrate=500000; may be given several times.",
        ),
    ] = None,
    context: ContextOption = None,
    profile: ProfileOption = "fd64",
    dbc: Annotated[
        Path | None, typer.Option(help="DBC file of the strain frames. With --mapping, not with --cycle-time.")
    ] = None,
    mapping: Annotated[Path | None, typer.Option(help="Which signal is which gauge (TOML). With --dbc.")] = None,
    cycle_time: Annotated[
        float | None,
        typer.Option(
            metavar="MS",
            callback=within(0.1, 10_000.0, "ms"),
            help="Period of the strain frames of a profile. Not with --dbc. Default: 10.",
        ),
    ] = None,
    id_base: BaseOption = "0x300",
    result_base: ResultBaseOption = "0x380",
    extended: ExtendedOption = False,
    key: KeyOption = None,
    freshness: FreshnessOption = None,
    dynamic_pressure: Annotated[
        float | None,
        typer.Option(
            metavar="PA",
            callback=within(*PRESSURE_PA, "Pa"),
            help="Fixed dynamic pressure, instead of its frame.",
        ),
    ] = None,
    result: Annotated[
        str | None, typer.Option(help="Form of the results: fd, classic-le, classic-be. Default: the input's.")
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", callback=within(*DURATION_S, "s"), help="Stop after this time."),
    ] = None,
    stuck_cycles: Annotated[
        int | None,
        typer.Option(
            callback=within(0, 1_000_000),
            help="Equal values in a row after which a gauge is left out; 0: never. Default: as its noise allows.",
        ),
    ] = None,
    zero_cycles: Annotated[
        int | None,
        typer.Option(
            callback=within(1, 1_000_000),
            help="Exact zeros in a row after which a gauge is left out. Default: as its noise allows.",
        ),
    ] = None,
    gauge_noise: Annotated[
        float | None,
        typer.Option(
            metavar="UM/M",
            callback=within(1e-4, 1000.0, "um/m"),
            help="Standard deviation of the gauges' noise at rest. Default: the estimator's.",
        ),
    ] = None,
    max_age: Annotated[
        float,
        typer.Option(
            metavar="CYCLES",
            callback=within(0.01, 1e6, "cycles"),
            help="Largest age of strains that are used.",
        ),
    ] = 5.0,
    clock_rate: Annotated[
        float,
        typer.Option(
            metavar="PPM",
            callback=within(-10_000.0, 10_000.0, "ppm"),
            help="Known rate error of the sender's clock; positive: slower than the bridge's.",
        ),
    ] = 0.0,
    clock_tolerance: Annotated[
        float,
        typer.Option(
            metavar="PPM",
            callback=within(0.0, 10_000.0, "ppm"),
            help="Largest difference from --clock-rate. A delay that grows faster counts as age.",
        ),
    ] = 100.0,
    hidden_age: Annotated[
        float,
        typer.Option(
            metavar="MS",
            callback=within(0.0, 1e6, "ms"),
            help="Largest sum of delays explained by a slow clock. Beyond it, results are UNCONFIRMED.",
        ),
    ] = 10.0,
    max_uncertainty: Annotated[
        float | None,
        typer.Option(
            metavar="MS",
            callback=within(0.0, 1e6, "ms"),
            help="Largest uncertainty of the age of VALID results. Default: no limit.",
        ),
    ] = None,
    synchronised: Annotated[
        float | None,
        typer.Option(
            metavar="MS",
            callback=within(0.0, 1e6, "ms"),
            help="Accuracy to which the sender's clock agrees with the system time (PTP, NTP).",
        ),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Record the bus: X.blf, X.asc or X.log (candump).")
    ] = None,
    publish: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Send results as UDP-JSON, for 'strainfmu monitor'.")
    ] = None,
    publish_rate: Annotated[
        float,
        typer.Option(
            metavar="HZ",
            callback=within(0.001, 10_000.0, "Hz"),
            help="With --publish: maximum number of datagrams a second.",
        ),
    ] = 50.0,
    publish_field: Annotated[
        Path | None,
        typer.Option(metavar="MAP", help="With --publish: map.h5 for the pressure on the surface, sent too."),
    ] = None,
    zeros: ZerosOption = None,
    tare: Annotated[
        Path | None,
        typer.Option(metavar="MAP", help="Tare when the sender asks for it; map.h5 of the same gauges."),
    ] = None,
    tare_cycles: Annotated[
        int, typer.Option(callback=within(64, 100_000), help="With --tare: number of cycles of a tare.")
    ] = 500,
    tare_known: Annotated[
        Path | None,
        typer.Option(
            metavar="TOML", help="With --tare: strain of own weight and air, from 'tare --known-output'."
        ),
    ] = None,
    tare_output: Annotated[
        Path | None, typer.Option(metavar="TOML", help="With --tare: zero offsets to write. Default: zeros.toml.")
    ] = None,
) -> None:
    """Estimate loads from strain frames on a CAN bus, and send them back as frames.

    Ends on SIGINT or SIGTERM with a summary. SIGUSR1 confirms a sender whose restart is not proven. The frames are
    described in docs/reference/can.md; `strainfmu dbc` writes them as a DBC file.

    Examples:

        strainfmu bridge estimator.fmu --interface socketcan --channel can0

        strainfmu bridge estimator.fmu --interface udp_multicast --channel 239.74.163.2 --bus-option port=43200

        strainfmu bridge estimator.fmu --interface pcan --channel PCAN_USBBUS1 --dbc rack.dbc --mapping rack.toml
    """
    from strainfmu.can.bridge.options import BridgeOptions
    from strainfmu.can.bridge.setup import bus_settings
    from strainfmu.can.bridge.summary import summary_table
    from strainfmu.can.tools.observed import observed_bridge

    refuse_cycle_time(cycle_time, dbc)
    options = BridgeOptions(
        interface=interface,
        channel=channel,
        bus_options=tuple(option or ()),
        bus_context=context,
        profile=profile,
        dbc=dbc,
        mapping=mapping,
        cycle_time=cycle_time_of(10.0 if cycle_time is None else cycle_time),
        identifiers=identifiers_of(id_base, result_base, extended),
        dynamic_pressure=dynamic_pressure,
        result_form=result,
        stuck_cycles=stuck_cycles,
        zero_cycles=zero_cycles,
        gauge_noise=None if gauge_noise is None else 1e-6 * gauge_noise,
        max_age=max_age,
        key_file=key,
        freshness_file=freshness,
        clock_rate=1e-6 * clock_rate,
        clock_tolerance=1e-6 * clock_tolerance,
        hidden_age=1e-3 * hidden_age,
        max_uncertainty=None if max_uncertainty is None else 1e-3 * max_uncertainty,
        synchronised=None if synchronised is None else 1e-3 * synchronised,
        zeros=zeros,
        tare=tare,
        tare_cycles=tare_cycles,
        tare_known=tare_known,
        tare_output=tare_output,
    )
    check_bus_options(interface, bus_settings(options).options)
    console = Console()
    with observed_bridge(
        fmu,
        options,
        record=record,
        publish=publish,
        publish_rate=publish_rate,
        publish_field=publish_field,
    ) as observed:
        running = observed.ready
        console.print(
            f"{fmu}: {running.n_gauges} gauges, {running.layout_name}; {interface}:{channel}; stop with Ctrl-C",
            highlight=False,
            markup=False,
            soft_wrap=True,
        )
        lines = list(running.start_lines)
        if running.freshness is not None and running.freshness.first_run_text:
            lines.append(running.freshness.first_run_text)
        for line in lines:
            console.print(line, highlight=False, markup=False, soft_wrap=True)
        with _stopped_by_signals(running.bridge):
            summary = running.bridge.run(duration)
    console.print(summary_table(summary))
    for note in observed.notes():
        console.print(note, highlight=False, markup=False, soft_wrap=True)


def dbc(
    source: Annotated[Path, typer.Argument(metavar="MAP", help="Inverse map (map.h5), or the FMU made of it.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="DBC file to write.")] = Path("strainfmu.dbc"),
    profile: ProfileOption = "fd64",
    cycle_time: CycleTimeOption = 10.0,
    id_base: BaseOption = "0x300",
    result_base: ResultBaseOption = "0x380",
    extended: ExtendedOption = False,
    tare: Annotated[bool, typer.Option("--tare", help="Include the frame that asks a bridge for a tare.")] = False,
) -> None:
    """Write the DBC file of the bridge's frames: strains in, results out.

    Examples:

        strainfmu dbc results/map.h5 -o strains.dbc

        strainfmu dbc results/map.h5 -o strains.dbc --profile classic-be --id-base 0x100 --cycle-time 20
    """
    from strainfmu.can.tools.dbc_export import write_dbc

    identifiers = identifiers_of(id_base, result_base, extended)
    n_frames = write_dbc(
        source,
        output,
        profile=profile,
        cycle_time=cycle_time_of(cycle_time),
        identifiers=identifiers,
        has_tare=tare,
    )
    Console().print(f"{output}: written, {n_frames} frames", highlight=False, markup=False, soft_wrap=True)


def identifiers_of(base: str, result_base: str, extended: bool) -> Identifiers:
    """Return the identifiers that the options state, in any of Python's notations."""
    from strainfmu.can.wire.profiles import Identifiers

    numbers = []
    for name, text in (("--id-base", base), ("--result-base", result_base)):
        try:
            numbers.append(int(text, 0))
        except ValueError as error:
            raise InputError(f"{name}: expected a number such as 0x300, got '{text}'") from error
    return Identifiers(numbers[0], numbers[1], extended)


@contextmanager
def _stopped_by_signals(running: Bridge) -> Iterator[None]:
    """Let SIGINT and SIGTERM stop the bridge in good order, the second one as ever; SIGUSR1 confirms senders."""

    def stop(number: int, _: object) -> None:
        signal.signal(number, previous[signal.Signals(number)])
        running.stop()

    def confirm(_: int, __: object) -> None:
        running.confirm_sender()

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
