"""The schema of a map: each array stands once, with shape, unit, meaning, allowed values and place in ``map.bin``.

A field of a record of a map is an :func:`entry`. What reads, writes, checks and shows maps, what fills in data
that a map does not have, the page of files, ``map.bin`` and the header of its layout follow from the entries.

Shapes are symbols, such as ``n_d n_q``; ``n_M+2`` is a symbol and a number. An array of ``map.bin`` is the entry's
transpose where its stored shape names the axes in the reverse order; it has the first five of n_f loads where it
names 5, the strain gauges of n_d rows where it names n_strains, and the rows after them where it names n_others.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import KW_ONLY, MISSING, Field, dataclass, field, fields, is_dataclass
from typing import Any, ClassVar

import numpy as np

from strainfmu.arrays import FloatArray, is_covariance
from strainfmu.errors import InputError
from strainfmu.records import OPTIONAL, brief

Sizes = dict[str, int]
"""Lengths by symbol."""

ANY, POSITIVE, COVARIANCE, FROM_0 = "ANY", "POSITIVE", "COVARIANCE", "FROM_0"
INCREASING, RANGE, BOUNDS = "INCREASING", "RANGE", "BOUNDS"
UNIQUE, UNIT_VECTORS = "UNIQUE", "UNIT_VECTORS"
"""What the values of an array must be, besides finite."""

NO_BOUNDS = (-np.inf, np.inf)
"""Bounds of a quantity without limits."""

_RULES: dict[str, tuple[Callable[[Any], Any], str]] = {
    POSITIVE: (lambda value: np.all((value > 0.0) & (value < np.inf)), "positive"),
    FROM_0: (lambda value: np.all(value >= 0.0), "at least 0"),
    INCREASING: (lambda value: np.all(np.diff(value) > 0.0), "increasing"),
    RANGE: (lambda value: 0.0 < value[0] <= value[1], "a range above 0"),
    COVARIANCE: (is_covariance, "symmetric and positive definite"),
    UNIQUE: (
        lambda names: names and all(names) and len({*names}) == len(names),
        "at least one name and none twice",
    ),
    UNIT_VECTORS: (lambda value: np.all(np.abs(np.linalg.norm(value, axis=1) - 1.0) <= 1e-9), "unit vectors"),
}
"""What each rule asks, and its words."""

SHARED = ("n_d", "n_f", "n_aux", "n_M", "n_a", "n", "n_v", "J")
"""Symbols that mean the same in a record and in the records inside it."""


@dataclass(frozen=True)
class Entry:
    """A field of a record of a map, an array of ``map.bin``, or both.

    Attributes
    ----------
    place : PART.NAME in ``map.bin``; "" for none.
    meaning : of the values.
    value : of an array that is no field: the values, or a function that gives them of the source of all values.
    shape : in symbols; of a text its last length is the number of bytes.
    unit : of the values.
    rule : one of the rules above.
    kind : ``number``, ``whole`` number, ``count`` (unsigned), ``values`` (a few, copied), ``array`` or ``text``;
        by the shape a number or an array if empty.
    low, high : smallest and largest number; of a whole number also a symbol.
    member : name in C, if another one.
    stored : shape in ``map.bin``, if another one.
    neutral : number, or function of the map, that stands where a map does not have the data; a file leaves it out.
    group : name of the entries of which a map has all or none.
    dtype : of an array.
    allowed : what a number or texts must be one of.
    """

    place: str
    meaning: str
    value: Any = None
    shape: str = ""
    _: KW_ONLY
    unit: str = "1"
    rule: str = ANY
    kind: str = ""
    low: float | None = None
    high: float | str | None = None
    member: str = ""
    stored: str = ""
    neutral: Any = None
    group: str = ""
    dtype: Any = float
    allowed: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", self.kind or ("array" if self.shape else "number"))

    @property
    def part(self) -> str:
        """The part of ``map.bin``."""
        return self.place.partition(".")[0]

    @property
    def name(self) -> str:
        """The name in its part."""
        return self.place.partition(".")[2]

    @property
    def axes(self) -> list[str]:
        """The lengths of the shape."""
        return self.shape.split()


def entry(
    shape: str = "",
    unit: str = "1",
    meaning: str = "",
    *,
    place: str = "",
    default: Any = MISSING,
    record: type[Any] | None = None,
    **about: Any,
) -> Any:
    """Return the field of an array, number, text or ``record`` of a map; other arguments are fields of its entry.

    ``default`` is of a field that a caller may leave out; None also where there is no such array.
    """
    stated = Entry(place, meaning, shape=shape, unit=unit, **about)
    metadata = {"entry": stated, "unit": unit} | ({"record": record, "units": {}} if record else {})
    if stated.neutral is not None:
        metadata |= OPTIONAL
        default = None if default is MISSING else default
    if isinstance(default, np.ndarray):
        return field(default_factory=lambda: default, metadata=metadata)
    return field(default=default, metadata=metadata)


class MapRecord:
    """A record of a map, a dataclass of entries: filled in and checked as it is made, shown in few lines.

    A class adds its entries to its description. ``where`` is what messages call it.
    """

    where: ClassVar[str]

    def __init_subclass__(cls, where: str) -> None:
        stated = {name: item.metadata["entry"] for name, item in vars(cls).items() if _is_entry(item)}
        lines = [f"{name} : {_in_words(item)}" for name, item in stated.items() if item.meaning]
        cls.where = where
        cls.__doc__ = f"{cls.__doc__}\n\n    Attributes\n    ----------\n    " + "\n    ".join(lines) + "\n"

    def __post_init__(self) -> None:
        check(self)
        for wrong in self.contradictions():
            raise InputError(f"{self.where}: {wrong}")

    __repr__ = brief

    def sizes(self) -> Sizes:
        """Return lengths that the first array with the symbol does not give."""
        return {}

    def contradictions(self) -> Iterator[str]:
        """Yield what is wrong between entries, each of which is right by itself, and what is allowed."""
        yield from ()


def _is_entry(item: Any) -> bool:
    return isinstance(item, Field) and "entry" in item.metadata


def entries(record: Any) -> dict[str, Entry]:
    """Return the entries of a record, or of its type, by field."""
    return {item.name: item.metadata["entry"] for item in fields(record) if _is_entry(item)}


def _in_words(stated: Entry) -> str:
    shape = f"({', '.join(stated.axes)}{',' if len(stated.axes) == 1 else ''}) " if stated.axes else ""
    return f"{shape}{stated.meaning}" + (f" [{stated.unit}]" if stated.unit else "")


def _length(axis: str, sizes: Mapping[str, int]) -> int | None:
    terms = [int(term) if term.isdigit() else sizes.get(term) for term in axis.split("+")]
    # mypy does not follow that no term is None here.
    return None if None in terms else sum(terms)  # type: ignore[arg-type]


def check(record: MapRecord) -> None:
    """Fill in neutral values, and check shapes, also of records inside, and values against the schema.

    A symbol that is not known gets the length of the first array that has it.

    Raises
    ------
    InputError
        An array has another shape than the symbols have, or values that are not allowed.
    """
    stated_entries, sizes = entries(record), record.sizes()
    for group in {item.group for item in stated_entries.values()} - {""}:
        names = [name for name, item in stated_entries.items() if item.group == group]
        given = [name for name in names if np.shape(getattr(record, name)) not in ((), (0,))]
        if given and len(given) < len(names):
            raise InputError(
                f"{record.where}: {', '.join(given)} of {', '.join(names)} found, must be all or none"
            )
    _fill(record, sizes, are_arrays=True)
    _check_shapes(record, record.where, sizes)
    for name, stated in stated_entries.items():
        value = getattr(record, name)
        if value is not None and not is_dataclass(value):
            _check_values(f"{record.where}: {name}", stated, value)
    _fill(record, sizes, are_arrays=False)


def _fill(record: MapRecord, sizes: Sizes, are_arrays: bool) -> None:
    for name, stated in _optional(record).items():
        if bool(stated.shape) == are_arrays and has_no_values(getattr(record, name)):
            object.__setattr__(record, name, neutral_value(record, name, sizes))


def _check_shapes(record: MapRecord, where: str, sizes: Sizes) -> None:
    for name, stated in entries(record).items():
        value = getattr(record, name)
        if isinstance(value, MapRecord) and not (has_no_values(value) and stated.neutral is not None):
            inner = {symbol: sizes[symbol] for symbol in SHARED if symbol in sizes}
            _check_shapes(value, f"{where}: {name}", inner)
            sizes |= {symbol: inner[symbol] for symbol in SHARED if symbol in inner}
        if not stated.shape or value is None:
            continue
        shape, axes = (len(value),) if isinstance(value, tuple) else np.shape(value), stated.axes
        for axis, length in zip(axes, shape, strict=False):
            symbol, _, more = axis.partition("+")
            if len(axes) == len(shape) and not symbol.isdigit() and re.fullmatch(r"\d*", more):
                sizes.setdefault(symbol, length - int(more or 0))
        wanted = tuple(_length(axis, sizes) for axis in axes)
        if len(wanted) != len(shape) or any(k not in (None, j) for k, j in zip(wanted, shape, strict=True)):
            expected = ", ".join("any" if k is None else str(k) for k in wanted) + "," * (len(wanted) == 1)
            raise InputError(f"{where}: {name} has shape {shape}, must be ({expected})")


def _check_values(where: str, stated: Entry, value: Any) -> None:
    if stated.allowed:
        wrong = [item for item in (value if isinstance(value, tuple) else (value,)) if item not in stated.allowed]
        if wrong:
            raise InputError(f"{where} is {wrong[0]!r}, must be one of {', '.join(map(str, stated.allowed))}")
    is_text, has_no_bounds = isinstance(value, str | tuple), stated.rule == BOUNDS and tuple(value) == NO_BOUNDS
    if stated.shape and not (is_text or has_no_bounds or np.all(np.isfinite(value))):
        raise InputError(f"{where} holds values that are not finite")
    is_allowed, words = _RULES.get(stated.rule, (lambda value: True, ""))
    if not is_allowed(value):
        raise InputError(f"{where}{'' if stated.shape else f' is {value:g},'} must be {words}")
    low, high = stated.low, stated.high
    if not stated.shape and low is not None and not low <= value <= (np.inf if high is None else high):
        words = f"at least {low:g}" if high is None else f"{low:g} to {high:g}"
        raise InputError(f"{where} is {value:g}, must be {words}")


def _optional(record: MapRecord) -> dict[str, Entry]:
    return {name: stated for name, stated in entries(record).items() if stated.neutral is not None}


def neutral_value(record: MapRecord, name: str, sizes: Mapping[str, int]) -> Any:
    """Return the value of the field ``name`` that stands for data that ``record`` does not have."""
    stated = entries(record)[name]
    if not stated.shape:
        return stated.neutral(record) if callable(stated.neutral) else stated.neutral
    return np.full([_length(axis, sizes) or 0 for axis in stated.axes], stated.neutral, dtype=stated.dtype)


def left_out(record: MapRecord) -> list[str]:
    """Return the names of the fields of ``record`` that hold neutral values, which a file leaves out."""
    stated, sizes, neutral = _optional(record), record.sizes(), list[str]()
    for name in stated:
        value = getattr(record, name)
        if has_no_values(value) or equal(value, neutral_value(record, name, sizes)):
            neutral.append(name)
    present = {item.group for name, item in stated.items() if name not in neutral} - {""}
    return [name for name in neutral if stated[name].group not in present]


def has_no_values(value: Any) -> bool:
    """Tell whether an array, or a record by its property ``is_empty``, is None or without values."""
    return value is None or bool(getattr(value, "is_empty", np.size(value) == 0))


def equal(first: Any, second: Any) -> bool:
    """Tell whether two arrays, or records of arrays, are equal."""
    if is_dataclass(first):
        return all(equal(getattr(first, item.name), getattr(second, item.name)) for item in fields(first))
    return bool(np.array_equal(first, second))


def stored_value(value: Any, stated: Entry, n_strains: int) -> FloatArray:
    """Return ``value`` of the field ``stated`` as ``map.bin`` has it."""
    array, axes = np.asarray(value, dtype=int if stated.kind == "whole" else float), stated.axes
    rows = {"5": slice(5), "n_strains": slice(n_strains), "n_others": slice(n_strains, None)}
    of_rows = {"5": "n_f", "n_strains": "n_d", "n_others": "n_d"}
    stored = stated.stored.split()
    if len(stored) == 2 and of_rows.get(stored[0], stored[0]) != axes[0]:
        array = array.T
    return np.asarray(array[tuple(rows.get(axis, slice(None)) for axis in stored)])
