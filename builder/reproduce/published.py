"""Every number that the source publishes of its results, with its place.

Source: Pham, Ghattas, Clemens and Willcox, "Real-time aerodynamic load estimation for hypersonics via strain-based
inverse maps", arXiv 2408.15286.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    """One published number, or a range of them.

    Attributes
    ----------
    key : name by which a comparison finds it.
    quantity : what it is.
    value : as published, with unit.
    place : where it stands in the source.
    low, high : the number, or both ends of the range, in the unit of ``unit``; None where only one end is given.
    unit : "%", "1" or "modes".
    """

    key: str
    quantity: str
    value: str
    place: str
    low: float | None
    high: float | None
    unit: str = "%"


_ALL = (
    Published("surface_nodes", "pressure nodes n_p", "60,538", "IC3X modeling", 60538, 60538, "1"),
    Published("structure_dofs", "structural dofs n_s", "461,664", "IC3X modeling", 461664, 461664, "1"),
    Published("energy", "energy of the first five modes of P1", "99.1 %", "Case 1, text", 99.1, 99.1),
    Published("k_1", "relative condition number, Configuration 1", "89.61", "Table 1", 89.61, 89.61, "1"),
    Published("k_2", "relative condition number, Configuration 2", "47.96", "Table 1", 47.96, 47.96, "1"),
    Published("k_ratio", "their ratio K1/K2", "1.868", "Table 1", 89.61 / 47.96, 89.61 / 47.96, "1"),
    Published(
        "field_1", "Case 1, Configuration 1: median field error", "7.5 %", "Case 1, text and figure", 7.5, 7.5
    ),
    Published("field_1_worst", "the same, largest", "over 30 %", "Case 1, text and figure", 30.0, None),
    Published(
        "field_2", "Case 1, Configuration 2: median field error", "5.5 %", "Case 1, text and figure", 5.5, 5.5
    ),
    Published("field_2_worst", "the same, largest", "under 15 %", "Case 1, text and figure", None, 15.0),
    Published(
        "example_1", "Case 1, M5 a6 b5, Configuration 1: field error", "15.9 %", "Case 1, figure", 15.9, 15.9
    ),
    Published("example_2", "Case 1, M7 a2 b8, Configuration 2: field error", "3.9 %", "Case 1, figure", 3.9, 3.9),
    Published("eigenvalues", "non-zero eigenvalues", "54", "Case 2, text and figure", 54, 54, "1"),
    Published("decay", "lambda_1 / lambda_8", "1e6, in orders of magnitude", "Case 2, text", 1e6, 1e6, "1"),
    Published("noise_free", "M5 a6 b6, no noise, gamma 1e-6: field error", "2.8 %", "Case 2, figure", 2.8, 2.8),
    Published("gamma", "gamma by the Morozov-like rule", "3.16", "Case 2, text", 10**0.5, 10**0.5, "1"),
    Published("modes_kept", "modes of the projection at that gamma", "7", "Case 2, text", 7, 7, "1"),
    Published("noisy", "M5 a6 b6, 100 draws: field error", "13.3 to 27.9 %", "Case 2, text", 13.3, 27.9),
    Published("c_n", "the same: largest error of C_N", "under 2 %", "Case 2, text", None, 2.0),
    Published("c_y", "the same: largest error of C_Y", "under 2 %", "Case 2, text", None, 2.0),
    Published("m_p", "the same: largest error of M_P", "under 3.4 %", "Case 2, text", None, 3.4),
    Published("m_y", "the same: largest error of M_Y", "under 3.4 %", "Case 2, text", None, 3.4),
    Published("c_a_mean", "the same: mean error of C_A", "5.1 %", "Case 2, text", 5.1, 5.1),
    Published("c_a_worst", "the same: largest error of C_A", "16.8 %", "Case 2, text", 16.8, 16.8),
    Published("off_set", "M6 a0 b5, 100 draws: field error", "4.0 to 12.0 %", "Case 2, text", 4.0, 12.0),
)

PUBLISHED = {entry.key: entry for entry in _ALL}
"""By key, in the order of the source."""
