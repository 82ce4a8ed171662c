"""What the nonlinear estimator is aimed at, and whether a comparison finds it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from builder.compare.candidate import (
    GIVEN,
    NO_DYNAMIC_PRESSURE,
    PRESSURE_ALONE,
    NonlinearCandidate,
)
from builder.compare.flights import GAUGE_NOISE, HARDWARE

RMS = {"C_A": 4e-4, "C_N": 8e-4, "C_Y": 8e-4, "M_P": 2.2e-3, "M_Y": 2.2e-3}
FIELD = {"field_median_percent": 1.5, "field_p95_percent": 4.0, "example_field_p95_percent": 3.0}
ANGLES = {"angle_of_attack_deg": 0.15, "sideslip_deg": 0.15}
DYNAMIC_PRESSURE_PERCENT = 5.0
"""Largest values on the shipped vehicle, with gauge noise and navigation; of q_inf where it is not given."""

COVERAGE = 99.0
"""Smallest coverage of 3 sigma [%]."""

OF_LINEAR = 0.5
"""Largest rms error over the error of the better linear map, with errors of the hardware."""

OF_LINEAR_IN_A_TENTH = 1.1
"""Largest rms error in a tenth of the flights over the error of the better linear map there, given q_inf alone."""

LINEAR = ("linear Case 1", "linear Case 2")


@dataclass(frozen=True, kw_only=True)
class Aim:
    """One number that is aimed at: ``found`` is to be at most ``limit``, or at least where ``at_least``."""

    what: str
    limit: float
    found: float | None
    at_least: bool = False

    @property
    def is_met(self) -> bool:
        """Whether it is met; not where nothing was found."""
        if self.found is None:
            return False
        return self.found >= self.limit if self.at_least else self.found <= self.limit

    @property
    def line(self) -> str:
        """The aim as text."""
        found = "none" if self.found is None else f"{self.found:.3g}"
        side = "at least" if self.at_least else "at most"
        return f"{'met' if self.is_met else 'MISSED'}: {self.what}: {found}, {side} {self.limit:.3g}"


def aims(entries: Sequence[Mapping[str, Any]], is_shipped: bool) -> list[Aim]:
    """Return the aims for the entries of ``compare.json``; absolute ones for the shipped vehicle alone."""

    def entry(estimator: str, errors: str, navigation: str) -> Mapping[str, Any]:
        return next(
            one
            for one in entries
            if (one["estimator"], one["errors"], one["air_data_inputs"]) == (estimator, errors, navigation)
        )

    name = NonlinearCandidate.name
    noise, hardware = (entry(name, errors, GIVEN) for errors in (GAUGE_NOISE, HARDWARE))
    found: list[Aim] = []
    if is_shipped:
        found += [Aim(what=f"rms {one}", limit=limit, found=noise["rms"][one]) for one, limit in RMS.items()]
        found += [Aim(what=_words(one), limit=limit, found=noise[one]) for one, limit in FIELD.items()]
        found += [
            Aim(what=f"p95 {_words(one)}", limit=limit, found=noise["air_data_p95"][one])
            for one, limit in ANGLES.items()
        ]
        blind = entry(name, GAUGE_NOISE, NO_DYNAMIC_PRESSURE)["air_data_p95"]["dynamic_pressure_percent"]
        what = f"p95 q_inf [%], air-data inputs {NO_DYNAMIC_PRESSURE}"
        found.append(Aim(what=what, limit=DYNAMIC_PRESSURE_PERCENT, found=blind))
    for errors in (GAUGE_NOISE, HARDWARE):
        for navigation in (GIVEN, PRESSURE_ALONE, NO_DYNAMIC_PRESSURE):
            shares = entry(name, errors, navigation)["coverage_percent"].values()
            least = min(share for share in shares if share is not None)
            what = f"smallest 3 sigma coverage [%], {errors}, air-data inputs {navigation}"
            found.append(Aim(what=what, limit=COVERAGE, found=least, at_least=True))
    for one, value in hardware["rms"].items():
        linear = min(entry(which, HARDWARE, GIVEN)["rms"][one] for which in LINEAR)
        what = f"rms {one} over the better linear map's, hardware"
        found.append(Aim(what=what, limit=OF_LINEAR, found=value / linear))
    for errors in (GAUGE_NOISE, HARDWARE):
        of_linear = [entry(one, errors, PRESSURE_ALONE)["rms_of_tenths"] for one in LINEAR]
        for by, of_name in entry(name, errors, PRESSURE_ALONE)["rms_of_tenths"].items():
            what = f"rms over the better linear map's, {errors}, q_inf only, worst tenth by {_words(by)}"
            worst = _worst_ratio(of_name, [of[by] for of in of_linear])
            found.append(Aim(what=what, limit=OF_LINEAR_IN_A_TENTH, found=worst))
    return found


def _worst_ratio(
    rms: Mapping[str, list[float | None]], others: Sequence[Mapping[str, list[float | None]]]
) -> float | None:
    """Return the largest of ``rms`` by coefficient and tenth over the smallest of ``others`` there."""
    ratios = [
        value / min(known)
        for name, values in rms.items()
        for value, *beside in zip(values, *(other[name] for other in others), strict=True)
        if value is not None and (known := [one for one in beside if one])
    ]
    return max(ratios, default=None)


def _words(key: str) -> str:
    return (
        key.replace("example_field_p95", "field p95 at the example")
        .replace("_percent", " [%]")
        .replace("_deg", " [deg]")
        .replace("_", " ")
    )
