"""Export of the native FMUs round the estimator: plant, autopilot and schedule (co-simulation)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from strainfmu.archive import write_archive
from strainfmu.cosim.models import flight_model
from strainfmu.cosim.models.autopilot import AutopilotSettings, autopilot_data, autopilot_interface
from strainfmu.cosim.models.flight_model import FlightModel, check_envelope, evaluate, load_flight_model
from strainfmu.cosim.models.plant_law import Plant
from strainfmu.cosim.models.schedule import ScheduledSignal, schedule_data, schedule_interface
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.errors import InputError
from strainfmu.estimator.library_sources import sources_digest
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.files import built_time_of, content_hash_of
from strainfmu.flight_condition import FlightCondition
from strainfmu.fmu.description.fmu_description import FmuDescription
from strainfmu.fmu.description.terminals import terminal_files
from strainfmu.fmu.documentation.index_page import Section, documentation_files
from strainfmu.fmu.documentation.plant_page import native_plant_sections
from strainfmu.fmu.documentation.run_panels import reference_sections
from strainfmu.fmu.fmu_file import check_fmu_path
from strainfmu.fmu.native.package import CAPABILITIES, chosen_libraries, native_entries
from strainfmu.fmu.native.sources import compiled_files, native_sources
from strainfmu.fmu.plant_resource import ModelKind, model_resource, plant_data
from strainfmu.fmu.reference_run.plant import (
    Reference,
    autopilot_reference,
    plant_reference,
    schedule_reference,
)
from strainfmu.interface.contents import CONTENTS
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.plant_variables import FlightStart, Motion, native_plant_interface
from strainfmu.version import __version__

STEP_SIZE = 1e-2
STOP_TIME = 20.0
LIBRARY = "plant"
"""The library of all three: a key of :data:`~strainfmu.estimator.library_sources.LIBRARIES`."""


def plant(
    flight_model: str | PathLike[str],
    output: str | PathLike[str] = "plant.fmu",
    *,
    fmi: str | int = "2",
    motion: str = "inputs",
    trajectory: str | PathLike[str] | None = None,
    mach_number: float | None = None,
    altitude: float | None = None,
    angle_of_attack: float | None = None,
    sideslip: float | None = None,
) -> None:
    """Package a flight model as a native FMU: strains with noise and gauge faults, and the true coefficients.

    Parameters
    ----------
    flight_model : flight_model.h5 of a demonstration.
    output : FMU to write.
    fmi : version of FMI, 2 or 3.
    motion : "inputs", "trajectory", or "short_period", which responds to a control moment.
    trajectory : table to fly (CSV), for motion "trajectory" and for it alone.
    mach_number, altitude, angle_of_attack, sideslip : start values [1], [m], [rad], [rad]; None for the middle of
        the model's Mach numbers, 20 km and 0. Not with motion "trajectory".

    Raises
    ------
    InputError, StrainfmuError
        As :func:`export_native_plant`.
    """
    names = [item.name.lower() for item in Motion]
    if motion not in names:
        raise InputError(f"--motion: expected one of {', '.join(names)}, got '{motion}'")
    given = {
        "--mach-number": mach_number,
        "--altitude": altitude,
        "--angle-of-attack": angle_of_attack,
        "--sideslip": sideslip,
    }
    named = [name for name, value in given.items() if value is not None]
    if named and motion == Motion.TRAJECTORY.name.lower():
        raise InputError(f"{named[0]}: not with --motion trajectory, whose table states it")
    knots = load_flight_model(Path(flight_model)).mach_knots
    start = FlightStart(
        mach_number=0.5 * float(knots[0] + knots[-1]) if mach_number is None else mach_number,
        altitude=20e3 if altitude is None else altitude,
        angle_of_attack=angle_of_attack or 0.0,
        sideslip_angle=sideslip or 0.0,
    )
    table = None if trajectory is None else Path(trajectory)
    export_native_plant(
        Path(flight_model), Path(output), Motion[motion.upper()], start, table, fmi_version=str(fmi)
    )


def export_native_plant(
    flight_model_path: Path,
    fmu_path: Path,
    motion: Motion,
    start: FlightStart,
    trajectory_path: Path | None = None,
    platforms: Sequence[str] | None = None,
    seed: int = 1,
    fmi_version: str = "2",
) -> None:
    """Write the native plant FMU of a flight model to ``fmu_path``.

    Parameters
    ----------
    start : start values of the inputs and parameters.
    trajectory_path : the CSV table to fly, for ``Motion.TRAJECTORY`` and for it alone.
    platforms : as for the estimator's export; None for all.
    seed : start value of the noise's.
    fmi_version : "2" for FMI 2.0, "3" for FMI 3.0.

    Raises
    ------
    InputError
        A file is missing, damaged or wrong, or start or trajectory is outside the flight model's envelope.
    StrainfmuError
        The FMU could not be written; ``fmu_path`` keeps its old content.
    """
    check_fmu_path(fmu_path)
    model = load_flight_model(flight_model_path)
    if (trajectory_path is None) == (motion is Motion.TRAJECTORY):
        raise InputError("plant: a trajectory is needed for the motion on a trajectory, and only for that")
    if trajectory_path is None:
        check_start(model, start)
    trajectory = None if trajectory_path is None else load_trajectory(trajectory_path)
    if trajectory is not None and trajectory_path is not None:
        check_envelope(
            mach_knots=model.mach_knots,
            incidence_knots=model.incidence_knots,
            trajectory=trajectory,
            path=trajectory_path,
        )
    content_hash = content_hash_of(flight_model_path, flight_model.SCHEMA, flight_model.SCHEMA_VERSION)
    entries = _native_fmu(
        model_name="StrainedVehicle",
        text=f"A vehicle with {model.n_gauges} noisy strain gauges that can fail: {model.vehicle}",
        kind=ModelKind.PLANT,
        interface=native_plant_interface(vehicle=model, motion=motion, start=start, seed=seed),
        data=plant_data(model, motion, trajectory),
        sections=native_plant_sections(model, motion, content_hash),
        reference=plant_reference(
            Plant(model=model, motion=motion, start=start, trajectory=trajectory, seed=seed)
        ),
        platforms=platforms,
        contents={"flight_model": content_hash, "vehicle": model.vehicle, "gauges": list(model.gauge_names)},
        stop_time=trajectory.stop_time if trajectory is not None else STOP_TIME,
        fmi_version=fmi_version,
        built=_built(flight_model_path),
    )
    write_archive(fmu_path, entries)


def check_start(model: FlightModel, start: FlightStart) -> None:
    """Refuse a start that is no number or outside the flight model's envelope.

    Raises
    ------
    InputError
        It is; the message names the quantity.
    """
    for name, value in asdict(start).items():
        if not np.isfinite(value):
            raise InputError(f"start: {name} {value} found, must be finite")
    try:
        evaluate(
            model,
            FlightCondition(
                mach_number=start.mach_number,
                angle_of_attack=start.angle_of_attack,
                sideslip_angle=start.sideslip_angle,
                altitude=start.altitude,
            ),
        )
    except InputError as error:
        raise InputError(f"start: {error}") from error


def export_autopilot(
    flight_model_path: Path,
    fmu_path: Path,
    start: FlightStart,
    settings: AutopilotSettings | None = None,
    platforms: Sequence[str] | None = None,
    fmi_version: str = "2",
) -> None:
    """Write the autopilot FMU, designed for the vehicle and flight condition of ``start``, to ``fmu_path``.

    Raises
    ------
    InputError
        The flight model is missing or damaged, or no autopilot can be made for it.
    StrainfmuError
        The FMU could not be written; ``fmu_path`` keeps its old content.
    """
    check_fmu_path(fmu_path)
    model, settings = load_flight_model(flight_model_path), settings or AutopilotSettings()
    sections = [
        (
            "What it computes",
            [
                "It holds a commanded angle of attack. The angle is inferred from C_N by a table, the aerodynamic "
                "moment is cancelled through M_P, and the control moment gives the angle the motion of a "
                "second-order system with the chosen frequency and damping ratio.",
                "An estimate that is missing or does not fit its gauges is replaced by the last good one, for "
                "hold_time at most. A gauge that is the suspect in enough samples in a row is taken out of use: "
                "its <code>valid</code> goes false.",
                f"Designed for Mach number {start.mach_number:g}, {start.altitude / 1e3:g} km, "
                f"{start.mass:g} kg, {start.pitch_inertia:g} kg m2.",
            ],
        )
    ]
    entries = _native_fmu(
        model_name="AngleOfAttackAutopilot",
        text=f"Holds an angle of attack through estimated coefficients: {model.vehicle}",
        kind=ModelKind.AUTOPILOT,
        interface=autopilot_interface(model, start, settings),
        data=autopilot_data(model, start),
        sections=sections,
        reference=autopilot_reference(model, start, settings),
        platforms=platforms,
        contents={"vehicle": model.vehicle, "design": asdict(start)},
        fmi_version=fmi_version,
        built=_built(flight_model_path),
    )
    write_archive(fmu_path, entries)


def _built(flight_model_path: Path) -> str:
    return built_time_of(flight_model_path, flight_model.SCHEMA, flight_model.SCHEMA_VERSION)


def export_schedule(
    signals: Sequence[ScheduledSignal],
    fmu_path: Path,
    platforms: Sequence[str] | None = None,
    fmi_version: str = "2",
    flight_model_path: Path | None = None,
) -> None:
    """Write the schedule FMU of ``signals`` to ``fmu_path``, dated as the flight model that it is for.

    Raises
    ------
    StrainfmuError
        The FMU could not be written; ``fmu_path`` keeps its old content.
    """
    check_fmu_path(fmu_path)
    sections = [("What it computes", ["Its outputs jump to the values of a table at the times of that table."])]
    entries = _native_fmu(
        model_name="FlightSchedule",
        text="Commands and gauge faults over time",
        kind=ModelKind.SCHEDULE,
        interface=schedule_interface(signals),
        data=schedule_data(signals),
        sections=sections,
        reference=schedule_reference(signals),
        platforms=platforms,
        contents={},
        fmi_version=fmi_version,
        built="" if flight_model_path is None else _built(flight_model_path),
    )
    write_archive(fmu_path, entries)


def _native_fmu(
    model_name: str,
    text: str,
    kind: ModelKind,
    interface: Sequence[Variable],
    data: NDArray[np.float64],
    sections: Sequence[Section],
    reference: Reference,
    platforms: Sequence[str] | None,
    contents: dict[str, object],
    stop_time: float = STOP_TIME,
    fmi_version: str = "2",
    built: str = "",
) -> dict[str, bytes]:
    """Return the entries of one FMU."""
    libraries = chosen_libraries(LIBRARY, platforms, fmi_version)
    sources = native_sources(LIBRARY, fmi_version)
    digest = hashlib.sha256(data.astype("<f8").tobytes() + sources_digest(sources).encode()).hexdigest()
    capabilities = {
        name: value for name, value in CAPABILITIES[fmi_version].items() if not name.startswith("provides")
    }
    description = FmuDescription(
        model_name=model_name,
        description=text,
        interface=interface,
        content_hash=digest,
        stop_time=stop_time,
        step_size=STEP_SIZE,
        capabilities=capabilities,
        fmi_version=fmi_version,
        built=built,
        source_files=compiled_files(sources),
    )
    pages = documentation_files(description, [*sections, *reference_sections(reference, interface)], "native")
    known = {"kind": "native", "model": kind.name.lower(), "strainfmu_version": __version__, **contents}
    arrays = {variable.array for variable in interface}
    terminals = {"gauges": ((STRAIN,), "Strain of every gauge")} if STRAIN in arrays else {}
    icon = "plant" if kind is ModelKind.PLANT else None
    return {
        **native_entries(
            description=description,
            libraries=libraries,
            sources=sources,
            resource_files={
                "model.bin": model_resource(kind=kind, interface=interface, data=data, guid=description.guid)
            },
        ),
        CONTENTS: json.dumps(known | reference.contents, indent=1).encode(),
        **{f"documentation/{name}": content for name, content in pages.items()},
        **(terminal_files(description, terminals, icon) if icon else {}),
        **reference.files(interface),
    }
