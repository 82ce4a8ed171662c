"""Processor time of the dearest steps of native FMUs, event by event, in a C host: what a deadline must hold."""

import platform
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

from strainfmu.cosim.systems.instance import import_fmpy, safe_temporary_parent
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.map.sensors import refuse_sensors
from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT, TARE
from strainfmu.fmu.checks.step_cost import compiled, run, strain_parts
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.fmi_variables import value_references

EVENTS = (
    "nothing",
    "one gauge lost, another one every time",
    "a third of the gauges lost, others every time",
    "the standard deviation of a zero offset changed",
    "the first step of an instance",
    "strain that fits no flight, and a wrong Mach number",
    "no dynamic pressure, Mach number, static pressure or altitude given",
    "first step, a third lost, sigma changed, no fit: all at once",
)
"""What happens in a step, by its number in ``fmus/bench/step_time.c``."""

AT_RANDOM = "masks, readings that are none, jumps, changed sigmas, tares at random"
"""The last line there."""

REPEATS = 201
"""Steps of each event."""


@dataclass(frozen=True)
class EventCost:
    """Processor time of the steps with an event [s]: median and largest; ``rare`` is the quantile of 99.99 %."""

    median: float
    largest: float
    rare: float | None = None


def bench_worst(
    folder: str | PathLike[str] = "demo", *, random_steps: int = 20_000
) -> dict[str, Mapping[str, EventCost]]:
    """Return the costs of the slowest steps of native FMUs of the map in ``folder``, as :func:`worst_steps`.

    Parameters
    ----------
    folder : as :func:`bench` takes it.
    random_steps : with ``worst``: steps with events at random.
    """
    return worst_steps(Path(folder) / "map.h5", random_steps)


def worst_steps(map_path: Path, random_steps: int) -> dict[str, Mapping[str, EventCost]]:
    """Return the costs by event, :data:`EVENTS` and :data:`AT_RANDOM`, of each estimator, alone and filtered.

    ``random_steps`` is the number of steps with events at random.

    Raises
    ------
    InputError
        The map is missing or damaged, or there is no C compiler on this machine, or no Linux.
    StrainfmuError
        The host cannot be compiled, or fails.
    """
    inverse_map = load_inverse_map(map_path)
    refuse_sensors(inverse_map.sensors, f"{map_path}: cost of a step")
    maps = {"linear": replace(inverse_map, manifold=None)}
    if inverse_map.manifold is not None:
        maps["nonlinear"] = inverse_map
    costs_of: dict[str, Mapping[str, EventCost]] = {}
    with tempfile.TemporaryDirectory(prefix="strainfmu_", dir=safe_temporary_parent()) as folder:
        program = compiled(Path(folder) / "step_time")
        if program is None or not sys.platform.startswith("linux"):
            raise InputError("worst steps: expected Linux and a C compiler (cc, gcc or clang), got none")
        for name, inverse_map in maps.items():
            fmu = Path(folder) / f"{name}.fmu"
            save_inverse_map(inverse_map, fmu.with_suffix(".h5"))
            export_estimator(fmu.with_suffix(".h5"), fmu, ExportOptions(platforms=("linux64",)))
            import_fmpy().extract(str(fmu), str(fmu.with_suffix("")))
            description = import_fmpy().read_model_description(str(fmu))
            costs_of[name] = _costs(program, inverse_map, fmu.with_suffix(""), description, random_steps)
            if any(variable.name == FILTER_TIME_CONSTANT for variable in description.modelVariables):
                costs = _costs(program, inverse_map, fmu.with_suffix(""), description, random_steps, filtered=True)
                costs_of[f"{name}, filter"] = costs
    return costs_of


def _costs(
    program: Path,
    inverse_map: InverseMap,
    fmu: Path,
    description: Any,
    random_steps: int,
    *,
    filtered: bool = False,
) -> dict[str, EventCost]:
    """Return the costs by event of an unzipped FMU, with its filter or without."""
    library = next((fmu / "binaries" / "linux64").glob("*.so"))
    names = value_references(estimator_interface(inverse_map))
    manifold = inverse_map.manifold
    numbers = (
        inverse_map.nominal_dynamic_pressure,
        names[FILTER_TIME_CONSTANT] if filtered else 0,
        REPEATS,
        names["zero_std[1]"],
        0.0 if manifold is None else float(manifold.mach_range.mean()),
        names[TARE],
        random_steps,
        *(value for part in strain_parts(inverse_map) for value in part.tolist()),
    )
    command = [str(program), "worst", str(library), description.guid, (fmu / "resources").as_uri()]
    costs = {}
    for line in run([*command, *map(repr, numbers)]).splitlines():
        number, *times = line.split()
        median, *rare, largest = map(float, times)
        costs[(*EVENTS, AT_RANDOM)[int(number)]] = EventCost(median, largest, *rare)
    return costs


def processor_name() -> str:
    """Return the processor of this machine in words."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.exists() else []
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    return model or platform.processor() or platform.machine()
