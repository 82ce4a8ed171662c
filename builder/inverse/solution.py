"""The solution of either case from snapshots, strain and loads per pressure, and noise."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, cast

import numpy as np

from builder.inverse.ensemble import Ensemble, rolled_modes, turned_to_gauges
from builder.inverse.mode_choice import (
    MIN_STRAIN_OVER_ERRORS,
    MIN_STRAIN_OVER_NOISE,
    choice_record,
)
from builder.inverse.noise.flow_models import flow_model_errors
from builder.inverse.noise.flows_between import SolvedFlows
from builder.inverse.noise.hardware_errors import HardwareError, MeshError
from builder.inverse.noise.model import NoiseModel, NoiseTerm, truncated_modes
from builder.inverse.sensor_set import SensorSet
from builder.vehicle.gauges.sensor_entries import Sensors
from builder.vehicle.map_options import MapEntry, Noise
from builder.vehicle.model_form import ModelForm, model_form
from builder.vehicle.shape.shape_entries import ReferenceQuantities
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.sensors import InertiaMap, ThermalMap
from strainfmu.linear.pressure_modes import (
    LowRankPrior,
    PressureModes,
    prior_of_snapshots,
    proper_orthogonal_decomposition,
)
from strainfmu.linear.regularisation import Rule, expected_data, select_gamma
from strainfmu.linear.state_map import (
    StateMap,
    gaussian_map,
    least_squares_map,
    relative_condition,
    whitened_spectrum,
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """A solved problem: p = mean + field_modes q with q from ``solved``.

    Attributes
    ----------
    solved : the state map.
    noise : all terms of its covariance.
    mean : (n_p,) [Pa].
    field_modes : (n_p, n_q) V_r [1] or F [Pa].
    facts : numbers for the map's provenance.
    unresolved : (n_p,) variance of the pressure that no state holds [Pa^2]; None where nothing or not wanted.
    """

    solved: StateMap
    noise: NoiseModel
    mean: FloatArray
    field_modes: FloatArray
    facts: dict[str, Any]
    unresolved: FloatArray | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Problem:
    """The inputs of an inverse map.

    Attributes
    ----------
    ensemble : the pressure fields.
    strain_operator : (n_d, n_p) Z_p [1/Pa].
    load_operator : (n_f, n_p) G C_map [m2, m3], of the five loads, then of those behind them.
    node_area : (n_p,) area of the nodes [m2].
    noise : terms without the truncated modes.
    errors : errors of the terms that follow the current strain.
    entry, tolerances, stated_sensors : sections [map], [noise] and [sensors] of the vehicle file.
    reference : what coefficients are referred to.
    inside : internal pressure [Pa], or "ambient".
    flows : the snapshots, and what more flows round the body are solved by; None where no tables are made.
    mesh : error of strain by the structure's mesh, where it is known; what counts of it is among ``errors``.
    sensors : sensors other than the strain gauges, whose rows follow the gauges'; None for none.
    thermal, inertia : modes of the wall's temperature and of inertia, which are among ``noise``; None for none.
    off_the_snapshots : (k, n_p) what of flows between the snapshots is no combination of these, which is among
        ``noise``, see :meth:`~builder.inverse.noise.flows_between.FlowsBetween.off_the_snapshots`
        [Pa]; None where it is not counted.
    leeward : (k, n_p) error of the pressure on the leeward side, see
        :func:`~builder.inverse.noise.flow_models.leeward_fields` [Pa]; None for none.
    newtonian : the flows of ``ensemble`` by newtonian theory, where their difference is stated.
    """

    ensemble: Ensemble
    strain_operator: FloatArray
    load_operator: FloatArray
    node_area: FloatArray
    noise: tuple[NoiseTerm, ...]
    errors: tuple[HardwareError, ...]
    entry: MapEntry
    tolerances: Noise
    reference: ReferenceQuantities
    inside: float | Literal["ambient"]
    flows: SolvedFlows | None = None
    stated_sensors: Sensors | None = None
    mesh: MeshError | None = None
    sensors: SensorSet | None = None
    thermal: ThermalMap | None = None
    inertia: InertiaMap | None = None
    off_the_snapshots: FloatArray | None = None
    leeward: FloatArray | None = None
    newtonian: Ensemble | None = None

    @property
    def model_form(self) -> ModelForm:
        """Sizes of the model-form error."""
        return model_form(self.entry, self.tolerances)

    @property
    def offset(self) -> FloatArray:
        """(n_d,) readings at the nominal dynamic pressure that no surface pressure makes [m/m]."""
        offset = np.zeros(len(self.strain_operator))
        if self.sensors is not None:
            offset[-len(self.sensors.rows) :] = self.sensors.offset
        return offset

    @cached_property
    def strain(self) -> FloatArray:
        """(n, n_d) readings of the members of the ensemble at the nominal dynamic pressure [m/m]."""
        return self.ensemble.responses(self.strain_operator) + self.offset

    @cached_property
    def modes(self) -> PressureModes:
        """The POD in the inner product of the map; pairs of a rolled one are turned to the gauges."""
        weights = area_weights(self.node_area) if self.entry.inner_product == "area" else None
        if self.ensemble.grid is None:
            return proper_orthogonal_decomposition(self.ensemble.pressure, weights)
        modes = rolled_modes(self.ensemble, weights)
        return turned_to_gauges(modes, self.noise[0].whitened(self.strain_operator @ modes.modes))

    @cached_property
    def strain_of_modes(self) -> FloatArray:
        """(n_d, k) Z_p V of :attr:`modes` [1/Pa]."""
        return self.strain_operator @ self.modes.modes

    @cached_property
    def noise_model(self) -> NoiseModel:
        """The terms without the truncated modes together."""
        return NoiseModel(self.noise)

    @cached_property
    def flow_models(self) -> tuple[NoiseTerm, ...]:
        """Terms of :mod:`builder.inverse.noise.flow_models`, which are not among ``noise``: see
        :func:`with_flow_models`; none without :attr:`flows`."""
        if self.flows is None:
            return ()
        operators = self.strain_operator, self.load_operator
        return flow_model_errors(self.model_form, self.flows.snapshots, self.ensemble, self.newtonian, *operators)

    @cached_property
    def solution(self) -> Solution:
        """The solution of the case of :attr:`entry`; an :class:`InputError` names the entry where it has none."""
        return _solve_case_1(self) if self.entry.case == 1 else _solve_case_2(self)


def with_flow_models(problem: Problem) -> Problem:
    """Return ``problem`` with the level and the difference of flow models among its noise.

    For linear maps that stand in for tables which strain does not fit. A linear map alone would identify single
    gauges that err less well, and its loads on flows as the snapshots' would be wrong by up to a quarter more.
    """
    return replace(problem, noise=problem.noise + problem.flow_models)


def _solve_case_1(problem: Problem) -> Solution:
    modes, strain_of_modes, states, choice = ordered_modes(problem)
    n_states = len(states)
    noise = _with_truncated(problem, modes, n_states, strain_of_modes)
    std, z = modes.coefficient_std[:n_states], strain_of_modes[:, :n_states]
    mean_strain = _mean_strain(problem, modes.mean)
    solved = least_squares_map(z, mean_strain, noise.covariance, std, noise.whitening)
    # The published scaling: 100 um/m per gauge, states in units of their root mean square norm over the snapshots.
    relative = relative_condition(
        z, strain_norm=1e-4 * np.sqrt(len(z)), state_norm=1.0, state_scale=float(np.linalg.norm(std))
    )
    facts = {
        "modes": n_states,
        "modes_skipped": [mode + 1 for mode in range(states[-1]) if mode not in states],
        "mode_choice": choice,
        "energy_of_modes": float(modes.energy[n_states - 1]),
        "condition_number": solved.condition_number,
        "relative_condition_number": relative.value,
        "relative_condition_scaling": relative.scaling,
    }
    return Solution(
        solved=solved,
        noise=noise,
        mean=modes.mean,
        field_modes=modes.modes[:, :n_states],
        facts=facts,
        unresolved=_unresolved(problem, modes, n_states),
    )


def _solve_case_2(problem: Problem) -> Solution:
    entry = problem.entry
    if entry.prior_modes is None:
        prior, noise, energy, unresolved = _whole_prior(problem), problem.noise_model, 1.0, None
    else:
        modes = problem.modes
        prior = prior_of_modes(modes, entry.prior_modes)
        noise = _with_truncated(problem, modes, entry.prior_modes, problem.strain_of_modes)
        energy = float(modes.energy[entry.prior_modes - 1])
        unresolved = _unresolved(problem, modes, entry.prior_modes)
    state_operator = problem.strain_operator @ prior.factor
    spectrum = whitened_spectrum(state_operator, noise.covariance)
    gamma = entry.gamma
    if isinstance(gamma, str):
        gamma = select_gamma(cast(Rule, gamma), expected_data(spectrum.eigenvalues, len(spectrum.left_vectors)))
    mean_strain = _mean_strain(problem, prior.mean)
    solved = gaussian_map(state_operator, mean_strain, noise.covariance, gamma, spectrum)
    facts = {
        "modes": prior.n_states,
        "energy_of_modes": energy,
        "gamma": gamma,
        "gamma_rule": entry.gamma if isinstance(entry.gamma, str) else "fixed",
        "recoverable_modes": solved.n_recoverable,
        "hessian_eigenvalues": spectrum.eigenvalues.tolist(),
    }
    return Solution(
        solved=solved,
        noise=noise,
        mean=prior.mean,
        field_modes=prior.factor,
        facts=facts,
        unresolved=unresolved,
    )


def prior_of_modes(modes: PressureModes, n_modes: int) -> LowRankPrior:
    """Return the prior truncated to the first ``n_modes`` POD modes: F = V_r diag(standard deviations)."""
    available = modes.modes.shape[1]
    if not 1 <= n_modes <= available:
        raise InputError(
            f"map.prior_modes: {n_modes} found, at most {available} with {modes.n_snapshots} snapshots"
        )
    return LowRankPrior(modes.mean, modes.modes[:, :n_modes] * modes.coefficient_std[:n_modes])


def area_weights(node_area: FloatArray) -> FloatArray:
    """Return the weights (n_p,) of the area-weighted inner product: area [m2] over the mean area.

    With this scaling coefficients keep the unit Pa, and equal areas give the Euclidean inner product.
    """
    missing = int(np.sum(~(node_area > 0.0)))
    if missing:
        raise InputError(
            f"map.inner_product: 'area' found, but {missing} of {len(node_area)} nodes have no area; "
            "use 'euclidean'"
        )
    return node_area / node_area.mean()


def ordered_modes(problem: Problem) -> tuple[PressureModes, FloatArray, list[int], dict[str, Any]]:
    """Return the POD with the states of Case 1 first, its strain (n_d, k) [1/Pa], and :func:`mode_choice`.

    Raises
    ------
    InputError
        More modes requested than gauges or snapshots carry, or the gauges observe none.
    """
    states, record = mode_choice(problem)
    order = [*states, *(mode for mode in range(problem.modes.modes.shape[1]) if mode not in states)]
    return problem.modes.reordered(order), problem.strain_of_modes[:, order], states, record


def mode_choice(problem: Problem) -> tuple[list[int], dict[str, Any]]:
    """Return which of the pressure modes are states of Case 1, by index, and the choice for a map's provenance.

    Modes are tried by falling energy, until there are ``map.modes`` states. A mode is a state if its strain at one
    standard deviation, without the part that states before it explain, is at least :data:`MIN_STRAIN_OVER_NOISE`
    times the gauges' own noise and :data:`MIN_STRAIN_OVER_ERRORS` times all errors together. A weaker one, kept as
    a free state, would add noise to the loads; it stays with the truncated modes.

    Raises
    ------
    InputError
        As :func:`ordered_modes`.
    """
    modes = problem.modes
    wanted, n_gauges, available = problem.entry.modes, len(problem.strain_operator), modes.modes.shape[1]
    if wanted > min(n_gauges, available):
        raise InputError(
            f"map.modes: {wanted} found, at most {min(n_gauges, available)} with {n_gauges} gauges and "
            f"{modes.n_snapshots} snapshots"
        )
    variance = modes.coefficient_std**2 * (problem.node_area @ modes.modes**2)
    of_modes = problem.strain_of_modes * modes.coefficient_std
    whitened = [problem.noise[0].whitened(of_modes), problem.noise_model.whitening @ of_modes]
    bases = [np.empty((n_gauges, 0))] * 2
    states: list[int] = []
    left_out: list[dict[str, Any]] = []
    for mode in range(available):
        if len(states) >= wanted:
            break
        new = [
            columns[:, mode] - basis @ (basis.T @ columns[:, mode])
            for columns, basis in zip(whitened, bases, strict=True)
        ]
        over_noise, over_errors = sizes = [float(np.linalg.norm(part)) for part in new]
        if over_noise >= MIN_STRAIN_OVER_NOISE and over_errors >= MIN_STRAIN_OVER_ERRORS:
            states.append(mode)
            bases = [np.column_stack([b, part / size]) for b, part, size in zip(bases, new, sizes, strict=True)]
        else:
            left_out.append(
                {
                    "mode": mode + 1,
                    "fraction_of_variance": float(variance[mode] / variance.sum()),
                    "strain_over_noise": over_noise,
                    "strain_over_errors": over_errors,
                }
            )
    if not states:
        raise InputError(f"map.modes: the {n_gauges} gauges observe none of the {available} modes")
    return states, choice_record(wanted, [mode + 1 for mode in states], left_out)


def _whole_prior(problem: Problem) -> LowRankPrior:
    """Return the prior of all snapshots, at all roll angles where the ensemble is rolled."""
    if problem.ensemble.grid is None:
        return prior_of_snapshots(problem.ensemble.pressure)
    modes = rolled_modes(problem.ensemble, None)
    return prior_of_modes(modes, modes.modes.shape[1])


def _with_truncated(
    problem: Problem, modes: PressureModes, n_states: int, strain_of_modes: FloatArray
) -> NoiseModel:
    if not problem.tolerances.with_truncated_modes or n_states == modes.modes.shape[1]:
        return problem.noise_model
    load_of_modes = problem.load_operator @ modes.modes
    return NoiseModel((*problem.noise, truncated_modes(strain_of_modes, load_of_modes, modes, n_states)))


def _unresolved(problem: Problem, modes: PressureModes, n_states: int) -> FloatArray | None:
    """Return (n_p,) variance of the pressure of the modes beyond ``n_states``, where the map has the field."""
    if not problem.entry.keep_field:
        return None
    variance = modes.coefficient_std[n_states:] ** 2
    unresolved = np.asarray(
        np.einsum("pm,pm,m->p", modes.modes[:, n_states:], modes.modes[:, n_states:], variance)
    )
    for fields in (problem.off_the_snapshots, problem.leeward):
        if fields is not None:
            unresolved += np.sum(fields**2, axis=0)
    return unresolved


def _mean_strain(problem: Problem, mean: FloatArray) -> FloatArray:
    strain: FloatArray = problem.strain_operator @ (mean - problem.ensemble.fixed_pressure)
    return strain + problem.offset
