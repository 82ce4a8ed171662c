"""What a test left as errors of a map: they follow the strain of every flow as J C J' does."""

import numpy as np
import pytest
from as_built_case import strain_covariances
from ensembles import listed_ensemble

from builder.calibration.after_test.left_by_test import COMMON, PATTERNS, LeftByTest, Remaining, left_by_test
from builder.inverse.ensemble import Ensemble
from builder.inverse.noise.error_list import error_named
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import as_built_std, draw_as_built
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray


@pytest.fixture(scope="module")
def ensemble(as_built: AsBuiltStructure) -> Ensemble:
    """Flows at many roll angles of the wind, from weak to strong."""
    grid, random = as_built.surface, np.random.default_rng(3)
    along, phi = np.meshgrid(1.5 - grid.x / grid.x[-1], grid.roll_angle, indexing="ij")
    fields = []
    for strength in np.linspace(0.0, 1.0, 9):
        wind = random.uniform(0.0, 2.0 * np.pi)
        m = np.array([1.0, -3.0, 1.0, -0.4])
        rise = sum(strength ** max(k, 1) * a * np.cos(k * (phi - wind)) for k, a in enumerate(m))
        fields.append(1e4 * (along * (1.0 + rise)).ravel())
    return listed_ensemble(np.array(fields))


@pytest.fixture(scope="module")
def tested(vehicle: Vehicle, as_built: AsBuiltStructure) -> Remaining:
    """An estimate, and the covariance of a test: small errors of gauges, and gains that go against E."""
    std = as_built_std(vehicle.calibration, as_built.counts)
    n, n_d = len(std.vector), as_built.n_gauges
    root = np.diag(0.2 * std.vector)
    root[:n_d, 0] -= 0.2 * std.vector[:n_d]
    root[6 * n_d :, 1] += 0.3 * std.vector[6 * n_d :]
    return Remaining(
        parameters=draw_as_built(std, np.random.default_rng(6)), covariance=(root @ root.T).reshape(n, n)
    )


@pytest.fixture(scope="module")
def left(as_built: AsBuiltStructure, tested: Remaining, ensemble: Ensemble) -> LeftByTest:
    return left_by_test(as_built, tested, ensemble)


def covariance_of(left: LeftByTest, member: int) -> FloatArray:
    """(n_d, n_d) what the errors say of one flow."""
    strain = [(error.strain[member], error.common) for error in left.errors]
    return np.sum([np.outer(e, e) if common else np.diag(e * e) for e, common in strain], axis=0)


def test_every_gauge_errs_in_every_flow_as_the_parameters_do(
    as_built: AsBuiltStructure, tested: Remaining, ensemble: Ensemble, left: LeftByTest
) -> None:
    assert [error.common for error in left.errors] == [True] * COMMON + [False] * PATTERNS
    stated = np.array([covariance_of(left, member) for member in range(len(ensemble.pressure))])
    exact = strain_covariances(as_built, tested.parameters, tested.covariance, ensemble.pressure)
    variances = np.diagonal(stated, axis1=1, axis2=2), np.diagonal(exact, axis1=1, axis2=2)
    # The mean of each gauge is that of J C J', and so is every flow's, up to patterns that are left out.
    # To the error of the differences that J is compared by: their step is 1 mm, or 1e-3.
    np.testing.assert_allclose(variances[0].mean(axis=0), variances[1].mean(axis=0), rtol=1e-5)
    np.testing.assert_allclose(variances[0], variances[1], atol=0.03 * variances[1].max())
    strong = np.flatnonzero(variances[1].mean(axis=1) > 3.0 * variances[1].mean(axis=1).min())
    assert len(strong) > 1  # a constant term would not do
    # What all gauges have in common is in the covariances.
    mean, held = np.mean(exact, axis=0), np.mean(stated, axis=0)
    scale = np.sqrt(np.outer(np.diag(mean), np.diag(mean)))
    assert np.sqrt(np.mean(((held - mean) / scale) ** 2)) < 0.3 * np.sqrt(
        np.mean((mean / scale - np.eye(len(mean))) ** 2)
    )


def test_a_gain_corrects_what_single_gauges_have_and_not_what_all_have_in_common(left: LeftByTest) -> None:
    assert {(error.common, error_named(error.name).role) for error in left.errors} == {
        (True, "considered"),
        (False, "estimated"),
    }


def test_zeros_are_a_term_of_their_own(as_built: AsBuiltStructure, tested: Remaining, left: LeftByTest) -> None:
    n_d = as_built.n_gauges
    zero = tested.covariance[5 * n_d : 6 * n_d, 5 * n_d : 6 * n_d]
    (term,) = left.zeros
    np.testing.assert_allclose(term.covariance, zero, atol=1e-9 * zero.max())
    assert not term.scales


def test_nothing_is_left_where_all_is_known(
    as_built: AsBuiltStructure, tested: Remaining, ensemble: Ensemble
) -> None:
    known = Remaining(parameters=tested.parameters, covariance=np.zeros_like(tested.covariance))
    found = left_by_test(as_built, known, ensemble)
    assert (found.errors, found.zeros) == ((), ())
