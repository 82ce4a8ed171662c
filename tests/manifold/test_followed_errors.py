"""Errors of gauges that follow the flight state: as large as those of the ensemble where strain is largest."""

from dataclasses import replace

import numpy as np
import pytest

from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.hardware_errors import HardwareError
from builder.inverse.problem import inverse_problem
from builder.inverse.solution import Problem
from builder.manifold.nonlinear_build import followed_errors, squares_fitted
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from strainfmu.estimator.map.inverse_map import PAIRS

FIRST, SECOND = np.array(PAIRS).T


def disc(count: int) -> np.ndarray:
    """Return c = [1, C_A, C_N, C_Y, M_P, M_Y] over a disc of incidences."""
    random = np.random.default_rng(3)
    incidence, roll = np.sqrt(random.uniform(0.0, 1.0, count)), random.uniform(0.0, 2.0 * np.pi, count)
    across = np.column_stack([incidence * np.cos(roll), incidence * np.sin(roll)])
    return np.column_stack([np.ones(count), 0.02 + 0.03 * incidence**2, 0.6 * across, 0.2 * across])


@pytest.mark.fast
def test_squares_of_combinations_are_fitted_and_never_negative() -> None:
    c = disc(500)
    rise = (c[:, 1] - 0.02) / 0.03
    square = np.column_stack(
        [rise**2, 4.0 * (rise + c[:, 2] / 0.6) ** 2, 0.3 * np.ones(len(c)), rise**4 * c[:, 2] ** 4]
    )
    fitted = squares_fitted(c, square, np.full(len(c), 1.0 / len(c)))
    found = (c[:, FIRST] * c[:, SECOND]) @ fitted
    # The least C_A of the draw is not quite that without incidence.
    assert np.max(np.abs(found[:, :3] - square[:, :3])) < 0.02
    whole = np.zeros((4, 6, 6))
    whole[:, FIRST, SECOND] = whole[:, SECOND, FIRST] = (np.where(FIRST == SECOND, 1.0, 0.5)[:, None] * fitted).T
    assert np.linalg.eigvalsh(whole).min() > -1e-12


def test_errors_of_gauges_grow_with_incidence_as_those_of_the_flows(
    vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots
) -> None:
    problem = inverse_problem(vehicle, snapshots, structure)
    check_growth(vehicle, problem, [one for one in problem.errors if not one.common])
    # With what no load follows of the errors that all have in common.
    whole = replace(problem, errors=tuple(replace(one, with_rest=True) for one in problem.errors))
    check_growth(vehicle, whole, list(problem.errors))


def check_growth(vehicle: Vehicle, problem: Problem, errors: list[HardwareError]) -> None:
    """Check the variance of every gauge against that of ``errors``, by incidence."""
    followed = followed_errors(problem)
    products = followed["gauge_error_product"]
    common = np.concatenate([followed["common_error"], followed["considered_common"]])
    ensemble, reference = problem.ensemble, vehicle.reference_quantities()
    pressure = np.tile(ensemble.ambient_pressure, ensemble.rolls)[:, None]
    scale = reference.area * np.array([1.0, 1.0, 1.0, reference.length, reference.length])
    c = np.hstack([np.ones((len(pressure), 1)), ensemble.responses(problem.load_operator[:5]) / pressure / scale])
    found = (c[:, FIRST] * c[:, SECOND]) @ products
    if any(one.common for one in errors):
        found = found + np.sum((c @ common) ** 2, axis=0)
    each = [one.strain for one in errors if one.name not in ("gauge gain", "common gain")]
    true = np.sum([(strain / pressure) ** 2 for strain in each], axis=0)
    across = np.hypot(c[:, 2], c[:, 3])
    for low, high in ((0.3, 0.6), (0.6, 0.8), (0.8, 1.0)):
        rows = (across > low * across.max()) & (across <= high * across.max())
        ratio = found[rows].mean(axis=0) / true[rows].mean(axis=0)
        assert 0.75 < ratio.min() < ratio.max() < 1.3, (low, ratio.min(), ratio.max())
