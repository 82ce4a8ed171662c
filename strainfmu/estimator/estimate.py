"""The result of an estimator, of one sample or of k samples: every number by name, made when it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray, IntArray, component, float_or_array
from strainfmu.errors import InputError
from strainfmu.estimator.air_data import AirData
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.notebook import html_table
from strainfmu.estimator.other_loads import SECTIONS, LoadGroup, names_of, rows_of
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY, COEFFICIENT_NAMES, LOAD_NAMES, LOAD_UNITS, VALID

if TYPE_CHECKING:
    from pandas import DataFrame

    from strainfmu.estimator.core import Core
    from strainfmu.estimator.map.validity import FlowParameters


class Source(Protocol):
    """What an estimate reads of the estimator that made it."""

    core: Core
    is_nonlinear: bool
    parameters: FlowParameters
    gauge_names: tuple[str, ...]
    section_station: FloatArray
    load_groups: tuple[LoadGroup, ...]

    def pressure_of(self, estimate: Estimate, with_std: bool = True) -> PressureField: ...

    def other_loads_of(self, estimate: Estimate) -> FloatArray: ...


class NamedLoads:
    """Loads and coefficients by name, a float of one sample and (k,) of k: the last axis of ``loads`` and
    ``coefficients`` (.., 5), and of the other ones (.., m), the first of which is the rolling moment."""

    loads: FloatArray
    coefficients: FloatArray
    other_loads: FloatArray
    other_coefficients: FloatArray

    axial_force = component("loads", 0, "F_x [N], positive aft, of the fore-body.")
    normal_force = component("loads", 1, "F_z [N], positive up.")
    side_force = component("loads", 2, "F_y [N], positive to starboard.")
    pitching_moment = component("loads", 3, "Moment about y [N m], positive nose-up.")
    yawing_moment = component("loads", 4, "Moment about z [N m], positive nose to starboard.")
    C_A = component(COEFFICIENT_ARRAY, 0, "Coefficient of the axial force [1].")
    C_N = component(COEFFICIENT_ARRAY, 1, "Coefficient of the normal force [1].")
    C_Y = component(COEFFICIENT_ARRAY, 2, "Coefficient of the side force [1].")
    M_P = component(COEFFICIENT_ARRAY, 3, "Coefficient of the pitching moment [1].")
    M_Y = component(COEFFICIENT_ARRAY, 4, "Coefficient of the yawing moment [1].")
    rolling_moment = component(
        "other_loads",
        0,
        "Moment about x [N m], positive with starboard going down; known to be zero for a body of revolution.",
    )
    M_R = component("other_coefficients", 0, "Coefficient of the rolling moment [1], C_l of the literature.")


@dataclass(frozen=True, eq=False)
class Sigma(NamedLoads):
    """Standard deviations by name: of the ``loads`` (.., 5) [N, N m], of the ``coefficients`` (.., 5) [1], and of
    the other loads (.., m)."""

    loads: FloatArray
    coefficients: FloatArray
    other_loads: FloatArray
    other_coefficients: FloatArray


@dataclass(frozen=True, eq=False)
class GroupLoads:
    """One load at n places: the axial force of every section, for example.

    Attributes
    ----------
    places : n texts, as in the descriptions of an FMU's outputs; one empty text of the whole body.
    loads, std : (.., n) loads and their standard deviations [N, N m].
    coefficients, coefficients_std : (.., n) loads over q_inf S, moments over q_inf S L, and standard deviations
        [1].
    """

    places: tuple[str, ...]
    loads: FloatArray
    std: FloatArray
    coefficients: FloatArray
    coefficients_std: FloatArray


@dataclass(frozen=True, eq=False)
class SectionLoads:
    """Loads of n_s sections along the body, of the air on the part ahead of each of them.

    Attributes
    ----------
    station : (n_s,) x of the sections [m].
    loads : (.., n_s, 6) axial force, normal and side shear [N], pitch and yaw bending moment, torsion [N m].
    std : (.., n_s, 6) their standard deviations.
    """

    station: FloatArray
    loads: FloatArray
    std: FloatArray

    axial = component("loads", 0, "(.., n_s) axial force [N], positive aft.")
    normal_shear = component("loads", 1, "(.., n_s) shear force along z [N], positive up.")
    side_shear = component("loads", 2, "(.., n_s) shear force along y [N], positive to starboard.")
    pitch_bending = component("loads", 3, "(.., n_s) bending moment about y [N m], positive nose-up.")
    yaw_bending = component("loads", 4, "(.., n_s) bending moment about z [N m], positive nose to starboard.")
    torsion = component("loads", 5, "(.., n_s) torsion moment about x [N m], positive with starboard going down.")


@dataclass(frozen=True, eq=False)
class TurnedCoefficients:
    """Drag, side force and lift coefficient [1], (.., 3), and their standard deviations.

    The wind seen by the body is V (cos a cos b, -sin b, sin a cos b). Drag acts along it, lift upward in the plane
    of symmetry and normal to it, the wind-axis side force to starboard and normal to both. Stability axes are the
    wind axes of b = 0: their side force is the body's.
    """

    values: FloatArray
    std: FloatArray

    C_D = component("values", 0, "Drag coefficient [1], positive along the wind.")
    C_S = component("values", 1, "Side force coefficient [1] of these axes, positive to starboard.")
    C_L = component("values", 2, "Lift coefficient [1], positive up.")


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureField:
    """Pressure at the n_p nodes of a map, ``point`` and ``triangle`` of the map.

    Attributes
    ----------
    pressure : (n_p,) [Pa]; NaN where the estimate holds no loads.
    std : (n_p,) standard deviation of each node [Pa].
    is_net : whether ``pressure`` is p - p_inf, as of a linear map whose internal pressure is the ambient one.
    """

    pressure: FloatArray
    std: FloatArray
    is_net: bool


class _Value(property):
    """A value of an estimate, described by a text; ``read`` returns it of the estimate and the property's name."""

    def __init__(self, text: str, read: Callable[[Any, str], Any]) -> None:
        self._text, self._of = text, read

    def __set_name__(self, owner: type[Any], name: str) -> None:
        super().__init__(lambda estimate: self._of(estimate, name))
        self.__doc__ = self._text  # a subclass has its own text otherwise


def _output(text: str, kind: type[Any] | None = None) -> Any:
    """Return an output, an array or a number of ``kind``."""
    return _Value(
        text, lambda estimate, name: estimate._field(name) if kind is None else estimate._number(name, kind)
    )


def _of_fit(text: str, kind: type[Any] | None = None, *, order: int = 0) -> Any:
    """Return a value of the fit, as :func:`_output`; a matrix of ``order`` above 0."""

    def read(estimate: Estimate, name: str) -> Any:
        values = estimate._fit(name)
        if order:
            return values.reshape(*values.shape[:-1], order, order)
        return values if kind is None else estimate._as(values[..., 0], kind)

    return _Value(text, read)


_OTHERS = ("other_loads", "other_loads_std", "other_coefficients", "other_coefficients_std")


def _other(text: str) -> Any:
    """Return a value of the loads behind the five, which the core of some maps does not have."""
    return _Value(text, lambda estimate, name: estimate._others[_OTHERS.index(name)])


class Estimate(NamedLoads):
    """Loads, coefficients, air data and health of one sample or of k samples.

    Of k samples every array has a first axis of length k more than below, ``len(estimate)`` is k and
    ``estimate[i]`` is the estimate of sample i. Of a gauge that is not ``valid``, no number depends on its strain.
    """

    def __init__(
        self,
        record: FloatArray,
        estimator: Source,
        inputs: FloatArray,
        mask: BoolArray | None,
        make_fit: Callable[[FloatArray, BoolArray | None], FloatArray] | None = None,
    ) -> None:
        """Wrap ``record`` (n,) or (k, n) of ``estimator``, of the samples ``inputs`` and ``mask``.

        ``make_fit`` makes the record with the fit behind it of the samples; None where ``record`` has it.
        """
        self._record, self._estimator = record, estimator
        self._inputs, self._mask, self._make_fit = inputs, mask, make_fit

    def _field(self, name: str) -> FloatArray:
        return np.asarray(self._record[..., self._estimator.core.outputs[name]])

    @cached_property
    def _fit_record(self) -> FloatArray:
        return self._record if self._make_fit is None else self._make_fit(self._inputs, self._mask)

    def _fit(self, name: str) -> FloatArray:
        return np.asarray(self._fit_record[..., self._estimator.core.fit[name]])

    @cached_property
    def _others(self) -> Sequence[FloatArray]:
        values = [self._field(name) for name in _OTHERS]
        return values if values[0].shape[-1] else [*self._estimator.other_loads_of(self)]

    def _number(self, name: str, kind: type[Any]) -> Any:
        """Return a field of one number as a ``kind``, of k samples as (k,)."""
        return self._as(self._record[..., self._estimator.core.outputs[name].start], kind)

    def _as(self, values: FloatArray, kind: type[Any]) -> Any:
        return values.astype(np.int64 if kind is int else kind, copy=False) if self.is_series else kind(values)

    @property
    def sample(self) -> FloatArray:
        """(n_inputs,) record of the sample, in the layout ``core.inputs`` of the estimator; (k, n_inputs) of k."""
        return self._inputs

    @property
    def mask(self) -> BoolArray | None:
        """(n_d,) or (k, n_d) sensors that were not left out by the caller; None for all."""
        return self._mask

    @property
    def is_series(self) -> bool:
        """Whether this is an estimate of k samples, not of one."""
        return self._record.ndim == 2

    def __len__(self) -> int:
        if not self.is_series:
            raise TypeError("the estimate of one sample has no length")
        return len(self._record)

    def __getitem__(self, sample: int | slice | IntArray) -> Estimate:
        """Return the estimate of one sample of k, or of some of them."""
        if not self.is_series:
            raise TypeError("the estimate of one sample has no parts")
        mask = self._mask if self._mask is None or self._mask.ndim == 1 else self._mask[sample]
        record, make = self._record[sample], self._make_fit
        if make is not None and (record.ndim == 1 or "_fit_record" in self.__dict__):

            def make(*_: object) -> FloatArray:
                return self._fit_record[sample]

        return Estimate(record, self._estimator, self._inputs[sample], mask, make)

    def __iter__(self) -> Iterator[Estimate]:
        return (self[sample] for sample in range(len(self)))

    # Loads and coefficients; names of each are those of NamedLoads.

    loads: FloatArray = _output(
        "(5,) forces and moments [N, N, N, N m, N m], order of ``LOAD_NAMES``; NaN where they cannot be known."
    )
    loads_std: FloatArray = _output("(5,) their standard deviations.")
    coefficients: FloatArray = _output("(5,) C_A, C_N, C_Y, M_P, M_Y [1]; NaN where they cannot be computed.")
    coefficients_std: FloatArray = _output("(5,) their standard deviations [1].")

    @property
    def sigma(self) -> Sigma:
        """Standard deviations by name: ``estimate.sigma.C_N``."""
        return Sigma(self.loads_std, self.coefficients_std, self.other_loads_std, self.other_coefficients_std)

    load_covariance: FloatArray = _of_fit("(5, 5) covariance of the loads [(N, N m)^2].", order=5)
    coefficient_covariance: FloatArray = _of_fit("(5, 5) covariance of the coefficients [1].", order=5)

    # Loads behind the five; of a map without any the rolling moment is zero.

    other_loads: FloatArray = _other("(m,) loads behind the five [N, N m], in the order of :attr:`load_groups`.")
    other_loads_std: FloatArray = _other("(m,) standard deviations of :attr:`other_loads`.")
    other_coefficients: FloatArray = _other("(m,) :attr:`other_loads` over q S, moments over q S L [1].")
    other_coefficients_std: FloatArray = _other("(m,) standard deviations of :attr:`other_coefficients` [1].")

    @property
    def load_groups(self) -> tuple[LoadGroup, ...]:
        """What the loads behind the five are: rolling moment, and what else the map gives at which places."""
        return self._estimator.load_groups

    def group(self, name: str) -> GroupLoads:
        """Return a load behind the five by name, ``rolling_moment`` or ``section.axial``, at all its places.

        Raises
        ------
        InputError
            The map gives no such load.
        """
        groups = {group.load.name: group for group in self.load_groups}
        if name not in groups:
            raise InputError(f"group: expected one of {', '.join(groups)}, got '{name}'")
        values = (self.other_loads, self.other_loads_std, self.other_coefficients, self.other_coefficients_std)
        return GroupLoads(groups[name].places, *(value[..., groups[name].rows] for value in values))

    @property
    def section_station(self) -> FloatArray:
        """(n_s,) x of the sections [m]."""
        return self._estimator.section_station

    @property
    def section_loads(self) -> SectionLoads:
        """Loads of the sections of the map, (n_s, 6), and their standard deviations."""
        stations = self.section_station
        shape = (*self.other_loads.shape[:-1], len(SECTIONS.loads), len(stations))
        rows = rows_of(self.load_groups, SECTIONS)
        loads, std = (
            np.swapaxes(values[..., rows].reshape(shape), -1, -2)
            for values in (self.other_loads, self.other_loads_std)
        )
        return SectionLoads(stations, loads, std)

    load_factor: FloatArray = _output(
        "(3,) axial, normal, side force over the weight of the vehicle; none where the map states no mass."
    )

    # Health, and what it rests on.

    @property
    def health(self) -> Any:
        """State of the estimate, a :class:`HealthState`; of k samples its numbers (k,)."""
        state = self._number("health", int)
        return state if self.is_series else HealthState(state)

    usable = _output(
        "Whether loads may be used with their standard deviations: OK and DEGRADED; of k samples (k,).", bool
    )
    chi_square = _output(
        "Chi-square of the residual of the valid gauges and, of nonlinear maps, of the air data used [1].", float
    )
    chi_square_limit = _output(
        "Detection threshold of chi-square, times ``alarm_scale``; infinite where nothing checks the estimate.",
        float,
    )
    degrees_of_freedom = _output("Degrees of freedom of chi-square; 0 where nothing checks the estimate.", int)
    iterations = _output(
        "Gauss-Newton iterations of the nonlinear estimator in this sample; 0 of the linear one.", int
    )
    envelope_score = _output(
        "Standard deviations by which the estimate leaves the envelope of the map; 0 inside, NaN if not known.",
        float,
    )
    valid_gauges = _output("Number of sensors that were used.", int)

    @property
    def valid(self) -> BoolArray:
        """(n_d,) sensors that were used."""
        return np.asarray(self._fit(VALID) != 0.0)

    standardised_residual: FloatArray = _of_fit(
        "(n_d,) z, standard normal where a sensor fits the others; 0 where no other checks it."
    )
    residual_limit = _of_fit("Detection threshold of the largest \\|z\\|.", float)

    @property
    def suspects(self) -> Any:
        """Sensors, by index, that the largest \\|z\\| points to, none below its detection threshold; more than one
        where they cannot be distinguished. Of k samples an array (k,) of tuples."""
        suspect = self._fit("is_suspect") != 0.0
        if not self.is_series:
            return tuple(np.flatnonzero(suspect).tolist())
        return _tuples([tuple(np.flatnonzero(row).tolist()) if row.any() else () for row in suspect])

    @property
    def residuals(self) -> dict[str, Any]:
        """:attr:`standardised_residual` by the names of the sensors: a float of one sample, (k,) of k samples."""
        z = self.standardised_residual
        return {name: float_or_array(z[..., k]) for k, name in enumerate(self._estimator.gauge_names)}

    @property
    def suspect_names(self) -> Any:
        """Names of the :attr:`suspects`; of k samples (k,) of tuples."""
        names = self._estimator.gauge_names
        if not self.is_series:
            return tuple(names[k] for k in self.suspects)
        return _tuples([tuple(names[k] for k in row) for row in self.suspects])

    @property
    def suspect_count(self) -> Any:
        """Number of :attr:`suspects`."""
        return self._number("suspects", int)

    fits = _of_fit("Whether strain and air data fit the map.", bool)
    noise_left = _of_fit(
        "Part of the variance of noise that the filter leaves [1]; 1 of a sample by itself.", float
    )
    parameter_score: FloatArray = _output(
        "(n_p,) fraction of its range by which each flow parameter leaves it; 0 inside or not known."
    )

    @property
    def outside_parameters(self) -> Any:
        """Names of the flow parameters that leave their range, for which health is OUTSIDE; of k samples (k,) of
        tuples."""
        outside, score = self._estimator.parameters.outside, self.parameter_score
        return _tuples([outside(row) for row in score]) if self.is_series else outside(score)

    # Air data and flight state, of nonlinear maps.

    @property
    def air_data(self) -> AirData:
        """Angles, Mach number and pressures with standard deviations; NaN of linear maps."""
        if not self._estimator.is_nonlinear:
            unknown = np.full((*self._record.shape[:-1], len(AIR_DATA_NAMES)), np.nan)
            return AirData(value=unknown, std=unknown, is_identified=np.zeros(unknown.shape, dtype=bool))
        flags = np.asarray(self._field("is_identified") != 0.0)
        return AirData(value=self._field("air_data"), std=self._field("air_data_std"), is_identified=flags)

    @property
    def air_data_used(self) -> BoolArray:
        """(3,) which air-data inputs (Mach number, static and dynamic pressure) were used.

        Those that are not given, or left out as inconsistent, are not; of linear maps the shape is (0,).
        """
        return np.asarray(self._field("air_data_used") != 0.0)

    air_data_residual: FloatArray = _of_fit(
        "(3,) standardised difference of each air-data input from all else; 0 if not given, NaN if linear."
    )

    @property
    def is_linear(self) -> Any:
        """Whether loads and coefficients come from the linear map.

        They always do of linear maps, of nonlinear ones where strain does not fit the tables.
        """
        if not self._estimator.is_nonlinear:
            return np.ones(len(self), dtype=bool) if self.is_series else True
        return self._number("is_linear", bool)

    state: FloatArray = _of_fit("(4,) flight state (M, u, w, ln p_inf); NaN of linear maps.")
    state_covariance: FloatArray = _of_fit("(4, 4) covariance of :attr:`state`; NaN of linear maps.", order=4)
    discrepancy_chi_square = _of_fit(
        "Chi-square of the discrepancy modes in the residual; NaN of linear maps.", float
    )

    # What is made of an estimate.

    def pressure(self, with_std: bool = True) -> PressureField:
        """Return pressure and standard deviation at every node of the map's surface, of one sample.

        ``with_std`` false leaves the standard deviation NaN, at a fraction of the cost.

        Raises
        ------
        InputError
            The map holds no pressure field.
        """
        if self.is_series:
            raise TypeError("pressure: of one sample, estimate[i].pressure()")
        return self._estimator.pressure_of(self, with_std)

    def in_wind_axes(
        self, angle_of_attack: ArrayLike, sideslip_angle: ArrayLike, angle_std: ArrayLike = 0.0
    ) -> TurnedCoefficients:
        """Return drag, side force and lift coefficient in wind axes.

        Angles of the wind [rad], one or one of each sample; ``angle_std`` [rad], the standard deviation of either,
        adds to the variances to first order.
        """
        stds = angle_std, angle_std
        return turned(self.coefficients, self.coefficient_covariance, (angle_of_attack, sideslip_angle), stds)

    def in_stability_axes(self, angle_of_attack: ArrayLike, angle_std: ArrayLike = 0.0) -> TurnedCoefficients:
        """Return drag, side force and lift coefficient in stability axes, the wind axes without sideslip."""
        return turned(self.coefficients, self.coefficient_covariance, (angle_of_attack, 0.0), (angle_std, 0.0))

    def to_frame(self) -> DataFrame:
        """Return one row a sample: coefficients, loads, their standard deviations and health. Needs pandas."""
        from pandas import DataFrame

        stated = [group for group in self.load_groups if group.load.coefficient]
        rows = [np.arange(group.first, group.first + group.size) for group in stated]
        of_stated = np.concatenate(rows)
        coefficients = tuple(name for group in stated for name in group.numbered(group.load.coefficient))
        of_others = self.other_coefficients[..., of_stated], self.other_coefficients_std[..., of_stated]
        columns: dict[str, Any] = {}
        for names, values, std in (
            (COEFFICIENT_NAMES, self.coefficients, self.coefficients_std),
            (LOAD_NAMES, self.loads, self.loads_std),
            (coefficients, *of_others),
            (names_of(self.load_groups), self.other_loads, self.other_loads_std),
        ):
            columns |= dict(zip(names, np.atleast_2d(values).T, strict=True))
            columns |= {f"sigma.{name}": row for name, row in zip(names, np.atleast_2d(std).T, strict=True)}
        columns["chi_square"] = np.atleast_1d(self.chi_square)
        columns["health"] = [HealthState(int(state)).name for state in np.atleast_1d(self.health)]
        columns["usable"] = np.atleast_1d(self.usable)
        columns["valid_gauges"] = np.atleast_1d(np.sum(self.valid, axis=-1))
        return DataFrame(columns)

    to_dataframe = to_frame

    def __repr__(self) -> str:
        """Return each load with sigma, of one sample with its coefficient, of k samples its range."""
        texts = [" ".join(text) for text in self._texts()]
        loads, coefficients = texts[: len(LOAD_NAMES)], texts[len(LOAD_NAMES) :]
        rows = loads if self.is_series else map(", ".join, zip(loads, coefficients, strict=True))
        return "\n  ".join([self._heading(), *rows])

    def _repr_html_(self) -> str:
        return html_table(self._heading(), ("", ""), self._texts())

    def _heading(self) -> str:
        """Return health in one line: of one sample what it rests on, of k samples how many have each state."""
        if not self.is_series:
            limit = f"chi-square {self.chi_square:.4g}, limit {self.chi_square_limit:.4g}"
            used = f"{int(np.sum(self.valid))} of {len(self.valid)} gauges"
            return f"Estimate: health {self.health.name}, {limit}, {used}; value +- sigma:"
        counts = zip(*np.unique(self.health, return_counts=True), strict=True)
        states = ", ".join(f"{count} {HealthState(int(state)).name}" for state, count in counts)
        return f"Estimate of {len(self)} sample{'' if len(self) == 1 else 's'}: health {states or 'not known'}"

    def _texts(self) -> list[tuple[str, str]]:
        """Return name and value of each load, then of each coefficient."""
        show, no_units = _range if self.is_series else _value, [""] * len(COEFFICIENT_NAMES)
        loads = zip(LOAD_NAMES, self.loads.T, self.loads_std.T, LOAD_UNITS, strict=True)
        coefficients = zip(COEFFICIENT_NAMES, self.coefficients.T, self.coefficients_std.T, no_units, strict=True)
        return [(name, show(*value)) for name, *value in (*loads, *coefficients)]


def _value(value: float, std: float, unit: str) -> str:
    return f"{value:.5g} +- {std:.2g} {unit}".rstrip() if np.isfinite(value) else "not known"


def _range(values: FloatArray, std: FloatArray, unit: str) -> str:
    known = np.isfinite(values)
    if not known.any():
        return "not known"
    low, high, sigma = values[known].min(), values[known].max(), np.median(std[known])
    return f"{low:.5g} to {high:.5g} {unit}, median sigma {sigma:.2g} {unit}".rstrip()


def _tuples(rows: list[tuple[Any, ...]]) -> Any:
    """Return (k,) of tuples."""
    array = np.empty(len(rows), dtype=object)
    array[:] = rows
    return array


def turned(
    coefficients: FloatArray,
    covariance: FloatArray,
    angles: tuple[ArrayLike, ArrayLike],
    stds: tuple[ArrayLike, ArrayLike],
) -> TurnedCoefficients:
    """Return C_D, C_S and C_L of body ``coefficients`` (.., 5) with ``covariance`` (.., 5, 5).

    ``angles`` are a and b [rad], one or one of each sample; ``stds`` of their errors [rad] add to the variances to
    first order.
    """
    a, b = np.broadcast_arrays(*(np.asarray(angle, dtype=float) for angle in angles))
    turn, order = _axes(a, b), np.array([0, 2, 1])
    body, of_body = coefficients[..., order], covariance[..., order[:, None], order]
    variance = np.einsum("...ij,...jk,...ik->...i", turn, of_body, turn)
    # Derivatives by an angle: a quarter turn more, less what does not turn.
    by_a = _axes(a + 0.5 * np.pi, b) * np.array([[1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0]])
    by_b = _axes(a, b + 0.5 * np.pi) * np.array([[1.0], [1.0], [0.0]])
    for slope, std in zip((by_a, by_b), stds, strict=True):
        error = np.einsum("...ij,...j->...i", slope, body) * np.asarray(std, dtype=float)[..., None]
        variance = variance + error**2
    return TurnedCoefficients(np.einsum("...ij,...j->...i", turn, body), np.sqrt(variance))


def _axes(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return (.., 3, 3) unit vectors of drag, side force and lift in body axes."""
    drag = np.stack([np.cos(a) * np.cos(b), -np.sin(b), np.sin(a) * np.cos(b)], axis=-1)
    side = np.stack([np.cos(a) * np.sin(b), np.cos(b), np.sin(a) * np.sin(b)], axis=-1)
    lift = np.stack([-np.sin(a), np.zeros_like(a), np.cos(a)], axis=-1)
    return np.stack([drag, side, lift], axis=-2)
