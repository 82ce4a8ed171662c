"""What known loads need of a structure, for any discretisation."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from builder.structure.loads.temperature import TemperatureField
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

OUTER, INNER = "outer", "inner"


@dataclass(frozen=True, kw_only=True)
class PointMass:
    """A mass on the wall, which it loads by its weight and inertia at the outer surface.

    Its own moment of inertia is left out, and so is the moment of its offset from the surface.

    Attributes
    ----------
    station : [m].
    roll_angle : [rad].
    mass : [kg], positive.
    """

    station: float
    roll_angle: float
    mass: float

    def __post_init__(self) -> None:
        if not np.isfinite([self.station, self.roll_angle]).all():
            raise InputError("point mass: station and roll_angle must be finite")
        if not (np.isfinite(self.mass) and self.mass > 0.0):
            raise InputError(f"point mass: mass {self.mass:g} kg must be greater than 0")


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadProperties:
    """What loads need in addition to stiffness.

    Attributes
    ----------
    density : of the material [kg/m3]; None where no load needs it.
    expansion : coefficient of linear expansion of the material [1/K]; None where no load needs it.
    compensation : (n_d,) or one for all: expansion [1/K] that the gauges' own temperature response cancels. A
        gauge reads strain less this times its temperature; with 0 it reads the whole strain.
    apparent_strain : coefficients of the gauges' temperature, its square and so on, in what they read beyond that
        [m/m, K].
    masses : point masses.
    other_densities : of the wall's further materials, in the order of the mesh [kg/m3]; None where not known.

    Raises
    ------
    InputError
        The density is not positive, or a value is not finite.
    """

    density: float | None = None
    expansion: float | None = None
    compensation: float | FloatArray = 0.0
    apparent_strain: tuple[float, ...] = ()
    masses: tuple[PointMass, ...] = ()
    other_densities: tuple[float | None, ...] = ()

    def __post_init__(self) -> None:
        if self.density is not None and not (np.isfinite(self.density) and self.density > 0.0):
            raise InputError(f"density {self.density:g} kg/m3 must be greater than 0")
        if self.expansion is not None and not np.isfinite(self.expansion):
            raise InputError(f"expansion {self.expansion:g} 1/K must be finite")
        if not np.isfinite(self.compensation).all():
            raise InputError("compensation must be finite")

    def needed_density(self) -> float:
        """Return the density; refuse a load that needs one where there is none."""
        if self.density is None:
            raise InputError("weight and inertia need a density, none found: material.density_kg_per_m3")
        return self.density

    def needed_densities(self, count: int) -> FloatArray:
        """Return the density of the wall's own material and ``count`` further ones; refuse as
        :meth:`needed_density`."""
        known = [density for density in self.other_densities if density is not None]
        if len(known) != count:
            raise InputError(
                "weight and inertia need a density of each material: materials.<name>.density_kg_per_m3"
            )
        return np.array([self.needed_density(), *known])

    def needed_expansion(self) -> float:
        """Return the expansion; refuse a load that needs one where there is none."""
        if self.expansion is None:
            raise InputError(
                "a temperature field needs the expansion of the material, none found: "
                "temperature.expansion_um_per_m_per_K"
            )
        return self.expansion


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfacePoints:
    """Quadrature points of a surface.

    Attributes
    ----------
    position : (n, 3) [m], body axes.
    normal : (n, 3) unit normals out of the material.
    area : (n,) [m2].
    """

    position: FloatArray
    normal: FloatArray
    area: FloatArray

    @cached_property
    def station(self) -> FloatArray:
        """(n,) [m]."""
        return self.position[:, 0].copy()

    @cached_property
    def roll_angle(self) -> FloatArray:
        """(n,) [rad]."""
        return np.arctan2(self.position[:, 1], self.position[:, 2])


class LoadedStructure(Protocol):
    """A structure solved for its gauges.

    Nodal forces are arrays of the structure's own shape; they add and scale. None of the methods solves anything.
    """

    @property
    def properties(self) -> LoadProperties: ...

    @property
    def is_free(self) -> bool:
        """Whether nothing holds the body, so that its inertia balances the load."""
        ...

    @property
    def gauge_location(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Stations [m], roll angles [rad], depths in the wall (0 inner, 1 outer face) of gauges, (n_d,) each."""
        ...

    @property
    def outer_span(self) -> tuple[float, float]:
        """First and last station of the outer surface [m]."""
        ...

    def surface_points(self, surface: str) -> SurfacePoints:
        """Return the quadrature points of a surface; refuse one that does not exist."""
        ...

    def spread_force(self, surface: str, force: FloatArray, chosen: IntArray | None = None) -> FloatArray:
        """Return nodal forces of forces (n, 3) [N] on the quadrature points of a surface, in their order.

        With ``chosen`` (n,) they are on these points alone.
        """
        ...

    def point_force(self, station: FloatArray, roll_angle: FloatArray, force: FloatArray) -> FloatArray:
        """Return nodal forces of forces (k, 3) [N] at points of the outer surface; refuse stations beyond it."""
        ...

    def outer_radius(self, station: float) -> float:
        """Return the radius of the outer surface at a station [m]; refuse one beyond it."""
        ...

    def inertia_force(self, acceleration: FloatArray) -> FloatArray:
        """Return nodal forces of mass times acceleration.

        ``acceleration`` (6,) has the acceleration of the origin [m/s2] and the angular one [rad/s2]; point masses
        are left out.
        """
        ...

    def thermal_force(self, temperature: TemperatureField) -> FloatArray:
        """Return the nodal forces that hinder thermal expansion."""
        ...

    def resultant(self, force: FloatArray) -> FloatArray:
        """Return force [N] and moment about the origin [N m] of nodal forces, (6,)."""
        ...

    def strain(self, force: FloatArray) -> FloatArray:
        """Return the strain of gauges (n_d,) [m/m] under nodal forces, which of a free body must be balanced."""
        ...


def check_stations(span: tuple[float, float], station: FloatArray) -> None:
    """Refuse stations (n,) [m] beyond the outer surface, which reaches over ``span``."""
    slack = 1e-9 * (span[1] - span[0])
    for x in station[~((station >= span[0] - slack) & (station <= span[1] + slack))]:
        raise InputError(f"load: station {x:.4g} m is beyond the surface, {span[0]:.4g} to {span[1]:.4g} m")
