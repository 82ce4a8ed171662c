"""The nonlinear part of a map: tables over the flight state, what flow parameters change of them, and errors.

**Flow parameters**, such as deflections. Strain and loads are y(x) + p_inf sum_j (z^j - offset_j) s_j(x): z the
parameter less its mean, over its spread in the snapshots, s_j tables over the flight state. A value that is stated
with a standard deviation counts together with the spread, both taken as normal.

**Pressure on the surface.** On a body of revolution the pressure at station x and roll angle phi is
p = p_inf sum_m P_m(x; M, a_T) cos m(phi - phi_T), on any other shape p = p_inf (1 + V c(x)) at the nodes, c the
tables of amplitudes of modes V. A residual r = d - y(x) of strain corrects it as it corrects the loads:
p + C S^-1 r, C the covariance of pressure off the tables with its strain.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.atmosphere import DEVIATION_OF_AIR
from strainfmu.estimator.health import chi_square_limit
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, FlightTables, U, W
from strainfmu.estimator.map.schema import COVARIANCE, FROM_0, INCREASING, POSITIVE, RANGE, MapRecord, Sizes, entry
from strainfmu.estimator.other_loads import FIVE_LOADS


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Powers(MapRecord, where="powers"):
    """J powers of n_p parameters."""

    # fmt: off
    mean: FloatArray = entry("n_p", "", "of the parameters over the snapshots", place="parameter_tables.mean")
    spread: FloatArray = entry("n_p", "", "the same, 0 where they hold one value", place="parameter_tables.spread",
        rule=FROM_0)
    parameter: IntArray = entry("J", "", "parameter of each power, ascending", place="parameter_tables.parameter")
    power: IntArray = entry("J", "", "exponent of each power, 1 to 3", place="parameter_tables.power")
    offset: FloatArray = entry("J", "1", "mean of each power over the snapshots", place="parameter_tables.offset")
    # fmt: on

    def change(self, values: FloatArray, remaining: FloatArray | float = 0.0) -> FloatArray:
        """Return (k, J) each power of ``values`` (k, n_p), less its mean [1].

        ``remaining`` (n_p,) are variances of z about the values; powers up to 3 are those expected.
        """
        z, power = self._scaled(values), self.power
        variance = np.broadcast_to(remaining, self.mean.shape)[self.parameter]
        pairs = 0.5 * power * (power - 1) * variance
        return np.asarray(z**power + pairs * z ** np.maximum(power - 2, 0) - self.offset)

    def known(self, value: FloatArray, std: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what is known of the powers; ``value`` and ``std`` as of :func:`with_known`.

        These are (J,) each power that is known, less its mean [1], (n_p,) the weight of each stated value against
        the spread, 0 where nothing is known, and (J,) the derivative of each power by z there.
        """
        variance = self.spread**2
        known = np.isfinite(value) & np.isfinite(std) & (variance > 0.0)
        with np.errstate(over="ignore"):  # of a deviation so large that nothing is known
            weight = np.where(known, variance / np.where(known, variance + std**2, 1.0), 0.0)
        middle = (self.mean + weight * np.where(known, value - self.mean, 0.0))[None]
        shift = np.where(known[self.parameter], self.change(middle, 1.0 - weight)[0], 0.0)
        return shift, weight, self.power * self._scaled(middle)[0] ** (self.power - 1)

    def remaining_errors(
        self, weight: FloatArray, derivative: FloatArray, unit_error: FloatArray, spread_error: FloatArray
    ) -> list[FloatArray]:
        """Return the columns (n, k) that are left of the errors of one unit of each power (J, n, k) and of the
        spread of each parameter (n_p, n, k); ``weight`` and ``derivative`` are of :meth:`known`.

        What a standard deviation leaves is in proportion to it about a value well known, and the spread of one
        that is not.
        """
        columns = []
        for parameter, part in enumerate(weight.tolist()):
            powers = self.parameter == parameter
            by_std = derivative[powers] * np.sqrt(part * (1.0 - part))
            columns += [np.tensordot(by_std, unit_error[powers], 1), (1.0 - part) * spread_error[parameter]]
        return columns

    def _scaled(self, values: FloatArray) -> FloatArray:
        z = (values - self.mean) / np.where(self.spread > 0.0, self.spread, 1.0)
        return np.asarray(z[:, self.parameter])


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ParameterTables(MapRecord, where="parameter tables"):
    """Tables of n rows by J powers of n_p parameters: strains, then all loads."""

    # fmt: off
    powers: Powers = entry(unit="", meaning="of the parameters", record=Powers)
    slope: FloatArray = entry("n_M+2 n_a+2 J n n_m 2", "1/Pa, m2, m3",
        "spline coefficients per p_inf, on the knots of the tables of strain")
    unit_error: FloatArray = entry("J n k_unit", "1/Pa, m2, m3",
        "errors per p_inf and unit of a power, over the states of the snapshots")
    spread_error: FloatArray = entry("n_p n k_spread", "1/Pa, m2, m3",
        "errors per p_inf of a parameter that is not known")
    error: FloatArray = entry("n k_rest", "1/Pa, m2, m3", "the other errors of the map, per p_inf")
    # fmt: on


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class FlightField(MapRecord, where="pressure_field"):
    """Pressure at n_x stations times n_roll roll angles; node = station number * n_roll + roll number."""

    # fmt: off
    station: FloatArray = entry("n_x", "m", "of the nodes")
    radius: FloatArray = entry("n_x", "m", "outer radius")
    roll_angle: FloatArray = entry("n_roll", "rad", "from +z towards +y")
    amplitude: NDArray[np.float32] = entry("n_M+2 n_a+2 n_x n_m", "1",
        "spline coefficients of P_m, on the knots of the tables")
    strain_covariance: NDArray[np.float32] = entry("n_x n_h 2 n_d", "1/Pa",
        "C with strain of pressure off the tables, per p_inf^2: cosine and sine of m phi")
    error_std: FloatArray = entry("n_x", "1",
        "standard deviation of pressure off the tables at any roll angle, per p_inf")
    table_error_std: NDArray[np.float32] = entry("n_x n_roll", "1",
        "the same of interpolation and of higher harmonics, at phi - phi_T")
    # fmt: on

    @property
    def n_nodes(self) -> int:
        """Number of nodes n_p."""
        return len(self.station) * len(self.roll_angle)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class FieldParameters(MapRecord, where="shape_field: parameters"):
    """What J powers of n_p flow parameters change of the amplitudes of n_v modes."""

    # fmt: off
    slope: NDArray[np.float32] = entry("n_M+2 n_a+2 J n_v n_m 2", "1", "spline coefficients per unit of a power")
    unit_error: FloatArray = entry("J n_v k_unit", "1",
        "errors per unit of a power, over the states of the snapshots")
    spread_error: FloatArray = entry("n_p n_v k_spread", "1",
        "errors of a parameter that is not known, part of the field's own")
    strain: FloatArray = entry("n_d n_v", "1/Pa", "strain of each mode, per p_inf")
    # fmt: on


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ShapeField(MapRecord, where="shape_field"):
    """Pressure at the n_p nodes of the map."""

    # fmt: off
    modes: NDArray[np.float32] = entry("n_p n_v", "1", "of p / p_inf - 1")
    amplitude: FloatArray = entry("n_M+2 n_a+2 n_v n_m 2", "1",
        "spline coefficients of their amplitudes, on the knots of the tables")
    strain_covariance: NDArray[np.float32] = entry("n_p n_d", "1/Pa",
        "C with strain of pressure off the tables, per p_inf^2")
    error_std: FloatArray = entry("n_p", "1", "standard deviation of pressure off the tables, per p_inf")
    parameters: FieldParameters | None = entry(unit="", meaning="what flow parameters change; None for nothing",
        default=None, record=FieldParameters)
    # fmt: on

    @property
    def n_nodes(self) -> int:
        """Number of nodes n_p."""
        return len(self.modes)


OUTSIDE_SCORE, OUTSIDE_SCORE_OF_SHAPES = 3.0, 2.0
"""Standard deviations by which the flight state leaves the ranges of the map from which it is outside.

The second holds where angle of attack and sideslip have ranges of their own: these are a few degrees wide, few
standard deviations of the angles. At the very end of a range it takes 1 good flight in 44 for one outside, if
errors are as large as stated.
"""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ManifoldMap(MapRecord, where="manifold"):
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
    discrepancy_shapes: FloatArray = entry("n_d n_s", "1", "strain of discrepancy modes, tested together",
        neutral=0.0)
    considered_response: FloatArray | None = entry("n_M+2 n_a+2 n n_m 2", "1/Pa, m2, m3",
        "as response, of a considered error that follows the state, at one standard deviation; None for none",
        default=None)
    considered_strain: FloatArray = entry("n_d k_considered", "1/Pa",
        "errors that the gain may not correct: they count in covariances and alarms alone (considered parameters, "
        "Schmidt 1966)", neutral=0.0)
    considered_load: FloatArray = entry("n_f k_considered", "m2, m3", "the same of loads", neutral=0.0)
    considered_common: FloatArray = entry("n_c 6 n_d", "1/Pa", "the same of common_error", neutral=0.0)
    crossflow_range: FloatArray | None = entry("2 2", "rad",
        "smallest and largest u and w that it holds for; None for every aerodynamic roll angle", default=None)
    pressure_field: FlightField | None = entry(unit="", meaning="pressure on the surface of a body of revolution",
        default=None, record=FlightField)
    shape_field: ShapeField | None = entry(unit="", meaning="the same of any other shape", default=None,
        record=ShapeField)
    sensor_gain_std: FloatArray = entry("n_aux", "1",
        "gauge_gain_std of the auxiliary sensors, the last of the gauges", neutral=0.0)
    sensor_common_gain_std: FloatArray = entry("n_aux", "1", "common_gain_std of these", neutral=0.0)
    parameters: ParameterTables | None = entry(unit="", meaning="what flow parameters change; None for nothing",
        default=None, record=ParameterTables)
    # fmt: on

    def sizes(self) -> Sizes:
        """Return the numbers of gauges and loads; tables have a row for each."""
        return {"n_d": self.n_gauges, "n_f": self.n_loads, "n": self.n_gauges + self.n_loads}

    def contradictions(self) -> Iterator[str]:
        """Yield what is wrong with tables of flow parameters."""
        if self.parameters is None and self.shape_field is not None and self.shape_field.parameters is not None:
            yield "shape_field: parameters: expected the parameters of the tables of strain"

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
    def outside_score(self) -> float:
        """Range score from which a flight is outside."""
        return OUTSIDE_SCORE if self.crossflow_range is None else OUTSIDE_SCORE_OF_SHAPES

    @property
    def shape_limit(self) -> float:
        """Detection threshold of the chi-square of the discrepancy modes."""
        return self.shape_scale * chi_square_limit(max(self.discrepancy_shapes.shape[1], 1))

    @cached_property
    def gain_std(self) -> FloatArray:
        """(n_d,) errors of each gain, relative [1]."""
        return self._of_rows(self.gauge_gain_std, self.sensor_gain_std)

    @cached_property
    def common_gain(self) -> FloatArray:
        """(n_d,) error that gains have in common, in each of them, relative [1]."""
        return self._of_rows(self.common_gain_std, self.sensor_common_gain_std)

    def _of_rows(self, of_gauges: float, of_sensors: FloatArray) -> FloatArray:
        return np.append(np.full(self.n_gauges - len(of_sensors), of_gauges), of_sensors)

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
        )

    @cached_property
    def considered_columns(self) -> FloatArray:
        """(n_d + n_f, k) strain and loads of considered errors that do not follow the state, k = 0 for none."""
        return np.vstack([self.considered_strain, self.considered_load])

    @cached_property
    def considered_tables(self) -> FlightTables | None:
        """Strain and all loads of the considered error over the flight state; None for none."""
        response, fixed = self.considered_response, np.zeros_like(self.fixed_response)
        whole = self.tables_of(self.n_loads)
        return None if response is None else replace(whole, response=response, fixed_response=fixed)

    @cached_property
    def crossflow(self) -> tuple[FloatArray, FloatArray]:
        """Middle and half width (2,) of the ranges of u and w [rad]."""
        if self.crossflow_range is None:
            return np.zeros(2), np.full(2, self.incidence_limit)
        low, high = self.crossflow_range.T
        return 0.5 * (low + high), 0.5 * (high - low)

    @cached_property
    def state_prior(self) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation (4,) of a state of which nothing is known: middle and half of each range.

        The standard deviation of u and w of a body of revolution is the largest incidence.
        """
        low, high = np.log(self.pressure_range)
        mean, std = np.empty(N_STATES), np.empty(N_STATES)
        mean[MACH], std[MACH] = self.mach_range.mean(), max(0.5 * np.ptp(self.mach_range), 0.1)
        mean[U : W + 1], std[U : W + 1] = self.crossflow
        mean[LOG_PRESSURE], std[LOG_PRESSURE] = 0.5 * (low + high), 0.5 * (high - low)
        return mean, std

    @cached_property
    def references(self) -> FloatArray:
        """(5,) S and S L [m2, m3] per coefficient."""
        length = self.reference_length
        return self.reference_area * np.array([1.0, 1.0, 1.0, length, length])

    @cached_property
    def scaled_covariance(self) -> FloatArray:
        """(n_d, n_d) of the errors that scale and the gain may correct, per p_inf^2 [1/Pa^2]."""
        return np.asarray(self.error_strain @ self.error_strain.T)


def with_known(manifold: ManifoldMap, value: FloatArray, std: FloatArray) -> ManifoldMap:
    """Return ``manifold`` where parameters are known: tables, errors, and the pressure on nodes of any shape.

    The errors of the pressure are less by the errors of the parameters' spread, and hold what is left.

    Parameters
    ----------
    value, std : (n_p,) of each parameter and its standard deviation, NaN of what is not known; ``manifold`` itself
        where nothing is.
    """
    tables, surface = manifold.parameters, manifold.shape_field
    if not np.any(np.isfinite(value) & np.isfinite(std)):
        return manifold
    assert tables is not None
    powers, n_d = tables.powers, manifold.n_gauges
    shift, weight, derivative = powers.known(value, std)
    columns = powers.remaining_errors(weight, derivative, tables.unit_error, tables.spread_error)
    errors = np.hstack([tables.error, *columns])
    response = manifold.response + np.tensordot(tables.slope, shift, axes=(2, 0))
    if surface is not None and surface.parameters is not None:
        changes, modes = surface.parameters, surface.modes.astype(float)
        spread = np.hstack([*changes.spread_error])
        columns = powers.remaining_errors(weight, derivative, changes.unit_error, changes.spread_error)
        remaining = np.hstack(columns)
        change = modes @ (remaining @ remaining.T - spread @ spread.T)
        variance = surface.error_std**2 + np.einsum("pq,pq->p", change, modes)
        surface = replace(
            surface,
            amplitude=surface.amplitude + np.tensordot(changes.slope, shift, axes=(2, 0)),
            strain_covariance=(surface.strain_covariance + change @ changes.strain.T).astype(np.float32),
            # Where the spread is nearly all of it, rounding leaves less.
            error_std=np.sqrt(np.maximum(variance, 0.0)),
            parameters=None,
        )
    return replace(
        manifold, response=response, error_strain=errors[:n_d], error_load=errors[n_d:], shape_field=surface
    )
