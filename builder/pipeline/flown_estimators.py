"""The linear and the nonlinear estimator on the strains of one flight, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.cosim.recording import Recording
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.load_estimate import LoadEstimates
from strainfmu.estimator.manifold.air_data import AIR_DATA_NAMES
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.step import Estimator
from strainfmu.interface.fmi_variables import strain_names

COMPARED_AIR_DATA = ("angle_of_attack", "sideslip_angle", "mach_number", "dynamic_pressure")
"""Air data that the plant of a flight states as well."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlownEstimates:
    """What an estimator made of a flight of n samples, and the truth.

    Attributes
    ----------
    coefficients, coefficients_std, true_coefficients : (n, 5) [1].
    health : (n,).
    air_data, air_data_std, true_air_data : (n, 4) of :data:`COMPARED_AIR_DATA` [rad, rad, 1, Pa]; None of the
        linear one.
    """

    coefficients: FloatArray
    coefficients_std: FloatArray
    true_coefficients: FloatArray
    health: IntArray
    air_data: FloatArray | None = None
    air_data_std: FloatArray | None = None
    true_air_data: FloatArray | None = None

    def air_data_errors(self) -> tuple[FloatArray, FloatArray]:
        """Return errors and standard deviations (n, 4) of the air data; (n, 0) where there are none."""
        if self.air_data is None or self.air_data_std is None or self.true_air_data is None:
            none = np.zeros((len(self.coefficients), 0))
            return none, none
        return self.air_data - self.true_air_data, self.air_data_std


def flown_estimators(
    inverse_map: InverseMap, recording: Recording, plant: str = "plant", zeros: FloatArray | None = None
) -> dict[str, FlownEstimates]:
    """Return the estimates of both estimators of ``inverse_map``, by name, on the strains of ``recording``.

    ``zeros`` (n_d,) are taken off what the gauges read [m/m]. The nonlinear one steps from state to state, with
    Mach number, altitude and dynamic pressure of the plant.
    """
    strain = np.stack([recording[f"{plant}.{name}"] for name in strain_names(inverse_map.n_gauges)], axis=1)
    strain = strain if zeros is None else strain - zeros
    truth = np.stack([recording[f"{plant}.{name}"] for name in COEFFICIENT_NAMES], axis=1)
    q, mach, altitude = (recording[f"{plant}.{name}"] for name in ("dynamic_pressure", "mach_number", "altitude"))
    linear = Estimator(inverse_map).estimate(strain, q)
    assert isinstance(linear, LoadEstimates)
    found = {
        "linear": FlownEstimates(
            coefficients=linear.coefficients,
            coefficients_std=linear.coefficients_std,
            true_coefficients=truth,
            health=np.asarray(linear.health),
        )
    }
    if inverse_map.manifold is None:
        return found
    tracker = FlightTracker(ManifoldEstimator(inverse_map))
    steps = [
        tracker.step(row, float(q[i]), mach_number=float(mach[i]), altitude=float(altitude[i]))
        for i, row in enumerate(strain)
    ]
    columns = [AIR_DATA_NAMES.index(name) for name in COMPARED_AIR_DATA]
    found["manifold"] = FlownEstimates(
        coefficients=np.array([one.coefficients for one in steps]),
        coefficients_std=np.array([one.coefficients_std for one in steps]),
        true_coefficients=truth,
        health=np.array([int(one.health) for one in steps], dtype=np.int64),
        air_data=np.array([one.air_data.value[columns] for one in steps]),
        air_data_std=np.array([one.air_data.std[columns] for one in steps]),
        true_air_data=np.stack([recording[f"{plant}.{name}"] for name in COMPARED_AIR_DATA], axis=1),
    )
    return found


def estimator_entry(flown: FlownEstimates) -> dict[str, Any]:
    """Return accuracy as numbers: rms errors and coverage of 3 sigma, of coefficients and air data."""
    entry: dict[str, Any] = {
        "rms": _named(COEFFICIENT_NAMES, _rms(flown.coefficients - flown.true_coefficients)),
        "coverage_percent": _named(
            COEFFICIENT_NAMES,
            _coverage(flown.coefficients - flown.true_coefficients, flown.coefficients_std),
        ),
        "healthy_percent": 100.0 * float(np.mean(flown.health == HealthState.OK)),
    }
    error, std = flown.air_data_errors()
    if error.shape[1]:
        entry["air_data"] = {
            "rms": _named(COMPARED_AIR_DATA, _rms(error)),
            "coverage_percent": _named(COMPARED_AIR_DATA, _coverage(error, std)),
        }
    return entry


def _rms(error: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def _coverage(error: FloatArray, std: FloatArray) -> FloatArray:
    return np.asarray(100.0 * np.mean(np.abs(error) <= 3.0 * std, axis=0))


def _named(names: tuple[str, ...], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))
