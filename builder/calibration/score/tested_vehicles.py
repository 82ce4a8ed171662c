"""Vehicles of an independent truth for ground tests: a mesh of its own, and a wall as stated, or a smooth one.

The calibration knows a wall of few regions, each of one thickness. Of a smooth wall thickness and its first
harmonic round the body are smooth random functions of the station, of the standard deviations that the section
[calibration] states. They are taken piece by piece over other, shorter regions on a finer mesh: thickness
linearly and without steps, the others by the mean of each piece. The tables of the structure are solved once; all
vehicles share them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from builder.structure.as_built.response_tables import LoadResponse, together
from builder.structure.as_built.structure import AsBuiltStructure, as_built_structure, with_surface_of
from builder.structure.as_built.vehicle import AsBuilt, as_built_std, draw_as_built
from builder.structure.as_built.wall_regions import wall_regions
from builder.structure.loads.applied import NO_VECTOR, UNIT_VECTORS, Load, PadForce
from builder.structure.loads.loaded_structure import LoadProperties
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolution
from strainfmu.arrays import FloatArray

HARMONICS = 14
"""Of loads: pads of half angle 30 deg need 12."""

DENSITY = 4430.0
"""Where the vehicle file names none: titanium [kg/m3]."""

PIECES = 7
"""Regions of the wall of the truth; none of their ends is one of the default regions'."""

SMOOTH = 0.75
"""Length over which a smooth variation forgets itself, over the length of the wall [1]."""

JOINT = 0.47
"""Station of the joint, over the length of the wall from the solid tip: at the break of the shipped profile."""

ELEMENT, LAYERS = 0.75, 2
"""Element length over the map's, and elements through the wall."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TestedVehicles:
    """What all vehicles share.

    Attributes
    ----------
    structure : of the truth, pressure nodes of its own.
    on_map : the same structure with the pressure nodes and the mesh error of the map.
    std : what all but a smooth wall is drawn from.
    is_smooth : whether the wall varies smoothly; otherwise it is drawn as the rest.
    """

    __test__ = False

    structure: AsBuiltStructure
    on_map: AsBuiltStructure
    std: AsBuilt
    is_smooth: bool

    def drawn(self, random: np.random.Generator) -> AsBuilt:
        """Return one vehicle; the joint of a smooth wall is as stiff as the wall."""
        found = draw_as_built(self.std, random)
        if not self.is_smooth:
            return found
        edge = self.structure.regions.end
        at_ends = smooth(edge, random) * self.std.wall_thickness[0]
        middle = 0.5 * (edge[1:] + edge[:-1])
        cosine, sine = (smooth(middle, random) * self.std.wall_cosine[0] for _ in range(2))
        return found.changed(
            wall_thickness=0.5 * (at_ends[1:] + at_ends[:-1]),
            wall_taper=0.5 * (at_ends[1:] - at_ends[:-1]),
            wall_cosine=cosine,
            wall_sine=sine,
            region_modulus=np.zeros(len(middle)),
            joint_softness=np.zeros(self.structure.counts.joint),
        )


def smooth(station: FloatArray, random: np.random.Generator) -> FloatArray:
    """Return (n,) values of a Gaussian process of standard deviation 1 at increasing stations (n,) [m].

    Its covariance is exp(-s^2 / 2) with the distance s over :data:`SMOOTH` times the span of the stations.
    """
    apart = (station[:, None] - station) / (SMOOTH * np.ptp(station))
    value, vector = np.linalg.eigh(np.exp(-0.5 * apart**2))
    return np.asarray(vector @ (np.sqrt(np.maximum(value, 0.0)) * random.standard_normal(len(value))))


def properties_of(vehicle: Vehicle) -> LoadProperties:
    """Return what known loads need; a vehicle whose file names no density is of titanium."""
    return LoadProperties(density=vehicle.material.density_kg_per_m3 or DENSITY)


def tested_vehicles(vehicle: Vehicle, of_map: AsBuiltStructure, is_smooth: bool) -> TestedVehicles:
    """Solve the structure of the truth; ``of_map`` is the structure of the map."""
    own, resolution = vehicle, vehicle.resolution.truth
    if is_smooth:
        own, coarse = with_smooth_wall(vehicle), vehicle.resolution.map
        resolution = Resolution(
            **resolution.model_dump(exclude={"element_length_mm", "wall_layers", "harmonics"}),
            element_length_mm=ELEMENT * coarse.element_length_mm,
            wall_layers=LAYERS,
            harmonics=min(resolution.harmonics, max(coarse.harmonics, HARMONICS)),
        )
    structure = as_built_structure(
        own, own.gauges.layout, resolution, properties_of(vehicle), max_harmonic=HARMONICS
    )
    return TestedVehicles(
        structure=structure,
        on_map=with_surface_of(structure, of_map),
        std=as_built_std(vehicle.calibration, structure.counts),
        is_smooth=is_smooth,
    )


def with_smooth_wall(vehicle: Vehicle) -> Vehicle:
    """Return ``vehicle`` with the regions, the joint and the moduli of a smooth wall."""
    end = wall_regions(vehicle).end
    first, last = float(end[0]), float(end[-1])
    entry = vehicle.calibration.model_copy(
        update={
            "wall_region_ends_m": np.linspace(first, last, PIECES + 1)[1:-1].tolist(),
            "region_modulus_percent": max(vehicle.calibration.region_modulus_percent, 3.0),
            "joint_stations_m": (first + JOINT * (last - first),),
        }
    )
    return vehicle.model_copy(update={"calibration": entry})


class LoadTables:
    """What the loads of a test strain, for any vehicle of one structure: solved once for each pad and attitude.

    Forces are sums of their three components, which is exact. Where a pad stands elsewhere than stated, or is of
    another shape, the change is the change of the wall of the drawing under the gauges as built.
    """

    def __init__(self, structure: AsBuiltStructure) -> None:
        self.structure = structure
        self._of_place: dict[Load, tuple[LoadResponse, LoadResponse]] = {}

    def strain(self, built: AsBuilt, applied: Load, stated: Load) -> FloatArray:
        """Return what the gauges read (n_d,) under ``applied``, stated as ``stated``, without zeros [m/m]."""
        if not isinstance(applied, PadForce) or not isinstance(stated, PadForce):
            return self.structure.load_strain(built, [applied])
        if stated.force == NO_VECTOR or applied.force == NO_VECTOR:
            return np.zeros(self.structure.n_gauges)
        place = replace(stated, force=NO_VECTOR)
        if place not in self._of_place:
            units = [replace(stated, force=unit) for unit in UNIT_VECTORS]
            self._of_place[place] = (
                together([self.structure.response(one) for one in units]),
                self.structure.nominal_response(units),
            )
        found, here = (
            np.asarray(applied.force) @ self.structure.response_strain(built, one) for one in self._of_place[place]
        )
        if replace(stated, force=applied.force) == applied:
            return np.asarray(found)
        there = self.structure.response_strain(built, self.structure.nominal_response((applied,)))
        return np.asarray(found + there[0] - here)
