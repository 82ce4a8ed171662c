"""The first screen: what a test established, what it did not, accept or repeat, what would help most.

The rule is plain: the test is accepted where all criteria hold, and each that does not hold says what to do.

What the report of a calibration is made from.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import chdtri

from builder.calibration.estimate.case_faults import Fault
from builder.calibration.estimate.check_loads import CheckLoad, LeftOut
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.load_steps import SteppedCase
from builder.calibration.estimate.outside_terms import OutsideModel
from builder.calibration.estimate.regression import LoadEquation
from builder.calibration.plan.load_plan import KindSigmas, established, kind_sigmas, undetermined
from builder.calibration.plan.worth_of_test import WorthOfTest
from builder.reports.page.origin import Origin
from strainfmu.arrays import BoolArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES


@dataclass(frozen=True, kw_only=True)
class UsedCell:
    """A load cell as the file of the test states it.

    Attributes
    ----------
    name : of the load cell.
    serial_number, calibrated_on : empty where they are not stated.
    loads : number of loads that it read.
    """

    name: str
    serial_number: str
    calibrated_on: str
    loads: int


@dataclass(frozen=True, eq=False, kw_only=True)
class CalibrationFindings:
    """A calibration, and what its report says of it.

    Attributes
    ----------
    title : of the page.
    estimate : from the readings.
    faults : gauges and load cases that were left out.
    outside : tests of what is taken for zero.
    left_out : each case predicted from the others.
    equations : regression load equations.
    checks : check loads.
    steps : cases with loading and unloading.
    worth : what the test is worth in flight.
    origin : files, version and date of the report.
    tested_on : date of the test, empty where it is not stated.
    cells : load cells.
    accepted : why the map was written although no known error explains the readings; empty otherwise.
    """

    title: str
    estimate: Estimate
    faults: tuple[Fault, ...]
    outside: OutsideModel
    left_out: tuple[LeftOut, ...]
    equations: tuple[LoadEquation, ...]
    checks: tuple[CheckLoad, ...]
    steps: tuple[SteppedCase, ...]
    worth: WorthOfTest
    origin: Origin
    tested_on: str = ""
    cells: tuple[UsedCell, ...] = ()
    accepted: str = ""


IN_FLIGHT = 1.5
"""Sigma of a coefficient in flight over its sigma for a vehicle known exactly up to which the test is enough."""

LOAD, SIGMAS = 0.02, 3.0
"""Difference of a check load from the applied one that is accepted [1], or so many standard deviations."""

CHANCE = 1e-4
"""Probability of a chi-square per reading below which a case does not fit what is predicted of it."""

PART = 0.1
"""Part of the gauges, and of the cases, that may be left out."""

HELPS = 0.02
"""Relative fall of a sigma in flight from which a further case is worth naming."""


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One criterion: what it asks, what was found, what is allowed, whether it holds, and what to do if not."""

    name: str
    actual: str
    allowed: str
    holds: bool
    remedy: str


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The first screen in sentences."""

    criteria: tuple[Criterion, ...]
    established: tuple[str, ...]
    open: tuple[str, ...]
    helps: tuple[str, ...]

    @property
    def accepted(self) -> bool:
        """Whether all criteria hold."""
        return all(criterion.holds for criterion in self.criteria)

    @property
    def facts(self) -> dict[str, Any]:
        """What the map's provenance says of it."""
        return {
            "accepted": self.accepted,
            "criteria": [
                {
                    "name": criterion.name,
                    "found": criterion.actual,
                    "allowed": criterion.allowed,
                    "holds": criterion.holds,
                }
                for criterion in self.criteria
            ],
        }

    @property
    def title(self) -> str:
        """Accept or repeat."""
        return "Accept the test" if self.accepted else "Repeat parts of the test"

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why: what does not hold, with its remedy; all criteria where they do."""
        wrong = tuple(
            f"{criterion.name}: {criterion.actual}, allowed {criterion.allowed}; {criterion.remedy}"
            for criterion in self.criteria
            if not criterion.holds
        )
        return wrong or tuple(
            f"{criterion.name}: {criterion.actual}, allowed {criterion.allowed}" for criterion in self.criteria
        )


def verdict(findings: CalibrationFindings) -> Verdict:
    """Return the verdict on a calibration."""
    return Verdict(
        criteria=(
            _agreement(findings.estimate),
            _outside(findings),
            _enough(findings),
            _predicted(findings),
            _left_out(findings),
        ),
        established=_established(findings),
        open=_open(findings),
        helps=_helps(findings),
    )


def _agreement(estimate: Estimate) -> Criterion:
    return Criterion(
        name="Readings fit the model: chi-square per reading",
        actual=f"{estimate.per_reading:.3g}{'' if estimate.settled else ', steps did not settle'}",
        allowed=f"{1.0 - estimate.allowed:.2f} to {1.0 + estimate.allowed:.2f}",
        holds=estimate.agrees and estimate.settled,
        remedy=estimate.unsettled or "check loads, noise and tolerances as stated",
    )


def _outside(findings: CalibrationFindings) -> Criterion:
    return Criterion(
        name="Errors outside the model",
        actual="found" if findings.outside.found else "none found",
        allowed="none",
        holds=not findings.outside.found,
        remedy="state their size in the vehicle file and calibrate again",
    )


def _enough(findings: CalibrationFindings) -> Criterion:
    ratio = findings.worth.after / findings.worth.exact
    worst = int(ratio.argmax())
    return Criterion(
        name="Sigma in flight, in units of a vehicle known exactly",
        actual=f"at most {ratio[worst]:.2f} ({COEFFICIENT_NAMES[worst]})",
        allowed=f"{IN_FLIGHT:g}",
        holds=bool(ratio[worst] <= IN_FLIGHT),
        remedy=f"apply further cases, first '{findings.worth.further}'",
    )


def _predicted(findings: CalibrationFindings) -> Criterion:
    if findings.checks:
        good = [
            abs(check.difference) <= max(LOAD, SIGMAS * check.std) or np.isnan(check.difference)
            for check in findings.checks
        ]
        fits = [check.chance >= CHANCE for check in findings.checks]
        off = [abs(check.difference) for check in findings.checks if not np.isnan(check.difference)]
        return Criterion(
            name="Check loads that were not fitted are predicted",
            actual=f"{sum(a and b for a, b in zip(good, fits, strict=True))} of {len(good)}"
            + (f", off by {100.0 * max(off):.2g} % at most" if off else ""),
            allowed=f"all, within {100.0 * LOAD:g} % or {SIGMAS:g} sigma, readings within chance",
            holds=all(good) and all(fits),
            remedy="find what differs between them and the fitted cases",
        )
    gauges = int(np.median(findings.estimate.used.sum(axis=1)[findings.estimate.used.any(axis=1)]))
    limit = float(chdtri(gauges, CHANCE)) / gauges
    worst = max(findings.left_out, key=lambda case: case.chi_square)
    return Criterion(
        name="No check loads: each case is predicted from the others, chi-square per reading",
        actual=f"at most {worst.chi_square:.2f} ('{worst.case}')",
        allowed=f"{limit:.2f}",
        holds=worst.chi_square <= limit,
        remedy="repeat that case",
    )


def _left_out(findings: CalibrationFindings) -> Criterion:
    test, used = findings.estimate.model.test, findings.estimate.used
    fitted = used[test.fitted]
    gauges, cases = int((~fitted.any(axis=0)).sum()), int((~fitted.any(axis=1)).sum())
    return Criterion(
        name="Left out",
        actual=f"{gauges} of {fitted.shape[1]} gauges, {cases} of {len(fitted)} cases",
        allowed=f"{100.0 * PART:g} % of each",
        holds=gauges <= PART * fitted.shape[1] and cases <= PART * len(fitted),
        remedy="repair the channels and repeat the cases that are named",
    )


def _kinds(estimate: Estimate) -> list[KindSigmas]:
    used: BoolArray = np.any(estimate.used, axis=0)
    return kind_sigmas(estimate.parameters.counts, estimate.model.std, estimate.std, used)


def _established(findings: CalibrationFindings) -> tuple[str, ...]:
    lines = [
        _ratios(
            "sigma in flight, in units of a vehicle known exactly", findings.worth.after / findings.worth.exact
        )
    ]
    lines.append(_ratios("by the drawing's tolerances it was", findings.worth.before / findings.worth.exact))
    known = established(_kinds(findings.estimate))
    return (*lines, *([known] if known else []))


def _open(findings: CalibrationFindings) -> tuple[str, ...]:
    ratio = findings.worth.after / findings.worth.exact
    lines = [
        f"{name}: sigma in flight {value:.2f} times the sigma of a vehicle known exactly"
        for name, value in zip(COEFFICIENT_NAMES, ratio, strict=True)
        if value > IN_FLIGHT
    ]
    same = undetermined(_kinds(findings.estimate))
    if same:
        lines.append(same)
    common = findings.estimate.model.test.errors.common
    lines.append(f"the gain that all load cells have in common: {100.0 * common:g} %, as stated")
    if not findings.steps:
        lines.append("hysteresis and return to zero: the test has no steps of unloading")
    if not findings.checks:
        lines.append("loads that the fit has not seen: the test has no check loads")
    return tuple(lines)


def _helps(findings: CalibrationFindings) -> tuple[str, ...]:
    fall = 1.0 - findings.worth.with_further / findings.worth.after
    if fall.max() < HELPS:
        return (f"no further case that was compared lowers a sigma in flight by {100.0 * HELPS:g} %",)
    falls = ", ".join(
        f"{name} {100.0 * value:.0f} %"
        for name, value in zip(COEFFICIENT_NAMES, fall, strict=True)
        if value >= HELPS
    )
    return (f"the case '{findings.worth.further}' lowers sigma in flight by: {falls}",)


def _ratios(what: str, ratio: np.ndarray) -> str:
    parts = ", ".join(f"{name} {value:.3g}" for name, value in zip(COEFFICIENT_NAMES, ratio, strict=True))
    return f"{what}: {parts}"
