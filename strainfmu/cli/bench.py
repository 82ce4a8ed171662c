"""Benchmark of one step: the mathematics, the estimator from Python, and FMUs of every kind."""

from collections.abc import Callable
from itertools import count
from os import PathLike
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.systems.master import matching_connections, simulate
from strainfmu.cosim.systems.system import System
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.gain import load_gain
from strainfmu.fmu.checks.step_cost import step_costs

STOP_TIME = 2.0
COMMUNICATION_STEP_SIZE = 1e-3

SERIES, FLIGHTS = 200_000, 2_000
"""Samples of the series that are estimated in one call, by the linear and the nonlinear estimator."""

FILTER_TIME_CONSTANT, TIME_STEP = 1.0, 0.01
"""Of the filtered steps [s]."""

FEWEST_CALLS, LONGEST_REPEAT = 50, 0.05
"""Calls that a mean is taken of at least; time [s] after which no more are added."""

FEWEST_REPEATS, LONGEST = 3, 2.0
"""Means that a median is taken of at least; time [s] after which no more are added."""

LOST = 3
"""Gauges that fail, the first ones, where the cost of a step without some is timed."""


def bench(folder: str | PathLike[str] = "demo") -> dict[str, float]:
    """Time the steps of the estimator: in Python, and as FMUs through fmpy.

    The table compares each with the bare product of matrix and strains. With the extra ``rivals``, it includes
    learning estimators of scikit-learn.

    One other measurement is chosen by an option:

    ``worst``: the slowest steps of the native FMUs, such as the loss of gauges or a changed zero offset, and steps
    with events at random.

    ``peers``: other programs at the same work, each with its version, or the reason why it is left out.

    ``mesh``: errors due to the mesh of the structure, in gauge strains and in a map built on each mesh.

    ``structure``: time and memory of the three-dimensional structure, size by size.

    ``gauges``: what the same vehicle costs with more and more gauges.

    On the command line::

        strainfmu bench demo
        strainfmu bench --structure my_vehicle.toml --solver cyclic --solver superlu
        strainfmu bench --mesh my_vehicle.toml --snapshots results/snapshots.h5
        strainfmu bench demo --worst
        strainfmu bench demo --peers
        strainfmu bench --gauges my_vehicle.toml --snapshots results/snapshots.h5

    Parameters
    ----------
    folder : folder of a finished demo: its map and its FMUs are timed.

    Raises
    ------
    InputError
        A file is missing or damaged.
    """
    map_path, plant_path, estimator_path = (
        Path(folder) / name for name in ("map.h5", "plant.fmu", "estimator.fmu")
    )
    inverse_map = load_inverse_map(map_path)
    estimator = Estimator(inverse_map.without_tables())
    n = inverse_map.n_gauges
    rows = load_gain(inverse_map)[FIVE_LOADS]
    strain, pressure = inverse_map.mean_strain, inverse_map.nominal_dynamic_pressure
    broken = strain.copy()
    broken[: min(LOST, n - 1)] = np.nan
    noise = np.random.default_rng(0).normal(size=(SERIES, n)) * inverse_map.noise_std
    series = strain + noise
    out = np.empty(len(COEFFICIENT_NAMES))
    fmus = {"plant": plant_path, "estimator": estimator_path}
    flown = simulate(
        System(fmus, matching_connections("plant", "estimator", fmus)),
        STOP_TIME,
        COMMUNICATION_STEP_SIZE,
        record=[f"estimator.{name}" for name in COEFFICIENT_NAMES],
    )
    cost = dict(zip(flown.instances, np.median(flown.step_cost, axis=0).tolist(), strict=True))
    return {
        f"bare product 5 x {n}, numpy": time_per_call(lambda: np.dot(rows, strain, out=out)),
        f"Python, linear, {n} gauges, with health": time_per_call(lambda: estimator.track(strain, pressure)),
        f"Python, linear, {LOST} gauges lost": time_per_call(lambda: estimator.track(broken, pressure)),
        f"Python, linear, {SERIES:,} samples in one call on all processors, per sample": time_per_call(
            lambda: estimator.estimate(series, pressure), repeats=10, calls=1
        )
        / SERIES,
        **_flight_costs(inverse_map, series, pressure),
        f"estimator FMU in the demo's simulation: set {n + 1}, step, get {len(out)}": cost["estimator"],
        f"plant FMU: step, get {n + 1}": cost["plant"],
        **step_costs(map_path, time_per_call),
    }


def _flight_costs(inverse_map: InverseMap, series: FloatArray, pressure: float) -> dict[str, float]:
    """Return the time per step [s] of the nonlinear estimator; none of a map without tables."""
    if inverse_map.manifold is None:
        return {}
    estimator, some = Estimator(inverse_map), series[:FLIGHTS]
    filtered, times = estimator.filter(FILTER_TIME_CONSTANT), count()
    in_one_call = {
        "each by itself, on all processors": lambda: estimator.estimate(some, pressure),
        "tracked": lambda: estimator.track(some, pressure),
    }
    return {
        "Python, nonlinear, from the last flight state": time_per_call(
            lambda: estimator.track(series[0], pressure)
        ),
        "Python, nonlinear, filtered": time_per_call(
            lambda: filtered.track(series[0], pressure, time=TIME_STEP * next(times))
        ),
        **{
            f"Python, nonlinear, {FLIGHTS:,} samples in one call {how}, per sample": (
                time_per_call(call, repeats=3, calls=1) / FLIGHTS
            )
            for how, call in in_one_call.items()
        },
    }


def time_per_call(
    call: Callable[[], object],
    repeats: int = 30,
    calls: int = 500,
    clock: Callable[[], float] = perf_counter,
) -> float:
    """Return the median over ``repeats`` of the mean time of ``calls`` calls [s], or of fewer that take long."""
    start, counted = clock(), 0
    while counted < calls and (counted < FEWEST_CALLS or clock() - start < LONGEST_REPEAT):
        call()
        counted += 1
    means: list[float] = []
    first = clock()
    while len(means) < repeats and (len(means) < FEWEST_REPEATS or clock() - first < LONGEST):
        start = clock()
        for _ in range(counted):
            call()
        means.append((clock() - start) / counted)
    return median(means)
