"""The page of load equations without a model: verdict, coefficients, residuals by load and gauge, check loads."""

import numpy as np

from builder.calibration.after_test.equations_map import FittedEquations
from builder.calibration.ground_test.equations_file import AT_STATION, WHOLE
from builder.reports.page.html import Cards, Items, Page, Paragraph, Section
from builder.reports.page.origin import Origin
from builder.reports.page.page_tables import Column, Table, make_table
from strainfmu.arrays import FloatArray
from strainfmu.estimator.signal_names import ZERO
from strainfmu.recorded.names import some_of

WITHIN = 3.0
"""Standard deviations within which check loads must be predicted."""

LARGEST = 0.02
"""Residual of a load over its largest applied value that is accepted [1]."""

CANNOT_SEE = (
    "An error that all applied loads have in common is not seen: it is an error of the gains.",
    "Loads beyond the applied ones are extrapolated; the map says so by its envelope.",
    "Loads that no row applies act on the gauges as well, and are taken for those that rows apply.",
)


def verdict_lines(fit: FittedEquations) -> tuple[bool, tuple[str, ...]]:
    """Return whether the equations are accepted, and a line for each reason."""
    size = np.abs(fit.test.load).max(axis=0)
    std = np.sqrt(np.diag(fit.load_covariance))
    worst = int(np.argmax(std / size))
    good = bool(std[worst] <= LARGEST * size[worst])
    name = fit.equations[worst].load
    lines = [
        f"{name}: left out of the fit, rows are predicted within {100.0 * std[worst] / size[worst]:.2g} % of its "
        f"largest value, {100.0 * LARGEST:g} % is allowed"
    ]
    checks = fit.test.is_check
    if checks.any():
        off = np.abs(fit.predicted - fit.test.load)[checks] / std
        good &= bool(off.max() <= WITHIN * np.sqrt(1.0 + np.log10(off.size)))
        lines.append(f"{checks.sum()} check loads are predicted within {off.max():.2g} standard deviations")
    else:
        lines.append("no check loads: the equations are judged by rows that are left out one by one")
    for line, gauges in fit.unlike.items():
        good = False
        lines.append(
            f"line {line} of the table: readings of {some_of(gauges)} are unlike what the other rows give at "
            "these loads: a reading or a load is wrong"
        )
    return good, tuple(lines)


def redundancy_line(fit: FittedEquations) -> str:
    """Return what redundant gauges allow."""
    n = fit.redundancy
    if not n:
        return "as many gauges as loads: faults of gauges cannot be detected"
    return f"{n} redundant gauges: faults of gauges are detected by chi-square of {n} degrees of freedom"


def equations_page(fit: FittedEquations, origin: Origin) -> Page:
    """Return the page."""
    good, lines = verdict_lines(fit)
    cards = Cards(
        (
            ("Accepted" if good else "Not accepted", "green" if good else "red", lines),
            ("Health in flight", "green" if fit.redundancy else "amber", (redundancy_line(fit),)),
        )
    )
    is_check = fit.test.is_check
    sections = [
        Section("Load equations", (equations_table_of(fit),)),
        Section("Residuals by load", (_loads_table(fit),)),
        Section("Residuals by gauge", (_gauges_table(fit),)),
        Section("Readings", (_rows_table(fit, ~is_check, "readings", "Applied loads less predicted ones."),)),
        *(
            [Section("Check loads", (_rows_table(fit, is_check, "checks", "Not fitted."),))]
            if is_check.any()
            else []
        ),
        Section("What this test cannot see", (Items(CANNOT_SEE),)),
        Section("Traceability", (Paragraph(origin.sentence), origin.table())),
    ]
    return Page(f"{fit.test.file.name}: load equations", (cards,), tuple(sections))


def equations_table_of(fit: FittedEquations) -> Table:
    """Return the equations in full, which is the CSV file as well."""
    names, unit, rows = fit.test.file.readings.gauges, fit.test.file.readings.unit, []
    scale = {"um/m": 1e-6, "mm/m": 1e-3, "mV/V": 1e-3}.get(unit, 1.0)
    for equation, entry in zip(fit.equations, fit.test.file.load, strict=True):
        for gauge, value, error in zip(
            equation.gauges, equation.coefficient, equation.standard_error, strict=True
        ):
            row = [
                scale * float(value),
                scale * float(error),
                float(value / error),
                float(fit.zero[gauge]) / scale,
            ]
            rows.append(
                [equation.load, (WHOLE | AT_STATION)[entry.name], names[gauge], *row, equation.residual_std]
            )
    columns = (
        Column("load"),
        Column("unit"),
        Column("gauge"),
        Column("coefficient", f"unit per {unit}"),
        Column("standard error", f"unit per {unit}"),
        Column("T", "", ".3g"),
        Column(ZERO, unit),
        Column("residual, standard deviation", "unit"),
    )
    caption = "Load = sum of coefficient times (reading less zero)."
    return make_table("load_equations", caption, columns, rows)


def _rms(value: FloatArray) -> float:
    return float(np.sqrt(np.mean(value**2))) if value.size else float("nan")


def _loads_table(fit: FittedEquations) -> Table:
    checks, residual = fit.test.is_check, fit.predicted - fit.test.load
    rows = [
        [
            equation.load,
            float(fit.test.load[:, k].min()),
            float(fit.test.load[:, k].max()),
            equation.residual_std,
            float(np.sqrt(fit.load_covariance[k, k])),
            _rms(residual[checks, k]),
            100.0 * float(np.sqrt(fit.load_covariance[k, k]) / np.abs(fit.test.load[:, k]).max()),
        ]
        for k, equation in enumerate(fit.equations)
    ]
    columns = (
        Column("load"),
        Column("smallest applied"),
        Column("largest applied"),
        Column("residual, standard deviation"),
        Column("rows left out one by one, rms"),
        Column("check loads, rms"),
        Column("left out over largest", "%", ".3g"),
    )
    return make_table("loads", "Errors of each load, in its unit.", columns, rows)


def _gauges_table(fit: FittedEquations) -> Table:
    residual, checks = 1e6 * fit.strain_left, fit.test.is_check
    size = 1e6 * np.abs(fit.test.strain - fit.zero).max(axis=0)
    rows = [
        [name, float(size[g]), _rms(residual[~checks, g]), float(np.abs(residual[:, g]).max())]
        for g, name in enumerate(fit.test.file.readings.gauges)
    ]
    columns = (
        Column("gauge"),
        Column("largest", "um/m"),
        Column("residual, rms", "um/m"),
        Column("residual, largest", "um/m"),
    )
    caption = "Readings less those that the predicted loads strain; zero without redundant gauges."
    return make_table("gauges", caption, columns, rows)


def _rows_table(fit: FittedEquations, some: np.ndarray, name: str, caption: str) -> Table:
    residual = fit.test.load - fit.predicted
    rows = [
        [fit.test.line[n], *(value for pair in zip(fit.test.load[n], residual[n], strict=True) for value in pair)]
        for n in np.flatnonzero(some)
    ]
    columns = [Column("line", "", "d")]
    for equation in fit.equations:
        columns += [Column(equation.load), Column("residual")]
    return make_table(name, f"{caption} Loads in N and N m, by the line of the table.", columns, rows)
