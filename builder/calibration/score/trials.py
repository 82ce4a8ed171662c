"""What a calibration makes of ground tests in which something went wrong, on vehicles of an independent truth.

Each draw is a vehicle whose wall varies smoothly along the body, on a mesh of its own, with gauges, loads and load
cell that err as vehicle file and test state, and the error of one row. The test is the one that `strainfmu
loadtest` proposes for the noise of the row's readings, of bonded pads. The calibration sees the readings alone. It
may refuse them, name the error, or make a map, which then flies on held-out flows next to the map of the vehicle
known exactly. The structures are solved once for all draws. A file of draws lets a run go on where it was stopped.

    python -m builder.calibration.score.trials VEHICLE SNAPSHOTS FLOWS --draws 20 --rows faultless "soft support"
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from builder.calibration.after_test.calibrated_map import (
    calibrated_map,
    calibrated_structure,
    remaining_after,
)
from builder.calibration.after_test.left_by_test import Remaining, left_by_test
from builder.calibration.as_built.structure_of_test import prior_of_test, structure_of_test
from builder.calibration.estimate.disagreement import unexplained
from builder.calibration.estimate.faults import Fault, calibrate_with_faults
from builder.calibration.estimate.outside_terms import outside_model
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.remarks import remarks
from builder.calibration.estimate.vehicle import Estimate
from builder.calibration.ground_test.candidate_cases import LoadLimits
from builder.calibration.ground_test.load_changes import CellErrors, as_applied
from builder.calibration.ground_test.load_test import LoadErrors, LoadTest
from builder.calibration.plan.load_plan import PlanParts, load_plan
from builder.calibration.plan.schedule import run_order
from builder.calibration.score.flown import flown_errors
from builder.calibration.score.setup import (
    HARMONICS,
    READING_STD,
    Flights,
    flights_of,
    load_test_of,
    properties_of,
    score_parser,
)
from builder.calibration.score.smooth_vehicles import LoadTables, SmoothVehicles, smooth_vehicles
from builder.calibration.score.trial_rows import Row, rows_of
from builder.calibration.score.vehicles import KINDS
from builder.calibration.score.wrong_cases import AppliedTest
from builder.campaign.snapshot_transfer import snapshots_on
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.inverse.modes.ensemble import Ensemble, ensemble_of
from builder.structure.as_built.structure import OF_MASS, AsBuiltStructure
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.loads.applied import Load
from builder.truth.revolution.flow_table import FlowTable, load_flow_table
from builder.vehicle.file import Vehicle, load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap

COVERED = 99.0
"""Percent of the flights of a vehicle whose coefficients must be within 3 sigma."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrialSetup:
    """What all draws share.

    Attributes
    ----------
    vehicle : its map holds no errors of the hardware but those that the test leaves.
    snapshots : on the nodes of ``structure``.
    structure : the map's.
    tests : the test for each noise of a reading [m/m], without readings.
    cases : of a test, in addition to its attitudes.
    errors : of its loads.
    vehicles, loads : the truth.
    flights : on the truth's own nodes.
    ensemble : of the map's flows.
    draws : of noise for each flight.
    exact : errors of vehicles known exactly, by their vectors; rows share them.
    """

    vehicle: Vehicle
    snapshots: Snapshots
    structure: AsBuiltStructure
    cases: int
    errors: LoadErrors
    vehicles: SmoothVehicles
    loads: LoadTables
    flights: Flights
    ensemble: Ensemble
    draws: int
    exact: dict[bytes, dict[str, Any]] = field(default_factory=dict)
    tests: dict[float, ReadingsModel] = field(default_factory=dict)

    def model(self, noise: float = READING_STD) -> ReadingsModel:
        """Return the test that is proposed where a reading has ``noise`` [m/m], without readings."""
        if noise not in self.tests:
            self.tests[noise] = proposed_test(
                self.vehicle, self.snapshots, self.structure, count=self.cases, errors=self.errors, noise=noise
            )
        return self.tests[noise]


def trial_setup(
    vehicle: Vehicle,
    snapshots: Snapshots,
    table: FlowTable,
    *,
    kind: str,
    cases: int,
    flights: int,
    draws: int,
    errors: LoadErrors,
) -> TrialSetup:
    """Solve what all draws share; ``kind`` is a map of :data:`~builder.calibration.score.vehicles.KINDS`."""
    entry = vehicle.map.model_copy(update={"estimator": "linear"} | KINDS[kind])
    noise = vehicle.noise.without_hardware_errors()
    vehicle = vehicle.model_copy(update={"noise": noise, "map": entry})
    structure = structure_of_test(vehicle, properties_of(vehicle), HARMONICS)
    vehicles = smooth_vehicles(vehicle, structure)
    on_map = snapshots_on(snapshots, structure.surface)
    return TrialSetup(
        vehicle=vehicle,
        snapshots=on_map,
        structure=structure,
        cases=cases,
        errors=errors,
        vehicles=vehicles,
        loads=LoadTables(vehicles.structure),
        flights=flights_of(vehicle, table, vehicles.structure.surface, flights),
        ensemble=ensemble_of(vehicle, on_map),
        draws=draws,
    )


def proposed_test(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AsBuiltStructure,
    *,
    count: int,
    errors: LoadErrors,
    noise: float,
) -> ReadingsModel:
    """Return the test of ``count`` bonded pads that is proposed for readings of ``noise`` [m/m], in the order in
    which it is run: with zero readings between and at the end."""
    drawing = calibrated_structure(structure, structure.exactly_built(), vehicle.gauges.layout, {})
    parts = PlanParts(vehicle=vehicle, snapshots=snapshots, structure=drawing, as_built=structure)
    plan = load_plan(parts, count, LoadLimits(directions=("out",)), errors, samples=1, noise=noise)
    test = load_test_of(structure, [one.case for one in run_order(plan)], errors, noise)
    return ReadingsModel(structure, test, prior_of_test(vehicle, structure))


@dataclass(frozen=True, eq=False, kw_only=True)
class Verdict:
    """What a calibration says of a test.

    Attributes
    ----------
    found : the estimate; None where the test is refused before.
    faults : gauges and load cases left out.
    lines : all that is printed of the vehicle and the test.
    refused : why no map is made; empty where one is.
    """

    found: Estimate | None
    faults: tuple[Fault, ...]
    lines: tuple[str, ...]
    refused: str


def verdict_of(model: ReadingsModel) -> Verdict:
    """Return what `strainfmu calibrate` says of the readings of ``model``."""
    try:
        found, faults = calibrate_with_faults(model)
    except InputError as error:
        return Verdict(found=None, faults=(), lines=(), refused=str(error))
    outside = outside_model(found)
    lines = (*(fault.line for fault in faults), *outside.lines, *remarks(found))
    return Verdict(found=found, faults=faults, lines=lines, refused=unexplained(found, outside, faults))


def applied_test(
    setup: TrialSetup, row: Row, test: LoadTest, built: AsBuilt, random: np.random.Generator
) -> AppliedTest:
    """Return the test as it is applied to a vehicle of the truth, with drawn errors of its loads."""
    gain, offset = random.standard_normal(2).tolist()
    cell = CellErrors(gain=test.errors.common * gain, offset=test.errors.cell_offset * offset)
    strain, weight = np.zeros((2, *test.readings.shape))
    for number, case in enumerate(test.cases):
        for known in case.loads:
            load = row.load(as_applied(known, test.errors, cell, random))
            own = setup.loads.strain(built, load, known.load)
            strain[number] += own
            weight[number] += own if isinstance(load, OF_MASS) else 0.0

    def of_load(load: Load, stated: Load) -> FloatArray:
        return setup.loads.strain(built, load, stated)

    zero = np.tile(built.zero, (len(strain), 1))
    return AppliedTest(test=test, strain=strain, weight=weight, zero=zero, of_load=of_load)


def trial(setup: TrialSetup, row: Row, number: int) -> dict[str, Any]:
    """Return what is said of draw ``number`` of a row, and how its map flies where there is one.

    The row's change of the vehicle is drawn apart, so that all rows have the same vehicles and errors of loads.
    """
    random, start = np.random.default_rng([number, 41]), process_time()
    built = row.vehicle(setup.vehicles.drawn(random), np.random.default_rng([number, 43]))
    stated, noise = row.noise
    model = setup.model(stated)
    applied = applied_test(setup, row, model.test, built, random)
    reading = applied.strain + applied.zero
    wanted = row.spoil(reading, random, applied)
    reading = reading + noise * random.standard_normal(reading.shape)
    verdict = verdict_of(model.with_readings(reading))
    gauges = set(setup.structure.gauges.names)
    blamed = {one.where: one.kind for one in verdict.faults}
    of_cases = {where: kind for where, kind in blamed.items() if where not in gauges}
    named = of_cases == wanted if wanted else bool(row.said) and any(row.said in one for one in verdict.lines)
    found: dict[str, Any] = {
        "row": row.name,
        "draw": number,
        "refused": verdict.refused,
        "named": named,
        "gauges_blamed": len(set(blamed) & gauges) / len(gauges),
        "cases_blamed": len(set(of_cases) - set(wanted)) / len(model.test.cases),
        "wanted": wanted,
        "lines": list(verdict.lines),
    }
    if verdict.found is not None:
        found["chi_square_per_reading"] = verdict.found.per_reading
        found["calibrate_s"] = process_time() - start
        if not verdict.refused:
            found |= _flown(setup, built, verdict.found, number)
    return found | {"s": process_time() - start}


def _flown(setup: TrialSetup, built: AsBuilt, estimate: Estimate, number: int) -> dict[str, Any]:
    """Return the errors in flight of the calibrated map, and of the map of the vehicle known exactly."""
    vehicle, key = setup.vehicle, built.vector.tobytes()
    strain = setup.flights.pressure @ setup.vehicles.structure.strain_operator(built).T
    remaining = remaining_after(estimate)
    left = left_by_test(setup.structure, remaining, setup.ensemble)
    tested = calibrated_map(vehicle, setup.snapshots, setup.structure, remaining, left=left)
    after = strain + built.zero - estimate.parameters.zero

    def flown(inverse_map: InverseMap, read: FloatArray) -> dict[str, Any]:
        random = np.random.default_rng([number, 42])
        return flown_errors(inverse_map, setup.flights, read, setup.draws, random)

    if key not in setup.exact:
        none = np.zeros((len(built.vector),) * 2)
        known = Remaining(parameters=built, covariance=none)
        exact = calibrated_map(vehicle, setup.snapshots, setup.vehicles.on_map, known)
        setup.exact[key] = flown(exact, strain)
    exactly = setup.exact[key]
    return {
        "exact": exactly["mean_square"],
        "exact_coverage_percent": exactly["coverage_percent"],
        **flown(tested, after),
    }


def summary_of(row: Row, found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the tally of the draws of one row."""
    flown = [one for one in found if "exact" in one]
    answered = [bool(one["refused"]) or one["named"] for one in found]
    line: dict[str, Any] = {
        "row": row.name,
        "draws": len(found),
        "refused": sum(bool(one["refused"]) for one in found),
        "named": sum(one["named"] for one in found),
        "refused_or_named": sum(answered),
        "gauges_blamed_percent": 100.0 * float(np.mean([one["gauges_blamed"] for one in found])),
        "cases_blamed_percent": 100.0 * float(np.mean([one["cases_blamed"] for one in found])),
        "false_blame": sum(one["gauges_blamed"] + one["cases_blamed"] > 0.0 for one in found),
        "seconds": float(np.mean([one["s"] for one in found])),
    }
    if flown:
        square, exact = (np.mean([one[name] for one in flown], axis=0) for name in ("mean_square", "exact"))
        coverage = np.array([one["coverage_percent"] for one in flown])
        silent = [not one["named"] and min(one["coverage_percent"]) < COVERED for one in flown]
        line |= {
            "accepted": len(flown),
            "ratio": np.sqrt(square / exact).round(3).tolist(),
            "coverage_percent": coverage.mean(axis=0).round(2).tolist(),
            "exact_coverage_percent": np.mean([one["exact_coverage_percent"] for one in flown], axis=0)
            .round(2)
            .tolist(),
            "worst_vehicle_percent": float(coverage.min()),
            "silent": sum(silent),
            "chi_square_per_reading": float(np.mean([one["chi_square_per_reading"] for one in flown])),
        }
    return line


HEAD = (
    f"{'row':28s}draws refused named either  gauges%  cases% accepted silent  chi2/n  "
    f"{'rms over exact: ' + ' '.join(COEFFICIENT_NAMES):34s}  3 sigma %"
)


def text_of(line: dict[str, Any]) -> str:
    """Return one line of the table."""
    text = (
        f"{line['row']:28s}{line['draws']:5d}{line['refused']:8d}{line['named']:6d}{line['refused_or_named']:7d}"
        f"{line['gauges_blamed_percent']:9.2f}{line['cases_blamed_percent']:8.2f}{line.get('accepted', 0):9d}"
    )
    if "ratio" not in line:
        return text
    ratio, coverage = (" ".join(f"{value:6.2f}" for value in line[name]) for name in ("ratio", "coverage_percent"))
    return f"{text}{line['silent']:7d}{line['chi_square_per_reading']:8.2f}  {ratio:34s}  {coverage}"


def held_draws(path: Path | None) -> dict[tuple[str, int], dict[str, Any]]:
    """Return the draws of an earlier run by row and number; none where there is no file.

    Raises
    ------
    InputError
        The file is no output of this command.
    """
    if path is None or not path.exists():
        return {}
    try:
        lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        return {(str(one["row"]), int(one["draw"])): one for one in lines}
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: expected draws of this command, one a line, got something else") from error


def trials(
    setup: TrialSetup, rows: Sequence[Row], numbers: Sequence[int], output: Path | None = None
) -> Iterator[list[dict[str, Any]]]:
    """Return the draws of one row after the other; draws that ``output`` holds are not made again."""
    held = held_draws(output)
    for row in rows:
        found = []
        for number in numbers:
            one = held.get((row.name, number))
            if one is None:
                one = trial(setup, row, number)
                if output is not None:
                    with output.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(one) + "\n")
            found.append(one)
        yield found


def parser() -> argparse.ArgumentParser:
    """Return the command's arguments."""
    found = score_parser("trials", __doc__)
    found.add_argument("--draws", type=int, default=20, help="vehicles of each row")
    found.add_argument("--first", type=int, default=0, help="number of the first draw, its seed")
    found.add_argument("--rows", nargs="+", default=[], help="names of rows; all by default")
    found.add_argument("--cases", type=int, default=12, help="pads of the test, in addition to its attitudes")
    found.add_argument("--load-cell-percent", type=float, default=0.5, help="error common to all loads")
    found.add_argument("--map", choices=list(KINDS), default="case 1")
    found.add_argument("--flights", type=int, default=60)
    found.add_argument("--noise-draws", type=int, default=8, help="for each flight")
    found.add_argument(
        "-o",
        "--output",
        type=Path,
        help="file of one line of JSON for each draw; draws that it holds are not made again",
    )
    return found


def main() -> None:
    """Print one line for each row."""
    options = parser().parse_args()
    setup = trial_setup(
        load_vehicle(options.vehicle),
        load_snapshots(options.snapshots),
        load_flow_table(options.flows),
        kind=options.map,
        cases=options.cases,
        flights=options.flights,
        draws=options.noise_draws,
        errors=LoadErrors(common=0.01 * options.load_cell_percent),
    )
    run(setup, options.rows, range(options.first, options.first + options.draws), options.output)


def run(setup: TrialSetup, names: Sequence[str], numbers: Sequence[int], output: Path | None) -> None:
    """Print one line for each row of ``names``, all rows where there are none; write the draws to ``output``.

    Raises
    ------
    InputError
        There is no row of a name.
    """
    every = rows_of(setup.model().test)
    unknown = [name for name in names if name not in every]
    if unknown:
        raise InputError(f"--rows: expected names of {', '.join(every)}; got {', '.join(unknown)}")
    rows = [every[name] for name in names] or list(every.values())
    print(HEAD, flush=True)
    for row, found in zip(rows, trials(setup, rows, numbers, output), strict=True):
        print(text_of(summary_of(row, found)), flush=True)


if __name__ == "__main__":
    try:
        main()
    except StrainfmuError as error:
        sys.exit(f"strainfmu: {error}")
