"""How surely a load case that is not as stated is found and named, over vehicles and load errors drawn at random.

python -m builder.calibration.score.wrong_cases VEHICLE --draws 40 --cases 12 --pairs
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from builder.calibration.estimate.faults import named_faults
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.vehicle import usable
from builder.calibration.ground_test.load_changes import CellErrors, as_applied, hanging, is_along
from builder.calibration.ground_test.load_test import LoadErrors, LoadTest
from builder.calibration.score.faults import drawn_readings
from builder.calibration.score.setup import HARMONICS, blank_test, properties_of
from builder.structure.as_built.structure import OF_MASS, as_built_structure
from builder.structure.as_built.vehicle import prior_std
from builder.structure.loads.applied import STANDARD_GRAVITY, Load, PadForce, Weight
from builder.vehicle.file import load_vehicle
from strainfmu.arrays import FloatArray

Spoil = Callable[[FloatArray, np.random.Generator, "AppliedTest"], dict[str, str]]
"""Changes readings (n_cases, n_d) of a test in place and returns what should be named: where and kind."""

FORGOTTEN = 10.0
"""Mass of what hangs on a load without being stated [kg]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AppliedTest:
    """A test with what the vehicle strained.

    Attributes
    ----------
    test : as stated.
    strain : (n_cases, n_d) readings without noise and zeros [m/m].
    weight : (n_cases, n_d) the part of it that own weight and inertia strain [m/m].
    zero : (n_cases, n_d) [m/m].
    of_load : returns the readings (n_d,) of the same vehicle, without zeros, under a load as applied, by the load
        that it was to be [m/m].
    """

    test: LoadTest
    strain: FloatArray
    weight: FloatArray
    zero: FloatArray
    of_load: Callable[[Load, Load], FloatArray]

    def noise(self, case: int, random: np.random.Generator) -> FloatArray:
        """Return noise (n_d,) of a reading of ``case`` [m/m]."""
        std = self.test.reading_stds[case]
        return np.asarray(std * random.standard_normal(len(std)))


def applied_by(model: ReadingsModel, vector: FloatArray) -> AppliedTest:
    """Return the test of the vehicle ``vector`` (n,) of a model."""
    built = model.built(vector)
    zero = model.errors(vector).zero[[model.groups.index(case.group) for case in model.test.cases]]
    weight = np.zeros_like(zero)
    for (case, one), own in zip(model.loads, model.load_strains(built), strict=True):
        weight[case] += own if isinstance(one.load, OF_MASS) else 0.0
    return AppliedTest(
        test=model.test,
        strain=model.readings(vector) - zero,
        weight=weight,
        zero=zero,
        of_load=lambda load, stated: model.structure.response_strain(built, model.structure.response(load)),
    )


def case_spoils(test: LoadTest) -> dict[str, Spoil]:
    """Return the errors of load cases by name: of their loads, of their readings, of what hangs on them."""
    names = [case.name for case in test.cases]
    weighs = [all(isinstance(one.load, Weight) for one in case.loads) for case in test.cases]
    loaded, weighed = (np.flatnonzero(np.array(weighs) == kind).tolist() for kind in (False, True))

    def by(factor: float, kind: str) -> Spoil:
        def spoil(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
            case = int(random.choice(loaded))
            reading[case] += (factor - 1.0) * (applied.strain - applied.weight)[case]
            return {names[case]: kind}

        return spoil

    def two(random: np.random.Generator) -> tuple[int, int]:
        """Return two cases of different loads: one that is repeated may stand for the other."""
        while True:
            a, b = random.choice(loaded, 2, replace=False).tolist()
            if test.cases[a].loads != test.cases[b].loads:
                return a, b

    def duplicate(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        a, b = two(random)
        reading[a] = reading[b] + applied.noise(a, random)
        return {names[a]: "duplicate"}

    def mislabelled(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        a, b = two(random)
        reading[a] = applied.zero[a] + applied.noise(a, random)
        for known in test.cases[b].loads:  # applied once more, with errors of its own
            again = as_applied(known, test.errors, CellErrors(), random)
            reading[a] += applied.of_load(again, known.load)
        return {names[a]: "mislabelled"}

    def interchanged(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        a, b = two(random)
        reading[[a, b]] = reading[[b, a]]
        return {names[a]: "interchanged", names[b]: "interchanged"}

    def attitude(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        case = int(random.choice(weighed))
        stated = test.cases[case].loads[0].load
        assert isinstance(stated, Weight)
        turn = 0.5 * np.pi * float(random.choice([1, 2, 3]))
        turned = replace(stated, up_roll_angle=stated.up_roll_angle + turn)
        reading[case] += applied.of_load(turned, turned) - applied.of_load(stated, stated)
        return {names[case]: "attitude"}

    def mass(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        pads = [
            (case, one.load)
            for case, of in enumerate(test.cases)
            for one in of.loads
            if isinstance(one.load, PadForce)
        ]
        case, pad = pads[int(random.integers(len(pads)))]
        weight = hanging(pad, test.cases[case], FORGOTTEN)
        reading[case] += applied.of_load(weight, weight)
        return {names[case]: "load" if is_along(pad, weight) else "mass"}

    def balance(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        case = int(random.choice(loaded))
        reading[case] -= applied.zero[case]
        return {names[case]: "balance"}

    return {
        "kgf": by(STANDARD_GRAVITY, "unit"),
        "lbf": by(4.4482216152605, "unit"),
        "case sign": by(-1.0, "sign"),
        "no load": by(0.0, "no load"),
        "duplicate": duplicate,
        "mislabelled": mislabelled,
        "interchanged": interchanged,
        **({"attitude": attitude} if weighed else {}),
        "10 kg more": mass,
        "balanced again": balance,
    }


def with_another(spoils: dict[str, Spoil], first: Spoil) -> Spoil:
    """Return ``first`` together with another error, of any kind and of another case."""

    def spoil(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        wanted = first(reading, random, applied)
        while True:
            changed = reading.copy()
            second = spoils[str(random.choice(list(spoils)))](changed, random, applied)
            if not set(second) & set(wanted):
                reading[:] = changed
                return wanted | second

    return spoil


def case_statistics(model: ReadingsModel, draws: int, pairs: bool = False) -> Iterator[dict[str, Any]]:
    """Return, for each error of a load case, in how many of ``draws`` it is found, and named as what it is.

    With ``pairs`` another error, of any kind and of another case, is there, too.
    """
    spoils = case_spoils(model.test)
    for number, (name, alone) in enumerate(spoils.items()):
        spoil = with_another(spoils, alone) if pairs else alone
        tally = {"found": 0, "named": 0, "others blamed": 0, "gauges blamed": 0}
        for draw in range(draws):
            random = np.random.default_rng([draw, 7, number, int(pairs)])
            reading, vector = drawn_readings(model, random)
            wanted = spoil(reading, random, applied_by(model, vector))
            spoiled = model.with_readings(reading)
            found = {one.where: one.kind for one in named_faults(spoiled, usable(spoiled))}
            gauges = set(found) & set(model.structure.gauges.names)
            tally["found"] += set(wanted) <= set(found)
            tally["named"] += found == wanted
            tally["others blamed"] += not set(found) <= set(wanted) | gauges
            tally["gauges blamed"] += bool(gauges)
        yield {"fault": f"{name} and another" if pairs else name, "draws": draws, **tally}


def main() -> None:
    """Print one line of JSON for each error."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vehicle", type=Path)
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--cases", type=int, default=12)
    parser.add_argument("--pairs", action="store_true", help="with another error in every test")
    options = parser.parse_args()
    vehicle = load_vehicle(options.vehicle)
    properties = properties_of(vehicle)
    structure = as_built_structure(vehicle, vehicle.gauges.layout, properties=properties, max_harmonic=HARMONICS)
    prior = prior_std(vehicle.calibration, structure.counts)
    test = blank_test(vehicle, structure, options.cases, LoadErrors())
    model = ReadingsModel(structure, test, prior)
    for row in case_statistics(model, options.draws, options.pairs):
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
