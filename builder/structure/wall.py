"""Wall of the vehicle: an isotropic material and a constant thickness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.vehicle.file import Vehicle
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


@dataclass(frozen=True)
class Wall:
    """Wall of a pointed body: hollow behind a solid tip.

    Attributes
    ----------
    thickness : wall thickness along the outer normal [m], positive.
    solid_tip_length : station at which the hollow part begins [m], positive.
    material : what wall and tip are made of.

    Raises
    ------
    InputError
        A length is not positive.
    """

    thickness: float
    solid_tip_length: float
    material: Material

    def __post_init__(self) -> None:
        for name in ("thickness", "solid_tip_length"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"wall {name} {value:g} m must be greater than 0")


def wall_of(vehicle: Vehicle) -> Wall:
    """Return the wall and its material."""
    material = Material(1e9 * vehicle.material.youngs_modulus_GPa, vehicle.material.poisson_ratio)
    return Wall(1e-3 * vehicle.structure.wall_thickness_mm, vehicle.structure.solid_tip_length_m, material)
