"""How surely faults of a ground test are found and rightly named, over vehicles and load errors drawn at random.

python -m builder.calibration.score.faults VEHICLE --draws 40 --cases 12
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from builder.calibration.estimate.faults import calibrate_with_faults, gauge_faults
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.vehicle import Estimate, usable
from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.score.setup import HARMONICS, blank_test, properties_of
from builder.structure.as_built.structure import as_built_structure
from builder.structure.as_built.vehicle import GAUGE_KINDS, prior_std
from builder.trial.score import is_within
from builder.vehicle.file import load_vehicle
from strainfmu.arrays import FloatArray

FAULTS = ("none", "swapped", "sign", "unit", "dead", "load")

Spoil = Callable[[FloatArray, np.random.Generator], dict[str, str]]
"""Changes readings (n_cases, n_d) in place and returns what should be named: where and kind."""


def drawn_readings(
    model: ReadingsModel, random: np.random.Generator, added: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the readings (n_cases, n_d) of a vehicle, loads and pads drawn from their tolerances, and its vector.

    ``added`` (n,) is added to the vector.
    """
    vector = model.std * random.standard_normal(len(model.std))
    if added is not None:
        vector = vector + added
    noise = model.test.reading_stds
    return model.readings(vector) + noise * random.standard_normal(noise.shape), vector


class Calibrations:
    """Calibrations of spoiled tests: right if chi-square and errors over their sigmas are as of sound tests."""

    def __init__(self) -> None:
        self.chi: list[float] = []
        self.pull: list[FloatArray] = []

    def add(self, found: Estimate, vector: FloatArray) -> None:
        """Take one whose vehicle was ``vector`` (n,); gauges that were left out do not count."""
        n_built, n_d = found.model.n_built, found.model.structure.n_gauges
        judged = found.std[:n_built] > 0.0
        for g in np.flatnonzero(~found.used.any(axis=0)):
            judged[g : len(GAUGE_KINDS) * n_d : n_d] = False
        self.chi.append(found.per_reading)
        self.pull.append((found.vector - vector)[:n_built][judged] / found.std[:n_built][judged])

    def entries(self) -> dict[str, Any]:
        """Return means; none where no calibration was made."""
        if not self.chi:
            return {}
        pull = np.concatenate(self.pull)
        return {
            "calibrations": len(self.chi),
            "chi_square_per_reading": float(np.mean(self.chi)),
            "error_over_sigma_rms": float(np.sqrt(np.mean(pull**2))),
            "within_3_sigma_percent": float(100.0 * np.mean(is_within(pull, 1.0))),
        }


def spoils(model: ReadingsModel) -> dict[str, Spoil]:
    """Return the faults of gauges by name."""
    names = model.structure.gauges.names

    def one(random: np.random.Generator) -> int:
        return int(random.integers(len(names)))

    def swapped(reading: FloatArray, random: np.random.Generator) -> dict[str, str]:
        a, b = random.choice(len(names), 2, replace=False).tolist()
        reading[:, [a, b]] = reading[:, [b, a]]
        return {names[a]: "swapped", names[b]: "swapped"}

    def sign(reading: FloatArray, random: np.random.Generator) -> dict[str, str]:
        g = one(random)
        reading[:, g] *= -1.0
        return {names[g]: "sign"}

    def unit(reading: FloatArray, random: np.random.Generator) -> dict[str, str]:
        g = one(random)
        reading[:, g] *= 1e-3
        return {names[g]: "unit"}

    def dead(reading: FloatArray, random: np.random.Generator) -> dict[str, str]:
        g = one(random)
        reading[:, g] = 0.0
        return {names[g]: "dead"}

    return {"none": lambda reading, random: {}, "swapped": swapped, "sign": sign, "unit": unit, "dead": dead}


def gauge_statistics(
    model: ReadingsModel, draws: int, calibrations: int, kinds: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Return, for each fault of a gauge, in how many of ``draws`` it is found, and named as what it is.

    In the first ``calibrations`` the vehicle is calibrated without it.
    """
    for kind, spoil in spoils(model).items():
        if kind not in kinds:
            continue
        tally, made = {"found": 0, "named": 0, "others blamed": 0}, Calibrations()
        for number in range(draws):
            random = np.random.default_rng([number, 5])
            reading, vector = drawn_readings(model, random)
            wanted = spoil(reading, random)
            spoiled = model.with_readings(reading)
            if number < calibrations:
                estimate, faults = calibrate_with_faults(spoiled)
                made.add(estimate, vector)
            else:
                faults = tuple(gauge_faults(spoiled, usable(spoiled)))
            found = {one.where: one.kind for one in faults}
            tally["found"] += set(wanted) <= set(found)
            tally["named"] += found == wanted
            tally["others blamed"] += not set(found) <= set(wanted)
        yield {"fault": kind, "draws": draws, **tally, **made.entries()}


def load_statistics(model: ReadingsModel, draws: int, error: float = 0.1) -> Iterator[dict[str, Any]]:
    """Return in how many of ``draws`` a load off by ``error`` is found, it alone, and what the calibration is
    without it: after every ten, and after all."""
    tally, made = {"found": 0, "named": 0, "others blamed": 0}, Calibrations()
    first = model.n_built + (len(model.groups) - 1) * model.structure.n_gauges
    for number in range(draws):
        random = np.random.default_rng([number, 6])
        loads = [k for k, (_, one) in enumerate(model.loads) if one.std > 0.0]
        wrong = int(random.choice(loads))
        reading, vector = drawn_readings(model, random, error * np.eye(len(model.std))[first + wrong])
        found, faults = calibrate_with_faults(model.with_readings(reading))
        made.add(found, vector)
        case, blamed = model.test.cases[model.loads[wrong][0]].name, [one.where for one in faults]
        tally["found"] += case in blamed
        tally["named"] += blamed == [case]
        tally["others blamed"] += not set(blamed) <= {case}
        if (number + 1) % 10 == 0 or number + 1 == draws:
            yield {"fault": f"load {error:+.0%}", "draws": number + 1, **tally, **made.entries()}


def main() -> None:
    """Print one line of JSON for each fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vehicle", type=Path)
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--load-draws", type=int, default=40)
    parser.add_argument("--calibrations", type=int, default=40, help="of each fault of a gauge")
    parser.add_argument("--cases", type=int, default=12)
    parser.add_argument("--faults", nargs="+", choices=FAULTS, default=FAULTS)
    options = parser.parse_args()
    vehicle = load_vehicle(options.vehicle)
    layout, properties = vehicle.gauges.layout, properties_of(vehicle)
    structure = as_built_structure(vehicle, layout, properties=properties, max_harmonic=HARMONICS)
    errors = LoadErrors(common=0.0)
    prior = prior_std(vehicle.calibration, structure.counts)
    model = ReadingsModel(structure, blank_test(vehicle, structure, options.cases, errors), prior)
    for row in gauge_statistics(model, options.draws, options.calibrations, options.faults):
        print(json.dumps(row), flush=True)
    if "load" in options.faults:
        for row in load_statistics(model, options.load_draws):
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
