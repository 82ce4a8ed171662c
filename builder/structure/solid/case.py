"""The solid model's input, made from a vehicle file of any shape: mesh, matter, support and gauges.

A body of revolution gets the mesh that is chosen: swept, made by Gmsh, or imported. Sections get a swept one, a
surface has the mesh that its file names.
"""

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
    displaced_gauges,
    displaced_on_surface,
    free_gauges,
    solid_gauges,
    surface_axes,
)
from builder.structure.solid.gauge_rows import Gauges
from builder.structure.solid.matter import Matter, matter_of
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
from builder.structure.solid.solid_mesh import INTERNAL, SolidMesh
from builder.structure.solid.supports import Clamped, Support, support_entries, support_of
from builder.structure.solid.swept_mesh import (
    RESOLUTIONS,
    AnyMesh,
    SweptResolution,
    SweptSector,
    section_wall,
)
from builder.structure.structure_file import SCHEMA_VERSION
from builder.structure.wall import Wall, wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import read_gauge_table
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
    second : makes another mesh of the same body, given the first, whose difference is the error of the first; and
        its name. None where there is none.
    reference : returns the strain (n_d, k) of all gauges under the reference loads by the Fourier model, where the
        mesh is compared with that.
    made_of, mesh_record : what mesh and matter were made of, and what a file states of the mesh, as JSON can hold
        it.
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
    second: tuple[str, Callable[[SolidMesh], AnyMesh]] | None = None
    reference: Callable[[], FloatArray] | None = None
    made_of: Mapping[str, Any]
    mesh_record: Mapping[str, Any]
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
        return float(self.mesh.full.node[:, 0].max()) if self.body is None else self.body.length

    @property
    def wall_elements(self) -> WallElements:
        """How the wall is meshed where its elements are longest: what the locking check is run on.

        Meshes made here are judged by the length of their elements round the axis, by which they are graded; a
        mesh of a body of revolution that is read is judged by its longest edges, whatever their direction.
        Bending is judged at the base, of other shapes at the median radius of the gauges.
        """
        mesh = self.mesh
        if self.body is not None:
            radius = self.body.base_radius
        else:
            position = np.concatenate([gauges.position for gauges in self.layouts.values()])
            radius = float(np.median(np.hypot(position[:, 1], position[:, 2])))
        if isinstance(mesh, SweptSector):
            # A support facet spans one element through the wall.
            layers = len(mesh.surface["support"])
            return swept_elements(self.of_revolution[1], radius=radius, n_sectors=mesh.n_sectors, layers=layers)
        by_edges = self.body is not None and self.model == "imported"
        size = facet_size(mesh, INTERNAL) if by_edges else facet_size_round_axis(mesh, INTERNAL, radius)
        return WallElements(
            element_type=mesh.element_type,
            size=size,
            layers=max(1, round(self.thickness / size)),
            radius=radius,
            thickness=self.thickness,
            material=self.matter.material,
            quadrature=mesh.quadrature,
        )

    @property
    def record(self) -> dict[str, Any]:
        """What a file states of mesh, wall, material and support."""
        masses, wall = self.matter.regions_and_masses(), self.wall
        return {
            "mesh": self.mesh_record,
            **({} if self.body is None else {"profile": profile_record(self.body)}),
            "wall": {
                "thickness_m": self.thickness,
                **({} if wall is None else {"solid_tip_length_m": wall.solid_tip_length}),
                **({"profile": [list(point) for point in wall.profile]} if wall and wall.profile else {}),
            },
            "material": {
                "youngs_modulus_Pa": self.matter.material.youngs_modulus,
                "poisson_ratio": self.matter.material.poisson_ratio,
                "density_kg_per_m3": self.matter.density,
            },
            **({"regions_and_masses": masses} if masses else {}),
            "support": support_entries(self.support),
        }

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
        gauges = {name: asdict(layout) for name, layout in self.layouts.items()}
        return {"mesh": fingerprint(mesh), "gauges": fingerprint(gauges)}


def structure_case(
    vehicle: Vehicle,
    layouts: list[str],
    mesh: MeshChoice | None = None,
    solver: str | None = None,
    allow_locking: bool = False,
) -> SolidCase:
    """Return what the three-dimensional model of a vehicle of any shape is made of, by default on a swept mesh.

    The mesh of a shape that is none of revolution is named by the file, or follows from its sections. Where the
    section [noise] has position or orientation errors, the layout in use is there displaced as well.

    Raises
    ------
    InputError
        A layout does not exist or is wrong, the wall does not fit the body, or a mesh is chosen where the file has
        one.
    """
    known = vehicle.gauges.layouts
    for name in layouts:
        if name not in known:
            raise InputError(f"layout '{name}' found, must be one of {', '.join(known)}")
    of_shape = _case_of_profile if vehicle.has_meridian else _case_of_other_shape
    case = of_shape(vehicle, list(dict.fromkeys(layouts)), mesh)
    return replace(case, solver=solver, allow_locking=allow_locking)


def _case_of_profile(vehicle: Vehicle, layouts: list[str], mesh: MeshChoice | None) -> SolidCase:
    """Return the case of a body of revolution.

    The second mesh, of ``structure.checked_by``, is in the unit of the first and names its surfaces likewise.
    """
    rows_on, body, second = gauge_mesh(vehicle), vehicle.body(), None
    gauges = {name: solid_gauges(vehicle, name, rows_on) for name in layouts}
    wall, mesh = wall_of(vehicle), mesh or MeshChoice(resolution=vehicle.structure.resolution)
    if vehicle.structure.checked_by is not None:
        second = MeshChoice(source=str(vehicle.beside(vehicle.structure.checked_by)))
        if mesh.file is not None:
            second = replace(second, unit=mesh.unit, by_position=mesh.by_position)
    mesh, in_use = _with_layers(mesh, body, wall, gauges), vehicle.gauges.layout
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
    checked_by: MeshChoice | None = None,
) -> SolidCase:
    """Return the case of a body of revolution with its wall.

    Its mesh is compared with ``checked_by``, without that with the Fourier model, and where that cannot do support
    or gauges with another swept mesh.
    """
    name = "swept hexahedra"
    if checked_by is not None:
        source = checked_by.source.rpartition("/")[2]
        name = checked_by.source if checked_by.file is None else f"the mesh {source}"

    def other_mesh(first: SolidMesh) -> AnyMesh:
        if checked_by is None:
            return coarser_sector(body, wall, mesh)
        made = make_mesh(body, wall, checked_by)
        if checked_by.file is not None:
            check_other(first, made.full, checked_by.file)
        check_mesh(made.full, body.length)
        return made

    def fourier_strain() -> FloatArray:
        return fourier_reference_strain(body, wall, list(layouts.values()))

    by_fourier = checked_by is None and isinstance(support, Clamped) and all(map(fourier_can, layouts.values()))
    inputs = mesh.inputs()
    return SolidCase(
        vehicle=vehicle,
        model=mesh.model,
        make=lambda: make_mesh(body, wall, mesh),
        second=None if by_fourier else (name, other_mesh),
        reference=fourier_strain if by_fourier else None,
        made_of={
            "body": asdict(body),
            "wall": asdict(wall),
            "density": density,
            "mesh": inputs,
            **({} if checked_by is None else {"checked_by": checked_by.inputs()}),
        },
        mesh_record={**inputs, **({} if mesh.file is None else {"file_name": mesh.file.name})},
        thickness=wall.thickness,
        body=body,
        wall=wall,
        file=mesh.file,
        matter=Matter(material=wall.material, density=density),
        support=support,
        layouts=layouts,
    )


def _with_layers(
    mesh: MeshChoice, body: BodyOfRevolution, wall: Wall, layouts: Mapping[str, Gauges]
) -> MeshChoice:
    """Return the choice with as many layers through the wall as the locking check needs, where it states none.

    They are those needed at the base and at the gauges. Other meshes have the layers of the swept one that
    the mesh is compared with.
    """
    if mesh.layers is not None:
        return mesh
    stations = [gauges.position[:, 0].clip(0.0, body.length) for gauges in layouts.values()]
    radius = np.concatenate([[body.base_radius], *(body.radius(x) for x in stations)])
    resolution = RESOLUTIONS[mesh.resolution]
    return replace(mesh, layers=layers_needed(wall, radius, resolution.n_sectors, resolution.n_layers))


def _case_of_other_shape(vehicle: Vehicle, layouts: list[str], choice: MeshChoice | None) -> SolidCase:
    """Return the case of a vehicle that is given by sections or a surface."""
    if choice is not None and (choice.source != SWEPT or choice.unit != 1.0):
        kind = vehicle.shape_kind
        raise InputError(
            f"--model: expected none with shape.{kind}, got '{choice.source}'; structure.mesh names it"
        )
    for file in (vehicle.gauges.layouts[name].file for name in layouts):
        if file is not None:
            read_gauge_table(vehicle.beside(file))  # refused before meshes are read, which takes longer
    resolution = vehicle.structure.resolution if choice is None else choice.resolution
    meshes_of = _section_meshes if vehicle.structure.mesh is None else _named_meshes
    mesh, second, model, source = meshes_of(vehicle, resolution)
    matter, in_use = matter_of(vehicle), vehicle.gauges.layout
    for made in (mesh, second):
        if made is not None:
            matter.check(made)
    inside = vehicle.structure.internal_pressure_Pa
    if INTERNAL not in mesh.surface and inside != "ambient":
        raise InputError(
            f"structure.internal_pressure_Pa: expected 'ambient' with a mesh without a cavity, got {inside:g}"
        )
    gauges = {name: free_gauges(vehicle, name, mesh) for name in layouts}
    if vehicle.noise.moves_gauges and in_use in gauges:
        gauges |= displaced_on_surface(in_use, gauges[in_use], *surface_axes(mesh, gauges[in_use]))
    return SolidCase(
        vehicle=vehicle.name,
        model=model,
        make=lambda: mesh,
        second=None if second is None else ("another mesh", lambda _: second),
        made_of={"source": source, "matter": asdict(matter)},
        mesh_record={"model": model, **source},
        thickness=1e-3 * vehicle.structure.wall_thickness_mm,
        matter=matter,
        support=support_of(vehicle),
        layouts=gauges,
    )


Meshes = tuple[SolidMesh, SolidMesh | None, str, dict[str, Any]]
"""The mesh, the one that checks it, the model's name and the source of both."""


def _section_meshes(vehicle: Vehicle, resolution: str) -> Meshes:
    body, wall, chosen = vehicle.sectioned_body(), wall_of(vehicle), RESOLUTIONS[resolution]
    coarser = SweptResolution(
        chosen.element_length / CHECK_SIZE, chosen.n_layers, round(CHECK_SIZE * chosen.n_sectors)
    )
    table = {name: np.asarray(value).tolist() for name, value in asdict(body).items()}
    source = {"sections": table, "wall": asdict(wall), "resolution": resolution}
    return section_wall(body, wall, chosen), section_wall(body, wall, coarser), "swept_hexahedra", source


def _named_meshes(vehicle: Vehicle, resolution: str) -> Meshes:
    entry = vehicle.structure
    assert entry.mesh is not None
    unit = METRES[entry.mesh_length_unit]
    paths = [vehicle.beside(name) for name in (entry.mesh, entry.checked_by) if name is not None]
    length = TETRAHEDRON_LENGTH[resolution] * float(
        np.sqrt(0.5 * vehicle.reference_quantities().length * 1e-3 * entry.wall_thickness_mm)
    )
    assert vehicle.shape is not None
    read = [_mesh_of_file(path, _digest(path), unit, length, vehicle.shape.length_m) for path in paths]
    source: dict[str, Any] = {"files": {path.name: _digest(path) for path in paths}, "unit": unit}
    made = paths[0].suffix.lower() in CAD_FORMATS
    if made:
        source["element_length"] = length
    if len(read) > 1:
        check_other(read[0], read[1], paths[1])
    return read[0], read[1] if len(read) > 1 else None, "gmsh_tetrahedra" if made else "imported", source


def flying_mesh(vehicle: Vehicle, case: SolidCase) -> SolidMesh | None:
    """Return the mesh that plays the vehicle that flies, None where there is none.

    A body of sections has a finer mesh than the map's, other shapes the second mesh of their case.
    """
    if vehicle.has_meridian or vehicle.structure.mesh is not None:
        return None if case.second is None else case.second[1](case.mesh.full).full
    chosen, truth = RESOLUTIONS[vehicle.structure.resolution], vehicle.resolution.truth
    finer = SweptResolution(
        1e-3 * truth.element_length_mm, truth.wall_layers, round(chosen.n_sectors * FLYING_SECTORS / 2.0) * 2
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
