"""``strainfmu trial`` and ``stress`` as a user runs them: files, second and ended runs, workers, refusals."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from changed_vehicle import change
from ogive import OGIVE, copied_ogive

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.campaign.journal import Journal
from builder.campaign.run import CampaignInterrupted
from builder.campaign.scheduling import Scheduling
from builder.pipeline.trial_run import CASES
from builder.reporting import Silent
from builder.trial import conditions
from builder.trial.flows import stress_flows
from builder.vehicle.file import VEHICLES, load_vehicle

Run = Callable[..., tuple[int, str, str]]

SHORT = """
[trial]
conditions = 3
vehicles = 2
[[group]]
class = "beyond"
cases = [
    { error = "bias of one gauge", size = "+50 um/m", fault = { of = 1, add_um_per_m = 50.0 } },
    { error = "three gauges lost", fault = { of = 3, lost = true } },
    { error = "too fast", where = { mach = 3.0 } },
]
"""


@pytest.fixture(autouse=True)
def few_knots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conditions, "MACH_KNOTS", 4)
    monkeypatch.setattr(conditions, "INCIDENCE_KNOTS", 4)


@pytest.fixture
def vehicle_file(tmp_path: Path) -> Path:
    """The coarse test vehicle, its alarm levels those of the theory, which saves time."""
    path = copied_ogive(tmp_path / "vehicle")
    change(path, ("modes = 4", 'modes = 4\nalarm_levels = "nominal"'))
    return path


@pytest.mark.usefixtures("compiled_solver")
def test_from_vehicle_file_to_table(vehicle_file: Path, tmp_path: Path, run: Run) -> None:
    folder = tmp_path / "stress"
    command = ("stress", vehicle_file, "-o", folder, "--conditions", 3, "--draws", 1)
    code, out, message = run(*command)
    assert (code, message) == (0, "")
    assert "nothing wrong" in out
    assert "flagged, the largest of" in out
    entries = json.loads((folder / "stress.json").read_text(encoding="utf-8"))
    assert len(entries) >= 24
    for one in entries:
        assert one["class"] in ("within", "outside", "unobservable")
        assert 0.0 <= one["undetected_percent"] <= one["wrong_percent"] <= 100.0
        assert one["detected_percent"] == pytest.approx(100.0 - one["health"].get("OK", 0.0), abs=1e-3)
    with (folder / "trial.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["error"] for row in rows if row["load"] == "all"] == [one["error"] for one in entries]
    assert (folder / "trial.png").read_bytes().startswith(b"\x89PNG")
    assert not (folder / "trial_flows.h5.journal").exists()

    # An interrupted run goes on; the map as a file gives the same numbers.
    before, kept = (folder / "trial.csv").read_bytes(), sorted((folder / CASES).iterdir())
    kept[3].unlink()
    code, out, _ = run(*command)
    assert code == 0
    for name in ("snapshots.h5", "map.h5", "trial_flows.h5"):
        assert f"{name}: up to date, reused" in out
    assert f"Cases: 1 of {len(kept)}" in out
    assert (folder / "trial.csv").read_bytes() == before
    (tmp_path / "given.h5").write_bytes((folder / "map.h5").read_bytes())
    code, out, _ = run(*command, "--map", tmp_path / "given.h5")
    assert code == 0
    assert "snapshots.h5" not in out
    assert "trial_flows.h5: up to date, reused" in out
    assert (folder / "trial.csv").read_bytes() == before

    # A file of the user's, on two workers, with the map and flows there.
    (tmp_path / "mine.toml").write_text(SHORT)
    own = ("trial", tmp_path / "mine.toml", vehicle_file, "--map", tmp_path / "given.h5", "--format", "csv")
    own = (*own, "--flows", folder / "trial_flows.h5", "--format", "json")
    code, out, _ = run(*own, "-o", tmp_path / "one")
    assert code == 0
    assert "too fast, : left out: Mach number:" in out
    code, *_ = run(*own, "-o", tmp_path / "two", "--workers", 2)
    assert code == 0
    for name in ("trial.csv", "trial.json"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    code, out, _ = run(*own, "-o", tmp_path / "one", "--only", "three gauges lost", "--estimators", "linear")
    assert code == 0
    assert "bias of one gauge" not in out
    code, _, message = run("stress", "-o", folder, "--map", tmp_path / "given.h5")
    assert code == 2
    assert "gauges of layout 'configuration_2', got" in message


def test_ended_flows_go_on(vehicle_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
        (("stress", OGIVE, "--conditions", 0), "--conditions: expected 1 .. 1000000, got 0"),
        (("stress", OGIVE, "--map", "m.h5", "--rebuild"), "--map: expected without --rebuild"),
        (
            ("trial", "stress", OGIVE, "--map", "m.h5", "--snapshots", "s.h5"),
            "--map: expected without --snapshots",
        ),
        (("stress", OGIVE, "--map", "m.h5"), "m.h5: no such file"),
        (("trial", "no_name", OGIVE), "no_name: expected the path of a file, or a trial that is shipped"),
        (("trial", "none.toml", OGIVE), "none.toml: no such file"),
        (("trial", "stress", OGIVE, "--format", "xlsx"), "--format: expected csv, parquet or json, got xlsx"),
        (
            ("trial", "manoeuvres", VEHICLES / "finned_body.toml"),
            "motion: expected a body of revolution, got a shape that needs a flow for every sample",
        ),
    ],
)
def test_wrong_options_are_refused_in_one_line(
    arguments: tuple[object, ...], message: str, tmp_path: Path, run: Run
) -> None:
    code, _, found = run(*arguments, "-o", tmp_path / "none")
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
    code, _, _ = run(*command, "--estimator", "nonlinear")
    assert code == 0
    entries = json.loads((tmp_path / "stress.json").read_text(encoding="utf-8"))
    of = {(one["error"], one["size"]): one for one in entries}
    assert of["nothing wrong", "vehicle of the file"]["undetected_percent"] <= 10.0
    assert of["bias of one gauge", "+50 um/m"]["detected_percent"] == 100.0
    assert of["Mach number below its least", "-20 %"]["detected_percent"] >= 95.0
    (tmp_path / "given.h5").write_bytes((tmp_path / "map.h5").read_bytes())
    code, *_ = run(*command, "--map", tmp_path / "given.h5")
    assert code == 0
    assert json.loads((tmp_path / "stress.json").read_text(encoding="utf-8")) == entries
