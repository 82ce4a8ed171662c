"""The solid model's input, made from a vehicle file of any shape: mesh, matter, support and gauges.

A body of revolution gets the mesh that is chosen: swept, made by Gmsh, or imported. Sections get a swept one, a
surface has the mesh that its file names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.cfd.units import METRES
from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.checks import (
    WallElements,
    fourier_can,
    fourier_reference_strain,
    layers_needed,
    swept_elements,
)
from builder.structure.solid.gauge_layouts import (
    check_table,
    displaced_gauges,
    displaced_on_surface,
    free_gauges,
    solid_gauges,
    surface_axes,
)
from builder.structure.solid.gauge_rows import Gauges
from builder.structure.solid.matter import Matter, PointMass
from builder.structure.solid.mesh_checks import check_mesh, facet_size, facet_size_round_axis
from builder.structure.solid.mesh_choice import (
    CAD_FORMATS,
    SWEPT,
    TETRAHEDRON_LENGTH,
    MeshChoice,
    check_other,
    coarser_sector,
    make_mesh,
)
from builder.structure.solid.solid_mesh import INTERNAL, SUPPORT, SolidMesh
from builder.structure.solid.supports import Clamped, Foundation, Support
from builder.structure.solid.swept_mesh import (
    RESOLUTIONS,
    AnyMesh,
    SweptResolution,
    SweptSector,
    section_wall,
)
from builder.structure.structure_file import SCHEMA_VERSION
from builder.structure.wall import Wall, material_of, wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import BodyOfRevolution
from builder.vehicle.shape.profile_entries import profile_record
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.files import fingerprint
from strainfmu.version import __version__

FLYING_SECTORS = 1.25
"""Sectors of the mesh that plays the vehicle that flies, over the sectors of the map's mesh."""
CHECK_SIZE = 0.75
"""Elements per length of the mesh that checks the mesh of a body of sections, over its own."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidCase:
    """All that Z_p depends on.

    Attributes
    ----------
    vehicle : name.
    model : what :class:`~builder.structure.structure_file.Structure` calls the mesh.
    make : makes or reads the mesh; a swept one as its sector.
    other : makes another mesh of the same body, given the first, whose difference is the error of the first; and
        its name. None where there is none.
    reference : returns the strain (n_d, k) of all gauges under the reference loads by the Fourier model, where the
        mesh is compared with that.
    made_of : what mesh and matter were made of, as JSON can hold it.
    record : what a file states of mesh, wall, material and support.
    thickness : nominal thickness of the wall [m].
    body, wall : outer shape and wall of a body of revolution, whose mesh is judged by them; None of other shapes.
    file : a mesh that was read and must fit body and wall.
    matter, support : materials and masses; what holds the body, None in free flight.
    layouts : gauges by name of layout.
    solver : name of the solver, or None for the best installed one.
    allow_locking : go on with elements that lose more than a tenth of the wall's bending.
    """

    vehicle: str
    model: str
    make: Callable[[], AnyMesh]
    other: tuple[str, Callable[[SolidMesh], AnyMesh]] | None = None
    reference: Callable[[], FloatArray] | None = None
    made_of: Mapping[str, Any]
    record: Mapping[str, Any]
    thickness: float
    body: BodyOfRevolution | None = None
    wall: Wall | None = None
    file: Path | None = None
    matter: Matter
    support: Support | None
    layouts: Mapping[str, Gauges]
    solver: str | None = None
    allow_locking: bool = False

    @cached_property
    def mesh(self) -> AnyMesh:
        """The mesh, a swept one as its sector."""
        return self.make()

    @property
    def of_revolution(self) -> tuple[BodyOfRevolution, Wall]:
        """Body and wall of a body of revolution."""
        assert self.body is not None
        assert self.wall is not None
        return self.body, self.wall

    @property
    def length(self) -> float:
        """Length of the body [m]."""
        return float(self.mesh.whole.node[:, 0].max()) if self.body is None else self.body.length

    @property
    def bending_radius(self) -> float:
        """Radius at which bending of the wall is judged [m]: the base's, of other shapes the gauges' median."""
        if self.body is not None:
            return self.body.base_radius
        every = np.concatenate([one.position for one in self.layouts.values()])
        return float(np.median(np.hypot(every[:, 1], every[:, 2])))

    def made_from(self) -> dict[str, str]:
        """Return fingerprints of what the mesh and its solution depend on, and of the gauges."""
        mesh = {
            "strainfmu_version": __version__,
            "schema_version": SCHEMA_VERSION,
            "vehicle": self.vehicle,
            **self.made_of,
            "support": support_entries(self.support),
            "solver": self.solver,
            "allow_locking": self.allow_locking,
        }
        gauges = {name: asdict(one) for name, one in self.layouts.items()}
        return {"mesh": fingerprint(mesh), "gauges": fingerprint(gauges)}


def support_entries(support: Support | None) -> dict[str, Any]:
    """Return what a file states of the support."""
    if support is None:
        return {"kind": "free flight"}
    return {"kind": type(support).__name__.lower(), **asdict(support)}


def wall_elements(case: SolidCase) -> WallElements:
    """Return how the wall is meshed where its elements are longest: what the locking check is run on.

    Meshes made here are judged by the length of their elements round the axis, by which they are graded; a mesh
    of a body of revolution that is read is judged by its longest edges, whatever their direction.

    Raises
    ------
    InputError
        The mesh has no internal surface.
    """
    mesh, radius = case.mesh, case.bending_radius
    if isinstance(mesh, SweptSector):
        # A support facet spans one element through the wall.
        layers = len(mesh.surface["support"])
        return swept_elements(case.of_revolution[1], radius=radius, n_sectors=mesh.n_sectors, layers=layers)
    if case.body is not None and case.model == "imported":
        size = facet_size(mesh, INTERNAL)
    else:
        size = facet_size_round_axis(mesh, INTERNAL, radius)
    return WallElements(
        element_type=mesh.element_type,
        size=size,
        layers=max(1, round(case.thickness / size)),
        radius=radius,
        thickness=case.thickness,
        material=case.matter.material,
        quadrature=mesh.quadrature,
    )


def _material_record(matter: Matter) -> dict[str, Any]:
    return {
        "youngs_modulus_Pa": matter.material.youngs_modulus,
        "poisson_ratio": matter.material.poisson_ratio,
        "density_kg_per_m3": matter.density,
    }


def _free_case(
    vehicle: Vehicle, layouts: list[str], resolution: str | None, solver: str | None, allow_locking: bool
) -> SolidCase:
    """Return the case of a vehicle that is given by sections or a surface."""
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
    support, thickness = support_of(vehicle), 1e-3 * vehicle.structure.wall_thickness_mm
    masses = matter.regions_and_masses()
    return SolidCase(
        vehicle=vehicle.name,
        model=model,
        make=lambda: mesh,
        other=None if other is None else ("another mesh", lambda _: other),
        made_of={"source": source, "matter": asdict(matter)},
        record={
            "mesh": {"model": model, **source},
            "wall": {"thickness_m": thickness},
            "material": _material_record(matter),
            **({"regions_and_masses": masses} if masses else {}),
            "support": support_entries(support),
        },
        thickness=thickness,
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


def second_mesh(case: SolidCase) -> SolidMesh | None:
    """Return the mesh with which the mesh of a case is compared, None where there is none."""
    return None if case.other is None else case.other[1](case.mesh.whole).whole


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
        from builder.structure.solid.gmsh_mesh import step_mesh

        return step_mesh(path, element_length)
    from builder.structure.solid.mesh_files import read_mesh

    return read_mesh(path, unit, length=body_length, hollow=False)


def structure_case(
    vehicle: Vehicle,
    layouts: list[str],
    mesh: MeshChoice | None = None,
    solver: str | None = None,
    allow_locking: bool = False,
) -> SolidCase:
    """Return what the three-dimensional model of a vehicle of any shape is made of.

    For a body of revolution it is the case of :func:`solid_case`; the mesh of another shape is named by the file,
    or follows from its sections.

    Raises
    ------
    InputError
        A layout does not exist or is wrong, the wall does not fit the body, or a mesh is chosen where the file has
        one.
    """
    if vehicle.is_of_revolution:
        return solid_case(vehicle, layouts, mesh, solver, allow_locking)
    if mesh is not None and (mesh.source != SWEPT or mesh.unit != 1.0):
        kind = vehicle.shape_kind
        raise InputError(f"--model: expected none with shape.{kind}, got '{mesh.source}'; structure.mesh names it")
    _check_layouts(vehicle, layouts)
    resolution = None if mesh is None else mesh.resolution
    return _free_case(vehicle, layouts, resolution, solver, allow_locking)


def _check_layouts(vehicle: Vehicle, layouts: list[str]) -> None:
    known = vehicle.gauges.layouts
    for name in layouts:
        if name not in known:
            raise InputError(f"layout '{name}' found, must be one of {', '.join(known)}")


def solid_case(
    vehicle: Vehicle,
    layouts: list[str],
    mesh: MeshChoice | None = None,
    solver: str | None = None,
    allow_locking: bool = False,
) -> SolidCase:
    """Return what the three-dimensional model of a vehicle is made of, by default on a swept mesh.

    A swept mesh gets as many elements through the wall as the
    locking check needs at the base and at the gauges.
    The second mesh, of ``structure.checked_by``, is in the unit of the first and names its surfaces likewise.
    Where the section [noise] has position or orientation errors, the layout in use is there displaced as well.

    Raises
    ------
    InputError
        A layout does not exist or is wrong, the wall does not fit the body, or that is none of revolution.
    """
    _check_layouts(vehicle, layouts)
    rows_on = gauge_mesh(vehicle)
    gauges = {name: solid_gauges(vehicle, name, rows_on) for name in dict.fromkeys(layouts)}
    body, wall = vehicle.body(), wall_of(vehicle)
    second = None
    if vehicle.structure.checked_by is not None:
        own = mesh is None or mesh.file is None
        second = MeshChoice(
            source=str(vehicle.beside(vehicle.structure.checked_by)),
            unit=1.0 if mesh is None or own else mesh.unit,
            by_position=False if mesh is None or own else mesh.by_position,
        )
    mesh = _with_layers(mesh or MeshChoice(resolution=vehicle.structure.resolution), body, wall, gauges)
    in_use = vehicle.gauges.layout
    if vehicle.noise.moves_gauges and in_use in gauges:
        gauges |= displaced_gauges(in_use, gauges[in_use], body)
    return case_of_body(
        vehicle=vehicle.name,
        body=body,
        wall=wall,
        density=vehicle.material.density_kg_per_m3,
        support=support_of(vehicle),
        mesh=mesh,
        layouts=gauges,
        solver=solver,
        allow_locking=allow_locking,
        checked_by=second,
    )


def case_of_body(
    *,
    vehicle: str,
    body: BodyOfRevolution,
    wall: Wall,
    density: float | None,
    support: Support | None,
    mesh: MeshChoice,
    layouts: Mapping[str, Gauges],
    solver: str | None = None,
    allow_locking: bool = False,
    checked_by: MeshChoice | None = None,
) -> SolidCase:
    """Return the case of a body of revolution with its wall.

    Its mesh is compared with ``checked_by``, without that with the Fourier model, and where that cannot do support
    or gauges with another swept mesh.

    Raises
    ------
    InputError
        A mesh file is missing.
    """
    matter, name = Matter(material=wall.material, density=density), "swept hexahedra"
    if checked_by is not None:
        source = checked_by.source.rpartition("/")[2]
        name = checked_by.source if checked_by.file is None else f"the mesh {source}"

    def other_mesh(first: SolidMesh) -> AnyMesh:
        if checked_by is None:
            return coarser_sector(body, wall, mesh)
        made = make_mesh(body, wall, checked_by)
        if checked_by.file is not None:
            check_other(first, made.whole, checked_by.file)
        check_mesh(made.whole, body.length)
        return made

    def fourier_strain() -> FloatArray:
        return np.concatenate([fourier_reference_strain(body, wall, one) for one in layouts.values()])

    by_fourier = checked_by is None and isinstance(support, Clamped) and all(map(fourier_can, layouts.values()))
    inputs = mesh.inputs()
    return SolidCase(
        vehicle=vehicle,
        model=mesh.model,
        make=lambda: make_mesh(body, wall, mesh),
        other=None if by_fourier else (name, other_mesh),
        reference=fourier_strain if by_fourier else None,
        made_of={
            "body": asdict(body),
            "wall": asdict(wall),
            "density": density,
            "mesh": inputs,
            **({} if checked_by is None else {"checked_by": checked_by.inputs()}),
        },
        record={
            "mesh": {**inputs, **({} if mesh.file is None else {"file_name": mesh.file.name})},
            "profile": profile_record(body),
            "wall": {
                "thickness_m": wall.thickness,
                "solid_tip_length_m": wall.solid_tip_length,
                **({"profile": [list(one) for one in wall.profile]} if wall.profile else {}),
            },
            "material": _material_record(matter),
            "support": support_entries(support),
        },
        thickness=wall.thickness,
        body=body,
        wall=wall,
        file=mesh.file,
        matter=matter,
        support=support,
        layouts=layouts,
        solver=solver,
        allow_locking=allow_locking,
    )


def _with_layers(mesh: MeshChoice, body: BodyOfRevolution, wall: Wall, gauges: Mapping[str, Gauges]) -> MeshChoice:
    """Return the choice with its layers through the wall, where it states none.

    Other meshes have the layers of the swept one that the mesh is compared with.
    """
    if mesh.layers is not None:
        return mesh
    at_gauges = [
        float(r) for one in gauges.values() for r in body.radius(one.position[:, 0].clip(0.0, body.length))
    ]
    resolution = RESOLUTIONS[mesh.resolution]
    radius = np.array([body.base_radius, *at_gauges])
    return replace(mesh, layers=layers_needed(wall, radius, resolution.n_sectors, resolution.n_layers))


def support_of(vehicle: Vehicle) -> Support | None:
    """Return what holds the vehicle, None in free flight."""
    entry = vehicle.structure
    if entry.support == "free_flight":
        return None
    if entry.support == "clamped_aft":
        return Clamped(SUPPORT)
    assert entry.foundation_normal_N_per_m3 is not None
    assert entry.foundation_tangential_N_per_m3 is not None
    return Foundation(SUPPORT, entry.foundation_normal_N_per_m3, entry.foundation_tangential_N_per_m3)
