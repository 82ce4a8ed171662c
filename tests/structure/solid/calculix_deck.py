"""CalculiX: the input deck of a mesh with its loads, a run of ccx, and the results it prints."""

import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np

from builder.structure.solid.elements import FACE_CORNERS, face_keys
from builder.structure.solid.matter import Matter, PointMass
from builder.structure.solid.nodal_loads import vector_area
from builder.structure.solid.solid_mesh import SolidMesh
from builder.structure.solid.supports import rigid_motions
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
    lines = _mesh_lines(mesh, kind or KIND[mesh.element_type])
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


def _mesh_lines(mesh: SolidMesh, kind: str) -> list[str]:
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{i},{x:.12e},{y:.12e},{z:.12e}" for i, (x, y, z) in enumerate(mesh.node, 1)]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=EALL")
    for number, nodes in enumerate(mesh.element + 1, 1):
        text = [str(number), *map(str, nodes)]
        lines += [
            ",".join(text[i : i + 15]) + ("," if i + 15 < len(text) else "") for i in range(0, len(text), 15)
        ]
    return lines


def free_flight_deck(
    mesh: SolidMesh, matter: Matter, force: FloatArray, time: float, kind: str | None = None
) -> str:
    """Return one implicit step of ``time`` [s] of a body that nothing holds, under nodal forces (n, 3) [N].

    The forces grow from 0, so the body starts without acceleration, and the average acceleration of Newmark's rule
    makes K u + 4 M u / time^2 = f of the step: with a time of many periods of the body u is rigid motion and the
    strain under load and inertia. Regions have materials of their own. Each point mass moves as
    the rigid motion nearest to that of the corner nodes of its surface, weighted with area.
    """
    lines = _mesh_lines(mesh, kind or KIND[mesh.element_type])
    material, density = matter.materials(mesh.region_names), matter.densities(mesh.region_names)
    for i, name in enumerate(mesh.region_names):
        lines += [f"*ELSET, ELSET=R{i}", *(f"{number + 1}," for number in np.flatnonzero(mesh.region == i))]
        lines += [f"*MATERIAL, NAME=M{i}", "*ELASTIC"]
        lines += [f"{material[name].youngs_modulus:.12e},{material[name].poisson_ratio:.12e}"]
        lines += ["*DENSITY", f"{density[name]:.12e}", f"*SOLID SECTION, ELSET=R{i}, MATERIAL=M{i}"]
    for i, one in enumerate(matter.points):
        lines += _carried(mesh, one, i)
    lines += ["*AMPLITUDE, NAME=GROWING", f"0.,0.,{time:.12e},1."]
    lines += ["*STEP", "*DYNAMIC, DIRECT, ALPHA=0.", f"{time:.12e},{time:.12e}", "*CLOAD, AMPLITUDE=GROWING"]
    lines += [f"{n + 1},{axis + 1},{force[n, axis]:.12e}" for n, axis in np.argwhere(force)]
    lines += ["*NODE PRINT, NSET=NALL", "U", "*EL FILE, NSET=NALL", "E", "*END STEP", ""]
    return "\n".join(lines)


SPECK = 1e-3 * np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])
"""Corners of a tetrahedron of 2.67e-9 m3 [m]: CalculiX refuses equations between nodes of its mass elements."""


def _carried(mesh: SolidMesh, mass: PointMass, number: int) -> list[str]:
    """Return a mass as a speck of heavy matter, and the equations by which its corners move with the surface."""
    first, density = mesh.n_nodes + 1 + 4 * number, mass.mass * 3.0 / 8e-9
    corner = np.array(mass.position) + SPECK
    lines = ["*NODE", *(f"{first + i},{x:.12e},{y:.12e},{z:.12e}" for i, (x, y, z) in enumerate(corner))]
    lines += [f"*ELEMENT, TYPE=C3D4, ELSET=P{number}", f"{len(mesh.element) + 1 + number},"]
    lines[-1] += ",".join(str(first + i) for i in range(4))
    lines += [f"*MATERIAL, NAME=P{number}", "*ELASTIC", "1e6,0.3", "*DENSITY", f"{density:.12e}"]
    lines += [f"*SOLID SECTION, ELSET=P{number}, MATERIAL=P{number}"]
    held, share = _nearest_motion(mesh, mass.surface, corner)
    for row, coefficient in enumerate(share):
        term = [f"{first + row // 3},{row % 3 + 1},-1."]
        term += [
            f"{held[k // 3] + 1},{k % 3 + 1},{coefficient[k]:.12e}"
            for k in np.flatnonzero(np.abs(coefficient) > 1e-14)
        ]
        lines += ["*EQUATION", f"{len(term)}", *(",".join(term[k : k + 4]) for k in range(0, len(term), 4))]
    return lines


def _nearest_motion(mesh: SolidMesh, surface: str, point: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return a surface's corner nodes (k,) and the motion of points (n, 3) [m] per theirs, (3 n, 3 k)."""
    facet = mesh.named_surface(surface)
    corner = facet[:, : FACE_CORNERS[mesh.element_type]]
    area = np.linalg.norm(vector_area(mesh.element_type, mesh.node[facet]), axis=-1).sum(axis=1)
    held, index = np.unique(corner, return_inverse=True)
    weight = np.zeros(len(held))
    np.add.at(weight, index.reshape(corner.shape), area[:, None])
    motion = rigid_motions(mesh.node[held])
    weighted = np.repeat(weight, 3)[:, None] * motion
    return held, rigid_motions(point) @ np.linalg.solve(motion.T @ weighted, weighted.T)


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
