"""False alarms of a map, counted on flights of the independent model with all errors drawn.

Every sample is of a vehicle of its own, at one of many flight conditions; seeds are not those that the alarm
levels were set with. FLOWS may be ``independent_flows.h5`` of the map, which its levels were set on, or others,
such as ``stress_flows.h5`` of `strainfmu stress`, whose flows are at other Mach numbers and incidences.

    python -m builder.stress.false_alarms VEHICLE MAP FLOWS --samples 1000000
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from scipy.special import chdtri

from builder.pipeline.progress_bars import ConsoleReporter
from builder.reporting import Progress
from builder.stress.run import vehicle_and_flows
from builder.trial.alarm_levels import alarm_ratios, ratios_and_health
from builder.trial.readings import ReadFlights, read_flights
from builder.trial.vehicles import drawn_vehicles
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure, true_structure
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import wrong_estimator
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map

CONDITIONS, VEHICLES = 1000, 50
"""Flight conditions of a block, and vehicles as built that fly at each."""

TESTS = ("chi-square", "largest |z|", "shapes")


@dataclass(frozen=True, kw_only=True)
class FalseAlarms:
    """How many of ``samples`` good samples raised an alarm.

    Attributes
    ----------
    strain : by any of the tests of the strain, whose rate is the stated one.
    each : by each test, and by navigation or ranges (the health states DEGRADED and OUTSIDE).
    """

    samples: int
    strain: int
    each: dict[str, int]

    @property
    def rate(self) -> float:
        """Rate of the tests of the strain."""
        return self.strain / self.samples

    def interval(self) -> tuple[float, float]:
        """Return the rates between which that of endless samples is with 95 %, were they independent (Garwood
        1936)."""
        low = 0.5 * float(chdtri(2 * self.strain, 0.975)) if self.strain else 0.0
        return low / self.samples, 0.5 * float(chdtri(2 * self.strain + 2, 0.025)) / self.samples

    def lines(self) -> list[str]:
        """Return a table."""
        low, high = self.interval()
        times = self.rate / FALSE_ALARM_PROBABILITY
        rows = [f"{'alarms of':32s}{'samples':>9s}{'rate':>10s}"]
        for name, count in {"strain, any test": self.strain, **self.each}.items():
            rows.append(f"{name:32s}{count:9d}{count / self.samples:10.2g}")
        return [
            *rows,
            f"{self.samples} samples; stated {FALSE_ALARM_PROBABILITY:g}, found {times:.2f} times that "
            f"(95 %: {low / FALSE_ALARM_PROBABILITY:.2f} to {high / FALSE_ALARM_PROBABILITY:.2f})",
        ]


def false_alarms(
    inverse_map: InverseMap,
    vehicle: Vehicle,
    structure: TrueStructure,
    table: FlowTable,
    *,
    samples: int,
    seed: int = 1,
    search: bool = False,
    progress: Progress | None = None,
) -> FalseAlarms:
    """Count the false alarms of ``inverse_map`` on ``samples`` at least, in whole blocks of 50,000, or of fewer.

    A map of the nonlinear estimator is tried as it steps, from the state of the flight, or by a ``search``
    of its tables, which takes about seven times as long.

    Raises
    ------
    InputError
        ``table`` does not cover the map, or the Fourier model cannot do the vehicle.
    """
    fly = partial(drawn_vehicles, vehicle, structure, table)
    conditions = min(CONDITIONS, max(1, samples // VEHICLES))
    blocks = -(-samples // (conditions * VEHICLES))
    flown, strain, each = 0, 0, Counter[str]()
    for block in range(blocks):
        flights = read_flights(
            inverse_map, vehicle, table, fly, seed=[seed, block], vehicles=VEHICLES, conditions=conditions
        )
        ratios, health = _tests(inverse_map, flights, search)
        above = ratios > 1.0
        flown, strain = flown + above.shape[1], strain + int(above.any(axis=0).sum())
        each.update({name: int(row.sum()) for name, row in zip(TESTS, above, strict=False)})
        for state in (HealthState.DEGRADED, HealthState.OUTSIDE) if len(health) else ():
            each[state.name] += int(np.sum(health == state))
        if progress is not None:
            progress(block + 1, blocks)
    return FalseAlarms(samples=flown, strain=strain, each=dict(each))


def _tests(inverse_map: InverseMap, flights: ReadFlights, search: bool) -> tuple[FloatArray, IntArray]:
    """Return tests over their levels (2 or 3, n) and health (n,); none of a linear map."""
    if inverse_map.manifold is None:
        return np.stack(alarm_ratios(inverse_map, flights)), np.zeros(0, dtype=np.int64)
    return ratios_and_health(inverse_map, flights, search=search)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m builder.stress.false_alarms",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("vehicle", type=Path, help="vehicle file of the map")
    parser.add_argument("map", type=Path, help="map.h5")
    parser.add_argument("flows", type=Path, help="flows of the independent model")
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--estimator", metavar="linear|nonlinear", help="linear: the linear estimator of a map that includes both"
    )
    parser.add_argument("--search", action="store_true", help="find each flight from the tables alone")
    options = parser.parse_args()
    if options.samples < 1 or options.seed < 0:
        raise InputError("expected --samples from 1 on and --seed from 0 on")
    if options.estimator is not None and (reason := wrong_estimator(options.estimator)) is not None:
        raise InputError(f"--estimator: {reason}")
    inverse_map = load_inverse_map(options.map)
    if options.estimator == "nonlinear" and inverse_map.manifold is None:
        raise InputError(f"{options.map}: holds no tables of the nonlinear estimator")
    if options.estimator == "linear":
        inverse_map = inverse_map.without_tables()
    vehicle, table = vehicle_and_flows(options.vehicle, inverse_map, options.map, options.flows)
    structure, reporter = true_structure(vehicle), ConsoleReporter(Console())
    with reporter.stage("Flights of the independent model") as progress:
        found = false_alarms(
            inverse_map,
            vehicle,
            structure,
            table,
            samples=options.samples,
            seed=options.seed,
            search=options.search,
            progress=progress,
        )
    print("\n".join(found.lines()))


if __name__ == "__main__":
    try:
        main()
    except StrainfmuError as error:
        print(f"strainfmu: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
