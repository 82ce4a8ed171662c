"""The estimation of recorded strains, block by block: a recording in, a table of loads out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE, QSource
from strainfmu.interface.health_names import STATE
from strainfmu.recorded import outputs
from strainfmu.recorded.checks import DataChecks
from strainfmu.recorded.estimators import open_estimator
from strainfmu.recorded.recorder_errors import RecorderWatch
from strainfmu.recorded.samples import open_recording
from strainfmu.recorded.summary import EstimationSummary
from strainfmu.text_cells import DateOrder

Progress = Callable[[int, int], None]

AUTO = "auto"
"""Stands for all gauges that repeat their reading, among those to leave out."""


def estimate_file(
    source: str | PathLike[str],
    data: str | PathLike[str],
    output: str | PathLike[str],
    dynamic_pressure: float | None = None,
    progress: Progress | None = None,
    *,
    residuals: bool = False,
    ignore_columns: Sequence[str] = (),
    check_level: bool = True,
    field_output: str | PathLike[str] | None = None,
    field_every: int = 1,
    channels: str | PathLike[str] | None = None,
    time_constant: float | None = None,
    smooth: bool = False,
    zeros: str | PathLike[str] | None = None,
    accept_held: bool = False,
    exclude: Sequence[str] = (),
    columns: Literal["plain", "all"] = "all",
    date_order: DateOrder | None = None,
) -> EstimationSummary:
    """Estimate every sample of ``data`` with the FMU or map ``source`` and write ``output``.

    A strain without a value leaves its gauge out of that sample; without a dynamic pressure there are no
    coefficients. Both are counted.

    Parameters
    ----------
    source, data, output, dynamic_pressure, residuals, smooth, zeros, channels, exclude, columns, date_order :
        as :func:`strainfmu.estimate` takes them; so are ``ignore_columns``, ``field_every`` and ``accept_held``.
    check_level : whether to refuse strains whose level is so far from the map's that their unit must be another.
    field_output, time_constant : ``field`` and ``filter_seconds`` of :func:`strainfmu.estimate`.

    Raises
    ------
    InputError
        A file, a column, a unit or a number is wrong.
    StrainfmuError
        Something needed is not installed, the FMU failed, or the output cannot be written.
    """
    source, data, output = Path(source), Path(data), Path(output)
    outputs.check_output(output)
    if output.exists() and any(path.exists() and output.samefile(path) for path in (source, data)):
        raise InputError(f"{output}: expected another file than those that are read")
    zeros = None if zeros is None else Path(zeros)
    with open_estimator(
        source, zeros, time_constant=time_constant, smooth=smooth, residuals=residuals
    ) as estimator:
        if field_every < 1:
            raise InputError(f"--field-every: expected at least 1, got {field_every}")
        if field_output is not None:
            if time_constant is not None:
                raise InputError("--field: expected none with --filter, which does not filter the pressure field")
            outputs.check_field_output(Path(field_output), estimator.inverse_map, source)
        if channels is not None and ignore_columns:
            raise InputError(f"{data}: --ignore-columns: expected none with --channels, which names what is read")
        wanted = replace(
            estimator.wanted,
            fixed_pressure=dynamic_pressure,
            ignored=tuple(ignore_columns),
            excluded=tuple(name for name in exclude if name != AUTO),
            date_order=date_order,
        )
        if dynamic_pressure is not None and np.isnan(dynamic_pressure) and not wanted.navigates:
            raise InputError(f"{source}: --dynamic-pressure: expected a pressure for a linear estimator, got nan")
        with open_recording(data, wanted, None if channels is None else Path(channels)) as recording:
            selection = recording.selection
            checks = DataChecks(
                selection,
                zero=estimator.zero,
                accepts_level=not check_level,
                accepts_held=accept_held,
                leaves_out_dead=AUTO in exclude,
            )
            notes = list[str]()
            if missing := [name for name in selection.stated if name not in estimator.inputs]:
                notes.append(f"{data}: {', '.join(missing)}: written but not used, {source} does not take them")
            if zeros is None and estimator.zero.any():
                rms = 1e6 * float(np.sqrt(np.mean(estimator.zero**2)))
                notes.append(
                    f"{source}: its calibration's zero offsets are subtracted, {rms:.3g} um/m rms; --zeros states "
                    "others"
                )
            if Q_SOURCE not in selection.flow and {DYNAMIC_PRESSURE, MACH_NUMBER} <= selection.flow.keys():
                notes.append(
                    f"{data}: dynamic_pressure: counts as computed from mach_number, so that it confirms nothing; "
                    f"where it is measured, a column {Q_SOURCE} of {QSource.INDEPENDENT:d} makes sigma of the "
                    "coefficients smaller"
                )
            summary = EstimationSummary(unused=selection.unused, faults=checks, gaps=recording.gaps)
            names = outputs.output_columns(selection.stated, estimator.other_columns)
            is_plain, watch = columns == "plain", RecorderWatch(data, estimator)
            written = outputs.plain_columns(names) if is_plain else {name: (name, unit) for name, unit in names}
            texts = outputs.PLAIN_TEXTS if is_plain else outputs.TEXTS
            with ExitStack() as stack:
                writer = stack.enter_context(
                    outputs.estimate_writer(output, [*written.values()], texts, estimator.attributes)
                )
                series = stack.enter_context(
                    nullcontext()
                    if field_output is None or estimator.inverse_map is None
                    else outputs.field_series_writer(Path(field_output), estimator.inverse_map, field_every)
                )
                for block, estimates in estimator.estimated(recording.blocks, checks.checked):
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
                summary.missing_strains = checks.missing
                summary.fields = 0 if series is None else -(-summary.samples // field_every)
                summary.notes += [*recording.notes, *notes, *checks.notes(), *watch.notes()]
    return summary
