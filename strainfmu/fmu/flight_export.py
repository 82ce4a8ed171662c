"""The FMUs of a scenario, exported together: schedule, plant, estimator, autopilot."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Literal

from strainfmu.cosim import flight
from strainfmu.cosim.flight import INSTANCES, FlightResult, scheduled_signals
from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.cosim.scenario import Scenario, load_scenario
from strainfmu.cosim.systems.recording import Recording, save_csv, save_hdf5
from strainfmu.cosim.systems.ssp import check_ssp_path, write_ssp
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.fmu.plant_export import export_autopilot, export_native_plant, export_schedule
from strainfmu.interface.plant_variables import Motion


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosedLoopFlight:
    """A scenario as it was flown: recording and score by what is fed back, and the files.

    ``fault`` is what ended a later run; the runs before it are complete.
    """

    scenario: Scenario
    recordings: dict[str, Recording]
    results: dict[str, FlightResult]
    files: tuple[Path, ...]
    fault: StrainfmuError | None = None


def fly(
    scenario: str | PathLike[str],
    output: str | PathLike[str] = "flight",
    *,
    files: str | PathLike[str] | None = None,
    ssp: str | PathLike[str] | None = None,
    fmi: Literal["2", "3", 2, 3] = "2",
    progress: Callable[[str], AbstractContextManager[Callable[[int, int], None]]] | None = None,
) -> ClosedLoopFlight:
    """Fly a scenario in closed loop: plant, estimator and autopilot, each an FMU.

    One run per feedback, with the plant's true coefficients or the estimator's: a table, recordings, figures. Ends
    with exit code 1 if the loop does not hold its angle of attack.

    On the command line::

        strainfmu fly ic3x_flight.toml --files demo -o flight
        strainfmu fly ic3x_flight.toml --files demo --ssp flight.ssp

    Parameters
    ----------
    scenario : scenario file (TOML); docs/reference/scenario.md lists its entries.
    output : folder for FMUs, recordings, figures.
    files : folder of map.h5 and flight_model.h5. Default: the scenario's own.
    ssp : SSP package of the system to write; X_connectors.ssp is written next to it.
    fmi : 3: write the FMUs in FMI 3.0 too, into fmi_3 of the output; 2.0 flies.
    progress : returns the context of a stage by its title, which gives a function of (done, of).

    Raises
    ------
    InputError, StrainfmuError
        A file is missing or wrong, an FMU failed in the first run, or something could not be written.
    """
    folder, stage = Path(output), progress or (lambda title: nullcontext(lambda done, total: None))
    if ssp is not None:
        check_ssp_path(Path(ssp))
    loaded = load_scenario(Path(scenario), None if files is None else Path(files))
    model, fault = load_flight_model(loaded.flight_model), None
    with stage("FMUs"):
        fmus = export_flight(loaded, folder)
        more = export_flight(loaded, folder / "fmi_3", fmi_version="3") if str(fmi) == "3" else {}
    written = [*fmus.values(), *more.values()]
    recordings: dict[str, Recording] = {}
    for feedback in loaded.feedback:
        with stage(f"Flight: feedback of {feedback}") as advance:
            try:
                recording = flight.fly(loaded, fmus, feedback, partial(_advance, advance, loaded.stop_time))
            except StrainfmuError as error:
                if not recordings:
                    raise
                fault = error
                break
        recordings[feedback] = recording
        stem = folder / f"flight_{feedback}"
        save_hdf5(recording, stem.with_suffix(".h5"))
        save_csv(recording, stem.with_suffix(".csv"))
        written += [stem.with_suffix(".h5"), stem.with_suffix(".csv")]
    if ssp is not None and fault is None:
        path, system = Path(ssp), flight.flight_system(loaded, fmus, loaded.feedback[-1])
        for name, connectors in ((path.name, False), (f"{path.stem}_connectors{path.suffix}", True)):
            write_ssp(system, path.with_name(name), loaded.name, loaded.stop_time, loaded.step_size, connectors)
            written.append(path.with_name(name))
    results = {name: flight.flight_result(loaded, recording, model) for name, recording in recordings.items()}
    return ClosedLoopFlight(
        scenario=loaded, recordings=recordings, results=results, files=tuple(written), fault=fault
    )


def _advance(advance: Callable[[int, int], None], stop_time: float, time: float) -> None:
    advance(round(100 * time / stop_time), 100)


def export_flight(
    scenario: Scenario, folder: Path, platforms: Sequence[str] | None = None, fmi_version: str = "2"
) -> dict[str, Path]:
    """Write the FMUs of a scenario into ``folder``; return their paths by name of the instance.

    FMUs of FMI 3.0 have the same scalar variables.

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
    options = ExportOptions(inputs="full", fmi_version=fmi_version, scalars=fmi_version == "3")
    export_estimator(scenario.inverse_map, fmus["estimator"], options)
    export_native_plant(
        flight_model_path=scenario.flight_model,
        fmu_path=fmus["plant"],
        motion=Motion.SHORT_PERIOD,
        start=scenario.start,
        trajectory_path=None,
        platforms=platforms,
        seed=scenario.noise_seed,
        fmi_version=fmi_version,
    )
    export_autopilot(
        flight_model_path=scenario.flight_model,
        fmu_path=fmus["autopilot"],
        start=scenario.start,
        settings=scenario.autopilot,
        platforms=platforms,
        fmi_version=fmi_version,
    )
    signals = scheduled_signals(scenario, model)
    export_schedule(
        signals,
        fmus["schedule"],
        platforms=platforms,
        fmi_version=fmi_version,
        flight_model_path=scenario.flight_model,
    )
    return fmus
