"""The report of a build as files: a page ``report.html``, and its numbers as ``report.json`` and CSV tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from builder.figures import build_report as draw
from builder.reports.build_report import BuildReport
from builder.reports.build_tables import report_tables
from builder.reports.first_screen import WELL, first_screen
from builder.reports.html import Block, Cards, Files, Items, Page, Paragraph, Section, picture, write_page
from builder.reports.tables import Table, tables_json, write_csv
from strainfmu.files import write_bytes_atomically

CSV_FOLDER = "report_tables"
JSON_NAME = "report.json"
PAGE_NAME = "report.html"

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
    tables = report_tables(report)
    sections = (
        _observability(report, tables),
        _blindness(report),
        _uncertainty(report, tables),
        _gauge_values(report, tables),
        _losses(report, tables),
        *((_gamma(report, tables),) if report.gamma else ()),
        Section("Noise terms", (tables["noise"],)),
        Section("Validity range", (tables["validity"], Paragraph(STRAINS_OF_GAUGES))),
        Section(NOT_INCLUDED, (Items(report.excluded),)),
        Section("Numbers", (Files(_files(tables)),)),
    )
    return Page(f"{report.vehicle}: what its gauges can observe", _opening(report), sections)


NOT_INCLUDED = "Errors not included"
STRAINS_OF_GAUGES = "The maximum strain of each gauge over the snapshots is in the table of gauges."


def blind_line(report: BuildReport) -> str:
    """Return one sentence on what the layout cannot observe."""
    if not report.blind_classes:
        return f"Layout {report.layout} is blind to no class of symmetry."
    parts = []
    for i in report.blind_classes:
        fraction = report.observability.class_fraction[i]
        known = f" ({100.0 * fraction:.1f} % of the snapshots' variance)" if np.isfinite(fraction) else ""
        parts.append(f"pressure {report.symmetries[i].symmetry}{known}")
    return f"Layout {report.layout} is blind to {'; '.join(parts)}."


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
            f"Each sigma holds {', '.join(report.coefficients.names)}. It does not hold the "
            f'{len(report.excluded)} errors listed under "{NOT_INCLUDED}". The range is that of the snapshots.'
        ),
    )


def _observability(report: BuildReport, tables: dict[str, Table]) -> Section:
    return Section(
        "What this layout observes",
        (
            Paragraph(
                "Pressure is split by its symmetry about the planes y = 0 and z = 0. Response: strain over all "
                "gauges per rms pressure, for smooth pressures. Variance removed: of the snapshots' pressure. At "
                "best: by the best linear map of the same gauges and noise."
            ),
            tables["classes"],
            picture(
                draw.known_pressure(report.surface, report.observability.node_removed, report.inverse_map),
                "Fraction of the pressure's variance that the data remove, on the unrolled body. Circles are "
                "axial gauges, squares hoop gauges, diamonds inclined ones, drawn slightly apart.",
                "Map of the unrolled body: fraction of the pressure's variance that the data remove.",
            ),
            picture(
                draw.modes(
                    of_variance=report.observability.mode_fraction,
                    removed=report.observability.mode_removed,
                    removed_at_best=report.observability.mode_removed_at_best,
                    n_kept=report.observability.n_kept,
                ),
                "The first POD modes: fraction of the variance in each, and what remains after the estimate.",
                "Bars of the variance of each mode with marks for the part that remains after the estimate.",
                "svg",
            ),
            tables["modes"],
            tables["singular_values"],
        ),
    )


def _blindness(report: BuildReport) -> Section:
    blocks: list[Block] = [Paragraph(blind_line(report))]
    observed = report.observability
    for i in report.blind_classes:
        if not np.isfinite(observed.class_removed[i]):
            continue
        blocks.append(
            Paragraph(
                f"No gauge responds to pressure {report.symmetries[i].symmetry}. It is "
                f"{100.0 * observed.class_fraction_of_kept[i]:.1f} % of the variance of the modes that the map "
                f"keeps. The part that this map still estimates, {100.0 * observed.class_removed[i]:.1f} %, is "
                "inferred: in the snapshots it is correlated with pressure that the gauges observe. In a flight "
                "without that correlation the inferred part is wrong, and neither sigma nor chi-square shows it."
            )
        )
    if np.isfinite(observed.class_fraction).all():
        blocks.append(
            picture(
                draw.classes(
                    of_snapshots=observed.class_fraction,
                    of_kept_modes=observed.class_fraction_of_kept,
                    removed=observed.class_removed,
                    removed_at_best=observed.class_removed_at_best,
                    blind=report.blind_classes,
                ),
                "Left: fraction of the variance in each class. Right: how much of it the data remove.",
                "Bars of the variance per class of symmetry, and of the fraction that the data remove.",
                "svg",
            )
        )
    else:
        blocks.append(
            Paragraph("The surface is not symmetric about y = 0 and z = 0: fractions per class are not given.")
        )
    return Section("Blindness", tuple(blocks))


def _uncertainty(report: BuildReport, tables: dict[str, Table]) -> Section:
    return Section(
        "Uncertainty of each coefficient",
        (
            tables["coefficients"],
            picture(
                draw.coefficients(
                    sources=report.coefficients.names,
                    of_variance=report.coefficients.variance / report.coefficients.std**2,
                    std_of_range=report.coefficients.std_of_range,
                    correlation=report.coefficients.correlation,
                ),
                "Sources of each variance; 3 sigma over the range of the snapshots; correlation of errors.",
                "Bars of the sources of each coefficient's variance and of 3 sigma over its range; correlations.",
                "svg",
            ),
            tables["sources"],
            tables["source_sigmas"],
            tables["correlations"],
        ),
    )


def _gauge_values(report: BuildReport, tables: dict[str, Table]) -> Section:
    groups: Block = (
        tables["groups"]
        if report.gauges.groups
        else Paragraph("A fault can be attributed to a single gauge, for every gauge.")
    )
    return Section(
        "Value of each gauge",
        (
            Paragraph(
                "Leverage is the fraction of a gauge's information that no other gauge has: 1 where no other "
                "gauge checks it. A bias of the stated size is detected, or attributed to its gauge, in 99 % of "
                "the cases, at one false alarm in 10,000. The effect of an undetected bias is given in sigmas of "
                "the coefficient that it affects most."
            ),
            picture(
                draw.gauge_loss(
                    report.inverse_map,
                    growth=report.gauges.growth,
                    detectable_bias=report.gauges.detectable_bias,
                ),
                "Growth of each sigma when one gauge is lost, and the minimum detectable bias, at the gauge's "
                "position on the unrolled body. Black: the others do not identify the state.",
                "Six unrolled bodies with gauges coloured by the cost of their loss.",
                "svg",
            ),
            tables["gauges"],
            groups,
        ),
    )


def _losses(report: BuildReport, tables: dict[str, Table]) -> Section:
    return Section(
        "Cost of a lost gauge",
        (
            tables["worst_losses"],
            tables["worst_pairs"],
            picture(
                draw.pair_loss(
                    report.inverse_map,
                    growth=report.gauges.growth,
                    pairs=report.gauges.pairs,
                    pair_growth=report.gauges.pair_growth,
                ),
                "Loss of two gauges: growth of the sigma that grows most. On the diagonal: loss of one gauge.",
                "Matrix of gauges by gauges coloured by the cost of losing both.",
            ),
        ),
    )


def _gamma(report: BuildReport, tables: dict[str, Table]) -> Section:
    assert report.gamma is not None
    above = int(np.sum(report.gamma.eigenvalues >= report.gamma.gamma))
    return Section(
        "Weight of the prior",
        (
            Paragraph(
                f"{above} modes have an eigenvalue of at least gamma = {report.gamma.gamma:.4g}: there the data "
                "outweigh the prior. The rules are applied to the data expected from prior and noise. The "
                "L-curve is a diagnostic: no map is built from its corner."
            ),
            tables["gamma_rules"],
            picture(
                draw.eigenvalues(report.gamma.eigenvalues, report.gamma.gamma),
                "Eigenvalues of the prior-preconditioned Hessian, and filter factors lambda / (lambda + gamma).",
                "Falling eigenvalues with gamma as a line, and bars of filter factors.",
                "svg",
            ),
            picture(
                draw.l_curve(report.gamma.curve, report.gamma.found),
                "L-curve: size of the states against size of the residual, with the gamma of every rule.",
                "Curve of solution norm over residual norm with marks for each rule.",
                "svg",
            ),
            tables["eigenvalues"],
        ),
    )


def _files(tables: dict[str, Table]) -> tuple[tuple[str, str], ...]:
    of_tables = ((f"{CSV_FOLDER}/{name}.csv", table.caption) for name, table in tables.items())
    return ((JSON_NAME, "all tables in full"), *of_tables)
