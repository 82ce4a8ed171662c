"""Rows of ground tests: what goes wrong and is read, what the calibration says of it, and how the maps that follow
fly.

Every vehicle brings estimators of its own. An estimator is named by the kind of its map and what is known of the
vehicle: "nonlinear" after the test, "nonlinear, known exactly", "nonlinear, before the test". "load equations" are
regressions on the readings of the test."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from builder.aero.load_operator import coefficient_scales_at
from builder.calibration.after_test.calibrated_map import remaining_after
from builder.calibration.after_test.left_by_test import Remaining, left_by_test
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.ground_test_faults import calibrate_with_faults
from builder.calibration.estimate.outside_terms import outside_model
from builder.calibration.estimate.regression import load_equations
from builder.calibration.estimate.remarks import remarks, unexplained
from builder.calibration.ground_test.load_changes import (
    DIRECTED,
    PLACED,
    hanging,
    is_along,
    moved,
)
from builder.calibration.ground_test.load_test import LoadTest
from builder.calibration.score.ground_world import BEFORE, EXACT, MAPS, GroundWorld
from builder.calibration.score.simulated_test import CellErrors, as_applied
from builder.structure.as_built.as_built_structure import OF_MASS
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.loads.applied import STANDARD_GRAVITY, Load, PadForce, Weight
from builder.trial.cases import Case, GroundTest, Plan
from builder.trial.estimators import Estimates, of_map, together
from builder.trial.faults import MICRO
from builder.trial.readings import Readings, joined
from builder.trial.run import add_worst_set, labelled
from builder.trial.score import NONE, Clusters, Row, rms_ratios, rows_of
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap

HEAVY_TAIL = 3.0
"""Degrees of freedom of zeros that are not of the prior."""

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

    def name(self, case: int) -> str:
        """Return the name of a load case by its number."""
        return self.test.cases[case].name

    def noise(self, case: int, random: np.random.Generator) -> FloatArray:
        """Return noise (n_d,) of a reading of ``case`` [m/m]."""
        std = self.test.reading_stds[case]
        return np.asarray(std * random.standard_normal(len(std)))

    def loaded(self, random: np.random.Generator) -> int:
        """Return the number of a case with loads, drawn."""
        return int(random.choice(cases_by_load(self.test)[0]))

    def two_loaded(self, random: np.random.Generator) -> tuple[int, int]:
        """Return two cases of different loads, drawn: one that is repeated may stand for the other."""
        loaded, cases = cases_by_load(self.test)[0], self.test.cases
        while True:
            a, b = random.choice(loaded, 2, replace=False).tolist()
            if cases[a].loads != cases[b].loads:
                return a, b


def cases_by_load(test: LoadTest) -> tuple[list[int], list[int]]:
    """Return the numbers of the cases with loads, and of own weight alone."""
    weighs = np.array([all(isinstance(known.load, Weight) for known in case.loads) for case in test.cases])
    return np.flatnonzero(~weighs).tolist(), np.flatnonzero(weighs).tolist()


Spoil = Callable[[FloatArray, np.random.Generator, AppliedTest], dict[str, str]]
"""Changes readings (n_cases, n_d) of a test in place and returns what should be named: where and kind."""


def times_load(factor: float, kind: str) -> Spoil:
    """Return the error of a load that is ``factor`` times as large as stated."""

    def spoil(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        case = applied.loaded(random)
        reading[case] += (factor - 1.0) * (applied.strain - applied.weight)[case]
        return {applied.name(case): kind}

    return spoil


def times_gauge(factor: float, kind: str) -> Spoil:
    """Return the error of a gauge that reads ``factor`` times what it should."""

    def spoil(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
        gauge = int(random.integers(reading.shape[1]))
        reading[:, gauge] *= factor
        return {applied.test.gauge_names[gauge]: kind}

    return spoil


def _duplicate(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
    a, b = applied.two_loaded(random)
    reading[a] = reading[b] + applied.noise(a, random)
    return {applied.name(a): "duplicate"}


def _mislabelled(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
    a, b = applied.two_loaded(random)
    reading[a] = applied.zero[a] + applied.noise(a, random)
    for known in applied.test.cases[b].loads:  # applied once more, with errors of its own
        again = as_applied(known, applied.test.errors, CellErrors(), random)
        reading[a] += applied.of_load(again, known.load)
    return {applied.name(a): "mislabelled"}


def _interchanged(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
    a, b = applied.two_loaded(random)
    reading[[a, b]] = reading[[b, a]]
    return dict.fromkeys((applied.name(a), applied.name(b)), "interchanged")


def _attitude(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
    case = int(random.choice(cases_by_load(applied.test)[1]))
    stated = applied.test.cases[case].loads[0].load
    assert isinstance(stated, Weight)
    turn = 0.5 * np.pi * float(random.choice([1, 2, 3]))
    turned = replace(stated, up_roll_angle=stated.up_roll_angle + turn)
    reading[case] += applied.of_load(turned, turned) - applied.of_load(stated, stated)
    return {applied.name(case): "attitude"}


def _mass(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
    cases = applied.test.cases
    loads = [(number, known.load) for number, case in enumerate(cases) for known in case.loads]
    pads = [(number, load) for number, load in loads if isinstance(load, PadForce)]
    number, pad = pads[int(random.integers(len(pads)))]
    weight = hanging(pad, cases[number], FORGOTTEN)
    reading[number] += applied.of_load(weight, weight)
    return {cases[number].name: "load" if is_along(pad, weight) else "mass"}


def _balance(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
    case = applied.loaded(random)
    reading[case] -= applied.zero[case]
    return {applied.name(case): "balance"}


def _swapped(reading: FloatArray, random: np.random.Generator, applied: AppliedTest) -> dict[str, str]:
    a, b = random.choice(reading.shape[1], 2, replace=False).tolist()
    reading[:, [a, b]] = reading[:, [b, a]]
    return dict.fromkeys((applied.test.gauge_names[a], applied.test.gauge_names[b]), "swapped")


CASE_SPOILS: dict[str, Spoil] = {
    "kgf": times_load(STANDARD_GRAVITY, "unit"),
    "lbf": times_load(4.4482216152605, "unit"),
    "case sign": times_load(-1.0, "sign"),
    "no load": times_load(0.0, "no load"),
    "duplicate": _duplicate,
    "mislabelled": _mislabelled,
    "interchanged": _interchanged,
    "attitude": _attitude,
    "10 kg more": _mass,
    "balanced again": _balance,
}
"""Errors of load cases by name: of their loads, of their readings, of what hangs on them."""

GAUGE_SPOILS: dict[str, Spoil] = {
    "gauges swapped": _swapped,
    "gauge sign": times_gauge(-1.0, "sign"),
    "gauge unit": times_gauge(1e-3, "unit"),
    "dead gauge": times_gauge(0.0, "dead"),
}
"""Errors of gauges by name."""

SPOILS = {**CASE_SPOILS, **GAUGE_SPOILS, "wrong load": times_load(1.1, "load")}


def case_spoils(test: LoadTest) -> dict[str, Spoil]:
    """Return the errors that load cases of ``test`` may have: own weight has one of its own."""
    weighed = cases_by_load(test)[1]
    return {name: spoil for name, spoil in CASE_SPOILS.items() if weighed or name != "attitude"}


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
    if entry.wrong is None:
        return lambda reading, random, applied: _drifting(entry, reading, random, applied)
    of_cases = case_spoils(test)
    if entry.wrong in CASE_SPOILS.keys() - of_cases:
        raise InputError(f"ground.wrong: expected {', '.join(of_cases)} in this test, got '{entry.wrong}'")
    return with_another(of_cases, SPOILS[entry.wrong]) if entry.and_another else SPOILS[entry.wrong]


def _drifting(
    entry: GroundTest, reading: FloatArray, random: np.random.Generator, applied: AppliedTest
) -> dict[str, str]:
    if entry.drift_um_per_m or entry.hysteresis_percent:
        time, n_d = np.linspace(0.0, 1.0, len(reading)), reading.shape[1]
        reading += time[:, None] * MICRO * entry.drift_um_per_m * random.standard_normal(n_d)
        hysteresis = 0.01 * entry.hysteresis_percent * (1.0 + 0.3 * random.standard_normal(n_d))
        reading[1:] += hysteresis * applied.strain[:-1]
    return {}


def with_errors(case: Case, as_built: AsBuilt, random: np.random.Generator) -> AsBuilt:
    """Return a vehicle with the errors of a case."""
    entry, counts, changes = case.ground or GroundTest(), as_built.counts, dict[str, FloatArray]()
    as_built = case.as_built.with_errors(as_built, random)
    if entry.zero_um_per_m:
        scatter = random.standard_t(HEAVY_TAIL, counts.gauge)
        changes.update(zero=MICRO * entry.zero_um_per_m * (0.5 + scatter))
    if entry.taper_percent:
        changes["wall_taper"] = as_built.wall_taper + 0.01 * entry.taper_percent
    if entry.second_harmonic_percent:
        wave = 0.01 * entry.second_harmonic_percent * random.standard_normal((2, counts.region))
        changes |= {"wall_second_cosine": wave[0], "wall_second_sine": wave[1]}
    return as_built.changed(**changes)


def towards_tail(load: Load, tilt_deg: float) -> Load:
    """Return a force turned towards the tail; its size stays."""
    if not tilt_deg or not isinstance(load, DIRECTED) or not any(load.force):
        return load
    force, angle = np.asarray(load.force), float(np.deg2rad(tilt_deg))
    size = float(np.linalg.norm(force))
    turned = np.cos(angle) * force + np.sin(angle) * size * np.array([1.0, 0.0, 0.0])
    x, y, z = (size * turned / np.linalg.norm(turned)).tolist()
    return replace(load, force=(x, y, z))


def applied_test(
    world: GroundWorld, entry: GroundTest, test: LoadTest, as_built: AsBuilt, random: np.random.Generator
) -> AppliedTest:
    """Return the test as it is applied to a vehicle of the truth, with drawn errors of its loads."""
    errors = random.standard_normal((entry.load_cells, 2)) * (test.errors.common, test.errors.cell_offset)
    cells = [CellErrors(gain=gain, offset=offset) for gain, offset in errors.tolist()]
    strain, weight = np.zeros((2, *test.readings.shape))
    for number, case in enumerate(test.cases):
        for known in case.loads:
            cell = cells[int(known.load_cell) - 1]
            load = towards_tail(as_applied(known, test.errors, cell, random), entry.tilt_deg)
            load = moved(load, longer=0.01 * entry.pads_percent)
            if entry.rig_kg and isinstance(known.load, PLACED):
                rig = hanging(known.load, case, entry.rig_kg)
                strain[number] += world.load_strain(as_built, rig, rig)
            load_strain = world.load_strain(as_built, load, known.load)
            strain[number] += load_strain
            weight[number] += load_strain if isinstance(load, OF_MASS) else 0.0

    zero, of_load = np.tile(as_built.zero, (len(strain), 1)), partial(world.load_strain, as_built)
    return AppliedTest(test=test, strain=strain, weight=weight, zero=zero, of_load=of_load)


def tested(world: GroundWorld, case: Case, number: int) -> tuple[AsBuilt, dict[str, float], Estimate | None]:
    """Return vehicle ``number``, what `strainfmu calibrate` says of its test, and the estimate that a map is made
    of, None of a refused test.

    It says ``refused``, no map is made; ``named``, gauges or load cases are named as what they are, or the error,
    not where nothing is wrong; ``gauges_blamed`` and ``cases_blamed``, sound ones that are left out, over all;
    ``per_reading``, chi-square, NaN where there is no estimate. The error of the vehicle is drawn apart, so that
    all cases have the same vehicles and errors of loads.
    """
    entry, random = case.ground or GroundTest(), np.random.default_rng([number, 41])
    as_built = with_errors(case, world.drawn(random), np.random.default_rng([number, 43]))
    model = world.model(entry)
    applied = applied_test(world, entry, model.test, as_built, random)
    reading = applied.strain + applied.zero
    wanted = spoil_of(entry, model.test)(reading, random, applied)
    noise = MICRO * entry.reading_std_um_per_m * entry.noise_times
    reading = reading + noise * random.standard_normal(reading.shape)
    try:
        estimate, faults = calibrate_with_faults(model.with_readings(reading))
    except InputError:
        says = {"refused": 1.0, "named": 0.0, "gauges_blamed": 0.0, "cases_blamed": 0.0, "per_reading": np.nan}
        return as_built, says, None
    outside = outside_model(estimate)
    lines = (*(fault.line for fault in faults), *outside.lines, *remarks(estimate))
    refused = bool(unexplained(estimate, outside, faults))
    gauges, blamed = set(world.structure.gauges.names), {fault.where: fault.kind for fault in faults}
    sound = set(blamed) & gauges - set(wanted)
    named = {where: kind for where, kind in blamed.items() if where not in sound}
    said = bool(entry.said) and any(entry.said in line for line in lines)
    says = {
        "refused": refused,
        "named": named == wanted if wanted else said,
        "gauges_blamed": len(sound) / len(gauges),
        "cases_blamed": len(set(named) - set(wanted)) / len(model.test.cases),
        "per_reading": estimate.per_reading,
    }
    return as_built, says, None if refused else estimate


EQUATIONS = "load equations"

TEST, CALIBRATION = "test", "calibration"
"""Stand for load and estimator in the row of what the calibration says."""

COVERED = 99.0
"""Percent of the samples of a vehicle of which each load must be within 3 sigma."""


def refuse_unknown_tests(names: Sequence[str], cases: Sequence[Case]) -> None:
    """Refuse estimators, and errors of load cases and gauges, that there are not."""
    known = [*MAPS, *(f"{kind}, {state}" for kind in MAPS for state in (EXACT, BEFORE)), EQUATIONS]
    if unknown := [name for name in names if name not in known]:
        raise InputError(f"estimators: expected {', '.join(known)}; got '{unknown[0]}'")
    wrong = [case.ground.wrong for case in cases if case.ground is not None and case.ground.wrong is not None]
    if unknown := [name for name in wrong if name not in SPOILS]:
        raise InputError(f"ground.wrong: expected {', '.join(SPOILS)}; got '{unknown[0]}'")


def ground_rows(world: GroundWorld, case: Case, plan: Plan) -> dict[str, list[Row]]:
    """Return what is said of the tests of a case, and the rows of each estimator where a test is accepted."""
    said = list[dict[str, float]]()
    read, parts = list[Readings](), {name: list[Estimates]() for name in plan.estimators}
    for number in range(plan.seed, plan.seed + plan.vehicles):
        (as_built, says, estimate), covered = tested(world, case, number), 100.0
        if estimate is not None:
            flown = {name: estimates_of(world, number, as_built, estimate, name) for name in plan.estimators}
            for name, (_, made) in flown.items():
                parts[name].append(made)
            read.append(next(iter(flown.values()))[0])
            of_maps = [rows_of(COEFFICIENT_NAMES, flown[name][1], read[-1])[1:] for name in MAPS if name in flown]
            covered = min((row["covered_percent"] for rows in of_maps for row in rows), default=covered)
        said.append({**says, "silent": not says["named"] and covered < COVERED})
    row = {"load": TEST, "samples": len(said), "vehicles": len(said), **row_of(said)}
    tests = labelled(case, CALIBRATION, [row])
    rows = {CALIBRATION: [{**row, "verdict": NONE, "why": ""} for row in tests]}
    if not read:
        return rows
    every, all_flights = joined(read), {name: together(made) for name, made in parts.items()}
    for name, made in all_flights.items():
        of_name = rows_of(COEFFICIENT_NAMES, made, every)
        add_worst_set(of_name, parts[name], read)
        kind = next(iter(MAPS)) if name == EQUATIONS else name.partition(", ")[0]
        exact = all_flights.get(f"{kind}, {EXACT}", made)
        if exact is not made:
            ratios = rms_ratios(made.value - every.truth, exact.value - every.truth, every)
            for row, (ratio, error) in zip(of_name[1:], ratios, strict=True):
                row |= {"over_exact": ratio, "over_exact_error": error}
        rows[name] = labelled(case, name, of_name)
    return rows


def estimates_of(
    world: GroundWorld, number: int, as_built: AsBuilt, estimate: Estimate, name: str
) -> tuple[Readings, Estimates]:
    """Return what vehicle ``number`` reads with several draws of noise in each flight, zeros taken off as far as
    they are known, and estimates of it by the estimator ``name``."""
    kind, _, state = name.partition(", ")

    def flown(inverse_map: InverseMap, zero: FloatArray = estimate.parameters.zero) -> tuple[Readings, Estimates]:
        """Return readings less ``zero`` (n_d,) [m/m], and estimates."""
        flights, random = world.flights, np.random.default_rng([number, 42])
        strain = world.pressure @ world.true_structure.strain_operator(as_built).T + (as_built.zero - zero)
        strain = strain[flights.flight]
        strain = strain + inverse_map.noise_std * random.standard_normal(strain.shape)
        vehicle = np.full(len(strain), number)
        read = replace(flights, strain=strain, vehicle=vehicle, name=f"vehicle {number}")
        return read, _by_equations(world, estimate, read) if kind == EQUATIONS else of_map(inverse_map)(read)

    if state == EXACT:
        known = Remaining(parameters=as_built, covariance=np.zeros((len(as_built.vector),) * 2))
        return world.once(  # cases share it
            (as_built.vector.tobytes(), kind),
            lambda: flown(world.map_of(kind, world.true_on_map, known), as_built.zero),
        )
    if state == BEFORE:
        return flown(world.drawing(kind), as_built.zero)
    if kind == EQUATIONS:
        return flown(world.drawing(next(iter(MAPS))))
    remaining = remaining_after(estimate)
    remainder = left_by_test(world.structure, remaining, world.ensemble)
    return flown(world.map_of(kind, world.structure, remaining, remainder))


def _by_equations(world: GroundWorld, estimate: Estimate, read: Readings) -> Estimates:
    """Return the estimates of regression load equations; their sigma is the regression's."""
    reference = world.vehicle.reference_quantities()
    equations = load_equations(estimate, reference.moment_station)
    scale = coefficient_scales_at(read.conditions, reference)[read.flight]
    load = np.column_stack([equation.value(read.strain) for equation in equations])
    std = np.array([equation.residual_std for equation in equations])
    return Estimates(value=load * scale, std=scale * std)


def row_of(said: Sequence[Mapping[str, float]]) -> Row:
    """Return how often the calibration says what [%]; ``silent``: a test is accepted, nothing is named, and its
    map covers a load too seldom."""
    clusters = Clusters(np.arange(len(said)))
    by_name = {name: np.array([float(record[name]) for record in said]) for name in said[0]}
    refused, named, silent = (by_name[name] > 0.0 for name in ("refused", "named", "silent"))
    gauges, cases = by_name["gauges_blamed"], by_name["cases_blamed"]
    return {
        **clusters.percent("refused", refused),
        **clusters.percent("named", named),
        **clusters.percent("refused_or_named", refused | named),
        **clusters.percent("silent", silent),
        **clusters.percent("blamed", gauges + cases > 0.0),
        "gauges_blamed_percent": 100.0 * float(gauges.mean()),
        "cases_blamed_percent": 100.0 * float(cases.mean()),
        "chi_square_per_reading": clusters.mean(np.where(refused, np.nan, by_name["per_reading"]))[0],
    }
