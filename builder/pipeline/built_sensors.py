"""The auxiliary sensors of a vehicle that flies: the section [sensors], errors of the stated sizes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.inverse.sensor_set import base_area, surface_rows
from builder.inverse.structural_sensors import SensorRow, rows_on_surface
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.fourier.shell_mesh import meshed_wall
from builder.truth.true_structure import BuiltSensors, sensor_response
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.estimator.signal_names import THRUST

PERCENT = 0.01


@dataclass(frozen=True, eq=False, kw_only=True)
class FlownSensors:
    """The sensors of a vehicle, solved at the resolution of the independent model.

    Attributes
    ----------
    vehicle : with its section [sensors].
    surface : the pressure nodes.
    rows : of the sensors there.
    """

    vehicle: Vehicle
    surface: SurfaceGrid
    rows: tuple[SensorRow, ...]

    @property
    def std(self) -> FloatArray:
        """(n_s,) standard deviations of the noise [unit]."""
        return np.array([row.std for row in self.rows])

    def as_built(self, as_built: AsBuilt, random: np.random.Generator | None) -> BuiltSensors:
        """Return the sensors of a vehicle ``as_built``, their own errors drawn; without errors of theirs for None.

        Errors of the wall, and of the pressure inside, are the errors of the gauges.
        """
        vehicle, rows, entry = self.vehicle, self.rows, self.vehicle.sensors
        assert entry is not None
        draws = self._draws(random, [*(f"gain {row.name}" for row in rows), *_names(rows), *_NUISANCES])
        noise = vehicle.noise
        of_wall = {
            "common gain": _over(as_built.common_gain, PERCENT * noise.common_gain_percent),
            "wall thickness": _over(as_built.wall_thickness, PERCENT * noise.wall_thickness_percent),
        }
        operator = np.array(
            [
                row.operator * (1.0 + row.gain * draws[f"gain {row.name}"])
                + sum(draws[name] * error for name, error in row.errors.items())
                + sum(of_wall[name] * error for name, error in row.shared.items())
                for row in rows
            ]
        )
        response = sensor_response(operator, self.surface, vehicle.resolution.truth.harmonics)
        per_force = np.array([row.per_axial_force for row in rows])
        inside = np.array([row.follows_inside for row in rows]) * float(np.mean(as_built.internal_pressure))
        suction = 1.0 - entry.base_pressure_ratio + PERCENT * entry.base_pressure_percent * draws["base pressure"]
        friction = entry.friction_C_A + entry.friction_C_A_std * draws["friction"]
        thrust = 0.0 if entry.imu is None else entry.imu.thrust_std_N * draws[THRUST]
        drift = [sum(std * draws[name] for name, std in row.drift.items()) for row in rows]
        return BuiltSensors(
            names=tuple(row.name for row in rows),
            roll_angle=np.zeros(len(rows)),
            record={},
            kind=tuple(row.kind for row in rows),
            unit=tuple(row.unit for row in rows),
            response=response,
            per_ambient=per_force * base_area(entry, vehicle.reference_quantities()) * suction
            - inside * response[:, 0, :, 0].sum(axis=1),
            per_dynamic=per_force * friction * vehicle.reference_quantities().area,
            apparent=np.array(drift) - per_force * thrust,
            std=self.std,
            largest=np.array([row.largest for row in rows]),
            thrust_response=-per_force,
        )

    def _draws(self, random: np.random.Generator | None, names: Sequence[str]) -> dict[str, float]:
        """Return standard normal numbers by name, 0 without ``random``."""
        normal = np.zeros(len(names)) if random is None else random.standard_normal(len(names))
        return dict(zip(names, normal.tolist(), strict=True))


_NUISANCES = ("base pressure", "friction", THRUST)


def flown_sensors(vehicle: Vehicle, surface: SurfaceGrid) -> FlownSensors | None:
    """Return the sensors of ``vehicle`` on the ``surface`` of its independent model; None without any.

    Raises
    ------
    InputError
        A sensor lies off the body.
    """
    entry = vehicle.sensors
    if entry is None:
        return None
    settings = vehicle.resolution.truth
    rows = surface_rows(entry, surface)
    if entry.of_structure:
        rows += rows_on_surface(entry, vehicle.noise, meshed_wall(vehicle, settings), surface, settings.harmonics)
    return FlownSensors(vehicle=vehicle, surface=surface, rows=tuple(rows))


def sensor_names_of(vehicle: Vehicle) -> tuple[str, ...]:
    """Return the names of the sensors of ``vehicle``, in the order of the rows of its map.

    Raises
    ------
    InputError
        A sensor lies off the body.
    """
    entry, settings = vehicle.sensors, vehicle.resolution.map
    if entry is None:
        return ()
    surface = surface_grid(vehicle.body(), *settings.surface_nodes)
    rows = surface_rows(entry, surface)
    if entry.of_structure:
        rows += rows_on_surface(entry, vehicle.noise, meshed_wall(vehicle), surface, settings.harmonics)
    return tuple(row.name for row in rows)


def _names(rows: Sequence[SensorRow]) -> list[str]:
    """Return the names of errors and drifts that sensors have in common."""
    return list(dict.fromkeys(name for row in rows for name in (*row.errors, *row.drift)))


def _over(value: FloatArray, std: float) -> float:
    """Return ``value`` in standard deviations, its mean where it differs from gauge to gauge; 0 if not stated."""
    return float(np.mean(value)) / std if std > 0.0 else 0.0
