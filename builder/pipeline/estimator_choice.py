"""The better estimator of a map, by flights that the map was not made from: ``map.estimator`` "auto".

Both estimators read the same strains, with installation errors, gauge noise and errors of the air data drawn. The
flights are the ones that set the alarm levels, by the independent model. Where there are none, a map is made
without some snapshots, one inner value of every condition, and estimates these with installation errors by the
map's own derivatives. Such a map has wider cells, so that its tables are worse than the whole map's.

The estimator of a map by an option, instead of the vehicle file's.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees
from typing import Any, Literal, NamedTuple

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.inverse.ensemble import Ensemble
from builder.inverse.solution import Problem
from builder.trial.estimators import of_map
from builder.trial.readings import Readings
from builder.trial.score import Row, by_load, rows_of
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import wrong_estimator
from strainfmu.arrays import BoolArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, PER_PRESSURE, InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.valid_ranges import TOTAL_INCIDENCE
from strainfmu.flight_condition import FlightCondition

MOST_UNDETECTED = 0.03
"""Fraction of samples with an undetected error up to which an estimator is taken for its accuracy."""

SAMPLES = 10_000
"""Samples that are estimated by both estimators."""

FACTS = "estimator_choice"
"""Name of the choice in the provenance of a map."""

SEED = 35

Chosen = Literal["linear", "nonlinear"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Choice:
    """The estimator that a map is used with.

    Attributes
    ----------
    used : the estimator.
    why : in words.
    flights : what they were compared on, in words; empty where they were not compared.
    scores : rows of all loads and of each, of both estimators, by name; empty where they were not compared.
    """

    used: Chosen
    why: str
    flights: str = ""
    scores: Mapping[str, list[Row]]

    @property
    def line(self) -> str:
        """The choice in a line."""
        on = f", on {self.flights}" if self.flights else ""
        return f"map.estimator 'auto': {self.used}, {self.why}{on}"

    def record(self) -> dict[str, Any]:
        """Return it for the provenance of a map."""
        return {
            "used": self.used,
            "why": self.why,
            "flights": self.flights,
            "rms": {name: by_load(rows[1:], "rms") for name, rows in self.scores.items()},
            "undetected": {name: _undetected(rows) for name, rows in self.scores.items()},
        }


def linear_because(why: str) -> Choice:
    """Return the choice of the linear estimator where the two are not compared."""
    return Choice(used="linear", why=why, scores={})


def compared(inverse_map: InverseMap, read: Readings, flights: str) -> Choice:
    """Return the better estimator of a map with tables on n samples.

    An estimator whose undetected errors exceed :data:`MOST_UNDETECTED` loses to one within it. Otherwise the
    rms errors of the nonlinear one, over the linear one's, decide by their median over the coefficients; the
    nonlinear one, which gives air data too, wins a tie.

    Parameters
    ----------
    read : with Mach number, p_inf and q_inf.
    flights : in words.
    """
    scores = {
        name: rows_of(COEFFICIENT_NAMES, of_map(inverse_map, name)(read), read) for name in ("linear", "nonlinear")
    }
    undetected = [_undetected(rows) for rows in scores.values()]
    safe = [fraction <= MOST_UNDETECTED for fraction in undetected]
    used: Chosen
    if safe[0] != safe[1]:
        used = "linear" if safe[0] else "nonlinear"
        percent = [f"{100.0 * fraction:.2g} %" for fraction in (undetected if safe[0] else undetected[::-1])]
        why = f"with {percent[0]} undetected errors where the other estimator has {percent[1]}"
        return Choice(used=used, why=why, flights=flights, scores=scores)
    linear, nonlinear, of_range = (
        np.array([row[column] for row in scores[name][1:]])
        for name, column in (("linear", "rms"), ("nonlinear", "rms"), ("linear", "rms_of_range"))
    )
    known = of_range > 0.0
    ratio = float(np.median(nonlinear[known] / linear[known])) if known.any() else 1.0
    used = "nonlinear" if ratio <= 1.0 else "linear"
    why = f"the nonlinear estimator has {ratio:.2g} times the rms error of the linear one (median coefficient)"
    return Choice(used=used, why=why, flights=flights, scores=scores)


def _undetected(rows: Sequence[Row]) -> float:
    """Return the fraction of undetected samples [1]."""
    return float(0.01 * rows[0]["undetected_percent"])


def compared_in_flights(inverse_map: InverseMap, flights: Readings) -> Choice:
    """Return the better estimator in ``flights`` of the independent model, some vehicles of each."""
    count = len(flights.conditions)
    vehicles = len(flights.strain) // count
    per_condition = min(vehicles, max(1, SAMPLES // count))
    rows = (vehicles * np.arange(count)[:, None] + np.arange(per_condition)).ravel()
    return compared(inverse_map, flights.rows(rows), f"{count} flights of the independent model")


def as_chosen(inverse_map: InverseMap, choice: Choice) -> InverseMap:
    """Return ``inverse_map`` for the estimator of ``choice``, which its provenance holds."""
    chosen = inverse_map if choice.used == "nonlinear" else inverse_map.without_tables()
    return replace(chosen, provenance={**chosen.provenance, FACTS: choice.record()})


class LeftOut(NamedTuple):
    """Flows that a map is made without: what they have in common, and their rows of the snapshots."""

    name: str
    rows: IntArray


def at_each_value(conditions: Sequence[FlightCondition], name: str) -> list[LeftOut]:
    """Return the flows at each value of a condition, in order: a map can do without one but the ends.

    Empty where there are too few values: Mach numbers need three, angles four.
    """
    value = np.round([getattr(condition, name) for condition in conditions], SAME_VALUE)
    distinct = np.unique(value)
    if len(distinct) < FEWEST_VALUES.get(name, 4):
        return []
    return [
        LeftOut(
            f"M {at:g}" if name == MACH_NUMBER else f"{_WORDS[name]} {degrees(at):.4g} deg",
            np.flatnonzero(value == at),
        )
        for at in distinct.tolist()
    ]


SAME_VALUE = 6
"""Decimals of Mach numbers and angles [rad] to which values count as one."""

FEWEST_VALUES = {MACH_NUMBER: 3}

_WORDS = {TOTAL_INCIDENCE: "total incidence", "angle_of_attack": "angle of attack", "sideslip_angle": "sideslip"}


def compared_on_left_out(
    snapshots: Snapshots, problem: Problem, build: Callable[[Snapshots], InverseMap]
) -> Choice:
    """Return the better estimator of the map that ``build`` makes, on snapshots that it is made without.

    ``problem`` is the one of all snapshots.
    """
    omitted = left_out(snapshots, problem.ensemble)
    if omitted is None:
        return linear_because("too few conditions to make a map without some of them")
    chosen = snapshots.chosen(np.setdiff1d(np.arange(len(snapshots.condition)), omitted.rows))
    try:
        made = build(chosen)
    except InputError as error:
        return linear_because(f"no map can be made without {omitted.name} ({error})")
    kept_keys = {_key(condition) for condition in chosen.conditions()}
    is_left = np.array([_key(condition) not in kept_keys for condition in problem.ensemble.conditions])
    read = _drawn(problem, np.tile(is_left, problem.ensemble.rolls))
    return compared(made, read, f"snapshots that a map was made without: {omitted.name}")


def _key(condition: FlightCondition) -> tuple[float, ...]:
    return tuple(
        np.round((condition.mach_number, condition.angle_of_attack, condition.sideslip_angle), 9).tolist()
    )


def left_out(snapshots: Snapshots, ensemble: Ensemble) -> LeftOut | None:
    """Return the snapshots to leave out: the flows at the middle value of every condition that has enough.

    Conditions are Mach number, and total incidence where flows are rolled, otherwise both angles. None where no
    condition has as many.
    """
    listed, angles = snapshots.conditions(), ("angle_of_attack", "sideslip_angle")
    names = (MACH_NUMBER, *((TOTAL_INCIDENCE,) if ensemble.grid is not None else angles))
    by_condition = [at_each_value(listed, name) for name in names]
    middle = [parts[len(parts) // 2] for parts in by_condition if parts]
    if not middle:
        return None
    rows = np.unique(np.concatenate([part.rows for part in middle]))
    return LeftOut(", ".join(part.name for part in middle), rows)


def _drawn(problem: Problem, members: BoolArray) -> Readings:
    """Return what vehicles read in the flows ``members`` (n,) of the ensemble.

    The flows are at the nominal dynamic pressure. Errors of the pressure itself are not drawn.
    """
    ensemble, noise, random = problem.ensemble, problem.tolerances, np.random.default_rng(SEED)
    rows = np.flatnonzero(members)
    rows = rows[np.arange(SAMPLES) % len(rows)] if len(rows) < SAMPLES else random.permutation(rows)[:SAMPLES]
    strain = problem.strain[rows]
    for error in problem.errors:
        shape = (len(rows), 1) if error.common else strain.shape
        strain += error.strain[rows] * random.standard_normal(shape)
    for term in problem.noise:
        if not term.scales:
            strain += term.draw(random, len(rows))
    mach = np.tile([condition.mach_number for condition in ensemble.conditions], ensemble.rolls)[rows]
    pressure = np.tile(ensemble.ambient_pressure, ensemble.rolls)[rows]
    normal = random.standard_normal((3, len(rows)))
    known = {
        DYNAMIC_PRESSURE: ensemble.nominal_dynamic_pressure
        * (1.0 + 0.01 * noise.dynamic_pressure_percent * normal[0]),
        MACH_NUMBER: mach + noise.navigation_mach_number * normal[1],
        STATIC_PRESSURE: pressure * (1.0 + 0.01 * noise.navigation_static_pressure_percent * normal[2]),
    }
    loads = ensemble.responses(problem.load_operator[FIVE_LOADS])[rows]
    return Readings(
        strain=strain, known=known, truth=loads * ensemble.scale[0], vehicle=np.arange(len(rows)), flight=rows
    )


Estimators = Literal["auto", "linear", "nonlinear"]


def estimator_of(inverse_map: InverseMap) -> Estimators:
    """Return the estimator that a map is for."""
    return "linear" if inverse_map.manifold is None else "nonlinear"


def with_estimator(vehicle: Vehicle, estimator: Estimators | None) -> Vehicle:
    """Return ``vehicle`` with another estimator in its section [map]; None leaves it.

    Raises
    ------
    InputError
        There is no estimator of this name, or the vehicle file does not fit the nonlinear estimator.
    """
    if estimator is None:
        return vehicle
    if (reason := wrong_estimator(estimator)) is not None:
        raise InputError(f"--estimator: {reason}")
    entry = vehicle.map
    if estimator == "nonlinear":
        requirements = {
            "map.form": (entry.form, PER_PRESSURE),
            "strains per snapshot": ("none" if vehicle.structure.strain_per_snapshot is None else "some", "none"),
        }
        if vehicle.is_axisymmetric:
            requirements["map.symmetry"] = (entry.symmetry, "full")
        for name, (got, needed) in requirements.items():
            if got != needed:
                raise InputError(f"--estimator nonlinear: needs {name} {needed!r}, got {got!r}")
    return vehicle.model_copy(update={"map": entry.model_copy(update={"estimator": estimator})})
