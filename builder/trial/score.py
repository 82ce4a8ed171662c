"""The score of estimates against the truth: the one definition of every figure, each with its statistical error.

An error is the estimate less the truth. A load is *covered* where it is within three of its stated standard
deviations. A sample is *wrong* where a load is not; it is *flagged* where health is neither OK nor DEGRADED, which
says that sigma is larger. So each sample is one of five: right and OK, right and flagged, wrong and flagged,
*undetected* (wrong and not flagged), or without an estimate.

Samples of one vehicle, and samples of one flight, resemble each other: standard errors are clustered both ways
(Cameron, Gelbach and Miller, Journal of Business and Economic Statistics 29, 2011). Of what never occurs, or
always, the limit at 95 % is 3 over the number of clusters.

:data:`LIMITS` is what is aimed at, from both sides. A limit is missed where a value is off by more than two
standard errors, met where it is inside by as much; otherwise it is open: there are too few samples to say.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, sqrt
from typing import Any

import numpy as np

from builder.trial.cases import Case
from builder.trial.conditions import quantities
from builder.trial.estimators import Estimates
from builder.trial.readings import Readings
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, STATIC_PRESSURE
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, HealthState
from strainfmu.estimator.other_loads import ROLLING as ROLLING

SIGMAS = 3.0
"""An estimate is wrong where a load is further from the truth than this many of its standard deviations."""

ALARMS = (HealthState.INCONSISTENT, HealthState.SUSPECT)
"""States that good samples should be in no oftener than the stated rate."""

UNFLAGGED = (HealthState.OK, HealthState.DEGRADED)
"""States that do not warn of wrong loads."""

ALL = "all"
"""Stands for all loads of a sample together, in the column of the load."""

PARTS = ("right_ok", "right_flagged", "wrong_flagged", "undetected", "no_estimate")
"""What a sample is, one of five: columns of a row, in percent."""

RELATIVE = (STATIC_PRESSURE, DYNAMIC_PRESSURE)
"""Air data whose errors are over the true value."""

Row = dict[str, Any]
"""A row of the long table, by column."""

CONSTANT = 1e-9
"""Range of a coefficient [1] below which it counts as constant."""


class Clusters:
    """Numbers of what samples are of, each of n samples: vehicle and flight."""

    def __init__(self, *labels: IntArray) -> None:
        self._numbers = [np.unique(label, return_inverse=True)[1] for label in labels]
        self.sizes = [int(number.max()) + 1 for number in self._numbers]

    def mean(self, values: FloatArray | BoolArray) -> tuple[float, float]:
        """Return the mean of ``values`` (n,) where they are known, and its standard error; NaN where it is of
        one."""
        known = ~np.isnan(values)
        if not (count := int(known.sum())):
            return float("nan"), float("nan")
        mean = float(np.mean(values[known]))
        off = np.where(known, values - mean, 0.0)
        if min(self.sizes) < 2:
            return mean, float("nan")
        square = (1 - len(self.sizes)) * float(np.sum(off**2))
        for number, size in zip(self._numbers, self.sizes, strict=True):
            square += float(np.sum(np.bincount(number, off) ** 2)) * size / (size - 1)
        return mean, sqrt(max(square, 0.0)) / count

    def percent(self, name: str, event: BoolArray | FloatArray) -> Row:
        """Return how often ``event`` (n,) is true [%] where it is known, its standard error, and its upper limit
        at 95 %."""
        mean, error = self.mean(event)
        upper = mean + 2.0 * error
        if not 0.0 < mean < 1.0:
            error = min(1.0, 3.0 / max(self.sizes))
            upper = mean + error
        of_name = {"": mean, "_error": error, "_upper": min(1.0, upper)}
        return {f"{name}_percent{suffix}": 100.0 * value for suffix, value in of_name.items()}


def rows_of(names: Sequence[str], made: Estimates, read: Readings) -> list[Row]:
    """Return a row for all loads together, and one for each of ``names`` (m), the first columns of the truth."""
    value, std, clusters = made.value, made.std, Clusters(read.vehicle, read.flight)
    error, count = value - read.truth[:, : value.shape[1]], len(value)
    with np.errstate(invalid="ignore", divide="ignore"):
        z = np.where(std > 0.0, error / std, np.nan)
    covered, known = is_within(error, std), np.isfinite(value)
    health = np.full(count, HealthState.OK) if made.health is None else made.health
    flagged, everything = ~np.isin(health, UNFLAGGED), np.asarray(known.all(axis=1))
    shared: Row = {
        "samples": count,
        "vehicles": clusters.sizes[0],
        "flights": clusters.sizes[1],
        **clusters.percent("flagged", flagged | ~everything),
        **clusters.percent("alarm", np.isin(health, ALARMS)),
    }
    states = {} if made.health is None else {HealthState(s).name: np.mean(health == s) for s in np.unique(health)}
    shared["health"] = " ".join(f"{name} {100.0 * share:.6g}" for name, share in states.items())
    right = np.asarray((covered | ~known).all(axis=1))
    rows: list[Row] = [{"load": ALL, **shared, **_parts(clusters, right, flagged, everything)}]
    spread = np.ptp(read.truth, axis=0)
    for column, name in enumerate(names):
        error_of_load = error[:, column]
        row: Row = {"load": name, **shared, **_parts(clusters, covered[:, column], flagged, known[:, column])}
        rms_z = _rms(clusters, z[:, column])
        row |= _errors(clusters, error_of_load, std[:, column])
        row |= {"rms_z": rms_z[0], "rms_z_error": rms_z[1]}
        row["rms_of_range"] = row["rms"] / spread[column] if spread[column] > CONSTANT else np.nan
        within_1 = is_within(error_of_load, std[:, column], 1.0)
        row |= clusters.percent("covered_1", np.where(known[:, column], within_1, np.nan))
        if read.bound is not None and column < read.bound.shape[1]:
            row["bound"] = sqrt(clusters.mean(read.bound[:, column] ** 2)[0])
            row["over_bound"] = row["rms"] / row["bound"]
        rows.append(row)
    return rows + [{"load": name, **shared, **_of_other(clusters, name, made, read)} for name in made.extras]


def _of_other(clusters: Clusters, name: str, made: Estimates, read: Readings) -> Row:
    """Return the errors of what is no load: of a quantity of the flight, or an error of a field as it is."""
    value, std = made.extras[name]
    is_quantity = name == STATIC_PRESSURE or hasattr(read.conditions[0], name)
    truth = quantities(read.conditions, name)[read.flight] if is_quantity else np.zeros(len(value))
    scale = truth if name in RELATIVE else np.ones(len(truth))
    error = (value - truth) / scale
    median, p95 = np.quantile(np.abs(error), [0.5, 0.95]).tolist()
    return {**_errors(clusters, error, std / scale), "median": median, "p95": p95}


def _errors(clusters: Clusters, error: FloatArray, std: FloatArray) -> Row:
    rms, of_rms = _rms(clusters, error)
    return {"rms": rms, "rms_error": of_rms, "bias": clusters.mean(error)[0], "sigma": clusters.mean(std)[0]}


def _parts(clusters: Clusters, right: BoolArray, flagged: BoolArray, known: BoolArray) -> Row:
    """Return the fractions of the five parts of the samples, and of covered ones among samples with an
    estimate."""
    right_given, wrong = right & known, ~right & known
    events = (right_given & ~flagged, right_given & flagged, wrong & flagged, wrong & ~flagged, ~known)
    parts = [clusters.percent(name, event) for name, event in zip(PARTS, events, strict=True)]
    covered = clusters.percent("covered", np.where(known, right, np.nan))
    return {name: value for part in (covered, *parts) for name, value in part.items()}


def by_load(rows: Sequence[Row], column: str, factor: float = 1.0) -> dict[str, float | None]:
    """Return a column of ``rows``, times ``factor``, by the load; None where nothing is known."""
    values = {row["load"]: row.get(column) for row in rows}
    return {
        load: None if value is None or not isfinite(value) else factor * float(value)
        for load, value in values.items()
    }


def _rms(clusters: Clusters, values: FloatArray) -> tuple[float, float]:
    """Return the root mean square of ``values`` (n,), and its standard error."""
    square, error = clusters.mean(values**2)
    rms = sqrt(square) if square == square else square
    return rms, error / (2.0 * rms) if rms else 0.0


def rms_ratios(error: FloatArray, of_other: FloatArray, read: Readings) -> list[tuple[float, float]]:
    """Return the rms of each column of an ``error`` (n, m) over the rms of another, where both are known, and its
    standard error."""
    clusters, ratios = Clusters(read.vehicle, read.flight), list[tuple[float, float]]()
    known = np.isfinite(error) & np.isfinite(of_other)
    squares = (np.where(known, values, np.nan).T ** 2 for values in (error, of_other))
    for square, of_square in zip(*squares, strict=True):
        mean = clusters.mean(of_square)[0]
        ratio = sqrt(clusters.mean(square)[0] / mean) if mean > 0.0 else np.nan
        ratios.append((ratio, clusters.mean(square - ratio**2 * of_square)[1] / (2.0 * ratio * mean)))
    return ratios


def is_within(error: FloatArray, std: FloatArray | float, sigmas: float = SIGMAS) -> BoolArray:
    """Return where ``error`` is at most ``sigmas`` of its standard deviations ``std``; not where it is NaN."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(error) <= sigmas * std)


OK, OPEN, MISSED, NONE = "ok", "open", "missed", "-"

ERRORS = 2.0
"""Standard errors by which a value is off a limit or inside."""


@dataclass(frozen=True, kw_only=True)
class Limit:
    """``column`` of each load, or of all together if it is of :data:`OF_SAMPLE`, is at least ``low`` and at most
    ``high``; ``within_error``: no sample is enough to say that a rate is so small, so it is met unless it is
    missed."""

    column: str
    low: float = -inf
    high: float = inf
    within_error: bool = False

    def verdict(self, rows: Sequence[Row]) -> tuple[str, str]:
        """Return the worst verdict over ``rows``, and what is off."""
        worst, of_sample = (OK, ""), self.column in OF_SAMPLE
        for row in (entry for entry in rows if (entry["load"] == ALL) == of_sample):
            value, error = row.get(self.column), row.get(f"{self.column}_error") or 0.0
            if value is None or value != value:
                continue
            excess = max(value - self.high, self.low - value)
            margin = -ERRORS * error if self.within_error else ERRORS * error
            verdict = MISSED if excess > ERRORS * error else OK if excess + margin <= 0.0 else OPEN
            if (OK, OPEN, MISSED).index(verdict) > (OK, OPEN, MISSED).index(worst[0]):
                worst = verdict, self._text(row["load"], value, error)
        return worst

    def _text(self, load: str, value: float, error: float) -> str:
        whose = "" if load == ALL else f" of {load}"
        name = self.column.removesuffix("_percent").replace("_", " ")
        unit = " %" if "percent" in self.column else ""
        aim = f"at most {self.high:g}" if value - self.high >= self.low - value else f"at least {self.low:g}"
        return f"{name}{whose} {value:.3g} +- {error:.2g}{unit}, {aim}{unit} aimed at"


OF_SAMPLE = ("flagged_percent", "alarm_percent", *(f"{part}_percent" for part in PARTS))
"""Columns whose limits are of all loads together."""

COVERED = Limit(column="covered_percent", low=99.0)

LIMITS: dict[str, tuple[Limit, ...]] = {
    "drawn": (
        Limit(column="rms_z", low=0.7, high=1.1),
        COVERED,
        Limit(column="alarm_percent", high=100.0 * FALSE_ALARM_PROBABILITY, within_error=True),
        Limit(column="flagged_percent", high=0.2),
    ),
    "alone": (COVERED, Limit(column="flagged_percent", high=1.0)),
    "beyond": (Limit(column="undetected_percent", high=5.0),),
    "unobservable": (),
}
"""By class."""


def judged(case: Case, rows: Sequence[Row]) -> tuple[str, str]:
    """Return the verdict of the ``rows`` of a case by one estimator, and why."""
    low = (Limit(column=column, low=value) for column, value in case.at_least.items())
    high = (Limit(column=column, high=value) for column, value in case.at_most.items())
    limits = (*LIMITS[case.group], *low, *high)
    verdicts = [limit.verdict(rows) for limit in limits]
    for verdict in (MISSED, OPEN):
        if texts := [text for name, text in verdicts if name == verdict]:
            return verdict, "; ".join(texts)
    return (OK if limits else NONE), ""
