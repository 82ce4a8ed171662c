"""The structure of a vehicle file, solved for the gauges of a layout, ready for known loads.

What gauges read of a vehicle that stands or hangs on the ground: own weight and the air around it.

Strain of own weight and ambient pressure while zero offsets are taken: options of ``strainfmu tare``.
"""

from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np

from builder.reporting import Progress
from builder.structure.fourier.fourier_model import refuse_gauges_beyond_fourier
from builder.structure.fourier.inner_surface import place_gauges
from builder.structure.fourier.meridian_mesh import NO_NODES
from builder.structure.fourier.shell_mesh import meshed_wall
from builder.structure.fourier.wall_layup import other_densities
from builder.structure.gauge_placement import gauge_layout
from builder.structure.loads.applied import Weight
from builder.structure.loads.fourier import MAX_HARMONIC, FourierStructure, fourier_structure
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.wall import Wall
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.model_entries import Resolution
from builder.vehicle.structure_section import MaterialEntry, Temperature
from strainfmu.arrays import FloatArray
from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.errors import InputError
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.tare import KnownStrain


def fourier_structure_of(
    vehicle: Vehicle,
    layout: str,
    resolution: Resolution | None = None,
    properties: LoadProperties | None = None,
    max_harmonic: int = MAX_HARMONIC,
    progress: Progress | None = None,
) -> FourierStructure:
    """Return the semi-analytic model of a vehicle, held or in free flight as its file says.

    Parameters
    ----------
    vehicle, layout : the vehicle and the name of one of its layouts.
    resolution : mesh; by default the resolution of the vehicle's map.
    properties : what loads need; the density of the vehicle file by default.
    max_harmonic : highest harmonic in roll angle; concentrated loads need more of them than air loads.
    progress : called with (harmonics done, harmonics in all).

    Raises
    ------
    InputError
        The layout does not exist, the wall does not fit the body, or the Fourier model cannot do the support or a
        gauge.
    """
    if layout not in vehicle.gauges.layouts:
        raise InputError(f"layout '{layout}' found, must be one of {', '.join(vehicle.gauges.layouts)}")
    refuse_gauges_beyond_fourier(vehicle.gauges, [layout])
    walled = meshed_wall(vehicle, resolution)
    wall, mesh = walled.wall, walled.mesh()
    gauges = gauge_layout(vehicle.gauges.layouts[layout], vehicle.beside(""), layout, mesh)
    if wall.flight is not None:
        mesh = replace(mesh, clamped_node=NO_NODES)
    return fourier_structure(
        mesh=mesh,
        material=wall.material,
        gauges=place_gauges(mesh, gauges.position, gauges.direction, gauges.names),
        properties=properties or load_properties(vehicle.material, vehicle.temperature, wall),
        max_harmonic=max_harmonic,
        progress=progress,
    )


def load_properties(material: MaterialEntry, entry: Temperature | None, wall: Wall | None) -> LoadProperties:
    """Return the density of the wall's material, of a body of revolution of regions and frames, too; expansion of
    material and gauges where the section [temperature] states it.

    ``wall`` is known of a body of revolution alone.
    """
    densities = () if wall is None else other_densities(wall)
    properties = LoadProperties(density=material.density_kg_per_m3, other_densities=densities)
    if entry is None:
        return properties
    expansion, compensation = entry.expansion_um_per_m_per_K, entry.compensation_um_per_m_per_K
    return replace(
        properties,
        expansion=MICRO * expansion,
        compensation=MICRO * (expansion if compensation is None else compensation),
        apparent_strain=tuple(MICRO * coefficient for coefficient in entry.apparent_strain_um_per_m),
    )


MICRO = 1e-6

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
