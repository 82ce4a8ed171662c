"""Fixtures shared by all tests: the command as a user runs it, and finished demonstrations to look at."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from synthetic_vehicle import SyntheticFiles, make_synthetic_files

from strainfmu.cli.main import main

# Tests run in as many processes as there are processors; threads of BLAS on top would fight for them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

pytest_plugins = ["coarse_vehicle"]

OGIVE = Path(__file__).parent / "acceptance" / "ogive" / "ogive.toml"


SHARED_FIXTURES = ("acceptance", "campaign", "inverse", "reports")
"""Folders whose files share results that take long to make: each runs in one process."""


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep together, where tests run in several processes, what shares fixtures: a file, or one of the folders."""
    for item in items:
        folder = item.path.relative_to(Path(__file__).parent).parts[0]
        group = folder if folder in SHARED_FIXTURES else str(item.path)
        item.add_marker(pytest.mark.xdist_group(group))


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Return a function that runs ``strainfmu`` with arguments: (exit code, standard output, standard error)."""

    def call(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        captured = capfd.readouterr()
        return int(ended.value.code or 0), captured.out, captured.err

    return call


def _demo(folder: Path, *arguments: str) -> str:
    """Run the installed command for a demonstration in its own process and return what it printed."""
    command = [
        sys.executable,
        "-c",
        "from strainfmu.cli.main import main; main()",
        "demo",
        "-o",
        str(folder),
        *arguments,
    ]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


@pytest.fixture(scope="session")
def ic3x_demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a finished demonstration of the shipped vehicle."""
    folder = tmp_path_factory.mktemp("ic3x") / "demo"
    (folder.parent / "printed.txt").write_text(_demo(folder), encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def ogive_demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a finished demonstration of the second, coarse vehicle."""
    folder = tmp_path_factory.mktemp("ogive") / "demo"
    (folder.parent / "printed.txt").write_text(_demo(folder, "--vehicle", str(OGIVE)), encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> SyntheticFiles:
    """Return the paths of synthetic maps, a flight model, a trajectory and FMUs of them."""
    return make_synthetic_files(tmp_path_factory.mktemp("synthetic"))
