"""The pressure on the unrolled body: from a result of the bridge, off its cycle, to the monitor's state."""

import json
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from deflected_shape import NAME, known_map
from field_maps import N_D, N_ROLL, X, exact_pressure, field_map
from flight_maps import exact_response
from page_results import altered
from shape_case import shape_map
from synthetic_vehicle import SyntheticFiles
from thermal_maps import REFERENCE, with_temperature

from strainfmu.can.machine import Result
from strainfmu.can.page_message import FIELD_PERIOD, FieldMessages, GaugePosition, field_messages
from strainfmu.can.publisher import Publisher
from strainfmu.can.quality import Cause, FrameAccount, Quality
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.estimator.map.nonlinear_map import with_known
from strainfmu.estimator.outer_surface import outermost_places
from strainfmu.interface.sensor_variables import temperature_names
from strainfmu.monitor.message import parsed
from strainfmu.monitor.server import Monitor
from strainfmu.monitor.state import MonitorState

pytestmark = pytest.mark.fast
STATE = (6.0, 0.06, 0.03, 5474.9)


def cycle(quality: Quality = Quality.VALID) -> Result:
    strain = exact_response(*STATE)[:N_D]
    strain[4] = np.nan
    return Result(
        time=1.0,
        quality=quality,
        causes=Cause.NONE,
        valid=np.isfinite(strain),
        strain=strain,
        dynamic_pressure=0.7 * 36.0 * 5474.9,
        mach_number=6.0,
        altitude=20e3,
        health=0,
    )


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_message_is_the_pressure_of_the_strains() -> None:
    messages = FieldMessages(field_map())
    content = messages.message(cycle(), 5.0)["field"]
    assert content["x"] == X.tolist()
    assert len(content["roll_angle"]) == N_ROLL
    truth = exact_pressure(*STATE)
    assert np.max(np.abs(np.array(content["pressure_Pa"]) - truth)) < 0.02 * np.max(truth)
    assert messages.message(cycle(Quality.STALE), 5.0)["field"]["pressure_Pa"] == []


def test_any_shape_is_unrolled() -> None:
    """The pressure of the tables at the places that are seen from outside; the page takes the same message."""
    held = shape_map(keep_field=True)
    manifold = held.manifold
    assert manifold is not None
    state = np.array([6.5, 0.03, 0.0, np.log(4000.0)])  # leeward at the top
    strain = evaluate(manifold.tables, state[None]).value[0, : held.n_gauges]
    q = 0.7 * 6.5**2 * 4000.0
    sample = altered(cycle(), strain=strain, valid=np.ones(len(strain), bool), dynamic_pressure=q)
    found = FieldMessages(held).message(altered(sample, mach_number=6.5, altitude=math.nan), 5.0)
    field = found["field"]
    assert len(json.dumps(found)) < 60_000
    true = Estimator(held).step(strain, q, mach_number=6.5).pressure().pressure
    x, roll = np.array(field["x"]), np.radians(field["roll_angle"])
    seen = outermost_places(held.point, held.triangle, x[10:], roll)
    pressure = np.array(field["pressure_Pa"]).reshape(60, 36)
    np.testing.assert_allclose(pressure[10:], seen.of(true), rtol=2e-3)
    assert np.all(pressure[10:, 18] > 1.1 * pressure[10:, 0])


def test_a_known_deflection_is_in_the_pressure() -> None:
    """As in the estimator's own: with the deviation that the bus states, and without one."""
    held = known_map(keep_field=True)
    manifold = held.manifold
    assert manifold is not None
    state = np.array([6.5, 0.03, 0.01, np.log(4000.0)])
    at = with_known(manifold, np.array([3.0]), np.zeros(1))
    strain = evaluate(at.tables, state[None]).value[0, : held.n_gauges]
    q = 0.7 * 6.5**2 * 4000.0
    sample = altered(cycle(), strain=strain, valid=np.ones(len(strain), bool), dynamic_pressure=q)
    sample = altered(sample, mach_number=6.5, altitude=math.nan)
    places = FieldMessages(held)._seen
    for std in (0.05, math.nan):
        given = {f"parameter.{NAME}": 3.0, f"parameter_std.{NAME}": std}
        found = FieldMessages(held).message(altered(sample, other_inputs=given), 5.0)["field"]["pressure_Pa"]
        own = Estimator(held).step(strain, q, mach_number=6.5, parameters={NAME: 3.0}, parameters_std={NAME: std})
        expected = places.of(own.pressure(with_std=False).pressure).ravel()
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1.0)  # whole pascals
    blind = FieldMessages(held).message(sample, 5.0)["field"]["pressure_Pa"]
    np.testing.assert_array_equal(blind, found)


def test_navigation_of_a_mapping_is_in_the_pressure() -> None:
    """Static pressure and deviations, as the estimator of the bridge takes them."""
    given = {"static_pressure": 5500.0, "static_pressure_std": 5.0, "mach_number_std": 0.5}
    given["dynamic_pressure_std"] = 4e4
    sample = altered(cycle(), mach_number=6.4)
    found, without = (
        np.array(
            FieldMessages(field_map()).message(altered(sample, other_inputs=one), 5.0)["field"]["pressure_Pa"]
        )
        for one in (given, {})
    )
    own = Estimator(field_map()).step(
        sample.strain, sample.dynamic_pressure, mach_number=6.4, altitude=20e3, **given
    )
    np.testing.assert_allclose(found, own.pressure(with_std=False).pressure, rtol=0.0, atol=1.0)
    assert np.abs(found - without).max() > 3.0


def test_temperatures_are_in_the_pressure() -> None:
    held = with_temperature(field_map())
    sample, readings = cycle(), REFERENCE + np.array([40.0, 15.0, np.nan, 25.0])
    given = dict(zip(temperature_names(held.thermal), readings.tolist(), strict=True))
    found, cold = (
        np.array(FieldMessages(held).message(altered(sample, other_inputs=one), 5.0)["field"]["pressure_Pa"])
        for one in (given, {})
    )
    own = Estimator(held).step(
        sample.strain, sample.dynamic_pressure, mach_number=6.0, altitude=20e3, temperature=readings
    )
    np.testing.assert_allclose(found, own.pressure(with_std=False).pressure, rtol=2e-3)
    assert np.abs(found - cold).max() > 0.01 * cold.max()


def test_zeros_are_off_the_strains_of_the_pressure() -> None:
    """Those that the estimator takes off, from the next message on."""
    messages, untold, sample = FieldMessages(field_map()), FieldMessages(field_map()), cycle()
    expected = np.array(messages.message(sample, 5.0)["field"]["pressure_Pa"])
    zeros = GaugeZeros(value=np.linspace(-4e-5, 4e-5, N_D), std=np.zeros(N_D))
    with_zeros = altered(sample, strain=sample.strain + zeros.value)
    assert np.abs(untold.message(with_zeros, 5.0)["field"]["pressure_Pa"] - expected).max() > 50.0
    messages.set_zeros(zeros)
    found = messages.message(with_zeros, 5.0)["field"]["pressure_Pa"]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=2.0)


def test_maps_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    names = field_map().gauge_names
    save_inverse_map(field_map(), tmp_path / "map.h5")
    save_inverse_map(field_map(linear=True), tmp_path / "linear.h5")
    assert isinstance(field_messages(tmp_path / "map.h5", names), FieldMessages)
    with pytest.raises(InputError, match=r"map.h5: expected a map of the estimator's gauges"):
        field_messages(tmp_path / "map.h5", names[::-1])
    with pytest.raises(
        InputError, match=r"linear.h5: expected a map built with estimator = 'nonlinear' and keep_"
    ):
        field_messages(tmp_path / "linear.h5", names)


def test_pressure_alone_is_that_with_its_deviation() -> None:
    from strainfmu.estimator.estimator import Estimator

    for held in (field_map(), field_map(linear=True)):
        found = Estimator(held).estimate(np.atleast_2d(exact_response(*STATE)[:N_D]), 0.7 * 36.0 * 5474.9)[0]
        one, other = found.pressure(), found.pressure(with_std=False)
        np.testing.assert_allclose(other.pressure, one.pressure, rtol=1e-12)
        assert np.all(np.isnan(other.std))
        assert one.is_net == other.is_net


def test_publisher_sends_it_to_the_page() -> None:
    monitor = Monitor(("127.0.0.1", 0), ("127.0.0.1", 0))
    publisher = Publisher(
        monitor.listens_at,
        [GaugePosition(f"g{i}") for i in range(N_D)],
        rate=1e4,
        account=FrameAccount,
        field=FieldMessages(field_map()),
    )
    try:
        begin = time.monotonic()
        while time.monotonic() < begin + 1.05:
            publisher.result(cycle())
            time.sleep(0.005)
        until(lambda: monitor.state.fields >= 1)
        # Ten a second, however many results.
        assert monitor.state.fields <= (time.monotonic() - begin) / FIELD_PERIOD + 2.0
        content = json.loads(monitor.state.snapshot(time.monotonic()))
        assert len(content["field"]["pressure_Pa"]) == len(X) * N_ROLL
        assert content["field_units"]["pressure_Pa"] == "Pa"
        assert content["latest"]["quality_name"] == "VALID"
    finally:
        publisher.close()
        monitor.close()


@pytest.mark.parametrize(
    "content",
    [
        {"timestamp": 1.0, "x": [0.0, 1.0], "roll_angle": [0.0], "pressure_Pa": [1.0]},
        {"timestamp": 1.0, "x": [0.0], "roll_angle": [0.0], "pressure_Pa": [None]},
        {"timestamp": 1.0, "x": [0.0], "roll_angle": ["0"], "pressure_Pa": [1.0]},
        {"timestamp": 1.0, "x": [0.0], "roll_angle": [0.0]},
    ],
)
def test_damaged_field_is_refused(content: dict[str, object]) -> None:
    state = MonitorState()
    state.take(json.dumps({"field": content}).encode(), 1.0)
    assert (state.refused, state.fields) == (1, 0)


def test_page_gets_a_field_once() -> None:
    field = {"timestamp": 1.0, "x": [0.0], "roll_angle": [0.0, 180.0], "pressure_Pa": [1000, 2000]}
    datagram = json.dumps({"field": field}).encode()
    assert parsed(datagram)["field"]["pressure_Pa"] == [1000, 2000]
    state = MonitorState()
    state.take(datagram, 1.0)
    content, seen = state.news(1.0, None)
    assert json.loads(content)["field"] == field
    assert "field" not in json.loads(state.news(1.1, seen)[0])


def test_command_refuses_a_field_without_a_publisher(
    run: Callable[..., tuple[int, str, str]], synthetic: SyntheticFiles
) -> None:
    options = ["--interface", "virtual", "--channel", "field", "--set", f"page.field={synthetic.map_1}"]
    code, _, error = run("bridge", synthetic.estimator_1, *options)
    assert code != 0
    assert "--set: page.field: expected with page.publish, got it alone" in error
    code, _, error = run("bridge", synthetic.estimator_1, *options, "--set", "page.publish=127.0.0.1:9870")
    assert code != 0
    assert "expected a map built with estimator = 'nonlinear' and keep_field = true" in error
