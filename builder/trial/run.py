"""A trial, run: each case flown, estimated by each estimator, scored; what is done is kept and not done again.

Draws follow from the name of a case, so that rows next to it change nothing. A worker makes its world once.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from builder.campaign.dask_workers import on_dask
from builder.reporting import Reporter
from builder.trial.cases import Case, Plan
from builder.trial.conditions import quantities
from builder.trial.estimators import EstimateReadings, Estimates, of_estimator, of_map, together
from builder.trial.faults import Lost, NoSuchGaugesError
from builder.trial.readings import (
    ANGLES,
    Readings,
    World,
    joined,
    read_case,
    read_motion,
    read_own_vehicles,
)
from builder.trial.score import ALL, NONE, ROLLING, Row, judged, rms_ratios, rows_of
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError, StrainfmuError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.files import fingerprint, kept_json, write_bytes_atomically

VERSION = 10
"""Raised whenever scores change otherwise than by their inputs, so that they are made again."""

TENTHS = 10

WORKER_MEMORY = "8 GiB"
"""At which a worker is stopped. What all ground tests of a trial share takes 4.3 GiB."""

FILTER = "filter"
"""Name of the estimator of a case whose flights last for a while."""


MakeEstimators = Callable[[Any, Case, Sequence[str]], dict[str, EstimateReadings]]
"""Returns estimators by name, of a world and a case."""

Score = Callable[[Any, Case, Plan], dict[str, list[Row]]]
"""Returns the rows of a case by estimator, of a world."""


def estimators_for(world: World, case: Case, names: Sequence[str]) -> dict[str, EstimateReadings]:
    """Return the estimators of ``names`` for ``case``; a filter alone where a flight lasts for a while."""
    how = case.over_time
    if how is None:
        return {name: of_map(world.inverse_map, name) for name in names}
    noise, n_d = float(np.mean(world.gauges.noise_std)), len(world.gauges.station)
    zeros = GaugeZeros(value=np.zeros(n_d), std=np.full(n_d, how.zero * noise), common_std=how.common_zero * noise)
    estimator = Estimator(world.inverse_map).with_zeros(zeros).filter(how.time_constant)
    return {FILTER: of_estimator(estimator)}


def readings_of(
    world: World, case: Case, plan: Plan, random: np.random.Generator | None = None
) -> Iterator[Readings]:
    """Yield what vehicles read in a case, in batches."""
    random = random or np.random.default_rng([world.seed, crc32(case.name.encode())])
    if case.lost is not None:
        every = joined(list(readings_of(world, case.model_copy(update={"lost": None}), plan, random)))
        yield from with_lost_gauges(world, case.lost, every, random)
        return
    count = max(1, round(plan.vehicles * case.draws))
    if case.motion is not None:
        yield from (read_motion(world, case, number, random) for number in range(count))
        return
    is_frozen = case.fault is not None and case.fault.frozen  # at the strain of another flight
    if not is_frozen and world.sensors is None:
        yield from read_own_vehicles(world, case, world.flights(case), count, random)
        return
    flights = world.flights(case)
    yield from (read_case(world, case, flights, number=number, random=random) for number in range(count))


def with_lost_gauges(world: World, lost: Lost, read: Readings, random: np.random.Generator) -> Iterator[Readings]:
    """Yield readings without the gauges of each set, the next samples for each; from the first again after the
    last."""
    count, first = min(lost.samples or len(read.strain), len(read.strain)), 0
    axial = np.abs(world.inverse_map.gauge_direction[:, 0]) > np.sqrt(0.5)
    for name, used in lost.in_use(world.gauges.row, axial, random).items():
        part = read.rows(slice(first, first + count))
        yield replace(part, strain=np.where(used, part.strain, np.nan), name=name)
        first = first + count if first + 2 * count <= len(read.strain) else 0


def scored(
    world: World, case: Case, plan: Plan, make_estimators: MakeEstimators = estimators_for
) -> dict[str, list[Row]]:
    """Return the rows of one case by estimator."""
    estimators = make_estimators(world, case, plan.estimators)
    read, parts = list[Readings](), {name: list[Estimates]() for name in estimators}
    for batch in readings_of(world, case, plan):
        for name, estimate in estimators.items():
            parts[name].append(estimate(batch))
        # Strain is needed no more, but for a flight in time.
        none = np.empty((len(batch.strain), 0))
        read.append(batch if case.motion is not None else replace(batch, strain=none, time=None))
    every, sixth = joined(read), (ROLLING,) if case.motion is None else ANGLES
    estimates, rows = {name: together(made) for name, made in parts.items()}, dict[str, list[Row]]()
    single = cache(partial(_of_single, world, read))
    for name, made in estimates.items():
        bound = world.bound(case, name)
        bounded = every if bound is None else replace(every, bound=bound[every.flight])
        rows[name] = rows_of((*COEFFICIENT_NAMES, *sixth)[: made.value.shape[1]], made, bounded)
        if case.lost is not None:
            add_worst_set(rows[name], parts[name], read)
        if case.motion is not None:
            middle, of_single = single(name.partition(" ")[0])
            ratios = rms_ratios(made.value - middle, of_single - middle, every)
            for row, (ratio, _) in zip(rows[name][1:], ratios, strict=True):
                row["over_single"] = ratio
    return {
        name: labelled(case, name, of_name) + _tenths(case, name, estimates[name], every)
        for name, of_name in rows.items()
    }


def _tenths(case: Case, estimator: str, made: Estimates, read: Readings) -> list[Row]:
    """Return a row of all loads for each tenth of the flights by each quantity that ``case`` names."""
    rows = []
    for quantity in case.tenths_by:
        order = np.argsort(quantities(read.conditions, quantity), kind="stable")
        for number, flights in enumerate(np.array_split(order, min(TENTHS, len(order))), start=1):
            part = np.flatnonzero(np.isin(read.flight, flights))
            row, *loads = rows_of(COEFFICIENT_NAMES, made.rows(part), read.rows(part))
            rms = {f"rms_{load['load']}": load["rms"] for load in loads[: len(COEFFICIENT_NAMES)]}
            rows.append({**row, **rms, "load": f"{ALL}, tenth {number} by {quantity}"})
    return [{**row, "verdict": NONE, "why": ""} for row in labelled(case, estimator, rows)]


def add_worst_set(rows: list[Row], made: Sequence[Estimates], read: Sequence[Readings]) -> None:
    """Add the set of readings with the smallest coverage of each load, and the coverage [%], to ``rows``."""
    names = [row["load"] for row in rows[1:]]
    of_sets = [rows_of(names, *both) for both in zip(made, read, strict=True)]
    for number, row in enumerate(rows):
        covered = [np.nan_to_num(of_set[number]["covered_percent"], nan=100.0) for of_set in of_sets]
        worst = int(np.argmin(covered))
        row |= {"sets": len(read), "worst_set_percent": float(covered[worst]), "worst_set": read[worst].name}


def _of_single(world: World, read: Sequence[Readings], name: str) -> tuple[FloatArray, FloatArray]:
    """Return (n, m) what errors of flights in time are counted from, and the estimates of single samples.

    They count from the estimates without noise, where there are some: what noise alone adds. Errors of the map are
    no part of it, and no average reduces them. Otherwise they count from the truth.
    """
    estimate = of_map(world.inverse_map, name)
    single = together([estimate(part) for part in read]).value
    quiet = [estimate(replace(part, strain=part.quiet)) for part in read if part.quiet is not None]
    return together(quiet).value if quiet else joined(read).truth[:, : single.shape[1]], single


def labelled(case: Case, estimator: str, rows: list[Row]) -> list[Row]:
    """Return ``rows`` with case, estimator and verdict."""
    verdict, why = judged(case, rows)
    head = {
        "case": f"{case.error}, {case.size}".removesuffix(", "),
        "error": case.error,
        "size": case.size,
        "class": case.group,
        "estimator": estimator,
    }
    return [{**head, **row, "verdict": verdict, "why": why} for row in rows]


@dataclass(frozen=True, kw_only=True)
class Task:
    """What a worker needs: the case, how it is flown, a function that makes the world, and one that returns the
    rows of the case there; it imports both. ``key`` names the file of the rows, ``world`` the world."""

    key: str
    world: str
    case: Case
    plan: Plan
    make_world: Callable[[], Any]
    score: Score = scored


Refused = tuple[type[StrainfmuError], ...]
"""Errors that leave a task out; other tasks go on."""

BEYOND: Refused = (FlowReachError, NoSuchGaugesError)
"""The flows do not reach a case, or there are no such gauges to lose."""


_WORLD = dict[str, Any]()
"""The last world of a worker, by its name."""


def run_task(task: Task, refused: Refused = BEYOND) -> tuple[Task, list[Row] | str]:
    """Return the rows of a task, or the line of an error that is ``refused``."""
    try:
        if task.world not in _WORLD:
            _WORLD.clear()
            _WORLD[task.world] = task.make_world()
        rows = task.score(_WORLD[task.world], task.case, task.plan)
    except refused as error:
        return task, "; ".join(str(error).splitlines())
    return task, [row for of_estimator in rows.values() for row in of_estimator]


def tasks_of(
    cases: Sequence[Case], plan: Plan, make_world: Callable[[], Any], inputs: dict[str, Any], score: Score = scored
) -> list[Task]:
    """Return the tasks of ``cases`` in one world, which is made from ``inputs``."""
    entries = {"version": VERSION, "plan": plan.model_dump(), **inputs}
    return [
        Task(
            key=fingerprint({**entries, "case": case.model_dump()}),
            world=fingerprint(entries),
            case=case,
            plan=plan,
            make_world=make_world,
            score=score,
        )
        for case in cases
    ]


def run_tasks(
    tasks: Sequence[Task],
    folder: Path,
    reporter: Reporter,
    *,
    title: str = "Cases",
    refused: Refused = BEYOND,
    workers: int = 1,
    scheduler: str | None = None,
    memory: str = WORKER_MEMORY,
) -> list[list[Row] | str]:
    """Return the rows of each task, or why it is left out; the ones whose rows are in ``folder`` are not done
    again.

    ``workers`` are local processes of ``memory`` each, ``scheduler`` is the address of a Dask scheduler whose
    workers share the files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = {task.key: folder / f"{task.key}.json" for task in tasks}
    todo, lines = [task for task in tasks if kept_json(files[task.key]) is None], dict[str, str]()
    run = partial(run_task, refused=refused)
    with reporter.stage(title if len(todo) == len(tasks) else f"{title}: {len(todo)} of {len(tasks)}") as progress:
        if not todo or (workers == 1 and scheduler is None):
            results: Iterator[tuple[Task, list[Row] | str]] = map(run, todo)
        else:
            results = on_dask(run, todo, scheduler, workers, reporter.note, memory)
        for number, (task, rows) in enumerate(results, start=1):
            if isinstance(rows, str):
                lines[task.key] = rows
            else:
                write_bytes_atomically(files[task.key], json.dumps(rows, default=float).encode())
            progress(number, len(todo))
    return [
        lines[key] if key in lines else json.loads(path.read_text(encoding="utf-8")) for key, path in files.items()
    ]
