"""Estimates of loads: of one sample, or of a series of samples, with every number by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.estimates.pressure_field import FieldInputs, PressureField
from strainfmu.estimator.further_loads import SECTION_LOADS, SectionLoads
from strainfmu.estimator.health import HealthState

if TYPE_CHECKING:
    from pandas import DataFrame


class NamedLoads:
    """Loads and coefficients by name: views of the last axis of ``loads`` and ``coefficients`` (.., 5), and of the
    further ones (.., m), the first of which is the rolling moment."""

    loads: FloatArray
    coefficients: FloatArray
    further_loads: FloatArray
    further_coefficients: FloatArray

    @property
    def axial_force(self) -> FloatArray:
        """F_x [N], positive aft, of the fore-body."""
        return self.loads[..., 0]

    @property
    def normal_force(self) -> FloatArray:
        """F_z [N], positive up."""
        return self.loads[..., 1]

    @property
    def side_force(self) -> FloatArray:
        """F_y [N], positive to starboard."""
        return self.loads[..., 2]

    @property
    def pitching_moment(self) -> FloatArray:
        """Moment about y [N m], positive nose-up."""
        return self.loads[..., 3]

    @property
    def yawing_moment(self) -> FloatArray:
        """Moment about z [N m], positive nose to starboard."""
        return self.loads[..., 4]

    @property
    def C_A(self) -> FloatArray:
        """Coefficient of the axial force [1]."""
        return self.coefficients[..., 0]

    @property
    def C_N(self) -> FloatArray:
        """Coefficient of the normal force [1]."""
        return self.coefficients[..., 1]

    @property
    def C_Y(self) -> FloatArray:
        """Coefficient of the side force [1]."""
        return self.coefficients[..., 2]

    @property
    def M_P(self) -> FloatArray:
        """Coefficient of the pitching moment [1]."""
        return self.coefficients[..., 3]

    @property
    def M_Y(self) -> FloatArray:
        """Coefficient of the yawing moment [1]."""
        return self.coefficients[..., 4]

    @property
    def rolling_moment(self) -> FloatArray:
        """Moment about x [N m], positive with starboard going down; known to be zero for a body of revolution."""
        return self.further_loads[..., 0]

    @property
    def M_R(self) -> FloatArray:
        """Coefficient of the rolling moment [1], C_l of the literature."""
        return self.further_coefficients[..., 0]


@dataclass(frozen=True, eq=False)
class Sigma(NamedLoads):
    """Standard deviations by name: of the ``loads`` (.., 5) [N, N m], of the ``coefficients`` (.., 5) [1], and of
    the further ones (.., m)."""

    loads: FloatArray
    coefficients: FloatArray
    further_loads: FloatArray
    further_coefficients: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LoadEstimate(NamedLoads):
    """The estimate of one sample. Of a gauge that is not valid, no number here depends on its strain.

    Attributes
    ----------
    loads : (5,) forces and moments [N, N, N, N m, N m], order of ``LOAD_NAMES``; NaN where they cannot be known.
    loads_std : (5,) their standard deviations.
    coefficients : (5,) C_A, C_N, C_Y, M_P, M_Y [1]; NaN where they cannot be computed.
    coefficients_std : (5,) their standard deviations [1].
    coefficient_covariance : (5, 5) covariance of the coefficients [1].
    chi_square : |W (d - mean_strain)|^2 of the residual of the valid gauges [1].
    health : state of this estimate.
    load_covariance : (5, 5) covariance of the loads [(N, N m)^2].
    chi_square_limit : alarm level for the valid gauges, times ``alarm_scale``; infinite where nothing checks the
        estimate.
    degrees_of_freedom : of chi_square; 0 where nothing checks the estimate.
    valid : (n_d,) gauges that were used.
    standardised_residual : (n_d,) z, standard normal where a gauge fits the others; 0 where no other checks it.
    suspects : gauges, by index, that the largest |z| points to, none below its alarm level; more than one where
        they cannot be distinguished.
    envelope_score : standard deviations by which the coefficients leave the half-spaces of the map's envelope; 0
        inside, NaN where they are not known.
    further_loads, further_loads_std : (m,) rolling moment, and six loads of each section [N, N m].
    further_coefficients, further_coefficients_std : (m,) the same over q S, moments over q S L [1].
    section_station : (n_s,) x of the sections [m].
    parameter_score : (n_p,) part of its range in the map by which each further parameter of the flow leaves it; 0
        inside, and where it is not known.
    outside_parameters : names of those that leave their range, for which health is OUTSIDE.
    field_inputs : what :meth:`pressure` needs; None where the map holds no pressure field.
    """

    loads: FloatArray
    loads_std: FloatArray
    coefficients: FloatArray
    coefficients_std: FloatArray
    chi_square: float
    health: HealthState
    load_covariance: FloatArray
    chi_square_limit: float
    degrees_of_freedom: int
    valid: BoolArray
    standardised_residual: FloatArray
    suspects: tuple[int, ...]
    envelope_score: float
    coefficient_covariance: FloatArray
    further_loads: FloatArray
    further_loads_std: FloatArray
    further_coefficients: FloatArray
    further_coefficients_std: FloatArray
    section_station: FloatArray
    parameter_score: FloatArray
    outside_parameters: tuple[str, ...]
    field_inputs: FieldInputs | None = None

    def pressure(self, with_std: bool = True) -> PressureField:
        """Return pressure and standard deviation at every node of the map's surface, off the deadline.

        ``with_std`` false leaves the standard deviation NaN, at a fraction of the cost.

        Raises
        ------
        InputError
            The map holds no pressure field.
        """
        from strainfmu.estimator.estimates.linear_field import linear_pressure

        return linear_pressure(self.field_inputs, self.valid, with_std)

    @property
    def sigma(self) -> Sigma:
        """Standard deviations by name: ``estimate.sigma.C_N``."""
        return _sigma(self)

    @property
    def section_loads(self) -> SectionLoads:
        """Loads of the sections of the map, (n_s, 6), and their standard deviations."""
        return _section_loads(self)

    def to_dataframe(self) -> DataFrame:
        """Return one row: coefficients, loads, their standard deviations and health. Needs pandas."""
        from strainfmu.estimator.estimates.estimate_table import dataframe_of

        return dataframe_of(self, [self.health.name])

    def __repr__(self) -> str:
        from strainfmu.estimator.estimates.estimate_text import estimate_text

        return estimate_text(self)

    def _repr_html_(self) -> str:
        from strainfmu.estimator.estimates.estimate_html import estimate_html

        return estimate_html(self)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LoadEstimates(NamedLoads):
    """The estimates of k samples; row i of every array is the :class:`LoadEstimate` of sample i.

    Attributes
    ----------
    loads, loads_std, coefficients, coefficients_std : (k, 5).
    chi_square, chi_square_limit : (k,).
    health : (k,) values of :class:`~strainfmu.estimator.health.HealthState`.
    load_covariance, coefficient_covariance : (k, 5, 5).
    degrees_of_freedom : (k,).
    valid : (k, n_d).
    standardised_residual : (k, n_d).
    suspects : (k,) of tuples.
    envelope_score : (k,).
    further_loads, further_loads_std, further_coefficients, further_coefficients_std : (k, m).
    section_station : (n_s,) of all of them.
    parameter_score : (k, n_p).
    outside_parameters : (k,) of tuples.
    field_inputs : as of one sample, for all of them.
    """

    loads: FloatArray
    loads_std: FloatArray
    coefficients: FloatArray
    coefficients_std: FloatArray
    chi_square: FloatArray
    health: IntArray
    load_covariance: FloatArray
    chi_square_limit: FloatArray
    degrees_of_freedom: IntArray
    valid: BoolArray
    standardised_residual: FloatArray
    suspects: np.ndarray[tuple[int], np.dtype[np.object_]]
    envelope_score: FloatArray
    coefficient_covariance: FloatArray
    further_loads: FloatArray
    further_loads_std: FloatArray
    further_coefficients: FloatArray
    further_coefficients_std: FloatArray
    section_station: FloatArray
    parameter_score: FloatArray
    outside_parameters: np.ndarray[tuple[int], np.dtype[np.object_]]
    field_inputs: FieldInputs | None = None

    @property
    def sigma(self) -> Sigma:
        """Standard deviations by name: ``estimates.sigma.C_N`` (k,)."""
        return _sigma(self)

    @property
    def section_loads(self) -> SectionLoads:
        """Loads of the sections of the map, (k, n_s, 6), and their standard deviations."""
        return _section_loads(self)

    def __len__(self) -> int:
        return len(self.loads)

    def __getitem__(self, sample: int) -> LoadEstimate:
        """Return the estimate of one sample."""
        return LoadEstimate(
            loads=self.loads[sample],
            loads_std=self.loads_std[sample],
            coefficients=self.coefficients[sample],
            coefficients_std=self.coefficients_std[sample],
            chi_square=float(self.chi_square[sample]),
            health=HealthState(int(self.health[sample])),
            load_covariance=self.load_covariance[sample],
            chi_square_limit=float(self.chi_square_limit[sample]),
            degrees_of_freedom=int(self.degrees_of_freedom[sample]),
            valid=self.valid[sample],
            standardised_residual=self.standardised_residual[sample],
            suspects=self.suspects[sample],
            envelope_score=float(self.envelope_score[sample]),
            coefficient_covariance=self.coefficient_covariance[sample],
            further_loads=self.further_loads[sample],
            further_loads_std=self.further_loads_std[sample],
            further_coefficients=self.further_coefficients[sample],
            further_coefficients_std=self.further_coefficients_std[sample],
            section_station=self.section_station,
            parameter_score=self.parameter_score[sample],
            outside_parameters=self.outside_parameters[sample],
            field_inputs=None if self.field_inputs is None else self.field_inputs.of_sample(sample),
        )

    def to_dataframe(self) -> DataFrame:
        """Return one row a sample: coefficients, loads, their standard deviations and health. Needs pandas."""
        from strainfmu.estimator.estimates.estimate_table import dataframe_of

        names = np.array([state.name for state in HealthState])
        return dataframe_of(self, names[self.health])

    def __repr__(self) -> str:
        from strainfmu.estimator.estimates.estimate_text import estimates_text

        return estimates_text(self)

    def _repr_html_(self) -> str:
        from strainfmu.estimator.estimates.estimate_html import estimates_html

        return estimates_html(self)


def series_of(samples: Sequence[LoadEstimate]) -> LoadEstimates:
    """Return ``samples`` as one series, which states no pressure field."""
    stations = samples[0].section_station if samples else np.zeros(0)
    n_gauges, n_parameters = (len(samples[0].valid), len(samples[0].parameter_score)) if samples else (0, 0)
    series = empty_estimates(len(samples), n_gauges, section_station=stations, n_parameters=n_parameters)
    for name in (entry.name for entry in fields(LoadEstimate) if entry.name not in _OF_ALL):
        for row, one in enumerate(samples):
            getattr(series, name)[row] = getattr(one, name)
    return series


_OF_ALL = ("section_station", "field_inputs")
"""What the samples of a series have in common."""


def empty_estimates(
    k: int,
    n_gauges: int,
    field_inputs: FieldInputs | None = None,
    section_station: FloatArray | None = None,
    n_parameters: int = 0,
) -> LoadEstimates:
    """Return estimates of ``k`` samples whose arrays are to be filled; the other arguments are of all of them."""
    stations = np.zeros(0) if section_station is None else section_station
    m = 1 + len(SECTION_LOADS) * len(stations)
    none_outside = np.empty(k, dtype=object)
    none_outside[:] = [()] * k
    return LoadEstimates(
        loads=np.empty((k, 5)),
        loads_std=np.empty((k, 5)),
        coefficients=np.empty((k, 5)),
        coefficients_std=np.empty((k, 5)),
        chi_square=np.empty(k),
        health=np.empty(k, dtype=np.int64),
        load_covariance=np.empty((k, 5, 5)),
        chi_square_limit=np.empty(k),
        degrees_of_freedom=np.empty(k, dtype=np.int64),
        valid=np.empty((k, n_gauges), dtype=bool),
        standardised_residual=np.empty((k, n_gauges)),
        suspects=np.empty(k, dtype=object),
        envelope_score=np.empty(k),
        coefficient_covariance=np.empty((k, 5, 5)),
        further_loads=np.zeros((k, m)),
        further_loads_std=np.zeros((k, m)),
        further_coefficients=np.zeros((k, m)),
        further_coefficients_std=np.zeros((k, m)),
        section_station=stations,
        parameter_score=np.zeros((k, n_parameters)),
        outside_parameters=none_outside,
        field_inputs=field_inputs,
    )


def set_unknown(estimates: LoadEstimates, rows: IntArray) -> None:
    """Fill ``rows``, whose ``valid`` gauges do not identify the state: no number is known."""
    set_nan(estimates, rows)
    some = estimates.valid[rows].any(axis=1)
    estimates.health[rows] = np.where(some, HealthState.UNIDENTIFIED, HealthState.INVALID)


def set_nan(estimates: LoadEstimates, rows: IntArray) -> None:
    """Fill every number of ``rows`` with NaN, and leave no suspects."""
    for values in (
        estimates.loads,
        estimates.loads_std,
        estimates.coefficients,
        estimates.coefficients_std,
        estimates.chi_square,
        estimates.load_covariance,
        estimates.chi_square_limit,
        estimates.standardised_residual,
        estimates.envelope_score,
        estimates.coefficient_covariance,
        estimates.further_loads,
        estimates.further_loads_std,
        estimates.further_coefficients,
        estimates.further_coefficients_std,
    ):
        values[rows] = np.nan
    estimates.degrees_of_freedom[rows] = 0
    for row in rows:
        estimates.suspects[row] = ()


def _sigma(estimate: LoadEstimate | LoadEstimates) -> Sigma:
    return Sigma(
        estimate.loads_std,
        estimate.coefficients_std,
        estimate.further_loads_std,
        estimate.further_coefficients_std,
    )


def _section_loads(estimate: LoadEstimate | LoadEstimates) -> SectionLoads:
    shape = (*estimate.further_loads.shape[:-1], len(SECTION_LOADS), len(estimate.section_station))
    loads, std = (
        np.swapaxes(values[..., 1:].reshape(shape), -1, -2)
        for values in (estimate.further_loads, estimate.further_loads_std)
    )
    return SectionLoads(estimate.section_station, loads, std)
