"""How well the estimator that a map is used with knows the coefficients: the nonlinear one of a map with tables.

The linear map of such a map stands in only where strain does not fit the tables, so that its sigmas are not those
that a user meets. The error of a coefficient of the nonlinear estimator is linear in the errors of strain, load
and navigation at a flight state, with a gain of each (:mod:`strainfmu.estimator.reference.nonlinear`). So its
variance is a sum over the sources.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from builder.aero.load_groups import Surface
from builder.inverse.noise.error_list import MODEL_FORM
from builder.inverse.noise.flow_models import FLOW_MODELS
from builder.inverse.noise.model import NoiseTerm
from builder.inverse.solution import Problem
from builder.manifold.nonlinear_build import errors_over_loads, tables_and_errors
from builder.reports.findings.coefficient_sources import AIR_DATA, OF_RANGES, CoefficientSources
from builder.reports.findings.envelope_states import ALL, FEW, air_data_at, envelope, estimated_at, strain_at
from builder.reports.findings.prior_observability import PriorObservability
from strainfmu.arrays import FloatArray
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.air import N_AIR, air_inputs
from strainfmu.estimator.reference.nonlinear import NonlinearReference, Sample, coefficient_slopes

OF_GAUGES = "other errors of each gauge"
"""Errors of single gauges that follow strain, where none of them has a name."""


@dataclass(frozen=True, eq=False, kw_only=True)
class NamedErrors:
    """Errors that a map with tables holds together, by name.

    Attributes
    ----------
    fixed : terms that no pressure changes.
    off_tables : (n_d + n_f, k) columns of strain and loads per p_inf.
    of_gauges, common : (m, 6, n_d) slopes of strain per p_inf over 1 and the loads, of errors of each gauge and of
        those in common.
    """

    fixed: Sequence[NoiseTerm]
    off_tables: Mapping[str, FloatArray]
    of_gauges: Mapping[str, FloatArray]
    common: Mapping[str, FloatArray]


def named_errors(problem: Problem, surface: Surface, nuisance: Sequence[NoiseTerm] = ()) -> NamedErrors:
    """Return the errors of the map with tables of ``problem``, whose structure has ``surface``."""
    plain = replace(problem, entry=problem.entry.model_copy(update={"keep_field": False}))
    _, off_tables = tables_and_errors(plain, surface, nuisance)
    slopes: tuple[dict[str, list[FloatArray]], ...] = (defaultdict(list), defaultdict(list))
    for error, slope, _ in errors_over_loads(problem)[1]:
        slopes[error.common][error.name].append(slope)
    of_gauges, common = ({name: np.array(parts) for name, parts in kind.items()} for kind in slopes)
    fixed = [term for term in problem.noise if not term.scales]
    return NamedErrors(fixed=fixed, off_tables=off_tables, of_gauges=of_gauges, common=common)


@dataclass(frozen=True, eq=False, kw_only=True)
class InUse:
    """The estimator that a map is used with, over the envelope of the map.

    Attributes
    ----------
    is_nonlinear : whether it is the nonlinear one.
    coefficients : uncertainty of each coefficient by source; of the nonlinear estimator rms values.
    largest_std : (5,) largest sigma of each over the envelope [1].
    node_removed : (n_p,) fraction of the variance of the snapshots' pressure at each node that the data remove;
        None where the nonlinear estimator gives no pressure.
    pressure_removed : the same over the surface.
    where : the flights that sigma is of, in words.
    """

    is_nonlinear: bool
    coefficients: CoefficientSources
    largest_std: FloatArray
    node_removed: FloatArray | None
    pressure_removed: float | None
    where: str

    @property
    def name(self) -> str:
        """Which estimator it is, in words."""
        return "the nonlinear estimator" if self.is_nonlinear else "the linear map"

    @property
    def std_without_model_form(self) -> FloatArray | None:
        """(5,) sigma without the model-form error, with the same gain [1]; None where there is none."""
        names = self.coefficients.of_group(MODEL_FORM)
        return self.coefficients.std_without(names) if names else None


def estimator_in_use(
    inverse_map: InverseMap,
    linear: CoefficientSources,
    observed: PriorObservability,
    node_area: FloatArray,
    errors: NamedErrors | None,
) -> InUse:
    """Return the judgement of the estimator of ``inverse_map``.

    ``linear`` and ``observed`` judge the linear map; ``node_area`` (n_p,) is its nodes' area [m2].
    ``errors`` belong to its tables, None where it has none.
    """
    if inverse_map.manifold is None or errors is None:
        return InUse(
            is_nonlinear=False,
            coefficients=linear,
            largest_std=linear.std,
            node_removed=observed.node_removed,
            pressure_removed=observed.removed,
            where=f"at q_inf = {1e-3 * inverse_map.nominal_dynamic_pressure:.5g} kPa",
        )
    dense, few = envelope(inverse_map.manifold), envelope(inverse_map.manifold, *FEW)
    node_removed, pressure_removed = _pressure_removed(inverse_map, few.flown, node_area, observed)
    coefficients, largest = _of_nonlinear(inverse_map, errors, dense.flown)
    return InUse(
        is_nonlinear=True,
        coefficients=coefficients,
        largest_std=largest,
        node_removed=node_removed,
        pressure_removed=pressure_removed,
        where=f"rms over the envelope of the map at p_inf = {1e-3 * dense.static_pressure:.4g} kPa, with {ALL} of "
        "navigation",
    )


def _of_nonlinear(
    inverse_map: InverseMap, errors: NamedErrors, flown: FloatArray
) -> tuple[CoefficientSources, FloatArray]:
    """Return the sources of the mean variance over the states ``flown`` (k, 4), and the largest sigma (5,)."""
    parts, covariance = source_variances(inverse_map, errors, flown)
    mean = covariance.mean(axis=0)
    std = np.sqrt(np.diag(mean))
    variance = {name: of_source.mean(axis=0) for name, of_source in parts.items()}
    nonzero = {name: of_source for name, of_source in variance.items() if np.any(of_source > 0.0)}
    sources = CoefficientSources(
        std=std,
        range=inverse_map.coefficient_range,
        correlation=mean / np.outer(std, std),
        names=tuple(nonzero),
        variance=np.stack(list(nonzero.values())),
    )
    return sources, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).max(axis=0))


def source_variances(
    inverse_map: InverseMap, errors: NamedErrors, flown: FloatArray
) -> tuple[dict[str, FloatArray], FloatArray]:
    """Return (k, 5) contribution of each source to the variance of each coefficient [1], and the covariance.

    The covariance (k, 5, 5) is of an estimate linearised at ``flown`` (k, 4), with all navigation, of strain that
    fits the tables; the contributions add up to its diagonal.
    """
    manifold = inverse_map.manifold
    assert manifold is not None
    reference = NonlinearReference(inverse_map, manifold, manifold.gauge_covariance)
    strain, air = strain_at(manifold, flown), air_data_at(flown, ALL)
    used, unknown = np.ones(inverse_map.n_gauges, dtype=bool), np.full(N_AIR, np.nan)
    samples = [
        Sample(rows=rows, used=used, air=air_inputs(inverse_map, value, unknown))
        for rows, value in zip(strain, air, strict=True)
    ]
    states = [_sources_of(reference, errors, *at_state) for at_state in zip(samples, flown, strict=True)]
    parts = {name: np.stack([parts_there[name] for parts_there, _ in states]) for name in states[0][0]}
    return parts, np.stack([covariance for _, covariance in states])


def _sources_of(
    reference: NonlinearReference, errors: NamedErrors, sample: Sample, state: FloatArray
) -> tuple[dict[str, FloatArray], FloatArray]:
    """Return (5,) contribution of each source for ``sample`` at ``state``, and the covariance (5, 5).

    What of the errors of a gauge is no combination of the loads goes to each of them in proportion.
    """
    manifold, n_d = reference.manifold, reference.n_d
    posterior = reference.posterior(
        state, sample, reference.strain_covariance(state, considered=True), considered=True
    )
    pressure, at_state = np.exp(state[LOG_PRESSURE]), reference.at(state)[0]
    joint = posterior.covariance[0]
    slopes_of_loads, scale, wider = coefficient_slopes(state, at_state[n_d:], joint, reference.references)
    gain = slopes_of_loads @ posterior.gain[0]
    strain, loads = at_state[:n_d], at_state[n_d:][FIVE_LOADS]
    of_strain, of_air, of_prior = np.split(gain[FIVE_LOADS], [n_d, n_d + N_AIR], axis=1)
    c = np.append(1.0, loads / (pressure * manifold.references))
    first, second = np.triu_indices(len(c))
    of_gauge = np.maximum((c[first] * c[second]) @ manifold.gauge_error_product, 0.0)
    fractions = {name: np.sum((c @ slopes) ** 2, axis=0) for name, slopes in errors.of_gauges.items()}
    fractions = fractions or {OF_GAUGES: np.ones(n_d)}
    of_all = np.maximum(np.sum(list(fractions.values()), axis=0), 1e-300)

    def of_columns(columns: FloatArray) -> FloatArray:
        by_load = scale[FIVE_LOADS, None] * columns[n_d:][FIVE_LOADS]
        return np.asarray(np.sum((of_strain @ columns[:n_d] - by_load) ** 2, axis=1))

    by_gauge, by_air = pressure**2 * of_strain**2, (of_air * sample.air.log_std).T ** 2
    parts: dict[str, FloatArray] = defaultdict(lambda: np.zeros(len(of_strain)))
    for term in errors.fixed:
        parts[term.name] += np.sum(term.by_gain(of_strain) ** 2, axis=1)
    parts["gauge gain"] += np.sum((of_strain * manifold.gain_std * strain) ** 2, axis=1)
    parts["common gain"] += (of_strain @ (manifold.common_gain * strain)) ** 2
    for name, fraction in fractions.items():
        parts[name] += by_gauge @ (of_gauge * fraction / of_all)
    for name, slopes in errors.common.items():
        parts[name] += pressure**2 * np.sum((of_strain @ (c @ slopes).T) ** 2, axis=1)
    for name, columns in errors.off_tables.items():
        parts[name] += pressure**2 * of_columns(columns)
    if manifold.considered_tables is not None:
        parts[FLOW_MODELS] += of_columns(evaluate(manifold.considered_tables, state[None]).value.T)
    for name, part in zip(AIR_DATA, by_air, strict=False):
        parts[name] += part
    parts[OF_RANGES] += np.sum((of_prior * reference.prior_std) ** 2, axis=1)
    covariance = wider * (slopes_of_loads[FIVE_LOADS] @ joint @ slopes_of_loads[FIVE_LOADS].T)
    return {name: wider * part for name, part in parts.items()}, covariance


def _pressure_removed(
    inverse_map: InverseMap, flown: FloatArray, node_area: FloatArray, observed: PriorObservability
) -> tuple[FloatArray | None, float | None]:
    """Return 1 - variance of the error at ``flown`` (k, 4) / variance over the snapshots; None without a field.

    That is (n_p,) at each node, and area-weighted over the surface.
    """
    manifold = inverse_map.manifold
    if manifold is None or manifold.surface_field is None:
        return None, None
    estimates = estimated_at(Estimator(inverse_map), flown, ALL)
    scale = inverse_map.nominal_dynamic_pressure / estimates.air_data.value[:, -1]
    remaining = np.mean([(scale[k] * estimates[k].pressure().std) ** 2 for k in range(len(flown))], axis=0)
    prior = np.broadcast_to(observed.node_std, remaining.shape) ** 2
    fraction = np.divide(remaining, prior, out=np.full(len(remaining), np.nan), where=prior > 0.0)
    return 1.0 - fraction, 1.0 - float(node_area @ remaining / (node_area @ prior))
