"""Accuracy of estimates in a flight against the truth, as of a flown estimator against its plant."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from builder.trial.score import ROLLING, Score, by_name, score_of
from strainfmu.arrays import FloatArray
from strainfmu.cosim.systems.recording import Recording
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

SCORE_VERSION = 2
"""Raised whenever scores of flights have other figures of the same files."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightScore(Score):
    """The score of a flight, and ``step_time``: median wall-clock time of one step per instance [s]."""

    step_time: dict[str, float] = field(default_factory=dict)

    def record(self) -> dict[str, Any]:
        """Return it for a file of results: a number per coefficient by name, None where there is none."""
        of_loads = {
            "rms_error": self.rms,
            "rms_error_of_range": self.rms_of_range,
            "mean_sigma": self.mean_std,
            "coverage": self.coverage_3,
            "undetected": self.undetected_of_load,
            "bias": self.bias,
            "coverage_1": self.coverage_1,
            "rms_z": self.rms_z,
            "bound": self.bound,
        }
        named = {key: by_name(self.names, value) for key, value in of_loads.items()}
        whole = {"healthy": self.healthy, "false_alarms": self.false_alarms, "step_time": self.step_time}
        return {"names": self.names, **named, **whole}


def score_flight(
    recording: Recording, plant: str = "plant", estimator: str = "estimator", bound: FloatArray | None = None
) -> FlightScore:
    """Compare the estimates of the instance ``estimator`` with the truth of the instance ``plant``.

    ``bound`` (n, 5) is the Cramer-Rao bound of the samples; None where it is not known.
    """
    names = (*COEFFICIENT_NAMES, *((ROLLING,) if f"{plant}.{ROLLING}" in recording.names else ()))
    truth, estimate, std = (
        np.stack([recording[f"{prefix}.{name}"] for name in names], axis=1)
        for prefix in (plant, estimator, f"{estimator}.sigma")
    )
    health, cost = recording[f"{estimator}.health.state"], np.median(recording.step_cost, axis=0)
    score = score_of(names, estimate - truth, std, truth=truth, health=health, bound=bound)
    step_time = dict(zip(recording.instances, cost.tolist(), strict=True))
    return FlightScore(**vars(score), step_time=step_time)
