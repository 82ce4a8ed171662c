"""The compiled core's filters agree with the reference over golden flights, as far as these are free of policies.

A policy is what the core does with a sample that does not fit: it begins again from it, and it leaves out air data
that were wrong four times in a row. Both happen where a flight jumps or an air data sensor fails: parts between
those are filtered, each from its first sample.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import linear_kinds
import nonlinear_kinds
import numpy as np
import pytest

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.reference.air import air_inputs
from strainfmu.estimator.reference.flight_filter import FlightFilterReference
from strainfmu.estimator.reference.linear_filter import LinearFilterReference
from strainfmu.estimator.reference.nonlinear import Sample

DATA = Path(__file__).parents[2] / "golden" / "data"
TOLERANCE = 1e-6
"""Largest difference [standard deviations], of standard deviations relative."""


def flight(file: str, samples: slice) -> dict[str, np.ndarray]:
    """Return the inputs of ``samples`` of the golden flight of ``file``, by name."""
    with np.load(DATA / f"{file}.npz") as content:
        found = {name: content[name][samples] for name in content.files if name.startswith("flight/")}
    return {
        name.split("/")[-1]: values if name.endswith("/valid") else values.astype(float)
        for name, values in found.items()
        if name.count("/") == 1 or "/flow/" in name
    }


def compared(core: Any, k: int, loads: np.ndarray, covariance: np.ndarray) -> float:
    """Return how far the five loads of sample ``k`` and their covariance are apart."""
    std = np.sqrt(np.diag(covariance))[:5]
    apart = (core.loads[k] - loads[:5]) / std
    of_both = (core.load_covariance[k] - covariance[:5, :5]) / np.outer(std, std)
    return float(max(np.abs(apart).max(), np.abs(of_both).max()))


def own_flight(inverse_map: Any, seconds: float, n: int) -> dict[str, np.ndarray]:
    """Return a flight of ``n`` samples, in tens, of a map in form "absolute" by the law of its filter."""
    random, law = np.random.default_rng(7), LinearFilterReference(inverse_map, seconds)
    time, std = np.cumsum(random.uniform(0.01, 0.1, n)), 0.3 * np.sqrt(np.diag(law.prior.covariance))
    considered = np.hstack([law.lasting, law.rest])
    states, errors = std * random.normal(size=len(std)), random.normal(size=considered.shape[1])
    strain = np.empty((n, inverse_map.n_gauges))
    for k, step in enumerate(np.diff(time, prepend=time[0])):
        kept = np.diag(law.transition(step))
        states = kept * states + np.sqrt(1.0 - kept**2) * std * random.normal(size=len(std))
        kept = np.exp(-step / seconds)
        errors = kept * errors + np.sqrt(1.0 - kept**2) * random.normal(size=len(errors))
        noise = np.sqrt(law.noise) * random.normal(size=len(law.noise))
        strain[k] = inverse_map.mean_strain + (law.scaled_strain + law.common) @ states
        strain[k] += considered @ errors + noise
    valid = np.repeat(random.random((n // 10, inverse_map.n_gauges)) < 0.95, 10, axis=0)
    q = inverse_map.nominal_dynamic_pressure * random.uniform(0.5, 2.0, n)
    return {
        "strain": strain,
        "dynamic_pressure": q,
        "valid": valid,
        "time": time,
        "dynamic_pressure_std": 0.01 * q,
    }


def check_linear(inverse_map: Any, given: dict[str, np.ndarray], seconds: float) -> None:
    strain, q, time = given["strain"], given["dynamic_pressure"], given["time"]
    estimator = Estimator(inverse_map)
    each = estimator.estimate(strain, q, given["valid"], given["dynamic_pressure_std"])
    core = estimator.filter(seconds).track(strain, q, given["valid"], given["dynamic_pressure_std"], time=time)
    reference, apart = LinearFilterReference(inverse_map, seconds), []
    for k, step in enumerate(np.diff(time, prepend=time[0])):
        change = reference.step(float(step), np.where(each.valid[k], strain[k], 0.0), each.valid[k], q[k])
        if change is not None:
            covariance = each.load_covariance[k] + change.covariance
            apart.append(compared(core, k, each.loads[k] + change.loads, covariance))
    assert len(apart) >= 0.85 * len(strain)
    assert max(apart) < TOLERANCE
    assert np.nanmax(np.abs(core.loads - each.loads) / each.loads_std) > 0.01, "memory changes nothing"


@pytest.mark.parametrize("seconds", [0.5, 5.0])
@pytest.mark.parametrize(("kind", "file"), [("case_1", "scaled_case_1"), ("case_2", "scaled_case_2")])
@pytest.mark.parametrize("samples", [slice(0, 80), slice(81, 120)])
def test_linear_filter_agrees(kind: str, file: str, samples: slice, seconds: float) -> None:
    check_linear(linear_kinds.KINDS[kind].make(), flight(file, samples), seconds)


@pytest.mark.parametrize("seconds", [0.5, 5.0])
@pytest.mark.parametrize("kind", ["absolute_case_1", "absolute_gamma_1"])
def test_linear_filter_of_absolute_maps_agrees(kind: str, seconds: float) -> None:
    inverse_map = linear_kinds.KINDS[kind].make()
    check_linear(inverse_map, own_flight(inverse_map, seconds, n=60), seconds)


PARTS = [
    (kind, samples, seconds)
    for kind in ("surface", "sections")
    for samples in (slice(36), slice(40, 60), slice(60, 80), slice(81, 120))
    for seconds in (0.5, 5.0)
]
FAST = [part for number, part in enumerate(PARTS) if number in (0, 3, 5, 6, 9, 14)]


@pytest.mark.parametrize(("kind", "samples", "seconds"), FAST)
def test_flight_filter_agrees(kind: str, samples: slice, seconds: float) -> None:
    check_flight(kind, samples, seconds)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "samples", "seconds"), PARTS)
def test_flight_filter_agrees_everywhere(kind: str, samples: slice, seconds: float) -> None:
    check_flight(kind, samples, seconds)


def check_flight(kind: str, samples: slice, seconds: float) -> None:
    """Assert that core and reference agree in ``samples`` of the flight of ``kind``."""
    inverse_map, given = nonlinear_kinds.KINDS[kind].make(), flight(kind, samples)
    strain, time = given["strain"], given["time"]
    air = {name: given[name] for name in nonlinear_kinds.AIR}
    core = Estimator(inverse_map).filter(seconds).track(strain, valid=given["valid"], time=time, **air)
    reference, apart = FlightFilterReference(inverse_map, seconds), []
    for k, step in enumerate(np.diff(time, prepend=time[0])):
        value = air_inputs(inverse_map, np.array([one[k] for one in air.values()]), np.full(3, np.nan))
        used = core.valid[k]
        found = reference.step(float(step), Sample(rows=np.where(used, strain[k], 0.0), used=used, air=value))
        assert np.array_equal(core.air_data_used[k], found.air_used & used.any())
        of_loads = compared(core, k, found.loads, found.covariance)
        std = np.sqrt(np.diag(found.coefficient_covariance))
        further = np.empty(0)
        if len(found.loads) > 5:
            further = (core.further_loads[k] - found.loads[5:])[1:] / np.sqrt(np.diag(found.covariance)[6:])
        state_std = np.sqrt(np.diag(found.law.covariance)[:4])
        others = np.concatenate(
            [
                (core.coefficients[k] - found.coefficients[:5]) / std[:5],
                core.coefficients_std[k] / std[:5] - 1.0,
                (core.state[k] - found.law.mean[:4]) / state_std,
                np.sqrt(np.diag(core.state_covariance[k])) / state_std - 1.0,
                [core.chi_square[k] / found.chi_square - 1.0 if used.any() else 0.0],
                core.standardised_residual[k] - found.standardised,
                further,
            ]
        )
        apart.append(max(of_loads, float(np.abs(others).max())))
    assert max(apart) < TOLERANCE, np.array(apart)
