"""What signatures of the commands' functions do not say: other names, metavars, ranges, units, texts to read."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, isnan, pi, radians
from typing import Any

import typer

from strainfmu.errors import InputError

Reader = Callable[[str, str], Any]


def within(
    low: float, high: float, unit: str = "", *, takes_nan: bool = False, factor: float | None = None
) -> Callable[[typer.CallbackParam, float | None], float | None]:
    """Return the callback of an option that takes a number from ``low`` to ``high``, and NaN if ``takes_nan``.

    The command gets the number times ``factor``; None leaves it as it is.

    Raises
    ------
    InputError
        By the callback, where the number is outside; the message names the option.
    """

    def checked(param: typer.CallbackParam, value: float | None) -> float | None:
        if value is not None and not low <= value <= high and not (takes_nan and isnan(value)):
            name = max(param.opts, key=len)
            shown = f"{low:.6g} .. {high:.10g} {unit}".rstrip() + (", or nan" if takes_nan else "")
            raise InputError(f"{name}: expected {shown}, got {value:.6g}")
        return value if value is None or factor is None else factor * value

    return checked


def listed(_: str, text: str) -> list[str] | str:
    """Return the names of a list with commas; "all" as it is."""
    return text if text == "all" else [name.strip() for name in text.split(",") if name.strip()]


def numbers(option: str, text: str) -> list[float]:
    """Return finite numbers that commas separate."""
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError as error:
        raise InputError(f"{option}: expected numbers with commas, got '{text}'") from error
    if not all(map(isfinite, values)):
        raise InputError(f"{option}: expected finite numbers, got '{text}'")
    return values


def series(option: str, text: str) -> list[float]:
    """Return numbers with commas, or first:last:step."""
    if ":" not in text:
        return numbers(option, text)
    parts = numbers(option, text.replace(":", ","))
    if len(parts) != 3 or parts[2] <= 0.0 or parts[1] < parts[0] or (parts[1] - parts[0]) / parts[2] > 1e5:
        raise InputError(f"{option}: expected first:last:step with a positive step, got '{text}'")
    first, last, step = parts
    return [round(first + step * k, 9) for k in range(int((last - first) / step + 1e-9) + 1)]


def in_radians(reader: Callable[[str, str], list[float]]) -> Reader:
    """Return the reader of angles in degrees."""
    return lambda option, text: [*map(radians, reader(option, text))]


def named_numbers(option: str, text: str) -> dict[str, float]:
    """Return name=number with commas."""
    values = {}
    for part in filter(None, (entry.strip() for entry in text.split(","))):
        name, equals, value = part.partition("=")
        if not equals:
            raise InputError(f"{option}: expected name=number with commas, got '{part}'")
        values[name.strip()] = numbers(option, value)[0]
    return values


def cable(option: str, text: str) -> tuple[float, float]:
    """Return cost of a metre of cable and the station that it runs to [m]."""
    parts = numbers(option, text.replace("@", ","))
    if len(parts) != 2 or parts[0] < 0.0 or text.count("@") != 1:
        raise InputError(f"{option}: expected COST@X with a cost from 0 per metre, got '{text}'")
    return parts[0], parts[1]


def zone(option: str, text: str) -> tuple[float, ...]:
    """Return first and last station of a zone [m] and, if stated, its roll angles [rad]."""
    along, _, around = text.partition("@")
    parts = numbers(option, along.replace(":", ","))
    angles = numbers(option, around.replace(":", ",")) if around else []
    if len(parts) != 2 or len(angles) not in (0, 2) or parts[0] > parts[1]:
        raise InputError(f"{option}: expected x1:x2 in m or x1:x2@roll1:roll2 in deg, got '{text}'")
    return (*parts, *map(radians, angles))


def window(option: str, text: str) -> tuple[float, float]:
    """Return FROM:TO [s]."""
    begin, colon, end = text.partition(":")
    try:
        times = float(begin), float(end)
    except ValueError:
        times = float("nan"), float("nan")
    if not colon or not all(map(isfinite, times)):
        raise InputError(f"{option}: expected FROM:TO in seconds, as 0:10, got '{text}'")
    return times


SI = {"mm": 1e-3, "km": 1e3, "deg": pi / 180.0, "um/m": 1e-6, "kPa": 1e3, "%": 0.01, "min": 60.0}
"""Factors to SI units."""


@dataclass(frozen=True, kw_only=True)
class Spelling:
    """How an option is spelled and read.

    Attributes
    ----------
    names : of the option; none for the parameter's.
    metavar : None for the type's.
    callback : of typer, checks and converts a value; None to leave it as its type has it.
    unit : of the option's value; the function gets SI units.
    form : how the text is written, for the help.
    is_argument : whether it is an argument although it may be missing.
    is_repeated : whether the option may be given several times, although it is read.
    """

    names: tuple[str, ...] = ()
    metavar: str | None = None
    callback: Callable[[typer.CallbackParam, Any], Any] | None = None
    unit: str = ""
    form: str = ""
    is_argument: bool = False
    is_repeated: bool = False

    def option(self, parameter: str) -> str:
        """Return the name by which messages and the help call a parameter."""
        return max(self.names, key=len, default=f"--{parameter.replace('_', '-')}")

    def shown(self, default: Any) -> Any:
        """Return a default as the user would write it; None for none."""
        factor = SI.get(self.unit, 1.0)
        if isinstance(default, tuple):
            parts = [f"{number / factor:.12g}" if isinstance(number, float) else str(number) for number in default]
            return ",".join(parts) or None
        if isinstance(default, float):
            return float(f"{default / factor:.12g}")
        return default


def value(metavar: str | None, *names: str) -> Spelling:
    """Return the spelling of an option with a metavar, and with names that are not its parameter's."""
    return Spelling(metavar=metavar, names=names)


def argument(metavar: str | None = None) -> Spelling:
    """Return the spelling of an argument that may be missing, or has another metavar than its name."""
    return Spelling(metavar=metavar, is_argument=True)


def number(low: float, high: float, unit: str = "", metavar: str | None = None, **settings: Any) -> Spelling:
    """Return the spelling of a number from ``low`` to ``high`` in ``unit``, given to the function in SI."""
    name = settings.pop("names", ())
    callback = within(low, high, unit, factor=settings.pop("factor", SI.get(unit)), **settings)
    return Spelling(metavar=metavar or unit.upper() or None, callback=callback, unit=unit, names=name)


def count(low: int, high: int) -> Spelling:
    """Return the spelling of a whole number from ``low`` to ``high``."""
    return number(low, high, metavar="N")


def read(reader: Reader, form: str = "", repeated: bool = False, **settings: Any) -> Spelling:
    """Return the spelling of a text of a form that ``reader`` reads, or of several texts."""

    def callback(param: typer.CallbackParam, text: Any) -> Any:
        option = max(param.opts, key=len)
        if repeated:
            return [reader(option, word) for word in text or ()]
        return reader(option, text) if text else None

    return Spelling(callback=callback, form=form, is_repeated=repeated, **settings)


PRESSURE_PA = (1.0, 1e8, "Pa")
"""Of q_inf, from a breath of wind to Mach 30 at sea level."""
DURATION_S = (1e-3, 1e8, "s")
SERIES = "numbers with commas, or first:last:step,"
ANGLES = read(in_radians(numbers), "in deg, with commas", unit="deg")

_SPELLINGS = {
    "as_built": number(0, 2**31 - 1, metavar="SEED"),
    "bus": value("TOML"),
    "channels": value("TOML"),
    "conditions": count(1, 1_000_000),
    "directions": read(listed, "with commas"),
    "draws": count(1, 100_000),
    "duration": number(*DURATION_S),
    "estimators": value("NAME"),
    "formats": value("csv|parquet|json", "--format"),
    "interface": value(None),
    "inverse_map": value("MAP"),
    "known_output": value("TOML"),
    "largest": number(1, 10**9),
    "layouts": value("NAME", "--layout"),
    "option": value("KEY=VALUE", "--bus-option"),
    "output": value(None, "-o", "--output"),
    "scheduler": value("ADDRESS"),
    "seed": number(0, 2**31 - 1),
    "settings": value("TABLE.ENTRY=VALUE", "--set"),
    "snapshots": value("FILE"),
    "solver": value("NAME"),
    "structure": value("FILE"),
    "workers": count(1, 1000),
    "zeros": value("TOML"),
    "bench.folder": argument(),
    "bench.gauges": value("VEHICLE"),
    "bench.growth": value("FILE"),
    "bench.mesh": value("VEHICLE"),
    "bench.most": count(8, 4096),
    "bench.output": value("FILE", "-o", "--output"),
    "bench.random_steps": number(1, 10**7),
    "bench.structure": value("VEHICLE"),
    "bridge.record": value("FILE"),
    "channels.source": value("MAP"),
    "compare.training": count(1200, 10_000_000),
    "compare.vehicle": argument(),
    "convert.file_format": value(None, "--format"),
    "convert.snapshots": value(None),
    "dbc.source": value("MAP"),
    "dbc.template": value("TOML"),
    "demo.can_duration": number(0.1, 1e5, "s"),
    "estimate.dynamic_pressure": number(*PRESSURE_PA, takes_nan=True),
    "estimate.exclude": read(listed, metavar="CHANNEL,.."),
    "estimate.field": value("X.vtkhdf"),
    "estimate.field_every": count(1, 1_000_000),
    "estimate.filter_seconds": number(1e-9, 1e6, "s", "SECONDS", names=("--filter",)),
    "estimate.ignore_columns": read(listed, metavar="NAME,.."),
    "estimate.part_rows": count(1, 10**9),
    "estimate.report": value("X.html"),
    "estimate.source": value("FMU"),
    "export.platforms": read(listed, "with commas"),
    "export.tare_known": value("TOML"),
    "fly.files": value("DIR"),
    "fly.ssp": value("X.ssp"),
    "inspect.artefact": value("FILE"),
    "inspect.figures": value(None, "-o", "--figures"),
    "loadtest.attitudes": ANGLES,
    "loadtest.axial": number(0.0, 1e7, "N"),
    "loadtest.cases": count(1, 200),
    "loadtest.cell_error": number(0.0, 100.0, "%"),
    "loadtest.checks": count(0, 50),
    "loadtest.force": number(0.0, 1e7, "N"),
    "loadtest.largest_strain": number(1.0, 1e5, "um/m"),
    "loadtest.load_cells": count(1, 100),
    "loadtest.load_error": number(0.0, 100.0, "%"),
    "loadtest.noise": number(1e-4, 1e3, "um/m"),
    "loadtest.pad_angle": number(1.0, 180.0, "deg"),
    "loadtest.pad_length": number(1.0, 1e4, "mm"),
    "loadtest.pressure": number(0.0, 1e5, "kPa"),
    "loadtest.reading_time": number(0.0, 1e4, "min"),
    "loadtest.repeats": count(0, 200),
    "loadtest.roll_angles": ANGLES,
    "loadtest.samples": count(1, 10**6),
    "loadtest.setup_time": number(0.0, 1e4, "min"),
    "loadtest.stations": read(numbers, "in m, with commas", unit="m"),
    "loadtest.steps": count(1, 20),
    "monitor.http": value("HOST:PORT"),
    "monitor.listen": value("HOST:PORT"),
    "picture.case": number(1, 1e6, metavar="NUMBER"),
    "picture.excluded": value("GAUGE"),
    "place.budget": number(1e-6, 1e9, "cost"),
    "place.cable": read(cable, metavar="COST@X", unit="m"),
    "place.costs": read(named_numbers, "as axial=1,hoop=1.5"),
    "place.curves": value("FILE"),
    "place.forbid": read(zone, "x1:x2 in m, or x1:x2@roll1:roll2 in deg", repeated=True, metavar="ZONE", unit="m"),
    "place.gauges": count(1, 2000),
    "place.keep": value("FILE"),
    "place.kinds": number(1, 4, metavar="K"),
    "place.loads": read(named_numbers, "as C_A=1,M_P=2"),
    "place.losses": number(1, 2),
    "place.roll_angles": read(in_radians(series), f"{SERIES} in deg", unit="deg"),
    "place.spacing": number(0.0, 1e4, "mm"),
    "place.starts": number(1, 1000),
    "place.stations": read(series, f"{SERIES} in m", unit="m"),
    "plant.altitude": number(0.0, 71.0, "km"),
    "plant.angle_of_attack": number(-60.0, 60.0, "deg"),
    "plant.bus": value("BUS.toml"),
    "plant.mach_number": number(1.01, 30.0),
    "plant.recording": value("FILE"),
    "plant.sideslip": number(-60.0, 60.0, "deg"),
    "plant.trajectory": value("FILE.csv"),
    "send.data": argument(),
    "send.gauges": value("MAP", "--map"),
    "send.plant": value("X.fmu"),
    "send.report": value("X.json"),
    "snapshots.sets": value("P1|P2|FILE.csv", "--set"),
    "snapshots.workers": number(0, 1024),
    "stress.inverse_map": value("MAP", "--map"),
    "stress.vehicle": argument(),
    "structure.by_position": value(None, "--surfaces-by-position"),
    "structure.export_influence": value("FILE.h5"),
    "structure.export_loads": value("DIR"),
    "structure.mesh_unit": number(1e-6, 1e3, "m", "METRES"),
    "structure.model": value("swept|gmsh|FILE"),
    "study.file": value("STUDY"),
    "tare.ambient_pressure": number(0.0, 1e6, "Pa"),
    "tare.largest_drift": number(0.0, 5e4, "um/m"),
    "tare.largest_zero": number(1.0, 5e4, "um/m"),
    "tare.max_dynamic_pressure": number(0.0, 1e5, "Pa"),
    "tare.vehicle": value("TOML"),
    "tare.weight_nose_deg": number(-90.0, 90.0, "deg", factor=None),
    "tare.weight_up_roll_deg": number(-360.0, 360.0, "deg", factor=None),
    "tare.window": read(window, metavar="FROM:TO", unit="s", names=("--window",)),
    "trial.flows": value("FLOWS"),
    "trial.inverse_map": value("MAP", "--map"),
    "trial.only": value("ERROR"),
    "trial.vehicle": argument(),
}
"""By parameter, for all commands; by command and parameter, for one."""

FLAGS: dict[str, dict[str, tuple[bool, str]]] = {
    "bench": {
        "worst": (
            False,
            "time the slowest steps of the native FMUs. Not with ``structure``, ``mesh``, ``gauges``, ``peers``.",
        ),
        "peers": (
            False,
            "time other programs at the same work. Not with ``structure``, ``mesh``, ``gauges``, ``worst``.",
        ),
    },
    "demo": {"verbose": (False, "print stages, notes, detection thresholds and the list of files.")},
    "fly": {"figures": (True, "draw every run.")},
    "loadtest": {
        "template": (False, "write a file to fill in for a test of your own. Not with other loads."),
    },
}
"""Options that choose one of the functions of a command or what is printed: default and help."""

NO_OPTIONS = {"estimate": ("files",), "tare": ("known_of",), "trial": ("training",)}
"""Parameters of functions that are no options."""


def spelling(command: str, parameter: str) -> Spelling:
    """Return how a command spells the option of a parameter."""
    return _SPELLINGS.get(f"{command}.{parameter}") or _SPELLINGS.get(parameter) or Spelling()
