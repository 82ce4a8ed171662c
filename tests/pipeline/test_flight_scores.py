"""The score of a flight, of a recording made by hand; of a map of imported results, on results that it was not
made from; another physics in flight is named."""

import json
from collections.abc import Callable
from dataclasses import replace
from io import StringIO
from math import radians
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from ogive import copied_ogive
from rich.console import Console

import builder
from builder.pipeline.demonstration import flight_scores
from builder.pipeline.demonstration.flight_scores import score_flight
from builder.pipeline.estimator_choice import with_estimator
from builder.reporting import Silent
from builder.structure.fourier.fourier_model import StructuralModel
from builder.truth.flights import FlownPhysics, flown_physics, other_physics
from builder.vehicle.file import VEHICLES
from builder.vehicle.model_entries import Aerodynamics
from strainfmu.cli.commands.demo_results import show_result
from strainfmu.cosim.systems.recording import Recording
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

Run = Callable[..., tuple[int, str, str]]


def known_score() -> dict[str, Any]:
    """Return the score of a flight of four samples; a constant coefficient has no range."""
    names = [f"{way}.{name}" for way in ("plant", "estimator", "estimator.sigma") for name in COEFFICIENT_NAMES]
    truth = np.zeros((4, 5))
    truth[:, 1] = [0.0, 1.0, 2.0, 4.0]
    estimate = truth + 0.02
    estimate[0, 1] += 0.08
    values = np.hstack([truth, estimate, np.full((4, 5), 0.01), np.zeros((4, 1))])
    return score_flight(
        Recording(
            time=0.01 * np.arange(4),
            names=(*names, "estimator.health.state"),
            units=("1",) * (len(names) + 1),
            values=values,
            instances=("plant", "estimator"),
            step_cost=np.array([[1e-4, 2e-5]] * 3),
        )
    )


@pytest.mark.fast
def test_errors_and_coverage_of_known_numbers() -> None:
    score, rms = known_score(), np.sqrt((0.1**2 + 3 * 0.02**2) / 4)
    assert score["rms_error"] == pytest.approx({**dict.fromkeys(COEFFICIENT_NAMES, 0.02), "C_N": rms}, rel=1e-12)
    assert score["rms_error_of_range"].pop("C_N") == pytest.approx(rms / 4.0, rel=1e-12)
    assert set(score["rms_error_of_range"].values()) == {None}
    assert list(score["coverage"].values()) == [1.0, 0.75, 1.0, 1.0, 1.0]
    assert score["undetected"]["C_N"] == 0.25
    assert score["step_time"] == {"plant": 1e-4, "estimator": 2e-5}


@pytest.mark.fast
def test_the_estimator_of_a_vehicle_file_may_be_replaced() -> None:
    vehicle, shape = builder.load_vehicle(builder.IC3X), builder.load_vehicle(VEHICLES / "elliptic_cone.toml")
    linear = with_estimator(vehicle, "linear")
    assert [one.map.estimator for one in (linear, with_estimator(linear, "nonlinear"))] == ["linear", "nonlinear"]
    assert with_estimator(shape, "nonlinear").map.estimator == "nonlinear"
    assert with_estimator(vehicle, None) is vehicle
    listed = linear.model_copy(update={"map": linear.map.model_copy(update={"symmetry": "listed"})})
    with pytest.raises(InputError, match=r"--estimator nonlinear: needs map.symmetry 'full', got 'listed'"):
        with_estimator(listed, "nonlinear")
    with pytest.raises(InputError, match=r"^--estimator: .* got 'manifold', now called 'nonlinear'$"):
        # The former name, which the type no longer has.
        with_estimator(vehicle, "manifold")  # type: ignore[arg-type]  # no estimator has the name


def at(*conditions: tuple[float, float]) -> Any:
    """Snapshots, as far as their conditions, at Mach numbers and total incidences [deg]."""
    listed = [SimpleNamespace(mach_number=m, total_incidence=radians(a)) for m, a in conditions]
    return cast(Any, SimpleNamespace(conditions=lambda: listed))


@pytest.mark.fast
def test_a_grid_loses_whole_rows_and_columns() -> None:
    """Inner Mach numbers and incidences but the largest; flown are the ones at inner Mach numbers. Any other table
    loses a fifth inside."""
    flows = [(m, a) for m in (4.0, 5.0, 6.0, 7.0) for a in (0.0, 2.0, 4.0, 6.0)]
    found = flight_scores.left_out_parts(at(*flows))
    assert [one.name for one in found] == ["M 5", "M 6", *(f"total incidence {a} deg" for a in (0, 2, 4))]
    assert [len(one.rows) for one in found] == [4, 4, 4, 4, 4]
    flown = np.concatenate([flight_scores._flown_rows(at(*flows), one) for one in found])
    assert {flows[row][0] for row in flown.tolist()} == {5.0, 6.0}
    many = [(m, a) for m in np.arange(4.0, 20.0).tolist() for a in np.arange(0.0, 30.0).tolist()]
    assert len(flight_scores.left_out_parts(at(*many))) == flight_scores.MOST_PARTS
    flows = np.random.default_rng(1).uniform([4.0, 0.0], [7.0, 9.0], (40, 2)).tolist()
    found = flight_scores.left_out_parts(at(*map(tuple, flows)))
    assert len(found) == 5
    rows = np.concatenate([one.rows for one in found])
    # But the ends of the Mach numbers, and the largest incidence.
    assert len(set(rows.tolist())) == len(rows) == 37
    assert flight_scores.left_out_parts(at((4.0, 0.0), (5.0, 0.0), (4.0, 3.0), (5.0, 3.0))) == []


def test_the_score_is_of_the_physics_of_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sigmas hold on flows that the maps are made without, but not where these are of another physics."""
    monkeypatch.setattr(flight_scores, "MOST_PARTS", 2)
    newtonian = {"aerodynamics": Aerodynamics(engine="newtonian")}
    vehicle = builder.load_vehicle(copied_ogive(tmp_path / "vehicle")).model_copy(update=newtonian)
    structure, snapshots = builder.solve_structure(vehicle), builder.take_snapshots(vehicle)
    assert isinstance(structure, StructuralModel)
    of_table = replace(snapshots, engine="table")
    found = flight_scores.held_out_score(vehicle, of_table, structure, Silent())
    assert found is not None
    assert found["left_out"] == ["M 4.5", "total incidence 6 deg"]
    assert found["not_built"] == []
    assert min(found["coverage"].values()) > 0.98
    assert found["healthy"] > 0.98
    assert max(found["rms_error_of_range"][name] for name in ("C_N", "C_Y")) < 0.02
    assert json.loads(json.dumps(found))["flows"] == 5
    # The flows at M 4.5 by another solver, which loads the aft half of the body more.
    alike, pressure = snapshots.condition[:, 0] == 4.5, snapshots.pressure.copy()
    mean = pressure[alike].mean(axis=1, keepdims=True)
    pressure[alike] = mean + np.where(snapshots.point[:, 0] > 1.25, 1.6, 0.9) * (pressure[alike] - mean)
    (part,) = (one for one in flight_scores.left_out_parts(of_table) if one.name == "M 4.5")
    monkeypatch.setattr(flight_scores, "left_out_parts", lambda of: [part])
    other = flight_scores.held_out_score(vehicle, replace(of_table, pressure=pressure), structure, Silent())
    assert other is not None
    assert min(other["coverage"].values()) < 0.9 or other["healthy"] < 0.5


@pytest.mark.fast
def test_what_flies_is_named() -> None:
    """Euler for a table, unless the file says otherwise; of any other shape the map's own."""
    shipped = builder.load_vehicle(builder.IC3X)
    assert flown_physics(shipped, "euler").is_that_of_map
    assert other_physics(shipped) == []
    of_table = flown_physics(shipped, "table")
    assert of_table == FlownPhysics(flies="euler", of_map="table")
    assert of_table.record() == {"flies": "euler", "map": "table", "same": False}
    flies = shipped.model_copy(update={"truth": shipped.truth.model_copy(update={"engine": "newtonian"})})
    (line,) = other_physics(flies)
    assert "its flow is of local inclination (newtonian), the map's of the marching Euler" in line
    assert other_physics(flies.model_copy(update={"aerodynamics": Aerodynamics(engine="newtonian")})) == []
    shape = builder.load_vehicle(VEHICLES / "elliptic_cone.toml")
    assert flown_physics(shape, shape.aerodynamics.engine).is_that_of_map


@pytest.mark.fast
def test_the_flight_of_another_physics_is_the_second_score(tmp_path: Path) -> None:
    score = known_score()
    held_out = {**score, "left_out": ["M 5"], "flows": 4, "not_built": []}
    result = SimpleNamespace(vehicle="ogive", folder=tmp_path, flight="20 s at 100 Hz", files={})

    def printed(**entries: Any) -> str:
        vars(result).update(entries)
        show_result(Console(file=(out := StringIO()), width=120), cast(Any, result))
        return out.getvalue()

    text = printed(summary={**score, "held_out": held_out}, physics=FlownPhysics(flies="euler", of_map="table"))
    assert text.index("Held-out conditions of the imported") < text.index("another physics, the marching Euler")
    assert "Maps made without M 5 in turn estimate what they are made without, 4 flows" in text
    assert "warning: the vehicle that flies has another physics than the map" in text
    assert "the map's of imported results (table)" in text
    assert "C_N 25.00%" in text
    text = printed(summary=score, physics=FlownPhysics(flies="euler", of_map="euler"))
    assert text.startswith("ogive: 20 s at 100 Hz; ")
    assert not any(words in text for words in ("Held-out", "another physics", "warning"))


@pytest.mark.slow
def test_a_demonstration_of_imported_results(run: Run, ogive_demo: Path, tmp_path: Path) -> None:
    """Euler's flows, exported and imported: the held-out score stands in the files, beside what flew."""
    vehicle, of_table = copied_ogive(tmp_path / "vehicle"), 'engine = "table"\nmanifest = "cfd/manifest.toml"\n'
    assert run("convert", ogive_demo / "snapshots.h5", "-o", vehicle.parent / "cfd", "--format", "csv")[0] == 0
    vehicle.write_text(f"{vehicle.read_text(encoding='utf-8')}\n[aerodynamics]\n{of_table}", encoding="utf-8")
    code, printed, message = run("demo", "--vehicle", vehicle, "-o", tmp_path / "demo")
    assert (code, message) == (0, "")
    assert "Held-out conditions of the imported results" in printed
    summary, held_out = (
        json.loads((tmp_path / "demo" / f"{name}.json").read_text(encoding="utf-8"))
        for name in ("summary", "held_out")
    )
    assert summary["physics"] == {"flies": "euler", "map": "table", "same": False}
    assert all(value > 0.97 for value in summary["held_out"]["coverage"].values())
    assert summary["held_out"] == held_out
