"""Pressure of the stress test: flows beyond the envelope, another engine's, and spots of pressure on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from builder.aero.deflections import deflections_of
from builder.aero.engine import FlowKey
from builder.aero.engines.local_inclination import tangent_cone_pressure_ratio
from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.journal import Journal
from builder.campaign.run import complete_flows
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.leeward import other_leeward
from builder.reporting import Reporter
from builder.stress.flights import stress_knots
from builder.truth.revolution.flow_table import FlowTable, flow_table
from builder.truth.revolution.flows import truth_engine, truth_surface
from builder.vehicle.file import Vehicle
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import FlowReachError
from strainfmu.flight_condition import MACH_NUMBER, FlightCondition


class OtherFlow(Protocol):
    """Another pressure at the same conditions."""

    def on_table(self, vehicle: Vehicle, table: FlowTable) -> FlowTable:
        """Return it as harmonics, instead of the harmonics of ``table``."""
        ...

    def on_surface(self, vehicle: Vehicle, flows: Snapshots) -> Snapshots:
        """Return it at the nodes of ``flows``, instead of theirs."""
        ...


def stress_flow_inputs(vehicle: Vehicle) -> dict[str, Any]:
    """Return what the flows of the stress test depend on."""
    mach, incidence = stress_knots(vehicle)
    return {
        "engine": truth_engine(vehicle).inputs(),
        MACH_NUMBER: mach.tolist(),
        "total_incidence": incidence.tolist(),
        "resolution": vehicle.resolution.truth.model_dump(),
    }


def stress_flows(
    vehicle: Vehicle, reporter: Reporter, journal: Journal | None = None, scheduling: Scheduling | None = None
) -> FlowTable:
    """Solve the flows at the knots of the stress test as far as the solver reaches, and return their table.

    Raises
    ------
    FlowReachError
        The solver reaches less than two Mach numbers or two incidences.
    """
    mach, incidence = stress_knots(vehicle)
    failed: dict[FlowKey, str] = {}
    flows, _ = complete_flows(
        engine=truth_engine(vehicle),
        keys=[(m, a) for m in mach.tolist() for a in incidence.tolist()],
        journal=journal,
        known={},
        scheduling=scheduling or Scheduling(),
        reporter=reporter,
        title="Flow: beyond the envelope",
        failed=failed,
    )
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
    return flow_table(
        vehicle=vehicle.name,
        mach=mach[rows],
        incidence=incidence[columns],
        flows=flows,
        surface=truth_surface(vehicle),
        max_harmonic=vehicle.resolution.truth.harmonics,
        provenance={"resolution": vehicle.resolution.truth.model_dump(), "flows": len(flows)},
    )


def solved_knots(solved: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Return rows and columns of ``solved`` (n_M, n_a) to keep, so that all between them is true.

    The outermost row or column with the largest fraction of failures goes first: lowest or highest Mach number,
    largest incidence.
    """
    rows, columns = np.ones(solved.shape[0], dtype=bool), np.ones(solved.shape[1], dtype=bool)
    while rows.any() and columns.any() and not solved[np.ix_(rows, columns)].all():
        kept, there = np.flatnonzero(rows), np.flatnonzero(columns)
        left = ~solved[np.ix_(rows, columns)]
        fractions = [left[0].mean(), left[-1].mean(), left[:, -1].mean()]
        if max(fractions) == 0.0:  # a hole in the middle: the largest incidence goes until it is at the border
            fractions[2] = 1.0
        worst = int(np.argmax(fractions))
        if worst == 2:
            columns[there[-1]] = False
        else:
            rows[kept[0 if worst == 0 else -1]] = False
    return rows, columns


def newtonian_flows(vehicle: Vehicle, table: FlowTable) -> FlowTable:
    """Return the pressure of modified Newtonian theory, Prandtl-Meyer leeward, at the knots of ``table``.

    Source: :mod:`builder.aero.engines.local_inclination`.
    """
    engine = NewtonianEngine(mesh_of_grid(truth_surface(vehicle)), leeward="prandtl_meyer")
    return _other_table(
        vehicle,
        table,
        # Without sideslip the leeward meridian is at roll angle 0, as the table counts.
        lambda mach, incidence: engine.solve((mach, incidence, 0.0)).arrays["pressure_ratio"],
        "newtonian",
    )


def _other_table(
    vehicle: Vehicle, table: FlowTable, ratio_at: Callable[[float, float], FloatArray], engine: str
) -> FlowTable:
    """Return ``table`` with p / p_inf of ``ratio_at`` (M, total incidence [rad]) at the nodes of the surface."""
    surface, n_m = truth_surface(vehicle), table.harmonic.shape[3]
    weight = np.where(np.arange(n_m) == 0, 1.0, 2.0) / surface.n_roll
    harmonic = np.empty_like(table.harmonic)
    for i, mach in enumerate(table.mach_knots.tolist()):
        for j, incidence in enumerate(table.incidence_knots.tolist()):
            ratio = ratio_at(mach, incidence)
            harmonic[i, j] = np.fft.rfft(surface.as_map(ratio), axis=1).real[:, :n_m] * weight
    return replace(table, harmonic=harmonic, provenance={**table.provenance, "engine": engine})


@dataclass(frozen=True)
class AnotherEngine:
    """Pressure of another theory: newtonian instead of Euler, and of newtonian flow another leeward side."""

    def on_table(self, vehicle: Vehicle, table: FlowTable) -> FlowTable:
        return newtonian_flows(vehicle, table)

    def on_surface(self, vehicle: Vehicle, flows: Snapshots) -> Snapshots:
        surface, stagnation = flows.surface, vehicle.aerodynamics.stagnation or "rayleigh_pitot"
        moved = deflections_of(vehicle, surface)
        engine = NewtonianEngine(surface, stagnation, other_leeward(vehicle), moved)
        conditions = flows.conditions()
        ratio = [engine.pressure_ratio(engine.solve(engine.flow_key(one)), one) for one in conditions]
        ambient = np.array([one.ambient_pressure for one in conditions])
        return replace(flows, pressure=ambient[:, None] * np.array(ratio))


@dataclass(frozen=True)
class TangentCones:
    """Pressure of tangent cones on a body, or a shape whose surface does not move."""

    def on_table(self, vehicle: Vehicle, table: FlowTable) -> FlowTable:
        normal = mesh_of_grid(truth_surface(vehicle)).node_normal

        def ratio(mach: float, incidence: float) -> FloatArray:
            return tangent_cone_pressure_ratio(
                mach, -normal @ np.array([np.cos(incidence), 0.0, np.sin(incidence)])
            )

        return _other_table(vehicle, table, ratio, "tangent cones")

    def on_surface(self, vehicle: Vehicle, flows: Snapshots) -> Snapshots:
        normal, conditions = flows.surface.node_normal, flows.conditions()
        ratio = [tangent_cone_pressure_ratio(one.mach_number, -normal @ _wind(one)) for one in conditions]
        ambient = np.array([one.ambient_pressure for one in conditions])
        return replace(flows, pressure=ambient[:, None] * np.array(ratio))


def _wind(condition: FlightCondition) -> FloatArray:
    """Return the direction (3,) of the free stream."""
    alpha, beta = condition.angle_of_attack, condition.sideslip_angle
    return np.array([np.cos(alpha) * np.cos(beta), -np.sin(beta), np.sin(alpha) * np.cos(beta)])


@dataclass(frozen=True, kw_only=True)
class Spots:
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

    def on_table(self, vehicle: Vehicle, table: FlowTable) -> FlowTable:
        surface, n_m = truth_surface(vehicle), table.harmonic.shape[3]
        amplitude = np.fft.rfft(self._around(surface.roll_angle)).real[:n_m] / surface.n_roll
        amplitude[1:] *= 2.0
        return replace(table, harmonic=table.harmonic + self.size * np.outer(self._along(surface.x), amplitude))

    def on_surface(self, vehicle: Vehicle, flows: Snapshots) -> Snapshots:
        x, y, z = flows.point.T
        conditions = flows.conditions()
        leeward = np.array([one.leeward_roll_angle for one in conditions])[:, None]
        shape = self._around(np.arctan2(y, z) - leeward) * self._along(x)
        ambient = np.array([one.ambient_pressure for one in conditions])[:, None]
        return replace(flows, pressure=flows.pressure + self.size * ambient * shape)

    def _along(self, x: FloatArray) -> FloatArray:
        """Return the spot along the body, by its stations ``x`` [m]."""
        of_length = x / x.max()
        return np.asarray(np.exp(-0.5 * ((of_length - self.place) / self.length) ** 2))

    def _around(self, from_leeward: FloatArray) -> FloatArray:
        """Return the spots round the body, by the angle from the leeward meridian [rad]."""
        roll, width = np.radians(self.roll_deg), np.radians(self.width_deg)
        sides = (roll,) if self.roll_deg == 180.0 else (roll, -roll)
        off = (np.mod(from_leeward - side + np.pi, 2.0 * np.pi) - np.pi for side in sides)
        return np.asarray(sum(np.exp(-0.5 * (one / width) ** 2) for one in off))


def windward_bump(size: float) -> Spots:
    """Return a bump of ``size`` p_inf at mid-body, windward, as of a local separation."""
    return Spots(size=size, place=0.5, length=0.03, roll_deg=180.0, width_deg=20.0)


VORTEX_PAIRS = (
    (0.3, 0.1, 25.0, 10.0),
    (0.5, 0.1, 25.0, 10.0),
    (0.7, 0.1, 25.0, 10.0),
    (0.85, 0.05, 20.0, 8.0),
    (0.6, 0.3, 30.0, 15.0),
)
"""Place, length, roll angle and width of the suction below pairs of leeward vortices, as of :class:`Spots`."""


def vortex_pairs(size: float) -> dict[str, Spots]:
    """Return pairs of leeward vortices of ``size`` p_inf, by where they lie."""
    return {
        f"{place:g} L": Spots(size=size, place=place, length=length, roll_deg=roll, width_deg=width)
        for place, length, roll, width in VORTEX_PAIRS
    }
