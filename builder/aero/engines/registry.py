"""Registry of the engines, and how each is made for a vehicle. A new engine is one entry of :data:`ENGINES`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from builder.reporting import Note
from strainfmu.errors import InputError

if TYPE_CHECKING:
    from builder.aero.engine import Engine
    from builder.aero.euler.planes import MarchingGrid
    from builder.aero.surface.mesh import SurfaceMesh
    from builder.vehicle.file import Vehicle
    from builder.vehicle.model_entries import Resolution


@dataclass(frozen=True)
class EngineKind:
    """One kind of engine.

    Attributes
    ----------
    make : from the vehicle, a resolution, a level of ``--grid`` (None: the resolution's own cells) and a
        function that takes notes.
    long_work : a flow takes so long that processes are worth starting.
    """

    make: Callable[[Vehicle, Resolution, str | None, Note], Engine]
    long_work: bool


def make_engine(
    vehicle: Vehicle,
    engine_name: str | None,
    resolution: Resolution,
    grid_level: str | None = None,
    note: Note | None = None,
) -> Engine:
    """Return the engine ``engine_name``, or the vehicle file's where that is None.

    ``note`` takes, line by line, what was changed on a surface file.

    Raises
    ------
    InputError
        There is no such engine or grid level, or the vehicle file lacks an entry that the engine needs.
    """
    name = engine_name or vehicle.aerodynamics.engine
    if name not in ENGINES:
        raise InputError(f"engine: '{name}' found, must be one of {', '.join(ENGINES)}")
    return ENGINES[name].make(vehicle, resolution, grid_level, note or (lambda text: None))


def _euler(vehicle: Vehicle, resolution: Resolution, grid_level: str | None, note: Note) -> Engine:
    from builder.aero.engines.euler import EulerEngine
    from builder.aero.euler.planes import marching_grid_of
    from builder.vehicle.shape.geometry import surface_grid

    grid = marching_grid_of(resolution) if grid_level is None else _level(grid_level)
    if not vehicle.is_axisymmetric:
        from builder.aero.engines.euler import FullBodyEngine

        return FullBodyEngine(vehicle.sectioned_body(), grid, *resolution.surface_nodes)
    body = vehicle.body()
    return EulerEngine(body, grid, surface_grid(body, *resolution.surface_nodes))


def _level(name: str) -> MarchingGrid:
    from builder.aero.euler.planes import GRID_LEVELS

    if name not in GRID_LEVELS:
        raise InputError(f"--grid: '{name}' found, must be one of {', '.join(GRID_LEVELS)}")
    return GRID_LEVELS[name]


def _newtonian(vehicle: Vehicle, resolution: Resolution, grid_level: str | None, note: Note) -> Engine:
    from builder.aero.cfd.formats.surface_files import read_surface
    from builder.aero.cfd.units import METRES
    from builder.aero.deflections import deflections_of
    from builder.aero.engines.newtonian import NewtonianEngine, newtonian_engine

    _refuse_level("newtonian", grid_level)
    entries = vehicle.aerodynamics
    options = {
        name: value
        for name, value in (("stagnation", entries.stagnation), ("leeward", entries.leeward))
        if value is not None
    }
    if entries.surface is None:
        surface = _noted_surface(vehicle, resolution, note)
        return NewtonianEngine(surface, **options, deflections=deflections_of(vehicle.flow_entries(), surface))
    path = vehicle.beside(entries.surface)
    mesh = read_surface(path, METRES[entries.surface_length_unit])
    try:
        engine, notes = newtonian_engine(mesh, **options)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    for text in notes:
        note(f"{path.name}: {text}")
    return engine


def _table(vehicle: Vehicle, resolution: Resolution, grid_level: str | None, note: Note) -> Engine:
    from builder.aero.cfd.results_table import table_engine

    _refuse_level("table", grid_level)
    manifest = vehicle.aerodynamics.manifest
    if manifest is None:
        raise InputError("aerodynamics.manifest: entry is missing, the table engine reads its results from there")
    surface = _noted_surface(vehicle, resolution, note)
    return table_engine(vehicle.beside(manifest), surface, tuple(vehicle.conditions.parameters))


def _noted_surface(vehicle: Vehicle, resolution: Resolution, note: Note) -> SurfaceMesh:
    """Return the vehicle's surface; ``note`` takes what was changed on the surface of a file."""
    from builder.aero.shapes import outer_surface

    surface, notes = outer_surface(vehicle, resolution)
    for text in notes:
        note(text)
    return surface


def _refuse_level(engine: str, grid_level: str | None) -> None:
    if grid_level is not None:
        raise InputError(f"--grid: '{grid_level}' found, the {engine} engine has no cells")


ENGINES = {
    "euler": EngineKind(_euler, long_work=True),
    "newtonian": EngineKind(_newtonian, long_work=False),
    "table": EngineKind(_table, long_work=False),
}
