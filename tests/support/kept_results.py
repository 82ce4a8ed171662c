"""Results that many tests compute alike, computed once: a flow, the strain per pressure of a wall, of the map's
wall as built too, and where a surface cuts itself.

All are functions of their arguments alone, as long as no test changes a constant of their modules. The first
process that calls one computes it, as the product does; the result is kept on disk by the arguments, for all
processes and for later runs of the same sources.
"""

import ast
import os
import pickle
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from builder.aero import shapes
from builder.aero.engines import euler
from builder.aero.euler.planes import MarchingGrid
from builder.structure.as_built import revolved
from builder.structure.fourier import strain_operator
from strainfmu.errors import FlowReachError

SOLVE_FLOW, RESPONSE_OF_ROWS = euler.solve_flow, strain_operator.response_of_rows
REVOLVED_TABLE, PIERCED_PLACES = revolved.revolved_table, shapes.pierced_places
FUNCTIONS = SOLVE_FLOW, RESPONSE_OF_ROWS, REVOLVED_TABLE, PIERCED_PLACES

ROOT = Path(__file__).parents[2]
PACKAGES = ("builder", "strainfmu")
LIBRARIES = ("numba", "numpy", "scipy")
"""What results depend on besides the sources."""

NEWEST = 4
"""States of the sources whose results are kept."""


def imported_sources(modules: Iterable[str]) -> set[Path]:
    """Return the files of ``modules`` and of all modules of the packages that they import, directly or not."""
    waiting, found = list(modules), set[Path]()
    while waiting:
        path = ROOT / waiting.pop().replace(".", "/")
        file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if file in found or not file.is_file():
            continue
        found.add(file)
        for statement in ast.walk(ast.parse(file.read_bytes())):
            if isinstance(statement, ast.ImportFrom) and (statement.module or "").startswith(PACKAGES):
                waiting += [
                    f"{statement.module}",
                    *(f"{statement.module}.{name.name}" for name in statement.names),
                ]
            elif isinstance(statement, ast.Import):
                waiting += [one.name for one in statement.names if one.name.startswith(PACKAGES)]
    return found


def folder_of_sources(parent: Path) -> Path:
    """Return the folder in ``parent`` for results of the sources as they are; folders of old ones go.

    Machine code of numba counts by its date: it may be of older sources until it is deleted.
    """
    sources = sorted(imported_sources(function.__module__ for function in FUNCTIONS))
    state = [sys.version, os.environ.get("NUMBA_DISABLE_JIT"), *map(version, LIBRARIES)]
    state += [sha256(file.read_bytes()).hexdigest() for file in sources]
    compiled = {code for file in sources for code in (file.parent / "__pycache__").glob("*.nbi")}
    state += [f"{code} {code.stat().st_mtime_ns}" for code in sorted(compiled)]
    folder = parent / sha256(repr(state).encode()).hexdigest()[:16]
    with suppress(FileNotFoundError):  # of two runs the other may be cleaning up as well
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        for old in sorted(parent.iterdir(), key=lambda path: path.stat().st_mtime)[:-NEWEST]:
            shutil.rmtree(old, ignore_errors=True)
    return folder


def cached(folder: Path, arguments: object, compute: Callable[[], Any]) -> Any:
    """Return what was kept of ``arguments`` in ``folder``, or compute and keep it, a flow out of reach too."""
    file = folder / sha256(pickle.dumps(arguments)).hexdigest()
    if file.exists():
        result = pickle.loads(file.read_bytes())
    else:
        try:
            result = compute()
        except FlowReachError as error:
            result = error
        temporary = file.with_name(f"{file.name}.{os.getpid()}.{id(result)}")
        temporary.write_bytes(pickle.dumps(result))
        temporary.replace(file)
    if isinstance(result, FlowReachError):
        raise result
    return result


FINE = 36
"""Radial cells of the grid of the shipped vehicle's independent model."""


def coarser(grid: MarchingGrid) -> MarchingGrid:
    """Return the grid, or one of two thirds of its cells each way if it is as fine as the independent model's."""
    if grid.n_radial < FINE:
        return grid
    return replace(grid, n_radial=2 * grid.n_radial // 3, n_circumferential=2 * grid.n_circumferential // 3)


@contextmanager
def kept_results(folder: Path, is_coarse: bool) -> Iterator[None]:
    """Keep flows of bodies of revolution, strain per pressure of Fourier models and self-intersections.

    Flows of the shipped vehicle's independent model are marched on a :func:`coarser` grid if ``is_coarse``.
    """
    folder.mkdir(parents=True, exist_ok=True)

    def flow(body: Any, mach_number: float, incidence: float, grid: MarchingGrid) -> Any:
        given = body, mach_number, incidence, coarser(grid) if is_coarse else grid
        return cached(folder, given, lambda: SOLVE_FLOW(*given))

    def response(
        mesh: Any, material: Any, rows: Any, station_x: Any, max_harmonic: int, progress: Any = None
    ) -> Any:
        """Rows follow from the gauges' stations, which rows of the first two harmonics identify."""
        shown = [sha256(np.ascontiguousarray(rows(m)).tobytes()).digest() for m in (0, 1)]
        solved = cached(
            folder,
            (mesh, material, shown, station_x, max_harmonic),
            lambda: RESPONSE_OF_ROWS(mesh, material, rows, station_x, max_harmonic),
        )
        if progress is not None:
            progress(max_harmonic + 1, max_harmonic + 1)
        return solved

    def table(walled: Any, nominal: Any, x: Any, surface: Any, kinds: Any, wall_step: Any) -> Any:
        given = walled, nominal, x, surface, sorted(kinds), wall_step
        return cached(folder, given, lambda: REVOLVED_TABLE(walled, nominal, x, surface, kinds, wall_step))

    def pierced(mesh: Any) -> Any:
        return cached(folder, ("pierced", mesh.point, mesh.triangle), lambda: PIERCED_PLACES(mesh))

    with _in_place(flow, response, table, pierced):
        yield


@contextmanager
def computed_results() -> Iterator[None]:
    """Compute all of them as the product does, for tests of the functions themselves, which change constants."""
    with _in_place(*FUNCTIONS):
        yield


@contextmanager
def _in_place(solve_flow: Any, response_of_rows: Any, revolved_table: Any, pierced_places: Any) -> Iterator[None]:
    with (
        patch.object(euler, "solve_flow", solve_flow),
        patch.object(strain_operator, "response_of_rows", response_of_rows),
        patch.object(revolved, "revolved_table", revolved_table),
        patch.object(shapes, "pierced_places", pierced_places),
    ):
        yield
