"""Calibration scored on vehicles drawn at random: errors in flight before, after, and if all were known.

Each vehicle is drawn from the tolerances of the section [calibration], is tested and flies on the independent
model: another mesh, a wall of its own, other flows. Loads, load cell and pads err as the test says they may. The
map sees the readings of its test alone. Regression load equations from the same readings stand in the same table.
Rows are written after each vehicle; the same command goes on where it was stopped.

    python -m builder.calibration.score.vehicles VEHICLE SNAPSHOTS FLOWS --vehicles 40 --cases 6 12 24 -o out.json
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from builder.aero.loads.operator import coefficient_scales_at
from builder.calibration.after_test.calibrated_map import calibrated_map, remaining_after
from builder.calibration.after_test.left_by_test import LeftByTest, Remaining, left_by_test
from builder.calibration.as_built.outside_errors import OUTSIDE, outside_vehicle
from builder.calibration.estimate.faults import calibrate_with_faults
from builder.calibration.estimate.load_equations import load_equations
from builder.calibration.estimate.outside_terms import outside_model
from builder.calibration.estimate.vehicle import Estimate
from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.ground_test.simulated import WINDOW, TestedStructure, ground_test
from builder.calibration.score.flown import flown_errors
from builder.calibration.score.setup import READING_STD, Setup, SetupOptions, rows_of_test, score_parser, setup_of
from builder.calibration.score.summary import BEFORE, EQUATIONS, EXACT, errors_of, summary, table
from builder.campaign.snapshots import load_snapshots
from builder.inverse.modes.ensemble import Ensemble, ensemble_of
from builder.structure.as_built.vehicle import AsBuilt, drawn
from builder.truth.revolution.flow_table import load_flow_table
from builder.vehicle.file import load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.files import write_bytes_atomically

KINDS: dict[str, dict[str, Any]] = {
    "case 1": {"case": 1},
    "case 2": {"case": 2},
    "nonlinear": {"estimator": "nonlinear"},
}
"""Entries of [map] of the maps that are scored."""

UNAVERAGED = "single samples"
"""Readings that are single samples, though said to be means: the third kind of error outside the model."""

OUTSIDE_KINDS = (*OUTSIDE, UNAVERAGED)


@dataclass(frozen=True, eq=False, kw_only=True)
class Knowledge:
    """What is known of a vehicle; ``left`` is not, and ``strain`` (k, n_d) is read in the flights [m/m].

    ``found`` is the estimate of a test; None without one.
    """

    state: str
    remaining: Remaining
    left: LeftByTest | None
    strain: FloatArray
    found: Estimate | None = None
    facts: dict[str, Any]


class Score:
    """Vehicles that share a setup; the map of the drawing is made once."""

    def __init__(self, setup: Setup, kinds: Sequence[str], outside: Sequence[str]) -> None:
        self.setup, self.kinds, self.outside = setup, kinds, outside
        self._drawing: dict[str, InverseMap] = {}
        self._ensemble: Ensemble = ensemble_of(setup.vehicle, setup.snapshots)

    def of_vehicle(self, number: int) -> Iterator[dict[str, Any]]:
        """Return one row for each map and state of vehicle ``number``."""
        known = self._known(number)
        for kind in self.kinds:
            for one in known:
                flown = self._flown(self._map(kind, one), kind, one.strain, number)
                yield {"vehicle": number, "map": kind, "state": one.state, **one.facts, **flown}
        for one in known:
            if one.found is not None:
                yield {"vehicle": number, "map": EQUATIONS, "state": one.state, **self._by_equations(one, number)}

    def _known(self, number: int) -> list[Knowledge]:
        """Return what is known of a vehicle: all, nothing but tolerances, and what each test determines."""
        setup = self.setup
        built = drawn(setup.std, np.random.default_rng([7, number]))
        truth = setup.truth_of(built)
        strain = setup.flights.pressure @ truth.strain_operator(built).T
        none, every = np.zeros((len(setup.std.vector),) * 2), np.diag(setup.std.vector**2)
        nominal = Remaining(parameters=setup.structure.exactly_built(), covariance=every)
        exact = Remaining(parameters=built, covariance=none)
        known = [
            Knowledge(state=EXACT, remaining=exact, left=None, strain=strain, facts={}),
            Knowledge(state=BEFORE, remaining=nominal, left=None, strain=strain, facts={}),
        ]
        samples = self._samples(truth, built, number)
        known += [self._tested(count, samples.mean(axis=1), strain, built) for count in setup.models]
        for kind in self.outside:
            count = max(n for n in setup.models if n <= 12 or n == min(setup.models))
            if kind == UNAVERAGED:
                known.append(self._tested(count, samples[:, 0], strain, built, kind))
            else:
                assert setup.outside is not None
                other = outside_vehicle(truth, setup.outside, kind, np.random.default_rng([9, number]))
                flown = setup.flights.pressure @ other.strain_operator(built).T
                reading = self._samples(other, built, number).mean(axis=1)
                known.append(self._tested(count, reading, flown, built, kind))
        return known

    def _samples(self, truth: TestedStructure, built: AsBuilt, number: int) -> FloatArray:
        """Return the samples (n_cases, n, n_d) of the largest test; smaller ones are parts of it."""
        noise = np.full(built.n_gauges, READING_STD * np.sqrt(WINDOW))
        setup, random = self.setup, np.random.default_rng([number, 1])
        return ground_test(truth, built, setup.cases, setup.errors, noise, random=random).strain

    def _tested(
        self, count: int, reading: FloatArray, strain: FloatArray, built: AsBuilt, kind: str = ""
    ) -> Knowledge:
        """Return what a test of ``count`` pads determines by readings (n_cases, n_d) of the largest test."""
        setup = self.setup
        rows = rows_of_test(count, max(setup.models), len(reading))
        found, faults = calibrate_with_faults(setup.models[count].with_readings(reading[rows]))
        outside = outside_model(found)
        remaining = remaining_after(found)
        said = [one.kind for one in found.model.causes] + [one.kind for one in outside.found]
        return Knowledge(
            state=f"{count} cases" + (f", {kind}" if kind else ""),
            remaining=remaining,
            left=left_by_test(setup.structure, remaining, self._ensemble),
            strain=strain + built.zero - found.parameters.zero,
            found=found,
            facts={
                "chi_square_per_reading": found.per_reading,
                "faults": len(faults),
                "disagrees": not found.agrees,
                "outside": {one.kind: one.chance for one in outside.kinds},
                "said": list(dict.fromkeys(said)),
                "steps": found.steps,
            },
        )

    def _map(self, kind: str, known: Knowledge) -> InverseMap:
        setup = self.setup
        entry = setup.vehicle.map.model_copy(update=KINDS[kind])
        vehicle = setup.vehicle.model_copy(update={"map": entry})
        if known.state != BEFORE:
            return calibrated_map(vehicle, setup.snapshots, setup.structure, known.remaining, left=known.left)
        if kind not in self._drawing:
            self._drawing[kind] = calibrated_map(vehicle, setup.snapshots, setup.structure, known.remaining)
        return self._drawing[kind]

    def _flown(self, inverse_map: InverseMap, kind: str, strain: FloatArray, seed: int) -> dict[str, Any]:
        """Return the errors of a map in the flights, each with several draws of noise."""
        flown = inverse_map if kind == "nonlinear" else inverse_map.without_tables()
        return flown_errors(flown, self.setup.flights, strain, self.setup.draws, np.random.default_rng(seed))

    def _by_equations(self, known: Knowledge, seed: int) -> dict[str, Any]:
        """Return the errors of regression load equations in the flights; their sigma is the regression's."""
        setup, random = self.setup, np.random.default_rng(seed)
        assert known.found is not None
        reference = setup.vehicle.reference_quantities()
        equations = load_equations(known.found, reference.moment_station)
        read = np.repeat(known.strain, setup.draws, axis=0)
        read = read + READING_STD * np.sqrt(WINDOW) * random.standard_normal(read.shape)
        scale = np.repeat(coefficient_scales_at(setup.flights.conditions, reference), setup.draws, axis=0)
        load = np.column_stack([one.value(read) for one in equations])
        truth = np.repeat(setup.flights.coefficients, setup.draws, axis=0)
        return errors_of(load * scale - truth, scale * np.array([one.residual_std for one in equations]))


def settings_of(options: argparse.Namespace) -> dict[str, Any]:
    """Return what rows of one file have in common; the number of vehicles is not part of it."""
    apart = ("vehicles", "first", "output", "vehicle", "snapshots", "flows")
    return {name: value for name, value in vars(options).items() if name not in apart} | {
        name: str(getattr(options, name)) for name in ("vehicle", "snapshots", "flows")
    }


def rows_of(path: Path, settings: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the rows of an earlier run; none where there is no file.

    Raises
    ------
    InputError
        The file is of other settings, or no score.
    """
    if not path.exists():
        return []
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
        of, rows = held["settings"], list(held["rows"])
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: expected a score of this command, got something else") from error
    if of != settings:
        other = [name for name in settings if of.get(name) != settings[name]]
        raise InputError(f"{path}: holds a score of other settings ({', '.join(other)}); name another output")
    return rows


def parser() -> argparse.ArgumentParser:
    """Return the command's arguments."""
    found = score_parser("vehicles", __doc__)
    found.add_argument("--vehicles", type=int, default=40, help="how many")
    found.add_argument("--first", type=int, default=0, help="number of the first one")
    found.add_argument("--cases", type=int, nargs="+", default=[12], help="pads of the tests")
    found.add_argument("--maps", nargs="+", choices=list(KINDS), default=list(KINDS))
    found.add_argument("--flights", type=int, default=60)
    found.add_argument("--draws", type=int, default=8, help="of noise, for each flight")
    found.add_argument("--load-cell-percent", type=float, default=0.5, help="error common to all loads")
    found.add_argument("--outside", nargs="+", choices=OUTSIDE_KINDS, default=[], help="errors it does not know")
    found.add_argument("--solve-walls", action="store_true", help="solve the wall of every vehicle: slow")
    found.add_argument("-o", "--output", type=Path, default=Path("calibration_score.json"))
    return found


def main() -> None:
    """Score vehicles and write rows and their summary."""
    options = parser().parse_args()
    settings = settings_of(options)
    rows = rows_of(options.output, settings)
    numbers = range(options.first, options.first + options.vehicles)
    left = sorted(set(numbers) - {row["vehicle"] for row in rows})
    print(f"{len(numbers) - len(left)} of {len(numbers)} vehicles are scored", flush=True)
    if left:
        score = _score(options)
        start = perf_counter()
        for done, number in enumerate(left, start=1):
            rows += score.of_vehicle(number)
            text = json.dumps({"settings": settings, "rows": rows, "summary": summary(rows)}, indent=1)
            write_bytes_atomically(options.output, text.encode())
            each = (perf_counter() - start) / done
            rest = each * (len(left) - done) / 60.0
            print(f"vehicle {number}: {each:.0f} s each, {rest:.0f} min left", flush=True)
    print(table(summary(rows)))


def _score(options: argparse.Namespace) -> Score:
    setup = setup_of(
        load_vehicle(options.vehicle),
        load_snapshots(options.snapshots),
        load_flow_table(options.flows),
        SetupOptions(
            cases=tuple(options.cases),
            flights=options.flights,
            draws=options.draws,
            errors=LoadErrors(common=0.01 * options.load_cell_percent),
            solve_walls=options.solve_walls,
            with_outside=bool(set(options.outside) & set(OUTSIDE)),
        ),
    )
    return Score(setup, options.maps, options.outside)


if __name__ == "__main__":
    try:
        main()
    except StrainfmuError as error:
        sys.exit(f"strainfmu: {error}")
