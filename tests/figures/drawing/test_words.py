"""Words and signs that all figures share."""

import pytest

from builder.figures.drawing import estimator_in_words, with_signs

pytestmark = pytest.mark.fast


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("C_A [1]", "$C_A$ [1]"),
        ("M, p_inf and q_inf", r"M, $p_\infty$ and $q_\infty$"),
        ("p/p_inf [1]", r"$p/p_\infty$ [1]"),
        ("internal pressure, +20 % of p_inf", r"internal pressure, +20 % of $p_\infty$"),
        ("gauge C_Ax_1", "gauge C_Ax_1"),
    ],
)
def test_quantities_are_set_as_mathematics(text: str, shown: str) -> None:
    assert with_signs(text) == shown


def test_estimators_are_called_as_in_the_documents() -> None:
    assert estimator_in_words("nonlinear") == "nonlinear estimator"
    assert estimator_in_words("random forest") == "random forest"
