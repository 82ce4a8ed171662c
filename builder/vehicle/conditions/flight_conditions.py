"""Sets of flight conditions at which snapshots are taken."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from math import radians
from pathlib import Path

from builder.vehicle.toml.entry_limits import ALTITUDE_KM, MACH_NUMBER, MAX_CONDITIONS, STREAM_ANGLE_DEG
from strainfmu.errors import InputError
from strainfmu.flight_condition import CONDITION_COLUMNS, FlightCondition
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
    found: dict[FlightCondition, int] = {}
    for line, row in rows:
        if any(cell.strip() for cell in row):
            _add_condition(path, line, row, found)
    if not found:
        raise InputError(f"{path}: expected at least 1 condition, got none")
    return list(found)


def _add_condition(path: Path, line: int, row: list[str], found: dict[FlightCondition, int]) -> None:
    """Add the condition of one row, which stands in no line before; ``found`` holds the line of each."""
    condition = _condition(path, line, row)
    if condition in found:
        raise InputError(
            f"{path}: line {line}: expected each condition once, got it in line {found[condition]} too"
        )
    found[condition] = line
    if len(found) > MAX_CONDITIONS:
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
