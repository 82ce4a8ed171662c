"""Maps on the states that their gauges see, against the maps on all states."""

from typing import Any

import numpy as np
import pytest
from coarse_vehicle import with_paper_map
from state_estimates import state_gain, state_offset

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import inverse_map_of, on_observable_states
from builder.inverse.problem import inverse_problem
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap

Q = 1.4e5


def whole(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel, **entry: Any) -> InverseMap:
    """The map with all the states of its prior."""
    changed = with_paper_map(vehicle, case=2, keep_field=True, **entry)
    problem = inverse_problem(changed, snapshots, structure)
    return inverse_map_of(changed, snapshots, structure, problem, problem.solution)


@pytest.mark.parametrize("gamma", [1.0, 10**0.5])
def test_every_output_stays_with_gauges_lost_too(
    gamma: float, vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel
) -> None:
    """243 states to 54: loads, covariance, chi-square, z to 1e-9; the field to single precision, 1e-6."""
    before = whole(vehicle, prior_snapshots, structure, gamma=gamma)
    after = on_observable_states(before)
    assert (before.state_operator.shape, after.state_operator.shape) == ((54, 243), (54, 54))
    estimators = Estimator(before), Estimator(after)
    random = np.random.default_rng(1)
    strain = before.mean_strain + before.state_operator @ random.normal(size=243)
    strain += before.noise_std * random.normal(size=54)
    for lost in ((), (3,), (0, 17, 40), tuple(range(40))):
        valid = np.ones(54, dtype=bool)
        valid[list(lost)] = False
        expected, found = (one.estimate(strain, Q, valid=valid) for one in estimators)
        size = expected.loads_std
        np.testing.assert_allclose(found.loads, expected.loads, rtol=0.0, atol=1e-9 * np.abs(expected.loads).max())
        np.testing.assert_allclose(
            found.load_covariance / np.outer(size, size),
            expected.load_covariance / np.outer(size, size),
            rtol=0.0,
            atol=1e-9,
        )
        assert found.chi_square == pytest.approx(expected.chi_square, rel=1e-9)
        np.testing.assert_allclose(found.standardised_residual, expected.standardised_residual, atol=1e-9)
        assert found.health is expected.health
    fields = []
    for one in (before, after):
        fields.append(one.field_mean + one.field_modes @ (state_gain(one) @ strain + state_offset(one)))
    np.testing.assert_allclose(fields[1], fields[0], rtol=0.0, atol=1e-6 * np.abs(fields[0]).max())


def test_states_are_ordered_by_what_gauges_see(
    vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel
) -> None:
    """A' Gamma^-1 A of the new states is diagonal: the provenance's eigenvalues, to 1e-9 of the first."""
    after = on_observable_states(whole(vehicle, prior_snapshots, structure))
    hessian = after.state_operator.T @ np.linalg.solve(after.noise_covariance, after.state_operator)
    expected = np.diag(after.provenance["hessian_eigenvalues"])
    np.testing.assert_allclose(hessian, expected, rtol=0.0, atol=1e-9 * expected[0, 0])


def test_a_map_of_few_states_is_left_alone(
    vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel
) -> None:
    few = whole(vehicle, prior_snapshots, structure, prior_modes=20)
    assert on_observable_states(few) is few
