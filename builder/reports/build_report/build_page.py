"""The report of a build as files: a page ``report.html``, and its numbers as ``report.json`` and CSV tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from builder.placement.review import Review
from builder.reports.build_report import build_sections as sections
from builder.reports.build_report.build_findings import BuildReport
from builder.reports.build_report.build_sections import layout_section
from builder.reports.build_report.build_tables import first_rows, report_tables
from builder.reports.build_report.first_screen import WELL, first_screen
from builder.reports.findings.coefficient_sources import CoefficientSources
from builder.reports.page.html import Block, Cards, Files, Items, Page, Paragraph, Section, write_page
from builder.reports.page.page_tables import Table, percent, tables_json, write_csv
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.files import write_bytes_atomically

CSV_FOLDER = "report_tables"
JSON_NAME = "report.json"
PAGE_NAME = "report.html"
ROWS_ON_PAGE = 200
"""Rows of a table that the page holds, folded; the files hold all of them."""

SCHEMA_VERSION = 5
"""Version of report.json; raised when names or meanings change."""


def write_numbers(report: BuildReport, folder: Path) -> None:
    """Write every table of ``report`` to ``folder``: CSV files in one folder, then one JSON file, each atomically.

    Raises
    ------
    StrainfmuError
        A file could not be written.
    """
    tables = report_tables(report)
    write_csv(tables, folder / CSV_FOLDER)
    content = {
        "schema_version": SCHEMA_VERSION,
        "made": report.origin.as_json(),
        "vehicle": report.vehicle,
        "estimator": "nonlinear" if report.in_use.is_nonlinear else "linear",
        "layout": report.layout,
        "model_form_percent": report.model_form_percent,
        "estimator_choice": report.inverse_map.provenance.get("estimator_choice"),
        "case": report.inverse_map.case,
        "engine": report.engine,
        "structural_model": report.structural_model,
        "blind_classes": [str(report.symmetries[i].symmetry) for i in report.blind_classes],
        "mode_choice": list(sections.mode_choice_of(report)),
        "excluded": list(report.excluded),
        "summary": first_screen(report).as_json(),
        "tables": tables_json(tables),
    }
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    write_bytes_atomically(folder / JSON_NAME, text.encode("utf-8"))


def write_report_page(report: BuildReport, path: Path) -> None:
    """Draw the figures and write the page to ``path``.

    Raises
    ------
    StrainfmuError
        The file could not be written, or matplotlib is missing.
    """
    write_page(report_page(report), path)


def report_page(report: BuildReport, review: Review | None = None) -> Page:
    """Return the page; with the ``review`` of a layout, which has no files of numbers, the section on it."""
    tables = {name: first_rows(table, ROWS_ON_PAGE) for name, table in report_tables(report).items()}
    of_page = (
        sections.observability(report, tables),
        sections.blindness(report),
        *((sections.flight_accuracy(report.flight, tables),) if report.flight else ()),
        *((Section("Both estimators", (tables["estimator_choice"],)),) if "estimator_choice" in tables else ()),
        sections.uncertainty(report, tables),
        sections.gauge_values(report, tables),
        sections.losses(report, tables),
        *(() if review is None else (layout_section(review),)),
        *((sections.gamma_choice(report, tables),) if report.gamma and not report.in_use.is_nonlinear else ()),
        sections.aerodynamics(report),
        *(() if report.in_use.is_nonlinear else (Section("Noise terms", (tables["noise"],)),)),
        Section("Validity range", (tables["validity"], Paragraph(STRAINS_OF_GAUGES))),
        Section(NOT_INCLUDED, (Items(report.excluded),)),
        *((Section("Made from", (tables["made_from"],)),) if "made_from" in tables else ()),
        *((Section("Numbers", (Files(_files(tables)),)),) if review is None else ()),
    )
    return Page(f"{report.vehicle}: what its gauges can observe", _opening(report), of_page)


NOT_INCLUDED = "Errors not included"
STRAINS_OF_GAUGES = "The maximum strain of each gauge over the snapshots is in the table of gauges."


def _opening(report: BuildReport) -> tuple[Block, ...]:
    inverse_map, used, screen = report.inverse_map, report.in_use, first_screen(report)
    modes = "POD modes, by least squares" if inverse_map.case == 1 else "states under a Gaussian prior"
    of_linear = f"Case {inverse_map.case}, {inverse_map.n_states} {modes}"
    both = f"nonlinear, and the linear map ({of_linear}) where strain does not fit the tables"
    return (
        Paragraph(report.origin.sentence),
        Paragraph(
            f"Layout {report.layout}, {inverse_map.n_gauges} gauges; estimator: "
            f"{both if used.is_nonlinear else f'linear, {of_linear}'}; "
            f"flow by the {report.engine} engine, structure: {report.structural_model}."
        ),
        *_choice(report),
        Cards(
            (
                (f"Measured well: sigma up to {100.0 * WELL:g} % of the range", "green", screen.well),
                ("Measured badly", "amber", screen.badly),
                ("Not measured at all", "red", screen.unmeasured),
                ("What would help most", "blue", screen.helps),
            )
        ),
        Paragraph(
            f"Each sigma is {'of the nonlinear estimator, ' if used.is_nonlinear else ''}{used.where}. It "
            f"includes {len(used.coefficients.names)} sources: {', '.join(used.coefficients.group_variance)}. "
            f"It does not include the {len(report.excluded)} errors listed under "
            f'"{NOT_INCLUDED}". The range is taken over the snapshots.'
        ),
        *_without_hardware(used.coefficients),
        *([] if (line := sections.model_form_line(report)) is None else [Paragraph(line)]),
    )


def _choice(report: BuildReport) -> list[Block]:
    """Return which estimator "auto" uses, and why, where it decided."""
    choice = report.inverse_map.provenance.get("estimator_choice")
    if choice is None:
        return []
    on = f", on {choice['flights']}" if choice["flights"] else ""
    return [Paragraph(f"map.estimator = 'auto' uses the {choice['used']} estimator: {choice['why']}{on}.")]


def _without_hardware(sources: CoefficientSources) -> list[Block]:
    """Return the sigmas without hardware errors, where there are any."""
    if not sources.hardware:
        return []
    ratio = sources.std_without(sources.hardware) / sources.std
    parts = [
        f"{name} {percent(fraction, '.3g')}"
        for name, fraction in zip(COEFFICIENT_NAMES, sources.std_of_range * ratio, strict=True)
        if np.isfinite(fraction)
    ]
    text = f"{len(sources.hardware)} of the sources are installation errors."
    return [Paragraph(f"{text} Without them sigma over the range would be {', '.join(parts)}.")]


def _files(tables: dict[str, Table]) -> tuple[tuple[str, str], ...]:
    of_tables = ((f"{CSV_FOLDER}/{name}.csv", table.caption) for name, table in tables.items())
    return ((JSON_NAME, "all tables in full"), *of_tables)
