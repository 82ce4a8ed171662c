"""The results of a replayed CAN log, written as a file of estimates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from strainfmu.can.bridge.options import BridgeOptions
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.tools.log_description import load_description
from strainfmu.can.tools.replay import ReplaySummary, replay_log
from strainfmu.cosim.estimators.source import LOAD_OUTPUTS, open_step
from strainfmu.cosim.estimators.step import load_groups_of
from strainfmu.estimator.air_inputs import AIR_INPUTS, DYNAMIC_PRESSURE, FLOW_QUANTITIES
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.other_loads import output_units
from strainfmu.interface.health_names import CHI_SQUARE, ENVELOPE_SCORE, STATE, USABLE
from strainfmu.recorded.estimators import other_outputs_of
from strainfmu.recorded.outputs import (
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
    *((one.name, one.unit) for one in AIR_INPUTS if one.name in FLOW_QUANTITIES and one.name != DYNAMIC_PRESSURE),
    (ENVELOPE_SCORE, "1"),
    ("age_uncertainty", "s"),
    (USABLE, "1"),
    ("gap", "s"),
)
"""Columns of a replay's output; loads behind the five follow where the estimator gives them."""

_SIGMAS = tuple(f"sigma.{name}" for name in COEFFICIENT_NAMES)

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

    ``zeros`` is the file of what the gauges read without strain (zeros.toml), None for the recorded run's.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`~strainfmu.can.tools.replay.replay_log`.
    """
    check_output(output)
    recorded = load_description(log)
    if zeros is None and recorded is not None:
        zeros = recorded["options"].zeros
    with open_step(source, zeros, with_loads=True) as ready:
        others = other_outputs_of(output_units(load_groups_of(ready.step)).items())
        columns = (*LOG_COLUMNS, *others.values())
        with estimate_writer(output, columns) as writer:
            rows = _Rows(writer, [*others])
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
        known = result.other_outputs if result.quality.has_coefficients else {}
        self._rows.append([*_row(result, known), *(known.get(name, float("nan")) for name in self._others)])
        if len(self._rows) == _BLOCK:
            self.flush()

    def flush(self) -> None:
        if self._rows:
            self._writer.write(np.array(self._rows))
            self._rows.clear()


def _row(result: CycleResult, outputs: Mapping[str, float]) -> list[float]:
    """Return the values of :data:`LOG_COLUMNS`, NaN where there is none; loads are among the ``outputs``."""
    values: dict[str, float | None] = {
        "time": result.time,
        **{name: outputs.get(name) for name in LOAD_OUTPUTS},
        **dict(zip(COEFFICIENT_NAMES, result.coefficients.tolist(), strict=True)),
        **dict(zip(_SIGMAS, result.coefficients_std.tolist(), strict=True)),
        **{name: getattr(result, name) for name in FLOW_QUANTITIES},
        CHI_SQUARE: result.chi_square,
        STATE: result.health,
        "gauges_used": int(result.valid.sum()),
        "quality": int(result.quality),
        "causes": int(result.causes),
        "age": result.age,
        "counter": result.counter,
        "sample_time": result.sample_time,
        ENVELOPE_SCORE: result.envelope_score,
        "age_uncertainty": result.age_uncertainty,
        USABLE: float(result.usable),
        "gap": result.gap,
    }
    found = (values[name] for name, _ in LOG_COLUMNS)
    return [float("nan") if value is None else value for value in found]
