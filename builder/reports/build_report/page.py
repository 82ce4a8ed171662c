"""The report of a build as files: a page ``report.html``, and its numbers as ``report.json`` and CSV tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from builder.reports.build_report import sections
from builder.reports.build_report.first_screen import WELL, first_screen
from builder.reports.build_report.report import BuildReport
from builder.reports.build_report.tables import first_rows, report_tables
from builder.reports.page.html import Block, Cards, Files, Items, Page, Paragraph, Section, write_page
from builder.reports.page.tables import Table, tables_json, write_csv
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.files import write_bytes_atomically

CSV_FOLDER = "report_tables"
JSON_NAME = "report.json"
PAGE_NAME = "report.html"
ROWS_ON_PAGE = 200
"""Rows of a table that the page holds, folded; the files hold all of them."""

SCHEMA_VERSION = 2
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
        "vehicle": report.vehicle,
        "layout": report.layout,
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


def report_page(report: BuildReport) -> Page:
    """Return the page."""
    tables = {name: first_rows(table, ROWS_ON_PAGE) for name, table in report_tables(report).items()}
    of_page = (
        sections.observability(report, tables),
        sections.blindness(report),
        sections.uncertainty(report, tables),
        *((sections.flight_accuracy(report.flight, tables),) if report.flight else ()),
        sections.gauge_values(report, tables),
        sections.losses(report, tables),
        *((sections.gamma_choice(report, tables),) if report.gamma else ()),
        Section("Noise terms", (tables["noise"],)),
        Section("Validity range", (tables["validity"], Paragraph(STRAINS_OF_GAUGES))),
        Section(NOT_INCLUDED, (Items(report.excluded),)),
        Section("Numbers", (Files(_files(tables)),)),
    )
    return Page(f"{report.vehicle}: what its gauges can observe", _opening(report), of_page)


NOT_INCLUDED = "Errors not included"
STRAINS_OF_GAUGES = "The maximum strain of each gauge over the snapshots is in the table of gauges."


def _opening(report: BuildReport) -> tuple[Block, ...]:
    one, found = report.inverse_map, first_screen(report)
    modes = "POD modes, by least squares" if one.case == 1 else "states under a Gaussian prior"
    return (
        Paragraph(
            f"Layout {report.layout}, {one.n_gauges} gauges; Case {one.case}, {len(one.state_offset)} {modes}; "
            f"flow by the {report.engine} engine, structure: {report.structural_model}."
        ),
        Cards(
            (
                (f"Measured well: sigma up to {100.0 * WELL:g} % of the range", "green", found.well),
                ("Measured badly", "amber", found.badly),
                ("Not measured at all", "red", found.unmeasured),
                ("What would help most", "blue", found.helps),
            )
        ),
        Paragraph(
            f"Each sigma holds {'; '.join(report.coefficients.names)}. It does not hold the "
            f'{len(report.excluded)} errors listed under "{NOT_INCLUDED}". The range is that of the snapshots.'
        ),
        *_without_hardware(report),
    )


def _without_hardware(report: BuildReport) -> list[Block]:
    """Return the sigmas without hardware errors, where the map holds any."""
    found = report.coefficients
    if not found.hardware:
        return []
    ratio = found.std_without(found.hardware) / found.std
    parts = [
        f"{name} {100.0 * share:.3g} %"
        for name, share in zip(COEFFICIENT_NAMES, found.std_of_range * ratio, strict=True)
        if np.isfinite(share)
    ]
    text = f"{len(found.hardware)} of these are hardware errors. Without them the sigmas over the range would be "
    return [Paragraph(f"{text}{', '.join(parts)}.")]


def _files(tables: dict[str, Table]) -> tuple[tuple[str, str], ...]:
    of_tables = ((f"{CSV_FOLDER}/{name}.csv", table.caption) for name, table in tables.items())
    return ((JSON_NAME, "all tables in full"), *of_tables)
