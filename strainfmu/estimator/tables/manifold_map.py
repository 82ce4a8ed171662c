"""The nonlinear part of a map: tables over the flight state, and the errors of strain and loads about them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import DEVIATION_OF_AIR
from strainfmu.errors import InputError
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, N_STATES, FlightTables, U, W
from strainfmu.estimator.tables.parameter_tables import ParameterTables, known_powers
from strainfmu.estimator.tables.schema import (
    COVARIANCE,
    INCREASING,
    POSITIVE,
    RANGE,
    Sizes,
    check,
    described,
    entry,
)
from strainfmu.estimator.tables.surface_field import FlightField, ShapeField


class Crossflow(NamedTuple):
    """Middle and half width (2,) of the ranges of u and w [rad]."""

    middle: FloatArray
    half: FloatArray


class StatePrior(NamedTuple):
    """Mean and standard deviation (4,) of the flight state where nothing is known."""

    mean: FloatArray
    std: FloatArray


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class ManifoldMap:
    """Tables of the nonlinear estimator and their errors, for n_d gauges and the n_f loads of the map.

    Errors are per p_inf where they scale with the pressure level. Those in proportion to strain follow
    c = [1, loads / (p_inf S [1, 1, 1, L, L])].
    """

    # fmt: off
    mach_knots: FloatArray = entry("n_M", "1", "increasing", place="flight.mach_knots", rule=INCREASING)
    incidence_knots: FloatArray = entry("n_a", "rad", "total angles of attack from 0, increasing",
        place="flight.incidence_knots", rule=INCREASING)
    response: FloatArray = entry("n_M+2 n_a+2 n n_m 2", "1/Pa, m2, m3",
        "spline coefficients of n_d strains, then n_f loads over the flight state, per p_inf")
    fixed_response: FloatArray = entry("n", "m/m, N, N.m", "part of these that does not follow p_inf")
    gauge_covariance: FloatArray = entry("n_d n_d", "(m/m)^2",
        "of what does not scale, as gauge noise and apparent strain", place="flight.gauge_covariance",
        rule=COVARIANCE)
    error_strain: FloatArray = entry("n_d k", "1/Pa",
        "errors that the gain may correct, as of the internal pressure, per standard deviation and per p_inf")
    error_load: FloatArray = entry("n_f k", "m2, m3", "the same of loads")
    gauge_gain_std: float = entry(meaning="error of each gauge's gain, relative")
    common_gain_std: float = entry(meaning="error of all gains together, relative")
    gauge_error_product: FloatArray = entry("21 n_d", "1/Pa^2",
        "sum over errors of each gauge of D_a D_b, doubled for a < b", place="flight.gauge_error_product")
    common_error: FloatArray = entry("n_e 6 n_d", "1/Pa",
        "errors that all gauges have in common, per p_inf and c_a, that the gain may correct",
        place="flight.common_error")
    reference_area: float = entry(unit="m2", meaning="S", place="flight.reference_area", rule=POSITIVE)
    reference_length: float = entry(unit="m", meaning="L", place="flight.reference_length", rule=POSITIVE)
    mach_range: FloatArray = entry("2", "1", "M that the map holds for", place="flight.mach_range", rule=RANGE,
        kind="values")
    pressure_range: FloatArray = entry("2", "Pa", "p_inf that the map holds for", place="flight.pressure_range",
        rule=RANGE, kind="values")
    incidence_limit: float = entry(unit="rad", meaning="largest total angle of attack that it holds for",
        place="flight.incidence_limit", rule=POSITIVE)
    mach_number_error: float = entry(meaning="standard deviation of a stated Mach number without its own")
    static_pressure_error: float = entry(meaning="the same of p_inf, relative")
    dynamic_pressure_error: float = entry(meaning="the same of q_inf, relative")
    altitude_error: float = entry(
        meaning="standard deviation of p_inf of the standard atmosphere at a stated altitude, relative",
        default=DEVIATION_OF_AIR, place="flight.altitude_error")
    chi_square_scale: float = entry(
        meaning="factor on the detection threshold of chi-square, from data of a truth model", default=1.0,
        place="flight.chi_square_scale")
    outlier_scale: float = entry(meaning="the same on the square of the largest leave-one-out residual",
        default=1.0, place="flight.outlier_scale")
    shape_scale: float = entry(meaning="the same on the chi-square of the discrepancy modes", default=1.0)
    discrepancy_shapes: FloatArray | None = entry("n_d n_s", "1",
        "strain of discrepancy modes, tested together; None for none", default=None)
    considered_response: FloatArray | None = entry("n_M+2 n_a+2 n n_m 2", "1/Pa, m2, m3",
        "as response, of a considered error that follows the state, at one standard deviation; None for none",
        default=None)
    considered_strain: FloatArray | None = entry("n_d k_considered", "1/Pa",
        "errors that the gain may not correct: they count in covariances and alarms alone (considered parameters, "
        "Schmidt 1966); None for none",
        default=None)
    considered_load: FloatArray | None = entry("n_f k_considered", "m2, m3", "the same of loads", default=None)
    considered_common: FloatArray | None = entry("n_c 6 n_d", "1/Pa", "the same of common_error", default=None)
    crossflow_range: FloatArray | None = entry("2 2", "rad",
        "smallest and largest u and w that it holds for; None for every aerodynamic roll angle", default=None)
    pressure_field: FlightField | None = entry(unit="", meaning="pressure on the surface of a body of revolution",
        default=None, record=FlightField)
    shape_field: ShapeField | None = entry(unit="", meaning="the same of any other shape", default=None,
        record=ShapeField)
    sensor_gain_std: FloatArray | None = entry("n_aux", "1",
        "gauge_gain_std of the auxiliary sensors, the last of the gauges; None for none", default=None)
    sensor_common_gain_std: FloatArray | None = entry("n_aux", "1", "common_gain_std of these", default=None)
    parameters: ParameterTables | None = entry(unit="", meaning="what flow parameters change; None for nothing",
        default=None, record=ParameterTables)
    # fmt: on

    def __post_init__(self) -> None:
        n_d, n_f = len(self.error_strain), len(self.error_load)
        sizes: Sizes = {"n_d": n_d, "n_f": n_f, "n": n_d + n_f, "n_aux": self.n_sensors}
        sizes |= {"n_M": len(self.mach_knots), "n_a": len(self.incidence_knots), "k": self.error_strain.shape[-1]}
        check(self, "manifold", **sizes)
        amplitude = None if self.surface_field is None else self.surface_field.amplitude
        if amplitude is not None and amplitude.shape[:2] != self.response.shape[:2]:
            raise InputError(
                f"pressure_field: expected tables of {self.response.shape[:2]}, got {amplitude.shape[:2]}"
            )
        if self.surface_field is not None and self.surface_field.strain_covariance.shape[-1] != n_d:
            raise InputError(
                f"pressure_field: expected {n_d} gauges, got {self.surface_field.strain_covariance.shape[-1]}"
            )
        if self.parameters is not None:
            self.parameters.check(self.response.shape)
        of_field = None if self.shape_field is None else self.shape_field.parameters
        powers = None if self.parameters is None else self.parameters.powers
        if of_field is not None and (powers is None or len(of_field.unit_error) != len(powers.power)):
            raise InputError("shape_field: parameters: expected the parameters of the tables of strain")

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


def with_known(manifold: ManifoldMap, value: FloatArray, std: FloatArray) -> ManifoldMap:
    """Return the tables and errors of ``manifold`` where parameters are known; the pressure on the surface stays
    as it is, see :func:`~strainfmu.estimator.tables.surface_field.field_with_known`.

    Parameters
    ----------
    value, std : (n_p,) of each parameter and its standard deviation, NaN of what is not known; ``manifold`` itself
        where nothing is.
    """
    tables = manifold.parameters
    if not np.any(np.isfinite(value) & np.isfinite(std)):
        return manifold
    assert tables is not None
    known = known_powers(tables.powers, value, std)
    errors = [tables.error, *known.errors(tables.unit_error, tables.spread_error)]
    return _changed(manifold, np.tensordot(tables.slope, known.shift, axes=(2, 0)), np.hstack(errors))


def _changed(manifold: ManifoldMap, change: FloatArray, errors: FloatArray) -> ManifoldMap:
    """Return ``manifold`` with ``change`` (n_M + 2, n_a + 2, n, n_m, 2) added to its tables, and ``errors``
    (n, k) per p_inf instead of its own."""
    n_d = manifold.n_gauges
    return replace(
        manifold, response=manifold.response + change, error_strain=errors[:n_d], error_load=errors[n_d:]
    )
