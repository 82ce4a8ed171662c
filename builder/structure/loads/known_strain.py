"""What gauges read of a vehicle that stands or hangs on the ground: own weight and the air around it.

Strain of own weight and ambient pressure while zero offsets are taken: options of ``strainfmu tare``.
"""

from __future__ import annotations

from math import radians
from pathlib import Path

import numpy as np

from builder.structure.loads.applied import Weight
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.vehicle.file import Vehicle, load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.errors import InputError
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.tare import KnownStrain

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


def known_strain(
    inverse_map: str | Path,
    vehicle: str | Path,
    *,
    weight_up_roll_deg: float | None = None,
    weight_nose_deg: float = 0.0,
    ambient_pressure: float = 0.0,
    known_output: str | Path | None = None,
) -> tuple[KnownStrain, dict[str, str | float]]:
    """Return the strain of own weight and ambient pressure, and what it is made from, for :func:`strainfmu.tare`.

    Parameters
    ----------
    inverse_map : inverse map (map.h5).
    vehicle : vehicle file: subtracts the strain of own weight or air, of the options below.
    weight_up_roll_deg : with ``vehicle``: roll angle of the meridian that is up [deg].
    weight_nose_deg : with ``weight_up_roll_deg``: elevation of the nose [deg].
    ambient_pressure : with ``vehicle``: pressure of the air inside and outside [Pa].
    known_output : with ``vehicle``: write the strain of the known loads (tare.known of a bus file).

    Raises
    ------
    InputError
        A file is missing or wrong, or it has other gauges than the map.
    """
    loaded, held = load_vehicle(vehicle), load_inverse_map(Path(inverse_map))
    n = held.n_strain_gauges
    stated: dict[str, str | float] = {"vehicle": str(vehicle), "ambient_pressure_Pa": ambient_pressure}
    strain = np.zeros(n)
    if weight_up_roll_deg is not None:
        weight = Weight(up_roll_angle=radians(weight_up_roll_deg), nose_elevation=radians(weight_nose_deg))
        strain = weight_strain(loaded, loaded.gauges.layout, weight)
        if len(strain) != n:
            raise InputError(f"{vehicle}: layout in use has {len(strain)} gauges, the map has {n}")
        stated |= {"weight_up_roll_deg": weight_up_roll_deg, "weight_nose_deg": weight_nose_deg}
    known = KnownStrain(value=strain + squeeze_strain(loaded, ambient_pressure))
    if known_output is not None:
        zeros = GaugeZeros(value=known.value, std=known.std)
        write_zeros(Path(known_output), held.gauge_names[:n], zeros, stated)
    return known, stated
