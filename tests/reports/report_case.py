"""A small vehicle with everything that a report needs: the ogive, Newtonian pressure, Fourier structure."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from ogive import OGIVE
from random_map import nothing_of

from builder.aero.engines.registry import make_engine
from builder.campaign.campaign_run import snapshots_of_flows, vehicle_campaign
from builder.campaign.scheduling import Scheduling, solve_flows
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import inverse_map_of
from builder.inverse.noise.model import NoiseModel
from builder.inverse.problem import inverse_problem
from builder.inverse.solution import Problem, Solution
from builder.structure.fourier.fourier_model import StructuralModel, structural_model
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.map_needs import used_layouts
from builder.vehicle.map_options import MapEntry
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.linear.state_map import StateMap, gaussian_map, least_squares_map

NEWTONIAN = '[aerodynamics]\nengine = "newtonian"\nleeward = "prandtl_meyer"\n'

CASE_1 = MapEntry(modes=4)
CASE_2 = MapEntry(case=2, gamma=2.0, form="absolute", symmetry="listed")


@dataclass(frozen=True, eq=False)
class ReportCase:
    """A vehicle, what its map is made of, and the map."""

    vehicle: Vehicle
    snapshots: Snapshots
    structure: StructuralModel
    problem: Problem
    solution: Solution
    inverse_map: InverseMap


def ogive_with(folder: Path, map_lines: str = "modes = 4") -> Path:
    """Copy the ogive's files to ``folder``, with Newtonian pressure and other lines under [map]."""
    text = OGIVE.read_text(encoding="utf-8").replace("modes = 4", map_lines)
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("gauges.csv", "manoeuvre.csv"):
        (folder / name).write_bytes((OGIVE.parent / name).read_bytes())
    path = folder / "ogive.toml"
    path.write_text(f"{text}\n{NEWTONIAN}", encoding="utf-8")
    return path


def solved_vehicle(folder: Path) -> tuple[Vehicle, Snapshots, StructuralModel]:
    """Return the ogive with its snapshots and structure."""
    vehicle = load_vehicle(ogive_with(folder))
    engine = make_engine(vehicle, None, vehicle.resolution.map)
    campaign = vehicle_campaign(vehicle, engine)
    keys = map(engine.flow_key, campaign.conditions)
    flows = {one.flow.key: one.flow for one in solve_flows(engine, keys, Scheduling(workers=0))}
    structure = structural_model(vehicle, vehicle.resolution.map, used_layouts(vehicle))
    return vehicle, snapshots_of_flows(campaign, flows), structure


def case_of(parts: tuple[Vehicle, Snapshots, StructuralModel], entry: MapEntry) -> ReportCase:
    """Return the map of ``entry``, with everything it is made of."""
    vehicle, snapshots, structure = parts
    vehicle = vehicle.model_copy(update={"map": entry})
    problem = inverse_problem(vehicle, snapshots, structure)
    solution = problem.solution
    inverse_map = inverse_map_of(vehicle, snapshots, structure, problem, solution)
    return ReportCase(
        vehicle=vehicle,
        snapshots=snapshots,
        structure=structure,
        problem=problem,
        solution=solution,
        inverse_map=inverse_map,
    )


def with_gauges(problem: Problem, kept: list[int]) -> Problem:
    """Return the problem of some of the gauges: a map of it is built without the others."""
    terms = [replace(term, strain=term.strain[kept]) for term in problem.noise]
    own = np.linalg.cholesky(terms[0].covariance)
    noise = (replace(terms[0], strain=own), *terms[1:])
    return replace(problem, strain_operator=problem.strain_operator[kept], noise=noise)


def solved_on_same_modes(case: ReportCase, kept: list[int]) -> Solution:
    """Return the solution for the gauges ``kept`` on the modes of the map of all gauges.

    A map built again may choose other modes.
    """
    whole = case.solution
    cut = with_gauges(replace(case.problem, noise=whole.noise.terms), kept)
    noise = NoiseModel(cut.noise)
    states, mean = whole.solved.state_operator[kept], whole.solved.mean_strain[kept]
    solved: StateMap
    if case.inverse_map.case == 1:
        solved = least_squares_map(states, mean, noise.covariance, np.ones(states.shape[1]))
    else:
        solved = gaussian_map(states, mean, noise.covariance, case.inverse_map.regularisation)
    return replace(whole, solved=solved, noise=noise)


def map_of_some(case: ReportCase, problem: Problem, solution: Solution, kept: list[int]) -> InverseMap:
    """Return the map of ``kept`` gauges from its own problem and solution."""
    whole, solved = case.inverse_map, solution.solved
    first, *more = solution.noise.terms
    columns = np.hstack([term.strain_and_load(len(problem.load_operator)) for term in more])
    return replace(
        whole,
        gauge_names=tuple(whole.gauge_names[i] for i in kept),
        gauge_position=whole.gauge_position[kept],
        gauge_direction=whole.gauge_direction[kept],
        noise_std=whole.noise_std[kept],
        strain_range=whole.strain_range[kept],
        state_operator=solved.state_operator,
        gauge_covariance=first.covariance,
        own_error_strain=np.zeros(0),
        error_strain=columns[: len(kept)],
        error_load=columns[len(kept) :],
        load_per_state=problem.load_operator @ solution.field_modes,
        mean_strain=solved.mean_strain,
        form="absolute",
        **nothing_of("fixed_strain", "fixed_load", "zero_offset"),
        **nothing_of("gauge_error_product", "common_error", "mean_product"),
        **nothing_of("sensors", "thermal"),
    )


def others(n: int, lost: list[int]) -> list[int]:
    """Return the gauges that are not lost."""
    return [i for i in range(n) if i not in lost]
