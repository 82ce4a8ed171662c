"""The bridge's results as received at the other end of the bus, and their errors against the truth."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.can.cycle.states.quality import Quality
from strainfmu.can.wire.frame_layout import FrameLayout
from strainfmu.can.wire.libraries import import_can
from strainfmu.can.wire.signal_plan import SignalPlan
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

_RANGE_OF_NONE = 1e-9
_NO_SAMPLE_TIME = 2**32 - 1


@dataclass(kw_only=True)
class Score:
    """Estimates against truth over the cycles that were answered with coefficients.

    Attributes
    ----------
    cycles, answered, published : number of cycles sent, with a result, with coefficients.
    rms_error, mean_sigma : (5,) [1]; the error is NaN where the truth is not known.
    rms_error_of_range : (5,) over the range of the truth, NaN where it is constant.
    coverage : (5,) fraction with the truth inside 3 sigma, NaN where it is not known.
    qualities : results by quality.
    """

    cycles: int
    answered: int
    published: int
    rms_error: list[float]
    rms_error_of_range: list[float]
    mean_sigma: list[float]
    coverage: list[float]
    qualities: dict[str, int] = field(default_factory=dict)

    @property
    def has_errors(self) -> bool:
        """Whether there are results with coefficients, and a truth to compare them with."""
        return any(isfinite(one) for one in self.rms_error)


class Listener:
    """Keeps the result frames ``LoadEstimate`` of a bus, in a thread of its own."""

    def __init__(self, bus: Any, layout: FrameLayout) -> None:
        self._bus, self._layout = bus, layout
        self._received: list[bytes] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="CAN listener", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        can = import_can()
        while not self._stop.is_set():
            try:
                message = self._bus.recv(0.1)
            except (can.CanError, OSError, ValueError):
                continue
            if message is not None and message.arbitration_id == self._layout.identifier:
                data = bytes(message.data)
                if len(data) == self._layout.length:
                    self._received.append(data)

    def finish(self) -> list[bytes]:
        """End the thread and return the data of all results."""
        self._stop.set()
        self._thread.join(2.0)
        return self._received


def score_answers(
    received: Sequence[bytes], layout: FrameLayout, truth: Sequence[FloatArray], cycle_time: float
) -> Score:
    """Compare results with the truth of the cycles that they answer; the sender's clock began at 0.

    Parameters
    ----------
    layout : of ``LoadEstimate``.
    truth : (5,) per cycle [1].
    cycle_time : [s].
    """
    plan = SignalPlan(layout)
    values = np.array([plan.physical(plan.raw(data)) for data in received]).reshape(-1, len(layout.signals))
    column = {signal.name: index for index, signal in enumerate(layout.signals)}
    qualities = Counter(Quality(int(value)).name for value in values[:, column["Quality"]])
    ticks = values[:, column["SampleTime"]]
    cycles = np.rint(ticks * 1e-6 / cycle_time).astype(int)
    known = (ticks != _NO_SAMPLE_TIME) & (cycles >= 0) & (cycles < len(truth))
    estimate = values[:, [column[name] for name in COEFFICIENT_NAMES]]
    sigma = values[:, [column[f"sigma_{name}"] for name in COEFFICIENT_NAMES]]
    used = known & np.isfinite(estimate).all(axis=1)
    true = np.array(truth).reshape(-1, 5)[cycles[used]]
    error = estimate[used] - true
    spread = np.ptp(true, axis=0) if used.any() else np.zeros(5)
    with np.errstate(invalid="ignore", divide="ignore"):
        rms = np.sqrt((error**2).mean(axis=0)) if used.any() else np.full(5, np.nan)
        of_range = np.where(spread > _RANGE_OF_NONE, rms / spread, np.nan)
    inside = (np.abs(error) <= 3.0 * sigma[used]).mean(axis=0) if used.any() else np.full(5, np.nan)
    nothing = np.full(5, np.nan)
    return Score(
        cycles=len(truth),
        answered=len(set(cycles[known].tolist())),
        published=int(used.sum()),
        rms_error=rms.tolist(),
        rms_error_of_range=of_range.tolist(),
        mean_sigma=(sigma[used].mean(axis=0) if used.any() else nothing).tolist(),
        coverage=np.where(np.isfinite(rms), inside, np.nan).tolist(),
        qualities=dict(qualities),
    )
