"""A trial, run: what many vehicles read is estimated by batches, through the compiled core on all processors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.processors import processors
from builder.trial.readings import Readings, joined
from builder.trial.score import Score, score_of
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

BATCH = 20_000
"""Samples that are estimated together, at least: work for all processors, in memory that does not grow."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimates:
    """Estimates of n samples: ``coefficients`` and ``std`` (n, 5) [1], ``health`` (n,)."""

    coefficients: FloatArray
    std: FloatArray
    health: IntArray


def trial_score(
    estimator: Estimator, readings: Iterable[Readings], truth: FloatArray, bound: FloatArray | None = None
) -> Score:
    """Return the score of what vehicles read, each of them in the same k flights.

    Parameters
    ----------
    readings : of each vehicle, drawn as they are needed.
    truth : (k, 5) coefficients of the flights [1].
    bound : (k, 5) their Cramer-Rao bound [1]; None where it is not known.
    """
    found = [estimates(estimator, batch) for batch in _batches(readings)]
    coefficients = np.concatenate([one.coefficients for one in found])
    std, health = np.concatenate([one.std for one in found]), np.concatenate([one.health for one in found])
    true = np.tile(truth, (len(coefficients) // len(truth), 1))
    return score_of(COEFFICIENT_NAMES, coefficients - true, std, health=health, bound=bound)


def _batches(readings: Iterable[Readings]) -> Iterator[Readings]:
    """Return ``readings`` joined to batches."""
    held: list[Readings] = []
    for one in readings:
        held.append(one)
        if sum(len(part.strain) for part in held) >= BATCH:
            yield joined(held)
            held = []
    if held:
        yield joined(held)


def estimates(estimator: Estimator, read: Readings) -> Estimates:
    """Return the estimates of ``read``; where each sample is a flight, those at its end."""
    if read.time is not None:
        return _at_ends(estimator, read, read.time)
    found = estimator.estimate(read.strain, **read.known)
    return Estimates(
        coefficients=found.coefficients,
        std=found.coefficients_std,
        health=np.asarray(found.health, dtype=np.int64),
    )


def _at_ends(estimator: Estimator, read: Readings, time: FloatArray) -> Estimates:
    """Return the estimates at the ends of flights, each processor a part of them with a track of its own."""
    count = len(read.strain)

    def of_part(numbers: IntArray) -> list[tuple[FloatArray, FloatArray, int]]:
        own, found = estimator.filter(estimator.filter_time_constant), []
        for k in numbers.tolist():
            own.restart()
            last = own.track(read.strain[k], time=time, **_of_sample(read.known, k, count))[-1]
            found.append((last.coefficients, last.coefficients_std, int(last.health)))
        return found

    parts = np.array_split(np.arange(count), max(1, min(count, processors())))
    with ThreadPoolExecutor(len(parts)) as pool:
        coefficients, std, health = zip(*(one for part in pool.map(of_part, parts) for one in part), strict=True)
    return Estimates(coefficients=np.array(coefficients), std=np.array(std), health=np.array(health))


def _of_sample(known: Mapping[str, Any], number: int, count: int) -> dict[str, Any]:
    """Return what is known in sample ``number`` of ``count``."""
    return {
        name: _of_sample(value, number, count)
        if isinstance(value, Mapping)
        else float(np.broadcast_to(value, count)[number])
        for name, value in known.items()
    }
