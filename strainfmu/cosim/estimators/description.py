"""What an estimator FMU says of itself: inputs, outputs, and the gauges, sensors and places they are of."""

import re
from collections.abc import Iterable, Sequence
from itertools import count, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.systems.instance import read_description
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.other_loads import FAMILIES, LoadFamily, LoadGroup, groups_at
from strainfmu.estimator.settings import OF_READINGS, SENSOR_RANGE
from strainfmu.interface.contents import FmuContents, stated_contents
from strainfmu.interface.health_names import CHI_SQUARE, STATE
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST

STRAIN = re.compile(r"strain\[(\d+)\]")
VALID = re.compile(r"valid\[(\d+)\]")
TEMPERATURES = re.compile(r"temperature\[(\d+)\]")
_NUMBER = {"Real", "Integer", "Enumeration", "Boolean"}
OUTPUTS = (
    *COEFFICIENT_NAMES,
    *(f"sigma.{name}" for name in COEFFICIENT_NAMES),
    CHI_SQUARE,
    STATE,
)
FIRST_NUMBER = 2 * len(COEFFICIENT_NAMES)
"""Place of the first output that is neither a coefficient nor its standard deviation: ``health.chi_square``."""


def gauge_names_of(path: Path) -> tuple[str, ...]:
    """Return the names of the gauges of the estimator FMU at ``path``, in the order of its strains.

    Raises
    ------
    InputError
        The FMU is missing, damaged, or no estimator.
    """
    strains = numbered(estimator_inputs(path, read_description(path)), STRAIN)
    return stated_names(strains, stated_contents(path).gauges)


def load_groups_in(path: Path) -> tuple[LoadGroup, ...]:
    """Return the groups of the loads that the FMU at ``path`` gives in addition to the five.

    Raises
    ------
    InputError
        The FMU is missing or damaged.
    """
    return load_groups(read_description(path), stated_contents(path))


def outputs_of(path: Path) -> tuple[tuple[str, str], ...]:
    """Return name and unit, "1" of a number without one, of every output of the FMU at ``path``.

    They are in the order of their value references, as a map has them.

    Raises
    ------
    InputError
        The FMU is missing or damaged.
    """
    in_order = sorted(read_description(path).modelVariables, key=lambda variable: int(variable.valueReference))
    outputs = (variable for variable in in_order if variable.causality == "output")
    return tuple((variable.name, variable.unit or "1") for variable in outputs if variable.type in _NUMBER)


def noise_std_of(contents: FmuContents, n_gauges: int) -> FloatArray | None:
    """Return (n_d,) the noise that an FMU states [m/m], None if it does not."""
    noise = np.array(contents.gauge_noise, dtype=float)
    return noise if noise.shape == (n_gauges,) and bool((noise > 0.0).all()) else None


def zero_offset_of(contents: FmuContents, n_gauges: int) -> FloatArray:
    """Return (n_d,) the zero offsets that an FMU subtracts unless others are given [m/m]; 0 without any."""
    zero = np.array(contents.gauge_zeros, dtype=float)
    return zero if zero.shape == (n_gauges,) else np.zeros(n_gauges)


def sensor_range_of(description: Any) -> float:
    """Return the largest |strain| of a working gauge [m/m] by an FMU; the value of maps if it states none."""
    start = next((v.start for v in description.modelVariables if v.name == OF_READINGS), None)
    return SENSOR_RANGE if start is None else float(start)


def estimator_inputs(path: Path, description: Any) -> list[Any]:
    """Return the inputs of an estimator FMU."""
    inputs = [v for v in description.modelVariables if v.causality == "input" and v.type in _NUMBER]
    names = [variable.name for variable in inputs]
    for name in ("strain[1]", DYNAMIC_PRESSURE):
        if name not in names:
            raise InputError(f"{path}: no input '{name}' found: not an estimator FMU")
    return inputs


def reading_units(inputs: Iterable[Any]) -> dict[str, str]:
    """Return the unit of each auxiliary sensor and of thrust among ``inputs`` of an estimator, by name."""
    return {v.name: str(v.unit) for v in inputs if v.name.startswith(SENSOR_PREFIX) or v.name == THRUST}


def reading_units_in(path: Path) -> dict[str, str]:
    """Return the unit of each auxiliary sensor and of thrust among the inputs of the estimator FMU at ``path``.

    Raises
    ------
    InputError
        The FMU is missing or damaged.
    """
    return reading_units(v for v in read_description(path).modelVariables if v.causality == "input")


def load_groups(description: Any, contents: FmuContents) -> tuple[LoadGroup, ...]:
    """Return the groups of the loads that an FMU states in addition to the five; the inverse of its interface.

    A place that it does not state is named as the output.
    """
    outputs = {v.name for v in description.modelVariables if v.causality == "output"}

    def places(family: LoadFamily) -> tuple[str, ...]:
        stem = family.loads[0].output
        if not family.is_listed:
            return ("",) if stem in outputs else ()
        names = tuple(takewhile(outputs.__contains__, (f"{stem}[{number}]" for number in count(1))))
        stated = tuple(contents.places.get(stem, ()))
        return stated if len(stated) == len(names) else names

    return groups_at([places(family) for family in FAMILIES])


def estimator_outputs(path: Path, description: Any, other_names: Iterable[str]) -> list[Any]:
    """Return the outputs that the bridge reads, with the ``other_names`` that exist before the last one."""
    outputs = {v.name: v for v in description.modelVariables if v.causality == "output"}
    missing = [name for name in OUTPUTS if name not in outputs]
    if missing:
        raise InputError(f"{path}: no output '{missing[0]}' found: not an estimator FMU")
    numbers, state = OUTPUTS[:-1], OUTPUTS[-1]
    further = [outputs[name] for name in other_names if name in outputs]
    # Those of a type side by side, so that they are exchanged as they lie.
    further.sort(key=lambda variable: variable.type != "Real")
    return [*(outputs[name] for name in numbers), *further, outputs[state]]


def numbered(variables: Sequence[Any], pattern: re.Pattern[str]) -> list[Any]:
    """Return the variables of an array in the order of their indices."""
    by_number = {int(match[1]): v for v in variables if (match := pattern.fullmatch(v.name))}
    return [by_number[index] for index in sorted(by_number)]


def stated_names(variables: Sequence[Any], stated: Sequence[str]) -> tuple[str, ...]:
    """Return the ``stated`` names of the gauges or sensors of an array, the variables' own without them."""
    return tuple(stated) if len(stated) == len(variables) else tuple(str(variable.name) for variable in variables)
