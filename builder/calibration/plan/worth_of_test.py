"""What a finished test is worth in flight: sigmas before and after it, the best further case, loads it covered."""

from dataclasses import dataclass

import numpy as np

from builder.aero.load_operator import load_operator_on
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.regression import applied_loads
from builder.calibration.ground_test.candidate_cases import (
    LoadLimits,
    attitude_cases,
    candidate_cases,
)
from builder.calibration.ground_test.load_changes import cell_force
from builder.calibration.ground_test.load_test import LoadTest
from builder.calibration.plan.case_selection import Knowledge, log_product, no_knowledge
from builder.calibration.plan.load_plan import (
    PlanParts,
    case_sensitivities,
    exactly_known_map,
    flight_sensitivity,
    planned_test,
    within_limits,
)
from builder.inverse.ensemble import ensemble_of
from builder.inverse.problem import on_structure
from builder.structure.as_built.displaced_structure import AnyAsBuilt
from builder.structure.loads.applied import Weight
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.other_loads import FIVE_LOADS

STATIONS, ROLL_ANGLES = 5, tuple(np.deg2rad([0.0, 90.0, 180.0, 270.0]).tolist())
"""Pads that are offered as the further case."""

USUAL_FORCE = 1000.0
"""Force of a pad where the test had none [N]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class WorthOfTest:
    """What a test is worth in flight.

    Attributes
    ----------
    before, after, exact : (5,) sigma of the coefficients by the drawing's tolerances, after the test, and of a
        vehicle that is known exactly [1].
    further : name of the case that would lower them most, and ``with_further`` (5,) what it would leave.
    flight_loads, ground_loads : (n, 5) loads of the flows, and of the cases that were used [N, N m].
    flight_strain, ground_strain : (n_d,) largest strain of every gauge in flight and in the cases [m/m].
    spanned : part of the mean square strain in flight that combinations of the cases' strains make up, each gauge
        over its noise [1].
    """

    before: FloatArray
    after: FloatArray
    exact: FloatArray
    further: str
    with_further: FloatArray
    flight_loads: FloatArray
    ground_loads: FloatArray
    flight_strain: FloatArray
    ground_strain: FloatArray
    spanned: float


def worth_of_test(parts: PlanParts, fit: Estimate) -> WorthOfTest:
    """Return what the test of an estimate is worth.

    Raises
    ------
    InputError
        The map of a vehicle known exactly cannot be built.
    """
    exact = exactly_known_map(parts)
    flight = flight_sensitivity(parts, exact)
    after = Knowledge(flight=flight, covariance=_over_prior(parts, fit))
    test = further_test(parts.vehicle, parts.as_built, fit.model.test)
    sigmas = [after.sigmas_after(case) for case in case_sensitivities(parts, test)]
    best = int(np.argmin([log_product(sigma) for sigma in sigmas]))
    ensemble = ensemble_of(parts.vehicle, on_structure(parts.snapshots, parts.structure))
    station = parts.vehicle.reference.moment_station_m
    strain = ensemble.responses(parts.as_built.strain_operator(fit.parameters))
    ground, rows = _ground_strains(fit), fit.used.any(axis=1)
    return WorthOfTest(
        before=no_knowledge(flight).sigmas,
        after=after.sigmas,
        exact=flight.sigmas(np.zeros_like(flight.noise_covariance)),
        further=test.cases[best].name,
        with_further=sigmas[best],
        flight_loads=ensemble.responses(load_operator_on(parts.as_built.surface, station)[FIVE_LOADS]),
        ground_loads=applied_loads(fit.model, station, float(fit.parameters.mass[0]))[rows],
        flight_strain=np.abs(strain).max(axis=0),
        ground_strain=np.abs(ground).max(axis=0),
        spanned=_spanned(strain, ground, exact.noise_std[: strain.shape[1]]),
    )


def further_test(vehicle: Vehicle, structure: AnyAsBuilt, test: LoadTest) -> LoadTest:
    """Return cases that could follow: pads with the largest force of a test, attitudes that it did not have."""
    force = max((cell_force(known.load) for case in test.cases for known in case.loads), default=0.0)
    limits = LoadLimits(force=force or USUAL_FORCE, roll_angles=ROLL_ANGLES)
    offered = candidate_cases(vehicle, limits, structure.outer_span)
    stations = sorted({float(getattr(planned.loads[0], "station", 0.0)) for planned in offered})
    chosen = {stations[k] for k in np.linspace(0, len(stations) - 1, STATIONS).round().astype(int)}
    pads = [planned for planned in offered if getattr(planned.loads[0], "station", None) in chosen]
    had = {
        round(known.load.up_roll_angle, 3)
        for case in test.cases
        for known in case.loads
        if isinstance(known.load, Weight)
    }
    attitudes = [] if structure.weightless else attitude_cases(limits)
    new = [attitude for attitude, up in zip(attitudes, limits.attitudes, strict=False) if round(up, 3) not in had]
    cases = [*(within_limits(structure, pad, limits) for pad in pads), *new]
    return planned_test(structure, cases, test.errors, np.median(test.reading_stds, axis=0))


def _over_prior(parts: PlanParts, fit: Estimate) -> FloatArray:
    """Return the covariance (n + 1, n + 1) of vehicle and first load cell, over standard deviations before.

    What was known exactly before has none.
    """
    model = fit.model
    prior = np.append(parts.as_built.prior(parts.vehicle.calibration).vector, model.test.errors.common)
    entries = np.append(np.arange(model.n_built), model.entries["cell"][0, 0])
    scale = np.divide(1.0, prior, out=np.zeros_like(prior), where=prior > 0.0)
    return np.asarray(scale[:, None] * fit.covariance[np.ix_(entries, entries)] * scale)


def _ground_strains(fit: Estimate) -> FloatArray:
    """Return what the loads strain (n, n_d) in the cases that were used, zeros taken off [m/m]."""
    model = fit.model
    strain = fit.after - model.errors(fit.vector).zero[model.group_of_case]
    return np.asarray(strain[fit.used.any(axis=1)])


def _spanned(flight: FloatArray, ground: FloatArray, noise_std: FloatArray) -> float:
    """Return the part of the mean square of ``flight`` (n, n_d) in the span of ``ground`` (k, n_d)."""
    strain, scaled = flight / noise_std, ground / noise_std
    _, size, rows = np.linalg.svd(scaled, full_matrices=False)
    basis = rows[size > 1e-6 * size.max()]
    inside = strain @ basis.T
    return float(np.sum(inside**2) / np.sum(strain**2))
