"""Tables of the report of a calibration."""

from collections.abc import Sequence

import numpy as np

from builder.calibration.estimate.check_loads import CheckLoad, LeftOut
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.ground_test_faults import load_shifts
from builder.calibration.estimate.load_steps import SteppedCase
from builder.calibration.estimate.outside_terms import NOISE, OutsideModel
from builder.calibration.estimate.readings_model import CELL
from builder.calibration.estimate.regression import LoadEquation
from builder.calibration.plan.worth_of_test import WorthOfTest
from builder.reports.calibration_page.verdict import Criterion, UsedCell
from builder.reports.page.page_tables import Column, Table, make_table
from builder.structure.as_built.as_built_vehicle import slices
from builder.structure.as_built_kinds import KINDS
from builder.structure.loads.applied import load_kind
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, LOAD_NAMES, LOAD_UNITS
from strainfmu.estimator.signal_names import ZERO


def _left(estimate: Estimate, predicted: np.ndarray) -> np.ndarray:
    return np.where(estimate.used, estimate.model.test.readings - predicted, np.nan)


ROUNDED = 1e-9
"""Loads over the largest one below which they are the rounding of none."""


def cases_table(estimate: Estimate) -> Table:
    """Return what each case leaves."""
    std = estimate.model.test.reading_stds
    rows = []
    for k, case in enumerate(estimate.model.test.cases):
        if not estimate.used[k].any():
            continue
        before, after = _left(estimate, estimate.before)[k], _left(estimate, estimate.after)[k]
        rows.append(
            [
                case.name,
                float(np.sqrt(np.nanmean(estimate.model.test.readings[k][estimate.used[k]] ** 2))) * 1e6,
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
    return make_table("cases", "Measured less predicted, case by case; sigma is of one reading.", columns, rows)


def cross_table(left_out: Sequence[LeftOut]) -> Table:
    """Return each case predicted from the others."""
    rows = [[case.case, 1e6 * case.rms, 1e6 * case.stated, case.chi_square] for case in left_out]
    columns = (
        Column("case left out"),
        Column("measured less predicted, rms", "um/m"),
        Column("stated", "um/m"),
        Column("chi-square per reading"),
    )
    return make_table("cross_validation", "Each case predicted from the others alone.", columns, rows)


def gauges_table(estimate: Estimate) -> Table:
    """Return what each gauge leaves."""
    before, after = _left(estimate, estimate.before), _left(estimate, estimate.after)
    std, part = estimate.model.test.reading_stds, estimate.parameters
    where = slices(part.counts)
    sigma = estimate.std
    rows: list[list[str | float]] = []
    for g, name in enumerate(estimate.model.structure.gauges.names):
        if not estimate.used[:, g].any():
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


def identified_table(estimate: Estimate) -> Table:
    """Return prior and posterior sigma side by side; of gauges and regions the root mean square."""
    part, sigma, before = estimate.parameters, estimate.std, estimate.model.std
    rows = []
    for kind, parameters in slices(part.counts).items():
        if not before[parameters].any():
            continue
        unit, scale = KINDS[kind].unit, 1.0 / KINDS[kind].scale
        prior, after = (float(np.sqrt(np.mean(value[parameters] ** 2))) for value in (before, sigma))
        identified = 100.0 * (1.0 - (after / prior) ** 2) if prior > 0.0 else 0.0
        size = float(np.sqrt(np.mean(estimate.vector[parameters] ** 2)))
        rows.append([KINDS[kind].in_words, unit, scale * size, scale * prior, scale * after, identified])
    model = estimate.model
    for number, cell in enumerate(model.entries["cell"][: len(CELL)].ravel()):
        of_cell = KINDS["common" if number < len(model.cells) else "cell_offset"]
        if before[cell] > 0.0:
            size, prior, after = (
                float(value[cell]) / of_cell.scale for value in (np.abs(estimate.vector), before, sigma)
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


def outside_table(outside: OutsideModel) -> Table:
    """Return the tests of what the estimate takes for zero."""
    rows: list[list[str | float]] = []
    for kind in outside.kinds:
        rows += [
            [f"{kind.kind}, region {term.region + 1}", "%", 100.0 * term.size, 100.0 * term.std, "", ""]
            for term in kind.terms
        ]
        total = ("noise", "stated", outside.over_stated) if kind.kind == NOISE else (f"{kind.kind}, all", "", "")
        rows.append([*total, "", kind.statistic / kind.freedom, kind.chance])
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


def loads_table(estimate: Estimate) -> Table:
    """Return what the readings say of each load."""
    shift, size = load_shifts(estimate)
    rows = [
        [estimate.model.test.cases[case].name, load_kind(error.load), 100.0 * float(size[k]), float(shift[k])]
        for k, (case, error) in enumerate(estimate.model.loads)
        if error.std > 0.0 and estimate.used[case].any()
    ]
    columns = (Column("load case"), Column("load"), Column("differs by", "%"), Column("in its sigma"))
    return make_table("loads", "What the readings say of each load, without its own prior.", columns, rows)


def equations_table(estimate: Estimate, equations: Sequence[LoadEquation]) -> Table:
    """Return the load equations in full: a row for each gauge of each, which is the CSV file as well."""
    names, number = estimate.model.structure.gauges.names, int(estimate.used.any(axis=1).sum())
    rows: list[list[str | float | None]] = []
    for equation, unit in zip(equations, LOAD_UNITS, strict=True):
        name = equation.load.replace("_", " ")
        if not equation.gauges:
            rows.append([name, unit, "none", None, None, None, equation.residual_std, number])
        for gauge, value, error in zip(
            equation.gauges, equation.coefficient, equation.standard_error, strict=True
        ):
            # Per um/m of the reading, as the equation is used.
            row = [1e-6 * float(value), 1e-6 * float(error), float(value / error)]
            rows.append([name, unit, names[gauge], *row, equation.residual_std, number])
    columns = (
        Column("load"),
        Column("unit"),
        Column("gauge"),
        Column("coefficient", "unit per um/m"),
        Column("standard error", "unit per um/m"),
        Column("T", "", ".3g"),
        Column("residual, standard deviation", "unit"),
        Column("cases"),
    )
    caption = (
        "Load equations: load = sum of coefficient times reading less zero offset; gauges with T of 4 or more."
    )
    return make_table("load_equations", caption, columns, rows)


def criteria_table(criteria: Sequence[Criterion]) -> Table:
    """Return the criteria of acceptance."""
    columns = (Column("criterion"), Column("found"), Column("allowed"), Column("holds"))
    rows = [[criterion.name, criterion.actual, criterion.allowed, criterion.holds] for criterion in criteria]
    return make_table("criteria", "The test is accepted where all criteria hold.", columns, rows)


def checks_table(checks: Sequence[CheckLoad]) -> Table:
    """Return applied and predicted check loads."""
    rows = [
        [
            check.case,
            check.applied or None,
            check.predicted if check.applied else None,
            100.0 * check.difference,
            100.0 * check.std,
            check.chi_square,
            check.chance,
        ]
        for check in checks
    ]
    columns = (
        Column("check load"),
        Column("applied", "N"),
        Column("predicted", "N"),
        Column("difference", "%", ".2g"),
        Column("its sigma", "%", ".2g"),
        Column("chi-square per reading"),
        Column("chance of a sound test", "", ".2g"),
    )
    return make_table("check_loads", "Check loads, applied and predicted without being fitted.", columns, rows)


def check_equations_table(checks: Sequence[CheckLoad], equations: Sequence[LoadEquation]) -> Table:
    """Return the five loads of the check loads, applied and by the load equations."""
    rows = [
        [check.case, name.replace("_", " "), unit, float(applied), float(predicted), equation.residual_std]
        for check in checks
        for name, unit, applied, predicted, equation in zip(
            LOAD_NAMES,
            LOAD_UNITS,
            np.where(np.abs(check.loads) > ROUNDED * np.abs(check.loads).max(), check.loads, 0.0),
            check.by_equations,
            equations,
            strict=True,
        )
    ]
    columns = (
        Column("check load"),
        Column("load"),
        Column("unit"),
        Column("applied"),
        Column("by the equation"),
        Column("residual of the equation, standard deviation"),
    )
    return make_table("check_equations", "Check loads by the regression load equations.", columns, rows)


def steps_table(cases: Sequence[SteppedCase], names: Sequence[str]) -> Table:
    """Return hysteresis and return to zero of the cases with steps."""
    rows: list[list[str | float | None]] = []
    for case in cases:
        hysteresis, zero = np.abs(case.change(case.same_load)[0]), case.change(case.without_load)[0]
        span = float(np.nanmax(case.span))
        row: list[str | float | None] = [case.name, 1e6 * span]
        if hysteresis.size and np.isfinite(hysteresis).any():
            worst = int(np.nanargmax(hysteresis)) % hysteresis.shape[1]
            most = float(np.nanmax(hysteresis))
            row += [1e6 * _root_mean_square(hysteresis), 1e6 * most, 100.0 * most / span, names[worst]]
        else:
            row += [None, None, None, ""]
        row.append(1e6 * _root_mean_square(zero) if len(zero) else None)
        rows.append(row)
    columns = (
        Column("load case"),
        Column("largest change", "um/m"),
        Column("unloading less loading, rms", "um/m", ".3g"),
        Column("largest", "um/m", ".3g"),
        Column("of the largest change", "%", ".2g"),
        Column("gauge"),
        Column("return to zero, rms", "um/m", ".3g"),
    )
    return make_table("steps", "Loading, unloading and return to zero.", columns, rows)


def flight_table(worth: WorthOfTest) -> Table:
    """Return the sigmas of the coefficients in flight."""
    rows = [
        [name, *row, row[1] / row[2]]
        for name, *row in zip(
            COEFFICIENT_NAMES,
            worth.before.tolist(),
            worth.after.tolist(),
            worth.exact.tolist(),
            worth.with_further.tolist(),
            strict=True,
        )
    ]
    columns = (
        Column("coefficient"),
        Column("by the drawing", "1"),
        Column("after the test", "1"),
        Column("vehicle known exactly", "1"),
        Column("with the further case", "1"),
        Column("after over exactly known", "", ".3f"),
    )
    caption = f"Sigma in flight; the further case is '{worth.further}'."
    return make_table("in_flight", caption, columns, rows)


def cells_table(cells: Sequence[UsedCell]) -> Table:
    """Return the load cells."""
    rows = [[cell.name, cell.serial_number or None, cell.calibrated_on or None, cell.loads] for cell in cells]
    columns = (Column("load cell"), Column("serial number"), Column("calibrated on"), Column("loads"))
    return make_table("load_cells", "Load cells, as the file of the test states them.", columns, rows)


def signatures_table() -> Table:
    """Return the lines on which those sign who answer for the test."""
    rows = [[who, "_" * 24, "_" * 12, "_" * 28] for who in ("tested", "checked", "approved")]
    columns = (Column("test"), Column("name"), Column("date"), Column("signature"))
    return make_table("signatures", "Signatures.", columns, rows)


def _root_mean_square(value: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(value**2)))
