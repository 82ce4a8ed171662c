"""The report of a calibration as one page: the verdict, figures, tables, and where all of it comes from."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.load_steps import step_remarks
from builder.calibration.estimate.remarks import remarks
from builder.figures import calibration as ground_test
from builder.reports.calibration_page import ground_test_tables as tables
from builder.reports.calibration_page.verdict import CalibrationFindings, Verdict, verdict
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


def calibration_page(findings: CalibrationFindings) -> Page:
    """Return the page."""
    screen = verdict(findings)
    estimate = findings.estimate
    sections = (
        Section("Influence coefficients", _influence(estimate)),
        Section("Residuals", _residuals(findings)),
        Section("Load against strain", _steps(findings)),
        Section("Check loads", _checks(findings)),
        Section("Uncertainty in flight", _in_flight(findings)),
        Section("Loads covered", _coverage(findings)),
        Section("Load equations", _equations(findings)),
        Section("What the test identifies", (tables.identified_table(estimate), tables.loads_table(estimate))),
        Section("What is taken for zero", (tables.outside_table(findings.outside),)),
        Section("What this test cannot see", (Items(CANNOT_SEE),)),
        Section("Traceability", _origin(findings)),
        Section("Signatures", (tables.signatures_table(),)),
    )
    return Page(findings.title, _opening(findings, screen), sections)


def _opening(findings: CalibrationFindings, screen: Verdict) -> tuple[Block, ...]:
    estimate, said = findings.estimate, remarks(findings.estimate)
    left_out = (*estimate.model.test.left_out, *(fault.line for fault in findings.faults))
    when = f"Tested on {findings.tested_on}. " if findings.tested_on else ""
    cards = (
        (screen.title, "green" if screen.accepted else "red", screen.reasons),
        ("Not established", "amber", screen.open),
        ("Established", "green", screen.established),
        ("What would help most", "blue", screen.helps),
    )
    details = (
        ("Left out", "amber" if left_out else "green", left_out),
        ("As stated", "amber" if said else "green", said or ("mass, load cells and chi-square",)),
        (
            "Outside the model",
            "red" if findings.outside.found else "green",
            findings.outside.lines or ("nothing found",),
        ),
        (
            "The fit",
            "blue",
            (
                f"{estimate.n_readings} readings, {len(estimate.vector)} parameters, {estimate.steps} steps"
                + ("" if estimate.settled else ", which did not settle"),
                f"chi-square per reading {estimate.per_reading:.3g}, 1 is expected: whether readings, priors "
                "apart, scatter about the calibrated vehicle as their noise says",
                f"squared distance from the files {estimate.from_priors:.3g}, 1 is expected: whether vehicle and "
                "loads differ from the files as their tolerances say; zero offsets are free and take no part",
                f"rms of measured less predicted: drawing {1e6 * _rms(estimate, estimate.before):.3g} um/m, "
                f"calibrated {1e6 * _rms(estimate, estimate.after):.3g} um/m",
            ),
        ),
    )
    accepted = (Paragraph(f"Written by --accept: {findings.accepted}."),) if findings.accepted else ()
    return (
        Paragraph(f"{when}{findings.origin.sentence}"),
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


def _influence(estimate: Estimate) -> tuple[Block, ...]:
    return _drawn(
        lambda: ground_test.influence_figure(estimate),
        "Strain per force of every case with one force, each gauge a point; own weight and zeros subtracted.",
        "Measured influence coefficients over predicted ones, by the drawing and as calibrated.",
        "No case has one force alone: influence coefficients are not defined.",
    )


def _residuals(findings: CalibrationFindings) -> tuple[Block, ...]:
    figures = _drawn(
        lambda: ground_test.residual_figure(findings.estimate),
        "Measured less predicted, in standard deviations of the readings; grey readings are not used.",
        "Map of residuals: load cases down, gauges across.",
    )
    cross = tables.cross_table(findings.left_out)
    return (*figures, tables.cases_table(findings.estimate), cross, tables.gauges_table(findings.estimate))


def _steps(findings: CalibrationFindings) -> tuple[Block, ...]:
    if not findings.steps:
        return (
            Paragraph(
                "The test has no steps of loading and unloading: hysteresis and return to zero are not measured. "
                "[[case.step]] of its file states them."
            ),
        )
    names = findings.estimate.model.structure.gauges.names
    figures = _drawn(
        lambda: ground_test.steps_figure(findings.steps, names),
        "Readings over the load: circles and full lines loading, squares and broken lines unloading.",
        "Strain over load for loading and unloading, the gauges of the largest strain.",
    )
    said = step_remarks(findings.estimate.model.test) or ("Readings repeat within their noise.",)
    return (Items(said), *figures, tables.steps_table(findings.steps, names))


def _checks(findings: CalibrationFindings) -> tuple[Block, ...]:
    figures = _drawn(
        lambda: ground_test.check_figure(findings.estimate, findings.checks, findings.equations),
        "Predicted and applied loads.",
        "Differences of predicted from applied loads, with three standard deviations.",
    )
    if not findings.checks:
        text = "The test has no check loads (check = true); each load that was fitted, by its readings, stands in."
        return (Paragraph(text), *figures)
    of_equations = tables.check_equations_table(findings.checks, findings.equations)
    return (*figures, tables.checks_table(findings.checks), of_equations)


def _in_flight(findings: CalibrationFindings) -> tuple[Block, ...]:
    figures = _drawn(
        lambda: ground_test.flight_figure(findings.worth),
        "Sigma of the coefficients by a linear estimator over flows of the map.",
        "Bars of sigma in flight by the drawing, after the test, and of a vehicle known exactly.",
    )
    return (*figures, tables.flight_table(findings.worth))


def _coverage(findings: CalibrationFindings) -> tuple[Block, ...]:
    worth = findings.worth
    larger = int(np.sum(worth.flight_strain > worth.ground_strain))
    text = (
        f"Combinations of the cases make up {100.0 * worth.spanned:.1f} % of the mean square strain in flight. "
        f"{larger} of {len(worth.flight_strain)} gauges strain more in flight than in any case."
    )
    figures = _drawn(
        lambda: ground_test.coverage_figure(worth, findings.estimate.model.structure.gauges.names),
        "Left: range of each load in flight, and the cases. Right: largest strain of each gauge.",
        "Loads and strains in flight and in the ground test.",
    )
    return (Paragraph(text), *figures)


def _equations(findings: CalibrationFindings) -> tuple[Block, ...]:
    text = (
        "The classical way, from the same cases: loads as sums of readings less zero offsets, coefficients by "
        "least squares, gauges chosen by T, coefficient over standard error (Skopinski, Aiken and Huston, NACA "
        "Report 1178). Where pads load a few places and flight loads the whole body, they err in flight."
    )
    return (Paragraph(text), tables.equations_table(findings.estimate, findings.equations))


def _origin(findings: CalibrationFindings) -> tuple[Block, ...]:
    cells: tuple[Table, ...] = (tables.cells_table(findings.cells),) if findings.cells else ()
    return (Paragraph(findings.origin.sentence), findings.origin.table(), *cells)


def _rms(estimate: Estimate, predicted: FloatArray) -> float:
    residual = np.where(estimate.used, estimate.model.test.readings - predicted, np.nan)
    return float(np.sqrt(np.nanmean(residual**2)))
