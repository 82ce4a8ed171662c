"""A workspace computes what it must and nothing twice."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from builder.vehicle.file import VEHICLES
from builder.workspace import MANIFEST, SHARED_VARIABLE, Cache, Workspace
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


class Maker:
    """Writes a text and counts how often."""

    def __init__(self, text: str = "result") -> None:
        self.text, self.times = text, 0

    def __call__(self, path: Path) -> None:
        self.times += 1
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(self.text)


def test_result_is_made_once(tmp_path: Path) -> None:
    make = Maker()
    assert Workspace(tmp_path / "new").ensure("a", {"x": 1.5}, make) == ""
    assert Workspace(tmp_path / "new").ensure("a", {"x": 1.5}, make) == "up to date"
    assert make.times == 1


@pytest.mark.parametrize("changed", [{"x": 1.6}, {"x": 1.5, "y": 0}, {"x": [1.5]}, {}])
def test_other_inputs_make_it_again(changed: dict[str, object], tmp_path: Path) -> None:
    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {"x": 1.5}, make)
    before = workspace.made_from("a")
    assert workspace.ensure("a", changed, make) == ""
    assert workspace.made_from("a") != before
    assert make.times == 2
    assert workspace.ensure("a", changed, make) == "up to date"


def test_order_and_type_of_arrays_do_not_matter(tmp_path: Path) -> None:
    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {"x": np.array([1.0, 2.0]), "y": np.float64(3.0)}, make)
    assert workspace.ensure("a", {"y": 3.0, "x": [1.0, 2.0]}, make) == "up to date"


def test_other_version_makes_it_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {}, make)
    monkeypatch.setattr("builder.workspace.__version__", "999")
    assert workspace.ensure("a", {}, make) == ""


def spoil(path: Path) -> None:
    path.write_text("resulT")


def remove(path: Path) -> None:
    path.unlink()


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1])


@pytest.mark.parametrize("damage", [spoil, remove, cut])
def test_damaged_result_is_made_again(damage: Callable[[Path], None], tmp_path: Path) -> None:
    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {}, make)
    damage(workspace.path("a"))
    assert workspace.ensure("a", {}, make) == ""
    assert workspace.path("a").read_text() == "result"
    assert make.times == 2


@pytest.mark.parametrize("content", [b"", b"{", b"[1, 2]", b"\xff\xfe", b'{"other": {}}'])
def test_damaged_manifest_makes_all_again(content: bytes, tmp_path: Path) -> None:
    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {}, make)
    workspace.path(MANIFEST).write_bytes(content)
    assert workspace.ensure("a", {}, make) == ""
    assert workspace.ensure("a", {}, make) == "up to date"


def test_failure_leaves_what_was_there(tmp_path: Path) -> None:
    def fail(path: Path) -> None:
        raise InputError("no")

    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {"x": 1}, make)
    with pytest.raises(InputError):
        workspace.ensure("a", {"x": 2}, fail)
    assert workspace.ensure("a", {"x": 1}, make) == "up to date"


def test_results_do_not_disturb_each_other(tmp_path: Path) -> None:
    a, b, workspace = Maker("a"), Maker("b"), Workspace(tmp_path)
    workspace.ensure("a", {}, a)
    workspace.ensure("b", {"of": workspace.made_from("a")}, b)
    assert workspace.ensure("a", {}, a) == "up to date"
    assert workspace.ensure("b", {"of": workspace.made_from("a")}, b) == "up to date"
    assert (a.times, b.times) == (1, 1)


def test_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("")
    with pytest.raises(InputError, match="is a file, must be a folder"):
        Workspace(path)
    with pytest.raises(InputError, match=r"expected a folder of results, got the name of a \.h5 file"):
        Workspace(tmp_path / "map.h5")


def test_folders_share_what_one_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the same inputs, undamaged, marked as shared; a results folder may be removed."""
    monkeypatch.delenv(SHARED_VARIABLE)
    make, cache = Maker(), Cache(tmp_path)
    first, second, third = (Workspace(tmp_path / name, cache) for name in "123")
    first.ensure("a.h5", {"x": 1}, make, shared=True)
    first.ensure("b.h5", {"x": 1}, make)
    first.path("a.h5").unlink()
    assert second.ensure("a.h5", {"x": 1}, make, shared=True) == f"from {tmp_path / '.strainfmu'}"
    assert second.ensure("a.h5", {"x": 1}, make, shared=True) == "up to date"
    assert second.path("a.h5").read_text() == "result"
    assert second.ensure("b.h5", {"x": 1}, make, shared=True) == ""
    assert second.ensure("a.h5", {"x": 2}, make, shared=True) == ""
    file = cache.find("a.h5", {"x": 1})
    assert file is not None
    file.write_text("damaged")
    assert cache.find("a.h5", {"x": 1}) is None
    assert third.ensure("a.h5", {"x": 1}, make, shared=True) == ""
    monkeypatch.setattr("builder.workspace.LARGEST_CACHE", 0.0)
    third.ensure("a.h5", {"x": 3}, make, shared=True)
    assert not list((tmp_path / ".strainfmu").iterdir())
    assert third.path("a.h5").is_file()


def test_shipped_vehicles_have_a_cache_where_one_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert Cache(tmp_path).folder is None  # as the tests set it
    monkeypatch.delenv(SHARED_VARIABLE)
    assert Cache(VEHICLES).folder is None
    monkeypatch.setenv(SHARED_VARIABLE, str(tmp_path))
    assert Cache(VEHICLES).folder == tmp_path
