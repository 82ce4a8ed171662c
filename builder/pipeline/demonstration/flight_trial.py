"""A recorded flight as a trial of one vehicle: the outputs of an FMU that flew, and the estimators of a map on the
same strains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from builder.trial.bound import cramer_rao_bound
from builder.trial.estimators import Estimates, estimates_from, known_by, of_map
from builder.trial.readings import ANGLES, Readings
from builder.trial.score import ROLLING, Row, by_load, rows_of
from strainfmu.arrays import FloatArray
from strainfmu.cosim.systems.recording import Recording
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE, QSource
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.flight_condition import FlightCondition
from strainfmu.interface.sensor_variables import reading_names

SCORE_VERSION = 3
"""Raised whenever scores of flights have other figures of the same files."""

AIR_DATA = (*ANGLES, MACH_NUMBER, DYNAMIC_PRESSURE)
"""Air data that the plant of a flight states as well [rad, rad, 1, Pa]."""

EACH, SECOND = 10, 100
"""The Cramer-Rao bound is taken at one sample of this many: it changes with the flight state alone. So many
samples count as one flight in statistical errors: noise is new in each, the errors of the vehicle last."""

RECORD = {
    "rms_error": ("rms", 1.0),
    "rms_error_of_range": ("rms_of_range", 1.0),
    "mean_sigma": ("sigma", 1.0),
    "coverage": ("covered_percent", 0.01),
    "undetected": ("undetected_percent", 0.01),
    "bias": ("bias", 1.0),
    "coverage_1": ("covered_1_percent", 0.01),
    "rms_z": ("rms_z", 1.0),
    "bound": ("bound", 1.0),
}
"""Columns of a score, with factors, by the entries of ``summary.json``."""

ENTRY = {
    "rms": ("rms", 1.0),
    "coverage_percent": ("covered_percent", 1.0),
    "bias": ("bias", 1.0),
    "rms_z": ("rms_z", 1.0),
    "bound": ("bound", 1.0),
}
"""The same by the entries of ``estimators.json``."""


class Flown(NamedTuple):
    """What was read in a flight of n samples, and what an estimator made of it."""

    read: Readings
    made: Estimates

    @property
    def error(self) -> FloatArray:
        """(n, m) estimate less truth."""
        return self.made.value - self.read.truth[:, : self.made.value.shape[1]]

    def rows(self, names: Sequence[str]) -> list[Row]:
        """Return the rows of all loads together and of the first of ``names``, as far as they are estimated."""
        return rows_of(names[: self.made.value.shape[1]], self.made, self.read)

    @property
    def healthy(self) -> float:
        """Fraction of samples with health OK [1]."""
        return float(np.mean(self.made.health == HealthState.OK))

    def record(self, names: Sequence[str] = COEFFICIENT_NAMES) -> dict[str, Any]:
        """Return the score for a file of results: a number per load by name, None where there is none."""
        every, *loads = self.rows(names)
        named = {entry: by_load(loads, *column) for entry, column in RECORD.items()}
        whole = {"healthy": self.healthy, "right_flagged": 0.01 * every["right_flagged_percent"]}
        return {"names": [row["load"] for row in loads], **named, **whole}

    def entry(self) -> dict[str, Any]:
        """Return accuracy for a file of results, of coefficients and air data."""
        rows = self.rows((*COEFFICIENT_NAMES, *AIR_DATA))[1:]
        loads, air = (
            {
                entry: by_load(part, *column)
                for entry, column in ENTRY.items()
                if any(column[0] in row for row in part)
            }
            for part in (rows[: len(COEFFICIENT_NAMES)], rows[len(COEFFICIENT_NAMES) :])
        )
        entry = {**loads, "healthy_percent": 100.0 * self.healthy}
        return {**entry, "air_data": air} if air else entry


def score_flight(recording: Recording, inverse_map: InverseMap | None = None) -> dict[str, Any]:
    """Return the score of the instance "estimator", whose map may be known, against the instance "plant", and the
    time of a step [s]."""
    names = (*COEFFICIENT_NAMES, *((ROLLING,) if f"plant.{ROLLING}" in recording.names else ()))
    flown = Flown(_readings(recording, names, inverse_map), outputs_of(recording, names))
    cost = np.median(recording.step_cost, axis=0)
    return {**flown.record(names), "step_time": dict(zip(recording.instances, cost.tolist(), strict=True))}


def flown_estimators(
    inverse_map: InverseMap, recording: Recording, zeros: FloatArray | None = None, estimator: str | None = None
) -> dict[str, Flown]:
    """Return the estimates of both estimators of ``inverse_map``, by name, on the strains of ``recording``.

    ``zeros`` (n_d,) are subtracted from what the gauges read [m/m]. The estimators get dynamic pressure, Mach
    number and altitude of the plant. With the instance ``estimator``, an FMU of the map that flew, estimates of
    the nonlinear one are its outputs, with air data.
    """
    strain = _columns(recording, "plant", reading_names(inverse_map))
    known = {name: recording[f"plant.{name}"] for name in (DYNAMIC_PRESSURE, MACH_NUMBER, ALTITUDE)}
    read = _readings(
        recording,
        (names := (*COEFFICIENT_NAMES, *AIR_DATA)),
        inverse_map,
        strain if zeros is None else strain - zeros,
        {**known, Q_SOURCE: float(QSource.INDEPENDENT)},
    )
    flown = {"linear": Flown(read, of_map(inverse_map, "linear")(read))}
    if inverse_map.manifold is not None:
        nonlinear = Estimator(inverse_map)
        made = (
            estimates_from(nonlinear.estimate(read.strain, **known_by(nonlinear, read.known)), AIR_DATA)
            if estimator is None
            else outputs_of(recording, names, estimator)
        )
        flown["nonlinear"] = Flown(read, made)
    return flown


def outputs_of(recording: Recording, names: Sequence[str], instance: str = "estimator") -> Estimates:
    """Return the outputs ``names`` of an FMU that flew."""
    outputs = [f"air_data.{name}" if name in AIR_DATA else name for name in names]
    return Estimates(
        value=_columns(recording, instance, outputs),
        std=_columns(recording, f"{instance}.sigma", outputs),
        health=recording[f"{instance}.health.state"].astype(np.int64),
    )


def _readings(
    recording: Recording,
    names: Sequence[str],
    inverse_map: InverseMap | None,
    strain: FloatArray | None = None,
    known: Mapping[str, Any] | None = None,
) -> Readings:
    """Return what the plant read, with the truth of ``names``, and the Cramer-Rao bound at every :data:`EACH`-th
    sample where the map has tables; known are q_inf, M and p_inf by altitude, as in a demonstration."""
    n, bound = len(recording.time), None
    if inverse_map is not None:
        flown = _columns(recording, "plant", (MACH_NUMBER, *ANGLES, ALTITUDE))[::EACH]
        conditions = [FlightCondition(*state) for state in flown.tolist()]
        bound = cramer_rao_bound(inverse_map, conditions, (MACH_NUMBER, ALTITUDE, DYNAMIC_PRESSURE))
    every = None if bound is None else np.full((n, bound.shape[1]), np.nan)
    if bound is not None and every is not None:
        every[::EACH] = bound
    return Readings(
        strain=np.empty((n, 0)) if strain is None else strain,
        known=known or {},
        truth=_columns(recording, "plant", names),
        vehicle=np.zeros(n, dtype=np.int64),
        flight=np.arange(n) // SECOND,
        bound=every,
    )


def _columns(recording: Recording, prefix: str, names: Sequence[str]) -> FloatArray:
    return np.stack([recording[f"{prefix}.{name}"] for name in names], axis=1)
