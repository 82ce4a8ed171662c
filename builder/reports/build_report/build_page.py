"""The report of a build as files: a page ``report.html``, and its numbers as ``report.json`` and CSV tables.

The first screen of the page says what a layout measures well, badly, not at all, and what would help most. Every
sentence follows from numbers of the report; one without its cause is left out. The estimator in use is judged:
where it is the nonlinear one, sentences on the linear map alone are left out.
"""

import json
from dataclasses import asdict, dataclass
from operator import itemgetter
from pathlib import Path

import numpy as np

from builder.placement.review import Review
from builder.reports.build_report import build_sections as sections
from builder.reports.build_report.build_findings import BuildReport
from builder.reports.build_report.build_sections import layout_section
from builder.reports.build_report.build_tables import entry_of, first_rows, largest_source, report_tables
from builder.reports.findings.coefficient_sources import CoefficientSources
from builder.reports.page.html import Block, Cards, Files, Items, Page, Paragraph, Section, write_page
from builder.reports.page.page_tables import Column, Table, percent, shown, tables_json, write_csv
from builder.structure.observability import Symmetry
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, LOAD_NAMES
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


WELL = 0.05
"""Sigma over the range of the snapshots up to which a coefficient counts as measured well."""

UNMEASURED = 12.0**-0.5
"""The same of an even spread over the range: an estimate with this sigma adds nothing to the range itself."""

PRESSURE_WELL = 0.9
"""Fraction of the pressure's variance from which it counts as measured well."""

SMALL_FRACTION = 1e-3
"""Fraction of the snapshots' variance below which a mode or a class is not worth a sentence."""

MAX_MODES = 3
NEAR_PLANE = 1e-3
"""Distance from a plane of symmetry over the distance from the axis, up to which a gauge lies on it."""


@dataclass(frozen=True, kw_only=True)
class FirstScreen:
    """Sentences in the order of their weight; a list may be empty.

    Attributes
    ----------
    well, badly, unmeasured : coefficients and pressure by their uncertainty.
    helps : what would reduce it most.
    """

    well: tuple[str, ...]
    badly: tuple[str, ...]
    unmeasured: tuple[str, ...]
    helps: tuple[str, ...]

    def as_json(self) -> dict[str, list[str]]:
        """Return the lists for JSON."""
        return {name: list(lines) for name, lines in asdict(self).items()}


def first_screen(report: BuildReport) -> FirstScreen:
    """Return the sentences of ``report``."""
    of_range, linear = report.in_use.coefficients.std_of_range, not report.in_use.is_nonlinear
    order = [int(i) for i in np.argsort(of_range, kind="stable")]
    well = [_coefficient(report, i) for i in order if of_range[i] <= WELL]
    badly = [_coefficient(report, i) for i in order[::-1] if WELL < of_range[i] < UNMEASURED]
    lost = [_coefficient(report, i) for i in order[::-1] if of_range[i] >= UNMEASURED]
    removed = report.in_use.pressure_removed
    if removed is not None:
        (well if removed >= PRESSURE_WELL else badly).append(_pressure(removed))
    of_map = (*_hidden_area(report), *_weak_modes(report)) if linear else ()
    helps = (*_largest_source(report), *(_largest_noise(report) if linear else ()), *_blind_gauges(report))
    return FirstScreen(
        well=tuple(well),
        badly=(*_rough_mesh(report), *badly, *of_map),
        unmeasured=(*lost, *_blind_classes(report), *(_silent_modes(report) if linear else ())),
        helps=(*helps, *(_other_map(report) if linear else ()), *_costly_gauge(report)),
    )


def _coefficient(report: BuildReport, index: int) -> str:
    used, name = report.in_use, f"{COEFFICIENT_NAMES[index]}, {LOAD_NAMES[index].replace('_', ' ')}"
    accuracy = used.coefficients
    low, high = accuracy.range[index]
    fraction = accuracy.std_of_range[index]
    if not np.isfinite(fraction):
        return f"{name}: it is {_value(low)} in every snapshot, so that the map holds no variation of it."
    largest = f" rms, {used.largest_std[index]:.2g} at most" if used.is_nonlinear else ""
    of_what = f"{_percent(fraction)} of the range {_value(low)} to {_value(high)}"
    source, part = largest_source(accuracy, index)
    dominates = f"{_percent(part)} of its variance is from {_with_entry(report, source)}"
    return f"{name}: sigma {accuracy.std[index]:.2g}{largest}, {of_what}; {dominates}."


def _with_entry(report: BuildReport, source: str) -> str:
    entry = entry_of(report, source)
    return f"{source} ({entry})" if entry else source


def _pressure(removed: float) -> str:
    return f"Surface pressure: the data remove {_percent(removed)} of the variance of the snapshots."


def _rough_mesh(report: BuildReport) -> list[str]:
    """Return that no sigma is to be trusted, where the mesh's error is too large."""
    error = report.inverse_map.provenance.get("mesh_error")
    if error is None or error["sigmas_trusted"]:
        return []
    return [
        f"All sigmas: the error of the structure's mesh is {error['rms_sigma']:.2g} sigma of gauge noise, against "
        f"{error['against']}; they are not to be trusted."
    ]


def _hidden_area(report: BuildReport) -> list[str]:
    """Return the part of the surface where most of the variance is left."""
    removed, area = report.observability.node_removed, report.surface.node_area
    hidden = float(area[removed < 0.5].sum() / area.sum())
    if hidden < SMALL_FRACTION:
        return []
    return [f"Pressure on {_percent(hidden)} of the surface: less than half of its variance is removed."]


def _signal(report: BuildReport) -> FloatArray:
    """Return (k,) strain of each mode at one standard deviation over the noise, over all gauges together [1]."""
    inverse_map = report.inverse_map
    return report.observability.mode_strain * np.sqrt(inverse_map.n_gauges / np.mean(inverse_map.noise_std**2))


def _weak_modes(report: BuildReport) -> list[str]:
    observed = report.observability
    weak = (observed.mode_removed < 0.5) & (_signal(report) >= 1.0) & (observed.mode_fraction >= SMALL_FRACTION)
    lines = []
    for j in np.flatnonzero(weak)[:MAX_MODES].tolist():
        removed = f"{_percent(max(observed.mode_removed[j], 0.0))} of it is removed"
        what = removed if observed.is_state[j] else "it is no state of this map"
        lines.append(
            f"POD mode {j + 1}, {_percent(observed.mode_fraction[j])} of the variance: {what}; the best linear "
            f"map would remove {_percent(observed.mode_removed_at_best[j])}."
        )
    return lines


def _silent_modes(report: BuildReport) -> list[str]:
    fraction = report.observability.mode_fraction
    silent = (_signal(report) < 1.0) & (fraction >= SMALL_FRACTION)
    return [
        f"POD mode {j + 1}, {_percent(fraction[j])} of the variance: its strain is below the noise of all gauges "
        "together."
        for j in np.flatnonzero(silent)[:MAX_MODES].tolist()
    ]


def _blind_classes(report: BuildReport) -> list[str]:
    fraction = report.observability.class_fraction
    return [
        f"Pressure {report.symmetries[i].symmetry}, {_in_words(report.symmetries[i].symmetry)}"
        + (f", {_percent(fraction[i])} of the variance of the snapshots" if np.isfinite(fraction[i]) else "")
        + ": no gauge responds to it."
        for i in report.blind_classes
    ]


def _in_words(symmetry: Symmetry) -> str:
    sides = "alike" if symmetry.even_in_y else "opposite"
    heights = "alike" if symmetry.even_in_z else "opposite"
    return f"{sides} on port and starboard, {heights} above and below"


def _largest_source(report: BuildReport) -> list[str]:
    """Return what the sigma of the most uncertain coefficient would be without its largest source."""
    accuracy = report.in_use.coefficients
    of_range = accuracy.std_of_range
    finite = np.isfinite(of_range)
    if not finite.any():
        return []
    worst = int(np.argmax(np.where(finite, of_range, -1.0)))
    source, _ = largest_source(accuracy, worst)
    remaining = accuracy.std_without([source])[worst] / accuracy.std[worst]
    return [
        f"The source to reduce first is {_with_entry(report, source)}: without it the sigma of "
        f"{COEFFICIENT_NAMES[worst]} would be {_percent(of_range[worst] * remaining)} of the "
        f"range, not {_percent(of_range[worst])}."
    ]


def _largest_noise(report: BuildReport) -> list[str]:
    terms = report.inverse_map.provenance["noise_terms"]
    if len(terms) < 2:
        return []
    noise = max(terms, key=itemgetter("share"))
    return [
        f"The largest of {len(terms)} noise terms is {noise['name']}: {_percent(noise['share'])} of the "
        f"whitened variance, {1e6 * noise['rms_strain']:.2g} um/m rms."
    ]


def _blind_gauges(report: BuildReport) -> list[str]:
    """Return where a gauge would respond to a blind class: off the planes on which all of them lie."""
    position = report.inverse_map.gauge_position
    radius = np.hypot(position[:, 1], position[:, 2])
    on_plane = np.abs(position[:, 1:]) <= NEAR_PLANE * radius[:, None]
    lines = []
    for i in report.blind_classes:
        odd = _odd_planes(report.symmetries[i].symmetry)
        if odd and on_plane[:, odd].any(axis=1).all():
            planes = " or ".join(f"{'yz'[k]} = 0" for k in odd)
            lines.append(
                f"A gauge off the plane{'s' if len(odd) > 1 else ''} {planes.replace(' or ', ' and ')}: all "
                f"{len(position)} lie on {planes}, and pressure {report.symmetries[i].symmetry} strains none."
            )
    return lines


def _odd_planes(symmetry: Symmetry) -> list[int]:
    return [k for k, even in enumerate((symmetry.even_in_y, symmetry.even_in_z)) if not even]


def _other_map(report: BuildReport) -> list[str]:
    """Return how much of what is left another map of the same gauges could remove."""
    rest, at_best = 1.0 - report.observability.removed, 1.0 - report.observability.removed_at_best
    if rest < SMALL_FRACTION:
        return []
    return [
        f"Of the pressure's variance {_percent(rest)} is left. The best linear map of these gauges would leave "
        f"{_percent(at_best)}; less than that takes other gauges."
    ]


def _costly_gauge(report: BuildReport) -> list[str]:
    growth, inverse_map = report.gauges.growth, report.inverse_map
    costly = int(np.argmax(growth.max(axis=1)))
    worst = int(np.argmax(growth[costly]))
    ratio = growth[costly, worst]
    cost = (
        f"{_percent(ratio - 1.0)} more sigma of {COEFFICIENT_NAMES[worst]}"
        if np.isfinite(ratio)
        else "no estimate"
    )
    return [f"The gauge to protect, or to double, is {inverse_map.gauge_names[costly]}: without it {cost}."]


def _value(coefficient: float) -> str:
    return shown(float(coefficient), Column("", "1", ".3f"))


def _percent(fraction: float) -> str:
    rounded = round(fraction, 6)
    return percent(rounded, ".3g" if rounded >= 0.1 else ".2g")
