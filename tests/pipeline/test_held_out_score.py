"""A map of imported results is scored on results that it was not made from; another physics in flight is named."""

from __future__ import annotations

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
from builder.campaign.snapshots import Snapshots
from builder.pipeline.demonstration import flight_scores as held_out
from builder.pipeline.demonstration.flight_scores import Flown
from builder.reporting import Silent
from builder.structure.fourier.fourier_model import StructuralModel
from builder.trial.estimators import Estimates
from builder.trial.readings import Readings
from builder.truth.independent_model import FlownPhysics, flown_physics, other_physics
from builder.vehicle.file import VEHICLES
from builder.vehicle.model_entries import Aerodynamics
from strainfmu.cli.commands.demo_results import show_result, write_readme

Run = Callable[..., tuple[int, str, str]]
OF_TABLE = '\n[aerodynamics]\nengine = "table"\nmanifest = "cfd/manifest.toml"\n'


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> tuple[builder.Vehicle, Snapshots, StructuralModel]:
    """The ogive with Newtonian pressure as if it were imported, and its structure."""
    path = copied_ogive(tmp_path_factory.mktemp("table") / "vehicle")
    loaded = builder.load_vehicle(path)
    vehicle = loaded.model_copy(update={"aerodynamics": Aerodynamics(engine="newtonian")})
    structure = builder.solve_structure(vehicle)
    assert isinstance(structure, StructuralModel)
    return vehicle, replace(builder.take_snapshots(vehicle), engine="table"), structure


def at(*conditions: tuple[float, float]) -> Any:
    """Snapshots, as far as their conditions, at Mach numbers and total incidences [deg]."""
    listed = [SimpleNamespace(mach_number=m, total_incidence=radians(a)) for m, a in conditions]
    return cast(Any, SimpleNamespace(conditions=lambda: listed))


@pytest.mark.fast
def test_a_grid_loses_whole_rows_and_columns() -> None:
    """Inner Mach numbers and incidences but the largest; flown are the ones at inner Mach numbers. Any other table
    loses a fifth inside."""
    flows = [(m, a) for m in (4.0, 5.0, 6.0, 7.0) for a in (0.0, 2.0, 4.0, 6.0)]
    found = held_out.left_out_parts(at(*flows))
    assert [one.name for one in found] == ["M 5", "M 6", *(f"total incidence {a} deg" for a in (0, 2, 4))]
    assert [len(one.rows) for one in found] == [4, 4, 4, 4, 4]
    assert {flows[row][0] for one in found for row in one.flown.tolist()} == {5.0, 6.0}
    many = [(m, a) for m in np.arange(4.0, 20.0).tolist() for a in np.arange(0.0, 30.0).tolist()]
    assert len(held_out.left_out_parts(at(*many))) == held_out.MOST_PARTS
    flows = np.random.default_rng(1).uniform([4.0, 0.0], [7.0, 9.0], (40, 2)).tolist()
    found = held_out.left_out_parts(at(*map(tuple, flows)))
    assert len(found) == 5
    rows = np.concatenate([one.rows for one in found])
    # But the ends of the Mach numbers, and the largest incidence.
    assert len(set(rows.tolist())) == len(rows) == 37
    assert held_out.left_out_parts(at((4.0, 0.0), (5.0, 0.0), (4.0, 3.0), (5.0, 3.0))) == []


def test_the_score_is_of_the_physics_of_the_table(
    parts: tuple[builder.Vehicle, Snapshots, StructuralModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sigmas hold on flows that the maps are made without, but not where these are of another physics."""
    monkeypatch.setattr(held_out, "MOST_PARTS", 2)
    vehicle, snapshots, structure = parts
    found = held_out.held_out_score(vehicle, snapshots, structure, Silent())
    assert found is not None
    assert found["left_out"] == ["M 4.5", "total incidence 0 deg"]
    assert found["not_built"] == []
    assert min(found["coverage"].values()) > 0.98
    assert found["healthy"] > 0.98
    assert max(found["rms_error_of_range"][name] for name in ("C_N", "C_Y")) < 0.02
    assert json.loads(json.dumps(found))["flows"] == 5
    # The flows at M 4.5 by another solver, which loads the aft half of the body more.
    alike = snapshots.condition[:, 0] == 4.5
    pressure = snapshots.pressure.copy()
    mean = pressure[alike].mean(axis=1, keepdims=True)
    pressure[alike] = mean + np.where(snapshots.point[:, 0] > 1.25, 1.6, 0.9) * (pressure[alike] - mean)
    monkeypatch.setattr(held_out, "left_out_parts", lambda of: [one for one in LEFT(of) if one.name == "M 4.5"])
    other = held_out.held_out_score(vehicle, replace(snapshots, pressure=pressure), structure, Silent())
    assert other is not None
    assert min(other["coverage"].values()) < 0.9 or other["healthy"] < 0.5


LEFT = held_out.left_out_parts


@pytest.mark.fast
def test_what_flies_is_named() -> None:
    """Euler for a table, unless the file says otherwise; of any other shape the map's own."""
    shipped = builder.load_vehicle(builder.IC3X)
    assert flown_physics(shipped, "euler").is_that_of_map
    assert other_physics(shipped) == []
    of_table = flown_physics(shipped, "table")
    assert of_table == FlownPhysics(flies="euler", of_map="table")
    assert of_table.model == "another physics, the marching Euler solver"
    assert "the map's of imported results (table)" in of_table.sentence
    assert of_table.record() == {"flies": "euler", "map": "table", "same": False}
    flies = shipped.model_copy(update={"truth": shipped.truth.model_copy(update={"engine": "newtonian"})})
    (line,) = other_physics(flies)
    assert "its flow is of local inclination (newtonian), the map's of the marching Euler" in line
    assert other_physics(flies.model_copy(update={"aerodynamics": Aerodynamics(engine="newtonian")})) == []
    shape = builder.load_vehicle(VEHICLES / "elliptic_cone.toml")
    assert flown_physics(shape, shape.aerodynamics.engine).is_that_of_map


@pytest.mark.fast
def test_the_flight_of_another_physics_is_the_second_score(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    error, sigma = random.normal(size=(50, 5)), np.ones((50, 5))
    label = np.arange(50)
    read = Readings(strain=np.empty((50, 0)), known={}, truth=error, vehicle=0 * label, flight=label)
    score, held = (
        Flown(read, Estimates(value=error + size * error, std=sigma, health=0 * label)).record()
        for size in (4.0, 1.0)
    )
    score["step_time"] = {}
    result = SimpleNamespace(
        vehicle="ogive",
        folder=tmp_path,
        flight="20 s at 100 Hz",
        files={"overview.png": "a figure", "estimator.fmu": "an FMU", "flight.csv": "the flight"},
        reused=(),
        physics=FlownPhysics(flies="euler", of_map="table"),
        summary={**score, "held_out": {**held, "left_out": ["M 5"], "flows": 4, "not_built": []}},
        errors_in_sigma=("gauge noise",),
    )

    def printed() -> str:
        out = StringIO()
        show_result(Console(file=out, width=120), cast(Any, result))
        return out.getvalue()

    text = printed()
    assert text.index("Held-out conditions of the imported") < text.index("another physics, the")
    assert "Maps made without M 5 in turn estimate what they are made without, 4 flows" in text
    assert "warning: the vehicle that flies has another physics than the map" in text
    assert score["undetected"]["C_A"] > 0.2
    assert f"C_A {score['undetected']['C_A']:.2%}" in text
    result.summary, result.physics = score, FlownPhysics(flies="euler", of_map="euler")
    lines = printed().splitlines()
    assert len(lines) == 13
    assert lines[0].startswith("ogive: 20 s at 100 Hz; ")
    assert [line.split(":")[0] for line in lines[-4:]] == ["Picture", "FMU", "Next", "More"]
    written = write_readme(cast(Any, result), ["Figures  1.0 s"]).read_text(encoding="utf-8")
    assert all(text in written for text in ("Figures  1.0 s", "includes: gauge noise", "overview.png   a figure"))
    result.reused = tuple(result.files)
    assert write_readme(cast(Any, result), []).read_text(encoding="utf-8") == written, "a run that made nothing"


@pytest.mark.slow
def test_a_demonstration_of_imported_results(run: Run, ogive_demo: Path, tmp_path: Path) -> None:
    """Euler's flows, exported and imported: the held-out score stands in the files, beside what flew."""
    vehicle = copied_ogive(tmp_path / "vehicle")
    assert run("convert", ogive_demo / "snapshots.h5", "-o", vehicle.parent / "cfd", "--format", "csv")[0] == 0
    vehicle.write_text(vehicle.read_text(encoding="utf-8") + OF_TABLE, encoding="utf-8")
    code, printed, message = run("demo", "--vehicle", vehicle, "-o", tmp_path / "demo")
    assert (code, message) == (0, "")
    assert "Held-out conditions of the imported results" in printed
    summary = json.loads((tmp_path / "demo" / "summary.json").read_text(encoding="utf-8"))
    assert summary["physics"] == {"flies": "euler", "map": "table", "same": False}
    assert all(value > 0.97 for value in summary["held_out"]["coverage"].values())
    assert summary["held_out"] == json.loads((tmp_path / "demo" / "held_out.json").read_text(encoding="utf-8"))
