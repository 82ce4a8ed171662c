"""The table of strains that another structural code found under the load cases: a CSV or HDF5 file.

Header and rows of a CSV file of another structural code's tables, with their line numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Protocol

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.flight_condition import CONDITION_COLUMNS
from strainfmu.text_files import MIB, read_csv, shown_columns
from strainfmu.units import STRAIN_UNITS

LARGEST_TABLE = 2048 * MIB
"""An influence matrix of 100,000 nodes and 50 gauges has 200 MiB."""


def csv_rows(path: Path) -> tuple[list[str], Sequence[tuple[int, list[str]]]]:
    """Return the header, empty for an empty file, and the rows with their line numbers; empty lines are left out.

    Raises
    ------
    InputError
        The file is missing or not a CSV file, or a row is not as long as the header.
    """
    lines = [(line, [cell.strip() for cell in row]) for line, row in read_csv(path, LARGEST_TABLE)]
    if not lines:
        return [], []
    (_, header), *rows = lines
    for line, row in rows:
        if len(row) != len(header):
            raise InputError(f"{path}, line {line}: expected {len(header)} values, got {len(row)}")
    return header, rows


UNIT_COLUMN = "strain_unit"
FIRST_COLUMNS = ("case", "load_id", *CONDITION_COLUMNS, UNIT_COLUMN)
"""Conditions are for the reader of the table; ``load_id`` distinguishes the cases."""
NEEDED_COLUMNS = ("case", "load_id")
SUBCASE_COLUMN = "subcase"
"""In place of strains and their unit, where those stand in the results of Nastran."""

LARGEST_STRAIN = 0.05
"""Above this [m/m] a strain is in another unit than stated: linear elasticity ends long before."""


class SubcaseStrains(Protocol):
    """Strains of gauges in another file, by the number of a subcase."""

    @property
    def column(self) -> tuple[str, ...]:
        """Names of the gauges' columns."""

    def row(self, subcase: int) -> list[float]:
        """Return the strain of each column [m/m]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StrainCells:
    """Where a row of a CSV file has its strains: in cells of its own, or in the results of a subcase.

    Attributes
    ----------
    column : k names of gauges' columns.
    cells : their places in a row; empty with ``results``.
    unit : place of the unit, or of the number of the subcase.
    results : the results, or None.
    """

    column: tuple[str, ...]
    cells: tuple[int, ...]
    unit: int
    results: SubcaseStrains | None

    def values(self, row: Sequence[str], where: str) -> list[float]:
        """Return the strains of a row [m/m]."""
        text = row[self.unit]
        if self.results is not None:
            if not text.isdigit():
                raise InputError(f"{where}: {SUBCASE_COLUMN}: expected its number, got '{text}'")
            return self.results.row(int(text))
        factor = strain_factor(text, where)
        return [
            factor * table_number(row[k], f"{where}, column '{name}'")
            for k, name in zip(self.cells, self.column, strict=True)
        ]


def strain_cells(
    path: Path, header: Sequence[str], other_columns: Sequence[str], results: SubcaseStrains | None
) -> StrainCells:
    """Return where the rows below ``header`` have their strains; ``other_columns`` are its others.

    Raises
    ------
    InputError
        The columns do not fit ``results``; the message begins with ``path``.
    """
    known = (*other_columns, UNIT_COLUMN, SUBCASE_COLUMN)
    gauges = tuple(k for k, name in enumerate(header) if name not in known)
    if results is None:
        if SUBCASE_COLUMN in header:
            raise InputError(
                f"{path}: column '{SUBCASE_COLUMN}': expected structure.nastran_results with it, got none"
            )
        _needed(path, header, UNIT_COLUMN)
        return StrainCells(
            column=tuple(header[k] for k in gauges), cells=gauges, unit=header.index(UNIT_COLUMN), results=None
        )
    _needed(path, header, SUBCASE_COLUMN)
    if gauges:
        raise InputError(f"{path}: expected no strains with nastran_results, got a column '{header[gauges[0]]}'")
    return StrainCells(column=results.column, cells=(), unit=header.index(SUBCASE_COLUMN), results=results)


def _needed(path: Path, header: Sequence[str], name: str) -> None:
    if name not in header:
        got = shown_columns(header, (*FIRST_COLUMNS, SUBCASE_COLUMN))
        raise InputError(f"{path}: expected a column '{name}', got {got}")


@dataclass(frozen=True, eq=False, kw_only=True)
class StrainTable:
    """Strains as read.

    Attributes
    ----------
    path : the file.
    case, load_id : (n,) name and load of each row.
    column : k names of columns.
    strain : (n, k) [m/m].
    """

    path: Path
    case: tuple[str, ...]
    load_id: tuple[str, ...]
    column: tuple[str, ...]
    strain: FloatArray


def read_strain_table(path: Path, results: SubcaseStrains | None = None) -> StrainTable:
    """Read strains per load case: ``.csv``, or ``.h5`` with the datasets case, load_id, column and strain (n, k).

    In a .csv every row names its unit in the column ``strain_unit``; in an .h5 the dataset ``strain`` has it as
    attribute ``unit``. With ``results`` a .csv names a subcase in every row instead.

    Raises
    ------
    InputError
        The file is missing, damaged or incomplete; the message names row and column.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; `strainfmu structure VEHICLE --export-loads DIR` makes the table")
    if path.suffix.lower() in (".h5", ".hdf5"):
        refuse_hdf5_results(path, results)
        table = _from_hdf5(path)
    else:
        table = _from_csv(path, results)
    _refuse_repeated(path, "case", table.case)
    _refuse_repeated(path, "column", table.column)
    large = np.argwhere(np.abs(table.strain) > LARGEST_STRAIN)
    if len(large):
        row, column = large[0]
        raise InputError(
            f"{path}: {table.case[row]}, column '{table.column[column]}': expected a strain of at most "
            f"{LARGEST_STRAIN:g} m/m, got {table.strain[row, column]:.4g} m/m; is strain_unit right?"
        )
    return table


def refuse_hdf5_results(path: Path, results: SubcaseStrains | None) -> None:
    """Refuse the results of subcases with a file that holds strains itself."""
    if results is not None:
        raise InputError(
            f"structure.nastran_results: expected a .csv with a column '{SUBCASE_COLUMN}', got {path}"
        )


def _from_csv(path: Path, results: SubcaseStrains | None) -> StrainTable:
    header, rows = csv_rows(path)
    for name in NEEDED_COLUMNS:
        _needed(path, header, name)
    cells = strain_cells(path, header, FIRST_COLUMNS, results)
    place = {name: header.index(name) for name in NEEDED_COLUMNS}
    strain = np.empty((len(rows), len(cells.column)))
    for number, (line, row) in enumerate(rows):
        strain[number] = cells.values(row, f"{path}, line {line}")
    return StrainTable(
        path=path,
        case=tuple(row[place["case"]] for _, row in rows),
        load_id=tuple(row[place["load_id"]] for _, row in rows),
        column=cells.column,
        strain=strain,
    )


def _from_hdf5(path: Path) -> StrainTable:
    try:
        with h5py.File(path, "r") as file:
            for name in ("case", "load_id", "column", STRAIN):
                if not isinstance(file.get(name), h5py.Dataset):
                    raise InputError(f"{path}: expected a dataset '{name}', got {', '.join(file) or 'none'}")
            texts = [tuple(map(str, file[name].asstr()[()])) for name in ("case", "load_id", "column")]
            strain = np.asarray(file[STRAIN][()], dtype=np.float64)
            unit = str(file[STRAIN].attrs.get("unit", ""))
    except (OSError, TypeError, ValueError) as error:
        raise InputError(f"{path}: damaged, or not an HDF5 file of strains: {error}") from error
    case, load_id, column = texts
    if strain.shape != (len(case), len(column)) or len(load_id) != len(case):
        raise InputError(f"{path}: strain: expected shape {(len(case), len(column))}, got {strain.shape}")
    if not np.isfinite(strain).all():
        row, k = np.argwhere(~np.isfinite(strain))[0]
        raise InputError(f"{path}: {case[row]}, column '{column[k]}': expected a number, got {strain[row, k]}")
    strain *= strain_factor(unit, f"{path}: attribute unit of strain")
    return StrainTable(path=path, case=case, load_id=load_id, column=column, strain=strain)


def strain_factor(unit: str, where: str) -> float:
    """Return the factor of a unit of strain to m/m; ``where`` begins the message of a unit that is none."""
    if unit not in STRAIN_UNITS:
        raise InputError(f"{where}: strain_unit: expected m/m, um/m, mm/m or percent, got '{unit}'")
    return STRAIN_UNITS[unit]


def table_number(text: str, where: str) -> float:
    """Return a cell as a finite number; ``where`` begins the message of one that is none."""
    try:
        value = float(text)
    except ValueError as error:
        raise InputError(f"{where}: expected a number, got '{text}'") from error
    if not isfinite(value):
        raise InputError(f"{where}: expected a finite number, got '{text}'")
    return value


def _refuse_repeated(path: Path, what: str, names: Sequence[str]) -> None:
    known: set[str] = set()
    for name in names:
        if name in known:
            raise InputError(f"{path}: expected each {what} once, got '{name}' again")
        known.add(name)
