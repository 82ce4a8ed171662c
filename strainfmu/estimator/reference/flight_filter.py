"""The filter of the flight state.

States are s = (x, dx/dt, b, c, e, da): flight state, its rates, errors of air data, pressure off the tables in the
directions that gauges see, hardware errors that gauges have in common, errors of the amplitudes of temperature
modes. Errors of each gauge alone, its gain, those in proportion to the loads and what else lasts, are considered,
and so are those of zeros, which stay as they are. Their covariances together are S of the static estimator, and
the stationary law is its prior. What is known of flow parameters changes tables and errors of pressure: states c
are amplitudes along the same directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator import policies
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.reference import kalman, nonlinear
from strainfmu.estimator.reference.air import N_AIR, air_rows
from strainfmu.estimator.reference.kalman import Law, Rows, measured
from strainfmu.estimator.reference.nonlinear import FlightLoads, Sample
from strainfmu.estimator.reference.readings import Zeros, row_noise, zero_columns
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, N_STATES
from strainfmu.estimator.tables.manifold_map import ManifoldMap
from strainfmu.estimator.tables.parameter_tables import with_known

RATES = slice(N_STATES, 2 * N_STATES)
AIR_ERRORS = slice(2 * N_STATES, 2 * N_STATES + N_AIR)
SEEN = AIR_ERRORS.stop
"""Places of dx/dt and b, and of the first state of c."""

RATE_STD = np.array([policies.MACH_NUMBER_RATE, *2 * [policies.ANGLE_RATE], policies.LOG_PRESSURE_RATE])
"""Standard deviations of dx/dt [1/s]."""

NOTICED = 3.0
"""Deviations of a rate at which half of its motion counts in the flight state of slopes."""

ITERATIONS = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class FilteredSample(FlightLoads):
    """What the filter makes of a sample: ``law`` after it, and what it says of gauges and air data."""

    law: Law
    chi_square: float
    standardised: FloatArray
    air_standardised: FloatArray
    air_used: BoolArray


class FlightFilterReference:
    """A nonlinear map fed with one sample after another; it never begins again, and names nothing."""

    def __init__(self, inverse_map: InverseMap, time_constant: float, zeros: Zeros | None = None) -> None:
        """Begin with the prior of the map; ``time_constant`` T [s], ``zeros`` that are taken off the rows."""
        manifold = inverse_map.manifold
        assert manifold is not None
        self.map, self.manifold, self.time_constant = inverse_map, manifold, time_constant
        whole = row_noise(inverse_map, manifold.gauge_covariance, zeros)
        self.static = nonlinear.NonlinearReference(inverse_map, manifold, whole)
        white, self.common, lasting = kalman.gauge_errors(inverse_map, manifold.gauge_covariance)
        diagonal = np.diag(lasting)
        # What is left beside a diagonal that dominates is a covariance (Gershgorin).
        self.own = np.sqrt(np.maximum(2.0 * diagonal - np.sum(np.abs(lasting), axis=1), 0.0))
        self.noise = np.diag(white - self.own**2) + lasting
        middle = float(np.exp(np.log(manifold.pressure_range).mean()))
        self.beside = np.sqrt(white + diagonal)
        self.seen = self.of_map = kalman.seen_errors(*_pressure_errors(manifold), middle, self.beside)
        self.known_std = np.zeros(0)
        self.of_gauge = _gauge_terms(manifold.gauge_error_product)

        n_d, r = self.seen.strain.shape
        self.hardware = SEEN + r
        n = self.hardware + 1 + len(manifold.common_error) + self.common.shape[1]
        mean, std = np.zeros(n), np.ones(n)
        mean[:N_STATES], std[:N_STATES] = self.static.prior_mean, self.static.prior_std
        std[RATES] = RATE_STD * (1.0 + policies.RATE_TIME / time_constant)
        self.of_zeros = zero_columns(inverse_map, zeros)
        n_decaying = n_d * (2 + self.of_gauge.shape[1])
        self.constant = np.arange(n_decaying + self.of_zeros.shape[1]) >= n_decaying
        std[n - inverse_map.thermal.n_modes :] = inverse_map.thermal.prior_std
        self.prior = Law(mean, np.diag(std**2), np.zeros((n, len(self.constant))))
        self.law: Law | None = None
        self.slopes: FloatArray | None = None
        self.state, self.age = mean[:N_STATES], 0.0

    def step(self, time_step: float, sample: Sample) -> FilteredSample:
        """Return what the filter makes of ``sample``, ``time_step`` [s] after the last one."""
        if self.law is None:
            start = self.static.solved(sample).state
            found = self.dropped(self.prior, sample, start, 0, None)
            self.slopes, self.age = None, 0.0
        else:
            before = self.predicted(self.law, time_step, self.prior)
            self.slopes = self.slopes_after(time_step, before) if sample.used.any() else None
            self.age += time_step
            found = self.dropped(before, sample, self.state, ITERATIONS, self.slopes)
        if not sample.used.any():
            self.slopes, self.age = None, 0.0
        self.law, self.state = found.law, found.law.mean[:N_STATES]
        return found

    def know(self, value: FloatArray, std: FloatArray) -> None:
        """Take what is known of flow parameters from the next sample on: (n_p,), NaN of one that is not.

        It begins again where other parameters are known, or to other deviations.
        """
        std = np.where(np.isfinite(value), std, np.nan)
        known, self.seen = with_known(self.manifold, value, std), self.of_map
        if known is not self.manifold:
            self.seen = kalman.seen_left(self.of_map, *_pressure_errors(known), self.beside)
        self.static = nonlinear.NonlinearReference(self.map, known, self.static.noise)
        if len(self.known_std) and not np.array_equal(std, self.known_std, equal_nan=True):
            self.law = None
        self.known_std = std

    # The law over time.

    def predicted(self, law: Law, time_step: float, stationary: Law) -> Law:
        """Return ``law`` after ``time_step`` [s]; ``stationary`` is that of no sample."""
        kept = np.where(self.constant, 1.0, np.exp(-time_step / self.time_constant))
        return kalman.predicted(law, self.transition(time_step), stationary, kept)

    def transition(self, time_step: float) -> FloatArray:
        """Return F (n, n): x and its rates are a Matern 3/2 process, all else decays."""
        std = np.sqrt(np.diag(self.prior.covariance))
        rate = std[RATES] / std[:N_STATES]
        turn = rate * time_step
        decay = np.exp(-turn)
        matrix = np.eye(len(std)) * float(np.exp(-time_step / self.time_constant))
        of_air = float(np.exp(-time_step / (policies.SLOW * self.time_constant)))
        matrix[AIR_ERRORS, AIR_ERRORS] = np.eye(N_AIR) * of_air
        matrix[:N_STATES, :N_STATES] = np.diag(decay * (1.0 + turn))
        matrix[:N_STATES, RATES] = np.diag(decay * time_step)
        matrix[RATES, :N_STATES] = np.diag(-decay * rate * turn)
        matrix[RATES, RATES] = np.diag(decay * (1.0 - turn))
        return matrix

    def slopes_after(self, time_step: float, before: Law) -> FloatArray | None:
        """Return the flight state of slopes, None where each iteration takes its own.

        It knows nothing of the sample that it weighs: it follows the estimate, and moves as predicted as far as
        the rates are noticed.
        """
        time_constant = min(policies.SLOPE_TIME, self.time_constant, policies.OF_AGE * self.age)
        if self.law is None or time_step >= policies.LONGEST_STEP * time_constant:
            return None
        square = self.law.mean[RATES] ** 2
        noticed = square / (square + NOTICED**2 * np.diag(self.law.covariance)[RATES])
        moved = noticed * (before.mean[:N_STATES] - self.law.mean[:N_STATES])
        last = self.state if self.slopes is None else self.slopes
        return self.state + moved + np.exp(-time_step / time_constant) * (last - self.state)

    # A sample.

    def dropped(
        self, law: Law, sample: Sample, start: FloatArray, iterations: int, slopes: FloatArray | None
    ) -> FilteredSample:
        """Return the estimate of ``sample``, a second time without air data that do not fit."""
        found = self.filtered(law, sample, sample, start, iterations, slopes)
        doubted = nonlinear.without_worst(sample, found.air_standardised)
        return found if doubted is None else self.filtered(law, sample, doubted, start, ITERATIONS, slopes)

    def filtered(
        self,
        law: Law,
        sample: Sample,
        doubted: Sample,
        start: FloatArray,
        iterations: int,
        slopes: FloatArray | None,
    ) -> FilteredSample:
        """Return the estimate from the predicted ``law`` by iterations from ``start``, whose errors count.

        Air data that ``doubted`` has not are left out; of others its larger variances count in this sample alone.
        """
        errors, state = self._errors(start), start
        for _ in range(iterations):
            after, _ = measured(law, self._rows(law, sample, doubted, errors, state, slopes))
            state = self.static.moved(state, after.mean[:N_STATES] - state)
        rows = self._rows(law, sample, doubted, errors, state, slopes)
        after, found = measured(law, rows)
        # The other states where the flight state is the iterations' last.
        weight = np.linalg.solve(after.covariance[:N_STATES, :N_STATES], state - after.mean[:N_STATES])
        mean = after.mean + after.covariance[:, :N_STATES] @ weight
        mean[:N_STATES] = state
        distance = (state - after.mean[:N_STATES]) @ weight
        n_used, known = int(sample.used.sum()), np.isfinite(doubted.air.value)
        z, of_air = np.zeros(len(sample.rows)), np.zeros(N_AIR)
        z[sample.used], of_air[known] = np.split(found.standardised[0], [n_used])
        law = Law(mean, after.covariance, after.cross)
        return FilteredSample(
            **vars(self.loads(law, sample, errors)),
            law=law,
            chi_square=float(found.chi_square[0] + distance),
            standardised=z,
            air_standardised=of_air,
            air_used=known,
        )

    def _errors(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return columns (n_d, n) of the states of errors at ``state``, considered ones (n_d, k), and noise."""
        m, (value, _) = self.manifold, self.static.at(state)
        n_d, pressure = self.static.n_d, np.exp(state[LOG_PRESSURE])
        strain = value[:n_d]
        c = np.append(1.0, value[n_d : n_d + 5] / (pressure * self.static.references[:5]))
        columns = np.zeros((n_d, len(self.prior.mean)))
        columns[:, SEEN:] = np.hstack(
            [
                pressure * self.seen.strain,
                (m.common_gain * strain)[:, None],
                pressure * np.einsum("a,tan->nt", c, m.common_error),
                self.common,
            ]
        )
        of_gauge = np.column_stack([m.gain_std * strain, self.own, pressure * (self.of_gauge @ c)])
        considered = (np.eye(n_d)[:, :, None] * of_gauge[:, None, :]).reshape(n_d, -1)
        considered = np.hstack([considered, self.of_zeros])
        return columns, considered, self.noise + pressure**2 * self.seen.rest_strain

    def _rows(
        self,
        law: Law,
        sample: Sample,
        doubted: Sample,
        errors: tuple[FloatArray, FloatArray, FloatArray],
        at: FloatArray,
        slopes: FloatArray | None,
    ) -> Rows:
        """Return the rows of ``sample`` about ``at``: strain, then air data over their standard deviations."""
        (columns, considered, noise), n_d, used = errors, self.static.n_d, sample.used
        sloped = at if slopes is None else slopes
        by_state = columns.copy()
        by_state[:, :N_STATES] = self.static.at(sloped)[1][:n_d]
        known, air = np.isfinite(doubted.air.value), sample.air
        std, white = air.log_std, policies.WHITE_NAVIGATION
        of_air = np.zeros((N_AIR, columns.shape[1]))
        of_air[:, :N_STATES] = air_rows(sloped)[1] / std[:, None]
        of_air[:, AIR_ERRORS] = np.sqrt(1.0 - white) * np.eye(N_AIR)
        apart = (air.log_value - air_rows(at)[0]) / std
        jacobian = np.vstack([by_state[used], of_air[known]])
        about = law.mean.copy()
        about[:N_STATES] -= at
        innovation = np.append((sample.rows - self.static.at(at)[0][:n_d])[used], apart[known])
        n, n_used = len(innovation), int(used.sum())
        whole = np.diag(np.append(np.zeros(n_used), white - 1.0 + (doubted.air.std / air.std)[known] ** 2))
        whole[:n_used, :n_used] = noise[np.ix_(used, used)]
        of_gauges = np.zeros((n, considered.shape[1]))
        of_gauges[:n_used] = considered[used]
        return Rows(innovation - jacobian @ about, jacobian, of_gauges, whole)

    def loads(
        self, law: Law, sample: Sample, errors: tuple[FloatArray, FloatArray, FloatArray] | None = None
    ) -> FlightLoads:
        """Return loads and coefficients by ``law``: of the tables, of the errors seen, and of the residual.

        ``errors`` are those at the flight state of the law for None.
        """
        columns, considered, noise = errors or self._errors(law.mean[:N_STATES])
        n_d, used = self.static.n_d, sample.used
        state, of_errors = law.mean[:N_STATES], np.append(np.zeros(N_STATES), law.mean[N_STATES:])
        (value, jacobian), pressure = self.static.at(state), np.exp(state[LOG_PRESSURE])
        strain = columns.copy()
        strain[:, :N_STATES] = jacobian[:n_d]
        load = np.zeros((len(value) - n_d, len(law.mean)))
        load[:, :N_STATES], load[:, SEEN : self.hardware] = jacobian[n_d:], pressure * self.seen.load
        residual = (sample.rows - value[:n_d] - strain @ of_errors)[used]
        cross = pressure**2 * self.seen.rest_cross[used]
        of_residual = np.linalg.solve((considered @ considered.T + noise)[np.ix_(used, used)], cross).T
        loads = value[n_d:] + load @ of_errors + of_residual @ residual
        by_state = load - of_residual @ strain[used]
        whole = np.vstack([np.eye(N_STATES, len(law.mean)), by_state])
        joint = whole @ law.covariance @ whole.T
        joint[N_STATES:, N_STATES:] += pressure**2 * self.seen.rest_load - of_residual @ cross
        return nonlinear.flight_loads(state, loads, joint, self.static.references)


def _pressure_errors(manifold: ManifoldMap) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return strain (n_d, k) of pressure off the tables, covariances with loads (n_d, m) and of these (m, m)."""
    return manifold.error_strain, manifold.load_strain_covariance.T, manifold.load_covariance


def _gauge_terms(product: FloatArray) -> FloatArray:
    """Return (n_d, 6, 6) errors D of each gauge per c, whose squares D' D add up to ``product`` (21, n_d)."""
    first, second = np.triu_indices(6)
    whole = np.zeros((product.shape[1], 6, 6))
    whole[:, first, second] = whole[:, second, first] = np.where(first == second, 1.0, 0.5) * product.T
    value, vector = np.linalg.eigh(whole)
    return np.asarray(np.swapaxes(vector, 1, 2) * np.sqrt(np.maximum(value, 0.0))[:, :, None])
