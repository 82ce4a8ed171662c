"""Errors that a calibration takes for zero: named with their size where they are there, not where they are not."""

import numpy as np
import pytest
from drawn_tests import blank_test

from builder.calibration.estimate.causes import freed
from builder.calibration.estimate.estimated_vehicle import Estimate, estimate, usable
from builder.calibration.estimate.outside_terms import NOISE, OutsideKind, outside_model
from builder.calibration.estimate.readings_model import Cause, ReadingsModel
from builder.calibration.ground_test.load_test import LoadErrors
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import AsBuilt, as_built_std, draw_as_built
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray

STATED = 0.05e-6
ERRORS = LoadErrors(common=0.002)
REGION = 2


@pytest.fixture(scope="module")
def prior(vehicle: Vehicle, as_built: AsBuiltStructure) -> AsBuilt:
    return as_built_std(vehicle.calibration, as_built.counts)


@pytest.fixture(scope="module")
def blank(as_built: AsBuiltStructure, prior: AsBuilt) -> ReadingsModel:
    """A test of six pads and four attitudes without readings."""
    return ReadingsModel(as_built, blank_test(as_built.gauges.names, ERRORS, STATED, 6), prior)


def calibrated(blank: ReadingsModel, seed: int, noise: float = 1.0, **wall: FloatArray) -> Estimate:
    """Return the estimate of a vehicle drawn at random but for its ``wall``; ``noise`` is over what is stated."""
    random = np.random.default_rng(seed)
    vector = np.zeros(len(blank.std))
    own = slice(blank.entries["direction"][0])  # what all cases have in common is zero
    vector[own] = blank.std[own] * random.standard_normal(own.stop)
    vector[: blank.n_built] = draw_as_built(blank.prior, random).changed(**wall).vector
    reading = blank.readings(vector)
    found = blank.with_readings(reading + noise * STATED * random.standard_normal(reading.shape))
    return estimate(found, usable(found))


def kinds_of(found: Estimate) -> dict[str, OutsideKind]:
    return {one.kind: one for one in outside_model(found).kinds}


def test_a_larger_load_shows_more_of_what_is_taken_for_zero(blank: ReadingsModel) -> None:
    vector = np.zeros(len(blank.std))
    stated = blank.held_derivatives(vector)
    vector[blank.entries["load"]] = 0.1
    assert stated
    for key, found in blank.held_derivatives(vector).items():
        np.testing.assert_allclose(found, 1.1 * stated[key], rtol=1e-12, err_msg=str(key))


def test_sound_vehicles_are_said_to_be_sound(blank: ReadingsModel) -> None:
    chance = []
    for seed in (0, 1, 2):
        model = outside_model(calibrated(blank, seed))
        assert model.found == ()
        assert model.lines == ()
        assert model.noise_factor == pytest.approx(1.0, abs=0.1)
        chance += [one.chance for one in model.kinds]
    assert 0.2 < np.mean(chance) < 0.8  # uniform between 0 and 1


def test_a_second_harmonic_is_named_with_its_size(blank: ReadingsModel) -> None:
    wave = 0.02 * (np.arange(blank.structure.n_regions) == REGION)
    found = calibrated(blank, 1, wall_second_cosine=0.6 * wave, wall_second_sine=0.8 * wave)
    model = outside_model(found)
    assert [one.kind for one in model.found] == ["second harmonic"]
    term = model.found[0].terms[REGION]
    assert abs(term.size - 0.02) < 4.0 * term.std
    assert term.size > 5.0 * term.std
    assert term.crest == pytest.approx(0.5 * np.arctan2(0.8, 0.6), abs=0.25)
    assert "second harmonic in region 3: " in model.lines[0]
    assert not any(f"region {k + 1}:" in line for line in model.lines for k in range(4) if k != REGION)
    assert "calibration.wall_second_harmonic_percent = " in model.lines[-1]


def test_a_taper_is_named_and_not_taken_for_another_error(blank: ReadingsModel) -> None:
    taper = np.array([0.02, -0.02, 0.02, 0.02])
    model = outside_model(calibrated(blank, 2, wall_taper=taper))
    (kind,) = model.found
    assert kind.kind == "taper"
    for term, size in zip(kind.terms, taper, strict=True):
        assert abs(term.size - size) < 4.0 * term.std
    assert model.noise_factor == pytest.approx(1.0, abs=0.1)


def test_noise_larger_than_stated_is_not_taken_for_a_wall(blank: ReadingsModel) -> None:
    model = outside_model(calibrated(blank, 4, noise=4.0))
    assert [one.kind for one in model.found] == [NOISE]
    assert model.noise_factor == pytest.approx(4.0, rel=0.1)
    assert f"scatter {model.noise_factor:.2g} times as much as stated" in model.lines[0]


def test_noise_is_said_over_what_the_file_states(blank: ReadingsModel) -> None:
    """What the estimate counts with already is part of it."""
    found = calibrated(blank, 4, noise=4.0)
    cause = Cause(where="noise", kind="noise", entries=np.zeros(0, dtype=np.int64), wide=np.zeros(0), factor=2.0)
    counting = estimate(freed(found.model, cause), found.used, start=found.vector)
    model = outside_model(counting)
    assert model.noise_factor == pytest.approx(2.0, rel=0.1)
    assert model.over_stated == pytest.approx(4.0, rel=0.1)
    assert f"scatter {model.over_stated:.2g} times as much as stated" in model.lines[0]


def test_what_the_file_sets_free_is_estimated(blank: ReadingsModel, prior: AsBuilt) -> None:
    n_r = prior.n_regions
    free = prior.changed(wall_second_cosine=np.full(n_r, 0.02), wall_second_sine=np.full(n_r, 0.02))
    wider = ReadingsModel(blank.structure, blank.test, free)
    wave = 0.02 * (np.arange(n_r) == REGION)
    found = calibrated(wider, 1, wall_second_cosine=wave, wall_second_sine=np.zeros(n_r))
    assert set(kinds_of(found)) == {"taper", NOISE}
    assert outside_model(found).found == ()
    at = wider.names.index(f"wall second cosine region {REGION + 1}")
    assert abs(found.vector[at] - 0.02) < 4.0 * found.std[at] < 0.02
    assert 0.85 < found.per_reading < 1.15


def test_nothing_is_taken_for_zero_but_the_noise(blank: ReadingsModel, prior: AsBuilt) -> None:
    some = np.full(prior.n_regions, 0.01)
    free = prior.changed(wall_taper=some, wall_second_cosine=some, wall_second_sine=some)
    found = calibrated(ReadingsModel(blank.structure, blank.test, free), 4)
    assert set(kinds_of(found)) == {NOISE}
    assert outside_model(found).found == ()
