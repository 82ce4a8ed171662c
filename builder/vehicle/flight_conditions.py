"""Sets of flight conditions at which snapshots are taken."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from math import radians
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

CSV_COLUMNS = ("mach_number", "angle_of_attack_deg", "sideslip_angle_deg", "altitude_km")

PUBLISHED_ALTITUDE = 20e3
"""Of the source's sets P1 and P2 [m]."""


@dataclass(frozen=True)
class ConditionSet:
    """Flight conditions in their order, under the name they were asked for."""

    name: str
    conditions: tuple[FlightCondition, ...]


def condition_set(wanted: str) -> ConditionSet:
    """Return the set ``P1`` or ``P2`` of the source, or the conditions of a CSV file.

    P1 is M {5, 5.5, 6, 6.5, 7} x alpha {0, 2, .., 10} x beta {0, 5, 10}, 90 conditions; P2 is M {5, 6, 7} x
    alpha, beta {-8, -6, .., 8}, 243; both at 20 km.

    Raises
    ------
    InputError
        The file is missing or wrong.
    """
    if wanted == "P1":
        grid = condition_grid([5.0, 5.5, 6.0, 6.5, 7.0], range(0, 11, 2), (0, 5, 10), PUBLISHED_ALTITUDE)
    elif wanted == "P2":
        grid = condition_grid([5.0, 6.0, 7.0], range(-8, 9, 2), range(-8, 9, 2), PUBLISHED_ALTITUDE)
    else:
        grid = read_conditions(Path(wanted))
    return ConditionSet(wanted, tuple(grid))


def read_conditions(path: Path) -> list[FlightCondition]:
    """Read flight conditions from a CSV file whose first line is :data:`CSV_COLUMNS`.

    Raises
    ------
    InputError
        The file is missing or no text, or a row is wrong; the message names line and column, what was found
        and what is allowed.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; a set of conditions is P1, P2 or a CSV file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as CSV text") from error
    reader = csv.reader(text.splitlines())
    try:
        header = tuple(cell.strip() for cell in next(reader, []))
        if header != CSV_COLUMNS:
            raise InputError(
                f"{path}: line 1: header '{','.join(header)}' found, '{','.join(CSV_COLUMNS)}' wanted"
            )
        found = [_condition(path, reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num}: no CSV: {error}") from error
    if not found:
        raise InputError(f"{path}: no conditions found, at least 1 wanted")
    return found


def _condition(path: Path, line: int, row: list[str]) -> FlightCondition:
    """Return the condition of one row."""
    if len(row) != len(CSV_COLUMNS):
        raise InputError(f"{path}: line {line}: {len(row)} values found, {len(CSV_COLUMNS)} wanted")
    allowed = (
        ("a number greater than 1", lambda value: 1.0 < value < float("inf")),
        ("a number between -60 and 60", lambda value: -60.0 < value < 60.0),
        ("a number between -60 and 60", lambda value: -60.0 < value < 60.0),
        ("a number from 0 to 71", lambda value: 0.0 <= value <= 71.0),
    )
    values = []
    for column, cell, (wanted, holds) in zip(CSV_COLUMNS, row, allowed, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = float("nan")
        if not holds(value):
            raise InputError(f"{path}: line {line}, column {column}: '{cell.strip()}' found, {wanted} wanted")
        values.append(value)
    mach_number, alpha, beta, altitude = values
    return FlightCondition(mach_number, radians(alpha), radians(beta), 1e3 * altitude)


def count_repeated(conditions: Sequence[FlightCondition]) -> int:
    """Return how many conditions stood in ``conditions`` before."""
    return len(conditions) - len(set(conditions))


def condition_grid(
    mach_numbers: Iterable[float],
    angles_of_attack_deg: Iterable[float],
    sideslip_angles_deg: Iterable[float],
    altitude: float,
) -> list[FlightCondition]:
    """Return all combinations, sideslip running fastest. Angles in degrees, altitude in metres."""
    return [
        FlightCondition(mach, radians(alpha), radians(beta), altitude)
        for mach, alpha, beta in product(mach_numbers, angles_of_attack_deg, sideslip_angles_deg)
    ]


def flow_key(condition: FlightCondition) -> tuple[float, float]:
    """Return (M, a_T [rad]), rounded: on a body of revolution conditions that share it share one flow."""
    return round(condition.mach_number, 9), round(condition.total_incidence, 9)
