"""Flow over a pointed body of revolution by OpenFOAM's rhoCentralFoam, from the mesh to the wall pressure.

Inviscid perfect gas, gamma 1.4, in units in which the free stream's pressure, temperature and sound speed are 1.
The mesh is structured: cell (i, j, k) lies between stations x_i, x_i+1, roll angles phi_j, phi_j+1 (0 on +z, the
leeward side, to pi) and the k-th and next layer from the wall outward. The outer boundary is a cone around the
bow shock. The tip is cut off: the free stream enters through the ring around the first station.

The flow is supersonic along the body, so nothing travels upstream: the body is done in windows of a few
planes, each run to its steady state with local time steps, the last plane of one entering the next.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from functools import cached_property
from math import cos, pi, sin, sqrt
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

import numpy as np

from builder.vehicle.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray, IntArray

SOLVER = "rhoCentralFoam"
ENVIRONMENT = {"WM_PROJECT_DIR": "/usr/share/openfoam"}
"""What Debian's package needs, unless the shell has OpenFOAM's own environment."""
OVERLAP = 2
"""Planes at a window's end that the next one does again, for the outlet's sake."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyCase:
    """One flow and its mesh.

    Attributes
    ----------
    body : the body of revolution.
    mach_number, incidence : M [1], total incidence a_T [rad].
    stations : (n_x + 1,) planes of the mesh [m], the first a little aft of the tip.
    n_circumferential, n_radial : cells over the half body and from wall to outer boundary.
    clustering : cells grow outward by exp(clustering) from the wall to the outer boundary.
    outer_angles : angles of the outer boundary to the body's axis at the leeward side, between and at the
        windward side [rad]; the nearer it follows the bow shock, the less noise the captured shock makes.
    """

    body: BodyOfRevolution
    mach_number: float
    incidence: float
    stations: FloatArray
    n_circumferential: int
    n_radial: int
    clustering: float
    outer_angles: tuple[float, float, float]

    @property
    def n_cells(self) -> int:
        return (len(self.stations) - 1) * self.n_circumferential * self.n_radial

    @property
    def roll_angle(self) -> FloatArray:
        """(n_phi,) roll angles of the cells [rad]."""
        return (np.arange(self.n_circumferential) + 0.5) * pi / self.n_circumferential

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Free stream's velocity over its sound speed."""
        return self.mach_number * cos(self.incidence), 0.0, self.mach_number * sin(self.incidence)

    @cached_property
    def vertices(self) -> FloatArray:
        """(n_x + 1, n_phi + 1, n_r + 1, 3) vertices of the mesh [m].

        Radii carry the factor that gives a chord polygon the area of its circle.
        """
        phi = np.linspace(0.0, pi, self.n_circumferential + 1)
        sine, cosine = np.sin(phi), np.cos(phi)
        sine[[0, -1]] = 0.0  # exactly on the symmetry plane
        leeward, side, windward = self.outer_angles
        angle = 0.25 * (leeward + 2.0 * side + windward) + 0.5 * (leeward - windward) * cosine
        angle += 0.25 * (leeward - 2.0 * side + windward) * np.cos(2.0 * phi)
        outer = self.stations[:, None] * np.tan(angle)
        wall = self.body.radius(self.stations)[:, None]
        share = np.expm1(np.linspace(0.0, self.clustering, self.n_radial + 1)) / np.expm1(self.clustering)
        swell = sqrt(phi[1] / sin(phi[1]))
        radius = swell * (wall[..., None] + (outer - wall)[..., None] * share)
        x = np.broadcast_to(self.stations[:, None, None], radius.shape)
        return np.stack([x, radius * sine[:, None], radius * cosine[:, None]], axis=-1)


@dataclass(frozen=True, eq=False)
class State:
    """Flow in some cells (...,): pressure and temperature over the free stream's, velocity (..., 3) over its
    sound speed."""

    pressure: FloatArray
    temperature: FloatArray
    velocity: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """Wall pressure of a case, and what it took.

    Attributes
    ----------
    x : (n_x,) stations of the cells [m].
    pressure : (n_x, n_phi) p/p_inf on the wall.
    unrest : largest relative change of it over the last fifth of the iterations.
    cpu_seconds : user time of the solver's processes.
    """

    x: FloatArray
    pressure: FloatArray
    unrest: float
    cpu_seconds: float


def is_available() -> bool:
    """Whether the solver is installed."""
    return shutil.which(SOLVER) is not None


def spread_stations(body: BodyOfRevolution, first: float, growth: float, largest: float) -> FloatArray:
    """Return planes from ``first`` [m] to the base, the slope breaks among them.

    Steps are ``growth`` x, as a conical flow wants them, up to ``largest`` [m],
    and begin with the first again at slope breaks.
    """
    ends = [*body.slope_breaks.tolist(), body.length]
    stations, origin, x = [first], 0.0, first
    for end in ends:
        piece = [x]
        while piece[-1] < end:
            piece.append(piece[-1] + min(growth * max(piece[-1] - origin, 5.0 * first), largest))
        # Stretched to meet the end.
        stations += [x + (station - x) * (end - x) / (piece[-1] - x) for station in piece[1:]]
        origin = x = end
    return np.array(stations)


def solve_case(case: BodyCase, directory: Path, window: int = 10, iterations: int = 400) -> Solution:
    """Run ``case`` in ``directory``, ``window`` planes at a time, each for a number of local time steps.

    The first window, where the bow shock has to form, gets four times as many.
    """
    n_x, n_phi, n_r = len(case.stations) - 1, case.n_circumferential, case.n_radial
    pressure, unrest, cpu_seconds = np.empty((n_x, n_phi)), 0.0, 0.0
    entering = State(np.ones((n_phi, n_r)), np.ones((n_phi, n_r)), np.broadcast_to(case.velocity, (n_phi, n_r, 3)))
    start, end = 0, 0
    while end < n_x:
        end = min(start + window, n_x)
        place = directory / f"planes_{start}"
        steps = iterations if start else 4 * iterations
        write_case(case, entering, start, end, steps, place)
        cpu_seconds += run_solver(place)
        earlier = read_state(place / f"{steps - steps // 5}", (end - start, n_phi, n_r))
        state = read_state(place / f"{steps}", (end - start, n_phi, n_r))
        pressure[start:end] = _wall_pressure(state, case.vertices[start : end + 1])
        settled = slice(0, None if end == n_x else -OVERLAP)
        change = state.pressure[settled, :, 0] / earlier.pressure[settled, :, 0] - 1.0
        unrest = max(unrest, float(np.abs(change).max()))
        entering = _between(state, end - start - OVERLAP)
        start = end - OVERLAP
    return Solution(
        x=0.5 * (case.stations[1:] + case.stations[:-1]), pressure=pressure, unrest=unrest, cpu_seconds=cpu_seconds
    )


def _wall_pressure(state: State, vertices: FloatArray) -> FloatArray:
    """Return (n_x, n_phi) pressure on the wall, extrapolated from the centres of the two cells next to it."""
    height = np.linalg.norm(np.diff(vertices[1:, 1:, :3], axis=2), axis=-1)
    share = height[..., 0] / (height[..., 0] + height[..., 1])
    return state.pressure[..., 0] + share * (state.pressure[..., 0] - state.pressure[..., 1])


def _between(state: State, i: int) -> State:
    """Return the state on the plane between cells i - 1 and i."""
    return State(
        0.5 * (state.pressure[i - 1] + state.pressure[i]),
        0.5 * (state.temperature[i - 1] + state.temperature[i]),
        0.5 * (state.velocity[i - 1] + state.velocity[i]),
    )


def loads_ahead(case: BodyCase, pressure: FloatArray) -> FloatArray:
    """Return (n_x + 1, 2) normal force [m2] and its moment about the tip [m3] ahead of each plane, over p_inf.

    Both halves of the body count. The first half of the first segment carries a conical flow's load: that of
    the plane that ends it. This makes up for the tip, which is cut off, and for what the cut disturbs.
    """
    wall = case.vertices[:, :, 0]
    inward = 0.5 * np.cross(wall[1:, 1:] - wall[:-1, :-1], wall[1:, :-1] - wall[:-1, 1:])
    centre = 0.25 * (wall[1:, 1:] + wall[:-1, :-1] + wall[1:, :-1] + wall[:-1, 1:])
    force = 2.0 * (pressure - 1.0)[..., None] * inward
    moment = force[..., 2] * centre[..., 0] - force[..., 0] * centre[..., 2]
    ring = np.stack([force[..., 2].sum(axis=1), moment.sum(axis=1)], axis=1)
    x = case.stations
    last = int(np.searchsorted(x, 0.5 * case.body.segments[0].end_x)) - 1
    power = np.array([2, 3])  # a cone's force grows with its length squared, the moment cubed
    ring[last] *= x[last + 1] ** power / (x[last + 1] ** power - x[last] ** power)
    ring[:last] = 0.0
    return np.concatenate([np.zeros((1, 2)), np.cumsum(ring, axis=0)])


# --------------------------------------------------------------------------------------------------------------
# The case's files


def write_case(case: BodyCase, plane: State, start: int, end: int, iterations: int, directory: Path) -> None:
    """Write planes ``start`` to ``end`` as a case; ``plane`` (n_phi, n_r) enters it and fills it at first."""
    write_mesh(case.vertices[start : end + 1], directory / "constant" / "polyMesh")
    n_planes, u = end - start, case.velocity
    _write_field(
        directory=directory,
        name="p",
        dimensions="[1 -1 -2 0 0 0 0]",
        plane=plane.pressure,
        free_stream=(1.0,),
        n_planes=n_planes,
        wall="zeroGradient",
    )
    _write_field(
        directory=directory,
        name="T",
        dimensions="[0 0 0 1 0 0 0]",
        plane=plane.temperature,
        free_stream=(1.0,),
        n_planes=n_planes,
        wall="zeroGradient",
    )
    _write_field(
        directory=directory,
        name="U",
        dimensions="[0 1 -1 0 0 0 0]",
        plane=plane.velocity,
        free_stream=u,
        n_planes=n_planes,
        wall="slip",
    )
    for name, text in (DICTIONARIES | {"system/controlDict": _control(iterations)}).items():
        _write(directory / name, "dictionary", text)


def write_mesh(vertices: FloatArray, directory: Path) -> None:
    """Write the structured mesh of ``vertices`` (n_x + 1, n_phi + 1, n_r + 1, 3) in OpenFOAM's format."""
    point: IntArray = np.arange(vertices[..., 0].size).reshape(vertices.shape[:3])
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
            all_faces.append(outside if end == -1 else outside[:, ::-1])  # normals point outward
            all_owners.append(cell.take(end, axis).ravel())
            count += len(outside)
        patches.append(f"{name} {{ type {kind}; nFaces {count}; startFace {n_faces}; }}")
        n_faces += count
    _write(directory / "points", "vectorField", _rows(vertices.reshape(-1, 3), "(%.12g %.12g %.12g)"))
    _write(directory / "faces", "faceList", _rows(np.concatenate(all_faces), "4(%d %d %d %d)"))
    _write(directory / "owner", "labelList", _rows(np.concatenate(all_owners)[:, None], "%d"))
    _write(directory / "neighbour", "labelList", _rows(neighbours[order][:, None], "%d"))
    _write(directory / "boundary", "polyBoundaryMesh", f"{len(patches)}\n(\n" + "\n".join(patches) + "\n)\n")


PATCHES = (
    ("inlet", "patch", ((0, 0),)),
    ("outlet", "patch", ((0, -1),)),
    ("symmetry", "symmetryPlane", ((1, 0), (1, -1))),
    ("wall", "patch", ((2, 0),)),
    ("outer", "patch", ((2, -1),)),
)
"""Name, type and (index, end) of the mesh's sides."""


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
) -> None:
    n = len(free_stream)
    kind, row = ("scalar", "%.10g") if n == 1 else ("vector", "(%.10g %.10g %.10g)")
    values = plane.reshape(-1, n)
    inside = f"nonuniform List<{kind}> " + _rows(np.tile(values, (n_planes, 1)), row)
    entering = f"nonuniform List<{kind}> " + _rows(values, row)
    outside = row % free_stream
    text = f"""dimensions {dimensions};
internalField {inside};
boundaryField
{{
    inlet {{ type fixedValue; value {entering}; }}
    outlet {{ type zeroGradient; }}
    symmetry {{ type symmetryPlane; }}
    wall {{ type {wall}; }}
    outer {{ type fixedValue; value uniform {outside}; }}
}}
"""
    _write(directory / "0" / name, f"vol{kind.capitalize()}Field", text)


def _control(iterations: int) -> str:
    return f"""application {SOLVER};
startFrom startTime; startTime 0; stopAt endTime; endTime {iterations};
deltaT 1; maxCo 0.2; maxDeltaT 1e3; rDeltaTSmoothingCoeff 0.3;
writeControl timeStep; writeInterval {iterations // 5}; purgeWrite 2;
writeFormat ascii; writePrecision 8; timeFormat general; timePrecision 8; runTimeModifiable no;
"""


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
