"""Every estimator of a comparison, made from the same parts and scored on the same flights."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.compare.candidate import (
    NAVIGATION,
    NO_DYNAMIC_PRESSURE,
    STATED,
    Candidate,
    LinearCandidate,
    NonlinearCandidate,
)
from builder.compare.flights import ERRORS, GAUGE_NOISE, Effort, altitudes_km, readings, with_errors
from builder.compare.random_walk import RandomWalkCandidate
from builder.compare.rivals import RIVALS, RivalCandidate
from builder.compare.score import scored
from builder.compare.training import training_flights
from builder.inverse.build import build_inverse_map
from builder.inverse.problem import AnyStructure
from builder.manifold.build import with_manifold
from builder.reporting import Progress, Reporter
from builder.trial.bound import cramer_rao_bound
from builder.truth.flights import Flights
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Flown:
    """k flights of the independent model, and their pressure (k, ..) at the nodes of the map [Pa]."""

    flights: Flights
    field: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """What every estimator of a comparison is made from and scored on.

    Attributes
    ----------
    snapshots, structure : of the maps.
    flown, example : flights of the independent model: at random, and the flights of the example.
    has_rivals : whether scikit-learn is there.
    """

    vehicle: Vehicle
    snapshots: Snapshots
    structure: AnyStructure
    flown: Flown
    example: Flown | None
    effort: Effort
    has_rivals: bool


def all_entries(trial: Trial, reporter: Reporter) -> list[dict[str, Any]]:
    """Return the entries of every estimator under both kinds of error; no rivals without scikit-learn.

    Raises
    ------
    InputError
        The flows of the map do not suffice for tables.
    """
    effort = trial.effort
    entries: list[dict[str, Any]] = []
    for number, errors in enumerate(ERRORS):
        random = np.random.default_rng([effort.seed, number])
        with reporter.stage(f"Estimators, {errors}: maps and training") as progress:
            candidates = candidates_of(trial=trial, errors=errors, random=random, progress=progress)
        found: list[dict[str, Any]] = []
        with reporter.stage(f"Estimators, {errors}: flights") as progress:
            scores = _scores_of(
                trial=trial,
                errors=errors,
                candidates=candidates,
                flown=trial.flown,
                draws=effort.draws,
                random=random,
            )
            for done, after_draw in enumerate(scores, start=1):
                found = after_draw
                progress(done, effort.draws)
        example = _example_fields(trial, errors, candidates)
        for one in found:
            of_example = example.get((one["estimator"], one["air_data_inputs"]))
            entries.append(
                {
                    "estimator": one["estimator"],
                    "errors": errors,
                    **one,
                    "example_field_p95_percent": of_example,
                }
            )
    return entries


def _scores_of(
    *,
    trial: Trial,
    errors: str,
    candidates: list[tuple[Candidate, str]],
    flown: Flown,
    draws: int,
    random: np.random.Generator,
) -> Iterator[list[dict[str, Any]]]:
    """Return the entries of ``candidates`` after every draw."""
    first = candidates[0][0]
    assert isinstance(first, LinearCandidate)
    read = readings(
        vehicle=trial.vehicle,
        flights=flown.flights,
        errors=errors,
        noise_std=first.inverse_map.noise_std,
        draws=draws,
        random=random,
    )
    bounds = _bounds(errors, candidates, flown.flights)
    return scored(candidates=candidates, read=read, flights=flown.flights, true_field=flown.field, bounds=bounds)


def _bounds(errors: str, candidates: list[tuple[Candidate, str]], flights: Flights) -> dict[str, FloatArray]:
    """Return the Cramer-Rao bound (k, 5) of ``flights`` by navigation, of the nonlinear estimator's tables."""
    tables = next(one.estimator.inverse_map for one, _ in candidates if isinstance(one, NonlinearCandidate))
    std = 0.0 if errors == GAUGE_NOISE else np.nan
    found = {name: cramer_rao_bound(tables, flights.conditions, known, std) for name, known in STATED.items()}
    return {name: bound for name, bound in found.items() if bound is not None}


def _example_fields(
    trial: Trial, errors: str, candidates: list[tuple[Candidate, str]]
) -> dict[tuple[str, str], float]:
    """Return the 95th percentile of the field error [%] at the example, of every estimator with a field."""
    if errors != GAUGE_NOISE or trial.example is None:
        return {}
    found = _scores_of(
        trial=trial,
        errors=errors,
        candidates=[(one, navigation) for one, navigation in candidates if one.has_field],
        flown=trial.example,
        draws=1,
        random=np.random.default_rng([trial.effort.seed, len(ERRORS)]),
    )
    return {(one["estimator"], one["air_data_inputs"]): one["field_p95_percent"] for one in next(found)}


def candidates_of(
    trial: Trial, errors: str, random: np.random.Generator, progress: Progress
) -> list[tuple[Candidate, str]]:
    """Return every estimator with each navigation, linear maps first, all of them knowing of ``errors``."""
    of, rivals = 4 + len(NAVIGATION) * len(RIVALS) * trial.has_rivals, RIVALS if trial.has_rivals else {}
    of_case = {case: with_errors(trial.vehicle, errors, case) for case in (1, 2)}
    maps = {case: build_inverse_map(one, trial.snapshots, trial.structure) for case, one in of_case.items()}
    progress(2, of)
    full = with_manifold(
        inverse_map=maps[1], vehicle=of_case[1], snapshots=trial.snapshots, structure=trial.structure
    )
    manifold = NonlinearCandidate(full)
    known: list[Candidate] = [
        LinearCandidate("linear Case 1", maps[1]),
        LinearCandidate("linear Case 2", maps[2]),
        manifold,
        RandomWalkCandidate(maps[2]),
    ]
    found = [(one, navigation) for one in known for navigation in NAVIGATION]
    found.append((manifold, NO_DYNAMIC_PRESSURE))
    progress(4, of)
    assert full.manifold is not None
    count = trial.effort.training
    training, calibration = (
        training_flights(manifold=full.manifold, altitudes_km=altitudes_km(trial.vehicle), count=n, random=random)
        for n in (count, count // 3)
    )
    for done, (name, navigation) in enumerate(
        ((name, navigation) for name in rivals for navigation in NAVIGATION), start=5
    ):
        rival = RivalCandidate(
            name=name,
            training=training,
            calibration=calibration,
            navigation=navigation,
            seed=trial.effort.seed,
        )
        found.append((rival, navigation))
        progress(done, of)
    return found
