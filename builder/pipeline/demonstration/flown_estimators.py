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
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, QSource
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.flight_condition import FlightCondition
from strainfmu.interface.sensor_variables import reading_names

COMPARED_AIR_DATA = ("angle_of_attack", "sideslip_angle", MACH_NUMBER, DYNAMIC_PRESSURE)
"""Air data that the plant of a flight states as well."""

AIR_PREFIXES = (".air_data", ".sigma.air_data")
"""Of the outputs of an estimator FMU, and of their standard deviations."""

EACH = 10
"""The Cramer-Rao bound is taken at one sample of this many: it changes with the flight state alone."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlownEstimates:
    """What an estimator made of a flight of n samples, less the truth, with its standard deviations.

    Attributes
    ----------
    error, std : (n, 5) of the coefficients [1].
    health : (n,).
    air_error, air_std : (n, 4) of :data:`COMPARED_AIR_DATA` [rad, rad, 1, Pa]; (n, 0) of the linear one.
    bound : (k, 5) Cramer-Rao bound at some samples [1]; None where it is not known.
    """

    error: FloatArray
    std: FloatArray
    health: IntArray
    air_error: FloatArray
    air_std: FloatArray
    bound: FloatArray | None = None


def flown_estimators(
    inverse_map: InverseMap,
    recording: Recording,
    plant: str = "plant",
    zeros: FloatArray | None = None,
    estimator: str | None = None,
) -> dict[str, FlownEstimates]:
    """Return the estimates of both estimators of ``inverse_map``, by name, on the strains of ``recording``.

    ``zeros`` (n_d,) are taken off what the gauges read [m/m]. The nonlinear one knows Mach number, altitude and
    dynamic pressure of the plant. Its estimates are the outputs of the instance ``estimator``, an FMU of the map
    that flew; with None each sample is estimated on its own.
    """
    strain = np.stack([recording[f"{plant}.{name}"] for name in reading_names(inverse_map)], axis=1)
    strain = strain if zeros is None else strain - zeros
    bound = bound_in_flight(inverse_map, recording, plant)
    truth = _columns(recording, plant, COEFFICIENT_NAMES)
    q, mach, altitude = (recording[f"{plant}.{name}"] for name in (DYNAMIC_PRESSURE, MACH_NUMBER, ALTITUDE))
    linear, none = Estimator(inverse_map.without_tables()).estimate(strain, q), np.zeros((len(strain), 0))
    found = {
        "linear": FlownEstimates(
            error=linear.coefficients - truth,
            std=linear.coefficients_std,
            health=np.asarray(linear.health),
            air_error=none,
            air_std=none,
            bound=bound,
        )
    }
    if inverse_map.manifold is None:
        return found
    if estimator is not None:
        flown, std, air, air_std = (
            _columns(recording, f"{estimator}{prefix}", names)
            for names, prefixes in ((COEFFICIENT_NAMES, ("", ".sigma")), (COMPARED_AIR_DATA, AIR_PREFIXES))
            for prefix in prefixes
        )
        health = recording[f"{estimator}.health.state"].astype(np.int64)
    else:
        one = Estimator(inverse_map).estimate(
            strain, q, mach_number=mach, altitude=altitude, q_source=QSource.INDEPENDENT
        )
        columns = [AIR_DATA_NAMES.index(name) for name in COMPARED_AIR_DATA]
        flown, std, health = one.coefficients, one.coefficients_std, np.asarray(one.health)
        air, air_std = one.air_data.value[:, columns], one.air_data.std[:, columns]
    found["nonlinear"] = FlownEstimates(
        error=flown - truth,
        std=std,
        health=health,
        air_error=air - _columns(recording, plant, COMPARED_AIR_DATA),
        air_std=air_std,
        bound=bound,
    )
    return found


def bound_in_flight(inverse_map: InverseMap, recording: Recording, plant: str = "plant") -> FloatArray | None:
    """Return (k, 5) the Cramer-Rao bound of the coefficients in a flight, at every :data:`EACH`-th sample.

    Known are q_inf, M and p_inf by altitude, as in a demonstration. None of a map without tables.
    """
    flown = _columns(recording, plant, (MACH_NUMBER, "angle_of_attack", "sideslip_angle", ALTITUDE))[::EACH]
    conditions = [FlightCondition(*one) for one in flown.tolist()]
    return cramer_rao_bound(inverse_map, conditions, (MACH_NUMBER, ALTITUDE, DYNAMIC_PRESSURE))


def _columns(recording: Recording, prefix: str, names: tuple[str, ...]) -> FloatArray:
    return np.stack([recording[f"{prefix}.{name}"] for name in names], axis=1)


def estimator_entry(flown: FlownEstimates) -> dict[str, Any]:
    """Return accuracy as numbers: rms errors and coverage of 3 sigma, of coefficients and air data."""
    score = score_of(COEFFICIENT_NAMES, flown.error, flown.std, health=flown.health, bound=flown.bound)
    entry: dict[str, Any] = {**_accuracy(score), "healthy_percent": 100.0 * score.healthy}
    if flown.air_error.shape[1]:
        entry["air_data"] = _accuracy(score_of(COMPARED_AIR_DATA, flown.air_error, flown.air_std))
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
