"""Loads of long recordings, and of folders of them, from several processors: one Parquet data set of parts.

A recording is divided into parts of successive rows. A part is estimated by itself: rows ahead of it lead the
filter and the nonlinear estimator in, and are not written. What is counted in the parts is added up in order,
so that the summary is the one of the whole. Parts that are done are not done again.
"""

import json
import os
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np

from builder.campaign.dask_workers import on_dask
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.processors import processors
from strainfmu.can.log_frames import is_bus_log
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.signal_names import ZERO
from strainfmu.files import fingerprint, kept_json, write_bytes_atomically
from strainfmu.recorded.checks import DataChecks, FaultCounts, FaultRows
from strainfmu.recorded.formats import SUFFIXES
from strainfmu.recorded.names import some_of
from strainfmu.recorded.run import Options, estimate_file, opened
from strainfmu.recorded.samples import WHOLE, Gaps, Part
from strainfmu.recorded.summary import EstimationSummary
from strainfmu.recorded.table import PIECE_ROWS
from strainfmu.version import __version__

PART_ROWS = 1_000_000
"""Rows of a part, unless stated."""

LEAD_WINDOWS = 2.0
"""Time that leads a filter in, in its longest windows."""

SUFFIX = ".parquet"

_COUNTS = "_parts"
"""Folder of what was counted in the parts; readers of data sets pass over names with an underscore."""


class Task(NamedTuple):
    """A part of a recording, the files of its loads and of its counts, and the key of all that it is made of."""

    data: Path
    part: Part
    loads: Path
    counts: Path
    key: str


@dataclass(eq=False)
class Divided:
    """A recording that is divided: its parts, and the summary and the checks that take the counts of these."""

    tasks: list[Task]
    summary: EstimationSummary
    checks: DataChecks


def estimate_recordings(
    source: str | Path,
    data: str | Path,
    output: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    part_rows: int | None = None,
    progress: AnyProgress = None,
    **options: Any,
) -> EstimationSummary:
    """Estimate the loads of a long recording, or of a folder of them, in parts, as one Parquet data set.

    ``pandas.read_parquet(output)`` reads it, with the name of the file as the column ``recording``. Recordings of
    text, and of several rasters, are one part each. A second run continues an interrupted one.

    Parts change no bit of the loads, except with a filter, whose windows begin two time constants ahead of a
    part, and where a nonlinear estimator without strains holds its loads for longer.

    On the command line::

        strainfmu estimate map.h5 flights/ -o loads.parquet --workers 2

    Parameters
    ----------
    source : inverse map.
    data : recording, or a folder with recordings.
    output : folder of the data set, X.parquet; it appears when it is complete.
    workers : parts at a time on this machine. Default: the number of processors.
    scheduler : Dask scheduler, such as tcp://host:8786, whose workers share the files.
    part_rows : rows of a part, in multiples of 16,000. Default: 1,000,000.
    progress : True for progress bars.
    options : as :func:`strainfmu.estimate` takes them, but ``field``, ``field_every`` and ``bus``.

    Raises
    ------
    InputError
        A file, a column, a unit or a number is wrong; or ``output`` is there and is no such data set.
    StrainfmuError
        Something needed is not installed, the output cannot be written, or the workers are lost.
    """
    source, data, output = Path(source), Path(data), Path(output)
    reporter, asked = reporter_of(progress), Options(**options)
    _check_output(output)
    work = output.with_name(f"{output.name}.unfinished")
    rows = max(1, round((part_rows or PART_ROWS) / PIECE_ROWS)) * PIECE_ROWS
    files, passed = _files_of(data)
    recordings = [_divided(source, file, work, rows, asked) for file in files]
    tasks = [task for recording in recordings for task in recording.tasks]
    todo, run = [task for task in tasks if not _is_done(task)], partial(estimate_part, source, asked)
    number = min(workers or processors(), len(todo))
    title = "Parts" if len(todo) == len(tasks) else f"Parts: {len(todo)} of {len(tasks)}"
    with reporter.stage(title) as done:
        is_here = number <= 1 and scheduler is None
        results: Iterator[Task] = (
            map(run, todo) if is_here else on_dask(run, todo, scheduler, number, reporter.note)
        )
        for k, _ in enumerate(results, start=1):
            done(k, len(todo))
    try:
        summary = _added(recordings)
        summary.notes += passed
    except InputError:  # what is refused as a whole leaves nothing
        shutil.rmtree(work)
        raise
    _finish(work, output)
    return summary


def estimate_part(source: Path, options: Options, task: Task) -> Task:
    """Estimate a part, and write its loads, then what was counted."""
    part = task.part
    if part != WHOLE and (seconds := LEAD_WINDOWS * (options.filter_seconds or 0.0)):
        part = part._replace(begin=_lead(source, task.data, part.first, seconds, options))
    task.loads.parent.mkdir(parents=True, exist_ok=True)
    summary = estimate_file(source, task.data, task.loads, part=part, **vars(options))
    counts = json.dumps({"key": task.key, **_counted(summary)}, default=_plain)
    write_bytes_atomically(task.counts, counts.encode())
    return task


def _lead(source: Path, data: Path, first: int, seconds: float, options: Options) -> int:
    """Return the row, a whole number of pieces ahead of ``first``, that is ``seconds`` or more before it."""

    def time(row: int) -> float:
        with opened(source, data, options, Part(row, row, row)) as (_, recording, *_):
            return float(next(recording.blocks).time[0])

    begin, pieces = first, 1
    while begin > 0 and (begin == first or time(first) - time(begin) < seconds):
        begin, pieces = max(first - pieces * PIECE_ROWS, 0), 2 * pieces
    return begin


def _check_output(output: Path) -> None:
    if output.suffix.lower() != SUFFIX:
        raise InputError(f"{output}: expected a folder X{SUFFIX} for the loads of a folder, or with --workers")
    if output.exists() and not any(output.glob(f"recording=*/part-*{SUFFIX}")):
        raise InputError(f"{output}: expected a data set of loads, or nothing, in its place: remove it")


def _files_of(data: Path) -> tuple[list[Path], list[str]]:
    """Return the recordings, the file or all that a folder has in the order of their names, and a line on the
    folders in it, which are passed over."""
    files, passed = [data], list[str]()
    if data.is_dir():
        items = sorted(data.iterdir())
        files = [item for item in items if item.suffix.lower() in SUFFIXES and item.is_file()]
        if not files:
            raise InputError(f"{data}: expected recordings, {', '.join(SUFFIXES)}, got none")
        if folders := [item.name for item in items if item.is_dir()]:
            passed.append(f"{data}: folders in it are passed over: {some_of(folders)}")
    for file in files:
        if is_bus_log(file):
            raise InputError(f"{file}: expected columns of strains, got a CAN log: estimate it by itself")
    return files, passed


def _divided(source: Path, data: Path, work: Path, rows: int, options: Options) -> Divided:
    """Return a recording in parts of ``rows`` rows, a piece ahead of each but the first; text in one part."""
    with opened(source, data, options) as (estimator, recording, checks, notes):
        if estimator.inverse_map is None:
            raise InputError(f"{source}: expected an inverse map for the parts of recordings, got an FMU")
        parts = [WHOLE]
        if recording.rows is not None and recording.rows > rows:
            firsts = range(0, recording.rows, rows)
            parts = [Part(max(first - PIECE_ROWS, 0), first, first + rows) for first in firsts]
        gaps = Gaps(recording.gaps.where, recording.gaps.counted)
        summary = EstimationSummary(unused=recording.selection.unused, faults=checks.counts, gaps=gaps)
        summary.notes = [*recording.notes, *notes]
    name, state = quote(data.name, safe=""), data.stat()
    files = {path: [path.stat().st_size, path.stat().st_mtime_ns] for path in _files_read(source, options)}
    made_of = {"version": __version__, "data": [state.st_size, state.st_mtime_ns], "options": vars(options)}
    made_of["files"] = {str(path): size_and_time for path, size_and_time in files.items()}
    tasks = [
        Task(
            data=data,
            part=part,
            loads=work / f"recording={name}" / f"part-{k:05d}{SUFFIX}",
            counts=work / _COUNTS / f"{name}-{k:05d}.json",
            key=fingerprint({**made_of, "part": list(part)}),
        )
        for k, part in enumerate(parts)
    ]
    return Divided(tasks, summary, checks)


def _files_read(source: Path, options: Options) -> list[Path]:
    """Return the files that the loads are made of besides the recording."""
    return [source, *(Path(file) for file in (options.channels, options.zeros) if file is not None)]


def _is_done(task: Task) -> bool:
    counts = kept_json(task.counts)
    return task.loads.is_file() and isinstance(counts, dict) and counts.get("key") == task.key


def _finish(work: Path, output: Path) -> None:
    """Give a complete data set its name; an earlier one is removed when the new one is in its place."""
    earlier = output.with_name(f"{output.name}.earlier")
    try:
        shutil.rmtree(work / _COUNTS)
        if output.exists():
            os.rename(output, earlier)
        os.rename(work, output)
        shutil.rmtree(earlier, ignore_errors=True)
    except OSError as error:
        raise StrainfmuError(f"{output}: could not be written: {error.strerror or error}") from error


# --- counts of parts -------------------------------------------------------------------------------------------


def _added(recordings: Sequence[Divided]) -> EstimationSummary:
    """Return the summary of all recordings: their parts in order, and what is to be said of each recording.

    Raises
    ------
    InputError
        The level of the strains of a recording is far below the map's.
    """
    total = EstimationSummary()
    for recording in recordings:
        summary, of_recorder = recording.summary, list[str]()
        for task in recording.tasks:
            of_part = _summary(json.loads(task.counts.read_text(encoding="utf-8")))
            of_recorder, of_part.notes = of_recorder or of_part.notes, []
            summary.take(of_part)  # and so the checks, whose counts it has
        summary.notes += [*summary.gaps.notes(), *recording.checks.notes(), *of_recorder]
        total.take(summary)
        total.unused = tuple(dict.fromkeys((*total.unused, *summary.unused)))
    total.notes = _said_once(total.notes)
    return total


def _said_once(notes: Sequence[str]) -> list[str]:
    """Return ``notes``, each of a file, with what is the same of several files as one line."""
    files = dict[str, dict[str, None]]()
    for file, _, text in (note.partition(": ") for note in notes):
        files.setdefault(text, {})[file] = None
    of_text = [(*of_files, text) for text, of_files in files.items()]
    return [f"{first}{f' and {len(rest)} more' if rest else ''}: {text}" for first, *rest, text in of_text]


_NUMBERS = ("samples", "first", "last", "missing_pressure", "refused", "results", "by_coefficients")


def _counted(summary: EstimationSummary) -> dict[str, Any]:
    """Return what a summary counts, as JSON can hold it."""
    numbers = {name: getattr(summary, name) for name in _NUMBERS}
    gaps = {name: value for name, value in vars(summary.gaps).items() if not name.startswith("_")}
    more = {"health": summary.health, "blamed": summary.blamed, "notes": summary.notes}
    return {**numbers, **more, "gaps": gaps, "faults": vars(summary.faults)}


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else vars(value)


def _summary(counted: Mapping[str, Any]) -> EstimationSummary:
    """Return the summary of which JSON holds the counts."""
    faults = dict(counted["faults"])
    for name in ("missing", "known"):
        faults[name] = Counter(faults[name])
    for name in ("railed", "dead"):
        faults[name] = {gauge: FaultRows(**rows) for gauge, rows in faults[name].items()}
    for name in ("held", ZERO):
        faults[name] = FaultRows(**faults[name])
    return EstimationSummary(
        **{name: counted[name] for name in _NUMBERS},
        health=Counter(counted["health"]),
        blamed={state: Counter(gauges) for state, gauges in counted["blamed"].items()},
        notes=counted["notes"],
        gaps=Gaps(**{**counted["gaps"], "first": [tuple(gap) for gap in counted["gaps"]["first"]]}),
        faults=FaultCounts(**{**faults, "level": np.array(faults["level"], dtype=float)}),
    )
