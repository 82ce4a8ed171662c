"""What a review adds to the report: gauges that could go, gauges that would help, and what stays unobserved."""

from __future__ import annotations

import numpy as np

from builder.placement.review import SPARE, Review
from builder.reports.page.html import Items, Paragraph, Section
from builder.reports.page.page_tables import Column, Table, make_table
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES


def layout_section(review: Review) -> Section:
    """Return the section on the layout among the layouts that could be placed."""
    unobserved, total = review.unobserved_combinations
    name, gain = review.best
    lines = (
        f"Could go: {', '.join(review.spare) or 'no gauge'}, within {100.0 * SPARE:g} % of the criterion.",
        f"Would help most: {name}: the criterion falls by {100.0 * gain:.2f} %.",
        f"{total - unobserved:.0f} of {total} combinations of unknowns strain the gauges by more than their "
        f"noise, {unobserved:.0f} do not. Unknowns are the flight state, pressure off the snapshots and errors "
        "that gauges have in common.",
        *review.hidden,
    )
    return Section(
        "Against other layouts",
        (
            Paragraph(
                f"{len(review.names)} gauges, {review.kind} estimator, at flight states of the snapshots. The "
                "criterion is the mean variance of the five coefficients, each over its variance with this "
                "layout, installation errors included. Candidates lie on a grid of stations and roll angles."
            ),
            Items(lines),
            _parts(review),
            _worth(review),
        ),
    )


def _parts(review: Review) -> Table:
    columns = (
        Column("coefficient"),
        Column("not observed", "%", ".1f"),
        Column("no strain", "%", ".1f"),
        Column("noise and errors in common", "%", ".1f"),
    )
    parts = 100.0 * np.stack((review.unobserved, review.off, 1.0 - review.unobserved - review.off))
    rows = [(name, *column) for name, column in zip(COEFFICIENT_NAMES, parts.T, strict=True)]
    caption = (
        "Parts of the variance: not observed by these gauges, of pressure that strains no candidate, the rest."
    )
    return make_table("layout_parts", caption, columns, rows)


def _worth(review: Review) -> Table:
    order = np.argsort(-review.worth, kind="stable")
    rows = [(review.names[k], 100.0 * review.worth[k]) for k in order.tolist()]
    columns = Column("gauge"), Column("without it the criterion rises by", "%", ".2f")
    return make_table("layout_gauges", "Gauges by worth.", columns, rows)
