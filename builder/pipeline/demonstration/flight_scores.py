"""Scores of flights: of a recorded flight, the outputs of an FMU that flew and the estimators of a map on the same
strains; and of a map of imported results on results that it was not made from.

The solver of a table is not here: there is no flow between its conditions. So the map is made again without some
of the flows, and estimates the loads of these. All else is as in the flights that alarm levels are set from: the
independent structure, errors of hardware, gauges and navigation drawn.

A table that is a grid of Mach numbers and total incidences loses one inner Mach number, or one incidence but the
largest, at a time: tables over the flight state need a grid. Of any other table a fifth of the flows inside is
left out at a time. What is left out is between flows of the map, never beyond them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from builder.campaign.snapshots import Snapshots, snapshots_on
from builder.inverse.problem import AnyStructure
from builder.manifold.flow_amplitudes import cosine_amplitudes
from builder.pipeline.estimator_choice import SAME_VALUE, LeftOut, at_each_value
from builder.pipeline.stages import map_from
from builder.reporting import Reporter, Silent
from builder.structure.structure_file import Structure
from builder.trial.bound import KNOWN, cramer_rao_bound
from builder.trial.conditions import at_any_roll
from builder.trial.estimators import Estimates, estimate_of, estimates_from, of_map, together
from builder.trial.levels import HARDWARE
from builder.trial.readings import ANGLES, Readings, World, joined, read_own_vehicles
from builder.trial.score import ROLLING, by_load, rows_of
from builder.truth.true_structure import TrueFlights, TrueStructure, flights_of_flows, true_structure
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import surface_grid
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.cosim.systems.recording import Recording
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE, QSource
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.valid_ranges import TOTAL_INCIDENCE
from strainfmu.flight_condition import FlightCondition
from strainfmu.interface.sensor_variables import reading_names

SCORE_VERSION = 6
"""Raised whenever scores of flights have other figures of the same files."""

AIR_DATA = (*ANGLES, MACH_NUMBER, DYNAMIC_PRESSURE)
"""Air data that the plant of a flight states as well [rad, rad, 1, Pa]."""

SECOND = 100
"""So many samples count as one flight in statistical errors: noise is new in each, the errors of the vehicle
last."""

RECORD = {
    "rms_error": ("rms", 1.0),
    "rms_error_of_range": ("rms_of_range", 1.0),
    "mean_sigma": ("sigma", 1.0),
    "coverage": ("covered_percent", 0.01),
    "undetected": ("undetected_percent", 0.01),
    "bias": ("bias", 1.0),
    "coverage_1": ("covered_1_percent", 0.01),
    "rms_z": ("rms_z", 1.0),
    "bound": ("bound", 1.0),
}
"""Columns of a score, with factors, by the entries of files of results."""


class Flown(NamedTuple):
    """What was read in a flight of n samples, and what an estimator made of it."""

    read: Readings
    made: Estimates

    @property
    def error(self) -> FloatArray:
        """(n, m) estimate less truth."""
        return self.made.value - self.read.truth[:, : self.made.value.shape[1]]

    def record(self, names: Sequence[str] = (*COEFFICIENT_NAMES, *AIR_DATA)) -> dict[str, Any]:
        """Return the score for a file of results: a number per load by name, None where there is none; of the
        first of ``names``, as far as they are estimated."""
        every, *loads = rows_of(names[: self.made.value.shape[1]], self.made, self.read)
        return {
            "names": [row["load"] for row in loads],
            **{entry: by_load(loads, *column) for entry, column in RECORD.items()},
            "healthy": float(np.mean(self.made.health == HealthState.OK)),
            "right_flagged": 0.01 * every["right_flagged_percent"],
        }


def score_flight(recording: Recording, inverse_map: InverseMap | None = None) -> dict[str, Any]:
    """Return the score of the instance "estimator", whose map may be known, against the instance "plant", and the
    time of a step [s]."""
    names = (*COEFFICIENT_NAMES, *((ROLLING,) if f"plant.{ROLLING}" in recording.names else ()))
    flown = Flown(_readings(recording, names, inverse_map), outputs_of(recording, names))
    cost = np.median(recording.step_cost, axis=0)
    return {**flown.record(names), "step_time": dict(zip(recording.instances, cost.tolist(), strict=True))}


def flown_estimators(
    inverse_map: InverseMap, recording: Recording, zeros: FloatArray | None = None, estimator: str | None = None
) -> dict[str, Flown]:
    """Return the estimates of both estimators of ``inverse_map``, by name, on the strains of ``recording``.

    ``zeros`` (n_d,) are subtracted from what the gauges read [m/m]. The estimators get dynamic pressure, Mach
    number and altitude of the plant. With the instance ``estimator``, an FMU of the map that flew, estimates of
    the nonlinear one are its outputs, with air data.
    """
    strain = _columns(recording, "plant", reading_names(inverse_map))
    known = {name: recording[f"plant.{name}"] for name in (DYNAMIC_PRESSURE, MACH_NUMBER, ALTITUDE)}
    read = _readings(
        recording,
        (names := (*COEFFICIENT_NAMES, *AIR_DATA)),
        inverse_map,
        strain if zeros is None else strain - zeros,
        {**known, Q_SOURCE: np.full(len(strain), float(QSource.INDEPENDENT))},
    )
    flown = {"linear": Flown(read, of_map(inverse_map, "linear")(read))}
    if inverse_map.manifold is not None:
        made = (
            estimates_from(estimate_of(Estimator(inverse_map), read), AIR_DATA)
            if estimator is None
            else outputs_of(recording, names, estimator)
        )
        flown["nonlinear"] = Flown(read, made)
    return flown


def outputs_of(recording: Recording, names: Sequence[str], instance: str = "estimator") -> Estimates:
    """Return the outputs ``names`` of an FMU that flew."""
    outputs = [f"air_data.{name}" if name in AIR_DATA else name for name in names]
    return Estimates(
        value=_columns(recording, instance, outputs),
        std=_columns(recording, f"{instance}.sigma", outputs),
        health=recording[f"{instance}.health.state"].astype(np.int64),
    )


def _readings(
    recording: Recording,
    names: Sequence[str],
    inverse_map: InverseMap | None,
    strain: FloatArray | None = None,
    known: Mapping[str, Any] | None = None,
) -> Readings:
    """Return what the plant read, with the truth of ``names``, and the Cramer-Rao bound where the map has tables;
    known are q_inf, M and p_inf by altitude, as in a demonstration."""
    n, bound = len(recording.time), None
    if inverse_map is not None:
        flown = _columns(recording, "plant", (MACH_NUMBER, *ANGLES, ALTITUDE))
        conditions = [FlightCondition(*state) for state in flown.tolist()]
        bound = cramer_rao_bound(inverse_map, conditions, (MACH_NUMBER, ALTITUDE, DYNAMIC_PRESSURE))
    return Readings(
        strain=np.empty((n, 0)) if strain is None else strain,
        known=known or {},
        truth=_columns(recording, "plant", names),
        vehicle=np.zeros(n, dtype=np.int64),
        flight=np.arange(n) // SECOND,
        bound=bound,
    )


def _columns(recording: Recording, prefix: str, names: Sequence[str]) -> FloatArray:
    return np.stack([recording[f"{prefix}.{name}"] for name in names], axis=1)


SEED, VEHICLES, ROLLS = 3, 20, 4
"""Of the draws; vehicles at each condition; aerodynamic roll angles of each flow, where a map takes it at all."""
MOST_PARTS = 6
"""Parts that are left out in turn, evenly spread over all."""
PART = 10**9
"""Between the numbers of vehicles, and of flights, of two parts."""


def left_out_parts(snapshots: Snapshots) -> list[LeftOut]:
    """Return the parts of the flows of ``snapshots`` to leave out in turn; empty where there are too few flows."""
    conditions = snapshots.conditions()
    key = np.round([(condition.mach_number, condition.total_incidence) for condition in conditions], SAME_VALUE)
    mach, incidence, flows = np.unique(key[:, 0]), np.unique(key[:, 1]), np.unique(key, axis=0)
    if len(flows) == len(mach) * len(incidence):
        parts = [*at_each_value(conditions, MACH_NUMBER)[1:-1], *at_each_value(conditions, TOTAL_INCIDENCE)[:-1]]
    else:
        inside = flows[(flows[:, 1] < incidence[-1]) & np.isin(flows[:, 0], mach[1:-1])]
        count = min(5, len(inside))
        alike = [(key[:, None] == inside[first::5]).all(axis=2).any(axis=1) for first in range(count)]
        parts = [
            LeftOut(f"part {number} of {count}", np.flatnonzero(rows))
            for number, rows in enumerate(alike, start=1)
        ]
    chosen = np.round(np.linspace(0, len(parts) - 1, min(MOST_PARTS, len(parts)))).astype(int)
    return [parts[number] for number in chosen]


def _flown_rows(snapshots: Snapshots, part: LeftOut) -> IntArray:
    """Return the rows of a part that are flown: of Mach numbers inside, where there are any.

    At an end of their range a stated Mach number is outside as often as not, and so is health.
    """
    inner = at_each_value(snapshots.conditions(), MACH_NUMBER)[1:-1]
    return np.intersect1d(part.rows, np.concatenate([at.rows for at in inner])) if inner else part.rows


def held_out_score(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    reporter: Reporter,
    solid: Structure | None = None,
) -> dict[str, Any] | None:
    """Return the score of maps of ``vehicle`` on flows of ``snapshots`` that they are made without, for a file of
    results: names of the parts that were left out in turn, number of their flows, and parts without which no map
    could be made, with the reason.

    ``structure`` is the structure of the map, ``solid`` the three-dimensional one behind it. None where there are
    too few flows to leave some out, or no map can be made without them.
    """
    parts = left_out_parts(snapshots)
    if not parts:
        return None
    on_grid = snapshots_on(snapshots, surface_grid(vehicle.body(), *vehicle.resolution.map.surface_nodes))
    truth, conditions = _true_structure(vehicle), snapshots.conditions()
    every, made, names, not_built = list[Readings](), list[Estimates](), list[str](), list[str]()
    flows = set[tuple[float, float]]()
    with reporter.stage("Held-out conditions: maps made without some results") as progress:
        for number, part in enumerate(parts):
            rest = np.setdiff1d(np.arange(len(conditions)), part.rows)
            try:
                inverse_map = map_from(vehicle, snapshots.chosen(rest), structure, Silent(), solid)
            except InputError as error:
                not_built.append(f"{part.name}: {error}")
                continue
            names.append(part.name)
            flown_rows = _flown_rows(snapshots, part)
            flows |= {
                (round(c.mach_number, 6), round(c.total_incidence, 6))
                for c in (conditions[row] for row in flown_rows)
            }
            random = np.random.default_rng([SEED, number])
            flown = _flown(vehicle, on_grid.chosen(flown_rows), truth, inverse_map, random)
            world = World(vehicle=vehicle, structure=truth, flows=None, inverse_map=inverse_map)
            read = joined(list(read_own_vehicles(world, HARDWARE, flown, VEHICLES, random)))
            made.append(of_map(inverse_map)(read))
            bound = cramer_rao_bound(inverse_map, flown.conditions, KNOWN)
            every.append(
                replace(
                    read,
                    vehicle=read.vehicle + PART * number,
                    flight=read.flight + PART * number,
                    bound=None if bound is None else bound[read.flight],
                )
            )
            progress(number + 1, len(parts))
    if not made:
        return None
    score = Flown(joined(every), together(made)).record()
    return {**score, "left_out": names, "flows": len(flows), "not_built": not_built}


def _true_structure(vehicle: Vehicle) -> TrueStructure:
    """Return the structure of the independent model with the pressure nodes of the map, where the results are."""
    of_map, truth = vehicle.resolution.map, vehicle.resolution.truth
    nodes = {
        "surface_stations": of_map.surface_stations,
        "surface_roll_angles": of_map.surface_roll_angles,
        "harmonics": min(truth.harmonics, (of_map.surface_roll_angles - 1) // 2),
    }
    resolution = vehicle.resolution.model_copy(update={"truth": truth.model_copy(update=nodes)})
    return true_structure(vehicle.model_copy(update={"resolution": resolution}))


def _flown(
    vehicle: Vehicle, snapshots: Snapshots, structure: TrueStructure, made: InverseMap, random: np.random.Generator
) -> TrueFlights:
    """Return the flights of a vehicle in the flows of ``snapshots``: rolled where the map takes every flow at
    every roll angle."""
    grid, conditions = snapshots.grid, snapshots.conditions()
    assert grid is not None
    ratio = [p / c.ambient_pressure for p, c in zip(snapshots.pressure, conditions, strict=True)]
    amplitude = [
        cosine_amplitudes(
            of_flow.reshape(len(grid.x), -1), grid.roll_angle - condition.leeward_roll_angle, structure.n_harmonics
        )
        for of_flow, condition in zip(ratio, conditions, strict=True)
    ]
    weight = np.eye(len(conditions))
    if made.provenance["symmetry"] == "full":
        weight = np.repeat(weight, ROLLS, axis=0)
        listed = [condition for condition in conditions for _ in range(ROLLS)]
        conditions = [at_any_roll(condition, condition.total_incidence, random) for condition in listed]
    return flights_of_flows(vehicle, structure, np.array(amplitude), (weight, weight), conditions)
