"""A Gmsh session: the model, the element size, and its tetrahedra as a solid mesh.

Gmsh is optional (extra ``mesh``) and under the GNU General Public License, version 2 or later; nothing of it is
loaded until a mesh is requested.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from builder.structure.solid.elements.element_quality import straighten_folded
from builder.structure.solid.mesh.solid_mesh import SolidMesh
from builder.structure.solid.mesh.surface_names import surfaces_of_hollow_body
from strainfmu.errors import InputError, StrainfmuError

WALL_REGION = "wall"
SYSTEM_PACKAGES = "libglu1-mesa libgl1 libxrender1 libxcursor1 libxft2 libxinerama1 libgomp1"
TETRAHEDRON_OF_4_NODES, TETRAHEDRON_OF_10_NODES = 4, 11  # Gmsh's numbers of the types
# Gmsh has the middles of edges 2-3 and 1-3 the other way round than VTK.
GMSH_TO_VTK = np.array([0, 1, 2, 3, 4, 5, 6, 7, 9, 8])
ORIGIN, X_AXIS = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
"""A point and a direction, as Gmsh takes them."""

OPTIONS = {
    "General.Terminal": 0.0,
    "General.NumThreads": 1.0,
    "Mesh.MeshSizeFromPoints": 0.0,
    "Mesh.MeshSizeFromCurvature": 0.0,
    "Mesh.MeshSizeExtendFromBoundary": 0.0,
}
"""Silent, repeatable, and sizes from our formula alone."""


def load_gmsh() -> Any:
    """Return the module ``gmsh``.

    Raises
    ------
    StrainfmuError
        Gmsh or a system library it needs is not installed.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise StrainfmuError(
            f'Gmsh cannot be loaded ({error}): pip install "strainfmu[mesh]", on Debian also '
            f"apt-get install {SYSTEM_PACKAGES}"
        ) from error
    return gmsh


@contextlib.contextmanager
def gmsh_model(what: str) -> Iterator[Any]:
    """Give a fresh, silent Gmsh model, and take it away afterwards; its errors become one line about ``what``.

    Raises
    ------
    StrainfmuError
        Gmsh is not installed or fails.
    """
    gmsh = load_gmsh()
    ours = not gmsh.isInitialized()
    if ours:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.restoreDefaults()  # options outlive a session
    before = {option: gmsh.option.getNumber(option) for option in OPTIONS}
    try:
        gmsh.model.add("strainfmu")
        for option, value in OPTIONS.items():
            gmsh.option.setNumber(option, value)
        yield gmsh
    except StrainfmuError:
        raise
    except Exception as error:  # Gmsh raises nothing more specific
        raise StrainfmuError(f"{what}: Gmsh fails: {' '.join(str(error).split())}") from error
    finally:
        gmsh.model.remove()
        for option, value in before.items():
            gmsh.option.setNumber(option, value)
        if ours:
            gmsh.finalize()


def check_length(length: float, name: str = "element_length", unit: str = " m") -> None:
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"{name} {length:g}{unit} must be greater than 0")


def set_size(gmsh: Any, formula: str) -> None:
    """Let the element size [m] follow a formula of x, y, z [m]."""
    field = gmsh.model.mesh.field
    size = field.add("MathEval")
    field.setString(size, "F", formula)
    field.setAsBackgroundMesh(size)


def mesh_volumes(gmsh: Any, what: str, region: dict[int, str], stretch: float = 1.0) -> SolidMesh:
    """Mesh all volumes, then draw the mesh out along x by ``stretch``.

    ``region`` names volumes by number, by default all are :data:`WALL_REGION`; ``what`` is for messages.
    """
    gmsh.model.mesh.generate(3)
    if not len(gmsh.model.mesh.getElementsByType(TETRAHEDRON_OF_4_NODES)[0]):
        raise StrainfmuError(f"{what}: Gmsh makes no elements of this surface; look at it in Gmsh")
    gmsh.model.mesh.setOrder(2)
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    position = np.empty((int(tags.max()) + 1, 3))
    position[tags.astype(np.int64)] = np.asarray(xyz).reshape(-1, 3)
    elements, regions, names = [], [], []
    for _, tag in gmsh.model.getEntities(3):
        _, node = gmsh.model.mesh.getElementsByType(TETRAHEDRON_OF_10_NODES, tag)
        name = region.get(tag, WALL_REGION)
        names += [name] if name not in names else []
        elements.append(np.asarray(node, dtype=np.int64).reshape(-1, 10)[:, GMSH_TO_VTK])
        regions.append(np.full(len(elements[-1]), names.index(name), dtype=np.int64))
    used, element = np.unique(np.concatenate(elements), return_inverse=True)
    element = element.reshape(-1, 10).astype(np.int64)
    node = straighten_folded("tetrahedron10", position[used] * np.array([stretch, 1.0, 1.0]), element)
    surface = surfaces_of_hollow_body("tetrahedron10", node, element)
    return SolidMesh(
        element_type="tetrahedron10",
        node=node,
        element=element,
        region=np.concatenate(regions),
        region_names=tuple(names),
        surface=surface,
    )
