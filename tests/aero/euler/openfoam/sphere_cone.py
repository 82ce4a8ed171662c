"""Sphere-cones by OpenFOAM, against the march behind the flow over a sphere.

The mesh is a wedge about the axis, with incidence half the body. Its lines leave the sphere along its radius and
the cone at a right angle, and end on a hyperboloid about the wind, a little larger than Billig's bow shock. As a
command: ``sphere_cone DIRECTORY [PICTURE]``.
"""

import sys
from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, pi, radians, sin, tan
from pathlib import Path

import numpy as np
from cone_theory import taylor_maccoll_pressure

from builder.aero.euler.bodies.solver import solve_flow
from builder.vehicle.shape.geometry import BodyOfRevolution, Segment, chain_pieces
from builder.vehicle.shape.profile_entries import spherical_cap
from openfoam.case_files import State, read_state, run_solver, write_case
from strainfmu.arrays import FloatArray

WEDGE = radians(4.0)
CLUSTERING = 2.5
"""Cells grow outward by the exponential of this from the wall to the outer boundary."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SphereCone:
    """A sphere-cone of nose radius 1 in a stream, and its mesh.

    Attributes
    ----------
    half_angle, incidence : of the cone, of the stream [rad].
    length : from tip to base, over the nose radius.
    n_sphere, n_cone, n_normal : cells along sphere and cone, and from wall to outer boundary.
    n_around : cells round half the body; one is a wedge.
    spread, opening : size of the outer boundary over Billig's shock, and angle by which it opens wider [rad].
    courant, iterations : of the local time steps.
    """

    mach_number: float
    half_angle: float
    length: float
    n_sphere: int
    n_cone: int
    n_normal: int
    incidence: float = 0.0
    n_around: int = 1
    spread: float = 1.15
    opening: float = radians(2.0)
    courant: float = 0.08
    iterations: int = 12_000

    @property
    def body(self) -> BodyOfRevolution:
        angle = self.half_angle

        def cone(x: float, radius: float) -> Segment:
            return Segment(start_x=x, end_x=self.length, start_radius=radius, start_angle=angle, end_angle=angle)

        return chain_pieces([lambda x, radius: spherical_cap(1.0, angle), cone])

    @cached_property
    def wall(self) -> tuple[FloatArray, FloatArray]:
        """Points (n + 1, 2) x, r on the wall and outward normals there."""
        theta = np.linspace(0.0, 0.5 * pi - self.half_angle, self.n_sphere + 1)
        sphere = np.stack([1.0 - np.cos(theta), np.sin(theta)], axis=1)
        normal = np.stack([-np.cos(theta), np.sin(theta)], axis=1)
        along = np.array([cos(self.half_angle), sin(self.half_angle)])
        end = (self.length - sphere[-1, 0]) / along[0]
        first = theta[1]
        growth = np.expm1(np.linspace(0.0, 1.0, self.n_cone + 1)[1:, None] * np.log1p(end / first / self.n_cone))
        cone = sphere[-1] + end * growth / growth[-1] * along
        return np.concatenate([sphere, cone]), np.concatenate(
            [normal, np.repeat(normal[-1:], self.n_cone, axis=0)]
        )

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Free stream's velocity over its sound speed."""
        return self.mach_number * cos(self.incidence), 0.0, self.mach_number * sin(self.incidence)

    @property
    def roll_angle(self) -> FloatArray:
        """(n_around + 1,) of the mesh's planes [rad], 0 on the leeward side."""
        if self.n_around == 1:
            return np.array([-0.5 * WEDGE, 0.5 * WEDGE])
        return np.linspace(0.0, pi, self.n_around + 1)

    @property
    def share(self) -> FloatArray:
        """(n_normal + 1,) places of the vertices between wall, 0, and outer boundary, 1."""
        return np.asarray(np.expm1(np.linspace(0.0, CLUSTERING, self.n_normal + 1)) / np.expm1(CLUSTERING))

    def _outside(self, point: FloatArray) -> FloatArray:
        """Return whether points (.., 3) lie outside the outer boundary."""
        m = self.mach_number
        from_centre = point - np.array([1.0, 0.0, 0.0])
        along = from_centre @ np.array(self.velocity) / m
        aside = np.sqrt(np.maximum(np.sum(from_centre**2, axis=-1) - along**2, 0.0))
        tangent = tan(np.arcsin(1.0 / m) + self.opening)
        curvature = self.spread * 1.143 * np.exp(0.54 / (m - 1.0) ** 1.2)
        vertex = -self.spread * 0.143 * np.exp(3.24 / m**2) - 0.05
        bend = np.sqrt(1.0 + (aside * tangent / curvature) ** 2) - 1.0
        return np.asarray(1.0 + along < vertex + curvature / tangent**2 * bend)

    @cached_property
    def vertices(self) -> FloatArray:
        """(n_x + 1, n_around + 1, n_r + 1, 3) vertices of the mesh."""
        phi = self.roll_angle
        step = phi[1] - phi[0]
        swell = np.sqrt(step / np.sin(step))  # a chord polygon of the circle's area
        around = np.stack([np.ones_like(phi), swell * np.sin(phi), swell * np.cos(phi)], axis=-1)
        around[np.abs(around) < 1e-12] = 0.0
        wall, normal = (side[:, None, [0, 1, 1]] * around for side in self.wall)
        wall[0, :, 1:] = normal[0, :, 1:] = 0.0
        near, far = np.zeros(wall.shape[:2]), np.full(wall.shape[:2], 10.0 * self.length)
        for _ in range(60):
            middle = 0.5 * (near + far)
            outside = self._outside(wall + middle[..., None] * normal)
            near, far = np.where(outside, near, middle), np.where(outside, middle, far)
        far[0] = far[0, 0]
        return np.asarray(
            wall[:, :, None] + far[:, :, None, None] * self.share[:, None] * normal[:, :, None] + 0.0
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class WallPressure:
    """Wall pressure of a case, theirs and ours, at the same places.

    Attributes
    ----------
    x : (n,) stations over the nose radius.
    theirs, ours : (n, n_around) p/p_inf, theirs the mean of the last four of five states.
    unrest : (n,) largest deviation of one of the four from their mean.
    cpu_seconds : of OpenFOAM.
    """

    x: FloatArray
    theirs: FloatArray
    ours: FloatArray
    unrest: FloatArray
    cpu_seconds: float


def compare(case: SphereCone, directory: Path) -> WallPressure:
    """Run OpenFOAM and the march."""
    shape = (case.n_sphere + case.n_cone, case.n_around, case.n_normal)
    stream = np.broadcast_to(case.velocity, (*shape[1:], 3))
    undisturbed = State(np.ones(shape[1:]), np.ones(shape[1:]), stream)
    write_case(
        case.vertices, case.velocity, undisturbed, case.iterations, directory, from_axis=True, courant=case.courant
    )
    seconds = run_solver(directory)

    states = [read_state(directory / f"{number * case.iterations // 5}", shape).pressure for number in range(2, 6)]
    near, next_to_it = (np.stack([state[:, :, k] for state in states]) for k in (0, 1))
    thickness = np.diff(case.share)
    at_wall = near + thickness[0] / (thickness[0] + thickness[1]) * (near - next_to_it)
    mean = at_wall.mean(axis=0)
    edge = case.wall[0][:, 0]
    x = 0.5 * (edge[1:] + edge[:-1])
    flow = solve_flow(case.body, case.mach_number, case.incidence)
    stations, ratio = flow.pieces[0]
    at_x = np.stack([np.interp(x, stations, column) for column in ratio.T], axis=1)
    phi = 0.5 * (case.roll_angle[1:] + case.roll_angle[:-1])
    ours = np.stack([np.interp(phi, flow.roll_angle, row) for row in at_x])
    return WallPressure(
        x=x,
        theirs=mean,
        ours=ours,
        unrest=np.max(np.abs(at_wall / mean - 1.0), axis=(0, 2)),
        cpu_seconds=seconds,
    )


ALONG_AXIS = SphereCone(mach_number=6.0, half_angle=radians(9.0), length=5.0, n_sphere=40, n_cone=24, n_normal=50)
AT_INCIDENCE = SphereCone(
    mach_number=6.0,
    half_angle=radians(9.0),
    length=3.5,
    n_sphere=30,
    n_cone=12,
    n_normal=36,
    incidence=radians(8.0),
    n_around=12,
    spread=1.1,
    opening=radians(6.0),
    courant=0.15,
    iterations=7000,
)


def draw(found: WallPressure, picture: Path) -> None:
    """Draw both pressures along the body, their difference, and the way to the pressure of the sharp cone."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplot_mosaic(
        [["pressure", "cones"], ["difference", "cones"]],
        figsize=(10.0, 4.6),
        height_ratios=[2.5, 1.0],
        layout="constrained",
    )
    above, below, right = axes["pressure"], axes["difference"], axes["cones"]
    above.plot(found.x, found.theirs[:, 0], "o", markersize=3, markerfacecolor="none", label="rhoCentralFoam")
    above.plot(found.x, found.ours[:, 0], color="black", linewidth=1.0, label="sphere and march")
    above.set(yscale="log", xlim=(0.0, found.x[-1]), ylabel=r"$p/p_\infty$ [1]", title="9 deg, M 6")
    above.set_yticks([2, 3, 5, 10, 20, 40], ["2", "3", "5", "10", "20", "40"])
    above.minorticks_off()
    above.legend(frameon=False)
    below.plot(found.x, 100.0 * (found.theirs[:, 0] / found.ours[:, 0] - 1.0), color="black", linewidth=1.0)
    below.axhline(0.0, color="grey", linewidth=0.5)
    below.set(xlim=(0.0, found.x[-1]), ylabel="difference [%]", xlabel="x over nose radius [1]")
    for half_angle_deg, mach_number in ((5.0, 6.0), (10.0, 6.0), (10.0, 10.0), (15.0, 10.0)):
        cone = replace(ALONG_AXIS, half_angle=radians(half_angle_deg), mach_number=mach_number, length=300.0)
        x, ratio = solve_flow(cone.body, mach_number, 0.0).pieces[0]
        sharp = taylor_maccoll_pressure(cone.half_angle, mach_number)
        right.plot(x, ratio[:, 0] / sharp, linewidth=1.0, label=f"{half_angle_deg:g} deg, M {mach_number:g}")
    right.axhline(1.0, color="grey", linewidth=0.5)
    right.set(xscale="log", xlim=(1.0, 300.0), ylim=(0.65, 1.3), xlabel="x over nose radius [1]")
    right.set(ylabel="pressure over that of the sharp cone [1]", title="sphere and march")
    right.legend(frameon=False)
    figure.savefig(picture, dpi=120)


def main() -> None:
    found = compare(ALONG_AXIS, Path(sys.argv[1]) / "along_axis")
    print(f"{found.cpu_seconds:.0f} s of OpenFOAM, unrest {found.unrest.max():.2%}")
    for x, theirs, ours in zip(found.x, found.theirs[:, 0], found.ours[:, 0], strict=True):
        print(f"x/R {x:7.3f}  OpenFOAM {theirs:8.4f}  ours {ours:8.4f}  {theirs / ours - 1.0:+.2%}")
    inclined = compare(AT_INCIDENCE, Path(sys.argv[1]) / "at_incidence")
    error = np.split(inclined.theirs / inclined.ours - 1.0, [AT_INCIDENCE.n_sphere])
    for name, part in zip(("sphere", "cone"), error, strict=True):
        print(
            f"8 deg, {name}, rms from leeward to windward:", np.round(100.0 * np.sqrt(np.mean(part**2, axis=0)), 1)
        )
    if len(sys.argv) > 2:
        draw(found, Path(sys.argv[2]))


if __name__ == "__main__":
    main()
