"""Inertia of a vehicle: strain of its gauges by specific force, angular acceleration and rates, and its errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from builder.inverse.noise.model import NoiseTerm, nuisance_modes
from builder.structure.fourier.inertia_strain import bending_strain, inertia_strain
from builder.structure.fourier.meridian_mesh import MeridianMasses, MeridianMesh
from builder.structure.fourier.model import place_layouts
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.loads.applied import STANDARD_GRAVITY
from builder.structure.wall import FlightMasses, Wall, wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolution
from builder.vehicle.structure.mass import Mass
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inertia import CHANNELS, InertiaMap

NAME = "inertia"
"""Name of the noise term of the modes."""

VIBRATION_MODES = "modes of vibration"
"""Name of the noise term of the bending modes."""

_OF_MODES = (NAME, VIBRATION_MODES)
_MICRO = 1e-6
N_FORCES = 3
"""Channels of specific force, the first."""

_UNLISTED_STATIONS = 5
_STRUCTURE, _EQUIPMENT, UNLISTED = "structure", "equipment", "unlisted"


@dataclass(frozen=True, eq=False, kw_only=True)
class InertiaStrain:
    """Strain of the gauges of the layout in use.

    Attributes
    ----------
    by_part : (n_d, k) per channel, by part: wall with covers, each point mass by its number, and 1 kg at stations.
    by_bending : (n_d, 2) of the first bending modes, over the strain of the gauge that each strains most [1].
    """

    by_part: dict[str, FloatArray]
    by_bending: FloatArray

    @property
    def of_listed(self) -> FloatArray:
        """(n_d, k) strain per channel of all that the vehicle file lists."""
        listed = [strain for name, strain in self.by_part.items() if not name.startswith(UNLISTED)]
        return np.asarray(np.sum(listed, axis=0))


def strain_by_inertia(
    vehicle: Vehicle,
    entry: Mass,
    resolution: Resolution | None = None,
    stations: Sequence[float] | None = None,
) -> InertiaStrain:
    """Return strain of the layout in use; 1 kg is at each of ``stations`` [m], None for five.

    Raises
    ------
    InputError
        The Fourier model cannot do the vehicle.
    """
    wall, entries = wall_of(vehicle), vehicle.structure
    layout, resolution = vehicle.gauges.layout, resolution or vehicle.resolution.map
    mesh = _mesh(vehicle, wall, resolution)
    _, placed = place_layouts(vehicle, mesh, [layout])
    covers = tuple((one.start_x_m, one.end_x_m, one.mass_kg_per_m2) for one in entries.covers)
    density = _densities(vehicle, wall, resolution)
    nothing = MeridianMasses(density=tuple(0.0 for _ in density))
    parts = {_STRUCTURE: MeridianMasses(density=density, covers=covers)}
    for number, one in enumerate(entries.point_masses, start=1):
        parts[f"{_EQUIPMENT} {number}"] = replace(nothing, points=((one.x_m, one.mass_kg),))
    if stations is None:
        stations = np.linspace(0.0, vehicle.body().length, _UNLISTED_STATIONS + 2)[1:-1].tolist()
    for number, station in enumerate(stations, start=1):
        parts[f"{UNLISTED} {number}"] = replace(nothing, points=((station, 1.0),))
    every = MeridianMasses(
        density=density, covers=covers, points=tuple((one.x_m, one.mass_kg) for one in entries.point_masses)
    )
    return InertiaStrain(
        by_part=inertia_strain(mesh, wall.material, placed[layout], parts, unit_station(vehicle, entry)),
        by_bending=bending_strain(mesh, wall.material, placed[layout], every),
    )


def unit_station(vehicle: Vehicle, entry: Mass) -> float:
    """Return the station of the inertial unit [m]."""
    return vehicle.reference_quantities().moment_station if entry.unit_x_m is None else entry.unit_x_m


def inertia_map(vehicle: Vehicle, strain: InertiaStrain | None) -> InertiaMap | None:
    """Return the modes of the layout in use, the gauges' covariance 0; None without a section [mass]."""
    entry = vehicle.mass
    if entry is None or strain is None:
        return None
    n_d = len(strain.by_bending)
    return InertiaMap(
        prior_std=_prior(entry),
        sensor_std=_errors(entry),
        mode_strain=strain.of_listed,
        rest_covariance=np.zeros((n_d, n_d)),
        vibration_strain=strain.by_bending,
        vibration_std=_MICRO * entry.vibration_um_per_m,
        vehicle_mass=entry.vehicle_kg,
    )


def inertia_terms(vehicle: Vehicle, inertia: InertiaMap | None, strain: InertiaStrain | None) -> list[NoiseTerm]:
    """Return what inertia adds to the noise: its modes, the errors of masses at the stated specific force, and
    vibration."""
    entry = vehicle.mass
    if entry is None or inertia is None or strain is None:
        return []
    size = {
        _STRUCTURE: 0.01 * entry.structure_percent,
        _EQUIPMENT: 0.01 * entry.equipment_percent,
        UNLISTED: entry.unlisted_kg,
    }
    force = inertia.prior_std[:N_FORCES]
    errors = [size[name.split()[0]] * one[:, :N_FORCES] * force for name, one in strain.by_part.items()]
    stds = np.full(inertia.vibration_strain.shape[1], inertia.vibration_std)
    return [
        nuisance_modes(NAME, inertia.mode_strain, inertia.prior_std),
        nuisance_modes(VIBRATION_MODES, inertia.vibration_strain, stds),
        NoiseTerm("errors of masses", np.hstack(errors)),
    ]


def with_rest(
    inertia: InertiaMap | None, terms: tuple[NoiseTerm, ...], others: tuple[str, ...]
) -> InertiaMap | None:
    """Return ``inertia`` with the covariance of ``terms`` that neither scale nor are its modes or ``others``."""
    if inertia is None:
        return None
    rest = [
        term.strain @ term.strain.T for term in terms if not term.scales and term.name not in _OF_MODES + others
    ]
    return replace(inertia, rest_covariance=np.sum(rest, axis=0))


def _mesh(vehicle: Vehicle, wall: Wall, resolution: Resolution) -> MeridianMesh:
    return shell_mesh(vehicle.body(), wall, 1e-3 * resolution.element_length_mm, resolution.wall_layers)


def _densities(vehicle: Vehicle, wall: Wall, resolution: Resolution) -> tuple[float, ...]:
    """Return the densities of the mesh's materials [kg/m3], the wall's own first."""
    own = vehicle.material.density_kg_per_m3
    assert own is not None  # a vehicle with [mass] has them
    flying = _mesh(vehicle, replace(wall, flight=FlightMasses(density=own), foundation=None), resolution)
    assert flying.masses is not None
    return flying.masses.density


def _prior(entry: Mass) -> FloatArray:
    """Return the standard deviations of the channels where they are not measured; of products the root mean
    square."""
    across = STANDARD_GRAVITY * entry.lateral_g
    force = [STANDARD_GRAVITY * entry.axial_g, across, across]
    x, y = entry.roll_rate_rad_per_s, entry.rate_rad_per_s
    # E w^4 = 3 s^4.
    of_axis, of_side = np.sqrt(8.0) * y**2, np.sqrt(3.0 * x**4 + 3.0 * y**4 + 2.0 * x**2 * y**2)
    products = [of_axis, of_side, of_side, x * y, x * y, y * y]
    found = np.array([*force, *(2 * [entry.angular_acceleration_rad_per_s2]), *products])
    assert len(found) == len(CHANNELS)
    return found


def _errors(entry: Mass) -> FloatArray:
    """Return the standard deviations of measured channels; of products at the stated rates."""
    x, y, error = entry.roll_rate_rad_per_s, entry.rate_rad_per_s, entry.angular_rate_std_rad_per_s
    of_axis, of_side = 2.0 * error * np.sqrt(2.0) * y, 2.0 * error * np.hypot(x, y)
    products = [
        of_axis,
        of_side,
        of_side,
        error * np.hypot(x, y),
        error * np.hypot(x, y),
        error * np.sqrt(2.0) * y,
    ]
    force = 3 * [entry.specific_force_std_m_per_s2]
    return np.array([*force, *(2 * [entry.angular_acceleration_std_rad_per_s2]), *products])
