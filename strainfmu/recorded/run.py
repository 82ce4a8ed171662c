"""The estimation of recorded strains, block by block: a recording in, a table of loads out."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE, QSource
from strainfmu.interface.health_names import STATE
from strainfmu.recorded import outputs
from strainfmu.recorded.checks import DataChecks
from strainfmu.recorded.estimators import BlockEstimator, open_estimator
from strainfmu.recorded.recorder_errors import RecorderWatch
from strainfmu.recorded.samples import WHOLE, Part, Recording, open_recording
from strainfmu.recorded.summary import EstimationSummary
from strainfmu.text_cells import DateOrder

Progress = Callable[[int, int], None]
File = str | PathLike[str]

AUTO = "auto"
"""Stands for all gauges that repeat their reading, among those to leave out."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a recording with columns is read and estimated: as :func:`strainfmu.estimate` takes it, None for all
    ``columns``."""

    dynamic_pressure: float | None = None
    columns: Literal["plain", "all"] | None = None
    residuals: bool = False
    ignore_columns: Sequence[str] = ()
    accept_strain_level: bool = False
    accept_held: bool = False
    exclude: Sequence[str] = ()
    field: File | None = None
    field_every: int | None = None
    channels: File | None = None
    date_order: DateOrder | None = None
    filter_seconds: float | None = None
    smooth: bool = False
    zeros: File | None = None


def estimate_file(
    source: File,
    data: File,
    output: File,
    dynamic_pressure: float | None = None,
    progress: Progress | None = None,
    *,
    part: Part = WHOLE,
    **options: Any,
) -> EstimationSummary:
    """Estimate every sample of ``data`` with the FMU or map ``source`` and write ``output``.

    A strain without a value leaves its gauge out of that sample; without a dynamic pressure there are no
    coefficients. Both are counted.

    Parameters
    ----------
    source, data, output, dynamic_pressure, progress : as :func:`strainfmu.estimate` takes them.
    part : rows to estimate. The notes on a part are on its own samples alone.
    options : the other ones of :class:`Options`.

    Raises
    ------
    InputError
        A file, a column, a unit or a number is wrong.
    StrainfmuError
        Something needed is not installed, the FMU failed, or the output cannot be written.
    """
    source, data, output = Path(source), Path(data), Path(output)
    asked = Options(dynamic_pressure=dynamic_pressure, **options)
    is_plain, every = asked.columns == "plain", 1 if asked.field_every is None else asked.field_every
    outputs.check_output(output)
    if output.exists() and any(path.exists() and output.samefile(path) for path in (source, data)):
        raise InputError(f"{output}: expected another file than those that are read")
    if every < 1:
        raise InputError(f"--field-every: expected at least 1, got {every}")
    if asked.field is not None and asked.filter_seconds is not None:
        raise InputError("--field: expected none with --filter, which does not filter the pressure field")
    with opened(source, data, asked, part) as (estimator, recording, checks, notes):
        if asked.field is not None:
            outputs.check_field_output(Path(asked.field), estimator.inverse_map, source)
        selection = recording.selection
        summary = EstimationSummary(unused=selection.unused, faults=checks.counts, gaps=recording.gaps)
        names = outputs.output_columns(selection.stated, estimator.other_columns)
        written = outputs.plain_columns(names) if is_plain else {name: (name, unit) for name, unit in names}
        texts, watch = outputs.PLAIN_TEXTS if is_plain else outputs.TEXTS, RecorderWatch(data, estimator)
        with ExitStack() as stack:
            writer = stack.enter_context(
                outputs.estimate_writer(output, [*written.values()], texts, estimator.attributes)
            )
            series = stack.enter_context(
                nullcontext()
                if asked.field is None or estimator.inverse_map is None
                else outputs.field_series_writer(Path(asked.field), estimator.inverse_map, every)
            )
            for block, estimates in estimator.estimated(recording.blocks, checks.checked):
                if not block.is_counted:
                    continue
                values = {"time": block.time, **block.flow, **estimates.values}
                shown = [
                    np.degrees(values[name]) if unit == "deg" else values[name]
                    for name, (_, unit) in written.items()
                ]
                if is_plain:
                    writer.write([*shown, outputs.health_words(values[STATE])])
                else:
                    writer.write([*shown, estimates.suspects, block.faults])
                summary.add(block, estimates)
                watch.add(block, estimates.values[STATE])
                if series is not None and estimates.estimates is not None:
                    series.write((block.time, estimates.estimates))
                if progress is not None:
                    progress(block.position, recording.length)
            summary.fields = 0 if series is None else -(-summary.samples // every)
            summary.notes += watch.notes()
            if part == WHOLE:
                summary.notes = [*recording.notes, *notes, *checks.notes(), *summary.notes]
    return summary


class Opened(NamedTuple):
    """An estimator and a recording that it can estimate, the checks of its strains, and lines for the user."""

    estimator: BlockEstimator
    recording: Recording
    checks: DataChecks
    notes: list[str]


@contextmanager
def opened(source: Path, data: Path, options: Options, part: Part = WHOLE) -> Iterator[Opened]:
    """Open an estimator and a recording; errors as :func:`estimate_file` has them."""
    fixed, zeros, channels = options.dynamic_pressure, options.zeros, options.channels
    with open_estimator(
        source,
        None if zeros is None else Path(zeros),
        filter_seconds=options.filter_seconds,
        smooth=options.smooth,
        residuals=options.residuals,
    ) as estimator:
        if channels is not None and options.ignore_columns:
            raise InputError(f"{data}: --ignore-columns: expected none with --channels, which names what is read")
        wanted = replace(
            estimator.wanted,
            fixed_pressure=fixed,
            ignored=tuple(options.ignore_columns),
            excluded=tuple(name for name in options.exclude if name != AUTO),
            date_order=options.date_order,
        )
        if fixed is not None and np.isnan(fixed) and not wanted.navigates:
            raise InputError(f"{source}: --dynamic-pressure: expected a pressure for a linear estimator, got nan")
        with open_recording(data, wanted, None if channels is None else Path(channels), part) as recording:
            checks = DataChecks(
                recording.selection,
                zero=estimator.zero,
                accepts_level=options.accept_strain_level,
                accepts_held=options.accept_held,
                leaves_out_dead=AUTO in options.exclude,
            )
            notes = _notes(source, data, estimator, recording, has_zeros=zeros is not None)
            yield Opened(estimator, recording, checks, notes)


def _notes(
    source: Path, data: Path, estimator: BlockEstimator, recording: Recording, *, has_zeros: bool
) -> list[str]:
    """Return lines on what the estimator takes of the recording, and what it takes it for."""
    selection, notes = recording.selection, list[str]()
    if missing := [name for name in selection.stated if name not in estimator.inputs]:
        notes.append(f"{data}: {', '.join(missing)}: written but not used, {source} does not take them")
    if not has_zeros and estimator.zero.any():
        rms = 1e6 * float(np.sqrt(np.mean(estimator.zero**2)))
        notes.append(
            f"{source}: its calibration's zero offsets are subtracted, {rms:.3g} um/m rms; --zeros states others"
        )
    if Q_SOURCE not in selection.flow and {DYNAMIC_PRESSURE, MACH_NUMBER} <= selection.flow.keys():
        notes.append(
            f"{data}: dynamic_pressure: counts as computed from mach_number, so that it confirms nothing; where "
            f"it is measured, a column {Q_SOURCE} of {QSource.INDEPENDENT:d} makes sigma of the coefficients "
            "smaller"
        )
    return notes
