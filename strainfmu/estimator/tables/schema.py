"""The schema of a map: each array stands once, with shape, unit, meaning, neutral value and place in ``map.bin``.

A field of a record of a map is an :func:`entry`. What reads, writes and checks maps, what fills in data that a map
does not have, the page of files, ``map.bin`` and the header of its layout follow from the entries.

Shapes are symbols, such as ``n_d n_q``; ``n_M+2`` is a symbol and a number. An array of ``map.bin`` is the entry's
transpose where its stored shape names the axes in the reverse order; it has the first five of n_f loads where it
names 5, the strain gauges of n_d rows where it names n_strains, and the rows after them where it names n_others.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from strainfmu.errors import InputError
from strainfmu.records import OPTIONAL, brief

Record = TypeVar("Record")
Sizes = dict[str, int]
"""Lengths by symbol."""

ANY, POSITIVE, COVARIANCE, FROM_0, INCREASING, RANGE = (
    "ANY",
    "POSITIVE",
    "COVARIANCE",
    "FROM_0",
    "INCREASING",
    "RANGE",
)
"""What the values of an array of map.bin must be, besides finite."""


@dataclass(frozen=True, kw_only=True)
class Stored:
    """An array of ``map.bin``.

    Attributes
    ----------
    place : PART.NAME.
    shape : in symbols; of a text its last length is the number of bytes.
    unit, meaning : of the values.
    rule : one of the rules above.
    kind : ``number``, ``whole`` number, ``count`` (unsigned), ``values`` (a few, copied), ``array`` or ``text``.
    low, high : of a number; of a whole number also a symbol.
    member : name in C, if another one.
    value : gives it of the source of all values.
    """

    place: str
    shape: str = ""
    unit: str = "1"
    meaning: str = ""
    rule: str = ANY
    kind: str = "number"
    low: float | None = None
    high: float | str | None = None
    member: str = ""
    value: Callable[[Any], Any] = lambda source: None

    @property
    def part(self) -> str:
        """The part of ``map.bin``."""
        return self.place.partition(".")[0]

    @property
    def name(self) -> str:
        """The name in its part."""
        return self.place.partition(".")[2]


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A field of a record of a map: shape, unit and meaning, its neutral value, and its array in ``map.bin``."""

    shape: str
    unit: str
    meaning: str
    neutral: Any
    dtype: Any
    is_range: bool
    stored: Stored | None


def entry(
    shape: str = "",
    unit: str = "1",
    meaning: str = "",
    *,
    neutral: Any = MISSING,
    default: Any = MISSING,
    dtype: Any = float,
    is_range: bool = False,
    record: type[Any] | None = None,
    place: str = "",
    stored: str | None = None,
    **rules: Any,
) -> Any:
    """Return the field of an array, number, text or record of a map.

    Parameters
    ----------
    neutral : number, or function of the map, that stands where a map does not have the data; a file leaves it out.
    default : of a field that a caller may leave out; None also where there is no such array.
    is_range : whether -inf to inf stands for no bounds.
    record : type of a record inside.
    place, stored, rules : array of ``map.bin`` and its shape there, the field's if None; see :class:`Stored`.
    """
    array = None
    if place:
        own = shape if stored is None else stored
        kind = "number" if not own else "array"
        array = Stored(**{"place": place, "shape": own, "unit": unit, "meaning": meaning, "kind": kind} | rules)
    stated = Entry(
        shape=shape, unit=unit, meaning=meaning, neutral=neutral, dtype=dtype, is_range=is_range, stored=array
    )
    metadata: dict[str, Any] = {"entry": stated, "unit": unit} | (
        {"record": record, "units": {}} if record else {}
    )
    metadata |= OPTIONAL if neutral is not MISSING else {}
    if neutral is not MISSING and default is MISSING:
        default = np.zeros(0, dtype=dtype)
    if default is MISSING or isinstance(default, int | float | str | None):
        return field(default=default, metadata=metadata)
    return field(default_factory=lambda: default, metadata=metadata)


def derived(
    place: str,
    meaning: str,
    value: Callable[[Any], Any],
    shape: str = "",
    *,
    unit: str = "1",
    rule: str = ANY,
    kind: str = "",
    whole: tuple[int, int | str] | None = None,
    bounds: tuple[float, float] | None = None,
    member: str = "",
) -> Stored:
    """Return an array of ``map.bin`` that follows from a map.

    ``whole`` bounds a whole number, by numbers or a symbol, ``bounds`` any number; the rest as of :class:`Stored`.
    """
    low, high = whole or bounds or (None, None)
    kind = kind or ("whole" if whole else "array" if shape else "number")
    return Stored(
        place=place,
        shape=shape,
        unit=unit,
        meaning=meaning,
        rule=rule,
        kind=kind,
        low=low,
        high=high,
        member=member,
        value=value,
    )


def entries(record: Any) -> dict[str, Entry]:
    """Return the entries of a record, or of its type, by field."""
    return {one.name: one.metadata["entry"] for one in fields(record) if "entry" in one.metadata}


def records_of(record: Any, group: str = "") -> dict[str, type[Any]]:
    """Return the types of records inside a type of records, by the path of their group; equal ones once."""
    inside = dict[str, type[Any]]()
    for one in fields(record):
        kind = one.metadata.get("record")
        if kind is not None and kind not in inside.values():
            inside[group + one.name] = kind
            inside |= records_of(kind, f"{group}{one.name}/")
    return inside


def described(record: type[Record]) -> type[Record]:
    """Add the attributes to the description of a type of records, and a text of few lines."""
    lines = [f"{name} : {_in_words(one)}" for name, one in entries(record).items() if one.meaning]
    record.__doc__ = f"{record.__doc__}\n\n    Attributes\n    ----------\n    " + "\n    ".join(lines) + "\n"
    record.__repr__ = brief  # type: ignore[method-assign]
    return record


def _in_words(one: Entry) -> str:
    shape = f"({', '.join(one.shape.split())}{',' if len(one.shape.split()) == 1 else ''}) " if one.shape else ""
    return f"{shape}{one.meaning}" + (f" [{one.unit}]" if one.unit else "")


def lengths(shape: str, sizes: Mapping[str, int]) -> tuple[int | None, ...]:
    """Return the lengths of ``shape`` in symbols, None where ``sizes`` does not have one."""
    return tuple(_length(axis, sizes) for axis in shape.split())


def _length(axis: str, sizes: Mapping[str, int]) -> int | None:
    total = 0
    for term in axis.split("+"):
        known = int(term) if term.isdigit() else sizes.get(term)
        if known is None:
            return None
        total += known
    return total


def check(record: Any, where: str, **sizes: int) -> Sizes:
    """Check that arrays of ``record`` have their shapes, and finite values but in ranges; return ``sizes``.

    A symbol that is not known gets the length of the first array that has it.

    Raises
    ------
    InputError
        An array has another shape than the symbols have, or values that are not finite.
    """
    for name, one in entries(record).items():
        value = getattr(record, name)
        if not one.shape or value is None:
            continue
        is_names = isinstance(value, tuple)
        shape = (len(value),) if is_names else np.shape(value)
        axes = one.shape.split()
        if len(axes) == len(shape):
            for axis, length in zip(axes, shape, strict=True):
                symbol, _, more = axis.partition("+")
                if symbol not in sizes and symbol != "." and re.fullmatch(r"\d*", more) and not symbol.isdigit():
                    sizes[symbol] = length - int(more or 0)
        wanted = lengths(one.shape, sizes)
        if len(wanted) != len(shape) or any(k not in (None, j) for k, j in zip(wanted, shape, strict=True)):
            expected = ", ".join("any" if k is None else str(k) for k in wanted) + (
                "," if len(wanted) == 1 else ""
            )
            raise InputError(f"{where}: {name} has shape {shape}, must be ({expected})")
        has_no_bounds = one.is_range and np.asarray(value).tolist() == [-np.inf, np.inf]
        if not (is_names or has_no_bounds or np.all(np.isfinite(value))):
            raise InputError(f"{where}: {name} holds values that are not finite")
    return sizes


def neutral_value(record: Any, name: str, sizes: Mapping[str, int]) -> Any:
    """Return the value of the field ``name`` that stands for data that ``record`` does not have."""
    one = entries(record)[name]
    if callable(one.neutral):
        return one.neutral(record)
    if not one.shape:
        return one.neutral
    if one.is_range:
        return np.array([-np.inf, np.inf])
    shape = tuple(k or 0 for k in lengths(one.shape, sizes))
    return np.full(shape, one.neutral, dtype=one.dtype)


def neutral_names(record: Any) -> tuple[str, ...]:
    """Return the names of the fields of a record, or of its type, that may be left out."""
    return tuple(name for name, one in entries(record).items() if one.neutral is not MISSING)


def has_no_values(value: Any) -> bool:
    """Tell whether an array, or a record by its property ``is_empty``, is without values."""
    return bool(getattr(value, "is_empty", np.size(value) == 0))


def equal(first: Any, second: Any) -> bool:
    """Tell whether two arrays, or records of arrays, are equal."""
    if is_dataclass(first):
        return all(equal(getattr(first, one.name), getattr(second, one.name)) for one in fields(first))
    return bool(np.array_equal(first, second))


def stored_arrays(record: type[Any]) -> Iterator[tuple[str, Entry, Stored]]:
    """Return field, entry and array of ``map.bin`` of each entry that has one."""
    for name, one in entries(record).items():
        if one.stored is not None:
            yield name, one, one.stored


def stored_value(value: Any, shape: str, stored: str, n_strains: int) -> Any:
    """Return ``value`` of ``shape`` as ``map.bin`` has it, of the shape ``stored``."""
    axes, after = shape.split(), stored.split()
    if len(axes) != len(after) or not axes:
        return value
    parts = {"5": slice(5), "n_strains": slice(n_strains), "n_others": slice(n_strains, None)}
    turned = after != axes and [_base(axis) for axis in after] == [_base(axis) for axis in reversed(axes)]
    turned = turned and [_base(axis) for axis in after] != [_base(axis) for axis in axes]
    whole = np.transpose(value) if turned else np.asarray(value)
    old = list(reversed(axes)) if turned else axes
    return whole[
        tuple(
            parts.get(new, slice(None)) if new != one else slice(None) for one, new in zip(old, after, strict=True)
        )
    ]


def _base(axis: str) -> str:
    return {"5": "n_f", "n_strains": "n_d", "n_others": "n_d"}.get(axis, axis)
