"""Kinds of error: how many, how they are told apart, and that their class follows from what a vehicle states."""

from __future__ import annotations

from math import degrees, radians

import numpy as np
import pytest

from builder.stress.flights import altitude_is_inside, mirrored_is_inside, stress_knots
from builder.stress.flows import solved_knots
from builder.stress.gauge_kinds import added, frozen, lost, scaled, swapped
from builder.stress.hardware_kinds import stated_class, stated_kinds
from builder.stress.kind import Hardware, exact
from builder.stress.kinds import all_kinds
from builder.structure.as_built.vehicle import Counts
from builder.structure.as_built_kinds import ALWAYS_DRAWN, IN_NOISE
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.map.options import HARDWARE_ERRORS, Noise

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def shipped() -> Vehicle:
    return load_vehicle(IC3X)


@pytest.fixture(scope="module")
def hardware(shipped: Vehicle) -> Hardware:
    n = 6
    return Hardware(
        noise=shipped.noise,
        station=np.linspace(0.5, 3.0, n),
        roll_angle=np.zeros(n),
        noise_std=np.full(n, 1e-7),
        counts=Counts(gauge=n),
    )


def test_there_are_many_and_each_is_another(shipped: Vehicle) -> None:
    kinds = all_kinds(shipped)
    assert len(kinds) >= 34
    assert len({(kind.error, kind.size) for kind in kinds}) == len(kinds)
    assert {kind.group for kind in kinds} == {"within", "outside", "unobservable"}


def test_every_stated_error_is_tried_alone() -> None:
    assert {one.noise for one in IN_NOISE} == set(HARDWARE_ERRORS)


def test_what_is_not_stated_is_not_tried_at_twice_its_size() -> None:
    noise = Noise(std_um_per_m=1.0, wall_thickness_percent=0.0)
    assert len(stated_kinds(noise)) == len(ALWAYS_DRAWN) - 1  # nor are kinds that are 0 by default
    turned = Noise(std_um_per_m=1.0, row_orientation_deg=1.5)
    assert [(one.error, one.size) for one in stated_kinds(turned)[-1:]] == [
        ("orientation of each row of gauges", "+-3 deg")
    ]
    soft = Noise(std_um_per_m=1.0, clamp_compliance_mm=2.0)
    assert [one.size for one in stated_kinds(soft)[-2:]] == ["+-4 mm", "+-4 mm"]
    assert stated_kinds(Noise(std_um_per_m=1.0, model="paper")) == []


def test_the_class_follows_from_the_stated_size() -> None:
    assert stated_class(0.02, 0.01) == "within"
    assert stated_class(-0.02, 0.01) == "within"
    assert stated_class(0.021, 0.01) == "outside"
    assert stated_class(0.01, 0.0) == "outside"


def test_the_class_of_a_flight_follows_from_the_map(shipped: Vehicle) -> None:
    listed, absolute = (
        shipped.model_copy(update={"map": shipped.map.model_copy(update={"estimator": "linear", **entry})})
        for entry in ({"symmetry": "listed"}, {"form": "absolute"})
    )
    assert mirrored_is_inside(shipped)
    assert not mirrored_is_inside(listed)
    assert altitude_is_inside(shipped, 12e3)
    assert not altitude_is_inside(absolute, 12e3)


def test_the_knots_go_beyond_the_envelope(shipped: Vehicle) -> None:
    mach, incidence = stress_knots(shipped)
    assert mach[0] == pytest.approx(0.78 * 5.0)
    assert mach[-1] == pytest.approx(1.22 * 7.0)
    largest = np.arccos(np.cos(radians(10.0)) ** 2)
    assert degrees(incidence[-1]) == pytest.approx(1.3 * degrees(largest))
    assert np.all(incidence > 0.0)


def test_knots_that_were_not_solved_are_left_out() -> None:
    solved = np.ones((4, 5), dtype=bool)
    solved[0, 1:] = False
    solved[1, 4] = False
    rows, columns = solved_knots(solved)
    assert rows.tolist() == [False, True, True, True]
    assert columns.tolist() == [True, True, True, True, False]
    solved[2, 2] = False
    rows, columns = solved_knots(solved)
    assert solved[np.ix_(rows, columns)].all()
    assert rows.sum() >= 2
    rows, columns = solved_knots(np.zeros((2, 2), dtype=bool))
    assert rows.sum() * columns.sum() == 0


def test_readings_change_as_they_say(hardware: Hardware) -> None:
    random = np.random.default_rng(1)
    d, wind = random.standard_normal((8, 6)), np.zeros((8, 1))
    found = added(3, 2.0)(d, wind, hardware, random) - d
    assert sorted(np.round(found[0], 12).tolist()) == [0.0, 0.0, 0.0, 2.0, 2.0, 2.0]
    assert np.count_nonzero(np.all(scaled(1, -1.0)(d, wind, hardware, random) == -d, axis=0)) == 1
    np.testing.assert_array_equal(scaled(None, 1e3)(d, wind, hardware, random), 1e3 * d)
    held = frozen(2)(d, wind, hardware, random)
    assert np.count_nonzero(np.ptp(held, axis=0) == 0.0) == 2
    assert np.count_nonzero(np.isnan(lost(3)(d, wind, hardware, random)[0])) == 3
    exchanged = swapped(d, wind, hardware, random)
    np.testing.assert_array_equal(np.sort(exchanged, axis=1), np.sort(d, axis=1))
    assert np.count_nonzero(np.any(exchanged != d, axis=0)) == 2


def test_a_stated_error_is_built_at_twice_its_size(hardware: Hardware) -> None:
    random = np.random.default_rng(2)
    stated = [one for one in IN_NOISE if getattr(hardware.noise, one.noise) > 0.0]
    for one, kind in zip(stated, stated_kinds(hardware.noise), strict=True):
        built = kind.build(hardware, random)
        size = 2.0 * getattr(hardware.noise, one.noise) * one.scale
        np.testing.assert_allclose(np.abs(getattr(built, one.name)), size)
        clean = exact(hardware, random)
        others = built.changed(**{one.name: getattr(clean, one.name)})
        for entry in ("gauge_gain", "orientation", "wall_thickness", "dynamic_pressure", "apparent_strain"):
            np.testing.assert_array_equal(getattr(others, entry), 0.0)
