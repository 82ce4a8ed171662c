"""Files of rhoCentralFoam: mesh, fields and settings of a case, its run, the fields that come back."""

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

import numpy as np

from strainfmu.arrays import FloatArray, IntArray

SOLVER = "rhoCentralFoam"
ENVIRONMENT = {"WM_PROJECT_DIR": "/usr/share/openfoam"}
"""What Debian's package needs, unless the shell has OpenFOAM's own environment."""


@dataclass(frozen=True, eq=False)
class State:
    """Flow in some cells (...,): pressure and temperature over the free stream's, velocity (..., 3) over its
    sound speed."""

    pressure: FloatArray
    temperature: FloatArray
    velocity: FloatArray


def is_available() -> bool:
    """Whether the solver is installed."""
    return shutil.which(SOLVER) is not None


def write_case(
    vertices: FloatArray,
    u: tuple[float, float, float],
    plane: State,
    iterations: int,
    directory: Path,
    *,
    from_axis: bool = False,
    courant: float = 0.2,
) -> None:
    """Write a mesh (n_x + 1, n_phi + 1, n_r + 1, 3) in a stream of velocity ``u`` over its sound speed.

    ``plane`` (n_phi, n_r) fills the mesh at first, and enters it, unless the mesh begins ``from_axis``: then
    nothing does, and its sides are planes through the axis, not one plane. Limiters then work face by face:
    round a blunt tip the other limiter does not come to rest. Five states are kept, evenly.
    """
    write_mesh(vertices, directory / "constant" / "polyMesh", "symmetry" if from_axis else "symmetryPlane")
    n_planes = len(vertices) - 1
    for name, dimensions, values, free_stream, wall in (
        ("p", "[1 -1 -2 0 0 0 0]", plane.pressure, (1.0,), "zeroGradient"),
        ("T", "[0 0 0 1 0 0 0]", plane.temperature, (1.0,), "zeroGradient"),
        ("U", "[0 1 -1 0 0 0 0]", plane.velocity, u, "slip"),
    ):
        _write_field(
            directory=directory,
            name=name,
            dimensions=dimensions,
            plane=values,
            free_stream=free_stream,
            n_planes=n_planes,
            wall=wall,
            from_axis=from_axis,
        )
    control = _control(iterations, courant=courant, kept=0 if from_axis else 2)
    for name, text in (DICTIONARIES | {"system/controlDict": control}).items():
        if from_axis:
            for limited, face_by_face in FACE_BY_FACE.items():
                text = text.replace(limited, face_by_face)
        _write(directory / name, "dictionary", text)


def write_mesh(vertices: FloatArray, directory: Path, side: str = "symmetryPlane") -> None:
    """Write the structured mesh of ``vertices`` (n_x + 1, n_phi + 1, n_r + 1, 3) in OpenFOAM's format.

    Vertices may coincide, as on an axis: faces lose corners there, or vanish. ``side`` is the type of the sides.
    """
    place, first = np.unique(vertices.reshape(-1, 3), axis=0, return_inverse=True)
    point: IntArray = first.reshape(vertices.shape[:3])
    cell = np.arange(point[1:, 1:, 1:].size).reshape(point[1:, 1:, 1:].shape)
    # Corners of all faces across each index, in the order whose normal points to higher indices.
    across = [
        np.stack([point[:, :-1, :-1], point[:, 1:, :-1], point[:, 1:, 1:], point[:, :-1, 1:]], axis=-1),
        np.stack([point[:-1, :, :-1], point[:-1, :, 1:], point[1:, :, 1:], point[1:, :, :-1]], axis=-1),
        np.stack([point[:-1, :-1, :], point[1:, :-1, :], point[1:, 1:, :], point[:-1, 1:, :]], axis=-1),
    ]
    corners, owner, neighbour = [], [], []
    for axis, faces in enumerate(across):
        n = faces.shape[axis]
        corners.append(faces.take(range(1, n - 1), axis).reshape(-1, 4))
        owner.append(cell.take(range(n - 2), axis).ravel())
        neighbour.append(cell.take(range(1, n - 1), axis).ravel())
    faces, owners, neighbours = np.concatenate(corners), np.concatenate(owner), np.concatenate(neighbour)
    order = np.lexsort((neighbours, owners))  # OpenFOAM wants internal faces in this order
    all_faces, all_owners, patches = [faces[order]], [owners[order]], []
    n_faces = len(order)
    for name, kind, sides in PATCHES:
        count = 0
        for axis, end in sides:
            outside = across[axis].take(end, axis).reshape(-1, 4)
            has_area = np.array([len(set(corner)) > 2 for corner in outside.tolist()])
            all_faces.append((outside if end == -1 else outside[:, ::-1])[has_area])  # normals point outward
            all_owners.append(cell.take(end, axis).ravel()[has_area])
            count += int(has_area.sum())
        patches.append(f"{name} {{ type {kind or side}; nFaces {count}; startFace {n_faces}; }}")
        n_faces += count
    _write(directory / "points", "vectorField", _rows(place, "(%.12g %.12g %.12g)"))
    _write(directory / "faces", "faceList", _polygons(np.concatenate(all_faces)))
    _write(directory / "owner", "labelList", _rows(np.concatenate(all_owners)[:, None], "%d"))
    _write(directory / "neighbour", "labelList", _rows(neighbours[order][:, None], "%d"))
    _write(directory / "boundary", "polyBoundaryMesh", f"{len(patches)}\n(\n" + "\n".join(patches) + "\n)\n")


PATCHES = (
    ("inlet", "patch", ((0, 0),)),
    ("outlet", "patch", ((0, -1),)),
    ("symmetry", "", ((1, 0), (1, -1))),
    ("wall", "patch", ((2, 0),)),
    ("outer", "patch", ((2, -1),)),
)
"""Name, type, where the case does not tell it, and (index, end) of the mesh's sides."""


def _polygons(faces: IntArray) -> str:
    """Return faces (n, 4) as OpenFOAM writes them, each corner once."""
    corners = [list(dict.fromkeys(face)) for face in faces.tolist()]
    rows = [f"{len(face)}({' '.join(map(str, face))})" for face in corners]
    return f"{len(rows)}\n(\n" + "\n".join(rows) + "\n)\n"


def _rows(values: FloatArray | IntArray, row: str) -> str:
    return f"{len(values)}\n(\n" + "\n".join(row % tuple(value) for value in values.tolist()) + "\n)\n"


def _write(path: Path, kind: str, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    header = f"FoamFile {{ version 2.0; format ascii; class {kind}; object {path.name}; }}\n"
    path.write_text(header + text, encoding="ascii")


def _write_field(
    directory: Path,
    name: str,
    dimensions: str,
    plane: FloatArray,
    free_stream: tuple[float, ...],
    n_planes: int,
    wall: str,
    from_axis: bool,
) -> None:
    n = len(free_stream)
    kind, row = ("scalar", "%.10g") if n == 1 else ("vector", "(%.10g %.10g %.10g)")
    values = plane.reshape(-1, n)
    inside = f"nonuniform List<{kind}> " + _rows(np.tile(values, (n_planes, 1)), row)
    entering = f"nonuniform List<{kind}> " + _rows(values, row)
    outside = row % free_stream
    inlet = "zeroGradient" if from_axis else f"fixedValue; value {entering}"
    side = "symmetry" if from_axis else "symmetryPlane"
    text = f"""dimensions {dimensions};
internalField {inside};
boundaryField
{{
    inlet {{ type {inlet}; }}
    outlet {{ type zeroGradient; }}
    symmetry {{ type {side}; }}
    wall {{ type {wall}; }}
    outer {{ type fixedValue; value uniform {outside}; }}
}}
"""
    _write(directory / "0" / name, f"vol{kind.capitalize()}Field", text)


def _control(iterations: int, courant: float, kept: int) -> str:
    return f"""application {SOLVER};
startFrom startTime; startTime 0; stopAt endTime; endTime {iterations};
deltaT 1; maxCo {courant}; maxDeltaT 1e3; rDeltaTSmoothingCoeff 0.3;
writeControl timeStep; writeInterval {iterations // 5}; purgeWrite {kept};
writeFormat ascii; writePrecision 8; timeFormat general; timePrecision 8; runTimeModifiable no;
"""


FACE_BY_FACE = {
    "reconstruct(rho) linearUpwind limited": "reconstruct(rho) vanLeer",
    "reconstruct(U) linearUpwind limited": "reconstruct(U) vanLeerV",
    "reconstruct(T) linearUpwind limited": "reconstruct(T) vanLeer",
}

DICTIONARIES = {
    # Kurganov, Noelle and Petrova's central-upwind flux of linearly extrapolated states, local time steps.
    # Limiters that work face by face (vanLeer and its like) make steady streaks here: on rays that diverge
    # they take the shock's gradient along a ray for one around the body. A limited gradient does not.
    "system/fvSchemes": """fluxScheme Kurganov;
ddtSchemes { default localEuler; }
gradSchemes { default Gauss linear; limited cellLimited<Venkatakrishnan> Gauss linear 1; }
divSchemes { default none; div(tauMC) Gauss linear; }
laplacianSchemes { default Gauss linear corrected; }
interpolationSchemes
{
    default linear;
    reconstruct(rho) linearUpwind limited;
    reconstruct(U) linearUpwind limited;
    reconstruct(T) linearUpwind limited;
}
snGradSchemes { default corrected; }
""",
    "system/fvSolution": 'solvers { "(rho|rhoU|rhoE)" { solver diagonal; } }\n',
    "constant/turbulenceProperties": "simulationType laminar;\n",
    # R = 8314.46 / 11640.3 = 1 / gamma, so that the sound speed is 1 at T = 1.
    "constant/thermophysicalProperties": """thermoType
{
    type hePsiThermo; mixture pureMixture; transport const; thermo hConst;
    equationOfState perfectGas; specie specie; energy sensibleInternalEnergy;
}
mixture
{
    specie { molWeight 11640.3; }
    thermodynamics { Cp 2.5; Hf 0; }
    transport { mu 0; Pr 1; }
}
""",
}


def run_solver(directory: Path) -> float:
    """Run the solver on one core and return its CPU time [s]."""
    before = getrusage(RUSAGE_CHILDREN)
    environment = ENVIRONMENT | dict(os.environ)
    with (directory / "log").open("w", encoding="ascii") as log:
        subprocess.run([SOLVER, "-case", str(directory)], stdout=log, stderr=log, env=environment, check=True)
    after = getrusage(RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def read_state(directory: Path, shape: tuple[int, int, int]) -> State:
    """Read the fields that the solver wrote in ``directory`` into (n_x, n_phi, n_r)."""

    def read(name: str, *tail: int) -> FloatArray:
        text = (directory / name).read_text(encoding="ascii")
        start = text.index("(", text.index("internalField")) + 1
        numbers = text[start : text.index("boundaryField")].replace("(", " ").replace(")", " ").replace(";", " ")
        return np.array(numbers.split(), dtype=float).reshape(*shape, *tail)

    return State(read("p"), read("T"), read("U", 3))
