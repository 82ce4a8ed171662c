"""Pressure of a trial: flows beyond the envelope, another engine's, higher all over, and spots of pressure on
them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any, Literal

import numpy as np

from builder.aero.deflections import deflections_of
from builder.aero.engine import FlowKey
from builder.aero.engines.local_inclination import tangent_cone_pressure_ratio
from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.campaign.campaign_run import complete_flows
from builder.campaign.journal import Journal
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.leeward import other_leeward
from builder.reporting import Reporter
from builder.trial.conditions import stress_knots
from builder.truth.revolution.flow_table import (
    FlowTable,
    cosine_series,
    flow_keys,
    flow_table,
    truth_engine,
    truth_surface,
)
from builder.vehicle.file import Vehicle
from builder.vehicle.toml.toml_sections import Section
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import FlowReachError
from strainfmu.flight_condition import MACH_NUMBER, FlightCondition


class Spot(Section):
    """Pressure of ``size`` p_inf more on Gaussian spots that lie symmetric to the plane of the wind.

    Attributes
    ----------
    size : largest pressure over p_inf [1].
    place, length : of the middle, and standard deviation, along the body over its length [1].
    roll_deg, width_deg : to both sides of the leeward meridian, and standard deviation [deg]; 180 is one spot,
        windward.
    """

    size: float
    place: float
    length: float
    roll_deg: float
    width_deg: float

    def along(self, x: FloatArray) -> FloatArray:
        """Return the spot along the body, by its stations ``x`` [m]."""
        return np.asarray(np.exp(-0.5 * ((x / x.max() - self.place) / self.length) ** 2))

    def around(self, from_leeward: FloatArray) -> FloatArray:
        """Return the spots round the body, by the angle from the leeward meridian [rad]."""
        roll, width = np.radians(self.roll_deg), np.radians(self.width_deg)
        sides = (roll,) if self.roll_deg == 180.0 else (roll, -roll)
        off = (np.mod(from_leeward - side + np.pi, 2.0 * np.pi) - np.pi for side in sides)
        return np.asarray(sum(np.exp(-0.5 * (angle / width) ** 2) for angle in off))


class Flow(Section):
    """Another pressure at the same conditions; its loads count as true.

    Attributes
    ----------
    engine : Modified Newtonian theory, on a shape with another leeward side than the map's; or the cone that is
        tangent at each point, on a body of revolution.
    drawn : each flight has its difference times a normal number of this standard deviation; 0 for all of it.
    raised : higher by so many p_inf all over the surface.
    spot : more on spots.
    """

    engine: Literal["newtonian", "tangent cones"] | None = None
    drawn: float = 0.0
    raised: float = 0.0
    spot: Spot | None = None

    def table(self, vehicle: Vehicle, flows: FlowTable) -> FlowTable:
        """Return it as harmonics, instead of the harmonics of ``flows``."""
        surface, n_m = truth_surface(vehicle), flows.harmonic.shape[3]
        if self.engine is not None:
            ratio_at = self._ratio_at(vehicle, mesh_of_grid(surface))
            knots = product(flows.mach_knots.tolist(), flows.incidence_knots.tolist())
            # Without sideslip the leeward meridian is at roll angle 0, as the table counts.
            ratio = [ratio_at(FlightCondition(mach, incidence, 0.0, 0.0)) for mach, incidence in knots]
            series = np.array([cosine_series(surface.as_map(values), n_m) for values in ratio])
            harmonic, engine = series.reshape(flows.harmonic.shape), {"engine": self.engine}
            return replace(flows, harmonic=harmonic, provenance=flows.provenance | engine)
        harmonic = flows.harmonic.copy()
        harmonic[..., 0] += self.raised
        if self.spot is not None:
            amplitude = cosine_series(self.spot.around(surface.roll_angle), n_m)
            harmonic = harmonic + self.spot.size * np.outer(self.spot.along(surface.x), amplitude)
        return replace(flows, harmonic=harmonic)

    def surface(self, vehicle: Vehicle, flows: Snapshots) -> Snapshots:
        """Return it at the nodes of ``flows``, instead of theirs."""
        conditions = flows.conditions()
        ambient = np.array([condition.ambient_pressure for condition in conditions])[:, None]
        if self.engine is not None:
            ratio_at = self._ratio_at(vehicle, flows.surface)
            return replace(flows, pressure=ambient * np.array([ratio_at(condition) for condition in conditions]))
        shape: FloatArray | float = self.raised
        if self.spot is not None:
            x, y, z = flows.point.T
            leeward = np.array([condition.leeward_roll_angle for condition in conditions])[:, None]
            shape = self.spot.size * self.spot.around(np.arctan2(y, z) - leeward) * self.spot.along(x)
        return replace(flows, pressure=flows.pressure + ambient * shape)

    def _ratio_at(self, vehicle: Vehicle, surface: SurfaceMesh) -> Callable[[FlightCondition], FloatArray]:
        """Return p / p_inf at the nodes of ``surface`` by condition.

        Source: :mod:`builder.aero.engines.local_inclination`. Leeward of a body of revolution is Prandtl-Meyer.
        """
        if self.engine == "tangent cones":
            return partial(_tangent_cones, surface.node_normal)
        if vehicle.is_axisymmetric:
            engine = NewtonianEngine(surface, leeward="prandtl_meyer")
        else:
            stagnation = vehicle.aerodynamics.stagnation or "rayleigh_pitot"
            engine = NewtonianEngine(surface, stagnation, other_leeward(vehicle), deflections_of(vehicle, surface))
        return lambda condition: engine.pressure_ratio(engine.solve(engine.flow_key(condition)), condition)


def _tangent_cones(normal: FloatArray, condition: FlightCondition) -> FloatArray:
    """Return p / p_inf of tangent cones at nodes with outer ``normal`` (n_p, 3)."""
    alpha, beta = condition.angle_of_attack, condition.sideslip_angle
    stream = np.array([np.cos(alpha) * np.cos(beta), -np.sin(beta), np.sin(alpha) * np.cos(beta)])
    return tangent_cone_pressure_ratio(condition.mach_number, -normal @ stream)


def stress_flow_inputs(vehicle: Vehicle, square: float | None = None) -> dict[str, Any]:
    """Return what the flows of :func:`stress_flows` depend on."""
    mach, incidence = stress_knots(vehicle, square)
    return {
        "engine": truth_engine(vehicle).inputs(),
        MACH_NUMBER: mach.tolist(),
        "total_incidence": incidence.tolist(),
        "resolution": vehicle.resolution.truth.model_dump(),
    }


def stress_flows(
    vehicle: Vehicle,
    reporter: Reporter,
    journal: Journal | None = None,
    scheduling: Scheduling | None = None,
    square: float | None = None,
) -> FlowTable:
    """Solve the flows inside the envelope and beyond it as far as the solver reaches, and return their table; the
    flows of a ``square`` alone where there is one.

    Raises
    ------
    FlowReachError
        The solver reaches less than two Mach numbers or two incidences.
    """
    mach, incidence = stress_knots(vehicle, square)
    failed: dict[FlowKey, str] = {}
    title = "Flow: inside the envelope" if square else "Flow: beyond the envelope"
    how: dict[str, Any] = {"journal": journal, "scheduling": scheduling, "failed": failed}
    flows, _ = complete_flows(truth_engine(vehicle), flow_keys(mach, incidence), reporter, title, **how)
    solved = np.array([[(m, a) not in failed for a in incidence.tolist()] for m in mach.tolist()])
    rows, columns = solved_knots(solved)
    if rows.sum() < 2 or columns.sum() < 2:
        raise FlowReachError(f"flows beyond the envelope: {next(iter(failed.values()))}")
    if failed:
        reporter.note(
            f"{len(failed)} of {solved.size} flows beyond the envelope are out of the solver's reach: flights "
            f"from M {mach[rows][0]:.3g} to {mach[rows][-1]:.3g}, total incidence up to "
            f"{np.degrees(incidence[columns][-1]):.3g} deg"
        )
    return flow_table(vehicle, mach[rows], incidence[columns], flows)


def solved_knots(solved: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Return rows and columns of ``solved`` (n_M, n_a) to keep, so that all between them is true.

    The outermost row or column with the largest fraction of failures goes first: lowest or highest Mach number,
    largest incidence.
    """
    rows, columns = np.ones(solved.shape[0], dtype=bool), np.ones(solved.shape[1], dtype=bool)
    while rows.any() and columns.any() and not solved[np.ix_(rows, columns)].all():
        row_numbers, column_numbers = np.flatnonzero(rows), np.flatnonzero(columns)
        failed = ~solved[np.ix_(rows, columns)]
        fractions = [failed[0].mean(), failed[-1].mean(), failed[:, -1].mean()]
        if max(fractions) == 0.0:  # a hole in the middle: the largest incidence goes until it is at the border
            fractions[2] = 1.0
        worst = int(np.argmax(fractions))
        if worst == 2:
            columns[column_numbers[-1]] = False
        else:
            rows[row_numbers[0 if worst == 0 else -1]] = False
    return rows, columns
