"""Design of an instrumentation: the chosen gauges, what each contributes, and how far any choice could go."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np

from builder.aero.surface.mesh import grid_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.ensemble import ensemble_of
from builder.inverse.noise.flows_between import SolvedFlows
from builder.inverse.problem import AnyStructure, errors_of_flows
from builder.placement.candidate_strain import CandidateStrain, fourier_strain, solid_strain
from builder.placement.candidates import (
    CandidateGrid,
    Candidates,
    grid_candidates,
    surface_candidates,
    with_gauges,
)
from builder.placement.flight_models import (
    FlightParts,
    Kind,
    air_data_goals,
    field_goals,
    flight_model,
    noise_std_of,
)
from builder.placement.gaussian_model import GaussianModel
from builder.placement.limits import Limits, Rules, rules_of
from builder.placement.lost_gauge import LARGEST_RATIO, LostGauge, lost_gauges, without_weak_points
from builder.placement.pressure_basis import counted_sensors, pressure_basis
from builder.placement.relaxation import Relaxed, relaxed
from builder.placement.selection import best_of_starts, exchanged, greedy, marginal_worth, rounded
from builder.reporting import Progress, Reporter
from builder.structure.solid.case import SolidCase, structure_case
from builder.structure.solid.gauge_rows import gauges_at
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.map_needs import why_linear
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

Goal = Literal["loads", "field", "air-data", "d-optimal"]
GOALS: tuple[Goal, ...] = ("loads", "field", "air-data", "d-optimal")

MODEL_FORM_PART = 0.1
"""Part of the criterion for loads that counts model-form error of the stated size; flows of the rest have none."""

NAMED = 8
"""Pairs of gauges that are named, the worst ones, where their loss raises a sigma too far."""

POOL = 600
"""Sites of the smallest reduced costs among which exchanges from many starts go on."""

POOL_PER_GAUGE = 12


@dataclass(frozen=True, kw_only=True)
class Aim:
    """What a placement is for.

    Attributes
    ----------
    goal : "loads", the coefficients; "field", pressure on the surface; "air-data", Mach number, incidences and
        ln p_inf of the nonlinear estimator; "d-optimal", all unknowns.
    weights : (5,) of the coefficients' variances, each relative to the layout in use [1].
    estimator : "linear" or "nonlinear"; None for the vehicle file's.
    starts : of the exchanges.
    robust : whether no loss may raise a sigma beyond :data:`~lost_gauge.LARGEST_RATIO`.
    losses : gauges lost together that ``robust`` is about, 1 or 2.
    """

    goal: Goal = "loads"
    weights: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0, 1.0)
    estimator: Kind | None = None
    starts: int = 20
    robust: bool = False
    losses: int = 1


@dataclass(frozen=True, eq=False, kw_only=True)
class Study:
    """Candidates of a vehicle with their models.

    Attributes
    ----------
    parts : of the models.
    kind : estimator that they are of.
    candidates : all sites, the sites of the layout in use and of gauges to be kept last.
    strain : of their gauges.
    layout_sites, kept_sites : sites of the layout in use, and of gauges to be kept.
    offered : number of sites that may be chosen, the first ones.
    model : goals are coefficients over their sigmas with the layout in use, mean over the states.
    own_sigma : (5,) these sigmas.
    without_model_form : the same model for flows without model-form error; None where there is none.
    """

    parts: FlightParts
    kind: Kind
    candidates: Candidates
    strain: CandidateStrain
    layout_sites: tuple[int, ...]
    kept_sites: tuple[int, ...]
    offered: int
    model: GaussianModel
    own_sigma: FloatArray
    without_model_form: GaussianModel | None = None

    def sigmas(self, sites: Sequence[int] | IntArray) -> FloatArray:
        """Return (5,) root mean square sigma over the flight states with gauges at ``sites``."""
        return np.asarray(self.own_sigma * np.sqrt(self.model.weight @ self.model.goal_variance(sites)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Placement:
    """A placement.

    Attributes
    ----------
    layout : the gauges.
    sites : chosen sites of the study.
    sigmas, own_sigmas : (5,) of the coefficients over the flight states, and with the layout in use [1].
    value, bound : the criterion, and what no choice of these candidates within the budget is below.
    worth : (n_sites,) what the criterion rises by without each site, over the criterion [1].
    lost : what the loss of each gauge does to the sigmas.
    remarks : lines on what could not be reached.
    """

    layout: GaugeLayout
    sites: tuple[int, ...]
    sigmas: FloatArray
    own_sigmas: FloatArray
    value: float
    bound: float
    unknowns: int
    is_determinant: bool
    worth: FloatArray
    lost: LostGauge
    remarks: tuple[str, ...] = ()

    @property
    def gap_percent(self) -> float:
        """How far the criterion may be above the best one [%]; of a determinant per unknown that gauges see."""
        if self.is_determinant:
            return 100.0 * float(np.expm1((self.value - self.bound) / self.unknowns))
        return 100.0 * (self.value / self.bound - 1.0)


def placement_study(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    grid: CandidateGrid,
    kind: Kind | None = None,
    keep: GaugeLayout | None = None,
    progress: Progress | None = None,
) -> Study:
    """Return the candidates of ``grid`` with their models.

    Parameters
    ----------
    vehicle, snapshots, structure : as for a map; the structure holds the layout in use.
    grid : what candidates there are.
    kind : estimator; by default the vehicle file's, of "auto" the nonlinear one where the flows allow tables.
    keep : gauges that are placed in any case.
    progress : called with (done, in all) as the strain of the candidates is found.

    Raises
    ------
    InputError
        The vehicle is a body of revolution of another model than the Fourier one, a candidate is not on the wall,
        or the layout in use is not on one surface.
    """
    own_layout = structure.layouts[vehicle.gauges.layout]
    case, offered = _offered(vehicle, structure, grid)
    everything, kept_sites = with_gauges(offered, keep) if keep is not None else (offered, [])
    everything, layout_sites = with_gauges(everything, own_layout)
    ensemble = ensemble_of(vehicle, snapshots)
    flows = SolvedFlows(snapshots=snapshots, entries=vehicle.flow_entries())
    basis = pressure_basis(vehicle, snapshots, ensemble, [*errors_of_flows(vehicle, flows, ensemble).values()])
    parts = FlightParts(
        vehicle=vehicle,
        flows=flows,
        ensemble=ensemble,
        structure=structure,
        basis=basis,
        noise_std=noise_std_of(vehicle, snapshots, structure),
        sensors=counted_sensors(vehicle.sensors, structure.surface, basis),
    )
    strain = _candidate_strain(parts, case, everything.gauges, progress)
    chosen, gaussian = _model_of_kind(parts, strain, everything.sites, kind)
    model, own_sigma = normalised(gaussian, layout_sites)
    without = None
    if chosen == "nonlinear" and vehicle.map.model_form_percent > 0.0:
        entry = vehicle.map.model_copy(update={"model_form_percent": 0.0})
        exact = replace(parts, vehicle=vehicle.model_copy(update={"map": entry}))
        without = normalised(flight_model(exact, strain, everything.sites, chosen), layout_sites)[0]
    return Study(
        parts=parts,
        kind=chosen,
        candidates=everything,
        strain=strain,
        layout_sites=tuple(layout_sites),
        kept_sites=tuple(kept_sites),
        offered=len(offered.sites),
        model=model,
        own_sigma=own_sigma,
        without_model_form=without,
    )


def _offered(
    vehicle: Vehicle, structure: AnyStructure, grid: CandidateGrid
) -> tuple[SolidCase | None, Candidates]:
    """Return the candidates of ``grid``, with the solid case of a free shape, None of a body of revolution."""
    if not vehicle.has_meridian:
        case = structure_case(vehicle, [vehicle.gauges.layout])
        return case, surface_candidates(case.mesh.full, bonded_surface(case, vehicle.gauges.layout), grid)
    if grid_of(structure.surface) is None or vehicle.structure.model != "fourier":
        raise InputError(
            "place: expected structure.model = 'fourier' of a body of revolution, whose inner surface takes the "
            f"gauges, got model '{vehicle.structure.model}'"
        )
    return None, grid_candidates(vehicle, grid)


def _candidate_strain(
    parts: FlightParts, case: SolidCase | None, gauges: GaugeLayout, progress: Progress | None
) -> CandidateStrain:
    """Return the strain of the candidates' ``gauges`` per pressure of the basis."""
    if case is None:
        stations = grid_of(parts.structure.surface)
        assert stations is not None
        return fourier_strain(parts.vehicle, stations, parts.basis, gauges, progress)
    layout = parts.vehicle.gauges.layout
    surface, length = bonded_surface(case, layout), float(case.layouts[layout].length[0])
    bonded = gauges_at(gauges.position, gauges.direction, gauges.names, length, surface)
    return solid_strain(case, parts.flows.snapshots, parts.basis, bonded, progress)


def _model_of_kind(
    parts: FlightParts, strain: CandidateStrain, sites: IntArray, kind: Kind | None
) -> tuple[Kind, GaussianModel]:
    """Return the estimator's kind, by the vehicle file where ``kind`` is None, and its model."""
    vehicle = parts.vehicle
    chosen: Kind = kind or ("linear" if vehicle.map.estimator == "linear" or why_linear(vehicle) else "nonlinear")
    try:
        return chosen, flight_model(parts, strain, sites, chosen)
    except InputError:
        if kind is not None or vehicle.map.estimator != "auto" or chosen == "linear":
            raise
        return "linear", flight_model(parts, strain, sites, "linear")


def bonded_surface(case: SolidCase, layout: str) -> str:
    """Return the surface of a free shape that the gauges of ``layout`` are bonded to, for the candidates too.

    Raises
    ------
    InputError
        They are on two surfaces, or of two lengths.
    """
    gauges = case.layouts[layout]
    if len(set(gauges.surface)) > 1 or np.ptp(gauges.length) > 0.0:
        raise InputError(f"gauges.layouts.{layout}: expected gauges on one surface and of one length, got two")
    return gauges.surface[0]


def normalised(model: GaussianModel, layout_sites: Sequence[int]) -> tuple[GaussianModel, FloatArray]:
    """Return the model with goals over their root mean square sigmas with ``layout_sites``, and these (n_g,)."""
    sigma = np.sqrt(model.weight @ model.goal_variance(layout_sites))
    return replace(model, goals=model.goals / sigma[:, None], fixed=model.fixed / sigma**2), sigma


def aimed(study: Study, aim: Aim) -> GaussianModel:
    """Return the model of ``study`` with the goals of ``aim``.

    The size of the model-form error is a judgement. With loads as the goal every second flight state has none: a
    layout for the stated size alone may be worse than the layout in use where flows have less of it.
    """
    model = study.model
    if aim.goal == "d-optimal":
        return replace(model, criterion="determinant")
    if aim.goal == "field":
        return replace(model, goals=field_goals(study.parts, study.strain, study.kind))
    if aim.goal == "air-data":
        if study.kind != "nonlinear":
            raise InputError("--goal: air-data needs the nonlinear estimator, got the linear one")
        goals = air_data_goals(study.parts, study.strain)
        states = replace(model, goals=goals, fixed=np.zeros(goals.shape[:2]))
        return normalised(states, study.layout_sites)[0]
    if study.without_model_form is not None:
        halves = model.of_states(slice(0, None, 2)), study.without_model_form.of_states(slice(1, None, 2))
        first, second = (normalised(half, study.layout_sites)[0] for half in halves)
        model = first.joined(second, MODEL_FORM_PART)
    weight = np.array(aim.weights) / np.mean(aim.weights)
    return replace(model, goals=model.goals * np.sqrt(weight)[:, None], fixed=model.fixed * weight)


def place(study: Study, limits: Limits, aim: Aim, reporter: Reporter) -> Placement:
    """Return the best placement that is found within ``limits``, of all choices of so many directions.

    Raises
    ------
    InputError
        No choice keeps the limits.
    """
    offered = study.candidates.gauges_of(list(range(study.offered)))
    kinds = list(dict.fromkeys(study.candidates.kind[gauge] for gauge in offered.tolist()))
    if limits.kinds is None or limits.kinds >= len(kinds):
        return _place(study, limits, aim, reporter)
    placements, faults = list[Placement](), list[InputError]()
    for some in combinations(kinds, limits.kinds):
        reporter.note(f"directions: {', '.join(some)}")
        try:
            placements.append(_place(study, replace(limits, directions=some), aim, reporter))
        except InputError as fault:
            faults.append(fault)
    if not placements:
        raise faults[0]
    best = placements[int(np.argmin([placement.value for placement in placements]))]
    return replace(best, bound=min(placement.bound for placement in placements))


def _place(study: Study, limits: Limits, aim: Aim, reporter: Reporter) -> Placement:
    """Return the best placement that is found within ``limits``.

    Raises
    ------
    InputError
        No choice keeps the limits.
    """
    objective = aimed(study, aim)
    offered = [*range(study.offered), *study.kept_sites]
    forced = list(range(study.offered, len(offered)))
    candidates = replace(study.candidates, sites=study.candidates.sites[offered])
    remaining, rules = rules_of(candidates, limits, forced)
    number = {tuple(site): k for k, site in reversed(list(enumerate(study.candidates.sites.tolist())))}
    of_study = np.array([number[tuple(site)] for site in remaining.sites.tolist()], dtype=np.int64)
    model = objective.of_sites(of_study)
    with reporter.stage("Gauges: greedy choice") as progress:
        first = greedy(model, rules, rules.forced, progress)
    with reporter.stage("Gauges: bound by the relaxation") as progress:
        relaxation = relaxed(model, rules, first, progress=progress)
    with reporter.stage(f"Gauges: exchanges from {aim.starts} starts") as progress:
        chosen = best_exchanged(model, rules, relaxation, first, aim.starts, progress)
    with reporter.stage("Gauges: exchanges among all candidates") as progress:
        chosen = exchanged(model, rules, chosen, progress)
    remarks: list[str] = []
    if aim.robust:
        coefficients = study.model.of_sites(of_study)
        words = "one" if aim.losses == 1 else "two"
        with reporter.stage(f"Gauges: against the loss of {words}") as progress:
            chosen = without_weak_points(model, coefficients, rules, chosen, progress, aim.losses)
    sites = of_study[chosen]
    lost = lost_gauges(study.model, sites, study.candidates.gauges_of(sites), aim.losses)
    if aim.robust:
        names = study.candidates.gauges.names
        remarks += robust_remarks(study, rules, of_study, chosen, lost, names)
        remarks += pair_remarks(lost, names)
    value = model.value(chosen)
    return Placement(
        layout=study.candidates.layout(sites),
        sites=tuple(sites.tolist()),
        sigmas=study.sigmas(sites),
        own_sigmas=study.own_sigma,
        value=value,
        bound=relaxation.bound,
        unknowns=model.rows.shape[-1],
        is_determinant=model.criterion == "determinant",
        worth=marginal_worth(model, chosen) / abs(value),
        lost=lost,
        remarks=tuple(remarks),
    )


def best_exchanged(
    model: GaussianModel,
    rules: Rules,
    relaxation: Relaxed,
    first: Sequence[int],
    starts: int,
    progress: Progress | None = None,
) -> list[int]:
    """Return the best choice from ``starts`` starts: greedy, the relaxation rounded, and drawn by its weights.

    Exchanges go on among the sites whose reduced costs in the relaxation are smallest: others cannot help much.
    """
    reduced = relaxation.gradient / rules.cost
    count = min(model.n_sites, max(POOL, int(POOL_PER_GAUGE * rules.budget / float(np.median(rules.cost)))))
    roundings = [rounded(relaxation.weight, rules)]
    roundings += [rounded(relaxation.weight, rules, seed) for seed in range(max(starts - 2, 0))]
    begun = [list(first), *roundings][: max(starts, 1)]
    needed = set(rules.forced).union(*map(set, begun))
    pool = np.array(sorted(needed.union(np.argsort(reduced, kind="stable")[:count].tolist())), dtype=np.int64)
    place_of = {int(site): k for k, site in enumerate(pool)}
    inside = [[place_of[site] for site in start] for start in begun]
    exchanged_sites = best_of_starts(model.of_sites(pool), rules.of_sites(pool), inside, progress)
    return [int(pool[site]) for site in exchanged_sites]


def pair_remarks(lost: LostGauge, names: Sequence[str]) -> list[str]:
    """Return a line for each pair whose loss raises a sigma too far, the :data:`NAMED` worst ones."""
    if lost.pair_ratio is None:
        return []
    remarks = []
    for first, second in lost.pairs[:NAMED]:
        ratio = lost.pair_ratio[first, second]
        worst = int(np.argmax(ratio))
        gauge, partner = (names[lost.gauges[k]] for k in (first, second))
        remarks.append(
            f"loss of {gauge} and {partner}: sigma of {COEFFICIENT_NAMES[worst]} rises to {ratio[worst]:.2f} "
            f"times, more than {LARGEST_RATIO:g}: too few others read the same"
        )
    if len(lost.pairs) > NAMED:
        remarks.append(f"{len(lost.pairs) - NAMED} more pairs raise a sigma beyond {LARGEST_RATIO:g} times")
    return remarks


def robust_remarks(
    study: Study,
    rules: Rules,
    of_study: IntArray,
    chosen: Sequence[int],
    lost: LostGauge,
    names: Sequence[str],
) -> list[str]:
    """Return a line for every gauge whose loss raises a sigma too far: by how much, and what one more would do."""
    remarks = []
    for gauge, ratio in zip(lost.gauges.tolist(), lost.ratio, strict=True):
        worst = int(np.argmax(ratio))
        if ratio[worst] <= LARGEST_RATIO:
            continue
        site = next(k for k, number in enumerate(chosen) if gauge in study.candidates.sites[of_study[number]])
        remaining = [int(of_study[number]) for k, number in enumerate(chosen) if k != site]
        spare = np.flatnonzero(rules.allowed([*chosen], whole_budget=True))
        nearest = ""
        if len(spare):
            variance = [study.model.goal_variance([*remaining, int(of_study[new])]) for new in spare[:200]]
            best = int(np.argmin([float((study.model.weight @ goals)[worst]) for goals in variance]))
            nearest = (
                f"; one more gauge, {names[study.candidates.sites[of_study[spare[best]]][0]]}, would cover it best"
            )
        remarks.append(
            f"loss of {names[gauge]}: sigma of {COEFFICIENT_NAMES[worst]} rises to {ratio[worst]:.2f} times, more "
            f"than {LARGEST_RATIO:g}: too few others read the same{nearest}"
        )
    return remarks
