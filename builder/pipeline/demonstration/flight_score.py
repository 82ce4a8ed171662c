"""Accuracy of estimates against the truth, as of a flown estimator against that of its plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.cosim.systems.recording import Recording
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

ROLLING = "M_R"
CONSTANT = 1e-9
"""Range of a coefficient [1] below which it counts as constant."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightScore:
    """Errors of m coefficients over a flight of n samples.

    Attributes
    ----------
    names : of the m coefficients: C_A, C_N, C_Y, M_P, M_Y, and M_R where it was recorded.
    rms_error : (m,) root mean square of estimate minus truth [1].
    rms_error_of_range : (m,) the same over the range of the truth in this flight [1]; NaN where it is constant.
    mean_sigma : (m,) mean stated standard deviation [1].
    coverage : (m,) fraction of samples with the truth within 3 sigma [1].
    healthy : fraction of samples with health state OK [1].
    undetected : (m,) fraction of samples with the truth beyond 3 sigma and health state OK [1].
    step_time : median wall-clock time of one step per instance [s].
    """

    names: tuple[str, ...]
    rms_error: FloatArray
    rms_error_of_range: FloatArray
    mean_sigma: FloatArray
    coverage: FloatArray
    healthy: float
    undetected: FloatArray
    step_time: dict[str, float]

    def record(self) -> dict[str, Any]:
        """Return it for a file of results: a number per coefficient by name, None where there is none."""
        return {
            key: {
                name: None if np.isnan(one) else one for name, one in zip(self.names, value.tolist(), strict=True)
            }
            if isinstance(value, np.ndarray)
            else value
            for key, value in asdict(self).items()
        }


def score_flight(recording: Recording, plant: str = "plant", estimator: str = "estimator") -> FlightScore:
    """Compare the estimates of the instance ``estimator`` with the truth of the instance ``plant``."""
    names = (*COEFFICIENT_NAMES, *((ROLLING,) if f"{plant}.{ROLLING}" in recording.names else ()))
    truth = np.stack([recording[f"{plant}.{name}"] for name in names], axis=1)
    estimate = np.stack([recording[f"{estimator}.{name}"] for name in names], axis=1)
    sigma = np.stack([recording[f"{estimator}.sigma.{name}"] for name in names], axis=1)
    cost = np.median(recording.step_cost, axis=0)
    step_time = {name: float(value) for name, value in zip(recording.instances, cost, strict=True)}
    return score_of(
        names, estimate - truth, sigma, truth, recording[f"{estimator}.health.state"] == 0, step_time=step_time
    )


def score_of(
    names: Sequence[str],
    error: FloatArray,
    sigma: FloatArray,
    truth: FloatArray,
    is_healthy: BoolArray,
    step_time: dict[str, float] | None = None,
) -> FlightScore:
    """Return the score of n samples: ``error``, ``sigma`` and ``truth`` are (n, m) [1], ``is_healthy`` (n,)."""
    rms = np.sqrt(np.mean(error**2, axis=0))
    spread = np.ptp(truth, axis=0)
    within = np.abs(error) <= 3.0 * sigma
    return FlightScore(
        names=tuple(names),
        rms_error=rms,
        rms_error_of_range=np.divide(rms, spread, out=np.full(len(rms), np.nan), where=spread > CONSTANT),
        mean_sigma=sigma.mean(axis=0),
        coverage=np.mean(within, axis=0),
        healthy=float(np.mean(is_healthy)),
        undetected=np.mean(~within & is_healthy[:, None], axis=0),
        step_time=step_time or {},
    )
