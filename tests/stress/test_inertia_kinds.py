"""Kinds of error by inertia on a coarse vehicle: what a section [mass] and an inertial unit cure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from builder.pipeline.chosen_estimator import with_estimator
from builder.stress.inertia_kinds import inertia_kinds
from builder.stress.kind import Kind
from builder.stress.kinds import all_kinds
from builder.stress.run import check_fit
from builder.stress.score import Range
from builder.vehicle.structure.mass import Mass
from strainfmu.errors import InputError

ERRORS = (
    "inertia of the masses",
    "inertia of the masses, inertial unit",
    "inertia of a mass that is not listed",
    "inertia of a mass that is not listed, inertial unit",
    "vibration",
    "vibration, stated",
)


def kind_of(trial: Range, error: str) -> Kind:
    return next(kind for kind in all_kinds(trial.vehicle) if kind.error == error)


@pytest.mark.parametrize("error", ERRORS)
def test_what_the_file_states_is_within(heavy_trial: Range, error: str) -> None:
    kind = kind_of(heavy_trial, error)
    assert kind.group == "within"
    assert heavy_trial.score(kind).missed == ()


def test_a_map_without_masses_errs_and_does_not_show_it(trial: Range, heavy_trial: Range) -> None:
    manoeuvre = kind_of(heavy_trial, ERRORS[0])
    assert trial.score(manoeuvre).score.undetected > 0.2


@pytest.mark.parametrize("error", [ERRORS[0], ERRORS[2], ERRORS[4]])
def test_the_nonlinear_estimator_expects_manoeuvres(nonlinear_trial: Range, error: str) -> None:
    kind = kind_of(nonlinear_trial, error)
    assert nonlinear_trial.score(kind).missed == ()
    without = replace(nonlinear_trial.inverse_map.manifold, considered_strain=None)
    blind = Range(
        vehicle=nonlinear_trial.vehicle,
        model=nonlinear_trial.model,
        inverse_map=replace(nonlinear_trial.inverse_map, manifold=without),
        effort=nonlinear_trial.effort,
    )
    assert blind.score(kind).score.undetected > 0.02


def test_the_inertial_unit_sharpens(heavy_trial: Range) -> None:
    without, measured = (heavy_trial.score(kind_of(heavy_trial, error)).score for error in ERRORS[:2])
    assert measured.rms[1] < 0.2 * without.rms[1]
    assert measured.coverage_3[1] > 0.99


def test_vibration_that_is_stated_shows_in_health(heavy_trial: Range) -> None:
    found = heavy_trial.score(kind_of(heavy_trial, "vibration, stated")).score
    assert found.health["DEGRADED"] > 0.99
    assert heavy_trial.score(kind_of(heavy_trial, "vibration")).score.health.get("DEGRADED", 0.0) == 0.0


def test_the_class_follows_from_the_file(trial: Range) -> None:
    assert [kind.group for kind in inertia_kinds(trial.vehicle)] == 3 * ["unobservable"]
    nonlinear = with_estimator(trial.vehicle, "nonlinear")
    assert [kind.group for kind in inertia_kinds(nonlinear)] == ["within", "outside", "outside"]
    weak = trial.vehicle.model_copy(update={"mass": Mass(lateral_g=1.0, vibration_um_per_m=1.0)})
    assert [kind.group for kind in inertia_kinds(weak)] == ["outside", "within", *(3 * ["outside"]), "within"]


def test_a_map_of_the_vehicle_without_masses_is_refused(trial: Range, heavy_trial: Range) -> None:
    path = Path("map.h5")
    check_fit(heavy_trial.vehicle, heavy_trial.inverse_map, path)
    with pytest.raises(InputError, match=r"map\.h5: expected a map with masses as the vehicle file has them"):
        check_fit(heavy_trial.vehicle, trial.inverse_map, path)
    with pytest.raises(InputError, match=r"map\.h5: expected a map without masses"):
        check_fit(trial.vehicle, heavy_trial.inverse_map, path)


def test_the_unit_reads_the_load_factor(heavy_trial: Range) -> None:
    unit = kind_of(heavy_trial, ERRORS[1])
    conditions = heavy_trial.flights(unit).conditions
    assert unit.air_data is not None
    known = unit.air_data.known(conditions, heavy_trial.vehicle.noise, np.random.default_rng(1))
    lateral = np.hypot(known["specific_force_y"], known["specific_force_z"])
    assert lateral == pytest.approx(5.0 * 9.80665, abs=0.6)
