"""Without q_inf the nonlinear estimator goes on with strain and what navigation there is; a linear one cannot."""

from dataclasses import replace
from math import isnan, nan
from pathlib import Path

import numpy as np
import pytest
from can_case import ACCEPTING, CYCLE, OWN, Projection, layout_of
from fault_injection import FaultySender
from flight_fmu import whole_map
from flight_maps import NOISE_STD, exact_response

from strainfmu.can.frame_layout import DYNAMIC_PRESSURE, InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.quality import Cause, Quality
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import Step
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator

pytestmark = pytest.mark.fast

N_D, MACH, STATIC = whole_map().n_gauges, 6.0, 5500.0
Q = 0.7 * STATIC * MACH**2
STRAIN = exact_response(MACH, 0.03, 0.01, STATIC)[:N_D]
LOST, CYCLES = 20, 45
"""Cycle from which on q_inf is not available, and number of cycles."""


def flight_map() -> InverseMap:
    return replace(whole_map(), noise_std=np.full(N_D, NOISE_STD))


def without_pressure(layout: InputLayout) -> InputLayout:
    """Return a layout of which no frame holds q_inf."""
    kept = [one for one in layout.flow_frames if all(s.quantity != DYNAMIC_PRESSURE for s in one.flow)]
    return replace(layout, flow_frames=tuple(kept))


def flown(step: Step, layout: InputLayout, mach_number: float = MACH) -> list[Result]:
    """Return the result of each cycle."""
    core = Machine(layout, step, ACCEPTING, start=0.0, own=[OWN.key])
    sender, random, results = FaultySender(layout, [], OWN), np.random.default_rng(5), list[Result]()
    for k in range(CYCLES):
        strain = STRAIN + NOISE_STD * random.standard_normal(N_D)
        frames = sender.cycle(k, k * CYCLE, strain, Q if k < LOST else nan, mach_number=mach_number)
        found = [one for frame in frames for one in core.receive(frame)]
        results.append((found + core.advance((k + 0.99) * CYCLE))[-1])
    core.finish(CYCLES * CYCLE)
    assert core.account.unaccounted == 0
    return results


@pytest.mark.parametrize("kind", ["map", "fmu"])
@pytest.mark.parametrize("mach_number", [MACH, nan], ids=["mach number", "nothing"])
def test_the_nonlinear_estimate_goes_on_with_larger_sigmas(tmp_path: Path, kind: str, mach_number: float) -> None:
    """Each result is that of the estimator itself on the strains that arrived."""
    save_inverse_map(flight_map(), source := tmp_path / "map.h5")
    if kind == "fmu":
        options = ExportOptions(platforms=["linux64"])
        export_estimator(source, source := tmp_path / "e.fmu", options)
    with open_step(source) as ready:
        results = flown(ready.step, layout_of("fd64", N_D), mach_number)
    tracker = Estimator(flight_map())
    compared = 0
    for result in results:
        expected = tracker.track(result.strain, result.dynamic_pressure, mach_number=result.mach_number)
        if result.quality.has_coefficients:
            np.testing.assert_allclose(result.coefficients, expected.coefficients, rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(result.coefficients_std, expected.coefficients_std, rtol=1e-5)
            compared += 1
    assert compared > CYCLES - 5
    before, after = results[LOST - 1], results[-1]
    assert (before.quality, before.causes) == (Quality.VALID, Cause.NONE)
    assert (after.quality, after.causes) == (Quality.DEGRADED, Cause.DYNAMIC_PRESSURE)
    assert after.health == HealthState.OK
    assert isnan(after.dynamic_pressure)
    assert np.all(after.coefficients_std[1:3] > 1.5 * before.coefficients_std[1:3])


def test_a_bus_without_the_pressure_is_no_fault_for_the_nonlinear_estimator(tmp_path: Path) -> None:
    save_inverse_map(flight_map(), tmp_path / "map.h5")
    with open_step(tmp_path / "map.h5") as ready:
        results = flown(ready.step, without_pressure(layout_of("fd64", N_D)))
    # Now and then a search has not settled, which health says.
    assert {one.causes for one in results[5:]} <= {Cause.NONE, Cause.HEALTH}
    assert np.mean([one.quality is Quality.VALID for one in results[5:]]) > 0.9
    assert np.isfinite([one.coefficients_std for one in results[5:]]).all()


def test_the_linear_estimator_needs_it() -> None:
    layout = layout_of("fd64", N_D)
    results = flown(Projection(N_D), layout)
    assert results[LOST - 1].quality is Quality.VALID
    assert all(one.quality is Quality.INVALID and one.causes & Cause.DYNAMIC_PRESSURE for one in results[LOST:])
    assert np.isnan([one.coefficients for one in results[LOST:]]).all()
    with pytest.raises(InputError, match="no frame holds the dynamic pressure; state it by --dynamic-pressure"):
        flown(Projection(N_D), without_pressure(layout))
