"""The result of an estimator, of one sample or of k samples: every number by name, made when it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray, IntArray, float_or_array
from strainfmu.errors import InputError
from strainfmu.estimator.air_data import AIR_DATA_NAMES, AirData
from strainfmu.estimator.estimates.load_estimate import GroupLoads, NamedLoads, SectionLoads, Sigma
from strainfmu.estimator.estimates.pressure_field import PressureField
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.validity import PARAMETER_TOLERANCE
from strainfmu.estimator.other_loads import SECTIONS, LoadGroup, rows_of
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY, VALID

if TYPE_CHECKING:
    from pandas import DataFrame

    from strainfmu.estimator.core import Core
    from strainfmu.estimator.estimates.axes import TurnedCoefficients
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

    def other_loads_of(self, estimate: Estimate, name: str) -> FloatArray: ...


class Estimate(NamedLoads):
    """Loads, coefficients, air data and health of one sample or of k samples.

    Of k samples every array has a first axis of length k more than below, ``len(estimate)`` is k and
    ``estimate[i]`` is the estimate of sample i. Of a gauge that is not ``valid``, no number depends on its strain.

    Attributes
    ----------
    loads : (5,) forces and moments [N, N, N, N m, N m], order of ``LOAD_NAMES``; NaN where they cannot be known.
    loads_std : (5,) their standard deviations.
    coefficients : (5,) C_A, C_N, C_Y, M_P, M_Y [1]; NaN where they cannot be computed.
    coefficients_std : (5,) their standard deviations [1].
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

    def _number(self, name: str, kind: type[Any] = float) -> Any:
        """Return a field of one number as a ``kind``, of k samples as (k,)."""
        return self._as(self._record[..., self._estimator.core.outputs[name].start], kind)

    def _fit_number(self, name: str, kind: type[Any] = float) -> Any:
        """Return a field of the fit of one number, as :meth:`_number`."""
        return self._as(self._fit(name)[..., 0], kind)

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

    @property
    def loads(self) -> FloatArray:  # type: ignore[override]  # NamedLoads declares attributes
        return self._field("loads")

    @property
    def loads_std(self) -> FloatArray:
        return self._field("loads_std")

    @property
    def coefficients(self) -> FloatArray:  # type: ignore[override]
        return self._field(COEFFICIENT_ARRAY)

    @property
    def coefficients_std(self) -> FloatArray:
        return self._field("coefficients_std")

    @property
    def sigma(self) -> Sigma:
        """Standard deviations by name: ``estimate.sigma.C_N``."""
        return Sigma(self.loads_std, self.coefficients_std, self.other_loads_std, self.other_coefficients_std)

    @property
    def load_covariance(self) -> FloatArray:
        """(5, 5) covariance of the loads [(N, N m)^2]."""
        return self._matrix("load_covariance", 5)

    @property
    def coefficient_covariance(self) -> FloatArray:
        """(5, 5) covariance of the coefficients [1]."""
        return self._matrix("coefficient_covariance", 5)

    def _matrix(self, name: str, order: int) -> FloatArray:
        values = self._fit(name)
        return values.reshape(*values.shape[:-1], order, order)

    # Loads behind the five; of a map without any the rolling moment is zero. NamedLoads has two of them as
    # attributes, for which mypy accepts no property without a setter.

    def _other(self, name: str) -> FloatArray:
        values = self._field(name)
        return values if values.shape[-1] else self._estimator.other_loads_of(self, name)

    @property
    def other_loads(self) -> FloatArray:  # type: ignore[override]
        """(m,) loads behind the five [N, N m], in the order of :attr:`load_groups`."""
        return self._other("other_loads")

    @property
    def other_loads_std(self) -> FloatArray:
        """(m,) standard deviations of :attr:`other_loads`."""
        return self._other("other_loads_std")

    @property
    def other_coefficients(self) -> FloatArray:  # type: ignore[override]
        """(m,) :attr:`other_loads` over q S, moments over q S L [1]."""
        return self._other("other_coefficients")

    @property
    def other_coefficients_std(self) -> FloatArray:
        """(m,) standard deviations of :attr:`other_coefficients` [1]."""
        return self._other("other_coefficients_std")

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

    @property
    def load_factor(self) -> FloatArray:
        """(3,) axial, normal, side force over the weight of the vehicle; none where the map states no mass."""
        return self._field("load_factor")

    # Health, and what it rests on.

    @property
    def health(self) -> Any:
        """State of the estimate, a :class:`HealthState`; of k samples its numbers (k,)."""
        state = self._number("health", int)
        return state if self.is_series else HealthState(state)

    @property
    def usable(self) -> Any:
        """Whether loads may be used with their standard deviations: OK and DEGRADED; of k samples (k,)."""
        return self._number("usable", bool)

    @property
    def chi_square(self) -> Any:
        """Chi-square of the residual of the valid gauges and, of nonlinear maps, of the air data used [1]."""
        return self._number("chi_square")

    @property
    def chi_square_limit(self) -> Any:
        """Detection threshold of chi-square, times ``alarm_scale``; infinite where nothing checks the estimate."""
        return self._number("chi_square_limit")

    @property
    def degrees_of_freedom(self) -> Any:
        """Degrees of freedom of chi-square; 0 where nothing checks the estimate."""
        return self._number("degrees_of_freedom", int)

    @property
    def iterations(self) -> Any:
        """Gauss-Newton iterations of the nonlinear estimator in this sample; 0 of the linear one."""
        return self._number("iterations", int)

    @property
    def envelope_score(self) -> Any:
        """Standard deviations by which the estimate leaves the envelope of the map; 0 inside, NaN if not known."""
        return self._number("envelope_score")

    @property
    def valid_gauges(self) -> Any:
        """Number of sensors that were used."""
        return self._number("valid_gauges", int)

    @property
    def valid(self) -> BoolArray:
        """(n_d,) sensors that were used."""
        return np.asarray(self._fit(VALID) != 0.0)

    @property
    def standardised_residual(self) -> FloatArray:
        """(n_d,) z, standard normal where a sensor fits the others; 0 where no other checks it."""
        return self._fit("standardised_residual")

    @property
    def residual_limit(self) -> Any:
        """Detection threshold of the largest \\|z\\|."""
        return self._fit_number("residual_limit")

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

    @property
    def fits(self) -> Any:
        """Whether strain and air data fit the map."""
        return self._fit_number("fits", bool)

    @property
    def noise_left(self) -> Any:
        """Part of the variance of noise that the filter leaves [1]; 1 of a sample by itself."""
        return self._fit_number("noise_left")

    @property
    def parameter_score(self) -> FloatArray:
        """(n_p,) fraction of its range by which each flow parameter leaves it; 0 inside or not known."""
        return self._field("parameter_score")

    @property
    def outside_parameters(self) -> Any:
        """Names of the flow parameters that leave their range, for which health is OUTSIDE; of k samples (k,) of
        tuples."""
        names, outside = self._estimator.parameters.names, self.parameter_score > PARAMETER_TOLERANCE
        if not self.is_series:
            return tuple(np.array(names, dtype=object)[outside])
        return _tuples([tuple(np.array(names)[row]) if row.any() else () for row in outside])

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

    @property
    def air_data_residual(self) -> FloatArray:
        """(3,) standardised difference of each air-data input from all else; 0 if not given, NaN if linear."""
        return self._fit("air_data_residual")

    @property
    def is_linear(self) -> Any:
        """Whether loads and coefficients come from the linear map.

        They always do of linear maps, of nonlinear ones where strain does not fit the tables.
        """
        if not self._estimator.is_nonlinear:
            return np.ones(len(self), dtype=bool) if self.is_series else True
        return self._number("is_linear", bool)

    @property
    def state(self) -> FloatArray:
        """(4,) flight state (M, u, w, ln p_inf); NaN of linear maps."""
        return self._fit("state")

    @property
    def state_covariance(self) -> FloatArray:
        """(4, 4) covariance of :attr:`state`; NaN of linear maps."""
        return self._matrix("state_covariance", 4)

    @property
    def discrepancy_chi_square(self) -> Any:
        """Chi-square of the discrepancy modes in the residual; NaN of linear maps."""
        return self._fit_number("discrepancy_chi_square")

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
        from strainfmu.estimator.estimates.axes import in_wind_axes

        return in_wind_axes(self, angle_of_attack, sideslip_angle, angle_std)

    def in_stability_axes(self, angle_of_attack: ArrayLike, angle_std: ArrayLike = 0.0) -> TurnedCoefficients:
        """Return drag, side force and lift coefficient in stability axes, the wind axes without sideslip."""
        from strainfmu.estimator.estimates.axes import in_stability_axes

        return in_stability_axes(self, angle_of_attack, angle_std)

    def to_frame(self) -> DataFrame:
        """Return one row a sample: coefficients, loads, their standard deviations and health. Needs pandas."""
        from strainfmu.estimator.estimates.estimate_views import dataframe_of

        return dataframe_of(self)

    to_dataframe = to_frame

    def __repr__(self) -> str:
        from strainfmu.estimator.estimates.estimate_views import estimate_text, estimates_text

        return estimates_text(self) if self.is_series else estimate_text(self)

    def _repr_html_(self) -> str:
        from strainfmu.estimator.estimates.estimate_views import estimate_html, estimates_html

        return estimates_html(self) if self.is_series else estimate_html(self)


def _tuples(rows: list[tuple[Any, ...]]) -> Any:
    """Return (k,) of tuples."""
    array = np.empty(len(rows), dtype=object)
    array[:] = rows
    return array
