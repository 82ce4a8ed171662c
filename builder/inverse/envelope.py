"""The envelope of a map from its flows: half-spaces of the coefficients, ranges of the flight state.

The limit of the envelope score follows from flights of the snapshots themselves, with every error drawn.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product
from math import degrees
from typing import Any

import numpy as np

from builder.inverse.ensemble import Ensemble
from builder.inverse.noise.model import NoiseTerm
from builder.inverse.solution import Problem
from builder.vehicle.map_options import MapEntry
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.atmosphere import dynamic_pressure
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.valid_ranges import CONDITION_UNITS, RECORDED_KEYS, TOTAL_INCIDENCE
from strainfmu.flight_condition import FlightCondition

ROLL_ANGLES = 24
"""Roll angles of the directions for a rolled ensemble; 1 / cos(pi / 24) lets 0.9 % of the incidence through."""

PRESSURE_SLACK = 0.01
"""Relative error of q_inf that the range of dynamic pressure allows."""

_RATIOS = (-1.0, 0.0, 1.0)


def coefficient_half_spaces(ensemble: Ensemble, coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return directions (m, 5) and limits (m,) of the half-spaces that hold the ``coefficients`` (n, 5) of all
    members of ``ensemble``.

    As listed: all 210 sign patterns of one to four coefficients in units of their spread. Rolled: what is the same
    at every roll angle, C_A and the amplitudes of the cross force and moment, combined likewise at 24 roll angles.
    """
    spread = np.ptp(coefficients, axis=0)
    if ensemble.grid is not None:
        for pair in (slice(1, 3), slice(3, 5)):
            spread[pair] = 2.0 * np.max(np.linalg.norm(coefficients[:, pair], axis=1))
    unit = np.where(spread > 1e-9 * np.max(spread), 1.0 / np.where(spread > 0.0, spread, 1.0), 0.0)
    patterns = _signs() if ensemble.grid is None else _rolled()
    direction = patterns * unit
    size = np.linalg.norm(direction, axis=1)
    direction = direction[size > 0.0] / size[size > 0.0, None]
    reach = coefficients @ direction.T if ensemble.grid is None else _reach_at_any_roll(coefficients, direction)
    return direction, np.max(reach, axis=0)


def _reach_at_any_roll(coefficients: FloatArray, direction: FloatArray) -> FloatArray:
    """Return (n, m) the largest n'C of each member over all roll angles, also those between the members'."""
    # Force and moment turn together: n'C at roll angle psi is n_A C_A + Re(z e^(i psi)).
    of_force = np.outer(coefficients[:, 1] + 1j * coefficients[:, 2], direction[:, 1] - 1j * direction[:, 2])
    of_moment = np.outer(coefficients[:, 3] + 1j * coefficients[:, 4], direction[:, 3] - 1j * direction[:, 4])
    return np.asarray(np.outer(coefficients[:, 0], direction[:, 0]) + np.abs(of_force + of_moment))


def _signs() -> FloatArray:
    """Return (210, 5) all patterns of +1 and -1 on one to four of five coefficients."""
    rows = []
    for count in range(1, 5):
        for chosen in combinations(range(5), count):
            for signs in product((1.0, -1.0), repeat=count):
                row = np.zeros(5)
                row[list(chosen)] = signs
                rows.append(row)
    return np.array(rows)


def _rolled() -> FloatArray:
    """Return (n, 5) patterns of C_A, and of the cross force and the moment along each roll angle."""
    rows = [np.array([sign, 0.0, 0.0, 0.0, 0.0]) for sign in (1.0, -1.0)]
    angles = 2.0 * np.pi * np.arange(ROLL_ANGLES) / ROLL_ANGLES
    for axial, force, moment in product(_RATIOS, (0.0, 1.0), _RATIOS):
        if force == 0.0 and moment <= 0.0:  # its opposite is another roll angle
            continue
        for angle in angles:
            c, s = np.cos(angle), np.sin(angle)
            rows.append(np.array([axial, force * c, force * s, moment * c, moment * s]))
    return np.array(rows)


def flight_ranges(entry: MapEntry, conditions: Sequence[FlightCondition]) -> dict[str, Any]:
    """Return fields of a map: the ranges of q_inf, Mach number and altitude from the flows of ``conditions``.

    In form "dynamic_pressure" the altitude is the range of map.valid_altitude_km, and q_inf what its ends and the
    Mach numbers of the flows allow; in form "absolute" both are the ranges of the snapshots.
    """
    mach = np.array([condition.mach_number for condition in conditions])
    low, high = float(mach.min()), float(mach.max())
    if entry.form == "absolute":
        pressure = np.array([condition.dynamic_pressure for condition in conditions])
        altitude = np.array([condition.altitude for condition in conditions])
        q_range = float(pressure.min()), float(pressure.max())
        heights = float(altitude.min()), float(altitude.max())
    else:
        heights = 1e3 * entry.valid_altitude_km[0], 1e3 * entry.valid_altitude_km[1]
        q_range = dynamic_pressure(low, heights[1]), dynamic_pressure(high, heights[0])
    slack = np.array([1.0 - PRESSURE_SLACK, 1.0 + PRESSURE_SLACK])
    return {
        "dynamic_pressure_range": np.array(q_range) * slack,
        "mach_number_range": np.array([low, high]),
        "altitude_range": np.array(heights),
    }


def condition_ranges(conditions: Sequence[FlightCondition]) -> dict[str, list[float]]:
    """Return minimum and maximum of each quantity over ``conditions``, by its name in a map's provenance."""
    ranges = {}
    for name, (unit, _, _) in CONDITION_UNITS.items():
        if name != TOTAL_INCIDENCE:
            values = [getattr(condition, name) for condition in conditions]
            values = [degrees(value) for value in values] if unit == "deg" else values
            ranges[RECORDED_KEYS[name]] = [min(values), max(values)]
    return ranges


def parameter_ranges(names: Sequence[str], conditions: Sequence[FlightCondition]) -> dict[str, list[float]]:
    """Return minimum and maximum of each flow parameter over ``conditions``, by its name."""
    values = zip(*(condition.parameters for condition in conditions), strict=True)
    return {
        name: [min(quantity_values), max(quantity_values)]
        for name, quantity_values in zip(names, values, strict=True)
    }


FALSE_OUTSIDE = 5e-4
"""Rate of flights inside the envelope that are taken to be outside it."""

SAMPLES, SEED = 12_000, 77
SMALLEST_LIMIT = 1.0

GAUGES_OF_ALL_SAMPLES = 512
"""Gauges whose readings of all samples are held at once; samples of more gauges are drawn in parts."""

TAIL = 0.01
"""Fraction of the sample that the tail is fitted to."""


def with_score_limit(inverse_map: InverseMap, problem: Problem, terms: Sequence[NoiseTerm]) -> InverseMap:
    """Return ``inverse_map`` with the score limit that a fraction :data:`FALSE_OUTSIDE` of the members exceeds,
    with noise of all ``terms``.

    The members are the corners of the envelope and what lies between them, so the rate holds for a flight
    programme which goes to its limits. Errors in proportion to strain are drawn at each member's strain.
    """
    random = np.random.default_rng(SEED)
    ensemble, n = problem.ensemble, len(problem.strain)
    q = np.full(n, inverse_map.nominal_dynamic_pressure)
    if inverse_map.form == "absolute":
        conditions = ensemble.conditions
        q = np.tile([condition.dynamic_pressure for condition in conditions], n // len(conditions))
    estimator, scores = Estimator(inverse_map.without_tables()), list[FloatArray]()
    samples = random.choice(n, size=SAMPLES, p=ensemble.member_weight)
    by_member = np.argsort(samples, kind="stable")  # a part has few members
    for part in np.array_split(by_member, 1 + (inverse_map.n_gauges - 1) // GAUGES_OF_ALL_SAMPLES):
        rows = samples[np.sort(part)]
        readings = (problem.strain[rows] + _errors(problem, terms, rows, random)) * inverse_map.sensors.scale
        stated = q[rows] * (1.0 + inverse_map.dynamic_pressure_error * random.standard_normal(len(rows)))
        scores.append(np.asarray(estimator.estimate(readings, stated).envelope_score))
    score = np.concatenate(scores)
    limit = max(tail_quantile(score[np.isfinite(score)], FALSE_OUTSIDE), SMALLEST_LIMIT)
    return replace(inverse_map, envelope_score_limit=limit)


def _errors(
    problem: Problem, terms: Sequence[NoiseTerm], rows: IntArray, random: np.random.Generator
) -> FloatArray:
    """Return (n, n_d) strain errors of the members ``rows``: those that follow strain at their own strain."""
    following = {error.name for error in problem.errors}
    total = np.zeros((len(rows), len(problem.strain_operator)))
    for term in terms:
        if term.name not in following and term.load is None:
            total += term.draw(random, len(rows))
    sizes, common = list[FloatArray](), list[FloatArray]()
    for error in problem.errors:
        draws = random.standard_normal((len(rows), 1 if error.common else total.shape[1]))
        if error.common:
            sizes.append(draws)
            common.append(error.strain)
        else:
            total += error.strain[rows] * draws
    if common:
        size_of_sample, by_member = np.hstack(sizes), np.argsort(rows, kind="stable")
        members, first = np.unique(rows[by_member], return_index=True)
        for member, alike in zip(members, np.split(by_member, first[1:]), strict=True):
            total[alike] += size_of_sample[alike] @ np.stack([strain[member] for strain in common])
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
