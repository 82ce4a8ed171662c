"""Known loads on the three-dimensional model.

Nodal forces are arrays (n_dof,) [N], dof = 3 * node + component along body axes. The strains of all gauges are
solved for once (adjoint, as in :mod:`~builder.structure.solid.strain_solution`), so that a load costs a product.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from builder.structure.loads.loaded_structure import INNER, OUTER, LoadProperties, SurfacePoints, check_stations
from builder.structure.loads.of_vehicle import load_properties
from builder.structure.loads.temperature import TemperatureField, wall_depth
from builder.structure.solid.case import structure_case
from builder.structure.solid.elements import (
    CurvedFacets,
    boundary_facets,
    facet_shape_functions,
    foot_point,
    reference_element,
    reference_facet,
)
from builder.structure.solid.gauge_rows import Gauges, gauge_rows, refuse_twins
from builder.structure.solid.linear_solvers import choose_solver
from builder.structure.solid.matter import FreeFlight, Matter, free_flight
from builder.structure.solid.mesh_choice import MeshChoice
from builder.structure.solid.nodal_loads import surface_points, vector_area
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SolidMesh
from builder.structure.solid.stiffness import CHUNK, physical_gradients
from builder.structure.solid.strain_solution import held_problem
from builder.structure.solid.supports import Support, rigid_motions
from builder.structure.wall import Material, wall_of
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray, IntArray

NAMES = {OUTER: EXTERNAL, INNER: INTERNAL}


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidStructure:
    """A :class:`~builder.structure.loads.loaded_structure.LoadedStructure` of any shape, of one material.

    Stations and roll angles are on the outer surface; temperature fields take it for a body of revolution.

    Attributes
    ----------
    mesh, material : the body.
    properties : density, expansion, compensation of the gauges, point masses.
    is_free : whether nothing holds the body.
    gauge_position : (n_d, 3) [m].
    adjoint : (n_d, n_dof) strain per nodal force [1/N].
    """

    mesh: SolidMesh
    material: Material
    properties: LoadProperties
    is_free: bool
    gauge_position: FloatArray
    adjoint: FloatArray

    @property
    def gauge_location(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Stations [m], roll angles [rad] and depths in the wall of the gauges, (n_d,) each."""
        x, y, z = self.gauge_position.T
        return x, np.arctan2(y, z), self._depth(self.gauge_position)

    @property
    def outer_span(self) -> tuple[float, float]:
        """First and last station of the outer surface [m]."""
        return float(self._outer_profile[0, 0]), float(self._outer_profile[-1, 0])

    def surface_points(self, surface: str) -> SurfacePoints:
        """Return the quadrature points of a surface, facet by facet; its names next to outer and inner too."""
        facet = self._facets(surface)
        area = vector_area(self.mesh.element_type, self.mesh.node[facet])
        shape = reference_facet(self.mesh.element_type).shape
        size = np.linalg.norm(area, axis=-1)
        return SurfacePoints(
            position=np.einsum("qa,fac->fqc", shape, self.mesh.node[facet]).reshape(-1, 3),
            normal=(area / size[..., None]).reshape(-1, 3),
            area=size.ravel(),
        )

    def spread_force(self, surface: str, force: FloatArray, chosen: IntArray | None = None) -> FloatArray:
        """Return nodal forces of forces (n, 3) [N] on quadrature points of a surface: all or ``chosen`` (n,)."""
        facet = self._facets(surface)
        shape = reference_facet(self.mesh.element_type).shape
        of_points = np.zeros((len(facet) * len(shape), 3))
        of_points[slice(None) if chosen is None else chosen] = force
        part = np.einsum("qa,fqc->fac", shape, of_points.reshape(len(facet), len(shape), 3))
        return self._scattered(facet, part)

    def point_force(self, station: FloatArray, roll_angle: FloatArray, force: FloatArray) -> FloatArray:
        """Return nodal forces of forces (k, 3) [N] at points of the outer surface."""
        check_stations(self.outer_span, station)
        facet = self._facets(OUTER)
        radius = np.interp(station, *self._outer_profile.T)
        point = np.column_stack([station, radius * np.sin(roll_angle), radius * np.cos(roll_angle)])
        feet = [foot_point(self._outer_facets, place) for place in point]
        shape, _ = facet_shape_functions(self.mesh.element_type, np.array([foot.reference for foot in feet]))
        node = facet[[foot.facet for foot in feet]]
        return self._scattered(node, shape[:, :, None] * force[:, None, :])

    def outer_radius(self, station: float) -> float:
        """Return the radius of the outer surface at a station [m]."""
        check_stations(self.outer_span, np.array([station]))
        return float(np.interp(station, *self._outer_profile.T))

    def inertia_force(self, acceleration: FloatArray) -> FloatArray:
        """Return nodal forces of mass times the acceleration (6,) of a rigid body about the origin."""
        flight = self._flight
        at_centre = acceleration[:3] + np.cross(acceleration[3:], flight.centre)
        return np.asarray(flight.inertia_force @ np.concatenate([at_centre, acceleration[3:]]))

    def thermal_force(self, temperature: TemperatureField) -> FloatArray:
        """Return the nodal forces that hinder thermal expansion."""
        x, y, z = self.mesh.node.T
        return self.thermal_force_of_nodes(temperature.at(x, np.arctan2(y, z), self._depth(self.mesh.node)))

    def thermal_force_of_nodes(self, temperature: FloatArray) -> FloatArray:
        """Return the same for temperatures (n_nodes,) [K] of the mesh's nodes."""
        kind = self.mesh.element_type
        quadrature = self.mesh.quadrature
        young, nu = self.material.youngs_modulus, self.material.poisson_ratio
        stress = self.properties.needed_expansion() * young / (1.0 - 2.0 * nu)
        shape = reference_element(kind, quadrature).shape
        force = np.zeros((self.mesh.n_nodes, 3))
        for start in range(0, len(self.mesh.element), CHUNK):
            element = self.mesh.element[start : start + CHUNK]
            gradient, volume = physical_gradients(kind, self.mesh.node[element], quadrature, start)
            at_point = stress * volume * (temperature[element] @ shape.T)
            np.add.at(force, element, np.einsum("eq,eqca->eac", at_point, gradient, optimize=True))
        return force.ravel()

    def resultant(self, force: FloatArray) -> FloatArray:
        """Return force [N] and moment about the origin [N m] of nodal forces, (6,)."""
        return np.asarray(rigid_motions(self.mesh.node).T @ force)

    def strain(self, force: FloatArray) -> FloatArray:
        """Return the strain of gauges (n_d,) under nodal forces, which of a free body must be balanced."""
        return np.asarray(self.adjoint @ force)

    def _facets(self, surface: str) -> IntArray:
        if surface == INNER:
            return self._inner
        return self.mesh.named_surface(NAMES.get(surface, surface))

    @cached_property
    def _inner(self) -> IntArray:
        """Facets of the inner surface and of the flat face that ends the hollow part in front, if there is one."""
        inner = self.mesh.named_surface(INTERNAL)
        front = self._inner_profile[0]
        facet, _ = boundary_facets(self.mesh.element_type, self.mesh.element)
        x, r = self.mesh.node[facet, 0], np.hypot(self.mesh.node[facet, 1], self.mesh.node[facet, 2])
        face = (np.abs(x - front[0]) < 1e-9) & (r < front[1] * (1.0 + 1e-6))
        return np.concatenate([facet[face.all(axis=1)], inner])

    @cached_property
    def _outer_facets(self) -> CurvedFacets:
        return CurvedFacets(self.mesh.element_type, self.mesh.node[self._facets(OUTER)])

    @cached_property
    def _outer_profile(self) -> FloatArray:
        return _profile(surface_points(self.mesh, EXTERNAL))

    @cached_property
    def _inner_profile(self) -> FloatArray:
        return _profile(surface_points(self.mesh, INTERNAL))

    @cached_property
    def _flight(self) -> FreeFlight:
        return free_flight(self.mesh, Matter(material=self.material, density=self.properties.needed_density()))

    def _depth(self, position: FloatArray) -> FloatArray:
        radius = np.hypot(position[:, 1], position[:, 2])
        return wall_depth(position[:, 0], radius, self._inner_profile, self._outer_profile)

    def _scattered(self, node: IntArray, force: FloatArray) -> FloatArray:
        """Sum forces (k, n, 3) of nodes (k, n) to (n_dof,)."""
        total = np.zeros((self.mesh.n_nodes, 3))
        np.add.at(total, node, force)
        return total.ravel()


def solid_structure(
    mesh: SolidMesh,
    material: Material,
    gauges: Gauges,
    supports: Sequence[Support] | None,
    properties: LoadProperties | None = None,
    solver_name: str | None = None,
) -> SolidStructure:
    """Solve a solid for the strains of its gauges.

    Parameters
    ----------
    mesh : of quadratic elements, with surfaces ``external`` and ``internal``.
    material : of all regions.
    gauges : on its surfaces.
    supports : what holds it; None leaves it free, its inertia balances the load.
    properties : what loads need in addition to stiffness.
    solver_name : name of a solver, or None for the best installed one.

    Raises
    ------
    InputError
        A gauge is not on its surface, the solver is unknown, or supports leave a rigid motion free.
    SolverError
        The solution's residual is too large.
    """
    refuse_twins(gauges)
    problem = held_problem(mesh, dict.fromkeys(mesh.region_names, material), supports)
    solver = choose_solver(problem, solver_name)
    return SolidStructure(
        mesh=mesh,
        material=material,
        properties=properties or LoadProperties(),
        is_free=supports is None,
        gauge_position=gauges.position,
        adjoint=solver.solve(csr_array(gauge_rows(mesh, gauges).T)).T,
    )


def solid_structure_of(
    vehicle: Vehicle,
    layout: str,
    mesh: MeshChoice | None = None,
    properties: LoadProperties | None = None,
    solver_name: str | None = None,
) -> SolidStructure:
    """Return the three-dimensional model of a vehicle with its support.

    Parameters
    ----------
    vehicle, layout : the vehicle and the name of one of its layouts.
    mesh : which mesh; a swept one by default.
    properties : what loads need; the density of the vehicle file by default.
    solver_name : name of a solver, or None for the best installed one.

    Raises
    ------
    InputError
        The layout does not exist, the wall does not fit the body, or a gauge is not on its surface.
    SolverError
        The solution's residual is too large.
    """
    vehicle.body()  # refuses other shapes: their regions and masses are not in the loads
    case = structure_case(vehicle, [layout], mesh, solver_name)
    return solid_structure(
        mesh=case.mesh.full,
        material=case.matter.material,
        gauges=case.layouts[layout],
        supports=None if case.support is None else [case.support],
        properties=properties or load_properties(vehicle.material, vehicle.temperature, wall_of(vehicle)),
        solver_name=solver_name,
    )


def _profile(point: FloatArray) -> FloatArray:
    """Return stations and radii (k, 2) [m] of points of a surface of revolution, stations increasing."""
    x = np.round(point[:, 0], 9)
    station, index = np.unique(x, return_inverse=True)
    radius = np.bincount(index, np.hypot(point[:, 1], point[:, 2])) / np.bincount(index)
    return np.column_stack([station, radius])
