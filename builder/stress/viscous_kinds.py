"""Kinds of error by viscosity, which the flows of a map do not have: pressure of the displaced flow, friction.

The axial coefficient is the pressure's, without friction. Even pressure acts on the wall as the internal pressure
does, so that health does not detect it; the vehicle file can state its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.stress.kind import Kind, as_stated
from builder.structure.fourier.inertia_strain import inertia_strain
from builder.structure.fourier.meridian_mesh import MeridianMasses
from builder.structure.fourier.model import place_layouts
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.wall import wall_of
from builder.truth.revolution.flow_table import FlowTable
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition

OVERPRESSURE = 0.3
"""Pressure of the displaced flow over the whole surface, over p_inf [1]."""

FRICTION = 0.01
"""Axial coefficient of friction that is spread evenly over the surface [1]."""


@dataclass(frozen=True, kw_only=True)
class Raised:
    """Pressure that is higher by ``size`` p_inf all over the surface; its loads count as true."""

    size: float

    def on_table(self, vehicle: Vehicle, table: FlowTable) -> FlowTable:
        harmonic = table.harmonic.copy()
        harmonic[..., 0] += self.size
        return replace(table, harmonic=harmonic)

    def on_surface(self, vehicle: Vehicle, flows: Snapshots) -> Snapshots:
        ambient = np.array([one.ambient_pressure for one in flows.conditions()])[:, None]
        return replace(flows, pressure=flows.pressure + self.size * ambient)


@dataclass(frozen=True, eq=False, kw_only=True)
class Friction:
    """Friction along the axis, even over the surface of a body of revolution, of an axial coefficient ``size``."""

    vehicle: Vehicle
    size: float

    @cached_property
    def _strain(self) -> FloatArray:
        """(n_d,) strain of the gauges per pressure of friction [m/m/Pa], by the independent mesh."""
        vehicle, resolution, wall = self.vehicle, self.vehicle.resolution.truth, wall_of(self.vehicle)
        mesh = shell_mesh(vehicle.body(), wall, 1e-3 * resolution.element_length_mm, resolution.wall_layers)
        layout = vehicle.gauges.layout
        gauges = place_layouts(vehicle, mesh, [layout])[1][layout]
        # A cover of 1 kg/m2 under a specific force of 1 m/s2 pulls with 1 Pa, towards the nose.
        cover = MeridianMasses(
            density=(0.0,) * (1 + len(mesh.materials)), covers=((0.0, vehicle.body().length, 1.0),)
        )
        return -inertia_strain(mesh, wall.material, gauges, {"": cover}, unit=0.0)[""][:, 0]

    @cached_property
    def _area(self) -> float:
        """Area of the surface [m2], by frusta."""
        grid = surface_grid(self.vehicle.body(), self.vehicle.resolution.truth.surface_stations, 4)
        x, r = grid.x, grid.radius
        return float(np.sum(np.pi * (r[1:] + r[:-1]) * np.hypot(np.diff(x), np.diff(r))))

    def strain(self, conditions: Sequence[FlightCondition]) -> FloatArray:
        """Return (k, n_d) strain [m/m] in flights at ``conditions``."""
        reference = self.vehicle.reference_quantities().area
        force = self.size * reference * np.array([one.dynamic_pressure for one in conditions])
        return np.outer(force / self._area, self._strain)


def viscous_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return pressure of the displaced flow, and friction where the Fourier model holds the aft end."""
    found = [
        Kind(
            error="viscous pressure",
            size=f"{OVERPRESSURE:+g} p_inf",
            group="unobservable",
            what="Pressure of the displaced flow all over the surface, which strains as another axial coefficient "
            "does. map.discrepancy_of_overpressure_percent states its size.",
            flow=Raised(size=OVERPRESSURE),
            build=as_stated,
        )
    ]
    if vehicle.is_of_revolution and vehicle.structure.support != "free_flight":
        found.append(
            Kind(
                error="friction",
                size=f"{FRICTION:+g} in C_A",
                group="outside",
                what="Friction on the surface, which is no part of C_A.",
                added=Friction(vehicle=vehicle, size=FRICTION),
                build=as_stated,
            )
        )
    return found
