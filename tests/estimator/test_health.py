"""The chi-square alarm level against an independent implementation."""

import pytest
from scipy.stats import chi2

from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, HealthState, chi_square_limit, chi_square_survival

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("freedom", [1, 2, 3, 10, 22, 49, 200, 1001])
@pytest.mark.parametrize("probability", [0.5, 1e-2, 1e-4, 1e-8])
def test_limit_is_the_quantile(freedom: int, probability: float) -> None:
    """scipy's inverse survival function to 1e-8."""
    assert chi_square_limit(freedom, probability) == pytest.approx(chi2.isf(probability, freedom), rel=1e-8)


@pytest.mark.parametrize("freedom", [1, 2, 7, 49, 500])
@pytest.mark.parametrize("share", [0.01, 0.5, 1.0, 1.5, 3.0])
def test_survival(freedom: int, share: float) -> None:
    value = share * freedom
    assert chi_square_survival(value, freedom) == pytest.approx(chi2.sf(value, freedom), rel=1e-9, abs=1e-300)


def test_survival_at_the_ends() -> None:
    assert chi_square_survival(0.0, 5) == 1.0
    assert chi_square_survival(-1.0, 5) == 1.0
    assert chi_square_survival(1e6, 5) == 0.0


def test_default_limit_is_one_false_alarm_in_ten_thousand() -> None:
    assert FALSE_ALARM_PROBABILITY == 1e-4
    assert chi2.sf(chi_square_limit(49), 49) == pytest.approx(1e-4, rel=1e-8)


def test_states_keep_their_numbers() -> None:
    """The numbers are what an FMU outputs: they must not move."""
    names = ["OK", "INCONSISTENT", "NO_COEFFICIENTS", "INVALID", "DEGRADED", "UNIDENTIFIED", "SUSPECT", "OUTSIDE"]
    assert [(state.name, state.value) for state in HealthState] == list(zip(names, range(8), strict=True))
