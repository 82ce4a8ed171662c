"""The tables of a build report: those on the page, and those that only the files hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter

import numpy as np

from builder.reports.build_report.build_findings import BuildReport
from builder.reports.build_report.gauge_tables import gauges, sensors_table
from builder.reports.findings.coefficient_sources import CoefficientSources, coefficient_scales
from builder.reports.findings.flight_accuracy import flight_accuracy_table
from builder.reports.page.page_tables import SCALES, Column, Table, by_name, make_table, records_table
from builder.structure.observability import SYMMETRIES
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, LOAD_NAMES, LOAD_UNITS
from strainfmu.estimator.map.validity import valid_ranges
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY

MICRO = SCALES["um/m"]
MICROSTRAIN_PER_KPA = 1e9
MAX_PAIRS = 200
ALL_HARDWARE = "all installation errors"


def report_tables(report: BuildReport) -> dict[str, Table]:
    """Return every table of ``report`` by its name, in the order of the page."""
    tables = (
        validity(report),
        classes(report),
        modes(report),
        singular_values(report),
        *estimator_choice(report),
        *((nonlinear_coefficients(report), nonlinear_sources(report)) if report.in_use.is_nonlinear else ()),
        coefficients(report),
        correlations(report),
        sources(report),
        source_sigmas(report),
        sigmas_without(report),
        noise(report),
        gauges(report),
        *((sensors_table(report),) if report.inverse_map.has_auxiliary_sensors else ()),
        worst_losses(report),
        worst_pairs(report),
        alike(report),
        *((flight_accuracy_table(report.flight),) if report.flight else ()),
        *((gamma_rules(report), eigenvalues(report), l_curve(report)) if report.gamma else ()),
        *((report.origin.table(),) if report.origin.files else ()),
    )
    return by_name(tables)


def first_rows(table: Table, count: int) -> Table:
    """Return a table's first rows; where some are left out, the caption states it."""
    if len(table.rows) <= count:
        return table
    caption = f"{table.caption} The first {count} of {len(table.rows)}; {table.name}.csv holds all."
    return replace(table, caption=caption, rows=table.rows[:count])


def validity(report: BuildReport) -> Table:
    columns = (
        ("quantity", Column("quantity")),
        ("minimum", Column("minimum", "", ".6g")),
        ("maximum", Column("maximum", "", ".6g")),
        ("unit", Column("unit")),
    )
    return records_table("validity", "Range of the snapshots.", valid_ranges(report.inverse_map), columns)


def classes(report: BuildReport) -> Table:
    """One row per class of symmetry, and one of all pressure."""
    observed = report.observability
    rows: list[tuple[object, ...]] = [
        (
            str(symmetry.symmetry),
            "blind" if symmetry.blind else "observed",
            MICROSTRAIN_PER_KPA * symmetry.norm,
            f"{symmetry.rank} of {len(symmetry.singular_values)}",
            100.0 * observed.class_fraction[i],
            100.0 * observed.class_fraction_of_kept[i],
            MICRO * observed.class_strain[i],
            100.0 * observed.class_removed[i],
            100.0 * observed.class_removed_at_best[i],
        )
        for i, symmetry in enumerate(report.symmetries)
    ]
    all_strain = MICRO * float(np.sqrt(np.sum(observed.mode_strain**2)))
    removed = 100.0 * observed.removed, 100.0 * observed.removed_at_best
    norm = MICROSTRAIN_PER_KPA * float(report.singular_values[0])
    rows.append(("all pressure", "", norm, "", 100.0, 100.0, all_strain, *removed))
    columns = (
        Column("pressure"),
        Column("gauges"),
        Column("maximum response", "um/m per kPa rms", ".3g"),
        Column("rank"),
        Column("of the snapshots' variance", "%", ".1f"),
        Column("of the kept modes' variance", "%", ".1f"),
        Column("rms strain", "um/m", ".3g"),
        Column("variance removed by this map", "%", ".1f"),
        Column("at best", "%", ".1f"),
    )
    return make_table("classes", "Pressure by symmetry, and what the gauges observe of it.", columns, rows)


def modes(report: BuildReport) -> Table:
    observed = report.observability
    sigma = np.sqrt(np.mean(report.inverse_map.noise_std**2))
    rows = []
    for j in range(len(observed.mode_std)):
        rows.append(
            (
                j + 1,
                observed.is_state[j],
                observed.mode_std[j],
                100.0 * observed.mode_fraction[j],
                MICRO * observed.mode_strain[j],
                observed.mode_strain[j] / sigma,
                *main_class(observed.mode_classes[j]),
                100.0 * observed.mode_removed[j],
                100.0 * observed.mode_removed_at_best[j],
            )
        )
    columns = (
        Column("mode"),
        Column("state of the map"),
        Column("pressure, rms", "Pa", ".3g"),
        Column("of the variance", "%", ".3g"),
        Column("rms strain", "um/m", ".3g"),
        Column("over gauge noise", "1", ".3g"),
        Column("main class"),
        Column("fraction in it", "%", ".0f"),
        Column("variance removed by this map", "%", ".1f"),
        Column("at best", "%", ".1f"),
    )
    return make_table("modes", "POD modes of the snapshots at one standard deviation.", columns, rows)


def main_class(fractions: FloatArray) -> tuple[str, float]:
    """Return the main class of a mode and its fraction in per cent; an empty name and NaN without classes."""
    main = int(np.argmax(fractions))
    return (str(SYMMETRIES[main]) if np.isfinite(fractions).all() else "", 100.0 * float(fractions[main]))


def singular_values(report: BuildReport) -> Table:
    rows = [(i, MICROSTRAIN_PER_KPA * value) for i, value in enumerate(report.singular_values, start=1)]
    columns = Column("number"), Column("singular value", "um/m per kPa rms")
    caption = (
        f"Singular values of Z_p over smooth pressures, degree {report.smooth_degree} in x, "
        f"{report.smooth_harmonics} harmonics."
    )
    return make_table("singular_values", caption, columns, rows)


def coefficients(report: BuildReport) -> Table:
    accuracy, scale = report.coefficients, coefficient_scales(report.inverse_map)
    rows = [
        (
            name,
            accuracy.std[i],
            3.0 * accuracy.std[i],
            *accuracy.range[i],
            100.0 * accuracy.std_of_range[i],
            LOAD_NAMES[i].replace("_", " "),
            accuracy.std[i] / scale[i],
            LOAD_UNITS[i],
        )
        for i, name in enumerate(COEFFICIENT_NAMES)
    ]
    columns = (
        Column("coefficient"),
        Column("sigma", "1", ".3g"),
        Column("3 sigma", "1", ".3g"),
        Column("minimum of the snapshots", "1", ".4f"),
        Column("maximum", "1", ".4f"),
        Column("sigma over that range", "%", ".2f"),
        Column("load"),
        Column("sigma of the load", "", ".3g"),
        Column("unit"),
    )
    pressure = 1e-3 * report.inverse_map.nominal_dynamic_pressure
    caption = f"Coefficients{_of_what(report)} at a dynamic pressure of {pressure:.5g} kPa, and their loads."
    return make_table(COEFFICIENT_ARRAY, caption, columns, rows)


def correlations(report: BuildReport) -> Table:
    caption = f"Correlation of the coefficients' errors{_of_what(report)}."
    return _by_coefficient(
        "correlations",
        caption,
        "error of",
        COEFFICIENT_NAMES,
        report.coefficients.correlation,
        Column("", "1", ".2f"),
    )


def sources(report: BuildReport) -> Table:
    caption = f"Fraction of each source in the variance of each coefficient{_of_what(report)}."
    return _sources("sources", caption, report.coefficients)


def _of_what(report: BuildReport) -> str:
    """Return what a table judges where that is not the estimator in use."""
    return " of the linear map" if report.in_use.is_nonlinear else ""


def _sources(name: str, caption: str, accuracy: CoefficientSources) -> Table:
    fractions = 100.0 * accuracy.variance / accuracy.std**2
    return _by_coefficient(name, caption, "source", accuracy.names, fractions, Column("", "%", ".1f"))


def estimator_choice(report: BuildReport) -> tuple[Table, ...]:
    """Rms error of both estimators where "auto" compared them: one row per coefficient; none elsewhere."""
    choice = report.inverse_map.provenance.get("estimator_choice")
    if choice is None or not choice["rms"]:
        return ()
    rms = choice["rms"]
    rows = [(name, rms["linear"][name], rms["nonlinear"][name]) for name in COEFFICIENT_NAMES]
    kinds = [Column(f"{kind} estimator", "1", ".3g") for kind in ("linear", "nonlinear")]
    caption = f"Rms error of both estimators, on {choice['flights']}."
    return (make_table("estimator_choice", caption, (Column("coefficient"), *kinds), rows),)


def nonlinear_coefficients(report: BuildReport) -> Table:
    """One row per coefficient, by the nonlinear estimator."""
    used = report.in_use
    accuracy, alone = used.coefficients, used.std_without_model_form
    numerical = [()] * len(COEFFICIENT_NAMES) if alone is None else [(sigma,) for sigma in alone.tolist()]
    rows = [
        (
            name,
            accuracy.std[i],
            used.largest_std[i],
            *accuracy.range[i],
            100.0 * accuracy.std_of_range[i],
            *numerical[i],
        )
        for i, name in enumerate(COEFFICIENT_NAMES)
    ]
    columns = (
        Column("coefficient"),
        Column("sigma, rms", "1", ".3g"),
        Column("largest sigma", "1", ".3g"),
        Column("minimum of the snapshots", "1", ".4f"),
        Column("maximum", "1", ".4f"),
        Column("rms sigma over that range", "%", ".2f"),
        *(() if alone is None else (Column("rms sigma without model form", "1", ".3g"),)),
    )
    caption = f"Coefficients by the nonlinear estimator, {used.where}."
    return make_table("nonlinear_coefficients", caption, columns, rows)


def nonlinear_sources(report: BuildReport) -> Table:
    caption = "Fraction of each source in the variance of each coefficient, nonlinear estimator."
    return _sources("nonlinear_sources", caption, report.in_use.coefficients)


def source_sigmas(report: BuildReport) -> Table:
    accuracy, caption = report.coefficients, f"Sigma of each coefficient{_of_what(report)} from each source alone."
    sigma = np.vstack([np.sqrt(accuracy.variance), accuracy.std])
    return _by_coefficient(
        "source_sigmas", caption, "source", (*accuracy.names, "all"), sigma, Column("", "1", ".3g")
    )


def sigmas_without(report: BuildReport) -> Table:
    """One row per source that is left out, and one without all hardware errors."""
    accuracy, caption = (
        report.coefficients,
        f"Sigma of each coefficient{_of_what(report)} without some sources, same gain.",
    )
    left_out: dict[str, tuple[str, ...]] = {name: (name,) for name in accuracy.names}
    if accuracy.hardware:
        left_out[ALL_HARDWARE] = accuracy.hardware
    sigma = np.array([accuracy.std_without(names) for names in left_out.values()])
    return _by_coefficient("sigmas_without", caption, "without", tuple(left_out), sigma, Column("", "1", ".3g"))


def _by_coefficient(
    name: str, caption: str, heading: str, names: Sequence[str], values: FloatArray, like: Column
) -> Table:
    """Return a table of (n, 5) values, a row per name and a column ``like`` this one per coefficient."""
    columns = (Column(heading), *(replace(like, heading=coefficient) for coefficient in COEFFICIENT_NAMES))
    return make_table(name, caption, columns, [(label, *row) for label, row in zip(names, values, strict=True)])


def noise(report: BuildReport) -> Table:
    columns = (
        (itemgetter("name"), Column("noise term")),
        (itemgetter("share"), Column("fraction", "%", ".1f")),
        (itemgetter("rms_strain"), Column("rms over the gauges", "um/m", ".3g")),
    )
    caption = "Strain that the states do not explain; fractions of the whitened variance."
    return records_table("noise", caption, report.inverse_map.provenance["noise_terms"], columns)


def worst_losses(report: BuildReport) -> Table:
    """Per coefficient the gauge, and the pair, whose loss costs most; the last row is over all coefficients."""
    value, names = report.gauges, report.inverse_map.gauge_names
    rows = []
    for i, coefficient in enumerate((*COEFFICIENT_NAMES, "any")):
        single = value.growth.max(axis=1) if i == len(COEFFICIENT_NAMES) else value.growth[:, i]
        pair = value.pair_growth.max(axis=1) if i == len(COEFFICIENT_NAMES) else value.pair_growth[:, i]
        gauge = int(np.argmax(single))
        two = [names[k] for k in value.pairs[int(np.argmax(pair))]] if len(pair) else []
        growth = 100.0 * (float(pair.max()) - 1.0) if len(pair) else None
        rows.append((coefficient, names[gauge], 100.0 * (single[gauge] - 1.0), " and ".join(two), growth))
    columns = (
        Column("coefficient"),
        Column("gauge whose loss costs most"),
        Column("sigma grows, gauge lost", "%", ".1f"),
        Column("pair whose loss costs most"),
        Column("sigma grows, pair lost", "%", ".1f"),
    )
    return make_table("worst_losses", "Losses that cost most.", columns, rows)


def worst_pairs(report: BuildReport) -> Table:
    value, names = report.gauges, report.inverse_map.gauge_names
    worst = value.pair_growth.max(axis=1)
    order = np.argsort(-worst, kind="stable")[:MAX_PAIRS]
    rows = [(*(names[k] for k in value.pairs[i]), *(100.0 * (value.pair_growth[i] - 1.0))) for i in order.tolist()]
    columns = (
        Column("gauge"),
        Column("and gauge"),
        *(Column(f"sigma of {name} grows", "%", ".1f") for name in COEFFICIENT_NAMES),
    )
    caption = f"Pairs whose loss costs most, {len(rows)} of {len(worst)}."
    return make_table("worst_pairs", caption, columns, rows)


def alike(report: BuildReport) -> Table:
    names = report.inverse_map.gauge_names
    rows = [
        (number, ", ".join(names[k] for k in group)) for number, group in enumerate(report.gauges.groups, start=1)
    ]
    caption = "Gauges whose faults cannot be distinguished: a fault is attributed to the group."
    return make_table("groups", caption, (Column("group"), Column("gauges")), rows)


def gamma_rules(report: BuildReport) -> Table:
    assert report.gamma is not None
    nothing = (None,) * len(COEFFICIENT_NAMES)
    rows = [
        (
            choice.rule.replace("_", " "),
            choice.gamma,
            choice.n_recoverable if choice.gamma is not None else None,
            choice.degrees_of_freedom,
            *(nothing if choice.coefficient_std is None else choice.coefficient_std),
            choice.why_not,
        )
        for choice in report.gamma.rules
    ]
    columns = (
        Column("rule"),
        Column("gamma", "1"),
        Column("eigenvalues above it"),
        Column("states that the data determine", "1", ".1f"),
        *(Column(f"sigma of {name}", "1", ".3g") for name in COEFFICIENT_NAMES),
        Column("remark"),
    )
    return make_table("gamma_rules", "Gamma by every rule, and the sigmas with it.", columns, rows)


def eigenvalues(report: BuildReport) -> Table:
    assert report.gamma is not None
    gamma = report.gamma
    modes = zip(gamma.eigenvalues, gamma.filter_factors, map(main_class, gamma.mode_classes), strict=True)
    rows = [(number, value, factor, *main) for number, (value, factor, main) in enumerate(modes, start=1)]
    columns = (
        Column("number"),
        Column("eigenvalue", "1"),
        Column("filter factor", "1", ".4f"),
        Column("main class"),
        Column("fraction in it", "%", ".0f"),
    )
    caption = (
        "Eigenvalues of the prior-preconditioned Hessian, the fraction of each mode that the data determine, and "
        "the symmetry of its pressure."
    )
    return make_table("eigenvalues", caption, columns, rows)


def l_curve(report: BuildReport) -> Table:
    assert report.gamma is not None
    curve = report.gamma.curve
    rows = list(zip(curve.gamma, curve.residual_norm, curve.solution_norm, curve.curvature, strict=True))
    names = ("gamma", "residual norm", "solution norm", "curvature")
    caption = "L-curve: norms of whitened residual and of states, root mean square over flights."
    return make_table("l_curve", caption, [Column(name, "1") for name in names], rows)
