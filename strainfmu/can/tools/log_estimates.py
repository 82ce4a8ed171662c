"""The results of a replayed CAN log, written as a file of estimates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from strainfmu.can.bridge.options import BridgeOptions
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.tools.log_description import load_description
from strainfmu.can.tools.replay import ReplaySummary, replay_log
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import load_groups_of
from strainfmu.estimator.air_inputs import ALTITUDE, MACH_NUMBER
from strainfmu.estimator.other_loads import output_units
from strainfmu.interface.health_names import ENVELOPE_SCORE
from strainfmu.recorded.estimates.fmu_columns import other_outputs_of
from strainfmu.recorded.output.estimate_files import (
    ESTIMATE_COLUMNS,
    EstimateWriter,
    check_output,
    estimate_writer,
)

LOG_COLUMNS = (
    *ESTIMATE_COLUMNS,
    ("quality", "1"),
    ("causes", "1"),
    ("age", "s"),
    ("counter", "1"),
    ("sample_time", "tick"),
    (MACH_NUMBER, "1"),
    (ALTITUDE, "m"),
    (ENVELOPE_SCORE, "1"),
    ("age_uncertainty", "s"),
)
"""Columns of a replay's output; loads behind the five follow where the estimator gives them."""

_BLOCK = 2000


def estimate_log(
    source: Path,
    log: Path,
    output: Path,
    options: Callable[[BridgeOptions | None], BridgeOptions],
    progress: Callable[[int, int], None] | None = None,
    zeros: Path | None = None,
) -> ReplaySummary:
    """Replay ``log`` with the FMU or map ``source`` and write every result to ``output``.

    ``zeros`` is the file of what the gauges read without strain (zeros.toml), None for that of the recorded run.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`~strainfmu.can.tools.replay.replay_log`.
    """
    check_output(output)
    recorded = load_description(log)
    if zeros is None and recorded is not None:
        zeros = recorded["options"].zeros
    with open_step(source, zeros) as ready:
        others = other_outputs_of(output_units(load_groups_of(ready.step)).items())
        columns = (*LOG_COLUMNS, *((one.column, one.unit) for one in others))
        with estimate_writer(output, columns) as writer:
            rows = _Rows(writer, [one.output for one in others])
            summary = replay_log(
                log,
                source,
                step=ready.step,
                gauge_names=ready.gauge_names,
                options=options,
                on_result=rows.add,
                progress=progress,
            )
            rows.flush()
    return summary


class _Rows:
    """Collects results and writes them block by block, with the outputs ``others`` behind the other columns."""

    def __init__(self, writer: EstimateWriter, others: Sequence[str]) -> None:
        self._writer, self._others = writer, others
        self._rows: list[list[float]] = []

    def add(self, result: CycleResult) -> None:
        # As coefficients, those of a result that has none are not known.
        held = result.other_outputs if result.quality.has_coefficients else {}
        self._rows.append([*_row(result), *(held.get(name, float("nan")) for name in self._others)])
        if len(self._rows) == _BLOCK:
            self.flush()

    def flush(self) -> None:
        if self._rows:
            self._writer.write(np.array(self._rows))
            self._rows.clear()


def _row(result: CycleResult) -> list[float]:
    nan = float("nan")
    return [
        result.time,
        *result.coefficients.tolist(),
        *result.coefficients_std.tolist(),
        result.dynamic_pressure,
        result.chi_square,
        nan if result.health is None else result.health,
        int(result.valid.sum()),
        int(result.quality),
        int(result.causes),
        result.age,
        nan if result.counter is None else result.counter,
        nan if result.sample_time is None else result.sample_time,
        result.mach_number,
        result.altitude,
        result.envelope_score,
        result.age_uncertainty,
    ]
