"""The sections of a build report's page, one function each.

What a review adds to the report: gauges that could go, gauges that would help, and what stays unobserved.
"""

import numpy as np

from builder.figures import gauge_figures, observability_figures
from builder.figures import uncertainty as uncertainty_figures
from builder.figures.scene import scene_of, solid_view
from builder.figures.snapshot_figures import force_curves, surface_maps
from builder.figures.uncertainty import AccuracyMap, accuracy_maps
from builder.inverse.mode_choice import mode_choice_lines
from builder.placement.review import SPARE, Review
from builder.reports.build_report.build_findings import BuildReport
from builder.reports.build_report.build_tables import MICROSTRAIN_PER_KPA, main_class
from builder.reports.findings.envelope_states import NAVIGATION, FlightAccuracy
from builder.reports.findings.gauge_value import PAIRED
from builder.reports.page.html import Block, Items, Paragraph, Section, picture
from builder.reports.page.page_tables import Column, Table, make_table, percent
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY

AIR_DATA_SHOWN = (
    ("total_incidence", "total incidence [deg]", 180.0 / np.pi),
    ("wind_roll_angle", "roll angle of the wind [deg]", 180.0 / np.pi),
    (MACH_NUMBER, "Mach number [1]", 1.0),
    ("static_pressure", "p_inf [kPa]", 1e-3),
    (DYNAMIC_PRESSURE, "q_inf [kPa]", 1e-3),
)
"""Air data of the maps over the envelope: name, label, factor to its unit."""
REMOVED = (
    "Variance removed: of the snapshots' pressure, by the linear map. At best: by the best linear map of the same "
    "gauges and noise."
)


def blind_line(report: BuildReport) -> str:
    """Return one sentence on what the layout cannot observe."""
    if not report.blind_classes:
        return f"Layout {report.layout} is blind to no class of symmetry."
    parts = []
    for i in report.blind_classes:
        fraction = report.observability.class_fraction[i]
        known = f" ({percent(fraction)} of the snapshots' variance)" if np.isfinite(fraction) else ""
        parts.append(f"pressure {report.symmetries[i].symmetry}{known}")
    return f"Layout {report.layout} is blind to {'; '.join(parts)}."


def model_form_line(report: BuildReport) -> str | None:
    """Return one sentence on sigma with and without the model-form error; None for a map that expects none."""
    used = report.in_use
    if not used.is_nonlinear or used.std_without_model_form is None:
        return None
    pairs = zip(COEFFICIENT_NAMES, used.coefficients.std, used.std_without_model_form, strict=True)
    text = ", ".join(f"{name} {total:.2g} ({alone:.2g})" for name, total, alone in pairs)
    return (
        f"Rms sigma with the model-form error (viscosity, real gas, leeward flow; map.model_form_percent "
        f"{report.model_form_percent:g}), in brackets without it: {text}."
    )


def mode_choice_of(report: BuildReport) -> tuple[str, ...]:
    """Return which modes are states of the linear map, and why others are not, a sentence each."""
    return tuple(f"{line}." for line in mode_choice_lines(report.inverse_map.provenance))


def _modelled(report: BuildReport) -> str:
    """Return which pressure the fields of the map are."""
    if report.inverse_map.form == "absolute":
        return "of the pressure of the snapshots"
    pressure = 1e-3 * report.inverse_map.nominal_dynamic_pressure
    return f"at q_inf = {pressure:.4g} kPa, of the pressure that strain is in proportion to, over every flow"


def observability(report: BuildReport, tables: dict[str, Table]) -> Section:
    removed, std = report.in_use.node_removed, report.observability.node_std
    if removed is None:
        values, label, what = 1e-3 * std, "standard deviation [kPa]", "standard deviation of the pressure"
    else:
        values, label = np.nan_to_num(np.clip(100.0 * removed, 0.0, 100.0)), "variance removed [%]"
        what = f"fraction of the pressure's variance that {report.in_use.name} removes"
    return Section(
        "What this layout observes",
        (
            Paragraph(
                "Pressure is split by its symmetry about the planes y = 0 and z = 0. Response: strain over all "
                "gauges per rms pressure, for smooth pressures."
                + ("" if report.in_use.is_nonlinear else f" {REMOVED}")
            ),
            tables["classes"],
            picture(
                solid_view(scene_of(report.surface, values, label, report.inverse_map, report.vehicle)),
                f"The vehicle from two sides: {what}, and the gauges as bars along their directions.",
                "Two oblique views of the vehicle with its gauges.",
            ),
            picture(
                observability_figures.unrolled_pressure(
                    report.surface,
                    removed=removed,
                    mean=report.observability.node_mean,
                    std=std,
                    inverse_map=report.inverse_map,
                ),
                f"{'' if removed is None else f'{what[0].upper()}{what[1:]}; '}mean and standard deviation of the "
                "pressure, on the unrolled body. Circles are axial gauges, squares hoop gauges, diamonds inclined "
                f"ones, drawn slightly apart. Mean and standard deviation are {_modelled(report)}.",
                "Maps of the unrolled body: pressure, and how much of its variance the data remove.",
                "svg",
            ),
            *([] if report.in_use.is_nonlinear else _modes(report, tables)),
            picture(
                observability_figures.singular_values(MICROSTRAIN_PER_KPA * report.singular_values),
                "Singular values of Z_p over smooth pressures.",
                "Falling singular values over their number.",
                "svg",
            ),
            tables["singular_values"],
        ),
    )


def _modes(report: BuildReport, tables: dict[str, Table]) -> list[Block]:
    """Return what the linear map makes of each POD mode."""
    return [
        picture(
            observability_figures.modes(
                of_variance=report.observability.mode_fraction,
                removed=report.observability.mode_removed,
                removed_at_best=report.observability.mode_removed_at_best,
                is_state=report.observability.is_state,
            ),
            "The first POD modes: fraction of the variance in each, and what remains after the linear map's "
            "estimate.",
            "Bars of the variance of each mode with marks for the part that remains after the estimate.",
            "svg",
        ),
        *((Items(choice),) if (choice := mode_choice_of(report)) else ()),
        tables["modes"],
    ]


def blindness_text(report: BuildReport) -> list[Paragraph]:
    """Return what the layout cannot observe, and what the map states of it all the same."""
    blocks = [Paragraph(blind_line(report))]
    observed = report.observability
    for i in report.blind_classes:
        if not np.isfinite(observed.class_removed[i]):
            continue
        blocks.append(
            Paragraph(
                f"No gauge responds to pressure {report.symmetries[i].symmetry}. It is "
                f"{percent(observed.class_fraction_of_kept[i])} of the variance of the modes that the map "
                f"keeps. The part that this map still estimates, {percent(observed.class_removed[i])}, is "
                "inferred: in the snapshots it is correlated with pressure that the gauges observe. In a flight "
                "without that correlation the inferred part is wrong, and neither sigma nor chi-square shows it."
            )
        )
    return blocks


def blindness(report: BuildReport) -> Section:
    blocks: list[Block] = [*blindness_text(report)]
    observed = report.observability
    if np.isfinite(observed.class_fraction).all() and not report.in_use.is_nonlinear:
        blocks.append(
            picture(
                observability_figures.classes(
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
    elif not np.isfinite(observed.class_fraction).all():
        blocks.append(
            Paragraph("The surface is not symmetric about y = 0 and z = 0: fractions per class are not given.")
        )
    return Section("Blindness", tuple(blocks))


def aerodynamics(report: BuildReport) -> Section:
    """Return the section on the flows that the map is built from."""
    return Section(
        "Aerodynamics",
        (
            picture(
                force_curves(report.snapshots),
                "Of the snapshots: normal force with its slope, axial force and centre of pressure over the total "
                "incidence; axial force over the Mach number; normal force along the body.",
                "Curves of forces over total incidence and Mach number, and of the force along the body.",
                "svg",
            ),
            picture(
                surface_maps(report.snapshots),
                "Pressure over p_inf on the unrolled body at the smallest and the largest total incidence.",
                "Maps of the unrolled body coloured by pressure.",
            ),
        ),
    )


def uncertainty(report: BuildReport, tables: dict[str, Table]) -> Section:
    used = report.in_use.coefficients
    groups = used.group_variance
    return Section(
        "Uncertainty of each coefficient",
        (
            tables[COEFFICIENT_ARRAY],
            tables["source_groups"],
            picture(
                uncertainty_figures.coefficients(
                    sources=tuple(groups),
                    of_variance=np.stack(list(groups.values())) / used.std**2,
                    std=used.std,
                    limits=used.range,
                    std_of_range=used.std_of_range,
                    correlation=used.correlation,
                ),
                "Sources of each variance; 3 sigma over the range of the snapshots; correlation of errors.",
                "Bars of the sources of each coefficient's variance and of 3 sigma over its range; correlations.",
                "svg",
            ),
            tables["sources"],
            tables["correlations"],
        ),
    )


def flight_accuracy(accuracy: FlightAccuracy, tables: dict[str, Table]) -> Section:
    """Return the section on the nonlinear estimator."""
    maps = [
        *(
            AccuracyMap(label=f"{name} [1]", std=accuracy.coefficient_std[..., k], identified=None)
            for k, name in enumerate(COEFFICIENT_NAMES)
        ),
        *(
            AccuracyMap(label=label, std=scale * accuracy.air_data(name), identified=accuracy.is_identified(name))
            for name, label, scale in AIR_DATA_SHOWN
        ),
    ]
    return Section(
        "The nonlinear estimator over the envelope",
        (
            Paragraph(
                "Standard deviations that the nonlinear estimator states, by Mach number and total incidence of "
                f"the flight, at p_inf = {1e-3 * accuracy.static_pressure:.4g} kPa: rms values over the "
                "roll angle of the wind. With M, p_inf and q_inf of navigation, each with the map's standard "
                "deviation, and with q_inf alone."
            ),
            picture(
                accuracy_maps(accuracy.mach_number, np.degrees(accuracy.total_incidence), NAVIGATION, maps),
                "Standard deviations over Mach number and total incidence. Hatched: strain and navigation do not "
                "identify the quantity at half of the roll angles or more; the ranges of the map are as good.",
                "Maps of standard deviations over Mach number and total incidence, a row for each navigation.",
                "svg",
            ),
            tables["flight_accuracy"],
        ),
    )


def gauge_values(report: BuildReport, tables: dict[str, Table]) -> Section:
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
                gauge_figures.gauge_loss(
                    report.inverse_map,
                    growth=report.gauges.growth,
                    detectable_bias=report.gauges.detectable_bias,
                    leverage=report.gauges.leverage,
                ),
                "Growth of each sigma when one gauge is lost, and the minimum detectable bias, at the gauge's "
                "position on the unrolled body. Black: the others do not identify the state.",
                "Six unrolled bodies with gauges coloured by the cost of their loss.",
                "svg",
            ),
            tables["gauges"],
            *((tables["sensors"],) if "sensors" in tables else ()),
            groups,
        ),
    )


def losses(report: BuildReport, tables: dict[str, Table]) -> Section:
    return Section(
        "Cost of a lost gauge",
        (
            tables["worst_losses"],
            tables["worst_pairs"],
            picture(
                gauge_figures.pair_loss(
                    report.inverse_map,
                    growth=report.gauges.growth,
                    pairs=report.gauges.pairs,
                    pair_growth=report.gauges.pair_growth,
                ),
                "Loss of two gauges: growth of the sigma that grows most. On the diagonal: loss of one gauge. Of "
                f"more than {PAIRED} gauges these are the {PAIRED} whose own loss costs most.",
                "Matrix of gauges by gauges coloured by the cost of losing both.",
                "svg",
            ),
        ),
    )


def gamma_choice(report: BuildReport, tables: dict[str, Table]) -> Section:
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
                uncertainty_figures.eigenvalues(
                    report.gamma.eigenvalues,
                    report.gamma.gamma,
                    [main_class(mode_class)[0] for mode_class in report.gamma.mode_classes],
                ),
                "Eigenvalues of the prior-preconditioned Hessian, and filter factors lambda / (lambda + gamma).",
                "Falling eigenvalues with gamma as a line, and bars of filter factors.",
                "svg",
            ),
            picture(
                uncertainty_figures.l_curve(report.gamma.curve, report.gamma.rule_gammas),
                "L-curve: size of the states against size of the residual, with the gamma of every rule.",
                "Curve of solution norm over residual norm with marks for each rule.",
                "svg",
            ),
            tables["eigenvalues"],
        ),
    )


def layout_section(review: Review) -> Section:
    """Return the section on the layout among the layouts that could be placed."""
    unobserved, total = review.unobserved_combinations
    name, gain = review.best
    lines = (
        f"Could go: {', '.join(review.spare) or 'no gauge'}, within {100.0 * SPARE:g} % of the criterion.",
        f"Would help most: {name}: the criterion falls by {100.0 * gain:.2f} %.",
        f"{total - unobserved:.0f} of {total} combinations of unknowns strain the gauges by more than their "
        f"noise, {unobserved:.0f} do not. Unknowns are the flight state, pressure off the snapshots and errors "
        "that gauges have in common.",
        *review.hidden,
    )
    return Section(
        "Against other layouts",
        (
            Paragraph(
                f"{len(review.names)} gauges, {review.kind} estimator, at flight states of the snapshots. The "
                "criterion is the mean variance of the five coefficients, each over its variance with this "
                "layout, installation errors included. Candidates lie on a grid of stations and roll angles."
            ),
            Items(lines),
            _parts(review),
            _worth(review),
        ),
    )


def _parts(review: Review) -> Table:
    columns = (
        Column("coefficient"),
        Column("not observed", "%", ".1f"),
        Column("no strain", "%", ".1f"),
        Column("noise and errors in common", "%", ".1f"),
    )
    parts = 100.0 * np.stack((review.unobserved, review.off, 1.0 - review.unobserved - review.off))
    rows = [(name, *column) for name, column in zip(COEFFICIENT_NAMES, parts.T, strict=True)]
    caption = (
        "Parts of the variance: not observed by these gauges, of pressure that strains no candidate, the rest."
    )
    return make_table("layout_parts", caption, columns, rows)


def _worth(review: Review) -> Table:
    order = np.argsort(-review.worth, kind="stable")
    rows = [(review.names[k], 100.0 * review.worth[k]) for k in order.tolist()]
    columns = Column("gauge"), Column("without it the criterion rises by", "%", ".2f")
    return make_table("layout_gauges", "Gauges by worth.", columns, rows)
