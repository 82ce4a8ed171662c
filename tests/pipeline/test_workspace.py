"""A workspace computes what it must and nothing twice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from builder.workspace import MANIFEST, Workspace
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
    assert Workspace(tmp_path / "new").ensure("a", {"x": 1.5}, make) is False
    assert Workspace(tmp_path / "new").ensure("a", {"x": 1.5}, make) is True
    assert make.times == 1


@pytest.mark.parametrize("changed", [{"x": 1.6}, {"x": 1.5, "y": 0}, {"x": [1.5]}, {}])
def test_other_inputs_make_it_again(changed: dict[str, object], tmp_path: Path) -> None:
    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {"x": 1.5}, make)
    before = workspace.made_from("a")
    assert workspace.ensure("a", changed, make) is False
    assert workspace.made_from("a") != before
    assert make.times == 2
    assert workspace.ensure("a", changed, make) is True


def test_order_and_type_of_arrays_do_not_matter(tmp_path: Path) -> None:
    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {"x": np.array([1.0, 2.0]), "y": np.float64(3.0)}, make)
    assert workspace.ensure("a", {"y": 3.0, "x": [1.0, 2.0]}, make) is True


def test_other_version_makes_it_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {}, make)
    monkeypatch.setattr("builder.workspace.__version__", "999")
    assert workspace.ensure("a", {}, make) is False


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
    assert workspace.ensure("a", {}, make) is False
    assert workspace.path("a").read_text() == "result"
    assert make.times == 2


@pytest.mark.parametrize("content", [b"", b"{", b"[1, 2]", b"\xff\xfe", b'{"other": {}}'])
def test_damaged_manifest_makes_all_again(content: bytes, tmp_path: Path) -> None:
    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {}, make)
    workspace.path(MANIFEST).write_bytes(content)
    assert workspace.ensure("a", {}, make) is False
    assert workspace.ensure("a", {}, make) is True


def test_failure_leaves_what_was_there(tmp_path: Path) -> None:
    def fail(path: Path) -> None:
        raise InputError("no")

    make, workspace = Maker(), Workspace(tmp_path)
    workspace.ensure("a", {"x": 1}, make)
    with pytest.raises(InputError):
        workspace.ensure("a", {"x": 2}, fail)
    assert workspace.ensure("a", {"x": 1}, make) is True


def test_results_do_not_disturb_each_other(tmp_path: Path) -> None:
    a, b, workspace = Maker("a"), Maker("b"), Workspace(tmp_path)
    workspace.ensure("a", {}, a)
    workspace.ensure("b", {"of": workspace.made_from("a")}, b)
    assert workspace.ensure("a", {}, a) is True
    assert workspace.ensure("b", {"of": workspace.made_from("a")}, b) is True
    assert (a.times, b.times) == (1, 1)


def test_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("")
    with pytest.raises(InputError, match="is a file, must be a folder"):
        Workspace(path)
