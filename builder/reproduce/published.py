"""Every result that the source publishes as a number, and where.

Source: Pham, Ghattas, Clemens and Willcox, "Real-time aerodynamic load estimation for hypersonics via strain-based
inverse maps", arXiv 2408.15286.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Published:
    """One published number, or a range of them.

    Attributes
    ----------
    key : its name in comparisons.
    quantity : description.
    value : as published, with unit.
    location : section, table or figure of the source.
    low, high : the number, or both ends of the range, in the unit of ``unit``; None where only one end is given.
    unit : "%", "1" or "modes".
    """

    key: str
    quantity: str
    value: str
    location: str
    low: float | None
    high: float | None
    unit: str = "%"


_ALL = (
    Published(
        key="surface_nodes",
        quantity="pressure nodes n_p",
        value="60,538",
        location="IC3X modeling",
        low=60538,
        high=60538,
        unit="1",
    ),
    Published(
        key="structure_dofs",
        quantity="structural dofs n_s",
        value="461,664",
        location="IC3X modeling",
        low=461664,
        high=461664,
        unit="1",
    ),
    Published(
        key="energy",
        quantity="energy of the first five modes of P1",
        value="99.1 %",
        location="Case 1, text",
        low=99.1,
        high=99.1,
    ),
    Published(
        key="k_1",
        quantity="relative condition number, Configuration 1",
        value="89.61",
        location="Table 1",
        low=89.61,
        high=89.61,
        unit="1",
    ),
    Published(
        key="k_2",
        quantity="relative condition number, Configuration 2",
        value="47.96",
        location="Table 1",
        low=47.96,
        high=47.96,
        unit="1",
    ),
    Published(
        key="k_ratio",
        quantity="their ratio K1/K2",
        value="1.868",
        location="Table 1",
        low=89.61 / 47.96,
        high=89.61 / 47.96,
        unit="1",
    ),
    Published(
        key="field_1",
        quantity="Case 1, Configuration 1: median field error",
        value="7.5 %",
        location="Case 1, text and figure",
        low=7.5,
        high=7.5,
    ),
    Published(
        key="field_1_worst",
        quantity="the same, largest",
        value="over 30 %",
        location="Case 1, text and figure",
        low=30.0,
        high=None,
    ),
    Published(
        key="field_2",
        quantity="Case 1, Configuration 2: median field error",
        value="5.5 %",
        location="Case 1, text and figure",
        low=5.5,
        high=5.5,
    ),
    Published(
        key="field_2_worst",
        quantity="the same, largest",
        value="under 15 %",
        location="Case 1, text and figure",
        low=None,
        high=15.0,
    ),
    Published(
        key="example_1",
        quantity="Case 1, M5 a6 b5, Configuration 1: field error",
        value="15.9 %",
        location="Case 1, figure",
        low=15.9,
        high=15.9,
    ),
    Published(
        key="example_2",
        quantity="Case 1, M7 a2 b8, Configuration 2: field error",
        value="3.9 %",
        location="Case 1, figure",
        low=3.9,
        high=3.9,
    ),
    Published(
        key="eigenvalues",
        quantity="non-zero eigenvalues",
        value="54",
        location="Case 2, text and figure",
        low=54,
        high=54,
        unit="1",
    ),
    Published(
        key="decay",
        quantity="lambda_1 / lambda_8",
        value="1e6, in orders of magnitude",
        location="Case 2, text",
        low=1e6,
        high=1e6,
        unit="1",
    ),
    Published(
        key="noise_free",
        quantity="M5 a6 b6, no noise, gamma 1e-6: field error",
        value="2.8 %",
        location="Case 2, figure",
        low=2.8,
        high=2.8,
    ),
    Published(
        key="gamma",
        quantity="gamma by the Morozov-like rule",
        value="3.16",
        location="Case 2, text",
        low=10**0.5,
        high=10**0.5,
        unit="1",
    ),
    Published(
        key="modes_kept",
        quantity="modes of the projection at that gamma",
        value="7",
        location="Case 2, text",
        low=7,
        high=7,
        unit="1",
    ),
    Published(
        key="noisy",
        quantity="M5 a6 b6, 100 draws: field error",
        value="13.3 to 27.9 %",
        location="Case 2, text",
        low=13.3,
        high=27.9,
    ),
    Published(
        key="c_n",
        quantity="the same: largest error of C_N",
        value="under 2 %",
        location="Case 2, text",
        low=None,
        high=2.0,
    ),
    Published(
        key="c_y",
        quantity="the same: largest error of C_Y",
        value="under 2 %",
        location="Case 2, text",
        low=None,
        high=2.0,
    ),
    Published(
        key="m_p",
        quantity="the same: largest error of M_P",
        value="under 3.4 %",
        location="Case 2, text",
        low=None,
        high=3.4,
    ),
    Published(
        key="m_y",
        quantity="the same: largest error of M_Y",
        value="under 3.4 %",
        location="Case 2, text",
        low=None,
        high=3.4,
    ),
    Published(
        key="c_a_mean",
        quantity="the same: mean error of C_A",
        value="5.1 %",
        location="Case 2, text",
        low=5.1,
        high=5.1,
    ),
    Published(
        key="c_a_worst",
        quantity="the same: largest error of C_A",
        value="16.8 %",
        location="Case 2, text",
        low=16.8,
        high=16.8,
    ),
    Published(
        key="off_set",
        quantity="M6 a0 b5, 100 draws: field error",
        value="4.0 to 12.0 %",
        location="Case 2, text",
        low=4.0,
        high=12.0,
    ),
)

PUBLISHED = {entry.key: entry for entry in _ALL}
"""By key, in the order of the source."""
