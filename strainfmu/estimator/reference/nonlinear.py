"""The flight state by strain and air data, and the loads there: Gauss-Newton iterations of the update.

Rows are the strains, then M, ln p_inf and ln q_inf of air data, then the ranges of the map as a weak prior of the
state. At a state x_0 the model is linear: x - x_0 is free, strain has the error covariance S(x_0), outputs are the
state and the loads; errors that scale are noise of strain and loads together. Its posterior is the next state, and
at the end the estimate f.

S holds the errors that the gain may correct. The considered ones h, with loads b, are in S_full = S + sum of h h'
alone, whose posterior at the same state is f_full with covariance C_full. What the estimate is worth, given the
sample, is the mean square of its error under the full model, and the alarms have the precision of that:

    cov f = C_full + (f - f_full)(f - f_full)',   P = S_full^-1 - S_full^-1 J H_full^-1 J' S_full^-1.

Source: Schmidt, Advances in Control Systems 3 (1966) 293, for considered parameters.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import log

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, inverse_root
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W, evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.reference.air import (
    N_AIR,
    AirInputs,
    air_data,
    air_rows,
    doubted,
    lognormal_std,
    without,
)
from strainfmu.estimator.reference.update import Model, Posterior, condition, model_of, prepare

SMALLEST_PART = 0.25
"""Smallest part of a Gauss-Newton step that is taken."""

CONVERGED, LARGEST_NUMBER = 1e-10, 60
"""Step in its standard deviations at which iterations end, and their largest number."""

INCIDENCES, MACHS, ROLLS, EACH = 6, 3, 16, 4
"""Grid of the search, of which the best of each incidence is a start; iterations of each start."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """Strains ``rows`` (n_d,) [m/m], which of them are ``used`` (n_d,), and what is known of ``air``."""

    rows: FloatArray
    used: BoolArray
    air: AirInputs


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightLoads:
    """Flight ``state`` (4,), ``loads`` and ``coefficients`` (m,), and their covariances."""

    state: FloatArray
    state_covariance: FloatArray
    loads: FloatArray
    covariance: FloatArray
    coefficients: FloatArray
    coefficient_covariance: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class NonlinearEstimate(FlightLoads):
    """Estimate of one sample.

    Leave-one-out residuals are ``standardised`` (n_d,) and ``air_standardised`` (3,); ``air_inputs`` are the air
    data as they count, without dropped ones, doubted ones with larger standard deviations; ``air`` and ``air_std``
    (7,) are angle of attack, sideslip, total incidence, aerodynamic roll angle [rad], M, p_inf and q_inf. The
    ``deviance`` is -2 ln likelihood less a constant, ``step`` the step of another iteration in standard
    deviations.
    """

    chi_square: float
    standardised: FloatArray
    air_standardised: FloatArray
    air_inputs: AirInputs
    air: FloatArray
    air_std: FloatArray
    deviance: float
    step: float


def strain_covariance(
    manifold: ManifoldMap, noise: FloatArray, state: FloatArray, considered: bool = True
) -> FloatArray:
    """Return S_full (k, n_d, n_d) [(m/m)^2] about the tables of ``manifold`` at the states ``state`` (k, 4).

    It is the sum of ``noise`` (n_d, n_d), which does not scale, of pressure off the tables, and of errors in
    proportion to strain. Without the ``considered`` errors it is S.
    """
    (value, _), n_d = evaluate(manifold.tables, state), manifold.n_gauges
    pressure, strain = np.exp(state[:, LOG_PRESSURE]), value[:, :n_d]
    square = (pressure * pressure)[:, None]
    c = np.hstack([np.ones((len(state), 1)), value[:, n_d:] / (pressure[:, None] * manifold.references)])
    first, second = np.triu_indices(6)
    of_gauge = square * np.maximum((c[:, first] * c[:, second]) @ manifold.gauge_error_product, 0.0)
    gain = manifold.gain_std * strain
    scaled, common, of_state = manifold.scaled_covariance, manifold.common_error, [manifold.common_gain * strain]
    if considered:
        columns, tables = manifold.considered_columns[:n_d], manifold.considered_tables
        scaled = scaled + columns @ columns.T
        common = np.concatenate([common, manifold.considered_common])
        if tables is not None:
            of_state.append(evaluate(tables, state).value[:, :n_d])
    columns = pressure[:, None, None] * np.einsum("ka,tan->knt", c, common)
    columns = np.concatenate([columns, np.stack(of_state, axis=2)], axis=2)
    covariance = noise + square[:, :, None] * scaled + columns @ np.swapaxes(columns, 1, 2)
    diagonal = np.arange(n_d)
    covariance[:, diagonal, diagonal] += of_gauge + gain * gain
    return covariance


def load_errors(
    manifold: ManifoldMap, state: FloatArray, considered: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Return covariances by common errors: (k, n_d, m) of strain and loads, (k, m, m) of loads.

    Both are at the states ``state`` (k, 4), with the ``considered`` errors or without.
    """
    columns, n_d = [np.vstack([manifold.error_strain, manifold.error_load])], manifold.n_gauges
    if considered:
        columns.append(manifold.considered_columns)
    of_state = np.exp(state[:, LOG_PRESSURE, None, None]) * np.hstack(columns)
    if considered and manifold.considered_tables is not None:
        tables = evaluate(manifold.considered_tables, state).value
        of_state = np.concatenate([of_state, tables[:, :, None]], axis=2)
    strain, load = of_state[:, :n_d], np.swapaxes(of_state[:, n_d:], 1, 2)
    return strain @ load, np.swapaxes(load, 1, 2) @ load


class NonlinearReference:
    """A nonlinear map with the tables and the noise of a sample.

    See :func:`~strainfmu.estimator.map.nonlinear_map.with_known` and
    :func:`~strainfmu.estimator.reference.readings.row_noise`.
    """

    def __init__(self, inverse_map: InverseMap, manifold: ManifoldMap, noise: FloatArray) -> None:
        """Prepare the map; ``noise`` (n_d, n_d) is the covariance of what does not scale [(m/m)^2].

        ``manifold`` has the tables of ``inverse_map``, with what is known of flow parameters. Their rows are the
        n_d strains, then the m outputs: five loads, rolling moment and section loads.
        """
        self.manifold, self.noise, self.n_d = manifold, noise, len(noise)
        self.rows = manifold.tables_of(manifold.n_loads)
        self.references = inverse_map.references[: manifold.n_loads]
        self.prior_mean, self.prior_std = manifold.state_prior

    # The model about a state.

    def at(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the rows (n_d + m,) at the flight ``state`` (4,), and their derivatives (n_d + m, 4)."""
        value, jacobian = evaluate(self.rows, state[None])
        return value[0], jacobian[0]

    def strain_covariance(self, state: FloatArray, considered: bool = False) -> FloatArray:
        """Return S (n_d, n_d) at ``state`` (4,), with ``considered`` errors S_full."""
        return strain_covariance(self.manifold, self.noise, state[None], considered)[0]

    def prior(self, air: AirInputs) -> tuple[FloatArray, FloatArray]:
        """Return (4,) mean and standard deviation of the state by the ranges of the map and measured angles."""
        mean, std = self.prior_mean.copy(), self.prior_std.copy()
        known = np.isfinite(air.direction_std)
        uw = np.flatnonzero(known) + 1  # u and w stand behind M
        precision = std[uw] ** -2, air.direction_std[known] ** -2
        mean[uw] = (precision[0] * mean[uw] + precision[1] * air.direction[known]) / (precision[0] + precision[1])
        std[uw] = (precision[0] + precision[1]) ** -0.5
        return mean, std

    def model(self, state: FloatArray, air: AirInputs, covariance: FloatArray, considered: bool = False) -> Model:
        """Return the model about ``state`` with the error ``covariance`` of strain; outputs: state, then loads."""
        n_d, (value, jacobian) = self.n_d, self.at(state)
        m, n = len(value) - n_d, n_d + N_AIR + N_STATES
        of_air, by_state = air_rows(state)
        variance = np.where(np.isnan(air.std), 1.0, air.log_std) ** 2
        noise = np.diag(np.concatenate([np.zeros(n_d), variance, self.prior(air)[1] ** 2]))
        noise[:n_d, :n_d] = covariance
        cross, output_noise = np.zeros((n, N_STATES + m)), np.zeros((N_STATES + m, N_STATES + m))
        cross[:n_d, N_STATES:], output_noise[N_STATES:, N_STATES:] = (
            part[0] for part in load_errors(self.manifold, state[None], considered)
        )
        return model_of(
            n,
            N_STATES + m,
            fixed=np.concatenate([value[:n_d], of_air, state]),
            free=np.vstack([jacobian[:n_d], by_state, np.eye(N_STATES)]),
            noise=noise,
            output_fixed=np.concatenate([state, value[n_d:]]),
            output_free=np.vstack([np.eye(N_STATES), jacobian[n_d:]]),
            cross=cross,
            output_noise=output_noise,
        )

    def posterior(
        self, state: FloatArray, sample: Sample, covariance: FloatArray, considered: bool = False
    ) -> Posterior:
        """Return the posterior of ``sample`` about ``state``, with the error ``covariance`` of strain."""
        rows = np.concatenate([sample.rows, sample.air.log_value, self.prior(sample.air)[0]])
        used = np.concatenate([sample.used, np.isfinite(sample.air.value), np.ones(N_STATES, dtype=bool)])
        model = self.model(state, sample.air, covariance, considered)
        return condition(prepare(model, used), rows[None], np.ones(1))

    # Iterations.

    def next_state(
        self, state: FloatArray, posterior: Posterior, before: tuple[FloatArray, FloatArray] | None
    ) -> FloatArray:
        """Return the next state: a step to the posterior, limited, and shortened by what the last one did.

        ``before`` are state and full step before. Where strain curves away from the residual whole steps are too
        long (Barzilai and Borwein 1988, the shorter step in the metric of the Hessian).
        """
        step = posterior.mean[0, :N_STATES] - state
        if before is not None:
            shrunk = before[1] - step
            turned = np.linalg.solve(posterior.covariance[0, :N_STATES, :N_STATES], shrunk)
            along, size = (state - before[0]) @ turned, shrunk @ turned
            if 0.0 < along < size:
                step = step * max(float(along / size), SMALLEST_PART)
        return self.moved(state, step)

    def moved(self, state: FloatArray, step: FloatArray) -> FloatArray:
        """Return ``state`` after a limited ``step``, not farther beyond the tables than their tangents hold."""
        m, out = self.manifold, state + step / max(np.max(np.abs(step) / POLICIES.largest_step), 1.0)
        out[MACH] = np.clip(out[MACH], 0.7 * m.mach_range[0], 1.3 * m.mach_range[1])
        out[U : W + 1] *= min(1.0, 1.5 * m.incidence_limit / max(np.hypot(out[U], out[W]), 1e-12))
        low, high = np.log(m.pressure_range)
        out[LOG_PRESSURE] = np.clip(out[LOG_PRESSURE], low - 1.0, high + 1.0)
        return out

    def iterated(self, state: FloatArray, sample: Sample, number: int, renewed: int = 1) -> FloatArray:
        """Return the state after ``number`` iterations, S renewed in every one of ``renewed``, or converged."""
        before, covariance = None, self.strain_covariance(state)
        for iteration in range(number):
            if iteration > 0 and iteration % renewed == 0:
                covariance = self.strain_covariance(state)
            posterior = self.posterior(state, sample, covariance)
            step = posterior.mean[0, :N_STATES] - state
            last, state = state, self.next_state(state, posterior, before)
            before = last, step
            if _size(step, posterior) < CONVERGED:
                break
        return state

    # Estimates.

    def estimate(self, sample: Sample, start: FloatArray | None = None) -> NonlinearEstimate:
        """Return the estimate of ``sample`` from ``start`` (4,), by a search of the tables for None.

        The one quantity of air data that fits worst is dropped where it does not fit, and the sample solved again.
        """
        solution = self.solved(sample, start)
        z = solution.air_standardised
        limit = POLICIES.navigation_limit
        worst = int(np.argmax(np.abs(z) / limit))
        air = without(sample.air, z, worst) if abs(z[worst]) > limit[worst] else doubted(sample.air, z)
        return solution if air is None else self.solved(replace(sample, air=air), start)

    def solved(self, sample: Sample, start: FloatArray | None = None) -> NonlinearEstimate:
        """Return the estimate of ``sample`` with all its air data."""
        if start is None:
            ends = [self.iterated(begin, sample, EACH, renewed=EACH // 2) for begin in self.starts(sample)]
            start = min(ends, key=lambda end: self.concluded(end, sample).deviance)
        return self.concluded(self.iterated(start, sample, LARGEST_NUMBER), sample)

    @cached_property
    def grid(self) -> tuple[FloatArray, FloatArray]:
        """States (INCIDENCES, n, 4) of the search at p_inf = 1 Pa, their strain (INCIDENCES, n, n_d) per p_inf."""
        middle, half = (np.broadcast_to(values, 2) for values in self.manifold.crossflow)
        roll = 2.0 * np.pi * np.arange(ROLLS) / ROLLS
        part = (np.arange(INCIDENCES)[:, None, None] + 0.5) / INCIDENCES
        low, high = self.manifold.mach_range
        mach = np.linspace(low, high, MACHS)[:, None]
        of_u, of_w = middle[0] + part * half[0] * np.cos(roll), middle[1] + part * half[1] * np.sin(roll)
        grid = np.broadcast_arrays(mach, of_u, of_w, 0.0)
        states = np.stack(grid, axis=-1).reshape(INCIDENCES, -1, N_STATES)
        strain = evaluate(self.rows, states.reshape(-1, N_STATES)).value[:, : self.n_d]
        unit = strain - self.rows.fixed_response[: self.n_d]
        return states, unit.reshape(INCIDENCES, -1, self.n_d)

    def starts(self, sample: Sample) -> FloatArray:
        """Return (INCIDENCES, 4) the best state of the grid at each incidence, p_inf by strain and air data.

        S is that in the middle of the grid, its diagonal where a gauge is not in use.
        """
        states, unit = self.grid
        middle = np.append(states[INCIDENCES // 2, 0, :LOG_PRESSURE], self.prior_mean[LOG_PRESSURE])
        covariance = self.strain_covariance(middle)
        if not sample.used.all():
            covariance = np.diag(np.diag(covariance))
        weight = inverse_root(covariance) * sample.used
        data = weight @ np.where(sample.used, sample.rows - self.rows.fixed_response[: self.n_d], 0.0)
        best = []
        for state, strain in zip(states, unit, strict=True):
            cost, log_pressure = self._joined(state[:, MACH], strain @ weight.T, data, sample.air)
            apart = (sample.air.direction - state[:, 1:3]) / sample.air.direction_std
            cost = cost + np.sum(apart**2, axis=1)
            least = np.argmin(cost)
            best.append(np.append(state[least, :LOG_PRESSURE], log_pressure[least]))
        return np.array(best)

    def _joined(
        self, mach: FloatArray, unit: FloatArray, data: FloatArray, air: AirInputs
    ) -> tuple[FloatArray, FloatArray]:
        """Return the cost (k,) of states of the grid, and their ln p_inf (k,) by strain, air data and prior.

        ``mach`` (k,), and ``unit`` (k, n_d) whitened strain per p_inf; ``data`` (n_d,) is the whitened strain of
        the sample.
        """
        size, along = np.sum(unit**2, axis=1), unit @ data
        log_pressure = np.log(np.clip(along / np.maximum(size, 1e-300), 10.0, 5e5))
        known, zero, both = np.isfinite(air.value), np.zeros(len(mach)), [MACH, LOG_PRESSURE]
        precision = np.append(np.where(known, air.log_std, np.inf), self.prior_std[both]) ** -2
        value = np.append(np.where(known, air.log_value, 0.0), self.prior_mean[both])
        of_dynamic = log(0.5 * HEAT_CAPACITY_RATIO) + 2.0 * np.log(mach)
        apart = value - np.stack([mach, zero, of_dynamic, mach, zero], axis=1)
        of_pressure = [1, 2, 4]
        information, weight = size * np.exp(2.0 * log_pressure), precision[of_pressure]
        joined = information * log_pressure + apart[:, of_pressure] @ weight
        joined /= information + weight.sum()
        apart[:, of_pressure] -= joined[:, None]
        pressure = np.exp(joined)
        return pressure**2 * size - 2.0 * pressure * along + apart**2 @ precision, joined

    def concluded(self, state: FloatArray, sample: Sample) -> NonlinearEstimate:
        """Return the estimate at the solved ``state``."""
        covariance, used, n_d = self.strain_covariance(state), sample.used, self.n_d
        posterior = self.posterior(state, sample, covariance)
        full = self.posterior(state, sample, self.strain_covariance(state, considered=True), considered=True)
        apart = posterior.mean[0] - full.mean[0]
        total = full.covariance[0] + np.outer(apart, apart)
        air, air_std = air_data(state, total[:N_STATES, :N_STATES])
        return NonlinearEstimate(
            **vars(flight_loads(state, posterior.mean[0, N_STATES:], total, self.references)),
            chi_square=float(full.chi_square[0]),
            standardised=full.standardised[0, :n_d],
            air_standardised=full.standardised[0, n_d : n_d + N_AIR],
            air_inputs=sample.air,
            air=air,
            air_std=air_std,
            deviance=float(posterior.chi_square[0] + np.linalg.slogdet(covariance[np.ix_(used, used)])[1]),
            step=_size(posterior.mean[0, :N_STATES] - state, posterior),
        )


def flight_loads(state: FloatArray, loads: FloatArray, joint: FloatArray, references: FloatArray) -> FlightLoads:
    """Return ``loads`` (m,) at ``state``, with their ``joint`` covariance (4 + m, 4 + m), and the coefficients.

    Of these the error of ln q_inf, which goes with the errors of the loads, is a part.
    """
    turn, scale, wider = coefficient_slopes(state, loads, joint, references)
    return FlightLoads(
        state=state,
        state_covariance=joint[:N_STATES, :N_STATES],
        loads=loads,
        covariance=joint[N_STATES:, N_STATES:],
        coefficients=scale * loads,
        coefficient_covariance=wider * (turn @ joint @ turn.T),
    )


def coefficient_slopes(
    state: FloatArray, loads: FloatArray, joint: FloatArray, references: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return how errors of state and loads, with the ``joint`` covariance, turn into errors of coefficients.

    That is their derivatives (m, 4 + m) by state and loads, their scale (m,) per load, and a factor on their
    covariance: the error of ln q_inf is normal, the error of q_inf is not.
    """
    mach = state[MACH]
    scale = 1.0 / (0.5 * HEAT_CAPACITY_RATIO * mach**2 * np.exp(state[LOG_PRESSURE]) * references)
    by_log = np.array([2.0 / mach, 0.0, 0.0, 1.0])
    of_log = float(np.sqrt(by_log @ joint[:N_STATES, :N_STATES] @ by_log))
    slopes = np.hstack([-np.outer(scale * loads, by_log), np.diag(scale)])
    return slopes, scale, float(lognormal_std(of_log) / of_log) ** 2


def _size(step: FloatArray, posterior: Posterior) -> float:
    """Return ``step`` (4,) in standard deviations of the posterior."""
    return float(np.sqrt(step @ np.linalg.solve(posterior.covariance[0, :N_STATES, :N_STATES], step)))
