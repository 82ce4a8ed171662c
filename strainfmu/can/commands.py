"""Commands of the bus as functions: ``bridge``, ``dbc``, ``send`` and ``replay``."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, replace
from itertools import islice
from os import PathLike
from pathlib import Path
from time import sleep
from typing import Any

from strainfmu.can.authentic import FIRST_TRIP, freshness_file, next_trip
from strainfmu.can.bus_file import bus_template, read_bus
from strainfmu.can.listener import BridgeSummary
from strainfmu.can.observed import ObservedBridge, observed_bridge
from strainfmu.can.opening import VIRTUAL, VIRTUAL_TEXT, BusSettings, bus_settings, open_bus, shut_down
from strainfmu.can.options import BridgeOptions
from strainfmu.can.replay import ReplaySummary, replay_described
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.sender import Answers, Score, Sender, SentFlight, score_answers, send_flight
from strainfmu.can.setup import map_input_layout, result_form, stated_in, write_dbc
from strainfmu.can.strain_sources import FlownSample, plant_samples, recorded_samples, scenario_samples
from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically
from strainfmu.recorded.run import Progress
from strainfmu.written_files import check_outputs

File = str | PathLike[str]


@dataclass(frozen=True, kw_only=True)
class BridgeRun:
    """The summary of a bridge, and lines on recording, freshness value, zero offsets and datagrams."""

    summary: BridgeSummary
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class SentStrains:
    """What was sent, and the errors of the bridge's results; None where the truth or the results are unknown."""

    sent: SentFlight
    score: Score | None


def bridge(
    fmu: File,
    *,
    bus: File | None = None,
    settings: Sequence[str] = (),
    interface: str | None = None,
    channel: str | None = None,
    option: Sequence[str] = (),
    profile: str | None = None,
    record: File | None = None,
    duration: float | None = None,
    say: Callable[[str], None] | None = None,
    running: Callable[[ObservedBridge], AbstractContextManager[Any]] = nullcontext,
) -> BridgeRun:
    """Estimate loads from strain frames on a CAN bus, and send them back as frames.

    Ends on SIGINT or SIGTERM with a summary. SIGUSR1 confirms a sender whose restart is not proven. The frames are
    described in docs/reference/can.md; ``strainfmu dbc`` writes them as a DBC file, or a bus file to fill in.

    On the command line::

        strainfmu bridge estimator.fmu --interface socketcan --channel can0
        strainfmu bridge estimator.fmu --interface udp_multicast --channel 239.74.163.2 --bus-option port=43200
        strainfmu bridge estimator.fmu --bus bus.toml --set trust.max_age_cycles=10 --record run.blf

    Parameters
    ----------
    fmu : estimator FMU.
    bus : bus file: interface, frames, clock, trust, record ..
    settings : entries of the bus file, such as "trust.max_age_cycles=10".
    interface : python-can interface: socketcan, udp_multicast, pcan ...
    channel : its channel: can0, 239.74.163.2 ...
    option : options of the interface, such as "bitrate=500000".
    profile : "fd64", "classic-le" or "fd64-sec". Default: fd64.
    record : record the bus: X.blf, X.asc or X.log (candump).
    duration : stop after this time [s].
    say : takes lines on the bridge as it begins.
    running : returns a context around the run of a bridge, as for signals that stop it.

    Raises
    ------
    InputError, StrainfmuError
        A file or an entry is wrong, the interface cannot be opened, or the bridge fails.
    """
    option_values = _of_bus(interface, channel, option, profile) | {"record.file": record}
    described = read_bus(_path(bus), settings, option_values)
    options, say = described.options(), say or (lambda line: None)
    check_outputs({"fmu": fmu, "bus": bus, "record": described.record, "zeros": options.zeros})
    with observed_bridge(
        Path(fmu),
        options,
        record=described.record,
        publish=described.publish,
        publish_rate=described.publish_rate,
        publish_field=described.publish_field,
        publish_token=described.publish_token,
    ) as observed:
        layout, on_bus = observed.bridge.machine.layout, f"{options.interface}:{options.channel}"
        say(f"{fmu}: {layout.n_gauges} gauges, {layout.name}; {on_bus}; stop with Ctrl-C")
        for line in observed.start_lines:
            say(line)
        observed.bridge.say = say
        with running(observed):
            summary = observed.bridge.run(duration)
    return BridgeRun(summary=summary, notes=tuple(observed.notes()))


def dbc(
    source: File,
    output: File = "strainfmu.dbc",
    *,
    bus: File | None = None,
    settings: Sequence[str] = (),
    profile: str | None = None,
) -> int:
    """Write the DBC file of the bridge's frames: strains in, results out. With ``input.dbc``, results alone.

    On the command line::

        strainfmu dbc results/map.h5 -o strains.dbc
        strainfmu dbc results/map.h5 -o strains.dbc --bus bus.toml --set input.id_base=0x100
        strainfmu dbc results/map.h5 --template bus.toml

    Parameters
    ----------
    source : inverse map (map.h5), or the FMU made of it.
    output : DBC file to write.
    bus, settings, profile : as :func:`bridge` takes them.
    """
    described = read_bus(_path(bus), settings, {"input.profile": profile})
    return write_dbc(Path(source), Path(output), described.options(BridgeOptions(interface="", channel="")))


def dbc_template(source: File, template: File) -> None:
    """Write a bus file with every entry, to fill in, for the gauges of a map or an FMU.

    Parameters
    ----------
    source : inverse map (map.h5), or the FMU made of it.
    template : write a bus file with every entry instead, to fill in.

    Raises
    ------
    InputError
        There is such a file, or the map is wrong.
    """
    path = Path(template)
    if path.exists():
        raise InputError(f"{path}: expected a new file, got one that exists")
    write_bytes_atomically(path, bus_template(stated_in(Path(source))[0]).encode())


def send(
    data: File | None = None,
    *,
    bus: File | None = None,
    settings: Sequence[str] = (),
    interface: str | None = None,
    channel: str | None = None,
    option: Sequence[str] = (),
    profile: str | None = None,
    plant: File | None = None,
    gauges: File | None = None,
    duration: float = 20.0,
    report: File | None = None,
    say: Callable[[str], None] | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> SentStrains:
    """Send strains on a CAN bus as a vehicle would.

    Receives the bridge's results meanwhile, names them in its frames, and compares them with the truth where it is
    known. A tare, a DBC file and all else are entries of the bus file.

    On the command line::

        strainfmu send --plant demo/plant.fmu --map demo/map.h5 --interface socketcan --channel vcan0
        strainfmu send flight.h5 --bus bus.toml --set tare.at_s=5
        strainfmu send ic3x_flight.toml --map demo/map.h5 --interface socketcan --channel vcan0

    Parameters
    ----------
    data : recorded strains (CSV, HDF5 ..), a row per cycle, or a scenario (TOML), flown in closed loop.
    bus, settings, interface, channel, option, profile : as :func:`bridge` takes them.
    plant : plant FMU whose strains are sent, instead of ``data``.
    gauges : map or FMU whose gauges the frames hold (input.gauges).
    duration : longest duration [s].
    report : file for the errors of the bridge's results; a plant or a scenario has the truth.
    say : takes lines on the bus as it is opened.
    stopped : asked before each cycle whether to end.

    Raises
    ------
    InputError, StrainfmuError
        A file or an entry is wrong, the interface cannot be opened, or there is nothing to report.
    """
    if (plant is None) == (data is None):
        raise InputError(f"DATA, --plant: expected one of them, got {'none' if plant is None else 'both'}")
    option_values = _of_bus(interface, channel, option, profile) | {"input.gauges": _path(gauges)}
    described = read_bus(_path(bus), settings, option_values)
    options, source = described.options(), described.gauges
    if source is None:
        raise InputError("--map: expected the map or FMU of the gauges, or input.gauges of the bus file, got none")
    if described.tare_at is not None and options.tare is None:
        options = replace(options, tare=source)
    settings_of_bus = bus_settings(options.interface, options.channel, options.bus_options)
    layout, names, readings = map_input_layout(options, source)
    if not layout.cycle_time <= duration:
        raise InputError(
            f"--duration: expected at least the period of {1e3 * layout.cycle_time:g} ms, got {duration:g} s"
        )
    samples: AbstractContextManager[Iterator[FlownSample]]
    if data is None:
        assert plant is not None
        samples = plant_samples(
            Path(plant),
            len(names),
            cycle_time=layout.cycle_time,
            duration=duration,
            readings=tuple(readings),
        )
    elif Path(data).suffix.lower() == ".toml":
        samples = scenario_samples(Path(data), source.parent, layout.cycle_time)  # its files lie next to the map
    else:
        samples = recorded_samples(Path(data), names, options.dynamic_pressure, readings)
    if options.interface == VIRTUAL and say is not None:
        say(VIRTUAL_TEXT)
    with samples as opened:
        limited = islice(opened, round(duration / layout.cycle_time))
        outcome = _send(
            settings_of_bus, options, layout, samples=limited, tare_at=described.tare_at, stopped=stopped
        )
    if report is not None:
        score = outcome.score
        if score is None or (score.published and not score.has_errors):
            raise InputError("--report: no results with a known truth, nothing to report")
        write_bytes_atomically(Path(report), json.dumps(asdict(score), indent=1).encode())
    return outcome


def replay(
    log: File,
    fmu: File,
    output: File,
    *,
    bus: File | None = None,
    settings: Sequence[str] = (),
    profile: str | None = None,
    progress: Progress | None = None,
) -> ReplaySummary:
    """Compute the results of a recorded run again, off line, from its time stamps.

    A log of ``strainfmu bridge --record`` needs no options; other logs need the bus file of the bridge.

    On the command line::

        strainfmu replay run.blf estimator.fmu -o run.csv
        strainfmu replay foreign.asc estimator.fmu -o run.h5 --profile classic-le --set input.cycle_time_ms=20
        strainfmu replay rack.blf map.h5 -o run.csv --bus bus.toml

    Parameters
    ----------
    log : recording of a bus: BLF, ASC, candump, TRC, CSV or MF4; .gz.
    fmu : estimator FMU, or inverse map.
    output : results to write: CSV or HDF5.
    bus, settings, profile : as :func:`bridge` takes them, for a log that no bridge recorded.
    progress : takes how much is done, and how much there is.

    Raises
    ------
    InputError, StrainfmuError
        A file or an entry is wrong.
    """
    described = read_bus(_path(bus), settings, {"input.profile": profile})
    return replay_described(Path(log), fmu, output, described, progress)


def _send(
    settings: BusSettings,
    options: Any,
    layout: Any,
    *,
    samples: Iterator[FlownSample],
    tare_at: float | None,
    stopped: Callable[[], bool],
) -> SentStrains:
    """Open the bus twice, to send and to listen; return what was sent, and what came back."""
    trip = FIRST_TRIP
    if layout.key is not None:
        trip = next_trip(options.freshness_file or freshness_file(options.key_file, "sender"), layout.key)
    sender = Sender(layout, trip)
    results = result_layouts(result_form(options, layout), options.identifiers, layout.cycle_time)
    named = layout.trailer or layout.first_of_cycle
    modulus = 0 if named.layout.protection is None else named.layout.protection.counter_modulus
    bus = open_bus(settings)
    heard = open_bus(settings)
    try:
        answers = Answers(heard, results, sender.hear)
        sent = send_flight(bus, layout, samples=samples, stopped=stopped, tare_at=tare_at, sender=sender)
        sleep(3.0 * layout.cycle_time + 0.2)  # the answer to the last cycle
        received = answers.finish()
        is_heard = bool(sent.truth) and bool(received)
        return SentStrains(sent=sent, score=score_answers(received, sent.truth, modulus) if is_heard else None)
    finally:
        shut_down(bus)
        shut_down(heard)


def _path(file: File | None) -> Path | None:
    return None if file is None else Path(file)


def _of_bus(
    interface: str | None, channel: str | None, option: Sequence[str], profile: str | None
) -> dict[str, Any]:
    """Return entries of a bus file that other arguments state."""
    options = tuple(option) or None
    return {
        "bus.interface": interface,
        "bus.channel": channel,
        "bus.options": options,
        "input.profile": profile,
    }
