"""The flow over an elliptic cone by rhoCentralFoam and by the march: see docs/evidence/openfoam.md.

From the project's root: ``PYTHONPATH=tests/aero/euler .venv/bin/python -m openfoam.elliptic_cone DIRECTORY``
prints what both say of the flows of :data:`FLOWS`. The directory must be empty.
"""

import sys
from dataclasses import dataclass
from math import degrees, pi, radians
from pathlib import Path

import numpy as np

from builder.aero.euler.bodies.solver import FullFlowSolution, solve_full_flow
from builder.aero.euler.planes import MarchingGrid
from builder.vehicle.shape.sectioned_body import SectionedBody
from openfoam.body_case import FlowCase, Solution, solve_case, wall_faces
from strainfmu.arrays import FloatArray

CONICAL_FROM = 0.5
"""Share of the length aft of which the cut-off tip is forgotten."""


@dataclass(frozen=True, eq=False, kw_only=True)
class EllipticConeCase(FlowCase):
    """Flow over a cone of 1 m with semi-axes ``y_slope`` x and ``z_slope`` x, planes even in eccentric angle."""

    y_slope: float
    z_slope: float

    def sides(self) -> tuple[FloatArray, FloatArray]:
        leeward, side, windward = np.tan(self.outer_angles)
        angle = np.linspace(0.0, pi, self.n_circumferential + 1)
        sine, cosine = np.sin(angle), np.cos(angle)
        height = 0.5 * (leeward - windward) * sine**2 + np.where(cosine > 0.0, leeward, windward) * cosine
        wall = np.stack([self.y_slope * sine, self.z_slope * cosine], axis=-1)
        outer = np.stack([side * sine, height], axis=-1)
        x = self.stations[:, None, None]
        return x * wall, x * outer

    @property
    def body(self) -> SectionedBody:
        return SectionedBody(
            station=np.array([0.0, 1.0]),
            half_width=np.array([0.0, self.y_slope]),
            half_height=np.array([0.0, self.z_slope]),
            exponent=np.full(2, 2.0),
            centre_z=np.zeros(2),
        )

    def coefficients(self, pressure: FloatArray) -> FloatArray:
        """Return (n_x, 2) C_A and C_N on the base area, of a cone whose rings carry p/p_inf (n_x, n_phi) each."""
        inward, _ = wall_faces(self)
        force = ((pressure - 1.0)[..., None] * inward).sum(axis=1)
        return force[:, [0, 2]] / (0.7 * self.mach_number**2 * inward[..., 0].sum(axis=1, keepdims=True))

    def marched(self, grid: MarchingGrid) -> FullFlowSolution:
        return solve_full_flow(self.body, self.mach_number, self.incidence, 0.0, grid)


@dataclass(frozen=True, kw_only=True)
class Difference:
    """What the march says less what OpenFOAM says, over the rings behind :data:`CONICAL_FROM`.

    Attributes
    ----------
    theirs, ours : C_A and C_N on the base area; OpenFOAM's is the mean of the rings, ours the march's own force.
    scatter : largest difference of a ring's C_A and C_N from their mean, over the mean C_A.
    rms : largest of all rings of the root mean square of p/p_inf round the body, over its mean.
    """

    theirs: tuple[float, float]
    ours: tuple[float, float]
    scatter: float
    rms: float


def difference(case: EllipticConeCase, theirs: Solution, ours: FullFlowSolution) -> Difference:
    conical = theirs.x > CONICAL_FROM
    found = case.coefficients(theirs.pressure)[conical]
    inward, centre = wall_faces(case)
    roll = np.arctan2(centre[-1, :, 1], centre[-1, :, 2])
    expected = np.interp(roll, ours.roll_angle, ours.pieces[-1][1][-1])
    weight = np.linalg.norm(inward[-1], axis=-1) / np.linalg.norm(inward[-1], axis=-1).sum()
    rms = np.sqrt(((theirs.pressure[conical] - expected) ** 2) @ weight) / (expected @ weight)
    mean = found.mean(axis=0)
    force = ours.force / (0.7 * case.mach_number**2 * pi * case.y_slope * case.z_slope)
    return Difference(
        theirs=(float(mean[0]), float(mean[1])),
        ours=(float(force[0]), float(force[2])),
        scatter=float(np.abs(found - mean).max() / mean[0]),
        rms=float(rms.max()),
    )


def flow(
    incidence_deg: float,
    outer_angles_deg: tuple[float, float, float],
    slopes: tuple[float, float] = (0.25, 0.125),
    cells: tuple[int, int, int] = (55, 48, 36),
) -> EllipticConeCase:
    """Return the flow at M 6 over the cone of the shipped elliptic cone, ``cells`` along, round and outward."""
    leeward, side, windward = (radians(angle) for angle in outer_angles_deg)
    return EllipticConeCase(
        y_slope=slopes[0],
        z_slope=slopes[1],
        mach_number=6.0,
        incidence=radians(incidence_deg),
        stations=np.geomspace(0.03, 1.0, cells[0] + 1),
        n_circumferential=cells[1],
        n_radial=cells[2],
        clustering=1.5,
        outer_angles=(leeward, side, windward),
    )


FLOWS = {
    "flat, 0 deg": flow(0.0, (14.4, 18.6, 14.4)),
    "flat, 4 deg": flow(4.0, (16.5, 18.6, 13.3)),
    "upright, 2 deg": flow(2.0, (19.5, 14.8, 18.2), slopes=(0.125, 0.25)),
}
"""An upright cone at incidence is the flat one in sideslip. Outer boundaries lie a tenth outside the bow shock."""
GRIDS = {
    "coarse, 10 x 14": MarchingGrid(n_radial=10, n_circumferential=14),
    "map, 16 x 36": MarchingGrid(n_radial=16, n_circumferential=36),
    "truth, 24 x 54": MarchingGrid(n_radial=24, n_circumferential=54),
    "default, 24 x 36": MarchingGrid(),
    "48 x 72": MarchingGrid(n_radial=48, n_circumferential=72),
}
"""Map and truth are those of the shipped elliptic cone."""


def main(directory: str) -> None:
    """Print forces and differences of all flows on all grids, and p/p_inf round the body."""
    for number, (name, case) in enumerate(FLOWS.items()):
        theirs = solve_case(case, Path(directory) / str(number))
        print(
            f"{name}: {case.n_cells} cells, {theirs.cpu_seconds:.0f} s CPU, "
            f"changed by {theirs.unrest[theirs.x > CONICAL_FROM].max():.1e} over the last fifth of the iterations"
        )
        for grid_name, grid in GRIDS.items():
            ours = case.marched(grid)
            found = difference(case, theirs, ours)
            print(
                f"  {grid_name:>16}: C_A {found.theirs[0]:.5f} / {found.ours[0]:.5f}, C_N {found.theirs[1]:.5f} / "
                f"{found.ours[1]:.5f}, scatter {found.scatter:.2%}, rms {found.rms:.2%}"
            )
        _, centre = wall_faces(case)
        roll = np.arctan2(centre[-1, :, 1], centre[-1, :, 2])
        for angle in np.radians([4.0, 30.0, 60.0, 80.0, 90.0, 100.0, 120.0, 150.0, 176.0]):
            them = np.interp(angle, roll, theirs.pressure[-5])
            us = np.interp(angle, ours.roll_angle, ours.pieces[-1][1][-1])
            print(f"  {degrees(angle):5.0f} deg: {them:.4f} / {us:.4f}")


if __name__ == "__main__":
    main(sys.argv[1])
