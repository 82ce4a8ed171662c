"""The choice of load cases: against the closed form of normal linear models, and where the best is known."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from builder.calibration.plan.case_selection import CaseSensitivity, FlightSensitivity, no_knowledge, select_cases

pytestmark = pytest.mark.fast

N_D, N = 6, 9


def some_flight(random: np.random.Generator) -> FlightSensitivity:
    return FlightSensitivity(
        jacobian=tuple(csr_array(one) for one in random.normal(size=(3, N_D, N))),
        state_operator=random.normal(size=(N_D, 3)),
        noise_covariance=0.1 * np.eye(N_D),
        regularisation=0.0,
        coefficient_per_state=random.normal(size=(5, 3)),
    )


def some_cases(random: np.random.Generator, count: int) -> list[CaseSensitivity]:
    return [
        CaseSensitivity(
            jacobian=csr_array(random.normal(size=(N_D, N))),
            error=random.normal(size=(N_D, 2)),
            noise_std=np.full(N_D, 0.3),
        )
        for _ in range(count)
    ]


def test_knowledge_is_that_of_all_cases_at_once() -> None:
    """Case by case is the same as one regression on everything, with a unit prior."""
    random = np.random.default_rng(1)
    flight, cases = some_flight(random), some_cases(random, 4)
    known, information = no_knowledge(flight), np.eye(N)
    for case in cases:
        np.testing.assert_allclose(known.sigmas_after(case), known.after(case).sigmas, rtol=1e-10)
        known = known.after(case)
        weight = np.linalg.inv(np.diag(case.noise_std**2) + case.error @ case.error.T)
        information += case.jacobian.T @ weight @ case.jacobian
    covariance = np.linalg.inv(information)
    np.testing.assert_allclose(known.covariance, covariance, atol=1e-12)
    left = np.mean([one @ covariance @ one.T for one in flight.jacobian], axis=0)
    np.testing.assert_allclose(known.error_covariance, left, atol=1e-12)


@pytest.mark.parametrize("regularisation", [0.0, 1.0])
def test_sigmas_are_those_of_the_weighted_estimate(regularisation: float) -> None:
    random = np.random.default_rng(2)
    base = some_flight(random)
    flight = FlightSensitivity(**{**vars(base), "regularisation": regularisation})
    error = np.diag(random.uniform(0.1, 1.0, N_D))
    weight = np.linalg.inv(flight.noise_covariance + error)
    a = flight.state_operator
    covariance = np.linalg.inv(a.T @ weight @ a + regularisation * np.eye(3))
    c = flight.coefficient_per_state
    np.testing.assert_allclose(flight.sigmas(error), np.sqrt(np.diag(c @ covariance @ c.T)), rtol=1e-12)


def test_each_case_is_the_best_next_one() -> None:
    """The lazy search finds what a search over all candidates finds."""
    random = np.random.default_rng(3)
    flight, cases = some_flight(random), some_cases(random, 12)
    known = no_knowledge(flight)
    for number, after in select_cases(known, cases, 4):
        assert number == int(np.argmin([np.prod(known.sigmas_after(case)) for case in cases]))
        known = known.after(cases[number])
        np.testing.assert_allclose(after.sigmas, flight.sigmas(known.error_covariance), rtol=1e-12)


def test_case_that_tells_what_flight_needs_comes_first() -> None:
    """Of two parameters only the second matters in flight; the case that shows it is chosen, not the larger."""
    flight = FlightSensitivity(
        jacobian=(csr_array([[0.0, 1.0], [0.0, 1.0]]),),
        state_operator=np.eye(2),
        noise_covariance=1e-4 * np.eye(2),
        regularisation=0.0,
        coefficient_per_state=np.ones((5, 2)),
    )
    none, noise = np.zeros((2, 0)), np.full(2, 0.1)
    shows_first = CaseSensitivity(jacobian=csr_array([[50.0, 0.0], [50.0, 0.0]]), error=none, noise_std=noise)
    shows_second = CaseSensitivity(jacobian=csr_array([[0.0, 1.0], [0.0, 0.0]]), error=none, noise_std=noise)
    first, second = select_cases(no_knowledge(flight), [shows_first, shows_second], 2)
    assert first[0] == second[0] == 1
    assert np.all(second[1].sigmas < first[1].sigmas)
