"""The limit of the envelope score, from flights of the snapshots themselves with every error drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from builder.inverse.solution import Problem, Solution
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

FALSE_OUTSIDE = 5e-4
"""Rate of flights inside the envelope that are taken to be outside it."""

SAMPLES, SEED = 12_000, 77
SMALLEST_LIMIT = 1.0

TAIL = 0.01
"""Fraction of the sample that the tail is fitted to."""


def with_score_limit(inverse_map: InverseMap, problem: Problem, solution: Solution) -> InverseMap:
    """Return ``inverse_map`` with the score limit that a fraction :data:`FALSE_OUTSIDE` of the members exceeds.

    The members are the corners of the envelope and what lies between them, so the rate holds for a flight
    programme which goes to its limits. Errors in proportion to strain are drawn at each member's strain.
    """
    random = np.random.default_rng(SEED)
    ensemble, nominal = problem.ensemble, inverse_map.nominal_dynamic_pressure
    strain = ensemble.responses(problem.strain_operator) + problem.offset
    n = len(strain)
    rows = random.choice(n, size=SAMPLES, p=ensemble.member_weight)
    samples = strain[rows] + _errors(problem, solution, rows, random)
    if inverse_map.form == "absolute":
        conditions = ensemble.conditions
        q = np.tile([condition.dynamic_pressure for condition in conditions], n // len(conditions))[rows]
    else:
        q = np.full(SAMPLES, nominal)
    stated = q * (1.0 + inverse_map.dynamic_pressure_error * random.standard_normal(SAMPLES))
    readings = samples * inverse_map.sensors.scale
    score = np.asarray(Estimator(inverse_map.without_tables()).estimate(readings, stated).envelope_score)
    limit = max(tail_quantile(score[np.isfinite(score)], FALSE_OUTSIDE), SMALLEST_LIMIT)
    return replace(inverse_map, envelope_score_limit=limit)


def _errors(problem: Problem, solution: Solution, rows: IntArray, random: np.random.Generator) -> FloatArray:
    """Return (n, n_d) strain errors of the members ``rows``: those that follow strain at their own strain."""
    following = {error.name for error in problem.errors}
    total = np.zeros((len(rows), len(problem.strain_operator)))
    for term in solution.noise.terms:
        if term.name not in following and term.load is None:
            total += term.draw(random, len(rows))
    for error in problem.errors:
        sensitivity = error.strain[rows]
        draws = random.standard_normal((len(rows), 1 if error.common else sensitivity.shape[1]))
        total += sensitivity * draws
    return total


def tail_quantile(values: FloatArray, probability: float) -> float:
    """Return the value that is exceeded with ``probability``.

    Below ``TAIL`` it is the value of the generalised Pareto distribution with the probability-weighted moments of
    the exceedances (Hosking and Wallis, Technometrics 29, 1987): its error is a fraction of the error of the one
    or two largest values of a sample.
    """
    ordered = np.sort(values)
    n = len(ordered)
    count = int(TAIL * n)
    if probability >= TAIL or count < 20:
        return float(np.quantile(ordered, 1.0 - probability))
    level, exceedances = float(ordered[-count - 1]), ordered[-count:] - ordered[-count - 1]
    mean = float(exceedances.mean())
    rank = (np.arange(count) + 0.65) / count
    weighted = float(np.mean((1.0 - rank) * exceedances))
    if not mean > 2.0 * weighted > 0.0:
        return float(np.quantile(ordered, 1.0 - probability))
    shape = 2.0 - mean / (mean - 2.0 * weighted)
    size = 2.0 * mean * weighted / (mean - 2.0 * weighted)
    ratio = probability * n / count
    if abs(shape) < 1e-9:
        return level - size * float(np.log(ratio))
    return level + size / shape * (ratio**-shape - 1.0)
