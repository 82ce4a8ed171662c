"""The names of the rules that find gamma; they are defined in :mod:`builder.inverse.cases.regularisation`."""

from __future__ import annotations

from typing import Literal, get_args

Rule = Literal["morozov", "corrected_discrepancy", "gcv", "evidence"]
RULES: tuple[Rule, ...] = get_args(Rule)
