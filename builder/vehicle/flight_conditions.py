"""Sets of flight conditions at which snapshots are taken, and the section [conditions] of a vehicle file.

The section holds flow parameters, such as deflections, too.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from math import radians
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, field_validator, model_validator

from builder.vehicle.toml.toml_sections import (
    ALTITUDE_KM,
    MACH_NUMBER,
    MAX_CONDITIONS,
    STREAM_ANGLE_DEG,
    Altitude,
    FileName,
    MachNumber,
    Section,
    StreamAngle,
    once_each,
)
from strainfmu.errors import InputError
from strainfmu.flight_condition import ALTITUDE_COLUMN, CONDITION_COLUMNS, FlightCondition
from strainfmu.text_files import read_csv, shown_columns

PUBLISHED_ALTITUDE = 20e3
"""Of the paper's sets P1 and P2 [m]."""


@dataclass(frozen=True)
class ConditionSet:
    """Flight conditions in their order, under the name they were requested by."""

    name: str
    conditions: tuple[FlightCondition, ...]


def condition_set(name: str) -> ConditionSet:
    """Return the set ``P1`` or ``P2`` of the paper, or the conditions of a CSV file called ``name``.

    P1 is M {5, 5.5, 6, 6.5, 7} x alpha {0, 2, .., 10} x beta {0, 5, 10}, 90 conditions; P2 is M {5, 6, 7} x
    alpha, beta {-8, -6, .., 8}, 243; both at 20 km.

    Raises
    ------
    InputError
        The file is missing or wrong.
    """
    if name == "P1":
        grid = condition_grid([5.0, 5.5, 6.0, 6.5, 7.0], range(0, 11, 2), (0, 5, 10), PUBLISHED_ALTITUDE)
    elif name == "P2":
        grid = condition_grid([5.0, 6.0, 7.0], range(-8, 9, 2), range(-8, 9, 2), PUBLISHED_ALTITUDE)
    else:
        grid = read_conditions(Path(name))
    return ConditionSet(name, tuple(grid))


def read_conditions(path: Path) -> list[FlightCondition]:
    """Read flight conditions from a CSV file whose first line is :data:`CONDITION_COLUMNS`.

    Raises
    ------
    InputError
        The file is missing or no text, or a row is wrong or repeats one before; the message names line and
        column, what is allowed and what was found.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file; a set of conditions is P1, P2 or a CSV file")
    (_, header), *rows = read_csv(path) or [(1, [])]
    if tuple(cell.strip() for cell in header) != CONDITION_COLUMNS:
        got = shown_columns(header, CONDITION_COLUMNS)
        raise InputError(f"{path}: line 1: expected header '{','.join(CONDITION_COLUMNS)}', got {got}")
    lines: dict[FlightCondition, int] = {}
    for line, row in rows:
        if any(cell.strip() for cell in row):
            _add_condition(path, line, row, lines)
    if not lines:
        raise InputError(f"{path}: expected at least 1 condition, got none")
    return list(lines)


def _add_condition(path: Path, line: int, row: list[str], lines: dict[FlightCondition, int]) -> None:
    """Add the condition of one row, which stands in no line before; ``lines`` has the line of each."""
    condition = _condition(path, line, row)
    if condition in lines:
        raise InputError(
            f"{path}: line {line}: expected each condition once, got it in line {lines[condition]} too"
        )
    lines[condition] = line
    if len(lines) > MAX_CONDITIONS:
        raise InputError(f"{path}: expected at most {MAX_CONDITIONS} conditions, got more")


def _condition(path: Path, line: int, row: list[str]) -> FlightCondition:
    """Return the condition of one row."""
    if len(row) != len(CONDITION_COLUMNS):
        raise InputError(f"{path}: line {line}: expected {len(CONDITION_COLUMNS)} values, got {len(row)}")
    allowed = (MACH_NUMBER, STREAM_ANGLE_DEG, STREAM_ANGLE_DEG, ALTITUDE_KM)
    values = []
    for column, cell, limits in zip(CONDITION_COLUMNS, row, allowed, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = float("nan")
        if not limits.holds(value):
            raise InputError(f"{path}: line {line}, column {column}: expected {limits}, got '{cell.strip()}'")
        values.append(value)
    mach_number, alpha, beta, altitude = values
    return FlightCondition(mach_number, radians(alpha), radians(beta), 1e3 * altitude)


def count_repeated(conditions: Sequence[FlightCondition]) -> int:
    """Return how many of ``conditions`` repeat an earlier one."""
    return len(conditions) - len(set(conditions))


def condition_grid(
    mach_numbers: Iterable[float],
    angles_of_attack_deg: Iterable[float],
    sideslip_angles_deg: Iterable[float],
    altitude: float | Iterable[float],
    parameters: Sequence[Sequence[float]] = (),
) -> list[FlightCondition]:
    """Return all combinations, the last quantity running fastest, altitude [m] slowest; angles in degrees.

    ``parameters`` holds the values of each flow parameter.
    """
    altitudes = (altitude,) if isinstance(altitude, int | float) else altitude
    return [
        FlightCondition(mach, radians(alpha), radians(beta), height, tuple(of_flow))
        for height, mach, alpha, beta, *of_flow in product(
            altitudes, mach_numbers, angles_of_attack_deg, sideslip_angles_deg, *parameters
        )
    ]


def flow_key(condition: FlightCondition) -> tuple[float, float]:
    """Return (M, a_T [rad]), rounded: on a body of revolution, conditions with the same key have the same flow."""
    return round(condition.mach_number, 9), round(condition.total_incidence, 9)


NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
MAX_PARAMETERS = 6
TAKEN = ("time_s", *CONDITION_COLUMNS, "file")
"""Columns of the files in which parameters are columns, too."""

Value = Annotated[float, Field(ge=-1e6, le=1e6)]


class DeflectedSurface(Section):
    """The surface at one value of a parameter: a file with the triangles of ``shape.surface``, in their order."""

    value: Value
    file: FileName


class FlowParameter(Section):
    """One parameter: its values in the snapshots, and the surfaces that belong to values of it.

    ``shape.surface`` is that at ``undeflected``. Between the values of the surfaces nodes move in straight lines.
    """

    values: Annotated[list[Value], AfterValidator(once_each)] = Field(min_length=1)
    undeflected: Value = 0.0
    surfaces: list[DeflectedSurface] = Field(default_factory=list, max_length=50)

    @model_validator(mode="after")
    def _surfaces_hold_the_values(self) -> FlowParameter:
        if not self.surfaces:
            return self
        known = once_each([self.undeflected, *(surface.value for surface in self.surfaces)])
        low, high = min(known), max(known)
        for value in self.values:
            if not low <= value <= high:
                raise ValueError(f"values: expected {low:g} .. {high:g}, the range of the surfaces, got {value:g}")
        return self


def checked_names(parameters: dict[str, FlowParameter]) -> dict[str, FlowParameter]:
    """Return ``parameters``.

    Raises
    ------
    ValueError
        There are too many, or a name cannot be the name of a column.
    """
    if len(parameters) > MAX_PARAMETERS:
        raise ValueError(f"expected at most {MAX_PARAMETERS} parameters, got {len(parameters)}")
    for name in parameters:
        if not NAME.fullmatch(name) or name in TAKEN:
            raise ValueError(
                f"expected names of letters, digits and _ other than {', '.join(TAKEN)}, got '{name}'"
            )
    return parameters


class Conditions(Section):
    """Flight conditions of the snapshots: all combinations. ``altitude_km`` is one number or a list.

    ``parameters`` are flow parameters, each a section with a name of the user's.
    """

    mach_number: list[MachNumber] = Field(min_length=1)
    angle_of_attack_deg: list[StreamAngle] = Field(min_length=1)
    sideslip_angle_deg: list[StreamAngle] = Field(min_length=1)
    altitude_km: Altitude | Annotated[list[Altitude], Field(min_length=1)]
    parameters: Annotated[dict[str, FlowParameter], AfterValidator(checked_names)] = Field(default_factory=dict)

    @field_validator(ALTITUDE_COLUMN, mode="before")
    @classmethod
    def _number_or_list(cls, value: Any) -> Any:
        """Refuse here, in one line, what is no altitude: a union has a fault for each of its parts."""
        altitudes = value if isinstance(value, list) else [value]
        if not altitudes:
            raise ValueError("expected at least 1 value, got []")
        for altitude in altitudes:
            if (
                isinstance(altitude, bool)
                or not isinstance(altitude, int | float)
                or not ALTITUDE_KM.holds(altitude)
            ):
                raise ValueError(f"expected {ALTITUDE_KM}, or a list of such numbers, got {altitude!r}")
        return value

    @field_validator(*CONDITION_COLUMNS)
    @classmethod
    def _each_value_once(cls, values: list[float] | float) -> list[float] | float:
        return once_each(values) if isinstance(values, list) else values

    @property
    def altitudes_km(self) -> list[float]:
        """Altitudes [km], in the order of the file."""
        return self.altitude_km if isinstance(self.altitude_km, list) else [self.altitude_km]
