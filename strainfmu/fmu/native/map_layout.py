"""The layout of ``map.bin`` for C: ``python -m strainfmu.fmu.native.map_layout`` writes ``map_layout.h``.

A part is read into one structure or several. The header has each group of arrays as one macro: of it C makes the
members of a structure and the rows of the table by which ``map_read`` reads, checks and refuses them.
"""

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

from strainfmu.estimator.map.schema import Entry
from strainfmu.estimator.resource.map_file import LAYOUT
from strainfmu.estimator.signal_names import TARE
from strainfmu.files import write_bytes_atomically

HEADER = Path(__file__).parents[3] / "fmus" / "native" / "estimator" / "map" / "map_layout.h"


@dataclass(frozen=True)
class Length:
    """A length: ``symbol``, of ``array`` along ``axis``, from ``least`` to ``most``; ``member``: in C."""

    symbol: str
    array: str
    axis: int = 0
    least: str = "0"
    most: str = "4096"
    member: str = ""


@dataclass(frozen=True)
class Group:
    """Arrays of ``part`` in one structure: the arrays ``names``, or the rest."""

    macro: str
    part: str
    lengths: tuple[Length, ...] = ()
    names: tuple[str, ...] = ()


# fmt: off
GROUPS = (
    Group("LINEAR", "linear", (
        Length("n_gauges", "mean_strain", least="1"), Length("n_states", "state_operator"),
        Length("n_errors", "error_strain"))),
    Group("GAUGE_COVARIANCE", "linear", names=("gauge_covariance",)),
    Group("LOW_RANK", "low_rank"),
    Group("ZERO_OFFSETS", "settings", names=("zero_offset",)),
    Group("SETTINGS", "settings"),
    Group("ENVELOPE", "envelope", (
        Length("n_half_spaces", "limit", most="65536"), Length("n_layers", "layers", least="1"))),
    Group("SCALED", "scaled"),
    Group("SPREAD", "scaled", names=("spread", "spread_load", "spread_unseen")),
    Group("SCALED_ERRORS", "scaled_errors", (Length("n_terms", "common"),)),
    Group("ANGLES", "angles"),
    Group("THERMAL", "thermal", (
        Length("n_modes", "prior_std", least="1"), Length("n_sensors", "sensor_std"),
        Length("n_powers", "apparent_strain"))),
    Group("INERTIA", "inertia"),
    Group("VEHICLE", "vehicle"),
    Group("PARAMETERS", "parameters", (
        Length("n_parameters", "minimum", least="1", most="64", member="count"),)),
    Group("SENSORS", "sensors", (Length("n_others", "scale", most="n_gauges-1", member="count"),)),
    Group("OTHER_LOADS", "other_loads", (
        Length("n_loads", "is_moment", least="1"), Length("n_arrays", "array_size", least="1"))),
    Group("FILTER", "filter"),
    Group("KNOTS", "flight", (
        Length("n_mach", "mach_knots", least="2"), Length("n_incidence", "incidence_knots", least="2")),
        names=("min_incidence", "mach_knots", "incidence_knots")),
    Group("TABLES", "considered", (
        Length("n_channels", "table", axis=2, least="1", most="2*n_rows"),
        Length("n_harmonics", "table", axis=3, least="1"),
        Length("n_terms", "row", least="n_rows", most="2*n_rows"))),
    Group("FLIGHT", "flight", (
        Length("n_common", "common_error"), Length("n_shapes", "shapes", most="16"),
        Length("n_considered_common", "considered_common"))),
    Group("FLIGHT_LOADS", "flight_loads"),
    Group("PRODUCTS", "parameter_tables", names=("product",)),
    Group("PARAMETER_TABLES", "parameter_tables", (
        Length("n_parameters", "mean", least="1", most="64"), Length("n_powers", "power", most="3*n_parameters"),
        Length("n_basis", "basis", most="65536"))),
    Group("TARE", TARE, (Length("n_patterns", "pattern", least="1", most="n_strains"),)),
)
# fmt: on
"""Groups in the order in which C reads them; arrays of tables are named once, by the part "considered"."""

_OPENING = """\
/* The arrays of map.bin, one a line: kind, member of the structure T of its group, name, what its values must be,
   rank, smallest and largest number, symbol that a length binds, shape or bounds of a length; meaning.

   Written by python -m strainfmu.fmu.native.map_layout, of the schema of a map: do not edit. map.h
   makes members of structures and rows of tables of it; map_read reads, checks and refuses by these. */

#ifndef MAP_LAYOUT_H
#define MAP_LAYOUT_H"""

_LIMITS = {sys.float_info.max: "DBL_MAX", sys.float_info.min: "DBL_MIN"}

TERM = re.compile(r"(?:(\d+)\*)?([a-z]\w*)([+-]\d+)?")


def header() -> str:
    """Return the content of ``map_layout.h``."""
    groups = [(group, _arrays_of(group)) for group in GROUPS]
    symbols = ", ".join(["SYM_NONE", *(f"SYM_{_name(symbol)}" for symbol in _symbols(groups)), "N_SYMBOLS"])
    lines = [
        *_OPENING.splitlines(),
        "",
        "enum {",
        *wrap(symbols, 120, initial_indent=" " * 4, subsequent_indent=" " * 4),
        "};",
        "",
    ]
    for group, arrays in groups:
        rows = [*map(_length_row, group.lengths), *map(_row, arrays)]
        lines += [
            f"#define {group.macro}(X, T) \\",
            *(f"    {row} \\" for row in rows[:-1]),
            f"    {rows[-1]}",
            "",
        ]
    return "\n".join([*lines, "#endif", ""])


def _arrays_of(group: Group) -> list[Entry]:
    named = {name for sibling in GROUPS if sibling.part == group.part for name in sibling.names}
    shared = {"table", "row", "channel", "cosine", "sine", "fixed_response"}
    arrays = [array for array in LAYOUT if array.part == group.part]
    if group.names:
        return [array for array in arrays if array.name in group.names]
    leave = named if group.macro == "TABLES" else named | shared
    return [array for array in arrays if array.name not in leave]


def _symbols(groups: list[tuple[Group, list[Entry]]]) -> list[str]:
    symbols = dict[str, None]()
    for group, arrays in groups:
        axes = [axis for array in arrays for axis in array.shape.split()]
        axes += [length.symbol for length in group.lengths]
        for axis in axes:
            match = TERM.fullmatch(axis)
            if match is not None:
                symbols[match[2]] = None
    return [*symbols]


def _name(symbol: str) -> str:
    return symbol.removeprefix("n_").upper()


def _size(text: str) -> str:
    """Return a length in symbols as C has it."""
    match = TERM.fullmatch(text)
    if match is None:
        return f"FIXED({text})"
    times, symbol, plus = match.groups()
    return f"AXIS({_name(symbol)}, {times or 1}, {int(plus or 0)})"


def _length_row(length: Length) -> str:
    bounds = f"SYM_{_name(length.symbol)}, {_size(length.least)}, {_size(length.most)}"
    return f"X(T, LENGTH, {length.member or length.symbol}, {length.array}, ANY, {length.axis}, 0, 0, {bounds})"


def _row(array: Entry) -> str:
    axes = array.shape.split()
    kind, rule = array.kind.upper(), array.rule
    if kind == "VALUES":
        kind += f"_{axes[0]}"
    low, high = array.low, array.high
    if kind == "NUMBER" and low is not None:
        rule = "BETWEEN"
    if isinstance(high, str):
        axes, high = [high], None
    numbers = ["0" if bound is None else _LIMITS.get(bound, f"{bound:g}") for bound in (low, high)]
    if rule == "BETWEEN" and high is None:
        numbers[1] = "DBL_MAX"
    shape = ", ".join(_size(axis) for axis in axes) or "FIXED(0)"
    rank = 0 if kind in ("WHOLE", "COUNT") else len(axes)
    values = ", ".join([rule, str(rank), *numbers, "SYM_NONE", shape])
    row = f"X(T, {kind}, {array.member or array.name}, {array.name}, {values})"
    unit = f" [{array.unit}]" if array.unit not in ("", "1") else ""
    meaning = re.split("; |: |, for ", array.meaning)[0]
    return f"{row} /* {meaning}{unit} */"


if __name__ == "__main__":
    write_bytes_atomically(HEADER, header().encode())
