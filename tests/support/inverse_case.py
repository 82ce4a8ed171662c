"""The numbers that the tests of the inverse problem share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.aero.engine import Engine
from builder.campaign.campaign_run import snapshots_of_flows, vehicle_campaign
from builder.campaign.scheduling import Scheduling, solve_flows
from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.model import NoiseModel, gauge_noise, truncated_modes
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import ConditionSet
from strainfmu.flight_condition import FlightCondition
from strainfmu.linear.pressure_modes import LowRankPrior, PressureModes
from strainfmu.linear.state_map import GaussianMap, LeastSquaresMap, gaussian_map, least_squares_map


@dataclass(frozen=True, eq=False)
class Case:
    """What the algebra of the inverse problem works on."""

    strain_operator: np.ndarray
    loads: np.ndarray
    modes: PressureModes
    noise_std: np.ndarray
    internal_pressure: float


def noise_model(case: Case, n_modes: int, with_truncated: bool = True) -> NoiseModel:
    """Return gauge noise and, by default, the modes beyond ``n_modes``."""
    of_gauges = gauge_noise(np.diag(case.noise_std**2))
    if not with_truncated or n_modes == case.modes.modes.shape[1]:
        return NoiseModel((of_gauges,))
    strain, load = (operator @ case.modes.modes for operator in (case.strain_operator, case.loads))
    return NoiseModel((of_gauges, truncated_modes(strain, load, case.modes, n_modes)))


def cross_covariance(noise: NoiseModel) -> np.ndarray | None:
    """(n_d, n_f) covariance of strain error and load that no state holds [m/m (N, N m)]; None of no load."""
    parts = [term.columns @ term.load.T for term in noise.terms if term.load is not None]
    return np.sum(parts, axis=0) if parts else None


def least_squares(case: Case, n_modes: int) -> LeastSquaresMap:
    """Return the map of Case 1 with the default noise."""
    z = case.strain_operator @ case.modes.modes[:, :n_modes]
    mean_strain = case.strain_operator @ (case.modes.mean - case.internal_pressure)
    noise = noise_model(case, n_modes)
    return least_squares_map(z, mean_strain, noise.covariance, case.modes.coefficient_std[:n_modes])


def gaussian(case: Case, prior: LowRankPrior, gamma: float = 1.0) -> GaussianMap:
    """Return the map of Case 2 with gauge noise alone."""
    mean_strain = case.strain_operator @ (prior.mean - case.internal_pressure)
    return gaussian_map(case.strain_operator @ prior.factor, mean_strain, np.diag(case.noise_std**2), gamma)


def estimated_field(prior: LowRankPrior, solved: GaussianMap, strain: np.ndarray) -> np.ndarray:
    """Return the estimated pressure (n_p,) [Pa] of ``strain`` (n_d,) [m/m]."""
    return np.asarray(prior.mean + prior.factor @ (solved.strain_gain @ strain + solved.state_offset))


def snapshots_at(engine: Engine, vehicle: Vehicle, conditions: Sequence[FlightCondition]) -> Snapshots:
    """Return the engine's pressures at ``conditions``, without a file."""
    campaign = vehicle_campaign(vehicle, engine, [ConditionSet("test", tuple(conditions))])
    keys = map(engine.flow_key, conditions)
    flows = {solution.flow.key: solution.flow for solution in solve_flows(engine, keys, Scheduling(workers=0))}
    return snapshots_of_flows(campaign, flows)
