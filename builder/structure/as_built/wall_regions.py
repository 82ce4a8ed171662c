"""Thickness of the wall by regions along the body, and the mesh of a wall of other thickness.

How many parameters of each kind a vehicle has: of its gauges, rows, regions of the wall and joints.
"""

from dataclasses import dataclass, replace

import numpy as np

from builder.structure.as_built.as_built_vehicle import Counts
from builder.structure.as_built.gauge_strain_terms import rows_of
from builder.structure.as_built_kinds import BY_REGION, KINDS
from builder.structure.fourier.meridian_mesh import MeridianMesh, line_nodes
from builder.structure.wall import Wall, wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import Calibration
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

REGIONS = 4
"""Regions where the vehicle file names no ends."""

BLEND = 0.02
"""Length over which one region goes over into the next, over the length of the wall; elements resolve it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class WallRegions:
    """Regions of the wall behind the solid tip.

    Attributes
    ----------
    end : (n_r + 1,) stations of their ends [m], from the tip to the base.
    """

    end: FloatArray

    def __len__(self) -> int:
        return len(self.end) - 1

    def share(self, x: FloatArray) -> FloatArray:
        """Return (n, n_r) how far stations ``x`` (n,) [m] belong to each region: 1 in it, 0 in the others.

        The first region starts from 0 at the tip, whose thickness has no meaning.
        """
        blend = BLEND * (self.end[-1] - self.end[0])
        start = self.end[:-1] - 0.5 * blend
        start[0] = self.end[0]
        begun = np.clip((x[:, None] - start) / blend, 0.0, 1.0)
        return np.asarray(begun - np.column_stack([begun[:, 1:], np.zeros(len(x))]))

    def mass_share(self, x: FloatArray) -> FloatArray:
        """Return (n, n_r) of the mass at stations ``x`` (n,): the solid tip belongs to the first region."""
        behind_tip = self.end[0] + BLEND * (self.end[-1] - self.end[0])
        return self.share(np.maximum(x, behind_tip))

    def slope(self, x: FloatArray) -> FloatArray:
        """Return (n, n_r) shares that grow from -1 at a region's fore end to 1 at its aft end."""
        middle, half = 0.5 * (self.end[1:] + self.end[:-1]), 0.5 * np.diff(self.end)
        return np.asarray(self.share(x) * np.clip((x[:, None] - middle) / half, -1.0, 1.0))


def wall_regions(entry: Calibration, wall: Wall, body: BodyOfRevolution) -> WallRegions:
    """Return the regions of the section [calibration]."""
    first, last = wall.solid_tip_length, body.length
    inner = entry.wall_region_ends_m
    if inner is None:
        return WallRegions(end=np.linspace(first, last, REGIONS + 1))
    for station in inner:
        if not first < station < last:
            raise InputError(
                f"calibration.wall_region_ends_m: expected stations of the wall, {first:g} .. {last:g} m, "
                f"got {station:g}"
            )
    return WallRegions(end=np.array([first, *inner, last]))


def thickened(
    mesh: MeridianMesh, wall: Wall, regions: WallRegions, thickness: FloatArray, taper: FloatArray | None = None
) -> MeridianMesh:
    """Return the mesh of a wall that is thicker than ``wall`` by ``thickness`` (n_r,), relative.

    ``taper`` (n_r,) is what regions are thicker at their aft end, and thinner at their fore end. The outer surface
    stays. Nodes of the wall move along the radius, so that stations keep their meaning.
    """
    inner = line_nodes(mesh.inner_edge)
    outer = line_nodes(mesh.outer_edge)[-len(inner) :]
    x, r = mesh.node[outer].T
    slope = np.gradient(r, x)
    larger = regions.share(x) @ thickness
    if taper is not None:
        larger = larger + regions.slope(x) @ taper
    inward = wall.thickness_at(x) * np.sqrt(1.0 + slope**2) * larger
    n_through = int(outer[0] - inner[0]) + 1
    column = inner[:, None] + np.arange(n_through)
    node = mesh.node.copy()
    node[column, 1] -= inward[:, None] * np.linspace(1.0, 0.0, n_through)
    return replace(mesh, node=node)


def counts_of(vehicle: Vehicle, roll_angle: FloatArray, *, in_flight: bool) -> Counts:
    """Return the numbers of what has errors of its own, with gauges at ``roll_angle`` (n_d,) [rad].

    A calibration estimates all of them; ``in_flight`` regions and joints count where [noise] states an error of
    theirs.

    Raises
    ------
    InputError
        An error by regions or joints is stated, and the vehicle has none.
    """
    rows = int(rows_of(roll_angle).max()) + 1
    stated = [KINDS[name] for name in BY_REGION if in_flight and KINDS[name].std(vehicle.noise) > 0.0]
    if in_flight and not stated:
        return Counts(gauge=len(roll_angle), row=rows)
    if stated and not vehicle.has_meridian:
        raise InputError(f"noise.{stated[0].entry}: expected 0 but for a body of revolution that is clamped aft")
    joints = len(vehicle.calibration.joint_stations_m)
    if not joints and any(kind.extent == "joint" for kind in stated):
        raise InputError(
            "noise.joint_softness_mm: expected 0 without joints, calibration.joint_stations_m is empty"
        )
    regions = len(wall_regions(vehicle.calibration, wall_of(vehicle), vehicle.body()))
    return Counts(gauge=len(roll_angle), region=regions, row=rows, joint=joints)
