"""Recorded data and the live view: ``strainfmu replay``, ``channels``, ``estimate`` and ``monitor``."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.table import Table

import builder
import strainfmu
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.can_bus import BusOption, ProfileOption, SetOption
from strainfmu.cli.commands.can_send import stop_request
from strainfmu.cli.commands.number_ranges import PRESSURE_PA, within
from strainfmu.cli.commands.taring import DateOrderOption
from strainfmu.errors import InputError, StrainfmuError

if TYPE_CHECKING:
    from strainfmu.can.replay import ReplaySummary
    from strainfmu.recorded.run import EstimationSummary


ZerosOption = Annotated[
    Path | None,
    typer.Option(metavar="TOML", help="Zero offsets of the gauges, of 'strainfmu tare'; subtracted."),
]


def replay(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="Recording of a bus: BLF, ASC, candump, TRC, CSV or MF4; .gz.")
    ],
    fmu: Annotated[Path, typer.Argument(metavar="FMU", help="Estimator FMU, or inverse map.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Results to write: CSV or HDF5.")],
    bus: BusOption = None,
    settings: SetOption = None,
    profile: ProfileOption = None,
) -> None:
    """Compute the results of a recorded run again, off line, from its time stamps.

    A log of 'strainfmu bridge --record' needs no options; other logs need the bus file of the bridge.

    Examples:

        strainfmu replay run.blf estimator.fmu -o run.csv

        strainfmu replay foreign.asc estimator.fmu -o run.h5 --profile classic-le --set input.cycle_time_ms=20

        strainfmu replay rack.blf map.h5 -o run.csv --bus bus.toml
    """
    console = Console()
    with ConsoleReporter(console).stage(f"Replay: {log.name}") as progress:
        begin = perf_counter()
        summary = strainfmu.replay(
            log, fmu, output, bus=bus, settings=settings or (), profile=profile, progress=progress
        )
    _show_replay(console, log, output, summary, perf_counter() - begin)


def channels(
    source: Annotated[Path, typer.Argument(metavar="MAP", help="Inverse map (map.h5), or estimator FMU.")],
    data: Annotated[Path, typer.Argument(metavar="DATA", help="CSV, HDF5, MF4, TDMS, MAT or Parquet.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Channel file to write (TOML).")] = Path(
        "channels.toml"
    ),
) -> None:
    """Propose which channel of a recording is which gauge, in a file to check and correct.

    Each gauge of the map gets the channel of its name or number, or the channel with the nearest name. Units are
    taken from the recording. A file that is there is never overwritten.

    Examples:

        strainfmu channels map.h5 recorder.tdms -o channels.toml

        strainfmu estimate map.h5 recorder.tdms -o loads.csv --channels channels.toml
    """
    draft = strainfmu.channels(source, data, output)
    lines = [f"{output}: written; {draft.summary()}", *draft.remarks()]
    lines.append(f"check it, then: strainfmu estimate {source} {data} -o loads.csv --channels {output}")
    for line in lines:
        Console().print(line, highlight=False, markup=False, soft_wrap=True)


def estimate(
    source: Annotated[Path, typer.Argument(metavar="FMU", help="Estimator FMU, or inverse map.")],
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA", help="CSV, HDF5, MF4, TDMS, MAT, Parquet, or a CAN log: BLF, ASC, log, MF4."
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Estimates to write: CSV, HDF5, Parquet or MF4.")],
    dynamic_pressure: Annotated[
        float | None,
        typer.Option(
            metavar="PA",
            callback=within(*PRESSURE_PA, "Pa", takes_nan=True),
            help="Dynamic pressure of the whole file, instead of its column; nan: not known.",
        ),
    ] = None,
    columns: Annotated[
        Literal["plain", "all"] | None,
        typer.Option(
            help="plain: time, loads, angles in degrees, health in words. Default: plain for CSV, all for others."
        ),
    ] = None,
    residuals: Annotated[
        bool, typer.Option("--residuals", help="Write the standardised residual of every gauge.")
    ] = False,
    ignore_columns: Annotated[
        str | None, typer.Option(metavar="NAME,..", help="Columns not to read; * for all unknown ones.")
    ] = None,
    accept_strain_level: Annotated[
        bool,
        typer.Option(
            "--accept-strain-level", help="Estimate although the strains are far from the range of the map."
        ),
    ] = False,
    accept_held: Annotated[
        bool,
        typer.Option("--accept-held", help="Estimate rows in which no gauge changes; they are INVALID otherwise."),
    ] = False,
    exclude: Annotated[
        str | None,
        typer.Option(
            metavar="CHANNEL,..",
            help="Gauges to leave out, by name, number or column; auto: those that stand still.",
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="X.html", help="Write a page of the flight, HTML or PDF: usable or not, figures."),
    ] = None,
    field: Annotated[
        Path | None,
        typer.Option(
            metavar="X.vtkhdf", help="Write the surface pressure, for ParaView. The map needs keep_field = true."
        ),
    ] = None,
    field_every: Annotated[
        int | None,
        typer.Option(metavar="N", callback=within(1, 1_000_000), help="With --field: write every N-th sample."),
    ] = None,
    channels: Annotated[
        Path | None,
        typer.Option(metavar="TOML", help="Which channel of the recorder is which gauge, and its unit or bridge."),
    ] = None,
    date_order: DateOrderOption = None,
    filter_seconds: Annotated[
        float | None,
        typer.Option(
            "--filter",
            metavar="SECONDS",
            callback=within(1e-9, 1e6, "s"),
            help="Average each sample with those before, over this time at most.",
        ),
    ] = None,
    smooth: Annotated[bool, typer.Option("--smooth", help="With --filter: filter from both ends.")] = False,
    zeros: ZerosOption = None,
    bus: Annotated[
        Path | None,
        typer.Option("--bus", metavar="TOML", help="Bus file of a CAN log that strainfmu did not record."),
    ] = None,
) -> None:
    """Estimate loads from recorded strains.

    Columns have the names of the gauges or strain[1] .., with the unit in brackets: 'strain[1] \\[um/m]'.
    Without a unit they are in m/m, Pa, m and s. Other names and units stand in a channel file: --channels.

    Other columns: dynamic_pressure, dynamic_pressure_std, mach_number, altitude. HDF5: data sets strain (n,
    n_d), time, dynamic_pressure .. with the attribute unit.

    A CAN log takes --bus, --dynamic-pressure and --zeros alone.

    Examples:

        strainfmu estimate map.h5 flight.csv -o loads.csv

        strainfmu estimate estimator.fmu flight.h5 -o loads.h5 --dynamic-pressure 95800

        strainfmu estimate map.h5 flight.csv -o loads.csv --residuals --ignore-columns 'temperature*,operator'

        strainfmu estimate map.h5 flight.csv -o loads.csv --exclude axial_180deg_7,'strain\\[12]'

        strainfmu estimate map.h5 recorder.tdms -o loads.csv --channels channels.toml

        strainfmu estimate map.h5 flight.csv -o loads.parquet --report flight.html

        strainfmu estimate map.h5 flight.csv -o loads.h5 --filter 10 --smooth

        strainfmu estimate estimator.fmu run.blf -o loads.h5

        strainfmu estimate map.h5 flight.csv -o loads.h5 --field pressure.vtkhdf --field-every 10
    """
    given, console = dict(locals()), Console()
    given |= {"ignore_columns": _names(ignore_columns), "exclude": _names(exclude)}
    del given["report"]
    if report is not None:
        from builder.reports.flight_page import check_report
        from strainfmu.can.log_frames import is_bus_log

        if is_bus_log(data):
            raise InputError(f"{data}: --report: expected none with a CAN log")
        check_report(report)
    begin = perf_counter()
    with ConsoleReporter(console).stage(f"Estimate: {data.name}") as progress:
        summary = strainfmu.estimate(**given, progress=progress)
    from strainfmu.can.replay import ReplaySummary

    if isinstance(summary, ReplaySummary):
        return _show_replay(console, data, output, summary, perf_counter() - begin)
    for line in _estimate_lines(summary, data):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    console.print(f"{output}: written, {summary.samples} samples", highlight=False, markup=False, soft_wrap=True)
    if field is not None:
        console.print(f"{field}: written, {summary.fields} fields", highlight=False, markup=False, soft_wrap=True)
    if report is not None:
        read = {"recording": data, "estimator": source, "channels": channels, "zero offsets": zeros}
        builder.write_flight_page(
            summary, report, {content: path for content, path in read.items() if path is not None}
        )
        console.print(f"{report}: written", highlight=False, markup=False, soft_wrap=True)
    if not summary.results:
        states = ", ".join(f"{name} {number}" for name, number in summary.health.most_common())
        raise StrainfmuError(f"{data}: none of {summary.samples} samples has a result: {states or 'all refused'}")


def _names(text: str | None) -> list[str]:
    """Return the names of a list with commas."""
    return [name.strip() for name in (text or "").split(",") if name.strip()]


def _estimate_lines(summary: EstimationSummary, data: Path) -> list[str]:
    """Return what a user should know of the data and the estimates."""
    health = ", ".join(f"{name} {number}" for name, number in sorted(summary.health.items()))
    lines = [f"health: {health or '-'}", *summary.account.lines()]
    if summary.missing_strains:
        total = sum(summary.missing_strains.values())
        gauge, number = summary.missing_strains.most_common(1)[0]
        lines.append(
            f"{data}: {total} strains without a value in {len(summary.missing_strains)} gauges, the largest "
            f"number in '{gauge}' ({number}): left out, and sigma has grown accordingly"
        )
    if summary.missing_pressure:
        lines.append(f"{data}: {summary.missing_pressure} samples without a dynamic pressure: no coefficients")
    if summary.refused:
        lines.append(f"{data}: {summary.refused} samples refused by the FMU: no coefficients")
    if summary.unused:
        some = ", ".join(summary.unused[:6]) + (" ..." if len(summary.unused) > 6 else "")
        number = len(summary.unused)
        lines.append(f"{data}: {number} {'column' if number == 1 else 'columns'} not used: {some}")
    lines += summary.notes
    return lines


def _show_replay(console: Console, log: Path, output: Path, summary: ReplaySummary, took: float) -> None:
    """Print what a replay gave, in ``took`` [s]."""
    from strainfmu.can.bridge import health_rows
    from strainfmu.can.quality import FrameClass

    table = Table(title="Replay", show_header=False)
    table.add_row("log", f"{summary.duration:.2f} s, {summary.duration / took:.0f} times as fast")
    for quality, number in sorted(summary.qualities.items()):
        table.add_row(f"results {quality.name}", str(number))
    for name, text in health_rows(summary.healths, summary.navigated):
        table.add_row(name, text)
    for name, number in summary.account.rows():
        table.add_row(f"frames: {name}", str(number))
    table.add_row("frames: not accounted for", str(summary.account.unaccounted))
    if summary.compared:
        table.add_row("result frames of the log given again", f"{summary.equal} of {summary.compared}")
    console.print(table)
    for note in summary.notes:
        console.print(note, highlight=False, markup=False, soft_wrap=True)
    console.print(f"{output}: written", highlight=False, markup=False, soft_wrap=True)
    if not summary.results:
        used, received = summary.account.classes[FrameClass.USED], summary.account.received
        raise StrainfmuError(
            f"{log}: none of {sum(summary.qualities.values())} results has coefficients, {used} of {received} "
            "frames are used: expected profile, identifiers, key or DBC file and mapping of the log"
        )


def monitor(
    listen: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Address to which the bridge publishes. Default: 127.0.0.1:9870."),
    ] = None,
    http: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT",
            help="Address of the page. Beyond loopback, everyone can read it. Default: 127.0.0.1:8780.",
        ),
    ] = None,
    bus: Annotated[
        Path | None,
        typer.Option("--bus", metavar="TOML", help="Bus file; addresses and token are entries of its table page."),
    ] = None,
) -> None:
    """Show live strains, coefficients, health and the frame account in a browser.

    A process of its own: it may start before or after the bridge, and goes on when that restarts.

    Examples:

        strainfmu monitor

        strainfmu bridge estimator.fmu --bus bus.toml --set page.publish=127.0.0.1:9870
    """
    from time import sleep

    from strainfmu.monitor.server import shown_address

    console = Console()
    with stop_request() as stopped:
        running = strainfmu.serve_monitor(listen, http, bus)
        try:
            address = shown_address(running.listens_at)
            line = f"{running.url}: open it in a browser; it listens for datagrams at {address}; stop with Ctrl-C"
            console.print(line, highlight=False, markup=False, soft_wrap=True)
            while not stopped():
                sleep(0.1)
        finally:
            running.close()
    state = running.state
    console.print(
        f"{state.datagrams} datagrams, {state.refused} refused", highlight=False, markup=False, soft_wrap=True
    )
