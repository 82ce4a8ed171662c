"""The file of a test without a model, and its table: loads applied and readings of the gauges, row by row."""

from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PrivateAttr

from builder.vehicle.toml.reading import read_sections
from builder.vehicle.toml.toml_sections import FileName, Section
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.other_loads import BODY, SECTIONS
from strainfmu.estimator.signal_names import LOAD_NAMES, LOAD_UNITS
from strainfmu.text_cells import Numerals
from strainfmu.text_files import read_csv

FORCES = {"N": 1.0, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216152605}
MOMENTS = {"N m": 1.0, "N mm": 1e-3, "kN m": 1e3, "kgf m": 9.80665, "lbf in": 0.1129848290276167}
STRAINS = {"um/m": 1e-6, "mm/m": 1e-3, "m/m": 1.0, "mV/V": 1e-3}

WHOLE = {**dict(zip(LOAD_NAMES, LOAD_UNITS, strict=True)), BODY.loads[0].name: "N m"}
"""Loads of the whole body, with their units."""

AT_STATION = {f"section_{load.key}": load.unit.replace(".", " ") for load in SECTIONS.loads}
"""Loads of the part ahead of a station, with their units."""

Method = Literal["all", "selected", "ridge"]
"""Gauges of an equation: all that may be used, chosen by T values, or all with a ridge."""

Name = Annotated[str, Field(min_length=1, max_length=200)]


class AppliedLoad(Section):
    """A load of the table: one of the map's, in a column, of all ``gauges`` or of those named.

    Loads of a section, as ``section_pitch``, state its station ``x_m``.
    """

    name: Name
    column: Name
    unit: Name
    x_m: float | None = Field(default=None, ge=-1e3, le=1e3)
    gauges: list[Name] | None = Field(default=None, min_length=1)


class TableEntries(Section):
    """The table, a CSV file with a row for each reading, and its columns of gauges.

    Rows with a mark in the column ``check`` are predicted and not fitted. Rows without any load are the zeros; a
    table without such rows has its zeros fitted.
    """

    table: FileName
    gauges: list[Name] = Field(min_length=1, max_length=10_000)
    unit: Literal["um/m", "mm/m", "m/m", "mV/V"] = "um/m"
    check: Name | None = None


class ReferenceEntries(Section):
    """Reference area and length of the coefficients, and the dynamic pressure that they hold at; 1 by default, so
    that coefficients are loads in N and N m."""

    area_m2: float = Field(default=1.0, gt=0.0, le=1e6)
    length_m: float = Field(default=1.0, gt=0.0, le=1e6)
    dynamic_pressure_Pa: float = Field(default=1.0, gt=0.0, le=1e9)


class WholeFile(Section):
    """A file that names further files by paths relative to its own folder."""

    _path: Path = PrivateAttr(default=Path("test.toml"))

    @property
    def path(self) -> Path:
        """Where the file is."""
        return self._path

    def beside(self, name: str) -> Path:
        """Return the path of a file that this file names."""
        return self._path.parent / name


class EquationsFile(WholeFile):
    """The file of a test without a model.

    ``method`` is ``all`` gauges of each load, ``selected`` by T values, or ``ridge``.
    """

    name: Name
    tested_on: date | None = None
    method: Method = "all"
    readings: TableEntries
    load: list[AppliedLoad] = Field(min_length=1, max_length=1000)
    reference: ReferenceEntries = ReferenceEntries()


@dataclass(frozen=True, eq=False, kw_only=True)
class AppliedTest:
    """A test without a model.

    Attributes
    ----------
    strain : (n, n_d) readings [m/m], or output over excitation [V/V].
    load : (n, n_l) applied [N, N m], in the order of the file.
    is_check : (n,) whether a row is a confirmation load.
    line : (n,) of each row in the table.
    """

    file: EquationsFile
    strain: FloatArray
    load: FloatArray
    is_check: BoolArray
    line: tuple[int, ...]


def equations_file(path: Path) -> EquationsFile:
    """Read and check the file of a test without a model.

    Raises
    ------
    FaultsError
        Entries are unknown, missing or outside their limits: one line each.
    InputError
        The file is missing or no TOML, or a load is named twice, has a unit of another kind, or no station.
    """
    file = read_sections(path, EquationsFile, "file of a test without a model")
    file._path = path
    names = set[tuple[str, float | None]]()
    for number, load in enumerate(file.load, start=1):
        where = f"{path}: load.{number}"
        if load.name not in WHOLE | AT_STATION:
            raise InputError(f"{where}.name: expected one of {', '.join(WHOLE | AT_STATION)}, got '{load.name}'")
        units = MOMENTS if (WHOLE | AT_STATION)[load.name] == "N m" else FORCES
        if load.unit not in units:
            raise InputError(f"{where}.unit: expected one of {', '.join(units)}, got '{load.unit}'")
        if (load.x_m is not None) != (load.name in AT_STATION):
            raise InputError(f"{where}.x_m: expected a station for loads of a section, and for these alone")
        if (load.name, load.x_m) in names:
            raise InputError(f"{where}.name: expected each load once, got '{load.name}' again")
        names.add((load.name, load.x_m))
        of_load, gauges = load.gauges or [], file.readings.gauges
        wrong = [name for name in of_load if name not in gauges or of_load.count(name) > 1]
        if wrong:
            raise InputError(f"{where}.gauges: expected some of readings.gauges, each once, got '{wrong[0]}'")
    return file


def applied_test(file: EquationsFile) -> AppliedTest:
    """Read the table of a test.

    Raises
    ------
    InputError
        A column is missing or there twice, or a value is no number.
    """
    path, entries = file.beside(file.readings.table), file.readings
    rows = read_csv(path)
    if len(rows) < 2:
        raise InputError(f"{path}: expected a heading and rows of readings, got {len(rows)} rows")
    heading = [name.strip() for name in rows[0][1]]
    numbers = [*entries.gauges, *(load.column for load in file.load)]
    wanted = [*numbers, *([entries.check] if entries.check else [])]
    for name in wanted:
        if wanted.count(name) > 1:
            raise InputError(f"{file.path}: expected each column for one gauge, load or check, got '{name}' again")
        if heading.count(name) != 1:
            what = "a column" if name not in heading else "one column"
            raise InputError(f"{path}: expected {what} '{name}', got {', '.join(heading)}")
    cells = {
        name: [row[place].strip() if (place := heading.index(name)) < len(row) else "" for _, row in rows[1:]]
        for name in wanted
    }
    numerals = Numerals("")
    numerals.learn(cell for name in numbers for cell in cells[name])

    def column(name: str) -> FloatArray:
        values = np.zeros(len(rows) - 1)
        for number, ((line, _), cell) in enumerate(zip(rows[1:], cells[name], strict=True)):
            try:
                values[number] = numerals.number(cell)
            except ValueError as error:
                raise InputError(f"{path}: line {line}: {name}: {error}, got '{cell}'") from None
            if not np.isfinite(values[number]):
                raise InputError(f"{path}: line {line}: {name}: expected a number, got '{cell}'")
        return values

    marked = cells[entries.check] if entries.check else [""] * (len(rows) - 1)
    scales = [(MOMENTS | FORCES)[load.unit] for load in file.load]
    return AppliedTest(
        file=file,
        strain=STRAINS[entries.unit] * np.column_stack([column(name) for name in entries.gauges]),
        load=np.column_stack([scale * column(load.column) for scale, load in zip(scales, file.load, strict=True)]),
        is_check=np.array([mark.casefold() not in ("", "0", "no", "false") for mark in marked]),
        line=tuple(line for line, _ in rows[1:]),
    )
