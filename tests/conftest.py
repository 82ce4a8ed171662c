"""Fixtures shared by all tests: the command as a user runs it, and what takes long to make, made once per run."""

from __future__ import annotations

import os

# Tests run in as many processes as there are processors; threads of BLAS on top would fight for them.
# The setting acts on a numpy that is imported later.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# A lower level of optimisation: numba compiles the flow solver faster, and its flows take as long.
os.environ.setdefault("NUMBA_OPT", "1")
os.environ["STRAINFMU_CACHE"] = ""  # a test finds nothing that another left

import gc
import pickle
import re
import subprocess
import sys
from collections.abc import Callable, Generator, Iterator
from functools import cache
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING

import hypothesis
import lark
import pytest
from kept_results import folder_of_sources, kept_results
from ogive import OGIVE
from once import folder_of_run, once
from sweeps import SLOW
from synthetic_vehicle import SyntheticFiles, make_synthetic_files, synthetic_files
from undrawn_figures import draw_nothing

from strainfmu import archive
from strainfmu.cli.main import main

if TYPE_CHECKING:
    from builder.truth.true_structure import TrueStructure

# An example may be the first call of a compiled function, and other processes may use the machine.
hypothesis.settings.register_profile("strainfmu", deadline=None)
hypothesis.settings.load_profile("strainfmu")

pytest_plugins = ["coarse_vehicle", "as_built_case"]

TESTS = Path(__file__).parent
TOGETHER = {
    **{folder: (folder,) for folder in ("golden", "inverse", "reports")},
    "sources": (
        "test_layout.py",
        "test_rooms.py",
        "docs/test_public_names.py",
        "docs/test_word_budgets.py",
        "fmu/description/test_signals_once.py",
    ),
}
"""Folders and files that share results in memory that cost more than the tests: each group runs in one process."""

FIRST = (
    "acceptance/test_demo.py",
    "can/test_campaign.py",
    "can/test_guards.py",
    "inverse",
    "reports",
    "campaign/test_resume.py",
    "campaign/test_dask_workers.py",
    "golden",
    "structure/test_structure_command.py",
    "structure/test_solid_model_maps.py",
    "docs/test_snippets.py",
    "trial/test_run.py",
    "pipeline/test_used_files.py",
    "fmu/native/test_build_from_sources.py",
    "pipeline/test_building_interface.py",
    "acceptance/test_shipped_maps.py",
    "fmu/test_export.py",
    "acceptance/test_bad_input.py",
    "can/test_demo_bus.py",
    "can/test_two_processes.py",
)
"""The longest groups, begun first so that no process is left with one at the end.

The second does not need the compiled flow solver, which the first prepares meanwhile.
"""


def pytest_configure(config: pytest.Config) -> None:
    """Bring arguments of one folder together: pytest 9.1 loses its fixtures when it comes to it a second time.

    And have Python keep what it compiles: hundreds of processes run the same modules.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False

    def folder(argument: str) -> Path:
        path = Path(argument.partition("::")[0])
        return path if path.is_dir() else path.parent

    config.args.sort(key=folder)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect tests without looking for garbage among what they import: there is none, then and later.

    The tests themselves leave little that is not freed at once: looking for it as often as Python does by default
    took 7 % of their processor time.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 10, 10)
        gc.enable()


LET_GO: list[bool] = []
"""Not empty once a bridge, at its end, has let go what was frozen."""


def freeze_again() -> None:
    """Freeze what is there again behind a bridge: the next one would look through all of it.

    That takes a second where thousands of tests are known. To count what is frozen takes as long.
    """
    if LET_GO:
        LET_GO.clear()
        gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def noted_unfreeze() -> Iterator[None]:
    unfreeze, collect = gc.unfreeze, gc.collect

    def noted() -> None:
        unfreeze()
        LET_GO.append(True)

    def collect_what_is_new(generation: int = 2) -> int:
        freeze_again()
        return collect(generation)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gc, "unfreeze", noted)
        patch.setattr(gc, "collect", collect_what_is_new)
        yield


def pytest_runtest_setup() -> None:
    freeze_again()


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep together, where tests run in several processes, what shares fixtures: a file, or one of the folders."""
    groups = {}
    group_of = {name: group for group, names in TOGETHER.items() for name in names}
    paths = {path: path.relative_to(TESTS) for path in {item.path for item in items}}
    for item in items:
        if {"fast", "slow"} <= {mark.name for mark in item.iter_markers()}:
            raise pytest.UsageError(f"{item.nodeid}: marked both fast and slow")
        path = paths[item.path]
        groups[item] = group_of.get(path.parts[0]) or group_of.get(path.as_posix()) or path.as_posix()
        item.add_marker(pytest.mark.xdist_group(groups[item]))
    missing = [name for name in (*FIRST, *group_of) if not (TESTS / name).exists()]
    if missing:
        raise pytest.UsageError(f"tests/conftest.py: not among the tests: {', '.join(missing)}")
    order = {name: position for position, name in enumerate(FIRST)}
    items.sort(key=lambda item: order.get(groups[item], len(FIRST)))


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str], undrawn: None) -> Callable[..., tuple[int, str, str]]:
    """Return a function that runs ``strainfmu`` with arguments: (exit code, standard output, standard error).

    Its figures are made and not drawn, but for tests marked ``drawn``.
    """

    def call(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        captured = capfd.readouterr()
        return int(ended.value.code or 0), captured.out, captured.err

    return call


@pytest.fixture
def undrawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Write a point for every figure, for tests of all else: drawing takes most of a report's time."""
    if request.node.get_closest_marker("drawn") is None:
        draw_nothing(monkeypatch.setattr)


LEVELS = """
from builder.reports.findings.envelope_states import envelope
from builder.trial.levels import level_readings
envelope.__defaults__ = (5, 4)
level_readings.__kwdefaults__["conditions"] = 1000
"""
"""Alarm levels of maps from 10,000 samples, not from the 40,000 of the product. And
reports that judge the nonlinear estimator at 5 Mach numbers and 4 incidences, not at 13 and 12.

Tests that take minutes hold the false alarms of the shipped map to the stated rate: nothing is changed for them.
"""


@pytest.fixture(scope="session")
def is_quick(request: pytest.FixtureRequest) -> bool:
    """Return whether the run is without tests that take minutes, for which nothing is changed."""
    return not any(item.get_closest_marker("slow") for item in request.session.items)


@pytest.fixture(scope="session", autouse=True)
def kept_folder(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, is_quick: bool
) -> Iterator[Path]:
    """Keep what many tests compute alike, for later runs in the cache of pytest; return the folder.

    Flows of the shipped vehicle are solved on a coarser grid.
    """
    cache = getattr(request.config, "cache", None)
    parent = folder_of_run(tmp_path_factory) if cache is None else cache.mkdir("kept")
    folder = folder_of_sources(parent)
    with kept_results(folder, is_coarse=is_quick):
        yield folder


@pytest.fixture(scope="session", autouse=True)
def few_samples(is_quick: bool) -> str:
    """Have builds draw few samples, reports judge few states; return the statements for another process."""
    if is_quick:
        exec(LEVELS, {})
    return LEVELS if is_quick else ""


@pytest.fixture(scope="session", autouse=True)
def quickly_packed() -> None:
    """Pack FMUs, of which tests make hundreds, without compressing them."""
    archive.LEVEL = 0


@pytest.fixture(scope="session", autouse=True)
def names_parsed_once() -> Iterator[None]:
    """Have FMPy parse a name of a variable once: FMUs of tests have many in common, but for their indices."""
    parser, parsed = cache(lark.Lark), cache(lark.Lark.parse)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lark.Lark, "parse", lambda grammar, name: parsed(grammar, re.sub(r"[1-9]\d*", "1", name)))
        patch.setattr(lark, "Lark", parser)
        yield


DEMO = """
import sys
from pathlib import Path
sys.path.insert(0, {support!r})
from kept_results import kept_results
from strainfmu.cli.main import main
{statements}
with kept_results(Path({kept!r}), is_coarse={is_coarse}):
    main()
"""


UNDRAWN = """
from undrawn_figures import draw_nothing
draw_nothing(setattr)
"""


@pytest.fixture(scope="session")
def demonstration(kept_folder: Path, few_samples: str, is_quick: bool) -> Callable[..., None]:
    """Return a function that runs the demonstration in its own process; it is drawn where tests take minutes.

    It leaves ``demo`` and ``printed.txt`` in ``folder``.
    """

    def run_it(folder: Path, *arguments: str) -> None:
        statements = few_samples + (UNDRAWN if is_quick else "")
        program = DEMO.format(
            support=str(TESTS / "support"), kept=str(kept_folder), statements=statements, is_coarse=is_quick
        )
        command = [sys.executable, "-c", program, "demo", "-o", str(folder / "demo"), *arguments]
        finished = subprocess.run(command, capture_output=True, text=True, check=False)
        assert finished.returncode == 0, finished.stderr
        (folder / "printed.txt").write_text(finished.stdout, encoding="utf-8")

    return run_it


@pytest.fixture(scope="session")
def compiled_solver(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Let one process compile the flow solver, where that is not kept on disk yet, before others need it."""

    def compile_it(folder: Path) -> None:
        from builder.aero.euler.bodies.solver import solve_flow
        from builder.aero.euler.planes import MarchingGrid
        from builder.vehicle.shape.geometry import chain_segments

        if os.environ.get("NUMBA_DISABLE_JIT", "0") == "0":
            cone = chain_segments([(1.0, radians(8.0), radians(8.0))])
            solve_flow(cone, 6.0, radians(2.0), MarchingGrid(n_radial=12, n_circumferential=16))

    once(tmp_path_factory, "compiled_solver", compile_it)


@pytest.fixture(scope="session")
def ic3x_demo(
    tmp_path_factory: pytest.TempPathFactory, compiled_solver: None, demonstration: Callable[..., None]
) -> Path:
    """Return the folder of a finished demonstration of the shipped vehicle."""
    return once(tmp_path_factory, "ic3x", demonstration) / "demo"


@pytest.fixture(params=["two thirds of the cells", pytest.param("all cells", marks=SLOW)])
def demo_by_grid(ic3x_demo: Path) -> Path:
    """Return the same, for tests that the slow ones repeat: there its flows have all of their cells."""
    return ic3x_demo


@pytest.fixture(scope="session")
def ic3x_truth(tmp_path_factory: pytest.TempPathFactory) -> TrueStructure:
    """Return the structure of the shipped vehicle's independent model."""

    def solve(folder: Path) -> None:
        from builder.truth.true_structure import true_structure
        from builder.vehicle.file import IC3X, load_vehicle

        (folder / "structure.pickle").write_bytes(pickle.dumps(true_structure(load_vehicle(IC3X))))

    found: TrueStructure = pickle.loads(
        (once(tmp_path_factory, "ic3x_truth", solve) / "structure.pickle").read_bytes()
    )
    return found


@pytest.fixture(scope="session")
def ogive_demo(
    tmp_path_factory: pytest.TempPathFactory, compiled_solver: None, demonstration: Callable[..., None]
) -> Path:
    """Return the folder of a finished demonstration of the second, coarse vehicle."""
    return once(tmp_path_factory, "ogive", lambda folder: demonstration(folder, "--vehicle", str(OGIVE))) / "demo"


@pytest.fixture(scope="session")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> SyntheticFiles:
    """Return the paths of synthetic maps, a flight model, a trajectory and FMUs of them."""
    return synthetic_files(once(tmp_path_factory, "synthetic", make_synthetic_files))
