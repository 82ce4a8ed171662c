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

from strainfmu.version import __version__ as __version__

if TYPE_CHECKING:
    from strainfmu.cosim.estimators.zeros_file import load_zeros as load_zeros
    from strainfmu.cosim.systems.master import simulate as simulate
    from strainfmu.cosim.systems.recording import Recording as Recording
    from strainfmu.cosim.systems.recording import load_recording as load_recording
    from strainfmu.cosim.systems.system import Connection as Connection
    from strainfmu.cosim.systems.system import System as System
    from strainfmu.errors import InputError as InputError
    from strainfmu.errors import StrainfmuError as StrainfmuError
    from strainfmu.estimator.air_data import AirData as AirData
    from strainfmu.estimator.air_inputs import QSource as QSource
    from strainfmu.estimator.estimate import Estimate as Estimate
    from strainfmu.estimator.estimator import Estimator as Estimator
    from strainfmu.estimator.estimator import load as load
    from strainfmu.estimator.health import HealthState as HealthState
    from strainfmu.estimator.linear_map import LinearMap as LinearMap
    from strainfmu.estimator.linear_map import linear_map as linear_map
    from strainfmu.estimator.map.inverse_map import InverseMap as InverseMap
    from strainfmu.estimator.map.inverse_map import load_inverse_map as load_inverse_map
    from strainfmu.estimator.map.inverse_map import save_inverse_map as save_inverse_map
    from strainfmu.estimator.settings import EstimatorSettings as EstimatorSettings
    from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros as GaugeZeros
    from strainfmu.estimator.zeros.tare import KnownStrain as KnownStrain
    from strainfmu.estimator.zeros.tare import Tare as Tare
    from strainfmu.estimator.zeros.tare import TareLimits as TareLimits
    from strainfmu.fmu.export import ExportOptions as ExportOptions
    from strainfmu.fmu.export import export_estimator as export_estimator
    from strainfmu.recorded.run import estimate_file as estimate_file

_MODULES = {
    "AirData": "estimator.air_data",
    "Connection": "cosim.systems.system",
    "Estimate": "estimator.estimate",
    "Estimator": "estimator.estimator",
    "EstimatorSettings": "estimator.settings",
    "ExportOptions": "fmu.export",
    "GaugeZeros": "estimator.zeros.gauge_zeros",
    "HealthState": "estimator.health",
    "InputError": "errors",
    "InverseMap": "estimator.map.inverse_map",
    "KnownStrain": "estimator.zeros.tare",
    "LinearMap": "estimator.linear_map",
    "QSource": "estimator.air_inputs",
    "Recording": "cosim.systems.recording",
    "StrainfmuError": "errors",
    "System": "cosim.systems.system",
    "Tare": "estimator.zeros.tare",
    "TareLimits": "estimator.zeros.tare",
    "estimate_file": "recorded.run",
    "export_estimator": "fmu.export",
    "linear_map": "estimator.linear_map",
    "load": "estimator.estimator",
    "load_inverse_map": "estimator.map.inverse_map",
    "load_recording": "cosim.systems.recording",
    "load_zeros": "cosim.estimators.zeros_file",
    "save_inverse_map": "estimator.map.inverse_map",
    "simulate": "cosim.systems.master",
}
"""Module of each public name."""

__all__ = ["__version__", *_MODULES]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
