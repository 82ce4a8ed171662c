"""The linear and the nonlinear estimator on the strains of one flight, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.trial.bound import cramer_rao_bound
from builder.trial.score import Score, by_name, score_of
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.cosim.systems.recording import Recording
from strainfmu.estimator.air_data import AIR_DATA_NAMES
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.flight_condition import FlightCondition
from strainfmu.interface.sensor_variables import reading_names

COMPARED_AIR_DATA = ("angle_of_attack", "sideslip_angle", "mach_number", "dynamic_pressure")
"""Air data that the plant of a flight states as well."""

EACH = 10
"""The Cramer-Rao bound is taken at one sample of this many: it changes with the flight state alone."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlownEstimates:
    """What an estimator made of a flight of n samples, and the truth.

    Attributes
    ----------
    coefficients, coefficients_std, true_coefficients : (n, 5) [1].
    health : (n,).
    air_data, air_data_std, true_air_data : (n, 4) of :data:`COMPARED_AIR_DATA` [rad, rad, 1, Pa]; None of the
        linear one.
    bound : (k, 5) Cramer-Rao bound at some samples [1]; None where it is not known.
    """

    coefficients: FloatArray
    coefficients_std: FloatArray
    true_coefficients: FloatArray
    health: IntArray
    air_data: FloatArray | None = None
    air_data_std: FloatArray | None = None
    true_air_data: FloatArray | None = None
    bound: FloatArray | None = None

    def air_data_errors(self) -> tuple[FloatArray, FloatArray]:
        """Return errors and standard deviations (n, 4) of the air data; (n, 0) where there are none."""
        if self.air_data is None or self.air_data_std is None or self.true_air_data is None:
            none = np.zeros((len(self.coefficients), 0))
            return none, none
        return self.air_data - self.true_air_data, self.air_data_std


def flown_estimators(
    inverse_map: InverseMap,
    recording: Recording,
    plant: str = "plant",
    zeros: FloatArray | None = None,
    estimator: str | None = None,
) -> dict[str, FlownEstimates]:
    """Return the estimates of both estimators of ``inverse_map``, by name, on the strains of ``recording``.

    ``zeros`` (n_d,) are taken off what the gauges read [m/m]. The nonlinear one knows Mach number, altitude and
    dynamic pressure of the plant. Its estimates are those of the instance ``estimator``, an FMU of the map that
    flew; with None each sample is estimated on its own.
    """
    strain = np.stack([recording[f"{plant}.{name}"] for name in reading_names(inverse_map)], axis=1)
    strain = strain if zeros is None else strain - zeros
    bound = bound_in_flight(inverse_map, recording, plant)
    truth = _columns(recording, plant, COEFFICIENT_NAMES)
    q, mach, altitude = (recording[f"{plant}.{name}"] for name in ("dynamic_pressure", "mach_number", "altitude"))
    linear = Estimator(inverse_map.without_tables()).estimate(strain, q)
    found = {
        "linear": FlownEstimates(
            coefficients=linear.coefficients,
            coefficients_std=linear.coefficients_std,
            true_coefficients=truth,
            health=np.asarray(linear.health),
            bound=bound,
        )
    }
    if inverse_map.manifold is None:
        return found
    true_air_data = _columns(recording, plant, COMPARED_AIR_DATA)
    if estimator is not None:
        found["nonlinear"] = FlownEstimates(
            coefficients=_columns(recording, estimator, COEFFICIENT_NAMES),
            coefficients_std=_columns(recording, f"{estimator}.sigma", COEFFICIENT_NAMES),
            true_coefficients=truth,
            health=recording[f"{estimator}.health.state"].astype(np.int64),
            air_data=_columns(recording, f"{estimator}.air_data", COMPARED_AIR_DATA),
            air_data_std=_columns(recording, f"{estimator}.sigma.air_data", COMPARED_AIR_DATA),
            true_air_data=true_air_data,
            bound=bound,
        )
        return found
    one = Estimator(inverse_map).estimate(strain, q, mach_number=mach, altitude=altitude)
    columns = [AIR_DATA_NAMES.index(name) for name in COMPARED_AIR_DATA]
    found["nonlinear"] = FlownEstimates(
        coefficients=one.coefficients,
        coefficients_std=one.coefficients_std,
        true_coefficients=truth,
        health=np.asarray(one.health),
        air_data=one.air_data.value[:, columns],
        air_data_std=one.air_data.std[:, columns],
        true_air_data=true_air_data,
        bound=bound,
    )
    return found


def bound_in_flight(inverse_map: InverseMap, recording: Recording, plant: str = "plant") -> FloatArray | None:
    """Return (k, 5) the Cramer-Rao bound of the coefficients in a flight, at every :data:`EACH`-th sample.

    Known are q_inf, M and p_inf by altitude, as in a demonstration. None of a map without tables.
    """
    flown = _columns(recording, plant, ("mach_number", "angle_of_attack", "sideslip_angle", "altitude"))[::EACH]
    conditions = [FlightCondition(*one) for one in flown.tolist()]
    return cramer_rao_bound(inverse_map, conditions, ("mach_number", "altitude", "dynamic_pressure"))


def _columns(recording: Recording, prefix: str, names: tuple[str, ...]) -> FloatArray:
    return np.stack([recording[f"{prefix}.{name}"] for name in names], axis=1)


def estimator_entry(flown: FlownEstimates) -> dict[str, Any]:
    """Return accuracy as numbers: rms errors and coverage of 3 sigma, of coefficients and air data."""
    error = flown.coefficients - flown.true_coefficients
    score = score_of(COEFFICIENT_NAMES, error, flown.coefficients_std, health=flown.health, bound=flown.bound)
    entry: dict[str, Any] = _accuracy(score)
    entry["healthy_percent"] = 100.0 * score.healthy
    error, std = flown.air_data_errors()
    if error.shape[1]:
        entry["air_data"] = _accuracy(score_of(COMPARED_AIR_DATA, error, std))
    return entry


def _accuracy(score: Score) -> dict[str, Any]:
    named = {
        "rms": score.rms,
        "coverage_percent": 100.0 * score.coverage_3,
        "bias": score.bias,
        "rms_z": score.rms_z,
    }
    if score.bound is not None:
        named["bound"] = score.bound
    return {key: by_name(score.names, value) for key, value in named.items()}
