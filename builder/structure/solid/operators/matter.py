"""What a mesh is made of, region by region, and the masses it carries that stiffen nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from builder.structure.solid.elements.elements import reference_facet
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, SolidMesh
from builder.structure.solid.operators.supports import rigid_motions
from builder.structure.solid.operators.surface_load import vector_area
from builder.structure.wall import Material
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
        found = {name: density for name in regions if (density := self._of(name)[1]) is not None}
        return found if len(found) == len(regions) else None

    def densities(self, regions: tuple[str, ...]) -> dict[str, float]:
        """Return the density of each region [kg/m3].

        Raises
        ------
        InputError
            One is missing.
        """
        found = {}
        for name in regions:
            density = self._of(name)[1]
            if density is None:
                raise InputError(f"free flight: the density of the material of region '{name}' is missing")
            found[name] = density
        return found

    def regions_and_masses(self) -> dict[str, Any]:
        """Return, as JSON can hold it, what is not of the one material; empty where there is nothing."""
        record = {
            "regions": {
                name: [one.youngs_modulus, one.poisson_ratio, density]
                for name, (one, density) in sorted(self.of_region.items())
            },
            "point_masses": [[one.mass, *one.position, one.surface] for one in self.points],
            "covers": [list(one) for one in self.covers],
        }
        return {name: value for name, value in record.items() if value}

    def check(self, mesh: SolidMesh) -> None:
        """Refuse names that the mesh does not have.

        Raises
        ------
        InputError
            A region or a surface does not exist.
        """
        for name in self.of_region:
            if name not in [one.lower() for one in mesh.region_names]:
                known = ", ".join(mesh.region_names)
                raise InputError(f"structure.mesh_materials: expected regions of the mesh, {known}, got '{name}'")
        for number, one in enumerate(self.points, start=1):
            if not len(mesh.surface.get(one.surface, ())):
                known = ", ".join(sorted(mesh.surface))
                raise InputError(
                    f"structure.point_masses.{number}.on: expected a surface of the mesh, {known}, got "
                    f"'{one.surface}'"
                )

    def _of(self, region: str) -> tuple[Material, float | None]:
        return self.of_region.get(region.lower(), (self.material, self.density))


def carried_inertia(mesh: SolidMesh, matter: Matter, centre: FloatArray) -> FloatArray:
    """Return nodal forces (n_dof, 6) of unit accelerations along rigid motions on the masses that are carried.

    Rotations are about ``centre`` [m].
    """
    force = np.zeros((mesh.n_dof, 6))
    for one in matter.points:
        facet = mesh.named_surface(one.surface)
        middle = mesh.node[np.unique(facet)].mean(axis=0)
        traction = _surface_forces(mesh, facet, middle, np.ones(len(facet))[:, None])
        resultant = rigid_motions(mesh.node, middle).T @ traction
        place = np.array([one.position])
        needed = one.mass * rigid_motions(place, middle).T @ rigid_motions(place, centre)
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
