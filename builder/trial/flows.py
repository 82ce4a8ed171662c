"""Pressure of a trial: flows beyond the envelope, another engine's, higher all over, and spots of pressure on
them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Literal

import numpy as np

from builder.aero.deflections import deflections_of
from builder.aero.engines.newtonian import NewtonianEngine, tangent_cone_pressure_ratio
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.flow_models import other_leeward
from builder.truth.flow_table import FlowTable, cosine_series, truth_surface
from builder.vehicle.file import Vehicle
from builder.vehicle.toml.toml_sections import Section
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition


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

    def share(self, count: int, random: np.random.Generator | None) -> FloatArray | float:
        """Return the part of its difference that each of ``count`` flights has, (count, 1) or one for all."""
        if not self.drawn:
            return 1.0
        assert random is not None
        return self.drawn * random.standard_normal((count, 1))

    def table(self, vehicle: Vehicle, flows: FlowTable) -> FlowTable:
        """Return it as harmonics, instead of the harmonics of ``flows``."""
        surface, n_m = truth_surface(vehicle), flows.harmonic.shape[3]
        knots = product(flows.mach_knots.tolist(), flows.incidence_knots.tolist())
        # Without sideslip the leeward meridian is at roll angle 0, as the table counts.
        conditions = [FlightCondition(mach, incidence, 0.0, 0.0) for mach, incidence in knots]
        ratio = self._ratio(vehicle, mesh_of_grid(surface), conditions)
        series = np.array([cosine_series(surface.as_map(values), n_m) for values in ratio])
        harmonic = series.reshape(flows.harmonic.shape)
        if self.engine is None:
            return replace(flows, harmonic=flows.harmonic + harmonic)
        return replace(flows, harmonic=harmonic, provenance=flows.provenance | {"engine": self.engine})

    def surface(self, vehicle: Vehicle, flows: Snapshots) -> Snapshots:
        """Return it at the nodes of ``flows``, instead of theirs."""
        conditions = flows.conditions()
        ambient = np.array([condition.ambient_pressure for condition in conditions])[:, None]
        pressure = ambient * self._ratio(vehicle, flows.surface, conditions)
        return replace(flows, pressure=pressure if self.engine is not None else flows.pressure + pressure)

    def _ratio(self, vehicle: Vehicle, surface: SurfaceMesh, conditions: Sequence[FlightCondition]) -> FloatArray:
        """Return p / p_inf (k, n_p) of the other engine at the nodes of ``surface``, or what is added to it."""
        if self.engine == "tangent cones":
            return np.array([_tangent_cones(surface.node_normal, condition) for condition in conditions])
        if self.engine is not None:
            engine = _other_engine(vehicle, surface)
            flows = [engine.solve(engine.flow_key(condition)) for condition in conditions]
            return np.array([engine.pressure_ratio(*both) for both in zip(flows, conditions, strict=True)])
        x, y, z = surface.point.T
        leeward = np.array([condition.leeward_roll_angle for condition in conditions])[:, None]
        more = np.full((len(conditions), len(x)), self.raised)
        if self.spot is not None:
            more += self.spot.size * self.spot.around(np.arctan2(y, z) - leeward) * self.spot.along(x)
        return more


def _other_engine(vehicle: Vehicle, surface: SurfaceMesh) -> NewtonianEngine:
    """Return Modified Newtonian theory with another leeward side: of a body of revolution Prandtl-Meyer.

    Source: :mod:`builder.aero.engines.newtonian`.
    """
    if vehicle.is_axisymmetric:
        return NewtonianEngine(surface, leeward="prandtl_meyer")
    stagnation = vehicle.aerodynamics.stagnation or "rayleigh_pitot"
    return NewtonianEngine(
        surface, stagnation, other_leeward(vehicle.aerodynamics), deflections_of(vehicle.flow_entries(), surface)
    )


def _tangent_cones(normal: FloatArray, condition: FlightCondition) -> FloatArray:
    """Return p / p_inf of tangent cones at nodes with outer ``normal`` (n_p, 3)."""
    alpha, beta = condition.angle_of_attack, condition.sideslip_angle
    stream = np.array([np.cos(alpha) * np.cos(beta), -np.sin(beta), np.sin(alpha) * np.cos(beta)])
    return tangent_cone_pressure_ratio(condition.mach_number, -normal @ stream)
