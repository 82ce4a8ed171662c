"""builder: from a vehicle file to an inverse map (off-line package).

    import builder

    vehicle = builder.load_vehicle(builder.IC3X)
    snapshots = builder.take_snapshots(vehicle, progress=True)
    structure = builder.solve_structure(vehicle)
    inverse_map = builder.build_map(vehicle, snapshots=snapshots, structure=structure)

``build_map(vehicle)`` alone runs all stages. Nothing is written to disk. The names below are loaded when they are
first used, so ``import builder`` costs nothing.

The data go one way: :mod:`builder.vehicle` -> :mod:`builder.aero` and :mod:`builder.campaign` (surface pressure),
:mod:`builder.structure` (strain per pressure) -> :mod:`builder.inverse` -> the map, for :mod:`strainfmu`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from builder.campaign.snapshots import Snapshots, load_snapshots, save_snapshots
    from builder.pipeline.stages import build_map, solve_structure, take_snapshots
    from builder.vehicle.file import IC3X, Vehicle, load_vehicle

__all__ = [
    "IC3X",
    "Snapshots",
    "Vehicle",
    "build_map",
    "load_snapshots",
    "load_vehicle",
    "save_snapshots",
    "solve_structure",
    "take_snapshots",
]

_MODULES = {
    "IC3X": "builder.vehicle.file",
    "Snapshots": "builder.campaign.snapshots",
    "Vehicle": "builder.vehicle.file",
    "build_map": "builder.pipeline.stages",
    "load_snapshots": "builder.campaign.snapshots",
    "load_vehicle": "builder.vehicle.file",
    "save_snapshots": "builder.campaign.snapshots",
    "solve_structure": "builder.pipeline.stages",
    "take_snapshots": "builder.pipeline.stages",
}
"""The module of each public name."""


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'builder' has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value  # found without this function from now on
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
