"""Rows of the sensors other than the strain gauges: reading per surface pressure, noise, errors, nuisances."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from builder.aero.load_operator import load_operator_on
from builder.aero.surface.mesh import Surface, grid_of
from builder.inverse.ensemble import Ensemble
from builder.inverse.noise.hardware_errors import HardwareError, error_terms, rms_ambient_pressure
from builder.inverse.noise.model import NoiseTerm, common_error, gauge_noise, nuisance_modes
from builder.inverse.structural_sensors import SensorRow, structural_rows
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.mapped_structure import MappedStructure
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.sensor_entries import AngularAccelerometers, InertialUnit, LoadCells, Ports, Sensors
from builder.vehicle.shape.geometry import SurfaceGrid
from builder.vehicle.shape.shape_entries import ReferenceQuantities
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.sensors import STRAIN, SensorRows
from strainfmu.estimator.signal_names import FORCE, MOMENT, THRUST

_COMPONENTS = ("axial", "normal", "side", "pitch", "yaw")
_AXES = {
    "axial": (1.0, 0.0, 0.0),
    "normal": (0.0, 0.0, 1.0),
    "side": (0.0, 1.0, 0.0),
    "pitch": (0.0, 1.0, 0.0),
    "yaw": (0.0, 0.0, -1.0),
}


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorSet:
    """All n_s auxiliary sensors, each row divided by its scale.

    Attributes
    ----------
    rows : the sensors.
    scale : (n_s,) unit per m/m.
    operator : (n_s, n_p) [1/Pa].
    offset : (n_s,) what base and friction add to the readings at the nominal dynamic pressure [m/m].
    errors : those in proportion to readings, rows of the sensors alone.
    terms : those errors over the ensemble, and nuisances; rows of the sensors alone.
    shared : (n_s, n_p) operator of each error that they have in common with the gauges [1/Pa], by name.
    inside : (n_s, 1) what one standard deviation of the internal pressure does to the readings [m/m].
    """

    rows: tuple[SensorRow, ...]
    scale: FloatArray
    operator: FloatArray
    offset: FloatArray
    errors: list[HardwareError]
    terms: list[NoiseTerm]
    shared: dict[str, FloatArray]
    inside: FloatArray

    @property
    def per_axial_force(self) -> FloatArray:
        """(n_s,) rows per axial force at base and skin [(m/m)/N]."""
        return np.array([row.per_axial_force for row in self.rows]) / self.scale

    @property
    def covariance(self) -> FloatArray:
        """(n_s, n_s) of the sensors' own noise [(m/m)^2]."""
        return np.diag((np.array([row.std for row in self.rows]) / self.scale) ** 2)

    def described(self, n_gauges: int, thrust_scale: float = -1.0) -> SensorRows:
        """Return what the rows of a map with ``n_gauges`` gauges ahead of these sensors measure."""
        of_axial = np.array([row.per_axial_force for row in self.rows])
        return SensorRows(
            kind=(STRAIN,) * n_gauges + tuple(row.kind for row in self.rows),
            unit=("m/m",) * n_gauges + tuple(row.unit for row in self.rows),
            scale=np.concatenate([np.ones(n_gauges), self.scale]),
            largest=np.concatenate([np.ones(n_gauges), [row.largest for row in self.rows]]),
            # Thrust pushes forward, an axial force aft.
            thrust_response=np.concatenate([np.zeros(n_gauges), thrust_scale * of_axial]),
        )


def sensor_set(
    vehicle: Vehicle,
    structure: StructuralModel | MappedStructure,
    ensemble: Ensemble,
    gauge_covariance: FloatArray,
) -> SensorSet | None:
    """Return the sensors of the section [sensors], None without one.

    ``gauge_covariance`` (n_g, n_g) [(m/m)^2] is the covariance of the gauges, whose typical noise the rows are
    scaled to.

    Raises
    ------
    InputError
        A sensor lies off the body, or surface or structure are none that it can be placed on.
    """
    entry = vehicle.sensors
    if entry is None:
        return None
    rows = [*surface_rows(entry, structure.surface), *structural_rows(vehicle, structure)]
    typical = float(np.sqrt(np.median(np.diag(gauge_covariance))))
    scale = np.array([row.std for row in rows]) / typical
    offset, terms = _nuisances(entry, vehicle.reference_quantities(), rows, scale, ensemble)
    operator = np.array([row.operator for row in rows]) / scale[:, None]
    errors = _errors(rows, scale, ensemble)
    against_inside = np.array([row.follows_inside for row in rows])
    std = 0.01 * vehicle.noise.internal_pressure_percent * rms_ambient_pressure(ensemble)
    return SensorSet(
        rows=tuple(rows),
        scale=scale,
        operator=operator,
        offset=offset,
        errors=errors,
        terms=[*error_terms(errors, ensemble), *terms, *_drifts(rows, scale)],
        shared=_joined_by_name([row.shared for row in rows], scale, len(rows[0].operator)),
        inside=np.where(against_inside, std * operator.sum(axis=1), 0.0)[:, None],
    )


def surface_rows(entry: Sensors, surface: Surface) -> list[SensorRow]:
    """Return the rows of the sensors that read the pressure on the surface alone, whatever the structure.

    Raises
    ------
    InputError
        A port lies off the body, or the surface is none that it can be placed on.
    """
    rows: list[SensorRow] = []
    if entry.ports is not None:
        rows += _ports(entry.ports, surface)
    if entry.imu is not None:
        rows += _inertial(entry.imu, surface)
    if entry.angular_accelerometers is not None:
        rows += _angular_accelerometers(entry.angular_accelerometers, surface)
    if entry.load_cells is not None:
        rows += _load_cells(entry.load_cells, surface)
    return rows


def _ports(entry: Ports, surface: Surface) -> list[SensorRow]:
    grid = grid_of(surface)
    if grid is None:
        raise InputError("sensors.ports: expected a surface of stations and roll angles, got a triangulated one")
    if not grid.x[0] <= entry.x_m <= grid.x[-1]:
        raise InputError(f"sensors.ports.x_m: expected {grid.x[0]:g} to {grid.x[-1]:g} m, got {entry.x_m:g}")
    rows = []
    for degrees in entry.roll_deg:
        roll = np.deg2rad(degrees)
        radius = float(np.interp(entry.x_m, grid.x, grid.radius))
        around = np.array([np.sin(roll), np.cos(roll)])
        rows.append(
            SensorRow(
                name=f"port_{degrees:g}deg",
                kind="pressure",
                unit="Pa",
                position=np.array([entry.x_m, *(radius * around)]),
                direction=np.array([0.0, *around]),
                operator=port_row(grid, entry.x_m, roll),
                std=entry.std_Pa,
                largest=entry.range_Pa,
                gain=0.01 * entry.gain_percent,
                follows_inside=True,
            )
        )
    return rows


def port_row(grid: SurfaceGrid, x: float, roll: float) -> FloatArray:
    """Return (n_p,) pressure at station ``x`` [m] and ``roll`` [rad] per nodal pressure [1].

    Linear between stations and trigonometric in roll, as pressure is on the grid.
    """
    after = int(np.clip(np.searchsorted(grid.x, x), 1, len(grid.x) - 1))
    length = grid.x[after] - grid.x[after - 1]
    along = np.zeros(len(grid.x))
    along[after] = 1.0 if length == 0.0 else (x - grid.x[after - 1]) / length
    along[after - 1] = 1.0 - along[after]
    harmonic = np.arange(grid.n_roll // 2 + 1)
    share = np.where((harmonic == 0) | (2 * harmonic == grid.n_roll), 1.0, 2.0) / grid.n_roll
    around = np.cos(np.outer(roll - grid.roll_angle, harmonic)) @ share
    return np.outer(along, around).ravel()


def _inertial(entry: InertialUnit, surface: Surface) -> list[SensorRow]:
    loads = load_operator_on(surface, entry.center_x_m)
    force, turn = loads[:3] / entry.mass_kg, loads[3:] / entry.inertia_kg_m2
    ahead = entry.x_m - entry.center_x_m
    # A centre of mass further aft lengthens the arm of every force ahead of it: M' = M + shift F.
    shift = 1e-3 * entry.center_std_mm
    of_centre = shift * loads[1:3] / entry.inertia_kg_m2
    by_mass, by_inertia = 0.01 * entry.mass_percent, 0.01 * entry.inertia_percent
    accelerations = {
        "axial": (force[0], np.zeros_like(force[0]), np.zeros_like(force[0])),
        # A nose that goes up or to starboard takes what lies ahead of the centre along.
        "normal": (force[1], -ahead * turn[0], shift * turn[0] - ahead * of_centre[0]),
        "side": (force[2], -ahead * turn[1], shift * turn[1] - ahead * of_centre[1]),
    }
    rows = [
        SensorRow(
            name=f"imu_{name}",
            kind="acceleration",
            unit="m/s2",
            position=np.array([entry.x_m, 0.0, 0.0]),
            direction=np.array(_AXES[name]),
            operator=of_force + of_turn,
            std=entry.accelerometer_std_m_per_s2,
            largest=entry.accelerometer_range_m_per_s2,
            gain=0.01 * entry.accelerometer_gain_percent,
            per_axial_force=1.0 / entry.mass_kg if name == "axial" else 0.0,
            errors={"mass": by_mass * of_force, "inertia": by_inertia * of_turn, f"centre, {name}": centre},
        )
        for name, (of_force, of_turn, centre) in accelerations.items()
    ]
    if not entry.angular:
        return rows
    std, largest, gain = (
        entry.angular_std_rad_per_s2,
        entry.angular_range_rad_per_s2,
        entry.angular_gain_percent,
    )
    return rows + _angular_rows("imu", ("pitch", "yaw"), entry, surface, std=std, largest=largest, gain=gain)


def _angular_accelerometers(entry: AngularAccelerometers, surface: Surface) -> list[SensorRow]:
    std, largest, gain = entry.std_rad_per_s2, entry.range_rad_per_s2, entry.gain_percent
    return _angular_rows("angular", entry.axes, entry, surface, std=std, largest=largest, gain=gain)


def _angular_rows(
    unit: str,
    axes: Sequence[str],
    entry: InertialUnit | AngularAccelerometers,
    surface: Surface,
    *,
    std: float,
    largest: float,
    gain: float,
) -> list[SensorRow]:
    """Return the angular accelerations about ``axes`` that a ``unit`` reads: moment over inertia, at any place.

    ``std`` and ``largest`` are in rad/s2, ``gain`` in per cent.
    """
    loads = load_operator_on(surface, entry.center_x_m)
    rows = []
    for name in axes:
        force_name, force, moment = {"pitch": ("normal", 1, 3), "yaw": ("side", 2, 4)}[name]
        turn = loads[moment] / entry.inertia_kg_m2
        of_centre = 1e-3 * entry.center_std_mm * loads[force] / entry.inertia_kg_m2
        rows.append(
            SensorRow(
                name=f"{unit}_{name}",
                kind="angular acceleration",
                unit="rad/s2",
                position=np.array([entry.x_m, 0.0, 0.0]),
                direction=np.array(_AXES[name]),
                operator=turn,
                std=std,
                largest=largest,
                gain=0.01 * gain,
                errors={
                    "inertia": 0.01 * entry.inertia_percent * turn,
                    f"centre, {force_name}": of_centre,
                },
            )
        )
    return rows


def _load_cells(entry: LoadCells, surface: Surface) -> list[SensorRow]:
    loads = dict(zip(_COMPONENTS, load_operator_on(surface, entry.station_m), strict=True))
    rows = []
    for name in entry.components:
        is_moment = name in ("pitch", "yaw")
        rows.append(
            SensorRow(
                name=f"cell_{name}",
                kind=MOMENT if is_moment else FORCE,
                unit="N m" if is_moment else "N",
                position=np.array([entry.station_m, 0.0, 0.0]),
                direction=np.array(_AXES[name]),
                operator=loads[name],
                std=entry.moment_std_N_m if is_moment else entry.force_std_N,
                largest=entry.moment_range_N_m if is_moment else entry.force_range_N,
                gain=0.01 * entry.gain_percent,
                per_axial_force=1.0 if name == "axial" else 0.0,
            )
        )
    return rows


def _errors(rows: list[SensorRow], scale: FloatArray, ensemble: Ensemble) -> list[HardwareError]:
    """Return gains of each sensor, and the errors that several have in common."""
    n_p = len(rows[0].operator)
    gains = np.array([row.gain * row.operator for row in rows]) / scale[:, None]
    operators = {"sensor gain": gains, **_joined_by_name([row.errors for row in rows], scale, n_p)}
    return [
        HardwareError(
            name=name,
            strain=ensemble.responses(operator),
            common=name != "sensor gain",
            with_rest=name != "sensor gain",
        )
        for name, operator in operators.items()
        if np.any(operator)
    ]


def _joined_by_name(of_rows: list[dict[str, FloatArray]], scale: FloatArray, n_p: int) -> dict[str, FloatArray]:
    """Return (n_s, n_p) operators [1/Pa] by name, zero in the rows that do not have one of that name."""
    names = dict.fromkeys(name for row in of_rows for name in row)
    none = np.zeros(n_p)
    return {name: np.array([row.get(name, none) for row in of_rows]) / scale[:, None] for name in names}


def _drifts(rows: list[SensorRow], scale: FloatArray) -> list[NoiseTerm]:
    """Return the terms of offsets that several readings have in common."""
    names = dict.fromkeys(name for row in rows for name in row.drift)
    columns = {name: np.array([row.drift.get(name, 0.0) for row in rows]) / scale for name in names}
    return [
        replace(nuisance_modes(name, column[:, None], np.ones(1)), hardware=True)
        for name, column in columns.items()
    ]


def base_area(entry: Sensors | None, reference: ReferenceQuantities) -> float:
    """Return the area that the base pressure acts on [m2]: the reference's where [sensors] states none."""
    stated = None if entry is None else entry.base_area_m2
    return reference.area if stated is None else stated


def _nuisances(
    entry: Sensors, reference: ReferenceQuantities, rows: list[SensorRow], scale: FloatArray, ensemble: Ensemble
) -> tuple[FloatArray, list[NoiseTerm]]:
    """Return what base pressure and friction add to the readings, and the terms of errors, thrust among them."""
    area = base_area(entry, reference)
    per_force = np.array([row.per_axial_force for row in rows]) / scale
    ambient, weight = ensemble.ambient_pressure, ensemble.weight / ensemble.weight.sum()
    mean = float(weight @ ambient)
    spread = float(np.sqrt(weight @ (ambient - mean) ** 2))
    suction = 1.0 - entry.base_pressure_ratio
    rms = float(np.hypot(mean, spread))
    of_base = area * np.hypot(0.01 * entry.base_pressure_percent * rms, suction * spread)
    per_coefficient = ensemble.nominal_dynamic_pressure * reference.area
    offset = per_force * (area * suction * mean + entry.friction_C_A * per_coefficient)
    columns = {
        "base pressure": (of_base, True),
        "friction": (entry.friction_C_A_std * per_coefficient, True),
        THRUST: (0.0 if entry.imu is None else entry.imu.thrust_std_N, False),
    }
    terms = [
        NoiseTerm(name, (std * per_force)[:, None], scales=scales, hardware=True)
        for name, (std, scales) in columns.items()
        if std > 0.0 and np.any(per_force)
    ]
    return offset, terms


def joined_terms(
    terms: list[NoiseTerm], errors: list[HardwareError], sensors: SensorSet, ensemble: Ensemble
) -> list[NoiseTerm]:
    """Return the noise terms of gauges and sensors together; the first is the term of their own noise.

    Terms of the gauges get no part in the sensors, but for the term of the internal pressure, which some of them
    read against, and for ``errors`` that both share.
    """
    n_s = len(sensors.rows)
    first, *remaining = terms
    n_g = len(first.strain)
    covariance = first.padded(0, n_s).covariance
    covariance[n_g:, n_g:] = sensors.covariance
    joined = [gauge_noise(covariance)]
    of_both = {error.name: error.strain for error in errors if error.name in sensors.shared}
    for term in remaining:
        if term.name in of_both:
            strain = np.hstack([of_both[term.name], ensemble.responses(sensors.shared[term.name])])
            both = common_error(term.name, ensemble.columns_by_harmonic(strain))
            joined.append(replace(both, hardware=term.hardware))
            continue
        padded_term = term.padded(0, n_s)
        if term.name == "internal pressure":
            padded_term.strain[n_g:] = sensors.inside
        joined.append(padded_term)
    return [*joined, *(term.padded(n_g, 0) for term in sensors.terms)]


def joined_errors(
    errors: list[HardwareError], sensors: SensorSet, n_g: int, ensemble: Ensemble
) -> list[HardwareError]:
    """Return the errors of ``n_g`` gauges and the sensors together, each with zeros in the rows of the others.

    Those that both share have rows of both.
    """
    n_s = len(sensors.rows)

    def padded(error: HardwareError, above: int, below: int) -> HardwareError:
        return replace(error, strain=np.pad(error.strain, ((0, 0), (above, below))))

    def of_gauges(error: HardwareError) -> HardwareError:
        if error.name not in sensors.shared:
            return padded(error, 0, n_s)
        auxiliary = ensemble.responses(sensors.shared[error.name])
        return replace(error, strain=np.hstack([error.strain, auxiliary]))

    return [*map(of_gauges, errors), *(padded(error, n_g, 0) for error in sensors.errors)]
