"""Kinds of error of auxiliary sensors on a coarse vehicle, and of known flow parameters on an elliptic cone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from deflected_shape import DEFLECTIONS, NAME, deflected, known_map
from shape_case import flown, shape_vehicle
from shape_truth import beam

from builder.stress.kind import Kind
from builder.stress.kinds import all_kinds
from builder.stress.model import RevolvedModel, ShapeModel
from builder.stress.run import check_fit
from builder.stress.score import Effort, Range
from builder.stress.sensor_kinds import parameter_kinds, sensor_kinds
from builder.truth.shape.flights import at_conditions
from builder.vehicle.conditions.entries import FlowParameter
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError

EFFORT = Effort(conditions=20, draws=4)


def kind_of(vehicle: Vehicle, error: str, size: str) -> Kind:
    return next(kind for kind in all_kinds(vehicle) if (kind.error, kind.size) == (error, size))


def test_sensors_sharpen_and_are_honest(sensed_trial: Range, trial: Range) -> None:
    """With all errors drawn as stated 3 sigma holds, and sigma of C_N is smaller than by strain alone."""
    kind = kind_of(sensed_trial.vehicle, "auxiliary sensors", "drawn at their stated sizes")
    score = sensed_trial.score(kind)
    assert score.missed == ()
    assert score.score.undetected < 0.03
    std = [float(np.median(one.inverse_map.noise_std)) for one in (sensed_trial, trial)]
    assert std[0] == pytest.approx(std[1])
    assert sensed_trial.inverse_map.n_gauges == trial.inverse_map.n_gauges + 9


@pytest.mark.parametrize(
    ("error", "size", "flagged"),
    [
        ("nothing wrong", "vehicle of the file", 0.0),
        ("wall thinner over the middle third", "-5 %", 0.0),
        ("gain of one auxiliary sensor", "+20 %", 2.0),
        ("bias of one auxiliary sensor", "+20 sigma of its noise", 20.0),
        ("one auxiliary sensor frozen", "at another flight's reading", 40.0),
    ],
)
def test_an_error_of_one_sensor_is_flagged(sensed_trial: Range, error: str, size: str, flagged: float) -> None:
    score = sensed_trial.score(kind_of(sensed_trial.vehicle, error, size))
    assert score.missed == ()
    assert 100.0 * score.score.detected >= flagged


def test_a_lost_sensor_is_left_out(sensed_trial: Range) -> None:
    score = sensed_trial.score(kind_of(sensed_trial.vehicle, "one auxiliary sensor lost", "no reading"))
    assert score.score.health == {"DEGRADED": 1.0}
    assert score.score.undetected == 0.0
    lost = sensed_trial.score(kind_of(sensed_trial.vehicle, "three gauges lost", "no reading"))
    assert lost.score.health == {"DEGRADED": 1.0}


def test_a_map_without_the_sensors_is_refused(sensed_trial: Range, trial: Range) -> None:
    check_fit(sensed_trial.vehicle, sensed_trial.inverse_map, Path("m.h5"))
    with pytest.raises(InputError, match=r"m.h5: expected the 9 auxiliary sensors .*, got 0: none"):
        check_fit(sensed_trial.vehicle, trial.inverse_map, Path("m.h5"))
    with pytest.raises(InputError, match=r"expected the 0 auxiliary sensors .*, got 9: port_0deg"):
        check_fit(trial.vehicle, sensed_trial.inverse_map, Path("m.h5"))
    assert isinstance(trial.model, RevolvedModel)
    assert sensor_kinds(trial.vehicle) == parameter_kinds(trial.vehicle) == []


# --- known flow parameters ---------------------------------------------------------------------------------------


@cache
def deflected_trial() -> Range:
    vehicle = shape_vehicle()
    parameters = {NAME: FlowParameter(values=list(DEFLECTIONS))}
    conditions = vehicle.conditions.model_copy(update={"parameters": parameters})
    table = vehicle.aerodynamics.model_copy(update={"engine": "table", "manifest": "flows.toml"})
    vehicle = vehicle.model_copy(update={"conditions": conditions, "aerodynamics": table})
    drawn = kind_of(vehicle, "nothing wrong", "vehicle of the file").flights(
        vehicle, None, EFFORT.conditions, np.random.default_rng(EFFORT.seed)
    )
    at_rest = flown([replace(one, parameters=()) for one in drawn])
    flows = deflected(at_rest, np.array([one.parameters[0] for one in drawn]))
    assert at_conditions(flows, drawn) is not None
    model = ShapeModel(vehicle=vehicle, structure=beam(flows.surface), flows=flows)
    return Range(vehicle=vehicle, model=model, inverse_map=known_map(), effort=EFFORT)


def test_known_parameters_are_honest_and_wrong_ones_are_flagged() -> None:
    trial = deflected_trial()
    right, wrong, filtered = (trial.score(kind) for kind in parameter_kinds(trial.vehicle))
    assert right.score.undetected <= 0.03
    assert right.kind.group == "within"
    assert right.score.detected < 0.05
    assert wrong.missed == filtered.missed == ()
    assert wrong.score.detected > 0.4
    assert filtered.kind.filtered is not None
    assert filtered.score.samples == EFFORT.conditions * EFFORT.draws
