"""Known loads on a structure of any make: by the strain of its gauges per force at nodes of its outer surface.

Nodal forces are arrays (3 n,) [N], 3 * node + component along body axes. What acts within the body, as weight,
inner pressure and heat, is not known of such a structure.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from builder.structure.loads.loaded_structure import OUTER, LoadProperties, SurfacePoints, check_stations
from builder.structure.loads.temperature import TemperatureField
from builder.structure.solid.elements import (
    CurvedFacets,
    FootPoint,
    facet_shape_functions,
    foot_point,
    reference_facet,
)
from builder.structure.solid.nodal_loads import ELEMENT_OF_FACET, vector_area
from builder.structure.solid.supports import rigid_motions
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class InfluenceStructure:
    """A :class:`~builder.structure.loads.loaded_structure.LoadedStructure` under forces on its outer surface.

    Attributes
    ----------
    node : (n, 3) of the outer surface [m].
    facet : (f, 3, 4, 6 or 8) nodes of its facets, outwards.
    gauge_position : (n_d, 3) [m].
    strain_per_force : (n_d, n, 3) [1/N].
    """

    node: FloatArray
    facet: IntArray
    gauge_position: FloatArray
    strain_per_force: FloatArray

    properties = LoadProperties()
    is_free = False

    @property
    def gauge_location(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Stations [m], roll angles [rad] and depths in the wall, taken for 0, of the gauges, (n_d,) each."""
        x, y, z = self.gauge_position.T
        return x, np.arctan2(y, z), np.zeros(len(x))

    @property
    def outer_span(self) -> tuple[float, float]:
        """First and last station of the outer surface [m]."""
        return float(self.node[:, 0].min()), float(self.node[:, 0].max())

    def surface_points(self, surface: str) -> SurfacePoints:
        """Return the quadrature points of the outer surface, facet by facet."""
        _refuse_within(surface)
        area = vector_area(self._facets.element_type, self._facets.position)
        size = np.linalg.norm(area, axis=-1)
        return SurfacePoints(
            position=np.einsum("qa,fac->fqc", self._shape, self._facets.position).reshape(-1, 3),
            normal=(area / size[..., None]).reshape(-1, 3),
            area=size.ravel(),
        )

    def spread_force(self, surface: str, force: FloatArray, chosen: IntArray | None = None) -> FloatArray:
        """Return nodal forces of forces (n, 3) [N] on quadrature points of the surface: all or ``chosen`` (n,)."""
        _refuse_within(surface)
        of_points = np.zeros((len(self.facet) * len(self._shape), 3))
        of_points[slice(None) if chosen is None else chosen] = force
        by_facet = of_points.reshape(len(self.facet), len(self._shape), 3)
        return self._scattered(self.facet, np.einsum("qa,fqc->fac", self._shape, by_facet))

    def point_force(self, station: FloatArray, roll_angle: FloatArray, force: FloatArray) -> FloatArray:
        """Return nodal forces of forces (k, 3) [N] at points of the outer surface."""
        feet = self._feet(station, roll_angle)
        reference = np.array([foot.reference for foot in feet])
        shape, _ = facet_shape_functions(self._facets.element_type, reference)
        return self._scattered(self.facet[[foot.facet for foot in feet]], shape[:, :, None] * force[:, None, :])

    def outer_radius(self, station: float) -> float:
        """Return the mean radius of the surface at a station [m]."""
        roll = 2.0 * np.pi * np.arange(AROUND) / AROUND
        return float(np.mean([np.hypot(*foot.point[1:]) for foot in self._feet(np.full(AROUND, station), roll)]))

    def inertia_force(self, acceleration: FloatArray) -> FloatArray:
        """Refuse what acts on mass."""
        raise InputError(f"own weight and inertia: {NOT_WITHIN}")

    def thermal_force(self, temperature: TemperatureField) -> FloatArray:
        """Refuse what acts by temperature."""
        raise InputError(f"temperature: {NOT_WITHIN}")

    def resultant(self, force: FloatArray) -> FloatArray:
        """Return force [N] and moment about the origin [N m] of nodal forces, (6,)."""
        return np.asarray(rigid_motions(self.node).T @ force)

    def strain(self, force: FloatArray) -> FloatArray:
        """Return the strain of gauges (n_d,) under nodal forces [m/m]."""
        return np.asarray(self.strain_per_force.reshape(len(self.strain_per_force), -1) @ force)

    def _feet(self, station: FloatArray, roll_angle: FloatArray) -> list[FootPoint]:
        """Return the points of the surface at stations and roll angles (k,)."""
        check_stations(self.outer_span, station)
        x, y, z = self.node.T
        radius = np.hypot(y, z)
        turn = np.arctan2(y, z) - roll_angle[:, None]
        around = radius * (np.mod(turn + np.pi, 2.0 * np.pi) - np.pi)
        radius_there = radius[np.argmin((x - station[:, None]) ** 2 + around**2, axis=1)]
        feet: list[FootPoint] = []
        for _ in range(FEET):
            point = np.column_stack(
                [station, radius_there * np.sin(roll_angle), radius_there * np.cos(roll_angle)]
            )
            feet = [foot_point(self._facets, place) for place in point]
            radius_there = np.array([np.hypot(*foot.point[1:]) for foot in feet])
        return feet

    @cached_property
    def _facets(self) -> CurvedFacets:
        return CurvedFacets(ELEMENT_OF_FACET[self.facet.shape[1]], self.node[self.facet])

    @property
    def _shape(self) -> FloatArray:
        return reference_facet(self._facets.element_type).shape

    def _scattered(self, node: IntArray, force: FloatArray) -> FloatArray:
        """Sum forces (k, n, 3) of nodes (k, n) to (3 n,)."""
        total = np.zeros((len(self.node), 3))
        np.add.at(total, node, force)
        return total.ravel()


FEET = 3
"""Times that the radius under a point is taken from the foot of the normal: the surface may be inclined."""

AROUND = 16
"""Points round a station whose mean radius is its own."""

NOT_WITHIN = (
    "expected loads on the outer surface alone with structure.model 'solid', structure.influence and shapes other "
    "than a profile; state the case without it"
)


def _refuse_within(surface: str) -> None:
    if surface != OUTER:
        raise InputError(f"surface '{surface}': {NOT_WITHIN}")
