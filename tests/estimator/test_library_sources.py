"""A library carries the digest of its C sources: of other ones Python makes its own, and no FMU gets it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from raw_fmu import this_platform

from strainfmu.errors import InputError
from strainfmu.estimator import core, library_sources
from strainfmu.estimator.library_sources import LIBRARIES, MARK, NoCoreError, library_digest
from strainfmu.fmu.native import package
from strainfmu.fmu.native.build import NATIVE, PLATFORMS, library_file

HEALTH, SOUND = "estimator/sample/health.c", "return OK;"
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
    assert "STATES" in text
    (native / HEALTH).write_text(text.replace("STATES", "TABLE"))


def load() -> str:
    """Return the path of the library that Python loads."""
    return str(core.library.__wrapped__()._name)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def _own_cache(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    monkeypatch.setenv("LOCALAPPDATA", str(cache))
    if shutil.which("cc"):  # optimised it takes three times as long
        (cache / "quick").write_text('#!/bin/sh\nexec cc "$@" -O0\n', encoding="utf-8")
        (cache / "quick").chmod(0o755)
        monkeypatch.setenv("CC", str(cache / "quick"))


@pytest.mark.fast
def test_a_library_of_its_sources_is_loaded(native: Path) -> None:
    assert load() == str(core.library_file())


@pytest.mark.slow
def test_of_other_sources_a_library_is_made_once(
    native: Path, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A changed file is compiled by itself; back to the old text, nothing is."""
    path = core.library_file()
    path.write_bytes(path.read_bytes().replace(MARK.encode(), b"?" * len(MARK)))
    first = load()
    assert Path(first).is_relative_to(cache)
    assert "has a library of other C sources; compiling" in capsys.readouterr().err
    objects = set(cache.rglob("*.o"))
    edit(native)
    second = load()
    assert len(set(cache.rglob("*.o")) - objects) == 1
    capsys.readouterr()
    assert (load(), capsys.readouterr().err) == (second, "")
    assert first != second


@pytest.mark.slow
def test_an_edited_rule_of_health_is_what_python_says(tmp_path: Path, cache: Path) -> None:
    """A copy of the checkout in which health_state says SUSPECT: an estimate of a new interpreter is SUSPECT."""
    for part in ("strainfmu", "fmus"):
        shutil.copytree(NATIVE.parents[1] / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__"))
    source = tmp_path / "fmus" / "native" / HEALTH
    text = source.read_text()
    assert SOUND in text
    source.write_text(text.replace(SOUND, SOUND.replace("OK", "SUSPECT")))
    program = (
        "import strainfmu; from random_map import map_of, random_model;"
        "m = map_of(random_model(gamma=1.0, n_gauges=27, n_states=12));"
        "print(strainfmu.__file__, strainfmu.Estimator(m).estimate(m.mean_strain, 1e5).health.name)"
    )
    support = NATIVE.parents[1] / "tests" / "support"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(support)])}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
    file, state = done.stdout.split()
    assert Path(file).is_relative_to(tmp_path)
    assert state == "SUSPECT"


def test_without_a_compiler_one_line_says_what_to_install(native: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    edit(native)
    monkeypatch.setattr(library_sources.shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "ziglang", None)
    with pytest.raises(
        NoCoreError, match=r"^the compiled estimator: native/binaries/\S+ has a library of other C "
    ):
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
    changed = ["core/state.c", "core/model.h", "fmi2/fmi2.c", "fmi3/fmi3.h"]
    changed += ["bus/signals.h", HEALTH] if library == "estimator" else ["plant/plant.c", "schedule/schedule.c"]
    for name in changed:
        with (native / name).open("a") as stream:
            stream.write("/* changed */\n")
        digests.add(library_digest(library, native))
    (native / "core" / "new.c").write_text("")
    (native / "core" / "new.c").rename(native / "core" / "newer.c")
    digests.add(library_digest(library, native))
    assert len(digests) == len(changed) + 2
