"""The public building interface: what notebooks and scripts call gives what the commands write."""

import subprocess
import sys
from contextlib import contextmanager
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from ogive import OGIVE

import builder
from builder.inverse.mode_choice import mode_choice_lines
from builder.reporting import Silent
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.structure_file import Structure
from builder.vehicle.gauges.gauge_entries import GaugeLayoutEntry
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import SCHEMA, SCHEMA_VERSION, load_inverse_map, save_inverse_map
from strainfmu.files import content_hash_of


@pytest.fixture(scope="module")
def ogive() -> builder.Vehicle:
    return builder.load_vehicle(OGIVE)


@pytest.fixture(scope="module")
def nominal(ogive: builder.Vehicle) -> builder.Vehicle:
    """With the alarm levels of the theory: flights of the independent model take longer than all else."""
    return ogive.model_copy(update={"map": ogive.map.model_copy(update={"alarm_levels": "nominal"})})


@pytest.fixture(scope="module")
def ogive_snapshots(ogive: builder.Vehicle) -> builder.Snapshots:
    return builder.take_snapshots(ogive)


class Listener(Silent):
    """Keeps the titles of stages and the notes."""

    def __init__(self) -> None:
        self.stages: list[str] = []
        self.notes: list[str] = []

    @contextmanager
    def stage(self, title):
        self.stages.append(title)
        yield lambda done, of: None

    def note(self, text: str) -> None:
        self.notes.append(text)


def test_import_is_cheap_and_names_come_when_used() -> None:
    code = (
        "import sys, builder; heavy = {'numpy', 'scipy', 'numba', 'pydantic', 'h5py', 'rich'} & set(sys.modules);"
        "assert not heavy, heavy; assert set(builder.__all__) <= set(dir(builder));"
        "builder.build_map; assert 'scipy' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", builder.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(builder, name) is not None
    assert name in dir(builder)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'builder' has no attribute 'nothing'"):
        builder.nothing  # noqa: B018  # the access itself is the test


def hash_of(path: Path) -> str:
    """Hash of all that a map holds but the time of its build."""
    return content_hash_of(path, SCHEMA, SCHEMA_VERSION)


@pytest.mark.slow
def test_the_map_is_that_of_the_demonstration_bit_for_bit(ogive_demo: Path, tmp_path: Path) -> None:
    save_inverse_map(builder.build_map(str(OGIVE)), tmp_path / "map.h5")
    assert hash_of(tmp_path / "map.h5") == hash_of(ogive_demo / "map.h5")


@pytest.fixture(scope="module")
def told(
    ogive: builder.Vehicle, ogive_snapshots: builder.Snapshots, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Listener, Path]:
    """What a listener was told of a build from stages solved one by one, and the map."""
    structure = builder.solve_structure(ogive)
    assert isinstance(structure, StructuralModel)
    n_nodes = ogive_snapshots.pressure.shape[1]
    assert structure.strain_operator("table").shape == (len(structure.layouts["table"].names), n_nodes)
    listener, path = Listener(), tmp_path_factory.mktemp("told") / "map.h5"
    given = {"snapshots": ogive_snapshots, "structure": structure}
    save_inverse_map(builder.build_map(ogive, **given, progress=listener), path)
    return listener, path


def test_the_stages_one_by_one_give_the_same_map(told: tuple[Listener, Path], ogive_demo: Path) -> None:
    assert hash_of(told[1]) == hash_of(ogive_demo / "map.h5")


def test_snapshots_are_those_of_the_demonstration(
    ogive_snapshots: builder.Snapshots, ogive_demo: Path, tmp_path: Path
) -> None:
    builder.save_snapshots(ogive_snapshots, str(tmp_path / "snapshots.h5"))
    for path in (tmp_path / "snapshots.h5", str(ogive_demo / "snapshots.h5")):
        read = builder.load_snapshots(path)
        for name in ("condition", "pressure", "internal_pressure", "point", "solved", "flow", "momentum_error"):
            assert np.array_equal(getattr(read, name), getattr(ogive_snapshots, name), equal_nan=True), name


def test_nothing_is_written_and_nothing_printed(
    nominal: builder.Vehicle,
    ogive_snapshots: builder.Snapshots,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    builder.build_map(nominal, snapshots=ogive_snapshots)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_progress_is_shown_where_it_is_requested(
    nominal: builder.Vehicle, ogive_snapshots: builder.Snapshots, capfd: pytest.CaptureFixture[str]
) -> None:
    builder.build_map(nominal, snapshots=ogive_snapshots, progress=True)
    assert "Structure: strain per pressure" in capfd.readouterr().out


def test_a_listener_is_told_every_stage(told: tuple[Listener, Path]) -> None:
    listener, path = told
    assert listener.stages == [
        "Flow: the vehicle that flies",
        "Structure: the vehicle that flies",
        "Alarm levels: flights of the independent model",
    ]
    assert any("4 modes hold" in note for note in listener.notes)
    lines = mode_choice_lines(load_inverse_map(path).provenance)
    assert lines
    assert [note for note in listener.notes if note in lines] == lines


@pytest.mark.slow
def test_the_solid_structure_is_mapped_onto_the_snapshots(
    nominal: builder.Vehicle, ogive_snapshots: builder.Snapshots
) -> None:
    entries = nominal.structure.model_copy(update={"model": "solid", "resolution": "coarse"})
    solid = nominal.model_copy(update={"structure": entries})
    structure = builder.solve_structure(solid)
    assert isinstance(structure, Structure)
    by_solid = builder.build_map(solid, snapshots=ogive_snapshots, structure=structure)
    by_fourier = builder.build_map(nominal, snapshots=ogive_snapshots)
    assert by_solid.provenance["structural_model"].startswith("swept_hexahedra")
    assert by_solid.provenance["structure"]["resolution"] == "coarse"
    thicker = solid.model_copy(update={"structure": entries.model_copy(update={"wall_thickness_mm": 4.0})})
    with pytest.raises(InputError, match=r"^structure: structure.wall_thickness_mm: expected 4, got 3$"):
        builder.build_map(thicker, snapshots=ogive_snapshots, structure=structure)
    longer = nominal.profile[1].model_copy(update={"end_x_m": 2.6})
    with pytest.raises(InputError, match=r"^snapshots: profile.2.end_x_m: expected 2.6, got 2.5$"):
        builder.build_map(
            nominal.model_copy(update={"profile": [nominal.profile[0], longer]}), snapshots=ogive_snapshots
        )
    difference = np.linalg.norm(by_solid.mean_strain - by_fourier.mean_strain)
    assert difference < 0.05 * np.linalg.norm(by_fourier.mean_strain)


def test_too_many_modes_are_refused_before_the_flows_are_solved(ogive: builder.Vehicle) -> None:
    greedy = ogive.model_copy(update={"map": ogive.map.model_copy(update={"modes": 1000})})
    listener = Listener()
    with pytest.raises(InputError, match=r"map\.modes: 1000 found"):
        builder.build_map(greedy, progress=listener)
    assert listener.stages == []


class Text(HTMLParser):
    """Keeps tags, text and the number of drawn gauges; fails on tags that do not close."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text, self.circles = "", 0
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag != "br":
            self.open.append(tag)
        assert tag != "script"

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.circles += tag == "circle"

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data + " "


def test_a_vehicle_shows_itself_in_a_notebook() -> None:
    shown = Text(builder.load_vehicle(builder.IC3X)._repr_html_())
    for part in ("IC3X surrogate", "3.6 m", "4 mm", "54 gauges", "90: M 5 to 7", "euler", "1 % of the median"):
        assert part in shown.text, part
    assert shown.circles == 27  # 9 stations at three heights; of two gauges at one position one is drawn


def test_a_vehicle_with_gauges_from_a_table_shows_itself(ogive: builder.Vehicle) -> None:
    shown = Text(ogive._repr_html_())
    assert "0.3 um/m per gauge" in shown.text
    assert shown.circles > 0


def test_text_of_the_vehicle_file_is_escaped_and_a_lost_table_is_no_error(ogive: builder.Vehicle) -> None:
    layouts = {"<b>table": GaugeLayoutEntry(file="lost.csv")}
    gauges = ogive.gauges.model_copy(update={"layout": "<b>table", "layouts": layouts})
    shown = Text(
        ogive.model_copy(update={"name": "<script>alert(1)</script> & co", "gauges": gauges})._repr_html_()
    )
    assert "<script>alert(1)</script> & co" in shown.text
    assert "<b>table" in shown.text
    assert shown.circles == 0
