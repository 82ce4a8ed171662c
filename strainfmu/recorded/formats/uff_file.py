"""Universal files (UFF, .uff, .unv, .uf58) of test halls: data sets 58 and 58b of time, read with pyuff.

Source: Structural Dynamics Research Laboratory, University of Cincinnati, Universal File Formats for Modal
Analysis Testing, data set 58, function at nodal degree of freedom.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, unique_names

_OF_TIME = (0, 1)
"""Types of functions that are series over time: general or unknown, time response."""

_REAL = (2, 4)
"""Types of ordinate that are real numbers, of single and double precision."""

_TIME_AXIS = (0, 17)
"""Types of abscissa: unknown, time."""

_DIRECTIONS = {1: "+X", -1: "-X", 2: "+Y", -2: "-Y", 3: "+Z", -3: "-Z"}


@contextmanager
def uff_channels(path: Path, reading: Reading) -> Iterator[ChannelFile]:
    """Open a universal file; a channel is a data set of time, its name the first line of identification.

    Where data sets have that line in common, or none, the name is the degree of freedom: entity, node, direction.
    """
    held = _sets(path)
    series = [one for one in held if _is_series(one)]
    if not series:
        raise InputError(f"{path}: no series over time found, expected data sets 58 of real numbers over time")
    channels = dict(zip(unique_names(path, _names(series)), series, strict=True))
    left_out = len(held) - len(series)
    for name, one in channels.items():
        found, stated = len(one["data"]), int(one["num_pts"])
        if found != stated:
            raise InputError(f"{path}: channel '{name}': damaged, {found} of {stated} values found")
    units = {name: _text(one.get("ordinate_axis_units_lab")) for name, one in channels.items()}
    yield ChannelFile(
        path=path,
        names=tuple(channels),
        units={name: unit for name, unit in units.items() if unit},
        values=lambda name: np.asarray(channels[name]["data"]),
        clock=lambda name: np.asarray(channels[name]["x"], dtype=float),
        remarks=[f"{path}: {left_out} data sets that are no series over time are not read"] if left_out else [],
    )


def _sets(path: Path) -> list[dict[str, Any]]:
    """Return the data sets of a file as pyuff has them.

    Raises
    ------
    InputError
        The file is damaged.
    StrainfmuError
        pyuff is not installed.
    """
    try:
        import pyuff
    except ImportError as error:
        raise StrainfmuError("pyuff is not installed: pip install 'strainfmu[uff]'") from error
    try:
        file = pyuff.UFF(str(path))
        kinds = [int(kind) for kind in np.atleast_1d(file.get_set_types())]
        sets = [file.read_sets(k) if kind == 58 else {} for k, kind in enumerate(kinds)]
    except Exception as error:  # pyuff raises whatever its parsers do
        raise InputError(f"{path}: damaged, or not a universal file") from error
    if not sets:
        raise InputError(f"{path}: damaged, or not a universal file: no data set found")
    return sets


def _is_series(one: dict[str, Any]) -> bool:
    return (
        one.get("func_type") in _OF_TIME
        and one.get("ord_data_type") in _REAL
        and one.get("abscissa_spec_data_type", 0) in _TIME_AXIS
    )


def _names(series: Sequence[dict[str, Any]]) -> list[str]:
    """Return the names of the channels: lines of identification, if each has its own, or degrees of freedom."""
    stated = [_text(one.get("id1")) for one in series]
    if all(stated) and len(set(stated)) == len(stated):
        return stated
    return [_degree_of_freedom(one) for one in series]


def _degree_of_freedom(one: dict[str, Any]) -> str:
    entity, node = _text(one.get("rsp_ent_name")), int(one.get("rsp_node", 0))
    return f"{f'{entity}:' if entity else ''}{node}{_DIRECTIONS.get(int(one.get('rsp_dir', 0)), '')}"


def _text(value: Any) -> str:
    """Return a text of the file, "" where it states none."""
    found = str(value or "").strip()
    return "" if found.upper() == "NONE" else found
