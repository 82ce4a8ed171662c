"""Element strains of one or several Nastran files, by subcase and element.

Strains of gauges by subcase, for the tables of load cases and of unit forces.

The table that says which element of the Nastran model each gauge is: its side, its angle.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path

import numpy as np

from builder.structure.external.load_export import strain_columns
from builder.structure.external.nastran.element_rows import (
    CURVATURE,
    PLATE,
    PLY,
    ROD,
    SOLID,
    ElementRows,
    along,
    plate_strain,
    solid_strain,
)
from builder.structure.external.nastran.op2 import read_op2_strains
from builder.structure.external.nastran.punch import read_punch_strains
from builder.structure.external.strain_table import csv_rows, table_number
from builder.structure.solid.gauge_rows import Gauges
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.text_files import shown_columns

NEEDED = ("column", "element")
DIRECTION = ("direction_x", "direction_y", "direction_z")
COLUMNS = (*NEEDED, "node", "side", "angle_deg", *DIRECTION)


@dataclass(frozen=True, kw_only=True, eq=False)
class NastranPoint:
    """Where one gauge, or a part of it, is read.

    Attributes
    ----------
    column : name of the gauge's column.
    element, node : Nastran's numbers; without a node the element's centre.
    side : ``z1`` or ``z2`` of a plate, ``ply N`` of a laminate, empty elsewhere.
    angle : from the x axis of the plate's strain, or the ply's first axis, to the gauge about z [rad], or None.
    direction : (3,) in the axes in which a solid's strain is given, or None.
    body_direction : (3,) the gauge's own direction, body axes.
    """

    column: str
    element: int
    node: int | None
    side: str
    angle: float | None
    direction: FloatArray | None
    body_direction: FloatArray

    @property
    def ply(self) -> int | None:
        """Number of the ply, or None."""
        return int(self.side.split()[1]) if self.side.startswith("ply ") else None


def read_nastran_gauges(path: Path, directions: Mapping[str, FloatArray]) -> dict[str, list[NastranPoint]]:
    """Read the points of each gauge; several rows of one column are averaged.

    ``directions`` are the directions of the gauges that may be there, by their columns, body axes.

    Raises
    ------
    InputError
        The file is missing, or an entry is wrong; the message names line and column.
    """
    header, rows = csv_rows(path)
    for name in NEEDED:
        if name not in header:
            raise InputError(f"{path}: expected a column '{name}', got {shown_columns(header, COLUMNS)}")
    for name in header:
        if name not in COLUMNS:
            raise InputError(f"{path}: expected columns {', '.join(COLUMNS)}, got '{name}'")
    gauges: dict[str, list[NastranPoint]] = {}
    for line, row in rows:
        where = f"{path}, line {line}"
        point = _point(dict(zip(header, row, strict=True)), where, directions)
        gauges.setdefault(point.column, []).append(point)
    if not gauges:
        raise InputError(f"{path}: expected a row per gauge, got none")
    return gauges


def _point(cells: Mapping[str, str], where: str, directions: Mapping[str, FloatArray]) -> NastranPoint:
    column, side = cells["column"], " ".join(cells.get("side", "").lower().split())
    if column not in directions:
        raise InputError(f"{where}: column: expected a gauge of the vehicle file, got '{column}'")
    if side not in ("", "z1", "z2") and not (side.startswith("ply ") and side[4:].isdigit()):
        raise InputError(f"{where}: side: expected z1, z2, 'ply N' or nothing, got '{cells['side']}'")
    angle = cells.get("angle_deg", "")
    given = [cells.get(name, "") for name in DIRECTION]
    direction = None
    if any(given):
        direction = np.array(
            [table_number(text, f"{where}, {name}") for name, text in zip(DIRECTION, given, strict=True)]
        )
        if not np.any(direction):
            raise InputError(f"{where}: direction: expected a vector, got 0, 0, 0")
    return NastranPoint(
        column=column,
        element=_number(cells["element"], f"{where}, element"),
        node=_number(cells["node"], f"{where}, node") if cells.get("node") else None,
        side=side,
        angle=radians(table_number(angle, f"{where}, angle_deg")) if angle else None,
        direction=direction,
        body_direction=np.asarray(directions[column], dtype=float),
    )


def _number(text: str, where: str) -> int:
    if not text.isdigit() or int(text) == 0:
        raise InputError(f"{where}: expected a number of the Nastran model, got '{text}'")
    return int(text)


_USED = {ROD: (), PLATE: ("node", "side", "angle_deg"), PLY: ("side", "angle_deg"), SOLID: ("node", "direction")}
READERS = {".op2": read_op2_strains, ".pch": read_punch_strains, ".pun": read_punch_strains}


@dataclass(frozen=True, eq=False)
class NastranResults:
    """Element strains.

    Attributes
    ----------
    paths : the files.
    blocks : of each subcase its blocks, an element in one of them.
    """

    paths: tuple[Path, ...]
    blocks: dict[int, list[ElementRows]]

    @property
    def name(self) -> str:
        """The files, for messages."""
        return ", ".join(map(str, self.paths))

    def strain(self, subcase: int, point: NastranPoint) -> float:
        """Return the strain along the direction of ``point`` [m/m].

        Raises
        ------
        InputError
            The file does not hold it; the message says what is missing.
        """
        where = f"{self.name}: subcase {subcase}, gauge '{point.column}'"
        if subcase not in self.blocks:
            subcases = sorted(self.blocks)
            raise InputError(f"{where}: expected strains of this subcase, got {_listed(subcases)}")
        blocks_of_element = [block for block in self.blocks[subcase] if np.any(block.element == point.element)]
        usable = [block for block in blocks_of_element if len(block.words)]
        if not usable:
            kinds = sorted({block.element_type for block in blocks_of_element})
            got = f"a type of element that is not read ({_listed(kinds)})" if blocks_of_element else "none"
            raise InputError(f"{where}: element {point.element}: expected its strain, got {got}")
        return _of_element(usable, point, where)


def read_nastran_results(paths: Sequence[Path]) -> NastranResults:
    """Read OP2 files and punch files.

    Raises
    ------
    InputError
        A file is missing, of another kind or damaged, or holds no element strains.
    """
    blocks: dict[int, list[ElementRows]] = {}
    for path in paths:
        if path.suffix.lower() not in READERS:
            raise InputError(f"{path}: expected a file .op2, .pch or .pun, got '{path.suffix}'")
        if not path.is_file():
            raise InputError(f"{path}: no such file")
        results = READERS[path.suffix.lower()](path)
        if not results:
            raise InputError(f"{path}: expected element strains, got none; request STRAIN(FIBER,PLOT) = ALL")
        for block in results:
            blocks.setdefault(block.subcase, []).append(block)
    return NastranResults(tuple(paths), blocks)


def _of_element(blocks: list[ElementRows], point: NastranPoint, where: str) -> float:
    where = f"{where}: element {point.element}"
    wants_ply = point.ply is not None
    fitting = [block for block in blocks if (block.layout is not None and block.layout.kind == PLY) == wants_ply]
    if not fitting:
        expected = "plies, got none" if wants_ply else f"side 'ply N' of its plies, got '{point.side}'"
        raise InputError(f"{where}: expected {expected}")
    if len(fitting) > 1:
        raise InputError(f"{where}: expected its strain once, got it {len(fitting)} times; statics alone?")
    block = fitting[0]
    layout = block.layout
    assert layout is not None
    rows = block.words[block.element == point.element]
    if wants_ply:
        rows = rows[rows[:, 1] == point.ply]
    if len(rows) != 1:
        what = f"ply {point.ply}" if wants_ply else "its strain"
        raise InputError(f"{where}: expected {what} once, got it {len(rows)} times")
    words = rows[0]
    _refuse_unused(layout.kind, point, where)
    if layout.kind == ROD:
        value = float(words[1])
    elif layout.kind == PLY:
        value = along(words[2:5], _in_plane(point, where))
    else:
        start = _start(block, words, point, where)
        value = (
            _of_plate(words, start, point, where)
            if layout.kind == PLATE
            else _of_solid(words, start, point, where)
        )
    if not np.isfinite(value):
        raise InputError(f"{where}: expected a finite strain, got {value}")
    return value


def _start(block: ElementRows, words: FloatArray, point: NastranPoint, where: str) -> int:
    """Return the word at which the point begins: its fibre distance in a plate, its node in a solid."""
    layout = block.layout
    assert layout is not None
    starts = [layout.first + layout.step * k for k in range(layout.points)]
    chosen = starts[0]
    if point.node is not None:
        nodes = [int(words[start]) for start in starts[1:]] if layout.has_nodes else []
        if point.node not in nodes:
            got = f"strain at nodes {_listed(nodes)}" if nodes else "strain at the centre alone"
            raise InputError(f"{where}: node {point.node}: expected its strain, got {got}")
        chosen = starts[1 + nodes.index(point.node)]
    return chosen + 1 if layout.kind == PLATE and layout.has_nodes else chosen


def _refuse_unused(kind: str, point: NastranPoint, where: str) -> None:
    """Refuse entries of the table that this kind of element has no use for."""
    named = {
        "node": point.node is not None,
        "side": bool(point.side),
        "angle_deg": point.angle is not None,
        "direction": point.direction is not None,
    }
    for name, is_given in named.items():
        if is_given and name not in _USED[kind]:
            raise InputError(f"{where}: {name}: expected none for a {kind}, got one")


def _in_plane(point: NastranPoint, where: str) -> FloatArray:
    if point.angle is None:
        raise InputError(f"{where}: expected angle_deg from the plate's x axis to the gauge, got none")
    return np.array([np.cos(point.angle), np.sin(point.angle)])


def _of_plate(words: FloatArray, start: int, point: NastranPoint, where: str) -> float:
    if point.side not in ("z1", "z2"):
        raise InputError(f"{where}: side: expected z1 or z2 of a plate, got '{point.side}'")
    if words[start] == 0.0 and words[start + 8] == CURVATURE:
        raise InputError(f"{where}: expected strain at the sides, got strain and curvature: STRAIN(FIBER)")
    return along(plate_strain(words, start, point.side), _in_plane(point, where))


def _of_solid(words: FloatArray, start: int, point: NastranPoint, where: str) -> float:
    if point.direction is not None:
        return along(solid_strain(words, start), point.direction)
    if words[1] != 0.0:
        raise InputError(
            f"{where}: expected direction_x, direction_y, direction_z in coordinate system {words[1]:.0f}, in "
            "which its strain is given, got none"
        )
    return along(solid_strain(words, start), point.body_direction)


def _listed(numbers: Sequence[int]) -> str:
    if not numbers:
        return "none"
    shown = ", ".join(map(str, numbers[:8]))
    return shown if len(numbers) <= 8 else f"{shown}, .. ({len(numbers)})"


@dataclass(frozen=True, eq=False)
class NastranStrains:
    """Strains of gauges in Nastran's results.

    Attributes
    ----------
    results : element strains.
    points : of each gauge's column the points whose mean it reads.
    """

    results: NastranResults
    points: Mapping[str, list[NastranPoint]]

    @property
    def column(self) -> tuple[str, ...]:
        """Names of the gauges' columns."""
        return tuple(self.points)

    def row(self, subcase: int) -> list[float]:
        """Return the strain of each column [m/m].

        Raises
        ------
        InputError
            The results do not hold it.
        """
        return [
            float(np.mean([self.results.strain(subcase, point) for point in points]))
            for points in self.points.values()
        ]


def nastran_strains(vehicle: Vehicle, layouts: Mapping[str, Gauges]) -> NastranStrains | None:
    """Return the strains in the files that the vehicle file names, None where it names none.

    Raises
    ------
    InputError
        A file is missing or wrong.
    """
    entry = vehicle.structure
    if entry.nastran_gauges is None:
        return None
    columns = strain_columns(layouts, vehicle.gauges.layout)
    directions = {
        name: gauges.direction[k] for layout, gauges in layouts.items() for k, name in enumerate(columns[layout])
    }
    points = read_nastran_gauges(vehicle.beside(entry.nastran_gauges), directions)
    return NastranStrains(read_nastran_results([vehicle.beside(name) for name in entry.nastran_results]), points)
