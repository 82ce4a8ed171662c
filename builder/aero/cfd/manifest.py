"""The manifest of a set of CFD results: files, their flight conditions, quantity and axes.

TOML, or a CSV table whose columns are the same entries. Nothing is guessed: an entry that is not declared, not
known or not settled is refused in one line.
"""

from __future__ import annotations

import csv
import hashlib
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator

from builder.aero.cfd.formats.text_numbers import read_file
from builder.aero.cfd.units import METRES, PRESSURE_UNITS, QUANTITIES
from builder.vehicle.toml.toml_sections import Section
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import CONDITION_COLUMNS, FlightCondition
from strainfmu.text_files import shown_columns

BODY_AXES = "aft starboard up"
_DIRECTIONS = {
    "aft": (1.0, 0.0, 0.0),
    "forward": (-1.0, 0.0, 0.0),
    "starboard": (0.0, 1.0, 0.0),
    "port": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0),
    "down": (0.0, 0.0, -1.0),
}
_ROTATION_TOLERANCE = 1e-6
_CASE_KEYS = ("file", *CONDITION_COLUMNS)
_PARAMETER = "parameters."
_TEXT_KEYS = ("file", "quantity", "unit", "length_unit", "array", "location", "axes")


_VALUES = ("quantity", "unit", "array", "location")
_FRAME = ("length_unit", "axes", "rotation", "translation_m", "mirrored")
"""Entries that a case of another code states itself, all of a group or none of it."""


class CaseEntry(Section):
    """One file and the flight condition that it holds; how it is written, where that is not as in the others."""

    file: str = Field(min_length=1)
    mach_number: float = Field(gt=0.0)
    angle_of_attack_deg: float = Field(gt=-90.0, lt=90.0)
    sideslip_angle_deg: float = Field(gt=-90.0, lt=90.0)
    altitude_km: float = Field(ge=0.0, le=71.0)
    parameters: dict[str, float] = Field(default_factory=dict)
    quantity: str | None = None
    unit: str | None = None
    array: str | None = None
    location: str | None = None
    length_unit: str | None = None
    axes: str | None = None
    rotation: list[list[float]] | None = None
    translation_m: list[float] | None = None
    mirrored: bool | None = None

    @property
    def condition(self) -> FlightCondition:
        return FlightCondition(
            self.mach_number,
            radians(self.angle_of_attack_deg),
            radians(self.sideslip_angle_deg),
            1e3 * self.altitude_km,
            tuple(self.parameters.values()),
        )


class FileEntries(Section):
    """How files of results are written; docs/howto/bring_cfd.md explains the entries."""

    quantity: str
    unit: str | None = None
    length_unit: str
    array: str | None = Field(default=None, min_length=1)
    location: Literal["node", "cell"] | None = None
    axes: str = BODY_AXES
    rotation: list[list[float]] | None = None
    translation_m: list[float] = Field(default=[0.0, 0.0, 0.0], min_length=3, max_length=3)
    mirrored: bool = False

    @field_validator("quantity")
    @classmethod
    def _known_quantity(cls, value: str) -> str:
        return _one_of(value, QUANTITIES)

    @field_validator("unit")
    @classmethod
    def _known_unit(cls, value: str | None) -> str | None:
        return None if value is None else _one_of(value, PRESSURE_UNITS)

    @field_validator("length_unit")
    @classmethod
    def _known_length(cls, value: str) -> str:
        return _one_of(value, tuple(METRES))

    @field_validator("axes")
    @classmethod
    def _three_directions(cls, value: str) -> str:
        words = value.split()
        if not set(words) <= set(_DIRECTIONS) or len(words) != 3 or abs(np.linalg.det(_matrix_of(value))) < 0.5:
            raise ValueError(
                f"{value!r} found, must be directions of x, y, z: three of {', '.join(_DIRECTIONS)}, such as "
                f"'{BODY_AXES}'"
            )
        return value

    @field_validator("rotation")
    @classmethod
    def _is_rotation(cls, value: list[list[float]] | None) -> list[list[float]] | None:
        if value is None:
            return None
        if [len(row) for row in value] != [3, 3, 3]:
            raise ValueError("must be three rows of three numbers")
        matrix = np.array(value)
        if np.abs(matrix @ matrix.T - np.eye(3)).max() > _ROTATION_TOLERANCE or np.linalg.det(matrix) < 0.0:
            raise ValueError("must be a rotation: R R^T = 1 within 1e-6, determinant 1")
        return value

    @model_validator(mode="after")
    def _pressure_has_a_unit(self) -> FileEntries:
        dimensional = self.quantity in ("p", "p - p_inf")
        if dimensional and self.unit is None:
            raise ValueError(
                f"unit: entry is missing, quantity '{self.quantity}' needs one of {_listed(PRESSURE_UNITS)}"
            )
        if not dimensional and self.unit is not None:
            raise ValueError(f"unit: {self.unit!r} found, quantity '{self.quantity}' has none")
        return self

    def settings(self) -> dict[str, Any]:
        """Return these entries, as JSON can hold them."""
        return self.model_dump(include=set(FileEntries.model_fields))

    def to_body_axes(self) -> tuple[FloatArray, FloatArray]:
        """Return (3, 3) and (3,) [m]: a file's point x [m] lies at M x + t in body axes.

        M turns the file's axes by ``axes`` and then by ``rotation``; it mirrors where ``axes`` are left-handed.
        """
        turn = np.eye(3) if self.rotation is None else np.array(self.rotation)
        return turn @ _matrix_of(self.axes), np.array(self.translation_m)


class ManifestEntries(FileEntries):
    """The entries of a manifest: the format of all files, which a case may state for its own file."""

    case: list[CaseEntry] = Field(min_length=1)

    def of_case(self, case: CaseEntry) -> FileEntries:
        """Return how the file of a case is written.

        Raises
        ------
        ValidationError
            The case states an entry of a group, and not those that the group needs.
        """
        entries: dict[str, Any] = {}
        for group in (_VALUES, _FRAME):
            stated = {name: value for name in group if (value := getattr(case, name)) is not None}
            entries |= stated or {name: getattr(self, name) for name in group}
        return FileEntries.model_validate(entries)


@dataclass(frozen=True)
class CfdCase:
    """One file of results.

    Attributes
    ----------
    file : its path.
    condition : the flight condition it holds.
    content : the first 48 bits of the SHA-256 of the file, a whole number that a float holds exactly.
    written : how the file is written.
    """

    file: Path
    condition: FlightCondition
    content: int
    written: FileEntries


@dataclass(frozen=True)
class Manifest:
    """A checked manifest.

    Attributes
    ----------
    path : of the manifest.
    entries : as written.
    cases : in the order of the manifest.
    """

    path: Path
    entries: ManifestEntries
    cases: tuple[CfdCase, ...]


def load_manifest(path: Path, parameters: Sequence[str] = ()) -> Manifest:
    """Read a manifest (.toml or .csv) and look at the files it names, relative to it.

    ``parameters`` are the names of the flow parameters that each case has a value of; a CSV file
    has them as columns ``parameters.NAME``.

    Raises
    ------
    InputError
        The manifest or a file is missing, an entry is unknown, missing or outside its limits, a condition or a
        file occurs twice, or a half model has a sideslip angle.
    """
    content = read_file(path)
    suffix = path.suffix.lower()
    if suffix == ".toml":
        raw, lines = _from_toml(path, content), None
    elif suffix == ".csv":
        raw, lines = _from_csv(path, content)
    else:
        raise InputError(f"{path}: '{path.suffix}' found, a manifest must be .toml or .csv")
    known = len(raw.keys() & ManifestEntries.model_fields.keys())
    if known < len(raw) - known:
        raise InputError(
            f"{path}: not a manifest: expected entries such as quantity, length_unit and case, got "
            f"{len(raw) - known} others"
        )
    try:
        entries = ManifestEntries.model_validate(raw)
    except ValidationError as error:
        raise InputError(f"{path}: {_first_fault(error, lines)}") from error
    labels = [f"case {i + 1}" if lines is None else f"line {lines[i]}" for i in range(len(entries.case))]
    entries = _with_ordered_parameters(path, entries, labels, tuple(parameters))
    written = [_written(path, entries, entry, label) for entry, label in zip(entries.case, labels, strict=True)]
    _check_cases(path, entries, labels, written)
    cases = [
        CfdCase(path.parent / entry.file, entry.condition, _content(path, label, path.parent / entry.file), how)
        for entry, label, how in zip(entries.case, labels, written, strict=True)
    ]
    return Manifest(path, entries, tuple(cases))


def file_content(file: Path) -> int:
    """Return the first 48 bits of the SHA-256 of a file."""
    with file.open("rb") as stream:
        return int.from_bytes(hashlib.file_digest(stream, "sha256").digest()[:6])


def condition_key(condition: FlightCondition) -> tuple[float, ...]:
    """Return M, angles of attack and sideslip [rad], altitude [m], flow parameters, all rounded."""
    m, a, b, h = condition.as_tuple()
    parameters = (round(value, 9) + 0.0 for value in condition.parameters)
    return (round(m, 9), round(a, 9) + 0.0, round(b, 9) + 0.0, round(h, 6), *parameters)


def _with_ordered_parameters(
    path: Path, entries: ManifestEntries, labels: list[str], parameters: tuple[str, ...]
) -> ManifestEntries:
    """Return ``entries`` with each case's parameters in the order of the vehicle file; refuse others than its."""
    cases = []
    for entry, label in zip(entries.case, labels, strict=True):
        if set(entry.parameters) != set(parameters):
            wanted, got = (", ".join(names) or "none" for names in (parameters, entry.parameters))
            raise InputError(f"{path}: {label}: expected the parameters of the vehicle file, {wanted}, got {got}")
        ordered = {name: entry.parameters[name] for name in parameters}
        cases.append(entry.model_copy(update={"parameters": ordered}))
    return entries.model_copy(update={"case": cases})


def _written(path: Path, entries: ManifestEntries, entry: CaseEntry, label: str) -> FileEntries:
    """Return how the file of a case is written."""
    try:
        return entries.of_case(entry)
    except ValidationError as error:
        fault = _first_fault(error, None)
        group = next((start for start in (_VALUES, _FRAME) if fault.startswith(start)), None)
        rule = "" if group is None else f"; a case that states one of {', '.join(group)} states all that it needs"
        raise InputError(f"{path}: {label}: {fault}{rule}") from error


def _content(path: Path, label: str, file: Path) -> int:
    try:
        return file_content(file)
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else f"cannot be read: {error.strerror}"
        raise InputError(f"{path}: {label}: {file}: {reason}") from error


def _check_cases(path: Path, entries: ManifestEntries, labels: list[str], written: Sequence[FileEntries]) -> None:
    conditions: dict[tuple[float, ...], str] = {}
    files: dict[str, tuple[str, tuple[float, ...], FileEntries]] = {}
    for entry, label, how in zip(entries.case, labels, written, strict=True):
        key = condition_key(entry.condition)
        if key in conditions:
            raise InputError(f"{path}: {label}: {entry.condition} already belongs to {conditions[key]}")
        conditions[key] = label
        # One file may serve several altitudes, since only p/p_inf is taken from it, but nothing else.
        flow_of = (*key[:3], *key[4:])
        first, flow, as_first = files.setdefault(entry.file, (label, flow_of, how))
        if flow != flow_of:
            raise InputError(f"{path}: {label}: file '{entry.file}' already belongs to {first}, another condition")
        if as_first != how:
            raise InputError(
                f"{path}: {label}: file '{entry.file}' is already used by {first}, with another format"
            )
        if how.mirrored and entry.sideslip_angle_deg != 0.0:
            raise InputError(
                f"{path}: {label}: sideslip_angle_deg {entry.sideslip_angle_deg:g} found, a mirrored half model "
                "has 0"
            )


def _from_toml(path: Path, content: bytes) -> dict[str, Any]:
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from error


def _from_csv(path: Path, content: bytes) -> tuple[dict[str, Any], list[int]]:
    """Return the entries as the TOML form has them, and the line of each case.

    The first line states columns other than the case's own for all cases; a later line that differs states them
    for its case alone.
    """
    rows = list(csv.reader(content.decode("utf-8-sig", "replace").splitlines(), skipinitialspace=True))
    start = next(number for number, row in enumerate(rows) if row)
    header = [name.strip() for name in rows[start]]
    columns = (*_CASE_KEYS, *ManifestEntries.model_fields)
    if not any(name in columns for name in header):
        got = shown_columns(header, columns)
        raise InputError(f"{path}: not a manifest: expected columns such as {', '.join(_CASE_KEYS)}, got {got}")
    common: dict[str, Any] = {}
    cases, lines = [], []
    for line, row in enumerate(rows[start + 1 :], start=start + 2):
        if not row:
            continue
        if len(row) != len(header):
            raise InputError(f"{path}: line {line}: {len(row)} columns found, must be {len(header)}")
        entries = {
            name: _plain(name, word.strip()) for name, word in zip(header, row, strict=True) if word.strip()
        }
        case = {name: entries[name] for name in _CASE_KEYS if name in entries}
        parameters = {name: value for name, value in entries.items() if name.startswith(_PARAMETER)}
        if parameters:
            case["parameters"] = {name.removeprefix(_PARAMETER): value for name, value in parameters.items()}
        cases.append(case)
        lines.append(line)
        shared = {name: value for name, value in entries.items() if name not in (*_CASE_KEYS, *parameters)}
        if len(cases) == 1:
            common = shared
        for group in (_VALUES, _FRAME):
            of_case, first = ({name: row[name] for name in group if name in row} for row in (shared, common))
            if of_case != first:
                case |= of_case
            if first and not of_case:
                name = next(iter(first))
                raise InputError(
                    f"{path}: line {line}: column '{name}': nothing found, {first[name]!r} in the first line; "
                    "state it in every line"
                )
        for name in (common.keys() | shared.keys()) - {*_VALUES, *_FRAME}:
            if common.get(name) != shared.get(name):
                raise InputError(
                    f"{path}: line {line}: column '{name}': {shared.get(name)!r} found, {common.get(name)!r} in "
                    "the first line; it must be the same in all"
                )
    if not cases:
        raise InputError(f"{path}: no case after the column names")
    return {**common, "case": cases}, lines


def _plain(name: str, word: str) -> Any:
    """Return what TOML would hold: text, a truth value or a number; what is none of these stays text."""
    if name == "mirrored" and word.lower() in ("true", "false"):
        return word.lower() == "true"
    if name in _TEXT_KEYS:
        return word
    try:
        return float(word)
    except ValueError:
        return word


def _matrix_of(axes: str) -> FloatArray:
    """Return (3, 3) whose columns are the directions, in body axes, of the file's x, y, z."""
    return np.array([_DIRECTIONS[word] for word in axes.split()]).T


def _one_of(value: str, allowed: tuple[str, ...]) -> str:
    if value not in allowed:
        raise ValueError(f"{value!r} found, must be one of {_listed(allowed)}")
    return value


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(f"'{name}'" for name in names)


def _first_fault(error: ValidationError, lines: list[int] | None) -> str:
    """Return the first fault in one line, unknown entries ahead of missing ones."""
    fault = min(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    where = list(fault["loc"])
    if len(where) > 1 and where[0] == "case" and isinstance(where[1], int):
        where[:2] = [f"case {where[1] + 1}" if lines is None else f"line {lines[where[1]]}"]
    label = ": ".join(str(part + 1) if isinstance(part, int) else part for part in where)
    prefix = f"{label}: " if label else ""
    if fault["type"] == "extra_forbidden":
        allowed = CaseEntry if len(where) > 1 else ManifestEntries
        return f"{prefix}unknown entry; allowed: {', '.join(allowed.model_fields)}"
    if fault["type"] == "missing":
        hint = {"quantity": QUANTITIES, "length_unit": tuple(METRES)}.get(str(where[-1]))
        return f"{prefix}entry is missing" + (f", must be one of {_listed(hint)}" if hint else "")
    if fault["type"] == "value_error":
        return f"{prefix}{fault['ctx']['error']}"
    return f"{prefix}{fault['input']!r} found, must be {fault['msg'].removeprefix('Input should be ')}"
