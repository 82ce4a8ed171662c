"""The influence matrix of a structure: strain of the gauges per force at the nodes of its surface.

HDF5 with the datasets ``node`` (n, 3) [m], ``facet`` (f, 3 .. 8) numbered from 0, ``column`` (k) and
``strain_per_force`` (k, n, 3) [1/N]; or CSV, a row per node and direction, with the facets in a second file.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from builder.structure.external.strain_table import (
    SubcaseStrains,
    csv_rows,
    refuse_hdf5_results,
    strain_cells,
    table_number,
)
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.files import write_hdf5_atomically
from strainfmu.text_files import shown_columns

SCHEMA = "strainfmu.influence"
SCHEMA_VERSION = 1

NODES_OF_FACET = (3, 4, 6, 8)
"""Linear and quadratic triangles and quadrilaterals: corners first, then the middles of their edges."""
PLACE_COLUMNS = ("node", "x_m", "y_m", "z_m", "direction")
FORCE_COLUMN = "force_N"
SPLIT = "split_at_sharp_edges"
"""Attribute of the facets."""
_SPACES = ("node", "facet", "column", "strain_per_force")
_COORDINATE = 1e3  # m: beyond it the unit is another one


@dataclass(frozen=True, eq=False, kw_only=True)
class Influence:
    """An influence matrix as read.

    Attributes
    ----------
    path : the file.
    node : (n, 3) loaded nodes, body axes [m].
    facet : (f, 3, 4, 6 or 8) nodes of the facets between them, outwards.
    column : k names of gauges, as :func:`builder.structure.external.load_export.strain_columns` gives them.
    strain_per_force : (k, n, 3) strain per force along x, y, z at each node [1/N].
    split : whether pressure may jump at sharp edges, as fins and wings have.

    Raises
    ------
    InputError
        Shapes do not fit, a value is not finite, or a node is missing; the message names it.
    """

    path: Path
    node: FloatArray
    facet: IntArray
    column: tuple[str, ...]
    strain_per_force: FloatArray
    split: bool = True

    def __post_init__(self) -> None:
        n, k = len(self.node), len(self.column)
        if self.node.shape != (n, 3) or n < 4:
            raise InputError(
                f"{self.path}: node: expected at least 4 nodes of 3 coordinates, got {self.node.shape}"
            )
        if self.facet.ndim != 2 or self.facet.shape[1] not in NODES_OF_FACET or not len(self.facet):
            raise InputError(
                f"{self.path}: facet: expected rows of 3, 4, 6 or 8 nodes, got shape {self.facet.shape}"
            )
        if self.strain_per_force.shape != (k, n, 3) or not k:
            shape = self.strain_per_force.shape
            raise InputError(f"{self.path}: strain_per_force: expected shape {(k, n, 3)}, got {shape}")
        for name in ("node", "strain_per_force"):
            wrong = np.argwhere(~np.isfinite(getattr(self, name)))
            if len(wrong):
                raise InputError(f"{self.path}: {name}{wrong[0].tolist()}: expected a finite number, got none")
        if np.abs(self.node).max() > _COORDINATE:
            raise InputError(
                f"{self.path}: node: expected metres, got a coordinate of {np.abs(self.node).max():.4g}"
            )
        low, high = int(self.facet.min()), int(self.facet.max())
        if low < 0 or high >= n:
            hint = "; facets are numbered from 0" if low == 1 and high == n else ""
            raise InputError(
                f"{self.path}: facet: expected nodes 0 to {n - 1}, got {low if low < 0 else high}{hint}"
            )
        if len(set(self.column)) < k:
            twice = next(name for name in self.column if self.column.count(name) > 1)
            raise InputError(f"{self.path}: expected each column once, got '{twice}' again")


def read_influence(path: Path, facets: Path | None = None, results: SubcaseStrains | None = None) -> Influence:
    """Read an influence matrix; ``facets`` is the file of facets of a CSV file.

    With ``results`` each row of the CSV file names the subcase of its force instead of strains.

    Raises
    ------
    InputError
        A file is missing, damaged or incomplete; the message names the entry.
    """
    if path.suffix.lower() not in (".h5", ".hdf5", ".csv"):
        raise InputError(f"{path}: expected a file .h5 or .csv, got '{path.suffix}'")
    if path.suffix.lower() == ".csv":
        if facets is None:
            raise InputError(f"{path}: expected structure.influence_facets with a CSV file, got none")
        return _from_csv(path, facets, results)
    refuse_hdf5_results(path, results)
    if facets is not None:
        raise InputError(f"structure.influence_facets: expected none with {path}, which holds them, got {facets}")
    return _from_hdf5(path)


def write_influence(influence: Influence) -> None:
    """Write an influence matrix as HDF5, atomically.

    Raises
    ------
    StrainfmuError
        The file could not be written.
    """

    def fill(file: h5py.File) -> None:
        file.create_dataset("node", data=influence.node).attrs["unit"] = "m"
        file.create_dataset("facet", data=influence.facet).attrs[SPLIT] = influence.split
        file["column"] = list(influence.column)
        file.create_dataset("strain_per_force", data=influence.strain_per_force).attrs["unit"] = "1/N"

    write_hdf5_atomically(influence.path, SCHEMA, SCHEMA_VERSION, fill)


def _from_hdf5(path: Path) -> Influence:
    try:
        with h5py.File(path, "r") as file:
            for name in _SPACES:
                if not isinstance(file.get(name), h5py.Dataset):
                    raise InputError(f"{path}: expected a dataset '{name}', got {', '.join(file) or 'none'}")
            for name, expected in (("node", "m"), ("strain_per_force", "1/N")):
                unit = file[name].attrs.get("unit", expected)
                if unit != expected:
                    raise InputError(f"{path}: {name}: expected unit {expected}, got '{unit}'")
            return Influence(
                path=path,
                node=np.asarray(file["node"][()], dtype=np.float64),
                facet=np.asarray(file["facet"][()], dtype=np.int64),
                column=tuple(map(str, file["column"].asstr()[()])),
                strain_per_force=np.asarray(file["strain_per_force"][()], dtype=np.float64),
                split=bool(file["facet"].attrs.get(SPLIT, True)),
            )
    except (OSError, TypeError, ValueError) as error:
        raise InputError(f"{path}: damaged, or not an HDF5 file of an influence matrix: {error}") from error


def _from_csv(path: Path, facets: Path, results: SubcaseStrains | None) -> Influence:
    header, rows = _rows(path)
    needed = (*PLACE_COLUMNS, FORCE_COLUMN)
    for name in needed:
        if name not in header:
            raise InputError(f"{path}: expected a column '{name}', got {shown_columns(header, needed)}")
    place = {name: header.index(name) for name in needed}
    cells = strain_cells(path, header, needed, results)
    number: dict[str, int] = {}
    points: list[list[float]] = []
    found: dict[tuple[int, int], list[float]] = {}
    for line, row in rows:
        where = f"{path}, line {line}"
        label, direction = row[place["node"]], row[place["direction"]].lower()
        if direction not in ("x", "y", "z"):
            raise InputError(f"{where}: direction: expected x, y or z, got '{direction}'")
        position = [table_number(row[place[name]], f"{where}, column '{name}'") for name in ("x_m", "y_m", "z_m")]
        if label not in number:
            number[label] = len(points)
            points.append(position)
        if points[number[label]] != position:
            raise InputError(
                f"{where}: node {label}: expected one place, got {position} after {points[number[label]]}"
            )
        force = table_number(row[place[FORCE_COLUMN]], f"{where}, column '{FORCE_COLUMN}'")
        if force == 0.0:
            raise InputError(f"{where}: {FORCE_COLUMN}: expected the force that was applied, got 0")
        key = (number[label], "xyz".index(direction))
        if key in found:
            raise InputError(f"{where}: expected node {label} along {direction} once, got it again")
        found[key] = [value / force for value in cells.values(row, where)]
    strain = np.empty((len(cells.column), len(points), 3))
    for label, node in number.items():
        for axis in range(3):
            if (node, axis) not in found:
                raise InputError(f"{path}: node {label}: expected a force along {'xyz'[axis]}, got none")
            strain[:, node, axis] = found[node, axis]
    return Influence(
        path=path,
        node=np.array(points),
        facet=_facets(facets, number),
        column=cells.column,
        strain_per_force=strain,
    )


def _facets(path: Path, number: dict[str, int]) -> IntArray:
    """Read a CSV file of facets, a row of node numbers each, after a header."""
    header, rows = _rows(path)
    if len(header) not in NODES_OF_FACET:
        raise InputError(f"{path}: expected 3, 4, 6 or 8 columns of nodes, got {len(header)}")
    facets = []
    for line, row in rows:
        for label in row:
            if label not in number:
                raise InputError(f"{path}, line {line}: expected a node of the matrix, got '{label}'")
        facets.append([number[label] for label in row])
    return np.array(facets, dtype=np.int64).reshape(len(facets), len(header))


def _rows(path: Path) -> tuple[list[str], Sequence[tuple[int, list[str]]]]:
    """Return header and rows, of which there is one at least."""
    header, rows = csv_rows(path)
    if not rows:
        raise InputError(f"{path}: expected a header and rows, got {1 if header else 0} lines")
    return header, rows
