"""Readings of the reference run: a flight that the map covers, errors as large as the map states, one fault."""

from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, with_gauge_covariance
from strainfmu.estimator.map.nonlinear_map import with_known
from strainfmu.estimator.map.validity import flow_parameters
from strainfmu.estimator.reference.readings import amplitudes, row_noise
from strainfmu.fmu.reference_run.flight_path import flight_path
from strainfmu.fmu.reference_run.reference_flight import ReferenceFlight, flight_of_states, flight_of_tables
from strainfmu.interface.parameter_variables import parameter_names, parameter_std_names
from strainfmu.interface.sensor_variables import temperature_names

FAULT_SIZE = 15.0
"""Error of the failing gauge, in standard deviations of its residual."""

_FAULT = (0.55, 0.72)
"""Part of the run at which the fault begins, and at which it ends."""

FAULT_STATES = (HealthState.INCONSISTENT, HealthState.SUSPECT)
"""Health of an estimate with a faulty gauge in use."""

_PARAMETER_STD = 0.01
"""Standard deviation of a parameter of the flow, of its range."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Fault:
    """A gauge that fails.

    Attributes
    ----------
    gauge : its row in the map.
    size : its error [m/m].
    fails : (n,) whether it does.
    """

    gauge: int
    size: float
    fails: BoolArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Readings:
    """What sensors give in the reference run, of n samples.

    Attributes
    ----------
    flight : without errors.
    fault : fault of one gauge.
    known : (n,) inputs other than the rows of the map, by name.
    """

    flight: ReferenceFlight
    fault: Fault
    known: dict[str, FloatArray]

    def sample(self, seed: int) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return (n, n_d) rows of the map [m/m] with errors and the fault, and the true outputs (n,) by name."""
        strain, truth = self.flight.sample(seed)
        strain[self.fault.fails, self.fault.gauge] += self.fault.size
        return strain, truth


def reference_readings(inverse_map: InverseMap, n_rows: int) -> Readings:
    """Return the readings of a flight of ``n_rows``, over the flight state where the map has tables of it."""
    known = _known_inputs(inverse_map)
    fitted = _with_known(inverse_map, known)
    path = flight_path(fitted, n_rows)
    flight = flight_of_states(fitted, path) if fitted.manifold is None else flight_of_tables(fitted, path)
    gauge, size = failing_gauge(flight.residual_precision)
    row = np.arange(n_rows)
    first, end = (round(part * n_rows) for part in _FAULT)
    return Readings(
        flight=flight,
        fault=Fault(gauge=gauge, size=size, fails=(row >= first) & (row < end)),
        known={**path.air_data, **{name: np.full(n_rows, value) for name, value in known.items()}},
    )


def _known_inputs(inverse_map: InverseMap) -> dict[str, float]:
    """Return temperatures, at the reference, and parameters of the flow, amid their ranges, by input."""
    thermal, parameters = inverse_map.thermal, flow_parameters(inverse_map)
    middle, std = 0.5 * (parameters.minimum + parameters.maximum), _PARAMETER_STD * parameters.span
    return {
        **dict.fromkeys(temperature_names(thermal), thermal.reference_temperature),
        **dict(zip(parameter_names(inverse_map), middle.tolist(), strict=True)),
        **dict(zip(parameter_std_names(inverse_map), std.tolist(), strict=False)),
    }


def _with_known(inverse_map: InverseMap, known: dict[str, float]) -> InverseMap:
    """Return ``inverse_map`` as it holds while the inputs ``known`` are."""
    thermal, manifold = inverse_map.thermal, inverse_map.manifold
    if thermal.n_sensors:
        modes = inverse_map.thermal_and_inertia
        at_rest = np.full((1, modes.n_sensors), thermal.reference_temperature)
        # No inertial unit measures anything.
        unknown = amplitudes(modes, at_rest, np.arange(modes.n_sensors) < thermal.n_sensors).covariance[0]
        noise = row_noise(inverse_map, inverse_map.gauge_covariance, left=unknown)
        inverse_map = with_gauge_covariance(inverse_map, noise)
        manifold = inverse_map.manifold
    stds = parameter_std_names(inverse_map)
    if manifold is None or not stds:
        return inverse_map
    value = np.array([known[name] for name in parameter_names(inverse_map)])
    return replace(inverse_map, manifold=with_known(manifold, value, np.array([known[name] for name in stds])))


def failing_gauge(precision: FloatArray) -> tuple[int, float]:
    """Return index and error [m/m] of the gauge that fails: the one whose error is best seen and attributed.

    ``precision`` (n_d, n_d) is the precision of the residual [1/(m/m)^2].
    """
    variance = np.diag(precision)
    checked = np.where(variance > 0.0, variance, 1.0)
    alike = precision**2 / np.outer(checked, checked)
    np.fill_diagonal(alike, 0.0)
    gauge = int(np.argmax(variance * (1.0 - np.max(alike, axis=0))))
    return gauge, FAULT_SIZE / float(np.sqrt(checked[gauge]))
