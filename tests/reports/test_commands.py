"""``strainfmu build`` leaves a report, ``inspect`` shows a map, ``check`` says where it will hold."""

import json
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_checks import assert_self_contained
from random_map import nothing_of
from report_case import ReportCase, ogive_with
from rich.console import Console
from scipy.stats import norm

from builder.campaign.snapshots import Snapshots
from builder.inverse.problem import inverse_problem
from builder.inverse.solution import Problem
from builder.pipeline import map_files, stages
from builder.reports.build_report import build_findings
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from strainfmu.cli.inspection.files import inspect_artefact
from strainfmu.cli.inspection.inverse_map import detectable_bias, hessian_eigenvalues
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.estimator.reference.gain import load_covariance
from strainfmu.estimator.valid_ranges import ValidRange, valid_ranges

Parts = tuple[Vehicle, Snapshots, StructuralModel]
Run = Callable[..., tuple[int, str, str]]


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_build_leaves_a_report_and_uses_it_again(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A build stops at the map and its report. It takes seconds: it is the whole command.

    What the map is solved from is made once.
    """
    problems = []

    def counted(*parts: Any) -> Problem:
        problems.append(inverse_problem(*parts))
        return problems[-1]

    for module in (map_files, stages, build_findings):
        monkeypatch.setattr(module, "inverse_problem", counted)
    vehicle = ogive_with(
        tmp_path / "vehicle", 'case = 2\ngamma = "morozov"\nform = "absolute"\nsymmetry = "listed"'
    )
    code, printed, message = run("build", vehicle, "-o", tmp_path / "out")
    assert (code, message) == (0, "")
    assert "report.html: written" in printed
    assert len(problems) == 1
    assert "is blind to pressure odd in y, odd in z (" in printed
    page = assert_self_contained((tmp_path / "out" / "report.html").read_text(encoding="utf-8"))
    # Form "absolute" has the alarm levels of the theory: no flows of the independent model.
    made = {"snapshots.h5", "map.h5", "report.json", "report.html", "report_tables"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == made | {"manifest.json"}
    content = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert content["case"] == 2
    used = content["tables"]["gamma_rules"]["rows"]
    assert used[0][1] == pytest.approx(used[1][1], rel=1e-9)  # this map's gamma is Morozov's
    linked = {link for link in page.links if not link.startswith("#")}
    files = {str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*.*")}
    assert linked < files
    code, printed, _ = run("build", vehicle, "-o", tmp_path / "out")
    assert code == 0
    for name in ("map.h5", "report.json", "report.html"):
        assert f"{name}: up to date, reused" in printed
    held = {one["content"]: one for one in content["made"]["files"]}
    assert list(held) == ["vehicle file", "gauges", "snapshots", "map"]
    for name, path in (("vehicle file", vehicle), ("map", tmp_path / "out" / "map.h5")):
        assert held[name]["sha256"] == sha256(path.read_bytes()).hexdigest()
        assert held[name]["sha256"] in page.text
    # A comment changes the file that the report was made from, and nothing else.
    vehicle.write_text(vehicle.read_text(encoding="utf-8") + "\n# seen\n", encoding="utf-8")
    code, printed, _ = run("build", vehicle, "-o", tmp_path / "out")
    assert code == 0
    assert "map.h5: up to date, reused" in printed
    again = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert again["made"]["files"][0]["sha256"] == sha256(vehicle.read_bytes()).hexdigest()
    hashes = again["tables"].pop("made_from"), content["tables"].pop("made_from")
    assert hashes[0] != hashes[1]
    assert {**again, "made": None} == {**content, "made": None}


def test_check_says_where_the_map_will_hold(run: Run, tmp_path: Path) -> None:
    code, printed, _ = run("check", ogive_with(tmp_path))
    assert code == 0
    cells = [[cell.strip() for cell in line.split("│")] for line in printed.splitlines() if "│" in line]
    lines = {cell[1]: cell[2] for cell in cells}
    assert lines["valid over Mach number"] == "4 to 5"
    assert lines["valid over angle of attack"] == "0 to 6 deg"
    assert lines["valid over sideslip angle"] == "0 to 3 deg"
    assert lines["valid over altitude"] == "0 to 40 km"


def inspected(case: ReportCase, folder: Path, figures: Path | None = None) -> str:
    """What is printed of the case's map, on a wide console."""
    names = ("G[deg]", *case.inverse_map.gauge_names[1:])
    save_inverse_map(replace(case.inverse_map, vehicle="A [deg] B", gauge_names=names), folder / "map.h5")
    out = StringIO()
    inspect_artefact(folder / "map.h5", figures, Console(file=out, width=150))
    return out.getvalue()


def test_a_map_is_shown_with_units(case: ReportCase, tmp_path: Path) -> None:
    """Headings in brackets and names with brackets are no markup."""
    printed = inspected(case, tmp_path)
    for text in ("A [deg] B", "G[deg]", "roll [deg]", "x [m]", "sigma [um/m]", "fraction [%]"):
        assert text in printed
    listed = case.inverse_map.provenance["symmetry"] == "listed"
    assert ("angle of attack" if listed else "total incidence, at any roll angle") in printed
    assert ("0 to 6 deg" if listed else "0 to 6.70575 deg") in printed
    lines = [line.split() for line in printed.splitlines()]
    row = next(line for line in lines if line[:1] == ["G[deg]"])
    one = case.inverse_map
    bias = detectable_bias(one)
    assert row[1] == f"{one.gauge_position[0, 0]:.4g}"
    assert row[5:] == ["0.3", f"{1e6 * bias[0]:.3g}", f"{1e6 * one.strain_range[0]:.3g}"]
    row_of = {line[0]: line for line in lines if line[:1] and line[0].startswith(("C_", "M_"))}
    sigma = np.sqrt(load_covariance(one)[0, 0]) / (one.nominal_dynamic_pressure * one.reference_area)
    assert row_of["C_A"][3] == f"{sigma:.4f}"
    assert ("gamma, found by" in printed) == (one.case == 2)
    assert not list(tmp_path.glob("*figures*"))


@pytest.mark.slow
def test_figures_of_a_map(case_2: ReportCase, tmp_path: Path) -> None:
    printed = inspected(case_2, tmp_path, tmp_path / "figures")
    drawn = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert drawn == ["correlations.png", "eigenvalues.png", "gauge_loss.png", "pair_loss.png"]
    assert all(f"{name}: written" in printed for name in drawn)


def test_eigenvalues_and_biases_of_a_map(case_2: ReportCase, tmp_path: Path) -> None:
    """lambda of the map's own matrices is that of its provenance, 1e-9 of the largest; the bias is Baarda's."""
    case = case_2
    save_inverse_map(case.inverse_map, tmp_path / "map.h5")
    one = load_inverse_map(tmp_path / "map.h5")
    values = hessian_eigenvalues(one)
    np.testing.assert_allclose(values, one.provenance["hessian_eigenvalues"], atol=1e-9 * values[0])
    precision = np.linalg.inv(one.noise_covariance + one.state_operator @ one.state_operator.T)
    shift = norm.isf(0.5e-4 / one.n_gauges) + norm.isf(0.01)
    np.testing.assert_allclose(detectable_bias(one), shift / np.sqrt(np.diag(precision)), rtol=1e-6)


def test_ranges_for_a_reader(case: ReportCase) -> None:
    found = {one.quantity: one for one in valid_ranges(case.inverse_map)}
    assert found["Mach number"].text == "4 to 5"
    if case.inverse_map.provenance["symmetry"] == "listed":
        assert found["sideslip angle"].text == "0 to 3 deg"
        assert found["altitude"].text == "22 km"
    else:
        assert "sideslip angle" not in found
        assert found["total incidence, at any roll angle"].text == "0 to 6.70575 deg"
        assert found["altitude"].text == "0 to 40 km"
    assert found["|strain| of the gauge that strains most"].maximum == 1e6 * case.inverse_map.strain_range.max()
    ranges = ("mach_number_range", "altitude_range", "dynamic_pressure_range")
    without = nothing_of(*ranges)
    older = replace(case.inverse_map, provenance={"altitude_m": 22e3}, **without)
    assert valid_ranges(older)[0] == ValidRange(quantity="altitude", minimum=22.0, maximum=22.0, unit="km")
