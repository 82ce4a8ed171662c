"""Examples of the gallery show what they say: all points, and the health of their results.

A build of the site checks the figures of every example by the same rules. Here are the rules, and examples.
"""

import runpy
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib import pyplot as plt
from snippets import ROOT

GALLERY = ROOT / "docs" / "gallery_src"


@pytest.fixture
def rules(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The module that checks figures while the site is built."""
    pytest.importorskip("sphinx_gallery", reason="the site is built with the extra docs")
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_ext"))
    import gallery_figures

    yield gallery_figures
    sys.modules.pop("gallery_figures")
    plt.close("all")


def run_example(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Run an example as its reader does; return its variables and leave its figures open."""
    for path in GALLERY.glob("*.toml"):
        shutil.copy(path, folder)
    monkeypatch.chdir(folder)
    plt.close("all")
    return runpy.run_path(str(GALLERY / f"{name}.py"))


def faults_of_all_figures(rules: ModuleType, variables: dict[str, Any]) -> list[str]:
    assert plt.get_fignums()
    return [fault for number in plt.get_fignums() for fault in rules.figure_faults(plt.figure(number), variables)]


def test_cones_show_every_point(
    rules: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiled_solver: None
) -> None:
    variables = run_example("plot_02_cone", tmp_path, monkeypatch)
    assert faults_of_all_figures(rules, variables) == []
    shown = [line for line in variables["right"].get_lines() if line.get_marker() == "o"]
    assert [len(line.get_xdata()) for line in shown] == [3, 3, 3]
    assert max(np.abs(line.get_ydata()).max() for line in shown) < 0.5  # per cent


@pytest.mark.slow
def test_the_fmu_in_fmpy_is_ok_until_the_gauge_is_lost(
    rules: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiled_solver: None
) -> None:
    variables = run_example("plot_08_fmu_in_fmpy", tmp_path, monkeypatch)
    result = variables["result"]
    assert faults_of_all_figures(rules, variables) == []
    # NaN at 0.61 s is held over the step that ends at 0.62 s.
    lost = result["time"] > 0.615
    assert set(result["health.state"][~lost]) == {0}
    assert set(result["health.state"][lost]) == {4}
    np.testing.assert_array_equal(result["health.valid_gauges"], np.where(lost, 53, 54))
    held = np.concatenate([variables["truth"][:1], variables["truth"][:-1]])
    assert np.all(np.abs(result["C_N"] - held) < 3.0 * result["sigma.C_N"])


def test_a_point_outside_its_axes_is_a_fault(rules: ModuleType) -> None:
    figure, (one, other) = plt.subplots(2, 1)
    one.plot([1.0, 2.0, 3.0], [-0.1, -0.2, np.nan], "o")
    one.axvline(2.0)
    one.axhline(9.0)
    one.set_ylim(-0.3, 0.3)
    other.plot([1.0, 2.0, 3.0], [-0.1, -0.2, -0.4], "o-")
    other.set_ylim(0.3, -0.3)
    assert list(rules.figure_faults(figure, {})) == ["axes 2: 1 points of its lines are outside"]
    other.set_xlim(2.5, 4.0)
    assert list(rules.figure_faults(figure, {})) == ["axes 2: 3 points of its lines are outside"]


@pytest.mark.parametrize(
    ("states", "label", "fault"),
    [
        ([7, 7], "health.state (4: DEGRADED)", "health is OUTSIDE, the figure says DEGRADED"),
        ([0, 4], "DEGRADED", "health is DEGRADED, OK, the figure says DEGRADED"),
        ([0, 4], "OK, then DEGRADED", None),
        ([7], "health.state", None),
        ([0], "NOT_OK, OKAY", None),
    ],
)
def test_another_state_of_health_than_that_of_the_result_is_a_fault(
    rules: ModuleType, states: list[int], label: str, fault: str | None
) -> None:
    result = np.array([(0.0, state) for state in states], dtype=[("time", float), ("health.state", np.int32)])
    figure, axis = plt.subplots()
    axis.set_ylabel(label)
    found = list(rules.figure_faults(figure, {"result": result, "time": np.zeros(3), "n": 3}))
    assert found == ([] if fault is None else [fault])
