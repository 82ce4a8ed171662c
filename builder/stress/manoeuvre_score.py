"""Scores of manoeuvres: the estimates of a filter over time next to single samples, and what health shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any
from zlib import crc32

import numpy as np

from builder.reporting import Reporter
from builder.stress.kind import Kind, as_stated, exact
from builder.stress.manoeuvre import Manoeuvre, ManoeuvreSet
from builder.stress.score import Range
from builder.trial.readings import navigation_at
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

ANGLES = ("angle_of_attack", "sideslip_angle")
SINGLE = 0.0
"""Time constant of single samples."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Flown:
    """One draw of a manoeuvre: what is read in n samples, and the truth.

    ``quiet`` (n, n_d) is ``strain`` without noise, of a vehicle without installation errors, None of others.
    ``known`` has air data by the names of arguments, of the nonlinear estimator and of the linear one;
    ``truth`` (n, 7) are coefficients and angles.
    """

    time: FloatArray
    strain: FloatArray
    quiet: FloatArray | None
    known: tuple[dict[str, Any], dict[str, Any]]
    truth: FloatArray


@dataclass(kw_only=True, eq=False)
class Sums:
    """Sums over the samples of all draws of one estimator, (m,) for m quantities."""

    samples: int = 0
    detected: int = 0
    undetected: int = 0
    square: FloatArray = field(default_factory=lambda: np.zeros(1))
    of_single: FloatArray = field(default_factory=lambda: np.zeros(1))
    both: FloatArray = field(default_factory=lambda: np.zeros(1))
    known: FloatArray = field(default_factory=lambda: np.zeros(1))
    inside: FloatArray = field(default_factory=lambda: np.zeros(1))

    def add(self, found: Estimate, single: Estimate, truth: FloatArray, middle: FloatArray) -> None:
        """Add the samples of one draw; rms errors are about ``middle`` (n, 7), coverage is of the ``truth``."""
        (value, std), (alone, _) = _quantities(found), _quantities(single)
        n = value.shape[1]
        error, of_single = value - middle[:, :n], alone - middle[:, :n]
        known, both = np.isfinite(value), np.isfinite(error) & np.isfinite(of_single)
        inside = known & (np.abs(value - truth[:, :n]) <= 3.0 * std)
        wrong: BoolArray = np.any(known & ~inside, axis=1)
        is_ok = found.health == HealthState.OK
        self.samples += len(truth)
        self.detected += int(np.sum(~is_ok))
        self.undetected += int(np.sum(wrong & is_ok))
        self.square = self.square + np.sum(np.where(both, error, 0.0) ** 2, axis=0)
        self.of_single = self.of_single + np.sum(np.where(both, of_single, 0.0) ** 2, axis=0)
        self.both = self.both + np.sum(both, axis=0)
        self.known, self.inside = self.known + np.sum(known, axis=0), self.inside + np.sum(inside, axis=0)


def _quantities(found: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return (n, m) coefficients and, of a nonlinear map, angles; and their standard deviations."""
    air, n = found.air_data, len(ANGLES)
    if np.isnan(air.value[:, :n]).all():
        return found.coefficients, found.coefficients_std
    return np.hstack([found.coefficients, air.value[:, :n]]), np.hstack([found.coefficients_std, air.std[:, :n]])


@dataclass(frozen=True, eq=False, kw_only=True)
class ManoeuvreScore:
    """The score of a ``manoeuvre`` by one estimator; a ``time_constant`` of 0 stands for single samples."""

    manoeuvre: Manoeuvre
    estimator: str
    time_constant: float
    coverage_target: float
    sums: Sums

    def entry(self) -> dict[str, Any]:
        """Return the entry of ``stress.json``."""
        one, sums = self.manoeuvre, self.sums
        names = (*COEFFICIENT_NAMES, *ANGLES)[: len(sums.square)]
        both, known = np.maximum(sums.both, 1.0), np.maximum(sums.known, 1.0)
        ratio = np.sqrt(sums.square / np.where(sums.of_single > 0.0, sums.of_single, 1.0))
        coverage = 100.0 * sums.inside / known
        undetected = 100.0 * sums.undetected / sums.samples

        def named(values: FloatArray, digits: int) -> dict[str, float]:
            return {name: float(f"{value:.{digits}g}") for name, value in zip(names, values.tolist(), strict=True)}

        return {
            "error": one.error,
            "size": one.size,
            "class": one.group,
            "estimator": self.estimator,
            "time_constant_s": self.time_constant,
            "detected_percent": round(100.0 * sums.detected / sums.samples, 3),
            "undetected_percent": round(undetected, 3),
            "samples": sums.samples,
            "what": one.what,
            "rms": named(np.sqrt(sums.square / both), 4),
            "rms_over_single": named(ratio, 4),
            "coverage_percent": named(coverage, 5),
            "missed": self._missed(names, ratio, coverage, undetected),
        }

    def _missed(
        self, names: tuple[str, ...], ratio: FloatArray, coverage: FloatArray, undetected: float
    ) -> list[str]:
        target, found = self.manoeuvre.undetected_target, list[str]()
        if undetected > target:
            found.append(f"undetected {undetected:.2f} %, at most {target:g} % aimed at")
        for name, of_single, inside in zip(names, ratio.tolist(), coverage.tolist(), strict=True):
            if self.time_constant != SINGLE and of_single > self.manoeuvre.ratio:
                found.append(
                    f"{name}: rms over single samples {of_single:.3f}, at most {self.manoeuvre.ratio:g} aimed at"
                )
            if inside < self.coverage_target:
                found.append(
                    f"{name}: inside 3 sigma {inside:.2f} %, at least {self.coverage_target:g} % aimed at"
                )
        return found


def manoeuvre_scores(trial: Range, given: ManoeuvreSet, reporter: Reporter) -> list[ManoeuvreScore]:
    """Return the scores of all manoeuvres by each estimator of the map, without filter and with each one."""
    found = list[ManoeuvreScore]()
    with reporter.stage("Manoeuvres") as progress:
        for done, one in enumerate(given.manoeuvres, start=1):
            found += _scores_of(trial, given, one)
            progress(done, len(given.manoeuvres))
    return found


def _scores_of(trial: Range, given: ManoeuvreSet, one: Manoeuvre) -> Iterator[ManoeuvreScore]:
    estimators = {"linear": trial.estimator.linear}
    if trial.estimator.is_nonlinear:
        estimators = {"nonlinear": trial.estimator, **estimators}
    constants = (SINGLE, *given.time_constants)
    sums = {(name, constant): Sums() for name in estimators for constant in constants}
    random = np.random.default_rng([trial.effort.seed, crc32(f"{one.error} {one.size}".encode())])
    for _ in range(trial.effort.draws):
        flown = fly(trial, given.time_step, one, random)
        for name, estimator in estimators.items():
            single = _track(estimator, SINGLE, flown, flown.strain)
            middle = flown.truth
            if flown.quiet is not None:
                # What noise alone adds: errors of the map are no part of it, and no average reduces them.
                middle = _quantities(_track(estimator, SINGLE, flown, flown.quiet))[0]
            for constant in constants:
                found = single if constant == SINGLE else _track(estimator, constant, flown, flown.strain)
                sums[name, constant].add(found, single, flown.truth, middle)
    for (name, constant), each in sums.items():
        yield ManoeuvreScore(
            manoeuvre=one,
            estimator=name,
            time_constant=constant,
            coverage_target=given.coverage_percent,
            sums=each,
        )


def _track(estimator: Estimator, time_constant: float, flown: Flown, strain: FloatArray) -> Estimate:
    known = flown.known[0 if estimator.is_nonlinear else 1]
    return estimator.filter(time_constant).track(strain, time=flown.time, **known)


def fly(trial: Range, time_step: float, one: Manoeuvre, random: np.random.Generator) -> Flown:
    """Return one draw of a manoeuvre: motion, vehicle and noise are drawn."""
    time = time_step * np.arange(float(round(one.seconds / time_step)))
    conditions = one.conditions(trial.vehicle, time, random)
    kind = Kind(
        error=one.error,
        size=one.size,
        group=one.group,
        what=one.what,
        flights=lambda *_: conditions,
        build=exact if one.exact else as_stated,
    )
    flights = trial.model.flights(kind, len(time), random)
    built = kind.build(trial.hardware, random)
    read = trial.readings(kind, flights, built, random)
    quiet = np.asarray(trial.readings(kind, flights, built, random, noise=False).strain) if one.exact else None
    strain = np.array(read.strain)
    gauges = trial.hardware.roll_angle
    strain[:, : len(gauges)][~one.gives(time, gauges, random)] = np.nan
    if one.no_strain > 0.0:
        strain[np.isnan(strain).any(axis=1)] = np.nan
    known = []
    for is_nonlinear in (True, False):
        air = {DYNAMIC_PRESSURE: read.known[DYNAMIC_PRESSURE], **navigation_at(conditions, is_nonlinear)}
        air[MACH_NUMBER] = air[MACH_NUMBER] + one.mach_drift * time
        if is_nonlinear:
            air[STATIC_PRESSURE] = air[STATIC_PRESSURE] * (1.0 + one.pressure_drift * time)
        known.append(air)
    angles = [[getattr(condition, name) for name in ANGLES] for condition in conditions]
    truth = np.hstack([flights.coefficients, angles])
    return Flown(time=time, strain=strain, quiet=quiet, known=(known[0], known[1]), truth=truth)


def set_inputs(given: ManoeuvreSet) -> dict[str, Any]:
    """Return what scores depend on, of the manoeuvres."""
    return asdict(given)
