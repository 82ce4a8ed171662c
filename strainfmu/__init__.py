"""strainfmu: aerodynamic loads in real time from structural strain.

    import strainfmu

    estimator = strainfmu.load("map.h5")
    result = estimator.estimate(strain, dynamic_pressure=95.8e3)
    result.C_N, result.sigma.C_N, result.health

Names are imported when they are used first. Applying a map needs numpy and h5py; the rest comes with the extras.
``strainfmu build`` makes the maps.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from strainfmu.version import __version__

if TYPE_CHECKING:
    from strainfmu.cosim.systems.master import simulate
    from strainfmu.cosim.systems.recording import Recording
    from strainfmu.cosim.systems.system import Connection, System
    from strainfmu.errors import InputError, StrainfmuError
    from strainfmu.estimator.air_data import AirData
    from strainfmu.estimator.estimate import Estimate
    from strainfmu.estimator.estimator import Estimator, load
    from strainfmu.estimator.health import HealthState
    from strainfmu.estimator.linear_map import LinearMap, linear_map
    from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
    from strainfmu.estimator.settings import EstimatorSettings
    from strainfmu.fmu.export import ExportOptions, export_estimator
    from strainfmu.recorded.run import estimate_file

_MODULES = {
    "AirData": "estimator.air_data",
    "Connection": "cosim.systems.system",
    "Estimate": "estimator.estimate",
    "Estimator": "estimator.estimator",
    "EstimatorSettings": "estimator.settings",
    "ExportOptions": "fmu.export",
    "HealthState": "estimator.health",
    "InputError": "errors",
    "LinearMap": "estimator.linear_map",
    "InverseMap": "estimator.map.inverse_map",
    "Recording": "cosim.systems.recording",
    "StrainfmuError": "errors",
    "System": "cosim.systems.system",
    "estimate_file": "recorded.run",
    "export_estimator": "fmu.export",
    "linear_map": "estimator.linear_map",
    "load": "estimator.estimator",
    "load_inverse_map": "estimator.map.inverse_map",
    "save_inverse_map": "estimator.map.inverse_map",
    "simulate": "cosim.systems.master",
}
"""Module of each public name."""

__all__ = [
    "AirData",
    "Connection",
    "Estimate",
    "Estimator",
    "EstimatorSettings",
    "ExportOptions",
    "HealthState",
    "InputError",
    "InverseMap",
    "LinearMap",
    "Recording",
    "StrainfmuError",
    "System",
    "__version__",
    "estimate_file",
    "export_estimator",
    "linear_map",
    "load",
    "load_inverse_map",
    "save_inverse_map",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
