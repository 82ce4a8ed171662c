"""Rows of ground tests: what the calibration says of them, and how the maps that follow fly.

Every vehicle brings estimators of its own. An estimator is named by the kind of its map and what is known of the
vehicle: "nonlinear" after the test, "nonlinear, known exactly", "nonlinear, before the test". "load equations" are
regressions on the readings of the test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from builder.aero.loads.operator import coefficient_scales_at
from builder.calibration.after_test.calibrated_map import remaining_after
from builder.calibration.after_test.left_by_test import Remaining, left_by_test
from builder.calibration.estimate.load_equations import load_equations
from builder.calibration.estimate.vehicle import Estimate
from builder.calibration.score.ground_world import BEFORE, EXACT, MAPS, GroundWorld
from builder.calibration.score.tested import Said, Tested, tested
from builder.trial.cases import Case, Plan
from builder.trial.estimators import Estimates, of_map, together
from builder.trial.ground import GroundTest
from builder.trial.readings import Readings, joined, navigation_at
from builder.trial.rules import NONE
from builder.trial.run import add_worst_set, labelled
from builder.trial.score import Clusters, Row, rows_of
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap

EQUATIONS = "load equations"

TEST, CALIBRATION = "test", "calibration"
"""Stand for load and estimator in the row of what the calibration says."""

COVERED = 99.0
"""Percent of the samples of a vehicle of which each load must be within 3 sigma."""


def refuse_unknown(names: Sequence[str]) -> None:
    """Refuse estimators that there are not."""
    known = [*MAPS, *(f"{kind}, {state}" for kind in MAPS for state in (EXACT, BEFORE)), EQUATIONS]
    if unknown := [name for name in names if name not in known]:
        raise InputError(f"estimators: expected {', '.join(known)}; got '{unknown[0]}'")


def ground_rows(world: GroundWorld, case: Case, plan: Plan) -> dict[str, list[Row]]:
    """Return what is said of the tests of a case, and the rows of each estimator where a test is accepted."""
    said, entry = list[Said](), case.ground or GroundTest()
    read, parts = list[Readings](), {name: list[Estimates]() for name in plan.estimators}
    for number in range(plan.seed, plan.seed + plan.vehicles):
        test, covered = tested(world, entry, number), 100.0
        if test.estimate is not None:
            flown = {name: estimates_of(world, test, test.estimate, name) for name in plan.estimators}
            for name, (_, made) in flown.items():
                parts[name].append(made)
            read.append(next(iter(flown.values()))[0])
            of_maps = [rows_of(COEFFICIENT_NAMES, flown[name][1], read[-1])[1:] for name in MAPS if name in flown]
            covered = min((row["covered_percent"] for rows in of_maps for row in rows), default=covered)
        said.append(replace(test.said, silent=not test.said.named and covered < COVERED))
    row = {"load": TEST, "samples": len(said), "vehicles": len(said), **row_of(said)}
    rows = {CALIBRATION: [{**one, "verdict": NONE, "why": ""} for one in labelled(case, CALIBRATION, [row])]}
    if not read:
        return rows
    every, whole = joined(read), {name: together(made) for name, made in parts.items()}
    for name, made in whole.items():
        of_name = rows_of(COEFFICIENT_NAMES, made, every)
        add_worst_set(of_name, parts[name], read)
        kind = next(iter(MAPS)) if name == EQUATIONS else name.partition(", ")[0]
        exact = whole.get(f"{kind}, {EXACT}", made)
        if exact is not made:
            add_over_exact(of_name[1:], made, exact, every)
        rows[name] = labelled(case, name, of_name)
    return rows


def estimates_of(world: GroundWorld, test: Tested, estimate: Estimate, name: str) -> tuple[Readings, Estimates]:
    """Return what a vehicle reads in flight, zeros taken off as far as they are known, and estimates of it by the
    estimator ``name``."""
    kind, _, state = name.partition(", ")
    built = test.built
    if state == EXACT:
        key = built.vector.tobytes(), kind
        if key not in world.exact:
            known = Remaining(parameters=built, covariance=np.zeros((len(built.vector),) * 2))
            world.exact[key] = _flown(world, test, world.map_of(kind, world.vehicles.on_map, known), built.zero)
        return world.exact[key]
    if state == BEFORE:
        return _flown(world, test, world.drawing(kind), built.zero)
    if kind == EQUATIONS:
        read = readings_of(world, test, world.drawing(next(iter(MAPS))).noise_std, estimate.parameters.zero)
        return read, _by_equations(world, estimate, read)
    remaining = remaining_after(estimate)
    left = left_by_test(world.structure, remaining, world.ensemble)
    inverse_map = world.map_of(kind, world.structure, remaining, left)
    return _flown(world, test, inverse_map, estimate.parameters.zero)


def _flown(
    world: GroundWorld, test: Tested, inverse_map: InverseMap, zero: FloatArray
) -> tuple[Readings, Estimates]:
    read = readings_of(world, test, inverse_map.noise_std, zero)
    return read, of_map(inverse_map)(read)


def readings_of(world: GroundWorld, test: Tested, noise_std: FloatArray, zero: FloatArray) -> Readings:
    """Return what a vehicle reads with several draws of noise in each flight, less ``zero`` (n_d,) [m/m]."""
    flights, draws, built = world.flights, world.options.draws, test.built
    strain = flights.pressure @ world.vehicles.structure.strain_operator(built).T + (built.zero - zero)
    every, random = np.repeat(strain, draws, axis=0), np.random.default_rng([test.number, 42])
    known = navigation_at(flights.conditions)
    known[DYNAMIC_PRESSURE] = np.array([one.dynamic_pressure for one in flights.conditions])
    return Readings(
        strain=every + noise_std * random.standard_normal(every.shape),
        known={name: np.repeat(value, draws) if np.ndim(value) else value for name, value in known.items()},
        truth=np.repeat(flights.coefficients, draws, axis=0),
        vehicle=np.full(len(every), test.number),
        flight=np.repeat(np.arange(len(strain)), draws),
        conditions=flights.conditions,
        name=f"vehicle {test.number}",
    )


def _by_equations(world: GroundWorld, estimate: Estimate, read: Readings) -> Estimates:
    """Return the estimates of regression load equations; their sigma is the regression's."""
    reference = world.vehicle.reference_quantities()
    equations = load_equations(estimate, reference.moment_station)
    scale = coefficient_scales_at(read.conditions, reference)[read.flight]
    load = np.column_stack([equation.value(read.strain) for equation in equations])
    std = np.array([equation.residual_std for equation in equations])
    return Estimates(value=load * scale, std=scale * std)


def add_over_exact(rows: Sequence[Row], made: Estimates, exact: Estimates, read: Readings) -> None:
    """Add the rms error of each load over the one of the exactly known vehicle, and its error, to ``rows``."""
    clusters = Clusters(read.vehicle, read.flight)
    square, of_exact = ((one.value - read.truth) ** 2 for one in (made, exact))
    for column, row in enumerate(rows):
        mean, of_mean = float(np.mean(square[:, column])), float(np.mean(of_exact[:, column]))
        ratio = mean / of_mean
        _, error = clusters.mean(square[:, column] - ratio * of_exact[:, column])
        row |= {"over_exact": np.sqrt(ratio), "over_exact_error": error / (2.0 * np.sqrt(ratio) * of_mean)}


def row_of(said: Sequence[Said]) -> Row:
    """Return how often the calibration says what [%]."""
    clusters = Clusters(np.arange(len(said)))

    def every(name: str) -> FloatArray:
        return np.array([float(getattr(one, name)) for one in said])

    refused, named, gauges, cases = (every(name) for name in ("refused", "named", "gauges_blamed", "cases_blamed"))
    return {
        **clusters.percent("refused", refused > 0.0),
        **clusters.percent("named", named > 0.0),
        **clusters.percent("refused_or_named", refused + named > 0.0),
        **clusters.percent("silent", every("silent") > 0.0),
        **clusters.percent("blamed", gauges + cases > 0.0),
        "gauges_blamed_percent": 100.0 * float(gauges.mean()),
        "cases_blamed_percent": 100.0 * float(cases.mean()),
        "chi_square_per_reading": clusters.mean(np.where(refused > 0.0, np.nan, every("per_reading")))[0],
    }
