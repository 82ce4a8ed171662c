"""Words and signs of figures: one for each quantity and estimator, whatever files call them."""

from __future__ import annotations

import re

ESTIMATORS = {"nonlinear": "nonlinear estimator", "linear": "linear map"}
"""What documents say, by the name in files."""

_COEFFICIENT = re.compile(r"\b(C_[ANY]|M_[PYR])\b")
_FREE_STREAM = re.compile(r"(\bp/)?\b([pq])_inf\b")


def estimator_in_words(name: str) -> str:
    """Return what documents call an estimator; a name that they share with files as it is."""
    return ESTIMATORS.get(name, name)


def with_signs(text: str) -> str:
    """Return ``text`` with coefficients and free-stream quantities as matplotlib sets mathematics.

    >>> with_signs("C_A over q_inf [1]")
    '$C_A$ over $q_\\\\infty$ [1]'
    """
    return _FREE_STREAM.sub(r"$\1\2_\\infty$", _COEFFICIENT.sub(r"$\1$", text))
