"""Choice of the mesh of a vehicle's structure: swept, made by Gmsh, or imported."""

from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from builder.structure.solid.solid_mesh import SolidMesh, same_elements
from builder.structure.solid.swept_mesh import (
    RESOLUTIONS,
    AnyMesh,
    SweptResolution,
    SweptSector,
    swept_wall,
)
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.errors import InputError

SWEPT, GMSH = "swept", "gmsh"
CAD_FORMATS, TRIANGLE_FORMAT = (".step", ".stp"), ".stl"
TETRAHEDRON_LENGTH = {"coarse": 0.9, "medium": 0.6, "paper": 0.45}
"""Edge round the axis over sqrt(r t), the length in which bending of the wall decays; longer ones lock.

Elements of STEP and STL files are as long along the axis as round it, elements of the vehicle's own wall twice as
long.
"""

NONE_HERE = "expected none with the solid model, of one material; structure.model = 'fourier' has them"

COARSER = {"paper": "medium", "medium": "coarse"}
COARSEST = SweptResolution(0.060, 1, 16)
"""What ``coarse`` is compared with."""


@dataclass(frozen=True, kw_only=True)
class MeshChoice:
    """A mesh and its resolution.

    Attributes
    ----------
    source : ``"swept"``, ``"gmsh"`` or the path of a file: a mesh, or a STEP or STL file that Gmsh meshes.
    resolution : key of :data:`RESOLUTIONS`; a mesh that is read has its own.
    unit : length of the unit of a mesh or STL file [m].
    by_position : find the surfaces of a mesh that is read by their position, not by names.
    layers : elements through the wall of a swept mesh; None for the layers of the resolution.
    """

    source: str = SWEPT
    resolution: str = "medium"
    unit: float = 1.0
    by_position: bool = False
    layers: int | None = None

    def __post_init__(self) -> None:
        if self.resolution not in RESOLUTIONS:
            raise InputError(f"resolution '{self.resolution}' found, must be one of {', '.join(RESOLUTIONS)}")
        if self.file is None and (self.unit != 1.0 or self.by_position):
            raise InputError(
                f"model '{self.source}' needs no unit and has named surfaces: those options are for files"
            )

    @property
    def file(self) -> Path | None:
        """The file, or None."""
        return None if self.source in (SWEPT, GMSH) else Path(self.source)

    @property
    def model(self) -> str:
        """What :class:`~builder.structure.structure_file.Structure` calls it."""
        if self.file is None:
            return "swept_hexahedra" if self.source == SWEPT else "gmsh_tetrahedra"
        made = self.file.suffix.lower() in (*CAD_FORMATS, TRIANGLE_FORMAT)
        return "gmsh_tetrahedra" if made else "imported"

    def inputs(self) -> dict[str, Any]:
        """Return all that the mesh depends on besides body and wall, a file by its bytes."""
        entries: dict[str, Any] = {"model": self.model, "unit": self.unit, "by_position": self.by_position}
        if self.file is not None:
            if not self.file.is_file():
                raise InputError(f"{self.file}: no such file; a model is '{SWEPT}', '{GMSH}' or a mesh file")
            entries["file"] = sha256(self.file.read_bytes()).hexdigest()
        if self.model != "imported":
            entries["resolution"] = self.resolution
        if self.source == SWEPT:
            entries["layers"] = self.with_layers(RESOLUTIONS[self.resolution]).n_layers
        return entries

    def with_layers(self, resolution: SweptResolution) -> SweptResolution:
        """Return a resolution of swept meshes with the layers chosen."""
        return resolution if self.layers is None else replace(resolution, n_layers=self.layers)


def make_mesh(body: BodyOfRevolution, wall: Wall, choice: MeshChoice) -> AnyMesh:
    """Make or read the mesh; a swept one as its sector."""
    if not wall.is_plain:
        raise InputError(f"structure.regions, structure.frames: {NONE_HERE}")
    if wall.flight is not None and (wall.flight.points or wall.flight.covers):
        raise InputError(f"structure.point_masses, structure.covers: {NONE_HERE}")
    if choice.source == SWEPT:
        return swept_wall(body, wall, choice.with_layers(RESOLUTIONS[choice.resolution]))
    from builder.structure.solid.gmsh_mesh import graded_wall_mesh, step_mesh, stl_mesh
    from builder.structure.solid.mesh_files import read_mesh

    relative = TETRAHEDRON_LENGTH[choice.resolution]
    if choice.file is None:
        return graded_wall_mesh(body, wall, relative)
    length = relative * float(np.sqrt(body.base_radius * wall.thickness))
    ending = choice.file.suffix.lower()
    if ending in CAD_FORMATS:
        return step_mesh(choice.file, length, body.base_radius)
    if ending == TRIANGLE_FORMAT:
        return stl_mesh(choice.file, length, choice.unit, graded_from=body.base_radius)
    return read_mesh(choice.file, choice.unit, name_by_position=choice.by_position, length=body.length)


def check_other(mesh: SolidMesh, second: SolidMesh, path: Path) -> None:
    """Refuse a second mesh, of ``path``, with the elements of the first: their difference would be 0."""
    if same_elements(mesh, second):
        raise InputError(
            f"structure.checked_by: expected another mesh than the first, got its {len(mesh.element)} elements "
            f"again in '{path.name}'"
        )


def coarser_sector(body: BodyOfRevolution, wall: Wall, choice: MeshChoice) -> SweptSector:
    """Return the swept mesh that a mesh is compared with: the next coarser, of no swept one the same."""
    if choice.source != SWEPT:
        return swept_wall(body, wall, choice.with_layers(RESOLUTIONS[choice.resolution]))
    coarser = COARSER.get(choice.resolution)
    return swept_wall(body, wall, choice.with_layers(COARSEST if coarser is None else RESOLUTIONS[coarser]))
