"""States of the filter of the nonlinear estimator, and what strain and navigation read of them.

The states are s = (x, dx/dt, b, c, e): flight state, its rates, errors of navigation, errors of pressure off the
tables in the directions that gauges see, and hardware errors that all gauges have in common. The last three have
unit variance. Their stationary law is what the static estimator takes for the errors of every sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.filter.kalman import Measurement, Transition
from strainfmu.estimator.filter.motion import decaying, with_rates
from strainfmu.estimator.filter.seen_errors import SeenErrors, seen_errors, white_and_lasting
from strainfmu.estimator.filter.settings import SLOW, FilterSettings
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.manifold.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W, evaluate
from strainfmu.estimator.manifold.manifold_map import ManifoldMap
from strainfmu.estimator.manifold.navigation import NAVIGATION, StateMeasurement, predicted, prior
from strainfmu.estimator.proportional_errors import PAIRS

ERRORS_OF_NAVIGATION = 2 * N_STATES
DISCREPANCY = ERRORS_OF_NAVIGATION + len(NAVIGATION)
"""First states of b and of c."""

_ROUND_OFF = 1e-12
"""Part of the noise's variance that keeps the factor of the considered errors regular."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightModel:
    """States and errors of a map with tables.

    Attributes
    ----------
    manifold : the tables.
    settings : of the filter.
    seen : errors of pressure per p_inf [1/Pa, m2, m3].
    noise : (n_d,) variances of what is independent from sample to sample.
    common : (n_d, c) errors that gauges have in common and that do not follow strain.
    lasting : (n_d, n_d) covariance of the other errors that do neither.
    """

    manifold: ManifoldMap
    settings: FilterSettings
    seen: SeenErrors
    noise: FloatArray
    common: FloatArray
    lasting: FloatArray

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
    noise, common, lasting = white_and_lasting(manifold.gauge_covariance, inverse_map.noise_std)
    std = np.sqrt(noise + np.diagonal(lasting))
    middle = float(np.exp(np.log(manifold.pressure_range).mean()))
    return FlightModel(
        manifold=manifold,
        settings=settings,
        seen=seen_errors(manifold.error_strain, manifold.error_load, middle, std),
        noise=noise,
        common=common,
        lasting=lasting,
    )


def transition(model: FlightModel, time_step: float, widening: float) -> Transition:
    """Return the step over ``time_step`` [s], the discrepancy of ``widening`` times the variance of the map."""
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
    slow = SLOW * settings.time_constant
    time_constant = np.full(n - ERRORS_OF_NAVIGATION, slow)
    first = DISCREPANCY - ERRORS_OF_NAVIGATION
    time_constant[first : model.hardware - ERRORS_OF_NAVIGATION] = settings.time_constant
    matrix[:ERRORS_OF_NAVIGATION, :ERRORS_OF_NAVIGATION] = with_rates(std, rate, time_step)
    rest = np.arange(ERRORS_OF_NAVIGATION, n)
    matrix[rest, rest] = decaying(time_constant, time_step)
    return Transition(
        matrix=matrix, mean=mean, covariance=np.diag(variance), considered=float(np.exp(-time_step / slow))
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorColumns:
    """Errors of strain at a flight state.

    Attributes
    ----------
    pressure : p_inf [Pa].
    strain : (n_d, n - 11) of the states c and e, per standard deviation.
    considered : (n_d, n_d) factor of the covariance of the considered errors.
    noise : (n_d,) variances of what is independent from sample to sample.
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
    first, second = np.array(PAIRS).T
    of_gauge = pressure**2 * np.maximum((c[first] * c[second]) @ manifold.gauge_error_product, 0.0)
    of_gauge = of_gauge + (manifold.gauge_gain_std * strain) ** 2
    rest = model.lasting + pressure**2 * model.seen.rest_strain + np.diag(of_gauge)
    small = _ROUND_OFF * model.noise
    factor = np.asarray(np.linalg.cholesky(rest + np.diag(small)), dtype=np.float64)
    columns = [
        pressure * model.seen.strain,
        manifold.common_gain_std * strain[:, None],
        pressure * np.einsum("a,tan->nt", c, manifold.common_error),
        model.common,
    ]
    return ErrorColumns(
        pressure=pressure, strain=np.concatenate(columns, axis=1), considered=factor, noise=model.noise - small
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleRows:
    """Strain and navigation of one sample.

    Attributes
    ----------
    strain, used : (n_d,) [m/m], and which gauges to use.
    navigation : (1, 7) of the static estimator; its priors are not used here.
    """

    strain: FloatArray
    used: BoolArray
    navigation: StateMeasurement

    @property
    def known(self) -> BoolArray:
        """(3,) which quantities of navigation are used."""
        return np.asarray(self.navigation.precision[0, :3] > 0.0)


def measurement(
    model: FlightModel, sample: SampleRows, columns: ErrorColumns, *, at: FloatArray, mean: FloatArray
) -> Measurement:
    """Return the rows of ``sample``, linearised at the flight state ``at`` (4,), about the ``mean`` (n,) of a law.

    Rows of strain come first, in the order of the gauges used, then those of navigation, over its deviation.
    """
    n_d, n = model.manifold.tables.n_gauges, model.n_states
    used, known, white = sample.used, sample.known, model.settings.white_navigation
    response = evaluate(model.manifold.tables, at[None])
    strain = np.zeros((n_d, n))
    strain[:, :N_STATES] = response.jacobian[0, :n_d]
    strain[:, DISCREPANCY:] = columns.strain
    value, of_state = predicted(at[None])
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
    considered = np.zeros((len(jacobian), n_d))
    considered[: int(used.sum())] = columns.considered[used]
    return Measurement(
        innovation=apart - jacobian @ about,
        jacobian=jacobian,
        considered=considered,
        noise=np.concatenate([columns.noise[used], np.full(int(known.sum()), white)]),
    )
