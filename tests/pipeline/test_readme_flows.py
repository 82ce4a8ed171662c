"""README's commands for one's own vehicle share its cache: each solves the flows that the others have not."""

import shlex
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from ogive import OGIVE, copied_ogive
from snippets import ROOT, snippets

from builder.campaign import campaign_run as campaign
from builder.trial import conditions
from builder.vehicle.file import load_vehicle
from builder.workspace import SHARED_VARIABLE
from strainfmu.files import fingerprint

Run = Callable[..., tuple[int, str, str]]

KNOTS = 2
QUICK = {"stress": ("--conditions", "3", "--draws", "1")}


def commands() -> list[list[str]]:
    """Return the words of the commands from the vehicle file to the review of its gauges."""
    (block,) = [one for one in snippets(ROOT / "README.md") if "strainfmu stress" in one.text]
    return [shlex.split(line, comments=True)[1:] for line in block.text.splitlines()]


@pytest.mark.usefixtures("compiled_solver", "undrawn")
def test_no_flow_is_solved_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    """Snapshots and independent model by the build, flows beyond the envelope by the stress test."""
    copied_ogive(tmp_path / "ogive").rename(tmp_path / "ogive" / "my_vehicle.toml")
    monkeypatch.chdir(tmp_path / "ogive")
    monkeypatch.delenv(SHARED_VARIABLE)
    monkeypatch.setattr(conditions, "MACH_KNOTS", KNOTS)
    monkeypatch.setattr(conditions, "INCIDENCE_KNOTS", KNOTS)
    solved, by_command = Counter[Any](), dict[str, int]()
    solve_flows = campaign.solve_flows

    def counted(engine: Any, keys: Any, *arguments: Any, **options: Any) -> Iterator[Any]:
        for one in solve_flows(engine, keys, *arguments, **options):
            solved[fingerprint(engine.inputs()), one.flow.key] += 1
            yield one

    monkeypatch.setattr(campaign, "solve_flows", counted)
    for name, *words in commands():
        before = solved.total()
        code, _, message = run(name, *words, *QUICK.get(name, ()))
        assert (code, message) == (0, ""), name
        by_command[name] = solved.total() - before
    truth = load_vehicle(OGIVE).truth
    independent = len(truth.mach_number or ()) * len(truth.total_incidence_deg or ())
    assert by_command == {"check": 0, "build": 15 + independent, "demo": 0, "stress": KNOTS**2, "review": 0}
    assert set(solved.values()) == {1}
