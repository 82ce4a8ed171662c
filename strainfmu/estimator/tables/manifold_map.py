"""The nonlinear part of a map: tables over the flight state, and the errors of strain and loads about them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import DEVIATION_OF_AIR
from strainfmu.errors import InputError
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.setting_inputs import OF_AREA, OF_LENGTH
from strainfmu.estimator.tables.flight_field import UNITS as FIELD_UNITS
from strainfmu.estimator.tables.flight_field import FlightField
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, N_STATES, FlightTables, U, W
from strainfmu.estimator.tables.parameter_tables import UNITS as PARAMETER_UNITS
from strainfmu.estimator.tables.parameter_tables import ParameterTables
from strainfmu.estimator.tables.shape_field import UNITS as SHAPE_UNITS
from strainfmu.estimator.tables.shape_field import ShapeField
from strainfmu.records import inner_record


class Crossflow(NamedTuple):
    """Middle and half width (2,) of the ranges of u and w [rad]."""

    middle: FloatArray
    half: FloatArray


class StatePrior(NamedTuple):
    """Mean and standard deviation (4,) of the flight state where nothing is known."""

    mean: FloatArray
    std: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class ManifoldMap:
    """Tables and errors for n_d gauges and the n_f loads of the map, in its order.

    Errors are per p_inf where they scale with the pressure level. Those in proportion to strain follow
    c = [1, loads / (p_inf S [1, 1, 1, L, L])].

    Attributes
    ----------
    mach_knots, incidence_knots, response, fixed_response : n_d strains, then n_f loads over the flight state, see
        :class:`~strainfmu.estimator.tables.flight_tables.FlightTables`.
    gauge_covariance : (n_d, n_d) of what does not scale, as gauge noise and apparent strain [(m/m)^2].
    error_strain, error_load : (n_d, k) [1/Pa], (n_f, k) [m2, m3] per standard deviation, and per p_inf, of errors
        that the gain may correct, as of the internal pressure.
    considered_strain, considered_load : the same of errors that it may not, as of pressure off the tables: they
        count in covariances and alarms alone (considered parameters, Schmidt 1966); None for none.
    gauge_gain_std, common_gain_std : errors of each gauge's gain, and of all together, relative [1].
    sensor_gain_std, sensor_common_gain_std : (n_s,) the same of the auxiliary sensors, which are the last of the
        n_d gauges; None for none.
    gauge_error_product : (21, n_d) sum over errors of each gauge of D_a D_b, doubled for a < b [1/Pa^2].
    common_error, considered_common : (n_t, 6, n_d) errors that all gauges have in common, per p_inf and c_a
        [1/Pa], that the gain may and may not correct; None of the latter for none.
    reference_area, reference_length : S [m2], L [m].
    mach_range, pressure_range : (2,) of M [1] and p_inf [Pa] that the map holds for.
    incidence_limit : largest total incidence that it holds for [rad].
    crossflow_range : (2, 2) smallest and largest u and w that it holds for [rad]; None for every roll angle of the
        wind.
    mach_number_error : standard deviation of a stated Mach number without its own [1].
    static_pressure_error, dynamic_pressure_error : the same of p_inf and q_inf, relative [1].
    altitude_error : standard deviation of p_inf of the standard atmosphere at a stated altitude, relative [1].
    chi_square_scale, outlier_scale, shape_scale : factors on the alarm levels of chi-square, of the square of the
        largest leave-one-out residual and of the chi-square of the shapes, from data of an independent model [1].
    discrepancy_shapes : (n_d, n_s) strain of shapes of pressure off the tables, tested together [1]; None for
        none.
    considered_response : as ``response``, of a considered error that follows the flight state, at one standard
        deviation; None for none.
    pressure_field, shape_field : pressure on the surface over the flight state, of a body of revolution, and of
        any other shape; None where the map does not hold it.
    parameters : what flow parameters change; None where the map holds none.
    """

    mach_knots: FloatArray
    incidence_knots: FloatArray
    response: FloatArray
    fixed_response: FloatArray
    gauge_covariance: FloatArray
    error_strain: FloatArray
    error_load: FloatArray
    gauge_gain_std: float
    common_gain_std: float
    gauge_error_product: FloatArray
    common_error: FloatArray
    reference_area: float
    reference_length: float
    mach_range: FloatArray
    pressure_range: FloatArray
    incidence_limit: float
    mach_number_error: float
    static_pressure_error: float
    dynamic_pressure_error: float
    altitude_error: float = DEVIATION_OF_AIR
    chi_square_scale: float = 1.0
    outlier_scale: float = 1.0
    shape_scale: float = 1.0
    discrepancy_shapes: FloatArray | None = None
    considered_response: FloatArray | None = None
    considered_strain: FloatArray | None = None
    considered_load: FloatArray | None = None
    considered_common: FloatArray | None = None
    crossflow_range: FloatArray | None = None
    pressure_field: FlightField | None = field(default=None, metadata=inner_record(FlightField, FIELD_UNITS))
    shape_field: ShapeField | None = field(default=None, metadata=inner_record(ShapeField, SHAPE_UNITS))
    sensor_gain_std: FloatArray | None = None
    sensor_common_gain_std: FloatArray | None = None
    parameters: ParameterTables | None = field(
        default=None, metadata=inner_record(ParameterTables, PARAMETER_UNITS)
    )

    def __post_init__(self) -> None:
        (n_d, k), n_f = self.error_strain.shape, len(self.error_load)
        shapes = {
            "response": (*self.response.shape[:2], n_d + n_f, *self.response.shape[3:]),
            "fixed_response": (n_d + n_f,),
            "gauge_covariance": (n_d, n_d),
            "error_strain": (n_d, k),
            "error_load": (n_f, k),
            "gauge_error_product": (21, n_d),
            "common_error": (len(self.common_error), 6, n_d),
            "mach_range": (2,),
            "pressure_range": (2,),
        }
        if self.discrepancy_shapes is not None:
            shapes["discrepancy_shapes"] = (n_d, *self.discrepancy_shapes.shape[1:2])
        if self.considered_response is not None:
            shapes["considered_response"] = self.response.shape
        if self.considered_strain is not None:
            k = self.considered_strain.shape[1:2]
            shapes |= {"considered_strain": (n_d, *k), "considered_load": (n_f, *k)}
        if self.considered_common is not None:
            shapes["considered_common"] = (len(self.considered_common), 6, n_d)
        if self.crossflow_range is not None:
            shapes["crossflow_range"] = (2, 2)
        if self.sensor_gain_std is not None or self.sensor_common_gain_std is not None:
            shapes["sensor_gain_std"] = shapes["sensor_common_gain_std"] = (self.n_sensors,)
        for name, shape in shapes.items():
            value = getattr(self, name)
            if np.shape(value) != shape or not np.all(np.isfinite(value)):
                raise InputError(f"{name}: expected finite values of shape {shape}, got {np.shape(value)}")
        self._check_field()
        if self.parameters is not None:
            self.parameters.check(self.response.shape)
        held = None if self.shape_field is None else self.shape_field.parameters
        powers = None if self.parameters is None else self.parameters.powers
        if held is not None and (powers is None or len(held.unit_error) != len(powers.power)):
            raise InputError("shape_field: parameters: expected the parameters of the tables of strain")

    def _check_field(self) -> None:
        held = self.surface_field
        if held is None:
            return
        knots = (len(self.mach_knots) + 2, len(self.incidence_knots) + 2)
        found = held.amplitude.shape[:2], held.strain_covariance.shape[-1]
        if found != (knots, self.n_gauges):
            raise InputError(
                f"pressure_field: expected tables of {knots} for {self.n_gauges} gauges, "
                f"got {found[0]} for {found[1]}"
            )

    @property
    def surface_field(self) -> FlightField | ShapeField | None:
        """The pressure on the surface that the map holds, if any."""
        return self.pressure_field if self.shape_field is None else self.shape_field

    @property
    def n_gauges(self) -> int:
        """Number of gauges n_d."""
        return len(self.error_strain)

    @property
    def n_loads(self) -> int:
        """Number of loads n_f."""
        return len(self.error_load)

    @property
    def n_sensors(self) -> int:
        """Number of auxiliary sensors n_s."""
        return 0 if self.sensor_gain_std is None else len(self.sensor_gain_std)

    @cached_property
    def gain_std(self) -> FloatArray:
        """(n_d,) errors of each gain, relative [1]."""
        return self._of_rows(self.gauge_gain_std, self.sensor_gain_std)

    @cached_property
    def common_gain(self) -> FloatArray:
        """(n_d,) error that gains have in common, in each of them, relative [1]."""
        return self._of_rows(self.common_gain_std, self.sensor_common_gain_std)

    def _of_rows(self, of_gauges: float, of_sensors: FloatArray | None) -> FloatArray:
        rows = np.full(self.n_gauges, of_gauges)
        if of_sensors is not None and len(of_sensors):
            rows[-len(of_sensors) :] = of_sensors
        return rows

    @cached_property
    def tables(self) -> FlightTables:
        """Strain and the five loads over the flight state."""
        return self.tables_of(FIVE_LOADS.stop)

    def tables_of(self, n_loads: int) -> FlightTables:
        """Return strain and the first ``n_loads`` loads over the flight state."""
        n = self.n_gauges + n_loads
        return FlightTables(
            mach_knots=self.mach_knots,
            incidence_knots=self.incidence_knots,
            response=self.response[:, :, :n],
            fixed_response=self.fixed_response[:n],
            n_loads=n_loads,
        )

    @cached_property
    def considered_columns(self) -> FloatArray:
        """(n_d + n_f, k) strain and loads of considered errors that do not follow the state, k = 0 for none."""
        if self.considered_strain is None or self.considered_load is None:
            return np.zeros((self.n_gauges + self.n_loads, 0))
        return np.vstack([self.considered_strain, self.considered_load])

    @cached_property
    def considered_tables(self) -> FlightTables | None:
        """Strain and all loads of the considered error over the flight state; None for none."""
        if self.considered_response is None:
            return None
        tables = self.tables_of(self.n_loads)
        return replace(
            tables, response=self.considered_response, fixed_response=np.zeros_like(tables.fixed_response)
        )

    @cached_property
    def crossflow(self) -> Crossflow:
        """Middle and half width of the ranges of u and w."""
        if self.crossflow_range is None:
            return Crossflow(np.zeros(2), np.full(2, self.incidence_limit))
        low, high = self.crossflow_range.T
        return Crossflow(0.5 * (low + high), 0.5 * (high - low))

    @cached_property
    def state_prior(self) -> StatePrior:
        """The flight state where nothing is known: the middle of each range, and half of it.

        The standard deviation of u and w of a body of revolution is the largest incidence.
        """
        low, high = np.log(self.pressure_range)
        mean, std = np.empty(N_STATES), np.empty(N_STATES)
        mean[MACH], std[MACH] = self.mach_range.mean(), max(0.5 * np.ptp(self.mach_range), 0.1)
        mean[U : W + 1], std[U : W + 1] = self.crossflow
        mean[LOG_PRESSURE], std[LOG_PRESSURE] = 0.5 * (low + high), 0.5 * (high - low)
        return StatePrior(mean, std)

    @cached_property
    def shapes(self) -> FloatArray:
        """(n_d, n_s) ``discrepancy_shapes``, n_s = 0 for none."""
        none = np.zeros((self.n_gauges, 0))
        return none if self.discrepancy_shapes is None else self.discrepancy_shapes

    @cached_property
    def references(self) -> FloatArray:
        """(5,) S and S L [m2, m3] per coefficient."""
        length = self.reference_length
        return self.reference_area * np.array([1.0, 1.0, 1.0, length, length])

    @cached_property
    def scaled_covariance(self) -> FloatArray:
        """(n_d, n_d) of the errors that scale and the gain may correct, per p_inf^2 [1/Pa^2]."""
        return np.asarray(self.error_strain @ self.error_strain.T)

    @cached_property
    def load_strain_covariance(self) -> FloatArray:
        """(n_f, n_d) of their loads with their strain, per p_inf^2."""
        return np.asarray(self.error_load @ self.error_strain.T)

    @cached_property
    def load_covariance(self) -> FloatArray:
        """(n_f, n_f) of their loads, per p_inf^2."""
        return np.asarray(self.error_load @ self.error_load.T)


UNITS = {
    "incidence_knots": "rad",
    "response": "1/Pa, m2, m3",
    "considered_response": "1/Pa, m2, m3",
    "considered_strain": "1/Pa",
    "considered_load": "m2, m3",
    "considered_common": "1/Pa",
    "fixed_response": "m/m, N, N.m",
    "gauge_covariance": "(m/m)^2",
    "error_strain": "1/Pa",
    "error_load": "m2, m3",
    "gauge_error_product": "1/Pa^2",
    "common_error": "1/Pa",
    OF_AREA: "m2",
    OF_LENGTH: "m",
    "pressure_range": "Pa",
    "incidence_limit": "rad",
    "crossflow_range": "rad",
}
