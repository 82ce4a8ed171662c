"""Design of a ground test: load cases for a vehicle, each with what it buys in flight, and how they are run: steps
of loading and unloading, zero readings between, and the time that it takes.

A case buys smaller standard deviations of the vehicle's parameters, which are given kind by kind and in words.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from builder.aero.load_operator import coefficient_scale
from builder.calibration.estimate.readings_model import ReadingsModel, scaled_columns
from builder.calibration.ground_test.candidate_cases import (
    LoadLimits,
    PlannedCase,
    attitude_cases,
    candidate_cases,
    known_loads,
)
from builder.calibration.ground_test.load_changes import cell_force, scaled
from builder.calibration.ground_test.load_test import LoadCase, LoadErrors, LoadTest
from builder.calibration.plan.case_selection import (
    CaseSensitivity,
    FlightSensitivity,
    no_knowledge,
    select_cases,
)
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.ensemble import ensemble_of
from builder.inverse.problem import AnyStructure, on_structure
from builder.reporting import Progress
from builder.structure.as_built.as_built_vehicle import Counts, places_of, slices, uncertain_keys
from builder.structure.as_built.displaced_structure import AnyAsBuilt
from builder.structure.as_built_kinds import KINDS
from builder.structure.loads.applied import Load, SurfacePressure
from builder.vehicle.file import Vehicle
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.signal_names import ZERO

ESTABLISHED, AT_PRIOR = 0.5, 0.9
"""Standard deviation after a test over that before: up to which a kind is established, from which it stays as it
was."""


@dataclass(frozen=True, kw_only=True)
class KindSigmas:
    """Root mean square of the standard deviations of one kind, in SI.

    Attributes
    ----------
    kind : of :data:`~builder.structure.as_built_kinds.KINDS`.
    before, after : the test.
    """

    kind: str
    before: float
    after: float

    @property
    def is_established(self) -> bool:
        """Whether the test at least halves it."""
        return self.after <= ESTABLISHED * self.before

    @property
    def stays(self) -> bool:
        """Whether the test hardly changes it."""
        return self.after >= AT_PRIOR * self.before

    def size(self, value: float) -> str:
        """Return a size of this kind, to two digits, with its unit."""
        digits = float(f"{value / KINDS[self.kind].scale:.2g}")
        return f"{np.format_float_positional(digits, trim='-')} {KINDS[self.kind].unit}"


def kind_sigmas(
    counts: Counts, before: FloatArray, after: FloatArray, used: BoolArray | None = None
) -> list[KindSigmas]:
    """Return the kinds that are not known exactly before a test.

    Parameters
    ----------
    before, after : (n,) of the vector.
    used : (n_d,) gauges that count; all by default.
    """
    kinds = []
    for kind, place in slices(counts).items():
        chosen = used if used is not None and used.any() and KINDS[kind].extent == "gauge" else slice(None)
        if before[place][chosen].any():
            rms = [float(np.sqrt(np.mean(stds[place][chosen] ** 2))) for stds in (before, after)]
            kinds.append(KindSigmas(kind=kind, before=rms[0], after=rms[1]))
    return kinds


def established(kinds: Sequence[KindSigmas]) -> str:
    """Return the kinds that a test establishes, in one line; empty without any."""
    parts = [
        f"{KINDS[kind.kind].in_words} {kind.size(kind.after)} ({kind.size(kind.before)})"
        for kind in kinds
        if kind.is_established
    ]
    return f"of the vehicle, 1 sigma (before the test): {', '.join(parts)}" if parts else ""


def undetermined(kinds: Sequence[KindSigmas]) -> str:
    """Return the kinds that a test leaves as they were, in one line; empty without any."""
    parts = [f"{KINDS[kind.kind].in_words} ({kind.size(kind.after)})" for kind in kinds if kind.stays]
    return f"as uncertain as before the test: {', '.join(parts)}" if parts else ""


FLIGHTS = 24
"""Pressure fields of the map's ensemble that stand for the flights."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadPlan:
    """Load cases in the order in which they are worth most.

    Attributes
    ----------
    attitudes : cases of own weight, which come first; none of a vehicle whose density is not known.
    cases : chosen cases, own weight included.
    sigmas : (n_cases, 5) sigma of the coefficients in flight after each chosen case [1].
    before, after_attitudes, exact : (5,) sigma of a vehicle of the drawing's tolerances, of one whose weight has
        been read, and of one that is known exactly [1].
    candidates : number of cases that were compared.
    repeats : how many of the last ``cases`` repeat the first ones.
    checks : cases to be predicted and not fitted: those that would be the next best ones.
    kinds : what the test leaves unknown of the vehicle.
    noise_std : (n_d,) of one sample [m/m], and ``samples`` that a reading is the mean of.
    """

    attitudes: tuple[PlannedCase, ...]
    cases: tuple[PlannedCase, ...]
    sigmas: FloatArray
    before: FloatArray
    after_attitudes: FloatArray
    exact: FloatArray
    candidates: int
    repeats: int
    checks: tuple[PlannedCase, ...]
    kinds: tuple[KindSigmas, ...]
    noise_std: FloatArray
    samples: int


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanParts:
    """What a plan is made from.

    Attributes
    ----------
    vehicle : the vehicle.
    snapshots : pressure of its flights.
    structure : the map's.
    as_built : the structure with what may differ from the drawing, on the same pressure nodes.
    """

    vehicle: Vehicle
    snapshots: Snapshots
    structure: AnyStructure
    as_built: AnyAsBuilt


def load_plan(
    parts: PlanParts,
    count: int,
    limits: LoadLimits,
    errors: LoadErrors,
    samples: int = 25,
    noise: float | None = None,
    checks: int = 0,
    repeats: int = 0,
    progress: Progress | None = None,
) -> LoadPlan:
    """Return ``count`` load cases for a vehicle.

    Parameters
    ----------
    samples : that a reading is the mean of.
    noise : of one sample of the test's recorder [m/m]; by default the vehicle's in flight.
    checks : number of check loads.
    repeats : number of cases that are applied again, the first ones first.
    progress : called with (cases chosen, cases in all).

    Raises
    ------
    InputError
        Nothing may act within ``limits``, or the map cannot be built.
    """
    vehicle, as_built = parts.vehicle, parts.as_built
    offered = candidate_cases(vehicle, limits, as_built.outer_span)
    offered = [within_limits(as_built, planned, limits) for planned in offered]
    attitudes = [] if as_built.weightless else attitude_cases(limits)
    lying: tuple[Load, ...] = attitudes[0].loads if attitudes else ()
    cases = [replace(planned, loads=(*lying, *planned.loads)) for planned in offered]
    exact = exactly_known_map(parts)
    flight = flight_sensitivity(parts, exact)
    lead = attitudes or [PlannedCase(name="no load", loads=())]
    sample_std = exact.noise_std if noise is None else np.full(as_built.n_gauges, noise)
    candidates = planned_test(as_built, [*lead, *offered], errors, sample_std / np.sqrt(samples))
    sensitivities = case_sensitivities(parts, candidates)
    first, bare = sensitivities[: len(lead)], sensitivities[len(lead) :]
    start = known = no_knowledge(flight)
    for case in first:
        known = known.after(case)
    if attitudes:
        bare = [acting_together(case, first[0], slices(as_built.counts)[ZERO]) for case in bare]
    chosen = select_cases(known, bare, count, progress)
    order, steps = [number for number, _ in chosen], [known, *(knowledge for _, knowledge in chosen)]
    for number in order[:repeats]:
        steps.append(steps[-1].after(bare[number]))
    end, rest = steps[-1], [k for k in range(len(bare)) if k not in order]
    prior = as_built.prior(vehicle.calibration)
    after = np.sqrt(np.diag(end.covariance)[:-1]) * prior.vector
    return LoadPlan(
        attitudes=tuple(attitudes),
        cases=_numbered([cases[k] for k in [*order, *order[:repeats]]]),
        sigmas=np.array([step.sigmas for step in steps[1:]]),
        before=start.sigmas,
        after_attitudes=known.sigmas,
        exact=flight.sigmas(np.zeros_like(flight.noise_covariance)),
        candidates=len(cases),
        repeats=min(repeats, len(order)),
        checks=tuple(cases[rest[k]] for k, _ in select_cases(end, [bare[k] for k in rest], checks, once=True)),
        kinds=tuple(kind_sigmas(as_built.counts, prior.vector, after)),
        noise_std=sample_std,
        samples=samples,
    )


def exactly_known_map(parts: PlanParts) -> InverseMap:
    """Return the map of a vehicle that is exactly as drawn: gauge noise alone, the flows as the prior.

    Case 2 whatever the vehicle file says: the choice of loads then hangs on no number of modes.
    """
    vehicle = parts.vehicle
    entry = vehicle.map.model_copy(
        update={"case": 2, "prior_modes": None, "gamma": 1.0, "estimator": "linear", "keep_field": False}
    )
    exact = vehicle.model_copy(update={"noise": vehicle.noise.without_hardware_errors(), "map": entry})
    return build_inverse_map(exact, parts.snapshots, parts.structure)


def flight_sensitivity(parts: PlanParts, exact: InverseMap) -> FlightSensitivity:
    """Return what the parameters do in flight; the last one, the error of the load cell, does nothing."""
    vehicle, as_built = parts.vehicle, parts.as_built
    ensemble = ensemble_of(vehicle, on_structure(parts.snapshots, parts.structure))
    pressure = np.concatenate(list(ensemble.members()))
    chosen = np.random.default_rng(FLIGHTS).choice(len(pressure), FLIGHTS, p=ensemble.member_weight)
    net = (pressure[chosen] - ensemble.fixed_pressure).T

    std = as_built.prior(vehicle.calibration)
    keys = uncertain_keys(std, in_flight=True)
    slopes = as_built.operator_slopes(as_built.exactly_built(), keys)
    place = places_of([*keys, (ZERO, 0)], as_built.counts)
    strain = np.stack([*(slopes[key] @ net for key in keys), np.ones((len(place), FLIGHTS))], axis=2)
    first, shape = np.arange(len(place) + 1) * place.shape[1], (len(place), len(std.vector) + 1)
    scale = coefficient_scale(exact.nominal_dynamic_pressure, vehicle.reference_quantities())
    return FlightSensitivity(
        jacobian=tuple(
            csr_array(((moveaxi * std.vector[place]).ravel(), place.ravel(), first), shape=shape)
            for moveaxi in np.moveaxis(strain, 1, 0)
        ),
        state_operator=exact.state_operator,
        noise_covariance=exact.noise_covariance,
        regularisation=exact.regularisation,
        coefficient_per_state=scale[:, None] * exact.load_per_state[FIVE_LOADS],
    )


def case_sensitivities(parts: PlanParts, test: LoadTest) -> list[CaseSensitivity]:
    """Return what the cases of a test would determine; the last parameter is the error of the load cell."""
    as_built = parts.as_built
    prior = as_built.prior(parts.vehicle.calibration)
    model = ReadingsModel(as_built, test, prior)
    _, jacobian = model.jacobian(np.zeros(len(model.std)))
    jacobian = scaled_columns(jacobian, model.std)
    cell, n_d = model.names.index("load cell"), as_built.n_gauges
    of_vehicle = np.append(np.arange(model.n_built), cell)
    entries = np.setdiff1d(np.arange(model.n_built, len(model.std)), cell)
    sensitivities = []
    for number, case in enumerate(test.cases):
        rows = jacobian[number * n_d : (number + 1) * n_d].tocsc()
        touched = entries[abs(rows).sum(axis=0)[entries] > 0.0]
        sensitivities.append(
            CaseSensitivity(
                jacobian=rows[:, of_vehicle].tocsr(), error=rows[:, touched].toarray(), noise_std=case.reading_std
            )
        )
    return sensitivities


def planned_test(
    as_built: AnyAsBuilt, cases: Sequence[PlannedCase], errors: LoadErrors, noise_std: FloatArray
) -> LoadTest:
    """Return the test of planned ``cases``, nothing read yet."""
    none = np.zeros(as_built.n_gauges)
    return LoadTest(
        gauge_names=as_built.gauges.names,
        cases=tuple(
            LoadCase(name=case.name, loads=known_loads(case, errors), reading=none, reading_std=noise_std)
            for case in _numbered(cases)
        ),
        errors=replace(errors, drift=0.0),  # cases have no time before they are chosen
    )


def acting_together(case: CaseSensitivity, weight: CaseSensitivity, zeros: slice) -> CaseSensitivity:
    """Return what a case determines in which own weight acts as well; the parameters ``zeros`` act once."""
    once = np.ones(case.jacobian.shape[1])
    once[zeros] = 0.0
    jacobian = case.jacobian + scaled_columns(weight.jacobian, once)
    return CaseSensitivity(
        jacobian=jacobian, error=np.column_stack([case.error, weight.error]), noise_std=case.noise_std
    )


def within_limits(as_built: AnyAsBuilt, case: PlannedCase, limits: LoadLimits) -> PlannedCase:
    """Return a case whose loads are lowered until no gauge exceeds the largest strain."""
    strains = as_built.nominal_strain(as_built.exactly_built(), case.loads)
    strain = strains.sum(axis=0)
    largest = float(np.abs(strain).max())
    if largest <= limits.largest_strain:
        return case
    factor = float(f"{0.995 * limits.largest_strain / largest:.2g}")
    return PlannedCase(
        name=f"{case.name}, times {factor:g}", loads=tuple(scaled(known, factor) for known in case.loads)
    )


def _numbered(cases: Sequence[PlannedCase]) -> tuple[PlannedCase, ...]:
    """Return cases whose names are unique: one that is applied again is called so."""
    count = Counter[str]()
    numbered = []
    for case in cases:
        count[case.name] += 1
        again = "" if count[case.name] == 1 else f" ({count[case.name]})"
        numbered.append(replace(case, name=f"{case.name}{again}"))
    return tuple(numbered)


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How the cases are run.

    Attributes
    ----------
    steps : of loading, and as many of unloading; 1 reads without load, under the whole load, and without load.
    setup_time : to set up a case or an attitude [s].
    reading_time : to apply a load, wait until it stands and record it [s].
    """

    steps: int = 2
    setup_time: float = 900.0
    reading_time: float = 60.0

    def steps_of(self, case: PlannedCase) -> list[tuple[float, bool]]:
        """Return part of the load [1] of each step, and whether it is taken off; none where no load can be
        changed."""
        loading = [round(k / self.steps, 4) for k in range(self.steps)] if changes(case) else []
        return [*((part, False) for part in loading), *((part, True) for part in loading[::-1])]

    def time_of(self, case: PlannedCase) -> float:
        """Return the time of a case [s]."""
        return self.setup_time + self.reading_time * (1 + len(self.steps_of(case)))


@dataclass(frozen=True, kw_only=True)
class RunCase:
    """A case as it is run.

    Attributes
    ----------
    case : name and loads.
    kind : "attitude", "zero reading", "load", "repeat" or "check".
    number : of a load or a repeat, in the plan; of others -1.
    """

    case: PlannedCase
    kind: str
    number: int = -1


def changes(case: PlannedCase) -> bool:
    """Return whether a load of a case can be applied step by step."""
    return any(cell_force(load) > 0.0 or isinstance(load, SurfacePressure) for load in case.loads)


def run_order(plan: LoadPlan) -> list[RunCase]:
    """Return the cases in the order in which they are run: zero readings at the start, between and at the end.

    The zero readings are of the vehicle as it lies under the loads; names are unique.
    """
    lead = plan.attitudes or (PlannedCase(name="no load", loads=()),)
    first = len(plan.cases) - plan.repeats
    loads = [
        RunCase(case=case, kind="load" if number < first else "repeat", number=number)
        for number, case in enumerate(plan.cases)
    ]
    loads += [
        RunCase(case=PlannedCase(name=f"check, {case.name}", loads=case.loads), kind="check")
        for case in plan.checks
    ]
    middle = (len(loads) + 1) // 2
    again = [
        RunCase(case=PlannedCase(name=f"{lead[0].name}, {when}", loads=lead[0].loads), kind="zero reading")
        for when in ("between", "at the end")
    ]
    # Turned to all attitudes first, and back to the one of the loads.
    order = [RunCase(case=case, kind="attitude") for case in lead]
    return [*order, *loads[:middle], again[0], *loads[middle:], again[1]]


def whole_time(plan: LoadPlan, schedule: Schedule) -> float:
    """Return the time of all cases [s]; zero readings need no set-up."""
    return sum(
        schedule.reading_time if run.kind == "zero reading" else schedule.time_of(run.case)
        for run in run_order(plan)
    )
