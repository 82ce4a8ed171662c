"""A compiled library carries the digest of its C sources: one of other sources is neither loaded nor exported."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from raw_fmu import this_platform

from strainfmu.errors import InputError
from strainfmu.estimator import core
from strainfmu.estimator.library_sources import LIBRARIES, MARK, library_digest
from strainfmu.fmu.native import package
from strainfmu.fmu.native.build import NATIVE, PLATFORMS, library_file

pytestmark = pytest.mark.fast

HEALTH = "estimator/linear/linear.c"
REFUSED = (
    rf"^fmus/native/binaries/{this_platform()}/estimator: expected a library of the C sources in fmus/native,"
    rf" got one of other sources; build it: python -m strainfmu\.fmu\.native\.build {this_platform()}$"
)


@pytest.fixture
def native(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of sources and libraries, which Python loads and exports."""
    copy = Path(shutil.copytree(NATIVE, tmp_path / "fmus" / "native"))
    used = library_file(this_platform(), folder=copy / "binaries")
    monkeypatch.setattr(core, "library_file", lambda: used)
    monkeypatch.setattr(package.resources, "files", lambda _: tmp_path / "fmus")
    return copy


def edit(native: Path) -> None:
    """Change the rule of health in the sources."""
    text = (native / HEALTH).read_text()
    assert "health_state" in text
    (native / HEALTH).write_text(text.replace("health_state", "state_of_health"))


def load() -> None:
    core.library.__wrapped__()


def test_a_library_of_its_sources_is_loaded(native: Path) -> None:
    load()


def test_a_library_of_other_sources_is_not_loaded(native: Path) -> None:
    edit(native)
    with pytest.raises(InputError, match=REFUSED):
        load()


def test_a_library_without_a_digest_is_not_loaded(native: Path) -> None:
    path = core.library_file()
    path.write_bytes(path.read_bytes().replace(MARK.encode(), b"?" * len(MARK)))
    with pytest.raises(InputError, match=REFUSED):
        load()


def test_line_ends_of_windows_are_no_other_sources(native: Path) -> None:
    for path in native.rglob("*.[ch]"):
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    load()


def test_without_sources_any_library_is_loaded(native: Path) -> None:
    for folder in (*native.iterdir(),):
        if folder.is_dir() and folder.name != "binaries":
            shutil.rmtree(folder)
    load()


def test_no_fmu_holds_a_library_of_other_sources(native: Path) -> None:
    assert len(package.chosen_libraries("estimator", None, "3")) == len(PLATFORMS)
    edit(native)
    with pytest.raises(InputError, match="estimator: expected a library of the C sources"):
        package.chosen_libraries("estimator", None, "2")
    with pytest.raises(InputError, match=REFUSED):
        package.chosen_libraries("estimator", [this_platform()], "2")
    package.chosen_libraries("plant", None, "2")  # which has no part of what was changed


@pytest.mark.parametrize("library", LIBRARIES)
def test_the_digest_is_of_all_sources(library: str, native: Path) -> None:
    digests = {library_digest(library, native)}
    changed = ["core/state.c", "core/model.h", "fmi2/fmi2_state.c", "fmi3/fmi3.h"]
    changed += ["bus/signals.h", HEALTH] if library == "estimator" else ["plant/plant.c", "schedule/schedule.c"]
    for name in changed:
        with (native / name).open("a") as stream:
            stream.write("/* changed */\n")
        digests.add(library_digest(library, native))
    (native / "core" / "new.c").write_text("")
    (native / "core" / "new.c").rename(native / "core" / "newer.c")
    digests.add(library_digest(library, native))
    assert len(digests) == len(changed) + 2
