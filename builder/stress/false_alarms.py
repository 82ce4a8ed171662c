"""False alarms of a map, counted on flights of the independent model with all errors drawn.

Every sample is of a vehicle of its own, at one of many flight conditions: with 20 vehicles at each a million
samples are at 50,000. Rates are of all samples, and of tenths of the conditions by Mach number, total incidence,
roll angle of the flow and dynamic pressure. Seeds are not those that the alarm levels were set with. FLOWS may be
``independent_flows.h5`` of the map, which its levels were set on, or others, such as ``stress_flows.h5`` of
`strainfmu stress`, whose flows are at other Mach numbers and incidences.

    python -m builder.stress.false_alarms VEHICLE MAP FLOWS --samples 1000000 --vehicles 20
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from rich.console import Console
from scipy.special import chdtri

from builder.pipeline.progress_bars import ConsoleReporter
from builder.reporting import Progress
from builder.stress.run import vehicle_and_flows
from builder.stress.study import run_study, study_parser
from builder.trial.alarm_levels import alarm_ratios, ratios_and_health
from builder.trial.readings import VEHICLES, ReadFlights, read_flights
from builder.trial.vehicles import drawn_vehicles
from builder.truth.revolution.flow_table import FlowTable, flow_states
from builder.truth.revolution.strain import TrueStructure, true_structure
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import wrong_estimator
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.flight_condition import FlightCondition

BLOCK = 1000
"""Flight conditions that are flown together."""

TESTS = ("chi-square", "largest |z|", "shapes")

TENTHS = 10


@dataclass(frozen=True, kw_only=True, eq=False)
class FalseAlarms:
    """How many of ``samples`` good samples raised an alarm.

    Attributes
    ----------
    samples : n, as many at each flight condition.
    strain : by any of the tests of the strain, whose rate is the stated one.
    each : by each test, and by air data or ranges (the health states DEGRADED and OUTSIDE).
    tenths : for each quantity of the flight the rates (10,) of alarms of the strain, over the stated one, and
        (10,) of OUTSIDE, in ten parts of the conditions by that quantity.
    """

    samples: int
    strain: int
    each: dict[str, int]
    tenths: dict[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)

    @property
    def rate(self) -> float:
        """Rate of the tests of the strain."""
        return self.strain / self.samples

    def interval(self) -> tuple[float, float]:
        """Return the rates between which the rate of endless samples is with 95 %, were they independent (Garwood
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
        rows.append(
            f"{self.samples} samples; stated {FALSE_ALARM_PROBABILITY:g}, found {times:.2f} times that "
            f"(95 %: {low / FALSE_ALARM_PROBABILITY:.2f} to {high / FALSE_ALARM_PROBABILITY:.2f})"
        )
        if self.tenths:
            rows.append("alarms of the strain over the stated rate, tenths of the conditions; largest OUTSIDE [%]")
        for name, (alarms, outside) in self.tenths.items():
            shown = " ".join(f"{one:5.2f}" for one in alarms.tolist())
            rows.append(f"{name:20s}{shown}{100.0 * float(outside.max()):9.3f}")
        return rows


def false_alarms(
    inverse_map: InverseMap,
    vehicle: Vehicle,
    structure: TrueStructure,
    table: FlowTable,
    *,
    samples: int,
    vehicles: int = VEHICLES,
    seed: int = 1,
    search: bool = False,
    progress: Progress | None = None,
) -> FalseAlarms:
    """Count the false alarms of ``inverse_map`` on ``samples`` at least, ``vehicles`` at each flight condition.

    Conditions are anywhere between the knots of ``table``, whose flows its splines interpolate. A map of the
    nonlinear estimator is tried as it steps, from the state of the flight, or by a ``search`` of its tables, which
    takes about four times as long. A linear map is given Mach number and altitude, which have no part in its tests
    of the strain.

    Raises
    ------
    InputError
        ``table`` does not cover the map, or the Fourier model cannot do the vehicle.
    """
    fly = partial(drawn_vehicles, vehicle, structure, table)
    conditions = min(BLOCK, max(1, samples // vehicles))
    blocks = -(-samples // (conditions * vehicles))
    each, parts = Counter[str](), list[_Block]()
    for block in range(blocks):
        flights = read_flights(
            inverse_map, vehicle, table, fly, seed=[seed, block], vehicles=vehicles, conditions=conditions
        )
        ratios, health = _tests(inverse_map, flights, search)
        above = ratios > 1.0
        each.update({name: int(row.sum()) for name, row in zip(TESTS, above, strict=False)})
        for state in (HealthState.DEGRADED, HealthState.OUTSIDE):
            each[state.name] += int(np.sum(health == state))
        parts.append(
            _Block(
                flights=_quantities(flights.conditions),
                alarms=above.any(axis=0).reshape(conditions, -1).sum(axis=1),
                outside=(health == HealthState.OUTSIDE).reshape(conditions, -1).sum(axis=1),
            )
        )
        if progress is not None:
            progress(block + 1, blocks)
    return FalseAlarms(
        samples=blocks * conditions * vehicles,
        strain=int(sum(one.alarms.sum() for one in parts)),
        each=dict(each),
        tenths=_tenths(parts, vehicles),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Block:
    """Quantities of k ``flights`` (k,) by name, and how many of their samples raised ``alarms``, were ``outside``
    (k,)."""

    flights: dict[str, FloatArray]
    alarms: IntArray
    outside: IntArray


def _quantities(conditions: Sequence[FlightCondition]) -> dict[str, FloatArray]:
    """Return what tenths of the envelope are taken by."""
    mach, incidence, roll = flow_states(conditions)
    dynamic = np.array([one.dynamic_pressure for one in conditions])
    named = (("Mach number", mach), ("total incidence", incidence), ("roll angle", roll))
    return {**dict(named), "dynamic pressure": dynamic}


def _tenths(parts: list[_Block], vehicles: int) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return the rates of alarms, over the stated one, and of OUTSIDE in tenths of the conditions, by quantity."""
    alarms = np.concatenate([one.alarms for one in parts]) / vehicles / FALSE_ALARM_PROBABILITY
    outside = np.concatenate([one.outside for one in parts]) / vehicles
    found = {}
    for name in parts[0].flights if len(alarms) >= TENTHS else ():
        rows = np.array_split(np.argsort(np.concatenate([one.flights[name] for one in parts])), TENTHS)
        rates = (np.array([one[row].mean() for row in rows]) for one in (alarms, outside))
        of_alarms, of_outside = rates
        found[name] = of_alarms, of_outside
    return found


def _tests(inverse_map: InverseMap, flights: ReadFlights, search: bool) -> tuple[FloatArray, IntArray]:
    """Return tests over their levels (2 or 3, n) and health (n,)."""
    if inverse_map.manifold is not None:
        return ratios_and_health(inverse_map, flights, search=search)
    known = {name: flights.known[name] for name in (DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE)}
    altitude = np.repeat([one.altitude for one in flights.conditions], flights.vehicles)
    found = Estimator(inverse_map).estimate(flights.strain, **known, altitude=altitude)
    return np.stack(alarm_ratios(inverse_map, flights)), np.asarray(found.health)


def main() -> None:
    """Print the table."""
    parser = study_parser("false_alarms", __doc__)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--vehicles", type=int, default=VEHICLES, help="vehicles at each flight condition")
    parser.add_argument(
        "--estimator", metavar="linear|nonlinear", help="linear: the linear estimator of a map that includes both"
    )
    parser.add_argument("--search", action="store_true", help="find each flight from the tables alone")
    options = parser.parse_args()
    if min(options.samples, options.vehicles) < 1 or options.seed < 0:
        raise InputError("expected --samples and --vehicles from 1 on, and --seed from 0 on")
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
            vehicles=options.vehicles,
            seed=options.seed,
            search=options.search,
            progress=progress,
        )
    print("\n".join(found.lines()))


if __name__ == "__main__":
    run_study(main)
