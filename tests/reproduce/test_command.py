"""``strainfmu reproduce --quick``, as a user runs it."""

import csv
import json
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest

from builder.reproduce.published import PUBLISHED
from builder.reproduce.setups import TITLES


@pytest.mark.slow
def test_every_published_number_is_compared_in_every_set_up(quick_run: tuple[Path, str]) -> None:
    folder, _ = quick_run
    with (folder / "tables" / "parity_numbers.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert {(row["key"], row["set-up"]) for row in rows} == {(key, setup) for key in PUBLISHED for setup in TITLES}
    assert all(row["our low"] for row in rows if row["key"] not in ("gamma",))
    numbers = json.loads((folder / "numbers.json").read_text(encoding="utf-8"))
    assert set(numbers) >= {"parity", "criteria", "readings", "layout_45", "noise_free", "symmetry_classes"}


@pytest.mark.slow
def test_agreement_by_the_mesh_is_not_shown_as_agreement(quick_run: tuple[Path, str]) -> None:
    """The noise-free field of maps with data of their own mesh stands next to the one of a symmetric model."""
    folder, printed = quick_run
    numbers = json.loads((folder / "numbers.json").read_text(encoding="utf-8"))
    crime = {(row[0], row[1]): row[2] for row in numbers["noise_free"]["rows"]}
    exact = crime["fourier", "fourier"]
    row = next(row for row in numbers["parity"]["rows"] if row[0].startswith("M5 a6 b6, no noise"))
    for model, shown in (("tetrahedra", row[3]), ("hexahedra", row[4])):
        assert exact > 5.0 * crime[model, model]
        assert shown == f"{crime[model, model]:.3g} % by the mesh's asymmetry; {exact:.3g} % on a symmetric model"
    assert "symmetric" not in row[5]
    assert "on coarse grids, not converged" in printed


@pytest.mark.slow
def test_coarse_grids_keep_the_source_s_findings(quick_run: tuple[Path, str]) -> None:
    # Bands, not values: the grids are coarse.
    numbers = json.loads((quick_run[0] / "numbers.json").read_text(encoding="utf-8"))
    rows = {(row[0], row[5]): row[6:] for row in numbers["parity_numbers"]["rows"]}
    for setup in ("paper_like", "same_mesh"):
        assert rows["energy", setup][0] >= 99.0
        assert 5.0 <= rows["field_1", setup][0] <= 11.25
        assert 3.7 <= rows["field_2", setup][0] <= 8.25
        assert rows["c_n", setup][1] < 2.0
        assert rows["m_p", setup][1] < 3.4
        assert 2.0 <= rows["c_a_mean", setup][0] <= 8.0
        assert rows["decay", setup][0] >= 1e4
    # The published layout cannot see the field at M5 a6 b6; data of the map's own asymmetric mesh hide that.
    assert rows["noise_free", "paper_like"][0] < 5.0
    assert rows["noisy", "same_mesh"][0] > 13.3
    classes = [row for row in numbers["symmetry_classes"]["rows"] if row[2] == "odd in y, odd in z"]
    ranks = {(row[0], row[1]): row[4] for row in classes}
    assert ranks["hexahedra", "configuration_2"] == 0
    assert ranks["hexahedra", "configuration_45"] > 0
    layout = {(row[0], row[1]): row[2:] for row in numbers["layout_45"]["rows"]}
    published, ours = (layout[TITLES["independent"], "M5 a6 b6, 100 draws"][i] for i in (1, 4))
    assert ours < 0.5 * published


class _Page(HTMLParser):
    """Collects what a page loads from elsewhere, and its pictures and headings."""

    def __init__(self) -> None:
        super().__init__()
        self.outside: list[str] = []
        self.pictures = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        held = dict(attrs)
        source = held.get("src") or ""
        if tag == "img":
            self.pictures += source.startswith("data:image/png;base64,")
        elif source or tag in ("script", "link"):
            self.outside.append(tag)


@pytest.mark.slow
def test_report_needs_no_other_file(quick_run: tuple[Path, str]) -> None:
    page = _Page()
    page.feed((quick_run[0] / "report.html").read_text(encoding="utf-8"))
    assert page.outside == []
    assert page.pictures == len(list((quick_run[0] / "figures").glob("*.png"))) >= 17


@pytest.mark.slow
def test_second_run_reuses_what_is_there_and_mends_what_is_damaged(
    quick_run: tuple[Path, str], command: Callable[..., str]
) -> None:
    folder, _ = quick_run
    before = (folder / "numbers.json").read_bytes()
    figure = folder / "figures" / "eigenvalues.png"
    drawn = figure.read_bytes()
    figure.write_bytes(b"damaged")
    printed = command("reproduce", "--quick", "-o", str(folder))
    for name in ("snapshots.h5", "held_out.h5", "tetrahedra.h5", "case_1.h5", "case_2.h5", "measurements.json"):
        assert f"{name}: up to date, reused" in printed
    assert figure.read_bytes() == drawn
    assert (folder / "numbers.json").read_bytes() == before


@pytest.mark.fast
def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path, run) -> None:
    path = tmp_path / "here"
    path.write_text("")
    code, _, error = run("reproduce", "--quick", "-o", path)
    assert (code, error.count("\n")) == (2, 1)
    assert "is a file, must be a folder" in error


@pytest.mark.slow
def test_at_the_paper_s_sizes_all_criteria_but_one_hold(tmp_path: Path, command: Callable[..., str]) -> None:
    """K1/K2 of the shipped rows does not: which rows the source's gauges are on is in no text."""
    command("reproduce", "-o", str(tmp_path / "paper"))
    numbers = json.loads((tmp_path / "paper" / "numbers.json").read_text(encoding="utf-8"))
    missed = {row[0]: row[3] for row in numbers["criteria"]["rows"] if row[4] is not True}
    assert list(missed) == ["K1/K2 of the shipped rows within 20 % of 1.87"]
    assert missed.popitem()[1].startswith("2.34; within it 3 of 8 readings")
