"""The report of a calibration: ``calibration.html`` beside the map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from builder.calibration.estimate.cross_validation import LeftOut
from builder.calibration.estimate.faults import Fault, load_shifts
from builder.calibration.estimate.load_equations import LoadEquation
from builder.calibration.estimate.outside_terms import NOISE, OutsideModel
from builder.calibration.estimate.remarks import remarks
from builder.calibration.estimate.vehicle import Estimate
from builder.reports.page.html import Block, Cards, Items, Page, Paragraph, Section
from builder.reports.page.tables import Column, Table, make_table
from builder.structure.as_built.vehicle import in_words, slices
from builder.structure.as_built_kinds import KINDS
from strainfmu.estimator.signal_names import ZERO

CANNOT_SEE = (
    "An error that all loads have in common is not seen: a load cell that reads too much makes a stiffer and "
    "heavier vehicle. Its stated size stays in the covariance; a second load cell, or a scale, would show it.",
    "The clamp of the test is taken as the one in flight; how it yields as a whole strains nothing.",
    "Young's modulus and the common gain are not told apart; their difference is what counts in flight.",
    "A zero that drifts after the test is not seen; take the tare before each flight.",
)


def calibration_page(
    title: str,
    found: Estimate,
    faults: Sequence[Fault],
    outside: OutsideModel,
    left_out: Sequence[LeftOut],
    equations: Sequence[LoadEquation],
) -> Page:
    """Return the page."""
    agrees, said = found.agrees, remarks(found)
    facts = (
        f"{found.n_readings} readings, {len(found.vector)} parameters, {found.steps} steps",
        f"chi-square per reading {found.per_reading:.3g}; 1 is expected",
        f"rms of measured less predicted: drawing {1e6 * _rms(found, found.before):.3g} um/m, "
        f"calibrated {1e6 * _rms(found, found.after):.3g} um/m",
    )
    verdict = "Test and model agree" if agrees else "Test and model do not agree"
    cards = (
        (verdict, "green" if agrees else "red", facts),
        ("Left out", "amber" if faults else "green", tuple(one.line for one in faults)),
        ("As stated", "amber" if said else "green", said or ("mass, load cells and chi-square",)),
        ("Outside the model", "red" if outside.found else "green", outside.lines or ("nothing found",)),
    )
    opening: tuple[Block, ...] = (Cards(cards),)
    sections = (
        Section("Readings by load case", (_cases(found), _cross(left_out))),
        Section("Readings by gauge", (_gauges(found),)),
        Section("What the test identifies", (_identified(found), _loads(found))),
        Section("What is taken for zero", (_outside(outside),)),
        Section(
            "Regression load equations",
            (
                Paragraph(
                    "The classical way, from the same cases: loads as sums of readings, gauges chosen by T "
                    "values. Where pads load a few places and flight loads the whole body, it disagrees."
                ),
                _equations(found, equations),
            ),
        ),
        Section("What this test cannot see", (Items(CANNOT_SEE),)),
    )
    return Page(title, opening, sections)


def _left(found: Estimate, predicted: np.ndarray) -> np.ndarray:
    return np.where(found.used, found.model.test.readings - predicted, np.nan)


def _rms(found: Estimate, predicted: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(_left(found, predicted) ** 2)))


def _cases(found: Estimate) -> Table:
    std = found.model.test.reading_stds
    rows = []
    for k, case in enumerate(found.model.test.cases):
        if not found.used[k].any():
            continue
        before, after = _left(found, found.before)[k], _left(found, found.after)[k]
        rows.append(
            [
                case.name,
                float(np.sqrt(np.nanmean(found.model.test.readings[k][found.used[k]] ** 2))) * 1e6,
                float(np.sqrt(np.nanmean(before**2))) * 1e6,
                float(np.sqrt(np.nanmean(after**2))) * 1e6,
                float(np.sqrt(np.nanmean((after / std[k]) ** 2))),
            ]
        )
    columns = (
        Column("load case"),
        Column("reading, rms", "um/m"),
        Column("left by the drawing", "um/m"),
        Column("left after", "um/m"),
        Column("left after", "sigma"),
    )
    return make_table("cases", "Measured less predicted, case by case; sigma is that of a reading.", columns, rows)


def _cross(left_out: Sequence[LeftOut]) -> Table:
    rows = [[one.case, 1e6 * one.rms, 1e6 * one.stated, one.chi_square] for one in left_out]
    columns = (
        Column("case left out"),
        Column("measured less predicted, rms", "um/m"),
        Column("stated", "um/m"),
        Column("chi-square per reading"),
    )
    return make_table("cross_validation", "Each case predicted from the others alone.", columns, rows)


def _gauges(found: Estimate) -> Table:
    before, after = _left(found, found.before), _left(found, found.after)
    std, part = found.model.test.reading_stds, found.parameters
    where = slices(part.counts)
    sigma = found.std
    rows: list[list[str | float]] = []
    for g, name in enumerate(found.model.structure.gauges.names):
        if not found.used[:, g].any():
            rows.append([name, *["left out"] * 6])
            continue
        rows.append(
            [
                name,
                float(np.sqrt(np.nanmean(before[:, g] ** 2))) * 1e6,
                float(np.sqrt(np.nanmean(after[:, g] ** 2))) * 1e6,
                float(np.sqrt(np.nanmean((after[:, g] / std[:, g]) ** 2))),
                100.0 * float(part.gauge_gain[g]),
                100.0 * float(sigma[where["gauge_gain"]][g]),
                1e6 * float(part.zero[g]),
            ]
        )
    columns = (
        Column("gauge"),
        Column("left by the drawing", "um/m"),
        Column("left after", "um/m"),
        Column("left after", "sigma"),
        Column("gain", "%"),
        Column("its sigma", "%"),
        Column(ZERO, "um/m"),
    )
    return make_table("gauges", "Measured less predicted, gauge by gauge, over all cases.", columns, rows)


def _identified(found: Estimate) -> Table:
    """Return prior and posterior sigma side by side; of gauges and regions the root mean square."""
    part, sigma, before = found.parameters, found.std, found.model.std
    rows = []
    for kind, at in slices(part.counts).items():
        if not before[at].any():
            continue
        unit, scale = KINDS[kind].unit, 1.0 / KINDS[kind].scale
        prior, after = (float(np.sqrt(np.mean(value[at] ** 2))) for value in (before, sigma))
        identified = 100.0 * (1.0 - (after / prior) ** 2) if prior > 0.0 else 0.0
        size = float(np.sqrt(np.mean(found.vector[at] ** 2)))
        rows.append([in_words(kind), unit, scale * size, scale * prior, scale * after, identified])
    model = found.model
    for number, cell in enumerate(range(model.cell_entries.start, model.cell_entries.stop)):
        of_cell = KINDS["common" if number < len(model.cells) else "cell_offset"]
        if before[cell] > 0.0:
            size, prior, after = (
                float(value[cell]) / of_cell.scale for value in (np.abs(found.vector), before, sigma)
            )
            rows.append(
                [model.names[cell], of_cell.unit, size, prior, after, 100.0 * (1.0 - (after / prior) ** 2)]
            )
    columns = (
        Column("parameter"),
        Column("unit"),
        Column("estimate, rms"),
        Column("sigma before"),
        Column("sigma after"),
        Column("variance explained", "%", ".3g"),
    )
    caption = "What the test identifies: standard deviations before and after it."
    return make_table("identifiability", caption, columns, rows)


def _outside(outside: OutsideModel) -> Table:
    """Return the tests of what the estimate takes for zero."""
    rows: list[list[str | float]] = []
    for one in outside.kinds:
        rows += [
            [f"{one.kind}, region {term.region + 1}", "%", 100.0 * term.size, 100.0 * term.std, "", ""]
            for term in one.terms
        ]
        whole = ("noise", "stated", outside.noise_factor) if one.kind == NOISE else (f"{one.kind}, all", "", "")
        rows.append([*whole, "", one.statistic / one.freedom, one.chance])
    columns = (
        Column("error"),
        Column("unit"),
        Column("size"),
        Column("its sigma"),
        Column("chi-square over its mean"),
        Column("chance of a sound vehicle", "", ".2g"),
    )
    caption = "Errors that no parameter stands for: what one step that sets them free would find."
    return make_table("outside_the_model", caption, columns, rows)


def _loads(found: Estimate) -> Table:
    shift, size = load_shifts(found)
    rows = [
        [found.model.test.cases[case].name, type(one.load).__name__, 100.0 * float(size[k]), float(shift[k])]
        for k, (case, one) in enumerate(found.model.loads)
        if one.std > 0.0
    ]
    columns = (Column("load case"), Column("load"), Column("differs by", "%"), Column("in its sigma"))
    return make_table("loads", "What the readings say of each load, without its own prior.", columns, rows)


def _equations(found: Estimate, equations: Sequence[LoadEquation]) -> Table:
    names = found.model.structure.gauges.names
    rows = [
        [
            one.load.replace("_", " "),
            len(one.gauges),
            one.least_t,
            one.residual_std,
            ", ".join(names[g] for g in one.gauges) or "none",
        ]
        for one in equations
    ]
    columns = (
        Column("load"),
        Column("gauges"),
        Column("least T"),
        Column("residual, standard deviation", "N, N m"),
        Column("gauges chosen"),
    )
    return make_table("load_equations", "Regression on the load cases, T values of 4 at least.", columns, rows)
