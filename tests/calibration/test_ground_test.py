"""PlannedCase load cases, loads as they are applied, and a simulated test: what is written reads back."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from builder.calibration.ground_test.candidate_cases import (
    LoadLimits,
    PlannedCase,
    attitude_cases,
    candidate_cases,
)
from builder.calibration.ground_test.ground_test_readings import read_load_test
from builder.calibration.ground_test.load_changes import moved, scaled, tilted
from builder.calibration.ground_test.load_test import KnownLoad, LoadErrors
from builder.calibration.ground_test.load_test_file import read_test_file
from builder.calibration.score.simulated_test import (
    CellErrors,
    as_applied,
    simulate_ground_test,
    write_ground_test,
)
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import BuiltStructure
from builder.structure.loads.applied import Load, PadForce, PadPressure, PointForce, SurfacePressure, Weight
from builder.vehicle.file import IC3X, load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

NAMES = tuple(f"g{k}" for k in range(20))
EXACT = LoadErrors(load=0.0, common=0.0, pad_position=0.0, pad_roll=0.0, pad_shape=0.0)


class SimpleStructure(BuiltStructure):
    """A structure whose gauges read 1 um/m per 10 N on a pad, times their number, and their zeros."""

    gauges = SimpleNamespace(names=NAMES)

    def reading(self, parameters: Any, loads: list[Load]) -> FloatArray:
        push = sum(load.push for load in loads if isinstance(load, PadPressure))
        return 1e-7 * push * np.arange(1.0, len(NAMES) + 1.0) + parameters.zero


PARAMETERS = SimpleNamespace(zero=np.linspace(-5e-5, 5e-5, len(NAMES)))
PAD = PadPressure(station=1.0, roll_angle=0.5, half_length=0.05, half_angle=0.5, push=100.0)
CASES = (
    PlannedCase(name="weight", loads=(Weight(),)),
    PlannedCase(name="one", loads=(Weight(), PAD)),
    PlannedCase(name="two", loads=(Weight(), replace(PAD, push=200.0))),
)


def simulated(errors: LoadErrors = EXACT, noise: float = 0.0) -> Any:
    structure = cast(AsBuiltStructure, SimpleStructure())
    std, random = np.full(len(NAMES), noise), np.random.default_rng(4)
    return simulate_ground_test(structure, cast(Any, PARAMETERS), CASES, errors, std, random=random)


def test_written_test_reads_back(tmp_path: Path) -> None:
    """Recording, channels and cases; the readings are known as well as 25 samples tell."""
    test = simulated(LoadErrors(load=0.003), noise=2e-7)
    path = write_ground_test(test, tmp_path, "bench")
    found, notes = read_load_test(read_test_file(path), NAMES)
    assert notes == ()
    assert [case.name for case in found.cases] == ["weight", "one", "two"]
    np.testing.assert_allclose(found.readings, test.strain.mean(axis=1), atol=1e-10)
    np.testing.assert_allclose(found.reading_stds, 2e-7 / 5.0, rtol=0.35)
    pad = found.cases[2].loads[1]
    assert vars(pad.load) == pytest.approx(vars(replace(PAD, push=200.0)))
    assert (pad.std, pad.on_load_cell) == (pytest.approx(0.003), True)
    assert (found.cases[2].loads[0].std, found.cases[2].loads[0].on_load_cell) == (0.0, False)


def test_steps_and_check_loads_are_recorded_and_read_back(tmp_path: Path) -> None:
    structure = cast(AsBuiltStructure, SimpleStructure())
    std, random = np.full(len(NAMES), 2e-7), np.random.default_rng(4)
    plan = {"loading": (0.0, 0.5), "checks": ("two",)}
    test = simulate_ground_test(
        structure, cast(Any, PARAMETERS), CASES, EXACT, std, random=random, **cast(Any, plan)
    )
    found, notes = read_load_test(read_test_file(write_ground_test(test, tmp_path, "bench")), NAMES)
    assert notes == ()
    assert found.fitted.tolist() == [True, True, False]
    assert [len(case.steps) for case in found.cases] == [0, 4, 4]
    assert [(one.part, one.unloading) for one in found.cases[1].steps] == [
        (0.0, False),
        (0.5, False),
        (0.5, True),
        (0.0, True),
    ]
    for case in found.cases[1:]:
        whole = case.reading - PARAMETERS.zero
        for step in case.steps:
            np.testing.assert_allclose(step.reading - PARAMETERS.zero, step.part * whole, atol=3e-7)


def test_test_without_errors_reads_the_stated_loads() -> None:
    mean = simulated().strain.mean(axis=1) - PARAMETERS.zero
    np.testing.assert_allclose(mean, np.outer([0.0, 1e-5, 2e-5], np.arange(1.0, 21.0)), atol=1e-18)


def test_drawn_errors_have_their_sizes() -> None:
    """Size, place and length of a pad scatter as stated; the load cell's error is in every case alike."""
    random, errors = np.random.default_rng(5), LoadErrors()
    known = KnownLoad(load=PAD, std=0.01)
    cell = CellErrors(gain=0.02)
    drawn = cast("list[PadPressure]", [as_applied(known, errors, cell, random) for _ in range(2000)])
    push = np.array([one.push for one in drawn]) / PAD.push
    assert push.mean() == pytest.approx(1.02, abs=1e-3)
    assert push.std() == pytest.approx(0.0102, rel=0.06)
    assert np.std([one.station for one in drawn]) == pytest.approx(0.002, rel=0.06)
    assert np.std([one.roll_angle for one in drawn]) == pytest.approx(np.deg2rad(0.3), rel=0.06)
    assert np.std([one.half_length for one in drawn]) == pytest.approx(0.005, rel=0.06)
    off_cell = as_applied(KnownLoad(load=Weight(), on_load_cell=False), errors, cell, random)
    assert off_cell == Weight()


def test_moved_pads_keep_their_force_and_other_loads_stay() -> None:
    pad = PadForce(station=1.0, roll_angle=0.0, half_length=0.05, half_angle=0.5, force=(3.0, 0.0, -10.0))
    other = cast(PadForce, moved(pad, along=0.1, around=0.2, longer=0.5))
    assert vars(other) == pytest.approx({**vars(pad), "station": 1.1, "roll_angle": 0.2, "half_length": 0.075})
    assert moved(Weight(), along=0.1) == Weight()
    assert scaled(SurfacePressure(surface="inner", pressure=10.0), 2.0) == SurfacePressure(
        surface="inner", pressure=20.0
    )


def test_a_load_cell_off_by_newtons_counts_by_the_force_it_reads() -> None:
    exact = LoadErrors(load=0.0, pad_position=0.0, pad_roll=0.0, pad_shape=0.0, tilt=0.0)
    random, cell = np.random.default_rng(1), CellErrors(gain=0.01, offset=4.0)
    pushed = cast(PadPressure, as_applied(KnownLoad(load=replace(PAD, push=200.0)), exact, cell, random))
    assert pushed.push == pytest.approx(200.0 * 1.01 + 4.0)
    inside = KnownLoad(load=SurfacePressure(surface="inner", pressure=1e5))
    assert cast(SurfacePressure, as_applied(inside, exact, cell, random)).pressure == pytest.approx(1.01e5)


def test_forces_are_turned_about_both_axes_across_them() -> None:
    """By the stated size each, without a change of the force; a pad that presses along the normal is not."""
    point = PointForce(station=1.0, roll_angle=0.0, force=(0.0, 30.0, -40.0))
    errors, random = LoadErrors(), np.random.default_rng(2)
    applied = [as_applied(KnownLoad(load=point), errors, CellErrors(), random) for _ in range(2000)]
    force = np.array([cast(PointForce, one).force for one in applied])
    np.testing.assert_allclose(np.linalg.norm(force, axis=1), 50.0, rtol=1e-12)
    across = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, 0.6]])
    np.testing.assert_allclose((force @ across.T).std(axis=0) / 50.0, np.deg2rad(1.0), rtol=0.06)
    assert np.std([cast(PointForce, one).station for one in applied]) == pytest.approx(0.002, rel=0.06)
    assert tilted(PAD, 0.1, 0.1) is PAD
    assert tilted(Weight(), 0.1) == Weight()


def test_candidates_are_pads_in_all_directions_and_what_else_the_rig_can_do() -> None:
    vehicle = load_vehicle(IC3X)
    limits = LoadLimits(
        stations=(0.5, 2.0),
        roll_angles=(0.0, np.pi / 2),
        directions=("in", "out", "around"),
        internal_pressure=1e5,
        axial_force=5e3,
    )
    found = {case.name: case.loads for case in candidate_cases(vehicle, limits, (0.0, vehicle.body().length))}
    assert len(found) == 2 * 2 * 3 + 2
    out = cast(PadForce, found["out 2 m, 90 deg"][0])
    np.testing.assert_allclose(out.force, [0.0, 1500.0, 0.0], atol=1e-9)
    around = cast(PadForce, found["around 2 m, 90 deg"][0])
    np.testing.assert_allclose(around.force, [0.0, 0.0, -1500.0], atol=1e-9)
    assert {"axial 5000 N", "pressure 100 kPa"} <= set(found)
    assert [case.name for case in attitude_cases(LoadLimits())][1] == "weight, 90 deg up"


@pytest.mark.parametrize(
    ("limits", "line"),
    [
        ({"stations": (0.05,)}, r"--stations: expected 0\.2 \.\. 3\.5 m, where pads fit, got 0\.05"),
        ({"force": 0.0}, r"expected --force, --axial or --pressure above 0"),
        ({"half_length": 2.0}, r"--pad-length: expected pads shorter than the wall"),
    ],
)
def test_limits_that_leave_nothing_are_refused(limits: dict[str, Any], line: str) -> None:
    shipped = load_vehicle(IC3X)
    with pytest.raises(InputError, match=line):
        candidate_cases(shipped, LoadLimits(**limits), (0.0, shipped.body().length))


def test_unknown_direction_is_refused() -> None:
    with pytest.raises(InputError, match=r"--directions: expected some of in, out, axial, around, got 'up'"):
        LoadLimits(directions=("up",))
