"""The tables of a build report: those on the page, and those that only the files hold."""

from collections.abc import Sequence
from dataclasses import replace
from math import degrees
from operator import itemgetter
from typing import Any

import numpy as np

from builder.inverse.noise.error_list import GAUGE_NOISE, GRID_REFINEMENT, INTERPOLATION, error_named
from builder.inverse.noise.flows_between import BETWEEN
from builder.reports.build_report.build_findings import BuildReport
from builder.reports.findings.coefficient_sources import AIR_DATA, CoefficientSources, coefficient_scales
from builder.reports.findings.envelope_states import flight_accuracy_table
from builder.reports.page.page_tables import SCALES, Column, Table, by_name, make_table, records_table
from builder.structure.observability import SYMMETRIES, direction_names
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, LOAD_NAMES, LOAD_UNITS
from strainfmu.estimator.map.sensors import shown_units
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY
from strainfmu.estimator.valid_ranges import valid_ranges

MICRO = SCALES["um/m"]
MICROSTRAIN_PER_KPA = 1e9
MAX_PAIRS = 200


def report_tables(report: BuildReport) -> dict[str, Table]:
    """Return every table of ``report`` by its name, in the order of the page."""
    tables = (
        validity(report),
        classes(report),
        modes(report),
        singular_values(report),
        *estimator_choice(report),
        coefficients(report),
        groups_of_sources(report),
        sources(report),
        correlations(report),
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

    def of_linear(*cells: Any) -> tuple[Any, ...]:
        """Return what only the linear estimator has."""
        return () if report.in_use.is_nonlinear else cells

    rows: list[tuple[object, ...]] = [
        (
            str(symmetry.symmetry),
            "blind" if symmetry.blind else "observed",
            MICROSTRAIN_PER_KPA * symmetry.norm,
            f"{symmetry.rank} of {len(symmetry.singular_values)}",
            100.0 * observed.class_fraction[i],
            100.0 * observed.class_fraction_of_kept[i],
            MICRO * observed.class_strain[i],
            *of_linear(100.0 * observed.class_removed[i], 100.0 * observed.class_removed_at_best[i]),
        )
        for i, symmetry in enumerate(report.symmetries)
    ]
    all_strain = MICRO * float(np.sqrt(np.sum(observed.mode_strain**2)))
    removed = 100.0 * observed.removed, 100.0 * observed.removed_at_best
    norm = MICROSTRAIN_PER_KPA * float(report.singular_values[0])
    rows.append(("all pressure", "", norm, "", 100.0, 100.0, all_strain, *of_linear(*removed)))
    columns = (
        Column("pressure"),
        Column("gauges"),
        Column("maximum response", "um/m per kPa rms", ".3g"),
        Column("rank"),
        Column("of the snapshots' variance", "%", ".1f"),
        Column("of the kept modes' variance", "%", ".1f"),
        Column("rms strain", "um/m", ".3g"),
        *of_linear(Column("variance removed by this map", "%", ".1f"), Column("at best", "%", ".1f")),
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
    """One row per coefficient, with the source that dominates its variance."""
    used = report.in_use
    accuracy, scale = used.coefficients, coefficient_scales(report.inverse_map)
    alone = used.std_without_model_form
    rows = []
    for i, name in enumerate(COEFFICIENT_NAMES):
        source, fraction = largest_source(accuracy, i)
        rows.append(
            (
                name,
                accuracy.std[i],
                *((used.largest_std[i],) if used.is_nonlinear else ()),
                *accuracy.range[i],
                100.0 * accuracy.std_of_range[i],
                *(() if alone is None else (alone[i],)),
                source,
                100.0 * fraction,
                LOAD_NAMES[i].replace("_", " "),
                accuracy.std[i] / scale[i],
                LOAD_UNITS[i],
            )
        )
    columns = (
        Column("coefficient"),
        Column("sigma, rms" if used.is_nonlinear else "sigma", "1", ".3g"),
        *((Column("largest sigma", "1", ".3g"),) if used.is_nonlinear else ()),
        Column("minimum of the snapshots", "1", ".4f"),
        Column("maximum", "1", ".4f"),
        Column("sigma over that range", "%", ".2f"),
        *(() if alone is None else (Column("sigma without model form", "1", ".3g"),)),
        Column("largest source"),
        Column("of the variance", "%", ".0f"),
        Column("load"),
        Column("sigma of the load", "", ".3g"),
        Column("unit"),
    )
    pressure = 1e-3 * report.inverse_map.nominal_dynamic_pressure
    caption = f"Coefficients by {used.name}, {used.where}, and their loads at q_inf = {pressure:.5g} kPa."
    return make_table(COEFFICIENT_ARRAY, caption, columns, rows)


def largest_source(accuracy: CoefficientSources, coefficient: int) -> tuple[str, float]:
    """Return the source that dominates the variance of a coefficient, and its fraction of it [1]."""
    source = int(np.argmax(accuracy.variance[:, coefficient]))
    return accuracy.names[source], float(accuracy.variance[source, coefficient] / accuracy.std[coefficient] ** 2)


def correlations(report: BuildReport) -> Table:
    correlation = report.in_use.coefficients.correlation
    caption = "Correlation of the coefficients' errors."
    return _by_coefficient(
        "correlations", caption, "error of", COEFFICIENT_NAMES, correlation, Column("", "1", ".2f")
    )


def groups_of_sources(report: BuildReport) -> Table:
    """One row per group of sources with sigma by it alone, and one of all."""
    accuracy = report.in_use.coefficients
    groups = accuracy.group_variance
    sigma = np.sqrt(np.vstack([*groups.values(), accuracy.std**2]))
    caption = "Sigma of each coefficient by the errors of each group alone; squares add up."
    like = Column("", "1", ".3g")
    return _by_coefficient("source_groups", caption, "errors", (*groups, "all"), sigma, like)


def sources(report: BuildReport) -> Table:
    """One row per source, by group: the entry that states it, and its part of the variances."""
    accuracy = report.in_use.coefficients
    groups, fractions = tuple(accuracy.group_variance), 100.0 * accuracy.variance / accuracy.std**2
    number = {name: k for k, name in enumerate(accuracy.names)}
    rows = [
        (name, group, entry_of(report, name), *fractions[number[name]])
        for group in groups
        for name in sorted(accuracy.of_group(group), key=lambda name: -fractions[number[name]].max())
    ]
    of_coefficients = (Column(name, "%", ".1f") for name in COEFFICIENT_NAMES)
    columns = Column("source"), Column("group"), Column("entry"), *of_coefficients
    caption = "Fraction of each source in the variance of each coefficient, and the entry that sets its size."
    return make_table("sources", caption, columns, rows)


def entry_of(report: BuildReport, source: str) -> str:
    """Return the entry of the vehicle file that states the size of a source, or that a size which the build finds
    follows from; empty where there is none."""
    if source == GAUGE_NOISE:
        return f"noise.{report.noise_entry}"
    return AIR_DATA.get(source) or error_named(source).entry or SET_BY.get(source, "")


SET_BY = {
    INTERPOLATION: "conditions",
    BETWEEN: "conditions",
    GRID_REFINEMENT: "resolution.map.radial_cells",
}
"""Entries from which sizes follow that the build finds: density of snapshots, grid of their flows."""


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


def gauges(report: BuildReport) -> Table:
    """Return the table of the strain gauges."""
    gauge_rows = _rows_of_map(report, range(report.inverse_map.n_strain_gauges))
    rows = [(name, *place, *values) for name, place, values in gauge_rows]
    columns = (Column("gauge"), *_PLACE, *_value_columns("um/m", "maximum |strain|"))
    return make_table(
        "gauges", "Every gauge: position, cost of its loss, detectable and isolable bias.", columns, rows
    )


def sensors_table(report: BuildReport) -> Table:
    """Return the table of the auxiliary sensors, each in its own unit."""
    sensors = report.inverse_map.sensors
    rows = range(sensors.n_strain_gauges, len(sensors.kind))
    sensor_rows = _rows_of_map(report, rows)
    kinds = zip(sensors.kind[rows.start :], sensors.unit[rows.start :], strict=True)
    content = [(row[0], *two, *row[1], *row[2]) for row, two in zip(sensor_rows, kinds, strict=True)]
    columns = (
        Column("sensor"),
        Column("kind"),
        Column("unit"),
        *_PLACE,
        *_value_columns("", "maximum |reading|"),
    )
    caption = "Every auxiliary sensor in its unit: position, cost of its loss, detectable and isolable bias."
    return make_table("sensors", caption, columns, content)


_PLACE = (Column("x", "m"), Column("roll angle", "deg", ".4g"), Column("direction"))


def _value_columns(unit: str, largest: str) -> tuple[Column, ...]:
    """Return the columns of the values of :func:`_rows_of_map`; ``unit`` "" where each row states its own."""
    return (
        Column("noise sigma", unit, ".3g"),
        Column(largest, unit, ".3g"),
        Column("leverage", "1", ".3f"),
        *(Column(f"lost: sigma of {name} grows", "%", ".1f") for name in COEFFICIENT_NAMES),
        Column("detectable bias", unit, ".3g"),
        Column("isolable bias", unit, ".3g"),
        Column("effect of an undetected bias, maximum", "sigma", ".2f"),
        Column("on"),
    )


def _rows_of_map(report: BuildReport, rows: range) -> list[tuple[str, tuple[Any, ...], tuple[Any, ...]]]:
    """Return name, place and values of ``rows`` of the map, in the units that are shown."""
    inverse_map, value = report.inverse_map, report.gauges
    units = shown_units(inverse_map.sensors)
    position = inverse_map.gauge_position
    roll = [degrees(angle) % 360.0 for angle in np.arctan2(position[:, 1], position[:, 2])]
    directions = direction_names(position, inverse_map.gauge_direction)
    worst = np.argmax(value.undetected_effect, axis=1)
    return [
        (
            inverse_map.gauge_names[i],
            # A value just below 360 deg is 0.
            (position[i, 0], roll[i] if roll[i] < 360.0 - 1e-9 else 0.0, directions[i]),
            (
                units[i][0] * inverse_map.noise_std[i],
                units[i][0] * inverse_map.strain_range[i],
                value.leverage[i],
                *(100.0 * (value.growth[i] - 1.0)),
                units[i][0] * value.detectable_bias[i],
                units[i][0] * value.isolable_bias[i],
                value.undetected_effect[i, worst[i]],
                COEFFICIENT_NAMES[worst[i]],
            ),
        )
        for i in rows
    ]


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
