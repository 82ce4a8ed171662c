"""The estimation of recorded strains, block by block."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE, SAMPLE_INPUTS, QSource
from strainfmu.estimator.health import USABLE_STATES
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.health_names import CHI_SQUARE_LIMIT, ENVELOPE_SCORE, SUSPECTS, USABLE
from strainfmu.recorded.columns.column_names import (
    FLOW_NAMES,
    INERTIAL_NAMES,
    NAVIGATION_NAMES,
    STATIC_PRESSURE,
    STD,
    DateOrder,
    Wanted,
)
from strainfmu.recorded.columns.columns import ColumnPlan, StrainBlock
from strainfmu.recorded.estimates.block_estimates import BlockEstimates, BlockEstimator, dropped_navigation
from strainfmu.recorded.estimates.estimator_files import open_block_estimator
from strainfmu.recorded.estimates.health_account import HealthAccount
from strainfmu.recorded.estimates.smoothed_blocks import estimated_blocks, filter_attributes, with_filter
from strainfmu.recorded.output.estimate_files import (
    ESTIMATE_COLUMNS,
    check_output,
    estimate_writer,
)
from strainfmu.recorded.output.field_series import FieldSeriesWriter, check_field_output, field_series_writer
from strainfmu.recorded.output.plain_columns import HEALTH_COLUMN, plain_columns
from strainfmu.recorded.recorder_errors import RecorderWatch
from strainfmu.recorded.strains.data_checks import DataChecks
from strainfmu.recorded.strains.strain_files import open_strains

Progress = Callable[[int, int], None]
HEALTH_COLUMNS = (
    (CHI_SQUARE_LIMIT, "1"),
    ("health.degrees_of_freedom", "1"),
    (SUSPECTS, "1"),
    (ENVELOPE_SCORE, "1"),
    ("health.envelope_score_limit", "1"),
    (USABLE, "1"),
)
SUSPECTS_COLUMN = "suspect_gauges"
"""Column of text: the names of the suspects, with a semicolon between them."""
FAULTS_COLUMN = "strain_faults"
"""Column of text: why strains were left out, ``held`` or ``zero`` of all gauges, else the names of railed ones."""

_FLOW_UNITS = {one.name: one.unit for one in SAMPLE_INPUTS[1:]}


@dataclass(kw_only=True)
class EstimationSummary:
    """Summary of an estimation.

    Attributes
    ----------
    samples : number of rows estimated.
    first, last : times of the first and the last sample [s].
    missing_strains : number of strains without a value, by gauge.
    missing_pressure : number of samples without a dynamic pressure that have no coefficients.
    refused : number of steps that the FMU refused; their outputs are NaN.
    results : number of samples that have coefficients.
    fields : number of pressure fields written.
    account : number of samples by state, and the gauges to blame.
    unused : columns of the data that were not read.
    notes : what else is to be known of the data.
    """

    samples: int = 0
    first: float = float("nan")
    last: float = float("nan")
    missing_strains: Counter[str] = field(default_factory=Counter)
    missing_pressure: int = 0
    refused: int = 0
    results: int = 0
    fields: int = 0
    account: HealthAccount = field(default_factory=HealthAccount)
    unused: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return self.last - self.first

    @property
    def health(self) -> Counter[str]:
        """Number of samples by state."""
        return self.account.samples


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
    dynamic_pressure : q_inf of the whole file [Pa], instead of its column; NaN where it is not known.
    residuals : whether to write the standardised residual of every gauge, and its alarm level. Needs a map.
    ignore_columns : names of columns not to read, ``*`` for any text in the names of unknown ones.
    channels : file that states which channel is which gauge (channels.toml); None where gauges name them.
    check_level : whether to refuse strains whose level is so far from the map's that their unit must be another.
    field_output : VTKHDF file for the pressure of every ``field_every``-th sample. Needs a map with keep_field.
    time_constant : of a filter over time [s], None for none. Needs a map.
    smooth : whether to smooth what it has filtered. The output says both.
    zeros : file of what the gauges read without strain (zeros.toml), None for what ``source`` holds.
    accept_held : whether to estimate rows in which no gauge changes, too; else they are INVALID.
    exclude : gauges to leave out: names of the map, ``strain[i]``, or names of their columns or channels.
    columns : "all", or "plain": time, loads, angles in degrees, health in words.
    date_order : what stands first in dates of figures, such as 03/04/2026; None where the file has none.

    Raises
    ------
    InputError
        A file, a column, a unit or a number is wrong.
    StrainfmuError
        Something needed is not installed, the FMU failed, or the output cannot be written.
    """
    source, data, output = Path(source), Path(data), Path(output)
    check_output(output)
    if output.exists() and any(one.exists() and output.samefile(one) for one in (source, data)):
        raise InputError(f"{output}: expected another file than those that are read")
    zeros = None if zeros is None else Path(zeros)
    with open_block_estimator(source, zeros) as static:
        estimator = with_filter(source, static, time_constant, smooth)
        if residuals and not estimator.has_residuals:
            raise InputError(f"{source}: --residuals: expected an inverse map, got an FMU")
        if field_every < 1:
            raise InputError(f"--field-every: expected at least 1, got {field_every}")
        if field_output is not None:
            _check_field(Path(field_output), estimator.inverse_map, source, time_constant)
        if channels is not None and ignore_columns:
            raise InputError(f"{data}: --ignore-columns: expected none with --channels, which names what is read")
        wanted = replace(
            _wanted(source, estimator, dynamic_pressure, ignore_columns),
            excluded=tuple(exclude),
            date_order=date_order,
        )
        with open_strains(data, wanted, None if channels is None else Path(channels)) as opened:
            plan = opened.plan
            checks = DataChecks(
                plan,
                estimator.gauge_names,
                estimator.reference,
                zero=estimator.zero,
                accepts_level=not check_level,
                accepts_held=accept_held,
                is_joined=channels is not None,
            )
            notes = [
                *opened.notes,
                *_unused_inputs(source, estimator, plan),
                *_own_zeros(source, estimator, zeros),
                *_unstated_source(plan),
            ]
            summary = EstimationSummary(unused=plan.unused, notes=notes)
            names = _columns(plan, estimator.other_columns, estimator.row_names if residuals else ())
            made, watch = filter_attributes(estimator), RecorderWatch(data, static)
            plain = plain_columns(names) if columns == "plain" else None
            of_text = (SUSPECTS_COLUMN, FAULTS_COLUMN) if plain is None else (HEALTH_COLUMN,)
            with (
                estimate_writer(
                    output, names if plain is None else plain.columns, text_columns=of_text, attributes=made
                ) as writer,
                _field_series(field_output, estimator.inverse_map, field_every) as series,
            ):
                for block, done, found in estimated_blocks(checks.without_faults(opened.blocks), estimator):
                    rows = _rows(block, found=found, estimator=estimator, residuals=residuals)
                    if plain is None:
                        writer.write(rows, _texts(block, found, estimator))
                    else:
                        writer.write(plain.rows(rows), {HEALTH_COLUMN: plain.health(rows)})
                    _count(summary, block, found=found, estimator=estimator)
                    watch.add(block, found.health)
                    if series is not None and found.estimates is not None:
                        series.write_block(block.time, found.estimates)
                        summary.fields = series.steps
                    if progress is not None:
                        progress(done, opened.length)
                summary.missing_strains = checks.missing
                summary.notes += [*opened.remarks, *checks.notes(), *watch.notes()]
    return summary


def _wanted(
    source: Path, estimator: BlockEstimator, dynamic_pressure: float | None, ignored: Sequence[str]
) -> Wanted:
    """Return what ``estimator`` takes of a recording; ``dynamic_pressure`` [Pa] stands for its column.

    Raises
    ------
    InputError
        The pressure is NaN, and the estimator of ``source`` needs it.
    """
    navigates = STATIC_PRESSURE in estimator.inputs
    if dynamic_pressure is not None and np.isnan(dynamic_pressure) and not navigates:
        raise InputError(f"{source}: --dynamic-pressure: expected a pressure for a linear estimator, got nan")
    flow = (
        *FLOW_NAMES,
        *(NAVIGATION_NAMES if navigates else (STATIC_PRESSURE,)),
        *(name for name in INERTIAL_NAMES if name in estimator.inputs),
        *estimator.parameter_names,
        *(f"{name}{STD}" for name in estimator.sharpening),
        *estimator.readings,
    )
    of_nonlinear = (*NAVIGATION_NAMES, *(f"{name}{STD}" for name in estimator.parameter_names))
    return Wanted(
        gauge_names=estimator.gauge_names,
        fixed_pressure=dynamic_pressure,
        flow=flow,
        passed=(
            *(name for name in of_nonlinear if name not in flow and name.endswith(STD)),
            *(name for name in INERTIAL_NAMES if name not in flow),
        ),
        readings=estimator.readings,
        computes_pressure=True,
        navigates=navigates,
        ignored=tuple(ignored),
        reference=estimator.reference,
        sensors=estimator.sensor_names,
    )


def _own_zeros(source: Path, estimator: BlockEstimator, zeros: Path | None) -> list[str]:
    """Return the line that zero offsets of a calibration are subtracted."""
    if zeros is not None or not estimator.zero.any():
        return []
    rms = 1e6 * float(np.sqrt(np.mean(estimator.zero**2)))
    return [f"{source}: its calibration's zero offsets are subtracted, {rms:.3g} um/m rms; --zeros states others"]


def _unstated_source(plan: ColumnPlan) -> list[str]:
    """Return the line that a dynamic pressure counts as computed, as its source is not stated."""
    if Q_SOURCE in plan.flow or not {DYNAMIC_PRESSURE, MACH_NUMBER} <= set(plan.flow):
        return []
    return [
        f"{plan.path}: dynamic_pressure: counts as computed from mach_number, so that it confirms nothing; where "
        f"it is measured, a column {Q_SOURCE} of {QSource.INDEPENDENT:d} makes sigma of the coefficients smaller"
    ]


def _check_field(path: Path, inverse_map: InverseMap | None, source: Path, time_constant: float | None) -> None:
    """Refuse pressure fields with a filter, and what :func:`check_field_output` does."""
    if time_constant is not None:
        raise InputError("--field: expected none with --filter, which does not filter the pressure field")
    check_field_output(path, inverse_map, source)


def _field_series(
    path: str | PathLike[str] | None, inverse_map: InverseMap | None, every: int
) -> AbstractContextManager[FieldSeriesWriter | None]:
    if path is None or inverse_map is None:
        return nullcontext()
    return field_series_writer(Path(path), inverse_map, every)


def _unused_inputs(source: Path, estimator: BlockEstimator, plan: ColumnPlan) -> list[str]:
    """Return a note on the quantities that the data hold and the estimator does not take."""
    missing = [name for name in plan.stated if name not in estimator.inputs]
    if not missing:
        return []
    return [f"{plan.path}: {', '.join(missing)}: written but not used, {source} does not take them"]


def _columns(
    plan: ColumnPlan, others: Sequence[tuple[str, str]], residuals: Sequence[str]
) -> tuple[tuple[str, str], ...]:
    """Return names and units of the output's columns, with the residuals of the gauges named."""
    limit = (("health.residual_limit", "1"),) if residuals else ()
    return (
        *ESTIMATE_COLUMNS,
        *HEALTH_COLUMNS,
        *((name, _FLOW_UNITS[name]) for name in _FLOW_UNITS if name in plan.stated),
        *others,
        *limit,
        *((f"residual.{gauge}", "1") for gauge in residuals),
    )


def _rows(block: StrainBlock, *, found: BlockEstimates, estimator: BlockEstimator, residuals: bool) -> FloatArray:
    """Return the rows of a block, all columns."""
    columns: list[FloatArray] = [
        block.time,
        *found.coefficients.T,
        *found.coefficients_std.T,
        block.dynamic_pressure,
        found.chi_square,
        found.health,
        found.gauges_used,
        found.chi_square_limit,
        found.degrees_of_freedom,
        found.suspect_count,
        found.envelope_score,
        np.full(len(block.time), estimator.envelope_score_limit),
        np.where(np.isnan(found.health), np.nan, np.isin(found.health, USABLE_STATES)),
        *(block.flow[name] for name in _FLOW_UNITS if name in block.flow),
    ]
    if found.other_values is not None:
        columns += [*found.other_values.T]
    if residuals and found.make_residual is not None:
        residual, limit = found.make_residual()
        columns += [limit, *residual.T]
    return np.column_stack(columns)


def _texts(block: StrainBlock, found: BlockEstimates, estimator: BlockEstimator) -> dict[str, Sequence[str]]:
    """Return the texts of the rows of a block."""
    names = [";".join([estimator.row_names[i] for i in one]) if one else "" for one in found.suspects]
    return {SUSPECTS_COLUMN: names, FAULTS_COLUMN: block.faults}


def _count(
    summary: EstimationSummary, block: StrainBlock, *, found: BlockEstimates, estimator: BlockEstimator
) -> None:
    """Add a block to the summary."""
    dropped = dropped_navigation(block, found, estimator.other_columns)
    summary.account.add(found, estimator.row_names, estimator.envelope_score_limit, dropped)
    # The nonlinear estimator has coefficients without it.
    without = np.isnan(block.dynamic_pressure) & np.isnan(found.coefficients[:, 0])
    summary.missing_pressure += int(without.sum())
    summary.refused += int(np.isnan(found.health).sum())
    summary.results += int(np.isfinite(found.coefficients).any(axis=1).sum())
    summary.samples += len(block.time)
    summary.first = float(np.fmin(summary.first, block.time[0]))
    summary.last = float(block.time[-1])
