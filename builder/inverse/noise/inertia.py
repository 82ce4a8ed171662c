"""Inertia of a vehicle: strain of its gauges by specific force, angular acceleration and rates, and its errors."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from builder.aero.load_groups import Surface
from builder.aero.load_operator import load_operator_on
from builder.inverse.ensemble import Ensemble
from builder.inverse.noise.hardware_errors import HardwareError
from builder.inverse.noise.model import NoiseTerm, nuisance_modes
from builder.structure.fourier.fourier_model import place_layouts
from builder.structure.fourier.inertia_strain import N_RIGID, bending_strain, inertia_strain, rigid_inertia
from builder.structure.fourier.meridian_mesh import MeridianMasses, MeridianMesh
from builder.structure.fourier.shell_mesh import MeshedWall, meshed_wall
from builder.structure.loads.applied import STANDARD_GRAVITY
from builder.structure.wall import FlightMasses, flight_masses
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolution
from builder.vehicle.structure_section import Mass
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.map.sensors import CHANNELS, InertiaMap

NAME, MASSES, THEORY = "inertia", "errors of masses", "strain of inertia"
"""Names of the noise term of the modes, of the errors of masses, and of the error of the strain by inertia."""

VIBRATION_MODES = "modes of vibration"
"""Name of the noise term of the bending modes."""

_MICRO = 1e-6
N_FORCES = 3
"""Channels of specific force, the first."""

_UNLISTED_STATIONS = 5
_SECTIONS = 12
"""Parts of the length in which gauges have errors of another theory in common, as of the bending moment there."""

_ATTACHMENT = 3.0
"""Distance from a point mass, over the root of radius times thickness, within which the strain by it depends on
how it is attached."""

_UNDETECTED_UNIT = "; a specific force in g, of wrong sign or axis is detected with mass.vehicle_kg alone"

_STRUCTURE, _EQUIPMENT, UNLISTED = "structure", "equipment", "unlisted"


@dataclass(frozen=True, eq=False, kw_only=True)
class InertiaStrain:
    """Strain of the gauges of the layout in use.

    Attributes
    ----------
    entry : section [mass].
    balanced : (6, 6) rigid inertia of a body that nothing holds, about the inertial unit: its acceleration follows
        from the load; None of a held body.
    unit : station of the inertial unit [m].
    by_part : (n_d, k) per channel, by part: wall with covers, each point mass by its number, and 1 kg at stations.
    by_bending : (n_d, 2) of the first bending modes, over the strain of the gauge that each strains most [1].
    section : (n_d,) number of the part of the length that each gauge is in.
    held_by_part : as ``by_part``, with the aft ring held.
    attached : (n_d,) whether each gauge is near enough to a point mass for its attachment to count, by its part.
    """

    entry: Mass
    balanced: FloatArray | None
    unit: float
    by_part: dict[str, FloatArray]
    by_bending: FloatArray
    section: IntArray
    held_by_part: dict[str, FloatArray]
    attached: dict[str, BoolArray]

    @property
    def of_listed(self) -> FloatArray:
        """(n_d, k) strain per channel of all that the vehicle file lists."""
        return _listed(self.by_part)

    def errors_of_theory(self, part: float, channels: int) -> tuple[list[FloatArray], FloatArray]:
        """Return errors (n_d, channels) that gauges have in common, and the size of each gauge's own.

        They are ``part`` of the strain of the held body, one of all gauges and one of each section, and the whole
        strain by each point mass near it, which shells and beams attach differently.
        """
        strain = part * _listed(self.held_by_part)[:, :channels]
        near = [
            self.held_by_part[name][:, :channels] * attached[:, None] for name, attached in self.attached.items()
        ]
        sections = [strain * (self.section == section)[:, None] for section in np.unique(self.section)]
        return [strain, *sections, *near], strain


def _listed(by_part: dict[str, FloatArray]) -> FloatArray:
    return np.asarray(
        np.sum([strain for name, strain in by_part.items() if not name.startswith(UNLISTED)], axis=0)
    )


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
    walled, layout = meshed_wall(vehicle, resolution), vehicle.gauges.layout
    body, wall, mesh = walled.body, walled.wall, walled.mesh()
    _, placed = place_layouts(vehicle, mesh, [layout])
    listed = _with_masses(walled, flight_masses(vehicle.structure, vehicle.material.density_kg_per_m3)).masses
    assert listed is not None  # a vehicle with [mass] has densities
    nothing = MeridianMasses(density=tuple(0.0 for _ in listed.density))
    parts = {_STRUCTURE: replace(listed, points=())}
    for number, point in enumerate(listed.points, start=1):
        parts[f"{_EQUIPMENT} {number}"] = replace(nothing, points=(point,))
    if stations is None:
        stations = np.linspace(0.0, body.length, _UNLISTED_STATIONS + 2)[1:-1].tolist()
    for number, station in enumerate(stations, start=1):
        parts[f"{UNLISTED} {number}"] = replace(nothing, points=((station, 1.0),))
    gauges = placed[layout]
    unit = vehicle.reference_quantities().moment_station if entry.unit_x_m is None else entry.unit_x_m
    by_part = carried = inertia_strain(mesh, wall.material, gauges, parts, unit)
    if wall.flight is not None:
        holding = walled.mesh(replace(wall, flight=None))
        carried = inertia_strain(holding, wall.material, gauges, parts, unit)
    attached = {}
    for number, (station, _) in enumerate(listed.points, start=1):
        decay = np.sqrt(body.radius(station) * wall.thickness_at(station))
        attached[f"{_EQUIPMENT} {number}"] = np.abs(gauges.x - station) < _ATTACHMENT * decay
    return InertiaStrain(
        entry=entry,
        balanced=None if wall.flight is None else rigid_inertia(mesh, unit),
        unit=unit,
        by_part=by_part,
        by_bending=bending_strain(mesh, wall.material, gauges, listed),
        section=np.rint(_SECTIONS * gauges.x / body.length).astype(int),
        held_by_part=carried,
        attached=attached,
    )


def inertia_in_words(vehicle: Vehicle) -> str:
    """Return what the map of ``vehicle`` makes of inertia: the load of 1 g across where it leaves inertia out."""
    if vehicle.mass is not None:
        known = "" if vehicle.mass.vehicle_kg or vehicle.structure.support == "free_flight" else _UNDETECTED_UNIT
        return f"included, by the masses of the vehicle file{known}"
    parts = (vehicle.material, *vehicle.materials.values())
    weight = "what 1 g across does needs material.density_kg_per_m3"
    if vehicle.has_meridian and all(part.density_kg_per_m3 is not None for part in parts):
        reference = vehicle.reference_quantities()
        mass = rigid_inertia(
            _with_masses(
                meshed_wall(vehicle), flight_masses(vehicle.structure, vehicle.material.density_kg_per_m3)
            ),
            0.0,
        )[0, 0]
        q = np.mean([condition.dynamic_pressure for condition in vehicle.flight_conditions()])
        weight = f"1 g across is an error of up to {STANDARD_GRAVITY * mass / (q * reference.area):.2g} in C_N"
    return f"not included, and nothing detects it: {weight}; a section [mass] includes it"


def inertia_map(strain: InertiaStrain | None) -> InertiaMap | None:
    """Return the modes of the layout in use, the gauges' covariance 0; None without a section [mass]."""
    if strain is None:
        return None
    entry, n_d = strain.entry, len(strain.by_bending)
    return InertiaMap(
        prior_std=_prior(entry),
        sensor_std=_errors(entry),
        mode_strain=strain.of_listed,
        rest_covariance=np.zeros((n_d, n_d)),
        vibration_strain=strain.by_bending,
        vibration_std=_MICRO * entry.vibration_um_per_m,
        vehicle_mass=entry.vehicle_kg,
    )


def inertia_terms(inertia: InertiaMap | None, strain: InertiaStrain | None) -> list[NoiseTerm]:
    """Return what inertia adds to the noise: its modes, the errors of masses at the stated specific force, and
    vibration."""
    if inertia is None or strain is None:
        return []
    stds = np.full(inertia.vibration_strain.shape[1], inertia.vibration_std)
    return [
        nuisance_modes(NAME, inertia.mode_strain, inertia.prior_std),
        nuisance_modes(VIBRATION_MODES, inertia.vibration_strain, stds),
        *([] if strain.balanced is not None else _held_terms(strain, inertia.prior_std[:N_FORCES])),
    ]


def _held_terms(strain: InertiaStrain, force: FloatArray) -> list[NoiseTerm]:
    """Return the errors of a held body at the standard deviations (3,) of specific ``force``."""
    columns: dict[str, list[FloatArray]] = {}
    for name, error, is_common in _errors_of_strain(strain, N_FORCES):
        of_force = error * force
        columns.setdefault(name, []).append(of_force if is_common else np.diag(np.linalg.norm(of_force, axis=1)))
    return [NoiseTerm(name, np.hstack(parts)) for name, parts in columns.items()]


def _errors_of_strain(strain: InertiaStrain, channels: int) -> Iterator[tuple[str, FloatArray, bool]]:
    """Yield errors (n_d, channels) of strain by name, and whether gauges have them in common.

    Half of the variance of another theory counts for all gauges in common, half for each section, half for each
    gauge.
    """
    entry = strain.entry
    size = {
        _STRUCTURE: 0.01 * entry.structure_percent,
        _EQUIPMENT: 0.01 * entry.equipment_percent,
        UNLISTED: entry.unlisted_kg,
    }
    for name, part in strain.by_part.items():
        yield MASSES, size[name.split()[0]] * part[:, :channels], True
    half = float(np.sqrt(0.5)) * 0.01 * entry.inertia_strain_percent
    common, of_gauge = strain.errors_of_theory(half, channels)
    for theory in common:
        yield THEORY, theory, True
    yield THEORY, of_gauge, False


def inertia_errors(strain: InertiaStrain | None, ensemble: Ensemble, surface: Surface) -> list[HardwareError]:
    """Return the errors of the strain by the accelerations that the load causes in free flight.

    Errors of masses strain as the masses do, balanced. Another theory of the structure gives this strain with an
    error of ``mass.inertia_strain_percent`` of the strain in a held body.
    """
    if strain is None or strain.balanced is None:
        return []
    acceleration, errors = _accelerations(strain.balanced, strain.unit, surface), list[HardwareError]()
    for name, error, is_common in _errors_of_strain(strain, N_RIGID):
        operator = error @ acceleration
        if np.any(operator):
            errors.append(HardwareError(name=name, strain=ensemble.responses(operator), common=is_common))
    return errors


def _accelerations(inertia: FloatArray, unit: float, surface: Surface) -> FloatArray:
    """Return (5, n_p) specific force along x, y, z and angular acceleration about y, z, at the unit, per pressure
    on ``surface``."""
    axial, normal, side, pitching, yawing = load_operator_on(surface, unit)
    load = np.stack([axial, side, normal, pitching, -yawing])  # a yawing moment to starboard turns about -z
    return np.linalg.solve(inertia, load)


def _with_masses(walled: MeshedWall, masses: FlightMasses | None) -> MeridianMesh:
    """Return the mesh with all ``masses`` that the vehicle file lists, held by nothing."""
    return walled.mesh(replace(walled.wall, flight=masses, foundation=None))


def _prior(entry: Mass) -> FloatArray:
    """Return the standard deviations of the channels where they are not measured; of products the root mean
    square."""
    across = STANDARD_GRAVITY * entry.lateral_g
    force = [STANDARD_GRAVITY * entry.axial_g, across, across]
    x, y = entry.roll_rate_rad_per_s, entry.rate_rad_per_s
    # E w^4 = 3 s^4.
    of_axis, of_side = np.sqrt(8.0) * y**2, np.sqrt(3.0 * x**4 + 3.0 * y**4 + 2.0 * x**2 * y**2)
    products = [of_axis, of_side, of_side, x * y, x * y, y * y]
    std = np.array([*force, *(2 * [entry.angular_acceleration_rad_per_s2]), *products])
    assert len(std) == len(CHANNELS)
    return std


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
