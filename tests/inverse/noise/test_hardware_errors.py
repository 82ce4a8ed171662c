"""Errors of the hardware as terms of the weights and as functions of the coefficients, by the book."""

import numpy as np
import pytest
from ensembles import listed_ensemble

from builder.inverse.noise.hardware_errors import HardwareError, error_model, hardware_terms
from builder.vehicle.file import IC3X, load_vehicle
from strainfmu.estimator.map.inverse_map import PAIRS

pytestmark = pytest.mark.fast

N, N_D = 30, 7


def made(linear: bool) -> tuple[list[HardwareError], np.ndarray]:
    """Return two errors of each gauge and two common ones over 30 flights, and (30, 5) coefficients.

    ``linear`` : their strain is linear in the coefficients.
    """
    random = np.random.default_rng(1)
    coefficients = random.standard_normal((N, 5))
    c = np.hstack([np.ones((N, 1)), coefficients])
    errors = []
    for number in range(4):
        strain = 1e-6 * c @ random.standard_normal((6, N_D))
        if not linear:
            strain = strain + 1e-6 * random.standard_normal((N, N_D))
        errors.append(HardwareError(name=f"e{number}", strain=strain, common=number > 1))
    return errors, coefficients


def products_of(coefficients: np.ndarray) -> np.ndarray:
    """(k, 21) c_a c_b of coefficients (k, 5)."""
    c = np.hstack([np.ones((len(coefficients), 1)), coefficients])
    first, second = np.array(PAIRS).T
    return c[:, first] * c[:, second]


def test_the_covariance_of_each_member_is_that_of_its_own_errors() -> None:
    """Strain linear in C: diag(sum D^2) + sum E E' at every member, from the mean and its excess; 1e-12."""
    errors, coefficients = made(linear=True)
    model = error_model(errors, listed_ensemble(np.ones((N, 3))), coefficients)
    products = products_of(coefficients)
    for member in range(N):
        expected = np.diag(sum(error.strain[member] ** 2 for error in errors[:2]))
        expected = expected + sum(np.outer(error.strain[member], error.strain[member]) for error in errors[2:])
        found = np.diag(products[member] @ model["gauge_error_product"])
        for term in model["common_error"]:
            strain = np.concatenate([[1.0], coefficients[member]]) @ term
            found = found + np.outer(strain, strain)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * expected.max())


@pytest.mark.parametrize("linear", [True, False])
def test_the_excess_averages_to_nothing(linear: bool) -> None:
    """Over the members the covariance at the current strain is that of the weights, whatever the errors: 1e-12."""
    errors, coefficients = made(linear)
    ensemble = listed_ensemble(np.ones((N, 3)))
    model = error_model(errors, ensemble, coefficients)
    excess = ensemble.member_weight @ (products_of(coefficients) - model["mean_product"])
    np.testing.assert_allclose(excess, np.zeros(len(PAIRS)), atol=1e-12)


def test_without_errors_there_is_no_model() -> None:
    assert error_model([], listed_ensemble(np.ones((N, 3))), np.zeros((N, 5))) == {}


def test_terms_are_means_over_the_members() -> None:
    """Own errors: the diagonal of mean squares; common ones: the mean of s s'; and what strain does not drive."""
    errors, _ = made(linear=False)
    vehicle, ensemble = load_vehicle(IC3X), listed_ensemble(np.ones((N, 3)))
    z = 1e-12 * np.random.default_rng(2).standard_normal((N_D, 3))
    terms = {term.name: term for term in hardware_terms(vehicle.noise, errors, ensemble, z)}
    assert list(terms) == ["e0", "e1", "e2", "e3", "apparent strain", "internal pressure"]
    assert all(term.hardware for term in terms.values())
    assert [term.scales for term in terms.values()] == [True, True, True, True, False, True]
    for error in errors:
        mean = error.strain.T @ error.strain / N
        expected = mean if error.common else np.diag(np.diag(mean))
        found = terms[error.name].covariance
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * expected.max())
    np.testing.assert_allclose(terms["apparent strain"].strain, np.full((N_D, 1), 5e-6), rtol=1e-12)
    ambient = ensemble.ambient_pressure[0]
    np.testing.assert_allclose(terms["internal pressure"].strain[:, 0], 0.05 * ambient * z.sum(axis=1), rtol=1e-12)
