"""Files of load cases for another structural code: nodal forces, gauges, and the table of strains to fill in.

Load cases as Nastran input: GRID and FORCE cards in large fields, and the SUBCASEs that take them.

Load cases for another structural code: the net surface pressure of every snapshot, and a uniform one.

The columns of gauges in files of another structural code: which layouts they make up.
"""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from math import degrees
from pathlib import Path

import numpy as np

from builder.aero.cfd.formats.vtk_files import write_vtk
from builder.aero.pressure_map import nodal_force_operator
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots
from builder.structure.external.strain_table import (
    FIRST_COLUMNS,
    NEEDED_COLUMNS,
    SUBCASE_COLUMN,
)
from builder.structure.solid.gauge_layouts import is_displaced
from builder.structure.solid.gauge_rows import Gauges
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically
from strainfmu.flight_condition import CONDITION_COLUMNS, FlightCondition

UNIFORM = "uniform"
"""Name of the case of the same pressure everywhere, by which the pressure inside acts."""

UNIFORM_PRESSURE = 1e4
"""Of that case [Pa]."""

ID_LENGTH = 12


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadCases:
    """Pressures that a structure is to be loaded with, linear over each triangle.

    Attributes
    ----------
    surface : nodes and triangles that carry them.
    names : n names, ``case_0001`` and so on; the last is :data:`UNIFORM`.
    conditions : flight condition of each case but the last.
    pressure : (n, n_p) outer less inner pressure at the nodes [Pa].
    """

    surface: SurfaceMesh
    names: tuple[str, ...]
    conditions: tuple[FlightCondition, ...]
    pressure: FloatArray

    def ids(self) -> tuple[str, ...]:
        """Return what identifies each case: a digest of its pressures and of the surface."""
        surface = self.surface.digest().encode()
        return tuple(
            sha256(surface + np.ascontiguousarray(row, dtype="<f8").tobytes()).hexdigest()[:ID_LENGTH]
            for row in self.pressure
        )


def load_cases(vehicle: Vehicle, snapshots: Snapshots) -> LoadCases:
    """Return the load cases of ``snapshots``, at the internal pressure of the vehicle file."""
    conditions = tuple(snapshots.conditions())
    inside = vehicle.structure.internal_pressure(conditions)
    uniform = np.full((1, snapshots.pressure.shape[1]), UNIFORM_PRESSURE)
    return LoadCases(
        surface=snapshots.surface,
        names=(*(f"case_{number:04d}" for number in range(1, len(conditions) + 1)), UNIFORM),
        conditions=conditions,
        pressure=np.concatenate([snapshots.pressure - inside[:, None], uniform]),
    )


def strain_columns(layouts: Mapping[str, Gauges], in_use: str) -> dict[str, tuple[str, ...]]:
    """Return the name of each gauge's column, by layout: its own, in others after the layout's name."""
    return {
        layout: gauges.name if layout == in_use else tuple(f"{layout}: {name}" for name in gauges.name)
        for layout, gauges in layouts.items()
    }


def columns_found(
    path: Path, columns: Sequence[str], layouts: Mapping[str, Gauges], in_use: str
) -> dict[str, tuple[str, ...]]:
    """Return the columns of each layout that is there; displaced ones may be missing as a whole.

    Raises
    ------
    InputError
        A column is no gauge's, or one is missing; the message begins with ``path``.
    """
    wanted = strain_columns(layouts, in_use)
    known = {name for names in wanted.values() for name in names}
    for name in columns:
        if name not in known:
            raise InputError(f"{path}: expected columns of gauges of {in_use}, got '{name}'")
    found = {}
    for layout, names in wanted.items():
        missing = [name for name in names if name not in columns]
        if is_displaced(layout) and len(missing) == len(names):
            continue
        if missing:
            raise InputError(f"{path}: expected a column '{missing[0]}', got none ({len(missing)} missing)")
        found[layout] = names
    return found


FIELD = 16


def grid_cards(point: FloatArray) -> str:
    """Return the GRID cards of points (n, 3) [m], numbered from 1, in the basic coordinate system."""
    lines = ["$ nodes of the surface that carries the pressure, body axes: x aft, y starboard, z up [m]"]
    for number, (x, y, z) in enumerate(point.tolist(), start=1):
        lines += [f"GRID*   {number:16d}{0:16d}{_real(x)}{_real(y)}*", f"*       {_real(z)}"]
    return "\n".join(lines) + "\n"


def force_cards(set_number: int, title: str, force: FloatArray) -> str:
    """Return the FORCE cards of forces (n, 3) [N] at nodes 1 to n, one load set; none at nodes without force."""
    lines = [f"$ {title}"]
    loaded: IntArray = np.flatnonzero(np.any(force != 0.0, axis=1))
    for node in loaded.tolist():
        x, y, z = force[node].tolist()
        lines += [
            f"FORCE*  {set_number:16d}{node + 1:16d}{0:16d}{_real(1.0)}*",
            f"*       {_real(x)}{_real(y)}{_real(z)}",
        ]
    return "\n".join(lines) + "\n"


def case_control(names: Sequence[str]) -> str:
    """Return the case control of n load cases: subcase k takes load set k; strains are asked for at fibres."""
    lines = ["$ case control; the load sets stand in the files of the same names", "STRAIN(PLOT,FIBER) = ALL"]
    for number, name in enumerate(names, start=1):
        lines += [f"SUBCASE {number}", f"  LABEL = {name}", f"  LOAD = {number}"]
    return "\n".join(lines) + "\n"


def _real(value: float) -> str:
    """Return a number in a field of 16 columns, ten digits."""
    return f"{value:{FIELD}.9E}"


NASTRAN = "bdf"
FORMATS = ("csv", "vtu", NASTRAN)
NODES, TRIANGLES, GAUGES, STRAINS = "nodes.csv", "triangles.csv", "gauges.csv", "strains.csv"
GRIDS, CASES = "nodes.bdf", "case_control.bdf"
_GAUGE_COLUMNS = "column,name,layout,surface,length_mm,x_m,y_m,z_m,direction_x,direction_y,direction_z"


def export_loads(
    cases: LoadCases, layouts: Mapping[str, Gauges], in_use: str, folder: Path, file_format: str = "csv"
) -> list[Path]:
    """Write load cases, gauges and an empty table of strains into ``folder``.

    Every case is a file of the nodal forces [N] and the net pressure [Pa] at the nodes of ``nodes.csv``, numbered
    from 1, a .vtu of both, or FORCE cards for Nastran with files of its GRIDs and SUBCASEs. Forces are
    consistent with pressure linear over the triangles, so that they have the force and moment of the pressure.

    Parameters
    ----------
    cases : the load cases.
    layouts : gauges by name of layout; gauges of ``in_use`` go by their own names.
    in_use : the layout in use.
    folder : where the files go; it is made.
    file_format : one of :data:`FORMATS`.

    Returns
    -------
    The files written, the table of strains last.

    Raises
    ------
    InputError
        The format is none of these, or ``folder`` holds a table of strains already.
    StrainfmuError
        A file could not be written, or needs VTK and that is not installed.
    """
    if file_format not in FORMATS:
        raise InputError(f"--format: expected one of {', '.join(FORMATS)}, got '{file_format}'")
    table = folder / STRAINS
    if table.exists():
        raise InputError(
            f"{table}: expected a folder without it, it may hold strains; remove it or choose another"
        )
    folder.mkdir(parents=True, exist_ok=True)
    mesh, operator = cases.surface, nodal_force_operator(cases.surface)
    _write(folder / NODES, _numbers("node,x_m,y_m,z_m", mesh.point, numbered=True))
    _write(folder / TRIANGLES, _numbers("node_1,node_2,node_3", mesh.triangle + 1))
    files = [folder / NODES, folder / TRIANGLES]
    if file_format == NASTRAN:
        _write(folder / GRIDS, grid_cards(mesh.point))
        _write(folder / CASES, case_control(cases.names))
        files += [folder / GRIDS, folder / CASES]
    for number, (name, pressure) in enumerate(zip(cases.names, cases.pressure, strict=True), start=1):
        force = (operator @ pressure).reshape(-1, 3)
        files.append(folder / f"{name}.{file_format}")
        if file_format == NASTRAN:
            _write(files[-1], force_cards(number, name, force))
        elif file_format == "vtu":
            arrays = {f"force_{axis}_N": force[:, k] for k, axis in enumerate("xyz")}
            write_vtk(files[-1], mesh, {"pressure_Pa": pressure, **arrays})
        else:
            header = "node,force_x_N,force_y_N,force_z_N,pressure_Pa"
            _write(files[-1], _numbers(header, np.column_stack([force, pressure]), numbered=True))
    _write(folder / GAUGES, _gauge_table(layouts, in_use))
    _write(table, subcase_table(cases) if file_format == NASTRAN else strain_template(cases, layouts, in_use))
    return [*files, folder / GAUGES, table]


def strain_template(
    cases: LoadCases,
    layouts: Mapping[str, Gauges],
    in_use: str,
    strain: FloatArray | None = None,
    unit: str = "m/m",
) -> str:
    """Return the table of strains as CSV: a row per case; ``strain`` (n, all gauges) in ``unit``, else empty."""
    columns = [name for names in strain_columns(layouts, in_use).values() for name in names]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*FIRST_COLUMNS, *columns])
    for number, (name, load_id) in enumerate(zip(cases.names, cases.ids(), strict=True)):
        condition = cases.conditions[number] if number < len(cases.conditions) else None
        values = [""] * len(columns) if strain is None else [repr(float(value)) for value in strain[number]]
        writer.writerow([name, load_id, *condition_cells(condition), unit, *values])
    return text.getvalue()


def subcase_table(cases: LoadCases) -> str:
    """Return the table of load cases as CSV, a subcase instead of strains: these stay in Nastran's results."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*NEEDED_COLUMNS, *CONDITION_COLUMNS, SUBCASE_COLUMN])
    for number, (name, load_id) in enumerate(zip(cases.names, cases.ids(), strict=True)):
        condition = cases.conditions[number] if number < len(cases.conditions) else None
        writer.writerow([name, load_id, *condition_cells(condition), number + 1])
    return text.getvalue()


def condition_cells(condition: FlightCondition | None) -> list[str]:
    """Return a condition's cells of the table, empty for the uniform case."""
    if condition is None:
        return [""] * len(CONDITION_COLUMNS)
    values = (
        condition.mach_number,
        degrees(condition.angle_of_attack),
        degrees(condition.sideslip_angle),
        1e-3 * condition.altitude,
    )
    return [f"{value:.9g}" for value in values]


def _gauge_table(layouts: Mapping[str, Gauges], in_use: str) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_GAUGE_COLUMNS.split(","))
    for layout, columns in strain_columns(layouts, in_use).items():
        gauges = layouts[layout]
        unit = gauges.direction / np.linalg.norm(gauges.direction, axis=1, keepdims=True)
        for i, column in enumerate(columns):
            numbers = [1e3 * gauges.length[i], *gauges.position[i], *unit[i]]
            cells = [
                column,
                gauges.name[i],
                layout,
                gauges.surface[i],
                *(f"{float(number):.12g}" for number in numbers),
            ]
            writer.writerow(cells)
    return text.getvalue()


def _numbers(header: str, rows: FloatArray | IntArray, numbered: bool = False) -> str:
    text = io.StringIO()
    form = ["%d"] * rows.shape[1] if np.issubdtype(rows.dtype, np.integer) else ["%.12g"] * rows.shape[1]
    table = np.column_stack([np.arange(1, len(rows) + 1), rows]) if numbered else rows
    np.savetxt(text, table, ["%d", *form] if numbered else form, ",", header=header, comments="")
    return text.getvalue()


def _write(path: Path, text: str) -> None:
    write_bytes_atomically(path, text.encode("utf-8"))
