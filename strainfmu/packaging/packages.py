"""Export of an estimator, as an FMU, on a CAN bus or not, or as C sources; and of a vehicle as an FMU."""

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
    inputs: Literal["minimal", "full"] = "minimal",
    estimator: Literal["linear"] | None = None,
    zero_inputs: bool = False,
    tare_known: str | PathLike[str] | None = None,
) -> Literal["linear", "nonlinear"]:
    """Package an inverse map as an FMU, or as C sources. Two exports of one map are equal to the byte.

    Native FMUs of the linear estimator are for co-simulation and model exchange, all others for co-simulation.

    Sources come with the map as a constant, CMakeLists.txt, an example, a program that measures memory and time
    of a step on the target, and README.txt. The folder must be a new one.

    On the command line::

        strainfmu export results/map.h5 -o estimator.fmu
        strainfmu export results/map.h5 -o estimator.fmu --inputs full
        strainfmu export results/map.h5 -o estimator.fmu --fmi 3 --platforms linux64,win64
        strainfmu export results/map.h5 -o estimator.fmu --fmi 3 --scalars
        strainfmu export results/map.h5 -o estimator.fmu --estimator linear
        strainfmu export results/map.h5 -o estimator.fmu --zero-inputs --tare-known known.toml
        strainfmu export results/map.h5 -o ecu.fmu --fmi 3 --bus bus.toml
        strainfmu export results/map.h5 -o loads_c --kind c

    Parameters
    ----------
    inverse_map : inverse map (map.h5).
    output : FMU to write; with ``kind`` "c": folder.
    kind : "native": compiled, needs nothing of its host; "python": PythonFMU; "c": C sources, for computers
        without FMI.
    fmi : version of FMI: 2 or, native only, 3.
    scalars : with ``fmi`` 3: the scalar variables of FMI 2, for tools without arrays, as fmpy.simulate_fmu.
    platforms : native: "all", or some of linux64, win64, darwin64, aarch64-linux, aarch64-darwin.
    bus : with ``fmi`` 3: strains and results are CAN frames (FMI-LS-BUS) of a bus file.
    inputs : "minimal": strain, dynamic pressure and its source, Mach number, altitude, static pressure, tare.
        "full": also valid of each gauge and all other air data.
    estimator : "linear": the linear estimator of a map that includes both.
    zero_inputs : add inputs for the zero offsets of the gauges. With FMI 2, or with ``scalars``.
    tare_known : strain of own weight and air during a tare, from ``strainfmu tare --known-output``.

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
    from strainfmu.packaging.ecu import export_ecu

    return export_ecu(Path(inverse_map), Path(output), Path(bus), options)


def plant(
    flight_model: str | PathLike[str],
    output: str | PathLike[str] = "plant.fmu",
    *,
    fmi: Literal["2", "3", 2, 3] = "2",
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

    On the command line::

        strainfmu plant demo/flight_model.h5 -o plant.fmu
        strainfmu plant demo/flight_model.h5 --fmi 3 -o plant_3.fmu
        strainfmu plant demo/flight_model.h5 --motion trajectory --trajectory manoeuvre.csv

    Parameters
    ----------
    flight_model : flight_model.h5 of a demo.
    output : FMU to write.
    fmi : 2 for FMI 2.0, 3 for FMI 3.0.
    motion : "inputs", "trajectory", or "short_period" (responds to a control moment).
    trajectory : with ``motion`` trajectory: the table to fly.
    mach_number : start value. Default: the middle of the model's. Not with ``motion`` trajectory.
    altitude : start value [m]. Default: 20 km. Not with ``motion`` trajectory.
    angle_of_attack : start value [rad]. Default: 0. Not with ``motion`` trajectory.
    sideslip : start value [rad]. Default: 0. Not with ``motion`` trajectory.
    bus : with ``fmi`` 3: send the strains as CAN frames (FMI-LS-BUS), by a bus file.
    recording : with ``bus``: recorded strains to send, a row a cycle.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`~strainfmu.fmu.plant_export.export_native_plant`; or the bus file or the recording is wrong.
    """
    names = [item.name.lower() for item in Motion]
    if motion not in names:
        raise InputError(f"--motion: expected one of {', '.join(names)}, got '{motion}'")
    flight_options = {
        "--mach-number": mach_number,
        "--altitude": altitude,
        "--angle-of-attack": angle_of_attack,
        "--sideslip": sideslip,
    }
    named = [name for name, value in flight_options.items() if value is not None]
    if named and motion == Motion.TRAJECTORY.name.lower():
        raise InputError(f"{named[0]}: not with --motion trajectory, whose table states it")
    model = load_flight_model(Path(flight_model))
    if bus is None and recording is not None:
        raise InputError("--recording: expected with --bus, whose frames hold it")
    if bus is not None and str(fmi).removesuffix(".0") != "3":
        raise InputError("--bus: expected with --fmi 3, which alone has clocks")
    sending = None
    if bus is not None:
        from strainfmu.packaging.nodes import export_recording, sender_part

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
