"""The FMUs of a scenario, exported together: schedule, plant, estimator, autopilot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from strainfmu.cosim.flight import INSTANCES, scheduled_signals
from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.cosim.scenario import Scenario
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.fmu.export import export_estimator
from strainfmu.fmu.plant_export import export_autopilot, export_native_plant, export_schedule
from strainfmu.interface.plant_variables import Motion


def export_flight(scenario: Scenario, folder: Path, platforms: Sequence[str] | None = None) -> dict[str, Path]:
    """Write the FMUs of a scenario into ``folder``; return their paths by name of the instance.

    Raises
    ------
    InputError
        A file is missing or damaged, map and flight model have different gauges, or a gauge is unknown.
    StrainfmuError
        An FMU could not be written.
    """
    model, inverse_map = load_flight_model(scenario.flight_model), load_inverse_map(scenario.inverse_map)
    if model.gauge_names != inverse_map.gauge_names:
        raise InputError(f"{scenario.inverse_map}: expected the gauges and sensors of {scenario.flight_model}")
    fmus = {name: folder / f"{name}.fmu" for name in INSTANCES}
    folder.mkdir(parents=True, exist_ok=True)
    export_estimator(scenario.inverse_map, fmus["estimator"])
    export_native_plant(
        flight_model_path=scenario.flight_model,
        fmu_path=fmus["plant"],
        motion=Motion.SHORT_PERIOD,
        start=scenario.start,
        trajectory_path=None,
        platforms=platforms,
        seed=scenario.noise_seed,
    )
    export_autopilot(
        flight_model_path=scenario.flight_model,
        fmu_path=fmus["autopilot"],
        start=scenario.start,
        settings=scenario.autopilot,
        platforms=platforms,
    )
    export_schedule(scheduled_signals(scenario, model), fmus["schedule"], platforms)
    return fmus
