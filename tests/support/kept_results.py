"""Results that many tests compute alike, computed once per run: a flow, the strain per pressure of a wall, where a
surface cuts itself.

All are functions of their arguments alone, as long as no test changes a constant of their modules. The first
process that calls one computes it, as the product does; the result is kept on disk by the arguments, for all
processes of the run.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from builder.aero import shapes
from builder.aero.engines import euler
from builder.structure.fourier import strain_operator

SOLVE_FLOW, RESPONSE_OF_ROWS = euler.solve_flow, strain_operator.response_of_rows
PIERCED_PLACES = shapes.pierced_places


def kept(folder: Path, arguments: object, compute: Callable[[], Any]) -> Any:
    """Return what was kept of ``arguments`` in ``folder``, or compute and keep it; errors are not kept."""
    file = folder / sha256(pickle.dumps(arguments)).hexdigest()
    if not file.exists():
        found = compute()
        own = file.with_name(f"{file.name}.{os.getpid()}.{id(found)}")
        own.write_bytes(pickle.dumps(found))
        own.replace(file)
        return found
    return pickle.loads(file.read_bytes())


@contextmanager
def kept_results(folder: Path) -> Iterator[None]:
    """Keep flows of bodies of revolution, strain per pressure of the Fourier model and self-intersections."""
    folder.mkdir(exist_ok=True)

    def flow(*arguments: Any) -> Any:
        return kept(folder, arguments, lambda: SOLVE_FLOW(*arguments))

    def response(
        mesh: Any, material: Any, rows: Any, station_x: Any, max_harmonic: int, progress: Any = None
    ) -> Any:
        """Rows follow from the gauges' stations, which rows of the first two harmonics identify."""
        shown = [sha256(np.ascontiguousarray(rows(m)).tobytes()).digest() for m in (0, 1)]
        found = kept(
            folder,
            (mesh, material, shown, station_x, max_harmonic),
            lambda: RESPONSE_OF_ROWS(mesh, material, rows, station_x, max_harmonic),
        )
        if progress is not None:
            progress(max_harmonic + 1, max_harmonic + 1)
        return found

    def pierced(mesh: Any) -> Any:
        return kept(folder, ("pierced", mesh.point, mesh.triangle), lambda: PIERCED_PLACES(mesh))

    with _in_place(flow, response, pierced):
        yield


@contextmanager
def computed_results() -> Iterator[None]:
    """Compute all of them as the product does, for tests of the functions themselves, which change constants."""
    with _in_place(SOLVE_FLOW, RESPONSE_OF_ROWS, PIERCED_PLACES):
        yield


@contextmanager
def _in_place(solve_flow: Any, response_of_rows: Any, pierced_places: Any) -> Iterator[None]:
    with (
        patch.object(euler, "solve_flow", solve_flow),
        patch.object(strain_operator, "response_of_rows", response_of_rows),
        patch.object(shapes, "pierced_places", pierced_places),
    ):
        yield
