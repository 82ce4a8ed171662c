"""How well the estimator that a map is used with knows the coefficients: the nonlinear one of a map with tables.

The linear map of such a map stands in only where strain does not fit the tables, so that its sigmas are not those
that a user meets. The error of a coefficient of the nonlinear estimator is linear in the errors of strain, load
and navigation at a flight state: with A the derivative of the coefficients by the state less what the residual
says of them, E the covariance of the state and K = Gamma_Ld S^-1, strain has the gain G = A E J' S^-1 + K and
navigation A E H' W. So the variance is a sum over the sources
(:mod:`strainfmu.estimator.manifold.load_solution` has the same sum in closed form).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.reports.findings.coefficient_sources import CoefficientSources
from builder.reports.findings.envelope_states import ALL, envelope, estimated_at, inputs_at
from builder.reports.findings.gauge_value import GaugeValue
from builder.reports.findings.prior_observability import PriorObservability
from strainfmu.arrays import FloatArray
from strainfmu.estimator.manifold.estimator import ManifoldEstimator, blocks
from strainfmu.estimator.manifold.gauss_newton import Linearised, Samples, linearise_anew
from strainfmu.estimator.manifold.load_solution import LoadSolution, load_solution
from strainfmu.estimator.manifold.navigation import state_measurement
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.proportional_errors import PAIRS
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap

NOISE, OFF_TABLES = "gauge noise and apparent strain", "pressure off the tables"
HARDWARE = (
    "gain of each gauge",
    "position and direction of each gauge",
    "gain of all gauges",
    "further errors of all gauges, as of clocking and wall",
)
NAVIGATION = ("Mach number", "static pressure", "dynamic pressure", "ranges of the map")
"""The sources of the nonlinear estimator's variance, with :data:`NOISE` and :data:`OFF_TABLES`."""

FEW = (2, 2)
"""Mach numbers and total incidences at which gauges are lost, and pressure is estimated."""


@dataclass(frozen=True, eq=False, kw_only=True)
class InUse:
    """The estimator that a map is used with, over the envelope of the map.

    Attributes
    ----------
    is_nonlinear : whether it is the nonlinear one.
    coefficients : uncertainty of each coefficient by source; of the nonlinear estimator rms values.
    largest_std : (5,) largest sigma of each over the envelope [1].
    growth : (n_d, 5) sigma of each coefficient without a gauge over sigma with all [1].
    pressure_removed : fraction of the variance of the snapshots' pressure that the data remove; None where the
        nonlinear estimator gives no pressure.
    where : the flights that sigma is of, in words.
    """

    is_nonlinear: bool
    coefficients: CoefficientSources
    largest_std: FloatArray
    growth: FloatArray
    pressure_removed: float | None
    where: str


def estimator_in_use(
    inverse_map: InverseMap,
    linear: CoefficientSources,
    gauges: GaugeValue,
    observed: PriorObservability,
    node_area: FloatArray,
) -> InUse:
    """Return the judgement of the estimator of ``inverse_map``.

    ``linear``, ``gauges`` and ``observed`` judge the linear map; ``node_area`` (n_p,) is that of its nodes [m2].
    """
    if inverse_map.manifold is None:
        return InUse(
            is_nonlinear=False,
            coefficients=linear,
            largest_std=linear.std,
            growth=gauges.growth,
            pressure_removed=observed.removed,
            where=f"at q_inf = {1e-3 * inverse_map.nominal_dynamic_pressure:.5g} kPa",
        )
    estimator = ManifoldEstimator(inverse_map)
    whole, few = envelope(estimator.manifold), envelope(estimator.manifold, *FEW)
    coefficients, largest = _of_nonlinear(estimator, whole.flown)
    return InUse(
        is_nonlinear=True,
        coefficients=coefficients,
        largest_std=largest,
        growth=_growth(estimator, few.flown),
        pressure_removed=_pressure_removed(estimator, few.flown, node_area, observed),
        where=f"rms over the envelope of the map at p_inf = {1e-3 * whole.static_pressure:.4g} kPa, with {ALL} of "
        "navigation",
    )


def _of_nonlinear(estimator: ManifoldEstimator, flown: FloatArray) -> tuple[CoefficientSources, FloatArray]:
    """Return the sources of the mean variance over the states ``flown`` (k, 4), and the largest sigma (5,)."""
    parts, covariance = list[dict[str, FloatArray]](), list[FloatArray]()
    for rows in blocks(len(flown)):
        at = linearised_at(estimator, flown[rows])
        parts.append(source_variances(estimator.manifold, at))
        covariance.append(_solved(estimator.manifold, at).coefficient_covariance)
    every = np.concatenate(covariance)
    mean = every.mean(axis=0)
    std = np.sqrt(np.diag(mean))
    variance = {name: np.mean(np.concatenate([one[name] for one in parts]), axis=0) for name in parts[0]}
    held = {name: one for name, one in variance.items() if np.any(one > 0.0)}
    sources = CoefficientSources(
        std=std,
        range=estimator.inverse_map.coefficient_range,
        correlation=mean / np.outer(std, std),
        names=tuple(held),
        variance=np.stack(list(held.values())),
        hardware=tuple(name for name in HARDWARE if name in held),
    )
    return sources, np.sqrt(np.diagonal(every, axis1=1, axis2=2).max(axis=0))


def linearised_at(estimator: ManifoldEstimator, state: FloatArray, lost: int | None = None) -> Linearised:
    """Return the problem of the strain of the tables at ``state`` (k, 4), with all navigation, and without the
    gauge ``lost``."""
    inputs = inputs_at(estimator, state, ALL)
    used = np.ones(inputs.strain.shape, dtype=bool)
    if lost is not None:
        used[:, lost] = False
    measured = state_measurement(estimator.manifold, inputs.navigation)
    samples = Samples(strain=np.where(used, inputs.strain, 0.0), used=used, measured=measured)
    return linearise_anew(estimator.manifold, state, samples)


def _solved(manifold: ManifoldMap, at: Linearised, lost: int | None = None) -> LoadSolution:
    used = np.ones(at.residual.shape, dtype=bool)
    if lost is not None:
        used[:, lost] = False
    return load_solution(manifold, at, used, np.asarray(np.linalg.inv(at.hessian)))


def source_variances(manifold: ManifoldMap, at: Linearised) -> dict[str, FloatArray]:
    """Return (k, 5) contribution of each source to the variance of each coefficient [1]; they add up to it.

    ``at`` is :func:`linearised_at`, with all gauges.
    """
    pressure = np.exp(at.state[:, LOG_PRESSURE])
    strain = evaluate(manifold.tables, at.state).value[:, : manifold.tables.n_gauges]
    solved = _solved(manifold, at)
    scale = 1.0 / (solved.errors.dynamic_pressure[:, None] * manifold.references)
    turned = np.swapaxes(np.linalg.solve(at.factor, np.swapaxes(_cross(manifold, pressure), 1, 2)), 1, 2)
    by_state = scale[:, :, None] * (at.load_jacobian - turned @ at.whitened_jacobian)
    by_state -= solved.coefficients[:, :, None] * solved.errors.of_pressure[:, None, :]
    of_state = by_state @ solved.errors.covariance
    # G L, then G: strain enters whitened.
    of_whitened = of_state @ np.swapaxes(at.whitened_jacobian, 1, 2) + scale[:, :, None] * turned
    gain = np.swapaxes(np.linalg.solve(np.swapaxes(at.factor, 1, 2), np.swapaxes(of_whitened, 1, 2)), 1, 2)
    c = np.hstack([np.ones((len(pressure), 1)), at.loads / (pressure[:, None] * manifold.references)])
    first, second = np.array(PAIRS).T
    of_gauge = np.maximum((c[:, first] * c[:, second]) @ manifold.gauge_error_product, 0.0)
    common = np.einsum("ka,tan->knt", c, manifold.common_error)
    off_tables = gain @ manifold.error_strain - scale[:, :, None] * manifold.error_load
    of_navigation = (of_state @ np.swapaxes(at.measurement_jacobian, 1, 2)) ** 2 * at.precision[:, None, :]
    square = (pressure**2)[:, None]
    parts = {
        NOISE: np.einsum("kin,nm,kim->ki", gain, manifold.gauge_covariance, gain, optimize=True),
        OFF_TABLES: square * np.sum(off_tables**2, axis=2),
        HARDWARE[0]: np.sum((gain * (manifold.gain_std * strain)[:, None, :]) ** 2, axis=2),
        HARDWARE[1]: square * np.sum(gain**2 * of_gauge[:, None, :], axis=2),
        HARDWARE[2]: np.sum(gain * (manifold.common_gain * strain)[:, None, :], axis=2) ** 2,
        HARDWARE[3]: square * np.sum((gain @ common) ** 2, axis=2),
        **{name: of_navigation[:, :, i] for i, name in enumerate(NAVIGATION[:3])},
        NAVIGATION[3]: of_navigation[:, :, 3:].sum(axis=2),
    }
    return {name: solved.errors.wider * part for name, part in parts.items()}


def _cross(manifold: ManifoldMap, pressure: FloatArray) -> FloatArray:
    """Return (k, 5, n_d) covariance of loads with strain of the errors that scale [N, N m]."""
    return (pressure**2)[:, None, None] * manifold.load_strain_covariance


def _growth(estimator: ManifoldEstimator, flown: FloatArray) -> FloatArray:
    """Return (n_d, 5) rms sigma of each coefficient at ``flown`` (k, 4) without a gauge over sigma with all."""

    def variance(lost: int | None) -> FloatArray:
        solved = _solved(estimator.manifold, linearised_at(estimator, flown, lost), lost)
        return np.asarray(np.diag(solved.coefficient_covariance.mean(axis=0)))

    with_all = variance(None)
    return np.sqrt([variance(lost) / with_all for lost in range(estimator.inverse_map.n_gauges)])


def _pressure_removed(
    estimator: ManifoldEstimator, flown: FloatArray, node_area: FloatArray, observed: PriorObservability
) -> float | None:
    """Return 1 - variance of the error at ``flown`` (k, 4) / variance over the snapshots, area-weighted; None
    without a field."""
    if estimator.manifold.surface_field is None:
        return None
    found = estimated_at(estimator, flown, ALL)
    scale = estimator.inverse_map.nominal_dynamic_pressure / found.air_data.value[:, -1]
    left = [node_area @ (scale[k] * found[k].pressure().std) ** 2 for k in range(len(flown))]
    return 1.0 - float(np.mean(left) / (node_area @ observed.node_std**2))
