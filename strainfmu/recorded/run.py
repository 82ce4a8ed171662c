"""The estimation of recorded strains, block by block."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from strainfmu.cosim.estimator_source import ReadyStep, open_step
from strainfmu.cosim.step import StepRefused, health_name
from strainfmu.recorded.columns import StrainBlock
from strainfmu.recorded.output import check_output, estimate_writer
from strainfmu.recorded.strain_files import open_strains

Progress = Callable[[int, int], None]


@dataclass(kw_only=True)
class EstimationSummary:
    """Summary of an estimation.

    Attributes
    ----------
    samples : number of rows estimated.
    duration : from the first to the last sample [s].
    missing_strains : number of strains without a value, by gauge.
    missing_pressure : number of samples without a dynamic pressure.
    refused : number of steps that the FMU refused; their outputs are NaN.
    health : number of samples by state.
    """

    samples: int = 0
    duration: float = 0.0
    missing_strains: Counter[str] = field(default_factory=Counter)
    missing_pressure: int = 0
    refused: int = 0
    health: Counter[str] = field(default_factory=Counter)


def estimate_file(
    source: str | PathLike[str],
    data: str | PathLike[str],
    output: str | PathLike[str],
    dynamic_pressure: float | None = None,
    progress: Progress | None = None,
) -> EstimationSummary:
    """Estimate every sample of ``data`` with the FMU or map ``source`` and write ``output``.

    A strain without a value leaves its gauge out of that sample; without a dynamic pressure there are no
    coefficients. Both are counted.

    Raises
    ------
    InputError
        A file, a column, a unit or a number is wrong.
    StrainfmuError
        Something needed is not installed, the FMU failed, or the output cannot be written.
    """
    source, data, output = Path(source), Path(data), Path(output)
    check_output(output)
    summary = EstimationSummary()
    with (
        open_step(source) as ready,
        open_strains(data, ready.gauge_names, dynamic_pressure) as opened,
        estimate_writer(output) as writer,
    ):
        first = last = float("nan")
        for block, done in opened.blocks:
            writer.write(_estimates(ready, block, last=last, summary=summary))
            first = block.time[0] if np.isnan(first) else first
            last = float(block.time[-1])
            if progress is not None:
                progress(done, opened.length)
    summary.duration = float(last - first) if summary.samples else 0.0
    return summary


def _estimates(ready: ReadyStep, block: StrainBlock, last: float, summary: EstimationSummary) -> np.ndarray:
    """Return the rows of a block; ``last`` is the time before its first sample [s], NaN at the start."""
    rows = np.full((len(block.time), 15), np.nan)
    before = np.append(last if np.isfinite(last) else block.time[0] - _first_step(block), block.time[:-1])
    for i, (time, strain, pressure) in enumerate(
        zip(block.time, block.strain, block.dynamic_pressure.tolist(), strict=True)
    ):
        used = int(np.isfinite(strain).sum())
        rows[i, [0, 11, 14]] = time, pressure, used
        try:
            found = ready.step(strain, pressure, float(time - before[i]))
        except StepRefused:
            summary.refused += 1
            continue
        rows[i, 1:6], rows[i, 6:11] = found.coefficients, found.coefficients_std
        rows[i, 12:14] = found.chi_square, found.health
        summary.health[health_name(found.health)] += 1
    missing = np.isnan(block.strain).sum(axis=0)
    summary.missing_strains.update({n: int(k) for n, k in zip(ready.gauge_names, missing, strict=True) if k})
    summary.missing_pressure += int(np.isnan(block.dynamic_pressure).sum())
    summary.samples += len(rows)
    return rows


def _first_step(block: StrainBlock) -> float:
    """Return a step size for the first sample [s], which has no predecessor."""
    return float(block.time[1] - block.time[0]) if len(block.time) > 1 else 1e-3
