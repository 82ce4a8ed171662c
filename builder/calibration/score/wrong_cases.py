"""What goes wrong in ground tests: errors of load cases, of gauges, of the vehicle, and what should be named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from builder.calibration.ground_test.load_changes import DIRECTED, CellErrors, as_applied, hanging, is_along
from builder.calibration.ground_test.load_test import LoadTest
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.loads.applied import STANDARD_GRAVITY, Load, PadForce, Weight
from builder.trial.faults import MICRO
from builder.trial.ground import GroundTest
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

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


def loaded_and_weighed(test: LoadTest) -> tuple[list[int], list[int]]:
    """Return the numbers of the cases with loads, and of own weight alone."""
    weighs = [all(isinstance(one.load, Weight) for one in case.loads) for case in test.cases]
    loaded, weighed = (np.flatnonzero(np.array(weighs) == kind).tolist() for kind in (False, True))
    return loaded, weighed


def times_load(test: LoadTest, factor: float, kind: str) -> Spoil:
    """Return the error of a load that is ``factor`` times as large as stated."""
    loaded, _ = loaded_and_weighed(test)

    def spoil(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        case = int(random.choice(loaded))
        reading[case] += (factor - 1.0) * (applied.strain - applied.weight)[case]
        return {test.cases[case].name: kind}

    return spoil


def case_spoils(test: LoadTest) -> dict[str, Spoil]:
    """Return the errors of load cases by name: of their loads, of their readings, of what hangs on them."""
    names, (loaded, weighed) = [case.name for case in test.cases], loaded_and_weighed(test)

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
        "kgf": times_load(test, STANDARD_GRAVITY, "unit"),
        "lbf": times_load(test, 4.4482216152605, "unit"),
        "case sign": times_load(test, -1.0, "sign"),
        "no load": times_load(test, 0.0, "no load"),
        "duplicate": duplicate,
        "mislabelled": mislabelled,
        "interchanged": interchanged,
        **({"attitude": attitude} if weighed else {}),
        "10 kg more": mass,
        "balanced again": balance,
    }


def gauge_spoils(names: tuple[str, ...]) -> dict[str, Spoil]:
    """Return the errors of gauges by name."""

    def times(factor: float, kind: str) -> Spoil:
        def spoil(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
            gauge = int(random.integers(len(names)))
            reading[:, gauge] *= factor
            return {names[gauge]: kind}

        return spoil

    def swapped(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        a, b = random.choice(len(names), 2, replace=False).tolist()
        reading[:, [a, b]] = reading[:, [b, a]]
        return {names[a]: "swapped", names[b]: "swapped"}

    return {
        "gauges swapped": swapped,
        "gauge sign": times(-1.0, "sign"),
        "gauge unit": times(1e-3, "unit"),
        "dead gauge": times(0.0, "dead"),
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


def spoil_of(entry: GroundTest, test: LoadTest) -> Spoil:
    """Return what changes the readings of ``test`` in a case, and returns what should be named."""
    of_cases = case_spoils(test)
    every = {**of_cases, **gauge_spoils(test.gauge_names), "wrong load": times_load(test, 1.1, "load")}
    if entry.wrong is None:
        return lambda reading, random, applied: _drifting(entry, reading, random, applied)
    if entry.wrong not in every:
        raise InputError(f"ground.wrong: expected {', '.join(every)} in this test, got '{entry.wrong}'")
    return with_another(of_cases, every[entry.wrong]) if entry.and_another else every[entry.wrong]


def _drifting(
    entry: GroundTest, reading: FloatArray, random: np.random.Generator, applied: AppliedTest
) -> dict[str, str]:
    if entry.drift_um_per_m or entry.hysteresis_percent:
        time, n_d = np.linspace(0.0, 1.0, len(reading)), reading.shape[1]
        reading += time[:, None] * MICRO * entry.drift_um_per_m * random.standard_normal(n_d)
        each = 0.01 * entry.hysteresis_percent * (1.0 + 0.3 * random.standard_normal(n_d))
        reading[1:] += each * applied.strain[:-1]
    return {}


def with_errors(entry: GroundTest, built: AsBuilt, random: np.random.Generator) -> AsBuilt:
    """Return a vehicle with the errors of a case."""
    counts, changes = built.counts, dict[str, FloatArray | float]()
    if entry.mass_percent:
        changes["mass"] = 0.01 * entry.mass_percent
    if entry.clamp_m:
        changes |= {"clamp_axial": entry.clamp_m, "clamp_transverse": entry.clamp_m}
    if entry.joint_m:
        changes["joint_softness"] = np.full(counts.joint, entry.joint_m)
    if entry.modulus_percent:
        signs = random.choice([-1.0, 1.0], counts.region)
        changes["region_modulus"] = 0.01 * entry.modulus_percent * signs
    if entry.taper_percent:
        changes["wall_taper"] = built.wall_taper + 0.01 * entry.taper_percent
    if entry.second_harmonic_percent:
        wave = 0.01 * entry.second_harmonic_percent * random.standard_normal((2, counts.region))
        changes |= {"wall_second_cosine": wave[0], "wall_second_sine": wave[1]}
    return built.changed(**changes)


def towards_tail(load: Load, tilt_deg: float) -> Load:
    """Return a force turned towards the tail; its size stays."""
    if not tilt_deg or not isinstance(load, DIRECTED) or not any(load.force):
        return load
    force, angle = np.asarray(load.force), float(np.deg2rad(tilt_deg))
    size = float(np.linalg.norm(force))
    turned = np.cos(angle) * force + np.sin(angle) * size * np.array([1.0, 0.0, 0.0])
    x, y, z = (size * turned / np.linalg.norm(turned)).tolist()
    return replace(load, force=(x, y, z))
