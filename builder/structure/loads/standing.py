"""What gauges read of a vehicle that stands or hangs on the ground: own weight and the air around it."""

from __future__ import annotations

from builder.structure.loads.applied import Weight
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

_HARMONICS = 2
"""Highest harmonic in roll angle; the harmonic of own weight is 1."""


def weight_strain(vehicle: Vehicle, layout: str, weight: Weight) -> FloatArray:
    """Return (n_d,) the strain of the gauges of ``layout`` under own weight [m/m], the vehicle at its support.

    Raises
    ------
    InputError
        The vehicle file states no density, or the Fourier model cannot do the vehicle.
    """
    if vehicle.material.density_kg_per_m3 is None:
        raise InputError("material.density_kg_per_m3: entry is missing, own weight needs it")
    return gauge_strain(fourier_structure_of(vehicle, layout, max_harmonic=_HARMONICS), [weight])


def squeeze_strain(vehicle: Vehicle, ambient_pressure: float) -> float:
    """Return the strain [m/m], in every direction, of a wall with ``ambient_pressure`` [Pa] on all sides.

    An isotropic wall shrinks by (1 - 2 nu) p / E. The model of the map knows net pressure alone: a zero taken at
    1 bar and flown vented is off by that.
    """
    material = vehicle.material
    return -(1.0 - 2.0 * material.poisson_ratio) * ambient_pressure / (1e9 * material.youngs_modulus_GPa)
