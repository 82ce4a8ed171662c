"""CalculiX: the input deck of a mesh with its loads, a run of ccx, and the results it prints."""

import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np

from builder.structure.solid.element_faces import face_keys
from builder.structure.solid.solid_mesh import SolidMesh
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray, IntArray

KIND = {"hexahedron20": "C3D20", "tetrahedron10": "C3D10"}
# Corners of the faces 1, 2, ... of CalculiX's elements (CalculiX CrunchiX User's Manual, *DLOAD).
FACES = {
    "hexahedron20": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    "tetrahedron10": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
}


def installed() -> bool:
    """Whether ccx is on the path."""
    return shutil.which("ccx") is not None


def deck(
    mesh: SolidMesh,
    material: Material,
    clamped: IntArray,
    force: FloatArray | None,
    pressed: tuple[str, float] | None,
    kind: str | None = None,
) -> str:
    """Return a static step: nodal forces (n, 3) [N], or a pressure [Pa] on a surface by CalculiX's own load.

    ``kind`` is CalculiX's name of the elements, that of :data:`KIND` by default.
    """
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{i},{x:.12e},{y:.12e},{z:.12e}" for i, (x, y, z) in enumerate(mesh.node, 1)]
    lines.append(f"*ELEMENT, TYPE={kind or KIND[mesh.element_type]}, ELSET=EALL")
    for number, nodes in enumerate(mesh.element + 1, 1):
        text = [str(number), *map(str, nodes)]
        lines += [
            ",".join(text[i : i + 15]) + ("," if i + 15 < len(text) else "") for i in range(0, len(text), 15)
        ]
    lines += ["*NSET, NSET=HELD", *(f"{node + 1}," for node in clamped)]
    lines += ["*MATERIAL, NAME=METAL", "*ELASTIC", f"{material.youngs_modulus:.12e},{material.poisson_ratio:.12e}"]
    lines += ["*SOLID SECTION, ELSET=EALL, MATERIAL=METAL", "*BOUNDARY", "HELD,1,3", "*STEP", "*STATIC"]
    if force is not None:
        lines.append("*CLOAD")
        lines += [f"{n + 1},{axis + 1},{force[n, axis]:.12e}" for n, axis in np.argwhere(force)]
    if pressed is not None:
        lines.append("*DLOAD")
        lines += [f"{owner + 1},P{face},{pressed[1]:.12e}" for owner, face in _faces(mesh, pressed[0])]
    lines += ["*NODE PRINT, NSET=NALL", "U", "*EL FILE", "E", "*END STEP", ""]
    return "\n".join(lines)


def _faces(mesh: SolidMesh, surface: str) -> list[tuple[int, int]]:
    """Return the element and CalculiX's number of the face of each facet."""
    facet = face_keys(mesh.element_type, mesh.named_surface(surface))
    wanted = {tuple(key) for key in facet.tolist()}
    found = []
    for face, corners in enumerate(FACES[mesh.element_type], 1):
        keys = np.sort(mesh.element[:, corners], axis=1)
        found += [(owner, face) for owner, key in enumerate(keys.tolist()) if tuple(key) in wanted]
    assert len(found) == len(wanted)
    return found


def run(folder: Path, text: str) -> float:
    """Run ccx on a deck, one thread, and return the wall-clock seconds."""
    (folder / "case.inp").write_text(text)
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "CCX_NPROC_EQUATION_SOLVER": "1"}
    start = time.perf_counter()
    finished = subprocess.run(
        ["ccx", "case"], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert "Job finished" in finished.stdout, finished.stdout[-2000:]
    return time.perf_counter() - start


def printed_displacement(folder: Path, n_nodes: int) -> FloatArray:
    """Return displacements (n, 3) [m] from case.dat, seven digits."""
    rows = [line.split() for line in (folder / "case.dat").read_text().splitlines()]
    values = [row for row in rows if len(row) == 4 and row[0].isdigit()]
    displacement = np.full((n_nodes, 3), np.nan)
    displacement[[int(row[0]) - 1 for row in values]] = [[float(v) for v in row[1:]] for row in values]
    return displacement


def nodal_strain(folder: Path, n_nodes: int) -> FloatArray:
    """Return strain tensors (n, 3, 3) from case.frd: CalculiX's own, extrapolated to nodes and averaged."""
    lines = (folder / "case.frd").read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(" -4  TOSTRAIN"))
    strain = np.full((n_nodes, 3, 3), np.nan)
    for line in lines[start:]:
        if line.startswith(" -3"):
            break
        if line.startswith(" -1"):
            xx, yy, zz, xy, yz, zx = (float(line[13 + 12 * k : 25 + 12 * k]) for k in range(6))
            strain[int(line[3:13]) - 1] = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]
    return strain
