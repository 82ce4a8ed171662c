"""Recorded data and the live view: ``strainfmu replay``, ``channels``, ``estimate``, ``tare`` and ``monitor``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from rich.console import Console

import builder
import strainfmu
from builder.pipeline.progress_bars import ConsoleReporter
from strainfmu.cli.commands.can_bus import result_rows, shown_table, stop_request
from strainfmu.cli.commands.printed import say
from strainfmu.errors import InputError, StrainfmuError

if TYPE_CHECKING:
    from strainfmu.can.replay import ReplaySummary
    from strainfmu.estimator.tare import Tare
    from strainfmu.recorded.summary import EstimationSummary


def replay(*, log: Path, output: Path, **options: Any) -> None:
    """Replay a recorded run and print what it gave."""
    with ConsoleReporter(Console()).stage(f"Replay: {log.name}") as progress:
        begin = perf_counter()
        summary = strainfmu.replay(log, output=output, **options, progress=progress)
    _show_replay(log, output, summary, perf_counter() - begin)


def channels(*, source: Path, data: Path, output: Path) -> None:
    """Write a draft of a channel file and print what to check."""
    draft = strainfmu.channels(source, data, output)
    say(f"{output}: written; {draft.summary()}", *draft.remarks())
    say(f"check it, then: strainfmu estimate {source} {data} -o loads.csv --channels {output}")


def estimate(*, source: Path, data: Path, output: Path, report: Path | None, **options: Any) -> None:
    """Estimate the loads of a recording, and print what a user should know of data and estimates."""
    dividing = {name: options.pop(name) for name in ("workers", "scheduler", "part_rows")}
    if data.is_dir() or any(value is not None for value in dividing.values()):
        return _estimate_in_parts(source, data, output, {"report": report, **options}, dividing)
    if report is not None:
        from builder.reports.flight_page import check_report
        from strainfmu.can.log_frames import is_bus_log

        if is_bus_log(data):
            raise InputError(f"{data}: --report: expected none with a CAN log")
        check_report(report)
    begin = perf_counter()
    with ConsoleReporter(Console()).stage(f"Estimate: {data.name}") as progress:
        summary = strainfmu.estimate(source, data, output, **options, progress=progress)
    from strainfmu.can.replay import ReplaySummary

    if isinstance(summary, ReplaySummary):
        return _show_replay(data, output, summary, perf_counter() - begin)
    say(*_estimate_lines(summary, data), f"{output}: written, {summary.samples} samples")
    if options["field"] is not None:
        say(f"{options['field']}: written, {summary.fields} fields")
    if report is not None:
        read = {"recording": data, "estimator": source}
        read |= {"channels": options["channels"], "zero offsets": options["zeros"]}
        files = {content: path for content, path in read.items() if path is not None}
        builder.write_flight_page(summary, report, files)
        say(f"{report}: written")
    _refuse_without_results(summary, data)


def _estimate_in_parts(
    source: Path, data: Path, output: Path, options: dict[str, Any], dividing: dict[str, Any]
) -> None:
    """Estimate a folder of recordings, or one with several workers, and print what a user should know."""
    for name in ("report", "field", "field_every", "bus"):
        if options.pop(name) is not None:
            option = f"--{name.replace('_', '-')}"
            raise InputError(f"{data}: {option}: expected none with parts: estimate the recording by itself")
    reporter = ConsoleReporter(Console())
    summary = builder.estimate_recordings(source, data, output, progress=reporter, **dividing, **options)
    say(*_estimate_lines(summary, data), f"{output}: written, {summary.samples} samples")
    _refuse_without_results(summary, data)


def _refuse_without_results(summary: EstimationSummary, data: Path) -> None:
    if not summary.results:
        states = ", ".join(f"{name} {number}" for name, number in summary.health.most_common())
        raise StrainfmuError(f"{data}: none of {summary.samples} samples has a result: {states or 'all refused'}")


def _estimate_lines(summary: EstimationSummary, data: Path) -> list[str]:
    """Return what a user should know of the data and the estimates."""
    health = ", ".join(f"{name} {number}" for name, number in sorted(summary.health.items()))
    lines = [f"health: {health or '-'}", *summary.health_lines()]
    if summary.faults.missing:
        total = sum(summary.faults.missing.values())
        gauge, number = summary.faults.missing.most_common(1)[0]
        lines.append(
            f"{data}: {total} strains without a value in {len(summary.faults.missing)} gauges, the largest "
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


def _show_replay(log: Path, output: Path, summary: ReplaySummary, took: float) -> None:
    """Print what a replay gave, in ``took`` [s]."""
    from strainfmu.can.quality import FrameClass

    rows = [
        ("log", f"{summary.duration:.2f} s, {summary.duration / took:.0f} times as fast"),
        *result_rows(summary),
    ]
    if summary.compared:
        rows.append(("result frames of the log given again", f"{summary.equal} of {summary.compared}"))
    shown_table("Replay", rows)
    say(*summary.notes, f"{output}: written")
    if not summary.results:
        used, received = summary.account.classes[FrameClass.USED], summary.account.received
        raise StrainfmuError(
            f"{log}: none of {sum(summary.qualities.values())} results has coefficients, {used} of {received} "
            "frames are used: expected profile, identifiers, key or DBC file and mapping of the log"
        )


def monitor(**options: Any) -> None:
    """Serve the page until a signal."""
    from time import sleep

    from strainfmu.monitor.server import shown_address

    with stop_request() as stopped:
        running = strainfmu.serve_monitor(**options)
        try:
            address = shown_address(running.listens_at)
            say(f"{running.url}: open it in a browser; it listens for datagrams at {address}; stop with Ctrl-C")
            while not stopped():
                sleep(0.1)
        finally:
            running.close()
    state = running.state
    say(f"{state.datagrams} datagrams, {state.refused} refused")


OF_KNOWN_LOADS = ("weight_up_roll_deg", "weight_nose_deg", "ambient_pressure", "known_output")
"""Options of :func:`builder.known_strain`."""


def tare(*, inverse_map: Path, recording: Path, output: Path, vehicle: Path | None, **options: Any) -> None:
    """Find zero offsets and print them."""
    from strainfmu.estimator.tare import refusal

    loads = {name: options.pop(name) for name in OF_KNOWN_LOADS}
    known, known_of = None, dict[str, str | float]()
    if vehicle is not None:
        known, known_of = builder.known_strain(inverse_map, vehicle, **loads)
    try:
        result = strainfmu.tare(inverse_map, recording, output=output, known=known, known_of=known_of, **options)
    except StrainfmuError as error:
        _show_notes(recording, getattr(error, "__notes__", ()))
        raise
    _show_notes(recording, (*result.notes, *(f"accepted: {why}" for why in [refusal(result)] if why)))
    say(_summary(result), f"{output}: written")


def _show_notes(recording: Path, notes: Sequence[str]) -> None:
    say(*(f"{recording}: {note}" for note in notes))


def _summary(result: Tare) -> str:
    import numpy as np

    zeros = 1e6 * result.zeros.value
    known = result.zeros.std < 0.01
    std = 1e6 * result.zeros.std[known]
    if not known.any():
        return f"no zeros from {result.samples} samples"
    return (
        f"{int(known.sum())} zeros from {result.samples} samples: rms {np.sqrt(np.mean(zeros**2)):.4g} um/m, "
        f"standard deviations {std.min():.2g} to {std.max():.2g} um/m each and "
        f"{1e6 * result.zeros.common_std:.2g} um/m in common (readings remember: factor {result.memory:.2g})"
    )
