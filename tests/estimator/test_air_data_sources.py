"""What a dynamic pressure is computed from, measured angles, and whether loads are usable: core and reference."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flight_fmu import whole_map
from flight_maps import exact_response

from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import AIR_INPUT_NAMES, QSource
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import USABLE_STATES, HealthState
from strainfmu.estimator.reference.air import (
    DAY_OF_MACH,
    AirInputs,
    air_inputs_of,
    air_of,
    linear_pressure_std,
    measured_directions,
)

pytestmark = pytest.mark.fast

MACH, ALTITUDE = 6.0, 20e3
PRESSURE = pressure_and_temperature(ALTITUDE)[0]
Q = 0.7 * MACH**2 * PRESSURE
U, W = 0.06, 0.03
N_D = whole_map().n_gauges
STRAIN = exact_response(MACH, U, W, PRESSURE)[:N_D]
NONLINEAR = Estimator(whole_map())
LINEAR = Estimator(whole_map().without_tables())


def estimated(strain: np.ndarray = STRAIN, estimator: Estimator = NONLINEAR, **flow: Any) -> Estimate:
    return estimator.estimate(strain, **flow)


def joined(**given: float) -> AirInputs:
    return air_inputs_of(whole_map(), dict.fromkeys(AIR_INPUT_NAMES, np.nan) | given)


def of_linear(**given: float) -> float:
    """Return the deviation of q_inf that a linear map works with, relative to it."""
    records = {name: np.array([[given.get(name, np.nan)]]) for name in AIR_INPUT_NAMES}
    error = LINEAR.inverse_map.dynamic_pressure_error
    return float(linear_pressure_std(air_of(records), error)[0] / given["dynamic_pressure"])


GIVEN = [
    {"dynamic_pressure": Q, "mach_number": MACH, "static_pressure": PRESSURE},
    {"dynamic_pressure": Q, "mach_number": MACH, "altitude": ALTITUDE},
    {"dynamic_pressure": Q, "mach_number": MACH},
    {"dynamic_pressure": 1.1 * Q, "mach_number": MACH, "static_pressure": PRESSURE},
    {"dynamic_pressure": Q, "mach_number": MACH, "q_source": 2.0},
    {"dynamic_pressure": Q, "static_pressure": PRESSURE, "q_source": 2.0},
    {"dynamic_pressure": Q, "mach_number": MACH, "q_source": 3.0},
    {"dynamic_pressure": Q, "q_source": 3.0},
    {"dynamic_pressure": Q, "q_source": 2.0, "dynamic_pressure_std": 0.01 * Q},
    {
        "dynamic_pressure": Q,
        "mach_number": MACH,
        "static_pressure": PRESSURE,
        "mach_number_std": 0.02,
        "static_pressure_std": 0.01 * PRESSURE,
        "q_source": 2.0,
    },
    {"dynamic_pressure": Q, "mach_number": MACH, "static_pressure": 0.93 * PRESSURE, "altitude": ALTITUDE},
]


@pytest.mark.parametrize("given", GIVEN, ids=range(len(GIVEN)))
def test_the_core_takes_a_computed_pressure_out_as_the_reference_does(given: dict[str, float]) -> None:
    """Equal to the estimate, q_inf independent, of what the reference leaves of the air data."""
    left = joined(**given)
    names = ("mach_number", "static_pressure", "dynamic_pressure")
    stated = {name: value for name, value in zip(names, left.value, strict=True) if np.isfinite(value)}
    stated |= {f"{name}_std": std for name, std in zip(names, left.std, strict=True) if np.isfinite(std)}
    found, expected = estimated(**given), estimated(**stated, q_source=QSource.INDEPENDENT)
    np.testing.assert_allclose(found.loads, expected.loads, rtol=1e-9)
    np.testing.assert_allclose(found.air_data.std, expected.air_data.std, rtol=1e-9)
    assert found.health == expected.health
    assert found.air_data_used.tolist() == expected.air_data_used.tolist()


@pytest.mark.parametrize("given", GIVEN, ids=range(len(GIVEN)))
def test_a_linear_map_takes_the_deviation_of_the_sources(given: dict[str, float]) -> None:
    found = estimated(estimator=LINEAR, **given)
    q = given["dynamic_pressure"]
    stated = {"dynamic_pressure_std": of_linear(**given) * q, "q_source": QSource.INDEPENDENT}
    expected = estimated(estimator=LINEAR, **{**given, **stated})
    np.testing.assert_allclose(found.coefficients_std, expected.coefficients_std, rtol=1e-9)


@pytest.mark.parametrize("off", [1.0, 1.0005, 1.05])
def test_a_pressure_of_unstated_source_counts_as_computed(off: float) -> None:
    """Whatever its value: rounded, late, or of another formula. Without a Mach number it is a measurement."""
    given = {"dynamic_pressure": off * Q, "mach_number": MACH, "static_pressure": PRESSURE}
    assert np.isnan(joined(**given).value[2])
    found = estimated(**given)
    assert not found.air_data_used[2]
    without = {name: value for name, value in given.items() if name != "dynamic_pressure"}
    np.testing.assert_allclose(found.air_data.value[5], PRESSURE, rtol=0.02)
    assert found.air_data.std[6] >= estimated(**without).air_data.std[6]
    assert estimated(**given, q_source="INDEPENDENT").air_data_used[2]
    assert estimated(dynamic_pressure=Q).air_data_used[2]


def test_nothing_confirms_what_it_is_computed_from() -> None:
    """The Mach number has the deviation of the day, unless its own is stated; so has a linear map's q_inf."""
    left = joined(dynamic_pressure=Q, mach_number=MACH, static_pressure=PRESSURE)
    manifold = whole_map().manifold
    assert manifold is not None
    assert left.std[0] == pytest.approx(np.hypot(manifold.mach_number_error, DAY_OF_MACH * MACH))
    assert joined(dynamic_pressure=Q, mach_number=MACH, static_pressure=PRESSURE, mach_number_std=0.01).std[0] == (
        pytest.approx(0.01)
    )
    assert of_linear(dynamic_pressure=Q, mach_number=MACH, altitude=ALTITUDE) == pytest.approx(
        np.hypot(0.05, 0.07)
    )


def test_sources_by_name_and_number() -> None:
    given = {"dynamic_pressure": 1.05 * Q, "mach_number": MACH, "static_pressure": PRESSURE}
    found = [estimated(**given, q_source=source).loads for source in ("mach_and_pressure", 2, QSource(2), [2.0])]
    for one in found[1:]:
        np.testing.assert_array_equal(one, found[0])
    for wrong in ("sideslip", 4, 1.5, -1):
        with pytest.raises(InputError, match="q_source: expected"):
            estimated(**given, q_source=wrong)


def test_angles_inform_and_contradict() -> None:
    """Both angles as u and w; the deviation falls where strain says little, and a mirror image is detected."""
    alpha, beta = np.arctan2(U, 1.0), -np.arcsin(np.sin(np.hypot(U, W)) * W / np.hypot(U, W))
    air = {name: np.array([np.nan]) for name in AIR_INPUT_NAMES}
    air |= {"measured_angle_of_attack": np.array([alpha]), "measured_sideslip_angle": np.array([beta])}
    np.testing.assert_allclose(measured_directions(air)[0][0], [U, W], atol=2e-4)
    few = np.arange(N_D) < 4
    known = {"mach_number": MACH, "static_pressure": PRESSURE}
    angles = {"measured_angle_of_attack": alpha, "measured_sideslip_angle": beta}
    without, given = (NONLINEAR.estimate(STRAIN, valid=few, **known, **more) for more in ({}, angles))
    assert (given.air_data.std[:2] <= without.air_data.std[:2]).all()
    assert given.air_data.std[0] < np.radians(1.001)
    assert estimated(**known, **angles).health == HealthState.OK
    large = exact_response(MACH, 0.1, 0.0, PRESSURE)[:N_D]
    mirrored = {"measured_angle_of_attack": -0.1, "measured_sideslip_angle": 0.0}
    assert estimated(large, **known, measured_angle_of_attack=0.1).health == HealthState.OK
    for found in (
        estimated(large, **known, **mirrored),
        estimated(large, **known, measured_angle_of_attack=-0.1),
        NONLINEAR.filter(1.0).track(large, time=0.0, **known, **mirrored)
        if whole_map().manifold is None
        else NONLINEAR.track(large, **known, **mirrored),
    ):
        assert found.health == HealthState.INCONSISTENT
        assert not found.usable
    wide = {"measured_angle_of_attack": -0.1, "measured_angle_of_attack_std": 0.2}
    assert estimated(large, **known, **wide).health == HealthState.OK


def test_a_linear_map_compares_angles_with_the_lateral_force() -> None:
    """For full symmetry alone: elsewhere the lateral force need not be 0 without incidence."""
    held = LINEAR.inverse_map
    stated = {**held.provenance, "symmetry": "full", "total_incidence_deg": [0.0, 10.0]}
    full = Estimator(replace(held, provenance=stated))
    assert full.estimate(STRAIN, Q).coefficients[1] > 0.0
    listed = Estimator(replace(held, provenance={**stated, "symmetry": "listed"}))
    for size, estimator, expected in ((0.2, full, False), (-0.2, full, True), (-0.2, listed, False)):
        found = estimator.estimate(STRAIN, Q, measured_angle_of_attack=size, measured_sideslip_angle=0.0)
        without = estimator.estimate(STRAIN, Q)
        np.testing.assert_array_equal(found.coefficients, without.coefficients)
        assert (found.health == HealthState.INCONSISTENT) is (
            expected or without.health == HealthState.INCONSISTENT
        )


def test_usable_follows_from_health() -> None:
    assert {state for state in HealthState if state.usable} == set(USABLE_STATES)
    good, bad = estimated(dynamic_pressure=Q), estimated(3.0 * STRAIN[::-1], dynamic_pressure=Q)
    lost = estimated(np.full(N_D, np.nan), dynamic_pressure=Q)
    assert good.usable
    for found in (good, bad, lost):
        assert found.usable is found.health.usable
    series = NONLINEAR.estimate(np.stack([STRAIN, 3.0 * STRAIN[::-1]]), Q)
    assert series.usable.tolist() == [good.usable, bad.usable]
