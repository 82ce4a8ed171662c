"""The score of a flight, on a recording made by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_maps import AREA, LENGTH, ROWS, STATIONS, exact_response, flight_map
from scaled_maps import scaled_map

from builder.figures.comparison.flown_estimators import estimator_errors
from builder.figures.drawing.canvas import save
from builder.pipeline.chosen_estimator import with_estimator
from builder.pipeline.demonstration.flight_scores import AIR_DATA, flown_estimators, score_flight
from builder.vehicle.file import IC3X, VEHICLES, load_vehicle
from strainfmu.cosim.systems.recording import Recording
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.flight_condition import FlightCondition
from strainfmu.interface.fmi_variables import strain_names

pytestmark = pytest.mark.fast


def recording(names: list[str], values: np.ndarray, **more: object) -> Recording:
    """Return a recording of (n, m) values at 100 Hz."""
    time, units = 0.01 * np.arange(len(values)), ("1",) * len(names)
    # ``more`` are other fields of a recording, each of its own type.
    return Recording(time=time, names=tuple(names), units=units, values=values, **more)  # type: ignore[arg-type]


def test_errors_and_coverage_of_known_numbers() -> None:
    """A constant coefficient has no range."""
    names = [f"{way}.{name}" for way in ("plant", "estimator", "estimator.sigma") for name in COEFFICIENT_NAMES]
    truth = np.zeros((4, 5))
    truth[:, 1] = [0.0, 1.0, 2.0, 4.0]
    estimate = truth + 0.02
    estimate[0, 1] += 0.08
    values = np.hstack([truth, estimate, np.full((4, 5), 0.01), np.zeros((4, 1))])
    cost = {"instances": ("plant", "estimator"), "step_cost": np.array([[1e-4, 2e-5]] * 3)}
    score = score_flight(recording([*names, "estimator.health.state"], values, **cost))
    rms = np.sqrt((0.1**2 + 3 * 0.02**2) / 4)
    assert score["rms_error"] == pytest.approx({**dict.fromkeys(COEFFICIENT_NAMES, 0.02), "C_N": rms}, rel=1e-12)
    assert score["rms_error_of_range"].pop("C_N") == pytest.approx(rms / 4.0, rel=1e-12)
    assert set(score["rms_error_of_range"].values()) == {None}
    assert list(score["coverage"].values()) == [1.0, 0.75, 1.0, 1.0, 1.0]
    assert score["undetected"]["C_N"] == 0.25
    assert score["step_time"] == {"plant": 1e-4, "estimator": 2e-5}


N_D, K = STATIONS * ROWS, 15


def flight() -> Recording:
    """Return a flight through zero incidence."""
    rows, random = [], np.random.default_rng(1)
    for i in range(K):
        one = FlightCondition(6.0, np.radians(1.0 * (i - 7)), np.radians(0.5), 20e3)
        u, w = (one.total_incidence * f(one.leeward_roll_angle) for f in (np.cos, np.sin))
        response = exact_response(one.mach_number, u, w, one.ambient_pressure)
        scale = one.dynamic_pressure * AREA * np.array([1.0, 1.0, 1.0, LENGTH, LENGTH])
        strain = response[:N_D] + 2e-7 * random.standard_normal(N_D)
        rows.append([*(response[N_D:] / scale), *strain, *one.as_tuple(), one.dynamic_pressure])
    names = [*COEFFICIENT_NAMES, *strain_names(N_D), "mach_number", "angle_of_attack", "sideslip_angle"]
    return recording([f"plant.{name}" for name in (*names, "altitude", "dynamic_pressure")], np.array(rows))


def test_the_nonlinear_estimator_is_beside_the_linear_one(tmp_path: Path) -> None:
    """A map without tables has the linear one alone."""
    whole = replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=1e-3))
    flown = flown_estimators(whole, flight())
    assert list(flown) == ["linear", "nonlinear"]
    score = flown["nonlinear"].record()
    assert min(score["coverage"][name] for name in COEFFICIENT_NAMES) >= 0.9
    assert score["healthy"] > 0.9
    assert score["names"] == [*COEFFICIENT_NAMES, *AIR_DATA]
    assert score["rms_error"]["angle_of_attack"] < np.radians(0.2)
    assert flown["linear"].record()["names"] == [*COEFFICIENT_NAMES]
    errors = {name: (one.error, one.made.std) for name, one in flown.items()}
    error, std = errors["nonlinear"]
    save(estimator_errors(flight().time, errors, (error[:, 5:7], std[:, 5:7]), "test"), tmp_path / "errors.png")
    assert (tmp_path / "errors.png").stat().st_size > 10_000
    assert list(flown_estimators(scaled_map(2, 1, N_D), flight())) == ["linear"]


def test_the_estimator_of_a_vehicle_file_may_be_replaced() -> None:
    vehicle = load_vehicle(IC3X)
    assert with_estimator(vehicle, "linear").map.estimator == "linear"
    assert with_estimator(with_estimator(vehicle, "linear"), "nonlinear").map.estimator == "nonlinear"
    assert with_estimator(vehicle, None) is vehicle
    entry = vehicle.map.model_copy(update={"symmetry": "listed", "estimator": "linear"})
    listed = vehicle.model_copy(update={"map": entry})
    with pytest.raises(InputError, match=r"--estimator nonlinear: needs map.symmetry 'full', got 'listed'"):
        with_estimator(listed, "nonlinear")
    with pytest.raises(InputError, match=r"^--estimator: .* got 'manifold', now called 'nonlinear'$"):
        # The former name, which the type no longer has.
        with_estimator(vehicle, "manifold")  # type: ignore[arg-type]
    shape = load_vehicle(VEHICLES / "elliptic_cone.toml")
    assert with_estimator(shape, "nonlinear").map.estimator == "nonlinear"
