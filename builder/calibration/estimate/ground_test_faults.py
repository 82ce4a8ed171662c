"""Gauges and load cases that do not fit: found, named and left out.

A gauge is judged by all its readings together, against what they should scatter by before the test: tolerances
of the vehicle, of the loads and of the pads, noise (prior-predictive chi-square). What would make its readings
right is its name: swapped with another one, of the wrong sign, in the wrong unit, dead. Gauges are judged without
the cases in which half of them say that the load was another one. What they, the loads, the vehicle and the test
may have in common compete for what still does not fit: :mod:`builder.calibration.estimate.causes`. Last, a load is
judged by the factor that would make it right, in that factor's standard deviations.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.special import chdtrc

from builder.calibration.estimate.case_faults import FITS, MODEL, NO_CAUSE, Fault, case_fault_after, case_faults
from builder.calibration.estimate.causes import Evidence, freed
from builder.calibration.estimate.estimated_vehicle import Estimate, estimate, minimum, usable
from builder.calibration.estimate.readings_model import Cause, ReadingsModel, scaled_columns
from builder.structure.as_built.as_built_structure import OF_MASS
from builder.structure.loads.applied import load_kind
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError

GAUGE_ALARM = 1e-7
"""Probability that a sound gauge is called a fault; of a Gaussian linear model, so with room for what is not."""

LOAD_ALARM = 4.5
"""Standard deviations from which a load is called wrong."""

LEAST_OF_LOAD = 0.01
"""Relative error of a load below which it is not called wrong: exact readings show errors of the model, too."""

LEAST_OF_GAUGE = 0.01
"""Part of its strain by which a gauge that is called wrong differs at least: the wall may differ from the average
of its region as much. Below it a gauge counts as less exact than stated."""

DOUBTFUL_LOAD = 0.04
"""Relative error of a load by the median gauge from which its case does not judge gauges."""

NEAR_MODEL = 5e-4
"""Part of the strain by which the model of the vehicle as built may err, as noise: the wall varies within its
regions. It counts where readings are more exact than 0.02 um/m."""

AT_BREAK = 0.03
"""The same of gauges within one element of a change of slope, thickness or material, where strain has a kink."""

UNITS = (1e3, 1e-3, 1e6, 1e-6)
"""Factors of a wrong unit: mm/m for um/m and the like."""

FOLLOWS = 0.8
"""Correlation with prediction from which readings in another unit follow the loads; a dead gauge is below."""

UNNAMED = ("gauge", "load")
"""Kinds of faults of which no cause is known."""

ROUNDS = 2
"""Times that pads are put where steps end, before the estimate: the first time from where causes had them."""

MOST_CAUSES = 10
"""Causes, gauges and loads among them, that are looked for before and after the estimate."""

MOST_GAUGES = 0.34
"""Part of the gauges that may be at fault; more, and it is rather the loads or the vehicle."""

MOST_AT_FAULT = 0.25
"""Part of the gauges, or of the load cases, that may be left out as faults."""


def calibrate_with_faults(model: ReadingsModel) -> tuple[Estimate, tuple[Fault, ...]]:
    """Estimate the vehicle without the gauges and load cases that do not fit, and name these.

    Raises
    ------
    InputError
        No reading is left, or the steps lead away from the readings.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # where the steps diverge, which is refused
        fit, faults = _without_faults(_with_model_error(model))
        if fit.has_diverged:
            raise InputError(f"load test: {fit.far_off}")
    return fit, faults


def _with_model_error(model: ReadingsModel) -> ReadingsModel:
    """Return ``model`` with the error of the model as noise, in proportion to what each case should strain."""
    predicted, _ = model.at_drawing()
    error = np.where(model.structure.at_break, AT_BREAK, NEAR_MODEL) * predicted
    return model.with_readings(model.test.readings, np.hypot(model.test.reading_stds, error))


def _without_faults(model: ReadingsModel) -> tuple[Estimate, tuple[Fault, ...]]:
    """Return :func:`calibrate_with_faults`, whether its steps ended near the readings or not."""
    model, faults = _before_the_estimate(model)
    fit = _about_its_loads(model, _left(model, faults))
    if fit.has_diverged:  # slopes far from the readings say nothing of causes
        return fit, tuple(faults)
    fit, faults = _with_causes(fit, faults)
    while True:
        wrong = None if _are_many(fit.model, faults) else worst_load(fit)
        if wrong is None:
            return fit, tuple(faults)
        faults.append(wrong)
        used = _left(fit.model, faults)
        if not used.any():
            return fit, tuple(faults)
        fit = _about_its_loads(fit.model, used, fit.vector)


def _about_its_loads(model: ReadingsModel, used: BoolArray, start: FloatArray | None = None) -> Estimate:
    """Return the estimate by pads that stand where steps from ``start`` (n,) say; see :func:`estimate`."""
    for _ in range(ROUNDS):
        start, *_ = minimum(model, used, start)
        model = model.with_pads_of(start)
    return estimate(model, used, start)


def _before_the_estimate(model: ReadingsModel) -> tuple[ReadingsModel, list[Fault]]:
    """Return the gauges and load cases that do not fit, and the model in which they do not.

    Where gauges or cases do not fit and no cause of their own is known, what they may have in common is set free
    first, if that makes the readings more probable than any gauge's, load's or case's own fault. The others are
    judged without a gauge, a load or a case whose own fault does so more.
    """
    faults = named_faults(model, usable(model))
    sure = [fault for fault in faults if fault.kind not in UNNAMED]
    for _ in range(MOST_CAUSES):
        sure = [fault for fault in sure if fault not in _shared(faults)]
        if all(fault.kind not in UNNAMED for fault in faults) and not _shared(faults):
            break
        used = _left(model, sure)
        cause = Evidence(model, used, np.zeros(len(model.std)), MODEL).best() if used.any() else None
        if cause is None:
            break
        if cause.where in ("vehicle", "noise"):
            model = freed(model, cause)
            faults = named_faults(model, usable(model))
            sure = [fault for fault in faults if fault.kind not in UNNAMED]
        else:  # left out while others are looked for, and named after the estimate
            suspect = Fault(where=_place(model, cause), kind=cause.kind, line="")
            sure = [*sure, suspect]
            usable_rest = _left(model, [suspect])
            if usable_rest.any():
                known = [fault for fault in faults if fault.where == suspect.where]
                faults = [*known, *named_faults(model, usable_rest)]
    return model, faults


def _shared(faults: Sequence[Fault]) -> list[Fault]:
    """Return the masses on loads where there are several: what hangs on all is one cause."""
    masses = [fault for fault in faults if fault.kind == "mass"]
    return masses if len(masses) > 1 else []


def _with_causes(fit: Estimate, faults: list[Fault]) -> tuple[Estimate, list[Fault]]:
    """Return the estimate and its faults after all causes that make the readings more probable, the best first.

    Readings that :data:`MOST_CAUSES` do not explain are no more than what they were before.
    """
    before, sure = fit, faults
    for _ in range(MOST_CAUSES):
        if _are_many(fit.model, faults):
            return fit, faults
        evidence = Evidence(fit.model, fit.used, fit.vector)
        cause = evidence.best()
        if cause is None:
            return fit, faults
        model = fit.model
        if cause.where == "load" and _of_the_load(evidence, cause) < LEAST_OF_LOAD:
            model = model.with_wider_std(cause.entries, LEAST_OF_LOAD)  # less exact than stated, and estimated
        elif cause.where == "gauge" and evidence.part_of_gauge(cause) < LEAST_OF_GAUGE:
            model = _less_exact(model, cause)
        elif cause.where == "case" and abs(case_fault_after(fit, cause.number).factor - 1.0) < LEAST_OF_LOAD:
            return fit, faults  # too little to be named
        elif cause.where in ("vehicle", "noise"):
            model = freed(model, cause)
        else:
            faults = [*faults, _fault_of(fit, cause)]
        used = _left(model, faults)
        if not used.any():
            break
        fit = _about_its_loads(model, used, fit.vector)
    return before, sure


def _less_exact(model: ReadingsModel, cause: Cause) -> ReadingsModel:
    """Return ``model`` with a gauge that is less exact than stated: in what is set free, or by its scatter."""
    if len(cause.entries):
        return model.with_wider_std(cause.entries, cause.wide)
    noise = model.test.reading_stds.copy()
    noise[:, cause.number] *= np.hypot(1.0, cause.factor)
    return model.of_causes(cause).with_readings(model.test.readings, noise)


def _of_the_load(evidence: Evidence, cause: Cause) -> float:
    """Return the size of what a cause adds to a load, relative to it [1]."""
    (size,) = evidence.sizes(cause)
    return abs(float(size)) * (float(np.linalg.norm(cause.wide)) if cause.together else 1.0)


def _place(model: ReadingsModel, cause: Cause) -> str:
    """Return the name of the gauge, or of the case, that a cause is of."""
    if cause.where == "gauge":
        return model.structure.gauges.names[cause.number]
    return model.test.cases[model.loads[cause.number][0] if cause.where == "load" else cause.number].name


def _fault_of(fit: Estimate, cause: Cause) -> Fault:
    """Return the gauge, the load or the case of a cause as a fault."""
    model = fit.model
    name = _place(model, cause)
    if cause.where == "gauge":
        text = NO_CAUSE
        if cause.kind == "gain":
            gain, tolerance = (float(vector[cause.entries[0]]) for vector in (fit.vector, model.std))
            text = f"its gain differs by about {gain:+.0%}, {abs(gain / tolerance):.0f} times its tolerance"
        return Fault(where=name, kind=cause.kind, line=f"gauge '{name}': {text}")
    case = model.loads[cause.number][0] if cause.where == "load" else cause.number
    return case_fault_after(fit, case)


def _left(model: ReadingsModel, faults: Sequence[Fault], among: BoolArray | None = None) -> BoolArray:
    """Return (n_cases, n_d) which readings are used without the readings of ``faults``, of all or of those
    ``among`` (n_cases, n_d)."""
    used, blamed = usable(model) if among is None else among.copy(), {fault.where for fault in faults}
    used[[case.name in blamed for case in model.test.cases]] = False
    used[:, [name in blamed for name in model.structure.gauges.names]] = False
    return used


def _are_many(model: ReadingsModel, faults: Sequence[Fault]) -> bool:
    """Return whether more than :data:`MOST_AT_FAULT` of the gauges or of the loads are left out as faults."""
    left_out, every = _blamed(model, faults)
    return bool(np.any(left_out > MOST_AT_FAULT * every))


def _blamed(model: ReadingsModel, faults: Sequence[Fault]) -> IntArray:
    """Return (2, 2) gauges and loads that are left out as faults, and of how many. Own weight is no load here."""
    read, blamed = usable(model), {fault.where for fault in faults}
    gauges = [name for g, name in enumerate(model.structure.gauges.names) if read[:, g].any()]
    cases = [case for k, case in enumerate(model.test.cases) if read[k].any()]
    loaded = [case for case in cases if not all(isinstance(known.load, OF_MASS) for known in case.loads)] or cases
    left_out = len(blamed & set(gauges)), len(blamed & {case.name for case in cases})
    return np.array([left_out, (len(gauges), len(loaded))])


def too_many(model: ReadingsModel, faults: Sequence[Fault]) -> str:
    """Return that too many gauges, loads, or both are left out as faults, in one clause; empty otherwise."""
    (gauges, loads), (n_gauges, n_loads) = _blamed(model, faults).tolist()
    if not _are_many(model, faults) and not (gauges and loads):
        return ""
    return (
        f"{gauges} of {n_gauges} gauges and {loads} of {n_loads} loads would have "
        f"to be left out, expected at most {100.0 * MOST_AT_FAULT:g} % of the gauges or of the loads, not both; "
        "look for what they have in common, or correct what is named"
    )


def named_faults(model: ReadingsModel, used: BoolArray) -> list[Fault]:
    """Return the load cases and the gauges that do not fit, before any estimate.

    A gauge at fault makes cases look wrong, and a wrong case makes gauges look at fault. The cases are judged
    first, then the gauges first; the result with fewer faults, and more of them named, counts.
    """
    cases = case_faults(model, used)
    cases_first = [*cases, *gauge_faults(model, _left(model, cases, used))]
    blamed = gauge_faults(model, used)
    if not blamed:
        return cases_first
    cases = case_faults(model, _left(model, blamed, used))
    gauges_first = [*cases, *(gauge_faults(model, _left(model, cases, used)) if cases else blamed)]
    return min(
        cases_first,
        gauges_first,
        key=lambda faults: (len(faults), sum(fault.kind in UNNAMED for fault in faults)),
    )


def gauge_faults(model: ReadingsModel, used: BoolArray) -> list[Fault]:
    """Return the gauges whose readings do not fit what they may be before the test."""
    predicted, jacobian = model.at_drawing()
    scatter = _GaugeScatter(model, used, predicted, jacobian)
    scatter.used = used & ~doubtful_cases(model, scatter)[:, None]
    names, reading = model.structure.gauges.names, model.test.readings
    chance = np.array([scatter.chance(g, reading[:, g]) for g in range(len(names))])
    bad = np.flatnonzero(chance < GAUGE_ALARM).tolist()
    if len(bad) > MOST_GAUGES * len(names):
        return []
    return [_named(scatter, g, bad, reading, names) for g in bad]


def worst_load(fit: Estimate) -> Fault | None:
    """Return the load that would have to differ most, in standard deviations; None if all fit.

    Loads that differ by less than :data:`LEAST_OF_LOAD` fit.
    """
    model = fit.model
    shift, size = load_shifts(fit)
    shift = np.where(np.abs(size) < LEAST_OF_LOAD, 0.0, shift)
    if not len(shift) or np.abs(shift).max() < LOAD_ALARM:
        return None
    worst = int(np.abs(shift).argmax())
    case = model.test.cases[model.loads[worst][0]]
    return Fault(
        where=case.name,
        kind="load",
        line=(
            f"load case '{case.name}': {load_kind(model.loads[worst][1].load)} differs by {size[worst]:+.1%} "
            f"from what is stated, {abs(shift[worst]):.1f} standard deviations"
        ),
    )


def load_shifts(fit: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return how far each load is from its statement in standard deviations, and relative to it, (n_loads,) each.

    The load's own error is what the others readings and all priors say without the prior of that error.
    """
    model = fit.model
    index = model.entries["load"]
    prior, after = model.std[index] ** 2, np.diag(fit.covariance)[index]
    shift, size = np.zeros(len(index)), np.zeros(len(index))
    used = np.array([fit.used[k].any() for k, _ in model.loads])
    # Take the prior out: theta / after = likelihood's part + 0 / prior.
    known = (prior > 0.0) & used & (after < 0.999 * prior)
    of_data = np.full(len(index), np.inf)
    of_data[known] = 1.0 / (1.0 / after[known] - 1.0 / prior[known])
    size[known] = fit.vector[index][known] / after[known] * of_data[known]
    shift[known] = size[known] / np.sqrt(of_data[known] + prior[known])
    return shift, size


def doubtful_cases(model: ReadingsModel, scatter: _GaugeScatter) -> BoolArray:
    """Return (n_cases,) whether half of the gauges say that a load was another one.

    A gauge's readings in the other cases show what it should read in a case; the median of all is not moved by
    a few gauges at fault.
    """
    doubtful, shape = np.zeros(len(model.test.cases), dtype=bool), model.test.readings.shape
    left_out = [scatter.left_out(gauge) for gauge in range(shape[1])]
    error, std = (np.array(part).T for part in zip(*left_out, strict=True))
    columns = model.at_drawing()[1].tocsc()
    for entry, (case, known) in zip(model.entries["load"], model.loads, strict=True):
        if known.std > 0.0:
            strain = columns[:, [entry]].toarray().reshape(shape)[case]
            some = np.isfinite(error[case]) & (strain != 0.0)
            value, weight = error[case, some] / strain[some], np.abs(strain[some]) / std[case, some]
            if len(value):
                order = np.argsort(value)
                middle = np.searchsorted(np.cumsum(weight[order]), 0.5 * weight.sum())
                doubtful[case] |= bool(abs(value[order][middle]) > DOUBTFUL_LOAD)
    return doubtful


class _GaugeScatter:
    """What each gauge's readings may scatter by before the test; ``spread`` is their covariance without noise."""

    def __init__(self, model: ReadingsModel, used: BoolArray, predicted: FloatArray, jacobian: csr_array) -> None:
        self.used, self.predicted, self.reading = used, predicted, model.test.readings
        self.noise = model.test.reading_stds
        columns, (n_c, n_d) = scaled_columns(jacobian, model.std), used.shape
        by_gauge = (columns[gauge + n_d * np.arange(n_c)] for gauge in range(n_d))
        self.spread = [(slopes @ slopes.T).toarray() for slopes in by_gauge]

    def left_out(self, gauge: int) -> tuple[FloatArray, FloatArray]:
        """Return what the readings (n_cases,) of a gauge differ by from their prediction by its other readings,
        and standard deviations of that [m/m]; NaN of readings that are not used."""
        rows, prediction_error = self.used[:, gauge], np.full((2, len(self.used)), np.nan)
        covariance = self.spread[gauge][np.ix_(rows, rows)] + np.diag(self.noise[rows, gauge] ** 2)
        precision = np.linalg.inv(covariance)
        misfit = self.reading[rows, gauge] - self.predicted[rows, gauge]
        variance = 1.0 / np.maximum(np.diag(precision), 1e-300)
        prediction_error[:, rows] = variance * (precision @ misfit), np.sqrt(variance)
        return prediction_error[0], prediction_error[1]

    def chance(self, gauge: int, reading: FloatArray, as_gauge: int | None = None, factor: float = 1.0) -> float:
        """Return the probability that readings (n_cases,) of gauge ``of`` scatter as much as these.

        ``factor`` is what readings were multiplied by, their noise with them; where it is stated for all gauges
        alike, that makes them no more exact than others.
        """
        rows = self.used[:, gauge]
        if not rows.any():
            return 1.0
        model_gauge = gauge if as_gauge is None else as_gauge
        noise = factor * self.noise[rows, gauge]
        if factor < 1.0:
            noise = np.maximum(noise, np.median(self.noise))
        covariance = self.spread[model_gauge][np.ix_(rows, rows)] + np.diag(noise**2)
        misfit = reading[rows] - self.predicted[rows, model_gauge]
        return float(chdtrc(rows.sum(), misfit @ np.linalg.solve(covariance, misfit)))

    def follows(self, gauge: int) -> bool:
        """Return whether the gauge's readings go with what is predicted, whatever their unit."""
        rows = self.used[:, gauge]
        pair = np.array([self.reading[rows, gauge], self.predicted[rows, gauge]])
        if rows.sum() < 3 or np.any(np.ptp(pair, axis=1) == 0.0):
            return False
        return float(np.corrcoef(pair)[0, 1]) > FOLLOWS


def _named(
    scatter: _GaugeScatter, gauge: int, bad: list[int], reading: FloatArray, names: tuple[str, ...]
) -> Fault:
    """Return what is wrong with a gauge."""
    readings, name = reading[:, gauge], names[gauge]
    rows = scatter.used[:, gauge]

    def fault(kind: str, text: str) -> Fault:
        return Fault(where=name, kind=kind, line=f"gauge '{name}': {text}")

    # Before "dead": in a unit 1000 times as large, readings may move by no more than noise is said to.
    for factor in UNITS if scatter.follows(gauge) else ():
        if scatter.chance(gauge, readings * factor, factor=factor) > FITS:
            return fault("unit", f"wrong unit, its readings fit when multiplied by {factor:g}")
    changes = np.std(readings[rows])
    if changes < 5.0 * np.median(scatter.noise[rows, gauge]) and len(readings[rows]) > 1:
        return fault("dead", "dead, it reads the same under every load")
    if scatter.chance(gauge, -readings) > FITS:
        return fault("sign", "wrong sign")
    partners = [g for g in bad if g != gauge and scatter.chance(gauge, readings, as_gauge=g) > FITS]
    back = [g for g in partners if scatter.chance(g, reading[:, g], as_gauge=gauge) > FITS]
    if back:
        best = max(back, key=lambda g: scatter.chance(gauge, readings, as_gauge=g))
        return fault("swapped", f"swapped with '{names[best]}'")
    return fault("gauge", NO_CAUSE)
