"""The plant's physics: strain and coefficients of a vehicle of revolution anywhere in its envelope.

A body of revolution sees total incidence and Mach number only; the roll angle of the flow turns the
strain round the body. So one table of circumferential harmonics over (Mach number, total incidence) holds
every flight condition. Between the knots it is a tensor-product cubic polynomial.
"""

from dataclasses import dataclass, field
from math import cos, degrees, sin
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.cosim.models.trajectory import Trajectory
from strainfmu.errors import InputError
from strainfmu.estimator.map.sensors import SensorRows
from strainfmu.estimator.settings import OF_AREA, OF_LENGTH
from strainfmu.files import build_time
from strainfmu.flight_condition import MACH_NUMBER, FlightCondition
from strainfmu.interface.sensor_variables import reading_names
from strainfmu.records import inner_record, load_record, save_record

SCHEMA = "strainfmu.flight_model"
SCHEMA_VERSION = 2

_UNITS = {
    "gauge_roll_angle": "rad",
    "incidence_knots": "rad",
    "strain_table": "1/Pa per knot coordinate",
    "strain_of_internal_pressure": "1/Pa",
    "internal_pressure": "Pa",
    "base_area": "m2",
    OF_AREA: "m2",
    OF_LENGTH: "m",
    "noise_std": "m/m",
    "apparent_strain": "m/m",
}

# A flight condition this fraction of the envelope outside a knot is round-off, not a wrong trajectory.
_ROUND_OFF = 1e-9
# Points per trajectory interval at which the envelope is checked: cubics bend between the rows.
_CHECKS_PER_ROW = 10


@dataclass(frozen=True, eq=False)
class FlightModel:
    """Strain and coefficients over the flight envelope, for n_d gauges on n_channel channels.

    Auxiliary sensors are rows as gauges are, behind them, whose readings stand in units of their own for strain.

    With M_i, a_j the lower knots of the cell that holds Mach number M and total incidence a_T, a table c has
    the value sum_pq c[i, j, p, q] (M - M_i)^p (a_T - a_j)^q. The strain of gauge g on channel k is
    p_inf sum_m [E_km cos(m (phi_g - phi_T)) + S_km sin(m (phi_g - phi_T))] - p_internal u_g, m from 0.

    Attributes
    ----------
    vehicle : name of the vehicle and what it stands for.
    gauge_names : n_d names, unique.
    gauge_roll_angle : (n_d,) phi_g, from +z toward +y [rad].
    gauge_channel : (n_d,) index of each gauge's channel in ``strain_table``.
    mach_knots : (n_M,) increasing [1].
    incidence_knots : (n_a,) total incidence, increasing from 0 [rad].
    strain_table : (n_M - 1, n_a - 1, 4, 4, n_channel, n_harmonic, 2) coefficients of [E, S] per ambient
        pressure [(m/m)/Pa, over rad^q].
    coefficient_table : (n_M - 1, n_a - 1, 4, 4, 3) coefficients of C_A, C_T, M_T [1, over rad^q]: axial
        force of absolute pressure, force along the cross-flow, and moment as M_P has it when phi_T = 0.
    strain_of_internal_pressure : (n_d,) u_g, strain per uniform outer pressure [(m/m)/Pa].
    internal_pressure : p_internal [Pa], or None for a vented body, whose inside is at p_inf.
    base_area : of the body [m2]; p_internal acts forward on it.
    reference_area : S [m2].
    reference_length : L [m].
    noise_std : standard deviation of the noise on every strain [m/m].
    provenance : what the model was built from.
    apparent_strain : (n_d,) strain that every gauge reads in addition to the body's [m/m]; None for none.
    sensors : what the n_d rows read; their scale is the noise of each over ``noise_std``. None for strain alone.
    """

    vehicle: str
    gauge_names: tuple[str, ...]
    gauge_roll_angle: FloatArray
    gauge_channel: NDArray[np.int64]
    mach_knots: FloatArray
    incidence_knots: FloatArray
    strain_table: FloatArray
    coefficient_table: FloatArray
    strain_of_internal_pressure: FloatArray
    internal_pressure: float | None
    base_area: float
    reference_area: float
    reference_length: float
    noise_std: float
    provenance: dict[str, Any] = field(default_factory=dict)
    apparent_strain: FloatArray | None = None
    sensors: SensorRows | None = field(default=None, metadata=inner_record(SensorRows, {}))

    def __post_init__(self) -> None:
        _check_shapes(self)
        _check_values(self)

    @property
    def n_gauges(self) -> int:
        """Number of rows n_d, gauges and auxiliary sensors."""
        return len(self.gauge_names)

    @property
    def n_strain_gauges(self) -> int:
        """Number of strain gauges, whose rows come first."""
        return self.n_gauges if self.sensors is None else self.sensors.n_strain_gauges

    @property
    def noise_scale(self) -> FloatArray:
        """(n_d,) noise of each row over ``noise_std`` [unit/(m/m)]; 1 of strain."""
        return np.ones(self.n_gauges) if self.sensors is None else self.sensors.scale

    @property
    def reading_names(self) -> tuple[str, ...]:
        """n_d names of the plant's outputs for the rows."""
        return reading_names(self)


@dataclass(frozen=True, eq=False)
class FlightPoint:
    """What the vehicle feels at one flight condition, without noise.

    Attributes
    ----------
    coefficients : (5,) C_A, C_N, C_Y, M_P, M_Y [1].
    strain : (n_d,) [m/m], of auxiliary sensors their readings.
    dynamic_pressure : q_inf [Pa].
    """

    coefficients: FloatArray
    strain: FloatArray
    dynamic_pressure: float


def evaluate(model: FlightModel, condition: FlightCondition, time: float | None = None) -> FlightPoint:
    """Return strain, coefficients and dynamic pressure at a flight condition.

    Parameters
    ----------
    time : when this is [s]; only named in errors.

    Raises
    ------
    InputError
        The condition is outside the envelope of knots or the atmosphere.
    """
    when = "" if time is None else f" at time {time:.6g} s"
    mach_number, roll_angle = condition.mach_number, condition.leeward_roll_angle
    i, mach_step = _cell(model.mach_knots, mach_number, MACH_NUMBER, 1.0, "", when)
    j, incidence_step = _cell(
        model.incidence_knots, condition.total_incidence, "total incidence", degrees(1.0), " deg", when
    )
    try:
        ambient_pressure = condition.ambient_pressure
    except InputError as error:
        raise InputError(f"{error}{when}") from error
    dynamic_pressure = condition.dynamic_pressure
    inside = ambient_pressure if model.internal_pressure is None else model.internal_pressure

    weights = np.outer(_powers(mach_step), _powers(incidence_step)).ravel()
    n_channel, n_harmonic = model.strain_table.shape[4:6]
    harmonics = (weights @ model.strain_table[i, j].reshape(16, -1)).reshape(n_channel, n_harmonic, 2)
    axial, cross_force, moment = weights @ model.coefficient_table[i, j].reshape(16, 3)
    axial -= inside * model.base_area / (dynamic_pressure * model.reference_area)

    of_gauge = harmonics[model.gauge_channel]
    phase = np.multiply.outer(model.gauge_roll_angle - roll_angle, np.arange(n_harmonic))
    strain = np.einsum("gm,gm->g", of_gauge[:, :, 0], np.cos(phase))
    strain += np.einsum("gm,gm->g", of_gauge[:, :, 1], np.sin(phase))
    up, starboard = cos(roll_angle), sin(roll_angle)
    strain = ambient_pressure * strain - inside * model.strain_of_internal_pressure
    if model.apparent_strain is not None:
        strain += model.apparent_strain
    return FlightPoint(
        np.array([axial, cross_force * up, cross_force * starboard, moment * up, moment * starboard]),
        strain,
        dynamic_pressure,
    )


def check_envelope(
    mach_knots: FloatArray, incidence_knots: FloatArray, trajectory: Trajectory, path: Path
) -> None:
    """Refuse a trajectory, read from ``path``, that leaves the knots of a flight model.

    Raises
    ------
    InputError
        The trajectory leaves the envelope; the message names the file, the quantity and the time.
    """
    fractions = np.arange(_CHECKS_PER_ROW) / _CHECKS_PER_ROW
    steps = np.diff(trajectory.time)
    times = np.append(np.add(trajectory.time[:-1, None], np.outer(steps, fractions)), trajectory.stop_time)
    for time in times.tolist():
        condition, when = trajectory.condition_at(time), f" at time {time:.6g} s"
        try:
            _cell(mach_knots, condition.mach_number, MACH_NUMBER, 1.0, "", when)
            _cell(incidence_knots, condition.total_incidence, "total incidence", degrees(1.0), " deg", when)
            pressure_and_temperature(condition.altitude)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error


def _powers(step: float) -> FloatArray:
    """Return step to the powers 0 to 3."""
    return np.array([1.0, step, step * step, step * step * step])


def _cell(knots: FloatArray, value: float, quantity: str, shown: float, unit: str, when: str) -> tuple[int, float]:
    """Return the index of the cell that holds ``value`` and the distance from its lower knot.

    ``shown`` and ``unit`` turn knots into what the error message shows.
    """
    low, high = float(knots[0]), float(knots[-1])
    slack = _ROUND_OFF * (high - low)
    if not low - slack <= value <= high + slack:
        raise InputError(
            f"{quantity}: {value * shown:.6g}{unit} found{when}, "
            f"{low * shown:.6g} to {high * shown:.6g}{unit} allowed by the flight model"
        )
    cell = int(np.searchsorted(knots, value, side="right")) - 1
    cell = min(max(cell, 0), len(knots) - 2)
    return cell, value - float(knots[cell])


def _check_shapes(model: FlightModel) -> None:
    """Refuse arrays that do not fit each other."""
    n_d, n_mach, n_incidence = len(model.gauge_names), len(model.mach_knots), len(model.incidence_knots)
    if min(n_mach, n_incidence) < 2:
        raise InputError(f"flight model: expected at least 2 x 2 knots, got {n_mach} x {n_incidence}")
    if model.strain_table.ndim != 7:
        raise InputError(f"flight model: strain_table has {model.strain_table.ndim} axes, must have 7")
    n_channel, n_harmonic = model.strain_table.shape[4:6]
    cells = (n_mach - 1, n_incidence - 1, 4, 4)
    expected = {
        "gauge_roll_angle": (n_d,),
        "gauge_channel": (n_d,),
        "mach_knots": (n_mach,),
        "incidence_knots": (n_incidence,),
        "strain_table": (*cells, n_channel, n_harmonic, 2),
        "coefficient_table": (*cells, 3),
        "strain_of_internal_pressure": (n_d,),
        **({} if model.apparent_strain is None else {"apparent_strain": (n_d,)}),
    }
    for name, shape in expected.items():
        value = getattr(model, name)
        if value.shape != shape:
            raise InputError(f"flight model: {name} has shape {value.shape}, must be {shape}")
        if not np.all(np.isfinite(value)):
            raise InputError(f"flight model: {name} holds values that are not finite")


def _check_values(model: FlightModel) -> None:
    """Refuse values that cannot be meant."""
    n_channel = model.strain_table.shape[4]
    channels = model.gauge_channel
    if len(set(model.gauge_names)) != len(model.gauge_names):
        raise InputError("flight model: gauge_names holds a name twice")
    if not np.issubdtype(channels.dtype, np.integer) or np.any((channels < 0) | (channels >= n_channel)):
        raise InputError(f"flight model: gauge_channel must hold integers from 0 to {n_channel - 1}")
    if model.sensors is not None and len(model.sensors.kind) != len(model.gauge_names):
        n_d = len(model.gauge_names)
        raise InputError(f"flight model: sensors: {len(model.sensors.kind)} rows found, must be {n_d}")
    for name in ("mach_knots", "incidence_knots"):
        if not np.all(np.diff(getattr(model, name)) > 0.0):
            raise InputError(f"flight model: {name} must increase")
    if model.incidence_knots[0] != 0.0:
        raise InputError(f"flight model: incidence_knots starts at {model.incidence_knots[0]:g} rad, must be 0")
    for name in (OF_AREA, OF_LENGTH):
        if not 0.0 < getattr(model, name) < np.inf:
            raise InputError(f"flight model: {name} is {getattr(model, name)}, must be positive")
    if not 0.0 <= model.base_area < np.inf:
        raise InputError(f"flight model: base_area is {model.base_area}, must be 0 or more")
    if model.internal_pressure is not None and not 0.0 <= model.internal_pressure < np.inf:
        raise InputError(f"flight model: internal_pressure is {model.internal_pressure}, must be 0 or more")
    if not 0.0 <= model.noise_std < np.inf:
        raise InputError(f"flight model: noise_std is {model.noise_std}, must be 0 or more")


def save_flight_model(model: FlightModel, path: str | PathLike[str]) -> str:
    """Write ``model`` to ``path`` atomically and return its content hash.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """
    return save_record(model, path, SCHEMA, SCHEMA_VERSION, _UNITS, built_at=build_time())


def load_flight_model(path: str | PathLike[str]) -> FlightModel:
    """Read and check a flight model.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version.
    """
    return load_record(FlightModel, path, SCHEMA, SCHEMA_VERSION)
