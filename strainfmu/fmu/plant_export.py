"""Export of the native FMUs round the estimator: plant, autopilot, schedule, CAN bus (co-simulation)."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
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
from strainfmu.fmu.description.port import MOST_PORTS, BusPart, Port
from strainfmu.fmu.description.terminals import terminal_files
from strainfmu.fmu.documentation.index_page import Section, documentation_files
from strainfmu.fmu.documentation.plant_page import native_plant_sections
from strainfmu.fmu.documentation.run_panels import reference_sections
from strainfmu.fmu.fmu_file import check_fmu_path
from strainfmu.fmu.native.package import CAPABILITIES, CAPABILITIES_ON_BUS, chosen_libraries, native_entries
from strainfmu.fmu.native.sources import compiled_files, native_sources
from strainfmu.fmu.plant_resource import ModelKind, model_resource, plant_data
from strainfmu.fmu.reference_run.plant import (
    Reference,
    autopilot_reference,
    plant_reference,
    schedule_reference,
)
from strainfmu.interface.contents import CONTENTS
from strainfmu.interface.fmi_variables import Variable, value_references
from strainfmu.interface.plant_variables import FlightStart, Motion, native_plant_interface
from strainfmu.version import __version__

STEP_SIZE = 1e-2
STOP_TIME = 20.0
LIBRARY = "plant"
"""The library of all of them: a key of :data:`~strainfmu.estimator.library_sources.LIBRARIES`."""

Sending = Callable[[FlightModel, Mapping[str, int]], BusPart]
"""Returns, for a flight model and the number of each variable by name, what puts the FMU on a bus."""


def export_native_plant(
    flight_model_path: Path,
    fmu_path: Path,
    motion: Motion,
    start: FlightStart,
    trajectory_path: Path | None = None,
    platforms: Sequence[str] | None = None,
    seed: int = 1,
    fmi_version: str = "2",
    bus: Sending | None = None,
) -> None:
    """Write the native plant FMU of a flight model to ``fmu_path``.

    Parameters
    ----------
    start : start values of the inputs and parameters.
    trajectory_path : the CSV table to fly, for ``Motion.TRAJECTORY`` and for it alone.
    platforms : as for the estimator's export; None for all.
    seed : start value of the noise's.
    fmi_version : "2" for FMI 2.0, "3" for FMI 3.0.
    bus : puts it on a bus, in FMI 3.0, as :func:`strainfmu.packaging.nodes.sender_part` does; None for none.

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
    interface = native_plant_interface(vehicle=model, motion=motion, start=start, seed=seed)
    entries = _native_fmu(
        model_name="StrainedVehicle",
        text=f"A vehicle with {model.n_gauges} noisy strain gauges that can fail: {model.vehicle}",
        kind=ModelKind.PLANT,
        interface=interface,
        data=plant_data(model, motion, trajectory),
        sections=native_plant_sections(model, motion, content_hash),
        reference=plant_reference(Plant(model=model, motion=motion, start=start, trajectory=trajectory, seed=seed))
        if bus is None
        else None,
        platforms=platforms,
        contents={"flight_model": content_hash, "vehicle": model.vehicle, "gauges": list(model.gauge_names)},
        stop_time=trajectory.stop_time if trajectory is not None else STOP_TIME,
        fmi_version=fmi_version,
        build_date=_built(flight_model_path),
        bus=None if bus is None else bus(model, value_references(interface)),
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
        build_date=_built(flight_model_path),
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
    bus: Callable[[Mapping[str, int]], BusPart] | None = None,
) -> None:
    """Write the schedule FMU of ``signals`` to ``fmu_path``, dated as the flight model that it is for.

    ``bus`` returns what puts it on a bus for the number of each variable by name; None for none.

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
        reference=schedule_reference(signals) if bus is None else None,
        platforms=platforms,
        contents={},
        fmi_version=fmi_version,
        build_date="" if flight_model_path is None else _built(flight_model_path),
        bus=None if bus is None else bus(value_references(schedule_interface(signals))),
    )
    write_archive(fmu_path, entries)


def export_can_bus(
    fmu_path: str | PathLike[str], network: str = "CAN", n_nodes: int = 2, platforms: Sequence[str] | None = None
) -> None:
    """Write the FMU of a CAN FD bus (FMI-LS-BUS 1.0) to ``fmu_path``.

    Parameters
    ----------
    network : start of the names of its terminals, which end with the number of the node from 1.
    n_nodes : number of nodes, 1 to 8.
    platforms : as for the estimator's export; None for all.

    Raises
    ------
    InputError
        There are too few nodes or too many.
    StrainfmuError
        The FMU could not be written; ``fmu_path`` keeps its old content.
    """
    fmu_path = Path(fmu_path)
    check_fmu_path(fmu_path)
    if not 1 <= n_nodes <= MOST_PORTS:
        raise InputError(f"nodes: expected 1 to {MOST_PORTS}, got {n_nodes}")
    part = BusPart(
        ports=tuple(Port(f"{network}{number}", "countdown") for number in range(1, n_nodes + 1)),
        resource="can.bin",
        lines=(
            "Connect a node to each terminal. A frame takes the time of its bits at the rates that its sender has "
            "stated; of frames that wait the lowest identifier goes first. The sender gets a Confirm, or a Bus "
            "Error where another node has other rates. Stuff bits that depend on the content are not counted.",
        ),
        is_bus=True,
    )
    nodes = ScheduledSignal(
        Variable(name="nodes", description="Number of nodes", causality="output", variability="discrete"),
        times=(0.0,),
        values=(float(n_nodes),),
    )
    entries = _native_fmu(
        model_name="CANBus",
        text=f"CAN FD bus of {n_nodes} nodes by FMI-LS-BUS 1.0",
        kind=ModelKind.SCHEDULE,
        interface=schedule_interface([nodes]),
        data=schedule_data([nodes]),
        sections=[],
        reference=None,
        platforms=platforms,
        contents={},
        fmi_version="3",
        bus=part,
    )
    write_archive(fmu_path, entries)


def _native_fmu(
    model_name: str,
    text: str,
    kind: ModelKind,
    interface: Sequence[Variable],
    data: NDArray[np.float64],
    sections: Sequence[Section],
    reference: Reference | None,
    platforms: Sequence[str] | None,
    contents: dict[str, object],
    stop_time: float = STOP_TIME,
    fmi_version: str = "2",
    build_date: str = "",
    bus: BusPart | None = None,
) -> dict[str, bytes]:
    """Return the entries of one FMU."""
    libraries = chosen_libraries(LIBRARY, platforms, fmi_version)
    sources = native_sources(LIBRARY, fmi_version, on_bus=bus is not None)
    digest = hashlib.sha256(data.astype("<f8").tobytes() + sources_digest(sources).encode())
    capabilities = CAPABILITIES_ON_BUS
    if bus is None:
        capable = CAPABILITIES[fmi_version]
        capabilities = {name: value for name, value in capable.items() if not name.startswith("provides")}
    else:
        digest.update(bus.content("") + repr(bus.ports).encode())
        sections = [("On the bus", bus.lines), *sections]
    description = FmuDescription(
        model_name=model_name,
        description=text,
        interface=interface,
        content_hash=digest.hexdigest(),
        stop_time=stop_time,
        step_size=STEP_SIZE,
        capabilities=capabilities,
        fmi_version=fmi_version,
        build_date=build_date,
        source_files=compiled_files(sources),
        ports=() if bus is None else bus.ports,
    )
    known = {"kind": "native", "model": kind.name.lower(), "strainfmu_version": __version__, **contents}
    if reference is not None:
        sections, known = [*sections, *reference_sections(reference, interface)], known | reference.contents
    pages = documentation_files(description, sections, "native")
    arrays = {variable.array for variable in interface}
    terminals = {"gauges": ((STRAIN,), "Strain of every gauge")} if STRAIN in arrays else {}
    icon = "plant" if kind is ModelKind.PLANT else None
    resource = model_resource(kind=kind, interface=interface, data=data, guid=description.guid)
    return {
        **native_entries(
            description=description,
            libraries=libraries,
            sources=sources,
            resource_files={"model.bin": resource},
        ),
        CONTENTS: json.dumps(known, indent=1).encode(),
        **{f"documentation/{name}": content for name, content in pages.items()},
        **(terminal_files(description, terminals, icon) if icon else {}),
        **({} if reference is None else reference.files(interface)),
        **({} if bus is None else bus.files(description.guid)),
    }
