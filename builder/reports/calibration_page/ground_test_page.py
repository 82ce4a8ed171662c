"""The report of a calibration as one page: the verdict, figures, tables, and where all of it comes from."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.load_steps import step_remarks
from builder.calibration.estimate.remarks import remarks
from builder.figures.calibration import ground_test
from builder.reports.calibration_page import ground_test_tables as tables
from builder.reports.calibration_page.findings import CalibrationFindings
from builder.reports.calibration_page.verdict import Verdict, verdict
from builder.reports.page.html import Block, Cards, Items, Page, Paragraph, Section, picture
from builder.reports.page.page_tables import Table
from strainfmu.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESOLUTION = 150
"""Dots per inch of the figures, which are printed as well."""

CANNOT_SEE = (
    "An error that all loads have in common is not seen: a load cell that reads too much makes a stiffer and "
    "heavier vehicle. Its stated size stays in the covariance; a second load cell, or a scale, would show it.",
    "The clamp of the test is taken as the one in flight; how it yields as a whole strains nothing.",
    "Young's modulus and the common gain are not separated; their difference is what counts in flight.",
    "A zero that drifts after the test is not seen; take the tare before each flight.",
)

FIGURES_NEED = "Figures need matplotlib: pip install 'strainfmu[report]'."


def calibration_page(one: CalibrationFindings) -> Page:
    """Return the page."""
    screen = verdict(one)
    found = one.found
    sections = (
        Section("Influence coefficients", _influence(found)),
        Section("Residuals", _residuals(one)),
        Section("Load against strain", _steps(one)),
        Section("Check loads", _checks(one)),
        Section("Uncertainty in flight", _in_flight(one)),
        Section("Loads covered", _coverage(one)),
        Section("Load equations", _equations(one)),
        Section("What the test identifies", (tables.identified_table(found), tables.loads_table(found))),
        Section("What is taken for zero", (tables.outside_table(one.outside),)),
        Section("What this test cannot see", (Items(CANNOT_SEE),)),
        Section("Traceability", _origin(one)),
        Section("Signatures", (tables.signatures_table(),)),
    )
    return Page(one.title, _opening(one, screen), sections)


def _opening(one: CalibrationFindings, screen: Verdict) -> tuple[Block, ...]:
    found, said = one.found, remarks(one.found)
    left_out = (*found.model.test.left_out, *(fault.line for fault in one.faults))
    when = f"Tested on {one.tested_on}. " if one.tested_on else ""
    cards = (
        (screen.title, "green" if screen.accepted else "red", screen.reasons),
        ("Not established", "amber", screen.open),
        ("Established", "green", screen.established),
        ("What would help most", "blue", screen.helps),
    )
    details = (
        ("Left out", "amber" if left_out else "green", left_out),
        ("As stated", "amber" if said else "green", said or ("mass, load cells and chi-square",)),
        ("Outside the model", "red" if one.outside.found else "green", one.outside.lines or ("nothing found",)),
        (
            "The fit",
            "blue",
            (
                f"{found.n_readings} readings, {len(found.vector)} parameters, {found.steps} steps"
                + ("" if found.settled else ", which did not settle"),
                f"chi-square per reading {found.per_reading:.3g}, 1 is expected: whether readings, priors apart, "
                "scatter about the calibrated vehicle as their noise says",
                f"squared distance from the files {found.from_priors:.3g}, 1 is expected: whether vehicle and "
                "loads differ from the files as their tolerances say; zero offsets are free and take no part",
                f"rms of measured less predicted: drawing {1e6 * _rms(found, found.before):.3g} um/m, "
                f"calibrated {1e6 * _rms(found, found.after):.3g} um/m",
            ),
        ),
    )
    accepted = (Paragraph(f"Written by --accept: {one.accepted}."),) if one.accepted else ()
    return (
        Paragraph(f"{when}{one.origin.sentence}"),
        *accepted,
        Cards(cards),
        tables.criteria_table(screen.criteria),
        Cards(details),
    )


def _drawn(
    figure: Callable[[], Figure | None], caption: str, alternative: str, none: str = ""
) -> tuple[Block, ...]:
    """Return a figure; ``none`` where there is nothing to draw."""
    if find_spec("matplotlib") is None:
        return (Paragraph(FIGURES_NEED),)
    made = figure()
    if made is None:
        return (Paragraph(none),)
    return (picture(made, caption, alternative, resolution=RESOLUTION),)


def _influence(found: Estimate) -> tuple[Block, ...]:
    return _drawn(
        lambda: ground_test.influence_figure(found),
        "Strain per force of every case with one force, each gauge a point; own weight and zeros subtracted.",
        "Measured influence coefficients over predicted ones, by the drawing and as calibrated.",
        "No case has one force alone: influence coefficients are not defined.",
    )


def _residuals(one: CalibrationFindings) -> tuple[Block, ...]:
    drawn = _drawn(
        lambda: ground_test.residual_figure(one.found),
        "Measured less predicted, in standard deviations of the readings; grey readings are not used.",
        "Map of residuals: load cases down, gauges across.",
    )
    cross = tables.cross_table(one.left_out)
    return (*drawn, tables.cases_table(one.found), cross, tables.gauges_table(one.found))


def _steps(one: CalibrationFindings) -> tuple[Block, ...]:
    if not one.steps:
        return (
            Paragraph(
                "The test has no steps of loading and unloading: hysteresis and return to zero are not measured. "
                "[[case.step]] of its file states them."
            ),
        )
    names = one.found.model.structure.gauges.names
    drawn = _drawn(
        lambda: ground_test.steps_figure(one.steps, names),
        "Readings over the load: circles and full lines loading, squares and broken lines unloading.",
        "Strain over load for loading and unloading, the gauges of the largest strain.",
    )
    said = step_remarks(one.found.model.test) or ("Readings repeat within their noise.",)
    return (Items(said), *drawn, tables.steps_table(one.steps, names))


def _checks(one: CalibrationFindings) -> tuple[Block, ...]:
    drawn = _drawn(
        lambda: ground_test.check_figure(one.found, one.checks, one.equations),
        "Predicted and applied loads.",
        "Differences of predicted from applied loads, with three standard deviations.",
    )
    if not one.checks:
        text = "The test has no check loads (check = true); each load that was fitted, by its readings, stands in."
        return (Paragraph(text), *drawn)
    of_equations = tables.check_equations_table(one.checks, one.equations)
    return (*drawn, tables.checks_table(one.checks), of_equations)


def _in_flight(one: CalibrationFindings) -> tuple[Block, ...]:
    drawn = _drawn(
        lambda: ground_test.flight_figure(one.worth),
        "Sigma of the coefficients by a linear estimator over flows of the map.",
        "Bars of sigma in flight by the drawing, after the test, and of a vehicle known exactly.",
    )
    return (*drawn, tables.flight_table(one.worth))


def _coverage(one: CalibrationFindings) -> tuple[Block, ...]:
    worth = one.worth
    beyond = int(np.sum(worth.flight_strain > worth.ground_strain))
    text = (
        f"Combinations of the cases make up {100.0 * worth.spanned:.1f} % of the mean square strain in flight. "
        f"{beyond} of {len(worth.flight_strain)} gauges strain more in flight than in any case."
    )
    drawn = _drawn(
        lambda: ground_test.coverage_figure(worth, one.found.model.structure.gauges.names),
        "Left: range of each load in flight, and the cases. Right: largest strain of each gauge.",
        "Loads and strains in flight and in the ground test.",
    )
    return (Paragraph(text), *drawn)


def _equations(one: CalibrationFindings) -> tuple[Block, ...]:
    text = (
        "The classical way, from the same cases: loads as sums of readings less zero offsets, coefficients by "
        "least squares, gauges chosen by T, coefficient over standard error (Skopinski, Aiken and Huston, NACA "
        "Report 1178). Where pads load a few places and flight loads the whole body, they err in flight."
    )
    return (Paragraph(text), tables.equations_table(one.found, one.equations))


def _origin(one: CalibrationFindings) -> tuple[Block, ...]:
    cells: tuple[Table, ...] = (tables.cells_table(one.cells),) if one.cells else ()
    return (Paragraph(one.origin.sentence), one.origin.table(), *cells)


def _rms(found: Estimate, predicted: FloatArray) -> float:
    left = np.where(found.used, found.model.test.readings - predicted, np.nan)
    return float(np.sqrt(np.nanmean(left**2)))
