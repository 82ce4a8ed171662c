"""The solid model's input for a vehicle that is no body of revolution: meshes, gauges on them, support."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.cfd.units import METRES
from builder.structure.solid.gauges.displaced_gauges import displaced_on_surface
from builder.structure.solid.gauges.free_gauges import check_table, free_gauges, surface_axes
from builder.structure.solid.gauges.gauge_rows import Gauges
from builder.structure.solid.mesh.section_wall import section_wall
from builder.structure.solid.mesh.solid_mesh import INTERNAL, SolidMesh
from builder.structure.solid.mesh.swept_mesh import RESOLUTIONS, SweptResolution
from builder.structure.solid.mesh_choice import CAD_FORMATS, TETRAHEDRON_LENGTH, check_other
from builder.structure.solid.operators.matter import Matter, PointMass
from builder.structure.solid.operators.supports import Support
from builder.structure.structure_file import SCHEMA_VERSION
from builder.structure.wall import material_of, wall_of
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError
from strainfmu.files import fingerprint
from strainfmu.version import __version__

FLYING_SECTORS = 1.25
"""Sectors of the mesh that plays the vehicle that flies, over the sectors of the map's mesh."""
CHECK_SIZE = 0.75
"""Elements per length of the mesh that checks the mesh of a body of sections, over its own."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FreeCase:
    """All that Z_p of a free shape depends on.

    Attributes
    ----------
    vehicle : name.
    model : what :class:`~builder.structure.structure_file.Structure` calls the mesh.
    mesh, other : the mesh, and another of the same body that shows what the mesh does; None where there is none.
    source : what both were made of, as JSON can hold it.
    thickness : nominal thickness of the wall [m].
    matter, support : materials and masses; what holds the body, None in free flight.
    layouts : gauges by name of layout, on the surfaces of ``mesh``.
    solver, allow_locking : as in :class:`builder.structure.solid.model.SolidCase`.
    """

    vehicle: str
    model: str
    mesh: SolidMesh
    other: SolidMesh | None
    source: Mapping[str, Any]
    thickness: float
    matter: Matter
    support: Support | None
    layouts: Mapping[str, Gauges]
    solver: str | None = None
    allow_locking: bool = False

    @property
    def length(self) -> float:
        """Greatest x of the mesh [m]."""
        return float(self.mesh.node[:, 0].max())

    @property
    def gauge_radius(self) -> float:
        """Median distance of the gauges from the x axis [m]."""
        every = np.concatenate([one.position for one in self.layouts.values()])
        return float(np.median(np.hypot(every[:, 1], every[:, 2])))

    def made_from(self) -> dict[str, str]:
        """Return fingerprints of what the mesh and its solution depend on, and of the gauges."""
        mesh = {
            "strainfmu_version": __version__,
            "schema_version": SCHEMA_VERSION,
            "vehicle": self.vehicle,
            "source": dict(self.source),
            "matter": asdict(self.matter),
            "support": None if self.support is None else [type(self.support).__name__, asdict(self.support)],
            "solver": self.solver,
            "allow_locking": self.allow_locking,
        }
        gauges = {name: asdict(one) for name, one in self.layouts.items()}
        return {"mesh": fingerprint(mesh), "gauges": fingerprint(gauges)}


def free_case(
    vehicle: Vehicle,
    layouts: list[str],
    support: Support | None,
    resolution: str | None = None,
    solver: str | None = None,
    allow_locking: bool = False,
) -> FreeCase:
    """Return what the solid model of a vehicle given by sections or a surface is made of.

    Raises
    ------
    InputError
        A mesh is missing or wrong, the wall does not fit the sections, or a gauge is not on its surface.
    StrainfmuError
        Gmsh or meshio is needed and not installed, or fails.
    """
    for name in layouts:
        check_table(vehicle, name)
    mesh, other, model, source = _meshes(vehicle, resolution or vehicle.structure.resolution)
    matter = _matter(vehicle)
    for one in (mesh, other):
        if one is not None:
            matter.check(one)
    inside = vehicle.structure.internal_pressure_Pa
    if INTERNAL not in mesh.surface and inside != "ambient":
        raise InputError(
            f"structure.internal_pressure_Pa: expected 'ambient' with a mesh without a cavity, got {inside:g}"
        )
    gauges = {name: free_gauges(vehicle, name, mesh) for name in dict.fromkeys(layouts)}
    in_use = vehicle.gauges.layout
    if vehicle.noise.moves_gauges and in_use in gauges:
        gauges |= displaced_on_surface(in_use, gauges[in_use], *surface_axes(mesh, gauges[in_use]))
    return FreeCase(
        vehicle=vehicle.name,
        model=model,
        mesh=mesh,
        other=other,
        source=source,
        thickness=1e-3 * vehicle.structure.wall_thickness_mm,
        matter=matter,
        support=support,
        layouts=gauges,
        solver=solver,
        allow_locking=allow_locking,
    )


def _matter(vehicle: Vehicle) -> Matter:
    """Return materials and masses of the vehicle file; the materials exist."""
    entry, own = vehicle.structure, vehicle.material
    return Matter(
        material=material_of(own),
        density=own.density_kg_per_m3,
        of_region={
            region.lower(): (material_of(vehicle.materials[name]), vehicle.materials[name].density_kg_per_m3)
            for region, name in entry.mesh_materials.items()
        },
        points=tuple(
            PointMass(mass=one.mass_kg, position=(one.x_m, one.y_m, one.z_m), surface=one.on.lower())
            for one in entry.point_masses
            if one.on is not None
        ),
        covers=tuple((one.start_x_m, one.end_x_m, one.mass_kg_per_m2) for one in entry.covers),
    )


def _meshes(vehicle: Vehicle, resolution: str) -> tuple[SolidMesh, SolidMesh | None, str, dict[str, Any]]:
    """Return the mesh, the one that checks it, the model's name and the source of both."""
    entry = vehicle.structure
    if vehicle.shape_kind == "sections":
        if resolution not in RESOLUTIONS:
            raise InputError(f"resolution: expected one of {', '.join(RESOLUTIONS)}, got '{resolution}'")
        body, wall = vehicle.sectioned_body(), wall_of(vehicle)
        own = RESOLUTIONS[resolution]
        coarser = SweptResolution(own.element_length / CHECK_SIZE, own.n_layers, round(CHECK_SIZE * own.n_sectors))
        table = {name: np.asarray(value).tolist() for name, value in asdict(body).items()}
        source: dict[str, Any] = {"sections": table, "wall": asdict(wall), "resolution": resolution}
        other = section_wall(body, wall, coarser)
        return section_wall(body, wall, own), other, "swept_hexahedra", source
    assert entry.mesh is not None
    unit = METRES[entry.mesh_length_unit]
    paths = [vehicle.beside(name) for name in (entry.mesh, entry.checked_by) if name is not None]
    length = TETRAHEDRON_LENGTH[resolution] * float(
        np.sqrt(0.5 * vehicle.reference_quantities().length * 1e-3 * entry.wall_thickness_mm)
    )
    assert vehicle.shape is not None
    read = [_mesh_of_file(path, _digest(path), unit, length, vehicle.shape.length_m) for path in paths]
    source = {"files": {path.name: _digest(path) for path in paths}, "unit": unit}
    made = paths[0].suffix.lower() in CAD_FORMATS
    if made:
        source["element_length"] = length
    if len(read) > 1:
        check_other(read[0], read[1], paths[1])
    return read[0], read[1] if len(read) > 1 else None, "gmsh_tetrahedra" if made else "imported", source


def flying_mesh(vehicle: Vehicle) -> SolidMesh:
    """Return the finer mesh of a body of sections that plays the vehicle that flies."""
    own, truth = RESOLUTIONS[vehicle.structure.resolution], vehicle.resolution.truth
    finer = SweptResolution(
        1e-3 * truth.element_length_mm, truth.wall_layers, round(own.n_sectors * FLYING_SECTORS / 2.0) * 2
    )
    return section_wall(vehicle.sectioned_body(), wall_of(vehicle), finer)


def _digest(path: Path) -> str:
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    return sha256(path.read_bytes()).hexdigest()


@lru_cache(maxsize=4)
def _mesh_of_file(
    path: Path, digest: str, unit: float, element_length: float, body_length: float | None
) -> SolidMesh:
    """Read or make a mesh; ``digest`` distinguishes versions of the file."""
    if path.suffix.lower() in CAD_FORMATS:
        from builder.structure.solid.mesh.gmsh_files import step_mesh

        return step_mesh(path, element_length)
    from builder.structure.solid.mesh.mesh_import import read_mesh

    return read_mesh(path, unit, length=body_length, hollow=False)
