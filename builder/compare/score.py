"""Scores of estimators on the same readings: errors, coverage, field, air data, cost of a step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from builder.compare.candidate import AIR_DATA, Answer, Candidate
from builder.compare.field import field_errors
from builder.compare.flights import Readings
from builder.pipeline.demonstration.flight_score import ROLLING
from builder.truth.flights import Flights
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.flight_condition import FlightCondition

SIGMAS = 3.0
"""Standard deviations that coverage counts within."""

PERCENTILES = tuple(range(0, 101, 5))
"""Percentiles of the field error in an entry."""

TENTHS = 10
"""Parts of the flights, by total incidence and by Mach number, whose rms errors are given."""

TENTHS_BY: dict[str, Callable[[FlightCondition], float]] = {
    "total_incidence": lambda one: one.total_incidence,
    "mach_number": lambda one: one.mach_number,
}

AIR_DATA_KEYS = (
    "angle_of_attack_deg",
    "sideslip_deg",
    "mach_number",
    "static_pressure_percent",
    "dynamic_pressure_percent",
)
"""Names of the air data of an entry, in the order of :data:`AIR_DATA`."""


@dataclass(eq=False, kw_only=True)
class Tally:
    """Errors of one estimator, block after block: coefficients, whether inside the band, field, air data.

    ``names`` are those of the coefficients. ``tenths`` holds the tenth of every flight, 0 to 9: by total incidence
    and by Mach number.
    """

    names: tuple[str, ...] = COEFFICIENT_NAMES
    error: list[FloatArray] = field(default_factory=list)
    covered: list[FloatArray] = field(default_factory=list)
    of_field: list[FloatArray] = field(default_factory=list)
    air: list[FloatArray] = field(default_factory=list)
    tenths: dict[str, list[IntArray]] = field(default_factory=lambda: {name: [] for name in TENTHS_BY})

    def add(self, answer: Answer, flights: Flights, true_field: FloatArray) -> None:
        """Count ``answer`` to ``flights`` of k conditions, whose field is ``true_field`` (k, ..) [Pa]."""
        error, std = answer.coefficients - flights.coefficients, answer.std
        if flights.rolling is not None:
            unknown = np.full((len(error), 2), np.nan)
            rolling = unknown if answer.rolling is None else answer.rolling
            error = np.column_stack([error, rolling[:, 0] - flights.rolling])
            std = np.column_stack([std, rolling[:, 1]])
        self.error.append(error)
        for name, by in TENTHS_BY.items():
            self.tenths[name].append(tenths(np.array([by(one) for one in flights.conditions])))
        with np.errstate(invalid="ignore"):
            inside = np.abs(error) <= SIGMAS * std  # false where there is no estimate
        covered = inside.astype(np.float64)
        if answer.rolling is None:
            covered[:, len(COEFFICIENT_NAMES) :] = np.nan  # not asked for
        self.covered.append(covered)
        if answer.field is not None:
            self.of_field.append(field_errors(answer.field, true_field))
        if answer.air_data is not None:
            self.air.append(air_data_errors(answer.air_data, flights))

    def entry(self) -> dict[str, Any]:
        """Return the scores as numbers; None where the estimator has none."""
        error, covered = np.concatenate(self.error), np.concatenate(self.covered)
        rms = _rms(error)
        of_field = 100.0 * np.concatenate(self.of_field) if self.of_field else None
        air = np.concatenate(self.air) if self.air else np.full((1, len(AIR_DATA)), np.nan)
        return {
            "rms": _named(self.names, rms),
            "rms_of_tenths": {
                name: rms_of_tenths(error, np.concatenate(number), self.names)
                for name, number in self.tenths.items()
            },
            "coverage_percent": _named(self.names, 100.0 * covered.mean(axis=0)),
            "field_median_percent": _percentile(of_field, 50),
            "field_p95_percent": _percentile(of_field, 95),
            "field_percentiles_percent": None
            if of_field is None
            else [_percentile(of_field, one) for one in PERCENTILES],
            "air_data_p95": _named(AIR_DATA_KEYS, np.quantile(np.abs(air), 0.95, axis=0)),
            "samples": len(error),
        }


def tenths(values: FloatArray) -> IntArray:
    """Return in which tenth of ``values`` (k,), in increasing order, each of them is: 0 to 9."""
    rank = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    return np.asarray(rank * TENTHS // max(len(values), 1), dtype=np.int64)


def _rms(error: FloatArray) -> FloatArray:
    """Return the rms (m,) of the columns of ``error`` (n, m) over what is known, NaN where nothing is."""
    known = np.isfinite(error).any(axis=0)
    rms = np.full(error.shape[1], np.nan)
    rms[known] = np.sqrt(np.nanmean(error[:, known] ** 2, axis=0))
    return rms


def rms_of_tenths(
    error: FloatArray, tenth: IntArray, names: tuple[str, ...] = COEFFICIENT_NAMES
) -> dict[str, list[float | None]]:
    """Return the rms of ``error`` (n, m) over the samples of each ``tenth`` (n,), by ``names`` of the columns."""
    rms = np.array([_rms(error[tenth == number]) for number in range(TENTHS)])
    return {name: [rounded(one) for one in values] for name, values in zip(names, rms.T.tolist(), strict=True)}


def air_data_errors(found: FloatArray, flights: Flights) -> FloatArray:
    """Return (k, 5) errors of air data ``found`` (k, 5), in the units of :data:`AIR_DATA_KEYS`."""
    conditions = flights.conditions
    angle, slip, mach = (
        np.array([getattr(one, name) for one in conditions])
        for name in ("angle_of_attack", "sideslip_angle", "mach_number")
    )
    true = np.column_stack([angle, slip, mach, flights.ambient_pressure, flights.dynamic_pressure])
    error = found - true
    error[:, :2] = np.degrees(error[:, :2])
    error[:, 3:] *= 100.0 / true[:, 3:]
    return error


def _named(names: tuple[str, ...], values: FloatArray) -> dict[str, float | None]:
    return {name: rounded(value) for name, value in zip(names, values.tolist(), strict=True)}


def _percentile(values: FloatArray | None, percent: float) -> float | None:
    return None if values is None else rounded(float(np.percentile(values, percent)))


def rounded(value: float) -> float | None:
    """Return ``value`` to five digits, None where it is not finite."""
    return float(f"{value:.5g}") if np.isfinite(value) else None


def scored(
    candidates: list[tuple[Candidate, str]],
    read: Iterator[Readings],
    flights: Flights,
    true_field: FloatArray,
) -> Iterator[list[dict[str, Any]]]:
    """Return the entries of ``candidates``, each with its navigation, after every block of readings.

    The last ones count.
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
                **tally.entry(),
                "step_microseconds": rounded(cost),
                "navigation": navigation,  # the former name of the key
            }
            for (candidate, navigation), tally, cost in zip(candidates, tallies, costs, strict=True)
        ]
