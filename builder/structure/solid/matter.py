"""What a mesh is made of, region by region, and the masses it carries that stiffen nothing.

Free flight: nothing holds the body, its inertia balances the load (inertia relief).

The body accelerates as a rigid one under the load's resultant, and the force that deforms it is the load less mass
times that acceleration. It sums to nothing, so any support that holds the six rigid motions alone carries no force
and leaves the strain as it is (Nelson and Wolf, NASA TM X-3524, 1977). Rotation is slow: no centrifugal forces.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from builder.structure.solid.elements import MASS_DEGREE, reference_element, reference_facet
from builder.structure.solid.nodal_loads import vector_area
from builder.structure.solid.solid_mesh import EXTERNAL, SolidMesh
from builder.structure.solid.stiffness import CHUNK, physical_gradients
from builder.structure.solid.supports import Restraint, free_motions, rigid_motions
from builder.structure.wall import Material, material_of
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError


@dataclass(frozen=True, kw_only=True)
class PointMass:
    """A mass without size, held by a surface of the mesh.

    Its force is a traction on that surface which is linear in position, so the surface is not stiffened.

    Attributes
    ----------
    mass, position : [kg], (x, y, z) [m].
    surface : name of the surface.
    """

    mass: float
    position: tuple[float, float, float]
    surface: str


@dataclass(frozen=True, kw_only=True)
class Matter:
    """Materials and masses of a mesh.

    Attributes
    ----------
    material, density : of all regions that ``of_region`` leaves out; the density [kg/m3] is for free flight.
    of_region : material and density [kg/m3] by name of region, in small letters; case does not matter.
    points : masses held by surfaces.
    covers : (start, end [m], mass per outer area [kg/m2]) on the external surface.
    """

    material: Material
    density: float | None = None
    of_region: Mapping[str, tuple[Material, float | None]] = field(default_factory=dict)
    points: tuple[PointMass, ...] = ()
    covers: tuple[tuple[float, float, float], ...] = ()

    def materials(self, regions: tuple[str, ...]) -> dict[str, Material]:
        """Return the material of each region."""
        return {name: self._of(name)[0] for name in regions}

    def known_densities(self, regions: tuple[str, ...]) -> dict[str, float] | None:
        """Return the density of each region [kg/m3], None where one is not known."""
        known = all(self._of(name)[1] is not None for name in regions)
        return self.densities(regions) if known else None

    def densities(self, regions: tuple[str, ...]) -> dict[str, float]:
        """Return the density of each region [kg/m3]."""
        density_of = {}
        for name in regions:
            density = self._of(name)[1]
            if density is None:
                raise InputError(f"free flight: the density of the material of region '{name}' is missing")
            if not 0.0 < density < np.inf:
                raise InputError(f"density {density:g} kg/m3 of region '{name}' must be greater than 0")
            density_of[name] = density
        return density_of

    def regions_and_masses(self) -> dict[str, Any]:
        """Return, as JSON can hold it, what is not of the one material; empty where there is nothing."""
        record = {
            "regions": {
                name: [material.youngs_modulus, material.poisson_ratio, density]
                for name, (material, density) in sorted(self.of_region.items())
            },
            "point_masses": [[mass.mass, *mass.position, mass.surface] for mass in self.points],
            "covers": [list(cover) for cover in self.covers],
        }
        return {name: value for name, value in record.items() if value}

    def check(self, mesh: SolidMesh) -> None:
        """Refuse names that the mesh does not have."""
        for name in self.of_region:
            if name not in [region.lower() for region in mesh.region_names]:
                known = ", ".join(mesh.region_names)
                raise InputError(f"structure.mesh_materials: expected regions of the mesh, {known}, got '{name}'")
        for number, mass in enumerate(self.points, start=1):
            if not len(mesh.surface.get(mass.surface, ())):
                known = ", ".join(sorted(mesh.surface))
                raise InputError(
                    f"structure.point_masses.{number}.on: expected a surface of the mesh, {known}, got "
                    f"'{mass.surface}'"
                )

    def _of(self, region: str) -> tuple[Material, float | None]:
        return self.of_region.get(region.lower(), (self.material, self.density))


def matter_of(vehicle: Vehicle) -> Matter:
    """Return materials and masses of the vehicle file."""
    entry, material = vehicle.structure, vehicle.material
    return Matter(
        material=material_of(material),
        density=material.density_kg_per_m3,
        of_region={
            region.lower(): (material_of(vehicle.materials[name]), vehicle.materials[name].density_kg_per_m3)
            for region, name in entry.mesh_materials.items()
        },
        points=tuple(
            PointMass(mass=mass.mass_kg, position=(mass.x_m, mass.y_m, mass.z_m), surface=mass.on.lower())
            for mass in entry.point_masses
            if mass.on is not None
        ),
        covers=tuple((cover.start_x_m, cover.end_x_m, cover.mass_kg_per_m2) for cover in entry.covers),
    )


def carried_inertia(mesh: SolidMesh, matter: Matter, centre: FloatArray) -> FloatArray:
    """Return nodal forces (n_dof, 6) of unit accelerations along rigid motions on the masses that are carried.

    Rotations are about ``centre`` [m].
    """
    force = np.zeros((mesh.n_dof, 6))
    for carried in matter.points:
        facet = mesh.named_surface(carried.surface)
        middle = mesh.node[np.unique(facet)].mean(axis=0)
        traction = _surface_forces(mesh, facet, middle, np.ones(len(facet))[:, None])
        resultant = rigid_motions(mesh.node, middle).T @ traction
        place = np.array([carried.position])
        needed = carried.mass * rigid_motions(place, middle).T @ rigid_motions(place, centre)
        force += traction @ np.linalg.solve(resultant, needed)
    if matter.covers:
        facet = mesh.named_surface(EXTERNAL)
        x = mesh.node[facet, 0] @ reference_facet(mesh.element_type).shape.T
        for start, end, per_area in matter.covers:
            force += _surface_forces(mesh, facet, centre, per_area * ((x >= start) & (x <= end)))
    return force


def _surface_forces(mesh: SolidMesh, facet: IntArray, centre: FloatArray, weight: FloatArray) -> FloatArray:
    """Return (n_dof, 6) integral of N_a times each rigid motion about ``centre`` times a weight (f, n_q) dS."""
    shape = reference_facet(mesh.element_type).shape
    position = mesh.node[facet]
    area = np.linalg.norm(vector_area(mesh.element_type, position), axis=-1) * weight
    point = np.einsum("qa,fac->fqc", shape, position)
    motion = rigid_motions(point.reshape(-1, 3), centre).reshape(*point.shape, 6)
    force = np.zeros((mesh.n_nodes, 3, 6))
    np.add.at(force, facet, np.einsum("fq,qa,fqcm->facm", area, shape, motion, optimize=True))
    return force.reshape(-1, 6)


SMALLEST_TRIANGLE = 1e-6  # height of the three held nodes over the body's size


@dataclass(frozen=True, eq=False, kw_only=True)
class FreeFlight:
    """Rigid motions of a body and its inertia against them.

    Attributes
    ----------
    mass : [kg].
    centre : (3,) centre of mass [m].
    rigid : (n_dof, 6) translations along x, y, z [-], rotations about axes through ``centre`` [m].
    inertia_force : (n_dof, 6) nodal forces of unit accelerations along ``rigid``: mass matrix times rigid.
    """

    mass: float
    centre: FloatArray
    rigid: FloatArray
    inertia_force: FloatArray

    @property
    def inertia(self) -> FloatArray:
        """(6, 6) mass [kg] and moments of inertia [kg m2] about the centre of mass."""
        return np.asarray(self.rigid.T @ self.inertia_force)

    def accelerations(self, load: FloatArray) -> FloatArray:
        """Return accelerations [m/s2] and angular accelerations [rad/s2], (6, k), under loads (n_dof, k) [N]."""
        return np.asarray(np.linalg.solve(self.inertia, self.rigid.T @ load))

    def balanced(self, load: FloatArray) -> FloatArray:
        """Return loads (n_dof, k) [N] less the inertia they meet: force and moment sum to nothing."""
        return np.asarray(load - self.inertia_force @ self.accelerations(load))

    def balanced_rows(self, row: FloatArray) -> FloatArray:
        """Return rows^T, (n_dof, k), that act on a load as those given do on the balanced load."""
        return np.asarray(row - self.rigid @ np.linalg.solve(self.inertia, self.inertia_force.T @ row))


def free_flight(mesh: SolidMesh, matter: Matter) -> FreeFlight:
    """Return a body's rigid motions and inertia, with the masses that it carries."""
    density = matter.densities(mesh.region_names)
    of_region = np.array([density[name] for name in mesh.region_names])

    def inertia_forces(about: FloatArray) -> FloatArray:
        return _inertia_forces(mesh, of_region[mesh.region], about) + carried_inertia(mesh, matter, about)

    first = inertia_forces(np.zeros(3))
    mass = float(first.reshape(-1, 3, 6)[:, 0, 0].sum())
    # Rotations about the origin: the moment of mass about z gives x, and so on.
    moment = first.reshape(-1, 3, 6).sum(axis=0)
    centre = np.array([moment[1, 5], moment[2, 3], moment[0, 4]]) / mass
    return FreeFlight(
        mass=mass,
        centre=centre,
        rigid=rigid_motions(mesh.node, centre),
        inertia_force=inertia_forces(centre),
    )


def _inertia_forces(mesh: SolidMesh, density: FloatArray, centre: FloatArray) -> FloatArray:
    """Return (n_dof, 6) integral of density times N_a times each rigid motion dV."""
    force = np.zeros((mesh.n_nodes, 3, 6))
    degree = MASS_DEGREE[mesh.element_type]
    shape = reference_element(mesh.element_type, degree).shape
    for start in range(0, len(mesh.element), CHUNK):
        chunk = slice(start, start + CHUNK)
        position = mesh.node[mesh.element[chunk]]
        _, volume = physical_gradients(mesh.element_type, position, degree, start)
        point = np.einsum("qa,eac->eqc", shape, position)
        motion = rigid_motions(point.reshape(-1, 3), centre).reshape(*point.shape, 6)
        part = np.einsum("e,eq,qa,eqcm->eacm", density[chunk], volume, shape, motion, optimize=True)
        np.add.at(force, mesh.element[chunk], part)
    return force.reshape(-1, 6)


def determinate_support(mesh: SolidMesh, node: IntArray | None = None) -> Restraint:
    """Hold the six rigid motions of a body and nothing else.

    Parameters
    ----------
    mesh : the mesh.
    node : (3,) nodes: the first is held, the second may move towards the first, the third within the plane of
        the three. By default nodes far apart.
    """
    chosen = _nodes_far_apart(mesh) if node is None else np.asarray(node)
    a, b, c = mesh.node[chosen]
    along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-300)
    up = np.cross(along, c - a)
    height = float(np.linalg.norm(up))
    if height < SMALLEST_TRIANGLE * np.ptp(mesh.node, axis=0).max():
        raise InputError(f"nodes {', '.join(str(int(i)) for i in chosen)} lie on a line: they do not hold a body")
    up /= height
    direction = np.concatenate([np.eye(3), [np.cross(up, along), up, up]])
    free = free_motions(mesh.n_nodes, chosen[[0, 0, 0, 1, 1, 2]], direction)
    return Restraint(free, csr_array((mesh.n_dof, mesh.n_dof)))


def _nodes_far_apart(mesh: SolidMesh) -> IntArray:
    node = np.unique(mesh.element)
    position = mesh.node[node]
    first = int(position[:, 0].argmin())
    second = int(np.linalg.norm(position - position[first], axis=1).argmax())
    along = position[second] - position[first]
    third = int(np.linalg.norm(np.cross(position - position[first], along), axis=1).argmax())
    return node[[first, second, third]]
