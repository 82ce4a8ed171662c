"""The report of a build as files: ``report.html`` to read, ``report.json`` and CSV tables to go on with."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from builder.figures import build_report as draw
from builder.reports.build_report import BuildReport
from builder.reports.build_tables import first_rows, report_tables
from builder.reports.html import Block, Files, Items, Page, Paragraph, Section, picture, write_page
from builder.reports.tables import Table, tables_json, write_csv
from strainfmu.estimator.inverse_map import COEFFICIENT_NAMES
from strainfmu.files import write_bytes_atomically

CSV_FOLDER = "report_tables"
JSON_NAME = "report.json"
PAGE_NAME = "report.html"
ROWS_ON_PAGE = 20

SCHEMA_VERSION = 1
"""Of report.json; higher where names or meanings change."""


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
    """Return the page: answers in the order in which they are asked."""
    tables = report_tables(report)
    sections = (
        _sight(report, tables),
        _blindness(report),
        _sureness(report, tables),
        _worth(report, tables),
        _losses(report, tables),
        *((_gamma(report, tables),) if report.gamma else ()),
        Section("What counts as noise", (tables["noise"],)),
        Section("Where the map holds", (tables["validity"], Paragraph(STRAINS_OF_GAUGES))),
        Section("What is not in these numbers", (Items(report.excluded),)),
        Section("Numbers", (Files(_files(tables)),)),
    )
    return Page(f"{report.vehicle}: what its gauges tell", _opening(report), sections)


STRAINS_OF_GAUGES = "The greatest strain of each gauge over the snapshots stands in the table of gauges."


def blind_line(report: BuildReport) -> str:
    """Return one sentence on what the layout cannot see."""
    if not report.blind_classes:
        return f"Layout {report.layout} is blind to no class of symmetry."
    parts = []
    for i in report.blind_classes:
        share = report.sight.class_share[i]
        known = f" ({100.0 * share:.1f} % of the snapshots' variance)" if np.isfinite(share) else ""
        parts.append(f"pressure {report.symmetries[i].symmetry}{known}")
    return f"Layout {report.layout} is blind to {'; '.join(parts)}."


def _opening(report: BuildReport) -> tuple[Block, ...]:
    one = report.inverse_map
    modes = "POD modes, by least squares" if one.case == 1 else "states under a Gaussian prior"
    sight = report.sight
    dear = int(np.argmax(report.gauges.growth.max(axis=1)))
    of = int(np.argmax(report.gauges.growth[dear]))
    share = report.coefficients.std_of_range
    unsure = int(np.argmax(np.where(np.isfinite(share), share, -1.0)))
    return (
        Paragraph(
            f"Layout {report.layout}, {one.n_gauges} gauges; Case {one.case}, {len(one.state_offset)} {modes}; "
            f"flow by the {report.engine} engine, structure: {report.structural_model}."
        ),
        Items(
            (
                f"The data remove {100.0 * sight.removed:.1f} % of the variance of the snapshots' pressure; the "
                f"best linear map would remove {100.0 * sight.removed_at_best:.1f} %.",
                blind_line(report),
                f"Least known of its range is {COEFFICIENT_NAMES[unsure]}: sigma is "
                f"{100.0 * share[unsure]:.2g} % of it.",
                f"The dearest gauge is {one.gauge_names[dear]}: {_grown(report.gauges.growth[dear, of])} "
                f"{COEFFICIENT_NAMES[of]} without it.",
            )
        ),
    )


def _grown(ratio: float) -> str:
    return f"{100.0 * (ratio - 1.0):.2g} % more sigma of" if np.isfinite(ratio) else "nothing is left of"


def _sight(report: BuildReport, tables: dict[str, Table]) -> Section:
    return Section(
        "What this layout sees",
        (
            Paragraph(
                "Pressure is split by its symmetry about the planes y = 0 and z = 0. Response: strain over all "
                "gauges per rms pressure, of smooth pressures. Variance removed: of the pressures that fly, the "
                "snapshots; at best means the best linear map of the same gauges and noise."
            ),
            tables["classes"],
            picture(
                draw.known_pressure(report.surface, report.sight.node_removed, report.inverse_map),
                "Share of the pressure's variance that the data remove, on the unrolled body; circles are axial "
                "gauges, squares hoop gauges, drawn a little apart.",
                "Map of the unrolled body showing where pressure becomes known.",
            ),
            picture(
                draw.modes(
                    of_variance=report.sight.mode_share,
                    removed=report.sight.mode_removed,
                    removed_at_best=report.sight.mode_removed_at_best,
                    n_kept=report.sight.n_kept,
                ),
                "The first POD modes: how much of the variance each is, and how much is left of it.",
                "Bars of the variance of each mode with marks for what the estimate leaves of it.",
                "svg",
            ),
            first_rows(tables["modes"], ROWS_ON_PAGE),
            first_rows(tables["singular_values"], ROWS_ON_PAGE),
        ),
    )


def _blindness(report: BuildReport) -> Section:
    said: list[Block] = [Paragraph(blind_line(report))]
    sight = report.sight
    for i in report.blind_classes:
        if not np.isfinite(sight.class_removed[i]):
            continue
        said.append(
            Paragraph(
                f"No strain tells of pressure {report.symmetries[i].symmetry}. It is "
                f"{100.0 * sight.class_share_of_kept[i]:.1f} % of the variance of the modes that the map keeps. "
                f"What becomes known of it, {100.0 * sight.class_removed[i]:.1f} % by this map, is inferred: in "
                "the snapshots it comes with pressure that the gauges see. On a flight where it does not, that "
                "part is wrong, and neither sigma nor chi-square shows it."
            )
        )
    if np.isfinite(sight.class_share).all():
        said.append(
            picture(
                draw.classes(
                    of_snapshots=sight.class_share,
                    of_kept_modes=sight.class_share_of_kept,
                    removed=sight.class_removed,
                    removed_at_best=sight.class_removed_at_best,
                    blind=report.blind_classes,
                ),
                "Left: each class's share of the variance. Right: how much of it the data remove.",
                "Bars of the variance per class of symmetry, and of the share that becomes known.",
                "svg",
            )
        )
    else:
        said.append(
            Paragraph("The surface is not symmetric about y = 0 and z = 0: shares of classes are not given.")
        )
    return Section("What it is blind to", tuple(said))


def _sureness(report: BuildReport, tables: dict[str, Table]) -> Section:
    return Section(
        "How sure each coefficient is",
        (
            tables["coefficients"],
            picture(
                draw.coefficients(
                    causes=report.coefficients.names,
                    of_variance=report.coefficients.variance / report.coefficients.std**2,
                    std_of_range=report.coefficients.std_of_range,
                    correlation=report.coefficients.correlation,
                ),
                "Where each variance comes from, 3 sigma over the range of the snapshots, correlation of errors.",
                "Bars of the causes of each coefficient's variance and of 3 sigma over its range; correlations.",
                "svg",
            ),
            tables["sources"],
            tables["source_sigmas"],
            tables["correlations"],
        ),
    )


def _worth(report: BuildReport, tables: dict[str, Table]) -> Section:
    groups: Block = tables["groups"] if report.gauges.groups else Paragraph("All gauges can be told apart.")
    return Section(
        "Which gauge matters most",
        (
            Paragraph(
                "Leverage is the share of a gauge's information that no other gauge has: 1 where nothing checks "
                "it. A bias as large as stated is noticed, or blamed on its gauge, in 99 % of the cases, at one "
                "false alarm in 10,000; what an unnoticed bias costs is in the sigmas of the coefficient it costs "
                "most."
            ),
            picture(
                draw.gauge_loss(
                    report.inverse_map,
                    growth=report.gauges.growth,
                    detectable_bias=report.gauges.detectable_bias,
                ),
                "Growth of each sigma where one gauge is lost, and the least bias that is noticed, at the gauge's "
                "place on the unrolled body; black: the others do not identify the state.",
                "Six unrolled bodies with gauges coloured by what their loss costs.",
                "svg",
            ),
            tables["gauges"],
            groups,
        ),
    )


def _losses(report: BuildReport, tables: dict[str, Table]) -> Section:
    return Section(
        "What a lost gauge costs",
        (
            tables["worst_losses"],
            first_rows(tables["worst_pairs"], ROWS_ON_PAGE),
            picture(
                draw.pair_loss(
                    report.inverse_map,
                    growth=report.gauges.growth,
                    pairs=report.gauges.pairs,
                    pair_growth=report.gauges.pair_growth,
                ),
                "The loss of two gauges: growth of the sigma that grows most. On the diagonal the loss of one.",
                "Matrix of gauges by gauges coloured by what the loss of both costs.",
            ),
        ),
    )


def _gamma(report: BuildReport, tables: dict[str, Table]) -> Section:
    assert report.gamma is not None
    above = int(np.sum(report.gamma.eigenvalues >= report.gamma.gamma))
    return Section(
        "How much the prior decides",
        (
            Paragraph(
                f"{above} modes have an eigenvalue of at least gamma = {report.gamma.gamma:.4g}: there the data "
                "outweigh the prior. The rules are given the data that prior and noise lead to expect. The "
                "L-curve is a diagnostic: no map is built by its corner."
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
            first_rows(tables["eigenvalues"], ROWS_ON_PAGE),
        ),
    )


def _files(tables: dict[str, Table]) -> tuple[tuple[str, str], ...]:
    of_tables = ((f"{CSV_FOLDER}/{name}.csv", table.caption) for name, table in tables.items())
    return ((JSON_NAME, "all tables in full"), *of_tables)
