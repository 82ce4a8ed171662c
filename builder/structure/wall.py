"""Wall of the vehicle: thickness along the body, isotropic materials by region, ring frames, what holds it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from builder.vehicle.file import Vehicle
from builder.vehicle.structure_section import MaterialEntry, Structure
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material.

    Attributes
    ----------
    youngs_modulus : Young's modulus [Pa], positive.
    poisson_ratio : Poisson's ratio [-], in [0, 0.5).

    Raises
    ------
    InputError
        A value is outside its range; 0.5 (incompressible) has no finite stiffness.
    """

    youngs_modulus: float
    poisson_ratio: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.youngs_modulus) and self.youngs_modulus > 0.0):
            raise InputError(f"youngs_modulus {self.youngs_modulus:g} Pa must be greater than 0")
        if not 0.0 <= self.poisson_ratio < 0.5:
            raise InputError(f"poisson_ratio {self.poisson_ratio:g} must be at least 0 and less than 0.5")

    @property
    def lame_parameters(self) -> tuple[float, float]:
        """Lamé's lambda and mu [Pa] (Timoshenko and Goodier, Theory of Elasticity, section 7)."""
        shear_modulus = self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))
        return 2.0 * shear_modulus * self.poisson_ratio / (1.0 - 2.0 * self.poisson_ratio), shear_modulus

    @property
    def stiffness(self) -> FloatArray:
        """(6, 6) stress [Pa] per strain [x, r, phi, x-r, x-phi, r-phi], shears as engineering strain.

        Hooke's law in three dimensions (Timoshenko and Goodier, Theory of Elasticity, section 6).
        """
        lame, shear_modulus = self.lame_parameters
        stiffness = np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0]) * shear_modulus
        stiffness[:3, :3] += lame
        return stiffness


@dataclass(frozen=True, kw_only=True)
class WallRegion:
    """Part of the wall of another material.

    Attributes
    ----------
    start, end : stations on the outer surface [m].
    material : of wall and tip there.
    density : [kg/m3], None where nothing needs it.
    """

    start: float
    end: float
    material: Material
    density: float | None = None


@dataclass(frozen=True, kw_only=True)
class RingFrame:
    """A ring of rectangular section on the inner surface, or a bulkhead.

    Attributes
    ----------
    station : middle, on the inner surface [m].
    width : along the axis [m].
    depth : from the inner surface towards the axis [m]; None for a closed bulkhead.
    material : of the ring; None for the material of the wall there.
    density : of that material [kg/m3].
    """

    station: float
    width: float
    depth: float | None
    material: Material | None = None
    density: float | None = None

    @property
    def ends(self) -> tuple[float, float]:
        """Stations of its two sides [m]."""
        return self.station - 0.5 * self.width, self.station + 0.5 * self.width


@dataclass(frozen=True, kw_only=True)
class FlightMasses:
    """Masses of a body that nothing holds, in addition to the masses of wall and frames.

    Attributes
    ----------
    density : of the wall's own material [kg/m3].
    points : (station [m], mass [kg]) on the axis, carried by the wall there.
    covers : (start, end [m], mass per outer area [kg/m2]) that stiffen nothing.
    has_stiff_base : whether the aft ring keeps its shape, as on a bulkhead; it is an open end otherwise.
    """

    density: float
    points: tuple[tuple[float, float], ...] = ()
    covers: tuple[tuple[float, float, float], ...] = ()
    has_stiff_base: bool = False


@dataclass(frozen=True)
class Wall:
    """Wall of a pointed body: hollow behind a solid tip.

    Attributes
    ----------
    thickness : wall thickness along the outer normal [m], positive.
    solid_tip_length : station at which the hollow part begins [m], positive.
    material : what wall and tip are made of, but for ``regions``.
    profile : (station on the outer surface [m], thickness over ``thickness``), linear in between, constant beyond.
    regions : parts of another material; where several overlap the last counts.
    frames : ring frames and bulkheads.
    flight : masses, where nothing holds the body.
    foundation : stiffness per area along and across the normal of the aft ring [N/m3], where that holds it.

    Raises
    ------
    InputError
        A length is not positive, or stations do not rise.
    """

    thickness: float
    solid_tip_length: float
    material: Material
    profile: tuple[tuple[float, float], ...] = ()
    regions: tuple[WallRegion, ...] = ()
    frames: tuple[RingFrame, ...] = ()
    flight: FlightMasses | None = None
    foundation: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name in ("thickness", "solid_tip_length"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"wall {name} {value:g} m must be greater than 0")
        stations = [station for station, _ in self.profile]
        if any(b <= a for a, b in pairwise(stations)) or any(not share > 0.0 for _, share in self.profile):
            raise InputError("wall profile: stations must rise and thicknesses be greater than 0")

    def thicker(self, factor: float) -> Wall:
        """Return the wall ``factor`` as thick."""
        return replace(self, thickness=factor * self.thickness)

    @property
    def is_plain(self) -> bool:
        """Whether it is of one material and without frames."""
        return not (self.regions or self.frames)

    def thickness_at(self, x: FloatArray | float) -> FloatArray:
        """Return the thickness along the outer normal [m] at stations ``x`` [m] of the outer surface."""
        x = np.asarray(x, dtype=float)
        if not self.profile:
            return np.full(x.shape, self.thickness)
        station, share = np.array(self.profile).T
        return np.asarray(self.thickness * np.interp(x, station, share))


def flight_masses(entry: Structure, density: float | None) -> FlightMasses | None:
    """Return the masses of a body of revolution, its wall of ``density`` [kg/m3]; None without it."""
    if density is None:
        return None
    return FlightMasses(
        density=density,
        points=tuple((mass.x_m, mass.mass_kg) for mass in entry.point_masses),
        covers=tuple((cover.start_x_m, cover.end_x_m, cover.mass_kg_per_m2) for cover in entry.covers),
        has_stiff_base=entry.base == "stiff",
    )


def wall_of(vehicle: Vehicle) -> Wall:
    """Return the wall, its materials and frames, and what holds it."""
    entry, material_entry = vehicle.structure, vehicle.material
    assert entry.solid_tip_length_m is not None  # with a profile and with sections
    material = {name: material_of(entry_of_material) for name, entry_of_material in vehicle.materials.items()}
    density = {name: entry_of_material.density_kg_per_m3 for name, entry_of_material in vehicle.materials.items()}
    return Wall(
        thickness=1e-3 * entry.wall_thickness_mm,
        solid_tip_length=entry.solid_tip_length_m,
        material=material_of(material_entry),
        profile=tuple(
            (station.x_m, station.thickness_mm / entry.wall_thickness_mm) for station in entry.wall_thickness_at
        ),
        regions=tuple(
            WallRegion(start=region.start_x_m, end=region.end_x_m, material=material[name], density=density[name])
            for region in entry.regions
            for name in (region.material,)
        ),
        frames=tuple(
            RingFrame(
                station=frame.x_m,
                width=1e-3 * frame.width_mm,
                depth=None if frame.depth_mm == "closed" else 1e-3 * frame.depth_mm,
                material=None if frame.material is None else material[frame.material],
                density=None if frame.material is None else density[frame.material],
            )
            for frame in entry.frames
        ),
        flight=flight_masses(entry, material_entry.density_kg_per_m3) if entry.support == "free_flight" else None,
        foundation=None
        if entry.foundation_normal_N_per_m3 is None or entry.foundation_tangential_N_per_m3 is None
        else (entry.foundation_normal_N_per_m3, entry.foundation_tangential_N_per_m3),
    )


def material_of(entry: MaterialEntry) -> Material:
    return Material(1e9 * entry.youngs_modulus_GPa, entry.poisson_ratio)
