"""Estimators of several kinds on the same readings: maps that are built for the errors of a case, a Kalman filter
whose states walk at random, and learning estimators of scikit-learn, which are trained on flights that the tables
and errors of the nonlinear estimator give. So every estimator of a comparison knows the same of flows and errors.

A name may state what is given of the air data: "nonlinear, q_inf only", "nonlinear, M and p_inf only".

The error of a pressure field is |p_estimate - p| / |p| over the pressure nodes of the map, p absolute, in the
Euclidean norm: the error of the reproduction of the source (:mod:`builder.reproduce.case_1`).

The filter, on a linear map of Case 2, is the estimator of load from strain that many works use:
d = d_0 + s (m - d_0 + A q) + e with q + w in the next cycle, e and w white. The states are standard normal when a
flight begins. What is not white, as the error of a gain, is the same in all cycles, and the filter takes it for
noise that averages out.

Learning estimators have no covariance. Their bands come from split conformal prediction (Lei et al., J. Am. Stat.
Assoc. 113, 2018): the quantile of the absolute residual over flights that they were not trained on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from math import ceil
from time import perf_counter
from typing import Any

import numpy as np

from builder.aero.surface.mesh import mesh_of, mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.problem import AnyStructure
from builder.manifold.nonlinear_build import with_manifold
from builder.processors import one_thread_of_blas
from builder.trial.bound import KNOWN, cramer_rao_bound, without_field_errors
from builder.trial.cases import Case
from builder.trial.conditions import drawn_altitudes_km, quantities
from builder.trial.estimators import EstimateReadings, Estimates, estimate_of, with_inputs
from builder.trial.readings import ANGLES, Readings, World, field_errors
from builder.truth.flow_table import FlowTable, ratio_at, truth_surface
from builder.truth.shape import at_conditions, on_nodes
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import MapEntry
from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, pressure_and_temperature
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.map.inverse_map import PER_PRESSURE, InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.air import air_data_at
from strainfmu.estimator.reference.nonlinear import strain_covariance

LINEAR_1, LINEAR_2, NONLINEAR, RANDOM_WALK = "linear Case 1", "linear Case 2", "nonlinear", "Kalman filter"

REGRESSIONS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "regression tree": ("tree", "DecisionTreeRegressor", {"min_samples_leaf": 3}),
    "random forest": (
        "ensemble",
        "RandomForestRegressor",
        {"n_estimators": 50, "max_features": 0.3, "min_samples_leaf": 2},
    ),
    "gradient boosting": ("ensemble", "HistGradientBoostingRegressor", {"max_iter": 200}),
    "multi-layer perceptron": (
        "neural_network",
        "MLPRegressor",
        {"hidden_layer_sizes": (64, 64), "max_iter": 150, "tol": 1e-6, "early_stopping": True},
    ),
}
"""Module and class of scikit-learn, and its arguments."""

NAMES = (LINEAR_1, LINEAR_2, NONLINEAR, RANDOM_WALK, *REGRESSIONS)

INPUTS = {"": KNOWN, "q_inf only": (DYNAMIC_PRESSURE,), "M and p_inf only": (MACH_NUMBER, STATIC_PRESSURE)}
"""What is given of the air data, by the end of an estimator's name."""

AIR_DATA, FIELD = (*ANGLES, MACH_NUMBER, STATIC_PRESSURE, DYNAMIC_PRESSURE), "pressure field"
"""What is scored besides loads, by the names of the table."""

DISCREPANCY = {
    "discrepancy_percent": 0.8,
    "discrepancy_of_prior_percent": 1.0,
    "discrepancy_of_overpressure_percent": 1.0,
    "discrepancy_of_leeward_percent": 1.0,
}
"""Entries of a map that knows of gauge noise alone."""

ALTITUDES_KM = (15.0, 28.0)
"""Of training flights, where the map holds there."""

PIECE = 500
"""Flights at a time whose errors are drawn: their covariances are n_d by n_d each."""


def refuse_unknown(names: Sequence[str]) -> None:
    """Refuse estimators that there are not."""
    for name in names:
        kind, _, inputs = name.partition(", ")
        if kind not in NAMES or inputs not in INPUTS:
            ends = ", ".join(end for end in INPUTS if end)
            raise InputError(f"estimators: expected {', '.join(NAMES)}, or with an end of {ends}; got '{name}'")


def knowing(vehicle: Vehicle, is_exact: bool, case: int) -> Vehicle:
    """Return ``vehicle`` with a map of ``case`` with tables and field, which knows of gauge noise alone or of all
    errors."""
    entry = vehicle.map.model_dump() | {
        "case": case,
        "form": PER_PRESSURE,
        "symmetry": "full" if vehicle.is_axisymmetric else "listed",
        "estimator": NONLINEAR,
        "gamma": 1.0,
        "keep_field": True,
    }
    noise = vehicle.noise.without_hardware_errors() if is_exact else vehicle.noise
    return vehicle.model_copy(
        update={"map": MapEntry(**entry | (DISCREPANCY if is_exact else {})), "noise": noise}
    )


def maps_for(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, is_exact: bool
) -> dict[str, InverseMap]:
    """Return the linear maps of both cases, and the first one with tables.

    Raises
    ------
    InputError
        The flows of the map do not suffice for tables.
    """
    first, second = (knowing(vehicle, is_exact, case) for case in (1, 2))
    maps = {
        name: build_inverse_map(entry, snapshots, structure)
        for name, entry in ((LINEAR_1, first), (LINEAR_2, second))
    }
    tables = with_manifold(inverse_map=maps[LINEAR_1], vehicle=first, snapshots=snapshots, structure=structure)
    return {**maps, NONLINEAR: tables}


@dataclass(eq=False, kw_only=True)
class ComparedWorld(World):
    """A world whose maps are built for the errors of each case.

    Attributes
    ----------
    snapshots, map_structure : what the maps are built from.
    training : flights that each regression learns from; a third as many are for its bands.
    """

    snapshots: Snapshots
    map_structure: AnyStructure
    training: int

    def maps(self, case: Case) -> dict[str, InverseMap]:
        """Return the maps that know of the errors of ``case``, by estimator."""
        is_exact = not case.as_built.stated
        return self.once(is_exact, lambda: maps_for(self.vehicle, self.snapshots, self.map_structure, is_exact))

    def bound(self, case: Case, estimator: str = "") -> FloatArray | None:
        """Return (k, 5) the Cramer-Rao bound with what ``estimator`` is given; None of one of many readings."""
        kind, _, inputs = estimator.partition(", ")
        if kind == RANDOM_WALK:
            return None
        conditions, std = self.flights(case).conditions, np.nan if case.as_built.stated else 0.0
        return cramer_rao_bound(self.maps(case)[NONLINEAR], conditions, INPUTS[inputs], std)

    def fields(self, case: Case) -> FloatArray:
        """Return (k, n_p) [Pa] the true pressure at the nodes of the maps."""
        conditions, nodes = self.flights(case).conditions, mesh_of(self.map_structure.surface)
        if isinstance(self.flows, Snapshots):
            flows = at_conditions(self.flows, conditions)
            return on_nodes(flows.surface, flows.pressure, nodes)
        assert isinstance(self.flows, FlowTable)
        surface = truth_surface(self.vehicle)
        ratio = ratio_at(self.flows, conditions, surface.roll_angle)
        ambient = quantities(conditions, STATIC_PRESSURE)
        return on_nodes(mesh_of_grid(surface), ambient[:, None] * ratio, nodes)

    def learned(self, case: Case, kind: str, with_mach: bool) -> EstimateReadings:
        """Return a regression that is trained on the tables for ``case``."""
        is_exact = not case.as_built.stated

        def trained() -> EstimateReadings:
            manifold = self.maps(case)[NONLINEAR].manifold
            random = np.random.default_rng([self.seed, not is_exact])
            assert manifold is not None
            altitudes = drawn_altitudes_km(self.vehicle, ALTITUDES_KM)
            training, calibration = (
                training_flights(manifold, altitudes, count, random)
                for count in (self.training, self.training // 3)
            )
            if not with_mach:
                training = replace(training, known={DYNAMIC_PRESSURE: training.known[DYNAMIC_PRESSURE]})
            return of_regression(kind, training, calibration, self.seed)

        return self.once((is_exact, kind, with_mach), trained)


def compared_estimators(world: ComparedWorld, case: Case, names: Sequence[str]) -> dict[str, EstimateReadings]:
    """Return the estimators of ``names`` for ``case``."""
    maps, fields = world.maps(case), cache(lambda: world.fields(case))

    def made(kind: str, inputs: str) -> EstimateReadings:
        if kind in REGRESSIONS:
            return world.learned(case, kind, MACH_NUMBER in INPUTS[inputs])
        if kind == RANDOM_WALK:
            return of_random_walk(maps[LINEAR_2])
        inverse_map = maps[kind]
        estimator = Estimator(inverse_map if kind == NONLINEAR else inverse_map.without_tables())
        return lambda read: _with_field(estimator, read, fields()[read.flight])

    parts = {name: name.partition(", ") for name in names}
    return {name: with_inputs(made(kind, inputs), INPUTS[inputs]) for name, (kind, _, inputs) in parts.items()}


def _with_field(estimator: Estimator, read: Readings, field_pressure: FloatArray) -> Estimates:
    """Return the estimates of last readings, with M_R where it is estimated and known, air data, and the error of
    the field relative to the true one (n, n_p) [Pa]."""
    made = estimate_of(estimator, read)
    value, std, extras = made.coefficients, made.coefficients_std, dict[str, tuple[FloatArray, FloatArray]]()
    if read.truth.shape[1] > value.shape[1] and made.other_coefficients.shape[-1]:
        value, std = np.column_stack([value, made.M_R]), np.column_stack([std, made.sigma.M_R])
    if estimator.is_nonlinear:
        columns = [(name, AIR_DATA_NAMES.index(name)) for name in AIR_DATA]
        extras = {name: (made.air_data.value[:, k], made.air_data.std[:, k]) for name, k in columns}
    pressure = estimated_fields(made, np.broadcast_to(read.known.get(STATIC_PRESSURE, np.nan), len(value)))
    if not np.isnan(pressure).any():
        error = np.linalg.norm(pressure - field_pressure, axis=1) / np.linalg.norm(field_pressure, axis=1)
        extras[FIELD] = error, np.full(len(value), np.nan)
    return Estimates(value=value, std=std, health=np.asarray(made.health, dtype=np.int64), extras=extras)


def estimated_fields(made: Estimate, static_pressure: FloatArray) -> FloatArray:
    """Return (k, n_p) [Pa] the absolute pressure at the nodes of a map by its estimates, NaN where it has none.

    Strain of a vented body says nothing of p_inf: to a field that is p - p_inf, ``static_pressure`` (k,) is added.
    """
    fields = [made[sample].pressure(with_std=False) for sample in range(len(made))]
    ambient = [
        p_inf if field.is_net else 0.0 for field, p_inf in zip(fields, static_pressure.tolist(), strict=True)
    ]
    return np.stack([field.pressure for field in fields]) + np.array(ambient)[:, None]


def training_flights(
    manifold: ManifoldMap, altitudes_km: tuple[float, float], count: int, random: np.random.Generator
) -> Readings:
    """Return ``count`` flights, uniform in Mach number, ln p_inf and the disc of total incidence.

    Where the tables have ranges of u and w, it draws from these instead of the disc. ``altitudes_km`` are the
    lowest and highest. The truth (k, 7) is the coefficients [1], angle of attack and sideslip [rad].
    """
    state = np.empty((count, 4))
    if manifold.crossflow_range is None:
        incidence = manifold.incidence_limit * np.sqrt(random.uniform(0.0, 1.0, count))
        roll = random.uniform(0.0, 2.0 * np.pi, count)
        state[:, U], state[:, W] = incidence * np.cos(roll), incidence * np.sin(roll)
    else:
        low, high = manifold.crossflow_range.T
        state[:, [U, W]] = low + (high - low) * random.uniform(size=(count, 2))
    state[:, MACH] = random.uniform(manifold.mach_range[0], manifold.mach_range[1], count)
    high, low = (np.log(pressure_and_temperature(1e3 * height)[0]) for height in altitudes_km)
    state[:, LOG_PRESSURE] = random.uniform(low, high, count)
    pressure, mach = np.exp(state[:, LOG_PRESSURE]), state[:, MACH]
    strain, loads = with_drawn_errors(manifold, state, random)
    dynamic = 0.5 * HEAT_CAPACITY_RATIO * mach**2 * pressure
    known = {
        DYNAMIC_PRESSURE: dynamic * (1.0 + manifold.dynamic_pressure_error * random.standard_normal(count)),
        MACH_NUMBER: mach + manifold.mach_number_error * random.standard_normal(count),
    }
    truth = np.hstack([loads / (dynamic[:, None] * manifold.references), air_data_at(state)[:, :2]])
    number = np.arange(count)
    return Readings(strain=strain, known=known, truth=truth, vehicle=number, flight=number)


def with_drawn_errors(
    manifold: ManifoldMap, state: FloatArray, random: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return strain (k, n_d) and loads (k, 5) of the tables at ``state`` (k, 4) with all errors of the map drawn.

    Strain then has the covariance of :func:`~strainfmu.estimator.reference.nonlinear.strain_covariance`.
    """
    strain, loads = field_errors(manifold, state, random)
    response, n_d = evaluate(manifold.tables, state).value, strain.shape[1]
    sound, noise = without_field_errors(manifold), list[FloatArray]()
    for part in np.array_split(state, ceil(len(state) / PIECE)):
        root = np.linalg.cholesky(strain_covariance(sound, sound.gauge_covariance, part))
        noise.append((root @ random.standard_normal((len(part), n_d, 1)))[:, :, 0])
    return response[:, :n_d] + strain + np.concatenate(noise), response[:, n_d:][:, FIVE_LOADS] + loads


STEP_STD = 0.1
"""Standard deviation of the walk in one cycle, over the prior's: at 100 Hz it reaches the prior's in 1 s."""

State = tuple[FloatArray, FloatArray]
"""Mean (k, n_q) and covariance (k, n_q, n_q), or one for all, of the states of k flights."""


def of_random_walk(inverse_map: InverseMap) -> EstimateReadings:
    """Return the filter on ``inverse_map``, of Case 2 and form "dynamic_pressure", fed with all readings of a
    flight; its estimates are the ones after the last."""

    def estimate(read: Readings) -> Estimates:
        q, n = np.asarray(read.known[DYNAMIC_PRESSURE]), inverse_map.state_operator.shape[1]
        ratio, state = q / inverse_map.nominal_dynamic_pressure, (np.zeros((len(q), n)), np.eye(n))
        for strain in np.swapaxes(read.strain, 0, 1):
            state = after_reading(inverse_map, state, strain, ratio)
        return _loads_of(inverse_map, state, q)

    return estimate


def after_reading(inverse_map: InverseMap, state: State, strain: FloatArray, ratio: FloatArray) -> State:
    """Return the states after ``strain`` (k, n_d) at ``ratio`` (k,) of q_inf to the nominal one."""
    mean, s, fixed = state[0], ratio[:, None, None], inverse_map.fixed_strain
    operator = s * inverse_map.state_operator
    covariance = state[1] + STEP_STD**2 * np.eye(mean.shape[1])
    cross = covariance @ np.swapaxes(operator, 1, 2)
    of_strain = operator @ cross + inverse_map.gauge_covariance + s * s * inverse_map.scaled_covariance
    gain = np.swapaxes(np.linalg.solve(of_strain, np.swapaxes(cross, 1, 2)), 1, 2)
    expected = fixed + ratio[:, None] * (inverse_map.mean_strain - fixed) + (operator @ mean[:, :, None])[:, :, 0]
    mean = mean + (gain @ (strain - expected)[:, :, None])[:, :, 0]
    return mean, covariance - gain @ np.swapaxes(cross, 1, 2)


def _loads_of(inverse_map: InverseMap, state: State, q: FloatArray) -> Estimates:
    """Return the coefficients of states at a dynamic pressure ``q`` (k,) [Pa]."""
    mean, covariance = state
    s = (q / inverse_map.nominal_dynamic_pressure)[:, None]
    fixed, error = inverse_map.fixed_load[FIVE_LOADS], inverse_map.error_load[FIVE_LOADS]
    of_mean, per_state = inverse_map.load_of_mean[FIVE_LOADS], inverse_map.load_per_state[FIVE_LOADS]
    loads = fixed + s * (of_mean - fixed + mean @ per_state.T)
    of_loads = (s * s)[:, :, None] * (per_state @ covariance @ per_state.T + error @ error.T)
    scale = 1.0 / (q[:, None] * inverse_map.references[FIVE_LOADS])
    value = scale * loads
    variance = (
        scale**2 * np.diagonal(of_loads, axis1=1, axis2=2) + (inverse_map.dynamic_pressure_error * value) ** 2
    )
    return Estimates(value=value, std=np.sqrt(variance))


LEVEL = 0.9973
"""Probability of 3 sigma of a normal error."""

COST_TRAINING, COST_STEPS = 500, 31
"""Flights that each learns from where its time per step is measured, which hardly depends on them; and steps that
the time is the median of."""


def conformal_half_width(residual: FloatArray) -> FloatArray:
    """Return (m,) half-widths of bands that hold a new value with :data:`LEVEL`; ``residual`` is (n, m).

    With fewer than 370 residuals there is no such band: it is infinite.
    """
    rank = ceil((len(residual) + 1) * LEVEL)
    if rank > len(residual):
        return np.full(residual.shape[1], np.inf)
    return np.asarray(np.sort(np.abs(residual), axis=0)[rank - 1])


def of_regression(name: str, training: Readings, calibration: Readings, seed: int) -> EstimateReadings:
    """Return a regression on strain over q_inf, ln q_inf and, where ``training`` gives it, Mach number; its bands
    are of ``calibration``. A third of a band stands for the standard deviation."""

    def features(read: Readings) -> FloatArray:
        q = np.asarray(read.known[DYNAMIC_PRESSURE])[:, None]
        mach = [np.asarray(read.known[MACH_NUMBER])[:, None]] if MACH_NUMBER in training.known else []
        return np.hstack([read.last / q, np.log(q), *mach])

    def scaled(read: Readings) -> FloatArray:
        return np.asarray((features(read) - feature_mean) / feature_std)

    def predicted(read: Readings) -> FloatArray:
        with one_thread_of_blas():
            return np.asarray(mean + std * model.predict(scaled(read)))

    def estimate(read: Readings) -> Estimates:
        value = predicted(read)
        bands = np.broadcast_to(half_width / 3.0, value.shape)
        angles = {name: (value[:, 5 + k], bands[:, 5 + k]) for k, name in enumerate(ANGLES)}
        return Estimates(value=value[:, :5], std=bands[:, :5], extras=angles)

    known = features(training)
    feature_mean, feature_std = known.mean(axis=0), known.std(axis=0)
    mean, std = training.truth.mean(axis=0), training.truth.std(axis=0)
    module, kind, arguments = REGRESSIONS[name]
    model = getattr(import_module(f"sklearn.{module}"), kind)(**arguments, random_state=seed)
    if kind == "HistGradientBoostingRegressor":  # of one value
        model = import_module("sklearn.multioutput").MultiOutputRegressor(model)
    with one_thread_of_blas():
        model.fit(scaled(training), (training.truth - mean) / std)
    half_width = conformal_half_width(calibration.truth - predicted(calibration))
    return estimate


def step_costs(manifold: ManifoldMap, seed: int = 1) -> dict[str, float]:
    """Return the median time per step [s] of each regression, in Python; needs scikit-learn."""
    random = np.random.default_rng(seed)
    training, calibration = (
        training_flights(manifold, ALTITUDES_KM, count, random) for count in (COST_TRAINING, COST_TRAINING // 4)
    )
    single = calibration.rows(slice(1))

    def cost(name: str) -> float:
        estimate, times = of_regression(name, training, calibration, seed), list[float]()
        for _ in range(1 + COST_STEPS):
            start = perf_counter()
            estimate(single)
            times.append(perf_counter() - start)
        return float(np.median(times[1:]))

    return {f"{name} of scikit-learn, trained on {COST_TRAINING:,} flights": cost(name) for name in REGRESSIONS}
