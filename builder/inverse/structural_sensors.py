"""Sensors that read the structure as strain gauges do: displacement of the wall, and strain along optical fibres.

Their readings per surface pressure follow from the same model of the wall. So they share its errors with the
gauges: Young's modulus (the common gain), and the thickness of the wall.

The row of one sensor other than the strain gauges: reading per surface pressure, noise, errors.
"""

from dataclasses import dataclass, field

import numpy as np

from builder.inverse.noise.hardware_errors import WALL_STEP
from builder.structure.as_built.reading_slopes import CLAMP
from builder.structure.as_built_kinds import BY_REGION, KINDS
from builder.structure.fourier.fourier_model import StructuralModel, SurfaceTargets, displacement_operator
from builder.structure.fourier.inner_surface import inner_surface_points, place_gauges
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import MeshedWall, meshed_wall
from builder.structure.fourier.strain_operator import harmonic_response, strain_operator
from builder.structure.mapped_structure import MappedStructure
from builder.structure.wall import Material
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.sensor_entries import Displacements, Fibre, Sensors
from builder.vehicle.map_options import Noise
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorRow:
    """One sensor.

    Attributes
    ----------
    name, kind, unit : of the reading.
    position, direction : (3,) [m], (3,) in body axes.
    operator : (n_p,) reading per net surface pressure [unit/Pa].
    std, largest, gain : standard deviation of its noise [unit], largest reading [unit], error over reading [1].
    per_axial_force : reading per axial force on the body, as of base pressure [unit/N].
    follows_inside : whether it reads against the pressure inside the body.
    errors : (n_p,) operator of each error that it has in common with other sensors, one standard deviation, by
        name.
    shared : the same of errors that it has in common with the strain gauges, by their names there.
    drift : standard deviation of an offset that all readings of the same name of drift have in common [unit]; by
        that name.
    """

    name: str
    kind: str
    unit: str
    position: FloatArray
    direction: FloatArray
    operator: FloatArray
    std: float
    largest: float
    gain: float = 0.0
    per_axial_force: float = 0.0
    follows_inside: bool = False
    errors: dict[str, FloatArray] = field(default_factory=dict)
    shared: dict[str, FloatArray] = field(default_factory=dict)
    drift: dict[str, float] = field(default_factory=dict)


MICRO, MILLI = 1e-6, 1e-3


@dataclass(frozen=True, eq=False, kw_only=True)
class _Place:
    """Points of the inner surface: (n,) stations [m] and roll angles [rad], (n, 3) directions and places [m]."""

    x: FloatArray
    roll_angle: FloatArray
    direction: FloatArray
    position: FloatArray


def structural_rows(vehicle: Vehicle, structure: StructuralModel | MappedStructure) -> list[SensorRow]:
    """Return the rows of the entries displacement and fibre.

    Raises
    ------
    InputError
        The structure is not the Fourier model of a held body, or a point lies off the wall's inner surface.
    """
    entry = vehicle.sensors
    if entry is None or not entry.of_structure:
        return []
    names = " and ".join(f"sensors.{name}" for name in entry.of_structure)
    if not isinstance(structure, StructuralModel):
        raise InputError(f"{names}: expected structure.model 'fourier', got {structure.description}")
    if vehicle.structure.support == "free_flight":
        raise InputError(f"{names}: expected a support that holds the body, got 'free_flight'")
    if vehicle.temperature is not None:
        raise InputError(
            f"{names}: expected no section [temperature]: what heat does to their readings is not known"
        )
    harmonics = structure.response.max_harmonic
    return rows_on_surface(entry, vehicle.noise, meshed_wall(vehicle), structure.surface, harmonics)


def rows_on_surface(
    entry: Sensors, tolerances: Noise, walled: MeshedWall, surface: SurfaceGrid, harmonics: int
) -> list[SensorRow]:
    """Return those rows per pressure at the nodes of ``surface``, of a Fourier model up to ``harmonics``.

    ``entry`` and ``tolerances`` are the sections [sensors] and [noise], ``walled`` is the wall that is read.

    Raises
    ------
    InputError
        A point lies off the wall's inner surface.
    """
    mesh, material = walled.mesh(), walled.wall.material

    def read_on(meridian: MeridianMesh) -> FloatArray:
        return _operators(entry, material, meridian, surface, harmonics)

    operator = read_on(mesh)
    shared = {"common gain": 0.01 * tolerances.common_gain_percent * operator}
    _refuse_unknown_errors(tolerances)
    if tolerances.wall_thickness_percent > 0.0:
        factors = 1.0 - WALL_STEP, 1.0 + WALL_STEP
        thin, thick = (read_on(walled.mesh(walled.wall.thicker(factor))) for factor in factors)
        slope = (thick - thin) / (2.0 * WALL_STEP)
        shared["wall thickness"] = 0.01 * tolerances.wall_thickness_percent * slope
    shared = {name: of_all for name, of_all in shared.items() if np.any(of_all)}
    rows: list[SensorRow] = []
    if entry.displacement is not None:
        rows += _displacement_rows(
            entry.displacement, _displacement_places(entry.displacement, mesh), operator, shared
        )
    if entry.fibre is not None:
        rows += _fibre_rows(entry.fibre, _fibre_places(entry.fibre, mesh), operator, shared, len(rows))
    return rows


def _operators(
    entry: Sensors, material: Material, mesh: MeridianMesh, grid: SurfaceGrid, harmonics: int
) -> FloatArray:
    """Return (n, n_p) readings per pressure [unit/Pa], displacements first."""
    blocks = []
    if entry.displacement is not None:
        place = _displacement_places(entry.displacement, mesh)
        targets = SurfaceTargets(x=place.x, roll_angle=place.roll_angle, direction=place.direction)
        blocks.append(displacement_operator(mesh, material, targets, grid, harmonics))
    if entry.fibre is not None:
        place = _fibre_places(entry.fibre, mesh)
        gauges = place_gauges(mesh, place.position, place.direction, _fibre_names(entry.fibre))
        response = harmonic_response(mesh, material, gauges.x, grid.x, harmonics)
        blocks.append(strain_operator(response, gauges, grid))
    return np.concatenate(blocks)


def _refuse_unknown_errors(entry: Noise) -> None:
    """Refuse errors whose part in these readings is not known."""
    for kind in (KINDS[name] for name in (*CLAMP, *BY_REGION)):
        if kind.std(entry) > 0.0:
            raise InputError(
                f"noise.{kind.entry}: expected 0 with sensors.displacement or sensors.fibre, whose readings with "
                f"such an error are not known, got {getattr(entry, kind.entry):g}"
            )


def _places(
    mesh: MeridianMesh, x: FloatArray, degrees: FloatArray, direction: FloatArray | None, where: str
) -> _Place:
    """Return points of the inner surface; without ``direction`` along the meridian, aft."""
    if not len(mesh.inner_edge):
        raise InputError(f"{where}: the body is solid: it has no inner surface")
    front, aft = mesh.node[mesh.inner_edge[[0, -1], [0, 2]], 0]
    for station in x:
        if not front <= station <= aft:
            raise InputError(f"{where}: expected a station from {front:g} to {aft:g} m, got {station:g}")
    point, roll = inner_surface_points(mesh, x), np.deg2rad(degrees)
    across = np.column_stack([np.sin(roll), np.cos(roll)])
    if direction is None:
        direction = np.column_stack([point.tangent[:, 0], point.tangent[:, 1:] * across])
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return _Place(
        x=x, roll_angle=roll, direction=unit, position=np.column_stack([x, point.radius[:, None] * across])
    )


def _displacement_places(entry: Displacements, mesh: MeridianMesh) -> _Place:
    return _places(
        mesh,
        np.array([point.x_m for point in entry.point]),
        np.array([point.roll_deg for point in entry.point]),
        np.array([point.direction for point in entry.point]),
        "sensors.displacement",
    )


def _fibre_places(entry: Fibre, mesh: MeridianMesh) -> _Place:
    along = np.linspace(entry.first_x_m, entry.last_x_m, entry.count)
    x, degrees = np.tile(along, len(entry.roll_deg)), np.repeat(entry.roll_deg, entry.count)
    return _places(mesh, x, degrees, None, "sensors.fibre")


def _fibre_names(entry: Fibre) -> list[str]:
    return [f"fibre_{roll:g}deg_{k + 1}" for roll in entry.roll_deg for k in range(entry.count)]


def _displacement_rows(
    entry: Displacements, place: _Place, operator: FloatArray, shared: dict[str, FloatArray]
) -> list[SensorRow]:
    return [
        SensorRow(
            name=point.label,
            kind="displacement",
            unit="m",
            position=place.position[k],
            direction=place.direction[k],
            operator=operator[k],
            std=MICRO * entry.std_um,
            largest=MILLI * entry.range_mm,
            gain=0.01 * entry.gain_percent,
            follows_inside=True,
            shared={name: of_all[k] for name, of_all in shared.items()},
        )
        for k, point in enumerate(entry.point)
    ]


def _fibre_rows(
    entry: Fibre, place: _Place, operator: FloatArray, shared: dict[str, FloatArray], first: int
) -> list[SensorRow]:
    """Return the rows of all fibres; their operators begin at row ``first``."""
    rows = []
    for k, name in enumerate(_fibre_names(entry)):
        fibre = f"fibre {entry.roll_deg[k // entry.count]:g} deg"
        gauge_operator = operator[first + k]
        rows.append(
            SensorRow(
                name=name,
                kind="fibre strain",
                unit="m/m",
                position=place.position[k],
                direction=place.direction[k],
                operator=gauge_operator,
                std=MICRO * entry.std_um_per_m,
                largest=MICRO * entry.range_um_per_m,
                follows_inside=True,
                errors={f"{fibre}, gain": 0.01 * entry.gain_percent * gauge_operator}
                if entry.gain_percent
                else {},
                shared={error_name: of_all[first + k] for error_name, of_all in shared.items()},
                drift={f"{fibre}, drift": MICRO * entry.drift_um_per_m} if entry.drift_um_per_m else {},
            )
        )
    return rows
