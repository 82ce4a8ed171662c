"""The compiled core's filters agree with the reference over golden flights, as far as these are free of policies.

A policy is what the core does with a sample that does not fit: it begins again from it, and it leaves out air data
that were wrong four times in a row. Both happen where a flight jumps or an air data sensor fails: parts between
those are filtered, each from its first sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import linear_kinds
import nonlinear_kinds
import numpy as np
import pytest

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.reference.air import air_inputs
from strainfmu.estimator.reference.flight_filter import FlightFilterReference
from strainfmu.estimator.reference.linear_filter import LinearFilterReference
from strainfmu.estimator.reference.nonlinear import Sample
from strainfmu.estimator.reference.readings import Zeros, rows_of
from strainfmu.estimator.tables.flight_tables import evaluate
from strainfmu.estimator.tables.parameter_tables import with_known
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros

DATA = Path(__file__).parents[2] / "golden" / "data"
TOLERANCE, OF_LINEAR = 1e-6, 1e-9
"""Largest difference [standard deviations], of standard deviations relative; of linear maps."""

ZEROS = {"no_zeros": (0.0, 0.0), "own": (10.0, 0.0), "common": (0.0, 20.0), "both": (1.0, 1.0)}
"""Deviations of zeros, and the one in common, over the noise."""


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


def zeros_of(inverse_map: InverseMap, own: float, common: float) -> Zeros:
    """Return random zeros of deviations of about ``own`` times the noise, and ``common`` times in common."""
    random, noise = np.random.default_rng(4), inverse_map.noise_std[: inverse_map.n_strain_gauges]
    std = own * noise * random.uniform(0.5, 1.5, len(noise))
    return Zeros(value=noise * random.standard_normal(len(noise)), std=std, common_std=common * noise.min())


def with_zeros(inverse_map: InverseMap, zeros: Zeros | None) -> Estimator:
    """Return the core of ``inverse_map`` with ``zeros``."""
    return Estimator(inverse_map, zeros=None if zeros is None else GaugeZeros(**vars(zeros)))


def read(inverse_map: InverseMap, strain: np.ndarray, zeros: Zeros | None) -> np.ndarray:
    """Return what gauges with ``zeros`` read of ``strain`` (k, n_d)."""
    return strain - rows_of(inverse_map, np.zeros_like(strain), np.zeros(len(strain)), zeros)


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


def check_linear(
    inverse_map: InverseMap, given: dict[str, np.ndarray], seconds: float, zeros: Zeros | None
) -> None:
    """Assert that the filter of the core gives what the reference does over the flight ``given``."""
    strain, q, time = given["strain"], given["dynamic_pressure"], given["time"]
    estimator, rows, strain = with_zeros(inverse_map, zeros), strain, read(inverse_map, strain, zeros)
    each = estimator.estimate(strain, q, given["valid"], given["dynamic_pressure_std"])
    core = estimator.filter(seconds).track(strain, q, given["valid"], given["dynamic_pressure_std"], time=time)
    reference, apart = LinearFilterReference(inverse_map, seconds, zeros), []
    for k, step in enumerate(np.diff(time, prepend=time[0])):
        change = reference.step(float(step), np.where(each.valid[k], rows[k], 0.0), each.valid[k], q[k])
        if change is not None:
            covariance = each.load_covariance[k] + change.covariance
            apart.append(compared(core, k, each.loads[k] + change.loads, covariance))
    assert len(apart) >= 0.85 * len(strain)
    assert max(apart) < OF_LINEAR
    assert np.nanmax(np.abs(core.loads - each.loads) / each.loads_std) > 0.01, "memory changes nothing"


@pytest.mark.parametrize("deviations", ZEROS)
@pytest.mark.parametrize("seconds", [0.5, 5.0])
@pytest.mark.parametrize(("kind", "file"), [("case_1", "scaled_case_1"), ("case_2", "scaled_case_2")])
@pytest.mark.parametrize("samples", [slice(0, 80), slice(81, 120)])
def test_linear_filter_agrees(kind: str, file: str, samples: slice, seconds: float, deviations: str) -> None:
    inverse_map = linear_kinds.KINDS[kind].make()
    check_linear(inverse_map, flight(file, samples), seconds, zeros_of(inverse_map, *ZEROS[deviations]))


def test_linear_filter_with_more_states_than_gauges_agrees() -> None:
    check_linear(linear_kinds.KINDS["five_gauges"].make(), flight("scaled_five_gauges", slice(0, 80)), 5.0, None)


@pytest.mark.parametrize("seconds", [0.5, 5.0])
@pytest.mark.parametrize("kind", ["absolute_case_1", "absolute_gamma_1"])
def test_linear_filter_of_absolute_maps_agrees(kind: str, seconds: float) -> None:
    inverse_map = linear_kinds.KINDS[kind].make()
    check_linear(inverse_map, own_flight(inverse_map, seconds, n=60), seconds, zeros_of(inverse_map, 0.5, 0.5))


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


@pytest.mark.parametrize(
    ("kind", "samples", "deviations"),
    [("surface", slice(81, 96), "own"), ("surface", slice(40, 55), "both"), ("sections", slice(60, 75), "common")],
)
def test_flight_filter_agrees_with_zeros(kind: str, samples: slice, deviations: str) -> None:
    check_flight(kind, samples, 5.0, deviations)


@pytest.mark.slow
@pytest.mark.parametrize("deviations", [None, *ZEROS])
@pytest.mark.parametrize(("kind", "samples", "seconds"), PARTS)
def test_flight_filter_agrees_everywhere(
    kind: str, samples: slice, seconds: float, deviations: str | None
) -> None:
    check_flight(kind, samples, seconds, deviations)


@dataclass(frozen=True, kw_only=True, eq=False)
class Deflected:
    """A flight of a map with tables of flow parameters: ``samples`` for the core, and what is stated (k, n_p)."""

    samples: dict[str, Any]
    value: np.ndarray
    std: np.ndarray

    def track(self, estimator: Estimator, part: slice = slice(None)) -> Any:
        """Return what ``estimator`` makes of a part of it."""
        names = estimator.parameters.names
        known = {"parameters": self.value, "parameters_std": self.std}
        of_each = {name: dict(zip(names, values[part].T, strict=True)) for name, values in known.items()}
        samples = {name: values[part] for name, values in self.samples.items()}
        return estimator.track(q_source="independent", **samples, **of_each)


def deflected_flight(inverse_map: InverseMap, n: int, seed: int) -> Deflected:
    """Return ``n`` samples in which flight state and flow parameters move, with errors of all parts of the map."""
    random, manifold = np.random.default_rng(seed), inverse_map.manifold
    assert manifold is not None
    assert manifold.parameters is not None
    powers, time = manifold.parameters.powers, 0.02 * np.arange(n)
    n_p, (middle, half) = len(powers.mean), (np.broadcast_to(one, 2) for one in manifold.crossflow)
    true = powers.mean + 0.5 * powers.spread * np.sin(2.0 * time[:, None] + random.uniform(0.0, 6.0, n_p))
    std = 0.02 * np.maximum(powers.spread, 1.0)
    phase = random.uniform(-1.0, 1.0, 3)
    log_pressure = np.log(manifold.pressure_range).mean() + 0.2 * np.sin(time)
    mach = manifold.mach_range.mean() + 0.2 * np.ptp(manifold.mach_range) * np.sin(time + phase[0])
    state = np.column_stack([mach, middle + 0.5 * half * np.sin(2.0 * time[:, None] + phase[1:]), log_pressure])
    own, rows = np.linalg.cholesky(manifold.gauge_covariance), np.empty((n, inverse_map.n_gauges))
    for k, at in enumerate(state):
        tables = with_known(manifold, true[k], np.full(n_p, 1e-9))
        error = 0.03 * tables.error_strain @ random.standard_normal(tables.error_strain.shape[1])
        rows[k] = evaluate(tables.tables, at[None]).value[0, : len(error)] + np.exp(at[3]) * error
        rows[k] += own @ random.standard_normal(len(error))
    air = np.column_stack([mach, np.exp(log_pressure), 0.7 * mach**2 * np.exp(log_pressure)])
    air = air * (1.0 + 0.003 * random.standard_normal(3))
    samples = {"strain": rows, "valid": random.random(rows.shape) > 0.05, "time": time}
    return Deflected(
        samples=samples | dict(zip(nonlinear_kinds.AIR, air.T, strict=True)),
        value=true + std * random.standard_normal(n_p),
        std=np.repeat(std[None], n, axis=0),
    )


@pytest.mark.parametrize(("seed", "seconds", "changes"), [(0, 5.0, False), (1, 0.5, False), (2, 5.0, True)])
def test_flight_filter_agrees_with_known_parameters(seed: int, seconds: float, changes: bool) -> None:
    """A value moves in every sample; deviations become others, and one parameter after the other is lost."""
    inverse_map = nonlinear_kinds.KINDS["parameters"].make()
    given = deflected_flight(inverse_map, 24, seed)
    if changes:
        given.std[6:] *= 2.0
        given.std[12:, 0] = np.nan
        given.value[18:] = np.nan
    core = given.track(Estimator(inverse_map).filter(seconds))
    reference, apart = FlightFilterReference(inverse_map, seconds), []
    samples, time = given.samples, given.samples["time"]
    air = np.column_stack([samples[name] for name in nonlinear_kinds.AIR])
    for k, step in enumerate(np.diff(time, prepend=time[0])):
        used, value = core.valid[k], air_inputs(inverse_map, air[k], np.full(3, np.nan))
        reference.know(given.value[k], given.std[k])
        rows = np.where(used, samples["strain"][k], 0.0)
        found = reference.step(float(step), Sample(rows=rows, used=used, air=value))
        further = (core.other_loads[k] - found.loads[5:])[1:] / np.sqrt(np.diag(found.covariance)[6:])
        apart += [compared(core, k, found.loads, found.covariance), np.abs(further).max()]
        apart.append(abs(core.chi_square[k] / found.chi_square - 1.0))
    assert max(apart) < TOLERANCE


def check_flight(kind: str, samples: slice, seconds: float, deviations: str | None = None) -> None:
    """Assert that core and reference agree in ``samples`` of the flight of ``kind``, with zeros or without."""
    inverse_map, given = nonlinear_kinds.KINDS[kind].make(), flight(kind, samples)
    zeros = None if deviations is None else zeros_of(inverse_map, *ZEROS[deviations])
    strain, time = given["strain"], given["time"]
    air, readings = {name: given[name] for name in nonlinear_kinds.AIR}, read(inverse_map, strain, zeros)
    filtered = with_zeros(inverse_map, zeros).filter(seconds)
    core = filtered.track(readings, valid=given["valid"], time=time, q_source="independent", **air)
    reference, apart = FlightFilterReference(inverse_map, seconds, zeros), []
    for k, step in enumerate(np.diff(time, prepend=time[0])):
        value = air_inputs(inverse_map, np.array([one[k] for one in air.values()]), np.full(3, np.nan))
        used = core.valid[k]
        found = reference.step(float(step), Sample(rows=np.where(used, strain[k], 0.0), used=used, air=value))
        assert np.array_equal(core.air_data_used[k], found.air_used & used.any())
        of_loads = compared(core, k, found.loads, found.covariance)
        std = np.sqrt(np.diag(found.coefficient_covariance))
        further = np.empty(0)
        if len(found.loads) > 5:
            further = (core.other_loads[k] - found.loads[5:])[1:] / np.sqrt(np.diag(found.covariance)[6:])
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
