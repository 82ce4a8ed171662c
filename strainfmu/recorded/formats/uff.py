"""Universal files (UFF, .uff, .unv, .uf58) of test halls: data sets 58 and 58b of time, read with pyuff.

Source: Structural Dynamics Research Laboratory, University of Cincinnati, Universal File Formats for Modal
Analysis Testing, data set 58, function at nodal degree of freedom.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.errors import InputError, library
from strainfmu.recorded.table import Column, Reading, Table, table_of

_OF_TIME = (0, 1)
"""Types of functions that are series over time: general or unknown, time response."""

_REAL = (2, 4)
"""Types of ordinate that are real numbers, of single and double precision."""

_TIME_AXIS = (0, 17)
"""Types of abscissa: unknown, time."""

_DIRECTIONS = {1: "+X", -1: "-X", 2: "+Y", -2: "-Y", 3: "+Z", -3: "-Z"}


def uff_table(path: Path, reading: Reading, stack: ExitStack) -> Table:
    """Open a universal file; a column is a data set of time, its name the first line of identification.

    Where data sets have that line in common, or none, the name is the degree of freedom: entity, node, direction.
    """
    pyuff = library("pyuff", "pyuff", "uff")
    file = pyuff.UFF(str(path))
    kinds = [int(kind) for kind in np.atleast_1d(file.get_set_types())]
    sets = [file.read_sets(k) if kind == 58 else {} for k, kind in enumerate(kinds)]
    if not sets:
        raise InputError(f"{path}: damaged, or not a universal file: no data set found")
    series = [data for data in sets if _is_series(data)]
    if not series:
        raise InputError(f"{path}: no series over time found, expected data sets 58 of real numbers over time")
    columns = []
    for name, data in zip(_names(series), series, strict=True):
        values, time, stated = np.asarray(data["data"]), np.asarray(data["x"], dtype=float), int(data["num_pts"])
        if len(values) != stated:
            raise InputError(f"{path}: column '{name}': damaged, {len(values)} of {stated} values found")
        unit, clock = _text(data.get("ordinate_axis_units_lab")) or None, (time.tobytes(), time.__getitem__)
        columns.append(Column(name=name, unit=unit, rows=stated, read=values.__getitem__, clock=clock))
    more = len(sets) - len(series)
    remarks = [f"{path}: {more} data sets that are no series over time are not read"] if more else []
    return table_of(path, columns, reading, remarks)


def _is_series(data: dict[str, Any]) -> bool:
    return (
        data.get("func_type") in _OF_TIME
        and data.get("ord_data_type") in _REAL
        and data.get("abscissa_spec_data_type", 0) in _TIME_AXIS
    )


def _names(series: Sequence[dict[str, Any]]) -> list[str]:
    """Return the names of the columns: lines of identification, if each has its own, or degrees of freedom."""
    stated = [_text(data.get("id1")) for data in series]
    if all(stated) and len(set(stated)) == len(stated):
        return stated
    names = []
    for data in series:
        entity, node = _text(data.get("rsp_ent_name")), int(data.get("rsp_node", 0))
        direction = _DIRECTIONS.get(int(data.get("rsp_dir", 0)), "")
        names.append(f"{entity}:{node}{direction}" if entity else f"{node}{direction}")
    return names


def _text(value: Any) -> str:
    """Return a text of the file, "" where it states none."""
    text = str(value or "").strip()
    return "" if text.upper() == "NONE" else text
