"""Export of an estimator, as an FMU, on a CAN bus or not, or as C sources; and of a vehicle as an FMU."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Literal

from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.errors import InputError
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.fmu.plant_export import export_native_plant
from strainfmu.interface.plant_variables import FlightStart, Motion


def export(
    inverse_map: str | PathLike[str],
    output: str | PathLike[str] = "estimator.fmu",
    *,
    kind: str = "native",
    fmi: str | int = "2",
    scalars: bool = False,
    platforms: Sequence[str] | Literal["all"] = "all",
    bus: str | PathLike[str] | None = None,
    inputs: str = "minimal",
    estimator: Literal["linear"] | None = None,
    zero_inputs: bool = False,
    tare_known: str | PathLike[str] | None = None,
) -> Literal["linear", "nonlinear"]:
    """Write the estimator FMU of a map, or a new folder of C sources; return which estimator it holds.

    Parameters
    ----------
    inverse_map : file of the map.
    output : FMU to write; folder of kind "c".
    kind, scalars, platforms, inputs, estimator, zero_inputs, tare_known : as :class:`ExportOptions` has them.
    fmi : version of FMI, 2 or, native only, 3.
    bus : bus file of an FMU of FMI 3.0 whose strains and results are CAN frames (FMI-LS-BUS); None for none.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`export_estimator`; or the bus file is wrong.
    """
    options = ExportOptions(
        kind=kind,
        fmi_version=str(fmi).removesuffix(".0"),
        scalars=scalars,
        platforms=None if platforms == "all" else platforms,
        inputs=inputs,
        estimator=estimator,
        zero_inputs=zero_inputs,
        tare_known=None if tare_known is None else Path(tare_known),
    )
    if bus is None:
        return export_estimator(inverse_map, output, options)
    from strainfmu.can.ecu import export_ecu

    return export_ecu(Path(inverse_map), Path(output), Path(bus), options)


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
    bus: str | PathLike[str] | None = None,
    recording: str | PathLike[str] | None = None,
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
    bus : bus file of an FMU of FMI 3.0 that sends the strains as CAN frames (FMI-LS-BUS); None for none.
    recording : strains to send, one row a cycle, instead of the flight model's; with ``bus`` alone.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`~strainfmu.fmu.plant_export.export_native_plant`; or the bus file or the recording is wrong.
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
    model = load_flight_model(Path(flight_model))
    if bus is None and recording is not None:
        raise InputError("--recording: expected with --bus, whose frames hold it")
    if bus is not None and str(fmi).removesuffix(".0") != "3":
        raise InputError("--bus: expected with --fmi 3, which alone has clocks")
    sending = None
    if bus is not None:
        from strainfmu.can.nodes import export_recording, sender_part

        if recording is not None:
            return export_recording(Path(recording), Path(flight_model), Path(output), Path(bus))
        sending = partial(sender_part, Path(bus))
    knots = model.mach_knots
    start = FlightStart(
        mach_number=0.5 * float(knots[0] + knots[-1]) if mach_number is None else mach_number,
        altitude=20e3 if altitude is None else altitude,
        angle_of_attack=angle_of_attack or 0.0,
        sideslip_angle=sideslip or 0.0,
    )
    table = None if trajectory is None else Path(trajectory)
    export_native_plant(
        Path(flight_model),
        Path(output),
        Motion[motion.upper()],
        start,
        table,
        fmi_version=str(fmi).removesuffix(".0"),
        bus=sending,
    )
