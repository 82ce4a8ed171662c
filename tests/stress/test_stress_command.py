"""``strainfmu stress`` as a user runs it: files, their schema, a second run, an ended run, refusals."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from changed_vehicle import change
from ogive import OGIVE, copied_ogive

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.campaign.journal import Journal
from builder.campaign.run import CampaignInterrupted
from builder.campaign.scheduling import Scheduling
from builder.reporting import Silent
from builder.stress import flights
from builder.stress.flows import stress_flows
from builder.stress.run import CSV_COLUMNS
from builder.vehicle.file import VEHICLES, load_vehicle

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(autouse=True)
def few_knots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flights, "MACH_KNOTS", 4)
    monkeypatch.setattr(flights, "INCIDENCE_KNOTS", 4)


@pytest.fixture
def vehicle_file(tmp_path: Path) -> Path:
    """The coarse test vehicle, its alarm levels those of the theory, which saves time."""
    path = copied_ogive(tmp_path / "vehicle")
    change(path, ("modes = 4", 'modes = 4\nalarm_levels = "nominal"'))
    return path


def check_entries(entries: list[dict[str, Any]]) -> None:
    assert len(entries) >= 24
    for one in entries:
        assert {"error", "size", "detected_percent", "undetected_percent", "class"} <= one.keys()
        assert one["class"] in ("within", "outside", "unobservable")
        assert one["samples"] >= 3
        assert (one["flagged_percent"], one["silent_percent"]) == (
            one["detected_percent"],
            one["undetected_percent"],
        )
        assert 0.0 <= one["undetected_percent"] <= one["wrong_percent"] <= 100.0
        assert one["detected_percent"] == pytest.approx(100.0 - one["health"].get("OK", 0.0), abs=1e-3)


@pytest.mark.usefixtures("compiled_solver")
def test_table_figure_and_second_run(vehicle_file: Path, tmp_path: Path, run: Run) -> None:
    folder = tmp_path / "stress"
    command = ("stress", vehicle_file, "-o", folder, "--conditions", 3, "--draws", 1)
    code, out, message = run(*command)
    assert (code, message) == (0, "")
    assert "nothing wrong" in out
    entries = json.loads((folder / "stress.json").read_text(encoding="utf-8"))
    check_entries(entries)
    within = [one for one in entries if one["class"] == "within"]
    for what in ("detected", "undetected"):
        most = max(one[f"{what}_percent"] for one in within)
        assert f"{what}, the largest of {len(within)} kinds within: {most:.2f} % (" in out
    with (folder / "stress.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert tuple(rows[0]) == CSV_COLUMNS
    assert [row["error"] for row in rows] == [one["error"] for one in entries]
    assert (folder / "stress.png").read_bytes().startswith(b"\x89PNG")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert not (folder / "stress_flows.h5.journal").exists()

    code, out, _ = run(*command)
    assert code == 0
    for name in ("snapshots.h5", "map.h5", "stress_flows.h5", "stress.json", "stress.csv", "stress.png"):
        assert f"{name}: up to date, reused" in out
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before

    # The same map as a file: no map is built, and the numbers are the same.
    (tmp_path / "given.h5").write_bytes((folder / "map.h5").read_bytes())
    code, out, _ = run(*command, "--map", tmp_path / "given.h5")
    assert code == 0
    assert "stress_flows.h5: up to date, reused" in out
    assert "snapshots.h5" not in out
    assert json.loads((folder / "stress.json").read_text(encoding="utf-8")) == entries
    code, _, message = run("stress", "-o", folder, "--map", tmp_path / "given.h5")
    assert code == 2
    assert "gauges of layout 'configuration_2', got" in message


def test_an_ended_run_goes_on(vehicle_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Flows that were finished before an interrupt are not solved again."""
    vehicle, solved = load_vehicle(vehicle_file), []
    real = EulerEngine.solve

    def solve(engine: EulerEngine, key: FlowKey) -> Flow:
        if len(solved) == 5 and not resumed:
            raise KeyboardInterrupt
        solved.append(key)
        return real(engine, key)

    resumed = False
    monkeypatch.setattr(EulerEngine, "solve", solve)
    with pytest.raises(CampaignInterrupted, match="of 16 flows are kept"), Journal(tmp_path / "flows.h5") as kept:
        stress_flows(vehicle, Silent(), kept, Scheduling(workers=0))
    resumed = True
    with Journal(tmp_path / "flows.h5") as kept:
        before = len(kept.flows(next(iter(kept._flows))[0]))
        assert before > 0
        del solved[:]
        table = stress_flows(vehicle, Silent(), kept, Scheduling(workers=0))
    assert len(solved) == 16 - before
    assert table.harmonic.shape[:2] == (4, 4)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--conditions", 0), "--conditions: expected 1 .. 10000, got 0"),
        (("--draws", 100_000), "--draws: expected 1 .. 10000, got 100000"),
        (("--map", "m.h5", "--rebuild"), "--map: expected without --rebuild"),
        (("--map", "m.h5", "--snapshots", "s.h5"), "--map: expected without --snapshots"),
        (("--map", "m.h5"), "m.h5: no such file"),
    ],
)
def test_wrong_options_are_refused_in_one_line(
    arguments: tuple[object, ...], message: str, tmp_path: Path, run: Run
) -> None:
    code, _, found = run("stress", OGIVE, "-o", tmp_path / "none", *arguments)
    assert code == 2
    assert found.count("\n") == 1
    assert message in found
    assert not (tmp_path / "none").exists()


@pytest.mark.fast
def test_a_vehicle_without_a_second_mesh_is_refused_before_the_long_work(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "finned_body.toml"
    text = (VEHICLES / "finned_body.toml").read_text(encoding="utf-8")
    path.write_text(text.replace('checked_by = "finned_body_check.vtu"\n', ""), encoding="utf-8")
    code, _, message = run("stress", path, "-o", tmp_path / "out")
    assert code == 2
    assert message.count("\n") == 1
    assert message.startswith(f"strainfmu: {path}: structure.checked_by: entry is missing")
    assert not (tmp_path / "out" / "structure.h5").exists()


@pytest.mark.slow
def test_the_finned_body_from_file_to_table(tmp_path: Path, run: Run) -> None:
    command = ("stress", VEHICLES / "finned_body.toml", "-o", tmp_path, "--conditions", 20, "--draws", 4)
    code, out, _ = run(*command, "--estimator", "nonlinear")
    assert code == 0
    entries = json.loads((tmp_path / "stress.json").read_text(encoding="utf-8"))
    check_entries(entries)
    of = {(one["error"], one["size"]): one for one in entries}
    assert of["nothing wrong", "vehicle of the file"]["undetected_percent"] <= 10.0
    assert of["bias of one gauge", "+50 um/m"]["detected_percent"] == 100.0
    assert of["Mach number below its least", "-20 %"]["detected_percent"] >= 95.0
    code, out, _ = run(*command, "--estimator", "nonlinear")
    assert code == 0
    for name in ("map.h5", "stress_flows.h5", "stress.json"):
        assert f"{name}: up to date, reused" in out
    (tmp_path / "given.h5").write_bytes((tmp_path / "map.h5").read_bytes())
    code, out, _ = run(*command, "--map", tmp_path / "given.h5")
    assert code == 0
    assert json.loads((tmp_path / "stress.json").read_text(encoding="utf-8")) == entries
