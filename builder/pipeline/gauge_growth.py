"""Growth of cost with the number of gauges: build, estimator, step, lost gauges and file of the same vehicle.

A vehicle of n gauges has n / 8 axial gauges on each of eight meridians, over the length of its own layout. A cost
that grows as n^p is a line of slope p in a double-logarithmic figure. The bound is the time to read a matrix of
n x n numbers once: a full covariance of n gauges costs as much in each step.
"""

from __future__ import annotations

import csv
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from functools import partial
from io import StringIO
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.figures.drawing import blank_figure, save
from builder.pipeline.stages import build_map
from builder.vehicle.file import Vehicle, load_vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.files import write_bytes_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COUNTS = (56, 128, 256, 512, 1024, 2048, 4096)
"""Gauges of the table, at most."""

MOST_NONLINEAR = 1024
"""Gauges up to which maps have tables of the flight state; beyond, the linear estimator alone is measured."""

MERIDIANS = 8
REPEATS = 5
"""Measurements that a median is taken of."""

STEPS = 200
"""Steps of one measurement."""


@dataclass(frozen=True, kw_only=True)
class GaugeRow:
    """What a map of so many gauges costs, in processor time [s] but for the file [MB].

    Attributes
    ----------
    gauges : their number n.
    build : structure and map of the estimators from given flows, with the theoretical alarm levels.
    load : making an :class:`~strainfmu.Estimator`.
    linear, nonlinear : a step of either estimator; of the nonlinear one not a number where it is not measured.
    one_lost, third_lost : the first step of the linear estimator without one gauge, without a third of them.
    reading : of n x n numbers, once.
    file : map.h5 [MB].
    """

    gauges: int
    build: float
    load: float
    linear: float
    nonlinear: float
    one_lost: float
    third_lost: float
    reading: float
    file: float


LABELS = {
    "build": "build",
    "load": "Estimator()",
    "linear": "step, linear",
    "nonlinear": "step, nonlinear",
    "one_lost": "first step, one lost",
    "third_lost": "first step, a third lost",
    "reading": "bound: n x n numbers read",
}
"""Lines of the figure by the fields of a row."""

UNITS = {"gauges": "1", "file": "MB"}
"""Of the columns that are no processor times."""


def bench_gauges(
    gauges: str | Path, snapshots: str | Path, growth: str | Path = "gauge_growth.csv", *, most: int = 512
) -> Iterator[GaugeRow]:
    """Yield what a vehicle's map costs with more and more gauges; write the table, and its figure next to it.

    Parameters
    ----------
    gauges : vehicle file whose gauges grow in number. Not with ``structure``, ``mesh``, ``worst``, ``peers``.
    snapshots : with ``mesh`` or ``gauges``, required: snapshots.h5 of ``strainfmu build``.
    growth : with ``gauges``: table to write (CSV), with its figure next to it (PNG).
    most : with ``gauges``: largest number of gauges.

    Raises
    ------
    InputError
        A file is missing or wrong, or the vehicle's gauges are not at stations of meridians.
    """
    path, pressure, rows = Path(gauges), load_snapshots(snapshots), list[GaugeRow]()
    build_map(with_gauges(path, COUNTS[0]), snapshots=pressure)  # compiles, or loads, all functions
    for count in COUNTS:
        if count <= most:
            rows.append(gauge_row(with_gauges(path, count), pressure))
            yield rows[-1]
    write_bytes_atomically(Path(growth), growth_csv(rows).encode())
    save(growth_figure(rows), Path(growth).with_suffix(".png"))


def with_gauges(path: Path, count: int) -> Vehicle:
    """Return the vehicle of a file with ``count`` axial gauges on eight meridians.

    They stand where its own layout begins and ends, and between.

    Raises
    ------
    InputError
        The vehicle's gauges are listed in a file, or stand at one station.
    """
    own = load_vehicle(path).gauges
    stations = [x for row in own.layouts[own.layout].rows or () for x in row.stations]
    if not stations or min(stations) == max(stations):
        raise InputError(f"{path}: gauges.{own.layout}: expected rows of gauges from one station to another")
    meridian: dict[str, Any] = {"directions": ["axial"], "count": count // MERIDIANS}
    meridian |= {"first_x_m": min(stations), "last_x_m": max(stations)}
    rows = [{"roll_angle_deg": 360.0 * k / MERIDIANS, **meridian} for k in range(MERIDIANS)]
    estimator = "nonlinear" if count <= MOST_NONLINEAR else "linear"
    changes = {"map.estimator": estimator, "map.alarm_levels": "nominal"}
    return load_vehicle(path, {f"gauges.layouts.{own.layout}.rows": rows, **changes})


def gauge_row(vehicle: Vehicle, snapshots: Snapshots) -> GaugeRow:
    """Build the map of a vehicle and measure what it costs."""
    start = time.process_time()
    inverse_map = build_map(vehicle, snapshots=snapshots)
    build = time.process_time() - start
    n, pressure, strain = inverse_map.n_gauges, inverse_map.nominal_dynamic_pressure, inverse_map.mean_strain
    linear_map = inverse_map.without_tables()

    def first_step(lost: int) -> float:
        broken = strain.copy()
        broken[:lost] = np.nan
        spent = list[float]()
        for _ in range(REPEATS):
            estimator = Estimator(linear_map)
            estimator.track(strain, pressure)
            spent.append(cost(partial(estimator.track, broken, pressure), 1))
        return median(spent)

    def step(of: InverseMap) -> float:
        estimator = Estimator(of)
        estimator.track(strain, pressure)
        return median(cost(lambda: estimator.track(strain, pressure), STEPS) for _ in range(REPEATS))

    square = np.ones((n, n))
    with tempfile.TemporaryDirectory(prefix="strainfmu_") as folder:
        file = Path(folder) / "map.h5"
        save_inverse_map(linear_map, file)
        size = file.stat().st_size
    return GaugeRow(
        gauges=n,
        build=build,
        load=median(cost(lambda: Estimator(linear_map), 1) for _ in range(REPEATS)),
        linear=step(linear_map),
        nonlinear=step(inverse_map) if inverse_map.manifold is not None else float("nan"),
        one_lost=first_step(1),
        third_lost=first_step(n // 3),
        reading=median(cost(square.sum, STEPS) for _ in range(REPEATS)),
        file=1e-6 * size,
    )


def cost(call: Callable[[], object], times: int) -> float:
    """Return the processor time of one of so many calls [s]."""
    start = time.process_time()
    for _ in range(times):
        call()
    return (time.process_time() - start) / times


def slopes(rows: Sequence[GaugeRow]) -> dict[str, float]:
    """Return the exponent p of each cost n^p, by least squares over the rows that have it; of one row none."""
    exponents, gauges = dict[str, float](), np.array([float(row.gauges) for row in rows])
    for field in fields(GaugeRow):
        values = np.array([float(getattr(row, field.name)) for row in rows])
        measured = np.isfinite(values)
        if measured.sum() > 1:
            exponents[field.name] = float(np.polyfit(np.log(gauges[measured]), np.log(values[measured]), 1)[0])
    return exponents


def growth_csv(rows: Sequence[GaugeRow]) -> str:
    """Return the rows as CSV, a line each."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f"{field.name} [{UNITS.get(field.name, 's')}]" for field in fields(GaugeRow)])
    writer.writerows([f"{value:.4g}" for value in astuple(row)] for row in rows)
    return text.getvalue()


def growth_figure(rows: Sequence[GaugeRow]) -> Figure:
    """Draw each cost over the number of gauges, in double-logarithmic axes, with its exponent."""
    figure = blank_figure(7.0, 6.0)
    axis, exponent = figure.subplots(), slopes(rows)
    n = [row.gauges for row in rows]
    for name, label in LABELS.items():
        style = {"color": "0.5", "linestyle": "--"} if name == "reading" else {"marker": "o", "markersize": 3.0}
        text = f"{label}: n^{exponent[name]:.1f}" if name in exponent else label
        axis.loglog(n, [getattr(row, name) for row in rows], label=text, **style)
    axis.set_xticks(n, [str(count) for count in n], minor=False)
    axis.set_xticks([], minor=True)
    axis.set_xlabel("gauges n [1]")
    axis.set_ylabel("processor time [s]")
    axis.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)
    return figure
