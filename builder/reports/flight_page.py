"""The page of an estimated flight: whether its loads may be used, when not and why, what was read, and figures."""

from collections.abc import Mapping
from math import isfinite
from pathlib import Path

from builder.reports.page.html import Block, Cards, Items, Page, Paragraph, Picture, Section, picture, write_page
from builder.reports.page.origin import input_files, origin_of
from builder.reports.page.page_tables import Column, Table, make_table
from strainfmu.errors import InputError
from strainfmu.estimator.health import USABLE_STATES, HealthState
from strainfmu.interface.enumerations import HEALTH_ITEMS
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.recorded.summary import EstimationSummary

SUFFIXES = (".html", ".pdf")

_WIDTH = 7.6
"""Of figures [in]."""

_FEW = 3

_USABLE = tuple(HealthState(state).name for state in USABLE_STATES)

FITS_WORST = "fits worst"
"""What is said of a gauge whose residual is the largest in samples that do not fit the map."""


def check_report(path: Path) -> None:
    """Refuse a page of another kind before any work begins.

    Raises
    ------
    InputError
        It is neither HTML nor PDF.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: --report: expected one of {', '.join(SUFFIXES)}, got '{path.suffix}'")


def write_flight_page(summary: EstimationSummary, report: str | Path, files: Mapping[str, str | Path]) -> None:
    """Write the page of an estimated flight, HTML or PDF: usable or not, figures.

    Parameters
    ----------
    summary : of :func:`strainfmu.estimate`.
    report : page of the flight to write, HTML or PDF: usable or not, figures.
    files : those that it follows from, by what they are: "recording" and "estimator", and others.

    Raises
    ------
    StrainfmuError
        matplotlib or reportlab is not installed, or the file cannot be written.
    """
    path = Path(report)
    page = flight_page(summary, {name: Path(file) for name, file in files.items()})
    if path.suffix.lower() == ".html":
        write_page(page, path)
        return
    from builder.reports.page.pdf import write_pdf

    write_pdf(page, path)


def flight_page(summary: EstimationSummary, files: dict[str, Path]) -> Page:
    """Return the page."""
    origin = origin_of(input_files(files))
    data = files["recording"].name
    not_usable = summary.samples - sum(summary.health[name] for name in _USABLE)
    opening: tuple[Block, ...] = (
        Paragraph(
            f"{summary.samples} samples of {data}, {summary.first:.6g} to {summary.last:.6g} s, one every "
            f"{1e3 * summary.gaps.period:.6g} ms, estimated with {files['estimator'].name}. {origin.sentence}"
        ),
        Cards(_cards(summary, not_usable)),
    )
    sections = [
        Section("Loads", (_figure(summary, "loads", "Loads, and 3 standard deviations about them."),)),
        Section("Air data and health", (_figure(summary, "state", "Air data, and the state of health."),)),
    ]
    if not_usable:
        sections.append(Section("When loads are not usable", (_periods(summary),)))
    if rows := _faulty(summary):
        columns = Column("gauge"), Column("fault"), Column("samples"), Column("first", "s"), Column("largest |z|")
        caption = "Gauges that were faulty or do not fit the others; z is the standardised residual."
        sections.append(Section("Faulty gauges", (make_table("gauges", caption, columns, rows),)))
    read = [*summary.notes]
    if summary.faults.missing:
        total = sum(summary.faults.missing.values())
        read.insert(0, f"{total} strains without a value, in {len(summary.faults.missing)} gauges: left out.")
    blocks: list[Block] = [origin.table()]
    blocks += [Items(tuple(read))] if read else []
    blocks += [_gaps(summary)] if summary.gaps.number else []
    sections.append(Section("What was read", tuple(blocks)))
    return Page(f"Loads of {data}", opening, tuple(sections))


def _cards(summary: EstimationSummary, not_usable: int) -> tuple[tuple[str, str, tuple[str, ...]], ...]:
    """Return the answer, reasons, largest loads, and what is to be known of the recording."""
    history, total = summary.history, max(summary.samples, 1)
    usable = summary.samples - not_usable
    title = (
        "Loads are usable" if not not_usable else "Loads are usable in part" if usable else "Loads are not usable"
    )
    colour = "green" if not not_usable else "amber" if usable > 0.5 * total else "red"
    answer = [
        f"{usable} of {summary.samples} samples ({100.0 * usable / total:.4g} %) may be used with their sigmas."
    ]
    if degraded := summary.health["DEGRADED"]:
        answer.append(f"{degraded} of them are DEGRADED: with fewer gauges or air data, and larger sigmas.")
    reasons = {state.name: f"{text[0].lower()}{text[1:]}" for state, text in HEALTH_ITEMS}
    not_ok = [(state, n) for state, n in summary.health.most_common() if state not in _USABLE]
    why = [f"{state}, {n} samples: {reasons.get(state, state)}." for state, n in not_ok]
    if summary.refused:
        why.append(f"{summary.refused} samples were refused by the FMU.")
    if history.periods:
        first, n = history.periods[0], len(history.periods) + history.further
        why.append(f"{'Once' if n == 1 else f'{n} times, first'} from {first.begin:.6g} to {first.end:.6g} s.")
    peaks = tuple(
        f"{load.label}: {_shown(peak.value, load.unit)} ± {_shown(3.0 * peak.sigma, load.unit)} (3 sigma) at "
        f"{peak.time:.6g} s"
        for load, peak in zip(LOADS.values(), history.peaks.values(), strict=True)
        if isfinite(peak.value)
    )
    faulty = _faulty(summary)
    known = [f"{name}: {kind} in {n} samples." for name, kind, n, *_ in faulty[:_FEW] if kind != FITS_WORST]
    known = known or [f"{name}: {kind} in {n} samples." for name, kind, n, *_ in faulty[:_FEW]]
    if summary.faults.dead:
        known.append("--exclude auto leaves gauges out that stand still.")
    if summary.gaps.number:
        known.append(f"Gaps: {summary.gaps.number}, the longest of {summary.gaps.longest:.6g} s.")
    if summary.unused:
        known.append(f"{len(summary.unused)} columns are not used.")
    return (
        (title, colour, tuple(answer)),
        ("When not, and why", "red" if why else "green", tuple(why)),
        ("Largest loads", "blue", peaks),
        ("Gauges and recording", "amber" if known else "green", tuple(known)),
    )


def _shown(value: float, unit: str) -> str:
    return (
        f"{1e-3 * value:.4g} k{unit.replace('.', ' ')}"
        if abs(value) >= 1e4
        else f"{value:.4g} {unit.replace('.', ' ')}"
    )


def _figure(summary: EstimationSummary, which: str, caption: str) -> Picture:
    text = f"{caption} Lines end at gaps." if summary.gaps.number else caption
    return picture(summary.history.plot(which, _WIDTH), text, caption)


def _periods(summary: EstimationSummary) -> Table:
    history = summary.history
    columns = Column("health"), Column("from", "s", ".6g"), Column("to", "s", ".6g"), Column("samples")
    rows = [(period.state, period.begin, period.end, period.samples) for period in history.periods]
    more = f" {history.further} further ones are not listed." if history.further else ""
    return make_table("periods", f"Periods in which loads are not usable.{more}", columns, rows)


def _faulty(summary: EstimationSummary) -> list[tuple[str, str, int, float, float]]:
    """Return gauge, fault, samples, time of the first [s] and largest |z| of each faulty gauge."""
    rows = []
    misfits, faults = summary.history.misfits, summary.faults
    for kind, gauges in (("stands still", faults.dead), ("beyond any flow of the map", faults.railed)):
        for name, fault in gauges.items():
            largest = misfits[name].largest if name in misfits else float("nan")
            rows.append((name, kind, fault.rows, fault.begin, largest))
    named = {name for name, *_ in rows}
    ranked = sorted(misfits.items(), key=lambda item: -item[1].samples)
    blamed = {name for counts in summary.blamed.values() for name in counts}
    for name, misfit in ranked:
        if name not in named and name in blamed and misfit.largest > _FEW:
            rows.append((name, FITS_WORST, misfit.samples, float("nan"), misfit.largest))
    return rows


def _gaps(summary: EstimationSummary) -> Table:
    gaps = summary.gaps
    columns = Column("gap behind", "s", ".6g"), Column("length", "s", ".6g")
    more = "" if gaps.number <= len(gaps.first) else f", the first {len(gaps.first)} of {gaps.number}"
    return make_table("gaps", f"Gaps between samples{more}.", columns, gaps.first)
