"""The ground test of one vehicle: what is applied and read, and what the calibration says of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.calibration.estimate.disagreement import unexplained
from builder.calibration.estimate.faults import Fault, calibrate_with_faults
from builder.calibration.estimate.outside_terms import outside_model
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.remarks import remarks
from builder.calibration.estimate.vehicle import Estimate
from builder.calibration.ground_test.load_changes import CellErrors, as_applied
from builder.calibration.ground_test.load_test import LoadTest
from builder.calibration.score.ground_world import GroundWorld
from builder.calibration.score.wrong_cases import AppliedTest, spoil_of, towards_tail, with_errors
from builder.structure.as_built.structure import OF_MASS
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.loads.applied import Load
from builder.trial.faults import MICRO
from builder.trial.ground import GroundTest
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


def verdict_of(model: ReadingsModel) -> tuple[Estimate | None, tuple[Fault, ...], tuple[str, ...], str]:
    """Return what `strainfmu calibrate` says of the readings of ``model``: the estimate of the vehicle, None where
    the test is refused before; gauges and load cases left out; all lines; and why no map is made, empty where a
    map is."""
    try:
        estimate, faults = calibrate_with_faults(model)
    except InputError as error:
        return None, (), (), str(error)
    outside = outside_model(estimate)
    lines = (*(fault.line for fault in faults), *outside.lines, *remarks(estimate))
    return estimate, faults, lines, unexplained(estimate, outside, faults)


@dataclass(frozen=True, kw_only=True)
class Said:
    """What the calibration says of one test, as numbers.

    Attributes
    ----------
    refused : whether no map is made.
    named : whether it names the error, gauges or load cases as what they are; not where nothing is wrong.
    gauges_blamed, cases_blamed : sound ones that it leaves out, over all [1].
    per_reading : chi-square per reading; NaN where there is no estimate.
    silent : it is accepted, names nothing, and its map covers a load too seldom.
    """

    refused: bool
    named: bool
    gauges_blamed: float
    cases_blamed: float
    per_reading: float
    silent: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Tested:
    """A vehicle by its number, what is said of its test, and the estimate that a map is made of, None of a refused
    test."""

    number: int
    built: AsBuilt
    said: Said
    estimate: Estimate | None


def applied_test(
    world: GroundWorld, entry: GroundTest, test: LoadTest, built: AsBuilt, random: np.random.Generator
) -> AppliedTest:
    """Return the test as it is applied to a vehicle of the truth, with drawn errors of its loads."""
    gain, offset = random.standard_normal(2).tolist()
    cell = CellErrors(gain=test.errors.common * gain, offset=test.errors.cell_offset * offset)
    strain, weight = np.zeros((2, *test.readings.shape))
    for number, case in enumerate(test.cases):
        for known in case.loads:
            load = towards_tail(as_applied(known, test.errors, cell, random), entry.tilt_deg)
            own = world.loads.strain(built, load, known.load)
            strain[number] += own
            weight[number] += own if isinstance(load, OF_MASS) else 0.0

    def of_load(load: Load, stated: Load) -> FloatArray:
        return world.loads.strain(built, load, stated)

    zero = np.tile(built.zero, (len(strain), 1))
    return AppliedTest(test=test, strain=strain, weight=weight, zero=zero, of_load=of_load)


def tested(world: GroundWorld, entry: GroundTest, number: int) -> Tested:
    """Return vehicle ``number`` with its test.

    The error of the vehicle is drawn apart, so that all cases have the same vehicles and errors of loads.
    """
    random = np.random.default_rng([number, 41])
    built = with_errors(entry, world.vehicles.drawn(random), np.random.default_rng([number, 43]))
    model = world.model(entry)
    applied = applied_test(world, entry, model.test, built, random)
    reading = applied.strain + applied.zero
    wanted = spoil_of(entry, model.test)(reading, random, applied)
    noise = MICRO * entry.reading_std_um_per_m * entry.noise_times
    reading = reading + noise * random.standard_normal(reading.shape)
    made, faults, lines, refused = verdict_of(model.with_readings(reading))
    gauges, blamed = set(world.structure.gauges.names), {one.where: one.kind for one in faults}
    sound = set(blamed) & gauges - set(wanted)
    named = {where: kind for where, kind in blamed.items() if where not in sound}
    said = bool(entry.said) and any(entry.said in line for line in lines)
    return Tested(
        number=number,
        built=built,
        said=Said(
            refused=bool(refused),
            named=named == wanted if wanted else said,
            gauges_blamed=len(sound) / len(gauges),
            cases_blamed=len(set(named) - set(wanted)) / len(model.test.cases),
            per_reading=float("nan") if made is None else made.per_reading,
        ),
        estimate=None if refused else made,
    )
