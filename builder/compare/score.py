"""Scores of estimators on the same readings: errors, coverage, field, air data, cost of a step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from builder.compare.candidate import AIR_DATA, Answer, Candidate
from builder.compare.field import field_errors
from builder.compare.flights import Readings
from builder.trial.score import ROLLING, by_name, mean_square, rounded, score_of
from builder.truth.flights import Flights
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.flight_condition import MACH_NUMBER, FlightCondition

PERCENTILES = tuple(range(0, 101, 5))
"""Percentiles of the field error in an entry."""

TENTHS = 10
"""Parts of the flights, by total incidence and by Mach number, whose rms errors are given."""

TENTHS_BY: dict[str, Callable[[FlightCondition], float]] = {
    "total_incidence": lambda one: one.total_incidence,
    MACH_NUMBER: lambda one: one.mach_number,
}

AIR_DATA_KEYS = (
    "angle_of_attack_deg",
    "sideslip_deg",
    MACH_NUMBER,
    "static_pressure_percent",
    "dynamic_pressure_percent",
)
"""Names of the air data of an entry, in the order of :data:`AIR_DATA`."""


@dataclass(eq=False, kw_only=True)
class Tally:
    """Errors of one estimator, block after block: coefficients and their sigmas, field, air data.

    ``names`` are the names of the coefficients. ``tenths`` holds the tenth of every flight, 0 to 9: by total
    incidence and by Mach number.
    """

    names: tuple[str, ...] = COEFFICIENT_NAMES
    error: list[FloatArray] = field(default_factory=list)
    std: list[FloatArray] = field(default_factory=list)
    of_field: list[FloatArray] = field(default_factory=list)
    air: list[FloatArray] = field(default_factory=list)
    tenths: dict[str, list[IntArray]] = field(default_factory=lambda: {name: [] for name in TENTHS_BY})

    def add(self, answer: Answer, flights: Flights, true_field: FloatArray) -> None:
        """Count ``answer`` to ``flights`` of k conditions, whose field is ``true_field`` (k, ..) [Pa]."""
        error, std = answer.coefficients - flights.coefficients, answer.std
        if flights.rolling is not None and answer.rolling is not None:
            error = np.column_stack([error, answer.rolling[:, 0] - flights.rolling])
            std = np.column_stack([std, answer.rolling[:, 1]])
        self.error.append(error)
        self.std.append(std)
        for name, by in TENTHS_BY.items():
            self.tenths[name].append(tenths(np.array([by(one) for one in flights.conditions])))
        if answer.field is not None:
            self.of_field.append(field_errors(answer.field, true_field))
        if answer.air_data is not None:
            self.air.append(air_data_errors(answer.air_data, flights))

    def entry(self, bound: FloatArray | None = None) -> dict[str, Any]:
        """Return the scores as numbers; None where the estimator has none.

        ``bound`` (k, 5) is the Cramer-Rao bound of the flights; None where it is not known.
        """
        error = np.concatenate(self.error)
        asked = self.names[: error.shape[1]]
        score = score_of(asked, error, np.concatenate(self.std), bound=bound)
        of_field = 100.0 * np.concatenate(self.of_field) if self.of_field else None
        air = np.concatenate(self.air) if self.air else np.full((1, len(AIR_DATA)), np.nan)

        unknown = {name: [None] * TENTHS for name in self.names}

        def named(values: FloatArray | None) -> dict[str, float | None]:
            return {**dict.fromkeys(self.names), **by_name(asked, values, rounded)}

        return {
            "rms": named(score.rms),
            "rms_of_tenths": {
                by: {**unknown, **rms_of_tenths(error, np.concatenate(number), asked)}
                for by, number in self.tenths.items()
            },
            "coverage_percent": named(100.0 * score.coverage_3),
            "field_median_percent": _percentile(of_field, 50),
            "field_p95_percent": _percentile(of_field, 95),
            "field_percentiles_percent": None
            if of_field is None
            else [_percentile(of_field, one) for one in PERCENTILES],
            "air_data_p95": by_name(AIR_DATA_KEYS, np.quantile(np.abs(air), 0.95, axis=0), rounded),
            "samples": score.samples,
            "bound": named(score.bound),
            "bias": named(score.bias),
            "coverage_1_percent": named(100.0 * score.coverage_1),
            "rms_z": named(score.rms_z),
        }


def tenths(values: FloatArray) -> IntArray:
    """Return in which tenth of ``values`` (k,), in increasing order, each of them is: 0 to 9."""
    rank = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    return np.asarray(rank * TENTHS // max(len(values), 1), dtype=np.int64)


def rms_of_tenths(
    error: FloatArray, tenth: IntArray, names: tuple[str, ...] = COEFFICIENT_NAMES
) -> dict[str, list[float | None]]:
    """Return the rms of ``error`` (n, m) over the samples of each ``tenth`` (n,), by ``names`` of the columns."""
    rms = np.sqrt([mean_square(error[tenth == number]) for number in range(TENTHS)])
    return {name: [rounded(one) for one in values] for name, values in zip(names, rms.T.tolist(), strict=True)}


def air_data_errors(found: FloatArray, flights: Flights) -> FloatArray:
    """Return (k, 5) errors of air data ``found`` (k, 5), in the units of :data:`AIR_DATA_KEYS`."""
    conditions = flights.conditions
    flow = np.array([[one.angle_of_attack, one.sideslip_angle, one.mach_number] for one in conditions])
    true = np.column_stack([flow, flights.ambient_pressure, flights.dynamic_pressure])
    error = found - true
    error[:, :2] = np.degrees(error[:, :2])
    error[:, 3:] *= 100.0 / true[:, 3:]
    return error


def _percentile(values: FloatArray | None, percent: float) -> float | None:
    return None if values is None else rounded(float(np.percentile(values, percent)))


def scored(
    candidates: list[tuple[Candidate, str]],
    read: Iterator[Readings],
    flights: Flights,
    true_field: FloatArray,
    bounds: Mapping[str, FloatArray],
) -> Iterator[list[dict[str, Any]]]:
    """Return the entries of ``candidates``, each with its navigation, after every block of readings.

    The last ones count. ``bounds`` are the Cramer-Rao bounds (k, 5) of the flights by navigation.
    """
    names = COEFFICIENT_NAMES if flights.rolling is None else (*COEFFICIENT_NAMES, ROLLING)
    tallies = [Tally(names=names) for _ in candidates]
    costs: list[float] = []
    for block in read:
        for (candidate, navigation), tally in zip(candidates, tallies, strict=True):
            tally.add(candidate.answer(block, navigation), flights, true_field)
        costs = costs or [one.step_microseconds(block, navigation) for one, navigation in candidates]
        yield [
            {
                "estimator": candidate.name,
                "air_data_inputs": navigation,
                **tally.entry(bounds.get(navigation) if candidate.takes_one_reading else None),
                "step_microseconds": rounded(cost),
                "navigation": navigation,  # the former name of the key
            }
            for (candidate, navigation), tally, cost in zip(candidates, tallies, costs, strict=True)
        ]
