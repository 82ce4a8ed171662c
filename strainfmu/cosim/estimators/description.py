"""What an estimator FMU says of itself: inputs, outputs, and the gauges, sensors and places they are of."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.systems.instance import read_description
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.other_loads import LoadGroup, groups_among
from strainfmu.estimator.settings import SENSOR_RANGE
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST

STRAIN = re.compile(r"strain\[(\d+)\]")
VALID = re.compile(r"valid\[(\d+)\]")
_GAUGE = re.compile(r"Strain of gauge (.+) at x = ")
TEMPERATURES = re.compile(r"temperature\[(\d+)\]")
SENSOR = re.compile(r"Temperature of sensor (.+);")
_NUMBER = {"Real", "Integer", "Enumeration", "Boolean"}
OUTPUTS = (
    *COEFFICIENT_NAMES,
    *(f"sigma.{name}" for name in COEFFICIENT_NAMES),
    "health.chi_square",
    "health.state",
)
FIRST_NUMBER = 2 * len(COEFFICIENT_NAMES)
"""Place of the first output that is neither a coefficient nor its standard deviation: ``health.chi_square``."""
CONTENTS = "extra/strainfmu/contents.json"
"""What an FMU of this project states beside its model description (strainfmu/fmu/fmu_file.py)."""


def gauge_names_of(path: Path) -> tuple[str, ...]:
    """Return the names of the gauges of the estimator FMU at ``path``, in the order of its strains.

    Raises
    ------
    InputError
        The FMU is missing, damaged, or no estimator.
    """
    strains = numbered(estimator_inputs(path, read_description(path)), STRAIN)
    return tuple(gauge_name(variable) for variable in strains)


def load_groups_in(path: Path) -> tuple[LoadGroup, ...]:
    """Return the groups of the loads that the FMU at ``path`` gives beside the five.

    Raises
    ------
    InputError
        The FMU is missing or damaged.
    """
    return load_groups(read_description(path))


def outputs_of(path: Path) -> tuple[tuple[str, str], ...]:
    """Return name and unit, "1" of a number without one, of every output of the FMU at ``path``.

    They are in the order of their value references, as a map has them.

    Raises
    ------
    InputError
        The FMU is missing or damaged.
    """
    in_order = sorted(read_description(path).modelVariables, key=lambda one: int(one.valueReference))
    found = (one for one in in_order if one.causality == "output")
    return tuple((one.name, one.unit or "1") for one in found if one.type in _NUMBER)


def noise_std_of(contents: Path, n_gauges: int) -> FloatArray | None:
    """Return (n_d,) the noise that ``contents`` of an unzipped FMU states [m/m], None if it does not."""
    try:
        stated = json.loads(contents.read_text())["gauge_noise_um_per_m"]
        noise = 1e-6 * np.asarray(stated, dtype=float)
    except (OSError, ValueError, TypeError, KeyError):
        return None  # of an earlier version, or of another program
    usable = noise.shape == (n_gauges,) and bool((np.isfinite(noise) & (noise > 0.0)).all())
    return noise if usable else None


def sensor_range_of(description: Any) -> float:
    """Return the largest |strain| of a working gauge [m/m] by an FMU; that of maps if it states none."""
    start = next((v.start for v in description.modelVariables if v.name == "sensor_range"), None)
    return SENSOR_RANGE if start is None else float(start)


def estimator_inputs(path: Path, description: Any) -> list[Any]:
    """Return the inputs of an estimator FMU."""
    inputs = [v for v in description.modelVariables if v.causality == "input" and v.type in _NUMBER]
    names = [variable.name for variable in inputs]
    for name in ("strain[1]", "dynamic_pressure"):
        if name not in names:
            raise InputError(f"{path}: no input '{name}' found: not an estimator FMU")
    return inputs


def reading_units(inputs: Iterable[Any]) -> dict[str, str]:
    """Return the unit of each auxiliary sensor and of thrust among ``inputs`` of an estimator, by name."""
    return {one.name: str(one.unit) for one in inputs if one.name.startswith(SENSOR_PREFIX) or one.name == THRUST}


def reading_units_in(path: Path) -> dict[str, str]:
    """Return the unit of each auxiliary sensor and of thrust among the inputs of the estimator FMU at ``path``.

    Raises
    ------
    InputError
        The FMU is missing or damaged.
    """
    return reading_units(one for one in read_description(path).modelVariables if one.causality == "input")


def load_groups(description: Any) -> tuple[LoadGroup, ...]:
    """Return the groups of the loads that an FMU states beside the five."""
    outputs = (v for v in description.modelVariables if v.causality == "output")
    return groups_among({one.name: one.description or "" for one in outputs})


def estimator_outputs(path: Path, description: Any, other_names: Iterable[str]) -> list[Any]:
    """Return the outputs that the bridge reads, with those of ``other_names`` that exist before the last one."""
    found = {v.name: v for v in description.modelVariables if v.causality == "output"}
    missing = [name for name in OUTPUTS if name not in found]
    if missing:
        raise InputError(f"{path}: no output '{missing[0]}' found: not an estimator FMU")
    numbers, state = OUTPUTS[:-1], OUTPUTS[-1]
    others = [found[name] for name in other_names if name in found]
    # Those of a type side by side, so that they are exchanged as they lie.
    others.sort(key=lambda variable: variable.type != "Real")
    return [*(found[name] for name in numbers), *others, found[state]]


def numbered(variables: Sequence[Any], pattern: re.Pattern[str]) -> list[Any]:
    """Return the variables of an array in the order of their indices."""
    found = {int(match[1]): v for v in variables if (match := pattern.fullmatch(v.name))}
    return [found[index] for index in sorted(found)]


def gauge_name(variable: Any) -> str:
    return described(variable, _GAUGE)


def described(variable: Any, pattern: re.Pattern[str]) -> str:
    """Return the name of gauge or sensor in the variable's description, or the variable's own."""
    match = pattern.match(variable.description or "")
    return match[1] if match else str(variable.name)
