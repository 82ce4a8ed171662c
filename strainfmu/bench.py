"""How long one step takes, and what of it is the mathematics."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

from strainfmu.cosim.master import simulate
from strainfmu.cosim.system import System
from strainfmu.estimator import Estimator
from strainfmu.inverse_map import load_inverse_map


def bench_loop(map_path: Path, fmu_path: Path) -> dict[str, float]:
    """Return the time per step [s] of the bare product, the numpy estimator and the FMU through fmpy.

    Raises
    ------
    InputError
        A file is missing or damaged.
    """
    inverse_map = load_inverse_map(map_path)
    estimator = Estimator(inverse_map)
    n = inverse_map.n_gauges
    rows = inverse_map.load_per_state @ inverse_map.strain_gain
    strain = inverse_map.mean_strain.copy()
    out = np.empty(5)
    pressure = inverse_map.nominal_dynamic_pressure
    record = [f"estimator.{name}" for name in ("C_A", "C_N", "C_Y", "M_P", "M_Y")]
    start = {f"estimator.strain[{i + 1}]": float(value) for i, value in enumerate(strain)}
    flown = simulate(System({"estimator": fmu_path}, start_values=start), 2.0, 1e-3, record=record)
    return {
        f"bare product 5 x {n}, numpy": time_per_call(lambda: np.dot(rows, strain, out=out)),
        f"Estimator.estimate, {n} gauges, health on": time_per_call(lambda: estimator.estimate(strain, pressure)),
        f"FMU through fmpy, step and read 5 of {n} inputs' coefficients": float(np.median(flown.step_cost)),
    }


def time_per_call(call: Callable[[], object], repeats: int = 30, calls: int = 500) -> float:
    """Return the median over ``repeats`` of the mean time of ``calls`` calls [s]."""
    for _ in range(calls):
        call()
    means = []
    for _ in range(repeats):
        start = perf_counter()
        for _ in range(calls):
            call()
        means.append((perf_counter() - start) / calls)
    return median(means)
