"""Result of the solid model: strain of gauges per pressure (``structure.h5`` of ``strainfmu structure``).

A second discretisation of a structure: the difference of the two is what its strains are uncertain by.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.files import schema_of
from strainfmu.records import inner_record, load_record, save_record

CHECK_UNITS = {"factor": "1", "strain_operator": "1/Pa", "point": "m"}


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshCheck:
    """Z_p of the same gauges on another mesh.

    Attributes
    ----------
    against : what it is, in words.
    factor : error of the structure over the difference of the two.
    strain_operator : (n_d, n_q) strain per pressure at its nodes [1/Pa].
    point, triangle : (n_q, 3) [m], (n_t, 3) its surface; None where it is the surface of the structure.

    Raises
    ------
    InputError
        Shapes do not fit, or a value is not finite.
    """

    against: str
    factor: float
    strain_operator: FloatArray
    point: FloatArray | None = None
    triangle: IntArray | None = None

    def __post_init__(self) -> None:
        if self.point is not None and len(self.point) != self.strain_operator.shape[1]:
            raise InputError(f"check: {len(self.point)} nodes, strain_operator {self.strain_operator.shape}")
        if not (np.isfinite(self.strain_operator).all() and np.isfinite(self.factor)):
            raise InputError("check: not all values are finite")


SCHEMA = "strainfmu.structure"
SCHEMA_VERSION = 1

EXTERNAL_MODELS = ("strain_per_snapshot", "influence")
"""Models that are not meshes of ours: :mod:`builder.structure.external`."""

UNITS = {
    "gauge_position": "m",
    "gauge_length": "m",
    "point": "m",
    "strain_operator": "1/Pa",
    "mesh_error": "1/Pa",
}


_SIZES = (("degrees_of_freedom", "dofs"), ("load_cases", "load cases"), ("loaded_nodes", "loaded nodes"))


@dataclass(frozen=True, eq=False, kw_only=True)
class Structure:
    """Strain per pressure of a vehicle's gauges, Z_p, and the surface that carries the pressure.

    Attributes
    ----------
    vehicle : name.
    model : ``"swept_hexahedra"``, ``"gmsh_tetrahedra"`` or ``"imported"``; of another structural code one of
        :data:`EXTERNAL_MODELS`.
    settings : what it was made from: resolution, wall, material, support, locking ratios, rows of the mesh report,
        what the mesh error is measured against, and fingerprints (``made_from``) of mesh and gauges.
    statistics : elements, displacement components, solver, licence, relative residual; no times, so that equal
        inputs give an equal file.
    gauge_names, layout : name of each gauge and the layout it is of; a name occurs once per layout.
    gauge_position, gauge_direction : (n_d, 3) [m] and unit vectors, body axes, as requested.
    gauge_length : (n_d,) [m], 0 for strain at a point.
    gauge_surface : ``"internal"`` or ``"external"`` of each gauge.
    point, triangle : (n_p, 3) [m], (n_t, 3): nodes of the mesh's external surface, its facets cut into triangles.
    normal : (n_p, 3) outward unit normals of the triangles at the nodes.
    strain_operator : (n_d, n_p) strain per pressure at each node [1/Pa].
    mesh_error : (n_d,) error of each gauge's strain by the mesh, per amplitude of the reference loads [1/Pa]
        (:mod:`builder.structure.solid.checks`).
    check : the same gauges on another mesh; None where there is none.

    Raises
    ------
    InputError
        An array's shape does not fit the others, a value is not finite, or a gauge occurs twice.
    """

    vehicle: str
    model: str
    settings: dict[str, Any]
    statistics: dict[str, Any]
    gauge_names: tuple[str, ...]
    layout: tuple[str, ...]
    gauge_position: FloatArray
    gauge_direction: FloatArray
    gauge_length: FloatArray
    gauge_surface: tuple[str, ...]
    point: FloatArray
    triangle: IntArray
    normal: FloatArray
    strain_operator: FloatArray
    mesh_error: FloatArray
    check: MeshCheck | None = field(default=None, metadata=inner_record(MeshCheck, CHECK_UNITS))

    def __post_init__(self) -> None:
        n_d, n_p = len(self.gauge_names), len(self.point)
        shapes = {
            "gauge_position": (n_d, 3),
            "gauge_direction": (n_d, 3),
            "gauge_length": (n_d,),
            "point": (n_p, 3),
            "normal": (n_p, 3),
            "strain_operator": (n_d, n_p),
            "mesh_error": (n_d,),
        }
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise InputError(f"{name}: shape {getattr(self, name).shape} found, must be {shape}")
            if not np.isfinite(getattr(self, name)).all():
                raise InputError(f"{name}: not all values are finite")
        for name in ("layout", "gauge_surface"):
            if len(getattr(self, name)) != n_d:
                raise InputError(f"{name}: {len(getattr(self, name))} found, must be {n_d}")
        if not n_d or len(set(zip(self.layout, self.gauge_names, strict=True))) < n_d:
            raise InputError("gauge_names: none, or one twice in a layout")
        if not set(self.gauge_surface) <= {"internal", "external"}:
            raise InputError(
                f"gauge_surface: {sorted(set(self.gauge_surface))} found, must be internal or external"
            )
        SurfaceMesh(self.point, self.triangle)
        if self.check is not None and len(self.check.strain_operator) != n_d:
            raise InputError(f"check: {len(self.check.strain_operator)} gauges found, must be {n_d}")

    @property
    def surface(self) -> SurfaceMesh:
        """The surface that carries the pressure."""
        return SurfaceMesh(self.point, self.triangle)

    @property
    def is_external(self) -> bool:
        """Whether another structural code made it, so that body and gauges are known, wall and support are not."""
        return self.model in EXTERNAL_MODELS

    @property
    def size(self) -> str:
        """How large it is, in words."""
        used = self.statistics
        return next(
            (f"{used[key]} {words}" for key, words in _SIZES if key in used), f"{len(self.point)} pressure nodes"
        )

    @property
    def layouts(self) -> tuple[str, ...]:
        """Names of the layouts, each once."""
        return tuple(dict.fromkeys(self.layout))

    def gauges_of(self, layout: str) -> IntArray:
        """Return the indices (k,) of a layout's gauges.

        Raises
        ------
        InputError
            There is no such layout; the message lists those there are.
        """
        if layout not in self.layout:
            raise InputError(f"structure: no gauges of layout '{layout}', found {', '.join(self.layouts)}")
        return np.flatnonzero(np.array(self.layout) == layout)


def save_structure(structure: Structure, path: Path) -> str:
    """Write ``structure.h5`` atomically and return its content hash.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """
    return save_record(structure, path, SCHEMA, SCHEMA_VERSION, UNITS)


def load_structure(path: Path) -> Structure:
    """Read ``structure.h5``.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema or version.
    """
    return load_record(Structure, path, SCHEMA, SCHEMA_VERSION)


def structure_to_reuse(path: Path) -> Structure | None:
    """Return what ``path`` holds; None where there is no file, or none that can be read, so that it is made again.

    Raises
    ------
    InputError
        ``path`` holds an artefact of another kind: that is not written over.
    """
    if not path.exists():
        return None
    try:
        schema = schema_of(path)
    except InputError:
        return None
    if schema != SCHEMA:
        raise InputError(f"{path}: holds '{schema}', give another name for the structure")
    try:
        return load_structure(path)
    except InputError:
        return None
