"""Case 1 of the source: five POD coefficients by least squares, over noisy samples of many flight conditions.

Errors of whole fields follow from errors of coefficients: with V orthonormal in the norm in use,
|p_hat - p|^2 = |q_hat - q|^2 + |p - p_mean - V q|^2, so no field is formed per sample.
"""

from dataclasses import dataclass

import numpy as np

from builder.reproduce.protocol import COEFFICIENT_FLOOR, DRAWS, DRAWS_PER_CONDITION, MODES, P1, SEED
from builder.reproduce.setups import Pressures, SetUp
from builder.trial.score import SIGMAS, is_within
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition
from strainfmu.linear.pressure_modes import PressureModes, proper_orthogonal_decomposition
from strainfmu.linear.state_map import LeastSquaresMap, least_squares_map, relative_condition

PUBLISHED_STRAIN = 1e-4
"""Strain per gauge [m/m] in the source's |d| = 100 sqrt(n_d), taken as um/m."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Case1Study:
    """One configuration in one set-up.

    Attributes
    ----------
    energy : (k,) fraction of the energy of P1 in the first 1, 2, .. modes.
    relative_condition : K in the source's scaling.
    scaling : of K, in words.
    pod_error : (n, r) normalised difference of coefficients of every sample (eq. of e_POD) [1].
    pod_bound : (r,) 3 sigma of the same from the covariance of the noise alone [1].
    covered : (r,) fraction of the samples within that bound.
    field_error : (n,) relative error of the pressure field of every sample [1].
    noise_free_error : (N,) the same without noise, per condition [1].
    truncation : (N,) its part that five modes cannot represent [1].
    coefficient_error : (n, 5) normalised difference of C_A, C_N, C_Y, M_P, M_Y [1].
    """

    energy: FloatArray
    relative_condition: float
    scaling: str
    pod_error: FloatArray
    pod_bound: FloatArray
    covered: FloatArray
    field_error: FloatArray
    noise_free_error: FloatArray
    truncation: FloatArray
    coefficient_error: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Case1Map:
    """A least-squares map of one configuration.

    Attributes
    ----------
    modes : POD of its snapshots.
    solved : the map.
    data_operator : (n_d, n_p) Z_p of the data [1/Pa].
    sigma : of the noise [m/m].
    """

    modes: PressureModes
    solved: LeastSquaresMap
    data_operator: FloatArray
    sigma: float

    @property
    def basis(self) -> FloatArray:
        """(n_p, r) V_r."""
        return self.modes.modes[:, :MODES]

    def coefficients(self, pressure: FloatArray) -> FloatArray:
        """Return the first r POD coefficients (.., r) [Pa] of pressures (.., n_p) [Pa]."""
        return self.modes.coefficients(pressure)[..., :MODES]


def pod_of(snapshots: FloatArray, weights: FloatArray | None) -> PressureModes:
    """Return the POD of ``snapshots`` (N, n_p) [Pa] in the norm of ``weights``, Euclidean by default."""
    return proper_orthogonal_decomposition(snapshots, weights)


def case_1_map(modes: PressureModes, setup: SetUp, names: list[str], internal: float) -> Case1Map:
    """Return the map of the gauges ``names``; ``internal`` is the pressure inside [Pa]."""
    operator = setup.inversion.operator_of(names)
    noise = setup.sigma**2 * np.eye(len(names))
    solved = least_squares_map(
        operator @ modes.modes[:, :MODES],
        operator @ (modes.mean - internal),
        noise,
        modes.coefficient_std[:MODES],
    )
    return Case1Map(modes=modes, solved=solved, data_operator=setup.data.operator_of(names), sigma=setup.sigma)


def study_case_1(
    case: Case1Map,
    pressures: Pressures,
    tested: FloatArray,
    conditions: tuple[FlightCondition, ...],
    seed: int = SEED,
    draws: int = DRAWS_PER_CONDITION,
) -> Case1Study:
    """Estimate from ``draws`` noisy strains of each of ``tested`` (N, n_p) [Pa], pressures at ``conditions``."""
    modes, solved = case.modes, case.solved
    true = case.coefficients(tested)
    estimate = _estimates(case, tested - pressures.internal, draws, seed)
    difference = (estimate - true[:, None]).reshape(-1, MODES)
    spread = np.ptp(case.coefficients(pressures.p1), axis=0)
    of_noise = np.sqrt(np.diag(solved.state_covariance)) / spread
    weights = 1.0 if modes.weights is None else modes.weights
    size = np.sum(weights * tested**2, axis=1)
    # The remainder of the projection, not a difference of two squares, which would lose digits.
    rest = tested - modes.mean - true @ case.basis.T
    truncated = np.sum(weights * rest**2, axis=1)
    square = np.sum(difference.reshape(len(tested), draws, MODES) ** 2, axis=2) + truncated[:, None]
    without_noise = (
        tested - pressures.internal
    ) @ case.data_operator.T @ solved.strain_gain.T + solved.state_offset
    exact = np.sum((without_noise - true) ** 2, axis=1) + truncated
    n_gauges, std = len(case.data_operator), modes.coefficient_std[:MODES]
    relative = relative_condition(
        solved.state_operator,
        strain_norm=PUBLISHED_STRAIN * np.sqrt(n_gauges),
        state_norm=1.0,
        state_scale=float(np.linalg.norm(std)),
    )
    return Case1Study(
        energy=modes.energy[: 4 * MODES],
        relative_condition=relative.value,
        scaling=relative.scaling,
        pod_error=difference / spread,
        pod_bound=SIGMAS * of_noise,
        covered=np.mean(is_within(difference / spread, of_noise), axis=0),
        field_error=np.sqrt(square / size[:, None]).ravel(),
        noise_free_error=np.sqrt(exact / size),
        truncation=np.sqrt(truncated / size),
        coefficient_error=_coefficient_error(case, pressures, tested, conditions, estimate),
    )


def _estimates(case: Case1Map, net: FloatArray, draws: int, seed: int) -> FloatArray:
    """Return (N, draws, r) estimated coefficients [Pa] from noisy strains of ``net`` (N, n_p) [Pa]."""
    strain = net @ case.data_operator.T
    noise = case.sigma * np.random.default_rng(seed).normal(size=(len(net), draws, strain.shape[1]))
    estimate: FloatArray = (strain[:, None] + noise) @ case.solved.strain_gain.T + case.solved.state_offset
    return estimate


def _coefficient_error(
    case: Case1Map,
    pressures: Pressures,
    tested: FloatArray,
    conditions: tuple[FlightCondition, ...],
    estimate: FloatArray,
) -> FloatArray:
    """Return (n, 5) the normalised differences; loads are due to p - p_internal."""
    scale = pressures.scale(conditions)
    true = pressures.coefficients(tested - pressures.internal, conditions)
    of_mean = pressures.loads @ (case.modes.mean - pressures.internal)
    loads = of_mean + estimate @ (pressures.loads @ case.basis).T
    floor = COEFFICIENT_FLOOR * np.abs(
        pressures.coefficients(pressures.p1 - pressures.internal, P1.conditions)
    ).max(axis=0)
    error = (loads * scale[:, None] - true[:, None]) / np.maximum(floor, np.abs(true))[:, None]
    return np.asarray(error.reshape(-1, error.shape[-1]))


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldExample:
    """A field, its estimate from noisy strain, and the errors.

    Attributes
    ----------
    reference, estimate : (n_p,) [Pa]; the estimate has the median error among the draws.
    projection : (n_p,) the reference on the kept modes [Pa]; in Case 1 on the basis of the estimate.
    errors : (n,) relative error of each draw [1].
    shown : error of ``estimate`` [1].
    """

    reference: FloatArray
    estimate: FloatArray
    projection: FloatArray
    errors: FloatArray
    shown: float


def field_example(
    case: Case1Map, tested: FloatArray, internal: float, seed: int = SEED, draws: int = DRAWS
) -> FieldExample:
    """Return the estimates of one ``tested`` field (n_p,) [Pa] over ``draws`` of noise."""
    estimate = _estimates(case, (tested - internal)[None], draws, seed)[0]
    modes = case.modes
    true = case.coefficients(tested)
    weights = np.ones(len(tested)) if modes.weights is None else modes.weights
    projection = modes.mean + case.basis @ true
    truncated = float(weights @ (tested - projection) ** 2)
    size = float(weights @ tested**2)
    errors = np.sqrt((np.sum((estimate - true) ** 2, axis=1) + truncated) / size)
    middle = int(np.argsort(errors)[len(errors) // 2])
    return FieldExample(
        reference=tested,
        estimate=modes.mean + case.basis @ estimate[middle],
        projection=projection,
        errors=errors,
        shown=float(errors[middle]),
    )
