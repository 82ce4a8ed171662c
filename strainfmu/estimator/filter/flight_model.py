"""States of the filter of the nonlinear estimator, and what strain and navigation read of them.

The states are s = (x, dx/dt, b, c, e, da): flight state, its rates, errors of navigation, errors of pressure off
the tables in the directions that gauges see, hardware errors that all gauges have in common, and errors of the
amplitudes of temperature modes. b, c and e have unit variance. Their stationary law is what the static estimator
takes for the errors of every sample.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.filter.further_step import SeenFurther, seen_further
from strainfmu.estimator.filter.kalman import Measurement, Transition
from strainfmu.estimator.filter.motion import decaying, with_rates
from strainfmu.estimator.filter.seen_errors import SeenErrors, seen_errors, white_and_lasting
from strainfmu.estimator.filter.settings import SLOW, FilterSettings
from strainfmu.estimator.filter.warm import WarmSample, mode_columns, not_warm
from strainfmu.estimator.manifold.gauss_newton import Samples
from strainfmu.estimator.manifold.navigation import NAVIGATION, StateMeasurement, predicted, prior
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.proportional_errors import PAIRS
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap

ERRORS_OF_NAVIGATION = 2 * N_STATES
DISCREPANCY = ERRORS_OF_NAVIGATION + len(NAVIGATION)
"""First states of b and of c."""

_FAINT = 1e-9
"""Variance of a term over the largest below which it is round-off."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightModel:
    """States and errors of a map with tables.

    Attributes
    ----------
    manifold : the tables.
    settings : of the filter.
    seen : errors of pressure per p_inf [1/Pa, m2, m3].
    noise : (n_d, n_d) covariance of what does not scale and counts as independent from sample to sample.
    common : (n_d, c) errors that gauges have in common and that do not follow strain, those of modes last.
    modes : what is known of temperature modes without sensors.
    of_gauge : (n_d, t, 6) errors of each gauge that last, per p_inf and c of
        :class:`~strainfmu.estimator.tables.manifold_map.ManifoldMap` [1/Pa].
    own : (n_d,) standard deviation of what lasts in each gauge and does not follow strain.
    further : errors of section loads; None for none.
    """

    manifold: ManifoldMap
    settings: FilterSettings
    seen: SeenErrors
    noise: FloatArray
    common: FloatArray
    modes: WarmSample
    of_gauge: FloatArray
    own: FloatArray
    further: SeenFurther | None = None

    @property
    def n_considered(self) -> int:
        """Number of errors that are considered: of each gauge its gain, its terms, and its own."""
        return self.of_gauge.shape[0] * (self.of_gauge.shape[1] + 2)

    @property
    def n_states(self) -> int:
        """Number of states."""
        return self.hardware + 1 + len(self.manifold.common_error) + self.common.shape[1]

    @property
    def hardware(self) -> int:
        """First state of e."""
        return DISCREPANCY + self.seen.strain.shape[1]


def flight_model(inverse_map: InverseMap, manifold: ManifoldMap, settings: FilterSettings) -> FlightModel:
    """Return the model of ``manifold``, the tables of ``inverse_map``."""
    thermal = inverse_map.thermal
    own_covariance = manifold.gauge_covariance if thermal is None else thermal.isothermal_covariance
    noise, common, lasting = white_and_lasting(own_covariance, inverse_map.noise_std)
    std = np.sqrt(noise + np.diagonal(lasting))
    # What is left beside a diagonal that dominates is a covariance (Gershgorin).
    beside = np.sum(np.abs(lasting), axis=1) - np.diagonal(lasting)
    own = np.sqrt(np.maximum(np.diagonal(lasting) - beside, 0.0))
    seen = seen_errors(manifold.error_strain, manifold.error_load, _middle_pressure(manifold), std)
    return FlightModel(
        manifold=manifold,
        settings=settings,
        seen=seen,
        noise=np.diag(noise - own**2) + lasting,
        common=np.hstack([common, mode_columns(inverse_map)]),
        modes=not_warm(thermal),
        of_gauge=gauge_terms(manifold.gauge_error_product),
        own=own,
        further=None if manifold.further is None else seen_further(manifold.further, seen, std),
    )


def with_tables(model: FlightModel, manifold: ManifoldMap) -> FlightModel:
    """Return ``model`` with the tables and the errors of pressure of ``manifold``, its states as they are.

    ``manifold`` is that of the model where other parameters of the flow are known.
    """
    std = np.sqrt(np.diagonal(model.noise) + model.own**2)
    number = model.seen.direction.shape[1]
    seen = seen_errors(manifold.error_strain, manifold.error_load, _middle_pressure(manifold), std, number)
    further = None if manifold.further is None else seen_further(manifold.further, seen, std)
    return replace(model, manifold=manifold, seen=seen, further=further)


def _middle_pressure(manifold: ManifoldMap) -> float:
    return float(np.exp(np.log(manifold.pressure_range).mean()))


def gauge_terms(product: FloatArray) -> FloatArray:
    """Return (n_d, t, 6) errors D of each gauge whose products are ``product`` (21, n_d), see ``ManifoldMap``."""
    first, second = np.array(PAIRS).T
    whole = np.zeros((product.shape[1], 6, 6))
    half = np.where(first == second, 1.0, 0.5)[:, None] * product
    whole[:, first, second] = whole[:, second, first] = half.T
    size, vector = np.linalg.eigh(whole)
    terms = np.swapaxes(vector, 1, 2) * np.sqrt(np.maximum(size, 0.0))[:, :, None]
    seen = np.max(size, axis=0) > _FAINT * max(float(np.max(size, initial=0.0)), 1e-300)
    return np.asarray(terms[:, seen])


def transition(
    model: FlightModel,
    time_step: float,
    widening: float,
    warm: WarmSample | None = None,
    last: FloatArray | None = None,
) -> Transition:
    """Return the step over ``time_step`` [s], the discrepancy of ``widening`` times the variance of the map.

    ``warm`` is what is known of the temperature in the sample that follows; None for nothing. ``last`` (k, r) are
    the directions of the states c in the sample before; None for those of ``model``. Columns of errors stay what
    they are where other parameters become known, and their directions turn: c' = V' V_last c, and what V_last does
    not see of V stays unknown.
    """
    settings, n = model.settings, model.n_states
    middle, precision = prior(model.manifold)
    std = 1.0 / np.sqrt(precision)
    rate = np.empty(N_STATES)
    rate[MACH], rate[LOG_PRESSURE] = settings.mach_number_rate, settings.log_pressure_rate
    rate[U] = rate[W] = settings.angle_rate
    rate *= settings.rate_scale
    mean, variance, matrix = np.zeros(n), np.ones(n), np.zeros((n, n))
    mean[:N_STATES] = middle
    variance[:N_STATES], variance[N_STATES:ERRORS_OF_NAVIGATION] = std**2, rate**2
    variance[DISCREPANCY : model.hardware] = widening
    time_constant = np.full(n - ERRORS_OF_NAVIGATION, float(settings.time_constant))
    time_constant[: DISCREPANCY - ERRORS_OF_NAVIGATION] *= SLOW
    matrix[:ERRORS_OF_NAVIGATION, :ERRORS_OF_NAVIGATION] = with_rates(std, rate, time_step)
    rest = np.arange(ERRORS_OF_NAVIGATION, n)
    matrix[rest, rest] = decaying(time_constant, time_step)
    if last is not None:
        c = slice(DISCREPANCY, model.hardware)
        matrix[c, c] = matrix[c, c] @ (model.seen.direction.T @ last)
    covariance, modes = np.diag(variance), model.modes if warm is None else warm
    first_mode = n - len(modes.amplitude)
    covariance[first_mode:, first_mode:] = modes.covariance
    return Transition(
        matrix=matrix,
        mean=mean,
        covariance=covariance,
        considered=float(np.exp(-time_step / settings.time_constant)),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorColumns:
    """Errors of strain at a flight state.

    Attributes
    ----------
    pressure : p_inf [Pa].
    strain : (n_d, n - 11) of the states c and e, per standard deviation.
    considered : (n_d, k) of the considered errors, each of one gauge.
    noise : (n_d, n_d) covariance of what counts as independent from sample to sample.
    """

    pressure: float
    strain: FloatArray
    considered: FloatArray
    noise: FloatArray


def error_columns(model: FlightModel, state: FloatArray) -> ErrorColumns:
    """Return the errors at the flight ``state`` (4,). Their covariances add up to S of the static estimator."""
    manifold = model.manifold
    n_d = manifold.tables.n_gauges
    response = evaluate(manifold.tables, state[None]).value[0]
    strain, loads, pressure = response[:n_d], response[n_d:], float(np.exp(state[LOG_PRESSURE]))
    c = np.concatenate([[1.0], loads / (pressure * manifold.references)])
    gain = manifold.gain_std * strain
    # Each error keeps its sign: that of a gain turns with the strain of its gauge.
    of_gauge = np.column_stack([gain, model.own, pressure * (model.of_gauge @ c)])
    considered = np.zeros((n_d, n_d, of_gauge.shape[1]))
    considered[np.arange(n_d), np.arange(n_d)] = of_gauge
    columns = [
        pressure * model.seen.strain,
        (manifold.common_gain * strain)[:, None],
        pressure * np.einsum("a,tan->nt", c, manifold.common_error),
        model.common,
    ]
    return ErrorColumns(
        pressure=pressure,
        strain=np.concatenate(columns, axis=1),
        considered=considered.reshape(n_d, -1),
        noise=model.noise + pressure**2 * model.seen.rest_strain,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleRows:
    """Strain and navigation of one sample.

    Attributes
    ----------
    strain, used : (n_d,) [m/m], and which gauges to use.
    navigation : (1, 7) of the static estimator; its priors are not used here.
    doubt : (3,) factor on the variance of each quantity of navigation while another one is dropped, at least 1.
    """

    strain: FloatArray
    used: BoolArray
    navigation: StateMeasurement
    doubt: FloatArray

    @property
    def known(self) -> BoolArray:
        """(3,) which quantities of navigation are used."""
        return np.asarray(self.navigation.precision[0, :3] > 0.0)


def sample_rows(samples: Samples, doubted: Samples | None = None) -> SampleRows:
    """Return the one sample in ``samples``, its navigation ``doubted`` or without doubts."""
    before = samples.measured.precision[0, :3]
    after = before if doubted is None else doubted.measured.precision[0, :3]
    kept = after > 0.0
    measured = samples.measured
    precision = measured.precision.copy()
    precision[0, :3] = np.where(kept, before, 0.0)
    return SampleRows(
        strain=samples.strain[0],
        used=samples.used[0],
        navigation=replace(measured, precision=precision),
        doubt=np.where(kept, before / np.where(kept, after, 1.0), 1.0),
    )


def measurement(
    model: FlightModel,
    sample: SampleRows,
    columns: ErrorColumns,
    *,
    at: FloatArray,
    mean: FloatArray,
    slopes: FloatArray | None = None,
) -> Measurement:
    """Return the rows of ``sample``, linearised at the flight state ``at`` (4,), about the ``mean`` (n,) of a law.

    ``slopes`` (4,) is the flight state of the slopes, None for ``at``. Rows of strain come first, in the order of
    the gauges used, then those of navigation, over its deviation.
    """
    n_d, n = model.manifold.tables.n_gauges, model.n_states
    used, known, white = sample.used, sample.known, model.settings.white_navigation
    response = evaluate(model.manifold.tables, at[None])
    value, of_state = predicted(at[None])
    sloped = response
    if slopes is not None:
        sloped, (_, of_state) = evaluate(model.manifold.tables, slopes[None]), predicted(slopes[None])
    strain = np.zeros((n_d, n))
    strain[:, :N_STATES] = sloped.jacobian[0, :n_d]
    strain[:, DISCREPANCY:] = columns.strain
    scale = np.sqrt(sample.navigation.precision[0, :3])
    navigation = np.zeros((len(NAVIGATION), n))
    navigation[:, :N_STATES] = scale[:, None] * of_state[0, :3]
    error = np.arange(len(NAVIGATION))
    navigation[error, ERRORS_OF_NAVIGATION + error] = np.sqrt(1.0 - white)
    about = mean.copy()
    about[:N_STATES] -= at
    apart = np.concatenate(
        [
            (sample.strain - response.value[0, :n_d])[used],
            (scale * (sample.navigation.value[0, :3] - value[0, :3]))[known],
        ]
    )
    jacobian = np.concatenate([strain[used], navigation[known]])
    n_used = int(used.sum())
    considered = np.zeros((len(jacobian), model.n_considered))
    considered[:n_used] = columns.considered[used]
    noise = np.zeros((len(jacobian), len(jacobian)))
    noise[:n_used, :n_used] = columns.noise[np.ix_(used, used)]
    # What is doubted errs more in this sample; what is known of its lasting error stays.
    noise[n_used:, n_used:] = np.diag(white + sample.doubt[known] - 1.0)
    return Measurement(
        innovation=apart - jacobian @ about,
        jacobian=jacobian,
        considered=considered,
        noise=noise,
    )
