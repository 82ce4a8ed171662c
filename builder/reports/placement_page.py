"""The review of a gauge layout as one page."""

from __future__ import annotations

import numpy as np

from builder.placement.lost_gauge import LARGEST_RATIO
from builder.placement.review import DETECTED, SPARE, Review
from builder.reports.page.html import Block, Cards, Items, Page, Paragraph, Section
from builder.reports.page.origin import Origin
from builder.reports.page.page_tables import Column, Table, make_table
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES


def placement_page(title: str, review: Review, origin: Origin, judged: str) -> Page:
    """Return the page; ``judged`` names in a sentence the estimator of ``review`` and what it is judged on."""
    blind, total = review.blind
    name, gain = review.best
    points = review.weak_points
    cards = (
        ("Weakest load", "amber", (review.weakest_line,)),
        (
            "Single points of failure",
            "red" if points else "green",
            points or (f"no loss of one gauge raises a sigma beyond {LARGEST_RATIO:g} times",),
        ),
        ("Could go", "green", review.spare or (f"no gauge, within {100.0 * SPARE:g} % of the criterion",)),
        ("Would help most", "green", (f"{name}: the criterion falls by {100.0 * gain:.2f} %",)),
    )
    opening: tuple[Block, ...] = (
        Paragraph(origin.sentence),
        Paragraph(judged),
        Paragraph(
            f"{len(review.names)} gauges. The criterion is the mean variance of the five coefficients, each over "
            "its variance with this layout, installation errors included."
        ),
        Cards(cards),
    )
    observed = Items(
        (
            f"{total - blind:.0f} of {total} combinations of unknowns strain the gauges by more than their noise; "
            f"{blind:.0f} do not.",
            *review.hidden,
            "Unknowns are the flight state, pressure off the snapshots and errors that gauges have in common.",
        )
    )
    return Page(
        title,
        opening,
        (
            Section("What the gauges observe", (observed, _loads(review))),
            Section("What each gauge contributes", (_gauges(review),)),
            Section("Faults of one gauge", (_faults(review),)),
            Section("Sigmas over the envelope", (_states(review),)),
            Section("Made from", (origin.table(),)),
        ),
    )


def _loads(review: Review) -> Table:
    columns = (
        Column("coefficient"),
        Column("sigma", "1e-4", ".3g"),
        Column("without gauges", "1", ".3g"),
        Column("over that", "times", ".2g"),
        Column("not observed", "%", ".1f"),
        Column("no strain", "%", ".1f"),
        Column("noise and errors in common", "%", ".1f"),
    )
    parts = np.stack((review.unobserved, review.off, 1.0 - review.unobserved - review.off))
    numbers = np.vstack((1e4 * review.sigma, review.prior, review.sigma / review.prior, 100.0 * parts))
    rows = ((name, *column) for name, column in zip(COEFFICIENT_NAMES, numbers.T, strict=True))
    without = "air data and ranges alone" if review.kind == "nonlinear" else "the spread over the flows"
    return make_table(
        "loads",
        (
            f"Root mean square sigmas over the flight states; without gauges: {without}. Parts of the variance: "
            "not observed by these gauges, and of pressure that strains no candidate."
        ),
        columns,
        list(rows),
    )


def _gauges(review: Review) -> Table:
    order = np.argsort(-review.worth, kind="stable")
    columns = (
        Column("gauge"),
        Column("without it the criterion rises by", "%", ".2f"),
        *(Column(f"{name} without it", "times", ".3f") for name in COEFFICIENT_NAMES),
    )
    rows = [(review.names[k], 100.0 * review.worth[k], *review.loss[k]) for k in order.tolist()]
    return make_table("gauges", "Gauges by worth, and sigmas after the loss of each.", columns, rows)


def _faults(review: Review) -> Table:
    order = np.argsort(-review.moved.max(axis=1), kind="stable")
    columns = (
        Column("gauge"),
        Column("detected from", "times its noise", ".1f"),
        *(Column(f"{name} moved by", "sigma", ".2f") for name in COEFFICIENT_NAMES),
    )
    rows = [(review.names[k], review.fault[k], *review.moved[k]) for k in order.tolist()]
    return make_table(
        "faults",
        (
            f"Offset of one gauge that the others detect: {DETECTED:g} standard deviations of the difference "
            "from their prediction. A smaller one moves each coefficient by this much at most. The noise includes "
            "gain, position and orientation."
        ),
        columns,
        rows,
    )


def _states(review: Review) -> Table:
    sigmas = tuple(Column(name, "1e-4", ".3g") for name in COEFFICIENT_NAMES)
    if review.states is None:
        return make_table("states", "Mean over the flows.", sigmas, [tuple(1e4 * review.state_sigma[0])])
    columns = (
        Column("Mach number", "", ".2f"),
        Column("total incidence", "deg", ".1f"),
        Column("aerodynamic roll angle", "deg", ".0f"),
        *sigmas,
    )
    rows = [(*state, *(1e4 * sigma)) for state, sigma in zip(review.states, review.state_sigma, strict=True)]
    return make_table("states", "Predicted sigmas at flight states of the snapshots.", columns, rows)
