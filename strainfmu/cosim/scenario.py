"""A flight scenario: which FMUs fly, what is commanded, which gauges fail, how the loop is closed (TOML)."""

from dataclasses import dataclass
from math import radians
from pathlib import Path

from strainfmu.cosim.models.autopilot import AutopilotSettings
from strainfmu.cosim.toml_table import TomlTable, read_table
from strainfmu.flight_condition import ALTITUDE_COLUMN, ANGLE_COLUMN, MACH_COLUMN, SIDESLIP_COLUMN
from strainfmu.interface.plant_variables import FlightStart, GaugeFault

FEEDBACKS = ("truth", "estimate")
"""What the autopilot may be fed with: the plant's true coefficients, or the estimator's."""


@dataclass(frozen=True)
class Command:
    """From ``time`` [s] on the angle of attack [rad] to hold."""

    time: float
    angle_of_attack: float


@dataclass(frozen=True)
class FaultEvent:
    """From ``time`` [s] on a gauge or auxiliary sensor, by name or number from 1, has a fault.

    ``value`` is the value of its kind [m/m], or in the unit of a sensor where it is ``of_sensor``.
    """

    time: float
    gauge: str | int
    kind: GaugeFault
    value: float = 0.0
    of_sensor: bool = False


@dataclass(frozen=True)
class Scenario:
    """One flight.

    Attributes
    ----------
    name : for headings.
    inverse_map, flight_model : files that the FMUs are made of.
    stop_time, step_size : [s].
    feedback : of :data:`FEEDBACKS`, one run each.
    start : flight condition and vehicle.
    noise_seed : of the gauges' noise.
    autopilot : its settings.
    commands : in order of time, the first at 0.
    faults : in order of time.
    """

    name: str
    inverse_map: Path
    flight_model: Path
    stop_time: float
    step_size: float
    feedback: tuple[str, ...]
    start: FlightStart
    noise_seed: int
    autopilot: AutopilotSettings
    commands: tuple[Command, ...]
    faults: tuple[FaultEvent, ...]


def load_scenario(path: Path, folder: Path | None = None) -> Scenario:
    """Read a scenario.

    Parameters
    ----------
    folder : where ``map`` and ``flight_model`` lie, if not next to the scenario.

    Raises
    ------
    InputError
        The file is missing or no TOML, or an entry is missing, unknown or out of range.
    """
    root = read_table(path)
    base = folder if folder is not None else path.parent
    files, flight, vehicle = root.table("files"), root.table("flight"), root.table("vehicle")
    stop_time = root.number("stop_time_s", None, 1e-3, 1e5)
    scenario = Scenario(
        name=root.text("name", path.stem),
        inverse_map=base / files.text("map", "map.h5"),
        flight_model=base / files.text("flight_model", "flight_model.h5"),
        stop_time=stop_time,
        step_size=root.number("step_size_s", 0.01, 1e-6, stop_time),
        feedback=_feedback(root),
        start=_start(flight, vehicle),
        noise_seed=flight.integer("noise_seed", 1, 2**31 - 1),
        autopilot=_autopilot(root.table("autopilot")),
        commands=_commands(root, stop_time),
        faults=tuple(sorted((_fault(item, stop_time) for item in root.tables("fault")), key=lambda f: f.time)),
    )
    for table in (files, flight, vehicle, root):
        table.finish()
    return scenario


def _feedback(root: TomlTable) -> tuple[str, ...]:
    value = root.entries.pop("feedback", list(FEEDBACKS))
    chosen = tuple(value) if isinstance(value, list) else (value,)
    if not chosen or any(item not in FEEDBACKS for item in chosen) or len(set(chosen)) < len(chosen):
        raise root.fault("feedback", f"{value!r} found, must be {' or '.join(FEEDBACKS)}, or a list of both")
    return chosen


def _start(flight: TomlTable, vehicle: TomlTable) -> FlightStart:
    default = FlightStart(6.0, 20e3)
    return FlightStart(
        mach_number=flight.number(MACH_COLUMN, None, 0.0, 100.0),
        altitude=1e3 * flight.number(ALTITUDE_COLUMN, None, 0.0, 71.0),
        angle_of_attack=radians(flight.number(ANGLE_COLUMN, 0.0, -90.0, 90.0)),
        sideslip_angle=radians(flight.number(SIDESLIP_COLUMN, 0.0, -90.0, 90.0)),
        mass=vehicle.number("mass_kg", default.mass, 1e-3, 1e9),
        pitch_inertia=vehicle.number("pitch_inertia_kg_m2", default.pitch_inertia, 1e-6, 1e12),
        pitch_damping=vehicle.number("pitch_damping_per_rad", default.pitch_damping, -1e6, 1e6),
    )


def _autopilot(table: TomlTable) -> AutopilotSettings:
    default = AutopilotSettings()
    settings = AutopilotSettings(
        frequency=table.number("frequency_rad_per_s", default.frequency, 1e-3, 1e3),
        damping_ratio=table.number("damping_ratio", default.damping_ratio, 0.0, 100.0),
        observer_rate=table.number("observer_rate_rad_per_s", default.observer_rate, 0.0, 1e3),
        largest_moment=table.number("largest_moment_N_m", default.largest_moment, 0.0, 1e12),
        hold_time=table.number("hold_time_s", default.hold_time, 0.0, 1e5),
        confirmations=table.integer("confirmations", default.confirmations, 10**6),
        largest_isolated=table.integer("largest_isolated", default.largest_isolated, 10**6),
    )
    table.finish()
    return settings


def _commands(root: TomlTable, stop_time: float) -> tuple[Command, ...]:
    commands = []
    for item in root.tables("command"):
        time = item.number("time_s", None, 0.0, stop_time)
        commands.append(Command(time, radians(item.number(ANGLE_COLUMN, None, -90.0, 90.0))))
        item.finish()
    times = [command.time for command in commands]
    if not times or times[0] != 0.0 or sorted(set(times)) != times:
        raise root.fault("command", "the times of the commands must start at 0 and increase")
    return tuple(commands)


def _fault(item: TomlTable, stop_time: float) -> FaultEvent:
    """Read one fault; its value is in um/m, or in the unit of an auxiliary sensor."""
    names = [kind.name.lower() for kind in GaugeFault]
    name = item.text("kind")
    if name not in names:
        raise item.fault("kind", f"{name!r} found, must be one of {', '.join(names)}")
    kind = GaugeFault[name.upper()]
    gauge = item.entries.pop("gauge", None)
    if not isinstance(gauge, str | int) or isinstance(gauge, bool):
        raise item.fault("gauge", f"expected the name of a gauge or its number from 1, got {gauge!r}")
    key = "drift_um_per_m_per_s" if kind is GaugeFault.DRIFT else "value_um_per_m"
    of_sensor = "drift_per_s" if kind is GaugeFault.DRIFT else "value"
    valued = kind in (GaugeFault.BIAS, GaugeFault.DRIFT, GaugeFault.STUCK)
    in_unit, value = valued and of_sensor in item.entries, 0.0
    if in_unit:
        value = item.number(of_sensor, None, -1e9, 1e9)
    elif valued:
        value = 1e-6 * item.number(key, None, -1e5, 1e5)
    time = item.number("time_s", None, 0.0, stop_time)
    event = FaultEvent(time=time, gauge=gauge, kind=kind, value=value, of_sensor=in_unit)
    item.finish()
    return event
