"""Estimators of several kinds on the same readings: maps that are built for the errors of a case, a filter whose
states walk at random, and regressions that learn from their tables.

A name may state what is given of the air data: "nonlinear, q_inf only", "nonlinear, M and p_inf only".

The error of a pressure field is |p_estimate - p| / |p| over the pressure nodes of the map, p absolute, in the
Euclidean norm: the error of the reproduction of the source (:mod:`builder.reproduce.case_1`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from builder.aero.surface.mesh import mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.problem import AnyStructure
from builder.manifold.nonlinear_build import with_manifold
from builder.trial.bound import KNOWN, cramer_rao_bound
from builder.trial.cases import Case
from builder.trial.conditions import drawn_altitudes_km
from builder.trial.estimators import EstimateReadings, Estimates, known_by, with_inputs
from builder.trial.other_estimators import REGRESSIONS, of_random_walk, of_regression, training_flights
from builder.trial.readings import ANGLES, Readings
from builder.trial.world import World
from builder.truth.revolution.flow_table import FlowTable, ratio_at, truth_surface
from builder.truth.shape import at_conditions, on_nodes
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import MapEntry
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_data import AIR_DATA_NAMES
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import PER_PRESSURE, InverseMap

LINEAR_1, LINEAR_2, NONLINEAR, RANDOM_WALK = "linear Case 1", "linear Case 2", "nonlinear", "Kalman filter"

NAMES = (LINEAR_1, LINEAR_2, NONLINEAR, RANDOM_WALK, *REGRESSIONS)

INPUTS = {"": KNOWN, "q_inf only": (DYNAMIC_PRESSURE,), "M and p_inf only": (MACH_NUMBER, STATIC_PRESSURE)}
"""What is given of the air data, by the end of an estimator's name."""

AIR_DATA, FIELD = (*ANGLES, MACH_NUMBER, STATIC_PRESSURE, DYNAMIC_PRESSURE), "pressure field"
"""What is scored besides loads, by the names of the table."""

DISCREPANCY = {
    "discrepancy_percent": 0.8,
    "discrepancy_of_prior_percent": 1.0,
    "discrepancy_of_overpressure_percent": 1.0,
    "discrepancy_of_leeward_percent": 1.0,
}
"""Entries of a map that knows of gauge noise alone."""

ALTITUDES_KM = (15.0, 28.0)
"""Of training flights, where the map holds there."""


def refuse_unknown(names: Sequence[str]) -> None:
    """Refuse estimators that there are not."""
    for name in names:
        kind, _, inputs = name.partition(", ")
        if kind not in NAMES or inputs not in INPUTS:
            given = ", ".join(one for one in INPUTS if one)
            raise InputError(f"estimators: expected {', '.join(NAMES)}, or with an end of {given}; got '{name}'")


def knowing(vehicle: Vehicle, is_exact: bool, case: int) -> Vehicle:
    """Return ``vehicle`` with a map of ``case`` with tables and field, which knows of gauge noise alone or of all
    errors."""
    entry = vehicle.map.model_dump() | {
        "case": case,
        "form": PER_PRESSURE,
        "symmetry": "full" if vehicle.is_of_revolution else "listed",
        "estimator": NONLINEAR,
        "gamma": 1.0,
        "keep_field": True,
    }
    noise = vehicle.noise.without_hardware_errors() if is_exact else vehicle.noise
    return vehicle.model_copy(
        update={"map": MapEntry(**entry | (DISCREPANCY if is_exact else {})), "noise": noise}
    )


def maps_for(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, is_exact: bool
) -> dict[str, InverseMap]:
    """Return the linear maps of both cases, and the first one with tables.

    Raises
    ------
    InputError
        The flows of the map do not suffice for tables.
    """
    first, second = (knowing(vehicle, is_exact, case) for case in (1, 2))
    maps = {
        name: build_inverse_map(one, snapshots, structure) for name, one in ((LINEAR_1, first), (LINEAR_2, second))
    }
    tables = with_manifold(inverse_map=maps[LINEAR_1], vehicle=first, snapshots=snapshots, structure=structure)
    return {**maps, NONLINEAR: tables}


@dataclass(eq=False, kw_only=True)
class ComparedWorld(World):
    """A world whose maps are built for the errors of each case.

    Attributes
    ----------
    snapshots, map_structure : what the maps are built from.
    training : flights that each regression learns from; a third as many are for its bands.
    made : maps by whether they know of gauge noise alone, and regressions.
    """

    snapshots: Snapshots
    map_structure: AnyStructure
    training: int
    made: dict[Any, Any] = field(default_factory=dict)

    def maps(self, case: Case) -> dict[str, InverseMap]:
        """Return the maps that know of the errors of ``case``, by estimator."""
        is_exact = not case.built.stated
        if is_exact not in self.made:
            self.made[is_exact] = maps_for(self.vehicle, self.snapshots, self.map_structure, is_exact)
        maps: dict[str, InverseMap] = self.made[is_exact]
        return maps

    def bound(self, case: Case, estimator: str = "") -> FloatArray | None:
        """Return (k, 5) the Cramer-Rao bound with what ``estimator`` is given; None of one of many readings."""
        kind, _, inputs = estimator.partition(", ")
        if kind == RANDOM_WALK:
            return None
        conditions, std = self.flights(case).conditions, np.nan if case.built.stated else 0.0
        return cramer_rao_bound(self.maps(case)[NONLINEAR], conditions, INPUTS[inputs], std)

    def fields(self, case: Case) -> FloatArray:
        """Return (k, n_p) [Pa] the true pressure at the nodes of the maps."""
        conditions, surface = self.flights(case).conditions, self.map_structure.surface
        if isinstance(self.flows, Snapshots):
            flows = at_conditions(self.flows, conditions)
            assert flows is not None
            return on_nodes(flows, mesh_of(surface))
        assert isinstance(self.flows, FlowTable)
        assert isinstance(surface, SurfaceGrid)
        weights = station_weights(truth_surface(self.vehicle).x, surface.x)
        ratio = ratio_at(self.flows, conditions, surface.roll_angle, weights)
        return np.array([one.ambient_pressure for one in conditions])[:, None] * ratio

    def learned(self, case: Case, kind: str, with_mach: bool) -> EstimateReadings:
        """Return a regression that is trained on the tables for ``case``."""
        is_exact = not case.built.stated
        if (key := (is_exact, kind, with_mach)) not in self.made:
            manifold, random = (
                self.maps(case)[NONLINEAR].manifold,
                np.random.default_rng([self.seed, not is_exact]),
            )
            assert manifold is not None
            altitudes = drawn_altitudes_km(self.vehicle, ALTITUDES_KM)
            training, calibration = (
                training_flights(manifold, altitudes, count, random)
                for count in (self.training, self.training // 3)
            )
            if not with_mach:
                known = {DYNAMIC_PRESSURE: training.known[DYNAMIC_PRESSURE]}
                training = Readings(**{**vars(training), "known": known})
            self.made[key] = of_regression(kind, training, calibration, self.seed)
        estimate: EstimateReadings = self.made[key]
        return estimate


def compared_estimators(world: ComparedWorld, case: Case, names: Sequence[str]) -> dict[str, EstimateReadings]:
    """Return the estimators of ``names`` for ``case``."""
    maps, fields = world.maps(case), cache(lambda: world.fields(case))

    def made(kind: str, inputs: str) -> EstimateReadings:
        if kind in REGRESSIONS:
            return world.learned(case, kind, MACH_NUMBER in INPUTS[inputs])
        if kind == RANDOM_WALK:
            return of_random_walk(maps[LINEAR_2])
        inverse_map = maps[kind]
        estimator = Estimator(inverse_map if kind == NONLINEAR else inverse_map.without_tables())
        return lambda read: _with_field(estimator, read, fields()[read.flight])

    parts = {name: name.partition(", ") for name in names}
    return {name: with_inputs(made(kind, inputs), INPUTS[inputs]) for name, (kind, _, inputs) in parts.items()}


def _with_field(estimator: Estimator, read: Readings, field_pressure: FloatArray) -> Estimates:
    """Return the estimates of last readings, with M_R where it is estimated and known, air data, and the error of
    the field relative to the true one (n, n_p) [Pa]."""
    made = estimator.estimate(read.last, **known_by(estimator, read.known))
    value, std, others = made.coefficients, made.coefficients_std, dict[str, tuple[FloatArray, FloatArray]]()
    if read.truth.shape[1] > value.shape[1] and made.other_coefficients.shape[-1]:
        value, std = np.column_stack([value, made.M_R]), np.column_stack([std, made.sigma.M_R])
    if estimator.is_nonlinear:
        columns = [(name, AIR_DATA_NAMES.index(name)) for name in AIR_DATA]
        others = {name: (made.air_data.value[:, k], made.air_data.std[:, k]) for name, k in columns}
    pressure = estimated_fields(made, np.broadcast_to(read.known.get(STATIC_PRESSURE, np.nan), len(value)))
    if not np.isnan(pressure).any():
        others[FIELD] = field_errors(pressure, field_pressure), np.full(len(value), np.nan)
    return Estimates(value=value, std=std, health=np.asarray(made.health, dtype=np.int64), others=others)


def estimated_fields(made: Estimate, static_pressure: FloatArray) -> FloatArray:
    """Return (k, n_p) [Pa] the absolute pressure at the nodes of a map by its estimates, NaN where it has none.

    Strain of a vented body says nothing of p_inf: to a field that is p - p_inf, ``static_pressure`` (k,) is added.
    """
    fields = [made[sample].pressure(with_std=False) for sample in range(len(made))]
    ambient = [p_inf if one.is_net else 0.0 for one, p_inf in zip(fields, static_pressure.tolist(), strict=True)]
    return np.stack([one.pressure for one in fields]) + np.array(ambient)[:, None]


def field_errors(estimate: FloatArray, true: FloatArray) -> FloatArray:
    """Return (k,) field errors [1] of ``estimate`` and ``true`` (k, n_p) [Pa]."""
    difference, size = (np.sqrt(np.sum(one**2, axis=1)) for one in (estimate - true, true))
    return np.asarray(difference / size)


def station_weights(source: FloatArray, target: FloatArray) -> FloatArray:
    """Return (n_target, n_source) weights of linear interpolation along the body.

    Stations are doubled at slope breaks, where the pressure jumps: each piece is interpolated on its own.
    """
    out = np.zeros((len(target), len(source)))
    for rows, columns in zip(_pieces(target), _pieces(source), strict=True):
        unit = np.eye(columns.stop - columns.start)
        out[rows, columns] = np.stack([np.interp(target[rows], source[columns], one) for one in unit], axis=1)
    return out


def _pieces(x: FloatArray) -> list[slice]:
    ends = [0, *(np.flatnonzero(np.diff(x) <= 0.0) + 1).tolist(), len(x)]
    return [slice(first, last) for first, last in pairwise(ends)]
