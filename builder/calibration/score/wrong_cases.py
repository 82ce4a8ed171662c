"""How surely a load case that is not as stated is found and named, over vehicles and load errors drawn at random.

python -m builder.calibration.score.wrong_cases VEHICLE --draws 40 --cases 12 --pairs
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from builder.calibration.estimate.faults import named_faults
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.vehicle import usable
from builder.calibration.ground_test.load_changes import cell_force
from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.score.faults import drawn_readings
from builder.calibration.score.setup import HARMONICS, blank_test, properties_of
from builder.structure.as_built.structure import as_built_structure
from builder.structure.as_built.vehicle import prior_std
from builder.structure.loads.applied import STANDARD_GRAVITY, Weight
from builder.vehicle.file import load_vehicle
from strainfmu.arrays import FloatArray

Spoil = Callable[[FloatArray, np.random.Generator, FloatArray], dict[str, str]]
"""Changes readings (n_cases, n_d) of a vector (n,) in place and returns what should be named: where and kind."""


def case_spoils(model: ReadingsModel) -> dict[str, Spoil]:
    """Return the errors of load cases by name: of their loads, of their readings, of what stands beside them."""
    test = model.test
    names = [case.name for case in test.cases]
    loaded = sorted({k for k, one in model.loads if not isinstance(one.load, Weight)})
    weighed = sorted({k for k, one in model.loads if isinstance(one.load, Weight)} - set(loaded))

    def strain(case: int, vector: FloatArray) -> FloatArray:
        """Readings (n_d,) of the loads of a case, without zeros."""
        bare = model.errors(vector).zero[model.groups.index(test.cases[case].group)]
        return model.readings(vector)[case] - bare

    def by(factor: float, kind: str) -> Spoil:
        def spoil(reading: FloatArray, random: np.random.Generator, vector: FloatArray) -> dict[str, str]:
            case = int(random.choice(loaded))
            reading[case] += (factor - 1.0) * strain(case, vector)
            return {names[case]: kind}

        return spoil

    def two(random: np.random.Generator) -> tuple[int, int]:
        a, b = random.choice(loaded, 2, replace=False).tolist()
        return a, b

    def duplicate(reading: FloatArray, random: np.random.Generator, vector: FloatArray) -> dict[str, str]:
        a, b = two(random)
        reading[a] = reading[b] + test.reading_stds[a] * random.standard_normal(len(reading[a]))
        return {names[a]: "duplicate"}

    def interchanged(reading: FloatArray, random: np.random.Generator, vector: FloatArray) -> dict[str, str]:
        a, b = two(random)
        reading[[a, b]] = reading[[b, a]]
        return {names[a]: "interchanged", names[b]: "interchanged"}

    def attitude(reading: FloatArray, random: np.random.Generator, vector: FloatArray) -> dict[str, str]:
        case, built = int(random.choice(weighed)), model.built(vector)
        stated = test.cases[case].loads[0].load
        assert isinstance(stated, Weight)
        turned = replace(
            stated, up_roll_angle=stated.up_roll_angle + 0.5 * np.pi * float(random.choice([1, 2, 3]))
        )
        of = [model.structure.response_strain(built, model.structure.response(one)) for one in (stated, turned)]
        reading[case] += of[1] - of[0]
        return {names[case]: "attitude"}

    def mass(reading: FloatArray, random: np.random.Generator, vector: FloatArray) -> dict[str, str]:
        number = int(random.choice([k for k, (_, one) in enumerate(model.loads) if cell_force(one.load) > 0.0]))
        case, known = model.loads[number]
        more = 10.0 * STANDARD_GRAVITY / cell_force(known.load)
        reading[case] += more * model.load_strains(model.built(vector))[number]
        return {names[case]: "load"}

    def balance(reading: FloatArray, random: np.random.Generator, vector: FloatArray) -> dict[str, str]:
        case = int(random.choice(loaded))
        reading[case] += strain(case, vector) - model.readings(vector)[case]
        return {names[case]: "balance"}

    return {
        "kgf": by(STANDARD_GRAVITY, "unit"),
        "lbf": by(4.4482216152605, "unit"),
        "case sign": by(-1.0, "sign"),
        "no load": by(0.0, "no load"),
        "duplicate": duplicate,
        "interchanged": interchanged,
        **({"attitude": attitude} if weighed else {}),
        "10 kg more": mass,
        "balanced again": balance,
    }


def case_statistics(model: ReadingsModel, draws: int, pairs: bool = False) -> Iterator[dict[str, Any]]:
    """Return, for each error of a load case, in how many of ``draws`` it is found, and named as what it is.

    With ``pairs`` another error, of any kind and of another case, is there, too.
    """
    spoils = case_spoils(model)
    for number, (name, spoil) in enumerate(spoils.items()):
        tally = {"found": 0, "named": 0, "others blamed": 0, "gauges blamed": 0}
        for draw in range(draws):
            random = np.random.default_rng([draw, 7, number, int(pairs)])
            reading, vector = drawn_readings(model, random)
            wanted = spoil(reading, random, vector)
            if pairs:
                second = wanted
                while set(second) & set(wanted):
                    changed = reading.copy()
                    second = spoils[str(random.choice(list(spoils)))](changed, random, vector)
                reading, wanted = changed, wanted | second
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
